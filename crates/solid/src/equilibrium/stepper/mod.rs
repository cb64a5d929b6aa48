//! Real time: one Newton iteration a frame from the last state
//! (*Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*).
//!
//! A frame moves what the hands hold, takes one full Newton step towards the new equilibrium, of forces alone or of
//! forces and inertia, and reports what is left. A step that would crush or tear a cell is cut back, and said so;
//! then the hands have moved only that part of their motion, and go on at a slower pace until a step is taken whole again:
//! the body gives way before it is pressed further.

mod balance;
mod barrier;
mod contact;
mod damping;
mod extrapolation;
mod frame;
mod mass;
mod means;
mod motion;
mod pressed;
mod regions;
mod relaxation;
mod settings;
mod step;
#[cfg(test)]
mod tests;
mod turn;

pub use damping::StiffnessDamping;
pub use frame::{Frame, Input};
pub use relaxation::Prony;
pub use settings::{Dynamics, Integration, Mass, StepperSettings};
pub use turn::{Torque, Turn};

use super::domain::check_start;
use super::iteration::Rounding;
use super::pressure::Pressure;
use super::problem::{PatchLoad, Problem};
use super::system::{ConstrainedSystem, Origin, mean_rows};
use super::tangent::Tangent;
use crate::body::Body;
use crate::clock::Instant;
use crate::contact::Contact;
use crate::element::Element;
use crate::error::Error;
use crate::mesh::{Patch, diagonal};
use crate::threads::in_common_pool;
pub use barrier::VOLUME_BOUNDS;
use barrier::VolumeBarrier;
use extrapolation::Extrapolation;
use frame::check_vector;
use mass::{MassMatrix, nodal_weight};
use motion::Motion;
use regions::Regions;
use relaxation::Relaxation;
use std::sync::Arc;
use std::time::Duration;
use step::MOST_ENERGY;
use turn::Turning;

/// Part of the budget that is planned for, since an iteration may end a little late.
const SPENDABLE: f64 = 0.97;
/// A time [s] that stands for no budget, and can be added to any clock.
const LONGEST_BUDGET: f64 = 1e6;
/// Decay per frame of the remembered tail.
const TAIL_KEPT: f64 = 0.98;
/// Decay per frame of the remembered time of a convex tangent, so that one is tried again after a slow one.
const CONVEX_KEPT: f64 = 0.8;

/// Strain energy beyond which no step leads [J]; infinite but for laws that grow exponentially.
fn most_energy(body: &Body) -> f64 {
    let is_bounded = body.material().has_exponential();
    if is_bounded { MOST_ENERGY * body.energy_scale() } else { f64::INFINITY }
}

/// A body in the hands of a simulator.
pub struct Stepper {
    settings: StepperSettings,
    fixed: Vec<u32>,
    grasped: Vec<u32>,
    patches: Vec<Patch>,
    /// What holds the mean rotation of patches.
    turning: Vec<Turning>,
    /// Torques on places that no hand holds.
    torques: Vec<Torque>,
    solver: ConstrainedSystem,
    tangent: Tangent,
    motion: Option<Motion>,
    stiffness_damping: Option<StiffnessDamping>,
    relaxation: Option<Relaxation>,
    /// What gravity pulls at [kg]: with inertia that of the mass matrix.
    nodal_mass: Vec<f64>,
    pressure: Pressure,
    contact: Contact,
    /// The body with the pattern of the tangent, where that has become wider.
    widened: Option<Arc<Body>>,
    rounding: Rounding,
    regions: Regions,
    /// Norm of the nodal forces to which the last residual was compared [N]; with several regions, that at which the worst
    /// of them would have it.
    magnitude: f64,
    /// Diagonal of the box around the body [m].
    length: f64,
    /// Strain energy beyond which no step leads [J].
    most_energy: f64,
    /// Keeps the volume ratios of cells within bounds.
    barrier: VolumeBarrier,
    /// Part of their motion that the hands make in an iteration: 1, or less after a step was cut.
    motion_fraction: f64,
    hands_move: bool,
    /// Whether the last frame settled: tools may then lead what they touch.
    was_settled: bool,
    /// Newton iterations since the hands have arrived or a frame has settled.
    unsettled: usize,
    extrapolation: Extrapolation,
    /// The part of the last motion by which this frame has set out from where it leads; zero from the last state.
    ahead: f64,
    /// Time that recent frames took after their last linear system; it is reserved in the budget.
    tail: Duration,
    /// How long a frame may take [s], by the iterations of the last one.
    longest_frame: f64,
    /// Time of the last convex tangent.
    convex: Duration,
    /// Whether the last tangent was indefinite and its step was cut or incomplete; the next one is then made convex at
    /// once.
    projects_next: bool,
    /// First shift of the tangent, over its mean diagonal: zero, or larger after every frame without motion.
    shift: f64,
    displacement: Vec<f64>,
    start: Vec<f64>,
    /// Forces that do not follow the surface, and those with the pressure on it.
    dead: Vec<f64>,
    external: Vec<f64>,
    internal: Vec<f64>,
    residual: Vec<f64>,
    /// Forces of inertia and damping.
    inertia: Vec<f64>,
    increment: Vec<f64>,
    step: Vec<f64>,
    /// Power of the residual along the last step, per step [J]; used with tools.
    descent: f64,
    /// Whether the steps of this frame follow friction: until one has increased the residual.
    follows_friction: bool,
    /// Norm of the residual after each step, by its number: of this frame, then of the last one [N].
    residuals: Vec<f64>,
    trial: Vec<f64>,
    forces: Vec<f64>,
}

