//! The separated series against the exact one, and against the appendix of paper A.

mod appendix;

use super::*;
use crate::body::Body;
use crate::equilibrium::Pressure;
use crate::error::Error;
use crate::law::Material;
use crate::mesh::samples::block;
use crate::mesh::{Surface, surface};
use std::sync::LazyLock;
use viscera_series::{Continuation, Parameter};

const LAWS: [&str; 2] = ["saint_venant_kirchhoff", "neo_hookean"];
const LOAD: f64 = 2.0;

/// A beam clamped at x = 0, loaded anywhere on its top face.
struct Beam {
    body: Body,
    surface: Surface,
    fixed: Vec<u32>,
    top: Vec<u32>,
}

impl Beam {
    fn new(law: &str) -> Self {
        let (points, cells) = block([6, 2, 2], [0.6, 0.1, 0.1]);
        let nodes = |is_in: &dyn Fn([f64; 3]) -> bool| -> Vec<u32> {
            (0..points.len() as u32).filter(|&n| is_in(points[n as usize])).collect()
        };
        let fixed = nodes(&|x| x[0] == 0.0);
        let top = nodes(&|x| x[0] > 0.0 && (x[2] - 0.1).abs() < 1e-12);
        let surface = Surface::new(&points, &surface(&points, &cells));
        let material = Material::new(law, vec![vec![3.0e4, 7.0e4]]).unwrap();
        Beam { body: Body::new(points, cells, material).unwrap(), surface, fixed, top }
    }

    fn loads(&self, radius: f64) -> Loads {
        Loads::new(&self.surface, &self.top, &self.fixed, radius).unwrap()
    }

    fn run(&self, route: Route, order: usize, loads: &Loads) -> Vec<Order> {
        let pgd = Pgd { order, load: LOAD, route };
        pgd.run(&self.body, &self.fixed, loads, &mut |_| true).unwrap()
    }
}

static BEAMS: LazyLock<[Beam; 2]> = LazyLock::new(|| LAWS.map(Beam::new));

fn enrichment(tolerance: f64) -> Enrichment {
    Enrichment { tolerance, max_terms: 60, stagnation: 1e-3, max_iterations: 60 }
}

/// Fields at every position, one after the other.
fn table(field: &Separated, n: usize, m: usize) -> Vec<Vec<f64>> {
    (0..m)
        .map(|s| {
            let mut u = vec![0.0; n];
            field.at(s, |f, g| u.iter_mut().zip(f).for_each(|(u, f)| *u += g * f));
            u
        })
        .collect()
}

/// `(sum_s w_s |a - b|^2 / sum_s w_s |b|^2)^1/2`.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>], weights: &[f64]) -> f64 {
    let square = |u: &mut dyn Iterator<Item = f64>| u.map(|x| x * x).sum::<f64>();
    let (mut gap, mut size) = (0.0, 0.0);
    for ((a, b), w) in a.iter().zip(b).zip(weights) {
        gap += w * square(&mut a.iter().zip(b).map(|(a, b)| a - b));
        size += w * square(&mut b.iter().copied());
    }
    (gap / size).sqrt()
}

#[test]
fn direct_orders_are_those_of_a_load_path() {
    for beam in &*BEAMS {
        let loads = beam.loads(0.0);
        let orders = beam.run(Route::Direct, 5, &loads);
        let mut force = vec![0.0; beam.body.n_dofs()];
        loads.unit[7].iter().for_each(|&(dof, f)| force[dof as usize] = LOAD * f);
        let path = Continuation {
            order: 5,
            parameter: Parameter::Load,
            until: 1.0,
            tolerance: 1e-6,
            max_expansions: 1,
        };
        let path = path
            .follow(&beam.body, &beam.fixed, &force, &Pressure::default(), &mut || true)
            .unwrap();
        let exact = &path[0].series;
        for (p, order) in orders.iter().enumerate() {
            let n = beam.body.n_dofs();
            let gap =
                difference(&[order.field.space[7].clone()], &[exact[p + 1][..n].to_vec()], &[1.0]);
            assert!(gap < 1e-10, "order {}: {gap:e}", p + 1);
        }
    }
}

