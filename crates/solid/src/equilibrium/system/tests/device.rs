//! A device that forms tangents, or takes them; and one that is lost in the middle of a solve.

use super::*;
use crate::body::{ProgrammedCells, ProgrammedSeries};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A device that works so many times and is then lost: it solves by elimination, in double precision. It forms the
/// tangents of a body, or takes them.
pub(super) struct Fragile(pub(super) usize, pub(super) Option<fn() -> Body>);

struct FragileSystem {
    pairs: Vec<(u32, u32)>,
    body: Option<Body>,
    rest: Vec<(u32, u32, [f64; 9])>,
    matrix: Mat<f64>,
    is_held: Vec<bool>,
    rows: Vec<Vec<(u32, f64)>>,
    left: AtomicUsize,
}

impl Device for Fragile {
    fn system(
        &self,
        n: usize,
        pairs: &[(u32, u32)],
        cells: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String> {
        let body = match (cells, self.1) {
            (Some(_), None) => return Err("it forms no tangents".to_string()),
            (cells, body) => cells.and(body).map(|body| body()),
        };
        Ok(Box::new(FragileSystem {
            pairs: pairs.to_vec(),
            body,
            rest: Vec::new(),
            matrix: Mat::zeros(3 * n, 3 * n),
            is_held: vec![false; 3 * n],
            rows: Vec::new(),
            left: AtomicUsize::new(self.0),
        }))
    }

    fn series(&self, _: &ProgrammedSeries<'_>) -> Result<Box<dyn DeviceSeries>, String> {
        Err("it expands nothing".to_string())
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

    fn form(&mut self, tangent: &DeviceTangent<'_>) -> Result<(), String> {
        let body = self.body.as_ref().ok_or("it has no cells")?;
        let mut blocks = body.zero_tangent();
        body.linearize(tangent.u, Curvature::Exact, &mut vec![0.0; tangent.u.len()], &mut blocks);
        blocks.values_mut().iter_mut().for_each(|k| *k *= tangent.factor);
        if let Some(rest) = tangent.rest {
            self.rest = rest.to_vec();
        }
        for (row, column, block) in &self.rest {
            let at = self.pairs.iter().position(|pair| *pair == (*row, *column)).unwrap();
            let values = &mut blocks.values_mut()[9 * at..9 * at + 9];
            values.iter_mut().zip(block).for_each(|(k, more)| *k += more);
        }
        self.load(blocks.values(), tangent.shift)
    }

    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, String> {
        let row = |r: usize| (0..x.len()).map(|c| self.matrix[(r, c)] * x[c]).sum();
        Ok((0..x.len()).map(|r| if self.is_held[r] { 0.0 } else { row(r) }).collect())
    }

    fn direction(&mut self) -> Result<Vec<f64>, String> {
        Ok(vec![0.0; self.is_held.len()])
    }

    fn solve(
        &mut self,
        b: &[f64],
        _: &[&[f64]],
        start: &[f64],
        _: &DeviceEnd<'_>,
    ) -> Result<DeviceSolution, String> {
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
        let x: Vec<f64> = (0..n).map(|r| found[(r, 0)]).collect();
        let sum = |c: usize| (x[c] + start[c]).abs();
        let row = |r: usize| (0..n).map(|c| self.matrix[(r, c)].abs() * sum(c)).sum::<f64>();
        let free = (0..n).filter(|r| !self.is_held[*r]);
        let magnitude = free.map(|r| row(r) * row(r)).sum::<f64>().sqrt();
        Ok(DeviceSolution { x, iterations: 1, residual: 0.0, magnitude, is_indefinite: false })
    }
}

/// The device takes part while it works; when it is lost in the middle, the processor ends with the same answer.
#[test]
fn a_device_that_is_lost_is_left_and_the_processor_goes_on() {
    for forms in [None, Some((|| bar().0) as fn() -> Body)] {
        lose(
            Box::leak(Box::new(Fragile(2, forms))),
            forms.map_or(Origin::Uploaded, |_| Origin::Formed),
        );
    }
}

fn lose(device: &'static Fragile, origin: Origin) {
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
        device: Some(OnDevice(device)),
    });
    let patches = vec![patch(&[60, 61, 62])];
    let mut solver = ConstrainedSystem::new(method, &body, fixed.iter().copied(), patches).unwrap();
    solver.prepare(&left_to(&solver, method, &body, &u), 0.0).unwrap();
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
        let used = if iterations.len() < 2 { Some(origin) } else { None };
        assert_eq!(solver.origin(), used);
        iterations.push(solved.iterations);
    }
    assert_eq!(iterations[..2], [1, 1]);
    assert!(iterations[2] > 1 && iterations[3] > 1);
    assert_eq!(solver.device_fault(), Some("the device was lost"));
    // The next tangent is assembled.
    assert!(!solver.forms_tangents());
    solver.prepare(&left_to(&solver, method, &body, &u), 0.0).unwrap();
    let (mut b, mut s) = (noise(body.n_dofs(), 4), vec![0.0; body.n_dofs()]);
    solver.solve(&mut b, &[1e-3; 3], &mut s, &mut Vec::new(), None).unwrap();
    let gap: Vec<f64> = s.iter().zip(&exact).map(|(s, exact)| s - exact).collect();
    assert!(norm(&gap) < 1e-7 * norm(&exact), "{}", norm(&gap) / norm(&exact));
}

