//! Mass, momentum, energy, order and frequency.

use super::*;

/// A velocity that is linear in the position has its exact energy with the consistent mass of any element, and the sum
/// of the lumped masses is the mass.
#[test]
fn masses_integrate_density() {
    let size = [0.4, 0.2, 0.3];
    for element in Element::ALL {
        let (points, cells) = block([3, 2, 2], size);
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::with_element(element, points, cells, material).unwrap();
        let matrix = |mass| MassMatrix::new(mass, &body, &[DENSITY]).unwrap();
        let weight = DENSITY * size.iter().product::<f64>();
        let along = |v: &dyn Fn(&[f64; 3]) -> f64| -> Vec<f64> {
            body.points().iter().flat_map(|x| [v(x), 0.0, 0.0]).collect()
        };
        for mass in [Mass::Lumped, Mass::Consistent] {
            let energy = matrix(mass).energy(&along(&|_| 1.0));
            assert!((energy - 0.5 * weight).abs() < 1e-12 * weight, "{element:?} {mass:?}");
        }
        let energy = matrix(Mass::Consistent).energy(&along(&|x| x[1] + 2.0 * x[2]));
        let [_, b, c] = size;
        let exact = 0.5 * weight * (b * b / 3.0 + b * c + 4.0 * c * c / 3.0);
        assert!((energy - exact).abs() < 1e-12 * exact, "{element:?}: {energy} {exact}");
    }
}

/// Nothing holds the body: its momentum stays, whatever it does inside.
#[test]
fn free_flight_keeps_its_momentum() {
    for (integration, mass) in [
        (TRAPEZOID, Mass::Lumped),
        (TRAPEZOID, Mass::Consistent),
        (Integration::BackwardEuler, Mass::Consistent),
    ] {
        let body = bar("neo_hookean");
        let mut stepper = Stepper::new(&body, &[], None, dynamic(integration, mass, 1e-3)).unwrap();
        let (spin, shift) = ([0.0, 0.0, 4.0], [0.5, -0.2, 0.1]);
        let velocity: Vec<f64> = body
            .points()
            .iter()
            .flat_map(|x| {
                let turning = crate::tensor::cross(&spin, x);
                std::array::from_fn::<f64, 3, _>(|i| shift[i] + turning[i] + 0.1 * x[i])
            })
            .collect();
        stepper.set_velocity(&velocity).unwrap();
        let momentum = |v: &[f64]| {
            let nodal = nodal_weight(&body, &[DENSITY]).unwrap();
            let mut sum = [0.0; 3];
            for (v, m) in v.chunks_exact(3).zip(nodal) {
                (0..3).for_each(|i| sum[i] += m * v[i]);
            }
            sum
        };
        // The momentum of a consistent mass is that of the lumped one: its columns have the same sums.
        let before = momentum(&velocity);
        for _ in 0..100 {
            let frame = stepper.frame(&body, &STILL).unwrap();
            assert_eq!(frame.taken, 1.0);
        }
        let after = momentum(stepper.velocity().unwrap());
        (0..3).for_each(|i| assert!((after[i] - before[i]).abs() < 1e-10, "{before:?} {after:?}"));
    }
}

/// Gravity pulls at each node as at its mass, so what falls freely is not deformed.
#[test]
fn free_fall_has_no_strain() {
    let gravity = [0.0, 3.0, -9.81];
    for element in Element::ALL {
        for mass in [Mass::Lumped, Mass::Consistent] {
            for integration in [TRAPEZOID, Integration::BackwardEuler] {
                let (points, cells) = block([3, 2, 2], [0.4, 0.2, 0.3]);
                let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
                let body = Body::with_element(element, points, cells, material).unwrap();
                let settings = dynamic(integration, mass, 1e-2);
                let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
                let input = Input { gravity, ..STILL };
                let frames = (0..20).map(|_| stepper.frame(&body, &input).unwrap());
                let energy = frames.last().unwrap().energy;
                // Strains of the weight were rho g h / mu, some 0.3, and their energy some 10 J; what is left is rounding of terms of 1e3 J.
                assert!(energy.abs() < 1e-12, "{element:?} {mass:?} {integration:?}: {energy} J");
                let fallen = stepper.displacement().chunks_exact(3).map(|u| u[2]);
                let (low, high) = (fallen.clone().fold(0.0, f64::min), fallen.fold(-1.0, f64::max));
                assert!(low < -0.19 && high - low < 1e-9, "{element:?}: {low} {high}");
            }
        }
    }
}

