//! Layout of the blocks of a symmetric matrix on the device. Rows are ordered so that neighbours are close. 32 rows are
//! a slice, which neighbouring threads read together. Slices form chunks, whose buffers fit into one binding each.

use crate::Error;
use std::collections::VecDeque;
use std::ops::Range;

/// Rows of a slice.
pub(crate) const SLICE: usize = 32;

/// Window of rows within which rows of equal length are sorted together.
const WINDOW: usize = 8 * SLICE;

/// Numbers that the evaluation of a cell returns: ten blocks, and forces on four corners.
pub(crate) const OF_CELL: usize = 102;

/// A place without a block.
pub(crate) const PADDING: u32 = u32::MAX;

/// The layout of a matrix.
pub(crate) struct Layout {
    /// Row of each node.
    pub row_of: Vec<u32>,
    /// Node of each row.
    pub node_of: Vec<u32>,
    pub chunks: Vec<Chunk>,
}

/// A chunk: consecutive rows with buffers of their own.
pub(crate) struct Chunk {
    pub rows: Range<usize>,
    /// Where the blocks of each slice start; the last entry is the end of all.
    pub starts: Vec<u32>,
    /// Column of each place; the row's own number in a place without a block.
    pub columns: Vec<u32>,
    /// For each place, twice the number of its block in the upper triangle, plus one if it is transposed.
    pub source: Vec<u32>,
    /// Place of the first entry of each row's diagonal block.
    pub diagonal: Vec<u32>,
    /// Cells that touch the rows, ascending.
    pub cells: Vec<u32>,
}

impl Layout {
    /// Lays out the matrix whose upper triangle has blocks at `pairs`, which include the diagonal. `cells` are those
    /// whose responses a chunk must hold, and `products` the number of cluster products of each row; both may be empty.
    pub fn new(
        n_nodes: usize,
        pairs: &[(u32, u32)],
        cells: &[[u32; 4]],
        products: &[u32],
        largest_binding: u64,
    ) -> Result<Self, Error> {
        let rows = neighbours(n_nodes, pairs)?;
        let order = ordered(&rows);
        let mut row_of = vec![0u32; n_nodes];
        (0u32..).zip(&order).for_each(|(row, &node)| row_of[node as usize] = row);
        let touching = touching(n_nodes, cells);
        let mut chunks = Vec::new();
        let mut first = 0;
        while first < n_nodes {
            let of_cells = (&touching[..], cells.len());
            let end = end_of_chunk(first, &order, &rows, of_cells, products, largest_binding)?;
            chunks.push(Chunk::new(first..end, &order, &row_of, &rows, &touching));
            first = end;
        }
        Ok(Layout { row_of, node_of: order, chunks })
    }

    /// Number of the block of the upper triangle that couples two nodes; none if the pattern has none.
    pub fn block(&self, node: u32, other: u32) -> Option<usize> {
        let row = *self.row_of.get(node as usize)?;
        let column = *self.row_of.get(other as usize)?;
        let chunk = self.chunks.iter().find(|chunk| chunk.rows.contains(&(row as usize)))?;
        Some(chunk.source[chunk.place(row, column).ok()?] as usize / 2)
    }

    pub fn n_rows(&self) -> usize {
        self.row_of.len()
    }

    /// Number of places, with padding.
    pub fn n_places(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.columns.len()).sum()
    }
}

/// For every row its columns, ascending, each with the block that it comes from.
fn neighbours(n_nodes: usize, pairs: &[(u32, u32)]) -> Result<Vec<Vec<(u32, u32)>>, Error> {
    let mut rows: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n_nodes];
    for (block, &(row, column)) in (0u32..).zip(pairs) {
        if row > column || column as usize >= n_nodes {
            return Err(Error::Input(format!(
                "block {block} is at ({row}, {column}); give the upper triangle of {n_nodes} rows"
            )));
        }
        rows[row as usize].push((column, 2 * block));
        if row != column {
            rows[column as usize].push((row, 2 * block + 1));
        }
    }
    rows.iter_mut().for_each(|row| row.sort_unstable());
    match (0u32..).zip(&rows).find(|(node, row)| !row.iter().any(|(column, _)| column == node)) {
        Some((node, _)) => Err(Error::Input(format!("row {node} has no block on the diagonal"))),
        None => Ok(rows),
    }
}

