//! The space of a grasp: the series fields of every contact, the coupling fields of every pair, and the superposed
//! series as a first guess.

use super::basis::Basis;
use super::coupling::coupling_fields;
use super::origin::Origin;
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::{degree_of, dot, evaluate_monomials};
use crate::reduced::{Contact, ReducedModel};
use faer::Mat;
use faer::linalg::solvers::{PartialPivLu, Solve};

/// Contacts whose means depend on each other to within this part have no independent forces.
const DEPENDENT: f64 = 1e-3;

/// Where a raw field comes from.
#[derive(Clone, Copy)]
enum Source {
    /// A monomial of the displacement of a contact.
    Series { contact: usize, exponents: [u8; 3] },
    /// A product of displacements of two contacts: contact and component of each.
    Coupling([[usize; 2]; 2]),
}

impl Source {
    /// The displacement, of all contacts one after the other, that a first-order field belongs to.
    fn first_order(&self) -> Option<usize> {
        match self {
            Source::Series { contact, exponents } if degree_of(exponents) == 1 => {
                exponents.iter().position(|&e| e == 1).map(|i| 3 * contact + i)
            }
            _ => None,
        }
    }
}

/// The span of the fields of some contacts.
#[derive(Clone)]
pub(super) struct Subspace {
    pub basis: Basis,
    /// Mean displacement of the patches under each mode: three rows for each contact.
    pub constraints: Vec<Vec<f64>>,
    sources: Vec<Source>,
    /// Inverse of the means of the first-order fields.
    unmixed: Mat<f64>,
}

impl Subspace {
    /// Fields up to `order` at some contacts, and all their couplings.
    ///
    /// # Errors
    /// Contacts so close that the displacement of one follows from the others.
    pub fn new(
        model: &ReducedModel,
        origin: &Origin,
        contacts: &[Contact],
        order: usize,
    ) -> Result<Self, Error> {
        let (mut fields, mut sources) = (Vec::new(), Vec::new());
        let scale = model.metadata().depth;
        let exponents = model.exponents_up_to(order);
        let mut first: Vec<Vec<Vec<f64>>> = Vec::new();
        for (contact, place) in contacts.iter().enumerate() {
            let mut series = model.series_fields(place, order);
            for (field, &exponents) in series.iter_mut().zip(exponents) {
                let unit = scale.powi(degree_of(&exponents) as i32);
                field.iter_mut().for_each(|u| *u *= unit);
                sources.push(Source::Series { contact, exponents });
            }
            first.push(series[..3].to_vec());
            fields.extend(series);
        }
        for b in 1..contacts.len() {
            for a in 0..b {
                fields.extend(coupling_fields(origin, &first[a], &first[b])?);
                let pairs = (0..9).map(|k| Source::Coupling([[a, k / 3], [b, k % 3]]));
                sources.extend(pairs);
            }
        }
        let basis = Basis::new(&fields, &origin.stiffness);
        let patches: Vec<Patch> = contacts.iter().map(|c| model.patch(c)).collect();
        let constraints = constraints(&patches, &basis);
        let unmixed = unmixed(&constraints, &basis, &sources)?;
        Ok(Subspace { basis, constraints, sources, unmixed })
    }

    /// Adds the parts of these fields outside the span, except parts below `smallest` of the largest field.
    pub fn enrich(
        &mut self,
        fields: &[Vec<f64>],
        smallest: f64,
        patches: &[Patch],
        origin: &Origin,
    ) {
        self.basis.enrich(fields, smallest, &origin.stiffness);
        self.constraints = constraints(patches, &self.basis);
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.basis.len()
    }

    /// Sum of the series of all contacts with their couplings, moved so that the means of the patches come out as `d`
    /// to second order.
    pub fn superposed(&self, d: &[f64]) -> Vec<f64> {
        let mut q = vec![0.0; self.len()];
        self.guess(d, &mut vec![0.0; d.len()])(1.0, &mut q);
        q
    }

    /// The superposed series under shares of `d`, in place, to start a search from; `means` is room for as many numbers.
    pub fn guess(&self, d: &[f64], means: &mut [f64]) -> impl FnMut(f64, &mut [f64]) {
        move |share, q| {
            means.iter_mut().zip(d).for_each(|(mean, d)| *mean = share * d);
            self.sum_of_series(means, q);
            for (mean, row) in means.iter_mut().zip(&self.constraints) {
                *mean += *mean - dot(row, q);
            }
            self.sum_of_series(means, q);
        }
    }

    /// The sum of the series of all contacts, each displaced on its own so that all first-order means come out as `d`.
    fn sum_of_series(&self, d: &[f64], q: &mut [f64]) {
        q.fill(0.0);
        // In units of the model's depth.
        let part = |contact: usize, i: usize| -> f64 {
            d.iter().enumerate().map(|(j, d)| self.unmixed[(3 * contact + i, j)] * d).sum()
        };
        for (field, source) in self.sources.iter().enumerate() {
            let amplitude = match *source {
                Source::Series { contact, exponents } => {
                    let mut value = [0.0];
                    let d = std::array::from_fn(|i| part(contact, i));
                    evaluate_monomials(&[exponents], d, &mut value);
                    value[0]
                }
                Source::Coupling([[a, i], [b, j]]) => part(a, i) * part(b, j),
            };
            self.basis.add(field, amplitude, q);
        }
    }
}

fn constraints(patches: &[Patch], basis: &Basis) -> Vec<Vec<f64>> {
    patches.iter().flat_map(|patch| basis.means(patch)).collect()
}

/// Inverse of the means under the first-order field of each contact, in units of their displacement.
fn unmixed(constraints: &[Vec<f64>], basis: &Basis, sources: &[Source]) -> Result<Mat<f64>, Error> {
    let is_first = |&f: &usize| sources[f].first_order().is_some();
    let first: Vec<usize> = (0..sources.len()).filter(is_first).collect();
    let n = constraints.len();
    let mixed = Mat::from_fn(n, n, |i, j| {
        let row = &basis.coordinates[first[j]];
        row.iter().zip(&constraints[i]).map(|(x, a)| x * a).sum::<f64>()
    });
    let size = mixed.norm_max();
    let inverse = PartialPivLu::new(mixed.as_ref()).solve(Mat::<f64>::identity(n, n));
    // Written so that what is not a number counts as dependent.
    let is_own = |x: f64| x.abs() * size * DEPENDENT < 1.0;
    if !(0..n).all(|i| (0..n).all(|j| is_own(inverse[(i, j)]))) {
        return Err(Error::input(
            "the contacts are so close that the displacement of one follows from the others; \
             move them apart, or leave one out",
        ));
    }
    Ok(inverse)
}
