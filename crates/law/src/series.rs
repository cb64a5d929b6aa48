//! The stress of a strain energy as a power series, for the highest degree only.
//!
//! The asymptotic numerical method asks, order after order, for the degree-p coefficients of `P`
//! given the lower ones of `F`. Geometry is done by hand on slices of coefficients, generic
//! arithmetic on the three scalar series only; nothing is kept between orders,
//! because recomputing the lower degrees in cache is cheaper than fetching them from memory.
//! A law gives its slopes alone, so all of this is compiled once, not once for each law, and may know wide vectors. No
//! product is fused with a sum: vectors of every width give the same numbers.

use super::{StrainEnergy, TaylorCache};
use std::ops::Range;
use viscera_number::simd::{WideKernel, dispatch_wide};
use viscera_number::unroll::array;
use viscera_number::{Jet, Monomials, PooledVec, Real, Scalar};

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
pub(super) struct Slopes<'a, T: Real> {
    pub uses: Uses,
    pub slopes: &'a dyn Fn([Jet<T>; 3]) -> [Jet<T>; 3],
    /// `U'` as a series of the volume ratio, and the part of it that a shared pressure replaces.
    pub pressure: &'a dyn Fn(Jet<T>) -> Jet<T>,
    pub part: f64,
    /// Of functions of the volume ratio alone, and of all invariants.
    pub cache: &'a mut TaylorCache<T>,
}

/// Adds `sum_k a_k b_k` for the monomials `c` of a range to `out`, which is indexed from its start.
#[inline(always)]
fn products<T: Real, const K: usize>(
    table: &Monomials,
    monomials: Range<usize>,
    terms: [[&[T]; 2]; K],
    out: &mut [T],
) {
    let n = table.len();
    assert!(terms.iter().flatten().all(|series| series.len() == n));
    for (out, c) in out.iter_mut().zip(monomials) {
        let mut sums = [T::default(); K];
        for &[i, j, _] in table.pairs_of(c) {
            for (sum, [a, b]) in sums.iter_mut().zip(&terms) {
                // SAFETY: a table's indices are below its length, asserted above.
                let (a, b) =
                    unsafe { (*a.get_unchecked(i as usize), *b.get_unchecked(j as usize)) };
                sum.add_product(a, b);
            }
        }
        sums.into_iter().for_each(|sum| *out = *out + sum);
    }
}

/// Adds `sign (a_r b_s - a_s b_r)`, entry `j` with `r` and `s` that follow it: what row `p` of `A` and row `q` of `B` give
/// to a row of `A x B`. Three entries at once load each series once, not four times.
#[inline(always)]
fn cross_row<'t, T: Real>(
    table: &'t Monomials,
    (monomials, pairs): (Range<usize>, impl Fn(usize) -> &'t [[u16; 3]]),
    (sign, a, b): (f64, [&[T]; 3], [&[T]; 3]),
    out: [&mut [T]; 3],
) {
    let n = table.len();
    assert!(a.iter().chain(&b).all(|series| series.len() == n));
    for (slot, c) in monomials.enumerate() {
        let mut sums = [T::default(); 3];
        for &[i, j, _] in pairs(c) {
            // SAFETY: as in `products`.
            let (a, b) = unsafe {
                (
                    array!(3, |k| *a[k].get_unchecked(i as usize)),
                    array!(3, |k| *b[k].get_unchecked(j as usize)),
                )
            };
            array!(3, |k| {
                let (r, s) = next(k);
                sums[k] = sums[k] + (a[r] * b[s] - a[s] * b[r]);
            });
        }
        array!(3, |k| {
            let out = &mut out[k][slot];
            *out = if sign > 0.0 { *out + sums[k] } else { *out - sums[k] };
        });
    }
}

/// Adds `series` times each of three series; a series of one coefficient is a constant, one of none is zero.
#[inline(always)]
fn scaled_row<T: Real>(
    table: &Monomials,
    monomials: Range<usize>,
    (series, row): (&[T], [&[T]; 3]),
    out: [&mut [T]; 3],
) {
    let n = table.len();
    assert!(row.iter().all(|series| series.len() == n));
    if let [factor] = series {
        for (out, row) in out.into_iter().zip(row) {
            let row = &row[monomials.clone()];
            out.iter_mut().zip(row).for_each(|(out, &b)| out.add_product(*factor, b));
        }
        return;
    }
    if series.is_empty() {
        return;
    }
    assert!(series.len() == n);
    for (slot, c) in monomials.enumerate() {
        let mut sums = [T::default(); 3];
        for &[i, j, _] in table.pairs_of(c) {
            // SAFETY: as in `products`.
            let (a, b) = unsafe {
                (
                    *series.get_unchecked(i as usize),
                    array!(3, |k| *row[k].get_unchecked(j as usize)),
                )
            };
            array!(3, |k| sums[k].add_product(a, b[k]));
        }
        array!(3, |k| out[k][slot] = out[k][slot] + sums[k]);
    }
}

