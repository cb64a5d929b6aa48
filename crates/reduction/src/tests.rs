//! The reduced model against the exact series it was made from.

mod departure;
mod family;
mod file;
mod pade;
mod places;
mod preload;
mod recompress;
mod work;

use super::correction::Correction;
use super::measure::DIRECTIONS;
use super::*;
use crate::body::Body;
use crate::error::Error;
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{Patch, Surface, surface};
use crate::number::{evaluate_monomials, norm, on_sphere};
use crate::series::{TouchExpansion, TouchSeries};
use std::sync::LazyLock;
use viscera_touch::{Notes, Places, to_bytes};

const SIZE: [f64; 3] = [0.04, 0.03, 0.03];
const DEPTH: f64 = 0.004;
const TOLERANCE: f64 = 1e-3;

/// A block held at the bottom, touched at the top.
struct FullModel {
    body: Body,
    surface: Surface,
    fixed: Vec<u32>,
    top: Vec<u32>,
}

static FULL: LazyLock<FullModel> = LazyLock::new(|| {
    let (points, cells) = block([4, 3, 3], SIZE);
    let at = |z: f64| -> Vec<u32> {
        (0..points.len() as u32).filter(|&n| (points[n as usize][2] - z).abs() < 1e-12).collect()
    };
    let law = Material::new("neo_hookean", vec![vec![3.0e3, 11.0e3]]).unwrap();
    let surface = Surface::new(&points, &surface(&points, &cells));
    let (fixed, top) = (at(0.0), at(SIZE[2]));
    FullModel { body: Body::new(points, cells, law).unwrap(), surface, fixed, top }
});

static MODEL: LazyLock<ReducedModel> = LazyLock::new(|| reduce(&settings()).unwrap());

