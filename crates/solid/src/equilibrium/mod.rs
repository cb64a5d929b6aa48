//! Equilibrium: find `u` with `f_int(u) = f_ext`, some of its components and weighted means
//! prescribed.

mod analytic;
mod compliance;
mod domain;
mod ending;
mod iteration;
mod newton;
mod outcome;
mod predictor;
mod pressure;
mod problem;
mod skew;
mod stepper;
mod system;
mod tangent;
#[cfg(test)]
mod tests;

pub use analytic::require_series_about_rest;
pub use compliance::Compliance;
pub use iteration::{Iteration, Limits, Rounding, Stop, backtrack, iterate};
pub use newton::Newton;
pub use outcome::{Equilibrium, Seconds, Status};
pub use pressure::Pressure;
pub use problem::{PatchLoad, Problem, patch_mean};
pub use stepper::{
    Dynamics, Frame, Input, Integration, Mass, Prony, Stepper, StepperSettings, StiffnessDamping,
    Torque, Turn, VOLUME_BOUNDS,
};
pub use system::{
    Choice, ConjugateGradients, ConstrainedSystem, Device, DeviceEnd, DeviceSeries, DeviceSolution,
    DeviceSystem, DeviceTangent, Method, OnDevice, Origin, Preconditioner, Row, SERIES_LANES,
    Solved, Until, dofs_of, mean_rows,
};
pub use tangent::Tangent;
