//! Which cells a node has.

/// The cells of each node.
pub struct Stars {
    first: Vec<u32>,
    cells: Vec<u32>,
}

impl Stars {
    pub fn new<'c>(n_points: usize, cells: impl Iterator<Item = &'c [u32; 4]> + Clone) -> Self {
        let mut first = vec![0; n_points + 1];
        for &i in cells.clone().flatten() {
            first[i as usize + 1] += 1;
        }
        for i in 0..n_points {
            first[i + 1] += first[i];
        }
        let mut next = first.clone();
        let mut listed = vec![0; first[n_points] as usize];
        for (c, cell) in cells.enumerate() {
            for &i in cell {
                listed[next[i as usize] as usize] = c as u32;
                next[i as usize] += 1;
            }
        }
        Stars { first, cells: listed }
    }

    pub fn of(&self, node: u32) -> &[u32] {
        &self.cells[self.first[node as usize] as usize..self.first[node as usize + 1] as usize]
    }
}
