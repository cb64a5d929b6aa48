//! A body: mesh, element and law together, as the integrals the solvers ask for.
//!
//! Cells are grouped in batches of [`LANES`](crate::number::LANES) that go through the same arithmetic side by side;
//! their results are gathered node by node (and block by block) through maps made once, so sums
//! come out the same whatever the number of threads.

mod blocks;
mod cell_tangent;
mod cells;
mod check;
mod clusters;
mod convex;
mod kernels;
mod outliers;
mod partition;
mod product;
mod quadrature_points;
mod series;
mod subset;
mod tangent;
#[cfg(test)]
mod tests;

pub use blocks::{BlockPattern, SymmetricBlocks, add_block_product};
pub use kernels::UPRIGHT;
pub use outliers::Outlier;
pub use product::TangentProduct;
pub use quadrature_points::QuadraturePoint;
pub use subset::{SharedNodes, WeightedSubset};
pub use tangent::Curvature;

use crate::element::{Element, Geometry, Shape, Tet4, Tet10};
use crate::error::Error;
use crate::law::Material;
use crate::mesh;
use crate::simd;
use crate::tensor::{cofactor, determinant};
use crate::threads::share;
use cells::{CellBatches, pairs_of};
use clusters::{Around, Clusters};
use partition::Partition;
use std::sync::Arc;

/// A hyperelastic body of tetrahedra, Total Lagrangian.
pub struct Body {
    element: Element,
    points: Vec<[f64; 3]>,
    cells: Vec<[u32; 4]>,
    /// Edges whose midpoints are nodes.
    edges: Vec<[u32; 2]>,
    geometry: Vec<Geometry>,
    material: Arc<Material>,
    pattern: Arc<BlockPattern>,
    assembly: Arc<Assembly>,
}

enum Assembly {
    P1(CellBatches<Tet4, 4>),
    P1MeanVolume(CellBatches<Tet4, 4>, Box<Clusters>),
    P2(CellBatches<Tet10, 10>),
}

/// The same expression on the cells of any element.
macro_rules! on_cells {
    ($body:expr, $cells:ident => $expression:expr) => {
        match &*$body.assembly {
            Assembly::P1($cells) | Assembly::P1MeanVolume($cells, _) => $expression,
            Assembly::P2($cells) => $expression,
        }
    };
}

impl Body {
    /// A body of linear tetrahedra, see [`Body::with_element`].
    ///
    /// # Errors
    /// As there.
    pub fn new(
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        material: Material,
    ) -> Result<Self, Error> {
        Self::with_element(Element::P1, points, cells, material)
    }

    /// Builds the element geometry and the assembly maps from the points and cells of a linear
    /// mesh; the midpoints of quadratic cells are added after its points.
    ///
    /// # Errors
    /// No cells; a node index out of range; a coordinate that is not finite; a cell of no or
    /// negative volume; a number of law parameter rows that is neither 1 nor the number of cells; a processor that lacks
    /// the vector instructions of the kernels.
    pub fn with_element(
        element: Element,
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        material: Material,
    ) -> Result<Self, Error> {
        simd::check().map_err(Error::input)?;
        let geometry = check::mesh(&points, &cells)?;
        check::parameter_rows(&material, cells.len())?;
        Ok(Self::assemble(element, points, cells, geometry, material, Partition::new))
    }

    /// From sound cells of this geometry; `partition` puts them in clusters where the element wants some.
    fn assemble(
        element: Element,
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        geometry: Vec<Geometry>,
        material: Material,
        partition: impl FnOnce(&[[u32; 4]], &Material) -> Partition,
    ) -> Self {
        let corners = points.len();
        let is_quadratic = element == Element::P2;
        let edges = if is_quadratic { mesh::edges(&cells) } else { Vec::new() };
        let points = mesh::with_midpoints(&points, &edges);
        let n = points.len();
        let (pattern, assembly) = match element {
            Element::P1 => {
                let pattern = BlockPattern::new(n, cells.iter().flat_map(pairs_of));
                let cells = CellBatches::new(cells.clone(), &geometry, &material, &pattern, n);
                (pattern, Assembly::P1(cells))
            }
            Element::P1MeanVolume => {
                let parts = partition(&cells, &material);
                let pattern = BlockPattern::new(n, parts.pairs());
                let batched = CellBatches::new(cells.clone(), &geometry, &material, &pattern, n);
                let slots = &batched.slots;
                let clusters = Clusters::new(&parts, &cells, slots, &geometry, &material, &pattern);
                (pattern, Assembly::P1MeanVolume(batched, Box::new(clusters)))
            }
            Element::P2 => {
                let nodes = mesh::quadratic_cells(corners, &cells, &edges);
                let pattern = BlockPattern::new(n, nodes.iter().flat_map(pairs_of));
                let cells = CellBatches::new(nodes, &geometry, &material, &pattern, n);
                (pattern, Assembly::P2(cells))
            }
        };
        let (material, pattern) = (Arc::new(material), Arc::new(pattern));
        let assembly = Arc::new(assembly);
        Body { element, points, cells, edges, geometry, material, pattern, assembly }
    }

