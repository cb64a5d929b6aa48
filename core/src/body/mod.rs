//! A body: mesh, element and law together, as the integrals the solvers ask for.
//!
//! Cells are grouped in batches of [`LANES`] that go through the same arithmetic side by side;
//! their results are gathered node by node (and block by block) through maps made once, so sums
//! come out the same whatever the number of threads.

mod blocks;
mod kernels;
mod series;
#[cfg(test)]
mod tests;

pub use blocks::SymmetricBlocks;

use crate::element::Tet4;
use crate::error::Error;
use crate::law::Material;
use crate::number::Lanes;
use blocks::BlockMap;

/// Cells per batch.
pub const LANES: usize = 4;

/// One number per cell of a batch.
pub(crate) type Lane = Lanes<LANES>;

/// Some cells with one set of law parameters; the last of a group repeats a cell with no volume.
struct Batch {
    nodes: [[u32; 4]; LANES],
    gradients: [[Lane; 3]; 4],
    volume: Lane,
    parameters: Vec<f64>,
}

/// Where a cell's results are: batch and lane.
#[derive(Clone, Copy)]
struct Slot {
    batch: u32,
    lane: u8,
}

/// A hyperelastic body of linear tetrahedra, Total Lagrangian.
pub struct Body {
    points: Vec<[f64; 3]>,
    cells: Vec<[u32; 4]>,
    elements: Vec<Tet4>,
    material: Material,
    batches: Vec<Batch>,
    /// Cell, local node, of every cell at a node; `incidence_start[n]..incidence_start[n + 1]`.
    incidence: Vec<(Slot, u8)>,
    incidence_start: Vec<u32>,
    block_map: BlockMap,
}

impl Body {
    /// Builds the element geometry and the assembly maps.
    ///
    /// # Errors
    /// No cells; a node index out of range; a coordinate that is not finite; a cell of no or
    /// negative volume; a number of law parameter rows that is neither 1 nor the number of cells.
    pub fn new(
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        material: Material,
    ) -> Result<Self, Error> {
        let elements = check_mesh(&points, &cells)?;
        let rows = material.parameters().len();
        if rows != 1 && rows != cells.len() {
            return Err(Error::input(format!(
                "law {}: {rows} parameter rows for {} cells; give one row, or one per cell",
                material.name(),
                cells.len()
            )));
        }
        let (batches, slots) = batches(&cells, &elements, &material);
        let (incidence, incidence_start) = incidence(points.len(), &cells, &slots);
        let block_map = BlockMap::new(points.len(), &cells, &slots);
        Ok(Body {
            points,
            cells,
            elements,
            material,
            batches,
            incidence,
            incidence_start,
            block_map,
        })
    }

    /// Rest positions [m].
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Cells, positively oriented.
    pub fn cells(&self) -> &[[u32; 4]] {
        &self.cells
    }

    /// The law.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Number of degrees of freedom, three per point.
    pub fn n_dofs(&self) -> usize {
        3 * self.points.len()
    }

    /// Volume at rest [m^3].
    pub fn rest_volume(&self) -> f64 {
        self.elements.iter().map(|e| e.volume).sum()
    }

    /// Sum of volumes times their largest law parameter [J]: the size of the terms that cancel in
    /// the energy.
    pub fn energy_scale(&self) -> f64 {
        self.elements.iter().enumerate().map(|(cell, e)| e.volume * self.modulus(cell)).sum()
    }

    /// Norm of the nodal forces of a stress of the size of the moduli [N]: their rounding is this
    /// times machine precision, however small the strain.
    pub fn force_scale(&self) -> f64 {
        let squares = self.elements.iter().enumerate().map(|(cell, e)| {
            let gradients = e.gradients.iter().flatten().map(|g| g * g).sum::<f64>();
            (self.modulus(cell) * e.volume).powi(2) * gradients
        });
        squares.sum::<f64>().sqrt()
    }

    fn modulus(&self, cell: usize) -> f64 {
        self.material.of_cell(cell).iter().fold(0.0, |max, p| p.abs().max(max))
    }

    /// Volume at displacement `u` [m^3].
    pub fn volume(&self, u: &[f64]) -> f64 {
        self.jacobians(u).zip(&self.elements).map(|(j, e)| j * e.volume).sum()
    }

    /// The smallest volume ratio `J` of a cell, and the cell.
    pub fn smallest_jacobian(&self, u: &[f64]) -> (f64, usize) {
        self.jacobians(u)
            .enumerate()
            .fold((f64::INFINITY, 0), |best, (cell, j)| if j < best.0 { (j, cell) } else { best })
    }

