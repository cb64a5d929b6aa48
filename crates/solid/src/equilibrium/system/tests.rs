//! Every method on one bordered system, while grasps change; and what an indefinite tangent does to each.

mod device;
mod threads;

use super::*;
use crate::body::{Body, Curvature};
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::number::norm;
use device::Fragile;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

const METHODS: [Method; 6] = [
    Method::Cholesky,
    with(Preconditioner::BlockJacobi, false),
    with(Preconditioner::BlockJacobi, true),
    with(Preconditioner::IncompleteCholesky, false),
    with(Preconditioner::LaggedCholesky, false),
    with(Preconditioner::Multigrid, false),
];

const fn with(preconditioner: Preconditioner, is_matrix_free: bool) -> Method {
    Method::ConjugateGradients(ConjugateGradients {
        preconditioner,
        tolerance: 1e-6,
        max_iterations: 1000,
        is_matrix_free,
        device: None,
    })
}

/// A bar held at one end, and a displacement of it.
fn bar() -> (Body, Vec<f64>, Vec<u32>) {
    let (points, cells) = block([5, 3, 2], [0.5, 0.3, 0.2]);
    let fixed: Vec<u32> = (0u32..)
        .zip(&points)
        .filter(|(_, x)| x[0] == 0.0)
        .flat_map(|(n, _)| [3 * n, 3 * n + 1, 3 * n + 2])
        .collect();
    let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    let u: Vec<f64> = noise(body.n_dofs(), 1).iter().map(|u| 0.004 * u).collect();
    (body, u, fixed)
}

/// The tangent of a body as a method takes it.
fn tangent_of(method: Method, body: &Body, u: &[f64]) -> Tangent {
    let mut tangent = method.tangent(body);
    tangent.linearize(body, u, Curvature::Exact, &mut vec![0.0; u.len()]);
    tangent
}

fn patch(nodes: &[u32]) -> Patch {
    let weights = (1..=nodes.len()).map(|w| w as f64);
    let sum: f64 = weights.clone().sum();
    Patch { nodes: nodes.to_vec(), weights: weights.map(|w| w / sum).collect() }
}

/// `K s - W^T F = b` where nothing is held, `W s = c`, `s = 0` where something is: checked in place, not by another
/// solver.
#[test]
fn every_method_solves_the_bordered_system_of_every_grasp() {
    let (body, u, fixed) = bar();
    let n = body.n_dofs();
    let load = noise(n, 2);
    let (tip, side) = (patch(&[5, 11, 17, 23]), patch(&[14, 15, 20]));
    let grasps: [(&[u32], Vec<Patch>); 4] = [
        (&[], vec![]),
        (&[], vec![tip.clone()]),
        (&[33, 34, 69], vec![tip.clone(), side]), // holds a component of a node of the first patch, too
        (&[51, 52, 53], vec![]),
    ];
    for method in METHODS {
        let tangent = tangent_of(method, &body, &u);
        let mut solver =
            ConstrainedSystem::new(method, &body, fixed.iter().copied(), Vec::new()).unwrap();
        for (dofs, patches) in &grasps {
            solver.hold(dofs, mean_rows(patches));
            solver.prepare(&tangent, 0.0).unwrap();
            let c = noise(3 * patches.len(), 3);
            let (mut b, mut s, mut forces) = (load.clone(), vec![0.0; n], Vec::new());
            let solved = solver.solve(&mut b, &c, &mut s, &mut forces, None).unwrap();
            assert!(solved.is_complete && solved.indefinite.is_none(), "{method:?} {solved:?}");
            let mut residual = vec![0.0; n];
            tangent.multiply(&s, &mut residual);
            let scale = norm(&residual);
            residual.iter_mut().zip(&load).for_each(|(r, b)| *r -= b);
            for (patch, f) in patches.iter().zip(forces.chunks_exact(3)) {
                for (&node, w) in patch.nodes.iter().zip(&patch.weights) {
                    (0..3).for_each(|i| residual[3 * node as usize + i] -= w * f[i]);
                }
            }
            fixed.iter().chain(*dofs).for_each(|&dof| {
                assert_eq!(s[dof as usize], 0.0);
                residual[dof as usize] = 0.0;
            });
            assert!(
                norm(&residual) < 1e-5 * scale,
                "{method:?} {dofs:?} {}",
                norm(&residual) / scale
            );
            for (patch, c) in patches.iter().zip(c.chunks_exact(3)) {
                let mean = crate::equilibrium::patch_mean(patch, &s);
                (0..3).for_each(|i| {
                    assert!((mean[i] - c[i]).abs() < 1e-9, "{method:?} {mean:?} {c:?}")
                });
            }
        }
    }
}

