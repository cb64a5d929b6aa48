//! A field over space and load position as a sum of products, `u(x, s) = sum_i F_i(x) G_i(s)`.

use crate::error::Error;
use faer::Mat;

/// Pairs of modes: `space[i]` holds `F_i` at every degree of freedom, `position[i]` holds `G_i` at every position.
#[derive(Clone, Debug, Default)]
pub struct Separated {
    /// `F_i`.
    pub space: Vec<Vec<f64>>,
    /// `G_i` [m].
    pub position: Vec<Vec<f64>>,
}

impl Separated {
    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.space.len()
    }

    /// Whether the field is zero.
    pub fn is_empty(&self) -> bool {
        self.space.is_empty()
    }

    /// Calls `add(F_i, G_i(s))` for the pairs that do not vanish at position `s`.
    pub(super) fn at(&self, s: usize, mut add: impl FnMut(&[f64], f64)) {
        for (f, g) in self.space.iter().zip(&self.position) {
            if g[s] != 0.0 {
                add(f, g[s]);
            }
        }
    }

    /// The same field in as few orthogonal pairs as `tolerance` allows: the projected PGD of paper A.
    ///
    /// QR of both factors, singular values of the small core; pairs are dropped from the smallest up while the
    /// dropped part stays below `tolerance` times the field, in the norm `sum_s w_s |u(., s)|^2`.
    ///
    /// # Errors
    /// Values that are not finite; a number of weights that is not the number of positions.
    pub fn compress(&self, weights: &[f64], tolerance: f64) -> Result<Separated, Error> {
        let (n, k) = (self.space.first().map_or(0, Vec::len), self.len());
        if k == 0 {
            return Ok(self.clone());
        }
        let m = self.position[0].len();
        if weights.len() != m || weights.iter().any(|w| !(*w > 0.0 && w.is_finite())) {
            return Err(Error::input(format!("the {m} positions need one positive weight each")));
        }
        let space = Mat::from_fn(n, k, |r, c| self.space[c][r]).qr();
        let position = Mat::from_fn(m, k, |r, c| self.position[c][r] * weights[r].sqrt()).qr();
        let core = space.thin_R() * position.thin_R().transpose();
        let svd = core
            .thin_svd()
            .map_err(|_| Error::input("the modes cannot be compressed: they are not finite"))?;
        let sigma: Vec<f64> = (0..core.nrows().min(core.ncols())).map(|i| svd.S()[i]).collect();
        let kept = rank(&sigma, tolerance);
        let left = space.compute_thin_Q() * svd.U().subcols(0, kept);
        let right = position.compute_thin_Q() * svd.V().subcols(0, kept);
        let column = |i: usize| (0..n).map(|r| left[(r, i)]).collect();
        let amplitude =
            |i: usize| (0..m).map(|s| right[(s, i)] * sigma[i] / weights[s].sqrt()).collect();
        Ok(Separated {
            space: (0..kept).map(column).collect(),
            position: (0..kept).map(amplitude).collect(),
        })
    }
}

/// The smallest rank whose remainder is below `tolerance` times the whole.
fn rank(sigma: &[f64], tolerance: f64) -> usize {
    let whole: f64 = sigma.iter().map(|s| s * s).sum();
    let (mut kept, mut dropped) = (sigma.len(), 0.0);
    while kept > 0 {
        dropped += sigma[kept - 1].powi(2);
        if dropped > tolerance.powi(2) * whole {
            break;
        }
        kept -= 1;
    }
    kept
}
