//! Labelled images to conforming tetrahedral meshes with smooth boundaries.
//!
//! The labels' indicators are smoothed and biased so that each label keeps its volume ([`field`]). A body-centred cubic
//! lattice, graded where labels ask for edges of different lengths ([`size`], [`lattice`]), is cut by the surfaces between
//! the owners, nodes near a surface being moved onto it ([`cut`]: isosurface stuffing). Then nodes move, each on its
//! surfaces, until no angle can be made better ([`improve`]). If a cell stays flat or turned over, the lattice is shifted,
//! and the work begins anew.

mod constraint;
mod cut;
mod field;
mod improve;
mod indicators;
mod lattice;
mod parts;
mod pieces;
pub mod quality;
mod size;
mod stars;
mod surface;
mod vector;
mod winding;

use cut::Cutting;
use field::Field;
pub use field::Labels;
use improve::{Improving, Interface};
use lattice::{Lattice, MEAN_EDGE};
pub use parts::Lost;
use rayon::prelude::*;
use surface::Surface;
use vector::Point;
pub use winding::Winding;

/// Why no mesh could be made.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// The map's values are not as many as its dimensions say, its affine map is singular, or its volumes are none.
    BadMap,
    /// No voxel carries the label.
    Absent(u16),
    /// The lattice misses a label, given by its place in the list: the edge is too long for it.
    Missed(usize),
    /// At this place [m] surfaces are so close that cells between them stay flat or turned over.
    Tangled(Point),
    /// The lengths are not one for each label, or not above zero.
    BadEdges,
    /// None, or more than [`MOST_LABELS`].
    TooManyLabels(usize),
    /// Too many cells for 32-bit indices.
    TooFine,
    /// The work was cancelled.
    Cancelled,
}

/// Largest number of labels of a mesh.
pub const MOST_LABELS: usize = 60;

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::BadMap => write!(
                f,
                "the label map's values or volumes do not fit it, or its affine map is singular"
            ),
            Error::Absent(label) => write!(f, "no voxel has the label {label}"),
            Error::Missed(label) => write!(
                f,
                "the edge is too long for label {label} of the list: no cell of it is left; use a shorter one"
            ),
            Error::Tangled(place) => {
                let [x, y, z] = place.map(|x| 1e3 * x);
                write!(
                    f,
                    "the surfaces between labels tangle at ({x:.1}, {y:.1}, {z:.1}) mm; take another edge, such as one \
                     that is a tenth shorter"
                )
            }
            Error::BadEdges => write!(f, "there must be one edge for each label, above zero"),
            Error::TooManyLabels(count) => {
                write!(f, "{count} labels at once; there may be 1 to {MOST_LABELS}")
            }
            Error::TooFine => write!(
                f,
                "the edge is so short that the lattice has more than 2^31 nodes; use a longer one"
            ),
            Error::Cancelled => write!(f, "cancelled"),
        }
    }
}

impl std::error::Error for Error {}

/// A mesh of several parts that share the nodes between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Places of the nodes [m].
    pub points: Vec<Point>,
    /// Nodes of the cells, of positive volume.
    pub cells: Vec<[u32; 4]>,
    /// For each cell, its label's place in the list of labels.
    pub owner: Vec<usize>,
    /// Nodes on the flat ends where the image cuts a label.
    pub cut: Vec<u32>,
    /// Mean edge of the lattice in each label [m]: the one asked for or, since lengths double from cube to cube, shorter.
    pub edges: Vec<f64>,
    /// Volume that each label was to have, that of its voxels unless another was given [m^3].
    pub volumes: Vec<f64>,
    /// Separate pieces that held little of any label, and were dropped.
    pub dropped: Lost,
    /// Other separate pieces for which the cells are too large.
    pub missed: Lost,
}

/// How often the biases are corrected by the volumes of the cut lattice, and by those of the mesh.
const CORRECTIONS: usize = 3;
const LAST_CORRECTIONS: usize = 2;
const SWEEPS: i32 = 16;
const LAST_SWEEPS: i32 = 4;
/// Where surfaces are closer to each other than nodes, a cell may stay flat or turned over. On a lattice that lies
/// elsewhere it seldom does: these shifts are tried [spacings], until no angle has a smaller sine than the first limit.
/// The second is that of a cell that is no good at all.
const SHIFTS: [Point; 6] = [
    [0.0, 0.0, 0.0],
    [0.37, 0.21, 0.13],
    [0.11, 0.43, 0.29],
    [0.23, 0.07, 0.41],
    [0.47, 0.31, 0.19],
    [0.17, 0.39, 0.05],
];
const SOUND: f64 = 0.02;
const FLAT: f64 = 1e-3;
/// Largest correction of a bias.
const LARGEST: f64 = 0.1;
/// Half the diagonal of a cube, in sides.
const HALF_DIAGONAL: f64 = 0.866_025_403_784_438_6;