/// A tangent as a solver wants it.
fn left_to(solver: &ConstrainedSystem, method: Method, body: &Body, u: &[f64]) -> Tangent {
    let mut tangent = method.tangent(body);
    tangent.leave_to_device(solver.forms_tangents());
    tangent.linearize(body, u, Curvature::Exact, &mut vec![0.0; u.len()]);
    tangent
}

/// What a device forms, scaled and with inertia added, is what the processor assembles, and so is the shift; a convex
/// tangent is assembled.
#[test]
fn a_device_forms_what_the_processor_assembles() {
    let (body, u, fixed) = bar();
    let device = OnDevice(Box::leak(Box::new(Fragile(usize::MAX, Some(|| bar().0)))));
    let block_jacobi = ConjugateGradients {
        preconditioner: Preconditioner::BlockJacobi,
        tolerance: 1e-9,
        max_iterations: 5000,
        is_matrix_free: false,
        device: Some(device),
    };
    let mut answers = Vec::new();
    for method in [Method::Cholesky, Method::ConjugateGradients(block_jacobi)] {
        let fixed = fixed.iter().copied();
        let mut solver = ConstrainedSystem::new(method, &body, fixed, Vec::new()).unwrap();
        let mut tangent = method.tangent(&body);
        for (round, curvature) in
            [Curvature::Exact, Curvature::Projected, Curvature::Exact].into_iter().enumerate()
        {
            tangent.leave_to_device(solver.forms_tangents());
            tangent.linearize(&body, &u, curvature, &mut vec![0.0; u.len()]);
            tangent.scale(1.5);
            let mass = 1e3 * (1 + round) as f64;
            tangent.blocks_mut().add(7, &[mass, 0.0, 0.0, 0.0, mass, 0.0, 0.0, 0.0, mass]);
            solver.prepare(&tangent, 0.1 * round as f64).unwrap();
            let (mut b, mut s) = (noise(body.n_dofs(), 4), vec![0.0; body.n_dofs()]);
            solver.solve(&mut b, &[], &mut s, &mut Vec::new(), None).unwrap();
            if solver.forms_tangents() {
                let is_exact = curvature == Curvature::Exact;
                let origin = if is_exact { Origin::Formed } else { Origin::Uploaded };
                assert_eq!(solver.origin(), Some(origin));
            }
            answers.push(s);
        }
    }
    for (exact, found) in answers[..3].iter().zip(&answers[3..]) {
        let gap: Vec<f64> = found.iter().zip(exact).map(|(s, exact)| s - exact).collect();
        assert!(norm(&gap) < 1e-8 * norm(exact), "{}", norm(&gap) / norm(exact));
    }
}