/// The nodes in reverse Cuthill-McKee order (1969): breadth first from nodes with few neighbours. Within a window, rows
/// with most blocks come first, so that slices need little padding.
fn ordered(rows: &[Vec<(u32, u32)>]) -> Vec<u32> {
    let length = |node: u32| rows[node as usize].len();
    let mut seeds: Vec<u32> = (0..rows.len() as u32).collect();
    seeds.sort_by_key(|&node| length(node));
    let mut is_seen = vec![false; rows.len()];
    let (mut order, mut queue) = (Vec::with_capacity(rows.len()), VecDeque::new());
    for seed in seeds {
        if !std::mem::replace(&mut is_seen[seed as usize], true) {
            queue.push_back(seed);
        }
        while let Some(node) = queue.pop_front() {
            order.push(node);
            let mut next: Vec<u32> =
                rows[node as usize].iter().map(|&(column, _)| column).collect();
            next.retain(|&node| !std::mem::replace(&mut is_seen[node as usize], true));
            next.sort_by_key(|&node| length(node));
            queue.extend(next);
        }
    }
    order.reverse();
    order
        .chunks_mut(WINDOW)
        .for_each(|window| window.sort_by_key(|&node| usize::MAX - length(node)));
    order
}

/// Cells at each node.
fn touching(n_nodes: usize, cells: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let mut touching = vec![Vec::new(); n_nodes];
    for (cell, nodes) in (0u32..).zip(cells) {
        nodes.iter().for_each(|&node| touching[node as usize].push(cell));
    }
    touching
}

/// Divides the slices into chunks. The values of a chunk, the responses of its cells and the products of its clusters
/// must each fit into one binding.
fn end_of_chunk(
    first: usize,
    order: &[u32],
    rows: &[Vec<(u32, u32)>],
    (touching, n_cells): (&[Vec<u32>], usize),
    products: &[u32],
    largest_binding: u64,
) -> Result<usize, Error> {
    let (mut is_counted, mut n_counted, mut places) = (vec![false; n_cells], 0usize, 0usize);
    let mut n_products = 0;
    let mut end = first;
    while end < order.len() {
        let slice = &order[end..(end + SLICE).min(order.len())];
        places += SLICE * slice.iter().map(|&n| rows[n as usize].len()).max().unwrap_or(0);
        for &cell in slice.iter().flat_map(|&node| &touching[node as usize]) {
            n_counted += usize::from(!std::mem::replace(&mut is_counted[cell as usize], true));
        }
        let of_row = |&node: &u32| products.get(node as usize).copied().unwrap_or(0) as usize;
        n_products += slice.iter().map(of_row).sum::<usize>();
        let of_cells = (4 * OF_CELL * n_counted).max(64 * n_counted);
        let bytes = (36 * places).max(of_cells).max(8 * n_products) as u64;
        if bytes > largest_binding {
            break;
        }
        end += slice.len();
    }
    if end == first {
        return Err(Error::Limit(format!(
            "not even {SLICE} nodes fit into {largest_binding} bytes, the largest binding of the graphics processor"
        )));
    }
    Ok(end)
}

