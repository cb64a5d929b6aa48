//! The Cholesky factor of an earlier tangent as a preconditioner: from one frame to the next the tangent changes so
//! little that a few iterations make up for it, and for single precision, too. A second thread, where there is one, makes the next factor while
//! frames go on with the last.

use super::factor::TangentFactor;
use crate::body::BlockPattern;
use crate::linear::FactorError;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

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

/// A factor in use and, where there is a second thread, one in the making.
pub(super) struct Lagged {
    current: Box<LaggedFactor>,
    is_usable: bool,
    is_held: Vec<bool>,
    spare: Option<Spare>,
}

/// The second factor: at home, or out with the worker.
struct Spare {
    factor: Option<Box<LaggedFactor>>,
    worker: Worker,
    /// What is held has changed since the factor went out: it comes home useless.
    is_outdated: bool,
    /// A new factor is asked for.
    is_wanted: bool,
}

/// A factor to renew, with the values of the tangent and the shift.
type Order = (Box<LaggedFactor>, Vec<f64>, f64);
/// The factor come back, and whether it is of use.
type Done = (Box<LaggedFactor>, Result<(), FactorError>);

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
        let factor = || LaggedFactor::new(&shape, n_dofs).map(Box::new);
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
                spare.is_wanted |= is_stale;
                spare.order(values, shift, self.current.wants_double);
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
    fn new(factor: Box<LaggedFactor>) -> Self {
        Spare {
            factor: Some(factor),
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
    fn order(&mut self, values: &[f64], shift: f64, wants_double: bool) {
        if !self.is_wanted {
            return;
        }
        if let (Some(mut factor), Some(orders)) = (self.factor.take(), &self.worker.orders) {
            factor.wants_double |= wants_double;
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
