//! A machine beside the processor that conjugate gradients may run on, a graphics processor for one. The core knows only
//! this interface; who links a device in hands it over with the settings.
//!
//! The device works in single precision. It forms the tangent from the displacement where it can, or takes a copy of the
//! one that is assembled here. What it finds is a step of Newton's method, whose residual stays in double precision
//! here: each step corrects the last one. A device that fails is left, and the processor goes on with the same system.

use super::border::Border;
use crate::body::{Body, ProgrammedCells, ProgrammedSeries};
use crate::clock::Instant;
use crate::equilibrium::tangent::{ProductOperator, RestBlock};
use std::fmt;

/// Where conjugate gradients may run.
pub trait Device: Send + Sync {
    /// Allocates memory for the tangents of one body, whose upper triangle has blocks at `pairs`; with `cells`, for a
    /// system that forms them.
    ///
    /// # Errors
    /// A sentence: no device, too little memory, a limit exceeded, cells that it has no kernels for.
    fn system(
        &self,
        n_nodes: usize,
        pairs: &[(u32, u32)],
        cells: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String>;

    /// Allocates memory to expand the force of a body.
    ///
    /// # Errors
    /// A sentence, as above.
    fn series(&self, body: &ProgrammedSeries<'_>) -> Result<Box<dyn DeviceSeries>, String>;
}

/// The internal force of a body as series in single precision. Every error is a sentence.
pub trait DeviceSeries: Send + Sync {
    /// Degree-p coefficients of the force along series in one variable without their own degree-p coefficients, as
    /// [`Body::force_series`] gives them. Series come in groups of [`SERIES_LANES`], side by side.
    ///
    /// displacement: `u_1 ... u_(p-1)` of a group, each over all degrees of freedom; then those of the next group.
    /// force: `N_p` of each group, over all degrees of freedom.
    ///
    /// # Errors
    /// The device is lost, or has too little memory; values that are not finite.
    fn force(
        &mut self,
        degree: usize,
        displacement: &[f32],
        force: &mut [f32],
    ) -> Result<(), String>;
}

/// Series in a group.
pub const SERIES_LANES: usize = 8;

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

    /// Forms the tangent of the cells that the system was made with.
    ///
    /// # Errors
    /// The device is lost; the system has no cells.
    fn form(&mut self, tangent: &DeviceTangent<'_>) -> Result<(), String>;

    /// The product of its matrix with a vector, zero on what is held.
    ///
    /// # Errors
    /// The device is lost.
    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, String>;

    /// Solves for a right-hand side as far as asked, and measures what the solution and `start` add up to. It sets out from
    /// the combination of at most three earlier steps that is nearest to the solution in energy; from zero where
    /// means are held.
    ///
    /// # Errors
    /// The device is lost, or returned values that are not finite.
    fn solve(
        &mut self,
        b: &[f64],
        steps: &[&[f64]],
        start: &[f64],
        end: &DeviceEnd<'_>,
    ) -> Result<DeviceSolution, String>;

    /// The last direction of the last solution.
    ///
    /// # Errors
    /// The device is lost.
    fn direction(&mut self) -> Result<Vec<f64>, String>;
}

/// A tangent that a device forms: `factor K + rest + shift I`.
pub struct DeviceTangent<'a> {
    /// Displacement [m].
    pub u: &'a [f64],
    /// Pressure of each cluster; none where cells share nothing.
    pub pressures: &'a [f64],
    /// Derivatives of the clusters' volume ratios by their nodes' displacements, and the same times their moduli: each
    /// cluster adds their product.
    pub slopes: [&'a [[f64; 3]]; 2],
    /// Factor of the law's tangent.
    pub factor: f64,
    /// What is added to it: row and column of blocks of the upper triangle, row-major, any number at each place. None if
    /// it is what it was.
    pub rest: Option<&'a [RestBlock]>,
    /// Multiple of the identity.
    pub shift: f64,
}

/// Where a device stops.
#[derive(Clone, Copy)]
pub struct DeviceEnd<'a> {
    /// At this residual, relative to the right-hand side.
    pub tolerance: f64,
    /// After so many iterations.
    pub max_iterations: usize,
    /// Then, with the last iterate.
    pub until: Until<'a>,
}

/// When an iteration stops before its end.
#[derive(Clone, Copy)]
pub struct Until<'a> {
    /// At this time.
    pub deadline: Option<Instant>,
    /// Once this says no. A device asks between batches of iterations, a processor ten times a second.
    pub is_wanted: &'a dyn Fn() -> bool,
}

impl Until<'_> {
    /// A time, or none.
    pub fn time(deadline: Option<Instant>) -> Self {
        Until { deadline, is_wanted: &|| true }
    }

    /// Whether to stop now.
    pub fn is_over(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline) || !(self.is_wanted)()
    }
}

/// The result of a device.
#[derive(Clone, Debug)]
pub struct DeviceSolution {
    /// The solution, as far as it got.
    pub x: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Residual in single precision, relative to the right-hand side.
    pub residual: f64,
    /// `| |K| |start + x| |` on what is free.
    pub magnitude: f64,
    /// Whether the last direction has negative curvature, judged in single precision.
    pub is_indefinite: bool,
}

/// Where the tangent on a device comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The device formed it from the displacement.
    Formed,
    /// It was assembled on the processor.
    Uploaded,
}

