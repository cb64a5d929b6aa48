//! Small bodies, laws, and their energies in double precision: what the device is compared with.
#![allow(dead_code)] // every test file uses a part

use std::sync::{Arc, OnceLock};
use viscera_gpu::{Gpu, Law, Solid};
use viscera_law::Material;

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

/// The laws of the core that a device has kernels for, and a formula with what they lack; each with a row of parameters of
/// tissue for Poisson's ratio `nu` between 0.3 and 0.49.
pub fn names(nu: f64) -> Vec<(&'static str, Vec<f64>)> {
    let (mu, lam) = moduli(nu);
    let kappa = lam + 2.0 / 3.0 * mu;
    let step = "formula mu/2*(I1 - 3) - mu*log(J) + kappa/2*(J - 1)**2 + mu*max(J - 1, 0)**5";
    vec![
        ("linear", vec![mu, lam]),
        ("corotated", vec![mu, lam]),
        ("saint_venant_kirchhoff", vec![mu, lam]),
        ("neo_hookean", vec![mu, lam]),
        ("stable_neo_hookean", vec![mu, lam]),
        ("mooney_rivlin J-1", vec![0.4 * mu, 0.1 * mu, kappa]),
        ("mooney_rivlin J^2-1", vec![0.4 * mu, 0.1 * mu, kappa]),
        ("mooney_rivlin ln J", vec![0.4 * mu, 0.1 * mu, kappa]),
        ("yeoh", vec![0.5 * mu, 0.1 * mu, 0.02 * mu, kappa]),
        ("arruda_boyce", vec![mu, 1.4, kappa]),
        ("fung", vec![mu, 1.5, kappa]),
        ("veronda_westmann", vec![mu, 1.5, kappa]),
        (step, vec![mu, kappa]),
    ]
}

/// The same as the device takes them.
pub fn laws(nu: f64) -> Vec<(String, Law, Vec<Vec<f64>>)> {
    let law = |(name, row): (&str, Vec<f64>)| {
        let (law, rows) = recorded(name, vec![row]);
        (name.to_string(), law, rows)
    };
    names(nu).into_iter().map(law).collect()
}

/// A law of the core by its name, and the rows of parameters of its program.
pub fn recorded(name: &str, rows: Vec<Vec<f64>>) -> (Law, Vec<Vec<f64>>) {
    let material = Material::new(name, rows).unwrap();
    let program = material.program(&[]).unwrap();
    let operations = viscera_device::law::operations(&program).unwrap();
    (Law::of(viscera_device::law::model(&program), &operations).unwrap(), program.rows)
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
        Solid { points: &self.points, cells: &self.cells, law, parameters, clusters: None }
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
                let at = |by: f64| {
                    let mut moved = f;
                    moved[i][k] += by * h;
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

pub fn gradients(points: &[[f64; 3]], cell: &[u32; 4]) -> ([[f64; 3]; 4], f64) {
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
