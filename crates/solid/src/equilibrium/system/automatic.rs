//! Which solver is likely to be the fastest for a body, and how many iterations conjugate gradients may take before a
//! factor would have been cheaper. `benchmarks/solvers.py` measures what the constants here say.
//!
//! Times are in products with a 3x3 block, the work of conjugate gradients. A body of `n` nodes in `L` layers from end to
//! end has a cross-section of `w = n / L` nodes. Nested dissection eliminates it last, block by block, so that a factor
//! takes about `n w^1.5` (a cube's `n²`, a bar's `n w^1.5`), and a solve with it `n w`.

use super::{ConjugateGradients, Method, Preconditioner};
use crate::body::Body;
use crate::linear::Numbering;
use crate::mesh::{cell_volume, cross, norm, sub};

/// Nodes up to which nothing is faster than a factor by more than it takes to find out.
const SMALL: usize = 150;

/// Newton iterations of a solution over which what is done once counts; where something touches there are many more.
const SOLUTIONS: f64 = 5.0;
const SOLUTIONS_IN_CONTACT: f64 = 25.0;

/// Analysis, for each block; factor, for each unit of `n w^1.5`; a solve with a factor in single precision, for each of
/// `n w`.
const ANALYSIS: f64 = 1200.0;
const FACTOR: f64 = 2.7;
const SUBSTITUTION: f64 = 1.3;

/// Time of a factor in single precision, over that of one in double precision.
const SINGLE: f64 = 0.65;

/// An iteration with an incomplete factor, for each block, up to twice that where they no longer fit into the cache.
const INCOMPLETE: f64 = 3.6;

/// An iteration with a V-cycle, for each node and for each block, and what it takes to make, for each node.
const CYCLE: [f64; 2] = [130.0, 6.8];
const MAKING: f64 = 700.0;

/// Blocks of which half fit into the cache.
const CACHED: f64 = 1e5;

/// How many times as many iterations quadratic cells take as linear ones with as many layers of nodes.
const ROUGH: f64 = 1.5;

/// Iterations of a body that is held at one end and pushed somewhere, over those of one that is stretched between two ends.
const LOADED: f64 = 1.7;

/// Longest edge over smallest height of the cells that a cube is cut into; with slimmer ones iterations grow. Of all cells
/// one in ten may be slimmer, and one in a hundred larger, or smaller, than those that count.
const REGULAR: f64 = 2.45;
const SLIM: f64 = 0.9;
const LARGE: f64 = 0.99;

/// Most cells that are looked at.
const LOOKED_AT: usize = 10_000;

/// Slenderness beyond which a body may bend so far that a factor has to start again. Where it is so many times as large,
/// conjugate gradients must promise to be faster by the square of that number.
const SLENDER: f64 = 2.0;

/// Residual of linear systems: Newton's method then takes about as many iterations as with a factor.
const TOLERANCE: f64 = 1e-4;

/// How far the iterations of a load step may go beyond the time that factors would take, and in how many parts: one linear
/// system has one of them, a smaller one where surfaces may touch: their tangents are seldom good ones.
const PATIENCE: f64 = 1.3;
const LONGEST: usize = 3;
const LONGEST_IN_CONTACT: usize = 5;

/// How much faster conjugate gradients must be to bother with tangents of a slender body that are not positive definite.
const CLEARLY: f64 = 3.0;

/// The corners at the ends of the edges of a cell.
const ENDS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// A body as the model sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Features {
    nodes: f64,
    blocks: f64,
    layers: f64,
    is_quadratic: bool,
    /// How many times as many iterations its cells take as those of a cube.
    distortion: f64,
    has_contact: bool,
    /// Largest Poisson's ratio at rest.
    poisson: f64,
}

/// Conjugate gradients that may be chosen.
struct Candidate {
    preconditioner: Preconditioner,
    /// Time of one solution, with its part of what is done once, and of an iteration.
    solution: f64,
    iteration: f64,
}

/// What was chosen for a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The solver.
    pub method: Method,
    /// Iterations of conjugate gradients in a load step beyond which it is a factor's turn; none where the caller
    /// chose, and for a factor.
    pub budget: Option<usize>,
    /// What chosen conjugate gradients do far from equilibrium where a tangent is not positive definite.
    pub negative_curvature: NegativeCurvature,
}

/// What is done about a direction of negative curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NegativeCurvature {
    /// A factor takes over.
    Refused,
    /// The tangent is shifted.
    Shifted,
    /// The line search follows the direction: a lagged factor would be renewed for every shift.
    Followed,
}

