//! Multigrid by smoothed aggregation with the rigid-body modes (Vaněk, Mandel and Brezina, Computing 56, 1996, 179), one
//! V-cycle as a preconditioner: its iterations hardly grow with the mesh.
//!
//! Blocks are 3x3 on the finest level and 6x6 below. The smoother is block Gauss-Seidel, forward before the coarse
//! correction and backward after it; each reads the upper triangle once. Sweeps are in single precision, coarse matrices
//! are made in double precision. The cycle is positive definite wherever the diagonal blocks and the coarsest matrix are,
//! whatever the rounding and whatever the matrix between them: with `G = (D + L)⁻¹` it is
//! `Gᵀ D G + (1 - Gᵀ A) P A_coarse⁻¹ Pᵀ (1 - A G)`. So an indefinite tangent shows in the iterations, or in a pivot here.

mod aggregates;
mod blocks;
mod columns;
mod galerkin;
mod order;
mod parts;
mod prolongation;
mod smoothing;
mod sweeps;
#[cfg(test)]
mod tests;

use super::neighbours::Neighbours;
use super::{Cholesky, FactorError, Factorization, Pattern, conjugate_gradients as cg};
use aggregates::Aggregates;
use blocks::Smoother;
use columns::Upper;
use galerkin::SQUARE;
use parts::Parts;
use prolongation::{MODES, Modal, Prolongation, rigid_modes};

/// Nodes up to which a level is solved by a factor.
const COARSEST: usize = 64;

/// A level that has more than this part of the nodes of the one above is the last.
const SLOWEST: f64 = 0.7;

/// Power iterations for the largest eigenvalue of `D⁻¹ A`.
const POWER_ITERATIONS: usize = 12;

/// Damping of the prolongation's smoother, over that eigenvalue.
const DAMPING: f64 = 4.0 / 3.0;

/// A V-cycle for symmetric matrices of 3x3 blocks on one pattern.
pub struct Multigrid {
    points: Vec<[f64; 3]>,
    finest: Level<3, 4>,
    coarse: Vec<Level<6, 8>>,
    coarsest: Coarsest,
    is_held: Vec<bool>,
    /// The prolongations know what is held.
    is_tentative_ready: bool,
}

/// A level with the way down from it.
struct Level<const B: usize, const W: usize> {
    smoother: Smoother<B, W>,
    prolongation: Prolongation<B>,
    /// The node around which each aggregate was made.
    root: Vec<u32>,
    b: Vec<[f32; W]>,
    x: Vec<[f32; W]>,
    /// The matrix below.
    below: Vec<f64>,
    below_upper: Upper,
    stretches: Vec<galerkin::Stretch>,
}

/// The matrix of the last level, factorised.
struct Coarsest {
    pattern: Pattern,
    /// Where the values of the pattern are among those of the blocks.
    source: Vec<u32>,
    values: Vec<f64>,
    factor: Cholesky,
    b: Vec<Modal>,
    solution: Vec<f64>,
}

impl Multigrid {
    /// Aggregates for matrices whose upper triangle has blocks at `pairs` of row and column, column by column, rows
    /// ascending, the diagonal among them; for a body with nodes at `points`. Factorise before use.
    ///
    /// # Errors
    /// Pairs in another order; a coarsest level too large to factorise.
    pub fn new(
        points: &[[f64; 3]],
        pairs: impl Iterator<Item = (u32, u32)>,
    ) -> Result<Self, FactorError> {
        Self::with_levels(COARSEST, Parts::new, points, pairs)
    }

    /// The same with levels down to so many nodes, each in parts of its own.
    fn with_levels(
        n_coarsest: usize,
        parts: impl Fn(&Upper) -> Parts,
        points: &[[f64; 3]],
        pairs: impl Iterator<Item = (u32, u32)>,
    ) -> Result<Self, FactorError> {
        let upper = Upper::new(points.len(), pairs)?;
        let (finest, mut next) = Level::new(upper, &parts);
        let (mut coarse, mut above) = (Vec::<Level<6, 8>>::new(), points.len());
        while next.n() > n_coarsest && (next.n() as f64) < SLOWEST * above as f64 {
            above = next.n();
            let (level, below) = Level::new(next, &parts);
            coarse.push(level);
            next = below;
        }
        Ok(Multigrid {
            points: points.to_vec(),
            finest,
            coarse,
            coarsest: Coarsest::new(next)?,
            is_held: vec![false; 3 * points.len()],
            is_tentative_ready: false,
        })
    }