impl Chunk {
    fn new(
        range: Range<usize>,
        order: &[u32],
        row_of: &[u32],
        rows: &[Vec<(u32, u32)>],
        touching: &[Vec<u32>],
    ) -> Self {
        let nodes = &order[range.clone()];
        let (mut starts, mut columns, mut source) = (vec![0u32], Vec::new(), Vec::new());
        let mut diagonal = Vec::with_capacity(nodes.len());
        for (slice, nodes) in nodes.chunks(SLICE).enumerate() {
            let width = nodes.iter().map(|&n| rows[n as usize].len()).max().unwrap_or(0);
            let (first, own) = (columns.len(), (range.start + slice * SLICE) as u32);
            let last = order.len() as u32 - 1;
            columns.extend((0..width * SLICE).map(|k| (own + (k % SLICE) as u32).min(last)));
            source.resize(columns.len(), PADDING);
            for (lane, &node) in nodes.iter().enumerate() {
                for (k, &(column, block)) in rows[node as usize].iter().enumerate() {
                    let place = first + k * SLICE + lane;
                    columns[place] = row_of[column as usize];
                    source[place] = block;
                    if column == node {
                        diagonal.push((9 * SLICE * (place / SLICE) + lane) as u32);
                    }
                }
            }
            starts.push((columns.len() / SLICE) as u32);
        }
        let mut cells: Vec<u32> =
            nodes.iter().flat_map(|&node| touching[node as usize].iter().copied()).collect();
        cells.sort_unstable();
        cells.dedup();
        Chunk { rows: range, starts, columns, source, diagonal, cells }
    }

    /// Rearranges the values of the upper triangle as kernels read them, with zeros in places without a block.
    pub fn packed<'a>(&self, block: impl Fn(usize) -> Option<&'a [f64; 9]>) -> Vec<f32> {
        let mut packed = vec![0.0f32; 9 * self.source.len()];
        for (place, &source) in self.source.iter().enumerate().filter(|(_, s)| **s != PADDING) {
            let Some(block) = block(source as usize / 2) else { continue };
            let at = 9 * SLICE * (place / SLICE) + place % SLICE;
            for e in 0..9 {
                let entry = if source % 2 == 0 { e } else { 3 * (e % 3) + e / 3 };
                packed[at + SLICE * e] = block[entry] as f32;
            }
        }
        packed
    }

    /// The place of a block.
    ///
    /// # Errors
    /// The pattern has no such block.
    pub fn place(&self, row: u32, column: u32) -> Result<usize, Error> {
        let local = row as usize - self.rows.start;
        let of_slice = self.starts[local / SLICE] as usize..self.starts[local / SLICE + 1] as usize;
        let mut places = of_slice.map(|k| SLICE * k + local % SLICE);
        let found =
            places.find(|&place| self.columns[place] == column && self.source[place] != PADDING);
        found.ok_or_else(|| {
            Error::Input("a cell couples two nodes whose block is not in the pattern".to_string())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(n: u32) -> Vec<(u32, u32)> {
        (0..n).flat_map(|i| [(i, i), (i, (i + 7) % n)]).map(|(a, b)| (a.min(b), a.max(b))).collect()
    }

    #[test]
    fn every_block_stands_in_both_its_rows_once() {
        let pairs = chain(101);
        let layout = Layout::new(101, &pairs, &[], &[], 36 * 32 * 3 * 2).unwrap();
        assert!(layout.chunks.len() > 1);
        let mut node_of = vec![0; 101];
        (0..101).for_each(|node| node_of[layout.row_of[node] as usize] = node as u32);
        let mut count = vec![0; pairs.len()];
        for chunk in &layout.chunks {
            for (place, &source) in chunk.source.iter().enumerate().filter(|(_, s)| **s != PADDING)
            {
                let slice = chunk.starts.partition_point(|&s| (s as usize) * SLICE <= place) - 1;
                let row = node_of[chunk.rows.start + slice * SLICE + place % SLICE];
                let column = node_of[chunk.columns[place] as usize];
                let (a, b) = pairs[source as usize / 2];
                assert_eq!(if source % 2 == 0 { (a, b) } else { (b, a) }, (row, column));
                count[source as usize / 2] += if a == b { 2 } else { 1 };
            }
        }
        assert!(count.iter().all(|&c| c == 2));
    }

    #[test]
    fn a_binding_too_small_for_a_slice_and_pairs_out_of_place_are_refused() {
        let refused =
            |pairs: &[(u32, u32)], bytes| Layout::new(40, pairs, &[], &[], bytes).err().unwrap();
        assert!(refused(&chain(40), 100).to_string().contains("not even 32 nodes"));
        assert!(refused(&[(1, 0)], 1 << 20).to_string().contains("(1, 0)"));
        assert!(refused(&[(0, 0)], 1 << 20).to_string().contains("row 1 has no block"));
    }
}
