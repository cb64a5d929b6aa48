//! Products with a symmetric block matrix, whose upper triangle is stored: each block is read once for both triangles. In
//! double precision that is as quick as a matrix in single precision that keeps them both.
//!
//! Threads share the columns in stretches. What a stretch adds to rows before its own is summed up apart, and added stretch
//! by stretch, so that the product does not depend on the number of threads.

use crate::simd::{Kernel, dispatch};
use crate::threads::{self, share};
use rayon::prelude::*;

/// Blocks of a stretch, at least: some tens of microseconds.
const SHORTEST: usize = 8_192;

/// Most stretches.
const MOST: usize = 64;

/// The upper triangle of a pattern of blocks, in compressed columns: rows ascend, the diagonal comes last.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    pub start: &'a [u32],
    pub row: &'a [u32],
}

/// Columns that a thread takes at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    start: usize,
    end: usize,
    /// From here on they have no block in a row before `start`.
    coupled: usize,
    /// The first row in which they have a block.
    lowest: usize,
}

impl Stretch {
    /// Rows before its own to which it adds.
    fn n_before(self) -> usize {
        self.start - self.lowest
    }
}

/// The columns in as many stretches as serve: all in one where threads would gain nothing, or where neighbours are numbered
/// so far apart that stretches would add to more rows than there are.
pub(super) fn stretches(columns: Columns<'_>) -> Vec<Stretch> {
    let n = columns.start.len() - 1;
    let mut count = (columns.row.len() / SHORTEST).min(MOST);
    while count >= threads::FEWEST {
        let cut = cut(count, columns);
        let beside: usize = cut.iter().map(|stretch| stretch.n_before()).sum();
        if beside <= n {
            return cut;
        }
        count /= 2;
    }
    vec![Stretch { start: 0, end: n, coupled: 0, lowest: 0 }]
}

fn cut(count: usize, Columns { start: starts, row }: Columns<'_>) -> Vec<Stretch> {
    let end = |k: usize| starts.partition_point(|&at| (at as usize) < k * row.len() / count);
    let stretch = |k: usize| {
        let (start, end) = (end(k), end(k + 1).min(starts.len() - 1));
        let first = |column: usize| row[starts[column] as usize] as usize;
        let coupled = (start..end).rev().find(|&column| first(column) < start);
        Stretch {
            start,
            end,
            coupled: coupled.map_or(start, |column| column + 1),
            lowest: (start..end).map(first).min().unwrap_or(start),
        }
    };
    (0..count).map(stretch).collect()
}

/// A matrix on these columns, with the entries `[i][k]` of its blocks.
#[derive(Clone, Copy)]
pub(super) struct Upper<'a> {
    pub columns: Columns<'a>,
    pub blocks: &'a [[f64; 9]],
}

impl Upper<'_> {
    /// `y = A x`, in [`stretches`] of its columns.
    pub fn multiply(self, stretches: &[Stretch], x: &[f64], y: &mut [f64]) {
        let (x, _) = x.as_chunks::<3>();
        let (y, _) = y.as_chunks_mut::<3>();
        if share(stretches.len()) {
            self.multiply_by_threads(stretches, x, y);
        } else {
            self.multiply_by_one(stretches, x, y);
        }
    }

    fn multiply_by_one(self, stretches: &[Stretch], x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        let mut before = Vec::new();
        for &stretch in stretches {
            before.clear();
            before.resize(stretch.n_before(), [0.0; 3]);
            let (done, rest) = y.split_at_mut(stretch.start);
            let own = &mut rest[..stretch.end - stretch.start];
            dispatch(Product { matrix: self, x, stretch, own, before: &mut before });
            add(&mut done[stretch.lowest..], &before);
        }
    }

    fn multiply_by_threads(self, stretches: &[Stretch], x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        let mut rest = &mut *y;
        let with_own = |&stretch: &Stretch| {
            let (own, next) = std::mem::take(&mut rest).split_at_mut(stretch.end - stretch.start);
            rest = next;
            (stretch, own)
        };
        let parts: Vec<_> = stretches.iter().map(with_own).collect();
        let of_part = |(stretch, own): (Stretch, &mut [[f64; 3]])| {
            let mut before = vec![[0.0; 3]; stretch.n_before()];
            dispatch(Product { matrix: self, x, stretch, own, before: &mut before });
            (stretch.lowest, before)
        };
        let sums: Vec<_> = parts.into_par_iter().map(of_part).collect();
        sums.iter().for_each(|(lowest, before)| add(&mut y[*lowest..], before));
    }
}

fn add(y: &mut [[f64; 3]], sums: &[[f64; 3]]) {
    let rows = y.as_flattened_mut().iter_mut().zip(sums.as_flattened());
    rows.for_each(|(y, sum)| *y += sum);
}

