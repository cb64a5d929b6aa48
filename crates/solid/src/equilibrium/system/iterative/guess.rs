//! Where a solve sets out from: the multiple of the last step that is nearest to the solution in energy, since a hand
//! mostly goes on as it went. In frames it is a combination of three steps: the last two that were as many iterations into
//! their frames, since motion bends and iterations of one number resemble each other, and the iteration beside them.
//! Newton's steps to one equilibrium have no such motion.

use super::Border;
use crate::number::dot;

/// Where the last step leaves more than this part of the residual, the one before it is of no use either.
const USEFUL: f64 = 0.5;

/// Part of its curvature that a step must have across the others, lest it be rounding.
const ACROSS: f64 = 1e-8;

/// Iterations of a frame whose steps are kept; later ones hardly resemble each other.
const KEPT: usize = 4;

/// The last two steps of an iteration, the last one first.
type Pair = [Vec<f64>; 2];

/// The last steps.
pub(super) struct Guess {
    /// By iteration of a frame, as far as frames have come; one alone where solves do not follow a motion, and then without
    /// the step before.
    steps: Vec<Pair>,
    follows_motion: bool,
    /// The iteration that comes next.
    iteration: usize,
    /// Room for steps that have no energy in common, and for their products with the operator.
    directions: Vec<Direction>,
}

#[derive(Clone)]
struct Direction {
    step: Vec<f64>,
    product: Vec<f64>,
    /// `p . K p`.
    curvature: f64,
}

impl Guess {
    pub fn new(n: usize) -> Self {
        let direction = Direction { step: vec![0.0; n], product: vec![0.0; n], curvature: 0.0 };
        Guess {
            steps: vec![[vec![0.0; n], Vec::new()]],
            follows_motion: false,
            iteration: 0,
            directions: vec![direction],
        }
    }

    /// Sets out from three steps from now on.
    pub fn follow_motion(&mut self) {
        self.follows_motion = true;
        let first = self.directions[0].clone();
        self.steps.iter_mut().for_each(|[last, other]| other.resize(last.len(), 0.0));
        self.directions.resize(3, first);
    }

    /// The next solve is the first of a frame.
    pub fn begin_frame(&mut self) {
        self.iteration = 0;
    }

    /// Nothing that led here is to be started from again.
    pub fn forget(&mut self) {
        self.steps.iter_mut().flatten().for_each(|step| step.fill(0.0));
    }

    /// Steps leave the means of another border alone.
    pub fn bind(&mut self, border: &Border) {
        let steps = self.steps.iter_mut().flatten();
        steps.filter(|step| !step.is_empty()).for_each(|step| border.project(step));
    }

    /// The next solve like this one goes on as this step went.
    pub fn keep(&mut self, step: &[f64]) {
        if !self.follows_motion {
            self.steps[0][0].copy_from_slice(step);
            return;
        }
        if self.iteration == self.steps.len() && self.iteration < KEPT {
            self.steps.push([vec![0.0; step.len()], vec![0.0; step.len()]]);
        }
        if let Some(pair) = self.steps.get_mut(self.iteration) {
            pair.swap(0, 1);
            pair[0].copy_from_slice(step);
        }
        self.iteration += 1;
    }

    /// The steps that the next solve may set out from, those of most use first; zero after others are forgotten.
    pub fn candidates(&self) -> [Option<&[f64]>; 3] {
        let own = self.steps.get(self.iteration);
        let beside = if self.iteration == 0 { 1 } else { self.iteration - 1 };
        let beside = self.steps.get(beside).filter(|_| self.follows_motion);
        let other = own.filter(|_| self.follows_motion);
        [own.map(|pair| &*pair[0]), other.map(|pair| &*pair[1]), beside.map(|pair| &*pair[0])]
    }

    /// Sets `x` to the guess, and takes its part from what is `left` of the residual: `(p . r) / (p . K p) p` for each step
    /// `p`, or that part of it which has no energy in common with those before, until no more than `tolerance` of the residual
    /// is left. `multiply` writes `K p`.
    pub fn start(
        &mut self,
        x: &mut [f64],
        left: &mut [f64],
        tolerance: f64,
        mut multiply: impl FnMut(&[f64], &mut [f64]),
    ) {
        x.fill(0.0);
        let mut directions = std::mem::take(&mut self.directions);
        let (whole, mut remains) = (dot(left, left), 1.0);
        let mut n = 0;
        for (place, candidate) in self.candidates().into_iter().enumerate() {
            let Some(candidate) = candidate else { continue };
            let is_of_use = place != 1 || remains < USEFUL;
            let is_asked_for = place == 0 || is_of_use && remains > tolerance;
            if !is_asked_for || dot(candidate, left) == 0.0 {
                continue;
            }
            let (before, others) = directions.split_at_mut(n);
            let direction = &mut others[0];
            direction.step.copy_from_slice(candidate);
            multiply(&direction.step, &mut direction.product);
            if direction.part_from(before) {
                direction.go(x, left);
                n += 1;
            }
            remains = (dot(left, left) / whole).sqrt();
        }
        self.directions = directions;
    }
}