/// With a tight tolerance nothing is lost on the way from order to order; with a loose one it is.
#[test]
fn separated_orders_are_the_direct_ones_to_tolerance() {
    for beam in &*BEAMS {
        for radius in [0.0, 0.12] {
            let (loads, n) = (beam.loads(radius), beam.body.n_dofs());
            let direct = beam.run(Route::Direct, 4, &loads);
            let errors = |tolerance: f64| -> Vec<f64> {
                let found = beam.run(Route::Greedy(enrichment(tolerance)), 4, &loads);
                let fields = found.iter().zip(&direct);
                fields
                    .map(|(f, d)| {
                        let [f, d] = [f, d].map(|o| table(&o.field, n, loads.len()));
                        difference(&f, &d, &loads.weights)
                    })
                    .collect()
            };
            let (tight, loose) = (errors(1e-8), errors(0.05));
            assert!(tight.iter().all(|e| *e < 1e-6), "{tight:?}");
            assert!(loose[0] < 0.05 && loose[3] > 10.0 * loose[0], "{loose:?}");
        }
    }
}

/// Every pair takes its own energy off the error, so the error falls with each.
#[test]
fn enrichment_converges_monotonically_by_the_energy_of_each_pair() {
    let beam = &BEAMS[1];
    let loads = beam.loads(0.0);
    let direct = &beam.run(Route::Direct, 1, &loads)[0].field;
    let energy: f64 = loads
        .unit
        .iter()
        .zip(&direct.space)
        .zip(&loads.weights)
        .map(|((f, u), w)| w * f.iter().map(|&(dof, f)| LOAD * f * u[dof as usize]).sum::<f64>())
        .sum();
    let found = &beam.run(Route::Greedy(enrichment(1e-8)), 1, &loads)[0];
    let mut left = energy;
    for (k, size) in found.sizes.iter().enumerate() {
        assert!(*size > 0.0 && *size <= 1.001 * found.sizes[0], "pair {k}");
        left -= size * size;
        assert!(left > -1e-12 * energy, "pair {k} takes more than there is");
    }
    assert!(left < 1e-12 * energy, "left {left:e} of {energy:e}");
    assert_eq!(found.sizes.len(), found.iterations.len());
}

/// They were taken for orders of which nothing is left.
#[test]
fn orders_that_are_not_finite_are_errors() {
    let loads = BEAMS[1].loads(0.0);
    let told = |load: f64, route: Route| {
        let pgd = Pgd { order: 2, load, route };
        let result = pgd.run(&BEAMS[1].body, &BEAMS[1].fixed, &loads, &mut |_| true);
        result.map(|orders| orders.len()).unwrap_err().to_string()
    };
    let far = told(1e200, Route::Direct);
    let words = format!("for the load of 1.0e200 N at node {};", BEAMS[1].top[0]);
    assert!(far.starts_with("order 2: the forces are not finite") && far.contains(&words), "{far}");
    let overflow = told(1e200, Route::Greedy(enrichment(0.1)));
    assert!(overflow.starts_with("the squares of the forces overflow"), "{overflow}");
}

/// A linear law leaves nothing to the higher orders.
#[test]
fn orders_of_which_nothing_is_left_have_no_pairs() {
    let beam = Beam::new("linear");
    let orders = beam.run(Route::Greedy(enrichment(0.1)), 3, &beam.loads(0.0));
    assert!(!orders[0].field.is_empty());
    assert!(orders[1..].iter().all(|order| order.field.is_empty() && !order.is_cut));
}

#[test]
fn a_formula_without_a_power_series_about_rest_is_refused() {
    let beam = &BEAMS[0];
    let law = "formula mu/2*(I1bar - 3) + mu*max(I1bar - 3, 0)**n + lam*log(J)**2";
    let rows = |n: f64| vec![vec![1e4, n, 1e5]];
    let run = |n: f64| {
        let material = Material::new(law, rows(n)).unwrap();
        let body = Body::new(beam.body.points().to_vec(), beam.body.cells().to_vec(), material);
        let pgd = Pgd { order: 3, load: LOAD, route: Route::Greedy(enrichment(0.1)) };
        pgd.run(&body.unwrap(), &beam.fixed, &beam.loads(0.0), &mut |_| true)
    };
    let told = run(2.5).unwrap_err().to_string();
    assert!(told.contains("raises to the power 2.5 is zero there"), "{told}");
    assert!(run(2.0).unwrap().iter().all(|order| !order.field.is_empty()));
}

