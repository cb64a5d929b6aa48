//! A second factor that is renewed while the first one is in use: by a thread of its own, or here, in parts.

use super::{FactorPattern, Goal, LaggedFactor};
use crate::linear::FactorError;
use crate::threads::work_alone;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// The second factor.
pub(super) struct Spare {
    factor: SecondFactor,
    maker: Maker,
    /// What is held has changed since the factor went out: it comes home useless.
    is_outdated: bool,
    /// A new factor is asked for.
    is_wanted: bool,
}

/// Where the second factor is.
enum SecondFactor {
    /// Nobody needed it yet: it takes as much analysis and memory as the first.
    Unmade,
    Idle(Box<LaggedFactor>),
    /// With its maker.
    Out,
}

/// Who makes the next factor.
enum Maker {
    Thread(Worker),
    Here(InParts),
}

/// A factor to renew, or to make.
struct Order {
    factor: Option<Box<LaggedFactor>>,
    pattern: Arc<FactorPattern>,
    is_held: Vec<bool>,
    wants_double: bool,
    goal: Goal<Vec<f64>>,
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

/// A factor that this thread makes, a part at a time.
struct InParts {
    /// Multiplications of a part.
    work: f64,
    unfinished: Option<Unfinished>,
}

struct Unfinished {
    factor: Box<LaggedFactor>,
    goal: Goal<Vec<f64>>,
    is_begun: bool,
}

impl Spare {
    /// One that another thread makes.
    pub fn beside() -> Self {
        Self::new(SecondFactor::Unmade, Maker::Thread(Worker::start()))
    }

    /// One that this thread makes, in parts of so many multiplications.
    pub fn in_parts(factor: Box<LaggedFactor>, work: f64) -> Self {
        Self::new(SecondFactor::Idle(factor), Maker::Here(InParts { work, unfinished: None }))
    }

    fn new(factor: SecondFactor, maker: Maker) -> Self {
        Spare { factor, maker, is_outdated: false, is_wanted: false }
    }

    /// Whether another thread makes it.
    pub fn has_thread(&self) -> bool {
        matches!(self.maker, Maker::Thread(_))
    }

    /// What is held has changed.
    pub fn hold(&mut self, is_held: &[bool]) {
        match (&mut self.factor, &mut self.maker) {
            (SecondFactor::Unmade, _) => {}
            (SecondFactor::Idle(factor), _) => factor.hold(is_held),
            (SecondFactor::Out, Maker::Thread(_)) => self.is_outdated = true,
            (SecondFactor::Out, Maker::Here(_)) => {
                self.stop();
                if let SecondFactor::Idle(factor) = &mut self.factor {
                    factor.hold(is_held);
                }
                self.is_wanted = true;
            }
        }
    }

    /// What is made here is not finished: the factor in use has become newer than that.
    pub fn stop(&mut self) {
        if let Maker::Here(parts) = &mut self.maker
            && let Some(Unfinished { factor, .. }) = parts.unfinished.take()
        {
            self.factor = SecondFactor::Idle(factor);
        }
    }

    /// Exchanges the factors if the next one is finished.
    pub fn collect(&mut self, current: &mut Box<LaggedFactor>, is_held: &[bool]) -> bool {
        let Some(done) = self.maker.collect() else { return false };
        let Ok((mut factor, outcome)) = done else {
            self.factor = SecondFactor::Unmade;
            return false;
        };
        let is_outdated = std::mem::take(&mut self.is_outdated);
        let is_good = outcome.is_ok() && !is_outdated;
        if is_good {
            std::mem::swap(&mut factor, current);
        }
        factor.hold(is_held);
        self.is_wanted |= is_outdated;
        self.factor = SecondFactor::Idle(factor);
        is_good
    }

    /// Sends the spare factor out, or has it made, if one is wanted and it is not out already.
    pub fn order(&mut self, current: &LaggedFactor, goal: Goal<&[f64]>, is_stale: bool) {
        let is_out = matches!(self.factor, SecondFactor::Out);
        // A factor that is made here is seldom far behind: that the last one is stale asks for no third.
        self.is_wanted |= is_stale && (!is_out || self.has_thread());
        if !self.is_wanted || is_out {
            return;
        }
        let factor = match std::mem::replace(&mut self.factor, SecondFactor::Out) {
            SecondFactor::Idle(factor) => Some(factor),
            SecondFactor::Unmade | SecondFactor::Out => None,
        };
        self.is_wanted = false;
        self.maker.take(Order {
            factor,
            pattern: current.pattern.clone(),
            is_held: current.is_held.clone(),
            wants_double: current.wants_double,
            goal: Goal { values: goal.values.to_vec(), shift: goal.shift },
        });
    }
}

impl Maker {
    fn take(&mut self, order: Order) {
        match self {
            // A worker that is gone leaves the factor in use as it is.
            Maker::Thread(worker) => {
                let _ = worker.orders.as_ref().map(|orders| orders.send(order));
            }
            Maker::Here(parts) => {
                let Order { factor, wants_double, goal, .. } = order;
                parts.unfinished = factor.map(|mut factor| {
                    factor.wants_double |= wants_double;
                    Unfinished { factor, goal, is_begun: false }
                });
            }
        }
    }

    /// The factor that was ordered, if it is finished; what is made here goes on by a part.
    fn collect(&mut self) -> Option<Done> {
        match self {
            Maker::Thread(worker) => worker.done.get_mut().ok()?.try_recv().ok(),
            Maker::Here(parts) => parts.go_on(),
        }
    }
}

impl InParts {
    fn go_on(&mut self) -> Option<Done> {
        let Unfinished { factor, goal, is_begun } = self.unfinished.as_mut()?;
        let is_first = !std::mem::replace(is_begun, true);
        let goal = Goal { values: goal.values.as_slice(), shift: goal.shift };
        match factor.factorize_part(goal, is_first, self.work) {
            Ok(false) => None,
            outcome => {
                let Unfinished { factor, .. } = self.unfinished.take()?;
                Some(Ok((factor, outcome.map(|_| ()))))
            }
        }
    }
}

impl Order {
    fn carry_out(self) -> Done {
        let mut factor = match self.factor {
            Some(factor) => factor,
            None => {
                let mut made = LaggedFactor::new(&self.pattern, self.is_held.len())?;
                made.hold(&self.is_held);
                Box::new(made)
            }
        };
        factor.wants_double |= self.wants_double;
        let Goal { values, shift } = &self.goal;
        let outcome = factor.factorize(Goal { values: values.as_slice(), shift: *shift });
        Ok((factor, outcome))
    }
}

impl Worker {
    fn start() -> Self {
        let (orders, incoming) = channel::<Order>();
        let (outgoing, done) = channel();
        let thread = std::thread::spawn(move || {
            work_alone();
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