    fn jacobians<'a>(&'a self, u: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.cells.iter().zip(&self.elements).map(|(cell, element)| {
            let deformed = cell.map(|n| {
                let n = n as usize;
                std::array::from_fn(|i| self.points[n][i] + u[3 * n + i])
            });
            Tet4::new(deformed).volume / element.volume
        })
    }

    /// Nodal forces of a body force `density * gravity` [N], a quarter of each cell to each node.
    ///
    /// # Errors
    /// A number of densities that is neither 1 nor the number of cells; one negative or not finite.
    pub fn gravity(&self, gravity: [f64; 3], density: &[f64]) -> Result<Vec<f64>, Error> {
        if density.len() != 1 && density.len() != self.cells.len() {
            return Err(Error::input(format!(
                "{} densities for {} cells; give one, or one per cell",
                density.len(),
                self.cells.len()
            )));
        }
        if let Some(&bad) = density.iter().find(|d| !d.is_finite() || **d < 0.0) {
            return Err(Error::input(format!("density {bad} kg/m^3; it must be finite and >= 0")));
        }
        let mut force = vec![0.0; self.n_dofs()];
        for (cell, (nodes, element)) in self.cells.iter().zip(&self.elements).enumerate() {
            let rho = if density.len() == 1 { density[0] } else { density[cell] };
            for &node in nodes {
                for i in 0..3 {
                    force[3 * node as usize + i] += rho * gravity[i] * element.volume / 4.0;
                }
            }
        }
        Ok(force)
    }
}

fn check_mesh(points: &[[f64; 3]], cells: &[[u32; 4]]) -> Result<Vec<Tet4>, Error> {
    if cells.is_empty() {
        return Err(Error::input("the mesh has no tetrahedra; give at least one cell"));
    }
    if let Some((n, x)) = points.iter().enumerate().find(|(_, x)| x.iter().any(|c| !c.is_finite()))
    {
        return Err(Error::input(format!("point {n} is at {x:?}; coordinates must be finite")));
    }
    let mut elements = Vec::with_capacity(cells.len());
    for (cell, nodes) in cells.iter().enumerate() {
        if let Some(node) = nodes.iter().find(|&&node| node as usize >= points.len()) {
            return Err(Error::input(format!(
                "cell {cell} uses point {node}; there are {} points",
                points.len()
            )));
        }
        let element = Tet4::new(nodes.map(|n| points[n as usize]));
        if !(element.volume > 0.0) || element.gradients.iter().flatten().any(|g| !g.is_finite()) {
            return Err(Error::input(format!(
                "cell {cell} has volume {:.3e} m^3; repair the mesh so that every volume is positive",
                element.volume
            )));
        }
        elements.push(element);
    }
    let mut is_used = vec![false; points.len()];
    cells.iter().flatten().for_each(|&node| is_used[node as usize] = true);
    if let Some(loose) = is_used.iter().position(|used| !used) {
        return Err(Error::input(format!(
            "point {loose} belongs to no cell; remove loose points from the mesh"
        )));
    }
    Ok(elements)
}

/// Batches of cells that share a law parameter row, and each cell's place in them.
fn batches(cells: &[[u32; 4]], elements: &[Tet4], material: &Material) -> (Vec<Batch>, Vec<Slot>) {
    let mut order: Vec<usize> = (0..cells.len()).collect();
    let row = |cell: usize| material.of_cell(cell);
    order.sort_by(|&a, &b| {
        row(a)
            .iter()
            .zip(row(b))
            .map(|(x, y)| x.total_cmp(y))
            .find(|o| o.is_ne())
            .unwrap_or(a.cmp(&b))
    });
    let mut batches = Vec::with_capacity(cells.len() / LANES + 1);
    let mut slots = vec![Slot { batch: 0, lane: 0 }; cells.len()];
    for group in order.chunk_by(|&a, &b| row(a) == row(b)) {
        for members in group.chunks(LANES) {
            for (lane, &cell) in members.iter().enumerate() {
                slots[cell] = Slot { batch: batches.len() as u32, lane: lane as u8 };
            }
            batches.push(batch(members, cells, elements, row(members[0])));
        }
    }
    (batches, slots)
}

fn batch(members: &[usize], cells: &[[u32; 4]], elements: &[Tet4], parameters: &[f64]) -> Batch {
    let cell_of = |lane: usize| members[lane.min(members.len() - 1)];
    let lanes = |f: &dyn Fn(&Tet4) -> f64| Lanes(std::array::from_fn(|l| f(&elements[cell_of(l)])));
    let mut volume = lanes(&|e| e.volume);
    for lane in members.len()..LANES {
        volume[lane] = 0.0;
    }
    Batch {
        nodes: std::array::from_fn(|l| cells[cell_of(l)]),
        gradients: std::array::from_fn(|a| std::array::from_fn(|i| lanes(&|e| e.gradients[a][i]))),
        volume,
        parameters: parameters.to_vec(),
    }
}

fn incidence(n: usize, cells: &[[u32; 4]], slots: &[Slot]) -> (Vec<(Slot, u8)>, Vec<u32>) {
    let mut start = vec![0u32; n + 1];
    for &node in cells.iter().flatten() {
        start[node as usize + 1] += 1;
    }
    for node in 0..n {
        start[node + 1] += start[node];
    }
    let mut fill = start.clone();
    let mut incidence = vec![(Slot { batch: 0, lane: 0 }, 0); 4 * cells.len()];
    for (cell, nodes) in cells.iter().enumerate() {
        for (a, &node) in nodes.iter().enumerate() {
            incidence[fill[node as usize] as usize] = (slots[cell], a as u8);
            fill[node as usize] += 1;
        }
    }
    (incidence, start)
}
