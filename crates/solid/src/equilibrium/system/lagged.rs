//! The Cholesky factor of an earlier tangent as a preconditioner: from one frame to the next the tangent changes so
//! little that a few iterations make up for it, and for single precision, too. Where frames ask for it, the next factor is
//! made while they go on with the last: by a second thread if there is one, else a part with every tangent.

use super::factor::TangentFactor;
use crate::body::BlockPattern;
use crate::linear::FactorError;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// Multiplications of a part of a factor: a third of the time of a frame that is just fast enough for 60 Hz.
const PART: f64 = 4e7;

/// A factor in single precision, or in double where the body asks for it: a tangent whose softest motion is beyond the
/// seven digits of the one has a factor in the other.
struct LaggedFactor {
    shape: Arc<Shape>,
    is_held: Vec<bool>,
    single: TangentFactor<f32>,
    /// Made when first needed, and kept.
    double: Option<Box<TangentFactor<f64>>>,
    /// The last factor is the one in double precision.
    is_double: bool,
    /// The next is to be.
    wants_double: bool,
}

/// What factors are made for.
struct Shape {
    blocks: BlockPattern,
    free: Vec<u32>,
}

impl LaggedFactor {
    fn new(shape: &Arc<Shape>, n_dofs: usize) -> Result<Self, FactorError> {
        Ok(LaggedFactor {
            single: TangentFactor::new(&shape.blocks, &shape.free)?,
            double: None,
            is_double: false,
            wants_double: false,
            is_held: vec![false; n_dofs],
            shape: shape.clone(),
        })
    }

    /// What is held decides on the condition as well: single precision may do again.
    fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.single.hold(is_held);
        if let Some(double) = &mut self.double {
            double.hold(is_held);
        }
        self.wants_double = false;
    }

    /// # Errors
    /// Those of double precision: what single precision does not tell from an indefinite tangent may well be definite.
    fn factorize(&mut self, values: &[f64], shift: f64) -> Result<(), FactorError> {
        if !self.wants_double && self.single.factorize(values, shift).is_ok() {
            self.is_double = false;
            return Ok(());
        }
        self.factorize_double(values, shift)
    }

    /// The first or the next part of [`factorize`](Self::factorize); returns whether it was the last.
    fn factorize_part(
        &mut self,
        goal: &Goal,
        is_first: bool,
        work: f64,
    ) -> Result<bool, FactorError> {
        let single = &mut self.single;
        let begun = if is_first { single.begin(&goal.values, goal.shift) } else { Ok(()) };
        if !self.wants_double
            && let Ok(is_last) = begun.and_then(|()| single.factorize_part(work))
        {
            self.is_double = false;
            return Ok(is_last);
        }
        self.factorize_double(&goal.values, goal.shift).map(|()| true)
    }

    fn factorize_double(&mut self, values: &[f64], shift: f64) -> Result<(), FactorError> {
        let double = match &mut self.double {
            Some(double) => double,
            none => {
                let mut double = TangentFactor::new(&self.shape.blocks, &self.shape.free)?;
                double.hold(&self.is_held);
                none.insert(Box::new(double))
            }
        };
        double.factorize(values, shift)?;
        (self.is_double, self.wants_double) = (true, true);
        Ok(())
    }

    fn solve(&mut self, b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        match &mut self.double {
            Some(double) if self.is_double => double.solve(b, x),
            _ => self.single.solve(b, x),
        }
    }
}

/// A factor in use and, where one is to be renewed beside it, a spare.
pub(super) struct Lagged {
    current: Box<LaggedFactor>,
    is_usable: bool,
    is_held: Vec<bool>,
    spare: Option<Spare>,
}

/// The second factor.
struct Spare {
    place: Place,
    maker: Maker,
    /// What is held has changed since the factor went out: it comes home useless.
    is_outdated: bool,
    /// A new factor is asked for.
    is_wanted: bool,
}

/// Where the second factor is.
enum Place {
    /// Nobody needed it yet: it takes as much analysis and memory as the first.
    Unmade,
    Home(Box<LaggedFactor>),
    /// With the maker.
    Out,
}

/// Who makes the next factor.
enum Maker {
    Beside(Worker),
    Here(InParts),
}

/// A factor to renew, or to make.
struct Order {
    factor: Option<Box<LaggedFactor>>,
    shape: Arc<Shape>,
    is_held: Vec<bool>,
    wants_double: bool,
    goal: Goal,
}

/// What to factorise: the values of a tangent, and a shift.
struct Goal {
    values: Vec<f64>,
    shift: f64,
}

/// The factor come back, and whether it is of use; an error alone where none could be made.
type Done = Result<(Box<LaggedFactor>, Result<(), FactorError>), FactorError>;

/// A thread that factorises what it is sent, and ends when nothing more can come.
struct Worker {
    orders: Option<Sender<Order>>,
    /// Behind a lock only so that a stepper may be shared between threads; it is never contended.
    done: Mutex<Receiver<Done>>,
    thread: Option<JoinHandle<()>>,
}