/// What a stretch adds to its own rows, and to those before.
struct Product<'a> {
    matrix: Upper<'a>,
    x: &'a [[f64; 3]],
    stretch: Stretch,
    own: &'a mut [[f64; 3]],
    before: &'a mut [[f64; 3]],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Product { matrix, x, stretch, own, before } = self;
        let Upper { columns: Columns { start: starts, row }, blocks } = matrix;
        let Stretch { start, end, coupled, lowest } = stretch;
        own.fill([0.0; 3]);
        let column = |ends: &[u32], own: [f64; 3]| {
            let places = ends[0] as usize..ends[1] as usize;
            Column { blocks: &blocks[places.clone()], rows: &row[places], own }
        };
        for (number, ends) in (start..coupled).zip(starts[start..].windows(2)) {
            let (other, rest) = column(ends, x[number]).split(start);
            let apart = other.pass(x, before, lowest);
            let sum = rest.pass_to_diagonal(x, own, start);
            (0..3).for_each(|i| own[number - start][i] += apart[i] + sum[i]);
        }
        for (number, ends) in (coupled..end).zip(starts[coupled..].windows(2)) {
            let sum = column(ends, x[number]).pass_to_diagonal(x, own, start);
            (0..3).for_each(|i| own[number - start][i] += sum[i]);
        }
    }
}

/// Blocks of a column and their rows, with the column's own entry of `x`.
#[derive(Clone, Copy)]
struct Column<'a> {
    blocks: &'a [[f64; 9]],
    rows: &'a [u32],
    own: [f64; 3],
}

impl Column<'_> {
    /// Those of the rows before one, and the others.
    #[inline(always)]
    fn split(self, row: usize) -> (Self, Self) {
        let at = self.rows.partition_point(|&other| (other as usize) < row);
        let (blocks, rows) = (self.blocks.split_at(at), self.rows.split_at(at));
        (
            Column { blocks: blocks.0, rows: rows.0, ..self },
            Column { blocks: blocks.1, rows: rows.1, ..self },
        )
    }

    /// Adds the products of the blocks with the column's entry to `y`, which begins at the row `first`; the sum of those of
    /// the transposed blocks.
    #[inline(always)]
    fn pass(self, x: &[[f64; 3]], y: &mut [[f64; 3]], first: usize) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (block, &row) in self.blocks.iter().zip(self.rows) {
            let (other, out) = (x[row as usize], &mut y[row as usize - first]);
            let product = times(block, self.own);
            for i in 0..3 {
                out[i] += product[i];
                let products = block[i] * other[0] + block[3 + i] * other[1];
                sum[i] += products + block[6 + i] * other[2];
            }
        }
        sum
    }

    /// The same where the last block is that of the diagonal, which counts once.
    #[inline(always)]
    fn pass_to_diagonal(self, x: &[[f64; 3]], y: &mut [[f64; 3]], first: usize) -> [f64; 3] {
        let last = self.rows.len() - 1;
        let above = Column { blocks: &self.blocks[..last], rows: &self.rows[..last], ..self };
        let sum = above.pass(x, y, first);
        let diagonal = times(&self.blocks[last], self.own);
        std::array::from_fn(|i| sum[i] + diagonal[i])
    }
}

/// `A x` of a block.
#[inline(always)]
fn times(block: &[f64; 9], x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let products = block[3 * i] * x[0] + block[3 * i + 1] * x[1];
        products + block[3 * i + 2] * x[2]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples::noise;

    const N: usize = 9_000;

    /// Columns whose nodes are coupled to those so far before them.
    fn coupled(distances: &[usize]) -> (Vec<u32>, Vec<u32>) {
        let (mut start, mut row) = (vec![0], Vec::new());
        for column in 0..N {
            row.extend(distances.iter().filter_map(|&far| Some(column.checked_sub(far)? as u32)));
            start.push(row.len() as u32);
        }
        (start, row)
    }

    /// Block by block, without stretches.
    fn plain(matrix: Upper<'_>, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        let Upper { columns: Columns { start, row }, blocks } = matrix;
        for column in 0..N {
            for place in start[column] as usize..start[column + 1] as usize {
                let row = row[place] as usize;
                for (i, k) in (0..9).map(|entry| (entry / 3, entry % 3)) {
                    y[3 * row + i] += blocks[place][3 * i + k] * x[3 * column + k];
                    if row != column {
                        y[3 * column + k] += blocks[place][3 * i + k] * x[3 * row + i];
                    }
                }
            }
        }
        y
    }

    #[test]
    fn stretches_add_up_to_the_product_on_any_number_of_threads() {
        let (start, row) = coupled(&[700, 300, 90, 41, 40, 7, 6, 1, 0]);
        let values = noise(9 * row.len(), 1);
        let columns = Columns { start: &start, row: &row };
        let matrix = Upper { columns, blocks: values.as_chunks().0 };
        let stretches = stretches(columns);
        assert!(stretches.len() >= threads::FEWEST);
        assert!(stretches.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!((stretches[0].start, stretches[stretches.len() - 1].end), (0, N));
        let x = noise(3 * N, 2);
        let [one, two, three] = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut y = vec![f64::NAN; 3 * N];
            pool.install(|| matrix.multiply(&stretches, &x, &mut y));
            y
        });
        assert!(one == two && one == three);
        let differences = one.iter().zip(plain(matrix, &x)).map(|(a, b)| (a - b).abs());
        assert!(differences.fold(0.0, f64::max) < 1e-13);
    }

    #[test]
    fn nodes_numbered_far_from_their_neighbours_make_one_stretch() {
        let (start, row) = coupled(&[N / 2, 4_000, 3_900, 41, 40, 7, 6, 1, 0]);
        assert_eq!(stretches(Columns { start: &start, row: &row }).len(), 1);
    }
}
