//! The checks that make a model safe to evaluate: every shape, index range and value.

use super::arrays::Arrays;
use super::departure::DIRECTIONS;
use super::forms::{N_CUBIC, SECOND};
use super::metadata::{Errors, Metadata, Parameter, UNITS};
use super::resummation::SKETCH;

use crate::Error;
use viscera_number::Monomials;

/// Checks a model whole and returns its sizes.
///
/// # Errors
/// [`Error::ModelFile`] naming the array, the place and the value.
pub(super) fn check(metadata: &Metadata, arrays: &Arrays) -> Result<Counts, Error> {
    check_metadata(metadata)?;
    let counts = Counts::new(metadata, arrays)?;
    check_shapes(arrays, &counts)?;
    check_law(metadata, arrays)?;
    check_indices(arrays, &counts)?;
    check_family(metadata.parameter.as_ref(), arrays)?;
    check_values(arrays)?;
    check_signs(metadata, arrays)?;
    Ok(counts)
}

fn check_metadata(m: &Metadata) -> Result<(), Error> {
    m.check_version()?;
    if !(2..=8).contains(&m.order) || !(1..=m.order).contains(&m.edge_order) {
        return Err(Error::model_file(format!(
            "order {} with edge order {}; orders are 2 to 8, edge orders 1 to the order",
            m.order, m.edge_order
        )));
    }
    for (name, value) in [
        ("radius", m.radius),
        ("depth", m.depth),
        ("tolerance", m.tolerance),
        ("diagonal", m.diagonal),
        ("norm_length", m.norm_length),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::model_file(format!("{name} = {value}; it must be positive")));
        }
    }
    if m.units != UNITS {
        return Err(Error::model_file(format!("units {:?}; they are always {UNITS:?}", m.units)));
    }
    let Errors { compression, interpolation_half_depth, interpolation, parameter } = m.errors;
    let errors = [
        ("errors.compression", compression),
        ("errors.interpolation_half_depth", interpolation_half_depth),
        ("errors.interpolation", interpolation),
        ("errors.parameter", parameter),
    ];
    let shares = m.interpolation_shares.into_iter().flatten().map(|s| ("interpolation_shares", s));
    let shares = shares.chain(m.truncation_share.map(|s| ("truncation_share", s)));
    match errors.into_iter().chain(shares).find(|(_, x)| !(x.is_finite() && *x >= 0.0)) {
        Some((name, value)) => {
            Err(Error::model_file(format!("{name} = {value}; it must not be negative")))
        }
        None => Ok(()),
    }
}

/// Sizes that shapes are checked against.
pub(super) struct Counts {
    pub points: usize,
    surface: usize,
    positions: usize,
    touchable: usize,
    pub edges: usize,
    regions: usize,
    modes: usize,
    terms: usize,
    pub edge_terms: usize,
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
            Some((name, _)) => Err(Error::model_file(format!("array {name} is empty"))),
            None => Ok(counts),
        }
    }
}

fn check_shapes(a: &Arrays, n: &Counts) -> Result<(), Error> {
    let interior = n.points.checked_sub(n.surface).ok_or_else(|| {
        Error::model_file(format!("{} surface nodes of {} points", n.surface, n.points))
    })?;
    // The second order is exact everywhere or nowhere; its fields are those of the edges.
    let is_exact = !a.answers.edge_energy.is_empty() && n.edge_terms >= SECOND.len();
    let exact = usize::from(is_exact);
    let lengths = [
        ("points", a.points.len(), 3 * n.points),
        ("preload", a.preload.len(), if a.preload.is_empty() { 0 } else { 3 * n.points }),
        ("cells", a.cells.len(), a.cells.len() / 4 * 4),
        ("surface", a.surface.len(), a.surface.len() / 3 * 3),
        ("touchable", a.touchable.len(), 3 * n.touchable),
        ("edges", a.edges.len(), 2 * n.edges),
        ("triangle_edges", a.triangle_edges.len(), 3 * n.touchable),
        ("tie_weights", a.tie_weights.len(), a.tie_nodes.len()),
        (
            "tie_start",
            a.tie_start.len(),
            if a.tie_stiffness.is_empty() { 0 } else { a.tie_stiffness.len() / 9 + 1 },
        ),
        ("patch_start", a.patch_start.len(), n.positions + 1),
        ("patch_weights", a.patch_weights.len(), a.patch_nodes.len()),
        ("compliance", a.answers.compliance.len(), 9 * n.positions),
        ("cross_compliance", a.answers.cross_compliance.len(), 9 * n.edges),
        ("force", a.answers.force.len(), 3 * n.positions * n.terms),
        ("edge_force", a.answers.edge_force.len(), 3 * n.edges * n.edge_terms),
        ("edge_energy", a.answers.edge_energy.len(), N_CUBIC * exact * n.edges),
        ("triangle_energy", a.answers.triangle_energy.len(), N_CUBIC * exact * n.touchable),
        (
            "sketch",
            a.answers.sketch.len(),
            if a.answers.sketch.is_empty() { 0 } else { n.positions * n.terms * SKETCH },
        ),
        ("norms", a.answers.norms.len(), n.positions * n.norms),
        ("compression", a.answers.compression.len(), n.positions),
        (
            "linear_compression",
            a.answers.linear_compression.len(),
            if a.answers.linear_compression.is_empty() { 0 } else { n.positions },
        ),
        (
            "departure",
            a.answers.departure.len(),
            if a.answers.departure.is_empty() { 0 } else { DIRECTIONS * n.positions },
        ),
        ("position_region", a.position_region.len(), n.positions),
        ("edge_region", a.edge_region.len(), n.edges),
        ("surface_modes", a.surface_modes.len(), 3 * n.surface * n.modes),
        ("interior_modes", a.interior_modes.len(), 3 * interior * n.modes),
    ];
    for (name, found, expected) in lengths {
        if found != expected {
            return Err(Error::model_file(format!(
                "array {name} has {found} entries instead of {expected}"
            )));
        }
    }
    Ok(())
}

