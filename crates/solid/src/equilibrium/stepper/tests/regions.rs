//! A settled frame is settled in every region, however large the forces elsewhere.

use super::*;
use crate::equilibrium::stepper::regions::Regions;

const SOFT: f64 = 1e3;

/// A bar whose first half is so many times stiffer than the other.
fn uneven(ratio: f64) -> Body {
    let (points, cells) = block([8, 2, 2], [0.4, 0.2, 0.2]);
    let is_stiff = |cell: &[u32; 4]| {
        cell.iter().map(|&node| points[node as usize][0]).sum::<f64>() < 4.0 * 0.2
    };
    let row = |cell| {
        let stiffness = if is_stiff(cell) { ratio * SOFT } else { SOFT };
        vec![stiffness, 4.0 * stiffness]
    };
    let material = Material::new("neo_hookean", cells.iter().map(row).collect()).unwrap();
    Body::new(points, cells, material).unwrap()
}

/// A stiff bar, and a soft one beside it.
fn two_bars() -> Body {
    let (mut points, mut cells) = block([4, 2, 2], [0.4, 0.2, 0.2]);
    let n = points.len() as u32;
    let (others, other_cells) = (points.clone(), cells.clone());
    points.extend(others.into_iter().map(|[x, y, z]| [x, y + 1.0, z]));
    cells.extend(other_cells.into_iter().map(|cell| cell.map(|node| node + n)));
    let row = |cell: &[u32; 4]| {
        let stiffness = if cell[0] < n { 1e4 * SOFT } else { SOFT };
        vec![stiffness, 4.0 * stiffness]
    };
    let material = Material::new("neo_hookean", cells.iter().map(row).collect()).unwrap();
    Body::new(points, cells, material).unwrap()
}

fn uniform(nodes: Vec<u32>) -> Patch {
    let weight = 1.0 / nodes.len() as f64;
    nodes.into_iter().map(|node| (node, weight)).collect()
}

fn settings() -> StepperSettings {
    StepperSettings { iterations: 30, ..StepperSettings::default() }
}

#[test]
fn regions_are_parts_and_orders_of_stiffness() {
    let count = |body: &Body| {
        let regions = Regions::of(body);
        let mut squares = Vec::new();
        regions.raise(&mut squares, &vec![1.0; body.n_dofs()]);
        let n: f64 = squares.iter().sum();
        assert_eq!(n, body.n_dofs() as f64);
        squares.len()
    };
    assert_eq!(
        [bar("neo_hookean"), uneven(50.0), uneven(1e4), two_bars()].map(|b| count(&b)),
        [1, 1, 2, 2]
    );
}

/// The tip is turned aside while bone is stretched: the force of the hand is that of an equilibrium.
#[test]
fn soft_tissue_beside_bone_has_settled_too() {
    let body = uneven(1e6);
    let bone = uniform(nodes(&body, |x| (x[0] - 0.15).abs() < 1e-9));
    let tip = uniform(nodes(&body, |x| x[0] == 0.4 && x[2] == 0.2));
    let mut stepper = Stepper::new(&body, &root(&body), None, settings()).unwrap();
    stepper.grasp(&body, &[], &[bone.clone(), tip.clone()]).unwrap();
    for motion in [[0.004, -0.05, 0.05], [0.01, 0.04, -0.06]] {
        let means = [[1e-3, 0.0, 0.0], motion];
        let frame = stepper.frame(&body, &Input { means: &means, ..STILL }).unwrap();
        assert!(frame.is_settled);
        let exact = Problem {
            body: &body,
            prescribed: root(&body).into_iter().map(|dof| (dof, 0.0)).collect(),
            force: vec![0.0; body.n_dofs()],
            pressure: Pressure::default(),
            patches: [bone.clone(), tip.clone()]
                .into_iter()
                .zip(means)
                .map(|(patch, displacement)| PatchLoad { patch, displacement })
                .collect(),
            start: Some(stepper.displacement().to_vec()),
        };
        let exact =
            Newton { tolerance: 1e-12, ..Newton::default() }.solve(&exact, &mut |_| true).unwrap();
        let (found, expected) = (frame.patch_forces[1], exact.patch_forces[1]);
        let size = expected.iter().map(|f| f * f).sum::<f64>().sqrt();
        let gap = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, f64::max);
        assert!(gap < 4e-3 * size, "{found:?} {expected:?}");
    }
}

/// A kilonewton on the stiff bar, two newtons on the other: both are carried.
#[test]
fn a_light_load_beside_a_heavy_one_is_carried() {
    let body = two_bars();
    let end = |y: f64| nodes(&body, |x| x[0] == 0.4 && (x[1] >= 1.0) == (y >= 1.0));
    let mut force = vec![0.0; body.n_dofs()];
    for (y, load) in [(0.0, 1e3), (1.0, 2.0)] {
        let end = end(y);
        end.iter().for_each(|&node| force[3 * node as usize + 2] = load / end.len() as f64);
    }
    let mut stepper = Stepper::new(&body, &root(&body), None, settings()).unwrap();
    let frame = stepper.frame(&body, &Input { force: &force, ..STILL }).unwrap();
    assert!(frame.is_settled);
    let mut internal = vec![0.0; body.n_dofs()];
    body.internal_force(stepper.displacement(), &mut internal);
    let (held, n) = (root(&body), body.n_dofs() as u32);
    let square = |v: &dyn Fn(usize) -> f64, is_out: bool| -> f64 {
        let soft = (n / 2..n).filter(|dof| !(is_out && held.contains(dof)));
        soft.map(|dof| v(dof as usize).powi(2)).sum()
    };
    let out = square(&|dof| force[dof] - internal[dof], true).sqrt();
    let size = square(&|dof| internal[dof], false).sqrt();
    assert!(out <= 1e-3 * size && size > 1.0, "{out} {size}");
}
