//! The arrays of a reduced model.

/// The arrays of a model file (docs/model-file.md), flat and row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays {
    /// Positions (n, 3) [m] in the shape that is touched: at rest, or under the preload.
    pub points: Vec<f64>,
    /// Displacement (n, 3) from rest to `points` under the preload [m]; empty if there is none.
    pub preload: Vec<f64>,
    /// Tetrahedra (m, 4).
    pub cells: Vec<u32>,
    /// Fixed nodes.
    pub fixed: Vec<u32>,
    /// Elastic supports (`Body::ties`): where the nodes of each sample start (s + 1,), empty without supports.
    pub tie_start: Vec<u32>,
    /// Nodes of the samples.
    pub tie_nodes: Vec<u32>,
    /// Their weights.
    pub tie_weights: Vec<f64>,
    /// Stiffness of each sample (s, 9) [N/m].
    pub tie_stiffness: Vec<f64>,
    /// Law parameters (1 or m, k).
    pub law_parameters: Vec<f64>,
    /// Boundary triangles of the organ (t, 3), by node.
    pub surface: Vec<u32>,
    /// Nodes of the boundary, ascending: the rows of surface modes.
    pub surface_nodes: Vec<u32>,
    /// Load positions (p,), by node.
    pub positions: Vec<u32>,
    /// Touchable triangles (q, 3), by position.
    pub touchable: Vec<u32>,
    /// Edges of touchable triangles (e, 2), by position.
    pub edges: Vec<u32>,
    /// The edges 01, 12, 20 of each touchable triangle (q, 3).
    pub triangle_edges: Vec<u32>,
    /// Where the patch of each position starts (p + 1,).
    pub patch_start: Vec<u32>,
    /// Nodes of the patches.
    pub patch_nodes: Vec<u32>,
    /// Weights of the patches, sum 1 for each.
    pub patch_weights: Vec<f64>,
    /// Region of each position and of each edge.
    pub position_region: Vec<u32>,
    /// Region of each edge.
    pub edge_region: Vec<u32>,
    /// Where the modes of each region start (r + 1,).
    pub region_start: Vec<u32>,
    /// Metres for one unit of a stored mode (modes,).
    pub mode_scale: Vec<f32>,
    /// Modes at the surface nodes (modes, 3 s).
    pub surface_modes: Vec<i16>,
    /// Modes at the other nodes (modes, 3 (n - s)).
    pub interior_modes: Vec<i16>,
    /// Cells whose law the parameter changes; none for all.
    pub parameter_cells: Vec<u32>,
    /// The arrays from which touches are answered.
    pub answers: Answers,
    /// The answers at each node of the parameter; empty if there is none.
    pub family: Answers,
}

/// The arrays from which touches are answered, and which depend on a parameter; in a family, all members one after the
/// other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Compliance of each position (p, 3, 3) [m/N].
    pub compliance: Vec<f64>,
    /// Compliance between the two positions of an edge (e, 3, 3): mean displacement of the second
    /// patch under a force on the first [m/N].
    pub cross_compliance: Vec<f64>,
    /// Force coefficients (p, terms, 3) [N/m^degree].
    pub force: Vec<f64>,
    /// Force coefficients of edge midpoints (e, edge terms, 3).
    pub edge_force: Vec<f64>,
    /// Forms of edges in the energy of third degree (e, 10) [J/N^3]; empty if the second order is interpolated.
    pub edge_energy: Vec<f64>,
    /// The same of the touchable triangles (q, 10).
    pub triangle_energy: Vec<f64>,
    /// Sketches of the fields (p, terms, 24), by which their orders are summed in a Padé form; empty
    /// where they are summed as a polynomial.
    pub sketch: Vec<f32>,
    /// Inner products of the fields of equal degree (p, sum of squares), for the error estimate.
    pub norms: Vec<f32>,
    /// Compression error of each position at full depth, worst direction, relative to the field.
    pub compression: Vec<f32>,
    /// The same of the first order alone, which remains in shallow touches; empty in files of format 1.
    pub linear_compression: Vec<f32>,
    /// How fast the organ departs from the path of the series (p, 24), in 24 directions: errors of trusted touches, measured
    /// off-line in units of the cube of what the rest of the series is in proportion to; empty where that is not
    /// measured.
    pub departure: Vec<f32>,
    /// Mode amplitudes of each position: (terms, modes of its region), position after position.
    pub position_coefficients: Vec<f32>,
    /// Mode amplitudes of each edge: (edge terms, modes of its region), edge after edge.
    pub edge_coefficients: Vec<f32>,
}

impl Answers {
    /// Name and length of each array.
    pub(super) fn lengths(&self) -> [(&'static str, usize); 13] {
        [
            ("compliance", self.compliance.len()),
            ("cross_compliance", self.cross_compliance.len()),
            ("force", self.force.len()),
            ("edge_force", self.edge_force.len()),
            ("edge_energy", self.edge_energy.len()),
            ("triangle_energy", self.triangle_energy.len()),
            ("sketch", self.sketch.len()),
            ("norms", self.norms.len()),
            ("compression", self.compression.len()),
            ("linear_compression", self.linear_compression.len()),
            ("departure", self.departure.len()),
            ("position_coefficients", self.position_coefficients.len()),
            ("edge_coefficients", self.edge_coefficients.len()),
        ]
    }
}
