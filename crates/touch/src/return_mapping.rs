//! Coulomb's law on a model by return mapping: where the force along the surface exceeds the cone, the tissue slips below
//! the sphere until it does not.
//!
//! A slip shortens the drag and moves the place that is held. Newton's step takes the stiffness of one place. Where that
//! changes much from place to place the step is too long, and the force comes out within the cone, or beyond it on the
//! other side. The next drag is then between the two.

use super::contact::Contact;
use super::felt::Grip;
use super::model::ReducedModel;
use super::press::{Press, within};
use viscera_mesh::{dot, norm, sub};

/// How often the force is computed on the way to the cone.
const RETURNS: usize = 4;
/// Where it ends early: what is left to the cone, in units of the force onto the surface.
const RETURNED: f64 = 1e-3;
/// Of the way between a drag beyond the cone and one within it, the part that a secant leaves at either end.
const MARGIN: f64 = 0.1;
/// A force has gone past the cone where it is by more than this part of what it is off against the direction of the slip.
const PAST: f64 = 0.7;
/// The tissue slips where the drag is longer than the sphere can hold by more than rounding.
const CUT: f64 = 1.0 + 1e-9;

/// The sphere over a foot on the surface.
pub(super) struct Return<'a> {
    pub model: &'a ReducedModel,
    pub press: &'a Press,
    pub foot: &'a Contact,
    pub friction: f64,
}

/// Where a sphere holds the surface, and how far that is dragged.
pub(super) struct Held {
    pub contact: Contact,
    pub drag: [f64; 3],
    pub grip: Grip,
    /// How long the drag was before the tissue slipped [m].
    pub length: f64,
    /// Whether friction bounds the force along the surface, or there is none; else the sphere holds what it can of the drag.
    pub is_on_cone: bool,
    /// The part of the force along the surface that is left after the slip.
    pub kept: f64,
    /// What the force along the surface lacks to the cone, or goes beyond it, where the tissue slips [N].
    pub off: f64,
}

/// A drag that was tried.
#[derive(Clone, Copy)]
struct Tried {
    contact: Contact,
    drag: [f64; 3],
    /// The force along the surface, its bound, and the force onto the surface [N].
    along: [f64; 3],
    bound: f64,
    pressing: f64,
    /// Beyond the cone along the direction of the last slip; negative past it [N].
    excess: f64,
    /// Newton's step to the cone.
    slip: [f64; 3],
}

impl Tried {
    /// How far from the cone [N].
    fn off(&self) -> f64 {
        (norm(self.along) - self.bound).max(-self.excess)
    }

    fn has_returned(&self) -> bool {
        self.off() <= RETURNED * self.pressing
    }

    fn is_past(&self) -> bool {
        self.excess < 0.0 && -self.excess >= PAST * self.off()
    }
}

impl Return<'_> {
    /// What is held once the tissue has slipped as far as it must, from the drag that it had.
    pub fn settle(&self, drag: [f64; 3]) -> Held {
        let stuck = self.attempt(drag, None);
        let within_cone = norm(stuck.along) <= stuck.bound + RETURNED * stuck.pressing;
        let length = norm(drag);
        if within_cone {
            let is_on_cone = self.friction == 0.0;
            let is_cut = length > self.press.longest * CUT;
            let grip = if is_on_cone || is_cut { Grip::Slides } else { Grip::Sticks };
            let Tried { contact, drag, .. } = stuck;
            return Held { contact, drag, grip, length, is_on_cone, kept: 1.0, off: 0.0 };
        }
        let (mut beyond, mut past) = (stuck, None::<Tried>);
        let mut best = stuck;
        for _ in 1..RETURNS {
            let next = match past {
                None => sub(beyond.drag, beyond.slip),
                Some(past) => {
                    let part = beyond.excess / (beyond.excess - past.excess);
                    let part = part.clamp(MARGIN, 1.0 - MARGIN);
                    std::array::from_fn(|i| beyond.drag[i] + part * (past.drag[i] - beyond.drag[i]))
                }
            };
            let tried = self.attempt(next, Some(&beyond));
            if tried.off() < best.off() {
                best = tried;
            }
            if best.has_returned() {
                break;
            }
            if tried.is_past() { past = Some(tried) } else { beyond = tried }
        }
        let kept = (best.bound / norm(stuck.along)).min(1.0);
        let off = if best.has_returned() { 0.0 } else { best.off() };
        let Tried { contact, drag, .. } = best;
        Held { contact, drag, grip: Grip::Slides, length, is_on_cone: true, kept, off }
    }

    fn attempt(&self, drag: [f64; 3], last: Option<&Tried>) -> Tried {
        let Return { model, press, foot, .. } = self;
        let drag = within([0.0; 3], drag, press.longest);
        let contact = model.walk(foot.triangle, sub(foot.point, drag));
        let (force, stiffness) = model.reaction(&contact, press.displacement(drag));
        let pressing = (-dot(force, press.normal)).max(0.0);
        let (along, bound) = (press.along(force), self.friction * pressing);
        let size = norm(along);
        let excess = match last {
            Some(last) => dot(along, last.along) / norm(last.along) - bound,
            None => size - bound,
        };
        let too_much = along.map(|x| x * (1.0 - bound / size));
        let slip = if size > bound { press.slip(&stiffness, too_much) } else { [0.0; 3] };
        Tried { contact, drag, along, bound, pressing, excess, slip }
    }
}