/// Meshes some labels of a map with cells whose edges have at most about the lengths `edges` [m], one for each label.
/// Towards a label with shorter edges, the others' become shorter.
///
/// `watch(done, total)` receives the progress, which begins anew when another lattice is tried; false ends the work.
///
/// # Errors
/// A bad map or list of labels; an edge that is too long; surfaces that tangle; `watch` has returned false.
pub fn mesh(
    map: &Labels,
    labels: &[u16],
    edges: &[f64],
    mut watch: impl FnMut(usize, usize) -> bool,
) -> Result<Mesh, Error> {
    check(map, labels, edges)?;
    let steps = steps(labels.len());
    if !watch(0, steps) {
        return Err(Error::Cancelled);
    }
    let mut field = Field::new(map, labels, edges);
    let biases = field.biases().to_vec();
    let mut best: Option<(f64, Mesh)> = None;
    let mut place = [0.0; 3];
    for shift in SHIFTS {
        field.set_biases(&biases);
        let mut done = 0;
        let mut step = || {
            done += 1;
            if watch(done, steps) { Ok(()) } else { Err(Error::Cancelled) }
        };
        let made = match tried(&mut field, shift, &mut step) {
            Err(Error::Missed(_) | Error::TooFine) if best.is_some() => continue,
            made => made?,
        };
        let (mut sine, mut at) = made.worst(&field);
        let mesh = finished(&field, edges, made);
        let hanging = || viscera_mesh::inspect(&mesh.points, &mesh.cells).hanging;
        if sine > FLAT
            && let Some(&[node, _]) = hanging().first()
        {
            (sine, at) = (0.0, mesh.points[node as usize]);
        }
        if best.as_ref().is_none_or(|(least, _)| sine > *least) {
            best = Some((sine, mesh));
            place = at;
        }
        if sine > SOUND {
            break;
        }
    }
    match best {
        Some((sine, mesh)) if sine > FLAT => Ok(mesh),
        _ => Err(Error::Tangled(place)),
    }
}

/// A mesh of what is inside and outside.
struct Made {
    cut: Cut,
    points: Vec<Point>,
    /// The owners that meet at each node.
    meeting: Vec<u64>,
}

/// Counts a step of the work; the error [`Error::Cancelled`] ends it.
type Step<'a> = &'a mut dyn FnMut() -> Result<(), Error>;

/// How often a try counts, which ends one before: a step for the lattice, one for each surface and one after them in
/// every cut.
fn steps(n_labels: usize) -> usize {
    let in_sweeps = |sweeps: i32| sweeps as usize * improve::STEPS_PER_SWEEP;
    let last = LAST_CORRECTIONS * (1 + in_sweeps(LAST_SWEEPS));
    2 + (CORRECTIONS + 1) * (n_labels + 1) + in_sweeps(SWEEPS) + last
}

/// One try, on a lattice that lies `shift` spacings lower.
fn tried(field: &mut Field, shift: Point, step: Step) -> Result<Made, Error> {
    step()?;
    let lattice = lattice(field, shift).ok_or(Error::TooFine)?;
    for _ in 0..CORRECTIONS {
        let cut = cut_lattice(field, &lattice, step)?;
        correct(field, &cut.points, &cut)?;
    }
    let cut = cut_lattice(field, &lattice, step)?;
    let meeting = improve::meeting(cut.points.len(), &cut.interfaces);
    let mut points = {
        let start = cut.points.clone();
        let mut improving =
            Improving::new(field, &cut.spacing, start, &meeting, &cut.cells, &cut.owner);
        for round in 0..SWEEPS {
            improving.sweep(round, step)?;
        }
        improving.points
    };
    for _ in 0..LAST_CORRECTIONS {
        step()?;
        correct(field, &points, &cut)?;
        let mut improving =
            Improving::new(field, &cut.spacing, points, &meeting, &cut.cells, &cut.owner);
        improving.return_to_surfaces();
        for round in 0..LAST_SWEEPS {
            improving.sweep(round + 8, step)?;
        }
        points = improving.points;
    }
    Ok(Made { cut, points, meeting })
}

