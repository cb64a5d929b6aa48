//! The Cholesky factor of an earlier tangent as a preconditioner: from one frame to the next the tangent changes so
//! little that a few iterations make up for it, and for single precision, too. Where frames ask for it, the next factor is
//! made while they go on with the last: by a second thread if there is one, else a part with every tangent.

mod spare;

use super::factor::TangentFactor;
use super::local_correction::{Block, Constrained, LocalCorrection};
use crate::body::BlockPattern;
use crate::linear::FactorError;
use spare::Spare;
use std::sync::Arc;

/// Parts of a factor that is made while frames go on. With fewer of them each frame takes longer, with more the factor is
/// old when it comes into use.
const PARTS: f64 = 32.0;

/// Multiplications of a factor that is made in one piece, since that takes but a few milliseconds.
const SMALL: f64 = 1e8;

/// A factor in single precision, or in double where the body asks for it: a tangent whose softest motion is beyond the
/// seven digits of the one has a factor in the other.
struct LaggedFactor {
    pattern: Arc<FactorPattern>,
    is_held: Vec<bool>,
    single: TangentFactor<f32>,
    /// Made when first needed, and kept.
    double: Option<Box<TangentFactor<f64>>>,
    /// The last factor is the one in double precision.
    is_double: bool,
    /// The next is to be.
    wants_double: bool,
    /// Each node's own block of the tangent that the last factor was made from.
    diagonal: Vec<Block>,
}

/// What to factorise: the values of a tangent, and a shift of its diagonal.
#[derive(Clone, Copy)]
struct Goal<V> {
    values: V,
    shift: f64,
}

/// What factors are made for.
struct FactorPattern {
    blocks: BlockPattern,
    free: Vec<u32>,
}

impl LaggedFactor {
    fn new(pattern: &Arc<FactorPattern>, n_dofs: usize) -> Result<Self, FactorError> {
        Ok(LaggedFactor {
            single: TangentFactor::new(&pattern.blocks, &pattern.free)?,
            double: None,
            is_double: false,
            wants_double: false,
            is_held: vec![false; n_dofs],
            diagonal: Vec::new(),
            pattern: pattern.clone(),
        })
    }

    /// What is held decides on the condition as well: single precision may do again.
    fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.single.hold(is_held);
        if let Some(double) = &mut self.double {
            double.hold(is_held);
        }
        self.wants_double = false;
    }

    /// # Errors
    /// Those of double precision: what single precision does not tell from an indefinite tangent may well be definite.
    fn factorize(&mut self, goal: Goal<&[f64]>) -> Result<(), FactorError> {
        self.remember(goal);
        if !self.wants_double && self.single.factorize(goal.values, goal.shift).is_ok() {
            self.is_double = false;
            return Ok(());
        }
        self.factorize_double(goal)
    }

    /// The first or the next part of [`factorize`](Self::factorize); returns whether it was the last. A factor in double
    /// precision is made in one piece.
    ///
    /// # Errors
    /// Those of [`factorize`](Self::factorize).
    fn factorize_part(
        &mut self,
        goal: Goal<&[f64]>,
        is_first: bool,
        work: f64,
    ) -> Result<bool, FactorError> {
        if is_first {
            self.remember(goal);
        }
        if !self.wants_double {
            let single = &mut self.single;
            let begun = if is_first { single.begin(goal.values, goal.shift) } else { Ok(()) };
            if let Ok(is_last) = begun.and_then(|()| single.factorize_part(work)) {
                self.is_double = false;
                return Ok(is_last);
            }
        }
        self.factorize_double(goal).map(|()| true)
    }

    /// Keeps what tells later where the tangent has changed.
    fn remember(&mut self, Goal { values, shift }: Goal<&[f64]>) {
        let LaggedFactor { pattern, is_held, diagonal, .. } = self;
        let given = Constrained { pattern: &pattern.blocks, values, shift, is_held };
        diagonal.clear();
        diagonal.extend(given.diagonal());
    }

    fn factorize_double(
        &mut self,
        Goal { values, shift }: Goal<&[f64]>,
    ) -> Result<(), FactorError> {
        let double = match &mut self.double {
            Some(double) => double,
            none => {
                let mut double = TangentFactor::new(&self.pattern.blocks, &self.pattern.free)?;
                double.hold(&self.is_held);
                none.insert(Box::new(double))
            }
        };
        double.factorize(values, shift)?;
        (self.is_double, self.wants_double) = (true, true);
        Ok(())
    }

    fn solve(&mut self, b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        match &mut self.double {
            Some(double) if self.is_double => double.solve(b, x),
            _ => self.single.solve(b, x),
        }
    }
}

