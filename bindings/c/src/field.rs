//! The whole mesh, and the displacement of all its nodes.

use crate::model::{Model, finite_or_zero};
use crate::status::{self, viscera_status};
use crate::vector;

impl Model {
    /// Displacement of all nodes; zero if there is no answer.
    fn field(
        &self,
        point: [f64; 3],
        displacement: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) -> viscera_status {
        let status = self.shape(point, displacement, out, |contact, d, out| {
            self.reduced.displacement(contact, d, workspace, out);
        });
        for u in out.chunks_exact_mut(3) {
            let moved = self.frame.length_out(std::array::from_fn(|i| f64::from(u[i])));
            (0..3).for_each(|i| u[i] = moved[i] as f32);
        }
        finite_or_zero(status, out)
    }

    fn cells(&self) -> &[u32] {
        &self.reduced.arrays().cells
    }
}

/// Number of cells; 0 for no model.
///
/// # Safety
/// `model` is null or loaded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_cell_count(model: *const Model) -> usize {
    // SAFETY: the caller's contract.
    unsafe { model.as_ref() }.map_or(0, |model| model.cells().len() / 4)
}

/// Nodes before a touch, and the corners of the cells.
///
/// # Safety
/// `model` is null or loaded; `points` and `cells` null or writable for their lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_mesh(
    model: *const Model,
    points: *mut f64,
    points_len: usize,
    cells: *mut u32,
    cells_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(model) = (unsafe { model.as_ref() }) else { return status::NULL_POINTER };
    let rest = &model.reduced.arrays().points;
    let needed = (rest.len(), model.cells().len());
    if (!points.is_null() && points_len < needed.0) || (!cells.is_null() && cells_len < needed.1) {
        return status::SHORT_BUFFER;
    }
    if !points.is_null() {
        // SAFETY: not null, and at least as long as what is taken.
        let out = unsafe { std::slice::from_raw_parts_mut(points, needed.0) };
        for (out, x) in out.chunks_exact_mut(3).zip(rest.chunks_exact(3)) {
            out.copy_from_slice(&model.frame.point_out([x[0], x[1], x[2]]));
        }
    }
    if !cells.is_null() {
        // SAFETY: not null, and at least as long as what is taken.
        let out = unsafe { std::slice::from_raw_parts_mut(cells, needed.1) };
        out.copy_from_slice(model.cells());
        if model.frame.is_reflected() {
            out.chunks_exact_mut(4).for_each(|cell| cell.swap(2, 3));
        }
    }
    status::OK
}

/// Numbers of workspace for [`viscera_field`]; 0 for no model.
///
/// # Safety
/// `model` is null or loaded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_field_workspace_size(model: *const Model) -> usize {
    // SAFETY: the caller's contract.
    unsafe { model.as_ref() }.map_or(0, |model| model.reduced.field_workspace_len())
}

/// Displacement of all nodes.
///
/// # Safety
/// `model` is null or loaded, `point` and `displacement` null or readable; `workspace` and `moved` null or writable
/// for their lengths, and apart from each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_field(
    model: *const Model,
    point: *const f64,
    displacement: *const f64,
    workspace: *mut f32,
    workspace_len: usize,
    moved: *mut f32,
    moved_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let given = unsafe { (model.as_ref(), vector(point), vector(displacement)) };
    let (Some(model), Some(point), Some(d)) = given else {
        return status::NULL_POINTER;
    };
    if workspace.is_null() || moved.is_null() {
        return status::NULL_POINTER;
    }
    let needed = (model.reduced.field_workspace_len(), 3 * model.reduced.n_points());
    if workspace_len < needed.0 || moved_len < needed.1 {
        return status::SHORT_BUFFER;
    }
    // SAFETY: not null, and at least as long as what is taken.
    let (workspace, moved) = unsafe {
        (
            std::slice::from_raw_parts_mut(workspace, needed.0),
            std::slice::from_raw_parts_mut(moved, needed.1),
        )
    };
    model.field(point, d, workspace, moved)
}
