//! Small bodies, laws, and their energies in double precision: what the device is compared with.
#![allow(dead_code)] // every test file uses a part

use std::sync::{Arc, OnceLock};
use viscera_gpu::{Gpu, Law, Operation, Program, Solid};

pub type Mat3 = [[f64; 3]; 3];

/// The device, or a loud word where there is none. `VISCERA_GPU=required` makes that a failure.
pub fn device() -> Option<Arc<Gpu>> {
    static SHARED: OnceLock<Option<Arc<Gpu>>> = OnceLock::new();
    SHARED.get_or_init(|| device_with(u64::MAX)).clone()
}

/// One of one's own, that binds no more than so many bytes at once.
pub fn device_with(largest_binding: u64) -> Option<Arc<Gpu>> {
    match Gpu::open_with(largest_binding) {
        Ok(gpu) => Some(Arc::new(gpu)),
        Err(error) => {
            assert!(std::env::var("VISCERA_GPU").is_err(), "{error}");
            eprintln!("NOT TESTED: {error}");
            None
        }
    }
}

/// `psi = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2`.
pub fn neo_hookean() -> Law {
    use Operation::*;
    let mut p = Program::new();
    let [mu, lam] = [0, 1].map(|k| p.add(Parameter(k)));
    let [i1, j] =
        [viscera_gpu::Invariant::I1, viscera_gpu::Invariant::J].map(|i| p.add(Invariant(i)));
    let [three, half] = [3.0, 0.5].map(|c| p.constant(c));
    let stretch = p.add(Subtract(i1, three));
    let half_mu = p.add(Multiply(half, mu));
    let first = p.add(Multiply(half_mu, stretch));
    let ln_j = p.add(Logarithm(j));
    let second = p.add(Multiply(mu, ln_j));
    let square = p.add(Multiply(ln_j, ln_j));
    let half_lam = p.add(Multiply(half, lam));
    let third = p.add(Multiply(half_lam, square));
    let sum = p.add(Subtract(first, second));
    p.add(Add(sum, third));
    Law::Energy(p)
}

/// `psi = c1 (I1 J^(-2/3) - 3) + c2 (I2 J^(-4/3) - 3) + kappa/8 (J^2 - 1)^2`.
pub fn mooney_rivlin() -> Law {
    use Operation::*;
    let mut p = Program::new();
    let [c1, c2, kappa] = [0, 1, 2].map(|k| p.add(Parameter(k)));
    let [i1, i2, j] = viscera_gpu::Invariant::ALL.map(|i| p.add(Invariant(i)));
    let [one, three, eighth] = [1.0, 3.0, 0.125].map(|c| p.constant(c));
    let part = |p: &mut Program, c, i, exponent| {
        let exponent = p.constant(exponent);
        let power = p.add(Power(j, exponent));
        let product = p.add(Multiply(i, power));
        let change = p.add(Subtract(product, three));
        p.add(Multiply(c, change))
    };
    let first = part(&mut p, c1, i1, -2.0 / 3.0);
    let second = part(&mut p, c2, i2, -4.0 / 3.0);
    let square = p.add(Multiply(j, j));
    let swelling = p.add(Subtract(square, one));
    let square = p.add(Multiply(swelling, swelling));
    let factor = p.add(Multiply(eighth, kappa));
    let third = p.add(Multiply(factor, square));
    let sum = p.add(Add(first, second));
    p.add(Add(sum, third));
    Law::Energy(p)
}

