//! The basis of a grasp: fields made orthonormal in the energy of the origin, `phi_i . K phi_j = delta_ij`.

use crate::body::SymmetricBlocks;
use crate::mesh::Patch;
use crate::number::dot;
use rayon::prelude::*;

/// A field is left out if the part of it outside the span is below this fraction of its norm.
const DEPENDENT: f64 = 1e-4;

/// Orthonormal modes, and the fields they came from.
#[derive(Clone)]
pub(super) struct Basis {
    /// Runs of all degrees of freedom.
    pub modes: Vec<Vec<f64>>,
    /// Coordinates of each field in the modes: a row of the Cholesky factor of their Gram matrix.
    pub coordinates: Vec<Vec<f64>>,
}

impl Basis {
    /// Gram-Schmidt orthonormalisation in the order of the fields, by the Cholesky factor of their Gram matrix. Fields
    /// that depend on earlier ones are left out.
    pub fn new(fields: &[Vec<f64>], stiffness: &SymmetricBlocks) -> Self {
        let forces = forces(fields, stiffness);
        let (mut coordinates, mut origin): (Vec<Vec<f64>>, Vec<usize>) = (Vec::new(), Vec::new());
        for j in 0..fields.len() {
            let mut row = Vec::with_capacity(origin.len() + 1);
            for (k, &i) in origin.iter().enumerate() {
                let sum = dot(&row, &coordinates[i][..k]);
                row.push((dot(&forces[j], &fields[i]) - sum) / coordinates[i][k]);
            }
            let energy = dot(&forces[j], &fields[j]);
            let own = energy - dot(&row, &row);
            if own > DEPENDENT.powi(2) * energy {
                row.push(own.sqrt());
                origin.push(j);
            }
            coordinates.push(row);
        }
        let mut modes: Vec<Vec<f64>> = Vec::with_capacity(origin.len());
        for (k, &i) in origin.iter().enumerate() {
            let mut mode = fields[i].clone();
            for (l, other) in modes.iter().enumerate() {
                let along = coordinates[i][l];
                mode.iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
            }
            let own = coordinates[i][k];
            mode.iter_mut().for_each(|x| *x /= own);
            modes.push(mode);
        }
        Basis { modes, coordinates }
    }

    /// Adds modes for the parts of these fields outside the span, the largest part first, until the remaining parts are
    /// below `smallest` of the largest field.
    pub fn enrich(&mut self, fields: &[Vec<f64>], smallest: f64, stiffness: &SymmetricBlocks) {
        let squares = |fields: &[Vec<f64>]| -> Vec<f64> {
            fields.iter().zip(forces(fields, stiffness)).map(|(u, f)| dot(u, &f)).collect()
        };
        let least = smallest.powi(2) * squares(fields).into_iter().fold(0.0, f64::max);
        let mut parts = fields.to_vec();
        let mut of_modes = forces(&self.modes, stiffness);
        for (mode, force) in self.modes.iter().zip(&of_modes) {
            parts.par_iter_mut().for_each(|part| take_out(mode, force, part));
        }
        for _ in 0..fields.len() {
            let own = squares(&parts).into_iter().enumerate();
            let largest = own.max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((place, square)) = largest.filter(|(_, square)| *square > least) else {
                break;
            };
            let mut mode = parts.swap_remove(place);
            mode.iter_mut().for_each(|x| *x /= square.sqrt());
            // Once more: rounding has left some of the others in it.
            self.modes.iter().zip(&of_modes).for_each(|(m, f)| take_out(m, f, &mut mode));
            let force = force_of(&mode, stiffness);
            parts.par_iter_mut().for_each(|part| take_out(&mode, &force, part));
            self.modes.push(mode);
            of_modes.push(force);
        }
    }

    /// Coordinates of the field in the span that is nearest to this one, in the energy norm at the origin.
    pub fn nearest(&self, field: &[f64], stiffness: &SymmetricBlocks) -> Vec<f64> {
        self.project(&force_of(field, stiffness))
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.modes.len()
    }

    /// Adds `amplitude` times a field to coordinates `q`.
    pub fn add(&self, field: usize, amplitude: f64, q: &mut [f64]) {
        let row = &self.coordinates[field];
        q.iter_mut().zip(row).for_each(|(q, x)| *q += amplitude * x);
    }

    /// Mean displacement of a patch under each mode: three rows.
    pub fn means(&self, patch: &Patch) -> [Vec<f64>; 3] {
        let weights = || patch.nodes.iter().zip(&patch.weights);
        let mean = |mode: &Vec<f64>, i: usize| -> f64 {
            weights().map(|(&node, w)| w * mode[3 * node as usize + i]).sum()
        };
        std::array::from_fn(|i| self.modes.iter().map(|mode| mean(mode, i)).collect())
    }

    /// The field `sum q_k phi_k`.
    pub fn field(&self, q: &[f64]) -> Vec<f64> {
        let mut field = vec![0.0; self.modes.first().map_or(0, Vec::len)];
        for (mode, &q) in self.modes.iter().zip(q) {
            field.iter_mut().zip(mode).for_each(|(u, phi)| *u += q * phi);
        }
        field
    }

    /// `phi . f` for each mode.
    pub fn project(&self, force: &[f64]) -> Vec<f64> {
        self.modes.iter().map(|mode| dot(mode, force)).collect()
    }
}

/// `K u` for each field.
fn forces(fields: &[Vec<f64>], stiffness: &SymmetricBlocks) -> Vec<Vec<f64>> {
    fields.par_iter().map(|field| force_of(field, stiffness)).collect()
}

fn force_of(field: &[f64], stiffness: &SymmetricBlocks) -> Vec<f64> {
    let mut force = vec![0.0; field.len()];
    stiffness.multiply(field, &mut force);
    force
}

/// Removes a mode, whose force is `K phi`, from a field.
fn take_out(mode: &[f64], force: &[f64], field: &mut [f64]) {
    let part = dot(force, field);
    field.iter_mut().zip(mode).for_each(|(x, m)| *x -= part * m);
}
