//! A body: mesh, element and law together, as the integrals that the solvers need.
//!
//! Cells are grouped in batches of [`LANES`](crate::number::LANES) that go through the same arithmetic side by side;
//! their results are gathered node by node (and block by block) through maps made once, so sums
//! come out the same whatever the number of threads.

mod batch;
mod block_product;
mod blocks;
mod cell_order;
mod cell_tangent;
mod cells;
mod check;
mod clusters;
mod contact_pair;
mod convex;
mod curvature;
mod elements;
mod integrals;
mod kernels;
mod layout;
mod links;
mod mean_volume;
mod outliers;
mod partition;
mod parts;
mod product;
mod programmed;
mod quadrature_points;
mod self_contact;
mod series;
mod subset;
mod tangent;
mod task_sums;
mod tasks;
#[cfg(test)]
mod tests;
mod ties;
mod waves;
mod workspace;

pub use blocks::{BlockPattern, Source, SymmetricBlocks, add_block_product};
pub use clusters::SharedTangent;
use clusters::averaged_part;
pub use contact_pair::ContactPair;
pub use curvature::Curvature;
pub use kernels::UPRIGHT;
pub use links::Link;
pub use outliers::Outlier;
pub(crate) use parts::part_of_nodes;
pub use product::TangentProduct;
pub use programmed::{ClusterNodes, ProgrammedCells, ProgrammedSeries};
pub use quadrature_points::QuadraturePoint;
pub use self_contact::SelfContact;
pub use subset::{SharedNodes, WeightedSubset};
pub use ties::Ties;
pub use workspace::Workspace;

