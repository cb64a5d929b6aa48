//! Training in the background: a thread trains a model while it is in use, first in rounds, then at the position of the
//! tools.
//!
//! Grasp and thread hand boxes to each other through [`Slot`]s, so that a tick neither takes a lock, nor allocates, nor
//! frees: the model that a better one replaces goes back to the thread, which frees it.

use super::contacts::ReducedContacts;
use super::model::MOST_SNAPSHOTS;
use super::trained::{Trained, train};
use crate::clock::Instant;
use crate::error::Error;
use crate::number::norm;
use std::mem::swap;
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};
use std::thread;
use std::time::Duration;

/// Tools that have moved by less than this part of the depth of training count as not moved.
const MOVED: f64 = 0.01;
/// How often an idle thread looks for a question.
const LOOKS: Duration = Duration::from_millis(5);

/// A place for a box, which one side puts there and the other takes.
struct Slot<T>(AtomicPtr<T>);

impl<T: Send> Slot<T> {
    const fn new() -> Self {
        Slot(AtomicPtr::new(null_mut()))
    }

    /// Puts a box there; returns the one that was there.
    fn put(&self, value: Box<T>) -> Option<Box<T>> {
        self.swap(Box::into_raw(value))
    }

    fn take(&self) -> Option<Box<T>> {
        self.swap(null_mut())
    }

    fn is_empty(&self) -> bool {
        self.0.load(Ordering::Acquire).is_null()
    }

    fn swap(&self, new: *mut T) -> Option<Box<T>> {
        let old = self.0.swap(new, Ordering::AcqRel);
        // SAFETY: every pointer there comes from `Box::into_raw`, and a swap gives it to one side alone.
        (!old.is_null()).then(|| unsafe { Box::from_raw(old) })
    }
}

impl<T> Drop for Slot<T> {
    fn drop(&mut self) {
        let left = *self.0.get_mut();
        if !left.is_null() {
            // SAFETY: as above; nobody else is left.
            drop(unsafe { Box::from_raw(left) });
        }
    }
}

/// What goes from the thread to the grasp and back.
struct Exchange {
    /// A better model.
    better: Slot<Trained>,
    /// One that has been replaced.
    replaced: Slot<Trained>,
    /// An answer to be compared with the equilibrium next to it, and one that has been.
    question: Slot<Question>,
    answered: Slot<Question>,
    /// What ended the training.
    failure: Slot<Error>,
    /// Whether better models may follow.
    is_busy: AtomicBool,
    /// Whether the grasp is still there, and the thread.
    is_wanted: AtomicBool,
    is_running: AtomicBool,
}

/// An answer of a grasp.
struct Question {
    q: Vec<f64>,
    depth: f64,
}

/// The grasp's connection to the thread, which ends soon after this is dropped.
pub(super) struct BackgroundTraining {
    exchange: Arc<Exchange>,
    /// The next question, while it is not with the thread.
    question: Option<Box<Question>>,
    /// Displacements [m] of the contacts in the last question; none before the first.
    asked: Vec<[f64; 3]>,
}

impl BackgroundTraining {
    /// Starts the thread, on all processors but one, which remains free for the use of the grasp.
    ///
    /// # Errors
    /// No thread.
    pub fn start(contacts: ReducedContacts, since: Instant) -> Result<Self, Error> {
        let exchange = Arc::new(Exchange {
            better: Slot::new(),
            replaced: Slot::new(),
            question: Slot::new(),
            answered: Slot::new(),
            failure: Slot::new(),
            is_busy: AtomicBool::new(true),
            is_wanted: AtomicBool::new(true),
            is_running: AtomicBool::new(true),
        });
        let q = Vec::with_capacity(contacts.n_modes() + MOST_SNAPSHOTS);
        let asked = Vec::with_capacity(contacts.places().len());
        let (theirs, threads) = (Arc::clone(&exchange), (rayon::current_num_threads() - 1).max(1));
        let work = move || {
            let _running = Running(&theirs.is_running);
            let train = || train_in_background(contacts, since, &theirs);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            if let Err(error) = pool.map_err(no_thread).and_then(|pool| pool.install(train)) {
                theirs.failure.put(Box::new(error));
            }
        };
        let thread = thread::Builder::new().name("viscera-training".into());
        thread.spawn(work).map_err(no_thread)?;
        let question = Some(Box::new(Question { q, depth: 0.0 }));
        Ok(BackgroundTraining { exchange, question, asked })
    }

