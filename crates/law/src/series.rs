//! The stress of a strain energy as a power series, for the highest degree only.
//!
//! The asymptotic numerical method asks, order after order, for the degree-p coefficients of `P`
//! given the lower ones of `F`. Geometry is done by hand on slices of coefficients, generic
//! arithmetic on the three scalar series only; nothing is kept between orders,
//! because recomputing the lower degrees in cache is cheaper than fetching them from memory.
//! A law gives its slopes alone, so all of this is compiled once, not once for each law.

use super::StrainEnergy;
use std::ops::Range;
use viscera_number::simd::{Kernel, dispatch_solver};
use viscera_number::{Jet, Monomials, PooledVec, Real};

/// The inputs of the stress of a strain energy.
#[derive(Clone, Copy)]
pub(super) struct Uses {
    slopes_of_i1: bool,
    i2: bool,
    volume_is_trace: bool,
}

impl Uses {
    pub fn of<E: StrainEnergy>() -> Self {
        Uses {
            slopes_of_i1: E::DERIVATIVES_USE_I1,
            i2: E::USES_I2,
            volume_is_trace: E::VOLUME_IS_TRACE,
        }
    }
}

/// `psi_1`, `psi_2` and `psi_J` as series of `I1`, `I2` and `J`; a series that is not used is zero.
pub(super) type Slopes<'a, T> = &'a dyn Fn([Jet<T>; 3]) -> [Jet<T>; 3];

/// `out[c] (+)= sum_k sign_k sum over pairs a_k[i] b_k[j]` for the monomials `c` of a range.
///
/// `out` is indexed from the start of the range.
#[inline(always)]
fn products<T: Real, const K: usize>(
    table: &Monomials,
    monomials: Range<usize>,
    terms: [(f64, &[T], &[T]); K],
    out: &mut [T],
) {
    let n = table.len();
    assert!(terms.iter().all(|(_, a, b)| a.len() == n && b.len() == n));
    for (slot, c) in monomials.enumerate() {
        let mut sums = [T::default(); K];
        for &[i, j, _] in table.pairs_of(c) {
            for k in 0..K {
                // SAFETY: a table's indices are below its length, asserted above.
                let (a, b) = unsafe {
                    (*terms[k].1.get_unchecked(i as usize), *terms[k].2.get_unchecked(j as usize))
                };
                sums[k].add_product(a, b);
            }
        }
        for k in 0..K {
            out[slot] = if terms[k].0 > 0.0 { out[slot] + sums[k] } else { out[slot] - sums[k] };
        }
    }
}

/// Degree-p coefficients of `P = 2 psi_1 F + (2 psi_2 Z) x F + psi_J Z + q dJ/dF`, p the order of `table`.
///
/// `deformation` holds the nine series of `F`, row by row, `table.len()` coefficients each;
/// `q` is one series or nothing,
/// `out` receives nine runs of the degree-p coefficients.
pub(super) fn stress_series<T: Real>(
    uses: Uses,
    slopes: Slopes<'_, T>,
    table: &'static Monomials,
    [deformation, q]: [&[T]; 2],
    out: &mut [T],
) {
    dispatch_solver(Stress { uses, slopes, table, deformation, q, out });
}

struct Stress<'a, T: Real> {
    uses: Uses,
    slopes: Slopes<'a, T>,
    table: &'static Monomials,
    deformation: &'a [T],
    q: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> Kernel for Stress<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        add_stress(self);
    }
}

