//! A rigid sphere on a reduced model: it presses, sticks, slides and lets go.
//!
//! The model holds the mean of a patch. A sphere touches less: at first a point. By Hertz a sphere that enters by `g`
//! touches a disc of radius `sqrt(R g)` and feels as much less force as the disc is smaller than the patch, whatever
//! the tissue. So the patch is moved by a share of the motion of the sphere,
//! `d = share(g) (t - g n)`, `share(g) = min(1, SHARE sqrt(R g + GRAIN h^2) / r)`,
//! with the normal `n` below the centre, the radius `r` of the patch, the mean edge `h` of the surface, which limits
//! how small a contact the mesh can show, and the drag `t`: from the point `s` that the sphere holds to the point below
//! its centre. The force is `F(s, d)` of the model. It is kept in Coulomb's cone by return mapping: where the force
//! along the surface exceeds the cone, the tissue slips below the sphere, which changes `t` and with it `s`.

use super::contact::Contact;
use super::error::Error;
use super::evaluate::Trust;
use super::felt::{Beside, Felt, Grip};
use super::model::ReducedModel;
use super::press::{CONTACT_ERROR, Press};
use super::skin::{Marks, Touching};
use viscera_mesh::{cross, dot, norm, sub};

/// Radii of a probe, in units of the radius of the patch.
pub const RADII: [f64; 2] = [0.8, 1.25];
/// Error of a trusted force, relative to its norm, unless a probe is given another. A smaller contact is trusted as one that
/// the mesh can show: its relative error is larger, and in newtons it is smaller.
pub const TOLERANCE: f64 = 0.35;
/// How far a probe moves at most in a tick when it follows a device, in units of its radius.
const STRIDE: f64 = 0.25;
/// A contact that begins deeper than this part of the radius has not begun outside.
const ONSET: f64 = 0.5;
/// The drag is at most this part of the radius.
const DRAG: f64 = 0.5;
/// Iterations of the friction, and of the coupling.
const RETURNS: usize = 3;
const BALANCES: usize = 4;
/// Where these end early: a step in units of the radius, a force along the surface in units of that onto it.
const BALANCED: f64 = 1e-6;
const RETURNED: f64 = 1e-3;
/// A force is not trusted from here on, in units of the depth that a probe may enter.
const BEYOND: f64 = 1.0 + 1e-6;

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
    radius: f64,
    friction: f64,
    tolerance: f64,
    coupling: Option<Coupling>,
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
    center: Option<[f64; 3]>,
    device: [f64; 3],
    anchor: Option<Anchor>,
    is_inside: bool,
}

/// What a probe remembers of a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Anchor {
    /// The point of the surface that is held.
    point: [f64; 3],
    /// The triangle below the centre.
    triangle: usize,
}