/// The array of the law's parameters has rows of as many columns as it names.
fn check_law(metadata: &Metadata, a: &Arrays) -> Result<(), Error> {
    let columns = metadata.law_parameter_names.len();
    if columns == 0 || !a.law_parameters.len().is_multiple_of(columns) {
        return Err(Error::model_file(format!(
            "array law_parameters has {} entries, which are no rows of the {columns} columns in law_parameter_names",
            a.law_parameters.len()
        )));
    }
    Ok(())
}

fn check_indices(a: &Arrays, n: &Counts) -> Result<(), Error> {
    let ranges = [
        ("cells", &a.cells, n.points),
        ("fixed", &a.fixed, n.points),
        ("tie_nodes", &a.tie_nodes, n.points),
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
            return Err(Error::model_file(format!(
                "{name}[{place}] = {}; it must be below {limit}",
                values[place]
            )));
        }
    }
    check_edges(a)?;
    if !a.surface_nodes.is_sorted_by(|x, y| x < y) {
        return Err(Error::model_file("surface_nodes is not ascending"));
    }
    let none = [0];
    let tie_start = if a.tie_start.is_empty() { &none[..] } else { &a.tie_start };
    for (name, starts, end) in [
        ("tie_start", tie_start, a.tie_nodes.len()),
        ("patch_start", &a.patch_start[..], a.patch_nodes.len()),
        ("region_start", &a.region_start, n.modes),
    ] {
        if starts[0] != 0 || !starts.is_sorted() || starts[starts.len() - 1] as usize != end {
            return Err(Error::model_file(format!("{name} does not run from 0 to {end}")));
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
                return Err(Error::model_file(format!(
                    "edge {edge} does not join corners of triangle {t}"
                )));
            }
        }
    }
    for (edge, ends) in a.edges.chunks_exact(2).enumerate() {
        if ends.iter().all(|&p| a.position_region[p as usize] != a.edge_region[edge]) {
            return Err(Error::model_file(format!(
                "edge {edge} lies in a region of none of its ends"
            )));
        }
    }
    Ok(())
}

/// Family and parameter are both there or neither is, and each member answers in full.
fn check_family(parameter: Option<&Parameter>, a: &Arrays) -> Result<(), Error> {
    let members = parameter.map_or(0, |p| p.nodes.len());
    if let Some(parameter) = parameter {
        parameter.check()?;
        parameter.weights(parameter.value).map_err(|error| Error::model_file(error.to_string()))?;
    }
    for ((name, found), (_, one)) in a.family.lengths().into_iter().zip(a.answers.lengths()) {
        let expected = members * one;
        if found != expected {
            return Err(Error::model_file(format!(
                "array family_{name} has {found} entries instead of {expected}"
            )));
        }
    }
    Ok(())
}

