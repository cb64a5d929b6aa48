//! Several rigid probes on the model of a block, which feel each other.

mod block;
mod counting;

use block::{SIZE, block};
use counting::allocations;
use viscera_core::reduced::{
    Coupling, Felt, Grip, Probe, ProbeGroup, ReducedModel, TOLERANCE, Trust,
};

const RADIUS: f64 = 0.012;

fn probe(model: &ReducedModel, friction: f64) -> Probe {
    Probe::new(model, RADIUS, friction, TOLERANCE, None).unwrap()
}

/// Over the top of the block, to either side of its middle.
fn centers(apart: f64, entered: [f64; 2]) -> [[f64; 3]; 2] {
    [-0.5, 0.5].map(|side| {
        let entered = entered[usize::from(side > 0.0)];
        [0.5 * SIZE[0] + side * apart, 0.5 * SIZE[1], SIZE[2] + RADIUS - entered]
    })
}

/// What two probes feel in the end of a way down.
fn pressed(model: &ReducedModel, friction: f64, apart: f64, entered: [f64; 2]) -> [Felt; 2] {
    let mut probes = [probe(model, friction), probe(model, friction)];
    let [one, other] = &mut probes;
    let mut together = ProbeGroup::new(model, 2);
    let mut felt = [None; 2];
    for n in 0..=20 {
        let part = f64::from(n) / 20.0;
        let here = centers(apart, entered.map(|depth| part * depth));
        let found = together.place(model, &mut [&mut *one, &mut *other], &here);
        felt = [Some(found[0]), Some(found[1])];
    }
    felt.map(Option::unwrap)
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    size(std::array::from_fn(|i| a[i] - b[i]))
}

/// Displacement of the surface under a touch, at the contact of another.
fn moved(model: &ReducedModel, touch: &Felt, at: &Felt) -> [f64; 3] {
    let nodes = &model.arrays().surface_nodes;
    let (mut workspace, mut field) = (vec![0.0; model.workspace_len()], vec![0.0; 3 * nodes.len()]);
    model.surface_displacement(&touch.contact, touch.displacement, &mut workspace, &mut field);
    let mut moved = [0.0; 3];
    for (position, weight) in model.corners(&at.contact).iter().zip(at.contact.weights) {
        let node = model.arrays().positions[*position as usize];
        let row = nodes.binary_search(&node).unwrap();
        (0..3).for_each(|i| moved[i] += weight * f64::from(field[3 * row + i]));
    }
    moved
}

#[test]
fn each_meets_the_surface_as_the_other_leaves_it() {
    let model = block();
    let entered = [0.003, 0.002];
    let felt = pressed(&model, 0.0, 0.03, entered);
    let places = centers(0.03, entered);
    for k in 0..2 {
        let by = moved(&model, &felt[1 - k], &felt[k]);
        assert!(size(by) > 1e-4, "the other moves the surface there: {by:?}");
        let mut alone = probe(&model, 0.0);
        let mut last = None;
        for n in 0..=20 {
            let up = 0.003 * (1.0 - f64::from(n) / 20.0);
            let at = std::array::from_fn(|i| places[k][i] - by[i] + if i == 2 { up } else { 0.0 });
            last = Some(alone.place(&model, at));
        }
        let last = last.unwrap();
        let error = difference(last.force, felt[k].force) / size(felt[k].force);
        assert!(error < 1e-3, "{k}: {error}");
        assert!((felt[k].gap - last.gap).abs() < 1e-3 * entered[k]);
        assert_eq!(felt[k].center, places[k]);
    }
}

#[test]
fn a_probe_pressed_in_beside_another_changes_its_force_the_more_the_closer_it_is() {
    let model = block();
    let change = |apart: f64| {
        let [one, free] = pressed(&model, 0.3, apart, [0.002, -0.01]);
        let [both, other] = pressed(&model, 0.3, apart, [0.002, 0.002]);
        assert_eq!((free.grip, other.grip), (Grip::Free, Grip::Sticks));
        difference(one.force, both.force) / size(one.force)
    };
    let [near, far] = [0.026, 0.038].map(change);
    assert!(near > far && far > 1e-3, "{near} {far}");
}

#[test]
fn the_order_of_the_probes_does_not_matter() {
    let model = block();
    let entered = [0.003, 0.001];
    let there = pressed(&model, 0.3, 0.03, entered);
    let mut probes = [probe(&model, 0.3), probe(&model, 0.3)];
    let [one, other] = &mut probes;
    let mut together = ProbeGroup::new(&model, 2);
    let mut back = Vec::new();
    for n in 0..=20 {
        let mut here = centers(0.03, entered.map(|depth| f64::from(n) / 20.0 * depth));
        here.reverse();
        back = together.place(&model, &mut [&mut *one, &mut *other], &here).to_vec();
    }
    for k in 0..2 {
        let error = difference(there[k].force, back[1 - k].force) / size(there[k].force);
        assert!(error < 2e-3, "{k}: {error}");
    }
}

#[test]
fn one_alone_feels_what_a_probe_feels_and_the_other_loses_only_its_own_touch() {
    let model = block();
    let places = centers(0.03, [0.002, 0.002]);
    let above = centers(0.03, [0.0, 0.0]);
    let mut alone = probe(&model, 0.3);
    let (mut first, mut second) = (probe(&model, 0.3), probe(&model, 0.3));
    let mut single = ProbeGroup::new(&model, 1);
    for at in [above[0], places[0]] {
        let mut group = [&mut first];
        assert_eq!(single.place(&model, &mut group, &[at]), [alone.place(&model, at)]);
    }

    let mut both = ProbeGroup::new(&model, 2);
    let mut group = [&mut first, &mut second];
    both.place(&model, &mut group, &[places[0], above[1]]);
    let felt = both.place(&model, &mut group, &[places[0], [f64::NAN, 0.0, 0.0]]);
    assert_eq!(felt[1].grip, Grip::Lost);
    assert_eq!(felt[1].force, [0.0; 3]);
    assert!(felt[0].trust == Trust::Trusted && felt[0].force[2] < 0.0);
}

#[test]
fn ticks_of_a_group_allocate_nothing() {
    let model = block();
    let coupling = Some(Coupling { stiffness: 300.0, damping: 1.0 });
    let made = || Probe::new(&model, RADIUS, 0.3, TOLERANCE, coupling).unwrap();
    let (mut one, mut other) = (made(), made());
    let mut together = ProbeGroup::new(&model, 2);
    let (count, touching) = allocations(|| {
        let mut touching = 0;
        for n in 0..200 {
            let devices = centers(0.03, [2e-5 * f64::from(n) - 5e-4; 2]);
            let mut probes = [&mut one, &mut other];
            let felt = together.follow(&model, &mut probes, &devices, 1e-3).unwrap();
            touching += felt.iter().filter(|felt| felt.force[2] < 0.0).count();
        }
        touching
    });
    assert_eq!(count, 0);
    assert!(touching > 200, "{touching}");
}
