//! Follower pressure: on each face of a surface the nodal forces `-p int N_a n da`, area and outward normal as deformed;
//! exact for flat triangles and for curved quadratic ones.
//!
//! The derivative is symmetric where the surface is closed or its rim is held: the load has a potential then. The
//! tangent takes its symmetric part; the rest, which lives on free rims alone, is left to an iteration within the step.

use crate::body::{Body, SymmetricBlocks};
use crate::error::Error;
use crate::mesh::cross;

/// Pressures on faces of a body's surface.
#[derive(Clone, Debug, Default)]
pub struct Pressure {
    /// Nodes of each face, seen from outside: three corners, and of a quadratic face the midpoints of the edges that
    /// follow the corners.
    pub faces: Vec<Vec<u32>>,
    /// The pressure on each [Pa], positive against the outward normal.
    pub values: Vec<f64>,
}

/// A quadrature point of the unit triangle: weight, shape functions, their slopes.
struct QuadraturePoint {
    weight: f64,
    shape: Vec<f64>,
    slopes: Vec<[f64; 2]>,
}

/// A face as deformed at a quadrature point: `int N_a n` is the sum of `weight N_a normal`, and with
/// `e_b = N_b,1 x,2 - N_b,2 x,1` its derivative is `-weight N_a [e_b]_x`.
struct FacePoint<'a> {
    nodes: &'a [u32],
    pressure: f64,
    shape: &'a [f64],
    normal: [f64; 3],
    edges: Vec<[f64; 3]>,
}

impl Pressure {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Checks values, and that every face is one of a cell.
    ///
    /// # Errors
    /// Those of [`Pressure::check_values`]; a face whose nodes share no cell.
    pub fn check(&self, body: &Body) -> Result<(), Error> {
        self.check_values()?;
        if self.is_empty() {
            return Ok(());
        }
        let nodes = if body.edges().is_empty() { 3 } else { 6 };
        for (k, face) in self.faces.iter().enumerate() {
            let touch = |a: u32| face.iter().all(|&b| body.pattern().position(a, b).is_some());
            if face.len() != nodes || !face.iter().all(|&a| touch(a)) {
                return Err(Error::input(format!(
                    "face {k}, {face:?}, is none of the mesh; take {nodes} nodes of its surface"
                )));
            }
        }
        Ok(())
    }

    /// Checks lengths and finiteness.
    ///
    /// # Errors
    /// A count that differs, a value that is not finite.
    pub fn check_values(&self) -> Result<(), Error> {
        if self.faces.len() != self.values.len() {
            return Err(Error::input(format!(
                "{} pressures for {} faces; give one each",
                self.values.len(),
                self.faces.len()
            )));
        }
        match self.values.iter().position(|p| !p.is_finite()) {
            Some(k) => Err(Error::input(format!(
                "the pressure on face {k} is {} Pa; it must be finite",
                self.values[k]
            ))),
            None => Ok(()),
        }
    }

    /// Adds `factor` times the nodal forces at displacement `u` [N].
    pub fn add_force(&self, body: &Body, u: &[f64], factor: f64, force: &mut [f64]) {
        self.each(body, u, |piece| {
            for (&node, n) in piece.nodes.iter().zip(piece.shape) {
                for i in 0..3 {
                    force[3 * node as usize + i] -= factor * piece.pressure * n * piece.normal[i];
                }
            }
        });
    }

    /// Adds the symmetric part of `-factor df/du`, `-p/2 [N_a e_b - N_b e_a]_x`: what the load takes from the stiffness.
    pub fn add_stiffness(
        &self,
        body: &Body,
        u: &[f64],
        factor: f64,
        tangent: &mut SymmetricBlocks,
    ) {
        self.each(body, u, |FacePoint { nodes, pressure, shape, edges, .. }| {
            for a in 0..nodes.len() {
                for b in (0..nodes.len()).filter(|&b| nodes[a] < nodes[b]) {
                    let Some(position) = tangent.pattern().position(nodes[a], nodes[b]) else {
                        continue;
                    };
                    let e: [f64; 3] = std::array::from_fn(|i| {
                        -0.5 * factor * pressure * (shape[a] * edges[b][i] - shape[b] * edges[a][i])
                    });
                    let spin = [0.0, -e[2], e[1], e[2], 0.0, -e[0], -e[1], e[0], 0.0];
                    tangent.add(position, &spin);
                }
            }
        });
    }