#[inline(always)]
#[allow(non_snake_case)]
fn add_stress<T: Real>(Stress { uses, slopes, table, deformation, q, out }: Stress<'_, T>) {
    let (n, top) = (table.len(), table.of_degree(table.order()));
    let F = |i: usize, j: usize| &deformation[(3 * i + j) * n..(3 * i + j + 1) * n];
    let mut cofactors = PooledVec::zeros(9 * n);
    for (entry, z) in cofactors.chunks_exact_mut(n).enumerate() {
        cofactor(table, deformation, entry, z);
    }
    let Z = |i: usize, j: usize| &cofactors[(3 * i + j) * n..(3 * i + j + 1) * n];

    let mut J = PooledVec::zeros(n);
    products(table, 0..n, std::array::from_fn::<_, 3, _>(|j| (1.0, F(0, j), Z(0, j))), &mut J);
    let mut I1 = PooledVec::zeros(if uses.slopes_of_i1 { n } else { 0 });
    if uses.slopes_of_i1 {
        for i in 0..3 {
            products(
                table,
                0..n,
                std::array::from_fn::<_, 3, _>(|j| (1.0, F(i, j), F(i, j))),
                &mut I1,
            );
        }
    }
    let mut I2 = PooledVec::zeros(if uses.i2 { n } else { 0 });
    if uses.i2 {
        for i in 0..3 {
            let squares = std::array::from_fn::<_, 3, _>(|j| (1.0, Z(i, j), Z(i, j)));
            products(table, 0..n, squares, &mut I2);
        }
    }
    let invariants = [I1, I2, J].map(|series| Jet::new(table, series));
    let [psi1, psi2, psiJ] = slopes(invariants);
    let (mut two_psi1, two_psi2) = (padded(&(psi1 * 2.0), n), padded(&(psi2 * 2.0), n));
    let mut psiJ = padded(&psiJ, n);
    let volumetric = if uses.volume_is_trace { &mut two_psi1 } else { &mut psiJ };
    volumetric.iter_mut().zip(q).for_each(|(slope, &q)| *slope = *slope + q);

    for (entry, p) in out.chunks_exact_mut(top.len()).enumerate() {
        let (i, j) = (entry / 3, entry % 3);
        let terms = [(1.0, &two_psi1[..], F(i, j)), (1.0, &psiJ[..], Z(i, j))];
        products(table, top.clone(), terms, p);
    }
    if uses.i2 {
        let mut weighted = PooledVec::zeros(9 * n);
        for (entry, w) in weighted.chunks_exact_mut(n).enumerate() {
            let z = Z(entry / 3, entry % 3);
            products(table, 0..n, [(1.0, &two_psi2[..], z)], w);
        }
        let W = |i: usize, j: usize| &weighted[(3 * i + j) * n..(3 * i + j + 1) * n];
        for (entry, out) in out.chunks_exact_mut(top.len()).enumerate() {
            let (i, j) = (entry / 3, entry % 3);
            let ((p, q), (r, s)) = (next(i), next(j));
            let cross = [
                (1.0, W(p, r), F(q, s)),
                (-1.0, W(p, s), F(q, r)),
                (-1.0, W(q, r), F(p, s)),
                (1.0, W(q, s), F(p, r)),
            ];
            products(table, top.clone(), cross, out);
        }
    }
}

/// All coefficients of the volume ratio: `det F`, for which a row of the cofactor suffices, or `(I1 - 1) / 2`.
pub(super) fn volume_series<T: Real>(
    uses: Uses,
    table: &'static Monomials,
    deformation: &[T],
    out: &mut [T],
) {
    dispatch_solver(VolumeRatio { uses, table, deformation, out });
}

struct VolumeRatio<'a, T> {
    uses: Uses,
    table: &'static Monomials,
    deformation: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> Kernel for VolumeRatio<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        add_volume_ratio(self);
    }
}

#[inline(always)]
fn add_volume_ratio<T: Real>(VolumeRatio { uses, table, deformation, out }: VolumeRatio<'_, T>) {
    let n = table.len();
    if uses.volume_is_trace {
        for f in deformation.chunks_exact(n) {
            products(table, 0..n, [(1.0, f, f)], out);
        }
        out[0] = out[0] - 1.0;
        out.iter_mut().for_each(|value| *value = *value * 0.5);
        return;
    }
    let mut z = PooledVec::zeros(n);
    for j in 0..3 {
        z.fill(T::default());
        cofactor(table, deformation, j, &mut z);
        products(table, 0..n, [(1.0, &deformation[j * n..(j + 1) * n], &z[..])], out);
    }
}

/// Adds the series of an entry of `Z = cof F`, counted row by row.
#[inline(always)]
#[allow(non_snake_case)]
fn cofactor<T: Real>(table: &Monomials, deformation: &[T], entry: usize, z: &mut [T]) {
    let n = table.len();
    let F = |i: usize, j: usize| &deformation[(3 * i + j) * n..(3 * i + j + 1) * n];
    let ((p, q), (r, s)) = (next(entry / 3), next(entry % 3));
    products(table, 0..n, [(1.0, F(p, r), F(q, s)), (-1.0, F(p, s), F(q, r))], z);
}

/// The two indices that follow `i` cyclically.
#[inline(always)]
fn next(i: usize) -> (usize, usize) {
    ((i + 1) % 3, (i + 2) % 3)
}

#[inline(always)]
fn padded<T: Real>(series: &Jet<T>, n: usize) -> PooledVec<T> {
    let mut coefficients = PooledVec::from(series.coefficients());
    coefficients.resize(n);
    coefficients
}