/// `psi = c/2 (exp(b (I1 - 3)) - 1) / b - c ln J + kappa/2 (J - 1)^2 + c step(J - 1) (J - 1)^5`, with every operation that
/// the others lack.
pub fn stiffening() -> Law {
    use Operation::*;
    let mut p = Program::new();
    let [c, b, kappa] = [0, 1, 2].map(|k| p.add(Parameter(k)));
    let [i1, _, j] = viscera_gpu::Invariant::ALL.map(|i| p.add(Invariant(i)));
    let [one, three, half] = [1.0, 3.0, 0.5].map(|c| p.constant(c));
    let stretch = p.add(Subtract(i1, three));
    let exponent = p.add(Multiply(b, stretch));
    let exponential = p.add(Exponential(exponent));
    let growth = p.add(Subtract(exponential, one));
    let per_b = p.add(Reciprocal(b));
    let half_c = p.add(Multiply(half, c));
    let factor = p.add(Multiply(half_c, per_b));
    let first = p.add(Multiply(factor, growth));
    let ln_j = p.add(Logarithm(j));
    let second = p.add(Multiply(c, ln_j));
    let second = p.add(Negate(second));
    let swelling = p.add(Subtract(j, one));
    let square = p.add(Multiply(swelling, swelling));
    let half_kappa = p.add(Multiply(half, kappa));
    let third = p.add(Multiply(half_kappa, square));
    let fourth_power = p.add(Multiply(square, square));
    let fifth_power = p.add(Multiply(fourth_power, swelling));
    let is_swollen = p.add(Step(swelling));
    let one_sided = p.add(Multiply(is_swollen, fifth_power));
    let fourth = p.add(Multiply(c, one_sided));
    let sum = p.add(Add(first, second));
    let sum = p.add(Add(sum, third));
    p.add(Add(sum, fourth));
    Law::Energy(p)
}

/// Laws with parameters of tissue, `nu` between 0.3 and 0.49.
pub fn laws(nu: f64) -> Vec<(&'static str, Law, Vec<f64>)> {
    let (mu, lam) = moduli(nu);
    let kappa = lam + 2.0 / 3.0 * mu;
    vec![
        ("linear", Law::Linear, vec![mu, lam]),
        ("corotated", Law::Corotated, vec![mu, lam]),
        ("neo-Hookean", neo_hookean(), vec![mu, lam]),
        ("Mooney-Rivlin", mooney_rivlin(), vec![0.4 * mu, 0.1 * mu, kappa]),
        ("stiffening", stiffening(), vec![mu, 1.5, kappa]),
    ]
}