#[test]
fn a_limit_on_pairs_is_said() {
    let loads = BEAMS[0].loads(0.0);
    let few = Enrichment { max_terms: 3, ..enrichment(1e-6) };
    let found = BEAMS[0].run(Route::Greedy(few), 2, &loads);
    assert!(found.iter().all(|order| order.is_cut && order.field.len() == 3));
    let enough = BEAMS[0].run(Route::Greedy(enrichment(0.1)), 2, &loads);
    assert!(enough.iter().all(|order| !order.is_cut));
}

#[test]
fn compression_keeps_its_tolerance_with_orthogonal_modes() {
    let (beam, loads) = (&BEAMS[1], BEAMS[1].loads(0.0));
    let n = beam.body.n_dofs();
    for route in [Route::Direct, Route::Greedy(enrichment(1e-8))] {
        let field = &beam.run(route, 1, &loads)[0].field;
        let exact = table(field, n, loads.len());
        let mut before = usize::MAX;
        for tolerance in [1e-6, 1e-2, 0.3] {
            let small = field.compress(&loads.weights, tolerance).unwrap();
            let gap = difference(&table(&small, n, loads.len()), &exact, &loads.weights);
            assert!(gap <= tolerance && gap > 0.0 && small.len() < before, "{tolerance}: {gap}");
            before = small.len();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for (i, f) in small.space.iter().enumerate() {
                assert!((dot(f, f) - 1.0).abs() < 1e-10);
                assert!(small.space[..i].iter().all(|other| dot(f, other).abs() < 1e-10));
            }
        }
    }
    assert!(Separated::default().compress(&[], 0.1).unwrap().is_empty());
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let loads = BEAMS[1].loads(0.0);
    let results = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| BEAMS[1].run(Route::Greedy(enrichment(0.01)), 3, &loads))
    });
    for (a, b) in results[0].iter().zip(&results[1]) {
        assert!(a.field.space == b.field.space && a.field.position == b.field.position);
    }
}

/// Where it converges it is the solution; where full steps overshoot it says how far it came.
#[test]
fn plain_newton_solves_or_says_how_far_it_came() {
    for beam in &*BEAMS {
        let loads = beam.loads(0.0);
        let force = |load: f64| {
            let mut force = vec![0.0; beam.body.n_dofs()];
            loads.unit[10].iter().for_each(|&(dof, f)| force[dof as usize] = load * f);
            force
        };
        let newton = PlainNewton { increments: 4, max_iterations: 20, tolerance: 1e-10 };
        let found = newton.solve(&beam.body, &beam.fixed, &force(LOAD), &mut || true).unwrap();
        let mut internal = vec![0.0; beam.body.n_dofs()];
        beam.body.internal_force(&found.displacement, &mut internal);
        let is_free = |dof: usize| !beam.fixed.contains(&(dof as u32 / 3));
        let worst = (0..internal.len())
            .filter(|&dof| is_free(dof))
            .fold(0.0f64, |max, dof| max.max((internal[dof] - force(LOAD)[dof]).abs()));
        assert!(found.increments == 4 && worst < 1e-9 * LOAD, "{worst:e}");
        let once = PlainNewton { increments: 1, ..newton };
        let failed =
            once.solve(&beam.body, &beam.fixed, &force(500.0 * LOAD), &mut || true).unwrap();
        assert!(failed.increments == 0 && failed.displacement.iter().all(|u| *u == 0.0));
        let bad = PlainNewton { increments: 0, ..newton };
        assert!(bad.solve(&beam.body, &beam.fixed, &force(LOAD), &mut || true).is_err());
        assert!(newton.solve(&beam.body, &beam.fixed, &force(f64::NAN), &mut || true).is_err());
    }
}

