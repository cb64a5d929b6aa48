//! Loads that no law bears: cells come to the bounds of their volume, and the body comes back when the loads are gone.

use super::super::barrier::VolumeBarrier;
use super::*;
use crate::number::dot;

/// Of the bar that is pulled [m].
const SIZE: [f64; 3] = [0.4, 0.2, 0.2];
/// Seven times Young's modulus times the cross-section [N].
const LOAD: f64 = 3000.0;

fn lame(young: f64, poisson: f64) -> Vec<f64> {
    let shear = young / (2.0 * (1.0 + poisson));
    vec![shear, 2.0 * shear * poisson / (1.0 - 2.0 * poisson)]
}

/// Pulls the end of a bar for 60 frames, with a force that no law bears, and lets it go for 240: the longest
/// displacement under the load, the last one, the most cells that were at a bound, and the last frame.
fn overloaded(
    law: (&str, &[f64]),
    direction: [f64; 3],
    settings: StepperSettings,
) -> (f64, f64, usize, Frame) {
    let body = body(law.0, law.1, [4, 2, 2], SIZE);
    let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
    let end = nodes(&body, |x| x[0] == SIZE[0]);
    let mut force = vec![0.0; body.n_dofs()];
    for &node in &end {
        (0..3).for_each(|i| force[3 * node as usize + i] = LOAD * direction[i] / end.len() as f64);
    }
    let largest = |u: &[f64]| u.iter().fold(0.0f64, |largest, u| largest.max(u.abs()));
    let (mut farthest, mut at_bound, mut last) = (0.0f64, 0, None);
    for k in 0..300 {
        let force: &[f64] = if k < 60 { &force } else { &[] };
        let frame = stepper.frame(&body, &Input { force, ..STILL }).unwrap();
        assert!(body.smallest_jacobian(stepper.displacement()).0 > 0.05, "frame {k}: {frame:?}");
        if k < 60 {
            farthest = farthest.max(largest(stepper.displacement()));
        }
        at_bound = at_bound.max(frame.cells_at_bound);
        last = Some(frame);
    }
    (farthest, largest(stepper.displacement()), at_bound, last.unwrap())
}

