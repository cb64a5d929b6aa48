//! Long vectors: scalar product and norm.

/// `a . b`, of as many numbers as the shorter has.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums side by side: one alone waits for itself at every addition.
    let (head, tail) = (a.len().min(b.len()) / 8 * 8, a.len().min(b.len()));
    let mut sums = [0.0; 8];
    for (x, y) in a[..head].chunks_exact(8).zip(b[..head].chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + (head..tail).map(|k| a[k] * b[k]).sum::<f64>()
}

/// `|a|`.
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_counts_to_its_end() {
        for n in 0..20 {
            let a: Vec<f64> = (1..=n).map(f64::from).collect();
            let squares = f64::from(n * (n + 1) * (2 * n + 1)) / 6.0;
            assert_eq!(dot(&a, &a), squares);
            assert_eq!(norm(&a), squares.sqrt());
            assert_eq!(dot(&a, &[2.0]), if n > 0 { 2.0 } else { 0.0 });
        }
    }
}
