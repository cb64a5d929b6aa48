//! The triangles around each point of a surface.

/// Lists of triangles, one after the other.
#[derive(Clone, Debug)]
pub(super) struct Around {
    /// Where the list of each point starts, and where the last one ends.
    start: Vec<u32>,
    triangles: Vec<u32>,
}

impl Around {
    /// Of so many points; `triangles` are their indices.
    pub fn new(points: usize, triangles: &[[u32; 3]]) -> Self {
        let mut start = vec![0u32; points + 1];
        triangles.iter().flatten().for_each(|&p| start[p as usize + 1] += 1);
        (0..points).for_each(|p| start[p + 1] += start[p]);
        let (mut next, mut around) = (start.clone(), vec![0u32; 3 * triangles.len()]);
        for (t, corners) in triangles.iter().enumerate() {
            for p in corners.map(|p| p as usize) {
                around[next[p] as usize] = t as u32;
                next[p] += 1;
            }
        }
        Around { start, triangles: around }
    }

    /// Those around a point.
    pub fn of(&self, point: u32) -> &[u32] {
        let p = point as usize;
        &self.triangles[self.start[p] as usize..self.start[p + 1] as usize]
    }
}
