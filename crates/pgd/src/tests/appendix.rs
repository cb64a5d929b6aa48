//! The neo-Hookean recursion as the appendix of paper A prints it (eqs. 42-51), scan errors repaired: written out
//! by hand, with nothing of the library but 3x3 algebra, and compared with the series that any law gets here.

use crate::body::Body;
use crate::element::Geometry;
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::number::Monomials;
use crate::tensor::{Mat3, add, cofactor, determinant, double_dot, scale, sub, transpose_mul};
use crate::unroll::tabulate;

const MU: f64 = 57.4e3;
const LAM: f64 = 1.38e6;

/// `Q(A, B)`, bilinear and symmetric with `cof A = Q(A, A)`.
fn q(a: &Mat3<f64>, b: &Mat3<f64>) -> Mat3<f64> {
    scale(&0.5, &sub(&cofactor(&add(a, b)), &add(&cofactor(a), &cofactor(b))))
}

fn zero() -> Mat3<f64> {
    [[0.0; 3]; 3]
}

fn sum(terms: impl Iterator<Item = Mat3<f64>>) -> Mat3<f64> {
    terms.fold(zero(), |sum, term| add(&sum, &term))
}

/// A linear tetrahedron: gradients of its four shape functions, and its volume.
struct Shape {
    gradients: [[f64; 3]; 4],
    volume: f64,
}

impl Shape {
    fn new(x: [[f64; 3]; 4]) -> Self {
        let Geometry { gradients: [a, b, c], volume } = Geometry::new(x);
        let first = std::array::from_fn(|i| -a[i] - b[i] - c[i]);
        Shape { gradients: [first, a, b, c], volume }
    }
}

