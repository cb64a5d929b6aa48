//! The ladder of shifts: what is added to the diagonal of a matrix that is not positive definite, as a part of its mean
//! diagonal entry, ten times more from rung to rung.

/// The last rung: a matrix shifted so far is its diagonal.
const LARGEST: f64 = 1e6;

/// The rung above `shift`, or `first` where there is no shift yet; none above the last.
pub fn next_shift(shift: f64, first: f64) -> Option<f64> {
    let next = if shift == 0.0 { first } else { 10.0 * shift };
    (shift < LARGEST).then_some(next.min(LARGEST))
}
