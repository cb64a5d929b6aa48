//! The arrays of a reduced model and the checks that make them safe to evaluate.

use super::family::check_family;
use super::metadata::{FORMAT_VERSION, Metadata};
use crate::error::Error;
use crate::mesh::TriangleTree;
use crate::number::Monomials;

/// The arrays of a model file (docs/model-file.md), flat and row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays {
    /// Positions (n, 3) [m] in the shape that is touched: at rest, or under the preload.
    pub points: Vec<f64>,
    /// Displacement (n, 3) from rest to `points` under the preload [m]; empty where there is none.
    pub preload: Vec<f64>,
    /// Tetrahedra (m, 4).
    pub cells: Vec<u32>,
    /// Fixed nodes.
    pub fixed: Vec<u32>,
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
    /// Compliance of each position (p, 3, 3) [m/N].
    pub compliance: Vec<f64>,
    /// Compliance between the two positions of an edge (e, 3, 3): mean displacement of the second
    /// patch under a force on the first [m/N].
    pub cross_compliance: Vec<f64>,
    /// Force coefficients (p, terms, 3) [N/m^degree].
    pub force: Vec<f64>,
    /// Force coefficients of edge midpoints (e, edge terms, 3).
    pub edge_force: Vec<f64>,
    /// Inner products of the fields of equal degree (p, sum of squares), for the error estimate.
    pub norms: Vec<f32>,
    /// Compression error of each position at full depth, worst direction, relative to the field.
    pub compression: Vec<f32>,
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
    /// Mode amplitudes of each position: (terms, modes of its region), position after position.
    pub position_coefficients: Vec<f32>,
    /// Mode amplitudes of each edge: (edge terms, modes of its region), edge after edge.
    pub edge_coefficients: Vec<f32>,
    /// Cells whose law the parameter changes; none for all.
    pub parameter_cells: Vec<u32>,
    /// The answers at each node of the parameter; empty where there is none.
    pub family: Answers,
}

/// The arrays that depend on a parameter, of all members of a family one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)] // as in `Arrays`
pub struct Answers {
    pub compliance: Vec<f64>,
    pub cross_compliance: Vec<f64>,
    pub force: Vec<f64>,
    pub edge_force: Vec<f64>,
    pub norms: Vec<f32>,
    pub compression: Vec<f32>,
    pub position_coefficients: Vec<f32>,
    pub edge_coefficients: Vec<f32>,
}

/// A reduced model, checked and ready to evaluate.
#[derive(Clone, Debug)]
pub struct ReducedModel {
    pub(super) metadata: Metadata,
    pub(super) arrays: Arrays,
    /// Exponents of the series' monomials, the constant left out.
    pub(super) exponents: Vec<[u8; 3]>,
    /// How many of them edges have: those of degree 2 to `edge_order`, at the front of degree >= 2.
    pub(super) edge_terms: usize,
    pub(super) position_offset: Vec<usize>,
    pub(super) edge_offset: Vec<usize>,
    pub(super) largest_region: usize,
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) tree: TriangleTree,
    /// Mean edge length of the touchable triangles [m].
    pub(super) edge_length: f64,
    /// Nodes that are not on the surface, ascending.
    pub(super) interior_nodes: Vec<u32>,
}

impl ReducedModel {
    /// Checks every shape, index range and value, then builds what the evaluator looks up.
    ///
    /// # Errors
    /// [`Error::ModelFile`] naming the array, the place and the value.
    pub fn new(metadata: Metadata, arrays: Arrays) -> Result<Self, Error> {
        check_metadata(&metadata)?;
        let counts = Counts::new(&metadata, &arrays)?;
        check_shapes(&arrays, &counts)?;
        check_indices(&arrays, &counts)?;
        check_family(metadata.parameter.as_ref(), &arrays)?;
        check_values(&arrays)?;
        let (position_offset, edge_offset) = offsets(&arrays, &counts)?;

        let sizes = arrays.region_start.windows(2).map(|w| (w[1] - w[0]) as usize);
        let largest_region = sizes.max().unwrap_or(0);
        let position = |&node: &u32| {
            let n = 3 * node as usize;
            [arrays.points[n], arrays.points[n + 1], arrays.points[n + 2]]
        };
        let positions: Vec<[f64; 3]> = arrays.positions.iter().map(position).collect();
        let triangles: Vec<[u32; 3]> =
            arrays.touchable.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let tree = TriangleTree::new(&positions, &triangles);
        let lengths = arrays.edges.chunks_exact(2).map(|e| {
            let (a, b) = (positions[e[0] as usize], positions[e[1] as usize]);
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
        });
        let edge_length = lengths.sum::<f64>() / counts.edges as f64;
        let mut is_surface = vec![false; counts.points];
        arrays.surface_nodes.iter().for_each(|&node| is_surface[node as usize] = true);
        let interior_nodes =
            (0..counts.points as u32).filter(|&node| !is_surface[node as usize]).collect();
        Ok(ReducedModel {
            exponents: Monomials::of(3, metadata.order).exponents()[1..].to_vec(),
            edge_terms: counts.edge_terms,
            position_offset,
            edge_offset,
            largest_region,
            positions,
            triangles,
            tree,
            edge_length,
            interior_nodes,
            metadata,
            arrays,
        })
    }

