//! The series against their definition and against Newton's method.

use super::*;
use crate::body::{ProgrammedCells, ProgrammedSeries};
use crate::equilibrium::{
    Device, DeviceSeries, DeviceSystem, Newton, OnDevice, PatchLoad, Pressure, Problem,
    SERIES_LANES, patch_mean,
};
use crate::law::samples::{analytic, uniform};
use crate::mesh::samples::block;
use crate::mesh::{Surface, surface};
use crate::number::{Lanes, evaluate_monomials};
use viscera_solid::element::Element;

const SIZE: [f64; 3] = [0.04, 0.03, 0.03];

fn organ(law: &str) -> Body {
    let (points, cells) = block([4, 3, 3], SIZE);
    Body::new(points, cells, uniform(law)).unwrap()
}

/// Nodes of the bottom, z = 0.
fn bottom(body: &Body) -> Vec<u32> {
    (0..body.points().len() as u32).filter(|&n| body.points()[n as usize][2] == 0.0).collect()
}

/// Patches around `count` nodes of the top.
fn patches(body: &Body, count: usize) -> Vec<Patch> {
    let surface = Surface::new(body.points(), &surface(body.points(), body.cells()));
    let is_top = |n: &u32| body.points()[*n as usize][2] > SIZE[2] - 1e-12;
    let top = (0..body.points().len() as u32).filter(is_top).skip(6).take(count);
    top.map(|n| surface.patch_at_node(n, 0.012, &|_| false).unwrap()).collect()
}

fn expand(body: &Body, patches: &[Patch], order: usize) -> Vec<TouchSeries> {
    let fixed = bottom(body);
    let expansion = TouchExpansion::new(body, &fixed, vec![0.0; body.n_dofs()], order).unwrap();
    expansion.expand(&patches.iter().collect::<Vec<_>>(), order).unwrap()
}

/// Field and force of the series at a displacement of the tool.
fn evaluate(series: &TouchSeries, order: usize, d: [f64; 3]) -> (Vec<f64>, [f64; 3]) {
    let exponents = &Monomials::of(3, order).exponents()[1..];
    let mut monomials = vec![0.0; exponents.len()];
    evaluate_monomials(exponents, d, &mut monomials);
    let mut field = vec![0.0; series.displacement[0].len()];
    let mut force = [0.0; 3];
    for (t, m) in monomials.iter().enumerate() {
        field.iter_mut().zip(&series.displacement[t]).for_each(|(f, u)| *f += m * u);
        force.iter_mut().zip(series.force[t]).for_each(|(f, c)| *f += m * c);
    }
    (field, force)
}

