//! Follower pressure: on each triangle of a surface the force `-p A n`, with area and outward normal as deformed, a
//! third to each corner; exact for flat triangles and a uniform `p`.
//!
//! Its derivative is symmetric where the surface is closed or its rim is held: the load has a potential then. The
//! tangent takes its symmetric part; the rest, which lives on free rims alone, is left to an iteration within the step.

use crate::body::{Body, SymmetricBlocks};
use crate::error::Error;
use crate::mesh::{cross, sub};

/// Pressures on triangles of a body's surface.
#[derive(Clone, Debug, Default)]
pub struct Pressure {
    /// Triangles, outward.
    pub triangles: Vec<[u32; 3]>,
    /// The pressure on each [Pa], positive against the outward normal.
    pub values: Vec<f64>,
}

impl Pressure {
    /// Checks lengths and finiteness, and that every triangle is a face of a cell.
    ///
    /// # Errors
    /// A count that differs, a value that is not finite, a triangle whose corners share no cell.
    pub fn check(&self, body: &Body) -> Result<(), Error> {
        if self.triangles.len() != self.values.len() {
            return Err(Error::input(format!(
                "{} pressures for {} triangles; give one each",
                self.values.len(),
                self.triangles.len()
            )));
        }
        if let Some((k, p)) = self.values.iter().enumerate().find(|(_, p)| !p.is_finite()) {
            return Err(Error::input(format!(
                "the pressure on triangle {k} is {p} Pa; it must be finite"
            )));
        }
        let tangent = body.zero_tangent();
        for (k, t) in self.triangles.iter().enumerate() {
            let is_face = (0..3).all(|a| tangent.position(t[a], t[(a + 1) % 3]).is_some());
            if t.iter().any(|&n| n as usize >= body.points().len()) || !is_face {
                return Err(Error::input(format!(
                    "triangle {k}, {t:?}, is no face of the mesh; take triangles of its surface"
                )));
            }
        }
        Ok(())
    }

    /// Adds `factor` times the nodal forces at displacement `u` [N].
    pub fn add_force(&self, body: &Body, u: &[f64], factor: f64, force: &mut [f64]) {
        for (t, p) in self.triangles.iter().zip(&self.values) {
            let x = deformed(body, u, t);
            let doubled = cross(sub(x[1], x[0]), sub(x[2], x[0]));
            for &node in t {
                for i in 0..3 {
                    force[3 * node as usize + i] -= factor * p / 6.0 * doubled[i];
                }
            }
        }
    }

    /// Adds the symmetric part of `-factor df/du`: what the load takes from the stiffness.
    ///
    /// With `e_a` the edge opposite to corner a, `df_a/dx_b = p/6 [e_b]_x`; its symmetric part is
    /// `p/12 [e_b - e_a]_x`.
    pub fn add_stiffness(
        &self,
        body: &Body,
        u: &[f64],
        factor: f64,
        tangent: &mut SymmetricBlocks,
    ) {
        for (t, p) in self.triangles.iter().zip(&self.values) {
            let x = deformed(body, u, t);
            let edge = |a: usize| sub(x[(a + 1) % 3], x[(a + 2) % 3]);
            for a in 0..3 {
                let b = (a + 1) % 3;
                let (row, column) = if t[a] < t[b] { (a, b) } else { (b, a) };
                let Some(position) = tangent.position(t[row], t[column]) else { continue };
                let e = sub(edge(column), edge(row)).map(|e| -factor * p / 12.0 * e);
                let spin = [0.0, -e[2], e[1], e[2], 0.0, -e[0], -e[1], e[0], 0.0];
                tangent.add(position, &spin);
            }
        }
    }

    /// Adds the skew part of `-factor df/du` times `x`: zero inside a surface, since neighbours cancel.
    ///
    /// `p/12 (e_a + e_b) x x_b` to corner a from every corner b.
    pub fn add_skew(&self, body: &Body, u: &[f64], factor: f64, x: &[f64], out: &mut [f64]) {
        for (t, p) in self.triangles.iter().zip(&self.values) {
            let corner = deformed(body, u, t);
            let edge = |a: usize| sub(corner[(a + 1) % 3], corner[(a + 2) % 3]);
            for a in 0..3 {
                for b in 0..3 {
                    let sum = sub(edge(a), edge(b).map(|e| -e));
                    let moved = std::array::from_fn(|i| x[3 * t[b] as usize + i]);
                    let force = cross(sum, moved);
                    for i in 0..3 {
                        out[3 * t[a] as usize + i] -= factor * p / 12.0 * force[i];
                    }
                }
            }
        }
    }

