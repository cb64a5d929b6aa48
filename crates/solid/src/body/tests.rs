//! What the solvers rely on, for every law: derivatives, invariance, the patch test, power series,
//! sums that come out the same on any number of threads.

mod convex;

use super::*;
use crate::law::samples::{analytic, names, parameters, per_cell, uniform};
use crate::mesh::samples::{block, noise};
use crate::number::Monomials;
use crate::tensor::{Mat3, mul_vector};
use crate::unroll::tabulate;

const SIZE: [f64; 3] = [0.03, 0.04, 0.05];
/// Shear and volume change with `J > 0`, small enough for every law.
const STRAIN: Mat3<f64> = [[0.08, 0.05, -0.03], [-0.06, -0.07, 0.04], [0.02, -0.05, 0.06]];

/// Points and cells.
type Mesh = (Vec<[f64; 3]>, Vec<[u32; 4]>);

/// A block whose points, boundary included, are moved by up to a tenth of an edge.
fn distorted(n: usize) -> Mesh {
    let (mut points, cells) = block([n; 3], SIZE);
    for (x, shift) in points.iter_mut().zip(noise(3 * (n + 1).pow(3), 1).chunks_exact(3)) {
        (0..3).for_each(|i| x[i] += 0.1 * SIZE[i] / n as f64 * shift[i]);
    }
    (points, cells)
}

fn body(element: Element, (points, cells): Mesh, material: Material) -> Body {
    Body::with_element(element, points, cells, material).unwrap()
}

/// Of every element, one body of the law with uniform and one with varying parameters, 48 cells each.
fn bodies(law: &str) -> Vec<Body> {
    let materials = [uniform(law), per_cell(law, 48)];
    let every = |element| materials.clone().map(|material| body(element, distorted(2), material));
    Element::ALL.into_iter().flat_map(every).collect()
}

/// How far nodes may be moved at random, in units of what linear cells stand.
fn agility(body: &Body) -> f64 {
    if body.element() == Element::P2 { 0.3 } else { 1.0 }
}

fn affine(body: &Body, gradient: &Mat3<f64>, shift: [f64; 3]) -> Vec<f64> {
    let moved = |x: &[f64; 3]| {
        let u = mul_vector(gradient, x);
        [u[0] + shift[0], u[1] + shift[1], u[2] + shift[2]]
    };
    body.points().iter().flat_map(moved).collect()
}

/// A deformed state far from rest in which no cell is alike another.
fn state(body: &Body) -> Vec<f64> {
    let u = affine(body, &STRAIN, [0.0; 3]);
    u.iter().zip(noise(u.len(), 2)).map(|(u, n)| u + 5e-4 * agility(body) * n).collect()
}

/// A state pressed so far that tangents of cells are indefinite, none turned inside out.
fn crushed(body: &Body) -> Vec<f64> {
    let pressed: Mat3<f64> = [[0.3, 0.2, 0.0], [0.0, -0.4, 0.1], [0.0, 0.0, 0.25]];
    let u = affine(body, &pressed, [0.0; 3]);
    u.iter().zip(noise(u.len(), 7)).map(|(u, n)| u + 2e-4 * agility(body) * n).collect()
}

fn force(body: &Body, u: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; u.len()];
    body.internal_force(u, &mut force);
    force
}

fn along(u: &[f64], t: f64, v: &[f64]) -> Vec<f64> {
    u.iter().zip(v).map(|(u, v)| u + t * v).collect()
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |max, x| max.max(x.abs()))
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    largest(&along(a, -1.0, b))
}

/// Central differences over 1e-7 of metres: 1e-10 of rounding, 1e-10 of curvature.
#[test]
fn internal_force_is_the_derivative_of_the_energy() {
    for law in names() {
        for body in bodies(law) {
            let u = state(&body);
            let f = force(&body, &u);
            let slope = |dof: usize| {
                let mut unit = vec![0.0; u.len()];
                unit[dof] = 1e-7;
                (body.energy(&along(&u, 1.0, &unit)) - body.energy(&along(&u, -1.0, &unit))) / 2e-7
            };
            let differences: Vec<f64> = (0..u.len()).map(slope).collect();
            let name = body.element().name();
            assert!(largest_difference(&f, &differences) < 1e-7 * largest(&f), "{law}, {name}");
        }
    }
}