impl Made {
    /// The smallest sine of an angle, negative in a cell that is turned over, and where it is. A cell outside that is flat
    /// or turned over between cells inside counts as a bad one, but not as a flat one.
    fn worst(&self, field: &Field) -> (f64, Point) {
        let mut is_used = vec![false; self.points.len()];
        let owned = self.cut.cells.iter().zip(&self.cut.owner);
        for (cell, _) in owned.clone().filter(|(_, owner)| **owner != field.outside()) {
            cell.iter().for_each(|&i| is_used[i as usize] = true);
        }
        let sine = |(cell, &owner): (&[u32; 4], &usize)| {
            let corners = cell.map(|i| self.points[i as usize]);
            let sine = quality::min_sine(corners);
            let is_between = || cell.iter().all(|&i| is_used[i as usize]);
            let counted = match owner != field.outside() {
                true => sine,
                false if sine < FLAT && is_between() => 0.5 * SOUND,
                false => 1.0,
            };
            (counted, vector::mean(corners))
        };
        let lower = |a: (f64, Point), b: (f64, Point)| if b.0 < a.0 { b } else { a };
        owned.map(sine).fold((1.0, [0.0; 3]), lower)
    }
}

/// The cells inside, and facts about them.
fn finished(field: &Field, edges: &[f64], Made { cut, points, meeting }: Made) -> Mesh {
    let kept = (0..cut.cells.len()).filter(|&c| cut.owner[c] != field.outside());
    let (cells, owner): (Vec<_>, Vec<_>) = kept.map(|c| (cut.cells[c], cut.owner[c])).unzip();
    let (used, cells) = renumbered(points.len(), cells);
    let is_cut = |i: u32| meeting[used[i as usize] as usize] & surface::BEYOND != 0;
    Mesh {
        points: used.iter().map(|&i| points[i as usize]).collect(),
        cells,
        owner,
        cut: (0..used.len() as u32).filter(|&i| is_cut(i)).collect(),
        edges: edges.iter().map(|&edge| field.levels.edge(edge)).collect(),
        volumes: field.volumes.clone(),
        dropped: cut.dropped,
        missed: cut.missed,
    }
}

fn check(map: &Labels, labels: &[u16], edges: &[f64]) -> Result<(), Error> {
    let count = map.dims.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
    let rows = map.affine.map(|row| [row[0], row[1], row[2]]);
    let determinant = vector::dot(rows[0], vector::cross(rows[1], rows[2]));
    let is_volume = |v: &f64| *v > 0.0 && v.is_finite();
    let are_volumes =
        map.volumes.is_none_or(|v| v.len() == labels.len() && v.iter().all(is_volume));
    if count != Some(map.values.len()) || !determinant.is_normal() || !are_volumes {
        return Err(Error::BadMap);
    }
    if labels.is_empty() || labels.len() > MOST_LABELS {
        return Err(Error::TooManyLabels(labels.len()));
    }
    if edges.len() != labels.len() || edges.iter().any(|edge| !(*edge > 0.0 && edge.is_finite())) {
        return Err(Error::BadEdges);
    }
    match labels.iter().find(|label| !map.values.contains(label)) {
        Some(&absent) => Err(Error::Absent(absent)),
        None => Ok(()),
    }
}

/// The lattice cut by all surfaces.
struct Cut {
    points: Vec<Point>,
    spacing: Vec<f64>,
    cells: Vec<[u32; 4]>,
    owner: Vec<usize>,
    interfaces: Vec<Interface>,
    dropped: Lost,
    missed: Lost,
}

/// The lattice where the labels may be, whatever the corrections of the biases, lowered by a shift in spacings.
fn lattice(field: &Field, shift: Point) -> Option<Lattice> {
    let levels = field.levels;
    let is_coarse = |x, side| field.is_too_long(x, side * MEAN_EDGE, HALF_DIAGONAL * side);
    let is_near = |x| field.outsideness(x, &mut Vec::new()) < CORRECTIONS as f64 * LARGEST;
    let side = levels.finest / MEAN_EDGE;
    let bounds = [vector::sub(field.bounds[0], vector::scale(shift, side)), field.bounds[1]];
    Lattice::new(bounds, side, levels.count, is_coarse, is_near)
}