/// Field and force by Newton's method.
fn exact(body: &Body, patch: &Patch, d: [f64; 3]) -> (Vec<f64>, [f64; 3]) {
    let held = bottom(body).into_iter().flat_map(|n| (0..3).map(move |i| (3 * n + i, 0.0)));
    let problem = Problem {
        body,
        prescribed: held.collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: vec![PatchLoad { patch: patch.clone(), displacement: d }],
        start: None,
    };
    let newton = Newton { tolerance: 1e-13, ..Newton::default() };
    let state = newton.solve(&problem, &mut |_| true).unwrap();
    assert!(state.status.is_converged(), "{}", state.message);
    (state.displacement, state.patch_forces[0])
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_patch_moves_by_the_displacement_and_nothing_else() {
    let body = organ("neo_hookean");
    let patches = patches(&body, 2);
    for (patch, series) in patches.iter().zip(expand(&body, &patches, 4)) {
        assert_eq!((series.displacement.len(), series.force.len()), (34, 34));
        for (term, u) in series.displacement.iter().enumerate() {
            let largest = u.iter().fold(0.0f64, |max, u| max.max(u.abs()));
            let expected: [f64; 3] = std::array::from_fn(|i| (i == term) as u8 as f64);
            assert!(distance(&patch_mean(patch, u), &expected) < 1e-12 * largest, "term {term}");
            let held = bottom(&body).into_iter().flat_map(|n| 3 * n as usize..3 * n as usize + 3);
            assert!(held.map(|dof| u[dof]).all(|u| u == 0.0), "term {term} moves what is fixed");
        }
        // The first order is the compliance turned round: F = C^-1 d.
        for i in 0..3 {
            let unit: [f64; 3] = std::array::from_fn(|j| {
                (0..3).map(|k| series.compliance[i][k] * series.force[j][k]).sum()
            });
            assert!(
                distance(&unit, &std::array::from_fn::<f64, 3, _>(|j| (i == j) as u8 as f64))
                    < 1e-12
            );
        }
    }
}

/// Halving the depth divides what a series of order p leaves by 2^(p+1), for the field and for the
/// force, which Newton's method finds as the multiplier of the patch.
#[test]
fn errors_against_newton_fall_with_the_order() {
    for law in analytic().filter(|law| *law != "linear") {
        let body = organ(law);
        let patch = &patches(&body, 1)[0];
        for order in [1, 2, 4] {
            let series = &expand(&body, std::slice::from_ref(patch), order)[0];
            let error = |depth: f64| {
                let d = [0.48, -0.36, -0.8].map(|n| depth * n);
                let ((u, f), (exact_u, exact_f)) =
                    (evaluate(series, order, d), exact(&body, patch, d));
                [
                    distance(&u, &exact_u) / distance(&exact_u, &vec![0.0; u.len()]),
                    distance(&f, &exact_f) / distance(&exact_f, &[0.0; 3]),
                ]
            };
            let (near, far) = (error(0.001), error(0.002));
            for (what, (near, far)) in ["field", "force"].iter().zip(near.iter().zip(far)) {
                let rate = (far / near).log2();
                // Relative errors: one power of the depth less.
                assert!(
                    (rate - order as f64).abs() < 0.35,
                    "{law}, order {order}: {what} {rate:.2}"
                );
                assert!(far < 0.2f64.powi(order as i32), "{law}, order {order}: {what} {far:e}");
            }
        }
    }
}

#[test]
fn a_linear_law_has_a_linear_series() {
    let body = organ("linear");
    let patch = &patches(&body, 1)[0];
    let series = &expand(&body, std::slice::from_ref(patch), 3)[0];
    let scale = series.force[0][0].abs();
    // Third-order coefficients carry 1 / m^2; at a depth of 0.01 m they would add 1e-4 of themselves.
    assert!(series.force[3..].iter().flatten().all(|f| 1e-4 * f.abs() < 1e-11 * scale));
    let d = [0.004, -0.002, -0.006];
    let ((u, f), (exact_u, exact_f)) = (evaluate(series, 3, d), exact(&body, patch, d));
    assert!(distance(&u, &exact_u) < 1e-11 * distance(&u, &vec![0.0; u.len()]));
    assert!(distance(&f, &exact_f) < 1e-11 * distance(&f, &[0.0; 3]));
}

/// About a loaded state: the series starts from there.
#[test]
fn a_series_about_a_deformed_state_continues_it() {
    let body = organ("neo_hookean");
    let patch = &patches(&body, 1)[0];
    let base = [0.0, 0.0, -0.002];
    let fixed = bottom(&body);
    // Held at the base by the patch, which the expansion then moves further.
    let (start, start_force) = exact(&body, patch, base);
    let expansion = TouchExpansion::new(&body, &fixed, start.clone(), 3).unwrap();
    let series = &expansion.expand(&[patch], 3).unwrap()[0];
    let error = |depth: f64| {
        let d = [depth, 0.0, -depth];
        let (u, f) = evaluate(series, 3, d);
        let (exact_u, exact_f) = exact(&body, patch, std::array::from_fn(|i| base[i] + d[i]));
        let moved: Vec<f64> = exact_u.iter().zip(&start).map(|(a, b)| a - b).collect();
        let added: [f64; 3] = std::array::from_fn(|i| exact_f[i] - start_force[i]);
        [
            distance(&u, &moved) / distance(&moved, &vec![0.0; u.len()]),
            distance(&f, &added) / distance(&added, &[0.0; 3]),
        ]
    };
    let (near, far) = (error(0.0005), error(0.001));
    for (near, far) in near.iter().zip(far) {
        assert!(((far / near).log2() - 3.0).abs() < 0.35 && far < 1e-3, "{near:e} {far:e}");
    }
}

/// Nine positions fill one block of eight and start another.
#[test]
fn positions_do_not_depend_on_their_company() {
    let body = organ("mooney_rivlin J^2-1");
    let patches = patches(&body, 9);
    assert_eq!(patches.len(), WIDTH + 1);
    let together = expand(&body, &patches, 3);
    for (patch, series) in patches.iter().zip(&together) {
        let alone = &expand(&body, std::slice::from_ref(patch), 3)[0];
        for (a, b) in alone.displacement.iter().zip(series.displacement.iter()) {
            assert!(distance(a, b) < 1e-11 * distance(a, &vec![0.0; a.len()]));
        }
        for (a, b) in alone.force.iter().zip(&series.force) {
            assert!(distance(a, b) < 1e-10 * distance(a, &[0.0; 3]));
        }
    }
}

#[test]
fn what_cannot_be_expanded_is_refused() {
    let body = organ("neo_hookean");
    let fixed = bottom(&body);
    for order in [0, 9] {
        let result = TouchExpansion::new(&body, &fixed, vec![0.0; body.n_dofs()], order);
        assert!(matches!(result, Err(Error::Input(s)) if s.starts_with(&format!("order {order}"))));
    }
    let expansion = TouchExpansion::new(&body, &fixed, vec![0.0; body.n_dofs()], 2).unwrap();
    let held = Patch { nodes: vec![fixed[0]], weights: vec![1.0] };
    let error = expansion.expand(&[&held], 2).err().unwrap().to_string();
    assert!(error.contains("lies on fixed points only"), "{error}");
    let floating = TouchExpansion::new(&body, &[], vec![0.0; body.n_dofs()], 2);
    assert!(matches!(floating, Err(Error::Factor(_))), "nothing fixed: the tangent is singular");
}

/// A device that is exact but for the rounding of what it is given, for so many calls.
struct Exact {
    calls: usize,
}

struct ExactSeries {
    body: Body,
    base: Vec<f64>,
    left: usize,
}

impl Device for Exact {
    fn system(
        &self,
        _: usize,
        _: &[(u32, u32)],
        _: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String> {
        Err("it only expands".to_string())
    }

    fn series(&self, body: &ProgrammedSeries<'_>) -> Result<Box<dyn DeviceSeries>, String> {
        let shared = body.dilatation.is_some();
        let element = if shared { Element::P1MeanVolume } else { Element::P1 };
        let (points, cells) = (body.cells.points.to_vec(), body.cells.cells.to_vec());
        let body_of = Body::with_element(element, points, cells, uniform("neo_hookean")).unwrap();
        let base = body.base.to_vec();
        Ok(Box::new(ExactSeries { body: body_of, base, left: self.calls }))
    }
}

impl DeviceSeries for ExactSeries {
    fn force(&mut self, degree: usize, given: &[f32], force: &mut [f32]) -> Result<(), String> {
        self.left = self.left.checked_sub(1).ok_or("it is lost")?;
        let (table, n) = (Monomials::of(1, degree), self.base.len());
        let run = n * SERIES_LANES;
        for (given, force) in given.chunks(run * (degree - 1)).zip(force.chunks_mut(run)) {
            let at = |k: usize, dof: usize| match k {
                0 => Lanes([self.base[dof]; SERIES_LANES]),
                k if k < degree => Lanes(std::array::from_fn(|lane| {
                    f64::from(given[SERIES_LANES * ((k - 1) * n + dof) + lane])
                })),
                _ => Wide::default(),
            };
            let of_dof = |dof: usize| (0..=degree).map(move |k| at(k, dof));
            let displacement: Vec<Wide> = (0..n).flat_map(of_dof).collect();
            let mut exact = vec![Wide::default(); n];
            self.body.force_series(table, &displacement, degree + 1, &mut exact);
            let exact = exact.iter().flat_map(|wide| wide.0).map(|f| f as f32);
            force.iter_mut().zip(exact).for_each(|(force, exact)| *force = exact);
        }
        Ok(())
    }
}

/// Through directions and back, to rounding in single precision, about rest and about a loaded shape; and on the processor
/// where the device is lost on the way.
#[test]
fn a_device_expands_along_directions() {
    for element in [Element::P1, Element::P1MeanVolume] {
        let (points, cells) = block([4, 3, 3], SIZE);
        let body = Body::with_element(element, points, cells, uniform("neo_hookean")).unwrap();
        let (fixed, patches) = (bottom(&body), patches(&body, 3));
        let patches: Vec<&Patch> = patches.iter().collect();
        let stretched = |dof: usize| 0.03 * body.points()[dof / 3][2] * f64::from(dof % 3 == 2);
        let loaded: Vec<f64> = (0..body.n_dofs()).map(stretched).collect();
        for base in [vec![0.0; body.n_dofs()], loaded] {
            let new = || TouchExpansion::new(&body, &fixed, base.clone(), 5).unwrap();
            let exact = new().expand(&patches, 5).unwrap();
            for (calls, fault) in [(usize::MAX, None), (2, Some("it is lost"))] {
                let device = OnDevice(Box::leak(Box::new(Exact { calls })));
                let device = Arc::new(SeriesDevice::new(device));
                let found = new().on_device(&device).expand(&patches, 5).unwrap();
                assert_eq!(device.fault(), fault);
                for (found, exact) in found.iter().zip(&exact) {
                    for (found, exact) in found.displacement.iter().zip(exact.displacement.iter()) {
                        let size = distance(exact, &vec![0.0; exact.len()]);
                        assert!(distance(found, exact) < 1e-4 * size);
                    }
                }
                let is_same =
                    found.iter().zip(&exact).all(|(a, b)| a.displacement == b.displacement);
                assert!(!is_same, "{calls}: the device was not asked");
            }
        }
    }
}

#[test]
fn a_device_that_does_not_take_the_body_says_why() {
    for (element, law, why) in [
        (Element::P2, "neo_hookean", "the element is \"P2\""),
        (Element::P1, "linear", "the law is no function of invariants"),
        (Element::P1, "ogden", "the law has powers of the principal stretches"),
    ] {
        let (points, cells) = block([2, 2, 2], SIZE);
        let body = Body::with_element(element, points, cells, uniform(law)).unwrap();
        let (fixed, patches) = (bottom(&body), patches(&body, 1));
        let new = || TouchExpansion::new(&body, &fixed, vec![0.0; body.n_dofs()], 3).unwrap();
        let device = OnDevice(Box::leak(Box::new(Exact { calls: usize::MAX })));
        let device = Arc::new(SeriesDevice::new(device));
        let found = new().on_device(&device).expand(&[&patches[0]], 3).unwrap();
        assert!(device.fault().is_some_and(|fault| fault.ends_with(why)), "{:?}", device.fault());
        let exact = new().expand(&[&patches[0]], 3).unwrap();
        assert!(found[0].displacement == exact[0].displacement);
    }
}