    /// Chooses the rows `3 node + component` that are held at zero.
    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_tentative_ready &= self.is_held == is_held;
        self.is_held.copy_from_slice(is_held);
    }

    /// Moves the nodes: the next matrix is made with the rigid motions that they have there, which are what costs a bent
    /// body least.
    pub fn move_to(&mut self, points: impl Iterator<Item = [f64; 3]>) {
        self.points.clear();
        self.points.extend(points);
        self.is_tentative_ready = false;
    }

    /// Nodes of every level, the finest first.
    pub fn levels(&self) -> Vec<usize> {
        let between = self.coarse.iter().map(|level| level.b.len());
        let ends = (self.finest.b.len(), self.coarsest.b.len());
        [ends.0].into_iter().chain(between).chain([ends.1]).collect()
    }

    /// Takes over a matrix, nine values for each block, row-major, with `shift` added to its diagonal: smooths the
    /// prolongations, and makes and factorises what lies below.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] with a row of the block, or of the aggregate, that shows it; values that are
    /// not finite.
    pub fn factorize(&mut self, values: &[f64], shift: f64) -> Result<(), FactorError> {
        let expected = 9 * self.finest.smoother.pattern.len();
        FactorError::expect_length("values", expected, values.len())?;
        if let Some(position) = values.iter().position(|value| !value.is_finite()) {
            return Err(FactorError::NotFinite { position });
        }
        if !self.is_tentative_ready {
            self.orthonormalize();
        }
        let Multigrid { finest, coarse, coarsest, is_held, .. } = self;
        finest.renew(values, shift, |row| !is_held[row]).map_err(|node| not_positive(node, []))?;
        let mut roots = vec![finest.root.as_slice()];
        let (mut values, mut has_unknown) = finest.below();
        for level in coarse {
            let renewed = level.renew(values, 0.0, |row| has_unknown[row]);
            renewed.map_err(|node| not_positive(node, roots.iter().copied()))?;
            roots.push(&level.root);
            (values, has_unknown) = level.below();
        }
        coarsest.factorize(values, has_unknown).map_err(|error| match error {
            FactorError::NotPositiveDefinite { row } | FactorError::Singular { row } => {
                not_positive(row / MODES, roots.iter().copied())
            }
            other => other,
        })
    }

    /// Modes of the body where nothing is held, level by level.
    fn orthonormalize(&mut self) {
        let mut modes = rigid_modes(&self.points);
        for (mode, _) in modes.iter_mut().zip(&self.is_held).filter(|(_, held)| **held) {
            *mode = [0.0; MODES];
        }
        modes = self.finest.prolongation.orthonormalize(&modes);
        for level in &mut self.coarse {
            modes = level.prolongation.orthonormalize(&modes);
        }
        self.is_tentative_ready = true;
    }
}

/// What is wrong with a node of a level, whose aggregates on the finer levels were made around `roots`, the finest first.
fn not_positive<'a>(
    node: usize,
    roots: impl IntoIterator<Item = &'a [u32], IntoIter: DoubleEndedIterator>,
) -> FactorError {
    let finest = roots.into_iter().rev().fold(node, |node, root| root[node] as usize);
    FactorError::NotPositiveDefinite { row: 3 * finest }
}

impl cg::Preconditioner for Multigrid {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let largest = r.iter().fold(0.0f64, |largest, r| largest.max(r.abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        for (b, r) in self.finest.b.iter_mut().zip(r.chunks_exact(3)) {
            (0..3).for_each(|i| b[i] = (r[i] / scale) as f32);
        }
        self.cycle();
        for (z, x) in z.chunks_exact_mut(3).zip(&self.finest.x) {
            (0..3).for_each(|i| z[i] = scale * f64::from(x[i]));
        }
    }
}

impl Multigrid {
    /// From `b` to `x` of the finest level.
    fn cycle(&mut self) {
        let Multigrid { finest, coarse, coarsest, .. } = self;
        finest.descend(coarse.first_mut().map_or(&mut coarsest.b, |next| &mut next.b));
        for k in 0..coarse.len() {
            let (above, below) = coarse.split_at_mut(k + 1);
            above[k].descend(below.first_mut().map_or(&mut coarsest.b, |next| &mut next.b));
        }
        coarsest.solve();
        for k in (0..coarse.len()).rev() {
            let (above, below) = coarse.split_at_mut(k + 1);
            above[k].ascend(below.first().map_or(&coarsest.b, |next| &next.x));
        }
        finest.ascend(coarse.first().map_or(&coarsest.b, |next| &next.x));
    }
}

impl<const B: usize, const W: usize> Level<B, W> {
    /// With what is below it.
    fn new(upper: Upper, parts: impl Fn(&Upper) -> Parts) -> (Self, Upper) {
        let neighbours = Neighbours::new(upper.n(), upper.pairs());
        let aggregates = Aggregates::new(&neighbours);
        let zeros = vec![[0.0; W]; upper.n()];
        let parts = parts(&upper);
        let smoother = Smoother::new(upper, parts);
        let prolongation = Prolongation::new(&aggregates, &neighbours, &smoother.parts);
        let coarse = galerkin::pattern(&prolongation, &neighbours);
        let stretches = galerkin::stretches(&smoother.pattern, &prolongation, &coarse);
        let level = Level {
            smoother,
            prolongation,
            root: aggregates.root,
            b: zeros.clone(),
            x: zeros,
            below: vec![0.0; SQUARE * coarse.len()],
            below_upper: coarse.clone(),
            stretches,
        };
        (level, coarse)
    }

