//! Numeric factorisation front by front (Duff and Reid 1983), `L Lᵀ` or `L S Lᵀ` with the signs of the pivots: every
//! supernode, with what its children in the elimination tree leave to it, is a small dense matrix, of which its own columns
//! are eliminated and the rest is left to its parent.
//!
//! For the factors of single organs this is quicker than faer's supernodes, which fetch from each descendant on its own
//! what a front is handed once. Large factors are left to faer, whose dense kernels mind the caches and share the work
//! among threads.

use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

use super::front::{eliminate, leave};
use super::signs::Signs;
use super::substitution::zeros;
use super::{FactorError, Precision};
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Rows of a front that follow each other in its parent's as well.
struct Run {
    own: usize,
    parent: usize,
    length: usize,
}

/// One supernode: `pivots` columns of `pivots + below` rows, and the square of what is left to the parent.
struct Front {
    /// Its first row.
    first: usize,
    pivots: usize,
    below: usize,
    /// Its columns in the factor.
    columns: Range<usize>,
    /// Its values among those of the matrix.
    values: Range<usize>,
    /// Where the square starts among those of its side.
    square: usize,
    children: Range<usize>,
    /// Its rows below in the parent's numbers, and how many of these runs are of the parent's pivots.
    runs: Vec<Run>,
    to_pivots: usize,
}

/// The fronts of a matrix in elimination order, and room for what they leave to each other.
pub(super) struct Fronts<T> {
    fronts: Vec<Front>,
    /// Multiplications of all fronts up to each.
    work: Vec<f64>,
    /// Children of all fronts, one front after the other.
    children: Vec<usize>,
    /// Where in the factor each value of the matrix belongs.
    home: Vec<u32>,
    /// Whether a front is at an odd depth of the tree.
    is_odd: Vec<bool>,
    /// What is left by fronts at even and at odd depths. Each is a stack: a front's children have read theirs when
    /// it leaves its own.
    left: [Vec<T>; 2],
}

impl<T: Precision> Fronts<T> {
    /// For matrices with the pattern `lower`, whose factor has these supernodes, every subtree contiguous.
    ///
    /// # Errors
    /// No memory.
    pub fn new(
        symbolic: &SymbolicSupernodalCholesky<u32>,
        lower: &SymbolicSparseColMat<u32>,
    ) -> Result<Self, FactorError> {
        let n = symbolic.n_supernodes();
        let parents = parents(symbolic);
        let mut is_odd = vec![false; n];
        for s in (0..n).rev() {
            is_odd[s] = parents[s].is_some_and(|parent| !is_odd[parent]);
        }
        let mut of_parent = vec![Vec::new(); n];
        (0..n).filter_map(|s| Some((s, parents[s]?))).for_each(|(s, p)| of_parent[p].push(s));
        let (mut fronts, mut children) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let (mut top, mut highest) = ([0; 2], [0; 2]);
        for s in 0..n {
            let (first, pivots, below) = shape(symbolic, s);
            let [own, other] = if is_odd[s] { [1, 0] } else { [0, 1] };
            let square = top[own];
            top[own] += below * below;
            highest[own] = highest[own].max(top[own]);
            let start = children.len();
            for &child in &of_parent[s] {
                top[other] -= shape(symbolic, child).2.pow(2);
                children.push(child);
            }
            let column_start = |column: usize| lower.col_ptr()[column] as usize;
            let offset = |s: usize| symbolic.col_ptr_for_val()[s] as usize;
            let runs = parents[s].map_or(Vec::new(), |parent| runs(symbolic, s, parent));
            let parent_pivots = parents[s].map_or(0, |parent| shape(symbolic, parent).1);
            fronts.push(Front {
                first,
                pivots,
                below,
                columns: offset(s)..offset(s + 1),
                values: column_start(first)..column_start(first + pivots),
                square,
                children: start..children.len(),
                to_pivots: runs.partition_point(|run| run.parent < parent_pivots),
                runs,
            });
        }
        let left = [zeros(highest[0])?, zeros(highest[1])?];
        let mut sum = 0.0;
        let work = fronts.iter().map(|front| {
            sum += front.pivots as f64 * ((front.pivots + front.below) as f64).powi(2);
            sum
        });
        let work = work.collect();
        Ok(Self { home: home(symbolic, lower), fronts, work, children, is_odd, left })
    }

