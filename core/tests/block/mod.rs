//! The reduced model that the tests of allocations touch.

use viscera_core::body::Body;
use viscera_core::law::Material;
use viscera_core::mesh::{Surface, samples, surface};
use viscera_core::reduced::{Notes, ReducedModel, Reduction};

/// Lengths of its edges [m].
pub const SIZE: [f64; 3] = [0.04, 0.03, 0.03];

/// A block held at the bottom and touched at the top.
pub fn block() -> ReducedModel {
    let (points, cells) = samples::block([4, 3, 3], SIZE);
    let at = |z: f64| -> Vec<u32> {
        (0..points.len() as u32).filter(|&n| (points[n as usize][2] - z).abs() < 1e-12).collect()
    };
    let (fixed, touchable) = (at(0.0), at(SIZE[2]));
    let law = Material::new("neo_hookean", vec![vec![3.0e3, 11.0e3]]).unwrap();
    let surface = Surface::new(&points, &surface(&points, &cells));
    let body = Body::new(points, cells, law).unwrap();
    let user = Notes::default();
    let (radius, depth, order, tolerance) = (0.012, 0.004, 3, 1e-3);
    let reduction = Reduction {
        touchable,
        radius,
        depth,
        order,
        tolerance,
        pade: true,
        memory: 1e9,
        preload: Vec::new(),
        device: None,
        user,
    };
    reduction.run(&body, &surface, &fixed, &mut |_| true).unwrap()
}