impl Stepper {
    /// A body with `fixed` degrees of freedom, from the displacement `start` or rest.
    ///
    /// # Errors
    /// Settings out of range; indices out of range; a start without energy, as where a cell is inside out.
    pub fn new(
        body: &Body,
        fixed: &[u32],
        start: Option<Vec<f64>>,
        settings: StepperSettings,
    ) -> Result<Self, Error> {
        settings.check()?;
        let n = body.n_dofs();
        let displacement = start.unwrap_or_else(|| vec![0.0; n]);
        check_vector("start displacement", &displacement, n)?;
        if let Some(dof) = fixed.iter().find(|&&dof| dof as usize >= n) {
            return Err(Error::input(format!(
                "point {} is fixed; there are {} points",
                dof / 3,
                n / 3
            )));
        }
        check_start(body, &displacement)?;
        let barrier = VolumeBarrier::new(VOLUME_BOUNDS, body, &displacement);
        let time_step = settings.time_step.unwrap_or_default();
        let motion = match &settings.dynamics {
            Some(dynamics) => {
                let mass = MassMatrix::new(dynamics.mass, body, &settings.density)?;
                Some(Motion::new(dynamics, time_step, mass, n))
            }
            None => None,
        };
        let stiffness_damping =
            settings.dynamics.as_ref().and_then(|dynamics| StiffnessDamping::new(dynamics, n));
        let nodal_mass = match &motion {
            Some(motion) => motion.mass.weights(),
            None if settings.density.is_empty() => Vec::new(),
            None => nodal_weight(body, &settings.density)?,
        };
        if settings.relaxation.is_some() && body.element() != Element::P1 {
            return Err(Error::input(format!(
                "relaxation is for the element \"P1\", this body has {:?}; choose element=\"P1\"",
                body.element().name()
            )));
        }
        let relax = |prony| Relaxation::new(prony, time_step, body, &displacement);
        let relaxation = settings.relaxation.as_ref().map(relax);
        let fixed = fixed.to_vec();
        let dofs = fixed.iter().copied();
        let contact = Contact::new(body).on_fixed(dofs.clone());
        Ok(Stepper {
            solver: ConstrainedSystem::new(settings.method, body, dofs, Vec::new())?.for_frames(),
            tangent: settings.method.tangent(body),
            settings,
            fixed,
            grasped: Vec::new(),
            patches: Vec::new(),
            turning: Vec::new(),
            torques: Vec::new(),
            motion,
            stiffness_damping,
            relaxation,
            nodal_mass,
            pressure: Pressure::default(),
            contact,
            widened: None,
            rounding: Rounding::of(body),
            regions: Regions::of(body),
            magnitude: 0.0,
            length: diagonal(body.points()),
            most_energy: most_energy(body),
            barrier,
            motion_fraction: 1.0,
            hands_move: false,
            was_settled: true,
            unsettled: 0,
            extrapolation: Extrapolation::default(),
            ahead: 0.0,
            tail: Duration::ZERO,
            longest_frame: f64::INFINITY,
            convex: Duration::ZERO,
            projects_next: false,
            shift: 0.0,
            start: displacement.clone(),
            displacement,
            dead: vec![0.0; n],
            external: vec![0.0; n],
            internal: vec![0.0; n],
            residual: vec![0.0; n],
            inertia: vec![0.0; n],
            increment: vec![0.0; n],
            step: vec![0.0; n],
            descent: 0.0,
            follows_friction: true,
            residuals: Vec::new(),
            trial: vec![0.0; n],
            forces: Vec::new(),
        })
    }

