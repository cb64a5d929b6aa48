//! Spheres around triangles, for telling what is far apart.

use super::{Vector, norm, sub};

/// A sphere around a triangle, about its centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre [m].
    pub centre: Vector,
    /// Its radius [m].
    pub radius: f64,
}

impl Sphere {
    /// Around the triangle with these points.
    pub fn around(points: &[Vector], triangle: &[u32; 3]) -> Self {
        let x = triangle.map(|corner| points[corner as usize]);
        let centre = std::array::from_fn(|i| x.iter().map(|x| x[i]).sum::<f64>() / 3.0);
        let radius = x.iter().map(|&x| norm(sub(x, centre))).fold(0.0, f64::max);
        Sphere { centre, radius }
    }

    /// How far apart two are, negative where they overlap [m].
    pub fn apart(&self, other: &Sphere) -> f64 {
        self.distance(other.centre) - other.radius
    }

    /// How far it is from a point, negative inside [m].
    pub fn distance(&self, x: Vector) -> f64 {
        norm(sub(self.centre, x)) - self.radius
    }
}
