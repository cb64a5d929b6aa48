//! Real time (paper B): one Newton iteration a frame from the last state.
//!
//! A frame moves what the hands hold, takes one full Newton step towards the new equilibrium and
//! reports what is left. Quasi-static: there is no inertia, so a frame at rest converges as
//! Newton's method does. A step that would turn a cell inside out is cut back, and said so; then
//! the hands have moved only that part of the way, and the next frame goes on.

use super::problem::{PatchLoad, Problem};
use super::system::{System, patch_mean};
use crate::body::{Body, SymmetricBlocks};
use crate::error::Error;
use crate::linear::FactorError;

/// What one frame did.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Residual on the free degrees of freedom before the step, relative to all nodal forces.
    pub residual: f64,
    /// Part of the step taken: 1, or less where a cell would have turned inside out.
    pub taken: f64,
    /// Whether the tangent had to be shifted: the state is not stable.
    pub is_unstable: bool,
    /// Force of each patch's tool on the body [N].
    pub patch_forces: Vec<[f64; 3]>,
}

/// A body in the hands of a simulator.
pub struct Stepper {
    prescribed: Vec<u32>,
    patches: Vec<PatchLoad>,
    system: System,
    tangent: SymmetricBlocks,
    displacement: Vec<f64>,
    internal_force: Vec<f64>,
    multipliers: Vec<f64>,
}

/// Halvings of a step before a frame stands still.
const MAX_CUTS: i32 = 10;

impl Stepper {
    /// Holds the degrees of freedom and patches of a problem, at its start displacement; their
    /// values come with every frame.
    ///
    /// # Errors
    /// Bad input ([`Problem::check`]).
    pub fn new(problem: &Problem) -> Result<Self, Error> {
        problem.check()?;
        let body = problem.body;
        let tangent = body.zero_tangent();
        let prescribed: Vec<u32> = problem.prescribed.iter().map(|&(dof, _)| dof).collect();
        let patches = problem.patches.iter().map(|load| load.patch.clone()).collect();
        let n = body.n_dofs();
        Ok(Stepper {
            system: System::new(&tangent, n, prescribed.iter().copied(), patches)?,
            prescribed,
            patches: problem.patches.clone(),
            tangent,
            displacement: problem.start.clone().unwrap_or_else(|| vec![0.0; n]),
            internal_force: vec![0.0; n],
            multipliers: vec![0.0; 3 * problem.patches.len()],
        })
    }

    /// Displacement after the last frame [m].
    pub fn displacement(&self) -> &[f64] {
        &self.displacement
    }

    /// Internal force before the last frame's step [N]: minus the external force, the reactions.
    pub fn internal_force(&self) -> &[f64] {
        &self.internal_force
    }

    /// One frame: `values` of the prescribed degrees of freedom and `means` of the patches [m],
    /// dead nodal `force` [N].
    ///
    /// # Errors
    /// Values of a wrong length or not finite; a tangent that no shift makes definite. The state
    /// is then that of the frame before.
    pub fn frame(
        &mut self,
        body: &Body,
        values: &[f64],
        means: &[[f64; 3]],
        force: &[f64],
    ) -> Result<Frame, Error> {
        self.check(values, means, force)?;
        body.internal_force_and_tangent(
            &self.displacement,
            &mut self.internal_force,
            &mut self.tangent,
        );
        let out_of_balance = self.out_of_balance(force);
        let residual = self.relative(&out_of_balance, force);
        let is_unstable = self.factorize()?;
        let (step, change) = self.step(&out_of_balance, values, means)?;
        let taken = self.advance(body, &step);
        self.multipliers.iter_mut().zip(change).for_each(|(m, c)| *m += taken * c);
        let patch_forces = self.multipliers.chunks_exact(3).map(|m| [m[0], m[1], m[2]]).collect();
        Ok(Frame { residual, taken, is_unstable, patch_forces })
    }

    fn check(&self, values: &[f64], means: &[[f64; 3]], force: &[f64]) -> Result<(), Error> {
        let expected = (self.prescribed.len(), self.patches.len(), self.displacement.len());
        if (values.len(), means.len(), force.len()) != expected {
            return Err(Error::input(format!(
                "a frame needs {} prescribed values, {} patch displacements and {} force components; got {}, {} and {}",
                expected.0,
                expected.1,
                expected.2,
                values.len(),
                means.len(),
                force.len()
            )));
        }
        let finite =
            values.iter().chain(means.iter().flatten()).chain(force).all(|v| v.is_finite());
        if finite { Ok(()) } else { Err(Error::input("a frame's values must be finite")) }
    }

    /// `f_ext + W^T F - f_int` on all degrees of freedom.
    fn out_of_balance(&self, force: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> =
            force.iter().zip(&self.internal_force).map(|(e, i)| e - i).collect();
        for (load, m) in self.patches.iter().zip(self.multipliers.chunks_exact(3)) {
            for (&node, &w) in load.patch.nodes.iter().zip(&load.patch.weights) {
                for i in 0..3 {
                    out[3 * node as usize + i] += w * m[i];
                }
            }
        }
        out
    }

    fn relative(&self, out_of_balance: &[f64], force: &[f64]) -> f64 {
        let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
        let free = square(&mut self.system.free().iter().map(|&d| out_of_balance[d as usize]));
        let scale = square(&mut self.internal_force.iter().copied())
            .max(square(&mut force.iter().copied()));
        if scale > 0.0 { (free / scale).sqrt() } else { 0.0 }
    }

