//! The Cholesky factor of an earlier tangent as a preconditioner: from one frame to the next the tangent changes so
//! little that a few iterations make up for it. A second thread, where there is one, makes the next factor while
//! frames go on with the last.

use super::factor::TangentFactor;
use crate::body::BlockPattern;
use crate::linear::FactorError;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

type Factor = TangentFactor<f32>;

/// A factor in use and, where there is a second thread, one in the making.
pub(super) struct Lagged {
    current: Box<Factor>,
    is_usable: bool,
    is_held: Vec<bool>,
    spare: Option<Spare>,
}

/// The second factor: at home, or out with the worker.
struct Spare {
    factor: Option<Box<Factor>>,
    worker: Worker,
    /// What is held has changed since the factor went out: it comes home useless.
    is_outdated: bool,
    /// A new factor is asked for.
    is_wanted: bool,
}

/// A factor to renew, with the values of the tangent and the shift.
type Order = (Box<Factor>, Vec<f64>, f64);
/// The factor come back, and whether it is of use.
type Done = (Box<Factor>, Result<(), FactorError>);

/// A thread that factorises what it is sent, and ends when nothing more can come.
struct Worker {
    orders: Option<Sender<Order>>,
    /// Behind a lock only so that a stepper may be shared; nobody ever waits for it.
    done: Mutex<Receiver<Done>>,
    thread: Option<JoinHandle<()>>,
}

impl Lagged {
    pub fn new(blocks: &BlockPattern, free: &[u32], n_dofs: usize) -> Result<Self, FactorError> {
        let factor = || TangentFactor::new(blocks, free).map(Box::new);
        let has_second_thread = rayon::current_num_threads() > 1;
        Ok(Lagged {
            current: factor()?,
            is_usable: false,
            is_held: vec![false; n_dofs],
            spare: if has_second_thread { Some(Spare::new(factor()?)) } else { None },
        })
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
        self.current.hold(is_held);
        if let Some(spare) = &mut self.spare {
            match &mut spare.factor {
                Some(factor) => factor.hold(is_held),
                None => spare.is_outdated = true,
            }
        }
    }

    /// Takes a finished factor into use, and has a new one made where `is_stale`; whether the factor in use changed.
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
                spare.is_wanted |= is_stale;
                spare.order(values, shift);
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
    fn new(factor: Box<Factor>) -> Self {
        Spare {
            factor: Some(factor),
            worker: Worker::start(),
            is_outdated: false,
            is_wanted: false,
        }
    }

    /// Exchanges the factors where the worker has finished.
    fn collect(&mut self, current: &mut Box<Factor>, is_held: &[bool]) -> bool {
        let Ok(done) = self.worker.done.get_mut() else {
            return false;
        };
        let Ok((mut factor, outcome)) = done.try_recv() else {
            return false;
        };
        let is_outdated = std::mem::take(&mut self.is_outdated);
        let is_good = outcome.is_ok() && !is_outdated;
        if is_good {
            std::mem::swap(&mut factor, current);
        }
        factor.hold(is_held);
        self.is_wanted |= is_outdated;
        self.factor = Some(factor);
        is_good
    }

    /// Sends the spare factor out, if one is wanted and it is at home.
    fn order(&mut self, values: &[f64], shift: f64) {
        if !self.is_wanted {
            return;
        }
        if let (Some(factor), Some(orders)) = (self.factor.take(), &self.worker.orders) {
            // A worker that is gone leaves the factor in use as it is.
            let _ = orders.send((factor, values.to_vec(), shift));
            self.is_wanted = false;
        }
    }
}

impl Worker {
    fn start() -> Self {
        let (orders, incoming) = channel::<Order>();
        let (outgoing, done) = channel();
        let thread = std::thread::spawn(move || {
            for (mut factor, values, shift) in incoming {
                let outcome = factor.factorize(&values, shift);
                if outgoing.send((factor, outcome)).is_err() {
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