impl Choice {
    /// The method that was asked for; if that is automatic, what suits a body's whole solution, in which something may touch.
    pub fn of(method: Method, body: &Body, has_contact: bool) -> Self {
        match method {
            Method::Automatic if body.points().len() > SMALL => {
                Features::of(body, has_contact).choose()
            }
            Method::Automatic => Self::given(Method::Cholesky),
            given => Self::given(given),
        }
    }

    fn given(method: Method) -> Self {
        Choice { method, budget: None, negative_curvature: NegativeCurvature::Refused }
    }
}

impl Features {
    fn of(body: &Body, has_contact: bool) -> Self {
        let n = body.points().len();
        let n_corners = body.n_corners();
        let numbering = Numbering::reverse_cuthill_mckee(n_corners, edges(body));
        let poisson = (0..body.cells().len()).map(|cell| {
            let [shear, bulk] = body.material().moduli_of_cell(cell);
            (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
        });
        let is_quadratic = n > n_corners;
        // A layer of quadratic cells is one of corners and one of nodes between them.
        let of_a_cell = if is_quadratic { 2 } else { 1 };
        Features {
            nodes: n as f64,
            blocks: body.pattern().pairs().count() as f64,
            layers: (of_a_cell * numbering.n_levels()) as f64,
            is_quadratic,
            distortion: distortion(body),
            has_contact,
            poisson: poisson.fold(0.0, f64::max).min(0.4999),
        }
    }

    /// Newton iterations of a solution.
    fn solutions(&self) -> f64 {
        if self.has_contact { SOLUTIONS_IN_CONTACT } else { SOLUTIONS }
    }

    /// Nodes of a cross-section.
    fn section(&self) -> f64 {
        self.nodes / self.layers
    }

    /// How many times as many layers it has as a cube, one or more.
    fn slenderness(&self) -> f64 {
        (self.layers / self.nodes.cbrt()).max(1.0)
    }

    /// Stiffness of volume, over that of shape.
    fn volume(&self) -> f64 {
        (1.0 - 2.0 * self.poisson).recip()
    }

    /// Blocks, each by the time that it takes to read it.
    fn reads(&self) -> f64 {
        self.blocks * (1.0 + self.blocks / (self.blocks + CACHED))
    }

    /// How many times as many iterations the element takes as a linear one, and a load as one that stretches it.
    fn roughness(&self) -> f64 {
        LOADED * if self.is_quadratic { ROUGH } else { 1.0 }
    }

    /// The time of an analysis, and of a factor.
    fn factor(&self) -> [f64; 2] {
        [ANALYSIS * self.blocks, FACTOR * self.nodes * self.section().powf(1.5)]
    }

    /// With an incomplete factor. The condition number grows with the square of the layers, for a body that bends with
    /// their fourth power, and with the stiffness of volume.
    fn incomplete(&self) -> Candidate {
        let volume = 0.29 + 0.03 * self.volume().powf(0.75);
        let iterations =
            self.roughness() * self.distortion * volume * self.layers * self.slenderness();
        let iteration = INCOMPLETE * self.reads();
        Candidate {
            preconditioner: Preconditioner::IncompleteCholesky,
            solution: iterations * iteration,
            iteration,
        }
    }

    /// With multigrid.
    fn multigrid(&self) -> Candidate {
        let volume = 3.3 + 0.11 * self.volume();
        let iterations = self.roughness() * self.distortion.sqrt() * volume * self.slenderness();
        let iteration = CYCLE[0] * self.nodes + CYCLE[1] * self.blocks;
        Candidate {
            preconditioner: Preconditioner::Multigrid,
            solution: iterations * iteration + MAKING * self.nodes,
            iteration,
        }
    }

    /// With a factor in single precision, which is renewed the more often the stiffer the volume is.
    fn lagged(&self) -> Candidate {
        let [analysis, factor] = self.factor();
        let stiffness = self.volume().sqrt();
        let (factors, iterations) = (0.8 + 0.4 * stiffness, 2.5 + 0.4 * stiffness);
        let iteration = SUBSTITUTION * self.nodes * self.section();
        let once = analysis + SINGLE * factors * factor;
        Candidate {
            preconditioner: Preconditioner::LaggedCholesky,
            solution: once / self.solutions() + iterations * self.slenderness() * iteration,
            iteration,
        }
    }

    fn choose(&self) -> Choice {
        let [analysis, factor] = self.factor();
        let direct = analysis / self.solutions() + factor;
        let candidates = [self.incomplete(), self.multigrid(), self.lagged()];
        let fastest = candidates.into_iter().min_by(|a, b| a.solution.total_cmp(&b.solution));
        let risk = (self.slenderness() / SLENDER).max(1.0).powi(2);
        match fastest {
            Some(Candidate { preconditioner, solution, iteration }) if risk * solution < direct => {
                let budget = (PATIENCE * self.solutions() * direct / iteration).ceil() as usize;
                let parts = if self.has_contact { LONGEST_IN_CONTACT } else { LONGEST };
                let method = Method::ConjugateGradients(ConjugateGradients {
                    preconditioner,
                    tolerance: TOLERANCE,
                    max_iterations: budget.div_ceil(parts),
                    ..ConjugateGradients::default()
                });
                let negative_curvature = match preconditioner {
                    _ if risk > 1.0 && CLEARLY * solution >= direct => NegativeCurvature::Refused,
                    Preconditioner::LaggedCholesky => NegativeCurvature::Followed,
                    _ => NegativeCurvature::Shifted,
                };
                Choice { method, budget: Some(budget), negative_curvature }
            }
            _ => Choice::given(Method::Cholesky),
        }
    }
}

/// How many times as many iterations irregular cells take as regular ones, by how slim and how unequal they are.
fn distortion(body: &Body) -> f64 {
    let every = body.cells().len().div_ceil(LOOKED_AT);
    let shapes = body.cells().iter().step_by(every).map(|cell| shape(body.points(), *cell));
    let (mut aspects, mut volumes): (Vec<f64>, Vec<f64>) = shapes.unzip();
    let slim = quantile(&mut aspects, SLIM) / REGULAR;
    let unequal = quantile(&mut volumes, LARGE) / quantile(&mut volumes, 1.0 - LARGE);
    slim.max(1.0) * unequal.powf(1.0 / 6.0)
}

/// Longest edge over smallest height of a cell, and its volume [m^3].
fn shape(points: &[[f64; 3]], cell: [u32; 4]) -> (f64, f64) {
    let x = cell.map(|node| points[node as usize]);
    let volume = cell_volume(points, cell).abs();
    let edges = ENDS.map(|[a, b]| norm(sub(x[b], x[a])));
    let area = |left_out: usize| {
        let [a, b, c]: [[f64; 3]; 3] =
            std::array::from_fn(|i| x[if i < left_out { i } else { i + 1 }]);
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    };
    let largest = (0..4).map(area).fold(0.0, f64::max);
    (edges.into_iter().fold(0.0, f64::max) * largest / (3.0 * volume), volume)
}

/// The value that this part of the values is below.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    let place = (part * (values.len() - 1) as f64).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// The pairs of corners of all cells, those of a shared edge several times. An element may couple more nodes, which makes
/// the body no shorter.
fn edges(body: &Body) -> impl Iterator<Item = (u32, u32)> + Clone + '_ {
    body.cells().iter().flat_map(|cell| ENDS.map(|[a, b]| (cell[a], cell[b])))
}

