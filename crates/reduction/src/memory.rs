//! How much is solved at a time: the fields of a region, and what the blocks of positions take that are being expanded, must
//! stay within a bound.

use crate::number::{Monomials, WIDTH};

/// What runs at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AtOnce {
    pub regions: usize,
    /// Blocks of positions in each.
    pub blocks: usize,
}

impl AtOnce {
    /// The most regions whose blocks keep all threads busy; where memory is too small for that, what keeps the most busy. At
    /// least one region and one block. `fields` is the number of fields of the largest of so many
    /// `regions`.
    pub fn within(
        memory: usize,
        n_dofs: usize,
        (regions, fields): (usize, usize),
        order: usize,
        threads: usize,
    ) -> Self {
        let bytes = size_of::<f64>() * n_dofs;
        let table = Monomials::of(3, order);
        // Coefficients, then the nonlinear forces and the columns of the highest order, or the fields that are kept.
        let top = table.of_degree(order).len();
        let block = bytes * WIDTH * (table.len() + (2 * top).max(table.len()));
        let of = |regions: usize| {
            let left = memory.saturating_sub(regions * bytes * fields) / (regions * block);
            AtOnce { regions, blocks: left.min(threads.div_ceil(regions)) }
        };
        let busy = |at: &AtOnce| (at.regions * at.blocks).min(threads);
        let most = (1..=threads.min(regions)).map(of).max_by_key(|at| (busy(at), at.regions));
        most.filter(|at| at.blocks > 0).unwrap_or(AtOnce { regions: 1, blocks: 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_runs_at_a_time_fits() {
        const MEMORY: usize = 1_200_000_000;
        let within =
            |n_dofs: usize, threads| AtOnce::within(MEMORY, n_dofs, (100, 2_300), 5, threads);
        let alone = AtOnce::within(MEMORY, 7_800, (1, 2_300), 5, 8);
        assert_eq!(alone, AtOnce { regions: 1, blocks: 8 }, "a region alone has all threads");
        assert_eq!(within(7_800, 2), AtOnce { regions: 2, blocks: 1 });
        assert_eq!(within(7_800, 8), AtOnce { regions: 4, blocks: 2 }, "regions share the threads");
        assert_eq!(within(7_800, 64), AtOnce { regions: 1, blocks: 18 });
        assert_eq!(within(42_000, 2), AtOnce { regions: 1, blocks: 1 });
        assert_eq!(within(42_000, 64), AtOnce { regions: 1, blocks: 1 });
        assert_eq!(within(1_000_000, 8), AtOnce { regions: 1, blocks: 1 }, "at least one");
        for (n_dofs, threads) in [(3_000, 1), (7_800, 64), (20_000, 16), (42_000, 64)] {
            let AtOnce { regions, blocks } = within(n_dofs, threads);
            let block = 8 * n_dofs * WIDTH * 2 * 56;
            assert!(regions * (8 * n_dofs * 2_300 + blocks * block) <= MEMORY, "{n_dofs}");
        }
    }
}
