//! What computes beside whatever the rig does: one job at a time, a few more waiting, all at the lowest priority.
//!
//! The pool of its own keeps a capture's work from queueing behind a job's, and its threads' priority leaves a capture every
//! core that it wants; what is computed does not depend on either.

use super::slot::{NotTaken, Over, Slot};
use super::{BackgroundWatcher, JobError, ended};
use crate::session::event::{BackgroundEvent, JobKind, JobState, JobStatus};
use serde_json::Value;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Jobs that may wait.
const MOST_WAITING: usize = 16;
/// The lowest priority: a thread of the usual one has 68 times its share of a core.
const NICE: i32 = 19;
/// Results that are kept for whoever asks.
const RESULTS_KEPT: usize = 20;
/// Progress is told no more often: the feed keeps a number of events, and a capture's are among them.
const EACH: Duration = Duration::from_millis(500);

/// What a job is about.
#[derive(Clone)]
pub(super) struct JobDescription {
    pub kind: JobKind,
    /// The session whose results it makes.
    pub session: String,
    /// Of a compression.
    pub name: Option<String>,
    /// Where a job can be stopped in its middle, this stops it.
    pub stop: Option<Arc<AtomicBool>>,
    /// What is done where it is taken out of the queue.
    pub called_off: Option<Arc<dyn Fn() + Send + Sync>>,
}

impl JobDescription {
    /// Whether it computes this compression.
    pub(super) fn is_compression(&self, session: &str, name: &str) -> bool {
        self.kind == JobKind::Compress && self.session == session && self.name.as_deref() == Some(name)
    }
}

/// A job with its number.
#[derive(Clone)]
struct QueuedJob {
    job: u64,
    about: JobDescription,
    /// Somebody, and not the end of the program, stopped it.
    cancelled: Arc<AtomicBool>,
}

/// Why a job was not taken, or not stopped.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BackgroundError {
    /// Too many wait.
    #[error(
        "{MOST_WAITING} computations wait already, behind one of session {session}; wait until some have ended"
    )]
    Full {
        /// The session of the one that goes on.
        session: String,
    },
    /// The program ends.
    #[error("the program is ending; start it again, then the computation")]
    Closed,
    /// There is no such job.
    #[error("no computation of this number waits or goes on; it has ended, or never was")]
    Absent,
    /// It can't be stopped in its middle.
    #[error(
        "this computation cannot be stopped in its middle: it ends by itself within minutes, and changes nothing before"
    )]
    Unstoppable,
}

/// How a job ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum JobEnd {
    /// It did what it was to do.
    Done,
    /// It was stopped before its end.
    Stopped,
}

/// What a job knows of its being stopped, and tells of its end.
pub(super) struct StopState {
    over: Over,
    cancelled: Arc<AtomicBool>,
}

impl StopState {
    /// Whether it was somebody, and not the end of the program.
    pub(super) fn by_somebody(&self) -> bool {
        self.cancelled.load(Ordering::Acquire)
    }

    /// The job is over: whoever is told of that from now on may begin another.
    pub(super) fn over(&self) {
        self.over.set();
    }
}

/// Computes jobs, one at a time.
pub struct Background {
    slot: Slot<QueuedJob>,
    watcher: BackgroundWatcher,
    next: AtomicU64,
    results: Results,
}

/// What the last jobs came to, by their numbers, the newest last.
type Results = Arc<Mutex<VecDeque<(u64, Value)>>>;

impl Background {
    /// A place for jobs; `watcher` is told how each stands.
    pub fn new(watcher: BackgroundWatcher) -> Self {
        Self {
            slot: Slot::new("computation", MOST_WAITING),
            watcher,
            next: AtomicU64::new(1),
            results: Arc::default(),
        }
    }

    /// Begins a job or lets it wait; its number. `work` calls [`StopState::over`] before it tells anybody of its end.
    ///
    /// # Errors
    /// [`BackgroundError`], or that the system gives no thread.
    pub(super) fn queue(
        &self,
        about: JobDescription,
        work: impl FnOnce(&StopState, &mut JobReporter) -> Result<JobEnd, String> + Send + 'static,
    ) -> Result<u64, JobError> {
        let job = self.next.fetch_add(1, Ordering::Relaxed);
        let cancelled = Arc::new(AtomicBool::new(false));
        let mut reporter =
            JobReporter::new(job, &about, Arc::clone(&self.watcher), Arc::clone(&self.results));
        // Before it can begin: the feed is in the order of what happened.
        reporter.tell();
        let mut withdrawn = reporter.clone();
        let numbered = QueuedJob { job, about, cancelled: Arc::clone(&cancelled) };
        let taken = self.slot.queue(numbered, move |over| {
            let stopped = StopState { over: over.clone(), cancelled };
            reporter.state(JobState::Running);
            let defect = "the computation ended by a defect of the program: please report it with the log";
            let done = ended(defect, || in_background(|| work(&stopped, &mut reporter)));
            stopped.over();
            match done {
                Ok(JobEnd::Done) => reporter.state(JobState::Complete),
                Ok(JobEnd::Stopped) if stopped.by_somebody() => reporter.state(JobState::Cancelled),
                Ok(JobEnd::Stopped) => reporter.state(JobState::Interrupted),
                Err(error) => reporter.failed(error),
            }
        });
        let error = match taken {
            Ok(Ok(_)) => return Ok(job),
            Ok(Err(source)) => JobError::Thread { source },
            Err(NotTaken::Closed) => BackgroundError::Closed.into(),
            Err(NotTaken::Busy(running)) => BackgroundError::Full { session: running.about.session }.into(),
        };
        withdrawn.failed(error.to_string());
        Err(error)
    }

