//! The on-line evaluator allocates nothing.

mod block;
mod counting;

use block::{SIZE, block};
use counting::allocations;
use viscera_core::mesh::samples;

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| 1 + 1).0, 0);
    let (count, mut list) = allocations(|| Vec::<u64>::with_capacity(8));
    assert_eq!(count, 1);
    assert_eq!(allocations(|| list.reserve_exact(1000)).0, 1);
}

#[test]
fn a_touch_allocates_nothing() {
    let model = block();
    let mut workspace = vec![0.0; model.workspace_len()];
    let mut surface = vec![0.0; 3 * model.arrays().surface_nodes.len()];
    let mut interior = vec![0.0; 3 * model.interior_nodes().len()];
    let mut largest: f32 = 0.0;
    for random in samples::noise(600, 1).chunks_exact(6) {
        let point = std::array::from_fn(|i| SIZE[i] * (0.5 + random[i]));
        let d = std::array::from_fn(|i| 0.006 * random[3 + i]);
        let (count, _) = allocations(|| {
            let contact = model.locate(point).expect("the point is finite");
            let response = model.respond(&contact, d);
            model.surface_displacement(&contact, d, &mut workspace, &mut surface);
            model.interior_displacement(&contact, d, &mut workspace, &mut interior);
            response
        });
        assert_eq!(count, 0);
        largest = surface.iter().fold(largest, |max, u| max.max(u.abs()));
    }
    assert!(largest > 1e-3, "the touches moved something: {largest} m");
}
