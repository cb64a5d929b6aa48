//! Numeric factorisation front by front (Duff and Reid 1983), `L Lᵀ` or `L S Lᵀ` with the signs of the pivots: every
//! supernode, with what its children in the elimination tree leave to it, is a small dense matrix, of which its own columns
//! are eliminated and the rest is left to its parent.
//!
//! For the factors of single organs this is quicker than faer's supernodes, which fetch from each descendant on its own
//! what a front is handed once. Threads share subtrees, and the columns of wide fronts. Large factors are left to faer, which
//! needs less memory.

use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

use super::front::{eliminate, leave};
use super::handover::{Run, runs, take_over};
use super::signs::Signs;
use super::substitution::zeros;
use super::subtrees::{Subtree, Subtrees};
use super::tree::{local, parents, shape};
use super::{FactorError, Precision};
use crate::threads::{in_pool_for_long_work, may_cut, n_threads};
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Entries of the factor that one thread makes in a piece, in a millisecond or more.
const GRAIN: usize = 250_000;

/// Pieces of a factor, about. More would be of little use, since threads share the wide fronts above them, and take more
/// memory: those that may be made at once need twice the squares of one after the other.
const PIECES: usize = 4;

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
    /// Where its square is: the room, whether at an odd depth of the tree, and the start there.
    room: usize,
    is_odd: bool,
    square: usize,
    children: Range<usize>,
    /// Its rows below in the parent's numbers, and how many of these runs are of the parent's pivots.
    runs: Vec<Run>,
    to_pivots: usize,
}

/// What fronts leave at even and at odd depths. Each is a stack: a front's children have read theirs when it leaves its own.
/// Each subtree at the bottom has one, which those above it go on with; the others stay empty.
struct Squares<T>([Vec<T>; 2]);

/// The fronts of a matrix in elimination order, and room for what they leave to each other.
pub(super) struct Fronts<T> {
    tree: Tree,
    /// As many as there are subtrees.
    squares: Vec<Squares<T>>,
}

