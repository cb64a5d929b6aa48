//! The interface between the core's bindings and the library of `gpu/`. The library is loaded when a solver first needs
//! it, so that nothing else compiles or links the drivers of a graphics processor.
//!
//! The library exports one symbol, [`SYMBOL`], a function without arguments that returns an [`Interface`]. Every function
//! there returns whether it succeeded; if not, it leaves a sentence in the [`Text`] that it was given.

pub mod law;
#[cfg(feature = "core")]
pub mod library;

use std::ffi::c_void;

/// Raised with every change of this crate.
pub const VERSION: u32 = 6;

/// The library's one symbol, an [`Entry`].
pub const SYMBOL: &[u8] = b"viscera_gpu\0";

/// The type of the symbol.
pub type Entry = unsafe extern "C" fn() -> &'static Interface;

/// A sentence from the other side, of limited length in UTF-8.
#[repr(C)]
pub struct Text {
    bytes: [u8; 480],
    length: usize,
}

impl Text {
    /// An empty text.
    pub const fn new() -> Self {
        Text { bytes: [0; 480], length: 0 }
    }

    /// Copies a text, cut to the available length.
    pub fn write(&mut self, words: &str) {
        let room = words.len().min(self.bytes.len());
        self.length = (0..=room).rev().find(|&end| words.is_char_boundary(end)).unwrap_or(0);
        self.bytes[..self.length].copy_from_slice(&words.as_bytes()[..self.length]);
    }

    /// The words.
    pub fn read(&self) -> String {
        let length = self.length.min(self.bytes.len());
        String::from_utf8_lossy(&self.bytes[..length]).into_owned()
    }
}

impl Default for Text {
    fn default() -> Self {
        Text::new()
    }
}

/// Description of a device.
#[repr(C)]
#[derive(Default)]
pub struct About {
    /// Its name.
    pub name: Text,
    /// Its driver.
    pub driver: Text,
    /// The interface it is driven through, such as "vulkan".
    pub backend: Text,
    /// Whether it is software on the processor.
    pub is_software: bool,
}

/// A run of values that the other side owns.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Slice<T> {
    first: *const T,
    length: usize,
}

impl<T> Slice<T> {
    /// Of values that outlive the call.
    pub fn new(values: &[T]) -> Self {
        Slice { first: values.as_ptr(), length: values.len() }
    }

    /// The values.
    ///
    /// # Safety
    /// They must still be there.
    pub unsafe fn get<'a>(self) -> &'a [T] {
        // SAFETY: made from a slice, see above.
        unsafe { std::slice::from_raw_parts(self.first, self.length) }
    }
}

/// Linear tetrahedra whose tangent the library forms.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Cells {
    /// Points at rest [m], one for each node.
    pub points: Slice<[f64; 3]>,
    /// Corners of the cells, positively oriented.
    pub cells: Slice<[u32; 4]>,
    /// What a cell answers with, see [`law`].
    pub model: u32,
    /// The energy, the last of these.
    pub operations: Slice<law::Operation>,
    /// Rows of parameters, one after the other: one for all cells, or one for each.
    pub parameters: Slice<f64>,
    /// Length of a row.
    pub n_parameters: usize,
    /// The cluster of each cell, of those that share their volume ratio; empty where none do.
    pub cluster_of: Slice<u32>,
    /// Where the nodes of each cluster start, and the last end.
    pub cluster_starts: Slice<u32>,
    /// Nodes of the clusters, ascending within each.
    pub cluster_nodes: Slice<u32>,
}

/// A body whose force the library expands in series.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Series {
    /// Its cells.
    pub cells: Cells,
    /// `s U` as a function of the volume ratio `J` of a cluster; a function of `I1`, if that ratio is `(I1 - 1) / 2`. Empty
    /// where cells share nothing.
    pub dilatation: Slice<law::Operation>,
    /// Rows of parameters of the dilatation, one after the other: one for all cells, or one for each.
    pub dilatation_parameters: Slice<f64>,
    /// Length of a row.
    pub n_dilatation_parameters: usize,
    /// Displacement of the base state [m].
    pub base: Slice<f64>,
}

/// Series that are expanded side by side.
pub const SERIES_LANES: usize = 8;

/// A block that is added to a tangent.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestBlock {
    /// Row node, at most the column's.
    pub row: u32,
    /// Column node.
    pub column: u32,
    /// Entries, row-major.
    pub values: [f64; 9],
}

/// A tangent to form: `factor K(u) + rest + shift I`.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Tangent {
    /// Displacement [m].
    pub u: Slice<f64>,
    /// Pressure of each cluster.
    pub pressures: Slice<f64>,
    /// By node of the clusters: slope of the cluster's volume ratio, and the same times its modulus, to which the
    /// cluster adds the product.
    pub slopes: Slice<[f64; 3]>,
    /// The slopes times the moduli.
    pub weighted: Slice<[f64; 3]>,
    /// Factor of the law's tangent.
    pub factor: f64,
    /// What is added to it, unless it is what it was.
    pub rest: Slice<RestBlock>,
    /// Whether `rest` replaces what was added before.
    pub is_rest_new: bool,
    /// Multiple of the identity.
    pub shift: f64,
}