/// A pose tried, before it is taken.
struct Tried {
    felt: Felt,
    anchor: Option<Anchor>,
    normal: [f64; 3],
    /// Derivative of the force with respect to the centre, along the normal and along the surface [N/m].
    stiffness: [f64; 2],
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
            Some(tried) => self.take(model, tried, center),
            None => self.lost(model),
        }
    }

    /// Draws the probe by its coupling to a device, `dt` seconds after the last step: the probe goes where coupling and
    /// tissue are in balance, by at most a quarter of its radius. The force is that of the tissue.
    pub fn follow(&mut self, model: &ReducedModel, device: [f64; 3], dt: f64) -> Felt {
        if !(is_finite(device) && dt > 0.0 && dt.is_finite()) {
            return self.lost(model);
        }
        let (Some(Coupling { stiffness, damping }), Some(last)) =
            (self.coupling, self.state.center)
        else {
            return self.place(model, device);
        };
        let rate = damping / dt;
        let total = stiffness + rate;
        let drawn: [f64; 3] = std::array::from_fn(|i| {
            (stiffness * device[i] + rate * (last[i] + device[i] - self.state.device[i])) / total
        });
        if !is_finite(drawn) {
            return self.lost(model);
        }
        let goal = within(last, drawn, STRIDE * self.radius);
        let mut center = self.balanced.take().unwrap_or(last);
        for _ in 0..BALANCES {
            let Some(tried) = self.attempt(model, center) else { return self.lost(model) };
            let rest: [f64; 3] =
                std::array::from_fn(|i| total * (goal[i] - center[i]) - tried.felt.force[i]);
            let (n, [normal, along]) = (tried.normal, tried.stiffness);
            let up = dot(rest, n);
            let step: [f64; 3] = std::array::from_fn(|i| {
                up * n[i] / (total + normal) + (rest[i] - up * n[i]) / (total + along)
            });
            let step = within([0.0; 3], step, 0.5 * self.radius);
            // Not deeper than the model goes, but so far that the force there is not trusted.
            let depth = -tried.felt.gap - dot(step, n);
            let out = (depth - BEYOND * self.deepest(model)).max(0.0);
            let out = if tried.anchor.is_some() { out } else { 0.0 };
            let next: [f64; 3] = std::array::from_fn(|i| center[i] + step[i] + out * n[i]);
            if norm(sub(next, center)) <= BALANCED * self.radius {
                let felt = self.take(model, tried, center);
                self.state.device = device;
                return felt;
            }
            center = next;
        }
        let felt = self.place(model, center);
        self.state.device = device;
        felt
    }

    /// How far a probe may enter: as deep as the model was made for, and not beyond the centre.
    fn deepest(&self, model: &ReducedModel) -> f64 {
        model.metadata.depth.min(self.radius)
    }

    fn take(&mut self, model: &ReducedModel, tried: Tried, center: [f64; 3]) -> Felt {
        self.state = State {
            center: Some(center),
            device: center,
            anchor: tried.anchor,
            is_inside: tried.felt.grip == Grip::Inside,
        };
        let is_touching = !self.is_beyond(model, -tried.felt.gap);
        match tried.anchor.filter(|_| is_touching) {
            Some(anchor) => tried.felt.with(self.beside(model, center, anchor.triangle)),
            None => tried.felt,
        }
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
    fn lost(&mut self, model: &ReducedModel) -> Felt {
        let center = self.state.center.unwrap_or(model.positions[model.triangles[0][0] as usize]);
        self.state.anchor = None;
        let contact = model.locate(center).unwrap_or_else(|| model.centroid(0));
        Felt::untouched(Grip::Lost, center, contact, contact.distance - self.radius)
    }

    /// What the probe feels with its centre at a finite place; none if the model overflows there.
    fn attempt(&self, model: &ReducedModel, center: [f64; 3]) -> Option<Tried> {
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
            Some(Tried { felt, anchor: None, normal, stiffness: [0.0; 2] })
        };
        if !entered.is_finite() {
            return None;
        }
        if entered <= 0.0 || model.overhang(&foot, at) > model.edge_length {
            return free(Grip::Free);
        }
        let deepest = self.deepest(model);
        if self.state.is_inside || (self.state.anchor.is_none() && entered > ONSET * self.radius) {
            return free(Grip::Inside);
        }
        let press = Press::new(model, self.radius, entered.min(deepest), normal);
        let (contact, drag, grip) = self.settle(model, &press, &foot);
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
        let is_beyond = self.is_beyond(model, entered);
        let carried = norm(self.carried) / entered;
        let worth = |error, trust| self.worth([error, press.error], carried, trust, is_beyond);
        let (error_estimate, trust) = worth(answer.error_estimate, answer.trust);
        let (shape_error_estimate, shape_trust) =
            worth(answer.shape_error_estimate, answer.shape_trust);
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
            shape_error_estimate,
            shape_trust,
            beside: Beside::Nothing,
        };
        let anchor = Some(Anchor { point: contact.point, triangle: foot.triangle });
        Some(Tried {
            felt,
            anchor,
            normal,
            stiffness: press.stiffness(&answer, grip == Grip::Sticks),
        })
    }

    /// Return mapping: the point that is held, how far it is dragged, and whether it slips.
    fn settle(
        &self,
        model: &ReducedModel,
        press: &Press,
        foot: &Contact,
    ) -> (Contact, [f64; 3], Grip) {
        let held = self.state.anchor.map_or(foot.point, |anchor| anchor.point);
        let most = DRAG * self.radius;
        let mut drag = within([0.0; 3], press.along(sub(foot.point, held)), most);
        let mut contact = model.walk(foot.triangle, sub(foot.point, drag));
        let mut grip = if self.friction > 0.0 { Grip::Sticks } else { Grip::Slides };
        for _ in 0..RETURNS {
            let (force, stiffness) = model.reaction(&contact, press.displacement(drag));
            let pressing = (-dot(force, press.normal)).max(0.0);
            let bound = self.friction * pressing;
            let along = press.along(force);
            let size = norm(along);
            if size > bound {
                grip = Grip::Slides;
            }
            if !(size > bound + RETURNED * pressing) {
                break;
            }
            let excess = along.map(|x| x * (1.0 - bound / size));
            let slip = press.slip(&stiffness, excess);
            drag = within([0.0; 3], sub(drag, slip), most);
            contact = model.walk(foot.triangle, sub(foot.point, drag));
        }
        (contact, drag, grip)
    }

    /// Whether a sphere that has entered so far is too deep for its force to be trusted.
    fn is_beyond(&self, model: &ReducedModel, entered: f64) -> bool {
        entered > self.deepest(model) * (0.5 + 0.5 * BEYOND)
    }

    /// Estimate and trust: errors of the model, of the patch for the contact, and of what others carry along, relative to
    /// what has been entered.
    fn worth(
        &self,
        [model, contact]: [f64; 2],
        carried: f64,
        trust: Trust,
        is_beyond: bool,
    ) -> (f64, Trust) {
        let coupled = COUPLED * carried;
        let error = (model + contact + coupled).min(1.0);
        let is_within = (model + CONTACT_ERROR + coupled).min(1.0) <= self.tolerance;
        match trust {
            _ if is_beyond => (error, Trust::BeyondDepth),
            Trust::Trusted if !is_within => (error, Trust::ErrorTooLarge),
            trust => (error, trust),
        }
    }
}

/// The point on the line from one to another that is at most a length away from the first.
fn within(from: [f64; 3], to: [f64; 3], length: f64) -> [f64; 3] {
    let line = sub(to, from);
    let size = norm(line);
    if size <= length {
        return to;
    }
    let part = if size.is_finite() { length / size } else { 0.0 };
    std::array::from_fn(|i| from[i] + part * line[i])
}

fn is_finite(v: [f64; 3]) -> bool {
    v.iter().all(|x| x.is_finite()) && norm(v).is_finite()
}