impl Lagged {
    pub fn new(blocks: &BlockPattern, free: &[u32], n_dofs: usize) -> Result<Self, FactorError> {
        let shape = Arc::new(Shape { blocks: blocks.clone(), free: free.to_vec() });
        Ok(Lagged {
            current: Box::new(LaggedFactor::new(&shape, n_dofs)?),
            is_usable: false,
            is_held: vec![false; n_dofs],
            spare: None,
        })
    }

    /// Renews the factor while the last one stays in use from now on: on a second thread if there is one, else in parts,
    /// unless the whole factor hardly takes longer than a part.
    pub fn renew_beside(&mut self) {
        if self.spare.is_some() {
            return;
        }
        if rayon::current_num_threads() > 1 {
            self.spare = Some(Spare::new(Place::Unmade, Maker::Beside(Worker::start())));
        } else if self.current.single.work().is_some_and(|work| work > 1.5 * PART) {
            self.renew_in_parts(PART);
        }
    }

    /// The second factor is made at once, since its analysis would be a long frame. If there is no memory for it,
    /// renewals go on in one piece.
    fn renew_in_parts(&mut self, work: f64) {
        if let Ok(factor) = LaggedFactor::new(&self.current.shape, self.is_held.len()) {
            let maker = Maker::Here(InParts { work, order: None });
            self.spare = Some(Spare::new(Place::Home(Box::new(factor)), maker));
        }
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.current.hold(is_held);
        if let Some(spare) = &mut self.spare {
            match &mut spare.place {
                Place::Unmade => {}
                Place::Home(factor) => factor.hold(is_held),
                Place::Out => spare.recall(is_held),
            }
        }
    }

    /// Takes a finished factor into use, and orders a new one if `is_stale`. Returns whether the factor in use changed.
    pub fn renew(
        &mut self,
        values: &[f64],
        shift: f64,
        is_stale: bool,
    ) -> Result<bool, FactorError> {
        let mut is_renewed = false;
        if let Some(spare) = &mut self.spare {
            is_renewed = spare.collect(&mut self.current, &self.is_held);
            if self.is_usable {
                spare.is_wanted |= is_stale && !spare.maker.is_under_way();
                spare.order(&self.current, values, shift);
                return Ok(is_renewed);
            }
        }
        if is_stale || !self.is_usable {
            self.is_usable = false;
            self.current.factorize(values, shift)?;
            (self.is_usable, is_renewed) = (true, true);
        }
        Ok(is_renewed)
    }

    /// After a fresh factor took too many iterations, the next one is in double precision.
    pub fn distrust(&mut self) {
        self.is_usable &= self.current.wants_double;
        self.current.wants_double = true;
    }

    /// `z = M⁻¹ r`; zero on what is held, also while the factor still stems from another grasp.
    pub fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.fill(0.0);
        if self.current.solve(r, z).is_err() {
            z.copy_from_slice(r);
        }
        for (z, &held) in z.iter_mut().zip(&self.is_held) {
            *z = if held { 0.0 } else { *z };
        }
    }
}

impl Spare {
    fn new(place: Place, maker: Maker) -> Self {
        Spare { place, maker, is_outdated: false, is_wanted: false }
    }

    /// What is held has changed while the factor is out.
    fn recall(&mut self, is_held: &[bool]) {
        match &mut self.maker {
            Maker::Beside(_) => self.is_outdated = true,
            Maker::Here(parts) => {
                let factor = parts.order.take().map(|unfinished| unfinished.factor);
                self.place = factor.map_or(Place::Unmade, |mut factor| {
                    factor.hold(is_held);
                    Place::Home(factor)
                });
                self.is_wanted = true;
            }
        }
    }

    /// Exchanges the factors if the next one is finished.
    fn collect(&mut self, current: &mut Box<LaggedFactor>, is_held: &[bool]) -> bool {
        let Some(done) = self.maker.collect() else { return false };
        let Ok((mut factor, outcome)) = done else {
            self.place = Place::Unmade;
            return false;
        };
        let is_outdated = std::mem::take(&mut self.is_outdated);
        let is_good = outcome.is_ok() && !is_outdated;
        if is_good {
            std::mem::swap(&mut factor, current);
        }
        factor.hold(is_held);
        self.is_wanted |= is_outdated;
        self.place = Place::Home(factor);
        is_good
    }

    /// Sends the spare factor out, or has it made, if one is wanted and it is not out already.
    fn order(&mut self, current: &LaggedFactor, values: &[f64], shift: f64) {
        if !self.is_wanted || matches!(self.place, Place::Out) {
            return;
        }
        let factor = match std::mem::replace(&mut self.place, Place::Out) {
            Place::Home(factor) => Some(factor),
            Place::Unmade | Place::Out => None,
        };
        self.maker.order(Order {
            factor,
            shape: current.shape.clone(),
            is_held: current.is_held.clone(),
            wants_double: current.wants_double,
            goal: Goal { values: values.to_vec(), shift },
        });
        self.is_wanted = false;
    }
}