    /// Adds the symmetric part of `-factor df/du` times `x`, `-p/2 (N_a e_b - N_b e_a) x x_b`: the product with what
    /// [`Pressure::add_stiffness`] adds.
    pub fn add_product(&self, body: &Body, u: &[f64], factor: f64, x: &[f64], out: &mut [f64]) {
        self.add_part(body, u, [factor, -factor], x, out);
    }

    /// Adds the skew part of `-factor df/du` times `x`, `-p/2 (N_a e_b + N_b e_a) x x_b`: zero inside a surface, since
    /// neighbours cancel.
    pub fn add_skew(&self, body: &Body, u: &[f64], factor: f64, x: &[f64], out: &mut [f64]) {
        self.add_part(body, u, [factor, factor], x, out);
    }

    /// Adds `-p/2 (c N_a e_b + d N_b e_a) x x_b`, with the factors `[c, d]`.
    fn add_part(&self, body: &Body, u: &[f64], [c, d]: [f64; 2], x: &[f64], out: &mut [f64]) {
        self.each(body, u, |FacePoint { nodes, pressure, shape, edges, .. }| {
            for a in 0..nodes.len() {
                for b in 0..nodes.len() {
                    let (own, its) = (d * shape[b], c * shape[a]);
                    let e = std::array::from_fn(|i| its * edges[b][i] + own * edges[a][i]);
                    let force = cross(e, at(x, nodes[b]));
                    for i in 0..3 {
                        out[3 * nodes[a] as usize + i] -= 0.5 * pressure * force[i];
                    }
                }
            }
        });
    }

