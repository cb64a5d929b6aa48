//! The coupling of a probe to a device: it goes where spring, damper and tissue are in balance.

use super::felt::Felt;
use super::model::ReducedModel;
use super::press::within;
use super::probe::{BEYOND, Coupling, Probe, Tried, is_finite};
use viscera_mesh::{dot, norm, sub};
use viscera_number::tensor::{inverse, mul_vector};
use viscera_number::unroll::tabulate;

/// Poses that the coupling tries in a tick.
const BALANCES: usize = 5;
/// Where it ends early: a step in units of the radius, but for the first, and what is missing to the balance in units of
/// the force. A strong damper makes each step small, so a probe that left the first one out would never come to rest.
const BALANCED: f64 = 1e-6;
const EVEN: f64 = 1e-4;
/// How far a probe moves at most in a tick when it follows a device, in units of its radius.
const STRIDE: f64 = 0.25;

/// What draws a probe: a spring to a goal, which moves it by no more than a reach from its last place.
struct Pull {
    goal: [f64; 3],
    /// Stiffness [N/m].
    total: f64,
    last: [f64; 3],
    reach: f64,
}

impl Pull {
    /// What is left of the pull beside a force of the tissue.
    fn rest(&self, center: [f64; 3], force: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.total * (self.goal[i] - center[i]) - force[i])
    }

    /// Of what is left, the part that the probe could follow: not that which draws it beyond its reach.
    fn within_reach(&self, center: [f64; 3], rest: [f64; 3]) -> [f64; 3] {
        let out = sub(center, self.last);
        let (size, along) = (norm(out), dot(rest, out));
        if size < self.reach * (1.0 - BALANCED) || along <= 0.0 {
            return rest;
        }
        std::array::from_fn(|i| rest[i] - along * out[i] / (size * size))
    }

    fn moved(&self, center: [f64; 3], step: [f64; 3]) -> [f64; 3] {
        within(self.last, std::array::from_fn(|i| center[i] + step[i]), self.reach)
    }
}

/// The pose of a probe that is nearest to the balance of its coupling with the tissue.
struct Balance {
    tried: Tried,
    /// What the two lack to it [N].
    rest: f64,
    /// Newton's step from here, or what is left of it.
    step: [f64; 3],
}

impl Tried {
    /// Makes the derivative agree with the force at another pose (Broyden, Math. Comput. 19 (1965) 577): it does not know
    /// how the response of the surface differs from place to place.
    fn correct(&mut self, center: [f64; 3], force: [f64; 3]) {
        let (step, change) = (sub(self.felt.center, center), sub(self.felt.force, force));
        let size = dot(step, step);
        if size > 0.0 && self.anchor.is_some() {
            let told = mul_vector(&self.stiffness, &step);
            let k = &self.stiffness;
            self.stiffness = tabulate!(|i, j| k[i][j] + (change[i] - told[i]) * step[j] / size);
        }
    }
}

impl Probe {
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
        let pull = Pull { goal: drawn, total, last, reach: STRIDE * self.radius };
        let Some(Balance { tried, rest, .. }) = self.balance(model, &pull) else {
            return self.lost(model);
        };
        let felt = self.take(model, tried, rest);
        self.state.device = device;
        felt
    }

    /// Newton's method for the place where pull and tissue are in balance, from the last one on; the place where they are
    /// nearest to it. Where what is missing grows twice in succession, half the last step is tried.
    fn balance(&mut self, model: &ReducedModel, pull: &Pull) -> Option<Balance> {
        let mut center = self.balanced.take().unwrap_or(pull.last);
        let (mut best, mut failures) = (None::<Balance>, 0);
        let mut before = None::<([f64; 3], [f64; 3])>;
        for tries in 0..BALANCES {
            let mut tried = self.attempt(model, center)?;
            if let Some((center, force)) = before {
                tried.correct(center, force);
            }
            before = Some((center, tried.felt.force));
            let rest = pull.rest(center, tried.felt.force);
            let step = self.balance_step(model, &tried, rest, pull.total);
            let missing = norm(self.above_ground(model, &tried, pull.within_reach(center, rest)));
            let is_better = best.as_ref().is_none_or(|best| missing < best.rest);
            failures = if is_better { 0 } else { failures + 1 };
            let next = match best.as_mut().filter(|_| failures > 1) {
                Some(best) => {
                    best.step = best.step.map(|x| 0.5 * x);
                    pull.moved(best.tried.felt.center, best.step)
                }
                None => pull.moved(center, step),
            };
            if is_better {
                let is_even = missing <= EVEN * norm(tried.felt.force);
                let is_small = norm(sub(next, center)) <= BALANCED * self.radius;
                best = Some(Balance { tried, rest: missing, step });
                if is_even || (is_small && tries > 0) {
                    break;
                }
            }
            center = next;
        }
        best
    }

    /// Of what is left of a pull, the part that does not press deeper than the model goes.
    fn above_ground(&self, model: &ReducedModel, tried: &Tried, rest: [f64; 3]) -> [f64; 3] {
        let (n, down) = (tried.normal, -dot(rest, tried.normal));
        if -tried.felt.gap < self.deepest(model) * (0.5 + 0.5 * BEYOND) || down <= 0.0 {
            return rest;
        }
        std::array::from_fn(|i| rest[i] + down * n[i])
    }

    /// Newton's step from a pose that was tried.
    fn balance_step(
        &self,
        model: &ReducedModel,
        tried: &Tried,
        rest: [f64; 3],
        total: f64,
    ) -> [f64; 3] {
        let tangent = tabulate!(|i, j| tried.stiffness[i][j] + if i == j { total } else { 0.0 });
        let step = match inverse(&tangent) {
            Some(inverse) => mul_vector(&inverse, &rest),
            None => rest.map(|x| x / total),
        };
        let step = within([0.0; 3], step, 0.5 * self.radius);
        // Not deeper than the model goes, but so far that the force there is not trusted.
        let depth = -tried.felt.gap - dot(step, tried.normal);
        let out = (depth - BEYOND * self.deepest(model)).max(0.0);
        let out = if tried.anchor.is_some() { out } else { 0.0 };
        std::array::from_fn(|i| step[i] + out * tried.normal[i])
    }
}
