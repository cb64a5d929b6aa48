//! What conjugate gradients do with their vectors, in parts that threads share. Sums are those of the parts, one after the
//! other, so that they do not depend on the number of threads.

use crate::threads::{for_parts, share};
use rayon::prelude::*;
use viscera_number::simd::{Kernel, dispatch};

/// Numbers of a part.
const PART: usize = 16_384;

/// `x . y`.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let of_part = |(x, y): (&[f64], &[f64])| dispatch(Dot(x, y));
    if share(x.len().div_ceil(PART)) {
        let sums: Vec<f64> = x.par_chunks(PART).zip(y.par_chunks(PART)).map(of_part).collect();
        sums.into_iter().sum()
    } else {
        x.chunks(PART).zip(y.chunks(PART)).map(of_part).sum()
    }
}

/// `|x|`.
pub fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// `y += length * direction`.
pub fn advance(y: &mut [f64], length: f64, direction: &[f64]) {
    for_parts(y, PART, |number, y| {
        let direction = &direction[number * PART..][..y.len()];
        dispatch(Advance { y, length, direction });
    });
}

/// `direction <- preconditioned + turn * direction`.
pub fn turn(direction: &mut [f64], preconditioned: &[f64], turn: f64) {
    for_parts(direction, PART, |number, direction| {
        let preconditioned = &preconditioned[number * PART..][..direction.len()];
        dispatch(Turn { direction, preconditioned, turn });
    });
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        viscera_number::dot(self.0, self.1)
    }
}

struct Advance<'a> {
    y: &'a mut [f64],
    length: f64,
    direction: &'a [f64],
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.y.iter_mut().zip(self.direction).for_each(|(y, p)| *y += self.length * p);
    }
}

struct Turn<'a> {
    direction: &'a mut [f64],
    preconditioned: &'a [f64],
    turn: f64,
}

impl Kernel for Turn<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let terms = self.direction.iter_mut().zip(self.preconditioned);
        terms.for_each(|(p, z)| *p = z + self.turn * *p);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::threads::FEWEST;

    #[test]
    fn parts_add_up_to_the_whole_on_any_number_of_threads() {
        let n = (FEWEST + 1) * PART + 5;
        let [x, y] = [0.37, 0.61].map(|w| (0..n).map(|k| (w * k as f64).sin()).collect::<Vec<_>>());
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (mut advanced, mut turned) = (y.clone(), y.clone());
                advance(&mut advanced, 0.5, &x);
                turn(&mut turned, &x, 0.5);
                (dot(&x, &y), norm(&x), advanced, turned)
            })
        });
        assert!(one == three);
        let (product, size, advanced, turned) = one;
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!((product - sum(&x, &y)).abs() < 1e-9);
        assert!((size - sum(&x, &x).sqrt()).abs() < 1e-9);
        assert!((0..n).all(|k| advanced[k] == y[k] + 0.5 * x[k] && turned[k] == x[k] + 0.5 * y[k]));
    }
}