    /// Work from `u` along `length * step` [J]: the power is a quadratic in the length, so Simpson's rule
    /// is exact.
    pub fn work(&self, body: &Body, u: &[f64], step: &[f64], length: f64) -> f64 {
        if self.is_empty() {
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

    /// Adds the last order of `load(a)` times the nodal forces along `u(a)`: coefficients of the load, and of the
    /// displacement as many, those of a degree of freedom in a row, `stride` from one to the next.
    ///
    /// The forces are quadratic in the position `x`, so with `t = x,1` and `s = load x,2` they are a Cauchy product.
    pub fn add_force_series(
        &self,
        body: &Body,
        load: &[f64],
        u: &[f64],
        stride: usize,
        force: &mut [f64],
    ) {
        let Some(first) = self.faces.first() else { return };
        let (rule, order) = (rule(first.len()), load.len() - 1);
        for (nodes, &pressure) in self.faces.iter().zip(&self.values) {
            for QuadraturePoint { weight, shape, slopes } in &rule {
                let tangent = |k: usize, order: usize| -> [f64; 3] {
                    let rest = |node: u32, i: usize| {
                        if order == 0 { body.points()[node as usize][i] } else { 0.0 }
                    };
                    std::array::from_fn(|i| {
                        let x = |n: u32| u[(3 * n as usize + i) * stride + order] + rest(n, i);
                        nodes.iter().zip(slopes).map(|(&n, s)| s[k] * x(n)).sum()
                    })
                };
                let second: Vec<[f64; 3]> = (0..=order).map(|p| tangent(1, p)).collect();
                let mut normal = [0.0; 3];
                for p in 0..=order {
                    let loaded = std::array::from_fn(|i| {
                        (0..=order - p).map(|q| load[order - p - q] * second[q][i]).sum()
                    });
                    let part = cross(tangent(0, p), loaded);
                    (0..3).for_each(|i| normal[i] += part[i]);
                }
                for (&node, n) in nodes.iter().zip(shape) {
                    (0..3).for_each(|i| {
                        force[3 * node as usize + i] -= pressure * weight * n * normal[i];
                    });
                }
            }
        }
    }

    /// Every quadrature point of every face, its weight within normal and edges.
    fn each(&self, body: &Body, u: &[f64], mut visit: impl FnMut(FacePoint)) {
        let Some(first) = self.faces.first() else {
            return;
        };
        let rule = rule(first.len());
        for (nodes, &pressure) in self.faces.iter().zip(&self.values) {
            let x: Vec<[f64; 3]> = nodes
                .iter()
                .map(|&n| {
                    let (rest, moved) = (body.points()[n as usize], at(u, n));
                    std::array::from_fn(|i| rest[i] + moved[i])
                })
                .collect();
            for QuadraturePoint { weight, shape, slopes } in &rule {
                let tangent = |k: usize| -> [f64; 3] {
                    std::array::from_fn(|i| x.iter().zip(slopes).map(|(x, s)| s[k] * x[i]).sum())
                };
                let (t1, t2) = (tangent(0), tangent(1));
                let edge = |s: &[f64; 2]| -> [f64; 3] {
                    std::array::from_fn(|i| weight * (s[0] * t2[i] - s[1] * t1[i]))
                };
                visit(FacePoint {
                    nodes,
                    pressure,
                    shape,
                    normal: cross(t1, t2).map(|n| weight * n),
                    edges: slopes.iter().map(edge).collect(),
                });
            }
        }
    }
}

fn at(u: &[f64], node: u32) -> [f64; 3] {
    std::array::from_fn(|i| u[3 * node as usize + i])
}

/// One point for linear faces; for quadratic ones the six of Dunavant's rule, exact to degree 4 (Int. J. Numer. Meth.
/// Engng 21, 1985, 1129).
fn rule(nodes: usize) -> Vec<QuadraturePoint> {
    if nodes == 3 {
        let slopes = vec![[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
        return vec![QuadraturePoint { weight: 0.5, shape: vec![1.0 / 3.0; 3], slopes }];
    }
    let (near, far) = (0.445_948_490_915_964_9, 0.091_576_213_509_770_74);
    let (heavy, light) = (0.111_690_794_839_005_73, 0.054_975_871_827_660_93);
    let mut rule = Vec::with_capacity(6);
    for (weight, side) in [(heavy, near), (light, far)] {
        for corner in 0..3 {
            let mut l = [side; 3];
            l[corner] = 1.0 - 2.0 * side;
            let dl = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
            let mut point = QuadraturePoint { weight, shape: Vec::new(), slopes: Vec::new() };
            for i in 0..3 {
                point.shape.push(l[i] * (2.0 * l[i] - 1.0));
                point.slopes.push(dl[i].map(|d| d * (4.0 * l[i] - 1.0)));
            }
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                point.shape.push(4.0 * l[i] * l[j]);
                let slope = |k: usize| 4.0 * (dl[i][k] * l[j] + dl[j][k] * l[i]);
                point.slopes.push([slope(0), slope(1)]);
            }
            rule.push(point);
        }
    }
    rule
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};
    use crate::number::dot;

    /// A body with pressure on the first faces of its surface, a displacement, and a direction.
    fn sample(element: Element, count: usize) -> (Body, Pressure, Vec<f64>, Vec<f64>) {
        let (points, cells) = block([2, 2, 1], [0.3, 0.2, 0.1]);
        let material = Material::new("neo_hookean", vec![vec![1.0, 1.0]]).unwrap();
        let body = Body::with_element(element, points, cells, material).unwrap();
        let (u, v) = (noise(body.n_dofs(), 3), noise(body.n_dofs(), 8));
        let surface = body.surface();
        let mut faces: Vec<Vec<u32>> = if element == Element::P2 {
            let six = |f: &[[u32; 3]]| vec![f[0][0], f[1][1], f[2][2], f[0][1], f[1][2], f[2][0]];
            surface.chunks_exact(4).map(six).collect()
        } else {
            surface.iter().map(|t| t.to_vec()).collect()
        };
        faces.truncate(count);
        let pressure = Pressure { values: vec![700.0; faces.len()], faces };
        pressure.check(&body).unwrap();
        (body, pressure, u.iter().map(|x| 0.01 * x).collect(), v)
    }

    const ALL: usize = usize::MAX;

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

    /// Moves nodes on edges halfway between the ends.
    fn straighten(body: &Body, u: &mut [f64]) {
        for (edge, &[a, b]) in body.edges().iter().enumerate() {
            let [node, a, b] = [body.n_corners() + edge, a as usize, b as usize];
            (0..3).for_each(|i| u[3 * node + i] = 0.5 * (u[3 * a + i] + u[3 * b + i]));
        }
    }

    #[test]
    fn on_a_closed_surface_the_stiffness_is_the_derivative() {
        for element in [Element::P1, Element::P2] {
            let (body, pressure, u, v) = sample(element, ALL);
            let (k, f) = (stiffness(&body, &pressure, &u, &v), slope(&body, &pressure, &u, &v));
            let size = dot(&f, &f).sqrt();
            assert!(size > 1.0 && k.iter().zip(&f).all(|(k, f)| (k + f).abs() < 1e-12 * size));
            let mut product = f;
            pressure.add_product(&body, &u, 1.0, &v, &mut product);
            assert!(product.iter().all(|rest| rest.abs() < 1e-12 * size));
        }
    }

    #[test]
    fn on_an_open_one_it_is_the_symmetric_part() {
        for element in [Element::P1, Element::P2] {
            let (body, pressure, u, v) = sample(element, 5);
            let (mut k, f) = (stiffness(&body, &pressure, &u, &v), slope(&body, &pressure, &u, &v));
            assert!((dot(&v, &k) + dot(&v, &f)).abs() < 1e-12 * dot(&f, &f).sqrt());
            assert!(k.iter().zip(&f).any(|(k, f)| (k + f).abs() > 1e-3), "this one is unsymmetric");
            pressure.add_skew(&body, &u, 1.0, &v, &mut k);
            let size = dot(&f, &f).sqrt();
            assert!(
                k.iter().zip(&f).all(|(k, f)| (k + f).abs() < 1e-12 * size),
                "and this the rest"
            );
        }
    }

    /// Both sides are polynomials of degree 6 in the path parameter.
    #[test]
    fn the_series_is_that_of_the_force() {
        for element in [Element::P1, Element::P2] {
            let (body, pressure, u, v) = sample(element, 5);
            let w = noise(u.len(), 11);
            let (loads, stride) = ([0.4, -0.3, 0.7, 0.0, 0.0, 0.0, 0.0], 9);
            let mut path = vec![0.0; stride * u.len()];
            for (dof, row) in path.chunks_exact_mut(stride).enumerate() {
                row[..3].copy_from_slice(&[u[dof], 0.1 * v[dof], 0.1 * w[dof]]);
            }
            let a = 0.6f64;
            let mut sum = vec![0.0; u.len()];
            for p in 0..loads.len() {
                let mut order = vec![0.0; u.len()];
                pressure.add_force_series(&body, &loads[..=p], &path, stride, &mut order);
                sum.iter_mut().zip(order).for_each(|(s, c)| *s += a.powi(p as i32) * c);
            }
            let at: Vec<f64> =
                path.chunks_exact(stride).map(|c| c[0] + a * (c[1] + a * c[2])).collect();
            let mut exact = vec![0.0; u.len()];
            pressure.add_force(&body, &at, loads[0] + a * (loads[1] + a * loads[2]), &mut exact);
            let size = dot(&exact, &exact).sqrt();
            assert!(
                size > 1.0 && sum.iter().zip(&exact).all(|(s, f)| (s - f).abs() < 1e-12 * size)
            );
        }
    }

    #[test]
    fn a_closed_surface_feels_no_total_force_and_works_on_the_volume() {
        for element in [Element::P1, Element::P2] {
            let (body, pressure, mut u, mut v) = sample(element, ALL);
            let f = force(&body, &pressure, &u, &v, 0.0);
            for i in 0..3 {
                assert!(f[i..].iter().step_by(3).sum::<f64>().abs() < 1e-12);
            }
            // Of curved cells the four points of the quadrature do not see the whole volume.
            straighten(&body, &mut u);
            straighten(&body, &mut v);
            let step: Vec<f64> = v.iter().map(|v| 0.01 * v).collect();
            let end: Vec<f64> = u.iter().zip(&step).map(|(u, d)| u + 0.7 * d).collect();
            let swept = 700.0 * (body.volume(&u) - body.volume(&end));
            let work = pressure.work(&body, &u, &step, 0.7);
            assert!((work - swept).abs() < 1e-12 * 700.0 * body.rest_volume(), "{work} {swept}");
        }
    }
}
