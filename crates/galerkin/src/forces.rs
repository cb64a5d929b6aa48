//! The forces of every unit in the states of training, from which units and weights are chosen.

use super::origin::Origin;
use super::sampled::OneByOne;
use super::sketch::Sketch;
use super::subspace::Subspace;
use crate::number::norm;
use rayon::prelude::*;

/// Number of sampling units in one task of a thread.
const CHUNK: usize = 64;

/// A state of training.
pub(super) struct TrainingState {
    /// Its coordinates.
    pub q: Vec<f64>,
    /// Weight of its forces beside those of other states.
    pub weight: f64,
    /// `phi . f_int` of the whole body.
    force: Vec<f64>,
}

impl TrainingState {
    /// Squared norm of its coordinates.
    pub fn square(&self) -> f64 {
        self.q.iter().map(|q| q * q).sum()
    }
}

/// The states with these coordinates.
pub(super) fn with_forces(
    origin: &Origin,
    subspace: &Subspace,
    coordinates: Vec<Vec<f64>>,
) -> Vec<TrainingState> {
    coordinates
        .into_par_iter()
        .map(|q| {
            let u = subspace.basis.field(&q);
            let mut force = vec![0.0; u.len()];
            origin.internal_force(&u, &mut force);
            TrainingState { q, weight: 1.0, force: subspace.basis.project(&force) }
        })
        .collect()
}

/// Forces of some units along the modes in some states, each state in units of the force of the whole body over its
/// weight.
pub(super) struct Forces {
    /// Rows: the modes of one state after those of another, or a sketch of them if they are many.
    pub rows: usize,
    /// Unit by unit.
    pub units: Vec<f64>,
    /// Of the whole body.
    pub body: Vec<f64>,
}

impl Forces {
    /// Of some units of a body.
    pub fn new(
        origin: &Origin,
        units: &[usize],
        subspace: &Subspace,
        states: &[TrainingState],
    ) -> Self {
        let scales: Vec<f64> =
            states.iter().map(|s| s.weight / norm(&s.force).max(f64::MIN_POSITIVE)).collect();
        let (r, rows) = (subspace.len(), subspace.len() * states.len());
        let sketch = Sketch::new(rows);
        let of_some = |some: &[usize]| {
            let mut one_by_one = OneByOne::new(origin, some, &subspace.basis.modes);
            let mut columns = vec![0.0; rows * some.len()];
            for (k, (state, scale)) in states.iter().zip(&scales).enumerate() {
                let forces = one_by_one.forces(&state.q);
                for (column, force) in columns.chunks_exact_mut(rows).zip(forces.chunks_exact(r)) {
                    let out = &mut column[k * r..(k + 1) * r];
                    out.iter_mut().zip(force).for_each(|(out, f)| *out = scale * f);
                }
            }
            let mut sketched = vec![0.0; sketch.rows() * some.len()];
            let pairs = columns.chunks_exact(rows).zip(sketched.chunks_exact_mut(sketch.rows()));
            pairs.for_each(|(column, out)| sketch.apply(column, out));
            sketched
        };
        let units = units.par_chunks(CHUNK).map(of_some).collect::<Vec<_>>().concat();
        let forces = states.iter().zip(&scales);
        let forces: Vec<f64> =
            forces.flat_map(|(s, scale)| s.force.iter().map(move |f| scale * f)).collect();
        let mut body = vec![0.0; sketch.rows()];
        sketch.apply(&forces, &mut body);
        Forces { rows: sketch.rows(), units, body }
    }

    /// The norm of each unit's forces.
    pub fn sizes(&self) -> Vec<f64> {
        self.units.chunks_exact(self.rows).map(norm).collect()
    }
}

/// About `count` indices, evenly spaced along the running sum of the sizes, so that larger ones are taken more often.
pub(super) fn systematic(sizes: &[f64], count: usize) -> Vec<usize> {
    let step = sizes.iter().sum::<f64>() / count as f64;
    let (mut sum, mut next, mut taken) = (0.0, 0.5 * step, Vec::with_capacity(count));
    for (place, size) in sizes.iter().enumerate() {
        sum += size;
        if sum > next {
            taken.push(place);
            next = step * ((sum / step - 0.5).floor() + 1.5);
        }
    }
    taken
}
