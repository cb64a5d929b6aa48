//! One organ under one law, held by nothing but its supports and at most two hands.

use crate::case::Case;
use crate::stress::von_mises;
use viscera_core::Error;
use viscera_core::body::Body;
use viscera_core::clock::Instant;
use viscera_core::equilibrium::{
    ConjugateGradients, Input, Method, OnDevice, Preconditioner, Stepper, StepperSettings,
};
use viscera_core::mesh::{Patch, Surface};

/// Time [s] for the organs in a frame: half of the 16 ms between two frames of a page.
pub const BUDGET: f64 = 8e-3;
/// Largest number of Newton iterations in a frame.
const MAX_ITERATIONS: usize = 20;

/// Number of cells above which the factor of an earlier tangent is kept (docs/solvers.md).
const DIRECT_CELLS: usize = 5000;

/// Iterations of a device for one Newton iteration, beyond which a frame goes on with what they found.
const DEVICE_ITERATIONS: usize = 5000;

/// Numbers of an organ in a frame before its displacements.
pub const FACTS: usize = 14;

pub struct Specimen {
    pub law: String,
    body: Body,
    stepper: Stepper,
    /// What each hand holds.
    patches: [Option<Patch>; 2],
}

impl Specimen {
    /// An organ that steps until it has settled or a budget [s] is spent, on a device if there is one.
    pub fn new(
        case: &Case,
        law: &str,
        budget: f64,
        device: Option<OnDevice>,
    ) -> Result<Self, Error> {
        let body = case.body(law)?;
        let n = body.points().len();
        if let Some(node) = case.fixed.iter().find(|&&node| node as usize >= n) {
            return Err(Error::input(format!("point {node} is fixed; there are {n} points")));
        }
        let method = match device {
            Some(_) => Method::ConjugateGradients(ConjugateGradients {
                preconditioner: Preconditioner::BlockJacobi,
                max_iterations: DEVICE_ITERATIONS,
                device,
                ..Default::default()
            }),
            None if body.cells().len() <= DIRECT_CELLS => Method::Cholesky,
            None => Method::ConjugateGradients(ConjugateGradients::default()),
        };
        let settings = StepperSettings {
            method,
            iterations: MAX_ITERATIONS,
            budget: Some(budget),
            density: case.density.clone(),
            ..Default::default()
        };
        let fixed: Vec<u32> =
            case.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i)).collect();
        let stepper = Stepper::new(&body, &fixed, None, settings)?;
        Ok(Specimen { law: law.into(), body, stepper, patches: [None, None] })
    }

    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Why the device that it was to step on is not used; none if it is, or there was none.
    pub fn device_fault(&self) -> Option<&str> {
        self.stepper.device_fault()
    }

    /// Makes each hand hold its patch, and nothing else.
    pub fn hold(&mut self, patches: &[Option<Patch>; 2]) -> Result<(), Error> {
        let held: Vec<Patch> = patches.iter().flatten().cloned().collect();
        self.stepper.grasp(&self.body, &[], &held)?;
        self.patches = patches.clone();
        Ok(())
    }

    /// Present mean displacement of a patch [m].
    pub fn mean(&self, patch: &Patch) -> [f64; 3] {
        let u = self.stepper.displacement();
        std::array::from_fn(|i| {
            let parts = patch.nodes.iter().zip(&patch.weights);
            parts.map(|(&node, weight)| weight * u[3 * node as usize + i]).sum()
        })
    }

    /// A frame for the displacement of each hand; appends the numbers of the protocol.
    pub fn step(
        &mut self,
        surface: &Surface,
        displacements: [[f64; 3]; 2],
        gravity: [f64; 3],
        out: &mut Vec<f32>,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        let holds = self.patches.iter().zip(displacements);
        let means: Vec<[f64; 3]> =
            holds.filter_map(|(patch, d)| patch.as_ref().map(|_| d)).collect();
        let input = Input { means: &means, gravity, ..Input::default() };
        let frame = self.stepper.frame(&self.body, &input)?;
        let mut carried = frame.patch_forces.iter().copied();
        let forces = [0, 1].map(|hand: usize| {
            self.patches[hand].as_ref().and_then(|_| carried.next()).unwrap_or_default()
        });
        let [force, second] = forces;
        let u = self.stepper.displacement();
        let gain = volume(surface, u) / volume(surface, &[]) - 1.0;
        let unstable = f64::from(u8::from(frame.is_unstable));
        let milliseconds = 1e3 * clock.elapsed().as_secs_f64();
        let settled = f64::from(u8::from(frame.is_settled));
        let (at_bound, steps) = (frame.cells_at_bound as f64, frame.steps as f64);
        let facts: [f64; FACTS - 6] =
            [frame.residual, frame.taken, unstable, milliseconds, gain, settled, at_bound, steps];
        out.extend(force.iter().chain(&facts).chain(&second).map(|&x| x as f32));
        let nodes = surface.nodes().iter();
        out.extend(nodes.flat_map(|&n| &u[3 * n as usize..3 * n as usize + 3]).map(|&x| x as f32));
        Ok(())
    }

    /// Appends the von Mises stress at the nodes of the surface after the last frame.
    pub fn stress(&self, surface: &Surface, out: &mut Vec<f32>) {
        let all = von_mises(&self.body, self.stepper.displacement());
        out.extend(surface.nodes().iter().map(|&node| all[node as usize] as f32));
    }
}

/// Volume inside a closed surface moved by `u`, at rest where that is empty: `V = 1/6 sum x0 . (x1 x x2)` [m^3].
fn volume(surface: &Surface, u: &[f64]) -> f64 {
    let origin = surface.points()[0];
    let at = |node: u32| -> [f64; 3] {
        let (node, x) = (node as usize, surface.points()[node as usize]);
        std::array::from_fn(|i| x[i] - origin[i] + u.get(3 * node + i).unwrap_or(&0.0))
    };
    let six = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(at);
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    surface.triangles().iter().map(six).sum::<f64>() / 6.0
}