type Work<'a> = dyn Fn(&mut dyn FnMut() -> bool) -> Result<usize, Error> + 'a;

/// Work that asks whether to go on ends at the first no; it asks at least as often as `run` returns.
fn ends_when_told(run: &Work) {
    let stopped_after = |allowed: usize| {
        let mut asked = 0;
        let outcome = run(&mut || {
            asked += 1;
            asked <= allowed
        });
        (outcome, asked)
    };
    let (least, asked) = stopped_after(usize::MAX);
    assert!(least.as_ref().is_ok_and(|&least| least > 2 && asked >= least), "{least:?} {asked}");
    for allowed in (0..asked).step_by(asked.div_ceil(5)) {
        assert_eq!(stopped_after(allowed), (Err(Error::Cancelled), allowed + 1));
    }
}

#[test]
fn plain_newton_can_be_stopped_in_every_iteration_and_pgd_for_every_pair_and_order() {
    let beam = &BEAMS[1];
    let loads = beam.loads(0.0);
    let mut force = vec![0.0; beam.body.n_dofs()];
    loads.unit[10].iter().for_each(|&(dof, f)| force[dof as usize] = LOAD * f);
    let newton = PlainNewton { increments: 2, max_iterations: 20, tolerance: 1e-10 };
    ends_when_told(&|go_on| {
        newton.solve(&beam.body, &beam.fixed, &force, go_on).map(|found| found.iterations)
    });
    for route in [Route::Greedy(enrichment(1e-3)), Route::Direct] {
        let pgd = Pgd { order: 3, load: LOAD, route };
        ends_when_told(&|go_on| {
            let orders = pgd.run(&beam.body, &beam.fixed, &loads, &mut |_| go_on())?;
            Ok(orders.iter().map(|order| 1 + order.sizes.len()).sum())
        });
    }
}

#[test]
fn bad_settings_are_refused_by_name_and_value() {
    let beam = &BEAMS[0];
    let loads = beam.loads(0.0);
    let good = Pgd { order: 2, load: LOAD, route: Route::Direct };
    let greedy = |e: Enrichment| Pgd { route: Route::Greedy(e), ..good };
    let base = Enrichment::default();
    let cases = [
        (Pgd { order: 0, ..good }, "order 0"),
        (Pgd { order: 16, ..good }, "order 16"),
        (Pgd { load: 0.0, ..good }, "load 0 N"),
        (Pgd { load: f64::NAN, ..good }, "load NaN N"),
        (greedy(Enrichment { tolerance: 0.0, ..base }), "tolerance of enrichment is 0;"),
        (greedy(Enrichment { stagnation: 1.0, ..base }), "stagnation of enrichment is 1;"),
        (greedy(Enrichment { max_terms: 0, ..base }), "max_terms of enrichment is 0;"),
        (greedy(Enrichment { max_iterations: 0, ..base }), "max_iterations of enrichment is 0;"),
    ];
    for (pgd, words) in cases {
        let error = pgd.run(&beam.body, &beam.fixed, &loads, &mut |_| true).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
    let floating = good.run(&beam.body, &[], &loads, &mut |_| true).unwrap_err();
    assert!(floating.to_string().contains("nothing is fixed"));
    let stopped = good.run(&beam.body, &beam.fixed, &loads, &mut |_| false).unwrap_err();
    assert_eq!(stopped, Error::Cancelled);
    let refused = |nodes: &[u32], radius: f64| {
        Loads::new(&beam.surface, nodes, &beam.fixed, radius).unwrap_err().to_string()
    };
    let inside = (0..beam.body.points().len() as u32).find(|&n| !beam.surface.contains(n)).unwrap();
    assert!(refused(&[], 0.0).contains("no load position"));
    assert!(refused(&beam.top, -1.0).contains("radius -1"));
    assert!(refused(&[beam.fixed[0]], 0.0).contains("is fixed"));
    assert!(refused(&[inside], 0.0).contains("no node of the surface"));
    assert!(refused(&[beam.top[0], beam.top[0]], 0.0).contains("given twice"));
}