    /// What the model says about itself.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Its arrays.
    pub fn arrays(&self) -> &Arrays {
        &self.arrays
    }

    /// Number of nodes of the organ.
    pub fn n_points(&self) -> usize {
        self.arrays.points.len() / 3
    }

    /// Number of load positions.
    pub fn n_positions(&self) -> usize {
        self.arrays.positions.len()
    }

    /// Number of modes of all regions.
    pub fn n_modes(&self) -> usize {
        self.arrays.mode_scale.len()
    }

    /// Number of monomials of the series.
    pub fn n_terms(&self) -> usize {
        self.exponents.len()
    }
}

pub(super) fn bad(sentence: String) -> Error {
    Error::ModelFile(sentence)
}

fn check_metadata(m: &Metadata) -> Result<(), Error> {
    if m.format_version != FORMAT_VERSION {
        return Err(bad(format!(
            "format version {}; this version reads {FORMAT_VERSION}",
            m.format_version
        )));
    }
    if !(2..=8).contains(&m.order) || !(1..=m.order).contains(&m.edge_order) {
        return Err(bad(format!(
            "order {} with edge order {}; orders are 2 to 8, edge orders 1 to the order",
            m.order, m.edge_order
        )));
    }
    for (name, value) in [
        ("radius", m.radius),
        ("depth", m.depth),
        ("tolerance", m.tolerance),
        ("diagonal", m.diagonal),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(bad(format!("{name} = {value}; it must be positive")));
        }
    }
    Ok(())
}

/// Sizes that shapes are checked against.
struct Counts {
    points: usize,
    surface: usize,
    positions: usize,
    touchable: usize,
    edges: usize,
    regions: usize,
    modes: usize,
    terms: usize,
    edge_terms: usize,
    norms: usize,
}

impl Counts {
    fn new(metadata: &Metadata, a: &Arrays) -> Result<Self, Error> {
        let monomials = Monomials::of(3, metadata.order);
        let squares = (1..=metadata.order).map(|d| monomials.of_degree(d).len().pow(2));
        let counts = Counts {
            points: a.points.len() / 3,
            surface: a.surface_nodes.len(),
            positions: a.positions.len(),
            touchable: a.touchable.len() / 3,
            edges: a.edges.len() / 2,
            regions: a.region_start.len().saturating_sub(1),
            modes: a.mode_scale.len(),
            terms: monomials.len() - 1,
            edge_terms: monomials.up_to(metadata.edge_order) - monomials.up_to(1),
            norms: squares.sum(),
        };
        let needed = [
            ("points", counts.points),
            ("positions", counts.positions),
            ("touchable", counts.touchable),
            ("region_start", counts.regions),
            ("mode_scale", counts.modes),
        ];
        match needed.iter().find(|(_, n)| *n == 0) {
            Some((name, _)) => Err(bad(format!("array {name} is empty"))),
            None => Ok(counts),
        }
    }
}

fn check_shapes(a: &Arrays, n: &Counts) -> Result<(), Error> {
    let interior = n
        .points
        .checked_sub(n.surface)
        .ok_or_else(|| bad(format!("{} surface nodes of {} points", n.surface, n.points)))?;
    let lengths = [
        ("points", a.points.len(), 3 * n.points),
        ("preload", a.preload.len(), if a.preload.is_empty() { 0 } else { 3 * n.points }),
        ("cells", a.cells.len(), a.cells.len() / 4 * 4),
        ("surface", a.surface.len(), a.surface.len() / 3 * 3),
        ("touchable", a.touchable.len(), 3 * n.touchable),
        ("edges", a.edges.len(), 2 * n.edges),
        ("triangle_edges", a.triangle_edges.len(), 3 * n.touchable),
        ("patch_start", a.patch_start.len(), n.positions + 1),
        ("patch_weights", a.patch_weights.len(), a.patch_nodes.len()),
        ("compliance", a.compliance.len(), 9 * n.positions),
        ("cross_compliance", a.cross_compliance.len(), 9 * n.edges),
        ("force", a.force.len(), 3 * n.positions * n.terms),
        ("edge_force", a.edge_force.len(), 3 * n.edges * n.edge_terms),
        ("norms", a.norms.len(), n.positions * n.norms),
        ("compression", a.compression.len(), n.positions),
        ("position_region", a.position_region.len(), n.positions),
        ("edge_region", a.edge_region.len(), n.edges),
        ("surface_modes", a.surface_modes.len(), 3 * n.surface * n.modes),
        ("interior_modes", a.interior_modes.len(), 3 * interior * n.modes),
    ];
    for (name, found, expected) in lengths {
        if found != expected {
            return Err(bad(format!("array {name} has {found} entries instead of {expected}")));
        }
    }
    Ok(())
}

