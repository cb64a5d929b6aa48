//! The matrix of the next level, `Pᵀ A P`, in double precision.

use super::blocks::Upper;
use super::prolongation::{MODES, Prolongation};
use crate::neighbours::Neighbours;
use viscera_number::simd::{Kernel, dispatch};

/// Values of a block of the next level.
pub(super) const SQUARE: usize = MODES * MODES;

const NONE: u32 = u32::MAX;

/// Where the product has blocks.
pub(super) fn pattern<const B: usize>(p: &Prolongation<B>, neighbours: &Neighbours) -> Upper {
    let n = neighbours.n();
    let mut nodes = vec![Vec::new(); p.n_coarse()];
    for node in 0..n {
        p.row(node).0.iter().for_each(|&aggregate| nodes[aggregate as usize].push(node as u32));
    }
    let (mut seen_node, mut seen) = (vec![NONE; n], vec![NONE; p.n_coarse()]);
    let mut pairs = Vec::new();
    for (column, nodes) in (0u32..).zip(&nodes) {
        let first = pairs.len();
        for &node in nodes {
            for &other in neighbours.of(node as usize).iter().chain([&node]) {
                if std::mem::replace(&mut seen_node[other as usize], column) == column {
                    continue;
                }
                for &row in p.row(other as usize).0.iter().filter(|&&row| row <= column) {
                    if std::mem::replace(&mut seen[row as usize], column) != column {
                        pairs.push((row, column));
                    }
                }
            }
        }
        pairs[first..].sort_unstable();
    }
    Upper::sorted(p.n_coarse(), &pairs)
}

/// Its values, for a matrix with `shift` added to its diagonal.
pub(super) struct Product<'a, const B: usize> {
    pub fine: &'a Upper,
    pub values: &'a [f64],
    pub shift: f64,
    pub prolongation: &'a Prolongation<B>,
    pub coarse: &'a Upper,
    pub out: &'a mut [f64],
}

impl<const B: usize> Product<'_, B> {
    pub fn compute(self) {
        dispatch(self);
    }
}

/// `P_rᵀ A_rc` summed over the blocks of a column, for an aggregate.
type Half<const B: usize> = [[f64; B]; MODES];

impl<const B: usize> Kernel for Product<'_, B> {
    type Output = ();

    /// Column by column, `T += P_rᵀ A_rc P_c` over the blocks above the diagonal, with half the diagonal ones; the
    /// product is `T + Tᵀ`.
    #[inline(always)]
    fn run(self) {
        let Product { fine, values, shift, prolongation: p, coarse, out } = self;
        out.fill(0.0);
        let (out, _) = out.as_chunks_mut::<SQUARE>();
        let mut slot = vec![NONE; p.n_coarse()];
        let mut halves: Vec<(u32, Half<B>)> = Vec::new();
        for column in 0..fine.n() {
            halves.clear();
            for (place, &row) in fine.column(column).zip(fine.rows(column)) {
                let is_diagonal = row as usize == column;
                let mut a: [[f64; B]; B] = std::array::from_fn(|i| {
                    std::array::from_fn(|k| values[B * B * place + B * i + k])
                });
                if is_diagonal {
                    (0..B).for_each(|i| a[i][i] += shift);
                    a.iter_mut().flatten().for_each(|a| *a *= 0.5);
                }
                let (aggregates, blocks) = p.row(row as usize);
                for (&aggregate, block) in aggregates.iter().zip(blocks) {
                    let slot = &mut slot[aggregate as usize];
                    if *slot == NONE {
                        *slot = halves.len() as u32;
                        halves.push((aggregate, [[0.0; B]; MODES]));
                    }
                    let half = &mut halves[*slot as usize].1;
                    for i in 0..B {
                        for m in 0..MODES {
                            let part = f64::from(block[i][m]);
                            (0..B).for_each(|k| half[m][k] += part * a[i][k]);
                        }
                    }
                }
            }
            let (aggregates, blocks) = p.row(column);
            for (&right, block) in aggregates.iter().zip(blocks) {
                let part = block.map(|row| row.map(f64::from));
                for (left, half) in &halves {
                    let mut product = [[0.0f64; 8]; MODES];
                    for i in 0..MODES {
                        for b in 0..B {
                            (0..8).for_each(|k| product[i][k] += half[i][b] * part[b][k]);
                        }
                    }
                    let out = &mut out[coarse.place(right.min(*left), right.max(*left))];
                    if *left <= right {
                        for i in 0..MODES {
                            (0..MODES).for_each(|k| out[MODES * i + k] += product[i][k]);
                        }
                    }
                    if *left >= right {
                        for i in 0..MODES {
                            (0..MODES).for_each(|k| out[MODES * k + i] += product[i][k]);
                        }
                    }
                }
            }
            halves.iter().for_each(|(aggregate, _)| slot[*aggregate as usize] = NONE);
        }
    }
}
