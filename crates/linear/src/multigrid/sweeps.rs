//! Sweeps over a level, part by part: block Gauss-Seidel forward and backward, and a step of Jacobi's method. Gauss-Seidel
//! comes to the parts with even numbers first, then to those with odd ones: `L` and `U` are what lies left and right of the
//! diagonal in that order.

use super::blocks::{Smoother, times};
use super::columns::Columns;
use super::parts::{Part, Turn};
use crate::threads::each;
use std::ops::Range;
use viscera_number::simd::{Kernel, dispatch, prefetch};

/// Columns from which a sweep backward asks for blocks: processors read ahead well upwards only.
const AHEAD: usize = 6;

impl<const B: usize, const W: usize> Smoother<B, W> {
    /// `x = (D + L)⁻¹ b`, and what of `A x` lies right of the diagonal: minus the residual.
    pub fn forward(&mut self, b: &[[f32; W]], x: &mut [[f32; W]]) -> &[[f32; W]] {
        for turn in [Turn::Even, Turn::Odd] {
            self.sweep(turn, b, x, |sweep, part| Forward(sweep, part.nodes.clone()));
        }
        &self.later
    }

    /// `x <- (D + U)⁻¹ (b - L x)`.
    pub fn backward(&mut self, b: &[[f32; W]], x: &mut [[f32; W]]) {
        self.later.fill([0.0; W]);
        for turn in [Turn::Odd, Turn::Even] {
            self.sweep(turn, b, x, |sweep, part| Backward(sweep, part.nodes.clone()));
        }
    }

    /// `y = D⁻¹ A x`.
    pub fn jacobi(&mut self, x: &[[f32; W]], y: &mut [[f32; W]]) {
        let Smoother { parts, inverses, .. } = &*self;
        for turn in [Turn::Even, Turn::Odd] {
            let windows = parts.windows(turn, y).into_iter().zip(parts.of(turn));
            let of_part = |(y, part): (_, &Part)| {
                let (matrix, window) = (self.matrix(), part.window.clone());
                Product {
                    matrix,
                    x: &x[window.clone()],
                    first: window.start,
                    y,
                    nodes: part.nodes.clone(),
                }
            };
            each(windows.map(of_part).collect(), dispatch);
        }
        let of_part = |(y, part): (_, &Part)| Scale { inverses: &inverses[part.nodes.clone()], y };
        each(parts.split(y).into_iter().zip(parts.all()).map(of_part).collect(), dispatch);
    }

    fn sweep<'a, K: Kernel<Output = ()> + Send>(
        &'a mut self,
        turn: Turn,
        b: &'a [[f32; W]],
        x: &'a mut [[f32; W]],
        kernel: impl Fn(Sweep<'a, B, W>, &Part) -> K,
    ) {
        let Smoother { parts, order, blocks, inverses, later, .. } = self;
        let (parts, matrix) = (&*parts, Matrix { columns: &order.columns, blocks });
        let inverses = &*inverses;
        let windows = parts.windows(turn, x).into_iter().zip(parts.windows(turn, later));
        let of_part = |((x, later), part): (_, &'a Part)| {
            let first = part.window.start;
            kernel(Sweep { matrix, inverses, b, first, x, later }, part)
        };
        each(windows.zip(parts.of(turn)).map(of_part).collect(), dispatch);
    }

    fn matrix(&self) -> Matrix<'_, B, W> {
        Matrix { columns: &self.order.columns, blocks: &self.blocks }
    }
}

#[derive(Clone, Copy)]
struct Matrix<'a, const B: usize, const W: usize> {
    columns: &'a Columns,
    blocks: &'a [[[f32; W]; B]],
}

impl<'a, const B: usize, const W: usize> Matrix<'a, B, W> {
    /// Without the diagonal.
    #[inline(always)]
    fn column(self, column: usize) -> Column<'a, B, W> {
        let places = self.columns.column(column);
        let rows = self.columns.rows(column);
        Column { blocks: &self.blocks[places.start..places.end - 1], rows: &rows[..rows.len() - 1] }
    }

    /// Asks for the blocks of a column.
    #[inline(always)]
    fn prefetch(self, column: usize) {
        self.blocks[self.columns.column(column)].iter().for_each(prefetch);
    }

    #[inline(always)]
    fn diagonal(self, column: usize) -> &'a [[f32; W]; B] {
        &self.blocks[self.columns.diagonal(column)]
    }
}