fn check_indices(a: &Arrays, n: &Counts) -> Result<(), Error> {
    let ranges = [
        ("cells", &a.cells, n.points),
        ("fixed", &a.fixed, n.points),
        ("surface", &a.surface, n.points),
        ("surface_nodes", &a.surface_nodes, n.points),
        ("positions", &a.positions, n.points),
        ("touchable", &a.touchable, n.positions),
        ("edges", &a.edges, n.positions),
        ("triangle_edges", &a.triangle_edges, n.edges),
        ("patch_nodes", &a.patch_nodes, n.points),
        ("position_region", &a.position_region, n.regions),
        ("edge_region", &a.edge_region, n.regions),
    ];
    for (name, values, limit) in ranges {
        if let Some(place) = values.iter().position(|&v| v as usize >= limit) {
            return Err(bad(format!(
                "{name}[{place}] = {}; it must be below {limit}",
                values[place]
            )));
        }
    }
    check_edges(a)?;
    if !a.surface_nodes.is_sorted_by(|x, y| x < y) {
        return Err(bad("surface_nodes is not ascending".into()));
    }
    for (name, starts, end) in [
        ("patch_start", &a.patch_start, a.patch_nodes.len()),
        ("region_start", &a.region_start, n.modes),
    ] {
        if starts[0] != 0 || !starts.is_sorted() || starts[starts.len() - 1] as usize != end {
            return Err(bad(format!("{name} does not run from 0 to {end}")));
        }
    }
    Ok(())
}

/// The edges of a triangle join its corners, and lie in a region of one of their ends.
fn check_edges(a: &Arrays) -> Result<(), Error> {
    for (t, corners) in a.touchable.chunks_exact(3).enumerate() {
        for k in 0..3 {
            let edge = a.triangle_edges[3 * t + k] as usize;
            let ends = &a.edges[2 * edge..2 * edge + 2];
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            if ends != [p.min(q), p.max(q)] {
                return Err(bad(format!("edge {edge} does not join corners of triangle {t}")));
            }
        }
    }
    for (edge, ends) in a.edges.chunks_exact(2).enumerate() {
        if ends.iter().all(|&p| a.position_region[p as usize] != a.edge_region[edge]) {
            return Err(bad(format!("edge {edge} lies in a region of none of its ends")));
        }
    }
    Ok(())
}

pub(super) fn check_values(a: &Arrays) -> Result<(), Error> {
    let doubles = [
        ("points", &a.points),
        ("preload", &a.preload),
        ("law_parameters", &a.law_parameters),
        ("patch_weights", &a.patch_weights),
        ("compliance", &a.compliance),
        ("cross_compliance", &a.cross_compliance),
        ("force", &a.force),
        ("edge_force", &a.edge_force),
        ("family_compliance", &a.family.compliance),
        ("family_cross_compliance", &a.family.cross_compliance),
        ("family_force", &a.family.force),
        ("family_edge_force", &a.family.edge_force),
    ];
    for (name, values) in doubles {
        if let Some(place) = values.iter().position(|v| !v.is_finite()) {
            return Err(bad(format!("{name}[{place}] is {}; it must be finite", values[place])));
        }
    }
    for (position, patch) in a.patch_start.windows(2).enumerate() {
        let sum: f64 = a.patch_weights[patch[0] as usize..patch[1] as usize].iter().sum();
        if (sum - 1.0).abs() > 1e-9 {
            return Err(bad(format!("patch_weights of position {position} sum to {sum}, not 1")));
        }
    }
    let singles = [
        ("norms", &a.norms),
        ("compression", &a.compression),
        ("mode_scale", &a.mode_scale),
        ("position_coefficients", &a.position_coefficients),
        ("edge_coefficients", &a.edge_coefficients),
        ("family_norms", &a.family.norms),
        ("family_compression", &a.family.compression),
        ("family_position_coefficients", &a.family.position_coefficients),
        ("family_edge_coefficients", &a.family.edge_coefficients),
    ];
    for (name, values) in singles {
        if let Some(place) = values.iter().position(|v| !v.is_finite()) {
            return Err(bad(format!("{name}[{place}] is {}; it must be finite", values[place])));
        }
    }
    Ok(())
}

/// Where each position's and each edge's amplitudes start.
fn offsets(a: &Arrays, n: &Counts) -> Result<(Vec<usize>, Vec<usize>), Error> {
    let run = |regions: &[u32], terms: usize| -> Vec<usize> {
        let mut total = 0;
        let sizes = regions.iter().map(|&r| {
            terms * (a.region_start[r as usize + 1] - a.region_start[r as usize]) as usize
        });
        std::iter::once(0)
            .chain(sizes.map(|size| {
                total += size;
                total
            }))
            .collect()
    };
    let positions = run(&a.position_region, n.terms);
    let edges = run(&a.edge_region, n.edge_terms);
    for (name, found, expected) in [
        ("position_coefficients", a.position_coefficients.len(), positions[n.positions]),
        ("edge_coefficients", a.edge_coefficients.len(), edges[n.edges]),
    ] {
        if found != expected {
            return Err(bad(format!("array {name} has {found} entries instead of {expected}")));
        }
    }
    Ok((positions, edges))
}
