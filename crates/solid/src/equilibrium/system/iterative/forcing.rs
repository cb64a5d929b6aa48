//! How far the linear systems of a frame are solved. Newton's method gains nothing from a system that is solved far beyond
//! what its own step leaves out of balance (Eisenstat and Walker, SIAM J. Sci. Comput. 17 (1996) 16). What the step of an
//! iteration leaves is known from the frame before.

/// Part of what the step of an iteration left in the last frame that its linear system may leave.
const SHARE: f64 = 0.2;

/// How many times the tolerance that was asked for may be left at most.
const LOOSEST: f64 = 30.0;

/// What the steps of the last frame left out of balance, and what matters.
#[derive(Default)]
pub(super) struct Forcing {
    /// Norm of a residual that is negligible.
    enough: f64,
    /// Norm of the force that has been balanced before the next solve.
    balanced: f64,
    /// By iteration: the residual after its step over that before. The last one of a frame is not known.
    left: Vec<f64>,
    /// The iteration that comes next.
    iteration: usize,
    /// The residual that the iteration before set out from.
    before: f64,
}

impl Forcing {
    /// The next solve is the first of a frame, in which a residual of the norm `enough` is negligible. It may also leave the
    /// tolerance times `balanced`, the norm of the force that the extrapolated motion has balanced before.
    pub fn begin_frame(&mut self, enough: f64, balanced: f64) {
        (self.enough, self.balanced) = (enough, balanced);
        self.left.truncate(self.iteration.saturating_sub(1));
        self.iteration = 0;
    }

    /// The residual to solve to, relative to the right-hand side, which has the norm `whole`: `tolerance`, or more where the
    /// step will leave more, or less does not matter.
    pub fn tolerance(&mut self, tolerance: f64, whole: f64) -> f64 {
        if let Some(last) = self.iteration.checked_sub(1) {
            self.left.resize(self.left.len().max(self.iteration), 0.0);
            self.left[last] = whole / self.before;
        }
        self.before = whole;
        let expected = self.left.get(self.iteration).map_or(0.0, |left| SHARE * left);
        self.iteration += 1;
        let enough = self.enough.max(tolerance * std::mem::take(&mut self.balanced));
        expected.max(enough / whole).clamp(tolerance, LOOSEST * tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f64 = 1e-3;
    const MOST: f64 = LOOSEST * TOLERANCE;

    /// The tolerances of a frame whose right-hand sides have these norms.
    fn frame(forcing: &mut Forcing, enough: f64, norms: &[f64]) -> Vec<f64> {
        forcing.begin_frame(enough, 0.0);
        norms.iter().map(|&whole| forcing.tolerance(TOLERANCE, whole)).collect()
    }

    fn is_close(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn a_system_leaves_a_share_of_what_the_same_step_left_in_the_last_frame() {
        let mut forcing = Forcing::default();
        assert_eq!(frame(&mut forcing, 0.0, &[8.0, 0.4, 0.2]), [TOLERANCE; 3]);
        // Left: 0.05 and 0.5; of the last step it is not known.
        let known = frame(&mut forcing, 0.0, &[2.0, 1.0, 0.001, 1e-9]);
        assert!(is_close(&known, &[0.05 * SHARE, MOST, TOLERANCE, TOLERANCE]), "{known:?}");
        // Half, a thousandth, and a millionth.
        let known = frame(&mut forcing, 0.0, &[1.0, 1.0]);
        assert!(is_close(&known, &[MOST, TOLERANCE]), "{known:?}");
        // A frame shorter than the last: what came after its first step is forgotten.
        let known = frame(&mut forcing, 0.0, &[1.0]);
        assert!(is_close(&known, &[MOST]), "{known:?}");
        assert_eq!(frame(&mut forcing, 0.0, &[1.0, 0.5]), [TOLERANCE; 2]);
    }

    #[test]
    fn a_residual_that_does_not_matter_is_left_but_never_most_of_it() {
        let mut forcing = Forcing::default();
        let known = frame(&mut forcing, 1e-5, &[1.0, 1e-3, 1e-6]);
        assert!(is_close(&known, &[TOLERANCE, 1e-2, MOST]), "{known:?}");
        // Who asks for an exact solution gets one.
        forcing.begin_frame(1e-5, 0.0);
        assert!(forcing.tolerance(1e-12, 1.0) <= LOOSEST * 1e-12);
    }

    /// A frame that sets out from nearer by leaves what it would have left from farther off.
    #[test]
    fn what_has_been_balanced_before_counts_as_part_of_the_first_right_hand_side() {
        let mut forcing = Forcing::default();
        forcing.begin_frame(0.0, 4.0);
        assert!((forcing.tolerance(TOLERANCE, 0.4) - 10.0 * TOLERANCE).abs() < 1e-15);
        assert_eq!(forcing.tolerance(TOLERANCE, 0.4), TOLERANCE);
    }
}