/// The series of one cell, order by order; the last entry of each list is the newest.
struct Appendix {
    /// `grad u_r`, `C_r`, cofactor `CC_r`, and `C^-1_r`.
    gradient: Vec<Mat3<f64>>,
    c: Vec<Mat3<f64>>,
    cc: Vec<Mat3<f64>>,
    inverse: Vec<Mat3<f64>>,
    /// Second Piola-Kirchhoff stress `S_r`.
    s: Vec<Mat3<f64>>,
    /// `X = det C`, `Y = ln J`, `Z = J^-2`.
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Appendix {
    fn new(gradient: Mat3<f64>) -> Self {
        let f = tabulate!(|i, j| gradient[i][j] + (i == j) as u8 as f64);
        let c = transpose_mul(&f, &f);
        let cc = cofactor(&c);
        let x = determinant(&c, &cc);
        let inverse = scale(&(1.0 / x), &cc);
        let y = 0.5 * x.ln();
        let identity = tabulate!(|i, j| (i == j) as u8 as f64);
        let s = add(&scale(&MU, &sub(&identity, &inverse)), &scale(&(LAM * y), &inverse));
        Appendix {
            gradient: vec![gradient],
            c: vec![c],
            cc: vec![cc],
            inverse: vec![inverse],
            s: vec![s],
            x: vec![x],
            y: vec![y],
            z: vec![1.0 / x],
        }
    }

    fn deformation(&self, r: usize) -> Mat3<f64> {
        let identity = (r == 0) as u8 as f64;
        tabulate!(|i, j| self.gradient[r][i][j] + if i == j { identity } else { 0.0 })
    }

    /// `sum_{r=1}^{p-1} f(r, p - r)`.
    fn lower(p: usize, f: impl Fn(usize, usize) -> Mat3<f64>) -> Mat3<f64> {
        sum((1..p).map(|r| f(r, p - r)))
    }

    /// `RJ_p`: the products of `det C` that hold no `C_p`.
    fn rj(&self, p: usize) -> f64 {
        let mut total = 0.0;
        for i in 0..p {
            for j in (0..p).filter(|j| i + j <= p && p - i - j < p) {
                total += double_dot(&self.c[i], &q(&self.c[j], &self.c[p - i - j])) / 3.0;
            }
        }
        total
    }

    /// `RY_p` and `RZ_p` of eq. 51: printed to order 3, continued by the recursions of logarithm and power.
    fn ry_rz(&self, p: usize) -> (f64, f64) {
        let (x, j2) = (&self.x, self.x[0]);
        match p {
            1 => (0.0, 0.0),
            2 => (-x[1].powi(2) / (4.0 * j2.powi(2)), x[1].powi(2) / j2.powi(3)),
            3 => (
                x[1].powi(3) / (6.0 * j2.powi(3)) - x[1] * x[2] / (2.0 * j2.powi(2)),
                -x[1].powi(3) / j2.powi(4) + 2.0 * x[1] * x[2] / j2.powi(3),
            ),
            _ => {
                let y = (1..p).map(|r| r as f64 * self.y[r] * x[p - r]).sum::<f64>();
                let z = (1..p).map(|r| self.z[r] * x[p - r]).sum::<f64>();
                (-y / (p as f64 * j2), -z / j2)
            }
        }
    }

    /// `D : E`, eq. 43.
    fn d(&self, e: &Mat3<f64>) -> Mat3<f64> {
        let (cc, j2) = (&self.cc[0], self.x[0]);
        let share = double_dot(cc, e) / j2.powi(2);
        let twice = 2.0 * (MU - LAM * self.y[0]);
        let ct = scale(&2.0, &q(&self.c[0], e));
        let bracket = sub(&scale(&share, cc), &scale(&(1.0 / j2), &ct));
        add(&scale(&(LAM * share), cc), &scale(&twice, &bracket))
    }

    /// `S_p^nlmat`, eqs. 45-51.
    fn s_nlmat(&self, p: usize) -> Mat3<f64> {
        let (cc, j2) = (&self.cc[0], self.x[0]);
        let (ry, rz) = self.ry_rz(p);
        let rj = self.rj(p);
        let rcc = Self::lower(p, |r, t| q(&self.c[r], &self.c[t]));
        let rc_inverse = Self::lower(p, |r, t| scale(&self.z[r], &self.cc[t]));
        let rs = Self::lower(p, |r, t| scale(&self.y[r], &self.inverse[t]));
        let first =
            add(&add(&scale(&(rz - rj / j2.powi(2)), cc), &scale(&(1.0 / j2), &rcc)), &rc_inverse);
        let second = add(&scale(&((ry + rj / (2.0 * j2)) / j2), cc), &rs);
        add(&scale(&(LAM * self.y[0] - MU), &first), &scale(&LAM, &second))
    }

    /// `S_p^nlgeom = D : 1/2 sum grad u_r^T grad u_{p-r}`, eq. 44.
    fn s_nlgeom(&self, p: usize) -> Mat3<f64> {
        let e = Self::lower(p, |r, t| transpose_mul(&self.gradient[r], &self.gradient[t]));
        self.d(&scale(&0.5, &e))
    }

    /// Integrand of the right-hand side as a first Piola-Kirchhoff stress: `F_0 (S^nlmat + S^nlgeom) + S*`, eq. 44.
    fn right_hand_side(&self, p: usize) -> Mat3<f64> {
        let nonlinear = add(&self.s_nlmat(p), &self.s_nlgeom(p));
        let f0 = self.deformation(0);
        add(
            &product(&f0, &nonlinear),
            &Self::lower(p, |r, t| product(&self.gradient[r], &self.s[t])),
        )
    }

    /// Takes `grad u_p` in and computes every order-p quantity.
    fn push(&mut self, gradient: Mat3<f64>) {
        let p = self.c.len();
        self.gradient.push(gradient);
        let c = sum((0..=p).map(|r| transpose_mul(&self.deformation(r), &self.deformation(p - r))));
        self.c.push(c);
        let (rj, (ry, rz)) = (self.rj(p), self.ry_rz(p));
        let s_nlmat = self.s_nlmat(p);
        let x = double_dot(&self.cc[0], &c) + rj;
        let rcc = Self::lower(p, |r, t| q(&self.c[r], &self.c[t]));
        self.cc.push(add(&scale(&2.0, &q(&self.c[0], &c)), &rcc));
        self.x.push(x);
        self.y.push(x / (2.0 * self.x[0]) + ry);
        self.z.push(-x / self.x[0].powi(2) + rz);
        self.inverse.push(sum((0..=p).map(|r| scale(&self.z[r], &self.cc[p - r]))));
        self.s.push(add(&self.d(&scale(&0.5, &c)), &s_nlmat));
    }
}

fn product(a: &Mat3<f64>, b: &Mat3<f64>) -> Mat3<f64> {
    tabulate!(|i, j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
}

/// Orders 2 to 7 about a strained state; orders 2 and 3 use the printed closed forms alone.
#[test]
fn eqs_42_to_51_give_the_right_hand_sides_of_the_generic_series() {
    const ORDER: usize = 7;
    let (points, cells) = block([2, 1, 1], [0.2, 0.1, 0.1]);
    let material = Material::new("neo_hookean", vec![vec![MU, LAM]]).unwrap();
    let body = Body::new(points.clone(), cells.clone(), material).unwrap();
    let (n, stride) = (body.n_dofs(), ORDER + 1);
    let scales: Vec<f64> = (0..=ORDER).map(|p| if p == 0 { 6e-3 } else { 4e-3 }).collect();
    let series: Vec<Vec<f64>> = (0u64..)
        .zip(&scales)
        .map(|(p, s)| noise(n, 30 + p).iter().map(|x| s * x).collect())
        .collect();
    let interleaved: Vec<f64> = (0..n).flat_map(|dof| series.iter().map(move |u| u[dof])).collect();
    let mut literal: Vec<(Shape, Appendix)> = cells
        .iter()
        .map(|cell| {
            let element = Shape::new(cell.map(|node| points[node as usize]));
            let start = gradient(&element, cell, &series[0]);
            (element, Appendix::new(start))
        })
        .collect();
    for p in 1..=ORDER {
        let mut generic = vec![0.0; n];
        body.force_series(Monomials::of(1, p), &interleaved, stride, &mut generic);
        let mut expected = vec![0.0; n];
        for (cell, (element, appendix)) in cells.iter().zip(&mut literal) {
            let stress = appendix.right_hand_side(p);
            for (&node, g) in cell.iter().zip(&element.gradients) {
                for i in 0..3 {
                    let share: f64 = (0..3).map(|j| stress[i][j] * g[j]).sum();
                    expected[3 * node as usize + i] += element.volume * share;
                }
            }
            appendix.push(gradient(element, cell, &series[p]));
        }
        let largest = expected.iter().fold(0.0f64, |max, f| max.max(f.abs()));
        let gap = generic.iter().zip(&expected).fold(0.0f64, |max, (a, b)| max.max((a - b).abs()));
        assert!(p == 1 || largest > 0.0);
        assert!(gap <= 1e-12 * largest, "order {p}: {:e}", gap / largest);
    }
}

fn gradient(element: &Shape, cell: &[u32; 4], u: &[f64]) -> Mat3<f64> {
    tabulate!(|i, j| {
        cell.iter().zip(&element.gradients).map(|(&node, g)| u[3 * node as usize + i] * g[j]).sum()
    })
}
