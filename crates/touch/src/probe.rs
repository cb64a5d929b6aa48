//! A rigid sphere on a reduced model: it presses, sticks, slides and lets go.
//!
//! The model holds the mean of a patch. A sphere touches less: at first a point. By Hertz a sphere that enters by `g`
//! touches a disc of radius `sqrt(R g)` and feels as much less force as the disc is smaller than the patch, whatever
//! the tissue. So the patch is moved by a share of the motion of the sphere,
//! `d = share(g) (t - g n)`, `share(g) = min(1, SHARE sqrt(R g + GRAIN h^2) / r)`,
//! with the normal `n` below the centre, the radius `r` of the patch, the mean edge `h` of the surface, which limits
//! how small a contact the mesh can show, and the drag `t`: from the point `s` that the sphere holds to the point below
//! its centre, which is bounded in proportion to `g`. The force is `F(s, d)` of the model. It is kept in Coulomb's cone by
//! return mapping: where the force along the surface exceeds the cone, the tissue slips below the sphere, which changes `t`
//! and with it `s`.

use super::error::Error;
use super::evaluate::Trust;
use super::felt::{Beside, Decisive, Felt, Grip};
use super::model::ReducedModel;
use super::press::{Press, within};
use super::return_mapping::{Held, Return};
use super::skin::{Marks, Touching};
use super::worth::Worth;
use viscera_mesh::{cross, dot, norm, sub};
use viscera_number::tensor::Mat3;

/// Radii of a probe, in units of the radius of the patch.
pub const RADII: [f64; 2] = [0.8, 1.25];
/// Error of a trusted force, relative to its norm, unless a probe is given another. A smaller contact is trusted as one that
/// the mesh can show: its relative error is larger, and in newtons it is smaller.
pub const TOLERANCE: f64 = 0.35;
/// A contact that begins deeper than this part of the radius has not begun outside.
const ONSET: f64 = 0.5;
/// Of the force, what may be missing to the balance without being told.
const TOLD: f64 = 1e-3;
/// A force is not trusted from here on, in units of the depth that a probe may enter.
pub(super) const BEYOND: f64 = 1.0 + 1e-6;

/// How much deeper a sphere may be in the organ than in its touchable surface without being told, over the depth that a probe
/// may enter: a light touch.
const BEYOND_SURFACE: f64 = 0.1;

/// Error of a force, relative to its norm, that comes from the superposition, over how far the others have moved the surface,
/// relative to how far the probe has entered it. With it the estimates are above the errors of 96 of 100 forces of
/// `benchmarks/probes.py 60 tuning`.
const COUPLED: f64 = 0.1;

/// A spring and a damper between a device and a probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Stiffness [N/m].
    pub stiffness: f64,
    /// Damping [N s/m].
    pub damping: f64,
}

/// A rigid sphere on the touchable surface of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    pub(super) radius: f64,
    pub(super) friction: f64,
    tolerance: f64,
    pub(super) coupling: Option<Coupling>,
    pub(super) state: State,
    /// How far other probes move the surface where this one meets it [m].
    pub(super) carried: [f64; 3],
    /// Where the next search for the balance begins, if not where the probe is.
    pub(super) balanced: Option<[f64; 3]>,
    /// For the search for a second place that it touches.
    marks: Marks,
}

/// Where a probe is and what it remembers from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct State {
    pub(super) center: Option<[f64; 3]>,
    pub(super) device: [f64; 3],
    pub(super) anchor: Option<Anchor>,
    is_inside: bool,
}

/// What a probe remembers of a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    /// The point of the surface that is held.
    pub(super) point: [f64; 3],
    /// The triangle below the centre.
    pub(super) triangle: usize,
}

/// A pose tried, before it is taken.
pub(super) struct Tried {
    pub(super) felt: Felt,
    pub(super) anchor: Option<Anchor>,
    pub(super) normal: [f64; 3],
    /// Derivative of the force with respect to the centre [N/m].
    pub(super) stiffness: Mat3<f64>,
    /// None where there is no force.
    pub(super) worth: Option<Worth>,
}