fn settings() -> Reduction {
    Reduction {
        touchable: FULL.top.clone(),
        radius: 0.012,
        depth: DEPTH,
        order: 3,
        tolerance: TOLERANCE,
        pade: false,
        memory: 1e9,
        device: None,
        preload: Vec::new(),
        user: Notes::new(r#"{"note": "a block"}"#).unwrap(),
    }
}

fn reduce(settings: &Reduction) -> Result<ReducedModel, Error> {
    settings.run(&FULL.body, &FULL.surface, &FULL.fixed, &mut |_| true)
}

/// The series the model was made from, for any patch.
fn series(patch: &Patch) -> TouchSeries {
    let base = vec![0.0; FULL.body.n_dofs()];
    let expansion = TouchExpansion::new(&FULL.body, &FULL.fixed, base, 3).unwrap();
    expansion.expand(&[patch], 3).unwrap().remove(0)
}

fn exact(series: &TouchSeries, d: [f64; 3]) -> (Vec<f64>, [f64; 3]) {
    let mut monomials = vec![0.0; MODEL.n_terms()];
    evaluate_monomials(MODEL.exponents(), d, &mut monomials);
    let mut field = vec![0.0; series.displacement[0].len()];
    let mut force = [0.0; 3];
    for (t, m) in monomials.iter().enumerate() {
        field.iter_mut().zip(&series.displacement[t]).for_each(|(f, u)| *f += m * u);
        force.iter_mut().zip(series.force[t]).for_each(|(f, c)| *f += m * c);
    }
    (field, force)
}

fn field(model: &ReducedModel, contact: &Contact, d: [f64; 3]) -> Vec<f64> {
    let mut workspace = vec![0.0; model.field_workspace_len()];
    let mut field = vec![0.0; 3 * model.n_points()];
    model.displacement(contact, d, &mut workspace, &mut field);
    field.into_iter().map(f64::from).collect()
}

/// A contact inside a triangle.
fn inside(triangle: usize, weights: [f64; 3]) -> Contact {
    Contact { weights, ..MODEL.centroid(triangle) }
}

fn relative(a: &[f64], exact: &[f64]) -> f64 {
    norm(&a.iter().zip(exact).map(|(a, b)| a - b).collect::<Vec<_>>()) / norm(exact)
}

/// Displacements of full depth to the faces, edges and corners of a cube.
fn directions() -> Vec<[f64; 3]> {
    let corner = |code: i32| [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1].map(f64::from);
    let unit = |v: [f64; 3]| v.map(|x| DEPTH * x / norm(&v));
    (0..27).filter(|&code| code != 13).map(|code| unit(corner(code))).collect()
}

#[test]
fn at_a_position_force_and_field_are_those_of_the_series() {
    for (p, &node) in MODEL.arrays().positions.iter().enumerate() {
        let point = FULL.body.points()[node as usize];
        let contact = MODEL.locate(point).unwrap();
        assert!(contact.distance < 1e-15 && MODEL.is_on_surface(&contact));
        let patch = FULL.surface.patch_at_node(node, 0.012, &|_| false).unwrap();
        let series = series(&patch);
        let mut squares = 0.0;
        for d in directions() {
            let (u, force) = exact(&series, d);
            assert!(relative(&MODEL.respond(&contact, d).force, &force) < 1e-10, "position {p}");
            let error = relative(&field(&MODEL, &contact, d), &u);
            // What is measured off-line, and single precision with negligible modes on top.
            assert!(error < MODEL.metadata().errors.compression + 2e-5, "position {p}: {error:e}");
            squares += error * error / directions().len() as f64;
        }
        assert!(squares.sqrt() < TOLERANCE, "position {p}: {:e}", squares.sqrt());
    }
}

/// The first order between positions is no interpolation but the solution for the blended patch.
#[test]
fn between_positions_the_first_order_is_exact() {
    for triangle in 0..MODEL.triangles().len() {
        let contact = inside(triangle, [0.2, 0.5, 0.3]);
        let series = series(&MODEL.patch(&contact));
        let d = [3e-10, -2e-10, 5e-10];
        let (u, force) = exact(&series, d);
        assert!(relative(&MODEL.respond(&contact, d).force, &force) < 1e-7, "triangle {triangle}");
        // Modes are stored in 16 bits.
        let error = relative(&field(&MODEL, &contact, d), &u);
        assert!(error < 1e-4, "triangle {triangle}: {error:e}");
    }
}

/// Nor is the second: the sum of both is that of the blended patch's own series, at any depth.
#[test]
fn between_positions_the_second_order_is_exact() {
    let mut workspace = vec![0.0; MODEL.field_workspace_len()];
    for triangle in 0..MODEL.triangles().len() {
        let contact = inside(triangle, [0.2, 0.5, 0.3]);
        let patch = MODEL.patch(&contact);
        let mut series = series(&patch);
        for term in 9..MODEL.n_terms() {
            series.displacement[term].fill(0.0);
            series.force[term] = [0.0; 3];
        }
        let d = directions()[triangle % 26];
        let (u, force) = exact(&series, d);
        let answer = MODEL.force_to_order(&contact, d, 2);
        let error = relative(&answer, &force);
        assert!(error < 1e-9, "triangle {triangle}: {error:e}");
        let mut surface = vec![0.0; 3 * MODEL.arrays().surface_nodes.len()];
        MODEL.surface_displacement_to_order(&contact, d, 2, &mut workspace, &mut surface);
        let nodes = MODEL.arrays().surface_nodes.iter();
        let wanted: Vec<f64> =
            nodes.flat_map(|&n| u[3 * n as usize..3 * n as usize + 3].to_vec()).collect();
        let found: Vec<f64> = surface.into_iter().map(f64::from).collect();
        let error = relative(&found, &wanted);
        assert!(
            error < 2.0 * MODEL.metadata().errors.compression,
            "triangle {triangle}: {error:e}"
        );
    }
}

#[test]
fn interpolation_errors_are_those_the_model_admits() {
    let mut worst: f64 = 0.0;
    let count = MODEL.triangles().len();
    for triangle in 0..count {
        let contact = MODEL.centroid(triangle);
        let series = series(&MODEL.patch(&contact));
        for k in 0..DIRECTIONS {
            let d = on_sphere(k * count + triangle, DIRECTIONS * count).map(|x| DEPTH * x);
            let (u, force) = exact(&series, d);
            let response = MODEL.respond(&contact, d);
            worst = worst.max(relative(&field(&MODEL, &contact, d), &u));
            let error =
                relative(&response.force, &force).max(relative(&field(&MODEL, &contact, d), &u));
            // An estimate, no bound: on this coarse surface the worst is 2.1 times its estimate.
            assert!(
                error < 3.0 * response.shape_error_estimate,
                "triangle {triangle}, direction {k}"
            );
        }
    }
    let admitted = MODEL.metadata().errors.interpolation;
    assert!((worst - admitted).abs() < 1e-6 && admitted > 0.0, "{worst:e}, said {admitted:e}");
    assert!(MODEL.metadata().errors.interpolation_half_depth < admitted);
}

/// Central differences over 1e-7 m of forces of about 1 N: exact to about 1e-8.
#[test]
fn stiffness_is_the_derivative_of_the_force() {
    for (triangle, d) in noise(12, 3).chunks_exact(3).enumerate() {
        let contact = inside(triangle, [0.25, 0.15, 0.6]);
        let d: [f64; 3] = std::array::from_fn(|i| DEPTH * d[i]);
        let stiffness = MODEL.respond(&contact, d).stiffness;
        for j in 0..3 {
            let moved = |step: f64| {
                let mut d = d;
                d[j] += step;
                MODEL.respond(&contact, d).force
            };
            let (plus, minus) = (moved(1e-7), moved(-1e-7));
            let difference: [f64; 3] = std::array::from_fn(|i| (plus[i] - minus[i]) / 2e-7);
            let column = [stiffness[0][j], stiffness[1][j], stiffness[2][j]];
            assert!(relative(&difference, &column) < 1e-7);
        }
    }
}

/// A touch by a lower order is the same series with fewer terms; by order 1 it is linear in the displacement.
#[test]
fn orders_are_cut_where_they_are_asked_to_be() {
    let contact = inside(5, [0.2, 0.5, 0.3]);
    let mut workspace = vec![0.0; MODEL.field_workspace_len()];
    let mut surface = |d: [f64; 3], order: usize| {
        let mut out = vec![0.0; 3 * MODEL.arrays().surface_nodes.len()];
        MODEL.surface_displacement_to_order(&contact, d, order, &mut workspace, &mut out);
        out.into_iter().map(f64::from).collect::<Vec<f64>>()
    };
    let d = [0.002, -0.004, -0.006];
    let all = MODEL.respond(&contact, d).force;
    assert!(relative(&MODEL.force_to_order(&contact, d, 3), &all) < 1e-14);
    // What order p adds grows with the p-th power of the displacement.
    for order in 1..=3 {
        let [once, twice] = [1.0, 2.0].map(|factor| {
            let d = d.map(|x| factor * x);
            let (mut field, mut force) =
                (surface(d, order), MODEL.force_to_order(&contact, d, order));
            if order > 1 {
                let lower = MODEL.force_to_order(&contact, d, order - 1);
                field.iter_mut().zip(surface(d, order - 1)).for_each(|(u, lower)| *u -= lower);
                force.iter_mut().zip(lower).for_each(|(f, lower)| *f -= lower);
            }
            (field, force)
        });
        let scale = 2f64.powi(order as i32);
        let expected: Vec<f64> = once.1.iter().map(|f| scale * f).collect();
        assert!(relative(&twice.1, &expected) < 1e-10, "force of order {order}");
        let expected: Vec<f64> = once.0.iter().map(|u| scale * u).collect();
        // Single precision, and modes left out below 1e-5 of the tool's displacement.
        let error = relative(&twice.0, &expected);
        assert!(error < 2e-3, "field of order {order}: {error:e}");
    }
}

#[test]
fn answers_are_continuous_across_edges() {
    let mut crossed = 0;
    for edge in 0..MODEL.arrays().edges.len() / 2 {
        let ends = &MODEL.arrays().edges[2 * edge..2 * edge + 2];
        let on_edge = |t: usize| {
            let share = |p: u32| 0.3 * f64::from(p == ends[0]) + 0.7 * f64::from(p == ends[1]);
            inside(t, MODEL.triangles()[t].map(share))
        };
        let has_ends = |&t: &usize| ends.iter().all(|p| MODEL.triangles()[t].contains(p));
        let sides: Vec<usize> = (0..MODEL.triangles().len()).filter(has_ends).collect();
        let [one, other] = sides[..] else { continue };
        crossed += 1;
        let d = [0.002, -0.001, -0.003];
        let (a, b) = (MODEL.respond(&on_edge(one), d), MODEL.respond(&on_edge(other), d));
        assert!(relative(&a.force, &b.force) < 1e-12);
        assert!(relative(&a.stiffness.concat(), &b.stiffness.concat()) < 1e-12);
        assert!((a.error_estimate - b.error_estimate).abs() < 1e-12);
        assert!((a.shape_error_estimate - b.shape_error_estimate).abs() < 1e-12);
        // Single precision, and modes left out below 1e-5 of the tool's displacement.
        let (a, b) = (field(&MODEL, &on_edge(one), d), field(&MODEL, &on_edge(other), d));
        assert!(relative(&a, &b) < 2e-5);
    }
    assert!(crossed > 10, "{crossed} edges have two sides");
}

#[test]
fn trust_ends_at_the_depth_and_where_the_series_does() {
    let contact = MODEL.centroid(3);
    let answer = |model: &ReducedModel, depth: f64| model.respond(&contact, [0.0, 0.0, -depth]);
    assert_eq!(answer(&MODEL, 0.1 * DEPTH).trust, Trust::Trusted);
    assert_eq!(answer(&MODEL, 1.01 * DEPTH).trust, Trust::BeyondDepth);
    let still = answer(&MODEL, 0.0);
    assert_eq!((still.trust, still.force, still.error_estimate), (Trust::Trusted, [0.0; 3], 0.0));
    let (metadata, arrays) = MODEL.clone().into_parts();
    let deeper = ReducedModel::new(Metadata { depth: 0.025, ..metadata }, arrays).unwrap();
    let response = answer(&deeper, 0.024);
    assert_eq!(response.trust, Trust::ErrorTooLarge);
    assert!(response.error_estimate > allowance(0.024 / MODEL.metadata().diagonal));
    assert!(response.error_estimate <= 1.0);
    let (small, large) = (answer(&MODEL, 0.5 * DEPTH), answer(&MODEL, DEPTH));
    assert!(small.error_estimate < large.error_estimate);
    assert_ne!(answer(&MODEL, f64::NAN).trust, Trust::Trusted);
    assert_ne!(answer(&MODEL, f64::INFINITY).trust, Trust::Trusted);
}

#[test]
fn a_point_is_located_or_said_to_be_off_the_surface() {
    let above = MODEL.locate([0.017, 0.013, SIZE[2] + 0.2]).unwrap();
    assert!((above.distance - 0.2).abs() < 1e-12 && !MODEL.is_on_surface(&above));
    assert!((above.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    assert!(
        norm(&[above.point[0] - 0.017, above.point[1] - 0.013, above.point[2] - SIZE[2]]) < 1e-15
    );
    assert!(MODEL.locate([f64::NAN, 0.0, 0.0]).is_none());
    let patch = MODEL.patch(&above);
    assert!((patch.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
}

#[test]
fn surfaces_that_cannot_be_touched_are_refused() {
    let refused = |touchable: &[u32]| {
        let settings = Reduction { touchable: touchable.to_vec(), ..settings() };
        reduce(&settings).err().map_or("accepted".to_string(), |e| e.to_string())
    };
    let inside = (0..80).find(|&n| !FULL.surface.contains(n)).unwrap();
    let with = |node: u32| FULL.top.iter().copied().chain([node]).collect::<Vec<u32>>();
    let cases = [
        (refused(&with(FULL.fixed[2])), "point 2 is both touchable and fixed"),
        (refused(&with(inside)), "is not on the surface"),
        (refused(&with(80)), "touchable point 80 is not on the surface"),
        (refused(&FULL.top[..2]), "the 2 touchable points span no surface triangle"),
        (refused(&[]), "the 0 touchable points span no surface triangle"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn bad_settings_are_refused() {
    let refused = |change: &dyn Fn(&mut Reduction)| {
        let mut settings = settings();
        change(&mut settings);
        reduce(&settings).err().map_or("accepted".to_string(), |e| e.to_string())
    };
    let cases = [
        (refused(&|s| s.order = 1), "order 1; it must be between 2 and 8"),
        (refused(&|s| s.order = 9), "order 9"),
        (refused(&|s| s.radius = 0.0), "radius = 0"),
        (refused(&|s| s.depth = 1.0), "depth = 1"),
        (refused(&|s| s.depth = f64::NAN), "depth = NaN"),
        (refused(&|s| s.tolerance = 1.0), "tolerance = 1"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
    let floating = settings().run(&FULL.body, &FULL.surface, &[], &mut |_| true);
    assert!(floating.unwrap_err().to_string().contains("nothing is fixed"));
}

#[test]
fn progress_reaches_the_end_and_may_stop_the_work() {
    let mut seen = Vec::new();
    let mut watch = |p: Progress| {
        seen.push((p.done, p.total));
        true
    };
    settings().run(&FULL.body, &FULL.surface, &FULL.fixed, &mut watch).unwrap();
    assert!(seen.is_sorted() && seen.last() == Some(&(20, 20)), "{seen:?}");
    let stopped = settings().run(&FULL.body, &FULL.surface, &FULL.fixed, &mut |_| false);
    assert_eq!(stopped.unwrap_err(), Error::Cancelled);
}

#[test]
fn the_model_is_the_same_on_any_number_of_threads() {
    let files = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (metadata, arrays) = pool.install(|| reduce(&settings()).unwrap()).into_parts();
        to_bytes(&Metadata { seconds: 0.0, ..metadata }, &arrays).unwrap()
    });
    assert!(MODEL.arrays().region_start.len() > 2, "one region is no test");
    assert!(files[0] == files[1] && files[0] == files[2]);
}