/// As a product, exact and made convex, and its blocks on the diagonal.
#[test]
fn the_tangent_without_a_matrix_is_the_matrix() {
    for law in names() {
        for body in bodies(law) {
            // The second state is beyond the first: cells are crushed, and some of their tangents indefinite.
            for (u, curvature) in
                [(state(&body), Curvature::Exact), (crushed(&body), Curvature::Projected)]
            {
                let (mut f, mut matrix) = (vec![0.0; u.len()], body.zero_tangent());
                body.linearize(&u, curvature, &mut f, &mut matrix);
                let mut product = body.tangent_product();
                product.move_to(&u, curvature);
                let (x, [mut y, mut same]) = (noise(u.len(), 6), [f.clone(), f.clone()]);
                matrix.multiply(&x, &mut y);
                product.multiply(&x, &mut same);
                let name = format!("{law}, {}, {curvature:?}", body.element().name());
                assert!(largest_difference(&y, &same) < 1e-12 * largest(&y), "{name}");
                let blocks = matrix.pattern().pairs().zip(matrix.values().chunks_exact(9));
                let diagonal = blocks.filter(|((row, column), _)| row == column).map(|(_, b)| b);
                let diagonal: Vec<f64> = diagonal.flatten().copied().collect();
                let found = product.diagonal().concat();
                assert!(
                    largest_difference(&diagonal, &found) < 1e-12 * largest(&diagonal),
                    "{name}: diagonal"
                );
            }
        }
    }
}

/// `f . v = int P : dF`, where `dF` is the change of `F` by `v`, and `W = int psi`, cluster or not.
#[test]
#[allow(non_snake_case)]
fn quadrature_points_are_what_force_and_energy_integrate() {
    for law in names() {
        for body in bodies(law) {
            let u = state(&body);
            let v: Vec<f64> = noise(u.len(), 3).iter().map(|n| 1e-3 * n).collect();
            let (here, there) =
                (body.quadrature_points(&u), body.quadrature_points(&along(&u, 1.0, &v)));
            let points = here.len() / body.cells().len();
            let (mut work, mut energy) = (0.0, 0.0);
            for (k, (response, moved)) in here.iter().zip(&there).enumerate() {
                let volume = body.geometry[k / points].volume / points as f64;
                let (P, F, G) = (response.stress, response.gradient, moved.gradient);
                let change = |i: usize, j: usize| P[i][j] * (G[i][j] - F[i][j]);
                work += volume * (0..9).map(|e| change(e / 3, e % 3)).sum::<f64>();
                energy += volume * response.energy;
            }
            let force = force(&body, &u);
            let expected: f64 = force.iter().zip(&v).map(|(f, v)| f * v).sum();
            let size = largest(&force) * largest(&v);
            assert!((work - expected).abs() < 1e-10 * size, "{law}: {work} {expected}");
            let exact = body.energy(&u);
            assert!((energy - exact).abs() < 1e-11 * exact.abs(), "{law}: {energy} {exact}");
        }
    }
}

