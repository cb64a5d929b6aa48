//! An orthonormal basis of many nearly dependent fields, ordered by importance; for several sets of
//! fields, the basis of their bases.

use super::columns::Columns;
use crate::error::Error;
use faer::{Mat, Par, Side};

/// An orthonormal basis of the columns: a pivoted Cholesky factor of their Gram matrix.
///
/// Column `c` has the coordinates `coordinates[c, ..]`; the first `n_first` columns come first, in
/// order, the rest is rotated to principal directions.
pub(super) struct Basis {
    pivots: Vec<usize>,
    /// Pivot rows of the Cholesky factor, before the rotation.
    factor: Mat<f64>,
    rotation: Mat<f64>,
    pub coordinates: Mat<f64>,
    n_first: usize,
}

impl Basis {
    /// Drops what lies below `tolerance` times the largest column.
    pub fn new(columns: &Columns, n_first: usize, tolerance: f64) -> Result<Self, Error> {
        let (pivots, lower) = pivoted_cholesky(columns, n_first, tolerance);
        let (m, rank) = (columns.len(), pivots.len());
        let cholesky = Mat::from_fn(m, rank, |i, k| lower[k][i]);
        let factor = Mat::from_fn(rank, rank, |i, j| cholesky[(pivots[i], j)]);
        let n_first = n_first.min(rank);
        let rest = cholesky.subcols(n_first, rank - n_first).to_owned();
        let principal = (rest.transpose() * &rest)
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| Error::input("the fields of a region could not be compressed"))?;
        // Eigenvalues come ascending.
        let size = rank - n_first;
        let rotation = Mat::from_fn(size, size, |i, j| principal.U()[(i, size - 1 - j)]);
        let rotated = &rest * &rotation;
        let coordinates = Mat::from_fn(m, rank, |c, k| {
            if k < n_first { cholesky[(c, k)] } else { rotated[(c, k - n_first)] }
        });
        Ok(Basis { pivots, factor, rotation, coordinates, n_first })
    }

    /// Number of modes.
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// The first `kept` modes as columns: `A[:, pivots] L^-T`, the rest rotated.
    pub fn modes(&self, columns: &Columns, kept: usize) -> Mat<f64> {
        let rank = self.rank();
        // Columns of T with A[:, pivots] T = modes: L^T T = [I, rotation].
        let mut t = Mat::from_fn(rank, kept, |i, k| {
            if i < self.n_first || k < self.n_first {
                (i == k) as u8 as f64
            } else {
                self.rotation[(i - self.n_first, k - self.n_first)]
            }
        });
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(
            self.factor.transpose(),
            t.as_mut(),
            Par::Seq,
        );
        columns.copied(&self.pivots) * &t
    }
}

/// A basis that several sets of columns share: that of the one set, or, where there are more, that
/// of their own bases, each mode as large as the largest part a column has in it.
///
/// Himpe, Leibner and Rave, SIAM J. Sci. Comput. 40 (2018) A3267: the same modes as of all columns
/// at once to within the tolerance, at a fraction of the work.
pub(super) struct Common {
    basis: Basis,
    /// The columns of which the basis is made, if not the fields themselves.
    parts: Option<Mat<f64>>,
    /// Of each set: the coordinates (columns, modes).
    pub coordinates: Vec<Mat<f64>>,
}

impl Common {
    /// Of sets of equal size; the first `n_first` columns of a single set are its first modes.
    pub fn new(sets: &[Columns], n_first: usize, tolerance: f64) -> Result<Self, Error> {
        if let [columns] = sets {
            let basis = Basis::new(columns, n_first, tolerance)?;
            let coordinates = vec![basis.coordinates.clone()];
            return Ok(Common { basis, parts: None, coordinates });
        }
        let own = sets
            .iter()
            .map(|columns| Basis::new(columns, n_first, tolerance))
            .collect::<Result<Vec<_>, _>>()?;
        let largest = |b: &Basis, k: usize| b.coordinates.col(k).norm_max().max(f64::MIN_POSITIVE);
        let starts: Vec<usize> = std::iter::once(0)
            .chain(own.iter().scan(0, |end, b| {
                *end += b.rank();
                Some(*end)
            }))
            .collect();
        let mut parts = Mat::zeros(sets[0].n_rows(), starts[own.len()]);
        for (j, basis) in own.iter().enumerate() {
            let modes = basis.modes(&sets[j], basis.rank());
            for k in 0..basis.rank() {
                let size = largest(basis, k);
                for i in 0..modes.nrows() {
                    parts[(i, starts[j] + k)] = size * modes[(i, k)];
                }
            }
        }
        let basis = Basis::new(&Columns::of(parts.as_ref()), 0, tolerance)?;
        let coordinates = own.iter().enumerate().map(|(j, own)| {
            let scaled = Mat::from_fn(own.coordinates.nrows(), own.rank(), |c, k| {
                own.coordinates[(c, k)] / largest(own, k)
            });
            &scaled * basis.coordinates.subrows(starts[j], own.rank())
        });
        Ok(Common { coordinates: coordinates.collect(), basis, parts: Some(parts) })
    }

