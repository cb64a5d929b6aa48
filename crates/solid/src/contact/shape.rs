//! Shapes of tools by their signed distance, in axes of their own.

use super::distance::Distance;
use super::solid::Solid;
use crate::error::Error;
use std::sync::Arc;

/// A rigid shape.
#[derive(Clone, Debug)]
pub enum Shape {
    /// All points within `radius` of a box around the origin: a sphere where the box is a point, a capsule where it is a
    /// piece of the z axis, a box with rounded edges.
    Rounded {
        /// Half the sides of the box [m].
        half: [f64; 3],
        /// Radius [m].
        radius: f64,
    },
    /// `z <= 0`.
    HalfSpace,
    /// The inside of a closed surface.
    Solid(Arc<Solid>),
}

impl Shape {
    /// A word for messages.
    pub fn name(&self) -> &'static str {
        match self {
            Shape::Rounded { half: [0.0, 0.0, 0.0], .. } => "a sphere",
            Shape::Rounded { half: [0.0, 0.0, _], .. } => "a capsule",
            Shape::Rounded { .. } => "a box",
            Shape::HalfSpace => "a half-space",
            Shape::Solid(_) => "a shape",
        }
    }

    /// Radius of a ball around the origin that holds the shape [m].
    pub fn reach(&self) -> f64 {
        match self {
            Shape::Rounded { half, radius } => {
                half.iter().map(|h| h * h).sum::<f64>().sqrt() + radius
            }
            Shape::HalfSpace => f64::INFINITY,
            Shape::Solid(solid) => solid.reach(),
        }
    }

    /// Half the second of its three extents along its axes [m]: the radius of a sphere or a capsule, and of a rod. What is
    /// as narrow as that fits between samples that are farther apart.
    pub fn width(&self) -> f64 {
        let mut extents = match self {
            Shape::Rounded { half, radius } => half.map(|h| h + radius),
            Shape::HalfSpace => return f64::INFINITY,
            Shape::Solid(solid) => {
                let [low, high] = solid.bounds();
                std::array::from_fn(|i| 0.5 * (high[i] - low[i]))
            }
        };
        extents.sort_by(f64::total_cmp);
        extents[1]
    }

    /// The distance of a point.
    pub fn distance(&self, x: [f64; 3]) -> Distance {
        match self {
            Shape::Rounded { half, radius } => rounded(*half, *radius, x),
            Shape::HalfSpace => {
                Distance { gap: x[2], normal: [0.0, 0.0, 1.0], curvature: [[0.0; 3]; 3] }
            }
            Shape::Solid(solid) => solid.distance(x),
        }
    }

    pub(super) fn check(&self, number: usize) -> Result<(), Error> {
        let Shape::Rounded { half, radius } = self else {
            return Ok(());
        };
        let is_length = |x: &f64| x.is_finite() && *x >= 0.0;
        if !half.iter().chain([radius]).all(is_length)
            || half.iter().all(|h| *h == 0.0) && *radius == 0.0
        {
            return Err(Error::input(format!(
                "tool {number} has the half sides {half:?} m and the radius {radius} m; give finite lengths, not all zero"
            )));
        }
        Ok(())
    }
}

/// Outside, the closest point of the box is fixed along the axes on which the point lies beyond it, and goes along on the
/// others: with `q` the vector from it, `g = |q| - r`, `g' = q / |q|`, `g'' = (D - g' g'^T) / |q|`, `D` one on the former axes.
fn rounded(half: [f64; 3], radius: f64, x: [f64; 3]) -> Distance {
    let q: [f64; 3] = std::array::from_fn(|i| x[i] - x[i].clamp(-half[i], half[i]));
    let distance = q.iter().map(|q| q * q).sum::<f64>().sqrt();
    if distance == 0.0 {
        return inside(half, radius, x);
    }
    let normal = q.map(|q| q / distance);
    let curvature = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let fixed = f64::from(i == j && q[i] != 0.0);
            (fixed - normal[i] * normal[j]) / distance
        })
    });
    Distance { gap: distance - radius, normal, curvature }
}

/// Inside the box: the closest point is on the closest side.
fn inside(half: [f64; 3], radius: f64, x: [f64; 3]) -> Distance {
    let axis = (0..3)
        .max_by(|&i, &j| (x[i].abs() - half[i]).total_cmp(&(x[j].abs() - half[j])))
        .unwrap_or(0);
    let mut normal = [0.0; 3];
    normal[axis] = if x[axis] < 0.0 { -1.0 } else { 1.0 };
    Distance { gap: x[axis].abs() - half[axis] - radius, normal, curvature: [[0.0; 3]; 3] }
}
