//! The energy in the coordinates of the modes, with its derivatives, after one evaluation.

/// What is evaluated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    /// Energy and force.
    Force,
    /// The tangent, too, by this thread alone.
    Tangent,
    /// The tangent, too, by all threads.
    SharedTangent,
}

/// Energy, force and tangent at some coordinates.
#[derive(Clone)]
pub(super) struct Reduced {
    /// `W(q)` [J].
    pub energy: f64,
    /// `dW/dq`.
    pub force: Vec<f64>,
    /// `d2W/dq2`, full and row by row; last computed where it was asked for.
    pub tangent: Vec<f64>,
    /// Smallest volume ratio of a cell with a weight.
    pub jacobian: f64,
}

impl Reduced {
    /// Memory for `r` modes.
    pub fn new(r: usize) -> Self {
        let (force, tangent) = (vec![0.0; r], vec![0.0; r * r]);
        Reduced { energy: 0.0, force, tangent, jacobian: 1.0 }
    }

    /// Fills the upper triangle of the tangent from the lower one.
    pub fn mirror(&mut self) {
        let r = self.force.len();
        for k in 0..r {
            for l in 0..k {
                self.tangent[l * r + k] = self.tangent[k * r + l];
            }
        }
    }
}