    /// The element.
    pub fn element(&self) -> Element {
        self.element
    }

    /// Rest positions of all nodes [m]: the corners of the cells, then the midpoints of [`Body::edges`].
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Corners of the cells, positively oriented.
    pub fn cells(&self) -> &[[u32; 4]] {
        &self.cells
    }

    /// The edges whose midpoints are nodes, none for linear elements.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Number of nodes that are corners of cells.
    pub fn n_corners(&self) -> usize {
        self.points.len() - self.edges.len()
    }

    /// Boundary triangles, oriented outward; a quadratic face counts as four.
    pub fn surface(&self) -> Vec<[u32; 3]> {
        let triangles = mesh::surface(&self.points, &self.cells);
        if self.edges.is_empty() {
            return triangles;
        }
        mesh::quadratic_surface(self.n_corners(), &triangles, &self.edges)
    }

    /// The law.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Number of degrees of freedom, three per node.
    pub fn n_dofs(&self) -> usize {
        3 * self.points.len()
    }

    /// Whether threads share the loops over its cells.
    pub fn is_shared(&self) -> bool {
        share(on_cells!(self, cells => cells.n_tasks()))
    }

    /// Volume at rest [m^3].
    pub fn rest_volume(&self) -> f64 {
        self.geometry.iter().map(|g| g.volume).sum()
    }

    /// Sum of volumes times their largest law parameter [J]: the size of the terms that cancel in
    /// the energy.
    pub fn energy_scale(&self) -> f64 {
        let of_cell = |(cell, g): (usize, &Geometry)| g.volume * self.material.scale(cell);
        self.geometry.iter().enumerate().map(of_cell).sum()
    }

    /// Norm of the nodal forces of a stress of the size of the moduli [N]: their rounding is this
    /// times machine precision, however small the strain.
    pub fn force_scale(&self) -> f64 {
        let squares = self.geometry.iter().enumerate().map(|(cell, g)| {
            let sum: [f64; 3] = std::array::from_fn(|i| g.gradients.iter().map(|g| g[i]).sum());
            let gradients = g.gradients.iter().flatten().chain(&sum).map(|g| g * g).sum::<f64>();
            (self.material.scale(cell) * g.volume).powi(2) * gradients
        });
        squares.sum::<f64>().sqrt()
    }

    /// Volume at displacement `u` [m^3].
    pub fn volume(&self, u: &[f64]) -> f64 {
        let jacobians = self.volume_ratios(u);
        let points = jacobians.len() / self.cells.len();
        let ratio = |of_cell: &[f64]| of_cell.iter().sum::<f64>() / points as f64;
        jacobians.chunks(points).zip(&self.geometry).map(|(j, g)| ratio(j) * g.volume).sum()
    }

    /// Volume ratios `J` at the quadrature points, cell by cell.
    pub fn volume_ratios(&self, u: &[f64]) -> Vec<f64> {
        on_cells!(self, cells => cells.jacobians(&self.geometry, u))
    }

    /// The smallest volume ratio `J` at a quadrature point, and its cell.
    pub fn smallest_jacobian(&self, u: &[f64]) -> (f64, usize) {
        let jacobians = self.volume_ratios(u);
        let points = jacobians.len() / self.cells.len();
        jacobians.iter().enumerate().fold((f64::INFINITY, 0), |best, (k, &j)| {
            if j < best.0 { (j, k / points) } else { best }
        })
    }

    /// The quadrature points whose `J` is not inside of an open range, cell by cell; none for laws that do not forbid
    /// inversion.
    pub fn outliers(&self, u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        if !self.material.law().forbids_inversion() {
            return Vec::new();
        }
        on_cells!(self, cells => cells.outliers(&self.geometry, u, range))
    }

