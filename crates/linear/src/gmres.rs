//! The generalised minimal residual method (Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 1986, 856) for the one
//! unsymmetric system there is: a tangent under pressure on a free rim, preconditioned by its symmetric part.

use viscera_number::{dot, norm};

/// Solves `A x = b` from zero for an operator near the identity, to a residual of `tolerance` relative to `b` or the
/// best of `max_iterations`.
///
/// # Errors
/// Those of `apply`.
pub fn gmres<E>(
    mut apply: impl FnMut(&[f64]) -> Result<Vec<f64>, E>,
    b: &[f64],
    tolerance: f64,
    max_iterations: usize,
) -> Result<Vec<f64>, E> {
    let size = norm(b);
    if !(size > 0.0) {
        return Ok(b.to_vec());
    }
    let mut basis = vec![scaled(b, 1.0 / size)];
    // Columns of the triangle R, the rotations that made it, and what they make of the right-hand side.
    let (mut columns, mut rotations) = (Vec::<Vec<f64>>::new(), Vec::<(f64, f64)>::new());
    let mut rest = vec![size];
    for k in 0..max_iterations {
        let mut next = apply(&basis[k])?;
        let mut column = Vec::with_capacity(k + 2);
        for v in &basis {
            let along = dot(&next, v);
            next.iter_mut().zip(v).for_each(|(x, v)| *x -= along * v);
            column.push(along);
        }
        let beyond = norm(&next);
        for (i, &(c, s)) in rotations.iter().enumerate() {
            let (x, y) = (column[i], column[i + 1]);
            (column[i], column[i + 1]) = (c * x + s * y, c * y - s * x);
        }
        let length = column[k].hypot(beyond);
        let (c, s) = (column[k] / length, beyond / length);
        column[k] = length;
        rotations.push((c, s));
        columns.push(column);
        let left = rest[k];
        rest[k] = c * left;
        rest.push(-s * left);
        if rest[k + 1].abs() <= tolerance * size || beyond == 0.0 {
            break;
        }
        basis.push(scaled(&next, 1.0 / beyond));
    }
    let n = columns.len();
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| columns[j][i] * rest[j]).sum();
        rest[i] = (rest[i] - known) / columns[i][i];
    }
    let mut x = vec![0.0; b.len()];
    for (v, weight) in basis.iter().zip(&rest[..n]) {
        x.iter_mut().zip(v).for_each(|(x, v)| *x += weight * v);
    }
    Ok(x)
}

fn scaled(a: &[f64], factor: f64) -> Vec<f64> {
    a.iter().map(|a| factor * a).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    const N: usize = 40;

    /// The identity and a skew part three times its size on a few rows: no fixed-point iteration converges.
    fn apply(x: &[f64]) -> Result<Vec<f64>, Infallible> {
        let mut y = x.to_vec();
        for i in 0..6 {
            y[i] += 3.0 * x[(i + 1) % 6] - 3.0 * x[(i + 5) % 6];
        }
        Ok(y)
    }

    #[test]
    fn a_skew_part_of_low_rank_takes_as_many_iterations() {
        let exact: Vec<f64> = (0..N).map(|i| (i as f64).sin()).collect();
        let Ok(b) = apply(&exact);
        let mut calls = 0;
        let counted = |x: &[f64]| {
            calls += 1;
            apply(x)
        };
        let Ok(x) = gmres(counted, &b, 1e-13, 20);
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-12), "{x:?}");
        assert!(calls <= 7, "{calls}");
    }

    #[test]
    fn the_identity_takes_one_and_zero_none() {
        let b: Vec<f64> = (0..N).map(|i| i as f64).collect();
        let identity = |x: &[f64]| Ok::<_, Infallible>(x.to_vec());
        let Ok(x) = gmres(identity, &b, 1e-12, 1);
        assert!(x.iter().zip(&b).all(|(x, b)| (x - b).abs() < 1e-12));
        let Ok(zero) = gmres(identity, &[0.0; 3], 1e-12, 1);
        assert_eq!(zero, [0.0; 3]);
    }

    #[test]
    fn what_the_operator_refuses_is_passed_on() {
        assert_eq!(gmres(|_| Err("no"), &[1.0], 1e-12, 3), Err("no"));
    }
}
