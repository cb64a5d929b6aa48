//! The dense arithmetic of one front, whose first columns are eliminated. Columns are worked on in strips of eight or
//! four: the sums of a tile of a strip stay in registers while the columns before it pass by. Columns with a negative
//! pivot are few: their products are subtracted with all others, and twice added.

use super::Precision;
use super::signs::Signs;
use super::strip::{Known, Strip};
use crate::threads::for_each_part;
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Most columns that are eliminated one after the other, without tiles.
const NARROW: usize = 4;

/// Most columns of a strip: as many as the sums of a tile have registers for.
const fn widest(bits: usize) -> usize {
    if bits >= 512 { 8 } else { 4 }
}

/// Columns of which those before them take their shares at once, in strips that threads may share.
const BLOCK: usize = 64;

/// Bytes of known columns that stay in the cache while a part passes by, and the fewest such columns.
const CACHED: usize = 1 << 17;
const FEWEST: usize = 16;

/// Multiplications that are worth waking a thread: some hundred microseconds.
const WORTH: usize = 4_000_000;

/// Replaces the first columns `A` of a symmetric matrix, `height` rows each, by those of `L`, `L S Lᵀ = A` with the
/// `signs` S of the pivots, for vectors of `BITS` bits. Nothing above the diagonal is read; what is left there means
/// nothing.
///
/// # Errors
/// The first column whose pivot is refused.
#[inline(always)]
pub(super) fn eliminate<const BITS: usize, T: Precision>(
    columns: &mut [T],
    height: usize,
    signs: &mut Signs<'_, T>,
    is_shared: bool,
) -> Result<(), usize> {
    for first in (0..columns.len() / height).step_by(BLOCK) {
        let (known, rest) = columns.split_at_mut(first * height);
        let n = rest.len().min(BLOCK * height);
        let block = &mut rest[..n];
        let known = Known { columns: known, height, row: first };
        let strips = Strips { known: &known, signs, stride: height, is_new: false, is_shared };
        strips.subtract::<BITS>(block);
        eliminate_block::<BITS, T>(block, height, first, signs)?;
    }
    Ok(())
}

/// The first of these columns has its diagonal in row `start`, and nothing left to subtract but each other.
#[inline(always)]
fn eliminate_block<const BITS: usize, T: Precision>(
    block: &mut [T],
    height: usize,
    start: usize,
    signs: &mut Signs<'_, T>,
) -> Result<(), usize> {
    let pivots = block.len() / height;
    for nth in (0..pivots).step_by(widest(BITS)) {
        let (known, rest) = block.split_at_mut(nth * height);
        let strip = &mut rest[..widest(BITS).min(pivots - nth) * height];
        let first = start + nth;
        let known = Known { columns: known, height, row: first };
        subtract::<BITS, T>(&known, strip, height, false);
        add_twice(&known, signs.negative_from(start), strip, height);
        let (narrow, others) = strip.split_at_mut(strip.len().min(NARROW * height));
        eliminate_narrow::<BITS, T>(narrow, height, first, signs)?;
        let (before, first) = (first, first + NARROW);
        if !others.is_empty() {
            let known = Known { columns: narrow, height, row: first };
            subtract::<BITS, T>(&known, others, height, false);
            add_twice(&known, signs.negative_from(before), others, height);
            eliminate_narrow::<BITS, T>(others, height, first, signs)?;
        }
    }
    Ok(())
}

/// The first of these columns has its diagonal in row `first`, and nothing left to subtract but each other.
#[inline(always)]
fn eliminate_narrow<const BITS: usize, T: Precision>(
    strip: &mut [T],
    height: usize,
    first: usize,
    signs: &mut Signs<'_, T>,
) -> Result<(), usize> {
    for column in 0..strip.len() / height {
        let diagonal = first + column;
        let (known, rest) = strip.split_at_mut(column * height);
        let own = &mut rest[diagonal..height];
        for (before, known) in known.chunks_exact(height).enumerate() {
            let known = &known[diagonal..];
            let is_negative = signs.is_negative(first + before);
            let share = if is_negative { known[0] } else { -known[0] };
            own.iter_mut().zip(known).for_each(|(x, l)| *x = l.times_plus::<BITS>(share, *x));
        }
        let root = signs.signed_root(diagonal, own[0]).ok_or(diagonal)?;
        let inverse = T::round(1.0) / root;
        own.iter_mut().for_each(|x| *x *= inverse);
        own[0] = if root < T::default() { -root } else { root };
    }
    Ok(())
}

