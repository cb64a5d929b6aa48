//! Coulomb friction as return mapping (Simo and Laursen 1992): a spring from the point of the tool that a sample stuck to,
//! as stiff along the surface as the layer is across it, whose force never exceeds the friction coefficient times the
//! pressure; what would be more slides. A step holds the bound at the pressure found last, so that the energy of the
//! spring, of Huber's form, is convex and its derivative the force. What sticks does not creep.

use crate::error::Error;

/// The friction law between a tool and a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction {
    /// Coulomb's coefficient; zero for none.
    Coulomb(f64),
    /// Tissue that has touched the tool sticks to it, also under tension.
    Bonded,
}

impl Friction {
    /// Whether there is no friction.
    pub fn is_none(self) -> bool {
        self == Friction::Coulomb(0.0)
    }

    /// Largest traction along the surface under a pressure.
    pub(super) fn bound(self, pressure: f64) -> f64 {
        match self {
            Friction::Coulomb(coefficient) => coefficient * pressure,
            Friction::Bonded => f64::INFINITY,
        }
    }

    pub(super) fn check(self, number: usize) -> Result<(), Error> {
        match self {
            Friction::Coulomb(mu) if !(mu >= 0.0 && mu.is_finite()) => Err(Error::input(format!(
                "the friction coefficient of tool {number} is {mu}; it must be finite and not negative"
            ))),
            _ => Ok(()),
        }
    }
}

/// Energy, force and force over stretch of a spring of stiffness `k` that yields at a bound: `k s^2 / 2`, `k s`, `k`
/// before it, `bound s - bound^2 / (2 k)`, `bound`, `bound / s` after it.
pub(super) fn spring(stretch: f64, stiffness: f64, bound: f64) -> [f64; 3] {
    if stiffness * stretch <= bound {
        [0.5 * stiffness * stretch * stretch, stiffness * stretch, stiffness]
    } else {
        [bound * stretch - 0.5 * bound * bound / stiffness, bound, bound / stretch]
    }
}
