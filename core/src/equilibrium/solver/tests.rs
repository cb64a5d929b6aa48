//! Every method on one bordered system, while grasps change; and what an indefinite tangent does to each.

use super::*;
use crate::body::Body;
use crate::law::Material;
use crate::mesh::samples::{block, noise};

const METHODS: [Method; 4] = [
    Method::Cholesky,
    with(Preconditioner::BlockJacobi),
    with(Preconditioner::IncompleteCholesky),
    with(Preconditioner::LaggedCholesky),
];

const fn with(preconditioner: Preconditioner) -> Method {
    Method::ConjugateGradients(ConjugateGradients {
        preconditioner,
        tolerance: 1e-6,
        max_iterations: 1000,
    })
}

fn bar() -> (Body, SymmetricBlocks, Vec<u32>) {
    let (points, cells) = block([5, 3, 2], [0.5, 0.3, 0.2]);
    let fixed: Vec<u32> = (0u32..)
        .zip(&points)
        .filter(|(_, x)| x[0] == 0.0)
        .flat_map(|(n, _)| [3 * n, 3 * n + 1, 3 * n + 2])
        .collect();
    let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    let mut tangent = body.zero_tangent();
    let u: Vec<f64> = noise(body.n_dofs(), 1).iter().map(|u| 0.004 * u).collect();
    body.internal_force_and_tangent(&u, &mut vec![0.0; u.len()], &mut tangent);
    (body, tangent, fixed)
}

fn patch(nodes: &[u32]) -> Patch {
    let weights = (1..=nodes.len()).map(|w| w as f64);
    let sum: f64 = weights.clone().sum();
    Patch { nodes: nodes.to_vec(), weights: weights.map(|w| w / sum).collect() }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// `K s - W^T F = b` where nothing is held, `W s = c`, `s = 0` where something is: checked in place, not by another
/// solver.
#[test]
fn every_method_solves_the_bordered_system_of_every_grasp() {
    let (body, tangent, fixed) = bar();
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
        let mut solver =
            Solver::new(method, &tangent, n, fixed.iter().copied(), Vec::new()).unwrap();
        for (dofs, patches) in &grasps {
            solver.hold(dofs, patches.clone());
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

/// The second solve of a hand that goes on starts where the first one ended.
#[test]
fn a_step_that_repeats_the_last_costs_nothing() {
    let (body, tangent, fixed) = bar();
    let n = body.n_dofs();
    let mut solver = Solver::new(METHODS[1], &tangent, n, fixed.iter().copied(), vec![]).unwrap();
    let iterations = [1.0, 3.0].map(|factor| {
        solver.prepare(&tangent, 0.0).unwrap();
        let mut b: Vec<f64> = noise(n, 2).iter().map(|b| factor * b).collect();
        solver.solve(&mut b, &[], &mut vec![0.0; n], &mut Vec::new(), None).unwrap().iterations
    });
    assert!(iterations[0] > 20 && iterations[1] <= 1, "{iterations:?}");
}

#[test]
fn an_indefinite_tangent_is_said_and_a_shift_mends_it() {
    let (body, mut tangent, fixed) = bar();
    let n = body.n_dofs();
    let scale = tangent.mean_diagonal();
    let diagonal: Vec<usize> = tangent
        .pairs()
        .enumerate()
        .filter(|(_, (r, c))| r == c)
        .map(|(block, _)| 9 * block)
        .collect();
    for block in diagonal {
        [0, 4, 8].iter().for_each(|i| tangent.values_mut()[block + i] -= 0.1 * scale);
    }
    for method in METHODS {
        let mut solver =
            Solver::new(method, &tangent, n, fixed.iter().copied(), Vec::new()).unwrap();
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
    ] {
        assert!(Method::ConjugateGradients(bad).check().is_err(), "{bad:?}");
    }
}