    /// Multiplications of a factor, about.
    pub fn work(&self) -> f64 {
        self.work.last().copied().unwrap_or(0.0)
    }

    /// Factorises the matrix with these values, those of its lower triangle by columns, in parts: those fronts that are
    /// next and take so many multiplications together, at least one. The number of fronts that are done is 0 at first;
    /// returns whether these were the last. What is above the diagonal in the factor's blocks is left undefined.
    ///
    /// # Errors
    /// The first step whose pivot is not positive; the fronts before it are done.
    pub fn factorize_part(
        &mut self,
        done: &mut usize,
        work: f64,
        matrix: &[T],
        factor: &mut [T],
    ) -> Result<bool, usize> {
        let before = done.checked_sub(1).map_or(0.0, |last| self.work[last]);
        let enough = self.work.partition_point(|&sum| sum < before + work) + 1;
        let end = enough.clamp(*done, self.fronts.len());
        let signs = Signs::positive();
        dispatch_wide(Elimination { fronts: self, matrix, factor, signs, done, end })?;
        Ok(*done == self.fronts.len())
    }

    /// Goes on to the end with the factor `A = L S Lᵀ` of any symmetric matrix, from the fronts that are `done`; returns the
    /// steps with a negative pivot, ascending. Pivots that are smaller than the `least` of their step are lifted to it.
    ///
    /// # Errors
    /// The first step whose pivot is not a number.
    pub fn factorize_rest(
        &mut self,
        mut done: usize,
        least: &[T],
        matrix: &[T],
        factor: &mut [T],
    ) -> Result<Vec<usize>, usize> {
        let (end, done, signs) = (self.fronts.len(), &mut done, Signs::any(least));
        let signs = dispatch_wide(Elimination { fronts: self, matrix, factor, signs, done, end })?;
        Ok(signs.negative())
    }

    #[inline(always)]
    fn front<const BITS: usize>(
        &mut self,
        s: usize,
        matrix: &[T],
        factor: &mut [T],
        signs: &mut Signs<'_, T>,
    ) -> Result<(), usize> {
        let Front { pivots, below, square, .. } = self.fronts[s];
        let height = pivots + below;
        let values = self.fronts[s].values.clone();
        let start = self.fronts[s].columns.start;
        let columns = &mut factor[self.fronts[s].columns.clone()];
        columns.fill(T::default());
        for (&home, &value) in self.home[values.clone()].iter().zip(&matrix[values]) {
            columns[home as usize - start] = value;
        }
        let [even, odd] = &mut self.left;
        let (own, others) = if self.is_odd[s] { (odd, &*even) } else { (even, &*odd) };
        let children = &self.children[self.fronts[s].children.clone()];
        let left_by = |child: usize| {
            let front = &self.fronts[child];
            (front, &others[front.square..front.square + front.below * front.below])
        };
        for &child in children {
            let (Front { below, runs, to_pivots, .. }, left) = left_by(child);
            take_over(left, *below, (runs, *to_pivots), columns, (height, 0));
        }
        eliminate::<BITS, T>(columns, height, signs)?;
        let own = &mut own[square..square + below * below];
        leave::<BITS, T>(columns, height, signs, own);
        for &child in children {
            let (child, left) = left_by(child);
            let runs = &child.runs[child.to_pivots..];
            take_over(left, child.below, (runs, runs.len()), own, (below, pivots));
        }
        Ok(())
    }
}

