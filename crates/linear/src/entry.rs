//! What a row of right-hand sides holds in a substitution: a number, or a few numbers side by side.

use super::Precision;

/// Rows that are worked on together, in vector registers.
const LANES: usize = 8;

/// An entry of a row, beside a factor in precision `T`.
pub trait Entry<T>: Copy + Default + Send {
    /// `self + other`
    fn plus(self, other: Self) -> Self;

    /// `self - other`
    fn minus(self, other: Self) -> Self;

    /// `self - l x`
    fn minus_times(self, l: T, x: Self) -> Self;

    /// `self / l`
    fn over(self, l: T) -> Self;

    /// `y += sum_k a_k x_k`: `y` is read once for all of them.
    fn add_columns<const BITS: usize, const W: usize>(a: [&[T]; W], x: [Self; W], y: &mut [Self]);

    /// `a_k . b` for all columns: `b` is read once for them.
    fn products<const BITS: usize, const W: usize>(a: [&[T]; W], b: &[Self]) -> [Self; W];
}

impl<T: Precision> Entry<T> for T {
    #[inline(always)]
    fn plus(self, other: T) -> T {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: T) -> T {
        self - other
    }

    #[inline(always)]
    fn minus_times(self, l: T, x: T) -> T {
        self - l * x
    }

    #[inline(always)]
    fn over(self, l: T) -> T {
        self / l
    }

    #[inline(always)]
    fn add_columns<const BITS: usize, const W: usize>(a: [&[T]; W], x: [T; W], y: &mut [T]) {
        let a = a.map(|a| a[..y.len()].as_chunks::<LANES>());
        let (whole, rest) = y.as_chunks_mut::<LANES>();
        for (i, y) in whole.iter_mut().enumerate() {
            let mut sums = *y;
            for k in 0..W {
                let a = &a[k].0[i];
                for lane in 0..LANES {
                    sums[lane] = a[lane].times_plus::<BITS>(x[k], sums[lane]);
                }
            }
            *y = sums;
        }
        for (i, y) in rest.iter_mut().enumerate() {
            for k in 0..W {
                *y = a[k].1[i].times_plus::<BITS>(x[k], *y);
            }
        }
    }

    #[inline(always)]
    fn products<const BITS: usize, const W: usize>(a: [&[T]; W], b: &[T]) -> [T; W] {
        let a = a.map(|a| a[..b.len()].as_chunks::<LANES>());
        let (whole, rest) = b.as_chunks::<LANES>();
        let mut sums = [[T::default(); LANES]; W];
        for (i, b) in whole.iter().enumerate() {
            for (sums, (a, _)) in sums.iter_mut().zip(a) {
                let a = &a[i];
                for lane in 0..LANES {
                    sums[lane] = a[lane].times_plus::<BITS>(b[lane], sums[lane]);
                }
            }
        }
        std::array::from_fn(|k| {
            let head = sums[k].iter().fold(T::default(), |sum, s| sum + *s);
            a[k].1.iter().zip(rest).fold(head, |sum, (a, b)| sum + *a * *b)
        })
    }
}

/// Each row fills a register, so rows are taken one by one.
impl<T: Precision, const R: usize> Entry<T> for [T; R]
where
    [T; R]: Default,
{
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        std::array::from_fn(|r| self[r] + other[r])
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        std::array::from_fn(|r| self[r] - other[r])
    }

    #[inline(always)]
    fn minus_times(self, l: T, x: Self) -> Self {
        std::array::from_fn(|r| self[r] - l * x[r])
    }

    #[inline(always)]
    fn over(self, l: T) -> Self {
        self.map(|x| x / l)
    }

    #[inline(always)]
    fn add_columns<const BITS: usize, const W: usize>(a: [&[T]; W], x: [Self; W], y: &mut [Self]) {
        let a = a.map(|a| &a[..y.len()]);
        for (i, y) in y.iter_mut().enumerate() {
            let mut sums = *y;
            for k in 0..W {
                for r in 0..R {
                    sums[r] = a[k][i].times_plus::<BITS>(x[k][r], sums[r]);
                }
            }
            *y = sums;
        }
    }

    #[inline(always)]
    fn products<const BITS: usize, const W: usize>(a: [&[T]; W], b: &[Self]) -> [Self; W] {
        let a = a.map(|a| &a[..b.len()]);
        let mut sums = [Self::default(); W];
        for (i, b) in b.iter().enumerate() {
            for (sums, a) in sums.iter_mut().zip(a) {
                for r in 0..R {
                    sums[r] = a[i].times_plus::<BITS>(b[r], sums[r]);
                }
            }
        }
        sums
    }
}