#[test]
fn tangent_is_the_derivative_of_the_force_and_symmetric() {
    for law in names() {
        for body in bodies(law) {
            let u = state(&body);
            let law = format!("{law}, {}", body.element().name());
            let (mut f, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
            body.internal_force_and_tangent(&u, &mut f, &mut tangent);
            assert!(
                largest_difference(&f, &force(&body, &u)) <= 1e-13 * largest(&f),
                "{law}: two forces"
            );
            let product = |v: &[f64]| {
                let mut out = vec![0.0; v.len()];
                tangent.multiply(v, &mut out);
                out
            };
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let [v, w] = [3, 4].map(|seed| noise(u.len(), seed));
            let (kv, kw) = (product(&v), product(&w));
            let difference: Vec<f64> = along(
                &force(&body, &along(&u, 1e-7, &v)),
                -1.0,
                &force(&body, &along(&u, -1e-7, &v)),
            )
            .iter()
            .map(|f| f / 2e-7)
            .collect();
            assert!(
                largest_difference(&kv, &difference) < 1e-7 * largest(&kv),
                "{law}: derivative"
            );
            assert!((dot(&w, &kv) - dot(&v, &kw)).abs() < 1e-12 * dot(&v, &kv).abs(), "{law}");
        }
    }
}

/// Rotation about (1, 2, 2) / 3 by 0.7, minus the identity.
fn turn() -> Mat3<f64> {
    let (n, c, s) = ([1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], 0.7f64.cos(), 0.7f64.sin());
    let spin = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
    tabulate!(|i, j| (c - 1.0) * ((i == j) as u8 as f64) + s * spin[i][j] + (1.0 - c) * n[i] * n[j])
}

#[test]
fn rigid_motions_are_free_of_force() {
    for law in names() {
        for body in bodies(law) {
            let scale = largest(&force(&body, &state(&body)));
            let shifted = affine(&body, &[[0.0; 3]; 3], [0.1, -0.2, 0.3]);
            assert!(largest(&force(&body, &shifted)) < 1e-11 * scale, "{law}: translation");
            let turned = force(&body, &affine(&body, &turn(), [0.1, -0.2, 0.3]));
            let is_free = largest(&turned) < 1e-11 * scale;
            assert_eq!(is_free, law != "linear", "{law}: only the linear law minds a rotation");
        }
    }
}

/// The patch test: every cell has the law's stress `P`, so that nodes inside feel nothing, and affine motions
/// `D x` the work `V P : D`.
#[test]
fn affine_motions_give_one_stress_everywhere() {
    for law in names() {
        for element in Element::ALL {
            let body = body(element, distorted(3), uniform(law));
            let f = force(&body, &affine(&body, &STRAIN, [0.01, 0.0, -0.02]));
            let gradient = tabulate!(|i, j| ((i == j) as u8 as f64) + STRAIN[i][j]);
            let (_, stress) =
                body.material().energy_and_stress(&parameters(law, 1.0), &[gradient])[0];
            let name = format!("{law}, {}", element.name());
            for entry in 0..9 {
                let unit = tabulate!(|i, j| (3 * i + j == entry) as u8 as f64);
                let motion = affine(&body, &unit, [0.0; 3]);
                let work: f64 = f.iter().zip(&motion).map(|(f, u)| f * u).sum();
                let exact = body.rest_volume() * stress[entry / 3][entry % 3];
                assert!((work - exact).abs() < 1e-13 * largest(&f), "{name}: {work} {exact}");
            }
            let surface = body.surface().concat();
            let inside: Vec<usize> =
                (0..body.points().len()).filter(|&n| !surface.contains(&(n as u32))).collect();
            assert_eq!(inside.len(), if element == Element::P2 { 125 } else { 8 });
            let worst = inside.iter().map(|&n| largest(&f[3 * n..3 * n + 3])).fold(0.0, f64::max);
            assert!(worst < 1e-12 * largest(&f), "{name}: {worst} N inside");
        }
    }
}

/// Coefficients of orders 1 to 4 along `u(t) = u0 + t u1 + t^2 u2 + t^3 u3`; as `force_series`
/// leaves out the newest displacement, its share is `K u_p`.
fn force_coefficients(body: &Body, path: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (n, stride) = (body.n_dofs(), path.len());
    let interleaved: Vec<f64> = (0..n).flat_map(|dof| path.iter().map(move |u| u[dof])).collect();
    let (mut f, mut tangent) = (vec![0.0; n], body.zero_tangent());
    body.internal_force_and_tangent(&path[0], &mut f, &mut tangent);
    let order = |p: usize| {
        let (mut nonlinear, mut newest) = (vec![0.0; n], vec![0.0; n]);
        body.force_series(Monomials::of(1, p), &interleaved, stride, &mut nonlinear);
        tangent.multiply(&path[p], &mut newest);
        along(&nonlinear, 1.0, &newest)
    };
    std::iter::once(f).chain((1..stride).map(order)).collect()
}

/// The force along the path minus its expansion falls like `t^5`: by 32 when `t` is halved.
#[test]
fn force_series_expands_the_force_along_a_path() {
    for law in analytic() {
        for body in bodies(law) {
            let scales = [1.0, 4e-3, 2e-3, 1e-3, 0.0];
            let mut path: Vec<Vec<f64>> = (0u64..)
                .zip(scales.map(|s| s * agility(&body)))
                .map(|(p, s)| noise(body.n_dofs(), 10 + p).iter().map(|n| s * n).collect())
                .collect();
            path[0] = state(&body);
            let coefficients = force_coefficients(&body, &path);
            let at = |series: &[Vec<f64>], t: f64| {
                series.iter().rev().fold(vec![0.0; body.n_dofs()], |sum, c| along(c, t, &sum))
            };
            let scale = largest(&coefficients[1]);
            let remainder = |t: f64| {
                largest_difference(&force(&body, &at(&path, t)), &at(&coefficients, t)) / scale
            };
            let (far, near) = (remainder(0.2), remainder(0.1));
            let is_exact = far < 1e-13;
            let name = format!("{law}, {}", body.element().name());
            assert_eq!(is_exact, law == "linear", "{name}: remainder {far:e}");
            assert!(is_exact || (24.0..40.0).contains(&(far / near)), "{name}: {far:e} {near:e}");
        }
    }
}

/// 2058 cells are enough for threads to share them.
#[test]
fn sums_are_the_same_on_any_number_of_threads() {
    for element in Element::ALL {
        let body = body(element, distorted(7), uniform("neo_hookean"));
        let u: Vec<f64> = state(&body).iter().map(|u| 0.3 * u).collect();
        let results = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                assert_eq!(body.is_shared(), threads > 1);
                let (mut f, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
                body.internal_force_and_tangent(&u, &mut f, &mut tangent);
                (body.energy(&u), f, tangent.values)
            })
        });
        assert!(results[0].0 > 0.0 && results[0].0.is_finite());
        assert!(results[0] == results[1] && results[0] == results[2], "{}", element.name());
    }
}

