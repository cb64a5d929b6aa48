//! Which solver is likely to be the fastest for a body, and how many iterations conjugate gradients may take before a
//! factor would have been cheaper. `benchmarks/solvers.py` measures what the constants here say.
//!
//! Times are in products with a 3x3 block, the work of conjugate gradients. A body of `n` nodes in `L` layers from end to
//! end has a cross-section of `w = n / L` nodes. Nested dissection eliminates it last, block by block, so that a factor
//! takes about `n w^1.5` (a cube's `n²`, a bar's `n w^1.5`).

use super::{ConjugateGradients, Method, Preconditioner};
use crate::body::Body;
use crate::linear::Numbering;

/// Nodes up to which nothing is faster than a factor by more than it takes to find out.
const SMALL: usize = 150;

/// Newton iterations of a solution over which what is done once counts.
const SOLUTIONS: f64 = 5.0;

/// Analysis, for each block, and factor, for each unit of `n w^1.5`.
const ANALYSIS: f64 = 900.0;
const FACTOR: f64 = 1.3;

/// An iteration with an incomplete factor and one with a V-cycle, for each block; what a V-cycle takes to make.
const INCOMPLETE: f64 = 3.5;
const CYCLE: f64 = 6.0;
const MAKING: f64 = 60.0;

/// Residual of linear systems: Newton's method then takes about as many iterations as with a factor.
const TOLERANCE: f64 = 1e-4;

/// How far iterations of one solution may go beyond the time of a factor.
const PATIENCE: f64 = 1.0;

/// How much faster conjugate gradients must be to bother with tangents that are not positive definite.
const CLEARLY: f64 = 3.0;

/// A body as the model sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Features {
    nodes: f64,
    blocks: f64,
    layers: f64,
    /// Largest Poisson's ratio at rest.
    poisson: f64,
}

/// What was chosen for a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The solver.
    pub method: Method,
    /// Iterations of conjugate gradients in a load step beyond which it is a factor's turn; none where the caller
    /// chose, and for a factor.
    pub budget: Option<usize>,
    /// Conjugate gradients are so much faster that they may shift a tangent that is not positive definite.
    pub shifts: bool,
}

impl Choice {
    /// The method that was asked for; if that is automatic, what suits a body's whole solution.
    pub fn of(method: Method, body: &Body) -> Self {
        match method {
            Method::Automatic if body.points().len() > SMALL => Features::of(body).choose(),
            Method::Automatic => Self::given(Method::Cholesky),
            given => Self::given(given),
        }
    }

    fn given(method: Method) -> Self {
        Choice { method, budget: None, shifts: false }
    }
}

impl Features {
    fn of(body: &Body) -> Self {
        let n = body.points().len();
        let numbering = Numbering::reverse_cuthill_mckee(n, body.pattern().pairs());
        let poisson = body.material().parameters().iter().map(|row| {
            let [shear, bulk] = body.material().moduli(row);
            (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
        });
        Features {
            nodes: n as f64,
            blocks: body.pattern().pairs().count() as f64,
            layers: numbering.n_levels() as f64,
            poisson: poisson.fold(0.0, f64::max).min(0.4999),
        }
    }

    /// The time of an analysis, and of a factor.
    fn factor(&self) -> [f64; 2] {
        let section = self.nodes / self.layers;
        [ANALYSIS * self.blocks, FACTOR * self.nodes * section.powf(1.5)]
    }

    /// Iterations to the tolerance, with an incomplete factor and with a V-cycle. The condition number grows with the
    /// square of the layers, for a body that bends with their fourth power, and with the stiffness of volume.
    fn iterations(&self) -> [f64; 2] {
        let slenderness = (self.layers / self.nodes.cbrt()).max(1.0);
        let volume = (1.0 - 2.0 * self.poisson).sqrt().recip();
        [0.22 * self.layers * slenderness * volume.sqrt(), 3.6 * slenderness.sqrt() * volume]
    }

    fn choose(&self) -> Choice {
        let [analysis, factor] = self.factor();
        let [incomplete, cycles] = self.iterations();
        let (products, cycle) = (INCOMPLETE * self.blocks, CYCLE * self.blocks);
        let direct = analysis / SOLUTIONS + factor;
        let iterative = [
            (Preconditioner::IncompleteCholesky, incomplete * products, products),
            (Preconditioner::Multigrid, cycles * cycle + MAKING * self.blocks, cycle),
        ];
        let fastest = iterative.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        match fastest {
            Some((preconditioner, time, iteration)) if time < direct => {
                let budget = (PATIENCE * direct / iteration).ceil() as usize;
                let method = Method::ConjugateGradients(ConjugateGradients {
                    preconditioner,
                    tolerance: TOLERANCE,
                    max_iterations: budget,
                    ..ConjugateGradients::default()
                });
                let shifts = CLEARLY * time < direct;
                Choice { method, budget: Some(budget * SOLUTIONS as usize), shifts }
            }
            _ => Choice::given(Method::Cholesky),
        }
    }
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
