//! Where a solve sets out from: the multiple of the last step that is nearest to the solution in energy, since a hand
//! mostly goes on as it went; in frames the combination of the last two, since its motion bends. Newton's steps to one
//! equilibrium have no such motion.

use super::Border;
use crate::number::dot;

/// The step before the last is of use where the last one leaves less than this part of the residual.
const USEFUL: f64 = 0.5;

/// Part of its curvature that a step must have across the other, lest it be rounding.
const ACROSS: f64 = 1e-8;

/// The last steps, with room for their products with the operator.
pub(super) struct Guess {
    /// The last one first; the other is empty where it is not asked for.
    steps: [Vec<f64>; 2],
    products: [Vec<f64>; 2],
    is_of_two: bool,
}

impl Guess {
    pub fn new(n: usize) -> Self {
        let pair = || [vec![0.0; n], Vec::new()];
        Guess { steps: pair(), products: pair(), is_of_two: false }
    }

    /// Sets out from the last two steps from now on.
    pub fn follow_motion(&mut self) {
        self.is_of_two = true;
        let n = self.steps[0].len();
        self.steps[1].resize(n, 0.0);
        self.products[1].resize(n, 0.0);
    }

    /// Nothing that led here is to be started from again.
    pub fn forget(&mut self) {
        self.steps.iter_mut().for_each(|step| step.fill(0.0));
    }

    /// Steps leave the means of another border alone.
    pub fn bind(&mut self, border: &Border) {
        self.steps.iter_mut().filter(|p| !p.is_empty()).for_each(|step| border.project(step));
    }

    /// The next solve goes on as this step went.
    pub fn keep(&mut self, step: &[f64]) {
        if self.is_of_two {
            self.steps.swap(0, 1);
        }
        self.steps[0].copy_from_slice(step);
    }

    /// Sets `x` to the guess, and takes its part from what is `left` of the residual: `(p . r) / (p . K p) p` for the last
    /// step `p`, and for that part of the one before which has no energy in common with it. `multiply` writes `K p`.
    pub fn start(
        &mut self,
        x: &mut [f64],
        left: &mut [f64],
        mut multiply: impl FnMut(&[f64], &mut [f64]),
    ) {
        x.fill(0.0);
        let Guess { steps: [last, other], products: [of_last, of_other], is_of_two } = self;
        let whole = dot(left, left);
        if dot(last, left) == 0.0 {
            return;
        }
        multiply(last, of_last);
        let curvature = dot(last, of_last);
        let is_useful = go_along((last, of_last), curvature, x, left)
            && *is_of_two
            && dot(left, left) < USEFUL * USEFUL * whole;
        if !is_useful || other.iter().all(|&p| p == 0.0) {
            return;
        }
        multiply(other, of_other);
        let before = dot(other, of_other);
        let common = dot(other, of_last) / curvature;
        add_times(other, -common, last);
        add_times(of_other, -common, of_last);
        let across = dot(other, of_other);
        if across > ACROSS * before {
            go_along((other, of_other), across, x, left);
        }
    }
}

/// Goes along a step as far as energy falls, if it has positive curvature; whether it has.
fn go_along(
    (step, product): (&[f64], &[f64]),
    curvature: f64,
    x: &mut [f64],
    left: &mut [f64],
) -> bool {
    let length = dot(step, left) / curvature;
    let goes = curvature > 0.0 && length.is_finite();
    if goes {
        add_times(x, length, step);
        add_times(left, -length, product);
    }
    goes
}

/// `y += factor x`.
fn add_times(y: &mut [f64], factor: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonal operator, and how often it was applied.
    fn started(guess: &mut Guess, k: &[f64], r: &[f64]) -> (Vec<f64>, Vec<f64>, usize) {
        let (mut x, mut left, mut products) = (vec![7.0; r.len()], r.to_vec(), 0);
        guess.start(&mut x, &mut left, |p, product| {
            products += 1;
            product.iter_mut().zip(p).zip(k).for_each(|((y, p), k)| *y = k * p);
        });
        (x, left, products)
    }

    fn kept(steps: [[f64; 3]; 2]) -> Guess {
        let mut guess = Guess::new(3);
        guess.follow_motion();
        steps.iter().for_each(|step| guess.keep(step));
        guess
    }

    #[test]
    fn a_combination_of_the_last_two_steps_leaves_nothing() {
        let (k, a, b) = ([2.0, 3.0, 5.0], [1.0, 0.2, 0.0], [1.0, 0.3, 0.1]);
        let solution: [f64; 3] = std::array::from_fn(|i| 2.0 * b[i] - a[i]);
        let r: [f64; 3] = std::array::from_fn(|i| k[i] * solution[i]);
        let (x, left, products) = started(&mut kept([a, b]), &k, &r);
        assert_eq!(products, 2);
        for i in 0..3 {
            assert!((x[i] - solution[i]).abs() < 1e-12 && left[i].abs() < 1e-12, "{x:?} {left:?}");
        }
    }

    /// What is left is the residual of the guess, which is where the energy along the steps is least.
    #[test]
    fn the_guess_has_the_least_energy_along_the_steps() {
        let (k, a, b, r) = ([2.0, 3.0, 5.0], [1.0, 0.2, -0.1], [1.0, 0.3, 0.1], [2.0, 1.0, 0.7]);
        let (x, left, _) = started(&mut kept([a, b]), &k, &r);
        for i in 0..3 {
            assert!((r[i] - k[i] * x[i] - left[i]).abs() < 1e-12);
        }
        assert!(dot(&left, &a).abs() < 1e-12 && dot(&left, &b).abs() < 1e-12);
    }

    #[test]
    fn steps_of_no_use_cost_no_product() {
        let k = [2.0, 3.0, 5.0];
        let start = |steps, r: [f64; 3]| started(&mut kept(steps), &k, &r);
        // The last one has nothing to do with what is asked for.
        let (x, _, products) = start([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [1.0, 0.0, 0.0]);
        assert_eq!((x, products), (vec![0.0; 3], 0));
        // It has little to do with it.
        let (.., products) = start([[1.0, 0.0, 0.0], [0.1, 1.0, 0.0]], [1.0, 0.0, 0.0]);
        assert_eq!(products, 1);
        // Newton's steps do not follow a motion.
        let mut guess = kept([[1.0, 0.2, 0.0], [1.0, 0.3, 0.1]]);
        guess.is_of_two = false;
        let (.., products) = started(&mut guess, &k, &[2.0, 1.2, 0.6]);
        assert_eq!(products, 1);
        // The two are the same.
        let (x, _, products) = start([[1.0, 1.0, 0.0]; 2], [2.0, 3.0, 0.5]);
        assert_eq!((x, products), (vec![1.0, 1.0, 0.0], 2));
    }

    #[test]
    fn sets_out_from_zero_where_curvature_is_not_positive_or_nothing_is_kept() {
        let steps = [[1.0, 0.2, 0.0], [1.0, 0.3, 0.1]];
        let (x, left, _) = started(&mut kept(steps), &[-2.0, -3.0, 0.0], &[1.0, 2.0, 3.0]);
        assert_eq!((x, left), (vec![0.0; 3], vec![1.0, 2.0, 3.0]));
        let mut guess = kept(steps);
        guess.forget();
        let (x, _, products) = started(&mut guess, &[2.0, 3.0, 5.0], &[1.0, 2.0, 3.0]);
        assert_eq!((x, products), (vec![0.0; 3], 0));
    }
}
