//! Springs and cables between the means of two places, or from one to a point in space.
//!
//! With the vector `x = d + sum_a w_a u_a` between the ends and its length `l`, a spring holds `k (l - l_0)^2 / 2`; a
//! cable holds nothing where it is shorter than `l_0`.

use super::curvature::Curvature;
use crate::error::Error;
use crate::tensor::Mat3;

/// A spring or a cable.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Nodes and weights: those of the first end add up to 1, those of the second, if it is none in space, to -1.
    pub ends: Vec<(u32, f64)>,
    /// Vector from the second end to the first at rest `d` [m].
    pub rest: [f64; 3],
    /// Stiffness `k` [N/m].
    pub stiffness: f64,
    /// Length without force `l_0` [m].
    pub length: f64,
    /// Whether it bears no compression.
    pub is_cable: bool,
}

/// What a link does at a displacement.
pub(super) struct Pull {
    /// Energy [J].
    pub energy: f64,
    /// Its derivative by `x` [N].
    pub force: [f64; 3],
    /// Its second derivative [N/m]; without its negative part if it is to be projected.
    pub stiffness: Mat3<f64>,
}

impl Link {
    /// At a displacement; none where a cable is slack.
    pub(super) fn at(&self, u: &[f64], curvature: Curvature) -> Option<Pull> {
        let Link { stiffness: k, length, is_cable, .. } = *self;
        let mut x = self.rest;
        for &(node, weight) in &self.ends {
            (0..3).for_each(|i| x[i] += weight * u[3 * node as usize + i]);
        }
        let now = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let stretch = now - length;
        if is_cable && stretch <= 0.0 {
            return None;
        }
        // Without a length in space there is no direction, and no force along it.
        let n = if now > 0.0 { x.map(|x| x / now) } else { [0.0; 3] };
        let across = if now > 0.0 { k * stretch / now } else { k };
        let across = if curvature == Curvature::Projected { across.max(0.0) } else { across };
        let stiffness = std::array::from_fn(|i| {
            std::array::from_fn(|j| k * n[i] * n[j] + across * (f64::from(i == j) - n[i] * n[j]))
        });
        let force = n.map(|n| k * stretch * n);
        Some(Pull { energy: 0.5 * k * stretch * stretch, force, stiffness })
    }

    pub(super) fn check(&self, number: usize, n_nodes: usize) -> Result<(), Error> {
        if let Some((node, _)) = self.ends.iter().find(|(node, _)| *node as usize >= n_nodes) {
            return Err(Error::input(format!(
                "spring {number} ends at point {node}; there are {n_nodes} points"
            )));
        }
        let is_finite = self.ends.iter().all(|(_, weight)| weight.is_finite())
            && self.rest.iter().all(|x| x.is_finite());
        let is_sound = self.stiffness > 0.0 && self.stiffness.is_finite() && self.length >= 0.0;
        if is_finite && is_sound && self.length.is_finite() && !self.ends.is_empty() {
            return Ok(());
        }
        Err(Error::input(format!(
            "spring {number} has the stiffness {} N/m and the length {} m; give finite numbers, the stiffness above 0, \
             and an end on the body",
            self.stiffness, self.length
        )))
    }
}