#[test]
fn volumes_follow_the_deformation() {
    for element in Element::ALL {
        let body = body(element, block([2; 3], SIZE), uniform("linear"));
        let rest = SIZE.iter().product::<f64>();
        assert!((body.rest_volume() - rest).abs() < 1e-14 * rest);
        let stretch = [[0.5, 0.0, 0.0], [0.0, -0.2, 0.0], [0.3, 0.0, 0.1]];
        let mut u = affine(&body, &stretch, [1.0, 2.0, 3.0]);
        let ratio = 1.5 * 0.8 * 1.1;
        assert!((body.volume(&u) - ratio * rest).abs() < 1e-12 * rest);
        assert!((body.smallest_jacobian(&u).0 - ratio).abs() < 1e-12);
        u[0] += 0.05; // beyond the opposite face of every cell at the corner
        let (jacobian, cell) = body.smallest_jacobian(&u);
        assert!(jacobian < 0.0 && body.cells()[cell].contains(&0));
    }
}

#[test]
fn gravity_adds_up_to_the_weight_at_the_centre_of_mass() {
    let g = [0.5, -1.0, -9.81];
    let densities: Vec<f64> = (0..48).map(|cell| 900.0 + 10.0 * cell as f64).collect();
    for element in Element::ALL {
        let body = body(element, distorted(2), uniform("linear"));
        for density in [&densities[..], &[1060.0]] {
            let force = body.gravity(g, density).unwrap();
            let (mut mass, mut moment) = (0.0, [0.0; 3]);
            for (cell, nodes) in body.cells().iter().enumerate() {
                let cell_mass = density[cell % density.len()] * body.geometry[cell].volume;
                mass += cell_mass;
                let corners = nodes.map(|n| body.points()[n as usize]);
                (0..3).for_each(|k| {
                    moment[k] += 0.25 * cell_mass * corners.iter().map(|x| x[k]).sum::<f64>();
                });
            }
            let total = |weight: &dyn Fn(&[f64; 3]) -> f64, i: usize| -> f64 {
                force.chunks(3).zip(body.points()).map(|(f, x)| f[i] * weight(x)).sum()
            };
            for i in 0..3 {
                assert!((total(&|_| 1.0, i) - mass * g[i]).abs() < 1e-13);
                for k in 0..3 {
                    assert!((total(&|x| x[k], i) - moment[k] * g[i]).abs() < 1e-14);
                }
            }
        }
        for (density, words) in [
            (vec![1.0; 3], "3 densities for 48 cells"),
            (vec![-1.0], "-1"),
            (vec![f64::NAN], "NaN"),
        ] {
            let error = body.gravity(g, &density).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}

#[test]
fn inversion_costs_infinite_energy_where_the_law_forbids_it() {
    for law in names() {
        for element in Element::ALL {
            let body = body(element, block([2; 3], SIZE), uniform(law));
            let mut u = vec![0.0; body.n_dofs()];
            u[0] = 0.05;
            let has_logarithm = ["neo_hookean", "mooney_rivlin ln J"].contains(&law);
            let name = element.name();
            assert!(body.energy(&u).is_infinite() || !has_logarithm, "{law}, {name}");
            assert!(body.energy(&u) > 0.0, "{law}, {name}: no NaN either");
        }
    }
}

#[test]
fn bad_meshes_are_refused_with_the_place_and_the_value() {
    let (points, cells) = block([1; 3], SIZE);
    let refusal = |change: &dyn Fn(&mut Mesh), rows: usize| {
        let mut mesh = (points.clone(), cells.clone());
        change(&mut mesh);
        let material = Material::new("linear", vec![parameters("linear", 1.0); rows]).unwrap();
        Body::new(mesh.0, mesh.1, material).err().map_or("accepted".to_string(), |e| e.to_string())
    };
    let cases = [
        (refusal(&|_| (), 1), "accepted"),
        (refusal(&|m| m.1[3].swap(0, 1), 1), "cell 3 has volume -1.000e-5"),
        (refusal(&|m| m.1[2][1] = m.1[2][0], 1), "cell 2 has volume 0"),
        (refusal(&|m| m.0[5][1] = f64::NAN, 1), "point 5 is at [0.03, NaN, 0.05]"),
        (refusal(&|m| m.0[5][1] = f64::INFINITY, 1), "point 5"),
        (refusal(&|m| m.0.push([9.0; 3]), 1), "point 8 belongs to no cell"),
        (refusal(&|m| m.1[4][2] = 8, 1), "cell 4 uses point 8; there are 8 points"),
        (refusal(&|m| m.1.clear(), 1), "no tetrahedra"),
        (refusal(&|_| (), 5), "5 parameter rows for 6 cells"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}
