//! The dense arithmetic of one front, whose first columns are eliminated. Columns are worked on four at a time in tiles
//! two vector registers high: the sums of a tile stay in registers while the columns before it pass by.

use super::Precision;

/// Most columns of a tile.
const WIDTH: usize = 4;

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
    for first in (0..pivots).step_by(WIDTH) {
        let (known, rest) = columns.split_at_mut(first * height);
        let strip = &mut rest[..WIDTH.min(pivots - first) * height];
        subtract::<BITS, false, T>(&Known { columns: known, height, row: first }, strip, height);
        eliminate_strip::<BITS, T>(strip, height, first).map_err(|column| first + column)?;
    }
    Ok(())
}

/// The first of these columns have their diagonal in row `first`, and nothing left to subtract but each other.
#[inline(always)]
fn eliminate_strip<const BITS: usize, T: Precision>(
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
    for first in (0..below).step_by(WIDTH) {
        let strip = &mut left[first * below..(first + WIDTH).min(below) * below];
        let row = pivots + first;
        subtract::<BITS, true, T>(&Known { columns, height, row }, strip, below);
    }
}

/// Columns of `L`, seen from a row on.
struct Known<'a, T> {
    columns: &'a [T],
    height: usize,
    row: usize,
}

/// `A_ij - sum_k L_ik L_jk` in the last rows of a strip of columns, from that of the first column's diagonal on, which is
/// where the known columns are seen from. Nothing is in a new strip yet.
#[inline(always)]
fn subtract<const BITS: usize, const IS_NEW: bool, T: Precision>(
    known: &Known<'_, T>,
    strip: &mut [T],
    stride: usize,
) {
    let strip = &mut strip[stride - (known.height - known.row)..];
    match strip.len().div_ceil(stride) {
        1 => subtract_columns::<BITS, IS_NEW, 1, T>(known, strip, stride),
        2 => subtract_columns::<BITS, IS_NEW, 2, T>(known, strip, stride),
        3 => subtract_columns::<BITS, IS_NEW, 3, T>(known, strip, stride),
        _ => subtract_columns::<BITS, IS_NEW, WIDTH, T>(known, strip, stride),
    }
}

#[inline(always)]
fn subtract_columns<const BITS: usize, const IS_NEW: bool, const W: usize, T: Precision>(
    known: &Known<'_, T>,
    strip: &mut [T],
    stride: usize,
) {
    let mut row = 0;
    tiles::<BITS, IS_NEW, W, 32, T>(known, &mut row, strip, stride);
    tiles::<BITS, IS_NEW, W, 16, T>(known, &mut row, strip, stride);
    tiles::<BITS, IS_NEW, W, 8, T>(known, &mut row, strip, stride);
    tiles::<BITS, IS_NEW, W, 4, T>(known, &mut row, strip, stride);
    tiles::<BITS, IS_NEW, W, 2, T>(known, &mut row, strip, stride);
    tiles::<BITS, IS_NEW, W, 1, T>(known, &mut row, strip, stride);
}

/// As many tiles of `H` rows as there is room for, if the registers have room for one.
#[inline(always)]
fn tiles<const BITS: usize, const IS_NEW: bool, const W: usize, const H: usize, T: Precision>(
    known: &Known<'_, T>,
    row: &mut usize,
    strip: &mut [T],
    stride: usize,
) {
    if H * 8 * size_of::<T>() > 2 * BITS && H > 1 {
        return;
    }
    while *row + H <= known.height - known.row {
        let sums = products::<BITS, W, H, T>(known, *row);
        for (sums, column) in sums.iter().zip(strip.chunks_mut(stride)) {
            for (x, sum) in column[*row..*row + H].iter_mut().zip(sums) {
                *x = if IS_NEW { -*sum } else { *x - *sum };
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

    #[test]
    fn the_factor_reproduces_the_matrix() {
        for (pivots, below) in [(1, 0), (1, 1), (3, 40), (4, 7), (6, 0), (9, 33), (30, 70), (47, 5)]
        {
            assert!(reproduces::<128, f64>(pivots, below) < 1e-12, "{pivots} {below}");
            assert!(reproduces::<256, f64>(pivots, below) < 1e-12, "{pivots} {below}");
            assert!(reproduces::<512, f64>(pivots, below) < 1e-12, "{pivots} {below}");
            assert!(reproduces::<512, f32>(pivots, below) < 1e-3, "{pivots} {below}");
        }
    }

    #[test]
    fn names_the_pivot_that_is_not_positive() {
        for bad in 0..7 {
            let mut columns: Vec<f64> = (0..70).map(|k| f64::from(u8::from(k % 11 == 0))).collect();
            for value in [0.0, -1.0, f64::NAN] {
                columns[11 * bad] = value;
                assert_eq!(eliminate::<256, f64>(&mut columns.clone(), 10), Err(bad));
            }
        }
    }
}
