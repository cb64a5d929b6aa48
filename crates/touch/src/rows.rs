//! A weighted sum of rows, as short as a region has modes.

use viscera_number::simd::Kernel;

/// `out += sum_k weight_k row_k`, added one after another, four rows in one walk through `out`.
pub(super) struct Rows<'a> {
    pub weights: &'a [f32],
    /// One after another, each as long as `out`.
    pub rows: &'a [f32],
    pub out: &'a mut [f32],
}

impl Kernel for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Rows { weights, rows, out } = self;
        let n = out.len();
        if n == 0 {
            return;
        }
        let mut fours = weights.chunks_exact(4).zip(rows.chunks_exact(4 * n));
        for (w, rows) in &mut fours {
            let ((a, b), (c, d)) = (rows[..2 * n].split_at(n), rows[2 * n..].split_at(n));
            for i in 0..n {
                out[i] = out[i] + w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i];
            }
        }
        let done = weights.len().min(rows.len() / n) / 4 * 4;
        for (&w, row) in weights[done..].iter().zip(rows[done * n..].chunks_exact(n)) {
            for i in 0..n {
                out[i] += w * row[i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera_number::simd::dispatch;

    /// Bit by bit the sum of one row after another, for any number of rows.
    #[test]
    fn rows_are_added_in_their_order() {
        let n = 13;
        for count in 0..10 {
            let value = |k: usize| (0.7 * k as f32).sin();
            let weights: Vec<f32> = (0..count).map(|k| value(k + 100)).collect();
            let rows: Vec<f32> = (0..count * n).map(value).collect();
            let mut out: Vec<f32> = (0..n).map(|i| value(i + 50)).collect();
            let mut expected = out.clone();
            for (w, row) in weights.iter().zip(rows.chunks(n)) {
                expected.iter_mut().zip(row).for_each(|(sum, x)| *sum += w * x);
            }
            dispatch(Rows { weights: &weights, rows: &rows, out: &mut out });
            assert_eq!(out, expected);
        }
        dispatch(Rows { weights: &[1.0], rows: &[], out: &mut [] });
    }
}