impl Maker {
    fn order(&mut self, order: Order) {
        match self {
            Maker::Beside(worker) => {
                // A worker that is gone leaves the factor in use as it is.
                let _ = worker.orders.as_ref().map(|orders| orders.send(order));
            }
            Maker::Here(parts) => {
                let Order { factor, wants_double, goal, .. } = order;
                parts.order = factor.map(|mut factor| {
                    factor.wants_double |= wants_double;
                    Unfinished { factor, goal, is_begun: false }
                });
            }
        }
    }

    /// The factor that was ordered, if it is finished. This thread makes the next part.
    fn collect(&mut self) -> Option<Done> {
        match self {
            Maker::Beside(worker) => worker.done.get_mut().ok()?.try_recv().ok(),
            Maker::Here(parts) => parts.go_on(),
        }
    }

    /// Whether this thread is making a factor. That the last one is stale is no reason then for one more.
    fn is_under_way(&self) -> bool {
        matches!(self, Maker::Here(InParts { order: Some(_), .. }))
    }
}

/// A factor that this thread makes in parts.
struct InParts {
    /// Multiplications of a part.
    work: f64,
    order: Option<Unfinished>,
}

struct Unfinished {
    factor: Box<LaggedFactor>,
    goal: Goal,
    is_begun: bool,
}

impl InParts {
    fn go_on(&mut self) -> Option<Done> {
        let Unfinished { factor, goal, is_begun } = self.order.as_mut()?;
        let is_first = !std::mem::replace(is_begun, true);
        match factor.factorize_part(goal, is_first, self.work) {
            Ok(false) => None,
            outcome => self.order.take().map(|order| Ok((order.factor, outcome.map(|_| ())))),
        }
    }
}

impl Order {
    fn carry_out(self) -> Done {
        let mut factor = match self.factor {
            Some(factor) => factor,
            None => {
                let mut made = LaggedFactor::new(&self.shape, self.is_held.len())?;
                made.hold(&self.is_held);
                Box::new(made)
            }
        };
        factor.wants_double |= self.wants_double;
        let outcome = factor.factorize(&self.goal.values, self.goal.shift);
        Ok((factor, outcome))
    }
}

impl Worker {
    fn start() -> Self {
        let (orders, incoming) = channel::<Order>();
        let (outgoing, done) = channel();
        let thread = std::thread::spawn(move || {
            for order in incoming {
                if outgoing.send(order.carry_out()).is_err() {
                    break;
                }
            }
        });
        Worker { orders: Some(orders), done: Mutex::new(done), thread: Some(thread) }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};

    /// A factor and its solutions are those of the last tangent until all parts of the next are made; what is held
    /// meanwhile sends it back to its beginning.
    #[test]
    fn a_factor_made_in_parts_comes_into_use_whole() {
        let (points, cells) = block([5, 3, 2], [0.5, 0.3, 0.2]);
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::new(points, cells, material).unwrap();
        let n = body.n_dofs();
        let is_fixed = |dof: u32| body.points()[dof as usize / 3][0] == 0.0;
        let free: Vec<u32> = (0..n as u32).filter(|&dof| !is_fixed(dof)).collect();
        let tangent = |seed: u64| {
            let u: Vec<f64> = noise(n, seed).iter().map(|u| 0.001 * u).collect();
            let mut tangent = body.zero_tangent();
            body.internal_force_and_tangent(&u, &mut vec![0.0; n], &mut tangent);
            tangent.values().to_vec()
        };
        let (first, second) = (tangent(1), tangent(2));
        let mut load = noise(n, 3);
        (0..n as u32).filter(|&dof| is_fixed(dof)).for_each(|dof| load[dof as usize] = 0.0);
        let solved = |lagged: &mut Lagged| {
            let mut x = vec![0.0; n];
            lagged.apply(&load, &mut x);
            x
        };
        let whole = |values: &[f64], held: &[bool]| {
            let mut lagged = Lagged::new(body.pattern(), &free, n).unwrap();
            lagged.hold(held);
            lagged.renew(values, 0.0, true).unwrap();
            solved(&mut lagged)
        };
        let (none, mut some) = (vec![false; n], vec![false; n]);
        some[30..33].fill(true);
        let (before, after) = (whole(&first, &none), whole(&second, &none));

        let mut lagged = Lagged::new(body.pattern(), &free, n).unwrap();
        lagged.renew_in_parts(0.3 * lagged.current.single.work().unwrap());
        assert!(lagged.renew(&first, 0.0, true).unwrap(), "the first one is made at once");
        let mut tangents = 0;
        while !lagged.renew(&second, 0.0, tangents == 0).unwrap() {
            assert_eq!(solved(&mut lagged), before);
            tangents += 1;
        }
        assert!((2..=5).contains(&tangents), "{tangents}");
        assert_eq!(solved(&mut lagged), after);

        assert!(!lagged.renew(&first, 0.0, true).unwrap());
        assert!(!lagged.renew(&first, 0.0, false).unwrap());
        lagged.hold(&some);
        let again = (0..6).position(|_| lagged.renew(&first, 0.0, false).unwrap());
        assert!(again.is_some_and(|count| count >= 2), "{again:?}");
        assert_eq!(solved(&mut lagged), whole(&first, &some));
    }
}
