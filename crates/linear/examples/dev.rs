//! dev
use std::time::Instant;
use viscera_linear::{BlockMatrix, Multigrid, conjugate_gradients as cg};

struct Op<'a> { n: usize, pairs: &'a [(u32, u32)], values: &'a [f64], held: &'a [bool] }
impl cg::Operator for Op<'_> {
    fn n(&self) -> usize { self.n }
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (&(r, c), b) in self.pairs.iter().zip(self.values.chunks_exact(9)) {
            let (r, c) = (3 * r as usize, 3 * c as usize);
            for i in 0..3 { for k in 0..3 {
                y[r + i] += b[3 * i + k] * x[c + k];
                if r != c { y[c + k] += b[3 * i + k] * x[r + i]; }
            } }
        }
        y.iter_mut().zip(self.held).for_each(|(y, h)| if *h { *y = 0.0 });
    }
}
fn main() {
    for path in std::env::args().skip(1) {
        let bytes = std::fs::read(&path).unwrap();
        let f: Vec<f64> = bytes.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
        let (n, nb) = (f[0] as usize, f[1] as usize);
        let mut at = 2;
        let mut take = |k: usize| { let s = f[at..at + k].to_vec(); at += k; s };
        let points: Vec<[f64; 3]> = take(3 * n).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let pairs: Vec<(u32, u32)> = take(2 * nb).chunks_exact(2).map(|p| (p[0] as u32, p[1] as u32)).collect();
        let values = take(9 * nb);
        let held: Vec<bool> = take(3 * n).iter().map(|h| *h != 0.0).collect();
        let b = take(3 * n);
        let op = Op { n: 3 * n, pairs: &pairs, values: &values, held: &held };
        let t = Instant::now();
        let mut m = Multigrid::new(&points, pairs.iter().copied()).unwrap();
        m.hold(&held);
        let t_new = t.elapsed().as_secs_f64();
        let t = Instant::now();
        m.factorize(&values, 0.0).unwrap();
        let t_fact = t.elapsed().as_secs_f64();
        let t = Instant::now();
        m.factorize(&values, 0.0).unwrap();
        let t_renew = t.elapsed().as_secs_f64();
        let s = cg::Settings { relative_tolerance: 1e-8, max_iterations: 5000, deadline: None };
        let mut w = cg::Workspace::new(3 * n);
        let mut x = vec![0.0; 3 * n];
        let t = Instant::now();
        let info = cg::solve(&mut x, &op, &mut m, &b, &s, &mut w);
        let t_solve = t.elapsed().as_secs_f64();
        let mut z = vec![0.0; 3 * n];
        let t = Instant::now();
        for _ in 0..10 { cg::Preconditioner::apply(&mut m, &b, &mut z); }
        let t_apply = t.elapsed().as_secs_f64() / 10.0;
        let t = Instant::now();
        for _ in 0..10 { cg::Operator::apply(&op, &b, &mut z); }
        let t_mul = t.elapsed().as_secs_f64() / 10.0;
        println!("{path} n {n} blocks/node {:.1} levels {:?} complexity {:.2} new {t_new:.3} factorize {t_fact:.3} renew {t_renew:.3} solve {t_solve:.3} apply {t_apply:.4} multiply {t_mul:.4} mg {info:?}", nb as f64 / n as f64, m.levels(), m.complexity());
        let mut a = BlockMatrix::new(n, pairs.iter().copied());
        a.hold(&held); a.fill(&values, 0.0);
        let mut ic = cg::IncompleteCholesky::new(&a);
        let t = Instant::now();
        ic.factorize(&a).unwrap();
        let t_fact = t.elapsed().as_secs_f64();
        x.fill(0.0);
        let t = Instant::now();
        let info = cg::solve(&mut x, &op, &mut ic, &b, &s, &mut w);
        println!("   ic factorize {t_fact:.3} solve {:.3} {info:?}", t.elapsed().as_secs_f64());
    }
}