impl Origin {
    /// Its name in other languages.
    pub fn name(self) -> &'static str {
        match self {
            Origin::Formed => "formed",
            Origin::Uploaded => "uploaded",
        }
    }
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
    Working(Box<Working>),
    /// It failed, and the processor continues.
    Failed(String),
}

/// A system on a device, and what of it is out of date.
pub(super) struct Working {
    system: Box<dyn DeviceSystem>,
    can_form: bool,
    origin: Option<Origin>,
    /// What was added to the tangent when it was formed last.
    rest: Vec<RestBlock>,
    is_held: Vec<bool>,
    is_border_new: bool,
    is_tangent_new: bool,
}

/// A tangent with a multiple of the identity, as its operand has it.
#[derive(Clone, Copy)]
pub(super) enum Given<'a> {
    /// Values of its blocks, and the shift.
    Assembled(&'a [f64], f64),
    /// What it is formed from, and the shift.
    Product(&'a ProductOperator, f64),
}

impl Remote {
    pub fn new(device: Option<OnDevice>, body: &Body) -> Self {
        let Some(OnDevice(device)) = device else { return Remote::Absent };
        let (n_dofs, pairs) = (body.n_dofs(), body.pattern().pairs().collect::<Vec<_>>());
        let forming = body
            .programmed()
            .ok()
            .and_then(|cells| device.system(n_dofs / 3, &pairs, Some(&cells)).ok());
        let can_form = forming.is_some();
        let system = match forming {
            Some(system) => Ok(system),
            None => device.system(n_dofs / 3, &pairs, None),
        };
        match system {
            Ok(system) => Remote::Working(Box::new(Working {
                system,
                can_form,
                origin: None,
                rest: Vec::new(),
                is_held: vec![false; n_dofs],
                is_border_new: true,
                is_tangent_new: true,
            })),
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

    /// Whether it forms tangents by itself.
    pub fn can_form(&self) -> bool {
        matches!(self, Remote::Working(working) if working.can_form)
    }

    /// Where its last tangent came from; none if it had none, or failed.
    pub fn origin(&self) -> Option<Origin> {
        match self {
            Remote::Working(working) => working.origin,
            _ => None,
        }
    }

    pub fn hold(&mut self, held: &[bool]) {
        if let Remote::Working(working) = self {
            working.is_held.copy_from_slice(held);
            working.is_border_new = true;
        }
    }

    /// The border has changed.
    pub fn bind(&mut self) {
        if let Remote::Working(working) = self {
            working.is_border_new = true;
        }
    }

    /// The tangent has changed.
    pub fn renew(&mut self) {
        if let Remote::Working(working) = self {
            working.is_tangent_new = true;
        }
    }

    /// The solution under the border, where there is a device that finds one.
    pub fn solve(
        &mut self,
        border: &Border,
        given: Given<'_>,
        (b, steps, start): (&[f64], &[&[f64]], &[f64]),
        end: &DeviceEnd<'_>,
    ) -> Option<DeviceSolution> {
        self.attempt(border, given, |system| system.solve(b, steps, start, end))
    }

    /// The product with a vector.
    pub fn multiply(&mut self, border: &Border, given: Given<'_>, x: &[f64]) -> Option<Vec<f64>> {
        self.attempt(border, given, |system| system.multiply(x))
    }

    /// The last direction of the last solution.
    pub fn direction(&mut self, border: &Border, given: Given<'_>) -> Option<Vec<f64>> {
        self.attempt(border, given, |system| system.direction())
    }

    /// What a device that has this tangent under this border does; none if there is no device, or it fails.
    fn attempt<T>(
        &mut self,
        border: &Border,
        given: Given<'_>,
        act: impl FnOnce(&mut dyn DeviceSystem) -> Result<T, String>,
    ) -> Option<T> {
        let Remote::Working(working) = self else { return None };
        let done = working.update(border, given).and_then(|()| act(&mut *working.system));
        done.map_err(|fault| *self = Remote::Failed(fault)).ok()
    }
}

impl Working {
    /// Brings border and tangent up to date.
    fn update(&mut self, border: &Border, given: Given<'_>) -> Result<(), String> {
        let is_border_new = std::mem::take(&mut self.is_border_new);
        if is_border_new {
            self.system.hold(&self.is_held, border.rows())?;
        }
        // The preconditioner goes by what is held, too.
        if !std::mem::take(&mut self.is_tangent_new) && !is_border_new {
            return Ok(());
        }
        match given {
            Given::Assembled(values, shift) => {
                self.origin = Some(Origin::Uploaded);
                self.system.load(values, shift)
            }
            Given::Product(operator, shift) => {
                let (cells, factor, rest) = operator.parts();
                let (u, shared) = cells.at();
                let ties = cells.tie_blocks();
                let ties =
                    ties.map(|(row, column, block)| (row, column, block.map(|k| factor * k)));
                let rest: Vec<RestBlock> = rest.iter().copied().chain(ties).collect();
                // Ties and inertia stay what they were from frame to frame.
                let is_rest_new = rest != self.rest;
                self.rest = rest;
                self.origin = Some(Origin::Formed);
                self.system.form(&DeviceTangent {
                    u,
                    pressures: &shared.pressures,
                    slopes: [&shared.slopes, &shared.weighted],
                    factor,
                    rest: is_rest_new.then_some(&self.rest),
                    shift,
                })
            }
        }
    }
}