    /// The hands hold these degrees of freedom and the means of these patches from now on, and nothing else.
    ///
    /// # Errors
    /// Those of [`Problem::check_grasp`]. A body without enough supports is not refused: inertia may hold it, and
    /// without inertia the frame reports that its tangent was not definite.
    pub fn grasp(&mut self, body: &Body, dofs: &[u32], patches: &[Patch]) -> Result<(), Error> {
        if dofs == self.grasped && patches == self.patches {
            return Ok(());
        }
        let load = |patch: &Patch| PatchLoad { patch: patch.clone(), displacement: [0.0; 3] };
        let problem = Problem {
            body,
            prescribed: self.fixed.iter().chain(dofs).map(|&dof| (dof, 0.0)).collect(),
            force: vec![0.0; body.n_dofs()],
            pressure: Pressure::default(),
            patches: patches.iter().map(load).collect(),
            start: None,
        };
        problem.check_grasp()?;
        self.grasped = dofs.to_vec();
        self.patches = patches.to_vec();
        self.turning.clear();
        self.extrapolation.forget();
        self.solver.hold(dofs, mean_rows(patches));
        self.motion.iter_mut().for_each(Motion::release);
        self.motion_fraction = 1.0;
        Ok(())
    }

    /// Displacement after the last frame [m].
    pub fn displacement(&self) -> &[f64] {
        &self.displacement
    }

    /// Why the requested device is not used, if it is not.
    pub fn device_fault(&self) -> Option<&str> {
        self.solver.device_fault()
    }

    /// Where the last tangent on the requested device came from; none without one.
    pub fn origin(&self) -> Option<Origin> {
        self.solver.origin()
    }

    /// How long a frame may take [s] whose iterations take as long as those of the last one; infinite before the first.
    pub fn longest_frame(&self) -> f64 {
        self.longest_frame
    }

    /// Velocity after the last frame [m/s]; none without inertia.
    pub fn velocity(&self) -> Option<&[f64]> {
        self.motion.as_ref().map(|motion| motion.velocity.as_slice())
    }

    /// Sets the velocity of everything that is not fixed [m/s].
    ///
    /// # Errors
    /// A wrong length; a value that is not finite; no inertia.
    pub fn set_velocity(&mut self, velocity: &[f64]) -> Result<(), Error> {
        check_vector("velocity", velocity, self.displacement.len())?;
        let Some(motion) = &mut self.motion else {
            return Err(Error::input(
                "a velocity means nothing without dynamics; choose an integration",
            ));
        };
        motion.velocity.copy_from_slice(velocity);
        self.fixed.iter().for_each(|&dof| motion.velocity[dof as usize] = 0.0);
        motion.has_started = false;
        Ok(())
    }