pub(super) fn check_values(a: &Arrays) -> Result<(), Error> {
    check_finite("", "points", &a.points)?;
    check_finite("", "preload", &a.preload)?;
    check_finite("", "law_parameters", &a.law_parameters)?;
    check_finite("", "tie_weights", &a.tie_weights)?;
    check_finite("", "tie_stiffness", &a.tie_stiffness)?;
    check_finite("", "patch_weights", &a.patch_weights)?;
    for (position, patch) in a.patch_start.windows(2).enumerate() {
        let sum: f64 = a.patch_weights[patch[0] as usize..patch[1] as usize].iter().sum();
        if (sum - 1.0).abs() > 1e-9 {
            return Err(Error::model_file(format!(
                "patch_weights of position {position} sum to {sum}, not 1"
            )));
        }
    }
    check_finite("", "mode_scale", &a.mode_scale)?;
    for (family, answers) in [("", &a.answers), ("family_", &a.family)] {
        check_finite(family, "compliance", &answers.compliance)?;
        check_finite(family, "cross_compliance", &answers.cross_compliance)?;
        check_finite(family, "force", &answers.force)?;
        check_finite(family, "edge_force", &answers.edge_force)?;
        check_finite(family, "edge_energy", &answers.edge_energy)?;
        check_finite(family, "triangle_energy", &answers.triangle_energy)?;
        check_finite(family, "sketch", &answers.sketch)?;
        check_finite(family, "norms", &answers.norms)?;
        check_finite(family, "compression", &answers.compression)?;
        check_finite(family, "linear_compression", &answers.linear_compression)?;
        check_finite(family, "departure", &answers.departure)?;
        check_finite(family, "position_coefficients", &answers.position_coefficients)?;
        check_finite(family, "edge_coefficients", &answers.edge_coefficients)?;
    }
    Ok(())
}

/// What cannot be negative: errors, squares of norms, and how far a place gives way under its own force. Of a family the
/// last two are those of its members, since what is blended of them may overshoot.
fn check_signs(metadata: &Metadata, a: &Arrays) -> Result<(), Error> {
    let is_family = metadata.parameter.is_some();
    let solved = if is_family { &a.family } else { &a.answers };
    let family = if is_family { "family_" } else { "" };
    let (per_position, squares) = squares(metadata.order);
    check_not_negative(family, "norms", &solved.norms, per_position, &squares)?;
    check_not_negative(family, "compliance", &solved.compliance, 9, &[0, 4, 8])?;
    for (family, answers) in [("", &a.answers), ("family_", &a.family)] {
        check_not_negative(family, "compression", &answers.compression, 1, &[0])?;
        check_not_negative(family, "linear_compression", &answers.linear_compression, 1, &[0])?;
        check_not_negative(family, "departure", &answers.departure, 1, &[0])?;
    }
    Ok(())
}

/// How many inner products of fields a position has, and which of them are squares: those on the diagonal of the square
/// of each degree.
fn squares(order: usize) -> (usize, Vec<usize>) {
    let monomials = Monomials::of(3, order);
    let (mut squares, mut end) = (Vec::new(), 0);
    for degree in 1..=order {
        let n = monomials.of_degree(degree).len();
        squares.extend((0..n).map(|k| end + k * (n + 1)));
        end += n * n;
    }
    (end, squares)
}

/// Checks some entries of each group of so many.
fn check_not_negative<T: Copy + Into<f64>>(
    family: &str,
    name: &str,
    values: &[T],
    group: usize,
    entries: &[usize],
) -> Result<(), Error> {
    for (number, values) in values.chunks_exact(group.max(1)).enumerate() {
        if let Some(&entry) = entries.iter().find(|&&entry| values[entry].into() < 0.0) {
            let (place, value): (usize, f64) = (number * group + entry, values[entry].into());
            return Err(Error::model_file(format!(
                "{family}{name}[{place}] is {value}; it must not be negative"
            )));
        }
    }
    Ok(())
}

fn check_finite<T: Copy + Into<f64>>(family: &str, name: &str, values: &[T]) -> Result<(), Error> {
    match values.iter().position(|&v| !v.into().is_finite()) {
        Some(place) => Err(Error::model_file(format!(
            "{family}{name}[{place}] is {}; it must be finite",
            values[place].into()
        ))),
        None => Ok(()),
    }
}

/// Where each position's and each edge's amplitudes start.
pub(super) fn offsets(a: &Arrays, n: &Counts) -> Result<(Vec<usize>, Vec<usize>), Error> {
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
        ("position_coefficients", a.answers.position_coefficients.len(), positions[n.positions]),
        ("edge_coefficients", a.answers.edge_coefficients.len(), edges[n.edges]),
    ] {
        if found != expected {
            return Err(Error::model_file(format!(
                "array {name} has {found} entries instead of {expected}"
            )));
        }
    }
    Ok((positions, edges))
}
