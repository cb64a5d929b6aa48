//! How a solution ends: why a load step was given up, where the tangent becomes singular, and the message.

use super::domain::NoEnergy;
use super::outcome::Status;
use super::problem::Problem;
use super::stepper::VOLUME_BOUNDS;
use crate::body::Body;
use crate::contact::Entry;
use crate::error::Error;
use crate::linear::FactorError;

/// A residual of fewer tolerances is small: what keeps it above may be rounding.
const NEAR: f64 = 100.0;

/// Bulk over shear modulus above which a law is nearly incompressible: Poisson's ratio 0.49. Rounding of the volume then
/// leaves a residual that many times as large.
const STIFF_IN_VOLUME: f64 = 50.0;

/// Part of the least residual of the first half of the iterations below which that of the second is if they still get on.
const FALLS: f64 = 0.5;

/// Times as many iterations as were too few that are advised, and the bounds of what is: the default, and the most there are.
const MORE: usize = 4;
const ADVISED: [usize; 2] = [30, 10_000];

/// A ratio of volumes above it comes from a step out of all proportion.
const OUT_OF_PROPORTION: f64 = 1e3;

/// Why a load step was given up.
pub(super) enum Cut {
    NoEnergy(NoEnergy),
    NoDescent {
        residual: f64,
    },
    Iterations {
        residual: f64,
        tolerance: f64,
        /// Iterations that a load step may have.
        most: usize,
        /// Whether the residual [still fell](still_falls).
        falls: bool,
    },
    /// The equilibria on the pieces that the surfaces of contact pairs share do not come to rest as these are found anew.
    Pieces {
        residual: f64,
    },
    Factor(FactorError),
    /// A tool went into the body between the samples of its surface, or surfaces of a contact pair through each other.
    Entered(Entry),
    /// Surfaces rub that were out of reach at the start of the load step.
    OutOfReach,
    /// None could be made for the wider pattern of surfaces that have come to touch.
    Solver(Error),
    /// Conjugate gradients would take longer than a factor.
    Spent,
    /// Conjugate gradients met, or may have overlooked, negative curvature.
    Doubtful,
    Cancelled,
}

/// How an equilibrium moves with the load.
#[derive(Clone, Copy)]
pub(super) struct Slope {
    pub load: f64,
    /// `|du/dload|`.
    pub length: f64,
    /// `du . K du / |du|^2`, the stiffness along the path.
    pub stiffness: f64,
}

/// The slopes of the last two equilibria from which a step started, the newest last.
pub(super) struct Slopes([Slope; 2]);

impl Slopes {
    pub fn new() -> Self {
        Slopes([Slope { load: f64::NEG_INFINITY, length: 0.0, stiffness: 0.0 }; 2])
    }

    /// Adds an equilibrium, unless it is the newest already.
    pub fn note(&mut self, slope: Slope) {
        if slope.load > self.0[1].load {
            self.0 = [self.0[1], slope];
        }
    }

    /// The load at which the tangent becomes singular, if it does within a `reach` beyond the equilibrium at `load`, as far as
    /// two slopes tell.
    ///
    /// Next to a limit point the displacement goes with the root of the distance in load, so `1/|du/dload|^2` falls
    /// linearly to zero. Below the buckling load of a body that is not quite straight it falls as fast, but not to zero: two
    /// slopes do not tell one from the other. A body that locks moves ever faster as well, where it does not lock yet, but it
    /// stiffens along the path. Towards a singular tangent the stiffness falls, below zero where the body drives what moves it.
    pub fn singular_point(&self, load: f64, reach: f64) -> Option<f64> {
        let [before, last] = self.0;
        let is_softer = last.stiffness < before.stiffness.max(0.0);
        if last.load != load || !before.load.is_finite() || !(last.length > before.length) {
            return None;
        }
        let left = (last.load - before.load) / ((last.length / before.length).powi(2) - 1.0);
        (is_softer && left <= reach).then_some(last.load + left)
    }
}

/// Whether the residuals of a load step still fell when its iterations were over; those that rounding keeps up do not. With
/// one alone nothing speaks for rounding.
pub(super) fn still_falls(residuals: &[f64]) -> bool {
    let (early, late) = residuals.split_at(residuals.len() / 2);
    let least = |part: &[f64]| part.iter().copied().fold(f64::INFINITY, f64::min);
    least(late) < FALLS * least(early)
}

/// Where a body goes that next to nothing holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fall {
    /// Onto what it may touch.
    Onto,
    /// Past or away from all that it could touch.
    Away,
}

