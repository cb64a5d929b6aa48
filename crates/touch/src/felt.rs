//! What a probe feels.

use super::contact::Contact;
use super::evaluate::Trust;

/// What a probe does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// It is free of the organ.
    Free,
    /// It holds the point that it touches.
    Sticks,
    /// It slides along the surface.
    Slides,
    /// It has come into the organ in one step. There is no force until it has been lifted off.
    Inside,
    /// The pose is not a usable number. The probe stays where it was.
    Lost,
}

/// What a sphere touches beside the place that a model answers for. With it, neither force nor field is trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// Nothing.
    Nothing,
    /// Where the organ is fixed.
    Support,
    /// The organ at a second place.
    SecondPlace,
    /// The organ beside its touchable surface.
    Untouchable,
}

/// The estimated error by which what a probe feels is trusted or not, and the largest that is trusted; relative to the norm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decisive {
    /// Estimated error.
    pub estimate: f64,
    /// The largest that is trusted.
    pub allowed: f64,
    /// Whether it includes the error of a contact, [`crate::CONTACT_ERROR`]; else it is the model's own.
    pub has_contact: bool,
}

impl Decisive {
    /// Of a probe whose estimate decides nothing.
    const NONE: Self = Decisive { estimate: 0.0, allowed: 0.0, has_contact: false };
}

/// What a probe feels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// What the probe does.
    pub grip: Grip,
    /// Centre of the sphere [m].
    pub center: [f64; 3],
    /// The point of the surface that is held; the closest if the probe is free.
    pub contact: Contact,
    /// Displacement of the patch there [m].
    pub displacement: [f64; 3],
    /// Distance of the sphere from the surface before the touch; negative by how far it has entered [m].
    pub gap: f64,
    /// Force of the probe on the organ [N].
    pub force: [f64; 3],
    /// Torque on the organ about the centre of the sphere [N m].
    pub torque: [f64; 3],
    /// Estimated error of the force, relative to its norm; at most 1: of the model, and of the patch for the contact.
    pub error_estimate: f64,
    /// Whether the force is trusted.
    pub trust: Trust,
    /// By what the force is trusted, where nothing else decides.
    pub decisive: Decisive,
    /// The same of the field.
    pub shape_error_estimate: f64,
    /// Whether the field is trusted.
    pub shape_trust: Trust,
    /// By what the field is trusted, where nothing else decides.
    pub shape_decisive: Decisive,
    /// What else the sphere touches.
    pub beside: Beside,
}

impl Felt {
    /// The same where the sphere touches something else as well.
    pub(super) fn with(self, beside: Beside) -> Self {
        if beside == Beside::Nothing {
            return self;
        }
        let (error, trust) = (1.0, Trust::ErrorTooLarge);
        Felt {
            error_estimate: error,
            trust,
            shape_error_estimate: error,
            shape_trust: trust,
            beside,
            ..self
        }
    }

    /// A probe without force.
    pub(super) fn untouched(grip: Grip, center: [f64; 3], contact: Contact, gap: f64) -> Felt {
        let is_free = grip == Grip::Free;
        let (error, trust) =
            if is_free { (0.0, Trust::Trusted) } else { (1.0, Trust::ErrorTooLarge) };
        Felt {
            grip,
            center,
            contact,
            displacement: [0.0; 3],
            gap,
            force: [0.0; 3],
            torque: [0.0; 3],
            error_estimate: error,
            trust,
            decisive: Decisive::NONE,
            shape_error_estimate: error,
            shape_trust: trust,
            shape_decisive: Decisive::NONE,
            beside: Beside::Nothing,
        }
    }
}
