//! A sphere pressed into the surface along a normal, and what of its motion the patch of a model follows.

use super::model::ReducedModel;
use viscera_mesh::{cross, dot, norm, sub};
use viscera_number::tensor::{Mat3, inverse, mul_vector};
use viscera_number::unroll::tabulate;

/// Of the radius of the contact that Hertz predicts, and the squared edges of the mesh that a contact has at least.
/// Both are fitted to the paths of `benchmarks/probe.py tuning`.
const SHARE: f64 = 0.65;
const GRAIN: f64 = 6.0;
/// Error of the force, relative to its norm, that comes from the patch in place of the contact, where that is as wide
/// as the mesh can show; fitted as the share is.
pub const CONTACT_ERROR: f64 = 0.25;
/// Error of the force where Hertz's contact is as narrow as an edge of the mesh, relative to its norm; it grows as the
/// contact shrinks. Below it are 95 of 100 poses, those at a support
/// left out, of 200 paths of `benchmarks/probe.py tuning`.
const UNRESOLVED: f64 = 0.45;
/// The drag is at most this part of the radius of the sphere.
const DRAG: f64 = 0.5;
/// Nor is it longer than so many times what the sphere has entered. By Mindlin (J. Appl. Mech. 16 (1949) 259) a sphere on a
/// half-space slips at `mu (2 - nu) / (2 - 2 nu)` times that, so a friction below 2.7 does not reach it there.
const LEAN: f64 = 4.0;

/// A sphere pressed into the surface along a normal.
pub(super) struct Press {
    pub normal: [f64; 3],
    /// Part of the motion of the sphere that the patch follows, its derivative by how far the sphere has entered, and that of
    /// the depth of the patch.
    share: f64,
    growth: f64,
    slope: f64,
    /// How deep the patch is pressed in [m].
    pub depth: f64,
    /// The drag is at most this long [m]. It vanishes, and with it its force, as the sphere leaves the surface, however large
    /// the friction.
    pub longest: f64,
    /// The derivative of that by how far the sphere has entered.
    lengthening: f64,
    /// Error of the force, relative to its norm, that comes from the patch in place of the contact.
    pub error: f64,
}

impl Press {
    pub fn new(model: &ReducedModel, radius: f64, entered: f64, normal: [f64; 3]) -> Self {
        Self::of([model.metadata.radius, model.edge_length], radius, entered, normal)
    }

    /// Of a patch of this radius on a mesh with edges of this length.
    fn of([patch, edge]: [f64; 2], radius: f64, entered: f64, normal: [f64; 3]) -> Self {
        let per = SHARE / patch;
        let disc = (radius * entered + GRAIN * edge.powi(2)).sqrt();
        let (share, growth) = match per * disc {
            share if share < 1.0 => (share, 0.5 * per * radius / disc),
            _ => (1.0, 0.0),
        };
        let unresolved = UNRESOLVED * edge / (radius * entered).sqrt();
        let error = CONTACT_ERROR.max(unresolved);
        let (slope, depth) = (share + growth * entered, share * entered);
        let (longest, lengthening) = match LEAN * entered {
            longest if longest < DRAG * radius => (longest, LEAN),
            _ => (DRAG * radius, 0.0),
        };
        Press { normal, share, growth, slope, depth, longest, lengthening, error }
    }