/// Strain and kinetic energy after each of some frames of a bent bar that is let go.
fn energies(law: &str, settings: StepperSettings, frames: usize) -> Vec<f64> {
    let body = bar(law);
    let start = Some(pressed(&body).displacement);
    let mut stepper = Stepper::new(&body, &root(&body), start, settings).unwrap();
    (0..frames)
        .map(|_| {
            let frame = stepper.frame(&body, &STILL).unwrap();
            frame.energy + frame.kinetic_energy
        })
        .collect()
}

#[test]
fn newmark_keeps_the_energy_of_a_linear_body_and_euler_does_not() {
    for mass in [Mass::Lumped, Mass::Consistent] {
        let kept = energies("linear", dynamic(TRAPEZOID, mass, 5e-3), 200);
        assert!(kept.iter().all(|e| (e - kept[0]).abs() < 1e-9 * kept[0]), "{mass:?} {kept:?}");
        let spent = energies("linear", dynamic(Integration::BackwardEuler, mass, 5e-3), 200);
        assert!(spent.windows(2).all(|e| e[1] < e[0]) && spent[199] < 0.75 * spent[0], "{mass:?}");
        let mut damped = dynamic(TRAPEZOID, mass, 5e-3);
        damped.dynamics.as_mut().unwrap().damping = [2.0, 1e-3];
        let damped = energies("linear", damped, 200);
        assert!(
            damped.windows(2).all(|e| e[1] <= e[0]) && damped[199] < 0.2 * damped[0],
            "{mass:?}"
        );
    }
}

/// One Newton iteration a frame linearises the force over the frame, which costs no order.
#[test]
fn errors_fall_with_the_order_of_the_rule() {
    let body = bar("neo_hookean");
    let start = pressed(&body).displacement;
    let end = |integration, frames: usize| {
        let settings = dynamic(integration, Mass::Lumped, 0.02 / frames as f64);
        let mut stepper = Stepper::new(&body, &root(&body), Some(start.clone()), settings).unwrap();
        for _ in 0..frames {
            stepper.frame(&body, &STILL).unwrap();
        }
        stepper.displacement().to_vec()
    };
    let exact = end(TRAPEZOID, 1280);
    let error = |integration, frames| {
        let u = end(integration, frames);
        u.iter().zip(&exact).map(|(u, v)| (u - v).powi(2)).sum::<f64>().sqrt()
    };
    for (integration, order, frames) in
        [(TRAPEZOID, 2.0, 40), (Integration::BackwardEuler, 1.0, 160)]
    {
        let rate = (error(integration, frames) / error(integration, 2 * frames)).log2();
        assert!((rate - order).abs() < 0.25, "{integration:?}: order {rate}");
    }
}

