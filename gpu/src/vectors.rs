//! Vectors on their way to the device and back: from the order of nodes and double precision to that of the rows and
//! single precision.

use crate::{Error, System};
use rayon::prelude::*;

/// Nodes that a thread takes over at once.
const PART: usize = 8192;

/// Parts from which threads share a vector: to wake them takes longer than a short one.
const FEWEST: usize = 4;

impl System {
    /// The largest absolute value.
    ///
    /// # Errors
    /// A vector of the wrong length or not finite.
    pub(crate) fn scale_of(&self, values: &[f64]) -> Result<f64, Error> {
        if values.len() != self.n_dofs() {
            return Err(Error::Input(format!(
                "{} values for {} degrees of freedom",
                values.len(),
                self.n_dofs()
            )));
        }
        // Not a number is kept, and is no finite scale.
        let larger = |a: f64, b: f64| if a >= b || a.is_nan() { a } else { b };
        let of_part = |part: &[f64]| part.iter().fold(0.0f64, |size, v| larger(size, v.abs()));
        let size = match self.is_shared() {
            true => values.par_chunks(3 * PART).map(of_part).reduce(|| 0.0, larger),
            false => of_part(values),
        };
        if size.is_finite() {
            return Ok(size);
        }
        let dof = values.iter().position(|v| !v.is_finite()).unwrap_or_default();
        Err(Error::Input(format!("value {} of point {}", values[dof], dof / 3)))
    }

    /// A vector in the order of the rows, divided by its scale.
    pub(crate) fn placed(&self, values: &[f64], size: f64, without_held: bool) -> Vec<f32> {
        let mut placed = vec![0.0f32; values.len()];
        let factor = if size > 0.0 { size.recip() } else { 0.0 };
        let place = |placed: &mut [f32], nodes: &[u32]| {
            for (placed, &node) in placed.as_chunks_mut::<3>().0.iter_mut().zip(nodes) {
                let own = 3 * node as usize..3 * node as usize + 3;
                let held = &self.is_held[own.clone()];
                for ((placed, value), held) in placed.iter_mut().zip(&values[own]).zip(held) {
                    *placed = if without_held && *held { 0.0 } else { (factor * value) as f32 };
                }
            }
        };
        self.share(&mut placed, &self.layout.node_of, place);
        placed
    }

    /// A vector of the device in the order of the nodes, times its scale.
    pub(crate) fn in_order(&self, placed: &[f32], size: f64) -> Vec<f64> {
        let mut values = vec![0.0; placed.len()];
        let order = |values: &mut [f64], rows: &[u32]| {
            for (values, &row) in values.as_chunks_mut::<3>().0.iter_mut().zip(rows) {
                let placed = &placed[3 * row as usize..3 * row as usize + 3];
                values.iter_mut().zip(placed).for_each(|(v, p)| *v = size * f64::from(*p));
            }
        };
        self.share(&mut values, &self.layout.row_of, order);
        values
    }

    /// Fills a vector from the places that its nodes or rows have in another one, on several threads where it is long.
    fn share<T: Send>(
        &self,
        values: &mut [T],
        places: &[u32],
        fill: impl Fn(&mut [T], &[u32]) + Sync,
    ) {
        if self.is_shared() {
            let parts = values.par_chunks_mut(3 * PART).zip(places.par_chunks(PART));
            parts.for_each(|(values, places)| fill(values, places));
        } else {
            fill(values, places);
        }
    }

    fn is_shared(&self) -> bool {
        self.layout.n_rows() >= FEWEST * PART && rayon::current_num_threads() > 1
    }
}