/// A factor in use and, where one is to be renewed beside it, a spare.
pub(super) struct Lagged {
    current: Box<LaggedFactor>,
    is_usable: bool,
    is_held: Vec<bool>,
    spare: Option<Spare>,
    /// What has changed much since the factor in use was made.
    correction: LocalCorrection,
}

impl Lagged {
    pub fn new(blocks: &BlockPattern, free: &[u32], n_dofs: usize) -> Result<Self, FactorError> {
        let pattern = Arc::new(FactorPattern { blocks: blocks.clone(), free: free.to_vec() });
        Ok(Lagged {
            current: Box::new(LaggedFactor::new(&pattern, n_dofs)?),
            is_usable: false,
            is_held: vec![false; n_dofs],
            spare: None,
            correction: LocalCorrection::default(),
        })
    }

    /// Renews the factor while the last one stays in use from now on: on a second thread if there is one, else in parts,
    /// unless the factor is small.
    pub fn renew_beside(&mut self) {
        if self.spare.is_some() {
            return;
        }
        if rayon::current_num_threads() > 1 {
            self.spare = Some(Spare::beside());
        } else if let Some(work) = self.current.single.work()
            && work > SMALL
        {
            self.renew_in_parts(work / PARTS);
        }
    }

    /// The second factor is made at once, since its analysis would be a long frame. If there is no memory for it,
    /// renewals go on in one piece.
    fn renew_in_parts(&mut self, work: f64) {
        if let Ok(factor) = LaggedFactor::new(&self.current.pattern, self.is_held.len()) {
            self.spare = Some(Spare::in_parts(Box::new(factor), work));
        }
    }

    /// Whether nothing waits for a renewal.
    pub fn is_renewed_beside(&self) -> bool {
        self.spare.as_ref().is_some_and(Spare::has_thread)
    }

    /// Whether a renewal takes several solves.
    pub fn is_renewed_in_parts(&self) -> bool {
        self.spare.as_ref().is_some_and(|spare| !spare.has_thread())
    }

    /// Whether the factor in use is in single precision.
    pub fn is_single(&self) -> bool {
        !self.current.is_double
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.current.hold(is_held);
        if let Some(spare) = &mut self.spare {
            spare.hold(is_held);
        }
    }

    /// Takes a finished factor into use, and orders a new one if `is_stale`. Returns whether the factor in use changed.
    pub fn renew(
        &mut self,
        values: &[f64],
        shift: f64,
        is_stale: bool,
    ) -> Result<bool, FactorError> {
        let (mut is_renewed, goal) = (false, Goal { values, shift });
        if let Some(spare) = &mut self.spare {
            is_renewed = spare.collect(&mut self.current, &self.is_held);
            if is_renewed {
                self.correction.clear();
            }
            if self.is_usable {
                // What was stale is no longer in use.
                spare.order(&self.current, goal, is_stale && !is_renewed);
                return Ok(is_renewed);
            }
        }
        if is_stale || !self.is_usable {
            self.is_usable = false;
            self.correction.clear();
            if let Some(spare) = &mut self.spare {
                spare.stop();
            }
            self.current.factorize(goal)?;
            (self.is_usable, is_renewed) = (true, true);
        }
        Ok(is_renewed)
    }

    /// Inverts anew what this tangent has changed much since the factor was made; whether that changes the inverse.
    pub fn correct(&mut self, values: &[f64], shift: f64) -> bool {
        let Lagged { current, is_held, correction, .. } = self;
        let given = Constrained { pattern: &current.pattern.blocks, values, shift, is_held };
        correction.update(given, &current.diagonal)
    }