    /// Takes over the matrix of this level. Fails with the node whose diagonal block is not positive definite.
    fn renew(
        &mut self,
        values: &[f64],
        shift: f64,
        has_unknown: impl Fn(usize) -> bool,
    ) -> Result<(), usize> {
        let Level { smoother, prolongation, b, x, below, below_upper, stretches, .. } = self;
        smoother.fill(values, shift, has_unknown)?;
        let omega = DAMPING / largest_eigenvalue(smoother, b, x);
        prolongation.smooth(smoother, omega as f32);
        let (fine, coarse) = (&smoother.pattern, &*below_upper);
        galerkin::Product { fine, values, shift, prolongation, coarse }.compute(stretches, below);
        Ok(())
    }

    /// The matrix of the next level, and which of its rows are unknowns.
    fn below(&self) -> (&[f64], &[bool]) {
        (&self.below, self.prolongation.unknowns())
    }

    /// Smooths from zero, and hands the residual down.
    fn descend(&mut self, below: &mut [Modal]) {
        let Level { smoother, prolongation, b, x, .. } = self;
        prolongation.restrict_negative(smoother.forward(b, x), below);
    }

    /// Takes the correction from below, and smooths.
    fn ascend(&mut self, below: &[Modal]) {
        let Level { smoother, prolongation, b, x, .. } = self;
        prolongation.prolongate(below, x);
        smoother.backward(b, x);
    }
}

/// Of `D⁻¹ A`, by power iterations; `x` and `y` are overwritten.
fn largest_eigenvalue<const B: usize, const W: usize>(
    smoother: &mut Smoother<B, W>,
    x: &mut [[f32; W]],
    y: &mut [[f32; W]],
) -> f64 {
    for (k, x) in x.iter_mut().enumerate() {
        (0..B).for_each(|i| x[i] = (((B * k + i) * 37 + 1) as f64 * 0.7).sin() as f32);
    }
    let mut largest = 1.0;
    for _ in 0..POWER_ITERATIONS {
        smoother.jacobi(x, y);
        let square =
            |v: &[[f32; W]]| v.iter().flatten().map(|v| f64::from(*v).powi(2)).sum::<f64>();
        let (before, after) = (square(x).sqrt(), square(y).sqrt());
        if !(before > 0.0 && after > 0.0) {
            break;
        }
        largest = after / before;
        for (x, y) in x.iter_mut().zip(&*y) {
            (0..B).for_each(|i| x[i] = (f64::from(y[i]) / after) as f32);
        }
    }
    largest
}

impl Coarsest {
    fn new(upper: Upper) -> Result<Self, FactorError> {
        let mut pattern = Pattern { n: MODES * upper.n(), column_start: vec![0], row: Vec::new() };
        let mut source = Vec::new();
        for column in 0..upper.n() {
            for k in 0..MODES {
                for (place, &row) in upper.column(column).zip(upper.rows(column)) {
                    let is_diagonal = row as usize == column;
                    for i in (0..MODES).filter(|&i| !is_diagonal || i <= k) {
                        pattern.row.push((MODES * row as usize + i) as u32);
                        source.push((SQUARE * place + MODES * i + k) as u32);
                    }
                }
                pattern.column_start.push(pattern.row.len() as u32);
            }
        }
        Ok(Coarsest {
            factor: Cholesky::analyze(&pattern)?,
            values: vec![0.0; source.len()],
            b: vec![Modal::default(); upper.n()],
            solution: vec![0.0; pattern.n],
            pattern,
            source,
        })
    }

    /// Rows without an unknown become those of the identity.
    fn factorize(&mut self, values: &[f64], has_unknown: &[bool]) -> Result<(), FactorError> {
        for (value, &source) in self.values.iter_mut().zip(&self.source) {
            *value = values[source as usize];
        }
        for row in (0..self.pattern.n).filter(|&row| !has_unknown[row]) {
            self.values[self.pattern.column(row).end - 1] = 1.0;
        }
        self.factor.factorize(&self.values)
    }

    /// `b <- A⁻¹ b`; zero where that overflows, which shows in the iterations.
    fn solve(&mut self) {
        for (x, b) in self.solution.chunks_exact_mut(MODES).zip(&self.b) {
            (0..MODES).for_each(|i| x[i] = f64::from(b[i]));
        }
        if self.factor.solve(&mut self.solution, 1).is_err() {
            self.solution.fill(0.0);
        }
        for (x, b) in self.solution.chunks_exact(MODES).zip(&mut self.b) {
            (0..MODES).for_each(|i| b[i] = x[i] as f32);
        }
    }
}