/// How fronts follow from each other.
struct Tree {
    fronts: Vec<Front>,
    subtrees: Subtrees,
    /// Multiplications of all fronts up to each.
    work: Vec<f64>,
    /// Children of all fronts, one front after the other.
    children: Vec<usize>,
    /// Where in the factor each value of the matrix belongs.
    home: Vec<u32>,
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
        // The factor is the same, however it is cut; one thread takes least memory for it in one piece.
        let pieces = if n_threads() > 1 { PIECES } else { 1 };
        let grain = (symbolic.len_val() / pieces).max(GRAIN);
        Self::cut(symbolic, lower, Subtrees::new(symbolic, grain))
    }

    fn cut(
        symbolic: &SymbolicSupernodalCholesky<u32>,
        lower: &SymbolicSparseColMat<u32>,
        subtrees: Subtrees,
    ) -> Result<Self, FactorError> {
        let n = symbolic.n_supernodes();
        let parents = parents(symbolic);
        let mut is_odd = vec![false; n];
        for s in (0..n).rev() {
            is_odd[s] = parents[s].is_some_and(|parent| !is_odd[parent]);
        }
        let mut of_parent = vec![Vec::new(); n];
        (0..n).filter_map(|s| Some((s, parents[s]?))).for_each(|(s, p)| of_parent[p].push(s));
        let (mut fronts, mut children) = (Vec::<Front>::with_capacity(n), Vec::with_capacity(n));
        let mut tops = vec![[0; 2]; subtrees.all.len()];
        let mut highest = tops.clone();
        for subtree in &subtrees.all {
            for s in subtree.supernodes.clone() {
                let (first, pivots, below) = shape(symbolic, s);
                let [own, other] = if is_odd[s] { [1, 0] } else { [0, 1] };
                let top: &mut [usize; 2] = &mut tops[subtree.room];
                let square = top[own];
                top[own] += below * below;
                highest[subtree.room][own] = top[own].max(highest[subtree.room][own]);
                let start = children.len();
                for &child in &of_parent[s] {
                    tops[fronts[child].room][other] -= fronts[child].below.pow(2);
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
                    room: subtree.room,
                    is_odd: is_odd[s],
                    square,
                    children: start..children.len(),
                    to_pivots: runs.partition_point(|run| run.parent < parent_pivots),
                    runs,
                });
            }
        }
        let room = |[even, odd]: [usize; 2]| Ok(Squares([zeros(even)?, zeros(odd)?]));
        let squares = highest.into_iter().map(room).collect::<Result<_, _>>()?;
        let mut sum = 0.0;
        let work = fronts.iter().map(|front| {
            sum += front.pivots as f64 * ((front.pivots + front.below) as f64).powi(2);
            sum
        });
        let work = work.collect();
        let tree = Tree { home: home(symbolic, lower), fronts, subtrees, work, children };
        Ok(Self { tree, squares })
    }

    /// Multiplications of a factor, about.
    pub fn work(&self) -> f64 {
        self.tree.work.last().copied().unwrap_or(0.0)
    }

    /// Factorises the matrix with these values, those of its lower triangle by columns; threads share the subtrees. What is
    /// above the diagonal in the factor's blocks is left undefined.
    ///
    /// # Errors
    /// The number of fronts that are done, and the first step whose pivot is not positive.
    pub fn factorize(&mut self, matrix: &[T], factor: &mut [T]) -> Result<(), (usize, usize)> {
        match self.squares.len() {
            ..2 => self.factorize_in_pieces(matrix, factor, false),
            _ => in_pool_for_long_work(|| self.factorize_in_pieces(matrix, factor, may_cut())),
        }
    }

    fn factorize_in_pieces(
        &mut self,
        matrix: &[T],
        factor: &mut [T],
        is_shared: bool,
    ) -> Result<(), (usize, usize)> {
        let (tree, mut shares) = self.shares(factor);
        let roots = &tree.subtrees.roots;
        tree.subtrees.each(roots, &mut shares, is_shared, &|subtree, shares| {
            tree.factorize(subtree, matrix, shares, is_shared);
        });
        shares.into_iter().try_for_each(|share| share.outcome)
    }

    /// The same in parts: those fronts that are next and take so many multiplications together, at least one. The number of
    /// fronts that are done is 0 at first; returns whether these were the last.
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
        let tree = &self.tree;
        let before = done.checked_sub(1).map_or(0.0, |last| tree.work[last]);
        let enough = tree.work.partition_point(|&sum| sum < before + work) + 1;
        let end = enough.clamp(*done, tree.fronts.len());
        self.go_on(done, end, &mut Signs::positive(), matrix, factor)?;
        Ok(end == self.tree.fronts.len())
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
        let (end, mut signs) = (self.tree.fronts.len(), Signs::any(least));
        self.go_on(&mut done, end, &mut signs, matrix, factor)?;
        Ok(signs.negative())
    }

    /// Fronts one after the other, through all subtrees.
    fn go_on(
        &mut self,
        done: &mut usize,
        end: usize,
        signs: &mut Signs<'_, T>,
        matrix: &[T],
        factor: &mut [T],
    ) -> Result<(), usize> {
        let (tree, mut shares) = self.shares(factor);
        for subtree in &tree.subtrees.all {
            let Range { start, end: last } = subtree.supernodes;
            let fronts = start.max(*done)..last.min(end);
            if fronts.is_empty() {
                continue;
            }
            *done = fronts.end;
            let (shares, signs) = (&mut shares[..=subtree.number], &mut *signs);
            let part =
                Elimination { tree, subtree, fronts, matrix, shares, signs, is_shared: false };
            if let Err((front, step)) = dispatch_wide(part) {
                *done = front;
                return Err(step);
            }
        }
        Ok(())
    }

    /// The tree, and what belongs to each subtree.
    fn shares<'a>(&'a mut self, mut factor: &'a mut [T]) -> (&'a Tree, Vec<Share<'a, T>>) {
        let Self { tree, squares } = self;
        let share = |(squares, subtree): (&'a mut Squares<T>, &Subtree)| {
            let entries = subtree.supernodes.clone().map(|s| tree.fronts[s].columns.len()).sum();
            let (columns, rest) = std::mem::take(&mut factor).split_at_mut(entries);
            factor = rest;
            Share { squares, columns, outcome: Ok(()) }
        };
        let shares = squares.iter_mut().zip(&tree.subtrees.all).map(share).collect();
        (tree, shares)
    }
}

