//! The fields of a contact's series one by one, from which a Galerkin model makes its basis.

use super::combine::Combine;
use super::contact::Contact;
use super::interpolation::Interpolation;
use super::model::ReducedModel;
use viscera_number::degree_of;
use viscera_number::simd::dispatch;

impl ReducedModel {
    /// Exponents of the monomials of a degree up to `order`, the constant left out.
    pub fn exponents_up_to(&self, order: usize) -> &[[u8; 3]] {
        let count = self.exponents.partition_point(|e| degree_of(e) <= order);
        &self.exponents[..count]
    }

    /// `u_alpha` at a contact for each of [`ReducedModel::exponents_up_to`]: runs of all degrees of freedom, whose
    /// sum times the monomials of `d` is the displacement of the series. Allocates.
    pub fn series_fields(&self, contact: &Contact, order: usize) -> Vec<Vec<f64>> {
        let here = Interpolation::new(self, contact);
        let mut workspace = vec![0.0; self.workspace_len()];
        let terms = 0..self.exponents_up_to(order).len();
        terms.map(|term| self.term_field(&here, term, &mut workspace)).collect()
    }

    fn term_field(&self, here: &Interpolation, term: usize, workspace: &mut [f32]) -> Vec<f64> {
        let slots = here.term_amplitudes(term, workspace);
        let mut field = vec![0.0; 3 * self.n_points()];
        for (nodes, modes) in [
            (&self.arrays.surface_nodes, &self.arrays.surface_modes),
            (&self.interior_nodes, &self.arrays.interior_modes),
        ] {
            let rows = 3 * nodes.len();
            let mut part = vec![0.0; rows];
            let runs = workspace.chunks_exact(self.largest_region);
            for (slot, amplitudes) in slots.iter().zip(runs) {
                let Some(region) = *slot else { continue };
                let range = self.region_modes(region);
                dispatch(Combine {
                    amplitudes: &amplitudes[..range.len()],
                    scales: &self.arrays.mode_scale[range.clone()],
                    modes: &modes[range.start * rows..range.end * rows],
                    negligible: 0.0,
                    out: &mut part,
                });
            }
            for (&node, u) in nodes.iter().zip(part.chunks_exact(3)) {
                (0..3).for_each(|i| field[3 * node as usize + i] = f64::from(u[i]));
            }
        }
        field
    }
}