/// The lower triangle of `-L S Lᵀ` in the rows below the pivots, with the `signs` of these columns.
#[inline(always)]
pub(super) fn leave<const BITS: usize, T: Precision>(
    columns: &[T],
    height: usize,
    signs: &Signs<'_, T>,
    left: &mut [T],
    is_shared: bool,
) {
    let row = columns.len() / height;
    let known = Known { columns, height, row };
    let strips = Strips { known: &known, signs, stride: height - row, is_new: true, is_shared };
    strips.subtract::<BITS>(left);
}

/// What known columns of a front take from others, strip by strip.
struct Strips<'a, 'b, T> {
    /// Seen from the diagonal of the first strip on.
    known: &'a Known<'a, T>,
    signs: &'a Signs<'b, T>,
    /// From a column to the next.
    stride: usize,
    /// Whether nothing is in the strips yet.
    is_new: bool,
    is_shared: bool,
}

impl<T: Precision> Strips<'_, '_, T> {
    #[inline(always)]
    fn subtract<const BITS: usize>(&self, columns: &mut [T]) {
        let part = self.part::<BITS>() * self.stride.max(1);
        if self.is_shared && self.known.columns.len() * columns.len() > WORTH * self.stride {
            for_each_part(columns, part, |nth, part| {
                dispatch_wide(OnePart { of: self, nth, part })
            });
        } else {
            columns
                .chunks_mut(part)
                .enumerate()
                .for_each(|(nth, part)| self.one::<BITS>(nth, part));
        }
    }

    /// Columns of a part: those of a strip, which threads share, or as many as they go through the cache with.
    #[inline(always)]
    fn part<const BITS: usize>(&self) -> usize {
        if self.is_shared && !self.is_new { 2 * widest(BITS) } else { BLOCK }
    }

    /// A part, strip by strip, for as many known columns at a time as the cache keeps.
    #[inline(always)]
    fn one<const BITS: usize>(&self, nth: usize, part: &mut [T]) {
        let Known { columns, height, row } = *self.known;
        let first = row + nth * self.part::<BITS>();
        let some = (CACHED / (height * size_of::<T>())).max(FEWEST) * height;
        for (number, columns) in columns.chunks(some).enumerate() {
            let is_new = self.is_new && number == 0;
            for (nth, strip) in part.chunks_mut(widest(BITS) * self.stride).enumerate() {
                let known = Known { columns, height, row: first + nth * widest(BITS) };
                subtract::<BITS, T>(&known, strip, self.stride, is_new);
            }
        }
        let known = Known { columns, height, row: first };
        add_twice(&known, self.signs.negative_from(0), part, self.stride);
    }
}

/// One of them, in the hands of a thread.
struct OnePart<'a, 'b, 'c, T> {
    of: &'a Strips<'b, 'c, T>,
    nth: usize,
    part: &'a mut [T],
}

impl<T: Precision> WideKernel for OnePart<'_, '_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        self.of.one::<BITS>(self.nth, self.part);
    }
}

