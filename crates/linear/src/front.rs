//! The dense arithmetic of one front, whose first columns are eliminated. Columns are worked on in strips of eight or
//! four: the sums of a tile of a strip stay in registers while the columns before it pass by.

use super::Precision;
use super::strip::{Known, Strip};

/// Most columns that are eliminated one after the other, without tiles.
const NARROW: usize = 4;

/// Most columns of a strip: as many as the sums of a tile have registers for.
const fn widest(bits: usize) -> usize {
    if bits >= 512 { 8 } else { 4 }
}

/// Replaces the first columns `A` of a symmetric matrix, `height` rows each, by those of `L`, `L Lᵀ = A`, for vectors of
/// `BITS` bits. Nothing above the diagonal is read; what is left there means nothing.
///
/// # Errors
/// The first column whose pivot is not positive.
#[inline(always)]
pub(super) fn eliminate<const BITS: usize, T: Precision>(
    columns: &mut [T],
    height: usize,
) -> Result<(), usize> {
    let pivots = columns.len() / height;
    for first in (0..pivots).step_by(widest(BITS)) {
        let (known, rest) = columns.split_at_mut(first * height);
        let strip = &mut rest[..widest(BITS).min(pivots - first) * height];
        subtract::<BITS, T>(&Known { columns: known, height, row: first }, strip, height, false);
        let (narrow, others) = strip.split_at_mut(strip.len().min(NARROW * height));
        eliminate_narrow::<BITS, T>(narrow, height, first).map_err(|column| first + column)?;
        let first = first + NARROW;
        if !others.is_empty() {
            let known = Known { columns: narrow, height, row: first };
            subtract::<BITS, T>(&known, others, height, false);
            eliminate_narrow::<BITS, T>(others, height, first).map_err(|column| first + column)?;
        }
    }
    Ok(())
}

/// The first of these columns have their diagonal in row `first`, and nothing left to subtract but each other.
#[inline(always)]
fn eliminate_narrow<const BITS: usize, T: Precision>(
    strip: &mut [T],
    height: usize,
    first: usize,
) -> Result<(), usize> {
    for column in 0..strip.len() / height {
        let diagonal = first + column;
        let (known, rest) = strip.split_at_mut(column * height);
        let own = &mut rest[diagonal..height];
        for known in known.chunks_exact(height) {
            let known = &known[diagonal..];
            let share = -known[0];
            own.iter_mut().zip(known).for_each(|(x, l)| *x = l.times_plus::<BITS>(share, *x));
        }
        if !(own[0] > T::default()) {
            return Err(column);
        }
        let pivot = own[0].root();
        let inverse = T::round(1.0) / pivot;
        own.iter_mut().for_each(|x| *x *= inverse);
        own[0] = pivot;
    }
    Ok(())
}

/// The lower triangle of `-L Lᵀ` in the rows below the pivots.
#[inline(always)]
pub(super) fn leave<const BITS: usize, T: Precision>(columns: &[T], height: usize, left: &mut [T]) {
    let pivots = columns.len() / height;
    let below = height - pivots;
    for first in (0..below).step_by(widest(BITS)) {
        let strip = &mut left[first * below..(first + widest(BITS)).min(below) * below];
        subtract::<BITS, T>(&Known { columns, height, row: pivots + first }, strip, below, true);
    }
}

/// `A_ij - sum_k L_ik L_jk` in the last rows of a strip of columns, from that of the first column's diagonal on, which is
/// where the known columns are seen from. Nothing is in a new strip yet.
#[inline(always)]
fn subtract<const BITS: usize, T: Precision>(
    known: &Known<'_, T>,
    strip: &mut [T],
    stride: usize,
    is_new: bool,
) {
    let Known { columns, height, row } = *known;
    let n = strip.len() / stride;
    let mut first = if columns.is_empty() && !is_new { n } else { 0 };
    while first < n {
        let known = Known { columns, height, row: row + first };
        let start = (first + 1) * stride - (height - known.row);
        let part = Strip { known: &known, columns: &mut strip[start..], stride, is_new };
        first += match n - first {
            8.. if BITS >= 512 => subtract_columns::<BITS, 8, T>(part),
            4.. => subtract_columns::<BITS, 4, T>(part),
            2.. => subtract_columns::<BITS, 2, T>(part),
            _ => subtract_columns::<BITS, 1, T>(part),
        };
    }
}

/// The first `W` columns, which it returns the number of.
#[inline(always)]
fn subtract_columns<const BITS: usize, const W: usize, T: Precision>(
    mut strip: Strip<'_, T>,
) -> usize {
    if BITS > 128 {
        // SAFETY: what is compiled for so many bits runs only on processors that have them.
        unsafe { T::subtract::<BITS, W>(strip) };
        return W;
    }
    let mut row = 0;
    tiles::<BITS, W, 4, T>(&mut strip, &mut row);
    tiles::<BITS, W, 2, T>(&mut strip, &mut row);
    tiles::<BITS, W, 1, T>(&mut strip, &mut row);
    W
}

