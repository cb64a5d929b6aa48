//! The caller's frame: `x_model [m] = metres_per_unit * R x + t`, and forces in units of `newtons_per_unit`. The core
//! uses SI units in the frame of the mesh; only this file converts.

use crate::all_finite;

type Matrix = [[f64; 3]; 3];

/// `struct viscera_frame`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    pub metres_per_unit: f64,
    pub newtons_per_unit: f64,
    pub rotation: Matrix,
    pub translation: [f64; 3],
}

const _: () = assert!(size_of::<Frame>() == 112);

impl Frame {
    /// SI in the frame of the mesh.
    pub const IDENTITY: Self = Frame {
        metres_per_unit: 1.0,
        newtons_per_unit: 1.0,
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.0; 3],
    };

    /// Units are positive and the matrix is orthogonal to within 1e-6.
    pub fn is_usable(&self) -> bool {
        let r = &self.rotation;
        let is_orthogonal = (0..3).all(|i| {
            (0..3).all(|j| {
                let product: f64 = (0..3).map(|k| r[i][k] * r[j][k]).sum();
                let expected = if i == j { 1.0 } else { 0.0 };
                (product - expected).abs() <= 1e-6
            })
        });
        let units = [self.metres_per_unit, self.newtons_per_unit];
        is_orthogonal
            && all_finite(&units)
            && units.iter().all(|&unit| unit > 0.0)
            && all_finite(&self.translation)
    }

    /// A left-handed frame, in which triangles turn the other way.
    pub fn is_reflected(&self) -> bool {
        let r = &self.rotation;
        let minor = |i: usize, j: usize| r[1][i] * r[2][j] - r[1][j] * r[2][i];
        r[0][0] * minor(1, 2) - r[0][1] * minor(0, 2) + r[0][2] * minor(0, 1) < 0.0
    }

    pub fn point_in(&self, x: [f64; 3]) -> [f64; 3] {
        let turned = self.length_in(x);
        std::array::from_fn(|i| turned[i] + self.translation[i])
    }

    pub fn length_in(&self, d: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        std::array::from_fn(|i| self.metres_per_unit * (0..3).map(|k| r[i][k] * d[k]).sum::<f64>())
    }

    pub fn point_out(&self, x: [f64; 3]) -> [f64; 3] {
        let from_origin = std::array::from_fn(|i| x[i] - self.translation[i]);
        self.back(from_origin).map(|x| x / self.metres_per_unit)
    }

    pub fn force_out(&self, f: [f64; 3]) -> [f64; 3] {
        self.back(f).map(|f| f / self.newtons_per_unit)
    }

    /// A torque turns over in a reflected frame.
    pub fn torque_out(&self, t: [f64; 3]) -> [f64; 3] {
        let sign = if self.is_reflected() { -1.0 } else { 1.0 };
        self.back(t).map(|t| sign * t / (self.newtons_per_unit * self.metres_per_unit))
    }

    pub fn energy_out(&self, w: f64) -> f64 {
        w / (self.newtons_per_unit * self.metres_per_unit)
    }

    pub fn length_out(&self, d: [f64; 3]) -> [f64; 3] {
        self.back(d).map(|d| d / self.metres_per_unit)
    }

    /// `R^T K R`, in force units per length unit of the caller.
    pub fn stiffness_out(&self, k: &Matrix) -> Matrix {
        let r = &self.rotation;
        let unit = self.metres_per_unit / self.newtons_per_unit;
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let terms = (0..9).map(|ab| r[ab / 3][i] * k[ab / 3][ab % 3] * r[ab % 3][j]);
                unit * terms.sum::<f64>()
            })
        })
    }

    /// `R^T S R`, in force units per squared length unit of the caller.
    #[cfg(feature = "hands")]
    pub fn stress_out(&self, s: &Matrix) -> Matrix {
        self.stiffness_out(s).map(|row| row.map(|x| x * self.metres_per_unit))
    }

    fn back(&self, v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| self.rotation[k][i] * v[k]).sum())
    }
}

/// Writes the frame of the mesh, in SI.
///
/// # Safety
/// `frame` is null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_frame_identity(frame: *mut Frame) {
    // SAFETY: the caller's contract.
    unsafe { crate::put(frame, Frame::IDENTITY) }
}
