//! A vector at points of a surface of triangles, carried along with it: what samples leave to those that follow them.

/// Vectors at points of triangles.
#[derive(Default)]
pub(super) struct Carried {
    /// Triangle, barycentric weights of the point, and vector; ascending by triangle.
    entries: Vec<(u32, [f64; 3], [f64; 3])>,
}

impl Carried {
    pub fn new(entries: impl Iterator<Item = (u32, [f64; 3], [f64; 3])>) -> Self {
        let mut entries: Vec<_> = entries.collect();
        entries.sort_by_key(|&(triangle, ..)| triangle);
        Carried { entries }
    }

    /// The vector at the nearest of the points of a triangle; none if it has no point. A mean of several would creep: it
    /// changes with every step even where the points stay.
    pub fn nearest(&self, triangle: u32, weights: [f64; 3]) -> Option<[f64; 3]> {
        let first = self.entries.partition_point(|entry| entry.0 < triangle);
        let own = self.entries[first..].iter().take_while(|entry| entry.0 == triangle);
        let distance =
            |other: [f64; 3]| (0..3).map(|i| (weights[i] - other[i]).powi(2)).sum::<f64>();
        let nearest = own.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
        nearest.map(|&(.., vector)| vector)
    }
}