impl Direction {
    /// Leaves out what has energy in common with others; whether there is anything left that energy may fall along.
    fn part_from(&mut self, others: &[Direction]) -> bool {
        let whole = dot(&self.step, &self.product);
        for other in others {
            let common = dot(&self.step, &other.product) / other.curvature;
            add_times(&mut self.step, -common, &other.step);
            add_times(&mut self.product, -common, &other.product);
        }
        self.curvature = dot(&self.step, &self.product);
        self.curvature > 0.0 && self.curvature > ACROSS * whole
    }

    /// Goes as far as energy falls.
    fn go(&self, x: &mut [f64], left: &mut [f64]) {
        let length = dot(&self.step, left) / self.curvature;
        if length.is_finite() {
            add_times(x, length, &self.step);
            add_times(left, -length, &self.product);
        }
    }
}

/// `y += factor x`.
fn add_times(y: &mut [f64], factor: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f64 = 1e-9;

    /// The guess with a diagonal operator, what it leaves, and how often the operator was applied.
    fn started(guess: &mut Guess, k: &[f64], r: &[f64]) -> (Vec<f64>, Vec<f64>, usize) {
        let (mut x, mut left, mut products) = (vec![7.0; r.len()], r.to_vec(), 0);
        guess.start(&mut x, &mut left, TOLERANCE, |p, product| {
            products += 1;
            product.iter_mut().zip(p).zip(k).for_each(|((y, p), k)| *y = k * p);
        });
        (x, left, products)
    }

    /// After frames of one iteration, in the next.
    fn kept(steps: [[f64; 3]; 2]) -> Guess {
        let mut guess = Guess::new(3);
        guess.follow_motion();
        for step in steps {
            guess.begin_frame();
            guess.keep(&step);
        }
        guess.begin_frame();
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

    /// Frames of two iterations whose steps have nothing in common: each iteration sets out from its own, and from the one
    /// beside it.
    #[test]
    fn an_iteration_sets_out_from_those_of_its_number_and_the_one_beside_it() {
        let k = [2.0, 3.0, 5.0];
        let (first, second) = ([1.0, 0.0, 0.2], [0.0, 1.0, 0.1]);
        let mut guess = Guess::new(3);
        guess.follow_motion();
        for _ in 0..2 {
            guess.begin_frame();
            guess.keep(&first);
            guess.keep(&second);
        }
        let of = |step: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| k[i] * step[i]) };
        guess.begin_frame();
        assert_eq!(started(&mut guess, &k, &of(first)).2, 1);
        let both: [f64; 3] = std::array::from_fn(|i| first[i] + 0.3 * second[i]);
        let (x, ..) = started(&mut guess, &k, &of(both));
        assert!((0..3).all(|i| (x[i] - both[i]).abs() < 1e-12), "{x:?}");
        guess.keep(&first);
        assert_eq!(started(&mut guess, &k, &of(second)).2, 1);
        let both: [f64; 3] = std::array::from_fn(|i| second[i] - 0.3 * first[i]);
        let (x, ..) = started(&mut guess, &k, &of(both));
        assert!((0..3).all(|i| (x[i] - both[i]).abs() < 1e-12), "{x:?}");
        // Beyond those that are kept there is nothing to set out from but the last of them.
        (0..KEPT + 2).for_each(|_| guess.keep(&second));
        assert_eq!(started(&mut guess, &k, &of(second)).2, 0);
    }

    #[test]
    fn steps_of_no_use_cost_no_product() {
        let k = [2.0, 3.0, 5.0];
        let start = |steps, r: [f64; 3]| started(&mut kept(steps), &k, &r);
        // Neither has anything to do with what is asked for.
        let (x, _, products) = start([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]], [1.0, 0.0, 0.0]);
        assert_eq!((x, products), (vec![0.0; 3], 0));
        // It has little to do with it.
        let (.., products) = start([[1.0, 0.0, 0.0], [0.1, 1.0, 0.0]], [1.0, 0.0, 0.0]);
        assert_eq!(products, 1);
        // It is the solution.
        let (.., products) = start([[1.0, 0.2, 0.0], [1.0, 0.3, 0.1]], [4.0, 1.8, 1.0]);
        assert_eq!(products, 1);
        // Newton's steps do not follow a motion.
        let mut guess = Guess::new(3);
        guess.keep(&[1.0, 0.2, 0.0]);
        guess.keep(&[1.0, 0.3, 0.1]);
        let (.., products) = started(&mut guess, &k, &[2.0, 1.2, 0.6]);
        assert_eq!(products, 1);
        // The two are the same but for rounding.
        let (x, _, products) = start([[1.0, 1.0, 1e-9], [1.0, 1.0, 0.0]], [2.0, 3.0, 0.5]);
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
