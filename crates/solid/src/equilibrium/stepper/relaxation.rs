//! Prony viscoelasticity: the second Piola-Kirchhoff stress `S_e` of the law is what the tissue answers at once, and
//! a part `g_i` of it fades with the time `tau_i`,
//!   S(t) = integral of G(t - s) dS_e(s),   G(t) = 1 - sum_i g_i (1 - exp(-t / tau_i)).
//! Simo and Hughes (1998), chapter 10, here for the whole stress. With `x_i = h / tau_i`, a frame of length `h` over
//! which `S_e` changes linearly takes the internal stresses exactly to
//!   H_i <- exp(-x_i) H_i + g_i (1 - exp(-x_i)) / x_i (S_e - S_e before).
//! So `S = theta S_e + S_h` with `S_h` known from the past: force and tangent of the cells are scaled by `theta`, and
//! the history adds a force that is linear in the displacement. Supports, bonds and springs do not relax. The law of small
//! strains knows no turned axes, and its `S` would not be symmetric: there the memory is that of `P`.

use crate::body::{BlockPattern, Body, Curvature};
use crate::element::Geometry;
use crate::equilibrium::Tangent;
use crate::error::Error;
use crate::law::{LINEAR, Material};
use crate::tensor::{Mat3, add, inverse, mul_vector, scale, sub};
use crate::unroll::tabulate;

/// Relative moduli `g_i` and relaxation times `tau_i` [s].
#[derive(Clone, Debug, PartialEq)]
pub struct Prony {
    /// Parts of the stress that relax; positive, with a sum below 1.
    pub g: Vec<f64>,
    /// Relaxation times [s].
    pub tau: Vec<f64>,
}

impl Prony {
    /// # Errors
    /// Lists of different or no length, a value out of range.
    pub fn check(&self) -> Result<(), Error> {
        if self.g.is_empty() && self.tau.is_empty() {
            return Err(Error::input(
                "relaxation has neither moduli g nor times tau; give one of each at least, or no relaxation",
            ));
        }
        if self.g.len() != self.tau.len() {
            return Err(Error::input(format!(
                "relaxation has {} moduli g and {} times tau; give one time for each modulus",
                self.g.len(),
                self.tau.len()
            )));
        }
        let sum: f64 = self.g.iter().sum();
        if self.g.iter().any(|g| !(*g > 0.0)) || !(sum < 1.0) {
            return Err(Error::input(format!(
                "relaxation moduli g = {:?}; each must be positive and their sum below 1",
                self.g
            )));
        }
        if let Some(tau) = self.tau.iter().find(|tau| !(**tau > 0.0 && tau.is_finite())) {
            return Err(Error::input(format!(
                "relaxation time tau = {tau} s; it must be positive"
            )));
        }
        Ok(())
    }
}

const IDENTITY: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Geometry of a cell for its history.
struct Cell {
    nodes: [u32; 4],
    /// Gradients of the shape functions [1/m].
    gradients: [[f64; 3]; 4],
    volume: f64,
    /// Block of each pair of its nodes in the tangent.
    blocks: [[u32; 4]; 4],
    /// The stress that it remembers is `P`, not `S`.
    is_small_strain: bool,
}

/// Stresses of the past, cell by cell.
pub(super) struct Relaxation {
    /// `g_i`, `exp(-x_i)` and `(1 - exp(-x_i)) / x_i`.
    terms: Vec<[f64; 3]>,
    theta: f64,
    cells: Vec<Cell>,
    /// `S_e` at the end of the last frame.
    elastic: Vec<Mat3<f64>>,
    /// `H_i`, term by term.
    internal: Vec<Vec<Mat3<f64>>>,
    /// `S_h` of the frame at hand.
    history: Vec<Mat3<f64>>,
}

impl Relaxation {
    /// Starts with stresses that have just arisen at displacement `u`.
    pub fn new(prony: &Prony, time_step: f64, body: &Body, u: &[f64]) -> Self {
        let term = |(&g, &tau): (&f64, &f64)| {
            let x = time_step / tau;
            [g, (-x).exp(), -(-x).exp_m1() / x]
        };
        let terms: Vec<[f64; 3]> = prony.g.iter().zip(&prony.tau).map(term).collect();
        let theta = 1.0 - terms.iter().map(|[g, _, mean]| g * (1.0 - mean)).sum::<f64>();
        let cells: Vec<Cell> = body
            .cells()
            .iter()
            .enumerate()
            .map(|(number, &nodes)| {
                let Geometry { gradients: [x, y, z], volume } =
                    Geometry::new(nodes.map(|n| body.points()[n as usize]));
                let first = std::array::from_fn(|i| -x[i] - y[i] - z[i]);
                let is_small_strain = body.material().name_of_cell(number) == LINEAR;
                let gradients = [first, x, y, z];
                Cell { nodes, gradients, volume, blocks: [[0; 4]; 4], is_small_strain }
            })
            .collect();
        let zeros = vec![Mat3::default(); cells.len()];
        let mut relaxation = Relaxation {
            terms,
            theta,
            cells,
            elastic: zeros.clone(),
            internal: Vec::new(),
            history: zeros,
        };
        relaxation.place(body.pattern());
        relaxation.elastic = relaxation.stresses(body.material(), u);
        let parts = relaxation.terms.iter().map(|[g, ..]| g);
        relaxation.internal =
            parts.map(|g| relaxation.elastic.iter().map(|s| scale(g, s)).collect()).collect();
        relaxation.look_ahead();
        relaxation
    }