fn cut_lattice(field: &Field, lattice: &Lattice, step: Step) -> Result<Cut, Error> {
    let is_inside: Vec<bool> = lattice
        .points
        .par_iter()
        .map_init(Vec::new, |scores, &x| field.outsideness(x, scores) < 0.0)
        .collect();
    let cells = lattice.cells.iter().filter(|cell| cell.iter().any(|&i| is_inside[i as usize]));
    let (used, cells) = renumbered(lattice.points.len(), cells.copied().collect());
    let points: Vec<Point> = used.iter().map(|&i| lattice.points[i as usize]).collect();
    let spacing = used.iter().map(|&i| lattice.spacing[i as usize]).collect();
    let on = vec![0; points.len()];
    let mut cutting = Cutting { field, points, spacing, on, cells, owned: Vec::new() };
    if !field.planes.is_empty() {
        cutting.cut(Surface::Beyond);
    }
    for surface in
        [Surface::Outside].into_iter().chain((1..field.outside()).map(|l| Surface::Label(l - 1)))
    {
        step()?;
        cutting.cut(surface);
    }
    step()?;
    let rest = cutting.cells.iter().map(|&cell| (cell, field.outside() - 1));
    let (cells, mut owner): (Vec<_>, Vec<_>) = cutting.owned.iter().copied().chain(rest).unzip();
    let (used, cells) = renumbered(cutting.points.len(), cells);
    let points: Vec<Point> = used.iter().map(|&i| cutting.points[i as usize]).collect();
    let spacing = used.iter().map(|&i| cutting.spacing[i as usize]).collect();
    let on: Vec<u64> = used.iter().map(|&i| cutting.on[i as usize]).collect();
    let [dropped, missed] = parts::tidy(field, &points, &cells, &mut owner);
    let interfaces = improve::interfaces(&on, &cells, &owner, field.outside());
    Ok(Cut { points, spacing, cells, owner, interfaces, dropped, missed })
}

/// The points that cells use, ascending, and the cells by their new numbers.
fn renumbered(n_points: usize, mut cells: Vec<[u32; 4]>) -> (Vec<u32>, Vec<[u32; 4]>) {
    let mut number = vec![u32::MAX; n_points];
    for &i in cells.iter().flatten() {
        number[i as usize] = 0;
    }
    let used: Vec<u32> = (0..n_points as u32).filter(|&i| number[i as usize] == 0).collect();
    for (new, &old) in used.iter().enumerate() {
        number[old as usize] = new as u32;
    }
    for i in cells.iter_mut().flatten() {
        *i = number[*i as usize];
    }
    (used, cells)
}

fn volumes(points: &[Point], cells: &[[u32; 4]], owner: &[usize], n_labels: usize) -> Vec<f64> {
    let each: Vec<f64> = cells
        .par_iter()
        .map(|cell| quality::volume6(cell.map(|i| points[i as usize])) / 6.0)
        .collect();
    let mut volumes = vec![0.0; n_labels + 1];
    for (volume, &label) in each.iter().zip(owner) {
        volumes[label] += volume;
    }
    volumes
}

/// Moves the biases so that the mesh's volumes come closer to the voxels': a step of Newton's method, since a face of
/// area `A` moves by `1 / |grad (s_a - s_b)|` when the bias of `a` grows by 1.
fn correct(field: &mut Field, points: &[Point], cut: &Cut) -> Result<(), Error> {
    let n = field.outside();
    let volumes = volumes(points, &cut.cells, &cut.owner, n);
    if let Some(missed) = volumes[..n].iter().position(|&volume| volume <= 0.0) {
        return Err(Error::Missed(missed));
    }
    let mut slope = vec![vec![0.0; n + 1]; n + 1];
    for face in &cut.interfaces {
        let (a, Some(b)) = (face.owner, face.other) else { continue };
        let [p, q, r] = face.nodes.map(|i| points[i as usize]);
        let area = 0.5 * vector::norm(vector::cross(vector::sub(q, p), vector::sub(r, p)));
        let (_, gradient) = field.difference(a, b, vector::mean([p, q, r]));
        let rate = area / vector::norm(gradient).max(1e-3 / field.reach());
        for (i, j) in [(a, b), (b, a)] {
            slope[i][i] += rate;
            slope[i][j] -= rate;
        }
    }
    let lost = |l: usize| cut.dropped.volumes[l] + cut.missed.volumes[l];
    let wanted = (0..n).map(|l| field.volumes[l] - lost(l) - volumes[l]).collect();
    for (label, shift) in solved(slope, wanted).into_iter().enumerate() {
        field.raise(label, shift.clamp(-LARGEST, LARGEST));
    }
    Ok(())
}

/// Solves a small system with a dominant diagonal, of which the first rows are wanted; the last unknown is 0.
fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for i in 0..n {
        let pivot = a[i][i].max(1e-300);
        for j in i + 1..n {
            let share = a[j][i] / pivot;
            for k in i..n {
                a[j][k] -= share * a[i][k];
            }
            b[j] -= share * b[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - known) / a[i][i].max(1e-300);
    }
    b
}