/// A subtree in the hands of a thread.
struct Share<'a, T> {
    squares: &'a mut Squares<T>,
    /// Its columns in the factor.
    columns: &'a mut [T],
    /// The front whose pivot is refused, and the step.
    outcome: Result<(), (usize, usize)>,
}

impl Tree {
    /// A subtree after those below it, where none of them has failed. The last share is its own.
    fn factorize<T: Precision>(
        &self,
        subtree: &Subtree,
        matrix: &[T],
        shares: &mut [Share<'_, T>],
        is_shared: bool,
    ) {
        let Some((_, below)) = shares.split_last_mut() else { return };
        self.subtrees.each(&subtree.children, below, is_shared, &|child, shares| {
            self.factorize(child, matrix, shares, is_shared);
        });
        if below.iter().all(|share| share.outcome.is_ok()) {
            let (fronts, signs) = (subtree.supernodes.clone(), &mut Signs::positive());
            let whole =
                Elimination { tree: self, subtree, fronts, matrix, shares, signs, is_shared };
            let outcome = dispatch_wide(whole);
            if let Some(own) = shares.last_mut() {
                own.outcome = outcome;
            }
        }
    }

    /// Eliminates a front, whose `columns` of the factor are given, with its own stack of squares and those of its children by
    /// their rooms.
    #[inline(always)]
    fn front<'b, const BITS: usize, T: Precision + 'b>(
        &self,
        s: usize,
        matrix: &[T],
        columns: &mut [T],
        (own, others): (&mut [T], impl Fn(usize) -> &'b [T] + Copy),
        signs: &mut Signs<'_, T>,
        is_shared: bool,
    ) -> Result<(), usize> {
        let front = &self.fronts[s];
        let Front { pivots, below, square, .. } = *front;
        let height = pivots + below;
        columns.fill(T::default());
        let values = front.values.clone();
        for (&home, &value) in self.home[values.clone()].iter().zip(&matrix[values]) {
            columns[home as usize - front.columns.start] = value;
        }
        let children = &self.children[front.children.clone()];
        let left_by = |child: usize| {
            let child = &self.fronts[child];
            (child, &others(child.room)[child.square..child.square + child.below * child.below])
        };
        for &child in children {
            let (Front { below, runs, to_pivots, .. }, left) = left_by(child);
            take_over(left, *below, (runs, *to_pivots), columns, (height, 0));
        }
        eliminate::<BITS, T>(columns, height, signs, is_shared)?;
        let own = &mut own[square..square + below * below];
        leave::<BITS, T>(columns, height, signs, own, is_shared);
        for &child in children {
            let (child, left) = left_by(child);
            let runs = &child.runs[child.to_pivots..];
            take_over(left, child.below, (runs, runs.len()), own, (below, pivots));
        }
        Ok(())
    }
}

/// Fronts of one subtree, one after the other.
struct Elimination<'a, 'b, 's, T> {
    tree: &'a Tree,
    subtree: &'a Subtree,
    fronts: Range<usize>,
    matrix: &'a [T],
    /// Those of the subtrees below it, and at last its own.
    shares: &'a mut [Share<'b, T>],
    signs: &'a mut Signs<'s, T>,
    /// Whether threads share wide fronts.
    is_shared: bool,
}