/// As many tiles of `H` rows as there is room for.
#[inline(always)]
fn tiles<const BITS: usize, const W: usize, const H: usize, T: Precision>(
    strip: &mut Strip<'_, T>,
    row: &mut usize,
) {
    let Strip { known, columns, stride, is_new } = strip;
    while *row + H <= known.height - known.row {
        let sums = products::<BITS, W, H, T>(known, *row);
        for (sums, column) in sums.iter().zip(columns.chunks_mut(*stride)) {
            for (x, sum) in column[*row..*row + H].iter_mut().zip(sums) {
                *x = if *is_new { -*sum } else { *x - *sum };
            }
        }
        *row += H;
    }
}

/// `sum_k L_ik L_jk` for `H` rows `i` and the first `W` rows `j`.
#[inline(always)]
fn products<const BITS: usize, const W: usize, const H: usize, T: Precision>(
    known: &Known<'_, T>,
    row: usize,
) -> [[T; H]; W] {
    let mut sums = [[T::default(); H]; W];
    for column in known.columns.chunks_exact(known.height) {
        let column = &column[known.row..];
        let (left, right) = (&column[row..row + H], &column[..W]);
        for j in 0..W {
            for i in 0..H {
                sums[j][i] = left[i].times_plus::<BITS>(right[j], sums[j][i]);
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a matrix `A = B B' + n I`, and what the product of its factor gives again.
    fn reproduces<const BITS: usize, T: Precision>(pivots: usize, below: usize) -> f64 {
        let height = pivots + below;
        let b = |i: usize, k: usize| ((7 * i + 3 * k) % 11) as f64 / 11.0 - 0.4;
        let a = |i: usize, j: usize| {
            let product: f64 = (0..height).map(|k| b(i, k) * b(j, k)).sum();
            product + if i == j { height as f64 } else { 0.0 }
        };
        let entry = |place: usize| T::round(a(place % height, place / height));
        let mut l: Vec<T> = (0..pivots * height).map(entry).collect();
        let mut left = vec![T::round(f64::NAN); below * below];
        eliminate::<BITS, T>(&mut l, height).unwrap();
        leave::<BITS, T>(&l, height, &mut left);
        let l = |i: usize, k: usize| if i < k { 0.0 } else { l[k * height + i].double() };
        let mut worst = 0.0f64;
        for j in 0..height {
            for i in j..height {
                let product: f64 = (0..pivots).map(|k| l(i, k) * l(j, k)).sum();
                let expected = if j < pivots {
                    a(i, j)
                } else {
                    -left[(j - pivots) * below + i - pivots].double()
                };
                worst = worst.max((product - expected).abs());
            }
        }
        worst
    }

    /// Whether this processor has vectors of so many bits.
    fn has(bits: usize) -> bool {
        #[cfg(target_arch = "x86_64")]
        return match bits {
            512 => is_x86_feature_detected!("avx512f"),
            256 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            _ => true,
        };
        #[cfg(not(target_arch = "x86_64"))]
        return bits == 128;
    }

    #[test]
    fn the_factor_reproduces_the_matrix() {
        let few = (1..19).flat_map(|pivots| (0..37).map(move |below| (pivots, below)));
        for (pivots, below) in few.chain([(30, 70), (47, 5), (26, 131)]) {
            let place = format!("{pivots} {below}");
            assert!(reproduces::<128, f64>(pivots, below) < 1e-12, "{place}");
            assert!(reproduces::<128, f32>(pivots, below) < 1e-3, "{place}");
            if has(256) {
                assert!(reproduces::<256, f64>(pivots, below) < 1e-12, "{place}");
                assert!(reproduces::<256, f32>(pivots, below) < 1e-3, "{place}");
            }
            if has(512) {
                assert!(reproduces::<512, f64>(pivots, below) < 1e-12, "{place}");
                assert!(reproduces::<512, f32>(pivots, below) < 1e-3, "{place}");
            }
        }
    }

    #[test]
    fn names_the_pivot_that_is_not_positive() {
        for bad in 0..7 {
            let mut columns: Vec<f64> = (0..70).map(|k| f64::from(u8::from(k % 11 == 0))).collect();
            for value in [0.0, -1.0, f64::NAN] {
                columns[11 * bad] = value;
                assert_eq!(eliminate::<128, f64>(&mut columns.clone(), 10), Err(bad));
                if has(512) {
                    assert_eq!(eliminate::<512, f64>(&mut columns.clone(), 10), Err(bad));
                }
            }
        }
    }
}
