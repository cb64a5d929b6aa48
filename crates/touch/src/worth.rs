//! What the force of a probe and its field are worth.

use super::evaluate::{Answer, Trust};
use super::felt::Decisive;
use super::press::CONTACT_ERROR;

/// What a force and its field are worth.
pub(super) struct Worth {
    pub answer: Answer,
    /// Error that is allowed of the answer.
    pub allowed: f64,
    /// Error of the patch in place of the contact.
    pub contact: f64,
    /// Of what others carry along, relative to what has been entered, and of what friction lacks to its cone.
    pub other: f64,
    pub is_beyond: bool,
}

impl Worth {
    /// Estimate and trust of a force that lacks so much to the balance with a coupling, relative to its norm, and by
    /// what it is trusted.
    pub fn of_force(&self, lacks: f64, tolerance: f64) -> (f64, Trust, Decisive) {
        self.of(self.answer.error_estimate, self.answer.trust, lacks, tolerance)
    }

    /// The same of the field.
    pub fn of_shape(&self, lacks: f64, tolerance: f64) -> (f64, Trust, Decisive) {
        self.of(self.answer.shape_error_estimate, self.answer.shape_trust, lacks, tolerance)
    }

    fn of(&self, model: f64, trust: Trust, lacks: f64, tolerance: f64) -> (f64, Trust, Decisive) {
        let other = self.other + lacks;
        let error = (model + self.contact + other).min(1.0);
        let of_model = Decisive { estimate: model, allowed: self.allowed, has_contact: false };
        let estimate = (model + CONTACT_ERROR + other).min(1.0);
        let decisive = Decisive { estimate, allowed: tolerance, has_contact: true };
        match trust {
            _ if self.is_beyond => (error, Trust::BeyondDepth, decisive),
            Trust::Trusted if estimate <= tolerance => (error, trust, decisive),
            Trust::Trusted => (error, Trust::ErrorTooLarge, decisive),
            trust => (error, trust, of_model),
        }
    }
}
