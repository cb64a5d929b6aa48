//! The graph whose nodes are the blocks of a matrix.

use super::Pattern;

/// No node.
pub(super) const NONE: u32 = u32::MAX;

/// Who neighbours whom among the blocks of a matrix, from both triangles, without the diagonal, ascending. A block is a
/// run of rows with the same entries, such as the three of a node: they fill in alike, so they are ordered as one.
pub(super) struct Graph {
    /// Number of blocks.
    pub n: usize,
    pub start: Vec<u32>,
    pub neighbour: Vec<u32>,
    /// First row of each block, and the end of the last.
    pub first_row: Vec<u32>,
}

impl Graph {
    pub fn new(pattern: &Pattern) -> Self {
        let first_row = blocks(pattern);
        let n = first_row.len() - 1;
        let mut block_of = vec![NONE; pattern.n];
        first_row[..n].iter().enumerate().for_each(|(b, &row)| block_of[row as usize] = b as u32);
        // Between first rows there is an entry if and only if there is one between their blocks.
        let off_diagonal = |block: usize| {
            let entries = pattern.column(first_row[block] as usize);
            let rows = &pattern.row[entries.start..entries.end - 1];
            let blocks = rows.iter().map(|&row| block_of[row as usize]);
            blocks.filter(|&block| block != NONE).map(|block| block as usize)
        };
        let mut start = vec![0u32; n + 1];
        for block in 0..n {
            for other in off_diagonal(block) {
                start[other + 1] += 1;
                start[block + 1] += 1;
            }
        }
        for block in 0..n {
            start[block + 1] += start[block];
        }
        let mut next = start.clone();
        let mut neighbour = vec![0u32; start[n] as usize];
        let mut append = |block: usize, other: usize| {
            neighbour[next[block] as usize] = other as u32;
            next[block] += 1;
        };
        // Block by block, each receives first its smaller neighbours, then the greater ones in order.
        for block in 0..n {
            for other in off_diagonal(block) {
                append(block, other);
                append(other, block);
            }
        }
        Self { n, start, neighbour, first_row }
    }

    pub fn neighbours(&self, block: u32) -> impl Iterator<Item = usize> + '_ {
        let block = block as usize;
        let entries = self.start[block] as usize..self.start[block + 1] as usize;
        self.neighbour[entries].iter().map(|&other| other as usize)
    }

    /// Number of rows of a block.
    pub fn size(&self, block: u32) -> u32 {
        self.first_row[block as usize + 1] - self.first_row[block as usize]
    }

    /// The rows of these blocks.
    pub fn rows_of(&self, blocks: &[u32]) -> Vec<u32> {
        let rows =
            |&block: &u32| self.first_row[block as usize]..self.first_row[block as usize + 1];
        blocks.iter().flat_map(rows).collect()
    }
}

/// First row of each run of rows that have entries in the same columns, and the number of rows.
fn blocks(pattern: &Pattern) -> Vec<u32> {
    // Sums of a number for each neighbour and the row itself: equal where the entries are, and almost surely only there.
    let mut sum = vec![0u64; pattern.n];
    for column in 0..pattern.n {
        for entry in pattern.column(column) {
            let row = pattern.row[entry] as usize;
            sum[column] = sum[column].wrapping_add(scattered(row));
            if row != column {
                sum[row] = sum[row].wrapping_add(scattered(column));
            }
        }
    }
    let starts = (0..pattern.n).filter(|&row| row == 0 || sum[row] != sum[row - 1]);
    starts.chain([pattern.n]).map(|row| row as u32).collect()
}

/// A number that looks random (the finaliser of SplitMix64: Steele, Lea, Flood 2014).
fn scattered(row: usize) -> u64 {
    let mut z = (row as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