    /// Puts the best model that is ready in the place of the one that is used, unless the thread has yet to take the
    /// last one back. The new one goes on from the old one by `go_on`.
    ///
    /// # Errors
    /// What ended the training.
    pub fn improve(
        &self,
        now: &mut Trained,
        go_on: impl FnOnce(&Trained, &mut Trained),
    ) -> Result<(), Error> {
        let exchange = &*self.exchange;
        if let Some(error) = exchange.failure.take() {
            return Err(*error);
        }
        if !exchange.is_running.load(Ordering::Acquire) && exchange.better.is_empty() {
            return Err(Error::input("training broke off; take hold anew"));
        }
        if !exchange.replaced.is_empty() {
            return Ok(());
        }
        if let Some(mut better) = exchange.better.take() {
            swap(now, &mut *better);
            go_on(&better, now);
            exchange.replaced.put(better);
        }
        Ok(())
    }

    /// Whether better models may follow.
    pub fn is_busy(&self) -> bool {
        self.exchange.is_busy.load(Ordering::Acquire) || !self.exchange.better.is_empty()
    }

    /// Sends an answer to the thread to be compared, if the thread is idle and the tools have moved since the last
    /// question.
    pub fn ask(&mut self, contacts: &ReducedContacts, q: &[f64], displacements: &[[f64; 3]]) {
        let moved = |(d, asked): (&[f64; 3], &[f64; 3])| {
            let moved: [f64; 3] = std::array::from_fn(|i| d[i] - asked[i]);
            norm(&moved) > MOVED * contacts.owner.sampling.depth
        };
        let is_new = self.asked.is_empty() || displacements.iter().zip(&self.asked).any(moved);
        if self.is_busy() || !is_new {
            return;
        }
        let Some(mut question) = self.question.take().or_else(|| self.exchange.answered.take())
        else {
            return;
        };
        question.q.clear();
        question.q.extend_from_slice(q);
        question.depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        self.asked.clear();
        self.asked.extend_from_slice(displacements);
        self.exchange.is_busy.store(true, Ordering::Release);
        self.exchange.question.put(question);
    }
}

impl Drop for BackgroundTraining {
    fn drop(&mut self) {
        self.exchange.is_wanted.store(false, Ordering::Release);
    }
}

/// Says that the thread is over, also if it panics.
struct Running<'a>(&'a AtomicBool);

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

/// The work of the thread. It ends when the grasp is gone.
fn train_in_background(
    mut contacts: ReducedContacts,
    since: Instant,
    exchange: &Exchange,
) -> Result<(), Error> {
    let is_wanted = || exchange.is_wanted.load(Ordering::Acquire);
    let mut replaced = Replaced::default();
    let hand_over = &mut |better| {
        replaced.collect(exchange);
        // One that the grasp has not taken is out of date.
        drop(exchange.better.put(Box::new(better)));
    };
    let mut training = train(&mut contacts, since, &is_wanted, hand_over)?;
    exchange.is_busy.store(false, Ordering::Release);
    while is_wanted() {
        replaced.collect(exchange);
        let Some(question) = exchange.question.take() else {
            thread::sleep(LOOKS);
            continue;
        };
        let since = Instant::now();
        // An answer of an older model, with fewer modes, says nothing about the present one.
        let is_present = question.q.len() == contacts.n_modes();
        let u = is_present.then(|| contacts.subspace.basis.field(&question.q));
        if let Some(u) = u
            && training.correct(&mut contacts, &u, question.depth)?
        {
            let better = Trained::new(contacts.clone(), training.clone(), since);
            drop(exchange.better.put(Box::new(better)));
        }
        exchange.answered.put(question);
        exchange.is_busy.store(false, Ordering::Release);
    }
    Ok(())
}

/// What has been replaced, but is still used by an answer: whoever lets go of it last would free it in a tick.
#[derive(Default)]
struct Replaced(Vec<Arc<ReducedContacts>>);

impl Replaced {
    fn collect(&mut self, exchange: &Exchange) {
        if let Some(replaced) = exchange.replaced.take() {
            self.0.push(Arc::clone(&replaced.contacts));
        }
        self.0.retain(|contacts| Arc::strong_count(contacts) > 1);
    }
}

fn no_thread(error: impl std::fmt::Display) -> Error {
    Error::input(format!("no thread to train in the background: {error}; take hold without it"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_gives_each_box_to_one_side_and_frees_what_is_left() {
        let (slot, counted) = (Slot::new(), Arc::new(()));
        assert!(slot.put(Box::new(Arc::clone(&counted))).is_none());
        assert!(slot.put(Box::new(Arc::clone(&counted))).is_some());
        assert!(!slot.is_empty());
        assert_eq!(Arc::strong_count(&counted), 2, "the first has been dropped");
        assert!(slot.take().is_some());
        assert!(slot.take().is_none());
        slot.put(Box::new(Arc::clone(&counted)));
        drop(slot);
        assert_eq!(Arc::strong_count(&counted), 1);
    }
}
