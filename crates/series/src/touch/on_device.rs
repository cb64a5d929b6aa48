//! The right-hand sides of load positions on a device, along the [`Directions`] of a degree.

use super::directions::Directions;
use crate::body::Body;
use crate::equilibrium::{DeviceSeries, OnDevice, SERIES_LANES};
use crate::number::simd::{Kernel, dispatch_solver};
use crate::number::{Lanes, WIDTH, Wide};
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

const _: () = assert!(WIDTH == SERIES_LANES);

/// What the series of one call may take [bytes].
const MOST_BYTES: usize = 32 << 20;

/// A device that is asked for the series of touches, by one expansion or several. The first fault ends its work.
pub struct SeriesDevice {
    device: OnDevice,
    fault: OnceLock<String>,
}

impl SeriesDevice {
    /// A device that has not failed.
    pub fn new(device: OnDevice) -> Self {
        SeriesDevice { device, fault: OnceLock::new() }
    }

    /// Why the processor computes instead, if it does: a sentence.
    pub fn fault(&self) -> Option<&str> {
        self.fault.get().map(String::as_str)
    }
}

impl std::fmt::Debug for SeriesDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SeriesDevice").field("fault", &self.fault()).finish_non_exhaustive()
    }
}

/// The series of one body on a device.
pub(super) struct Expanded {
    of: Arc<SeriesDevice>,
    series: Mutex<Box<dyn DeviceSeries>>,
}

impl Expanded {
    /// None if the device does not take the body, or has failed.
    pub fn new(of: &Arc<SeriesDevice>, body: &Body, base: &[f64]) -> Option<Self> {
        if of.fault().is_some() {
            return None;
        }
        let no_kernels =
            |why| format!("the graphics processor has no kernels for these series: {why}");
        let programmed = body.programmed_series(base).map_err(no_kernels);
        let made = programmed.and_then(|body| of.device.0.series(&body));
        let series = made.map_err(|why| of.fault.set(why)).ok()?;
        Some(Expanded { of: of.clone(), series: Mutex::new(series) })
    }

    /// The coefficients of a degree of the internal force, as [`Body::force_series`] gives them; whether the device did it.
    pub fn force(
        &self,
        degree: usize,
        displacement: &[Wide],
        stride: usize,
        force: &mut [Wide],
    ) -> bool {
        let along = Along { directions: Directions::of(degree), degree, displacement, stride };
        along.force(force, &|given, found| {
            if self.of.fault().is_some() {
                return false;
            }
            let mut series = self.series.lock().unwrap_or_else(PoisonError::into_inner);
            let done = series.force(degree, given, found);
            done.map_err(|why| self.of.fault.set(why)).is_ok()
        })
    }
}

/// Series of load positions that are turned into series along directions.
struct Along<'a> {
    directions: &'static Directions,
    degree: usize,
    displacement: &'a [Wide],
    stride: usize,
}

impl Along<'_> {
    /// Some directions at a time, as memory allows.
    fn force(&self, force: &mut [Wide], expand: &dyn Fn(&[f32], &mut [f32]) -> bool) -> bool {
        let run = WIDTH * self.displacement.len() / self.stride;
        let lower = self.degree - 1;
        let at_once =
            (MOST_BYTES / (size_of::<f32>() * run * lower)).clamp(1, self.directions.len());
        force.fill(Wide::default());
        for first in (0..self.directions.len()).step_by(at_once) {
            let some = first..self.directions.len().min(first + at_once);
            let mut given = vec![0.0; run * lower * some.len()];
            let mut found = vec![0.0; run * some.len()];
            dispatch_solver(Given { along: self, some: some.clone(), out: &mut given });
            if !expand(&given, &mut found) {
                return false;
            }
            let directions = self.directions;
            dispatch_solver(Found { directions, some, found: &found, out: force });
        }
        true
    }
}

/// `u_k(d) = sum_(|a|=k) d^a u_a` along some directions.
struct Given<'a> {
    along: &'a Along<'a>,
    some: Range<usize>,
    out: &'a mut [f32],
}

impl Kernel for Given<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Along { directions, degree, displacement, stride } = *self.along;
        let n_dofs = displacement.len() / stride;
        for (dof, u) in displacement.chunks_exact(stride).enumerate() {
            for (place, direction) in self.some.clone().enumerate() {
                for k in 1..degree {
                    let (terms, monomials) = directions.monomials(direction, k);
                    let mut sum = Wide::default();
                    for (&u, &m) in u[terms].iter().zip(monomials) {
                        sum = sum + u * m;
                    }
                    let at = WIDTH * ((place * (degree - 1) + k - 1) * n_dofs + dof);
                    let out = self.out[at..at + WIDTH].iter_mut();
                    out.zip(sum.0).for_each(|(out, u)| *out = u as f32);
                }
            }
        }
    }
}

/// Adds what some directions give to the coefficients.
struct Found<'a> {
    directions: &'static Directions,
    some: Range<usize>,
    found: &'a [f32],
    out: &'a mut [Wide],
}

impl Kernel for Found<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let terms = self.directions.len();
        let run = self.found.len() / self.some.len();
        for (dof, out) in self.out.chunks_exact_mut(terms).enumerate() {
            let value = |place: usize| {
                let values = &self.found[run * place + WIDTH * dof..][..WIDTH];
                Lanes(std::array::from_fn(|lane| f64::from(values[lane])))
            };
            for (a, out) in out.iter_mut().enumerate() {
                let weights = &self.directions.weights(a)[self.some.clone()];
                for (place, &weight) in weights.iter().enumerate() {
                    *out = *out + value(place) * weight;
                }
            }
        }
    }
}