impl Probe {
    /// A probe that is not yet at any place. `friction` is Coulomb's coefficient, `tolerance` the largest estimated
    /// error of a trusted force. Without a coupling the probe is where the device is.
    ///
    /// # Errors
    /// [`Error::Input`] if a value is out of its range; the radius is 0.8 to 1.25 times that of the model's patch.
    pub fn new(
        model: &ReducedModel,
        radius: f64,
        friction: f64,
        tolerance: f64,
        coupling: Option<Coupling>,
    ) -> Result<Self, Error> {
        let patch = model.metadata.radius;
        let [low, high] = RADII.map(|part| part * patch);
        if !(low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(&radius) {
            return Err(Error::input(format!(
                "the radius of a probe is {radius:.6} m; this model's patch of {patch:.6} m serves radii from {low:.6} \
                 to {high:.6} m. Reduce with another radius, or with a range of it"
            )));
        }
        if !(0.0..=1e3).contains(&friction) {
            return Err(Error::input(format!(
                "the friction of a probe is {friction}; it must be from 0 to 1000"
            )));
        }
        let mut probe = Probe {
            radius,
            friction,
            tolerance: TOLERANCE,
            coupling: None,
            state: State::default(),
            carried: [0.0; 3],
            balanced: None,
            marks: model.skin.marks(),
        };
        probe.tolerate(tolerance)?;
        probe.couple(coupling)?;
        Ok(probe)
    }

    /// Sets the largest estimated error of a trusted force, relative to its norm.
    ///
    /// # Errors
    /// [`Error::Input`] unless it is above 0 and at most 1.
    pub fn tolerate(&mut self, tolerance: f64) -> Result<(), Error> {
        if !(tolerance > 0.0 && tolerance <= 1.0) {
            return Err(Error::input(format!(
                "the tolerance of a probe is {tolerance}; it must be above 0 and at most 1"
            )));
        }
        self.tolerance = tolerance;
        Ok(())
    }

    /// Sets the coupling, or takes it away.
    ///
    /// # Errors
    /// [`Error::Input`] unless the stiffness is above 0, the damping at least 0, and both are finite.
    pub fn couple(&mut self, coupling: Option<Coupling>) -> Result<(), Error> {
        if let Some(Coupling { stiffness, damping }) = coupling {
            let is_usable = stiffness > 0.0 && stiffness.is_finite() && damping >= 0.0;
            if !(is_usable && damping.is_finite()) {
                return Err(Error::input(format!(
                    "the coupling of a probe has stiffness {stiffness} N/m and damping {damping} N s/m; the stiffness \
                     must be above 0, the damping at least 0, both finite"
                )));
            }
        }
        self.coupling = coupling;
        Ok(())
    }

    /// Radius of the sphere [m].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Takes the probe from the organ: the next place is a first one.
    pub fn lift(&mut self) {
        self.state = State { device: self.state.device, ..State::default() };
    }

    /// Moves the centre of the sphere to a place, and tells what it feels there.
    pub fn place(&mut self, model: &ReducedModel, center: [f64; 3]) -> Felt {
        if !is_finite(center) {
            return self.lost(model);
        }
        match self.attempt(model, center) {
            Some(tried) => self.take(model, tried, 0.0),
            None => self.lost(model),
        }
    }

    /// How far a probe may enter: as deep as the model was made for, and not beyond the centre.
    pub(super) fn deepest(&self, model: &ReducedModel) -> f64 {
        model.metadata.depth.min(self.radius)
    }

    /// Goes to a pose that was tried, where the force lacks so much to the balance with a coupling [N].
    pub(super) fn take(&mut self, model: &ReducedModel, tried: Tried, lacks: f64) -> Felt {
        let Tried { mut felt, anchor, worth, .. } = tried;
        let center = felt.center;
        if let Some(worth) = worth {
            let size = norm(felt.force);
            let lacks = if lacks > TOLD * size { lacks / size } else { 0.0 };
            (felt.error_estimate, felt.trust, felt.decisive) =
                worth.of_force(lacks, self.tolerance);
            (felt.shape_error_estimate, felt.shape_trust, felt.shape_decisive) =
                worth.of_shape(lacks, self.tolerance);
        }
        self.state = State {
            center: Some(center),
            device: center,
            anchor,
            is_inside: felt.grip == Grip::Inside,
        };
        match (felt.grip, anchor) {
            (Grip::Free, _) if self.is_past_the_surface(model, &felt) => {
                felt.with(Beside::Untouchable)
            }
            (_, Some(anchor)) if !self.is_beyond(model, -felt.gap) => {
                felt.with(match self.beside(model, center, anchor.triangle) {
                    Beside::Nothing if self.is_past_the_surface(model, &felt) => {
                        Beside::Untouchable
                    }
                    beside => beside,
                })
            }
            _ => felt,
        }
    }

    /// Whether the sphere is deeper in the organ than in its touchable surface, which ends there.
    fn is_past_the_surface(&self, model: &ReducedModel, felt: &Felt) -> bool {
        let (points, _) = model.arrays.points.as_chunks::<3>();
        let at = sub(felt.center, self.carried);
        let deeper = model.skin.overlap(points, at, self.radius) - (-felt.gap).max(0.0);
        deeper > BEYOND_SURFACE * self.deepest(model)
    }

    /// The same where the force and the field may be wrong by so much more, relative to their norms.
    pub(super) fn doubt(&self, mut felt: Felt, more: f64) -> Felt {
        if more <= TOLD {
            return felt;
        }
        let doubted = |error: f64, trust: Trust, decisive: Decisive| {
            // A light touch is trusted though its estimate is larger.
            let is_too_much =
                more > self.tolerance || (error..=error + more).contains(&self.tolerance);
            let estimate = (error + more).min(1.0);
            let sum = Decisive { estimate, allowed: self.tolerance, has_contact: true };
            match trust {
                Trust::Trusted if is_too_much => (estimate, Trust::ErrorTooLarge, sum),
                trust => (estimate, trust, decisive),
            }
        };
        (felt.error_estimate, felt.trust, felt.decisive) =
            doubted(felt.error_estimate, felt.trust, felt.decisive);
        (felt.shape_error_estimate, felt.shape_trust, felt.shape_decisive) =
            doubted(felt.shape_error_estimate, felt.shape_trust, felt.shape_decisive);
        felt
    }

    /// What else the sphere touches than the surface around a triangle: a support does not give way, and the patch knows
    /// nothing of it; nor does it know of a second place.
    fn beside(&mut self, model: &ReducedModel, center: [f64; 3], triangle: usize) -> Beside {
        if model.supports.any_within(center, self.radius) {
            return Beside::Support;
        }
        let corners = model.triangles[triangle];
        let sphere = Touching {
            center: sub(center, self.carried),
            radius: self.radius,
            triangle: corners.map(|p| model.arrays.positions[p as usize]),
        };
        let (points, _) = model.arrays.points.as_chunks::<3>();
        match model.skin.is_touched_twice(points, &sphere, &mut self.marks) {
            true => Beside::SecondPlace,
            false => Beside::Nothing,
        }
    }

    /// No force, at the last place; the touch is over.
    pub(super) fn lost(&mut self, model: &ReducedModel) -> Felt {
        let center = self.state.center.unwrap_or(model.positions[model.triangles[0][0] as usize]);
        self.state.anchor = None;
        let contact = model.locate(center).unwrap_or_else(|| model.centroid(0));
        Felt::untouched(Grip::Lost, center, contact, contact.distance - self.radius)
    }

    /// What the probe feels with its centre at a finite place; none if the model overflows there.
    pub(super) fn attempt(&self, model: &ReducedModel, center: [f64; 3]) -> Option<Tried> {
        // In the place of the surface before all touches.
        let at = sub(center, self.carried);
        let foot = match self.state.anchor {
            Some(anchor) => model.walk(anchor.triangle, at),
            None => model.locate(at)?,
        };
        let normal = model.normal(&foot);
        let above = dot(sub(at, foot.point), normal) >= 0.0;
        let entered = self.radius - if above { foot.distance } else { -foot.distance };
        let free = |grip| {
            let felt = Felt::untouched(grip, center, foot, -entered);
            Some(Tried { felt, anchor: None, normal, stiffness: [[0.0; 3]; 3], worth: None })
        };
        if !entered.is_finite() {
            return None;
        }
        if entered <= 0.0 || model.overhang(&foot, at) > model.edge_length {
            return free(Grip::Free);
        }
        let deepest = self.deepest(model);
        if self.state.is_inside {
            return free(Grip::Inside);
        }
        if self.state.anchor.is_none() && entered > ONSET * self.radius {
            // Behind the touchable surface it may be beyond the organ.
            let (points, _) = model.arrays.points.as_chunks::<3>();
            let is_outside = !above && model.skin.is_outside(points, at);
            return free(if is_outside { Grip::Free } else { Grip::Inside });
        }
        let press = Press::new(model, self.radius, entered.min(deepest), normal);
        let held = self.state.anchor.map_or(foot.point, |anchor| anchor.point);
        let mapping = Return { model, press: &press, foot: &foot, friction: self.friction };
        let Held { contact, drag, grip, length, is_on_cone, kept, off } =
            mapping.settle(press.along(sub(foot.point, held)));
        let d = press.displacement(drag);
        let answer = model.respond(&contact, d);
        if !(is_finite(answer.force) && answer.stiffness.iter().all(|&row| is_finite(row))) {
            return None;
        }
        let pressing = -dot(answer.force, normal);
        // Tissue does not pull at a probe.
        if pressing <= 0.0 {
            return free(Grip::Free);
        }
        // What the iterations have left of the path to the cone.
        let along = within([0.0; 3], press.along(answer.force), self.friction * pressing);
        let force = std::array::from_fn(|i| along[i] - pressing * normal[i]);
        let torque = cross(normal.map(|x| -self.radius * x), force);
        let worth = Worth {
            answer,
            allowed: model.allowed(norm(d)),
            contact: press.error,
            other: COUPLED * norm(self.carried) / entered + off / norm(force),
            is_beyond: self.is_beyond(model, entered),
        };
        let (error_estimate, trust, decisive) = worth.of_force(0.0, self.tolerance);
        let (shape_error_estimate, shape_trust, shape_decisive) =
            worth.of_shape(0.0, self.tolerance);
        let felt = Felt {
            grip,
            center,
            contact,
            displacement: d,
            gap: -entered,
            force,
            torque,
            error_estimate,
            trust,
            decisive,
            shape_error_estimate,
            shape_trust,
            shape_decisive,
            beside: Beside::Nothing,
        };
        let anchor = Some(Anchor { point: contact.point, triangle: foot.triangle });
        let stiffness = match is_on_cone {
            true => press.sliding(&answer.stiffness, drag, [self.friction, kept], along),
            false => press.stuck(&answer.stiffness, drag, length),
        };
        Some(Tried { felt, anchor, normal, stiffness, worth: Some(worth) })
    }

    /// Whether a sphere that has entered so far is too deep for its force to be trusted.
    fn is_beyond(&self, model: &ReducedModel, entered: f64) -> bool {
        entered > self.deepest(model) * (0.5 + 0.5 * BEYOND)
    }
}

pub(super) fn is_finite(v: [f64; 3]) -> bool {
    v.iter().all(|x| x.is_finite()) && norm(v).is_finite()
}