    /// Nodal forces of a body force `density * gravity` [N], the work of a constant force per
    /// volume in each cell.
    ///
    /// # Errors
    /// A number of densities that is neither 1 nor the number of cells; one negative or not finite.
    pub fn gravity(&self, gravity: [f64; 3], density: &[f64]) -> Result<Vec<f64>, Error> {
        check::densities(density, self.cells.len())?;
        let mut force = vec![0.0; self.n_dofs()];
        on_cells!(self, cells => cells.for_each_load(|cell, node, part| {
            let rho = if density.len() == 1 { density[0] } else { density[cell] };
            for i in 0..3 {
                let weight = rho * gravity[i] * self.geometry[cell].volume;
                force[3 * node as usize + i] += part * weight;
            }
        }));
        Ok(force)
    }

    /// Strain energy [J]; infinite where a law that forbids it finds a cell turned inside out.
    pub fn energy(&self, u: &[f64]) -> f64 {
        let law = self.material.law();
        match &*self.assembly {
            Assembly::P1(cells) => cells.energy(law, Around::default(), u),
            Assembly::P2(cells) => cells.energy(law, Around::default(), u),
            Assembly::P1MeanVolume(cells, clusters) => {
                let local = cells.energy(law, clusters.around(&[]), u);
                if local.is_infinite() {
                    return local;
                }
                local + clusters.energy(law, &clusters.volumes(law, cells, u))
            }
        }
    }

    /// Internal force `f_int = dW/du` [N], in place, and with it what [`Body::energy`] says; where that is infinite,
    /// the force means nothing.
    pub fn internal_force(&self, u: &[f64], force: &mut [f64]) -> f64 {
        self.internal_force_within(u, UPRIGHT, force)
    }

    /// [`Body::internal_force`] that finds the energy infinite where the `J` of a cell is outside of a range, for laws
    /// that forbid inversion.
    pub fn internal_force_within(&self, u: &[f64], range: [f64; 2], force: &mut [f64]) -> f64 {
        let (law, at) = (self.material.law(), (u, range));
        match &*self.assembly {
            Assembly::P1(cells) => cells.force(law, Around::default(), at, force),
            Assembly::P2(cells) => cells.force(law, Around::default(), at, force),
            Assembly::P1MeanVolume(cells, clusters) => {
                let volumes = clusters.volumes(law, cells, u);
                let (pressures, _) = clusters.pressures(law, &volumes);
                let local = cells.force(law, clusters.around(&pressures), at, force);
                if local.is_infinite() { local } else { local + clusters.energy(law, &volumes) }
            }
        }
    }

    /// Internal force and tangent `d f_int / du`, in place.
    pub fn internal_force_and_tangent(
        &self,
        u: &[f64],
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        self.linearize(u, Curvature::Exact, force, tangent);
    }

    /// Internal force and tangent, in place; a [`Curvature::Projected`] tangent is positive semidefinite everywhere.
    pub fn linearize(
        &self,
        u: &[f64],
        curvature: Curvature,
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let (law, at) = (self.material.law(), (u, curvature));
        let nothing = |_: usize, _: &mut [f64; 9]| ();
        match &*self.assembly {
            Assembly::P1(cells) => {
                cells.force_and_tangent(law, Around::default(), at, force, tangent, nothing);
            }
            Assembly::P2(cells) => {
                cells.force_and_tangent(law, Around::default(), at, force, tangent, nothing);
            }
            Assembly::P1MeanVolume(cells, clusters) => {
                let volumes = clusters.volumes(law, cells, u);
                let shared = clusters.tangent(law, &volumes, curvature);
                let products = |block: usize, out: &mut [f64; 9]| {
                    clusters.add_products(&shared, block, out);
                };
                let around = clusters.around(&shared.pressures);
                cells.force_and_tangent(law, around, at, force, tangent, products);
            }
        }
    }

    /// Which blocks its tangent has.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// A tangent of the right shape, zero.
    pub fn zero_tangent(&self) -> SymmetricBlocks {
        SymmetricBlocks::zeros(&self.pattern)
    }
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// `det F` at the quadrature points, cell by cell.
    fn jacobians(&self, geometry: &[Geometry], u: &[f64]) -> Vec<f64> {
        self.gradients(geometry, u).iter().map(|f| determinant(f, &cofactor(f))).collect()
    }

    /// Calls with cell, node and the integral of the node's shape function over a cell of volume 1.
    fn for_each_load(&self, mut visit: impl FnMut(usize, u32, f64)) {
        for (cell, nodes) in self.nodes.iter().enumerate() {
            nodes.iter().zip(E::LOADS).for_each(|(&node, part)| visit(cell, node, part));
        }
    }
}
