//! Places inside move as the whole organ does.

use super::*;

/// The displacement of places under a touch.
fn moved(model: &ReducedModel, mut places: Places, contact: &Contact, d: [f64; 3]) -> Vec<f64> {
    let mut out = vec![[f64::NAN; 3]; places.len()];
    model.move_places(&mut places, contact, d, &mut out);
    out.concat()
}

#[test]
fn nodes_and_points_in_cells_move_with_the_field() {
    let d = [0.001, 0.002, -0.003];
    let nodes: Vec<u32> = vec![41, 3, 41, 0, MODEL.n_points() as u32 - 1];
    let cells: Vec<&[u32]> = MODEL.arrays().cells.chunks_exact(4).step_by(7).collect();
    let weights = [0.4, 0.3, 0.2, 0.1];
    let mean = |values: &[f64], cell: &[u32], i: usize| -> f64 {
        cell.iter().zip(weights).map(|(&node, w)| w * values[3 * node as usize + i]).sum()
    };
    let points: Vec<[f64; 3]> = cells
        .iter()
        .map(|cell| std::array::from_fn(|i| mean(&MODEL.arrays().points, cell, i)))
        .collect();
    for triangle in [0, 5, 11] {
        let contact = inside(triangle, [0.5, 0.3, 0.2]);
        let whole = field(&MODEL, &contact, d);
        let of_nodes = moved(&MODEL, MODEL.places_of_nodes(&nodes).unwrap(), &contact, d);
        let at = |&node: &u32| whole[3 * node as usize..3 * node as usize + 3].to_vec();
        assert_eq!(of_nodes, nodes.iter().flat_map(at).collect::<Vec<f64>>());
        let of_points = moved(&MODEL, MODEL.places_at(&points).unwrap(), &contact, d);
        let expected: Vec<f64> =
            cells.iter().flat_map(|cell| (0..3).map(|i| mean(&whole, cell, i))).collect();
        assert!(relative(&of_points, &expected) < 1e-12);
    }
}

#[test]
fn what_lies_outside_is_refused() {
    let sentence = |places: Result<Places, viscera_touch::Error>| places.unwrap_err().to_string();
    let far = MODEL.places_at(&[[0.01; 3], [1.0; 3]]);
    assert!(sentence(far).contains("place 1 at [1.0, 1.0, 1.0] m lies outside"));
    let node = MODEL.places_of_nodes(&[0, MODEL.n_points() as u32]);
    assert!(sentence(node).contains("place 1 is node"));
    let shell = MODEL.surface_alone(&[]).unwrap();
    assert!(sentence(shell.places_at(&[[0.01; 3]])).contains("no cells"));
    assert!(shell.places_of_nodes(&[0]).is_ok() && MODEL.places_at(&[]).unwrap().is_empty());
    let (metadata, arrays) = MODEL.clone().into_parts();
    let metadata = Metadata { element: "P2".to_string(), ..metadata };
    let wrong = ReducedModel::new(metadata, arrays).unwrap();
    assert!(sentence(wrong.places_at(&[[0.01; 3]])).contains("quadratic cells"));
}