/// Adds `2 L_ik L_jk` of the `negative` ones among the known columns where [`subtract`] has subtracted it once.
#[inline(always)]
fn add_twice<T: Precision>(
    known: &Known<'_, T>,
    negative: impl Iterator<Item = usize>,
    strip: &mut [T],
    stride: usize,
) {
    let Known { columns, height, row } = *known;
    for column in negative {
        let l = &columns[column * height + row..][..height - row];
        for (j, own) in strip.chunks_exact_mut(stride).enumerate() {
            let (own, share) = (&mut own[stride - (height - row - j)..], l[j] + l[j]);
            own.iter_mut().zip(&l[j..]).for_each(|(x, l)| *x += share * *l);
        }
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

    /// Columns of a matrix `A = B B' + n D`, and what the product of its factor gives again. D is 1, and -2 in one of so many
    /// rows, if any.
    fn reproduces<const BITS: usize, T: Precision>(
        pivots: usize,
        below: usize,
        negative: Option<usize>,
    ) -> f64 {
        let height = pivots + below;
        let b = |i: usize, k: usize| ((7 * i + 3 * k) % 11) as f64 / 11.0 - 0.4;
        let is_negative = |i: usize| negative.is_some_and(|every| i % every == every / 2);
        let a = |i: usize, j: usize| {
            let product: f64 = (0..height).map(|k| b(i, k) * b(j, k)).sum();
            let own = if is_negative(i) { -2.0 } else { 1.0 } * height as f64;
            product + if i == j { own } else { 0.0 }
        };
        let entry = |place: usize| T::round(a(place % height, place / height));
        let mut l: Vec<T> = (0..pivots * height).map(entry).collect();
        let mut left = vec![T::round(f64::NAN); below * below];
        let least = vec![T::round(1e-12); 100 + pivots];
        let mut signs = match negative {
            Some(_) => Signs::any(&least),
            None => Signs::positive(),
        };
        signs.begin(100);
        eliminate::<BITS, T>(&mut l, height, &mut signs, false).unwrap();
        leave::<BITS, T>(&l, height, &signs, &mut left, false);
        let l = |i: usize, k: usize| if i < k { 0.0 } else { l[k * height + i].double() };
        let sign = |k: usize| if signs.is_negative(k) { -1.0 } else { 1.0 };
        let mut worst = 0.0f64;
        for j in 0..height {
            for i in j..height {
                let product: f64 = (0..pivots).map(|k| l(i, k) * sign(k) * l(j, k)).sum();
                let expected = if j < pivots {
                    a(i, j)
                } else {
                    -left[(j - pivots) * below + i - pivots].double()
                };
                worst = worst.max((product - expected).abs());
            }
        }
        let expected = (0..pivots).filter(|&k| is_negative(k)).map(|k| 100 + k);
        assert_eq!(signs.negative(), expected.collect::<Vec<_>>());
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
        for (pivots, below) in few.chain([(30, 70), (47, 5), (26, 131), (137, 21)]) {
            for negative in [None, Some(7), Some(2)] {
                let place = format!("{pivots} {below} {negative:?}");
                let [double, single] = [1e-12, 1e-3].map(|least| {
                    // Pivots of both signs grow.
                    if negative.is_some() { 10.0 * least } else { least }
                });
                let of = |[f64, f32]: [f64; 2]| assert!(f64 < double && f32 < single, "{place}");
                of([
                    reproduces::<128, f64>(pivots, below, negative),
                    reproduces::<128, f32>(pivots, below, negative),
                ]);
                if has(256) {
                    of([
                        reproduces::<256, f64>(pivots, below, negative),
                        reproduces::<256, f32>(pivots, below, negative),
                    ]);
                }
                if has(512) {
                    of([
                        reproduces::<512, f64>(pivots, below, negative),
                        reproduces::<512, f32>(pivots, below, negative),
                    ]);
                }
            }
        }
    }

    #[test]
    fn threads_share_strips_and_change_no_bit() {
        let (pivots, height) = (200, 330);
        let entry = |place: usize| {
            let (i, k) = (place % height, place / height);
            ((7 * i + 3 * k) % 11) as f64 / 11.0 + if i == k { height as f64 } else { 0.0 }
        };
        let made = |is_shared: bool| {
            let mut l: Vec<f64> = (0..pivots * height).map(entry).collect();
            let mut left = vec![f64::NAN; (height - pivots).pow(2)];
            dispatch_wide(Whole { l: &mut l, left: &mut left, height, is_shared });
            let lower = |k: usize, rows: usize| k * rows + k.min(rows)..(k + 1) * rows;
            let l = (0..pivots).flat_map(|k| l[lower(k, height)].to_vec());
            l.chain((0..height - pivots).flat_map(|k| left[lower(k, height - pivots)].to_vec()))
                .collect::<Vec<_>>()
        };
        assert!(pivots * height * (height - pivots) > WORTH);
        let alone = made(false);
        for threads in 1..5 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| made(true)), alone);
        }
    }

    struct Whole<'a> {
        l: &'a mut [f64],
        left: &'a mut [f64],
        height: usize,
        is_shared: bool,
    }

    impl WideKernel for Whole<'_> {
        type Output = ();

        #[inline(always)]
        fn run<const BITS: usize>(self) {
            let Whole { l, left, height, is_shared } = self;
            let mut signs = Signs::positive();
            eliminate::<BITS, f64>(l, height, &mut signs, is_shared).unwrap();
            leave::<BITS, f64>(l, height, &signs, left, is_shared);
        }
    }

    #[test]
    fn names_the_pivot_that_is_not_positive() {
        for bad in 0..7 {
            let mut columns: Vec<f64> = (0..70).map(|k| f64::from(u8::from(k % 11 == 0))).collect();
            for value in [0.0, -1.0, f64::NAN] {
                columns[11 * bad] = value;
                let mut signs = Signs::positive();
                let refused = eliminate::<128, f64>(&mut columns.clone(), 10, &mut signs, false);
                assert_eq!(refused, Err(bad));
                if has(512) {
                    let refused =
                        eliminate::<512, f64>(&mut columns.clone(), 10, &mut signs, false);
                    assert_eq!(refused, Err(bad));
                }
            }
        }
    }
}