/// Blocks of a column, and their rows.
#[derive(Clone, Copy)]
struct Column<'a, const B: usize, const W: usize> {
    blocks: &'a [[[f32; W]; B]],
    rows: &'a [u32],
}

impl<const B: usize, const W: usize> Column<'_, B, W> {
    /// `sum_r A_rᵀ x_r`; `x` begins at the row `first`.
    #[inline(always)]
    fn gather(self, x: &[[f32; W]], first: usize) -> [f32; W] {
        let mut products = [[0.0f32; W]; B];
        for (block, &row) in self.blocks.iter().zip(self.rows) {
            let x = &x[row as usize - first];
            for k in 0..B {
                (0..W).for_each(|i| products[k][i] += block[k][i] * x[i]);
            }
        }
        let mut sum = [0.0; W];
        for k in 0..B {
            sum[k] = products[k].iter().sum();
        }
        sum
    }

    /// `y_r += A_r x`; `y` begins at the row `first`.
    #[inline(always)]
    fn scatter(self, x: &[f32; W], y: &mut [[f32; W]], first: usize) {
        for (block, &row) in self.blocks.iter().zip(self.rows) {
            let y = &mut y[row as usize - first];
            for k in 0..B {
                (0..W).for_each(|i| y[i] += block[k][i] * x[k]);
            }
        }
    }
}

/// Over a part: `x` and `later` are those of its window, which begins at the node `first`.
struct Sweep<'a, const B: usize, const W: usize> {
    matrix: Matrix<'a, B, W>,
    inverses: &'a [[[f32; W]; B]],
    b: &'a [[f32; W]],
    first: usize,
    x: &'a mut [[f32; W]],
    later: &'a mut [[f32; W]],
}

struct Forward<'a, const B: usize, const W: usize>(Sweep<'a, B, W>, Range<usize>);

impl<const B: usize, const W: usize> Kernel for Forward<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forward(Sweep { matrix, inverses, b, first, x, later }, nodes) = self;
        later[nodes.start - first..nodes.end - first].fill([0.0; W]);
        for node in nodes {
            let column = matrix.column(node);
            let found = times(&inverses[node], &less(&b[node], &column.gather(x, first)));
            x[node - first] = found;
            column.scatter(&found, later, first);
        }
    }
}

struct Backward<'a, const B: usize, const W: usize>(Sweep<'a, B, W>, Range<usize>);

impl<const B: usize, const W: usize> Kernel for Backward<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Backward(Sweep { matrix, inverses, b, first, x, later }, nodes) = self;
        for node in nodes.rev() {
            matrix.prefetch(node.saturating_sub(AHEAD));
            let column = matrix.column(node);
            let rest = less(&less(&b[node], &column.gather(x, first)), &later[node - first]);
            let found = times(&inverses[node], &rest);
            x[node - first] = found;
            column.scatter(&found, later, first);
        }
    }
}

/// `A x` for the nodes of a part, with what they add to those to which a sweep comes earlier.
struct Product<'a, const B: usize, const W: usize> {
    matrix: Matrix<'a, B, W>,
    x: &'a [[f32; W]],
    first: usize,
    y: &'a mut [[f32; W]],
    nodes: Range<usize>,
}

impl<const B: usize, const W: usize> Kernel for Product<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Product { matrix, x, first, y, nodes } = self;
        for node in nodes {
            let (column, own) = (matrix.column(node), x[node - first]);
            let (left, diagonal) = (column.gather(x, first), times(matrix.diagonal(node), &own));
            // Nothing has been added to its row yet.
            y[node - first] = std::array::from_fn(|i| left[i] + diagonal[i]);
            column.scatter(&own, y, first);
        }
    }
}

/// `y <- D⁻¹ y`.
struct Scale<'a, const B: usize, const W: usize> {
    inverses: &'a [[[f32; W]; B]],
    y: &'a mut [[f32; W]],
}

impl<const B: usize, const W: usize> Kernel for Scale<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (y, inverse) in self.y.iter_mut().zip(self.inverses) {
            *y = times(inverse, y);
        }
    }
}

#[inline(always)]
fn less<const W: usize>(a: &[f32; W], b: &[f32; W]) -> [f32; W] {
    std::array::from_fn(|i| a[i] - b[i])
}
