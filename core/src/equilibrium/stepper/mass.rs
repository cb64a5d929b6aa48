//! The mass of a body on the block pattern of its tangent, lumped at the nodes or consistent with the displacement.

use super::Mass;
use crate::body::{Body, SymmetricBlocks};
use crate::element::Tet4;
use crate::error::Error;
use crate::linear::conjugate_gradients::{
    self as cg, Operator, Preconditioner, Settings, Workspace,
};
use std::collections::HashMap;

/// Mass of a pair of nodes, the same in all three directions [kg].
struct Entry {
    block: u32,
    row: u32,
    column: u32,
    mass: f64,
}

/// The mass matrix.
pub(super) struct MassMatrix {
    entries: Vec<Entry>,
    /// Row sums: the mass of each node [kg].
    nodal: Vec<f64>,
}

/// The block of each pair of nodes, row <= column.
pub(super) fn block_of_pair(tangent: &SymmetricBlocks) -> HashMap<(u32, u32), u32> {
    tangent.pairs().zip(0..).collect()
}

/// Mass of each node, a quarter of that of its cells [kg]: the force of a unit gravity.
pub(super) fn nodal_mass(body: &Body, density: &[f64]) -> Result<Vec<f64>, Error> {
    Ok(body.gravity([1.0, 0.0, 0.0], density)?.into_iter().step_by(3).collect())
}

impl MassMatrix {
    pub fn new(
        mass: Mass,
        body: &Body,
        tangent: &SymmetricBlocks,
        density: &[f64],
    ) -> Result<Self, Error> {
        let nodal = nodal_mass(body, density)?;
        if let Some(node) = nodal.iter().position(|m| !(*m > 0.0)) {
            return Err(Error::input(format!(
                "the mass of point {node} is {} kg; give a positive density [kg/m^3]",
                nodal[node]
            )));
        }
        let blocks = block_of_pair(tangent);
        let mut entries = Vec::new();
        match mass {
            Mass::Lumped => {
                for (node, &mass) in (0u32..).zip(&nodal) {
                    entries.push(Entry {
                        block: blocks[&(node, node)],
                        row: node,
                        column: node,
                        mass,
                    });
                }
            }
            Mass::Consistent => {
                // Integral of N_a N_b over a tetrahedron: V (1 + delta_ab) / 20.
                for (cell, nodes) in body.cells().iter().enumerate() {
                    let volume = Tet4::new(nodes.map(|n| body.points()[n as usize])).volume;
                    let rho = if density.len() == 1 { density[0] } else { density[cell] };
                    for (a, &row) in nodes.iter().enumerate() {
                        for &column in &nodes[a..] {
                            let pair = (row.min(column), row.max(column));
                            let share = if row == column { 2.0 } else { 1.0 };
                            let mass = rho * volume * share / 20.0;
                            entries.push(Entry {
                                block: blocks[&pair],
                                row: pair.0,
                                column: pair.1,
                                mass,
                            });
                        }
                    }
                }
                entries.sort_by_key(|e| e.block);
                entries.dedup_by(|b, a| {
                    let is_same = a.block == b.block;
                    a.mass += if is_same { b.mass } else { 0.0 };
                    is_same
                });
            }
        }
        Ok(MassMatrix { entries, nodal })
    }

    /// `y += factor M x`.
    pub fn add_product(&self, factor: f64, x: &[f64], y: &mut [f64]) {
        for &Entry { row, column, mass, .. } in &self.entries {
            let (row, column, mass) = (3 * row as usize, 3 * column as usize, factor * mass);
            for i in 0..3 {
                y[row + i] += mass * x[column + i];
                if row != column {
                    y[column + i] += mass * x[row + i];
                }
            }
        }
    }

    /// Adds `factor M` to a tangent.
    pub fn add_to(&self, factor: f64, tangent: &mut SymmetricBlocks) {
        let values = tangent.values_mut();
        for entry in &self.entries {
            let block = 9 * entry.block as usize;
            [0, 4, 8].iter().for_each(|i| values[block + i] += factor * entry.mass);
        }
    }

    /// `v . M v / 2` [J].
    pub fn energy(&self, v: &[f64]) -> f64 {
        let mut momentum = vec![0.0; v.len()];
        self.add_product(0.5, v, &mut momentum);
        v.iter().zip(momentum).map(|(v, p)| v * p).sum()
    }

    /// `M a = force` where nothing `is_held`, `a = 0` elsewhere.
    pub fn accelerations(&self, force: &[f64], is_held: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let b: Vec<f64> =
            force.iter().enumerate().map(|(d, f)| if is_held(d) { 0.0 } else { *f }).collect();
        let mut a = vec![0.0; b.len()];
        let settings = Settings { relative_tolerance: 1e-13, max_iterations: 200, deadline: None };
        let free = Free { mass: self, is_held };
        // What it misses of the tolerance is rounding.
        let _ = cg::solve(
            &mut a,
            &free,
            &mut Lumped(self),
            &b,
            &settings,
            &mut Workspace::new(b.len()),
        );
        a
    }
}

/// The mass matrix on what is not held.
struct Free<'a> {
    mass: &'a MassMatrix,
    is_held: &'a dyn Fn(usize) -> bool,
}

impl Operator for Free<'_> {
    fn n(&self) -> usize {
        3 * self.mass.nodal.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        self.mass.add_product(1.0, x, y);
        for (dof, y) in y.iter_mut().enumerate() {
            *y = if (self.is_held)(dof) { 0.0 } else { *y };
        }
    }
}

struct Lumped<'a>(&'a MassMatrix);

impl Preconditioner for Lumped<'_> {
    fn n(&self) -> usize {
        3 * self.0.nodal.len()
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        for (dof, (z, r)) in z.iter_mut().zip(r).enumerate() {
            *z = r / self.0.nodal[dof / 3];
        }
    }
}