/// A rod 240 times as long as thick: what bends it is softer than the rounding of its cells' stiffness in single
/// precision.
fn wire() -> (Body, Vec<u32>) {
    let (points, cells) = block([240, 1, 1], [0.6, 0.0025, 0.0025]);
    let ends = (0u32..).zip(&points).filter(|(_, x)| x[0] == 0.0);
    let fixed = ends.flat_map(|(n, _)| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    let material = Material::new("mooney_rivlin ln J", vec![vec![1.5e5, 1e5, 1e7]]).unwrap();
    (Body::new(points, cells, material).unwrap(), fixed)
}

#[test]
fn what_is_solved_of_a_slender_stiff_body_is_right() {
    let (body, fixed) = wire();
    let u = vec![0.0; body.n_dofs()];
    let load = body.gravity([0.0, 0.0, -1.0], &[1.0]).unwrap();
    let run = |method: Method| {
        let tangent = tangent_of(method, &body, &u);
        let mut solver =
            ConstrainedSystem::new(method, &body, fixed.iter().copied(), Vec::new()).unwrap();
        solver.prepare(&tangent, 0.0).unwrap();
        let (mut b, mut s) = (load.clone(), u.clone());
        let solved = solver.solve(&mut b, &[], &mut s, &mut Vec::new(), None).unwrap();
        let mut residual = u.clone();
        tangent.multiply(&s, &mut residual);
        residual.iter_mut().zip(&b).for_each(|(r, b)| *r -= b);
        fixed.iter().for_each(|&dof| residual[dof as usize] = 0.0);
        (solved, norm(&residual) / norm(&b), s)
    };
    let (_, _, exact) = run(Method::Cholesky);
    for preconditioner in [
        Preconditioner::IncompleteCholesky,
        Preconditioner::LaggedCholesky,
        Preconditioner::Multigrid,
    ] {
        let method = Method::ConjugateGradients(ConjugateGradients {
            preconditioner,
            tolerance: 1e-6,
            max_iterations: 20_000,
            is_matrix_free: false,
            device: None,
        });
        let (solved, residual, s) = run(method);
        assert!(solved.is_complete && solved.indefinite.is_none(), "{method:?} {solved:?}");
        assert!(residual <= 1.001e-6, "{method:?} {residual}");
        let gap: Vec<f64> = s.iter().zip(&exact).map(|(s, exact)| s - exact).collect();
        assert!(norm(&gap) < 1e-4 * norm(&exact), "{method:?} {}", norm(&gap) / norm(&exact));
    }
}

/// The second solve of a hand that goes on starts where the first one ended.
#[test]
fn a_step_that_repeats_the_last_costs_nothing() {
    let (body, u, fixed) = bar();
    let n = body.n_dofs();
    let tangent = tangent_of(METHODS[1], &body, &u);
    let mut solver =
        ConstrainedSystem::new(METHODS[1], &body, fixed.iter().copied(), vec![]).unwrap();
    let iterations = [1.0, 3.0].map(|factor| {
        solver.prepare(&tangent, 0.0).unwrap();
        let mut b: Vec<f64> = noise(n, 2).iter().map(|b| factor * b).collect();
        solver.solve(&mut b, &[], &mut vec![0.0; n], &mut Vec::new(), None).unwrap().iterations
    });
    assert!(iterations[0] > 20 && iterations[1] <= 1, "{iterations:?}");
}

#[test]
fn an_indefinite_tangent_is_said_and_a_shift_mends_it() {
    let (body, u, fixed) = bar();
    let n = body.n_dofs();
    let matrix = tangent_of(Method::Cholesky, &body, &u);
    let scale = matrix.blocks().unwrap().mean_diagonal();
    for method in METHODS {
        let mut tangent = tangent_of(method, &body, &u);
        for node in 0..(n / 3) as u32 {
            let block = body.pattern().position(node, node).unwrap();
            let less = -0.1 * scale;
            let entries = [less, 0.0, 0.0, 0.0, less, 0.0, 0.0, 0.0, less];
            tangent.blocks_mut().add(block, &entries);
        }
        let mut solver =
            ConstrainedSystem::new(method, &body, fixed.iter().copied(), Vec::new()).unwrap();
        let (mut s, mut forces) = (vec![0.0; n], Vec::new());
        let mut run = |shift| {
            solver.prepare(&tangent, shift)?;
            solver.solve(&mut noise(n, 4), &[], &mut s, &mut forces, None)
        };
        match run(0.0) {
            Err(FactorError::NotPositiveDefinite { row }) => assert!(row < n),
            Ok(solved) => assert!(solved.indefinite.is_some_and(|dof| dof < n), "{method:?}"),
            other => panic!("{method:?} {other:?}"),
        }
        let solved = run(1.0).unwrap();
        assert!(solved.is_complete && solved.indefinite.is_none(), "{method:?}");
        let descent: f64 = noise(n, 4).iter().zip(&s).map(|(b, s)| b * s).sum();
        assert!(descent > 0.0);
    }
}

#[test]
fn bad_settings_are_refused() {
    let cg = ConjugateGradients::default();
    for bad in [
        ConjugateGradients { tolerance: 0.0, ..cg },
        ConjugateGradients { tolerance: f64::NAN, ..cg },
        ConjugateGradients { max_iterations: 0, ..cg },
        ConjugateGradients { is_matrix_free: true, ..cg },
        ConjugateGradients { device: Some(OnDevice(&Fragile(0, None))), ..cg },
    ] {
        assert!(Method::ConjugateGradients(bad).check().is_err(), "{bad:?}");
    }
}

/// To a tangent without a matrix everything happens that happens to one with it: scaled, added to, linearised anew.
#[test]
fn a_tangent_without_a_matrix_is_that_with_one() {
    let (body, u, _) = bar();
    let n = body.n_dofs();
    let straight = vec![0.0; n];
    let x = noise(n, 5);
    let mut tangents = [METHODS[1], METHODS[2]].map(|method| method.tangent(&body));
    let added = [1.0, 2.0, 3.0, 2.0, 5.0, 6.0, 3.0, 6.0, 9.0];
    let one = body.pattern().position(7, 7).unwrap();
    let two = body.pattern().position(7, 8).unwrap();
    for (u, curvature) in [(&u, Curvature::Exact), (&straight, Curvature::Projected)] {
        let products = tangents.each_mut().map(|tangent| {
            let (mut force, mut y) = (vec![f64::NAN; n], vec![f64::NAN; n]);
            tangent.linearize(&body, u, curvature, &mut force);
            [one, two].iter().for_each(|&block| tangent.blocks_mut().add(block, &added));
            tangent.scale(0.7);
            tangent.blocks_mut().add(one, &added);
            tangent.multiply(&x, &mut y);
            (force, y)
        });
        let [(force, y), (same_force, same)] = products;
        let gap = |a: &[f64], b: &[f64]| {
            let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            norm(&difference)
        };
        assert!(gap(&force, &same_force) <= 1e-14 * norm(&force));
        assert!(gap(&y, &same) < 1e-13 * norm(&y));
    }
}

#[test]
fn a_solver_refuses_the_tangent_of_another() {
    let (body, u, fixed) = bar();
    for (method, other) in [(METHODS[0], METHODS[2]), (METHODS[2], METHODS[0])] {
        let mut solver =
            ConstrainedSystem::new(method, &body, fixed.iter().copied(), Vec::new()).unwrap();
        assert!(solver.prepare(&tangent_of(other, &body, &u), 0.0).is_err());
    }
}

/// `K - c` on the degrees of freedom that are free, and on those steps of them that leave the patch's mean alone:
/// smallest eigenvalues, dense.
fn smallest_eigenvalues(tangent: &Tangent, free: &[u32], patch: &Patch) -> [f64; 2] {
    let n = free.len();
    let mut dense = Mat::<f64>::zeros(n, n);
    let n_dofs = 3 * tangent.blocks().unwrap().pattern().pairs().map(|(r, _)| r + 1).max().unwrap();
    for (c, &dof) in free.iter().enumerate() {
        let (mut unit, mut column) = (vec![0.0; n_dofs as usize], vec![0.0; n_dofs as usize]);
        unit[dof as usize] = 1.0;
        tangent.multiply(&unit, &mut column);
        free.iter().enumerate().for_each(|(r, &row)| dense[(r, c)] = column[row as usize]);
    }
    // An orthonormal basis of the steps with `W s = 0`: the rows of W are orthogonal, and the reflections that take
    // them to unit vectors take those steps to the rest.
    let mut w = Mat::<f64>::zeros(n, 3);
    for (&node, &weight) in patch.nodes.iter().zip(&patch.weights) {
        for i in 0..3 {
            if let Ok(row) = free.binary_search(&(3 * node + i as u32)) {
                w[(row, i)] = weight;
            }
        }
    }
    let q = w.qr().compute_Q();
    let basis = q.subcols(3, n - 3);
    let held = basis.transpose() * &dense * basis;
    let smallest = |a: &Mat<f64>| {
        let eigenvalues = a.self_adjoint_eigenvalues(Side::Lower).unwrap();
        eigenvalues.into_iter().fold(f64::INFINITY, f64::min)
    };
    [smallest(&dense), smallest(&held)]
}

/// What is stable is what tools leave stable: against the eigenvalues of the dense matrix, for tangents of which every
/// eigenvalue is lowered until the body is unstable alone, and then under the tool too.
#[test]
fn the_verdict_is_that_of_the_steps_that_tools_leave() {
    let (body, u, fixed) = bar();
    let n = body.n_dofs();
    let free: Vec<u32> = (0..n as u32).filter(|dof| !fixed.contains(dof)).collect();
    let tip = patch(&[5, 11, 17, 23]);
    let mut tangent = tangent_of(Method::Cholesky, &body, &u);
    let [alone, held] = smallest_eigenvalues(&tangent, &free, &tip);
    assert!(0.0 < alone && 2.0 * alone < held, "{alone} {held}: the tool must matter");
    let lower = |tangent: &mut Tangent, by: f64| {
        for node in 0..(n / 3) as u32 {
            let block = body.pattern().position(node, node).unwrap();
            tangent.blocks_mut().add(block, &[-by, 0.0, 0.0, 0.0, -by, 0.0, 0.0, 0.0, -by]);
        }
    };
    let mut by = 0.0;
    for (target, is_stable) in [
        (0.9 * alone, true),
        (1.1 * alone, true),
        (0.5 * (alone + held), true),
        (0.99 * held, true),
        (1.01 * held, false),
        (2.0 * held, false),
    ] {
        lower(&mut tangent, target - by);
        by = target;
        let [now_alone, now_held] = smallest_eigenvalues(&tangent, &free, &tip);
        assert!((now_held > 0.0) == is_stable && (now_alone > 0.0) == (by < alone));
        for method in METHODS.into_iter().filter(|m| m.tangent(&body).blocks().is_ok()) {
            let patches = vec![tip.clone()];
            let mut solver =
                ConstrainedSystem::new(method, &body, fixed.iter().copied(), patches).unwrap();
            let (mut s, mut forces) = (vec![0.0; n], Vec::new());
            let outcome = solver.prepare(&tangent, 0.0).and_then(|()| {
                solver.solve(&mut noise(n, 4), &[0.1, -0.2, 0.3], &mut s, &mut forces, None)
            });
            let said = match &outcome {
                Ok(solved) => solved.indefinite.is_none(),
                Err(FactorError::NotPositiveDefinite { .. }) => false,
                Err(error) => panic!("{method:?} {error}"),
            };
            assert_eq!(said, is_stable, "{method:?} lowered by {by}: {outcome:?}");
            if !is_stable {
                continue;
            }
            let mean = crate::equilibrium::patch_mean(&tip, &s);
            let off =
                mean.iter().zip([0.1, -0.2, 0.3]).map(|(m, c)| (m - c).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{method:?} {mean:?}");
            let (mut residual, load) = (vec![0.0; n], noise(n, 4));
            tangent.multiply(&s, &mut residual);
            let scale = norm(&residual);
            residual.iter_mut().zip(&load).for_each(|(r, b)| *r -= b);
            for (&node, w) in tip.nodes.iter().zip(&tip.weights) {
                (0..3).for_each(|i| residual[3 * node as usize + i] -= w * forces[i]);
            }
            fixed.iter().for_each(|&dof| residual[dof as usize] = 0.0);
            assert!(norm(&residual) < 1e-5 * scale, "{method:?} {by}");
        }
    }
}

/// A body that tools alone hold has six zero eigenvalues, and is stable all the same.
#[test]
fn three_tools_hold_a_body_that_nothing_fixes() {
    let (body, _, _) = bar();
    let n = body.n_dofs();
    let tangent = tangent_of(Method::Cholesky, &body, &vec![0.0; n]);
    let tools = [patch(&[0, 6, 12, 18]), patch(&[5, 11, 17]), patch(&[66, 67, 68])];
    let solve = |patches: Vec<Patch>| {
        let mut solver =
            ConstrainedSystem::new(Method::Cholesky, &body, [].into_iter(), patches.clone())?;
        solver.prepare(&tangent, 0.0).map_err(Error::Factor)?;
        let c = noise(3 * patches.len(), 3);
        let (mut s, mut forces) = (vec![0.0; n], Vec::new());
        solver.solve(&mut vec![0.0; n], &c, &mut s, &mut forces, None).map_err(Error::Factor)?;
        Ok::<_, Error>((c, s, forces))
    };
    let (c, s, forces) = solve(tools.to_vec()).unwrap();
    let mut residual = vec![0.0; n];
    tangent.multiply(&s, &mut residual);
    let scale = norm(&residual);
    for ((tool, f), c) in tools.iter().zip(forces.chunks_exact(3)).zip(c.chunks_exact(3)) {
        let mean = crate::equilibrium::patch_mean(tool, &s);
        // The zero eigenvalues are lifted by a hundred-millionth of the diagonal, and leave as much.
        (0..3).for_each(|i| assert!((mean[i] - c[i]).abs() < 1e-6, "{mean:?} {c:?}"));
        for (&node, w) in tool.nodes.iter().zip(&tool.weights) {
            (0..3).for_each(|i| residual[3 * node as usize + i] -= w * f[i]);
        }
    }
    assert!(norm(&residual) < 1e-6 * scale, "{}", norm(&residual) / scale);
}
