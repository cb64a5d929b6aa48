//! What happens where conjugate gradients were chosen automatically and a factor has to take over.

use super::*;
use crate::body::{Body, Curvature, ProgrammedCells, ProgrammedSeries};
use crate::equilibrium::system::NegativeCurvature;
use crate::equilibrium::{
    ConjugateGradients, Device, DeviceEnd, DeviceSeries, DeviceSolution, DeviceSystem,
    DeviceTangent, OnDevice, Preconditioner, Pressure, Status,
};
use crate::law::Material;
use crate::mesh::samples::block;

const SIZE: [f64; 3] = [0.02, 0.02, 0.3];

/// A column whose ends are held, the upper one pushed down by a part of its length.
fn pushed(body: &Body, part: f64) -> Problem<'_> {
    let ends = (0u32..).zip(body.points()).filter(|(_, x)| x[2] == 0.0 || x[2] == SIZE[2]);
    let prescribed = ends.flat_map(|(node, x)| {
        let down = if x[2] > 0.0 { -part * SIZE[2] } else { 0.0 };
        [(3 * node, 0.0), (3 * node + 1, 0.0), (3 * node + 2, down)]
    });
    Problem {
        body,
        prescribed: prescribed.collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    }
}

fn column() -> Body {
    let (points, cells) = block([2, 2, 24], SIZE);
    Body::new(points, cells, Material::new("neo_hookean", vec![vec![1e4, 2e4]]).unwrap()).unwrap()
}

fn iterative(preconditioner: Preconditioner, budget: usize) -> Choice {
    let settings = ConjugateGradients {
        preconditioner,
        tolerance: 1e-6,
        max_iterations: budget,
        ..ConjugateGradients::default()
    };
    Choice {
        method: Method::ConjugateGradients(settings),
        budget: Some(10 * budget),
        negative_curvature: NegativeCurvature::Shifted,
    }
}

fn solved(choice: Choice, problem: &Problem) -> Equilibrium {
    let contact = &mut Contact::new(problem.body);
    Newton::default().solve_by(choice, problem, contact, &mut |_| true).unwrap()
}

fn largest_gap(a: &Equilibrium, b: &Equilibrium) -> f64 {
    let pairs = a.displacement.iter().zip(&b.displacement);
    pairs.fold(0.0, |gap, (a, b)| (a - b).abs().max(gap))
}

#[test]
fn a_factor_goes_on_where_the_budget_ends() {
    let body = column();
    let problem = pushed(&body, 0.002);
    let exact = solved(Choice::of(Method::Cholesky, &body, false), &problem);
    assert_eq!(exact.solvers, ["cholesky"]);
    let names = [("multigrid", 500, false), ("incomplete_cholesky", 3, true)];
    for (name, budget, is_handed_over) in names {
        let found = solved(iterative(Preconditioner::named(name).unwrap(), budget), &problem);
        assert_eq!(found.status, Status::Converged, "{}", found.message);
        assert_eq!(found.solvers, if is_handed_over { vec![name, "cholesky"] } else { vec![name] });
        assert!(found.linear_iterations > 0);
        assert!(largest_gap(&found, &exact) < 1e-9 * SIZE[2], "{}", largest_gap(&found, &exact));
    }
}

/// Conjugate gradients need not meet the negative curvature of a column that is pushed straight down.
#[test]
fn the_verdict_on_a_column_is_that_of_a_factor() {
    let body = column();
    for (part, status) in [(0.002, Status::Converged), (0.05, Status::ConvergedPastInstability)] {
        let problem = pushed(&body, part);
        let exact = solved(Choice::of(Method::Cholesky, &body, false), &problem);
        assert_eq!(exact.status, status, "{part}: {}", exact.message);
        for preconditioner in [Preconditioner::IncompleteCholesky, Preconditioner::Multigrid] {
            let automatic = iterative(preconditioner, 5_000);
            for choice in [automatic, Choice { budget: None, ..automatic }] {
                let found = solved(choice, &problem);
                assert_eq!(found.status, status, "{part} {choice:?}: {}", found.message);
            }
        }
    }
}