    /// Work on the way from `u` along `length * step` [J]: the power is a quadratic in the length, so Simpson's rule
    /// is exact.
    pub fn work(&self, body: &Body, u: &[f64], step: &[f64], length: f64) -> f64 {
        if self.triangles.is_empty() {
            return 0.0;
        }
        let power = |s: f64| {
            let mut force = vec![0.0; u.len()];
            let at: Vec<f64> = u.iter().zip(step).map(|(u, d)| u + s * d).collect();
            self.add_force(body, &at, 1.0, &mut force);
            force.iter().zip(step).map(|(f, d)| f * d).sum::<f64>()
        };
        length / 6.0 * (power(0.0) + 4.0 * power(0.5 * length) + power(length))
    }
}

fn deformed(body: &Body, u: &[f64], triangle: &[u32; 3]) -> [[f64; 3]; 3] {
    triangle.map(|n| {
        let n = n as usize;
        std::array::from_fn(|i| body.points()[n][i] + u[3 * n + i])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};
    use crate::mesh::surface;

    fn sample(count: usize) -> (Body, Pressure, Vec<f64>, Vec<f64>) {
        let (points, cells) = block([2, 2, 1], [0.3, 0.2, 0.1]);
        let triangles = surface(&points, &cells)[..count].to_vec();
        let material = Material::new("neo_hookean", vec![vec![1.0, 1.0]]).unwrap();
        let body = Body::new(points, cells, material).unwrap();
        let (u, v) = (noise(body.n_dofs(), 3), noise(body.n_dofs(), 8));
        let pressure = Pressure { values: vec![700.0; count], triangles };
        (body, pressure, u.iter().map(|x| 0.01 * x).collect(), v)
    }

    fn all() -> usize {
        let (points, cells) = block([2, 2, 1], [0.3, 0.2, 0.1]);
        surface(&points, &cells).len()
    }

    fn force(body: &Body, pressure: &Pressure, u: &[f64], v: &[f64], h: f64) -> Vec<f64> {
        let at: Vec<f64> = u.iter().zip(v).map(|(u, v)| u + h * v).collect();
        let mut force = vec![0.0; at.len()];
        pressure.add_force(body, &at, 1.0, &mut force);
        force
    }

    /// The force is quadratic in `u`: central differences are exact.
    fn slope(body: &Body, pressure: &Pressure, u: &[f64], v: &[f64]) -> Vec<f64> {
        let (plus, minus) = (force(body, pressure, u, v, 0.1), force(body, pressure, u, v, -0.1));
        plus.iter().zip(minus).map(|(p, m)| (p - m) / 0.2).collect()
    }

    fn stiffness(body: &Body, pressure: &Pressure, u: &[f64], v: &[f64]) -> Vec<f64> {
        let mut tangent = body.zero_tangent();
        pressure.add_stiffness(body, u, 1.0, &mut tangent);
        let mut out = vec![0.0; u.len()];
        tangent.multiply(v, &mut out);
        out
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    #[test]
    fn on_a_closed_surface_the_stiffness_is_the_derivative() {
        let (body, pressure, u, v) = sample(all());
        let (k, f) = (stiffness(&body, &pressure, &u, &v), slope(&body, &pressure, &u, &v));
        let size = dot(&f, &f).sqrt();
        assert!(size > 1.0 && k.iter().zip(&f).all(|(k, f)| (k + f).abs() < 1e-12 * size));
    }

    #[test]
    fn on_an_open_one_it_is_the_symmetric_part() {
        let (body, pressure, u, v) = sample(5);
        let (mut k, f) = (stiffness(&body, &pressure, &u, &v), slope(&body, &pressure, &u, &v));
        assert!((dot(&v, &k) + dot(&v, &f)).abs() < 1e-12 * dot(&f, &f).sqrt());
        assert!(k.iter().zip(&f).any(|(k, f)| (k + f).abs() > 1e-3), "this one is unsymmetric");
        pressure.add_skew(&body, &u, 1.0, &v, &mut k);
        let size = dot(&f, &f).sqrt();
        assert!(k.iter().zip(&f).all(|(k, f)| (k + f).abs() < 1e-12 * size), "and this the rest");
    }

    #[test]
    fn a_closed_surface_feels_no_total_force_and_works_on_the_volume() {
        let (body, pressure, u, v) = sample(all());
        let f = force(&body, &pressure, &u, &v, 0.0);
        for i in 0..3 {
            assert!(f[i..].iter().step_by(3).sum::<f64>().abs() < 1e-12);
        }
        let step: Vec<f64> = v.iter().map(|v| 0.01 * v).collect();
        let end: Vec<f64> = u.iter().zip(&step).map(|(u, d)| u + 0.7 * d).collect();
        let swept = 700.0 * (body.volume(&u) - body.volume(&end));
        let work = pressure.work(&body, &u, &step, 0.7);
        assert!((work - swept).abs() < 1e-12 * 700.0 * body.rest_volume(), "{work} {swept}");
    }
}