use crate::element::{Element, Geometry};
use crate::error::Error;
use crate::law::Material;
use crate::mesh;
use crate::number::{Monomials, Real};
use crate::simd;
use crate::threads::share;
use integrals::ElementIntegrals;
use layout::Layout;
use partition::Partition;
use series::{Along, SeriesIntegrals};
use std::sync::Arc;
use ties::Tied;

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
    integrals: Arc<dyn ElementIntegrals>,
    tied: Option<Arc<Tied>>,
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
        Self::tied(element, points, cells, material, Ties::default())
    }

    /// As [`Body::with_element`], with elastic supports and bonds; their nodes are those of the element.
    ///
    /// # Errors
    /// As there, and those of [`Ties::check`]; a contact pair with a triangle that is no face of the surface.
    pub fn tied(
        element: Element,
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        material: Material,
        ties: Ties,
    ) -> Result<Self, Error> {
        simd::check().map_err(Error::input)?;
        let geometry = check::mesh(&points, &cells)?;
        check::parameter_rows(&material, cells.len())?;
        let edges = if element.is_quadratic() { mesh::edges(&cells).len() } else { 0 };
        ties.check(points.len() + edges)?;
        ties.check_pairs(&points, &cells)?;
        Ok(Self::assemble(element, points, cells, geometry, (material, ties), Partition::new))
    }

    /// Builds the body from checked cells of this geometry; `partition` puts them in clusters if the element needs
    /// them.
    fn assemble(
        element: Element,
        points: Vec<[f64; 3]>,
        cells: Vec<[u32; 4]>,
        geometry: Vec<Geometry>,
        (material, mut ties): (Material, Ties),
        partition: impl FnOnce(&[[u32; 4]], &Material) -> Partition,
    ) -> Self {
        let edges = if element.is_quadratic() { mesh::edges(&cells) } else { Vec::new() };
        let n_corners = points.len();
        let points = mesh::with_midpoints(&points, &edges);
        if element.is_quadratic() {
            ties.contact_pairs.iter_mut().for_each(|pair| pair.cut(&points, &edges));
        }
        let layout = Layout {
            cells: &cells,
            edges: &edges,
            n_corners,
            geometry: &geometry,
            material: &material,
            ties: &ties,
        };
        let (pattern, integrals) = elements::integrals(element, &layout, partition);
        let tied = Tied::new(ties, &pattern).map(Arc::new);
        let (material, pattern) = (Arc::new(material), Arc::new(pattern));
        Body { element, points, cells, edges, geometry, material, pattern, integrals, tied }
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

    /// Its elastic supports and bonds, if it has some.
    pub fn ties(&self) -> Option<&Ties> {
        self.tied.as_deref().map(|tied| &tied.ties)
    }

    /// Whether springs or cables act on it, which no series knows.
    pub fn has_links(&self) -> bool {
        self.ties().is_some_and(|ties| !ties.links.is_empty())
    }

    /// The surfaces of it that may touch each other.
    pub fn contact_pairs(&self) -> &[ContactPair] {
        self.ties().map_or(&[], |ties| &ties.contact_pairs)
    }

    /// The same body, with a pattern that also couples what contact pairs bring together at a displacement.
    pub fn widened(&self, u: &[f64]) -> Self {
        let mut ties = self.ties().cloned().unwrap_or_default();
        let at = |(k, x): (usize, &[f64; 3])| std::array::from_fn(|i| x[i] + u[3 * k + i]);
        let places: Vec<[f64; 3]> = self.points.iter().enumerate().map(at).collect();
        ties.contact_pairs.iter_mut().for_each(|pair| pair.reserve(&places));
        let corners = self.points[..self.n_corners()].to_vec();
        let law = ((*self.material).clone(), ties);
        let (cells, geometry) = (self.cells.clone(), self.geometry.clone());
        Self::assemble(self.element, corners, cells, geometry, law, Partition::new)
    }

    /// Number of degrees of freedom, three per node.
    pub fn n_dofs(&self) -> usize {
        3 * self.points.len()
    }

    /// Whether threads share the loops over its cells.
    pub fn is_shared(&self) -> bool {
        share(self.integrals.n_tasks())
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
        self.integrals.jacobians(&self.geometry, u)
    }

    /// The smallest volume ratio `J` at a quadrature point, and its cell.
    pub fn smallest_jacobian(&self, u: &[f64]) -> (f64, usize) {
        self.integrals.smallest_jacobian(&self.geometry, u)
    }

    /// The quadrature points whose `J` is outside an open range, cell by cell; none for laws that do not forbid
    /// inversion.
    pub fn outliers(&self, u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        if !self.material.law().forbids_inversion() {
            return Vec::new();
        }
        self.integrals.outliers(&self.geometry, u, range)
    }

    /// Nodal forces of a body force `density * gravity` [N], the work of a constant force per
    /// volume in each cell.
    ///
    /// # Errors
    /// A number of densities that is neither 1 nor the number of cells; one negative or not finite.
    pub fn gravity(&self, gravity: [f64; 3], density: &[f64]) -> Result<Vec<f64>, Error> {
        check::densities(density, self.cells.len())?;
        let mut force = vec![0.0; self.n_dofs()];
        let of_cell = |cell: usize| {
            let rho = if density.len() == 1 { density[0] } else { density[cell] };
            gravity.map(|g| rho * g * self.geometry[cell].volume)
        };
        self.integrals.add_body_force(&of_cell, &mut force);
        Ok(force)
    }

    /// Strain energy and that of the ties [J]; infinite if a cell is inverted and the law forbids that.
    pub fn energy(&self, u: &[f64]) -> f64 {
        self.energy_within(u, UPRIGHT)
    }

    /// As [`Body::energy`], but for laws that forbid inversion infinite if the `J` of a cell is outside a range.
    pub fn energy_within(&self, u: &[f64], range: [f64; 2]) -> f64 {
        let energy = self.integrals.energy(self.material.law(), (u, range));
        self.ties().map_or(energy, |ties| energy + ties.energy(u))
    }

    /// Internal force `f_int = dW/du` [N], in place; returns [`Body::energy`]. If that is infinite, the force has no
    /// meaning.
    pub fn internal_force(&self, u: &[f64], force: &mut [f64]) -> f64 {
        self.internal_force_within(u, UPRIGHT, force)
    }

    /// As [`Body::internal_force`], but for laws that forbid inversion the energy is infinite if the `J` of a cell is
    /// outside a range.
    pub fn internal_force_within(&self, u: &[f64], range: [f64; 2], force: &mut [f64]) -> f64 {
        self.internal_force_in(&mut Workspace::default(), (u, range), force)
    }

    /// As [`Body::internal_force_within`], with memory that is kept from one evaluation to the next.
    pub fn internal_force_in(
        &self,
        workspace: &mut Workspace,
        (u, range): (&[f64], [f64; 2]),
        force: &mut [f64],
    ) -> f64 {
        let energy = self.integrals.force(self.material.law(), (u, range), workspace, force);
        self.tied.as_ref().map_or(energy, |tied| energy + tied.ties.add_internal_force(u, force))
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
        self.linearize_in(&mut Workspace::default(), (u, curvature), force, tangent);
    }

    /// As [`Body::linearize`], with memory that is kept from one evaluation to the next.
    pub fn linearize_in(
        &self,
        workspace: &mut Workspace,
        (u, curvature): (&[f64], Curvature),
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let law = self.material.law();
        self.integrals.force_and_tangent(law, (u, curvature), workspace, force, tangent);
        if let Some(tied) = &self.tied {
            tied.ties.add_internal_force(u, force);
            tied.add_stiffness((u, curvature), 1.0, tangent);
        }
    }

    /// Adds a share of what ties contribute to the internal force [N].
    pub fn add_tie_force(&self, u: &[f64], share: f64, force: &mut [f64]) {
        if let Some(ties) = self.ties() {
            ties.add_share_of_force(u, share, force);
        }
    }

    /// Adds a share of what ties contribute to the tangent.
    pub fn add_tie_stiffness(
        &self,
        at: (&[f64], Curvature),
        share: f64,
        tangent: &mut SymmetricBlocks,
    ) {
        if let Some(tied) = &self.tied {
            tied.add_stiffness(at, share, tangent);
        }
    }

    /// Degree-p coefficients of the internal force, p being the order of `table`.
    ///
    /// `displacement` holds `stride >= table.len()` coefficients for each degree of freedom (the
    /// displacement of the base state first); only those of degree below p are read, so that the
    /// result is the nonlinear right-hand side with `u_p = 0`, to which ties, being linear, add nothing; springs and cables are left out. `force` receives
    /// `table.of_degree(p).len()` coefficients for each degree of freedom.
    pub fn force_series<T: Real>(
        &self,
        table: &'static Monomials,
        displacement: &[T],
        stride: usize,
        force: &mut [T],
    ) where
        dyn ElementIntegrals: SeriesIntegrals<T>,
    {
        force.fill(T::default());
        let along = Along { table, displacement, stride };
        self.integrals.add_force_series(&self.material, &self.geometry, along, force);
    }

    /// The pattern of the tangent's blocks.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// A tangent of the right shape, zero.
    pub fn zero_tangent(&self) -> SymmetricBlocks {
        SymmetricBlocks::zeros(&self.pattern)
    }
}