/// Half the time between two passages of the tip through rest, against `omega = 1.8751^2 sqrt(E I / (rho A L^4))`.
/// Linear tetrahedra are too stiff in bending; the excess falls with the square of their size.
#[test]
fn a_cantilever_swings_at_its_first_frequency() {
    let (young, length, height) = (1e5, 1.0, 0.1);
    let k1: f64 = 1.875_104_068_711_961;
    let exact = k1 * k1 * (young * height * height / (12.0 * DENSITY)).sqrt() / (length * length);
    let excess = |across: usize| {
        let n = [10 * across, across, across];
        let body = body("linear", &[young / 2.0, 0.0], n, [length, height, height]);
        let sigma = (k1.sinh() - k1.sin()) / (k1.cosh() + k1.cos());
        let mode = |x: f64| {
            let k = k1 * x;
            let shape = k.cosh() - k.cos() - sigma * (k.sinh() - k.sin());
            let slope = k1 * (k.sinh() + k.sin() - sigma * (k.cosh() - k.cos()));
            [1e-3 * shape, 1e-3 * slope]
        };
        let start = body.points().iter().flat_map(|x| {
            let [shape, slope] = mode(x[0]);
            [-(x[2] - 0.5 * height) * slope, 0.0, shape]
        });
        let time_step = std::f64::consts::TAU / exact / 100.0;
        let settings = dynamic(TRAPEZOID, Mass::Consistent, time_step);
        let mut stepper =
            Stepper::new(&body, &root(&body), Some(start.collect()), settings).unwrap();
        let end = 3 * nodes(&body, |x| x[0] == length)[0] as usize + 2;
        let (mut passages, mut before) = (Vec::new(), stepper.displacement()[end]);
        for k in 0..90 {
            stepper.frame(&body, &STILL).unwrap();
            let now = stepper.displacement()[end];
            if now * before <= 0.0 {
                passages.push(time_step * (f64::from(k) + before / (before - now)));
            }
            before = now;
        }
        std::f64::consts::PI / (passages[1] - passages[0]) / exact - 1.0
    };
    let [coarse, fine] = [2, 4].map(excess);
    assert!(coarse > 0.0 && fine > 0.0 && fine < 0.12, "{coarse} {fine}");
    assert!((2.5..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

/// A blow whose first step is cut back, and whose next ones balance forces and inertia all the same: the frame has settled,
/// and the body goes on as it was left.
#[test]
fn a_frame_that_recovers_from_a_cut_keeps_its_inertia() {
    let body = bar("neo_hookean");
    for integration in [Integration::BackwardEuler, TRAPEZOID] {
        let settings = StepperSettings {
            iterations: 60,
            settled: 1e-9,
            ..dynamic(integration, Mass::Lumped, 0.01)
        };
        let mut stepper = held(&body, settings);
        let frame = stepper.frame(&body, &press(&[[-0.25, 0.0, 0.0]])).unwrap();
        assert!(frame.taken < 1.0, "{frame:?}");
        assert!(frame.is_settled && frame.steps < 40, "{frame:?}");
        assert!(stepper.motion.as_ref().unwrap().acceleration.iter().any(|&a| a != 0.0));
    }
}

/// A body that flies farther in a frame than it is long: no iteration takes it so far. Where there is but one, the frame
/// ends short of the way and has not settled; where there are more, they go all the way, and it keeps its velocity.
#[test]
fn a_frame_that_brakes_a_flight_has_not_settled() {
    let body = bar("neo_hookean");
    let speed = 100.0;
    for integration in [Integration::BackwardEuler, TRAPEZOID] {
        for (iterations, goes_all_the_way) in [(1, false), (10, true)] {
            let settings =
                StepperSettings { iterations, ..dynamic(integration, Mass::Lumped, 0.01) };
            let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
            let flight: Vec<f64> = body.points().iter().flat_map(|_| [speed, 0.0, 0.0]).collect();
            stepper.set_velocity(&flight).unwrap();
            let frame = stepper.frame(&body, &STILL).unwrap();
            assert!(frame.taken < 1.0, "{integration:?}: {frame:?}");
            assert_eq!(frame.is_settled, goes_all_the_way, "{integration:?}: {frame:?}");
            let kept = stepper.velocity().unwrap().iter().zip(&flight);
            let lost = kept.fold(0.0f64, |most, (v, w)| most.max((v - w).abs()));
            assert_eq!(lost < 1e-9 * speed, goes_all_the_way, "{integration:?}: {lost} m/s");
        }
    }
}

/// A hand on a patch moves at one speed and then stands still: by Newmark's rule its force does not swing from frame to
/// frame, and the patch moves with the mean velocity of the frame.
#[test]
fn a_patch_moves_with_the_mean_velocity_of_the_frame() {
    let body = bar("neo_hookean");
    let (h, speed, moving) = (2e-3, 0.5, 20);
    for mass in [Mass::Lumped, Mass::Consistent] {
        let mut settings = dynamic(TRAPEZOID, mass, h);
        settings.dynamics.as_mut().unwrap().damping = [40.0, 0.0];
        settings.iterations = 10;
        let mut stepper = held(&body, settings);
        let (mut at, mut forces) = (0.0, Vec::new());
        for k in 1..=600 {
            let before = at;
            at = -speed * h * f64::from(k.min(moving));
            let frame = stepper.frame(&body, &press(&[[0.0, 0.0, at]])).unwrap();
            forces.push(frame.patch_forces[0][2]);
            let velocity = stepper.velocity().unwrap();
            let patch = tip(&body);
            let weighted = patch.nodes.iter().zip(&patch.weights);
            let mean: f64 = weighted.map(|(&n, w)| w * velocity[3 * n as usize + 2]).sum();
            assert!((mean - (at - before) / h).abs() < 1e-9, "{mass:?} frame {k}: {mean} m/s");
        }
        let expected = pressed_by(&body, at).patch_forces[0][2];
        for force in &forces[590..] {
            assert!((force / expected - 1.0).abs() < 1e-3, "{mass:?}: {force} {expected} N");
        }
    }
}

/// A face of a body.
fn pressed_face(body: &Body, value: f64) -> Pressure {
    let is_on = |&n: &u32| body.points()[n as usize][0] == 0.0;
    let all = body.surface();
    let faces: Vec<_> = all.iter().filter(|t| t.iter().all(is_on)).map(|t| t.to_vec()).collect();
    Pressure { values: vec![value; faces.len()], faces }
}

/// Pressure on one face drives a body that nothing holds. Damping by stiffness takes no part of the load: at every node
/// the frame leaves `f_int + M a + beta K v - f_pressure` of Newton's law, with `K` of body alone, taken here by itself.
#[test]
fn pressure_is_not_damped() {
    let body = bar("neo_hookean");
    let (beta, n) = (0.05, body.n_dofs());
    for method in [Method::Cholesky, Method::ConjugateGradients(MATRIX_FREE)] {
        for integration in [Integration::BackwardEuler, TRAPEZOID] {
            let mut settings = dynamic(integration, Mass::Lumped, 2e-3);
            settings.dynamics.as_mut().unwrap().damping[1] = beta;
            (settings.method, settings.iterations) = (method, 4);
            let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
            let pressure = pressed_face(&body, 5e3);
            stepper.set_pressure(&body, pressure.clone()).unwrap();
            for number in 0..20 {
                let frame = stepper.frame(&body, &STILL).unwrap();
                assert!(frame.is_settled, "{method:?} {integration:?} frame {number}: {frame:?}");
                let (motion, damping) =
                    (stepper.motion.as_ref().unwrap(), stepper.stiffness_damping());
                let StiffnessDamping { velocity, displacement, curvature, .. } = damping.unwrap();
                let (mut expected, mut force, mut damped) =
                    (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                let mut tangent = body.zero_tangent();
                body.linearize(displacement, *curvature, &mut force, &mut tangent);
                tangent.multiply(velocity, &mut damped);
                body.internal_force(stepper.displacement(), &mut expected);
                motion.mass.add_product(1.0, &motion.acceleration, &mut expected);
                pressure.add_force(&body, stepper.displacement(), -1.0, &mut expected);
                expected.iter_mut().zip(&damped).for_each(|(f, k)| *f += beta * k);
                let size = expected.iter().chain(&force).fold(0.0f64, |most, f| most.max(f.abs()));
                for (found, expected) in stepper.reactions().zip(expected) {
                    assert!(
                        (found - expected).abs() < 1e-9 * size,
                        "{found} {expected} of {size} N"
                    );
                }
            }
        }
    }
}
