//! Signs `S` of the pivots of `A = L S Lᵀ`: all are positive where a matrix is positive definite, and nearly all where a
//! body has lost its stability.

use super::Precision;

/// What becomes of pivots that are not positive, and the steps whose pivots are negative.
pub(super) struct Signs<'a, T> {
    /// Of each step: smaller pivots are lifted to this size. Without it none but positive ones are accepted.
    least: Option<&'a [T]>,
    /// Ascending; those of the front in hand are the last.
    negative: Vec<usize>,
    /// Where those of this front start, and the step of its first column.
    start: usize,
    first: usize,
}

impl<'a, T: Precision> Signs<'a, T> {
    /// Of a matrix that must be positive definite.
    pub fn positive() -> Self {
        Signs { least: None, negative: Vec::new(), start: 0, first: 0 }
    }

    /// Of any matrix; smaller pivots than the `least` of their step are lifted to it.
    pub fn any(least: &'a [T]) -> Self {
        Signs { least: Some(least), ..Self::positive() }
    }

    /// Begins with the front whose first column is eliminated at this step.
    #[inline(always)]
    pub fn begin(&mut self, first: usize) {
        (self.start, self.first) = (self.negative.len(), first);
    }

    /// All steps with a negative pivot.
    pub fn negative(self) -> Vec<usize> {
        self.negative
    }

    /// The columns of the front from one on that have a negative pivot, counted from this one.
    #[inline(always)]
    pub fn negative_from(&self, column: usize) -> impl Iterator<Item = usize> {
        let first = self.first + column;
        self.negative[self.start..].iter().filter_map(move |step| step.checked_sub(first))
    }

    /// Whether this column of the front has a negative pivot.
    #[inline(always)]
    pub fn is_negative(&self, column: usize) -> bool {
        self.negative[self.start..].contains(&(self.first + column))
    }

    /// The root of a pivot's size, with the pivot's sign; none if the pivot is refused, or not a number.
    #[inline(always)]
    pub fn signed_root(&mut self, column: usize, pivot: T) -> Option<T> {
        let step = self.first + column;
        let least = self.least.map_or(T::default(), |least| least[step]);
        if pivot > least {
            return Some(pivot.root());
        }
        self.least?;
        if pivot < -least {
            self.negative.push(step);
            return Some(-(-pivot).root());
        }
        (pivot <= least).then(|| least.root())
    }
}
