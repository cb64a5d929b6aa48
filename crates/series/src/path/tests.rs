//! Paths against Newton's equilibria.

use super::*;
use crate::equilibrium::{Newton, Problem};
use crate::law::Material;
use crate::mesh::samples::block;
use crate::number::pade::Pade;
use std::f64::consts::PI;
use viscera_solid::element::Element;

fn cantilever(law: &str) -> (Body, Vec<u32>, Vec<f64>) {
    let (points, cells) = block([6, 1, 1], [1.5, 0.25, 0.25]);
    let fixed = (0..points.len() as u32).filter(|&n| points[n as usize][0] == 0.0).collect();
    let tip: Vec<usize> = (0..points.len()).filter(|&n| points[n][0] == 1.5).collect();
    let mut force = vec![0.0; 3 * points.len()];
    tip.iter().for_each(|&n| force[3 * n + 2] = -60.0 / tip.len() as f64);
    let material = Material::new(law, vec![vec![1e5, 1.5e5]]).unwrap();
    (Body::new(points, cells, material).unwrap(), fixed, force)
}

const NONE: Pressure = Pressure { faces: Vec::new(), values: Vec::new() };

/// So much on the faces all of whose nodes are chosen [Pa].
fn pressed(body: &Body, pressure: f64, choose: impl Fn(&[f64; 3]) -> bool) -> Pressure {
    let is_chosen = |face: &[u32; 3]| face.iter().all(|&n| choose(&body.points()[n as usize]));
    let faces: Vec<_> = body.surface().into_iter().filter(is_chosen).map(Vec::from).collect();
    Pressure { values: vec![pressure; faces.len()], faces }
}

/// None; one that bends the beam up, its rim free, beside a pull on its end; one all around.
fn pressures(body: &Body) -> [Pressure; 3] {
    let mut bending = pressed(body, 150.0, |x| x[2] == 0.0);
    let pull = pressed(body, -2e3, |x| x[0] == 1.5);
    bending.faces.extend(pull.faces);
    bending.values.extend(pull.values);
    [NONE, bending, pressed(body, 3e4, |_| true)]
}

fn newton(body: &Body, fixed: &[u32], force: &[f64], pressure: &Pressure, load: f64) -> Vec<f64> {
    let held = fixed.iter().flat_map(|&node| (0..3).map(move |i| (3 * node + i, 0.0)));
    let scaled = |values: &[f64]| values.iter().map(|f| load * f).collect();
    let problem = Problem {
        pressure: Pressure { values: scaled(&pressure.values), ..pressure.clone() },
        body,
        prescribed: held.collect(),
        force: scaled(force),
        patches: vec![],
        start: None,
    };
    let settings = Newton { tolerance: 1e-12, ..Newton::default() };
    settings.solve(&problem, &mut |_| true).unwrap().displacement
}

fn relative(a: &[f64], b: &[f64]) -> f64 {
    let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    norm(&difference) / norm(b)
}

fn settings(parameter: Parameter) -> Continuation {
    Continuation { order: 12, parameter, until: 1.0, tolerance: 1e-6, max_expansions: 20 }
}

#[test]
fn both_parameters_reach_newtons_equilibrium() {
    for law in ["saint_venant_kirchhoff", "neo_hookean"] {
        let (body, fixed, force) = cantilever(law);
        for (k, pressure) in pressures(&body).iter().enumerate() {
            let exact = newton(&body, &fixed, &force, pressure, 1.0);
            for parameter in [Parameter::Load, Parameter::ArcLength] {
                let path = settings(parameter)
                    .follow(&body, &fixed, &force, pressure, &mut || true)
                    .unwrap();
                let last = path.last().unwrap();
                let end = Pade::new(&last.series, 0).evaluate(&last.series, last.range);
                let (u, load) = end.split_at(end.len() - 1);
                assert!((load[0] - 1.0).abs() < 1e-8, "load {}", load[0]);
                let gap = relative(u, &exact);
                assert!(gap < 1e-5, "{law} {parameter:?}, pressure {k}: {gap}");
            }
        }
    }
}

/// Order by order the truncated series gains a power of the load, at rest and where a pressure pushes already.
#[test]
fn coefficients_are_those_of_the_path() {
    let (body, fixed, force) = cantilever("neo_hookean");
    for (k, pressure) in pressures(&body).iter().enumerate() {
        let continuation = Continuation {
            order: 5,
            max_expansions: 2,
            until: 10.0,
            tolerance: 1e-7,
            parameter: Parameter::Load,
        };
        for expansion in continuation.follow(&body, &fixed, &force, pressure, &mut || true).unwrap()
        {
            let series = &expansion.series;
            let (start, n) = (series[0][body.n_dofs()], body.n_dofs());
            let (small, large) = (0.03, 0.06);
            for order in 1..=4 {
                let error = |further: f64| {
                    let u = newton(&body, &fixed, &force, pressure, start + further);
                    let sum: Vec<f64> = (0..n)
                        .map(|d| (0..=order).map(|p| further.powi(p as i32) * series[p][d]).sum())
                        .collect();
                    let gap: Vec<f64> = sum.iter().zip(&u).map(|(a, b)| a - b).collect();
                    norm(&gap)
                };
                let rate = (error(large) / error(small)).log2();
                let gain = rate - order as f64 - 1.0;
                assert!(gain.abs() < 0.3, "pressure {k}, load {start}, order {order}: {rate}");
            }
        }
    }
}