/// What is known at the end.
pub(super) struct Ending {
    pub load: f64,
    pub iterations: usize,
    /// Why the last load step was given up.
    pub cut: Option<Cut>,
    /// The load at which the tangent becomes singular.
    pub singular: Option<f64>,
    /// Load and degree of freedom of an equilibrium that is not stable.
    pub unstable: Option<(f64, usize)>,
    /// Whether tools or surfaces may touch it.
    pub in_contact: bool,
    /// How the body fell in the last load step, since next to nothing holds it.
    pub fall: Option<Fall>,
    /// Linear systems of the last load step that conjugate gradients left unfinished.
    pub unfinished: usize,
    /// The last relative residual of the last load step that succeeded, and the tolerance: rounding may have stopped above
    /// it.
    pub residual: f64,
    pub tolerance: f64,
    /// The cell farthest beyond the volume ratios in which frames keep cells, and its `J`.
    pub unsound: Option<(usize, f64)>,
}

/// The cell farthest beyond the volume ratios in which frames keep cells, and its `J`; none where the law lets cells turn
/// inside out.
pub(super) fn unsound_cell(body: &Body, u: &[f64]) -> Option<(usize, f64)> {
    let beyond = |j: f64| (VOLUME_BOUNDS[0] / j).max(j / VOLUME_BOUNDS[1]);
    let found =
        body.outliers(u, VOLUME_BOUNDS).into_iter().map(|point| (point.cell, point.volume_ratio));
    found.max_by(|one, other| beyond(one.1).total_cmp(&beyond(other.1)))
}

impl Ending {
    pub fn status(&self) -> Status {
        match (self.load >= 1.0, self.unstable, self.singular) {
            (false, _, Some(_)) => Status::LimitPoint,
            (false, _, None) => Status::StepTooSmall,
            (true, None, _) => Status::Converged,
            (true, Some(_), _) => Status::ConvergedPastInstability,
        }
    }

    pub fn message(&self, problem: &Problem) -> String {
        let (is_converged, load) = (self.status().is_converged(), self.load);
        let mut text = match (is_converged, &self.cut) {
            (false, Some(cut)) => format!("stopped at load {load:.4}: {}", cut.sentence()),
            _ => format!("converged in {} iterations", self.iterations),
        };
        if is_converged && self.residual > self.tolerance {
            text += &format!(
                ", as far as rounding allows (relative residual {:.1e}, tolerance {:.0e})",
                self.residual, self.tolerance
            );
        }
        if let Some((load, dof)) = self.unstable {
            text += &format!(
                "; the tangent was not positive definite under what is prescribed at load {load:.4} (point {}): \
                 the path passes an instability",
                dof / 3
            );
        }
        if is_converged {
            return text + &self.doubt();
        }
        text += &self.remedy(problem);
        if problem.body.material().name() == "saint_venant_kirchhoff" {
            text += "; Saint Venant-Kirchhoff softens in compression and its energy stays finite where a cell is \
                     crushed, a known flaw of the law: use NeoHookean";
        }
        text
    }

    /// Where a solution is no state of tissue, though it has converged.
    fn doubt(&self) -> String {
        let [low, high] = VOLUME_BOUNDS;
        let Some((cell, j)) = self.unsound else { return String::new() };
        let has = if j <= low {
            format!("{:.2} % of its volume left, less than the {:.0} %", 100.0 * j, 100.0 * low)
        } else {
            format!("{j:.2} times its volume, more than the {high:.0} times")
        };
        format!(
            "; cell {cell} has {has} that frames leave it: spread the load or the support there, or remesh it"
        )
    }

    /// What to do about a load step that failed next to a singular tangent or within rounding.
    fn remedy(&self, problem: &Problem) -> String {
        match self.fall {
            Some(Fall::Onto) => {
                return "; next to nothing holds the body until it comes down on what it touches: let it come to rest there \
                        in frames with inertia, of Organ.stepper(density=..., time_step=0.02, dynamics='backward_euler'), \
                        with friction or damping so that it does, and solve from the last of them (start)"
                    .to_string();
            }
            Some(Fall::Away) => {
                return "; next to nothing holds the body, and nothing that it could touch is in its way: check the signs of \
                        its loads, and where the tools and other organs are"
                    .to_string();
            }
            None => {}
        }
        if self.unfinished > 0 {
            return format!(
                "; conjugate gradients left {} linear systems unfinished at the largest number of iterations: give \
                 ConjugateGradients more (max_iterations) or another preconditioner, or take solver='auto'",
                self.unfinished
            );
        }
        match (self.singular, self.unstable, &self.cut) {
            (Some(load), ..) => format!(
                "; the tangent becomes nearly singular at load {load:.4}, a limit point, above which there is no equilibrium \
                 nearby, or a buckling load, above which the body bends aside: {}",
                self.way_on(problem)
            ),
            (None, Some(_), _) => format!("; {}", self.way_on(problem)),
            (None, None, Some(Cut::Pieces { .. })) => {
                "; what touches is small beside the triangles there, as where nodes of two coarse curved surfaces meet: make \
                 these finer, or give the pair a little friction, such as 0.01, with which the pieces stay"
                    .to_string()
            }
            (None, None, &Some(Cut::Iterations { falls: true, most, .. })) => format!(
                "; the residual still fell: allow a load step more iterations than {most}, \
                 settings={{'max_iterations': {}}}",
                (MORE * most).clamp(ADVISED[0], ADVISED[1])
            ),
            (None, None, &Some(Cut::Iterations { residual, tolerance, .. }))
                if residual < NEAR * tolerance =>
            {
                let higher = format!(
                    "choose a tolerance above it, such as {:.0e} where it is {tolerance:.0e}",
                    3.0 * residual
                );
                if is_nearly_incompressible(problem) {
                    return format!(
                        "; next to Poisson's ratio 1/2 rounding may allow no less: {higher}"
                    );
                }
                let way = self.way_on(problem);
                format!(
                    "; rounding may allow no less: {higher}; or the tangent is nearly singular: {way}"
                )
            }
            _ => String::new(),
        }
    }