/// Conjugate gradients that were asked for have no factor to turn to: they probe the last tangent themselves.
#[test]
fn a_motion_that_the_solution_did_not_excite_is_probed() {
    let body = column();
    for (part, is_overlooked) in [(0.002, false), (0.007, true)] {
        let problem = pushed(&body, part);
        let choice =
            Choice { budget: None, ..iterative(Preconditioner::IncompleteCholesky, 5_000) };
        let (contact, progress) = (&mut Contact::new(&body), &mut |_| true);
        let mut run = Run::new(Newton::default(), choice, &problem, contact, progress).unwrap();
        let straight: Vec<f64> =
            body.points().iter().flat_map(|x| [0.0, 0.0, -part * x[2]]).collect();
        let force = &mut vec![0.0; body.n_dofs()];
        run.tangent.linearize(&body, &straight, Curvature::Exact, force);
        run.solver.prepare(&run.tangent, 0.0).unwrap();
        assert_eq!(run.has_overlooked().ok(), Some(is_overlooked), "{part}");
    }
}

/// Just beyond the load at which the straight column becomes unstable, and just before it.
#[test]
fn a_probe_finds_an_eigenvalue_that_is_hardly_negative() {
    let body = column();
    let is_stable =
        |part: f64, choice| solved(choice, &pushed(&body, part)).status == Status::Converged;
    let factor = Choice::of(Method::Cholesky, &body, false);
    let (mut low, mut high) = (0.002, 0.05);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if is_stable(middle, factor) { low = middle } else { high = middle }
    }
    let cycles = iterative(Preconditioner::Multigrid, 5_000);
    for part in [0.99, 1.01] {
        assert_eq!(is_stable(part * low, cycles), is_stable(part * low, factor), "{part} {low}");
    }
    let found = solved(cycles, &pushed(&body, 0.99 * low));
    assert_eq!(found.solvers, ["multigrid"]);
}

/// A device that never ends unless it is told to, ten seconds at most.
struct Endless;

impl Device for Endless {
    fn system(
        &self,
        n: usize,
        _: &[(u32, u32)],
        _: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String> {
        Ok(Box::new(EndlessSystem(3 * n)))
    }

    fn series(&self, _: &ProgrammedSeries<'_>) -> Result<Box<dyn DeviceSeries>, String> {
        Err("it expands nothing".to_string())
    }
}

struct EndlessSystem(usize);

impl DeviceSystem for EndlessSystem {
    fn hold(&mut self, _: &[bool], _: &[Vec<(u32, f64)>]) -> Result<(), String> {
        Ok(())
    }

    fn load(&mut self, _: &[f64], _: f64) -> Result<(), String> {
        Ok(())
    }

    fn form(&mut self, _: &DeviceTangent<'_>) -> Result<(), String> {
        Ok(())
    }

    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, String> {
        Ok(vec![0.0; x.len()])
    }

    fn direction(&mut self) -> Result<Vec<f64>, String> {
        Ok(vec![0.0; self.0])
    }

    fn solve(
        &mut self,
        _: &[f64],
        _: &[&[f64]],
        _: &[f64],
        end: &DeviceEnd<'_>,
    ) -> Result<DeviceSolution, String> {
        let began = Instant::now();
        while (end.until.is_wanted)() {
            if began.elapsed().as_secs() >= 10 {
                return Err("nobody told it to end".to_string());
            }
        }
        let x = vec![0.0; self.0];
        Ok(DeviceSolution { x, iterations: 1, residual: 1.0, magnitude: 0.0, is_indefinite: false })
    }
}

#[test]
fn the_caller_can_stop_a_device_that_iterates() {
    let body = column();
    let settings = ConjugateGradients {
        preconditioner: Preconditioner::BlockJacobi,
        device: Some(OnDevice(&Endless)),
        ..ConjugateGradients::default()
    };
    let newton = Newton { method: Method::ConjugateGradients(settings), ..Newton::default() };
    let mut calls = 0;
    let outcome = newton.solve(&pushed(&body, 0.01), &mut |_| {
        calls += 1;
        calls < 4
    });
    // Before and after the tangent is prepared; then twice while the device iterates.
    assert!(matches!(outcome, Err(Error::Cancelled)));
    assert_eq!(calls, 4);
}