    /// Number of modes.
    pub fn rank(&self) -> usize {
        self.basis.rank()
    }

    /// The first modes that are columns kept exactly.
    pub fn n_first(&self) -> usize {
        self.basis.n_first
    }

    /// Squared norm of a column's part in all modes from one on.
    pub fn square(&self, set: usize, column: usize, from: usize) -> f64 {
        (from..self.rank()).map(|m| self.coordinates[set][(column, m)].powi(2)).sum()
    }

    /// The first `kept` modes as columns.
    pub fn modes(&self, sets: &[Columns], kept: usize) -> Mat<f64> {
        match &self.parts {
            Some(parts) => self.basis.modes(&Columns::of(parts.as_ref()), kept),
            None => self.basis.modes(&sets[0], kept),
        }
    }
}

/// Columns of the Gram matrix `A^T A`, made when they are asked for: a basis needs few of them.
struct Gram<'a> {
    columns: &'a Columns<'a>,
    known: Vec<Vec<f64>>,
}

impl<'a> Gram<'a> {
    /// Columns that are made at once. Of more, fewer would turn out to be pivots; fewer would take longer each.
    const BLOCK: usize = 32;

    fn new(columns: &'a Columns) -> Self {
        Gram { columns, known: vec![Vec::new(); columns.len()] }
    }

    /// A column; where it is not known yet, those next in turn are made with it.
    fn column(&mut self, index: usize, next: impl FnOnce() -> Vec<usize>) -> &[f64] {
        if self.known[index].is_empty() {
            let is_new = |&other: &usize| other != index && self.known[other].is_empty();
            let others = next().into_iter().filter(is_new).take(Self::BLOCK - 1);
            let wanted: Vec<usize> = std::iter::once(index).chain(others).collect();
            for (&index, product) in wanted.iter().zip(self.columns.products(&wanted)) {
                self.known[index] = product;
            }
        }
        &self.known[index]
    }
}

/// `A^T A = L L^T` with the first `n_first` pivots in order and the rest by largest remainder, until that falls below
/// `tolerance` times the largest column: the pivots, and the columns of L.
fn pivoted_cholesky(
    columns: &Columns,
    n_first: usize,
    tolerance: f64,
) -> (Vec<usize>, Vec<Vec<f64>>) {
    let m = columns.len();
    let mut gram = Gram::new(columns);
    let mut remainder = columns.squares();
    let largest = remainder.iter().fold(0.0f64, |a, &b| a.max(b));
    let mut lower: Vec<Vec<f64>> = Vec::new();
    let mut pivots = Vec::new();
    for step in 0..m {
        let pivot = if step < n_first {
            step
        } else {
            let next = (n_first..m).max_by(|&a, &b| remainder[a].total_cmp(&remainder[b]));
            match next {
                Some(next) if remainder[next] > tolerance.powi(2) * largest => next,
                _ => break,
            }
        };
        // A first-order column that depends on earlier ones adds nothing.
        if remainder[pivot] <= 1e-14 * largest {
            if step < n_first {
                continue;
            }
            break;
        }
        let root = remainder[pivot].sqrt();
        let in_turn = || match step < n_first {
            true => (step..n_first).collect(),
            false => by_size(&remainder),
        };
        let mut row = gram.column(pivot, in_turn).to_vec();
        for previous in &lower {
            let factor = previous[pivot];
            row.iter_mut().zip(previous).for_each(|(r, p)| *r -= factor * p);
        }
        for (i, r) in row.iter_mut().enumerate() {
            *r /= root;
            remainder[i] = (remainder[i] - *r * *r).max(0.0);
        }
        for &earlier in &pivots {
            row[earlier] = 0.0;
        }
        remainder[pivot] = 0.0;
        pivots.push(pivot);
        lower.push(row);
    }
    (pivots, lower)
}

/// Indices by falling value.
fn by_size(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order
}