    /// Factorises the tangent, shifted where it is not positive definite; whether it was.
    fn factorize(&mut self) -> Result<bool, Error> {
        let mut shift = 0.0;
        loop {
            match self.system.factorize(&self.tangent, shift) {
                Ok(()) => return Ok(shift > 0.0),
                Err(FactorError::NotPositiveDefinite { .. } | FactorError::Singular { .. })
                    if shift < 10.0 =>
                {
                    shift = if shift == 0.0 { 1e-3 } else { 10.0 * shift };
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// The Newton step with the hands' motion, and the change of the patch forces.
    fn step(
        &self,
        out_of_balance: &[f64],
        values: &[f64],
        means: &[[f64; 3]],
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let mut step = vec![0.0; self.displacement.len()];
        for (&dof, value) in self.prescribed.iter().zip(values) {
            step[dof as usize] = value - self.displacement[dof as usize];
        }
        let mut moved = vec![0.0; step.len()];
        self.tangent.multiply(&step, &mut moved);
        let free = self.system.free();
        let mut rhs: Vec<f64> =
            free.iter().map(|&d| out_of_balance[d as usize] - moved[d as usize]).collect();
        let gap: Vec<f64> = self
            .patches
            .iter()
            .zip(means)
            .flat_map(|(load, mean)| {
                let now = patch_mean(&load.patch, &self.displacement);
                let held = patch_mean(&load.patch, &step);
                std::array::from_fn::<f64, 3, _>(|i| mean[i] - now[i] - held[i])
            })
            .collect();
        let change = self.system.solve(&mut rhs, &gap)?;
        for (s, &dof) in rhs.iter().zip(free) {
            step[dof as usize] = *s;
        }
        Ok((step, change))
    }

    /// Takes as much of the step as keeps every cell the right way round.
    fn advance(&mut self, body: &Body, step: &[f64]) -> f64 {
        for cuts in 0..=MAX_CUTS {
            let taken = 0.5f64.powi(cuts);
            let trial: Vec<f64> =
                self.displacement.iter().zip(step).map(|(u, s)| u + taken * s).collect();
            if body.energy(&trial).is_finite() {
                self.displacement = trial;
                return taken;
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::equilibrium::{Newton, Pressure};
    use crate::law::Material;
    use crate::mesh::Patch;
    use crate::mesh::samples::block;

    const DEPTH: f64 = -0.06;

    fn bar() -> (Body, Vec<u32>) {
        let (points, cells) = block([4, 2, 2], [0.4, 0.2, 0.2]);
        let fixed = (0..points.len() as u32).filter(|&n| points[n as usize][0] == 0.0).collect();
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        (Body::new(points, cells, material).unwrap(), fixed)
    }

    fn tip(body: &Body) -> Patch {
        let nodes: Vec<u32> = (0u32..)
            .zip(body.points())
            .filter(|(_, x)| x[0] == 0.4 && x[2] == 0.2)
            .map(|(n, _)| n)
            .collect();
        let weights = vec![1.0 / nodes.len() as f64; nodes.len()];
        Patch { nodes, weights }
    }

    fn problem<'a>(body: &'a Body, fixed: &[u32], d: [f64; 3]) -> Problem<'a> {
        let held = fixed.iter().flat_map(|&node| (0..3).map(move |i| (3 * node + i, 0.0)));
        Problem {
            body,
            prescribed: held.collect(),
            force: vec![0.0; body.n_dofs()],
            pressure: Pressure::default(),
            patches: vec![PatchLoad { patch: tip(body), displacement: d }],
            start: None,
        }
    }

    /// A hand that moves in steps and then waits ends where Newton's method does.
    #[test]
    fn a_hand_that_waits_finds_newtons_equilibrium() {
        let (body, fixed) = bar();
        let problem = problem(&body, &fixed, [0.0, 0.0, DEPTH]);
        let exact = Newton::default().solve(&problem, &mut |_| true).unwrap();
        let mut stepper = Stepper::new(&problem).unwrap();
        let values = vec![0.0; problem.prescribed.len()];
        let mut last = None;
        for k in 1..=16 {
            let d = [0.0, 0.0, DEPTH * (f64::from(k) / 10.0).min(1.0)];
            last = Some(stepper.frame(&body, &values, &[d], &problem.force).unwrap());
        }
        let frame = last.unwrap();
        assert!(frame.residual < 1e-9 && frame.taken == 1.0, "{frame:?}");
        for (u, v) in stepper.displacement().iter().zip(&exact.displacement) {
            assert!((u - v).abs() < 1e-10);
        }
        let (f, g) = (frame.patch_forces[0][2], exact.patch_forces[0][2]);
        assert!((f - g).abs() < 1e-7 * g.abs(), "{f} {g}");
    }

    /// A hand that jumps through the organ is held back until no cell is inside out.
    #[test]
    fn a_jump_is_cut_back_and_said() {
        let (body, fixed) = bar();
        let problem = problem(&body, &fixed, [0.0; 3]);
        let mut stepper = Stepper::new(&problem).unwrap();
        let values = vec![0.0; problem.prescribed.len()];
        let frame = stepper.frame(&body, &values, &[[-0.5, 0.0, 0.0]], &problem.force).unwrap();
        assert!(frame.taken < 1.0);
        assert!(body.smallest_jacobian(stepper.displacement()).0 > 0.0);
    }

    #[test]
    fn a_bad_frame_leaves_the_state_alone() {
        let (body, fixed) = bar();
        let problem = problem(&body, &fixed, [0.0; 3]);
        let mut stepper = Stepper::new(&problem).unwrap();
        let values = vec![0.0; problem.prescribed.len()];
        let before = stepper.displacement().to_vec();
        assert!(stepper.frame(&body, &values, &[[f64::NAN, 0.0, 0.0]], &problem.force).is_err());
        assert!(stepper.frame(&body, &values[1..], &[[0.0; 3]], &problem.force).is_err());
        assert_eq!(before, stepper.displacement());
    }
}