    pub fn displacement(&self, drag: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.share * drag[i] - self.depth * self.normal[i])
    }

    pub fn along(&self, v: [f64; 3]) -> [f64; 3] {
        let up = dot(v, self.normal);
        std::array::from_fn(|i| v[i] - up * self.normal[i])
    }

    /// The change of the drag that takes an excess from the force along the surface.
    pub fn slip(&self, stiffness: &Mat3<f64>, excess: [f64; 3]) -> [f64; 3] {
        // Two directions along the surface.
        let flat =
            (0..3).fold(0, |k, i| if self.normal[i].abs() < self.normal[k].abs() { i } else { k });
        let axis: [f64; 3] = std::array::from_fn(|i| if i == flat { 1.0 } else { 0.0 });
        let first = cross(self.normal, axis);
        let first = first.map(|x| x / norm(first));
        let plane = [first, cross(self.normal, first)];
        let k: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| self.share * dot(plane[i], mul_vector(stiffness, &plane[j])))
        });
        let e = plane.map(|axis| dot(axis, excess));
        let determinant = k[0][0] * k[1][1] - k[0][1] * k[1][0];
        // Tissue near an instability does not say where to slip to.
        if !(k[0][0] > 0.0 && determinant > 0.0) {
            return [0.0; 3];
        }
        let a = (k[1][1] * e[0] - k[0][1] * e[1]) / determinant;
        let b = (k[0][0] * e[1] - k[1][0] * e[0]) / determinant;
        std::array::from_fn(|i| a * plane[0][i] + b * plane[1][i])
    }

    /// Derivative of the force with respect to the centre, of a sphere that holds the surface. The patch follows by
    /// `d = share (t - g n)`, the drag by what the centre moves along the surface, and `g` by what it moves down:
    ///   `dF/dx = K (share T + (g share)' n n^T - share' t n^T)`,   `T = dt/dx = P = I - n n^T`.
    /// Of a drag `t = l(g) e` that was longer, by `length`, before it was cut to the longest,
    ///   `T = l / length (P - e e^T) - l' e n^T`.
    pub fn stuck(&self, stiffness: &Mat3<f64>, drag: [f64; 3], length: f64) -> Mat3<f64> {
        let (n, is_cut) = (self.normal, length > self.longest);
        let (turned, stretched) = match is_cut {
            true => (self.longest / length, self.lengthening),
            false => (1.0, 0.0),
        };
        let e = drag.map(|x| if is_cut { x / self.longest } else { 0.0 });
        let of_normal: [f64; 3] = std::array::from_fn(|i| {
            self.slope * n[i] - self.growth * drag[i] - self.share * stretched * e[i]
        });
        let follows = tabulate!(|i, j| {
            let plane = f64::from(u8::from(i == j)) - n[i] * n[j] - e[i] * e[j];
            self.share * turned * plane + of_normal[i] * n[j]
        });
        product(stiffness, &follows)
    }

    /// The same where the tissue slips by `s` along the surface so that `F_t = mu F_n e`. With the derivative `J` of a sphere
    /// that holds, the direction `e` turns with that of the force before the slip, of which a part `kept` is left:
    ///   `share (P K P + mu e n^T K P) ds = (e e^T + (1 - kept) (P - e e^T) + mu e n^T) J dx`,   `dF = J dx - share K ds`.
    pub fn sliding(
        &self,
        stiffness: &Mat3<f64>,
        drag: [f64; 3],
        [friction, kept]: [f64; 2],
        along: [f64; 3],
    ) -> Mat3<f64> {
        let (n, size) = (self.normal, norm(along));
        let e = along.map(|x| if size > 0.0 { x / size } else { 0.0 });
        let stuck = self.stuck(stiffness, drag, norm(drag).min(self.longest));
        let plane = tabulate!(|i, j| f64::from(u8::from(i == j)) - n[i] * n[j]);
        let onto = |a: &Mat3<f64>| -> [f64; 3] {
            std::array::from_fn(|j| (0..3).map(|i| n[i] * a[i][j]).sum())
        };
        let flat = product(stiffness, &plane);
        let (flat_along, flat_onto) = (product(&plane, &flat), onto(&flat));
        let slips = tabulate!(|i, j| {
            self.share * (flat_along[i][j] + friction * e[i] * flat_onto[j]) + n[i] * n[j]
        });
        let drives = tabulate!(|i, j| {
            let across = plane[i][j] - e[i] * e[j];
            e[i] * e[j] + (1.0 - kept) * across + friction * e[i] * n[j]
        });
        // Tissue near an instability does not say where to slip to.
        let Some(inverse) = inverse(&slips) else { return stuck };
        let slip = product(&inverse, &product(&drives, &stuck));
        let freed = product(&flat, &slip);
        tabulate!(|i, j| stuck[i][j] - self.share * freed[i][j])
    }
}