/// The three runs of a row of a tensor.
#[inline(always)]
fn row<T>(tensor: &[T], i: usize, n: usize) -> [&[T]; 3] {
    array!(3, |j| &tensor[(3 * i + j) * n..(3 * i + j + 1) * n])
}

/// Those of a row alone.
#[inline(always)]
fn runs<T>(row: &mut [T], n: usize) -> [&mut [T]; 3] {
    let (first, others) = row.split_at_mut(n);
    let (second, third) = others.split_at_mut(n);
    [first, second, third]
}

/// Degree-p coefficients of `P = 2 psi_1 F + (2 psi_2 Z) x F + psi_J Z + (q - s U') dJ/dF`, p the order of `table`.
///
/// `deformation` holds the nine series of `F`, row by row, `table.len()` coefficients each, those of degree p zero;
/// `q` is one series or nothing,
/// `out` receives nine runs of the degree-p coefficients.
#[inline(never)]
pub(super) fn stress_series<T: Real>(
    slopes: Slopes<'_, T>,
    table: &'static Monomials,
    [deformation, q]: [&[T]; 2],
    out: &mut [T],
) {
    dispatch_wide(Stress { slopes, table, deformation, q, out });
}

struct Stress<'a, T: Real> {
    slopes: Slopes<'a, T>,
    table: &'static Monomials,
    deformation: &'a [T],
    q: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> WideKernel for Stress<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        add_stress(self);
    }
}

#[inline(always)]
#[allow(non_snake_case)]
fn add_stress<T: Real>(Stress { slopes, table, deformation, q, out }: Stress<'_, T>) {
    let uses = slopes.uses;
    let (n, top) = (table.len(), table.of_degree(table.order()));
    let F = |i: usize| row(deformation, i, n);
    let mut cofactors = PooledVec::zeros(9 * n);
    for (i, z) in cofactors.chunks_exact_mut(3 * n).enumerate() {
        cofactor_row(table, deformation, i, z);
    }
    let Z = |i: usize| row(&cofactors, i, n);

    let mut J = PooledVec::zeros(n);
    products(table, 0..n, array!(3, |j| [F(0)[j], Z(0)[j]]), &mut J);
    let has_i1 = uses.slopes_of_i1 || (uses.volume_is_trace && slopes.part != 0.0);
    let mut I1 = PooledVec::zeros(if has_i1 { n } else { 0 });
    if has_i1 {
        (0..3).for_each(|i| products(table, 0..n, F(i).map(|f| [f, f]), &mut I1));
    }
    let mut I2 = PooledVec::zeros(if uses.i2 { n } else { 0 });
    if uses.i2 {
        (0..3).for_each(|i| products(table, 0..n, Z(i).map(|z| [z, z]), &mut I2));
    }
    let invariants = [I1, I2, J].map(|series| Jet::new(table, series));
    let [mut two_psi1, two_psi2, mut psiJ] = slopes.at(invariants).map(|slope| up_to(slope, n));
    two_psi1.iter_mut().for_each(|slope| *slope = *slope * 2.0);
    let volumetric = if uses.volume_is_trace { &mut two_psi1 } else { &mut psiJ };
    if !q.is_empty() {
        volumetric.resize(n);
        volumetric.iter_mut().zip(q).for_each(|(slope, &q)| *slope = *slope + q);
    }

    let m = top.len();
    for (i, p) in out.chunks_exact_mut(3 * m).enumerate() {
        scaled_row(table, top.clone(), (&two_psi1, F(i)), runs(p, m));
        scaled_row(table, top.clone(), (&psiJ, Z(i)), runs(p, m));
    }
    if uses.i2 {
        let mut weighted = PooledVec::zeros(9 * n);
        for (i, w) in weighted.chunks_exact_mut(3 * n).enumerate() {
            scaled_row(table, 0..n, (&two_psi2, Z(i)), runs(w, n));
            w.iter_mut().for_each(|w| *w = *w * 2.0);
        }
        let W = |i: usize| row(&weighted, i, n);
        for (i, out) in out.chunks_exact_mut(3 * m).enumerate() {
            let (p, q) = next(i);
            let pairs = |c| table.pairs_of(c);
            cross_row(table, (top.clone(), pairs), (1.0, W(p), F(q)), runs(out, m));
            cross_row(table, (top.clone(), pairs), (-1.0, W(q), F(p)), runs(out, m));
        }
    }
}