/// Forces at the points of a body that hold something of every motion: waves of all lengths, from twice its size to that of
/// its cells, in all directions, each as strong as the others.
pub fn waves(points: &[[f64; 3]]) -> Vec<f64> {
    let ends =
        points.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], x| {
            [tabulate(|i| low[i].min(x[i])), tabulate(|i| high[i].max(x[i]))]
        });
    let size = (0..3).map(|i| ends[1][i] - ends[0][i]).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let n_waves = 2 + (points.len() as f64).cbrt().log2().ceil() as i32;
    let mut force = vec![0.0; 3 * points.len()];
    for wave in 0..n_waves {
        // Numbers without a pattern.
        let odd = |seed: f64| {
            tabulate(|i| ((seed + f64::from(wave)) * 12.9898 + i as f64 * 78.233).sin())
        };
        let (along, strength) = (odd(1.0), odd(5.0));
        let steepness = std::f64::consts::PI * 2f64.powi(wave) / size / crate::number::norm(&along);
        let (places, _) = force.as_chunks_mut::<3>();
        for (force, x) in places.iter_mut().zip(points) {
            let phase = (0..3).map(|i| along[i] * x[i]).sum::<f64>();
            let height = (steepness * phase + f64::from(wave)).cos();
            force.iter_mut().zip(strength).for_each(|(force, part)| *force += height * part);
        }
    }
    force
}

fn tabulate(of: impl FnMut(usize) -> f64) -> [f64; 3] {
    std::array::from_fn(of)
}