fn product(a: &Mat3<f64>, b: &Mat3<f64>) -> Mat3<f64> {
    tabulate!(|i, j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
}

/// The point on the line from one to another that is at most a length away from the first.
pub(super) fn within(from: [f64; 3], to: [f64; 3], length: f64) -> [f64; 3] {
    let line = sub(to, from);
    let size = norm(line);
    if size <= length {
        return to;
    }
    let part = if size.is_finite() { length / size } else { 0.0 };
    std::array::from_fn(|i| from[i] + part * line[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A patch that resists more along one direction than along another, and couples them with the normal [N/m].
    const STIFFNESS: Mat3<f64> =
        [[900.0, 50.0, 260.0], [50.0, 300.0, -90.0], [260.0, -90.0, 500.0]];
    const NORMAL: [f64; 3] = [0.48, -0.6, 0.64];
    const DRAGGED: [f64; 3] = [2e-3, 1e-3, -0.5625e-3]; // along the surface

    /// A sphere of 10 mm that has entered by 4 mm, moved.
    fn moved(by: [f64; 3], patch: f64) -> (Press, [f64; 3]) {
        let press = Press::of([patch, 2e-3], 0.01, 4e-3 - dot(NORMAL, by), NORMAL);
        let along = press.along(by);
        (press, std::array::from_fn(|i| DRAGGED[i] + along[i]))
    }

    fn force(press: &Press, drag: [f64; 3]) -> [f64; 3] {
        mul_vector(&STIFFNESS, &press.displacement(drag))
    }

    /// The drag once the tissue has slipped, and what is left of the force along the surface.
    fn slipped(press: &Press, mut drag: [f64; 3], friction: f64) -> ([f64; 3], f64) {
        let first = norm(press.along(force(press, drag)));
        for _ in 0..200 {
            let now = force(press, drag);
            let (along, bound) = (press.along(now), -friction * dot(now, press.normal));
            let excess = along.map(|x| x * (1.0 - bound / norm(along).max(1e-300)));
            drag = sub(drag, press.slip(&STIFFNESS, excess));
        }
        (drag, norm(press.along(force(press, drag))) / first)
    }

    fn assert_is_derivative(found: &Mat3<f64>, force: impl Fn([f64; 3]) -> [f64; 3]) {
        let h = 1e-7;
        let largest = found.as_flattened().iter().fold(0.0f64, |most, x| most.max(x.abs()));
        for j in 0..3 {
            let by = |h: f64| std::array::from_fn(|i| if i == j { h } else { 0.0 });
            let (more, less) = (force(by(h)), force(by(-h)));
            for i in 0..3 {
                let exact = (more[i] - less[i]) / (2.0 * h);
                assert!(
                    (found[i][j] - exact).abs() < 1e-5 * largest,
                    "{i}{j}: {} {exact}",
                    found[i][j]
                );
            }
        }
    }

    /// Of a drag that is cut to a length that grows with how far the sphere has entered, and to one that does not.
    fn assert_cut_is_derivative(patch: f64) {
        for entered in [1e-3, 4e-3] {
            let force = |by: [f64; 3]| {
                let press = Press::of([patch, 2e-3], 0.01, entered - dot(NORMAL, by), NORMAL);
                let along = press.along(by);
                let uncut = std::array::from_fn(|i| 10.0 * DRAGGED[i] + along[i]);
                let drag = within([0.0; 3], uncut, press.longest);
                (mul_vector(&STIFFNESS, &press.displacement(drag)), press, drag, norm(uncut))
            };
            let (_, press, drag, length) = force([0.0; 3]);
            assert!(length > press.longest && (press.lengthening > 0.0) == (entered < 2e-3));
            assert_is_derivative(&press.stuck(&STIFFNESS, drag, length), |by| force(by).0);
        }
    }

    /// With a patch of which the sphere moves a part, and with one of which it moves the whole.
    #[test]
    fn derivatives_of_the_force_are_those_of_the_sphere() {
        for patch in [0.012, 0.004] {
            let (press, drag) = moved([0.0; 3], patch);
            assert!((press.share < 1.0) == (patch > 0.01) && dot(drag, NORMAL).abs() < 1e-18);
            assert_is_derivative(&press.stuck(&STIFFNESS, drag, norm(drag)), |by| {
                let (press, drag) = moved(by, patch);
                force(&press, drag)
            });
            assert_cut_is_derivative(patch);
            for friction in [0.0, 0.2] {
                let (slid, kept) = slipped(&press, drag, friction);
                assert!(kept < 0.9 && (friction == 0.0 || kept > 0.1), "{kept}");
                let along = press.along(force(&press, slid));
                let along = if friction > 0.0 { along } else { [0.0; 3] };
                let found = press.sliding(&STIFFNESS, slid, [friction, kept], along);
                assert_is_derivative(&found, |by| {
                    let (press, drag) = moved(by, patch);
                    force(&press, slipped(&press, drag, friction).0)
                });
            }
        }
    }
}
