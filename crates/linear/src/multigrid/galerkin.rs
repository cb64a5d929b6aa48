//! The matrix of the next level, `Pᵀ A P`, in double precision. Threads share the columns of `A` by stretches, whose
//! products are added one after the other, so that the sums do not depend on the number of threads.

use super::columns::Upper;
use super::prolongation::{MODES, Modal, Prolongation};
use crate::neighbours::Neighbours;
use crate::threads::share;
use rayon::prelude::*;
use std::ops::Range;
use viscera_number::simd::{Kernel, dispatch};
use viscera_number::{Lanes, Wide};

/// Values of a block of the next level.
pub(super) const SQUARE: usize = MODES * MODES;

const NONE: u32 = u32::MAX;

/// Columns of a stretch.
const COLUMNS: usize = 1_024;

/// Stretches whose products are held at once.
const HELD: usize = 16;

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

/// Some columns of the finer matrix, and the blocks of the next level to which their products add, ascending.
pub(super) struct Stretch {
    columns: Range<usize>,
    places: Vec<u32>,
}

/// All columns, stretch by stretch.
pub(super) fn stretches<const B: usize>(
    fine: &Upper,
    p: &Prolongation<B>,
    coarse: &Upper,
) -> Vec<Stretch> {
    stretches_of(COLUMNS, fine, p, coarse)
}

/// The same, of so many columns each.
pub(super) fn stretches_of<const B: usize>(
    length: usize,
    fine: &Upper,
    p: &Prolongation<B>,
    coarse: &Upper,
) -> Vec<Stretch> {
    let mut last_pair = vec![NONE; coarse.len()];
    let of_columns = |first: usize| {
        let (columns, number) = (first..fine.n().min(first + length), (first / length) as u32);
        let mut places = Vec::new();
        let mut left: Vec<u32> = Vec::new();
        for column in columns.clone() {
            left.clear();
            left.extend(fine.rows(column).iter().flat_map(|&row| p.row(row as usize).0));
            left.sort_unstable();
            left.dedup();
            for &right in p.row(column).0 {
                for &left in &left {
                    let place = coarse.place(right.min(left), right.max(left));
                    if std::mem::replace(&mut last_pair[place], number) != number {
                        places.push(place as u32);
                    }
                }
            }
        }
        places.sort_unstable();
        Stretch { columns, places }
    };
    (0..fine.n()).step_by(length).map(of_columns).collect()
}

/// Its values, for a matrix with `shift` added to its diagonal.
#[derive(Clone, Copy)]
pub(super) struct Product<'a, const B: usize> {
    pub fine: &'a Upper,
    pub values: &'a [f64],
    pub shift: f64,
    pub prolongation: &'a Prolongation<B>,
    pub coarse: &'a Upper,
}

/// A block of the next level, by rows, each padded to vector registers.
type Block = [Wide; MODES];

/// `A_rcᵀ P_r` summed over the blocks of a column, for an aggregate, by rows.
type Half<const B: usize> = [Wide; B];

/// What the products of a stretch need, one after the other.
struct Workspace<const B: usize> {
    halves: Vec<(u32, Half<B>)>,
    /// By aggregate: where its half is, if it has one.
    slot: Vec<u32>,
    /// By block: where it is among those of the stretch, if it is one of them.
    local: Vec<u32>,
    sums: Vec<Block>,
}

impl<const B: usize> Product<'_, B> {
    pub fn compute(self, stretches: &[Stretch], out: &mut [f64]) {
        out.fill(0.0);
        let out = out.as_chunks_mut::<SQUARE>().0;
        if !share(stretches.len()) {
            let mut workspace = self.workspace();
            for stretch in stretches {
                self.sum(stretch, &mut workspace);
                stretch.add(&workspace.sums, out);
            }
            return;
        }
        for some in stretches.chunks(HELD) {
            let sums = |workspace: &mut Workspace<B>, stretch: &Stretch| {
                self.sum(stretch, workspace);
                std::mem::take(&mut workspace.sums)
            };
            let sums: Vec<_> = some.par_iter().map_init(|| self.workspace(), sums).collect();
            some.iter().zip(&sums).for_each(|(stretch, sums)| stretch.add(sums, out));
        }
    }

    fn workspace(&self) -> Workspace<B> {
        Workspace {
            halves: Vec::new(),
            slot: vec![NONE; self.prolongation.n_coarse()],
            local: vec![0; self.coarse.len()],
            sums: Vec::new(),
        }
    }

    /// The sums of a stretch, at its blocks.
    fn sum(&self, stretch: &Stretch, workspace: &mut Workspace<B>) {
        for (local, &place) in (0u32..).zip(&stretch.places) {
            workspace.local[place as usize] = local;
        }
        workspace.sums.clear();
        workspace.sums.resize(stretch.places.len(), Block::default());
        dispatch(OfStretch { product: self, columns: stretch.columns.clone(), workspace });
    }
}

impl Stretch {
    fn add(&self, sums: &[Block], out: &mut [[f64; SQUARE]]) {
        for (&place, sum) in self.places.iter().zip(sums) {
            let rows = out[place as usize].chunks_exact_mut(MODES).zip(sum);
            rows.for_each(|(out, sum)| (0..MODES).for_each(|k| out[k] += sum[k]));
        }
    }
}

struct OfStretch<'a, 'p, const B: usize> {
    product: &'a Product<'p, B>,
    columns: Range<usize>,
    workspace: &'a mut Workspace<B>,
}

impl<const B: usize> Kernel for OfStretch<'_, '_, B> {
    type Output = ();

    /// Column by column, `T += P_rᵀ A_rc P_c` over the blocks above the diagonal, with half the diagonal ones; the
    /// product is `T + Tᵀ`.
    #[inline(always)]
    fn run(self) {
        let OfStretch { product, columns, workspace } = self;
        let Product { fine, values, shift, prolongation: p, coarse } = *product;
        let Workspace { halves, slot, local, sums } = workspace;
        for column in columns {
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
                        halves.push((aggregate, [Wide::default(); B]));
                    }
                    add_product(|k, i| a[k][i], &widened(block), &mut halves[*slot as usize].1);
                }
            }
            let (aggregates, blocks) = p.row(column);
            for (&right, block) in aggregates.iter().zip(blocks) {
                let part = widened(block);
                for (left, half) in &*halves {
                    let place = coarse.place(right.min(*left), right.max(*left));
                    let out = &mut sums[local[place] as usize];
                    if *left <= right {
                        add_product(|k, i| half[k][i], &part, out);
                    }
                    if *left >= right {
                        add_product(|k, i| part[k][i], half, out);
                    }
                }
            }
            halves.iter().for_each(|(aggregate, _)| slot[*aggregate as usize] = NONE);
        }
    }
}

/// `out += aᵀ b`, by rows.
#[inline(always)]
fn add_product<const B: usize, const M: usize>(
    a: impl Fn(usize, usize) -> f64,
    b: &[Wide; B],
    out: &mut [Wide; M],
) {
    for i in 0..M {
        let row = (0..B).fold(out[i], |row, k| row + b[k] * a(k, i));
        out[i] = row;
    }
}

#[inline(always)]
fn widened<const B: usize>(block: &[Modal; B]) -> [Wide; B] {
    block.map(|row| Lanes(row.map(f64::from)))
}
