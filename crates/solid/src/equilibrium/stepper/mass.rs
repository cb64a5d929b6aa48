//! The mass of a body on the block pattern of its tangent, lumped at the nodes or consistent with the displacement.

use super::Mass;
use crate::body::{BlockPattern, Body, SymmetricBlocks};
use crate::error::Error;
use crate::linear::conjugate_gradients::{
    self as cg, Operator, Preconditioner, Settings, Workspace,
};
use crate::mesh::{EDGES, cell_volume, quadratic_cells};
use std::collections::BTreeMap;

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

/// Corners of every cell, and midpoints where displacement is quadratic.
fn nodes_of_cells(body: &Body) -> Vec<Vec<u32>> {
    if body.edges().is_empty() {
        return body.cells().iter().map(|cell| cell.to_vec()).collect();
    }
    let cells = quadratic_cells(body.n_corners(), body.cells(), body.edges());
    cells.iter().map(|cell| cell.to_vec()).collect()
}

/// Integral of `N_a N_b` over a tetrahedron of volume 1, of 4 or of 10 shape functions.
fn product(a: usize, b: usize, count: usize) -> f64 {
    if count == 4 {
        return if a == b { 0.1 } else { 0.05 };
    }
    let shared =
        |a: usize, b: usize| EDGES[a - 4].iter().filter(|end| EDGES[b - 4].contains(end)).count();
    let entry = match (a.min(b), a.max(b)) {
        (a, b) if b < 4 => [1.0, 6.0][usize::from(a == b)],
        (a, b) if a < 4 => [-6.0, -4.0][usize::from(EDGES[b - 4].contains(&a))],
        (a, b) => [8.0, 16.0, 32.0][shared(a, b)],
    };
    entry / 420.0
}

/// Part of each node in the weight of a body without inertia [kg]: the force of a unit gravity.
pub(super) fn nodal_weight(body: &Body, density: &[f64]) -> Result<Vec<f64>, Error> {
    Ok(body.gravity([1.0, 0.0, 0.0], density)?.into_iter().step_by(3).collect())
}

impl MassMatrix {
    pub fn new(mass: Mass, body: &Body, density: &[f64]) -> Result<Self, Error> {
        if let Some(bad) = density.iter().find(|rho| !(**rho > 0.0)) {
            return Err(Error::input(format!(
                "density {bad} kg/m^3; inertia needs a positive one"
            )));
        }
        // Checks the number of densities, too.
        nodal_weight(body, density)?;
        let mut shares: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let mut nodal = vec![0.0; body.points().len()];
        for (cell, nodes) in nodes_of_cells(body).iter().enumerate() {
            let rho = if density.len() == 1 { density[0] } else { density[cell] };
            let weight = rho * cell_volume(body.points(), body.cells()[cell]);
            let diagonal: f64 = (0..nodes.len()).map(|a| product(a, a, nodes.len())).sum();
            for (a, &row) in nodes.iter().enumerate() {
                // Lumped in proportion to the diagonal (Hinton, Rock and Zienkiewicz 1976): positive for any element.
                nodal[row as usize] += weight * product(a, a, nodes.len()) / diagonal;
                for (b, &column) in nodes.iter().enumerate().skip(a) {
                    let pair = (row.min(column), row.max(column));
                    *shares.entry(pair).or_default() += weight * product(a, b, nodes.len());
                }
            }
        }
        if mass == Mass::Lumped {
            shares = (0u32..).zip(&nodal).map(|(node, &mass)| ((node, node), mass)).collect();
        }
        let entry = |((row, column), mass)| Entry { block: 0, row, column, mass };
        let mut matrix = MassMatrix { entries: shares.into_iter().map(entry).collect(), nodal };
        matrix.place(body.pattern());
        Ok(matrix)
    }

    /// Part of each node in the weight of the body [kg], the sum of its row: what is thrown or falls freely then has no
    /// strain, whatever the mass is. Consistent weights would deform a quadratic cell with lumped masses, as they lift its
    /// corners.
    pub fn weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.nodal.len()];
        for &Entry { row, column, mass, .. } in &self.entries {
            weights[row as usize] += mass;
            if row != column {
                weights[column as usize] += mass;
            }
        }
        weights
    }

    /// Degrees of freedom.
    pub fn n_dofs(&self) -> usize {
        3 * self.nodal.len()
    }

    /// Finds its blocks in the pattern of the tangent.
    pub fn place(&mut self, pattern: &BlockPattern) {
        for entry in &mut self.entries {
            entry.block = pattern.position(entry.row, entry.column).unwrap_or_default() as u32;
        }
        self.entries.sort_unstable_by_key(|entry| entry.block);
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
        let settings =
            Settings { relative_tolerance: 1e-13, max_iterations: 200, ..Settings::default() };
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