/// Lame's constants of a Young's modulus of 10 kPa.
pub fn moduli(nu: f64) -> (f64, f64) {
    let young = 1e4;
    (young / (2.0 * (1.0 + nu)), young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
}

/// A block of points and cells.
pub struct Block {
    pub points: Vec<[f64; 3]>,
    pub cells: Vec<[u32; 4]>,
    n: usize,
}

impl Block {
    /// `n^3` cubes of 5 mm, six cells each, the points moved a little.
    pub fn new(n: usize) -> Self {
        let index = |i: usize, j: usize, k: usize| ((i * (n + 1) + j) * (n + 1) + k) as u32;
        let mut points = Vec::new();
        for i in 0..=n {
            for j in 0..=n {
                for k in 0..=n {
                    let wave = |phase: f64| 0.15 * (1.7 * (i + 3 * j + 7 * k) as f64 + phase).sin();
                    let at = [i as f64 + wave(0.0), j as f64 + wave(1.0), k as f64 + wave(2.0)];
                    points.push(at.map(|x| 0.005 * x));
                }
            }
        }
        let mut cells = Vec::new();
        for i in 0..n {
            for j in 0..n {
                for k in 0..n {
                    let corner = |b: usize| index(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
                    let ways = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
                    cells.extend(ways.map(|[a, b]| [0, a, b, 7].map(corner)));
                }
            }
        }
        Block { points, cells, n }
    }

    pub fn solid<'a>(&'a self, law: &'a Law, parameters: &'a [Vec<f64>]) -> Solid<'a> {
        Solid { points: &self.points, cells: &self.cells, law, parameters }
    }

    /// Blocks of the tangent's upper triangle.
    pub fn pairs(&self) -> Vec<(u32, u32)> {
        let of_cell = |cell: &[u32; 4]| {
            let cell = *cell;
            (0..16).map(move |k| (cell[k / 4], cell[k % 4])).filter(|(a, b)| a <= b)
        };
        let mut pairs: Vec<_> = self.cells.iter().flat_map(of_cell).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// The points of one face.
    pub fn is_held(&self) -> Vec<bool> {
        let on_face = self.points.len() / (self.n + 1);
        (0..3 * self.points.len()).map(|dof| dof / 3 < on_face).collect()
    }

    /// A smooth displacement, `size` being about the strain.
    pub fn bent(&self, size: f64) -> Vec<f64> {
        let at = |p: &[f64; 3]| {
            let [x, y, z] = p.map(|x| x / 0.005);
            [0.4 * y * y / 3.0 + 0.5 * x, 0.3 * z - 0.6 * x, 0.2 * x * y - 0.4 * z]
                .map(|u| 0.005 * size * u)
        };
        self.points.iter().flat_map(at).collect()
    }
}

/// Energy density of a deformation gradient in double precision, straight from the formulas.
pub fn energy(law: &Law, parameters: &[f64], f: &Mat3) -> f64 {
    let double_dot =
        |a: &Mat3, b: &Mat3| (0..9).map(|k| a[k / 3][k % 3] * b[k / 3][k % 3]).sum::<f64>();
    let z = cofactor(f);
    let j = (0..3).map(|k| f[0][k] * z[0][k]).sum::<f64>();
    match law {
        Law::Energy(program) => {
            *program.evaluate([double_dot(f, f), double_dot(&z, &z), j], parameters).last().unwrap()
        }
        Law::Linear => {
            let e = |i: usize, k: usize| 0.5 * (f[i][k] + f[k][i]) - f64::from(u8::from(i == k));
            let squares: f64 = (0..9).map(|k| e(k / 3, k % 3).powi(2)).sum();
            parameters[0] * squares + 0.5 * parameters[1] * (e(0, 0) + e(1, 1) + e(2, 2)).powi(2)
        }
        Law::Corotated => {
            let mut r = *f;
            for _ in 0..20 {
                let z = cofactor(&r);
                let scale = 0.5 / (0..3).map(|k| r[0][k] * z[0][k]).sum::<f64>();
                r = std::array::from_fn(|i| {
                    std::array::from_fn(|k| 0.5 * r[i][k] + scale * z[i][k])
                });
            }
            let squares: f64 = (0..9).map(|k| (f[k / 3][k % 3] - r[k / 3][k % 3]).powi(2)).sum();
            parameters[0] * squares + 0.5 * parameters[1] * (double_dot(&r, f) - 3.0).powi(2)
        }
    }
}

fn cofactor(f: &Mat3) -> Mat3 {
    std::array::from_fn(|i| {
        std::array::from_fn(|k| {
            let [a, b, c, d] = [(i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3];
            f[a][c] * f[b][d] - f[a][d] * f[b][c]
        })
    })
}

/// Internal force in double precision, stresses by differences of the energy (five points, exact to 1e-9 or so).
pub fn internal_force(solid: &Solid<'_>, u: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; u.len()];
    for (number, cell) in solid.cells.iter().enumerate() {
        let row = &solid.parameters[if solid.parameters.len() == 1 { 0 } else { number }];
        let (g, volume) = gradients(solid.points, cell);
        let f: Mat3 = std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let sum: f64 = (0..4).map(|a| u[3 * cell[a] as usize + i] * g[a][k]).sum();
                sum + f64::from(u8::from(i == k))
            })
        });
        for i in 0..3 {
            let stress: [f64; 3] = std::array::from_fn(|k| {
                let h = 1e-3;
                let at = |way: f64| {
                    let mut moved = f;
                    moved[i][k] += way * h;
                    energy(solid.law, row, &moved)
                };
                (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h)
            });
            for a in 0..4 {
                let sum: f64 = (0..3).map(|k| stress[k] * g[a][k]).sum();
                force[3 * cell[a] as usize + i] += volume * sum;
            }
        }
    }
    force
}

fn gradients(points: &[[f64; 3]], cell: &[u32; 4]) -> ([[f64; 3]; 4], f64) {
    let p = cell.map(|node| points[node as usize]);
    let edges: Mat3 = std::array::from_fn(|a| std::array::from_fn(|i| p[a + 1][i] - p[0][i]));
    let z = cofactor(&edges);
    let det = (0..3).map(|i| edges[0][i] * z[0][i]).sum::<f64>();
    let g = |a: usize| z[a].map(|x| x / det);
    let first = std::array::from_fn(|i| -(0..3).map(|a| g(a)[i]).sum::<f64>());
    ([first, g(0), g(1), g(2)], det / 6.0)
}

/// `|a - b| / |b|`.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
    (square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())).sqrt()
}