/// The laws of the bar, none of which bears the load.
fn laws() -> [(&'static str, Vec<f64>); 3] {
    let lame = lame(1e4, 0.45);
    [
        ("saint_venant_kirchhoff", lame.clone()),
        ("corotated", lame),
        ("mooney_rivlin ln J", vec![1e3, 7e2, 3e4]),
    ]
}

/// Statics, backward Euler and Newmark.
fn schemes() -> [StepperSettings; 3] {
    let moving = |integration| {
        let mut settings = dynamic(integration, Mass::Lumped, 0.02);
        settings.dynamics.as_mut().unwrap().damping = [0.1, 0.1];
        settings
    };
    [StepperSettings::default(), moving(Integration::BackwardEuler), moving(TRAPEZOID)]
}

fn comes_back(law: &str, parameters: &[f64], direction: [f64; 3], settings: &StepperSettings) {
    let (farthest, rest, at_bound, last) =
        overloaded((law, parameters), direction, settings.clone());
    let case = format!("{law} {direction:?} {settings:?}: {rest} of {farthest} m, {last:?}");
    assert!(at_bound > 0 && farthest > 0.2, "no overload: {case}");
    assert!(rest < 0.01 * farthest && last.cells_at_bound == 0 && last.taken == 1.0, "{case}");
}

#[test]
fn a_body_comes_back_from_an_overload() {
    for (law, parameters) in laws() {
        for settings in schemes() {
            for direction in [[1.0, 0.0, 0.0], [-1.0, 0.1, 0.0], [0.0, 0.0, -1.0]] {
                comes_back(law, &parameters, direction, &settings);
            }
        }
    }
}

#[test]
fn so_it_does_by_conjugate_gradients_and_in_three_iterations_a_frame() {
    let method = Method::ConjugateGradients(ConjugateGradients::default());
    for (law, parameters) in laws() {
        for settings in schemes() {
            let by_cg = StepperSettings { method, ..settings.clone() };
            let thrice = StepperSettings { iterations: 3, ..settings };
            for settings in [by_cg, thrice] {
                comes_back(law, &parameters, [0.0, 0.0, -1.0], &settings);
            }
        }
    }
}

/// Hooke's law takes any load, which has equal components here: a node's way is longer than each of them.
#[test]
fn no_node_goes_farther_in_an_iteration_than_the_body_is_long() {
    let body = body("linear", &lame(1e4, 0.3), [4, 2, 2], SIZE);
    let end = nodes(&body, |x| x[0] == SIZE[0]);
    let mut force = vec![0.0; body.n_dofs()];
    for dof in dofs(&end) {
        force[dof as usize] = 1e6;
    }
    let long = dot(&SIZE, &SIZE).sqrt();
    for iterations in [1, 3] {
        let settings = StepperSettings { iterations, ..Default::default() };
        let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
        stepper.frame(&body, &Input { force: &force, ..STILL }).unwrap();
        let ways = stepper.displacement().chunks_exact(3).map(|u| dot(u, u).sqrt());
        let farthest = ways.fold(0.0, f64::max) / f64::from(u16::try_from(iterations).unwrap());
        // Rounding of a quotient and a product.
        let of_length = farthest / long;
        assert!((of_length - 1.0).abs() < 1e-12, "{of_length} lengths an iteration");
    }
}

/// Laws that stiffen exponentially: an end is moved by half the length within two frames, at once, and let go.
#[test]
fn exponential_laws_do_not_lock() {
    let fibres = [0.96, 0.28, 0.0, 0.96, -0.28, 0.0];
    let artery = |k2: f64| [&[3e3, 2.4e3, k2, 0.0, 3e4][..], &fibres].concat();
    let laws = [
        ("fung", vec![1e3, 5.0, 1e4]),
        ("fung", vec![1e3, 50.0, 1e4]),
        ("veronda_westmann", vec![200.0, 5.0, 3e4]),
        ("holzapfel_gasser_ogden", artery(12.0)),
        ("holzapfel_gasser_ogden", artery(500.0)),
    ];
    for (law, parameters) in laws {
        for iterations in [1, 5] {
            for settings in schemes() {
                let settings = StepperSettings { iterations, ..settings };
                for direction in [[0.5, 0.0, 0.0], [0.0, 0.3, -0.5]] {
                    returns(law, &parameters, direction, &settings);
                }
            }
        }
    }
}

fn returns(law: &str, parameters: &[f64], way: [f64; 3], settings: &StepperSettings) {
    let body = body(law, parameters, [4, 2, 2], SIZE);
    let mut stepper = held(&body, settings.clone());
    let means = [way.map(|x| SIZE[0] * x)];
    let mut farthest = 0.0f64;
    let case = format!("{law} {parameters:?} {way:?} {settings:?}");
    let size = |u: &[f64]| u.iter().fold(0.0f64, |largest, u| largest.max(u.abs()));
    for _ in 0..2 {
        let frame = stepper.frame(&body, &press(&means)).unwrap();
        assert!(frame.residual.is_finite(), "{case}: {frame:?}");
        farthest = farthest.max(size(stepper.displacement()));
    }
    stepper.grasp(&body, &[], &[]).unwrap();
    let mut last = None;
    for k in 0..400 {
        let frame = stepper.frame(&body, &STILL).unwrap();
        assert!(frame.residual.is_finite(), "frame {k} of {case}: {frame:?}");
        last = Some(frame);
    }
    let (rest, last) = (size(stepper.displacement()), last.unwrap());
    assert!(last.taken == 1.0 && last.cells_at_bound == 0, "{case}: {last:?}");
    assert!(rest < 0.05 * SIZE[0], "{case}: {rest} of {farthest} m, {last:?}");
}

/// A bar whose noise takes cells next to both bounds, with their points.
fn strained(element: Element) -> (Body, Vec<f64>) {
    let (points, cells) = block([2, 1, 1], [0.2, 0.1, 0.1]);
    let material = Material::new("saint_venant_kirchhoff", vec![lame(1e4, 0.3)]).unwrap();
    let body = Body::with_element(element, points, cells, material).unwrap();
    let u = noise(body.n_dofs(), 11);
    (body, u.iter().map(|u| 0.008 * u).collect())
}

/// `dJ/du` against differences, in every element.
#[test]
fn slopes_of_the_volume_ratio_are_its_derivative() {
    for element in Element::ALL {
        let (body, u) = strained(element);
        let nothing = [1.0, 1.0];
        let points = body.outliers(&u, nothing);
        assert_eq!(points.len(), body.volume_ratios(&u).len());
        let direction = noise(u.len(), 12);
        let moved =
            |h: f64| -> Vec<f64> { u.iter().zip(&direction).map(|(u, w)| u + h * w).collect() };
        let [ahead, behind] = [1e-6, -1e-6].map(|h| body.volume_ratios(&moved(h)));
        for (point, exact) in points.iter().zip(body.volume_ratios(&u)) {
            assert!((point.volume_ratio - exact).abs() < 1e-14);
            let along = |(node, slope): &(u32, [f64; 3])| -> f64 {
                (0..3).map(|i| slope[i] * direction[3 * *node as usize + i]).sum()
            };
            let slope: f64 = point.slopes.iter().map(along).sum();
            let difference = (ahead[point.point] - behind[point.point]) / 2e-6;
            assert!((slope - difference).abs() < 1e-6 * slope.abs().max(1.0), "{element:?}");
        }
    }
}

/// Force of the barrier against differences of its energy. Its stiffness is the second derivative made convex: along no
/// direction is it less than the size of that.
#[test]
fn the_barrier_pushes_with_the_derivative_of_its_energy() {
    for element in Element::ALL {
        let (body, u) = strained(element);
        let (direction, h) = (noise(u.len(), 13), 1e-6);
        // Bounds between which every point is next to the one or the other.
        let ratios = body.volume_ratios(&u);
        let [least, most] =
            ratios.iter().fold([f64::INFINITY, 0.0f64], |[a, b], &j| [a.min(j), b.max(j)]);
        let barrier = |u: &[f64]| VolumeBarrier::new([0.6 * least, 1.2 * most], &body, u);
        let moved =
            |h: f64| -> Vec<f64> { u.iter().zip(&direction).map(|(u, w)| u + h * w).collect() };
        let energy = |h: f64| -> f64 {
            let u = moved(h);
            let barrier = barrier(&u);
            body.outliers(&u, barrier.inner())
                .iter()
                .map(|point| barrier.energy(&body, point)[0])
                .sum()
        };
        let here = barrier(&u);
        assert!(!here.is_idle(), "{element:?}");
        let dot = |a: &[f64]| a.iter().zip(&direction).map(|(a, w)| a * w).sum::<f64>();
        let mut force = vec![0.0; u.len()];
        here.add_force(&body, &mut force);
        let slope = (energy(h) - energy(-h)) / (2.0 * h);
        assert!((dot(&force) - slope).abs() < 1e-6 * slope.abs(), "{element:?} {slope}");

        let mut convex = body.zero_tangent();
        here.add_stiffness(&body, &mut convex);
        let mut product = vec![0.0; u.len()];
        convex.multiply(&direction, &mut product);
        let curvature = (energy(h) - 2.0 * energy(0.0) + energy(-h)) / (h * h);
        assert!(dot(&product) >= curvature.abs() * (1.0 - 1e-5), "{element:?} {curvature}");
        assert!(dot(&product) < 3.0 * curvature.abs(), "{element:?} {curvature}");
    }
}

/// A bar with a node so far from its place that it presses cells to a fiftieth of their volume, as a solution may leave
/// them; and which cells.
fn crushed() -> (Body, Vec<f64>, Vec<bool>) {
    let body = body("corotated", &lame(1e4, 0.45), [4, 2, 2], SIZE);
    let mut start = vec![0.0; body.n_dofs()];
    start[3 * nodes(&body, |x| *x == [0.2, 0.1, 0.1])[0] as usize] = 0.098;
    let crushed: Vec<bool> = body.volume_ratios(&start).iter().map(|&j| j < 0.05).collect();
    assert!(crushed.contains(&true));
    (body, start, crushed)
}

/// The barrier begins for them where they have begun, and ends at half of that.
#[test]
fn cells_that_begin_crushed_have_a_bound_of_their_own() {
    let (body, start, crushed) = crushed();
    let n_crushed = crushed.iter().filter(|&&is| is).count();
    let mut barrier = VolumeBarrier::new(VOLUME_BOUNDS, &body, &start);
    let force_of = |barrier: &VolumeBarrier| {
        let mut force = vec![0.0; body.n_dofs()];
        barrier.add_force(&body, &mut force);
        force.iter().fold(0.0f64, |most, f| most.max(f.abs()))
    };
    assert!(barrier.n_cells() == n_crushed && force_of(&barrier) == 0.0);
    assert!((barrier.range()[0] - 0.01).abs() < 1e-12);
    let at = |ratio: f64| start.iter().map(|u| u / 0.098 * 0.1 * (1.0 - ratio)).collect::<Vec<_>>();
    assert!(!barrier.follow(&body, &at(0.014)));
    assert!(barrier.follow(&body, &at(0.016)) && force_of(&barrier) > 0.0);
    assert!(barrier.follow(&body, &at(0.06)));
    assert!(barrier.n_cells() == n_crushed && force_of(&barrier) == 0.0);
    // Once they have come back they have the bounds of all.
    assert!(barrier.follow(&body, &at(0.11)));
    assert!(
        barrier.is_idle() && barrier.range() == VOLUME_BOUNDS && !barrier.follow(&body, &at(0.04))
    );
    // A frame that is given up begins anew.
    barrier.begin(&body, &start);
    assert!(barrier.n_cells() == n_crushed && force_of(&barrier) == 0.0);
}

/// Frames in which they are held so: they are at a bound in each of them, and an overload finds all others within the
/// bounds of all. Let go, they come back.
#[test]
fn cells_that_begin_crushed_are_at_a_bound_until_they_come_back() {
    let (body, start, crushed) = crushed();
    let mut held: Vec<u32> = body
        .cells()
        .iter()
        .zip(&crushed)
        .filter(|(_, is)| **is)
        .flat_map(|(cell, _)| *cell)
        .collect();
    held.sort_unstable();
    held.dedup();
    let held = dofs(&held);
    let values: Vec<f64> = held.iter().map(|&dof| start[dof as usize]).collect();
    let settings = StepperSettings { iterations: 3, ..Default::default() };
    let mut stepper = Stepper::new(&body, &root(&body), Some(start), settings).unwrap();
    stepper.grasp(&body, &held, &[]).unwrap();
    let mut force = vec![0.0; body.n_dofs()];
    let end = nodes(&body, |x| x[0] == SIZE[0]);
    end.iter().for_each(|&node| force[3 * node as usize + 2] = -LOAD / end.len() as f64);
    let mut least = f64::INFINITY;
    for k in 0..40 {
        let force: &[f64] = if k < 20 { &[] } else { &force };
        let frame = stepper.frame(&body, &Input { values: &values, force, ..STILL }).unwrap();
        assert!(frame.cells_at_bound > 0 && !frame.is_settled, "frame {k}: {frame:?}");
        assert!(k != 19 || frame.residual < 1e-6, "{frame:?}");
        let ratios = body.volume_ratios(stepper.displacement());
        let others = ratios.iter().zip(&crushed).filter(|(_, is)| !**is).map(|(&ratio, _)| ratio);
        least = others.fold(least, f64::min);
        assert!(least > 0.05, "frame {k}: {least}");
    }
    assert!(least < 0.1, "{least}: the load finds no bound");

    stepper.grasp(&body, &[], &[]).unwrap();
    let last = (0..200).map(|_| stepper.frame(&body, &STILL).unwrap()).last().unwrap();
    assert!(last.is_settled && last.cells_at_bound == 0, "{last:?}");
    assert!(stepper.displacement().iter().all(|u| u.abs() < 1e-3));
}