    /// Reaction at each degree of freedom after the last frame [N]: internal force and inertia minus the applied
    /// forces.
    pub fn reactions(&self) -> impl Iterator<Item = f64> + '_ {
        self.internal.iter().zip(&self.external).map(|(i, e)| i - e)
    }

    /// The same without the forces `Wᵀ F` of the patches' tools [N]: what holds nodes themselves.
    pub fn supports(&self) -> Vec<f64> {
        let mut supports: Vec<f64> = self.reactions().collect();
        for (patch, force) in self.patches.iter().zip(self.forces.chunks_exact(3)) {
            for (&node, w) in patch.nodes.iter().zip(&patch.weights) {
                (0..3).for_each(|i| supports[3 * node as usize + i] -= w * force[i]);
            }
        }
        let rows = self.turning.iter().flat_map(|turning| &turning.rows);
        for (row, force) in rows.zip(self.forces.iter().skip(3 * self.patches.len())) {
            row.iter().for_each(|&(dof, w)| supports[dof as usize] -= w * force);
        }
        supports
    }

    /// One frame.
    ///
    /// # Errors
    /// Values of a wrong length or not finite; gravity without a density; a tangent that no shift makes definite.
    /// The state is then that of the frame before.
    pub fn frame(&mut self, body: &Body, input: &Input<'_>) -> Result<Frame, Error> {
        self.frame_while(body, input, &|| true)
    }

    /// As [`frame`](Self::frame), as long as it is wanted: that is asked before every iteration but the first.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame); [`Error::Cancelled`].
    pub fn frame_while(
        &mut self,
        body: &Body,
        input: &Input<'_>,
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame, Error> {
        if !body.is_shared() {
            return self.frame_here(body, input, is_wanted);
        }
        in_common_pool(|| self.frame_here(body, input, is_wanted))
    }

    fn frame_here(
        &mut self,
        body: &Body,
        input: &Input<'_>,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Frame, Error> {
        let clock = Instant::now();
        input.check(self.grasped.len(), &self.patches, self.displacement.len())?;
        if self.nodal_mass.is_empty() && input.gravity != [0.0; 3] {
            return Err(Error::input("gravity needs a density [kg/m^3]"));
        }
        let deadline = self.settings.budget.map(|budget| {
            let budget = Duration::from_secs_f64(budget.min(LONGEST_BUDGET));
            clock + budget.mul_f64(SPENDABLE).saturating_sub(self.tail.min(budget / 2))
        });
        self.longest_frame = f64::INFINITY;
        self.turn(body, input.turns)?;
        let loads_stay = self.apply_loads(input);
        self.start.copy_from_slice(&self.displacement);
        let hands = self.places_of_hands(input);
        self.begin_contact(loads_stay && self.extrapolation.are_at(&hands));
        self.contact.find_sweep(body, &self.displacement);
        self.follows_friction = true;
        self.convex = self.convex.mul_f64(CONVEX_KEPT);
        self.ahead = self.extrapolate(body, &hands);
        let outcome = self.advance(body, input, deadline, is_wanted);
        let progress = match outcome {
            Ok(progress) => progress,
            Err(error) => {
                self.displacement.copy_from_slice(&self.start);
                self.barrier.begin(body, &self.displacement);
                self.extrapolation.forget();
                return Err(error);
            }
        };
        self.keep_motion(hands, progress.is_whole());
        let is_entered = self.contact.find_entry(body, &self.displacement).is_some();
        self.end(body);
        self.tail = progress.solved_at.elapsed().max(self.tail.mul_f64(TAIL_KEPT));
        let seconds = clock.elapsed().as_secs_f64();
        let each = seconds / progress.steps.max(1) as f64;
        self.longest_frame = each * self.settings.iterations as f64;
        self.was_settled =
            progress.is_settled(self.settings.settled) && self.barrier.is_idle() && !is_entered;
        self.unsettled = if self.was_settled || !progress.has_arrived {
            0
        } else {
            self.unsettled + progress.steps
        };
        Ok(Frame {
            residual: progress.residual,
            is_settled: self.was_settled,
            steps: progress.steps,
            cells_at_bound: self.barrier.n_cells(),
            taken: progress.taken,
            is_unstable: progress.is_unstable,
            iterations: progress.iterations,
            is_solved: progress.is_solved,
            floor: progress.floor,
            within_budget: self.settings.budget.is_none_or(|budget| seconds <= budget),
            seconds,
            energy: progress.energy,
            kinetic_energy: self.motion.as_ref().map_or(0.0, |m| m.mass.energy(&m.velocity)),
            patch_forces: self.patch_forces(),
            patch_torques: self.patch_torques(body),
        })
    }

    /// Whether they are those of the last frame.
    fn apply_loads(&mut self, input: &Input<'_>) -> bool {
        let mut dead = vec![0.0; self.dead.len()];
        if !input.force.is_empty() {
            dead.copy_from_slice(input.force);
        }
        for (force, mass) in dead.chunks_exact_mut(3).zip(&self.nodal_mass) {
            (0..3).for_each(|i| force[i] += mass * input.gravity[i]);
        }
        let have_stayed = dead == self.dead && self.torques == input.torques;
        self.dead = dead;
        self.torques.clear();
        self.torques.extend_from_slice(input.torques);
        have_stayed
    }
}