    /// Finds the blocks of its cells in the pattern of the tangent.
    pub fn place(&mut self, pattern: &BlockPattern) {
        let block = |a: u32, b: u32| pattern.position(a, b).unwrap_or_default() as u32;
        for cell in &mut self.cells {
            cell.blocks = cell.nodes.map(|a| cell.nodes.map(|b| block(a, b)));
        }
    }

    /// `S_h` of the next frame.
    fn look_ahead(&mut self) {
        for (cell, history) in self.history.iter_mut().enumerate() {
            *history = Mat3::default();
            for ([g, decay, mean], internal) in self.terms.iter().zip(&self.internal) {
                let gone = scale(&(g * mean), &self.elastic[cell]);
                *history = add(history, &sub(&scale(decay, &internal[cell]), &gone));
            }
        }
    }

    /// From the body's force at displacement `u` to that of this frame.
    pub fn apply(&self, body: &Body, u: &[f64], force: &mut [f64]) {
        force.iter_mut().for_each(|f| *f *= self.theta);
        body.add_tie_force(u, 1.0 - self.theta, force);
        for (cell, history) in self.cells.iter().zip(&self.history) {
            let f = if cell.is_small_strain { IDENTITY } else { cell.deformation(u) };
            for (&node, g) in cell.nodes.iter().zip(&cell.gradients) {
                let share = mul_vector(&f, &mul_vector(history, g));
                (0..3).for_each(|i| force[3 * node as usize + i] += cell.volume * share[i]);
            }
        }
    }

    /// From the body's tangent at a displacement to that of this frame.
    pub fn soften(&self, body: &Body, at: (&[f64], Curvature), tangent: &mut Tangent) {
        tangent.scale(self.theta);
        body.add_tie_stiffness(at, 1.0 - self.theta, tangent.blocks_mut());
        let values = tangent.blocks_mut().values_mut();
        let cells = self.cells.iter().zip(&self.history);
        for (cell, history) in cells.filter(|(cell, _)| !cell.is_small_strain) {
            let g = &cell.gradients;
            for b in 0..4 {
                let pull = mul_vector(history, &g[b]);
                for a in 0..4 {
                    // The block of two nodes is stored once, that of a node with itself comes once.
                    if cell.nodes[a] <= cell.nodes[b] {
                        let stiffness = g[a].iter().zip(&pull).map(|(g, p)| g * p).sum::<f64>();
                        let block = 9 * cell.blocks[a][b] as usize;
                        [0, 4, 8].iter().for_each(|i| values[block + i] += cell.volume * stiffness);
                    }
                }
            }
        }
    }

    /// Ends a frame at displacement `u`.
    pub fn end(&mut self, material: &Material, u: &[f64]) {
        let elastic = self.stresses(material, u);
        for ([g, decay, mean], internal) in self.terms.iter().zip(&mut self.internal) {
            for (cell, internal) in internal.iter_mut().enumerate() {
                let change = sub(&elastic[cell], &self.elastic[cell]);
                *internal = add(&scale(decay, internal), &scale(&(g * mean), &change));
            }
        }
        self.elastic = elastic;
        self.look_ahead();
    }

    /// `S_e = F^-1 P` of every cell, zero where a cell has no volume left; `P` where that is remembered.
    fn stresses(&self, material: &Material, u: &[f64]) -> Vec<Mat3<f64>> {
        let deformations: Vec<_> = self.cells.iter().map(|cell| cell.deformation(u)).collect();
        let answers = if let [row] = material.parameters() {
            material.energy_and_stress(row, &deformations)
        } else {
            let of_cell = |(cell, f): (usize, &Mat3<f64>)| {
                material.energy_and_stress(material.of_cell(cell), std::slice::from_ref(f))[0]
            };
            deformations.iter().enumerate().map(of_cell).collect()
        };
        let of_each = self.cells.iter().zip(&deformations).zip(answers);
        of_each.map(|((cell, f), (_, p))| cell.remembered(f, p)).collect()
    }
}

impl Cell {
    /// The stress that it remembers, of the deformation `F` and `P`.
    fn remembered(&self, f: &Mat3<f64>, p: Mat3<f64>) -> Mat3<f64> {
        if self.is_small_strain {
            return p;
        }
        let inverse = inverse(f).unwrap_or_default();
        tabulate!(|i, j| (0..3).map(|k| inverse[i][k] * p[k][j]).sum())
    }

    /// `F = I + sum_a u_a (x) g_a`.
    fn deformation(&self, u: &[f64]) -> Mat3<f64> {
        tabulate!(|i, j| {
            let nodes = self.nodes.iter().zip(&self.gradients);
            let gradient: f64 = nodes.map(|(&node, g)| u[3 * node as usize + i] * g[j]).sum();
            gradient + f64::from(i == j)
        })
    }
}