    /// Leaves the factor as it was made; whether that changes the inverse.
    pub fn forget_corrections(&mut self) -> bool {
        self.correction.clear()
    }

    /// The factor in use is of so little use that the next tangent has its own made at once.
    pub fn abandon(&mut self) {
        self.is_usable = false;
    }

    /// After a fresh factor took too many iterations, the next one is in double precision.
    pub fn distrust(&mut self) {
        self.is_usable &= self.current.wants_double;
        self.current.wants_double = true;
    }

    /// `z = M⁻¹ r`; zero on what is held, also while the factor still stems from another grasp.
    pub fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let Lagged { current, is_held, correction, .. } = self;
        correction.apply(r, z, |r, z| {
            z.fill(0.0);
            if current.solve(r, z).is_err() {
                z.copy_from_slice(r);
            }
            for (z, &held) in z.iter_mut().zip(&*is_held) {
                *z = if held { 0.0 } else { *z };
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};

    /// A factor and its solutions are those of the last tangent until all parts of the next are made; what is held
    /// meanwhile sends it back to its beginning, and a factor made at once puts an end to it.
    #[test]
    fn a_factor_made_in_parts_comes_into_use_whole() {
        let (points, cells) = block([5, 3, 2], [0.5, 0.3, 0.2]);
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::new(points, cells, material).unwrap();
        let n = body.n_dofs();
        let is_fixed = |dof: u32| body.points()[dof as usize / 3][0] == 0.0;
        let free: Vec<u32> = (0..n as u32).filter(|&dof| !is_fixed(dof)).collect();
        let tangent = |seed: u64| {
            let u: Vec<f64> = noise(n, seed).iter().map(|u| 0.001 * u).collect();
            let mut tangent = body.zero_tangent();
            body.internal_force_and_tangent(&u, &mut vec![0.0; n], &mut tangent);
            tangent.values().to_vec()
        };
        let (first, second) = (tangent(1), tangent(2));
        let mut load = noise(n, 3);
        (0..n as u32).filter(|&dof| is_fixed(dof)).for_each(|dof| load[dof as usize] = 0.0);
        let solved = |lagged: &mut Lagged| {
            let mut x = vec![0.0; n];
            lagged.apply(&load, &mut x);
            x
        };
        let whole = |values: &[f64], held: &[bool]| {
            let mut lagged = Lagged::new(body.pattern(), &free, n).unwrap();
            lagged.hold(held);
            lagged.renew(values, 0.0, true).unwrap();
            solved(&mut lagged)
        };
        let (none, mut some) = (vec![false; n], vec![false; n]);
        some[30..33].fill(true);
        let (before, after) = (whole(&first, &none), whole(&second, &none));

        let mut lagged = Lagged::new(body.pattern(), &free, n).unwrap();
        lagged.renew_in_parts(0.3 * lagged.current.single.work().unwrap());
        assert!(lagged.renew(&first, 0.0, true).unwrap(), "the first one is made at once");
        let mut tangents = 0;
        while !lagged.renew(&second, 0.0, true).unwrap() {
            assert_eq!(solved(&mut lagged), before);
            tangents += 1;
        }
        assert!((2..=5).contains(&tangents), "{tangents}");
        assert_eq!(solved(&mut lagged), after);
        for _ in 0..6 {
            assert!(!lagged.renew(&second, 0.0, false).unwrap(), "no other was asked for");
        }

        assert!(!lagged.renew(&first, 0.0, true).unwrap());
        assert!(!lagged.renew(&first, 0.0, false).unwrap());
        lagged.hold(&some);
        let again = (0..6).position(|_| lagged.renew(&first, 0.0, false).unwrap());
        assert!(again.is_some_and(|count| count >= 2), "{again:?}");
        assert_eq!(solved(&mut lagged), whole(&first, &some));

        // What is unfinished when a factor is made at once is older than that one.
        assert!(!lagged.renew(&first, 0.0, true).unwrap());
        lagged.abandon();
        assert!(lagged.renew(&second, 0.0, true).unwrap());
        assert_eq!(solved(&mut lagged), whole(&second, &some));
        assert!((0..6).all(|_| !lagged.renew(&second, 0.0, false).unwrap()));
    }
}