/// Adds to the columns of a front, `height` rows each, what a child of `below` rows has left to it: the columns of the
/// first `n` of these runs, and in each of them the rows of all runs. Row and column `first` of the front come first.
#[inline(always)]
fn take_over<T: Precision>(
    left: &[T],
    below: usize,
    (runs, n): (&[Run], usize),
    columns: &mut [T],
    (height, first): (usize, usize),
) {
    for number in 0..n {
        for nth in 0..runs[number].length {
            let source = &left[(runs[number].own + nth) * below..][..below];
            let target = &mut columns[(runs[number].parent + nth - first) * height..][..height];
            let mut skip = nth; // what is above the diagonal
            for run in &runs[number..] {
                let target =
                    &mut target[run.parent + skip - first..run.parent + run.length - first];
                let source = &source[run.own + skip..run.own + run.length];
                target.iter_mut().zip(source).for_each(|(t, s)| *t += *s);
                skip = 0;
            }
        }
    }
}

struct Elimination<'a, T> {
    fronts: &'a mut Fronts<T>,
    matrix: &'a [T],
    factor: &'a mut [T],
    signs: Signs<'a, T>,
    done: &'a mut usize,
    end: usize,
}

impl<'a, T: Precision> WideKernel for Elimination<'a, T> {
    type Output = Result<Signs<'a, T>, usize>;

    #[inline(always)]
    fn run<const BITS: usize>(self) -> Self::Output {
        let Elimination { fronts, matrix, factor, mut signs, done, end } = self;
        while *done < end {
            let first = fronts.fronts[*done].first;
            signs.begin(first);
            let front = fronts.front::<BITS>(*done, matrix, factor, &mut signs);
            front.map_err(|pivot| first + pivot)?;
            *done += 1;
        }
        Ok(signs)
    }
}

/// First row, number of columns and number of rows below of a supernode.
fn shape(symbolic: &SymbolicSupernodalCholesky<u32>, s: usize) -> (usize, usize, usize) {
    let [first, end] = [symbolic.supernode_begin()[s], symbolic.supernode_end()[s]];
    (first as usize, (end - first) as usize, symbolic.supernode(s).pattern().len())
}

/// The supernode that holds the first row below each.
fn parents(symbolic: &SymbolicSupernodalCholesky<u32>) -> Vec<Option<usize>> {
    let mut of_row = vec![0; symbolic.nrows()];
    for s in 0..symbolic.n_supernodes() {
        let (first, pivots, _) = shape(symbolic, s);
        of_row[first..first + pivots].fill(s);
    }
    let first_below = |s| symbolic.supernode(s).pattern().first();
    (0..symbolic.n_supernodes()).map(|s| first_below(s).map(|&row| of_row[row as usize])).collect()
}

/// Number of a row in a supernode: its own columns come first, then the rows below.
fn local(symbolic: &SymbolicSupernodalCholesky<u32>, s: usize, row: u32) -> usize {
    let (first, pivots, _) = shape(symbolic, s);
    match (row as usize).checked_sub(first) {
        Some(pivot) if pivot < pivots => pivot,
        _ => pivots + symbolic.supernode(s).pattern().partition_point(|&below| below < row),
    }
}

/// The rows below a supernode in its parent's numbers; no run goes from the parent's pivots to its rows below.
fn runs(symbolic: &SymbolicSupernodalCholesky<u32>, s: usize, parent: usize) -> Vec<Run> {
    let pivots = shape(symbolic, parent).1;
    let mut runs: Vec<Run> = Vec::new();
    for (own, &row) in symbolic.supernode(s).pattern().iter().enumerate() {
        let there = local(symbolic, parent, row);
        match runs.last_mut() {
            Some(run) if run.parent + run.length == there && there != pivots => run.length += 1,
            _ => runs.push(Run { own, parent: there, length: 1 }),
        }
    }
    runs
}

/// Where in the factor each entry of the matrix belongs.
fn home(symbolic: &SymbolicSupernodalCholesky<u32>, lower: &SymbolicSparseColMat<u32>) -> Vec<u32> {
    let mut home = Vec::with_capacity(lower.row_idx().len());
    for s in 0..symbolic.n_supernodes() {
        let (first, pivots, below) = shape(symbolic, s);
        for pivot in 0..pivots {
            let start = symbolic.col_ptr_for_val()[s] as usize + pivot * (pivots + below);
            let rows = &lower.row_idx()[lower.col_range(first + pivot)];
            home.extend(rows.iter().map(|&row| (start + local(symbolic, s, row)) as u32));
        }
    }
    home
}
