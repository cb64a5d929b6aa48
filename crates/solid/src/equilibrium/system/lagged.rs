//! The Cholesky factor of an earlier tangent as a preconditioner: from one frame to the next the tangent changes so
//! little that a few iterations make up for it, and for single precision, too. Where frames ask for it and there is a
//! second thread, that makes the next factor while frames go on with the last.

use super::factor::TangentFactor;
use super::local_correction::{Block, Constrained, LocalCorrection};
use crate::body::BlockPattern;
use crate::linear::FactorError;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// A factor in single precision, or in double where the body asks for it: a tangent whose softest motion is beyond the
/// seven digits of the one has a factor in the other.
struct LaggedFactor {
    pattern: Arc<FactorPattern>,
    is_held: Vec<bool>,
    single: TangentFactor<f32>,
    /// Made when first needed, and kept.
    double: Option<Box<TangentFactor<f64>>>,
    /// The last factor is the one in double precision.
    is_double: bool,
    /// The next is to be.
    wants_double: bool,
    /// Each node's own block of the tangent that the last factor was made from.
    diagonal: Vec<Block>,
}

/// What factors are made for.
struct FactorPattern {
    blocks: BlockPattern,
    free: Vec<u32>,
}

impl LaggedFactor {
    fn new(pattern: &Arc<FactorPattern>, n_dofs: usize) -> Result<Self, FactorError> {
        Ok(LaggedFactor {
            single: TangentFactor::new(&pattern.blocks, &pattern.free)?,
            double: None,
            is_double: false,
            wants_double: false,
            is_held: vec![false; n_dofs],
            diagonal: Vec::new(),
            pattern: pattern.clone(),
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
        let LaggedFactor { pattern, is_held, diagonal, .. } = self;
        let given = Constrained { pattern: &pattern.blocks, values, shift, is_held };
        diagonal.clear();
        diagonal.extend(given.diagonal());
        if !self.wants_double && self.single.factorize(values, shift).is_ok() {
            self.is_double = false;
            return Ok(());
        }
        let double = match &mut self.double {
            Some(double) => double,
            none => {
                let mut double = TangentFactor::new(&self.pattern.blocks, &self.pattern.free)?;
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
    /// What has changed much since the factor in use was made.
    correction: LocalCorrection,
}

/// The second factor.
struct Spare {
    factor: SecondFactor,
    worker: Worker,
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
    /// With the worker.
    WithWorker,
}

/// A factor to renew, or to make, with the values of the tangent and the shift.
struct Order {
    factor: Option<Box<LaggedFactor>>,
    pattern: Arc<FactorPattern>,
    is_held: Vec<bool>,
    wants_double: bool,
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
        let pattern = Arc::new(FactorPattern { blocks: blocks.clone(), free: free.to_vec() });
        Ok(Lagged {
            current: Box::new(LaggedFactor::new(&pattern, n_dofs)?),
            is_usable: false,
            is_held: vec![false; n_dofs],
            spare: None,
            correction: LocalCorrection::default(),
        })
    }

    /// Renews the factor on a second thread from now on, if there is one, while the last one stays in use.
    pub fn renew_beside(&mut self) {
        if rayon::current_num_threads() > 1 {
            self.spare.get_or_insert_with(Spare::new);
        }
    }

    /// Whether nothing waits for a renewal.
    pub fn is_renewed_beside(&self) -> bool {
        self.spare.is_some()
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.current.hold(is_held);
        if let Some(spare) = &mut self.spare {
            match &mut spare.factor {
                SecondFactor::Unmade => {}
                SecondFactor::Idle(factor) => factor.hold(is_held),
                SecondFactor::WithWorker => spare.is_outdated = true,
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
            if is_renewed {
                self.correction.clear();
            }
            if self.is_usable {
                spare.is_wanted |= is_stale;
                spare.order(&self.current, values, shift);
                return Ok(is_renewed);
            }
        }
        if is_stale || !self.is_usable {
            self.is_usable = false;
            self.correction.clear();
            self.current.factorize(values, shift)?;
            (self.is_usable, is_renewed) = (true, true);
        }
        Ok(is_renewed)
    }

    /// Inverts anew what this tangent has changed much since the factor was made; whether that changes the inverse.
    pub fn correct(&mut self, values: &[f64], shift: f64) -> bool {
        let Lagged { current, is_held, correction, .. } = self;
        let given = Constrained { pattern: &current.pattern.blocks, values, shift, is_held };
        correction.update(given, &current.diagonal)
    }

    /// Leaves the factor as it was made; whether that changes the inverse.
    pub fn forget_corrections(&mut self) -> bool {
        self.correction.clear()
    }

    /// After a fresh factor took too many iterations, the next one is in double precision.
    pub fn distrust(&mut self) {
        self.is_usable &= self.current.wants_double;
        self.current.wants_double = true;
    }

    /// `z = M⁻¹ r`; zero on what is held, also while the factor still stems from another grasp.
    pub fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let Lagged { current, is_held, correction, .. } = self;
        correction.apply(r, z, |r, z| {
            z.fill(0.0);
            if current.solve(r, z).is_err() {
                z.copy_from_slice(r);
            }
            for (z, &held) in z.iter_mut().zip(&*is_held) {
                *z = if held { 0.0 } else { *z };
            }
        });
    }
}

impl Spare {
    fn new() -> Self {
        Spare {
            factor: SecondFactor::Unmade,
            worker: Worker::start(),
            is_outdated: false,
            is_wanted: false,
        }
    }

    /// Exchanges the factors if the worker has finished.
    fn collect(&mut self, current: &mut Box<LaggedFactor>, is_held: &[bool]) -> bool {
        let Ok(done) = self.worker.done.get_mut() else {
            return false;
        };
        let Ok(done) = done.try_recv() else {
            return false;
        };
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
    fn order(&mut self, current: &LaggedFactor, values: &[f64], shift: f64) {
        if !self.is_wanted || matches!(self.factor, SecondFactor::WithWorker) {
            return;
        }
        if let Some(orders) = &self.worker.orders {
            let factor = match std::mem::replace(&mut self.factor, SecondFactor::WithWorker) {
                SecondFactor::Idle(factor) => Some(factor),
                SecondFactor::Unmade | SecondFactor::WithWorker => None,
            };
            // A worker that is gone leaves the factor in use as it is.
            let _ = orders.send(Order {
                factor,
                pattern: current.pattern.clone(),
                is_held: current.is_held.clone(),
                wants_double: current.wants_double,
                values: values.to_vec(),
                shift,
            });
            self.is_wanted = false;
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
        let outcome = factor.factorize(&self.values, self.shift);
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
