//! The coupling of a probe to a device: it goes where spring, damper and tissue are in balance.

use super::felt::{Felt, Grip};
use super::model::ReducedModel;
use super::press::{Press, within};
use super::probe::{Anchor, BEYOND, Coupling, Probe, Tried, is_finite};
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
/// Halvings of a range of depths.
const HALVINGS: usize = 20;
/// As stiff as a damper counts [N/m]: rigid beside any tissue, and not so stiff that rounding hides the force of the tissue.
const RIGID: f64 = 1e10;

impl Coupling {
    /// Stiffness of the damper over a step of `dt >= 0` [N/m]; over one of no duration it is rigid.
    fn rate(&self, dt: f64) -> f64 {
        if self.damping > 0.0 { (self.damping / dt.abs()).min(RIGID) } else { 0.0 }
    }
}

/// Whether a number is the duration of a step [s].
pub(super) fn is_duration(dt: f64) -> bool {
    dt >= 0.0 && dt.is_finite()
}

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
    /// tissue are in balance, by at most a quarter of its radius. The force is that of the tissue. In a step of no duration
    /// the damper takes the probe along with the device; without a damper the duration does not matter. The first step
    /// begins where the probe would have touched first, and goes to the balance of spring and tissue alone.
    ///
    /// None, with the probe as it was, unless `dt` is at least 0 and finite.
    pub fn follow(&mut self, model: &ReducedModel, device: [f64; 3], dt: f64) -> Option<Felt> {
        is_duration(dt).then(|| self.drawn(model, device, dt))
    }

    /// The same for a `dt` that is a duration.
    pub(super) fn drawn(&mut self, model: &ReducedModel, device: [f64; 3], dt: f64) -> Felt {
        if !is_finite(device) {
            return self.lost(model);
        }
        let Some(coupling) = self.coupling else {
            return self.place(model, device);
        };
        let Some(last) = self.state.center else {
            return self.drawn_first(model, device, coupling.stiffness);
        };
        let rate = coupling.rate(dt);
        let total = coupling.stiffness + rate;
        // The spring draws to the device, the damper along with its motion.
        let moved = |i: usize| rate / total * (last[i] - self.state.device[i]);
        let goal = std::array::from_fn(|i| device[i] + moved(i));
        if !is_finite(goal) {
            return self.lost(model);
        }
        let pull = Pull { goal, total, last, reach: STRIDE * self.radius };
        self.go(model, device, &pull)
    }

    /// The first step, in which only the spring draws. What has not touched before has dragged nothing: friction begins with
    /// the next step, from the place where there is no force along the surface.
    fn drawn_first(&mut self, model: &ReducedModel, device: [f64; 3], stiffness: f64) -> Felt {
        let Some(last) = self.touch_first(model, device, stiffness) else {
            return self.place(model, device);
        };
        let reach = norm(sub(device, last));
        let pull = Pull { goal: device, total: stiffness, last, reach };
        let friction = std::mem::take(&mut self.friction);
        let felt = self.go(model, device, &pull);
        self.friction = friction;
        match felt.grip {
            // A probe whose device is in the organ touches it.
            Grip::Free => self.doubt(felt, 1.0),
            _ => felt,
        }
    }

    /// Goes to the balance of a pull with the tissue.
    fn go(&mut self, model: &ReducedModel, device: [f64; 3], pull: &Pull) -> Felt {
        let Some(Balance { tried, rest, .. }) = self.balance(model, pull) else {
            return self.lost(model);
        };
        let felt = self.take(model, tried, rest);
        self.state.device = device;
        felt
    }

    /// Begins a touch with a device that is in the organ already: the nearest place of the probe outside, from where on it
    /// holds the point that it touches there. None where it would not touch.
    fn touch_first(
        &mut self,
        model: &ReducedModel,
        device: [f64; 3],
        stiffness: f64,
    ) -> Option<[f64; 3]> {
        let tried = self.attempt(model, device)?;
        let Anchor { triangle, .. } = tried.anchor?;
        let outside = std::array::from_fn(|i| device[i] - tried.felt.gap * tried.normal[i]);
        let foot = model.walk(triangle, sub(outside, self.carried));
        self.state.anchor = Some(Anchor { point: foot.point, triangle: foot.triangle });
        let out = -tried.felt.gap - self.depth_of_balance(model, &tried, stiffness);
        let begin = std::array::from_fn(|i| device[i] + out * tried.normal[i]);
        self.balanced.get_or_insert(begin);
        Some(outside)
    }

    /// How far the probe enters until a spring to a pose that was tried bears the tissue, if that presses in proportion to the
    /// depth of the patch: where Newton's method begins, which from the deep would need more poses.
    fn depth_of_balance(&self, model: &ReducedModel, tried: &Tried, stiffness: f64) -> f64 {
        let deepest = self.deepest(model);
        let patch =
            |entered: f64| Press::new(model, self.radius, entered.min(deepest), tried.normal).depth;
        let whole = -tried.felt.gap;
        let per = -dot(tried.felt.force, tried.normal) / patch(whole);
        let (mut low, mut high) = (0.0, whole);
        for _ in 0..HALVINGS {
            let entered = 0.5 * (low + high);
            match stiffness * (whole - entered) > per * patch(entered) {
                true => low = entered,
                false => high = entered,
            }
        }
        0.5 * (low + high)
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
