//! Position and rotation of a tool.

use crate::error::Error;
use crate::mesh::{cross, dot, sub};
use crate::tensor::{Mat3, mul_vector, transpose_mul_vector};

/// How far `R R^T` may be from the identity.
const ROUNDING: f64 = 1e-6;

/// `x = R y + p` from the axes of a tool to those of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The rotation `R`, rows first.
    pub rotation: Mat3<f64>,
    /// The origin of the tool `p` [m].
    pub position: [f64; 3],
}

impl Default for Pose {
    fn default() -> Self {
        Pose::at([0.0; 3])
    }
}

impl Pose {
    /// Not turned.
    pub fn at(position: [f64; 3]) -> Self {
        Pose { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], position }
    }

    /// From the tool to the world.
    pub fn outward(&self, y: [f64; 3]) -> [f64; 3] {
        let turned = self.turn(y);
        std::array::from_fn(|i| turned[i] + self.position[i])
    }

    /// From the world to the tool.
    pub fn inward(&self, x: [f64; 3]) -> [f64; 3] {
        transpose_mul_vector(&self.rotation, &sub(x, self.position))
    }

    /// A direction from the tool to the world.
    pub fn turn(&self, y: [f64; 3]) -> [f64; 3] {
        mul_vector(&self.rotation, &y)
    }

    /// Moved by a displacement and turned about its origin by a rotation vector [rad], both in axes of the world.
    pub fn moved(&self, displacement: [f64; 3], turn: [f64; 3]) -> Self {
        let position = std::array::from_fn(|i| self.position[i] + displacement[i]);
        let columns: [[f64; 3]; 3] =
            std::array::from_fn(|j| rotated(turn, std::array::from_fn(|i| self.rotation[i][j])));
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        Pose { rotation, position }
    }

    /// The rotation vector [rad], in axes of the world, that turns it to where another pose is: the shorter way.
    pub(super) fn turn_to(&self, other: &Pose) -> [f64; 3] {
        let r: Mat3<f64> = std::array::from_fn(|i| {
            std::array::from_fn(|j| dot(other.rotation[i], self.rotation[j]))
        });
        // The quaternion by its largest component (Shepperd 1978): four times its products with the others are sums and
        // differences of entries.
        let trace = r[0][0] + r[1][1] + r[2][2];
        let squares = [trace, r[0][0], r[1][1], r[2][2]];
        let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
        let skew = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
        let (scalar, vector) = match largest {
            0 => (1.0 + trace, skew),
            k => {
                let axis = k - 1;
                let entry = |i: usize| match i {
                    _ if i == axis => 1.0 + 2.0 * r[i][i] - trace,
                    _ => r[i][axis] + r[axis][i],
                };
                (skew[axis], std::array::from_fn(entry))
            }
        };
        let size = dot(vector, vector).sqrt();
        if size == 0.0 {
            return [0.0; 3];
        }
        let sign = if scalar < 0.0 { -1.0 } else { 1.0 };
        let angle = 2.0 * size.atan2(scalar.abs());
        vector.map(|v| sign * angle * v / size)
    }

    pub(super) fn check(&self, number: usize) -> Result<(), Error> {
        let values = self.rotation.iter().flatten().chain(&self.position);
        if let Some(value) = values.into_iter().find(|v| !v.is_finite()) {
            return Err(Error::input(format!(
                "the pose of tool {number} holds {value}; it must be finite"
            )));
        }
        let [a, b, c] = self.rotation;
        let is_unit =
            [(a, a), (b, b), (c, c)].iter().all(|&(a, b)| (dot(a, b) - 1.0).abs() < ROUNDING);
        if !is_unit || dot(a, b).abs() > ROUNDING || (dot(cross(a, b), c) - 1.0).abs() > ROUNDING {
            return Err(Error::input(format!(
                "the rotation of tool {number} is no rotation; give an orthogonal matrix of determinant 1"
            )));
        }
        Ok(())
    }
}

/// Rodrigues' formula: a vector turned by a rotation vector.
pub(super) fn rotated(turn: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    let angle = turn.iter().map(|t| t * t).sum::<f64>().sqrt();
    if angle == 0.0 {
        return v;
    }
    let axis = turn.map(|t| t / angle);
    let (sine, cosine) = angle.sin_cos();
    let across = cross(axis, v);
    let along = axis.iter().zip(v).map(|(a, v)| a * v).sum::<f64>();
    std::array::from_fn(|i| cosine * v[i] + sine * across[i] + (1.0 - cosine) * along * axis[i])
}
