//! Training in the background: a thread trains a model while it is in use, first in rounds, then at the position of the
//! tools.

use super::contacts::ReducedContacts;
use super::trained::{Trained, train};
use crate::clock::Instant;
use crate::error::Error;
use crate::number::norm;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, channel, sync_channel};
use std::thread;

/// Tools that have moved by less than this part of the depth of training count as not moved.
const MOVED: f64 = 0.01;

/// What the thread reports.
enum TrainingEvent {
    /// A better model.
    Better(Box<Trained>),
    /// Nothing is left to do, neither a round nor a question.
    Done,
}

/// An answer of a grasp, to be compared with the equilibrium next to it.
struct Question {
    contacts: Arc<ReducedContacts>,
    q: Vec<f64>,
    depth: f64,
}

/// The grasp's connection to the thread, which ends soon after this is dropped.
pub(super) struct BackgroundTraining {
    events: Receiver<Result<TrainingEvent, Error>>,
    questions: SyncSender<Question>,
    /// Displacements [m] of the contacts in the last question.
    asked: Vec<[f64; 3]>,
    is_busy: bool,
    is_wanted: Arc<AtomicBool>,
}

impl BackgroundTraining {
    /// Starts the thread, on all processors but one, which remains free for the use of the grasp.
    ///
    /// # Errors
    /// No thread.
    pub fn start(contacts: ReducedContacts, since: Instant) -> Result<Self, Error> {
        let ((say, events), (questions, asked)) = (channel(), sync_channel(1));
        let is_wanted = Arc::new(AtomicBool::new(true));
        let (wanted, threads) = (Arc::clone(&is_wanted), (rayon::current_num_threads() - 1).max(1));
        let work = move || {
            let train = || train_in_background(contacts, since, asked, &wanted, &say);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            if let Err(error) = pool.map_err(no_thread).and_then(|pool| pool.install(train)) {
                _ = say.send(Err(error));
            }
        };
        let thread = thread::Builder::new().name("viscera-training".into());
        thread.spawn(work).map_err(no_thread)?;
        Ok(BackgroundTraining { events, questions, asked: Vec::new(), is_busy: true, is_wanted })
    }

    /// The best model that is ready, if it is newer than the one handed over last.
    ///
    /// # Errors
    /// What ended the training.
    pub fn newest(&mut self) -> Result<Option<Trained>, Error> {
        let mut newest = None;
        loop {
            match self.events.try_recv() {
                Ok(Ok(TrainingEvent::Better(better))) => newest = Some(*better),
                Ok(Ok(TrainingEvent::Done)) => self.is_busy = false,
                Ok(Err(error)) => return Err(error),
                Err(TryRecvError::Empty) => return Ok(newest),
                Err(TryRecvError::Disconnected) => {
                    return Err(Error::input("training broke off; take hold anew"));
                }
            }
        }
    }

    /// Whether better models may follow.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Sends an answer to the thread to be compared, if the thread is idle and the tools have moved since the last
    /// question.
    pub fn ask(&mut self, contacts: &Arc<ReducedContacts>, q: &[f64], displacements: &[[f64; 3]]) {
        let moved = |(d, asked): (&[f64; 3], &[f64; 3])| {
            let moved: [f64; 3] = std::array::from_fn(|i| d[i] - asked[i]);
            norm(&moved) > MOVED * contacts.owner.sampling.depth
        };
        let is_new = self.asked.is_empty() || displacements.iter().zip(&self.asked).any(moved);
        if self.is_busy || !is_new {
            return;
        }
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        let question = Question { contacts: Arc::clone(contacts), q: q.to_vec(), depth };
        self.is_busy = self.questions.try_send(question).is_ok();
        self.asked = displacements.to_vec();
    }
}

impl Drop for BackgroundTraining {
    fn drop(&mut self) {
        self.is_wanted.store(false, Ordering::Relaxed);
    }
}

/// The work of the thread. It ends when the other end of the channels is dropped.
fn train_in_background(
    mut contacts: ReducedContacts,
    since: Instant,
    questions: Receiver<Question>,
    wanted: &AtomicBool,
    say: &Sender<Result<TrainingEvent, Error>>,
) -> Result<(), Error> {
    let is_wanted = || wanted.load(Ordering::Relaxed);
    let tell = |lesson| _ = say.send(Ok(lesson));
    let hand_over = &mut |better| tell(TrainingEvent::Better(Box::new(better)));
    let mut training = train(&mut contacts, since, &is_wanted, hand_over)?;
    tell(TrainingEvent::Done);
    for Question { contacts: asked, q, depth } in questions {
        let since = Instant::now();
        // An answer of an older model says nothing about the present one.
        let is_present = asked.n_modes() == contacts.n_modes();
        if is_present && training.correct(&mut contacts, &asked.subspace.basis.field(&q), depth)? {
            let better = Trained::new(contacts.clone(), training.clone(), since);
            tell(TrainingEvent::Better(Box::new(better)));
        }
        tell(TrainingEvent::Done);
    }
    Ok(())
}

fn no_thread(error: impl std::fmt::Display) -> Error {
    Error::input(format!("no thread to train in the background: {error}; take hold without it"))
}
