//! Prolongations smoothed by a step of Jacobi's method. Threads share the nodes by the parts of the level.

use super::blocks::Smoother;
use super::columns::Columns;
use super::parts::{Part, Turn, apart};
use super::prolongation::{Modal, Prolongation, Reach};
use crate::threads::each;
use std::ops::Range;
use viscera_number::simd::{Kernel, dispatch};

impl<const B: usize> Prolongation<B> {
    /// `P = (1 - omega D⁻¹ A) Q`, with the matrix that the smoother has.
    pub fn smooth<const W: usize>(&mut self, smoother: &Smoother<B, W>, omega: f32) {
        let Prolongation { aggregate, tentative, pattern, blocks, .. } = self;
        let (aggregate, tentative, pattern) = (&aggregate[..], &tentative[..], &*pattern);
        let Smoother { parts, order, blocks: matrix, inverses, .. } = smoother;
        blocks.fill([Modal::default(); B]);
        for turn in [Turn::Even, Turn::Odd] {
            let windows = parts.of(turn).map(|part| pattern.places(part.window.clone()));
            let of_part = |(out, part): (_, &Part)| {
                let (columns, nodes) = (&*order.columns, part.nodes.clone());
                let first = pattern.places(part.window.clone()).start;
                Products { columns, matrix, aggregate, tentative, pattern, nodes, first, out }
            };
            let tasks = apart(blocks, windows).into_iter().zip(parts.of(turn)).map(of_part);
            each(tasks.collect(), dispatch);
        }
        let places = parts.all().iter().map(|part| pattern.places(part.nodes.clone()));
        let of_part = |(out, part): (_, &Part)| {
            let nodes = part.nodes.clone();
            Step { inverses, omega, aggregate, tentative, pattern, nodes, out }
        };
        let tasks = apart(blocks, places).into_iter().zip(parts.all()).map(of_part);
        each(tasks.collect(), dispatch);
    }
}

/// `A Q`, with what the blocks of some nodes' columns add to it; `out` begins at the place `first`.
struct Products<'a, const B: usize, const W: usize> {
    columns: &'a Columns,
    matrix: &'a [[[f32; W]; B]],
    aggregate: &'a [u32],
    tentative: &'a [[Modal; B]],
    pattern: &'a Reach,
    nodes: Range<usize>,
    first: usize,
    out: &'a mut [[Modal; B]],
}

impl<const B: usize, const W: usize> Kernel for Products<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Products { columns, matrix, aggregate, tentative, pattern, nodes, first, out } = self;
        for node in nodes {
            let own = &tentative[node];
            for (&row, block) in columns.rows(node).iter().zip(&matrix[columns.column(node)]) {
                let row = row as usize;
                let to = &mut out[pattern.place(row, aggregate[node]) - first];
                add_product(|i, k| block[k][i], own, to);
                if row != node {
                    let to = &mut out[pattern.place(node, aggregate[row]) - first];
                    add_product(|i, k| block[i][k], &tentative[row], to);
                }
            }
        }
    }
}

/// `out <- Q - omega D⁻¹ out` at some nodes.
struct Step<'a, const B: usize, const W: usize> {
    inverses: &'a [[[f32; W]; B]],
    omega: f32,
    aggregate: &'a [u32],
    tentative: &'a [[Modal; B]],
    pattern: &'a Reach,
    nodes: Range<usize>,
    out: &'a mut [[Modal; B]],
}

impl<const B: usize, const W: usize> Kernel for Step<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Step { inverses, omega, aggregate, tentative, pattern, nodes, out } = self;
        let first = pattern.places(nodes.clone()).start;
        for node in nodes {
            let inverse = &inverses[node];
            let places = pattern.places(node..node + 1);
            for block in &mut out[places.start - first..places.end - first] {
                let product = *block;
                *block = [Modal::default(); B];
                add_product(|i, k| -omega * inverse[k][i], &product, block);
            }
            let own = &mut out[pattern.place(node, aggregate[node]) - first];
            for (row, tentative) in own.iter_mut().zip(&tentative[node]) {
                (0..8).for_each(|m| row[m] += tentative[m]);
            }
        }
    }
}

/// `out += a b`, by rows.
#[inline(always)]
fn add_product<const B: usize>(
    a: impl Fn(usize, usize) -> f32,
    b: &[Modal; B],
    out: &mut [Modal; B],
) {
    for i in 0..B {
        let mut row = out[i];
        for k in 0..B {
            let factor = a(i, k);
            (0..8).for_each(|m| row[m] += factor * b[k][m]);
        }
        out[i] = row;
    }
}
