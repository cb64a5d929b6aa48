//! A machine beside the processor that conjugate gradients may run on, a graphics processor for one. The core knows only
//! this interface; who links a device in hands it over with the settings.
//!
//! The device works in single precision on a copy of the tangent. What it finds is a step of Newton's method, whose
//! residual stays in double precision here: each step corrects the last one. A device that fails is left, and the
//! processor goes on with the same system.

use super::border::Border;
use crate::body::BlockPattern;
use crate::clock::Instant;
use std::fmt;

/// Where conjugate gradients may run.
pub trait Device: Send + Sync {
    /// Allocates memory for the tangents of one body, whose upper triangle has blocks at `pairs`.
    ///
    /// # Errors
    /// A sentence: no device, too little memory, a limit exceeded.
    fn system(&self, n_nodes: usize, pairs: &[(u32, u32)])
    -> Result<Box<dyn DeviceSystem>, String>;
}

/// A linear system on a device, its preconditioner the inverse of each node's block. Every error is a sentence.
pub trait DeviceSystem: Send + Sync {
    /// Holds degrees of freedom at zero, and means `sum w u = 0` of others, by rows of degree of freedom and weight.
    ///
    /// # Errors
    /// The device is lost, or takes no more means.
    fn hold(&mut self, is_held: &[bool], means: &[Vec<(u32, f64)>]) -> Result<(), String>;

    /// Takes nine values for each block of the upper triangle, row-major, and adds `shift` to the diagonal.
    ///
    /// # Errors
    /// The device is lost.
    fn load(&mut self, values: &[f64], shift: f64) -> Result<(), String>;

    /// Solves for a right-hand side as far as asked.
    ///
    /// # Errors
    /// The device is lost, or returned values that are not finite.
    fn solve(&mut self, b: &[f64], end: &DeviceEnd) -> Result<DeviceSolution, String>;
}

/// Where a device stops.
#[derive(Clone, Copy, Debug)]
pub struct DeviceEnd {
    /// At this residual, relative to the right-hand side.
    pub tolerance: f64,
    /// After so many iterations.
    pub max_iterations: usize,
    /// At this time, with the last iterate.
    pub deadline: Option<Instant>,
}

/// The result of a device.
#[derive(Clone, Debug)]
pub struct DeviceSolution {
    /// The solution, as far as it got.
    pub x: Vec<f64>,
    /// The last direction.
    pub direction: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Whether the direction has negative curvature, judged in single precision.
    pub is_indefinite: bool,
}

/// A device by reference: settings are copied and compared.
#[derive(Clone, Copy)]
pub struct OnDevice(pub &'static dyn Device);

impl PartialEq for OnDevice {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::addr_eq(self.0, other.0)
    }
}

impl fmt::Debug for OnDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("OnDevice")
    }
}

/// A system on a device for as long as it works, and why it does not.
pub(super) enum Remote {
    /// None was asked for.
    Absent,
    /// It works.
    Working {
        system: Box<dyn DeviceSystem>,
        is_held: Vec<bool>,
        is_border_new: bool,
        is_tangent_new: bool,
    },
    /// It failed, and the processor continues.
    Failed(String),
}

impl Remote {
    pub fn new(device: Option<OnDevice>, pattern: &BlockPattern, n_dofs: usize) -> Self {
        let Some(OnDevice(device)) = device else { return Remote::Absent };
        let pairs: Vec<(u32, u32)> = pattern.pairs().collect();
        match device.system(n_dofs / 3, &pairs) {
            Ok(system) => Remote::Working {
                system,
                is_held: vec![false; n_dofs],
                is_border_new: true,
                is_tangent_new: true,
            },
            Err(fault) => Remote::Failed(fault),
        }
    }

    /// Why it failed.
    pub fn fault(&self) -> Option<&str> {
        match self {
            Remote::Failed(fault) => Some(fault),
            _ => None,
        }
    }

    pub fn hold(&mut self, held: &[bool]) {
        if let Remote::Working { is_held, is_border_new, .. } = self {
            is_held.copy_from_slice(held);
            *is_border_new = true;
        }
    }

    /// The tangent has changed.
    pub fn renew(&mut self) {
        if let Remote::Working { is_tangent_new, .. } = self {
            *is_tangent_new = true;
        }
    }

    /// The solution under the border, where there is a device that finds one, of the matrix of `values` and `shift`.
    pub fn solve(
        &mut self,
        border: &Border,
        (values, shift): (&[f64], f64),
        b: &[f64],
        end: &DeviceEnd,
    ) -> Option<DeviceSolution> {
        let Remote::Working { system, is_held, is_border_new, is_tangent_new } = self else {
            return None;
        };
        let mut attempt = || {
            let is_border_new = std::mem::take(is_border_new);
            if is_border_new {
                system.hold(is_held, border.rows())?;
            }
            // The preconditioner goes by what is held, too.
            if std::mem::take(is_tangent_new) || is_border_new {
                system.load(values, shift)?;
            }
            system.solve(b, end)
        };
        match attempt() {
            Ok(found) => Some(found),
            Err(fault) => {
                *self = Remote::Failed(fault);
                None
            }
        }
    }
}
