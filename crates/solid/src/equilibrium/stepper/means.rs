//! The mean motion of patches under Newmark's rule. Hands prescribe the means `W u` of displacements, and the trapezoidal
//! rule would make their velocities swing from frame to frame for ever, and with them the forces of the hands. So `v` and
//! `a` are changed along `M⁻¹ Wᵀ` until `W v` is the mean velocity of the frame: as inertia, that is a change of the
//! hands' forces `Wᵀ F` alone, and the body moves as it did.

use super::mass::MassMatrix;
use crate::equilibrium::system::Row;
use faer::Mat;
use faer::linalg::solvers::Solve;

/// What patches lead.
pub(super) struct Means {
    /// Rows of `W`.
    rows: Vec<Row>,
    /// Columns of `M⁻¹ Wᵀ`.
    modes: Vec<Vec<f64>>,
    /// `(W M⁻¹ Wᵀ)⁻¹`.
    inverse: Mat<f64>,
}

impl Means {
    /// Of these rows of `W`, which have no entries where something `is_held`.
    pub fn new(rows: &[Row], mass: &MassMatrix, is_held: &dyn Fn(usize) -> bool) -> Self {
        let rows: Vec<Row> = rows.iter().filter(|row| !row.is_empty()).cloned().collect();
        let mut force = vec![0.0; mass.n_dofs()];
        let modes: Vec<Vec<f64>> = rows
            .iter()
            .map(|row| {
                row.iter().for_each(|&(dof, w)| force[dof as usize] = w);
                let mode = mass.accelerations(&force, is_held);
                row.iter().for_each(|&(dof, _)| force[dof as usize] = 0.0);
                mode
            })
            .collect();
        let k = rows.len();
        let mobility = Mat::from_fn(k, k, |r, c| mean(&rows[r], |dof| modes[c][dof]));
        let inverse = mobility.partial_piv_lu().solve(Mat::<f64>::identity(k, k));
        Means { rows, modes, inverse }
    }

    /// Changes `x` along the modes until `W x` is `W` times what is `wanted`.
    pub fn lead(&self, x: &mut [f64], wanted: impl Fn(usize) -> f64) {
        let missing: Vec<f64> =
            self.rows.iter().map(|row| mean(row, |dof| wanted(dof) - x[dof])).collect();
        for (r, mode) in self.modes.iter().enumerate() {
            let share: f64 = (0..missing.len()).map(|c| self.inverse[(r, c)] * missing[c]).sum();
            x.iter_mut().zip(mode).for_each(|(x, m)| *x += share * m);
        }
    }
}

fn mean(row: &Row, x: impl Fn(usize) -> f64) -> f64 {
    row.iter().map(|&(dof, w)| w * x(dof as usize)).sum()
}
