//! A device that is lost in the middle of a solve.

use super::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A device that works so many times and is then lost: it solves by Cholesky, in double precision.
pub(super) struct Fragile(pub(super) usize);

struct FragileSystem {
    pairs: Vec<(u32, u32)>,
    matrix: Mat<f64>,
    is_held: Vec<bool>,
    rows: Vec<Vec<(u32, f64)>>,
    left: AtomicUsize,
}

impl Device for Fragile {
    fn system(&self, n: usize, pairs: &[(u32, u32)]) -> Result<Box<dyn DeviceSystem>, String> {
        let (pairs, matrix) = (pairs.to_vec(), Mat::zeros(3 * n, 3 * n));
        let (is_held, rows) = (vec![false; 3 * n], Vec::new());
        Ok(Box::new(FragileSystem { pairs, matrix, is_held, rows, left: AtomicUsize::new(self.0) }))
    }
}

impl DeviceSystem for FragileSystem {
    fn hold(&mut self, is_held: &[bool], means: &[Vec<(u32, f64)>]) -> Result<(), String> {
        self.is_held.copy_from_slice(is_held);
        self.rows = means.to_vec();
        Ok(())
    }

    fn load(&mut self, values: &[f64], shift: f64) -> Result<(), String> {
        for (&(row, column), block) in self.pairs.iter().zip(values.as_chunks::<9>().0) {
            for k in 0..9 {
                let (r, c) = (3 * row as usize + k / 3, 3 * column as usize + k % 3);
                self.matrix[(r, c)] = block[k];
                self.matrix[(c, r)] = block[k];
            }
        }
        (0..self.is_held.len()).for_each(|k| self.matrix[(k, k)] += shift);
        Ok(())
    }

    fn solve(&mut self, b: &[f64], _: &DeviceEnd) -> Result<DeviceSolution, String> {
        let works = self.left.fetch_update(Relaxed, Relaxed, |left| left.checked_sub(1));
        works.map_err(|_| "the device was lost".to_string())?;
        // [K W^T; W 0], what is held being rows of the identity.
        let (n, k) = (b.len(), self.rows.len());
        let mut bordered = Mat::zeros(n + k, n + k);
        for r in 0..n {
            for c in 0..n {
                let is_free = !self.is_held[r] && !self.is_held[c];
                bordered[(r, c)] = if is_free { self.matrix[(r, c)] } else { f64::from(r == c) };
            }
        }
        for (m, row) in self.rows.iter().enumerate() {
            for &(dof, weight) in row {
                bordered[(dof as usize, n + m)] = weight;
                bordered[(n + m, dof as usize)] = weight;
            }
        }
        let rhs = Mat::from_fn(n + k, 1, |r, _| if r < n && !self.is_held[r] { b[r] } else { 0.0 });
        let found = bordered.partial_piv_lu().solve(rhs);
        Ok(DeviceSolution {
            x: (0..n).map(|r| found[(r, 0)]).collect(),
            direction: vec![0.0; n],
            iterations: 1,
            is_indefinite: false,
        })
    }
}

/// The device takes part while it works; when it is lost in the middle, the processor ends with the same answer.
#[test]
fn a_device_that_is_lost_is_left_and_the_processor_goes_on() {
    let (body, u, fixed) = bar();
    let b = noise(body.n_dofs(), 4);
    let exact = {
        let mut solver = ConstrainedSystem::new(
            Method::Cholesky,
            &body,
            fixed.iter().copied(),
            vec![patch(&[60, 61, 62])],
        )
        .unwrap();
        solver.prepare(&tangent_of(Method::Cholesky, &body, &u), 0.0).unwrap();
        let mut s = vec![0.0; body.n_dofs()];
        solver.solve(&mut b.clone(), &[1e-3; 3], &mut s, &mut Vec::new(), None).unwrap();
        s
    };
    let method = Method::ConjugateGradients(ConjugateGradients {
        preconditioner: Preconditioner::BlockJacobi,
        tolerance: 1e-9,
        max_iterations: 5000,
        is_matrix_free: false,
        device: Some(OnDevice(&Fragile(2))),
    });
    let patches = vec![patch(&[60, 61, 62])];
    let mut solver = ConstrainedSystem::new(method, &body, fixed.iter().copied(), patches).unwrap();
    solver.prepare(&tangent_of(method, &body, &u), 0.0).unwrap();
    let mut iterations = Vec::new();
    for _ in 0..4 {
        let mut s = vec![0.0; body.n_dofs()];
        // A right-hand side of which the last step is no multiple.
        let mut b = noise(body.n_dofs(), 4 + iterations.len() as u64);
        let solved = solver.solve(&mut b, &[1e-3; 3], &mut s, &mut Vec::new(), None).unwrap();
        if iterations.is_empty() {
            let gap: Vec<f64> = s.iter().zip(&exact).map(|(s, exact)| s - exact).collect();
            assert!(norm(&gap) < 1e-8 * norm(&exact), "{}", norm(&gap) / norm(&exact));
        }
        assert!(solved.is_complete);
        iterations.push(solved.iterations);
    }
    assert_eq!(iterations[..2], [1, 1]);
    assert!(iterations[2] > 1 && iterations[3] > 1);
    assert_eq!(solver.device_fault(), Some("the device was lost"));
}