    /// Takes a waiting job out of the queue, or stops the one that goes on where it can be stopped.
    ///
    /// # Errors
    /// [`BackgroundError::Absent`] and [`BackgroundError::Unstoppable`].
    pub fn cancel(&self, job: u64) -> Result<(), BackgroundError> {
        if let Some(waiting) = self.slot.withdraw(|j| j.job == job) {
            if let Some(called_off) = &waiting.about.called_off {
                called_off();
            }
            let (watcher, results) = (Arc::clone(&self.watcher), Arc::clone(&self.results));
            JobReporter::new(job, &waiting.about, watcher, results).state(JobState::Cancelled);
            return Ok(());
        }
        let running = self.slot.running().filter(|j| j.job == job).ok_or(BackgroundError::Absent)?;
        let stop = running.about.stop.as_ref().ok_or(BackgroundError::Unstoppable)?;
        running.cancelled.store(true, Ordering::Release);
        stop.store(true, Ordering::Release);
        Ok(())
    }

    /// What a job came to, where it was one of the last.
    pub fn result(&self, job: u64) -> Option<Value> {
        let results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        results.iter().find(|(number, _)| *number == job).map(|(_, result)| result.clone())
    }

    /// The number of the job that goes on, where it is such a one.
    pub(super) fn running(&self, is_such: impl Fn(&JobDescription) -> bool) -> Option<u64> {
        self.slot.running().filter(|j| is_such(&j.about)).map(|j| j.job)
    }

    /// Whether such a job waits.
    pub(super) fn waits(&self, is_such: impl Fn(&JobDescription) -> bool) -> bool {
        self.slot.waiting().iter().any(|j| is_such(&j.about))
    }

    /// Takes no more jobs, forgets those that wait, has the one that goes on stopped where that can be, and waits for its end,
    /// `limit` at most; whether it came.
    pub fn finish(&self, limit: Duration) -> bool {
        let stop = |running: &QueuedJob| {
            if let Some(stop) = &running.about.stop {
                stop.store(true, Ordering::Release);
            }
        };
        self.slot.close(stop, limit)
    }
}

/// Tells the watcher of one job.
#[derive(Clone)]
pub(super) struct JobReporter {
    watcher: BackgroundWatcher,
    results: Results,
    next: JobStatus,
    told: Option<Instant>,
}

impl JobReporter {
    fn new(job: u64, about: &JobDescription, watcher: BackgroundWatcher, results: Results) -> Self {
        let next = JobStatus {
            job,
            kind: about.kind,
            session: about.session.clone(),
            name: about.name.clone(),
            state: JobState::Waiting,
            phase: None,
            done: 0.0,
            error: None,
        };
        Self { watcher, results, next, told: None }
    }

    /// What is being done, and how much of that is done, 0 to 1; the next thing is told at once.
    pub(super) fn progress(&mut self, phase: &str, done: f64) {
        self.next.done = done;
        let is_new = self.next.phase.as_deref() != Some(phase);
        if is_new {
            self.next.phase = Some(phase.into());
        }
        if is_new || self.told.is_none_or(|told| told.elapsed() >= EACH) {
            self.tell();
        }
    }

    /// Keeps what the job came to; whoever is told of its end finds it.
    pub(super) fn keep(&self, result: Value) {
        let mut results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        if results.len() == RESULTS_KEPT {
            results.pop_front();
        }
        results.push_back((self.next.job, result));
    }

    fn state(&mut self, state: JobState) {
        self.next.state = state;
        self.next.phase = None;
        self.next.done = if state == JobState::Complete { 1.0 } else { self.next.done };
        self.tell();
    }

    fn failed(&mut self, error: String) {
        tracing::warn!("{error}");
        self.next.error = Some(error);
        self.state(JobState::Failed);
    }

    fn tell(&mut self) {
        (self.watcher)(BackgroundEvent::Job(self.next.clone()));
        self.told = Some(Instant::now());
    }
}

/// Computes on a pool of its own, at the lowest priority.
fn in_background<T: Send>(work: impl FnOnce() -> Result<T, String> + Send) -> Result<T, String> {
    let pool = rayon::ThreadPoolBuilder::new()
        .thread_name(|n| format!("compute-{n}"))
        .start_handler(|_| step_back())
        .build()
        .map_err(|e| JobError::Thread { source: std::io::Error::other(e) }.to_string())?;
    // It is another thread's: the log has it within the same span.
    let span = tracing::Span::current();
    pool.install(|| span.in_scope(work))
}

/// Gives this thread the lowest priority.
fn step_back() {
    // On Linux a priority is a thread's; no process means the caller.
    if let Err(error) = rustix::process::setpriority_process(None, NICE) {
        tracing::warn!(%error, "a computation keeps the usual priority");
    }
}