impl<T: Precision> WideKernel for Elimination<'_, '_, '_, T> {
    /// The front whose pivot is refused, and the step.
    type Output = Result<(), (usize, usize)>;

    #[inline(always)]
    fn run<const BITS: usize>(self) -> Self::Output {
        let Elimination { tree, subtree, fronts, matrix, shares, signs, is_shared } = self;
        let before = subtree.number + 1 - shares.len();
        let start = tree.fronts[subtree.supernodes.start].columns.start;
        let all = shares.last_mut().map(|own| std::mem::take(&mut own.columns)).unwrap_or_default();
        for s in fronts {
            let Front { first, room, is_odd, ref columns, .. } = tree.fronts[s];
            signs.begin(first);
            let (own, other) = (usize::from(is_odd), usize::from(!is_odd));
            let mut stack = std::mem::take(&mut shares[room - before].squares.0[own]);
            let of = |room: usize| &shares[room - before].squares.0[other][..];
            let columns = &mut all[columns.start - start..columns.end - start];
            let front =
                tree.front::<BITS, T>(s, matrix, columns, (&mut stack, of), signs, is_shared);
            shares[room - before].squares.0[own] = stack;
            front.map_err(|pivot| (s, first + pivot))?;
        }
        Ok(())
    }
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

#[cfg(test)]
mod tests {
    use super::super::analysis::Analysis;
    use super::super::test_matrices::{Matrix, elastic_block};
    use super::*;

    /// Fronts in pieces of a few entries, the values of a matrix in elimination order, and room for its factor.
    fn in_pieces(matrix: &Matrix) -> (Fronts<f64>, Vec<f64>, Vec<f64>) {
        let made = cut(matrix, 2_000);
        assert!(made.0.squares.len() > 8);
        made
    }

    fn cut(matrix: &Matrix, grain: usize) -> (Fronts<f64>, Vec<f64>, Vec<f64>) {
        let mut analysis = Analysis::new(&matrix.pattern).unwrap();
        analysis.load(&matrix.values).unwrap();
        let Analysis { supernodes, lower, values, .. } = analysis;
        let fronts = Fronts::cut(&supernodes, &lower, Subtrees::new(&supernodes, grain)).unwrap();
        (fronts, values, vec![0.0; supernodes.len_val()])
    }

    fn on<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
    }

    #[test]
    fn pieces_and_threads_make_the_factor_of_one_bit_for_bit() {
        let matrix = elastic_block(9, 8, 7);
        let (mut whole, values, mut expected) = cut(&matrix, usize::MAX);
        assert_eq!(whole.squares.len(), 1);
        whole.factorize(&values, &mut expected).unwrap();
        let (mut fronts, _, mut factor) = in_pieces(&matrix);
        let mut done = 0;
        assert!(fronts.factorize_part(&mut done, f64::INFINITY, &values, &mut factor).unwrap());
        assert_eq!(factor, expected, "one after the other");
        for threads in 1..5 {
            let mut factor = vec![f64::NAN; expected.len()];
            on(threads, || fronts.factorize_in_pieces(&values, &mut factor, true)).unwrap();
            assert_eq!(factor, expected, "{threads} threads");
        }
    }

    #[test]
    fn threads_stop_where_one_does() {
        for shift in [-0.05, -0.5, -3.0] {
            let (mut fronts, values, mut factor) =
                in_pieces(&elastic_block(9, 8, 7).shifted(shift));
            let mut done = 0;
            let step = fronts.factorize_part(&mut done, f64::INFINITY, &values, &mut factor);
            let whole = (done, step.unwrap_err());
            let before = factor[..fronts.tree.fronts[done].columns.start].to_vec();
            for threads in 1..5 {
                let mut factor = vec![f64::NAN; factor.len()];
                let outcome =
                    on(threads, || fronts.factorize_in_pieces(&values, &mut factor, true));
                assert_eq!(outcome, Err(whole), "shift {shift}, {threads} threads");
                assert_eq!(factor[..before.len()], before);
                let least = vec![1e-12; factor.len()];
                let negative =
                    fronts.factorize_rest(whole.0, &least, &values, &mut factor).unwrap();
                assert_eq!(negative[0], whole.1);
            }
        }
    }
}
