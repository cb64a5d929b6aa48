//! Where an organ is fixed on its surface.

use viscera_mesh::{norm, sub};

/// The places of fixed nodes, sorted along the axis on which they lie farthest apart: a sphere looks at those beside it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Supports {
    places: Vec<[f64; 3]>,
    axis: usize,
}

impl Supports {
    pub fn new(mut places: Vec<[f64; 3]>) -> Self {
        let extent = |axis: usize| {
            let along = || places.iter().map(|place| place[axis]);
            along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
        };
        let longest = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b)));
        let axis = longest.unwrap_or_default();
        places.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        Supports { places, axis }
    }

    /// Whether one of them lies within a sphere.
    pub fn any_within(&self, center: [f64; 3], radius: f64) -> bool {
        let axis = self.axis;
        let first = self.places.partition_point(|place| place[axis] <= center[axis] - radius);
        let beside = self.places[first..].iter();
        let mut beside = beside.take_while(|place| place[axis] < center[axis] + radius);
        beside.any(|&place| norm(sub(place, center)) < radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_finds_what_lies_within_it() {
        let at = |k: usize| [0.3 * (k as f64).sin(), 0.1 * (2.0 * k as f64).cos(), 0.02 * k as f64];
        let places: Vec<[f64; 3]> = (0..50).map(|k| at(k * 7 % 50)).collect();
        let supports = Supports::new(places.clone());
        let mut found = 0;
        for k in 0..200 {
            let center = [0.3 * (k as f64).cos(), 0.05, 0.006 * k as f64 - 0.1];
            let exact = places.iter().any(|&place| norm(sub(place, center)) < 0.12);
            assert_eq!(supports.any_within(center, 0.12), exact, "{k}");
            found += usize::from(exact);
        }
        assert!((20..180).contains(&found), "{found}");
        assert!(!Supports::new(Vec::new()).any_within([0.0; 3], 1.0));
    }
}