#[test]
fn bad_settings_are_refused() {
    let (body, fixed, force) = cantilever("neo_hookean");
    let good = settings(Parameter::Load);
    for bad in [
        Continuation { order: 1, ..good },
        Continuation { until: f64::NAN, ..good },
        Continuation { tolerance: 0.0, ..good },
    ] {
        assert!(bad.follow(&body, &fixed, &force, &NONE, &mut || true).is_err());
    }
    assert!(good.follow(&body, &fixed, &vec![0.0; force.len()], &NONE, &mut || true).is_err());
    let nowhere = Pressure { faces: vec![vec![0, 1, 27]], values: vec![1.0] };
    assert!(good.follow(&body, &fixed, &force, &nowhere, &mut || true).is_err());
}

/// Straight, clamped at one end and without Poisson's effect, a column stays straight; Euler's load is
/// `pi^2 E I / (4 L^2)`. Steps shorten towards it, and rounding decides whether one of them meets the singular tangent; with
/// some of these moduli one does.
#[test]
fn a_straight_column_is_unstable_beyond_its_euler_load() {
    for mu in [3000.0, 3006.0, 3012.0, 3015.0] {
        let (length, height) = (0.2, 0.01);
        let (points, cells) = block([12, 1, 1], [length, height, height]);
        let material = Material::new("saint_venant_kirchhoff", vec![vec![mu, 0.0]]).unwrap();
        let body = Body::with_element(Element::P2, points, cells, material).unwrap();
        let fixed: Vec<u32> =
            (0u32..).zip(body.points()).filter(|(_, x)| x[0] == 0.0).map(|(n, _)| n).collect();
        let euler = PI.powi(2) * 2.0 * mu * height.powi(4) / (48.0 * length.powi(2));
        let end = pressed(&body, euler / height.powi(2), |x| x[0] > 0.999 * length);
        let mut force = vec![0.0; body.n_dofs()];
        end.add_force(&body, &vec![0.0; body.n_dofs()], 1.0, &mut force);
        for (until, is_stable) in [(0.9, true), (1.1, false)] {
            let path = Continuation { until, ..settings(Parameter::Load) };
            let path = path.follow(&body, &fixed, &force, &NONE, &mut || true).unwrap();
            assert_eq!(path.last().unwrap().is_stable, is_stable, "{until} of Euler's load, {mu}");
        }
    }
}

#[test]
fn a_path_can_be_stopped_before_every_expansion() {
    let (body, fixed, force) = cantilever("neo_hookean");
    let far = Continuation { order: 5, until: 10.0, tolerance: 1e-7, ..settings(Parameter::Load) };
    let far = Continuation { max_expansions: 4, ..far };
    let stopped_after = |allowed: usize| {
        let mut asked = 0;
        let mut go_on = || {
            asked += 1;
            asked <= allowed
        };
        let path = far.follow(&body, &fixed, &force, &NONE, &mut go_on);
        (path.map(|path| path.len()), asked)
    };
    let (whole, asked) = stopped_after(usize::MAX);
    assert!(asked > 2 && whole == Ok(asked), "{whole:?} {asked}");
    (0..asked).for_each(|n| assert_eq!(stopped_after(n), (Err(Error::Cancelled), n + 1)));
}

/// Fibres that bear no compression: at rest all are at their switch, and some turn over along the path.
fn fibres() -> (Body, Vec<u32>, Vec<f64>) {
    let (body, fixed, force) = cantilever("neo_hookean");
    let row = vec![2e5, 2e5, 0.8, 0.0, 1e6, 0.96, 0.28, 0.0, 0.96, -0.28, 0.0];
    let material = Material::new("holzapfel_gasser_ogden", vec![row]).unwrap();
    let body = Body::new(body.points().to_vec(), body.cells().to_vec(), material).unwrap();
    (body, fixed, force.iter().map(|f| 40.0 * f).collect())
}

#[test]
fn a_law_with_a_switch_is_followed_across_it() {
    let (body, fixed, force) = fibres();
    let exact = newton(&body, &fixed, &force, &NONE, 1.0);
    for parameter in [Parameter::Load, Parameter::ArcLength] {
        let path = settings(parameter).follow(&body, &fixed, &force, &NONE, &mut || true).unwrap();
        assert!(path.len() > 2, "{} expansions", path.len());
        for expansion in &path {
            assert!(expansion.residual <= 1e-6, "{parameter:?}: {:e}", expansion.residual);
        }
        let last = path.last().unwrap();
        let end = Pade::new(&last.series, 0).evaluate(&last.series, last.range);
        // The residual is 1e-6 of the load, in a beam that multiplies no error of force by more than a few.
        let gap = relative(&end[..body.n_dofs()], &exact);
        assert!(gap < 1e-5 && (end[body.n_dofs()] - 1.0).abs() < 1e-8, "{parameter:?}: {gap:e}");
        for pair in path.windows(2) {
            let end = Pade::new(&pair[0].series, 0).evaluate(&pair[0].series, pair[0].range);
            let gap = relative(&end, &pair[1].series[0]);
            assert!(gap < 1e-5, "{parameter:?}: an expansion begins {gap:e} from the last end");
        }
    }
}

#[test]
fn switches_that_take_all_expansions_are_an_error() {
    let (body, fixed, force) = fibres();
    let short = Continuation { max_expansions: 2, ..settings(Parameter::Load) };
    let error = short.follow(&body, &fixed, &force, &NONE, &mut || true).unwrap_err().to_string();
    assert!(error.contains("of 1 after 2 expansions; allow more"), "{error}");
}