#[allow(non_snake_case)]
impl<T: Real> Slopes<'_, T> {
    /// The slopes at the invariants, without the part of the pressure that is shared, by composition.
    #[inline(always)]
    fn at(self, [I1, I2, J]: [Jet<T>; 3]) -> [Jet<T>; 3] {
        let Slopes { uses, slopes, pressure, part, cache } = self;
        if uses.slopes_of_i1 || uses.i2 || uses.volume_is_trace {
            return cache.of_three([I1, I2, J], |[I1, I2, J]| {
                let ratio = if uses.volume_is_trace { (I1.clone() - 1.0) * 0.5 } else { J.clone() };
                let [mut psi1, psi2, mut psiJ] = slopes([I1, I2, J]);
                if part != 0.0 {
                    let own = ratio.substituted_in(&pressure(ratio.variable())) * part;
                    if uses.volume_is_trace { psi1 = psi1 - own * 0.5 } else { psiJ = psiJ - own }
                }
                [psi1, psi2, psiJ]
            });
        }
        let taylor = cache.of(&J, |J| {
            let none = J.constant(0.0);
            let [psi1, psi2, psiJ] = slopes([none.clone(), none, J.clone()]);
            vec![psi1, psi2, if part == 0.0 { psiJ } else { psiJ - pressure(J) * part }]
        });
        let table = J.table();
        // A constant: if it varied with J, psi_J would vary with I1.
        let psi1 = Jet::new(table, &[taylor[0].coefficient(0)][..]);
        [psi1, Jet::new(table, PooledVec::default()), J.substituted_in(&taylor[2])]
    }
}

/// All coefficients of the volume ratio: `det F`, for which a row of the cofactor suffices, or `(I1 - 1) / 2`.
#[inline(never)]
pub(super) fn volume_series<T: Real>(
    uses: Uses,
    table: &'static Monomials,
    deformation: &[T],
    out: &mut [T],
) {
    dispatch_wide(VolumeRatio { uses, table, deformation, out });
}

struct VolumeRatio<'a, T> {
    uses: Uses,
    table: &'static Monomials,
    deformation: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> WideKernel for VolumeRatio<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        add_volume_ratio(self);
    }
}

#[inline(always)]
fn add_volume_ratio<T: Real>(VolumeRatio { uses, table, deformation, out }: VolumeRatio<'_, T>) {
    let n = table.len();
    if uses.volume_is_trace {
        for f in deformation.chunks_exact(n) {
            products(table, 0..n, [[f, f]], out);
        }
        out[0] = out[0] - 1.0;
        out.iter_mut().for_each(|value| *value = *value * 0.5);
        return;
    }
    let mut z = PooledVec::zeros(3 * n);
    cofactor_row(table, deformation, 0, &mut z);
    let (f, z) = (row(deformation, 0, n), row(&z, 0, n));
    products(table, 0..n, array!(3, |j| [f[j], z[j]]), out);
}

/// Adds the series of a row of `Z = cof F`; the highest degree of `F` is zero, as it is what is sought.
#[inline(always)]
fn cofactor_row<T: Real>(table: &Monomials, deformation: &[T], i: usize, z: &mut [T]) {
    let (n, (p, q)) = (table.len(), next(i));
    let rows = (1.0, row(deformation, p, n), row(deformation, q, n));
    cross_row(table, (0..n, |c| table.pairs_below_top(c)), rows, runs(z, n));
}

/// The two indices that follow `i` cyclically.
#[inline(always)]
fn next(i: usize) -> (usize, usize) {
    ((i + 1) % 3, (i + 2) % 3)
}

/// The coefficients: none, the constant, or all `n` of them.
#[inline(always)]
fn up_to<T: Real>(series: Jet<T>, n: usize) -> PooledVec<T> {
    let mut coefficients = PooledVec::from(series.coefficients());
    if coefficients.len() > 1 {
        coefficients.resize(n);
    }
    coefficients
}
