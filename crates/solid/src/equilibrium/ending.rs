//! How a solution ends: why a load step was given up, where the path turns, and the message.

use super::outcome::Status;
use super::problem::Problem;
use crate::error::Error;
use crate::linear::FactorError;

/// A residual of fewer tolerances is small: what keeps it above may be rounding.
const NEAR: f64 = 100.0;

/// Why a load step was given up.
pub(super) enum Cut {
    Inverted {
        cell: usize,
        jacobian: f64,
    },
    NoDescent {
        residual: f64,
    },
    Iterations {
        residual: f64,
        tolerance: f64,
    },
    Factor(FactorError),
    /// A tool went into the body between the samples of its surface.
    Entered {
        tool: usize,
        shape: &'static str,
    },
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

/// Load and `|du/dload|` of the last two equilibria from which a step started, the newest last.
pub(super) struct Slopes([(f64, f64); 2]);

impl Slopes {
    pub fn new() -> Self {
        Slopes([(f64::NEG_INFINITY, 0.0); 2])
    }

    /// Adds an equilibrium, unless it is the newest already.
    pub fn note(&mut self, load: f64, slope: f64) {
        if load > self.0[1].0 {
            self.0 = [self.0[1], (load, slope)];
        }
    }

    /// The load at which the path turns, if it turns within a `reach` beyond the equilibrium at `load`.
    ///
    /// Next to a limit point the displacement goes with the root of the distance in load, so `1/|du/dload|^2` falls
    /// linearly to zero.
    pub fn limit_point(&self, load: f64, reach: f64) -> Option<f64> {
        let [(before, slow), (last, fast)] = self.0;
        if last != load || !before.is_finite() || !(fast > slow) {
            return None;
        }
        let left = (last - before) / ((fast / slow).powi(2) - 1.0);
        (left <= reach).then_some(last + left)
    }
}

/// What is known at the end.
pub(super) struct Ending {
    pub load: f64,
    pub iterations: usize,
    /// Why the last load step was given up.
    pub cut: Option<Cut>,
    /// The load at which the path turns.
    pub turn: Option<f64>,
    /// Load and degree of freedom of an equilibrium that is not stable.
    pub unstable: Option<(f64, usize)>,
}

impl Ending {
    pub fn status(&self) -> Status {
        match (self.load >= 1.0, self.unstable, self.turn) {
            (false, _, Some(_)) => Status::LimitPoint,
            (false, _, None) => Status::StepTooSmall,
            (true, None, _) => Status::Converged,
            (true, Some(_), _) => Status::ConvergedPastInstability,
        }
    }

    pub fn message(&self, problem: &Problem) -> String {
        let (status, load) = (self.status(), self.load);
        let mut text = match (status.is_converged(), &self.cut) {
            (false, Some(cut)) => format!("stopped at load {load:.4}: {}", cut.sentence()),
            _ => format!("converged in {} iterations", self.iterations),
        };
        if let (Status::LimitPoint, Some(turn)) = (status, self.turn) {
            let advice = if has_path(problem) {
                "follow it further by arc length, Organ.path(parameter='arc length')"
            } else {
                "ask for less, or prescribe a displacement instead of the load"
            };
            text += &format!("; the path turns back at load {turn:.4}, a limit point: {advice}");
        }
        if let Some((load, dof)) = self.unstable {
            text += &format!(
                "; the tangent was not positive definite under what is prescribed at load {load:.4} (point {}): \
                 the path passes an instability",
                dof / 3
            );
        }
        if !status.is_converged() && problem.body.material().name() == "saint_venant_kirchhoff" {
            text += "; Saint Venant-Kirchhoff softens in compression and its energy stays finite where a cell is \
                     crushed, a known flaw of the law: use neo_hookean";
        }
        text
    }
}

impl Cut {
    pub fn sentence(&self) -> String {
        match self {
            Cut::Inverted { cell, jacobian } => {
                format!(
                    "a smaller load step still turns cell {cell} inside out (J = {jacobian:.3})"
                )
            }
            Cut::NoDescent { residual } => {
                format!("no step lowers the energy (relative residual {residual:.1e})")
            }
            &Cut::Iterations { residual, tolerance } => {
                let mut text = format!("too many iterations (relative residual {residual:.1e})");
                if residual < NEAR * tolerance {
                    text += &format!(
                        "; next to Poisson's ratio 1/2 rounding may allow no less: choose a tolerance above it, such as \
                         {:.0e} where it is {tolerance:.0e}",
                        3.0 * residual
                    );
                }
                text
            }
            Cut::Entered { tool, shape } => format!(
                "tool {tool}, {shape}, goes into the organ between the samples of its surface; give the surface \
                 shorter edges there, or take a blunter tool"
            ),
            Cut::OutOfReach => {
                "surfaces rub that were out of reach at the start of the load step".into()
            }
            Cut::Factor(FactorError::SolutionNotFinite { .. }) => {
                "the displacement of a smaller load step still overflows; check the units of loads and moduli".into()
            }
            Cut::Factor(error) => error.to_string(),
            Cut::Solver(error) => error.to_string(),
            Cut::Spent | Cut::Doubtful => "conjugate gradients did not converge".into(),
            Cut::Cancelled => "cancelled on request".into(),
        }
    }
}

/// Whether forces and pressures alone load the body and whole points hold it, as an arc-length path asks.
fn has_path(problem: &Problem) -> bool {
    let Problem { prescribed, patches, .. } = problem;
    let is_held = |&(dof, value): &(u32, f64)| {
        value == 0.0 && (0..3).all(|i| prescribed.contains(&(dof / 3 * 3 + i, 0.0)))
    };
    patches.is_empty() && prescribed.iter().all(is_held)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_next_to_the_tolerance_is_told_as_what_rounding_may_leave() {
        let sentence = |residual| Cut::Iterations { residual, tolerance: 1e-9 }.sentence();
        let near = sentence(1.1e-9);
        assert!(
            near.ends_with("choose a tolerance above it, such as 3e-9 where it is 1e-9"),
            "{near}"
        );
        assert_eq!(sentence(1e-3), "too many iterations (relative residual 1.0e-3)");
    }
}