/// What went to the device since the library was loaded, and back.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Bytes written to it after its buffers were made.
    pub written: u64,
    /// Bytes read from it.
    pub read: u64,
    /// Kernels dispatched.
    pub dispatches: u64,
}

/// Right-hand side and limits of conjugate gradients.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Task {
    /// Right-hand side, on all degrees of freedom.
    pub b: Slice<f64>,
    /// At most three earlier steps. The solve sets out from their combination that is nearest to the solution in energy;
    /// from zero where means are held.
    pub steps: Slice<Slice<f64>>,
    /// What the solution will be added to; see [`Answer::magnitude`].
    pub start: Slice<f64>,
    /// Residual to reach, relative to the right-hand side.
    pub tolerance: f64,
    /// Iterations after which to stop and return the last iterate.
    pub max_iterations: usize,
    /// Wall time [s] after which to stop likewise; infinity for none.
    pub seconds: f64,
    /// Asked between batches of iterations, with `caller`, whether to go on; if not, the solve stops likewise.
    pub is_wanted: unsafe extern "C" fn(*const c_void) -> bool,
    /// What that takes.
    pub caller: *const c_void,
}

/// The result of conjugate gradients.
#[repr(C)]
pub struct Answer {
    /// Where the solution goes, as long as the right-hand side.
    pub x: *mut f64,
    /// Iterations.
    pub iterations: usize,
    /// Residual in single precision, relative to the right-hand side.
    pub residual: f64,
    /// `| |K| |start + x| |` on what is free.
    pub magnitude: f64,
    /// Whether the last direction has negative curvature, judged in single precision.
    pub is_indefinite: bool,
}

/// A system on the device, opaque outside the library.
pub type Handle = *mut c_void;

/// The functions of the library. A handle is used by one thread at a time.
#[repr(C)]
pub struct Interface {
    /// [`VERSION`] of the library.
    pub version: u32,
    /// Opens the device if necessary, and describes it.
    pub about: unsafe extern "C" fn(&mut About, &mut Text) -> bool,
    /// Shuts the device down as its driver would after a fault. The next system opens it anew.
    pub lose: unsafe extern "C" fn(),
    /// Room for a symmetric matrix of 3x3 blocks: number of nodes, and row and column of each block of the upper triangle.
    pub new: unsafe extern "C" fn(usize, Slice<[u32; 2]>, &mut Handle, &mut Text) -> bool,
    /// The same with cells, for a system that forms their tangent.
    pub new_with_cells:
        unsafe extern "C" fn(usize, Slice<[u32; 2]>, &Cells, &mut Handle, &mut Text) -> bool,
    /// Frees that memory.
    pub free: unsafe extern "C" fn(Handle),
    /// Holds degrees of freedom at zero, and means `sum w u = 0`: where each mean starts and the last ends, degrees of
    /// freedom, weights.
    pub hold: unsafe extern "C" fn(
        Handle,
        Slice<bool>,
        Slice<usize>,
        Slice<u32>,
        Slice<f64>,
        &mut Text,
    ) -> bool,
    /// Takes nine values for each block, row-major, and a shift of the diagonal.
    pub load: unsafe extern "C" fn(Handle, Slice<f64>, f64, &mut Text) -> bool,
    /// Forms the tangent of a system with cells.
    pub form: unsafe extern "C" fn(Handle, &Tangent, &mut Text) -> bool,
    /// The product of the matrix with a vector, zero on what is held, to where there is room for it.
    pub multiply: unsafe extern "C" fn(Handle, Slice<f64>, *mut f64, &mut Text) -> bool,
    /// The last direction of the last solution, to where there is room for it.
    pub direction: unsafe extern "C" fn(Handle, *mut f64, &mut Text) -> bool,
    /// What was moved so far.
    pub traffic: unsafe extern "C" fn(&mut Traffic),
    /// Solves.
    pub solve: unsafe extern "C" fn(Handle, &Task, &mut Answer, &mut Text) -> bool,
    /// Room for the series of a body, behind a handle of its own kind.
    pub new_series: unsafe extern "C" fn(&Series, &mut Handle, &mut Text) -> bool,
    /// Frees that memory.
    pub free_series: unsafe extern "C" fn(Handle),
    /// The coefficients of the highest degree of the force, to where there is room for them: degree; displacements, for each
    /// group of [`SERIES_LANES`] series those of the lower degrees but for that of the base state.
    pub expand: unsafe extern "C" fn(Handle, usize, Slice<f32>, *mut f32, &mut Text) -> bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_kept_as_far_as_there_is_room() {
        let mut text = Text::new();
        assert_eq!(text.read(), "");
        text.write("lost");
        assert_eq!(text.read(), "lost");
        text.write(&"µ".repeat(1000));
        assert_eq!(text.read(), "µ".repeat(240));
        text.write(&format!("a{}", "µ".repeat(1000)));
        assert_eq!(text.read(), format!("a{}", "µ".repeat(239)));
    }
}
