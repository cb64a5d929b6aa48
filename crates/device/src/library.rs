//! A library that computes on a graphics processor, as the core's device.

use crate::law;
use crate::{
    Answer, Cells, Handle, Interface, RestBlock, SERIES_LANES, Series, Slice, Tangent, Task, Text,
};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::{from_ref, null_mut};
use viscera_clock::Instant;
use viscera_law::Program;
use viscera_solid::body::{ProgrammedCells, ProgrammedSeries};
use viscera_solid::equilibrium::{
    self, Device, DeviceEnd, DeviceSeries, DeviceSolution, DeviceSystem, DeviceTangent,
};

/// The library behind an interface.
pub struct Library(pub &'static Interface);

/// A system on the device, and its number of degrees of freedom.
struct System {
    of: &'static Interface,
    handle: Handle,
    n_dofs: usize,
}

// SAFETY: the library takes calls from any thread, one at a time.
unsafe impl Send for System {}
// SAFETY: every method takes it exclusively.
unsafe impl Sync for System {}

/// Makes a call; where it fails, its sentence.
///
/// # Errors
/// That sentence.
pub fn spoken(call: impl FnOnce(&mut Text) -> bool) -> Result<(), String> {
    let mut fault = Text::new();
    if call(&mut fault) { Ok(()) } else { Err(fault.read()) }
}

impl Device for Library {
    fn system(
        &self,
        n: usize,
        pairs: &[(u32, u32)],
        cells: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String> {
        let pairs: Vec<[u32; 2]> = pairs.iter().map(|&(row, column)| [row, column]).collect();
        let (of, mut handle, pairs) = (self.0, null_mut(), Slice::new(&pairs));
        let Some(cells) = cells else {
            // SAFETY: the slice lives until the call returns.
            spoken(|fault| unsafe { (of.new)(n, pairs, &mut handle, fault) })?;
            return Ok(Box::new(System { of, handle, n_dofs: 3 * n }));
        };
        let listed = Listed::new(&cells.program)?;
        let cells = cells_of(cells, &listed);
        // SAFETY: the slices live until the call returns.
        spoken(|fault| unsafe { (of.new_with_cells)(n, pairs, &cells, &mut handle, fault) })?;
        Ok(Box::new(System { of, handle, n_dofs: 3 * n }))
    }

    fn series(&self, body: &ProgrammedSeries<'_>) -> Result<Box<dyn DeviceSeries>, String> {
        let ProgrammedSeries { cells, dilatation, base } = body;
        let listed = Listed::new(&cells.program)?;
        let of_dilatation = dilatation.as_ref().map(Listed::new).transpose()?.unwrap_or_default();
        let series = Series {
            cells: cells_of(cells, &listed),
            dilatation: Slice::new(&of_dilatation.operations),
            dilatation_parameters: Slice::new(&of_dilatation.parameters),
            n_dilatation_parameters: of_dilatation.n_parameters,
            base: Slice::new(base),
        };
        let (of, mut handle) = (self.0, null_mut());
        // SAFETY: the slices live until the call returns.
        spoken(|fault| unsafe { (of.new_series)(&series, &mut handle, fault) })?;
        Ok(Box::new(Expansion { of, handle, n_dofs: base.len() }))
    }
}

/// A program as the interface takes it.
#[derive(Default)]
struct Listed {
    model: u32,
    operations: Vec<law::Operation>,
    parameters: Vec<f64>,
    n_parameters: usize,
}

impl Listed {
    fn new(program: &Program) -> Result<Self, String> {
        Ok(Listed {
            model: law::model(program),
            operations: law::operations(program)?,
            parameters: program.rows.concat(),
            n_parameters: program.rows.first().map_or(0, Vec::len),
        })
    }
}

fn cells_of(cells: &ProgrammedCells<'_>, listed: &Listed) -> Cells {
    let clusters = cells.clusters.as_ref();
    Cells {
        points: Slice::new(cells.points),
        cells: Slice::new(cells.cells),
        model: listed.model,
        operations: Slice::new(&listed.operations),
        parameters: Slice::new(&listed.parameters),
        n_parameters: listed.n_parameters,
        cluster_of: Slice::new(clusters.map_or(&[][..], |c| &c.of)),
        cluster_starts: Slice::new(clusters.map_or(&[][..], |c| &c.starts)),
        cluster_nodes: Slice::new(clusters.map_or(&[][..], |c| &c.nodes)),
    }
}

/// Series on the device, and the number of degrees of freedom of their body.
struct Expansion {
    of: &'static Interface,
    handle: Handle,
    n_dofs: usize,
}

// SAFETY: the library takes calls from any thread, one at a time.
unsafe impl Send for Expansion {}
// SAFETY: every method takes it exclusively.
unsafe impl Sync for Expansion {}

impl DeviceSeries for Expansion {
    fn force(
        &mut self,
        degree: usize,
        displacement: &[f32],
        force: &mut [f32],
    ) -> Result<(), String> {
        let run = self.n_dofs * SERIES_LANES;
        assert_eq!(displacement.len(), (degree - 1) * force.len(), "one force for each series");
        assert!(force.len().is_multiple_of(run), "whole groups of series");
        let (of, displacement, out) = (self.of, Slice::new(displacement), force.as_mut_ptr());
        // SAFETY: the handle is of this library; there is room for a force of each series, see above.
        spoken(|fault| unsafe { (of.expand)(self.handle, degree, displacement, out, fault) })
    }
}

impl Drop for Expansion {
    fn drop(&mut self) {
        // SAFETY: the handle is of this library, and nobody has it any more.
        unsafe { (self.of.free_series)(self.handle) };
    }
}

const _: () = assert!(SERIES_LANES == equilibrium::SERIES_LANES);

/// Whether the caller still wants what is computed; a panic there counts as no.
///
/// # Safety
/// `caller` points to a `&dyn Fn() -> bool`.
unsafe extern "C" fn is_wanted(caller: *const c_void) -> bool {
    // SAFETY: see above.
    let ask = unsafe { *caller.cast::<&dyn Fn() -> bool>() };
    catch_unwind(AssertUnwindSafe(ask)).unwrap_or(false)
}

impl DeviceSystem for System {
    fn hold(&mut self, is_held: &[bool], means: &[Vec<(u32, f64)>]) -> Result<(), String> {
        let (dofs, weights): (Vec<u32>, Vec<f64>) = means.iter().flatten().copied().unzip();
        let mut starts = vec![0];
        starts.extend(means.iter().scan(0, |end, mean| {
            *end += mean.len();
            Some(*end)
        }));
        let (is_held, starts) = (Slice::new(is_held), Slice::new(&starts));
        let (dofs, weights) = (Slice::new(&dofs), Slice::new(&weights));
        // SAFETY: the handle is of this library; the slices live until the call returns.
        spoken(|fault| unsafe {
            (self.of.hold)(self.handle, is_held, starts, dofs, weights, fault)
        })
    }

    fn load(&mut self, values: &[f64], shift: f64) -> Result<(), String> {
        // SAFETY: as in `hold`.
        spoken(|fault| unsafe { (self.of.load)(self.handle, Slice::new(values), shift, fault) })
    }

    fn form(&mut self, tangent: &DeviceTangent<'_>) -> Result<(), String> {
        let block = |&(row, column, values)| RestBlock { row, column, values };
        let rest: Vec<RestBlock> = tangent.rest.unwrap_or_default().iter().map(block).collect();
        let tangent = Tangent {
            u: Slice::new(tangent.u),
            pressures: Slice::new(tangent.pressures),
            slopes: Slice::new(tangent.slopes[0]),
            weighted: Slice::new(tangent.slopes[1]),
            factor: tangent.factor,
            rest: Slice::new(&rest),
            is_rest_new: tangent.rest.is_some(),
            shift: tangent.shift,
        };
        // SAFETY: as in `hold`.
        spoken(|fault| unsafe { (self.of.form)(self.handle, &tangent, fault) })
    }

    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, String> {
        let mut product = vec![0.0; x.len()];
        let out = product.as_mut_ptr();
        // SAFETY: as in `hold`; there is room for as many values as `x` has.
        spoken(|fault| unsafe { (self.of.multiply)(self.handle, Slice::new(x), out, fault) })?;
        Ok(product)
    }

    fn solve(
        &mut self,
        b: &[f64],
        steps: &[&[f64]],
        start: &[f64],
        end: &DeviceEnd<'_>,
    ) -> Result<DeviceSolution, String> {
        let left =
            |deadline: Instant| deadline.saturating_duration_since(Instant::now()).as_secs_f64();
        let steps: Vec<Slice<f64>> = steps.iter().map(|step| Slice::new(step)).collect();
        let task = Task {
            b: Slice::new(b),
            steps: Slice::new(&steps),
            start: Slice::new(start),
            tolerance: end.tolerance,
            max_iterations: end.max_iterations,
            seconds: end.until.deadline.map_or(f64::INFINITY, left),
            is_wanted,
            caller: from_ref(&end.until.is_wanted).cast(),
        };
        let mut x = vec![0.0; self.n_dofs];
        let mut answer = Answer {
            x: x.as_mut_ptr(),
            iterations: 0,
            residual: 0.0,
            magnitude: 0.0,
            is_indefinite: false,
        };
        // SAFETY: as in `hold`; the answer has room for as many values as there are degrees of freedom.
        spoken(|fault| unsafe { (self.of.solve)(self.handle, &task, &mut answer, fault) })?;
        let Answer { iterations, residual, magnitude, is_indefinite, .. } = answer;
        Ok(DeviceSolution { x, iterations, residual, magnitude, is_indefinite })
    }

    fn direction(&mut self) -> Result<Vec<f64>, String> {
        let mut direction = vec![0.0; self.n_dofs];
        let out = direction.as_mut_ptr();
        // SAFETY: as in `hold`; there is room for as many values as there are degrees of freedom.
        spoken(|fault| unsafe { (self.of.direction)(self.handle, out, fault) })?;
        Ok(direction)
    }
}

impl Drop for System {
    fn drop(&mut self) {
        // SAFETY: the handle is of this library, and nobody has it any more.
        unsafe { (self.of.free)(self.handle) };
    }
}