    /// How to go on from a tangent that is nearly singular, whether the body buckles or a limit point is near.
    fn way_on(&self, problem: &Problem) -> String {
        let past = if self.in_contact || is_moved(problem) {
            "inertia leads past either, Organ.stepper(dynamics='newmark', density=..., time_step=...)"
        } else if has_path(problem) {
            "arc length follows the path past either, Organ.path(parameter='arc length')"
        } else {
            "past a limit point, prescribe a displacement instead of the load"
        };
        format!(
            "if the body buckles, solve with a small sideways force first, and without it from that state (start); {past}"
        )
    }
}

impl Cut {
    pub fn sentence(&self) -> String {
        match self {
            &Cut::NoEnergy(NoEnergy { cell, jacobian }) if jacobian.abs() > OUT_OF_PROPORTION => {
                format!(
                    "a smaller load step still leads out of all proportion (J = {jacobian:.1e} in cell {cell})"
                )
            }
            Cut::NoEnergy(lost) => format!("a smaller load step still {}", lost.sentence()),
            Cut::NoDescent { residual } => {
                format!("no step lowers the energy (relative residual {residual:.1e})")
            }
            Cut::Iterations { residual, .. } if !residual.is_finite() => {
                "the forces of a smaller load step still overflow; prescribe less, or take a law that grows more slowly".into()
            }
            Cut::Iterations { residual, .. } => {
                format!("too many iterations (relative residual {residual:.1e})")
            }
            Cut::Pieces { residual } => format!(
                "the surfaces of a contact pair swing between the pieces that they share (relative residual {residual:.1e})"
            ),
            Cut::Entered(Entry::Tool { tool, shape }) => format!(
                "tool {tool}, {shape}, goes into the organ between the samples of its surface; give the surface \
                 shorter edges there, or take a blunter tool"
            ),
            Cut::Entered(Entry::Pair(pair)) => format!(
                "the surfaces of contact pair {pair} go through each other; give the layer more stiffness, or press less"
            ),
            Cut::OutOfReach => {
                "surfaces rub that were out of reach at the start of the load step".into()
            }
            Cut::Factor(FactorError::SolutionNotFinite { .. }) => {
                "the displacement of a smaller load step still overflows; check the units of loads and moduli".into()
            }
            Cut::Factor(
                FactorError::NotPositiveDefinite { row } | FactorError::Singular { row },
            ) => format!(
                "the tangent is singular or not positive definite at point {}: the equilibrium is unstable there, or next to \
                 nothing holds a part",
                row / 3
            ),
            Cut::Factor(error) => error.to_string(),
            Cut::Solver(error) => error.to_string(),
            Cut::Spent | Cut::Doubtful => "conjugate gradients did not converge".into(),
            Cut::Cancelled => "cancelled on request".into(),
        }
    }
}

/// Whether the volume of a cell is so much stiffer than its shape that rounding of the one disturbs the other.
fn is_nearly_incompressible(problem: &Problem) -> bool {
    let material = problem.body.material();
    material.parameters().iter().any(|row| {
        let [shear, bulk] = material.moduli(row);
        bulk > STIFF_IN_VOLUME * shear
    })
}

/// Whether forces and pressures alone load the body and whole points hold it, as an arc-length path asks.
fn has_path(problem: &Problem) -> bool {
    let Problem { prescribed, patches, .. } = problem;
    let is_held = |&(dof, value): &(u32, f64)| {
        value == 0.0 && (0..3).all(|i| prescribed.contains(&(dof / 3 * 3 + i, 0.0)))
    };
    patches.is_empty() && prescribed.iter().all(is_held)
}

/// Whether displacements other than zero are prescribed.
fn is_moved(problem: &Problem) -> bool {
    let Problem { prescribed, patches, .. } = problem;
    !patches.is_empty() || prescribed.iter().any(|&(_, value)| value != 0.0)
}
