//! A place for one job at a time, on a thread of its own, with a short queue before it.
//!
//! ```text
//!  begin ──▶ free? ──▶ running ──▶ over: its watchers were told ──▶ ended: it has let go of everything ──▶ the next
//!  queue ──▶ waiting ──▲
//! ```
//!
//! Whoever is told of a job's end may begin the next at once: it begins a moment later, when the one before has let go of its
//! devices and folders.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Set by a job when its watchers are about to be told of its end.
#[derive(Debug, Clone, Default)]
pub(super) struct Over(Arc<AtomicBool>);

impl Over {
    pub(super) fn set(&self) {
        self.0.store(true, Ordering::Release);
    }

    pub(super) fn is_set(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}

/// Does a job; it must not panic, and sets [`Over`] before it tells of its end.
type Work = Box<dyn FnOnce(&Over) + Send>;

/// Why a job was not taken. `T` is what is known of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum NotTaken<T> {
    /// The program ends.
    Closed,
    /// This one goes on, and the queue is full.
    Busy(T),
}

/// A place for jobs, of which `T` is known.
pub(super) struct Slot<T> {
    /// Of its thread.
    name: &'static str,
    /// Jobs that may wait.
    most_waiting: usize,
    shared: Arc<Shared<T>>,
}

struct Shared<T> {
    state: Mutex<State<T>>,
    /// A job has let go of everything.
    ended: Condvar,
}

struct State<T> {
    running: Option<(T, Over)>,
    waiting: VecDeque<(T, Work)>,
    closed: bool,
}

/// The right to begin a job; no other begins while it is held.
pub(super) struct Free<'a, T> {
    slot: &'a Slot<T>,
    state: MutexGuard<'a, State<T>>,
}

impl<T: Clone + Send + 'static> Slot<T> {
    pub(super) fn new(name: &'static str, most_waiting: usize) -> Self {
        let state = State { running: None, waiting: VecDeque::new(), closed: false };
        Self {
            name,
            most_waiting,
            shared: Arc::new(Shared { state: Mutex::new(state), ended: Condvar::new() }),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.shared.lock()
    }

    /// The job that goes on.
    pub(super) fn running(&self) -> Option<T> {
        self.lock().running.as_ref().filter(|(_, over)| !over.is_set()).map(|(about, _)| about.clone())
    }

    /// The jobs that wait, the next first.
    pub(super) fn waiting(&self) -> Vec<T> {
        self.lock().waiting.iter().map(|(about, _)| about.clone()).collect()
    }

    /// The right to begin a job, where none goes on and none waits.
    ///
    /// # Errors
    /// [`NotTaken`].
    pub(super) fn free(&self) -> Result<Free<'_, T>, NotTaken<T>> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return Err(NotTaken::Closed);
            }
            match &state.running {
                None => return Ok(Free { slot: self, state }),
                Some((about, over)) if !over.is_set() => return Err(NotTaken::Busy(about.clone())),
                Some(_) => {}
            }
            if let Some((about, _)) = state.waiting.front() {
                return Err(NotTaken::Busy(about.clone()));
            }
            state = self.shared.ended.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Begins a job where none goes on, else lets it wait; how many are before it.
    ///
    /// # Errors
    /// [`NotTaken`], or that the system gives no thread.
    pub(super) fn queue(
        &self,
        about: T,
        work: impl FnOnce(&Over) + Send + 'static,
    ) -> Result<io::Result<usize>, NotTaken<T>> {
        let mut state = self.lock();
        if state.closed {
            return Err(NotTaken::Closed);
        }
        let Some((running, over)) = &state.running else {
            return Ok(Free { slot: self, state }.begin(about, work).map(|()| 0));
        };
        if state.waiting.len() >= self.most_waiting {
            return Err(NotTaken::Busy(running.clone()));
        }
        let before = state.waiting.len() + usize::from(!over.is_set());
        state.waiting.push_back((about, Box::new(work)));
        Ok(Ok(before))
    }

    /// Takes a waiting job out of the queue, if there is such a one.
    pub(super) fn withdraw(&self, is_it: impl Fn(&T) -> bool) -> Option<T> {
        let mut state = self.lock();
        let place = state.waiting.iter().position(|(about, _)| is_it(about))?;
        state.waiting.remove(place).map(|(about, _)| about)
    }

    /// Takes no more jobs, lets the waiting ones go, has the one that goes on stopped, and waits for its end, `limit` at most;
    /// whether it came.
    pub(super) fn close(&self, stop: impl FnOnce(&T), limit: Duration) -> bool {
        let mut state = self.lock();
        state.closed = true;
        state.waiting.clear();
        if let Some((about, _)) = &state.running {
            stop(about);
        }
        let (state, _) = self
            .shared
            .ended
            .wait_timeout_while(state, limit, |state| state.running.is_some())
            .unwrap_or_else(PoisonError::into_inner);
        state.running.is_none()
    }
}

impl<T: Clone + Send + 'static> Free<'_, T> {
    /// Begins a job, and those that come to wait behind it.
    pub(super) fn begin(mut self, about: T, work: impl FnOnce(&Over) + Send + 'static) -> io::Result<()> {
        let over = Over::default();
        let (shared, first) = (Arc::clone(&self.slot.shared), over.clone());
        let thread = std::thread::Builder::new().name(self.slot.name.into());
        // It waits for the lock that is held here before it looks for the next.
        thread.spawn(move || {
            work(&first);
            first.set();
            while let Some((work, over)) = shared.next() {
                work(&over);
                over.set();
            }
        })?;
        self.state.running = Some((about, over));
        Ok(())
    }
}

impl<T: Clone> Shared<T> {
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The job that has waited longest, which goes on from now.
    fn next(&self) -> Option<(Work, Over)> {
        let mut state = self.lock();
        let next = state.waiting.pop_front();
        let over = Over::default();
        state.running = next.as_ref().map(|(about, _)| (about.clone(), over.clone()));
        self.ended.notify_all();
        next.map(|(_, work)| (work, over))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, Sender, channel};

    const LIMIT: Duration = Duration::from_secs(60);

    /// A job that tells of its beginning, and ends when it is let.
    fn held(
        name: &'static str,
        began: &Sender<&'static str>,
    ) -> (Sender<()>, impl FnOnce(&Over) + Send + use<>) {
        let (let_end, may_end) = channel::<()>();
        let began = began.clone();
        (let_end, move |_: &Over| {
            began.send(name).unwrap();
            let _ = may_end.recv();
        })
    }

    fn slot(most: usize) -> (Slot<&'static str>, Sender<&'static str>, Receiver<&'static str>) {
        let (send, receive) = channel();
        (Slot::new("test", most), send, receive)
    }

    #[test]
    fn jobs_go_one_after_the_other_in_the_order_in_which_they_came() {
        let (slot, send, began) = slot(2);
        let (end_a, a) = held("a", &send);
        let (end_b, b) = held("b", &send);
        let (end_c, c) = held("c", &send);
        assert_eq!(slot.queue("a", a).unwrap().unwrap(), 0);
        assert_eq!(slot.queue("b", b).unwrap().unwrap(), 1);
        assert_eq!(slot.queue("c", c).unwrap().unwrap(), 2);
        assert_eq!(slot.queue("d", |_: &Over| ()).unwrap_err(), NotTaken::Busy("a"));
        assert_eq!(slot.free().err(), Some(NotTaken::Busy("a")));
        assert_eq!(began.recv().unwrap(), "a");
        assert_eq!((slot.running(), slot.waiting()), (Some("a"), vec!["b", "c"]));
        drop(end_a);
        assert_eq!(began.recv().unwrap(), "b");
        assert_eq!((slot.running(), slot.waiting()), (Some("b"), vec!["c"]));
        assert_eq!(slot.withdraw(|name| *name == "c"), Some("c"));
        assert_eq!(slot.withdraw(|name| *name == "c"), None);
        drop((end_b, end_c));
        assert!(slot.close(|_| (), LIMIT));
        assert!(began.try_recv().is_err(), "a job that was taken out began");
        assert_eq!(slot.queue("e", |_: &Over| ()).unwrap_err(), NotTaken::Closed);
    }

    /// Whoever is told of an end may begin the next, which begins when the one before has let go.
    #[test]
    fn who_is_told_of_the_end_may_begin_the_next() {
        let (slot, _, _) = slot(0);
        let (tell, told) = channel();
        let (let_go, may_go) = channel::<()>();
        let is_gone = Arc::new(AtomicBool::new(false));
        let going = Arc::clone(&is_gone);
        let work = move |over: &Over| {
            over.set();
            tell.send(()).unwrap();
            let _ = may_go.recv();
            going.store(true, Ordering::Release);
        };
        slot.free().unwrap().begin("a", work).unwrap();
        told.recv().unwrap();
        assert_eq!(slot.running(), None);
        drop(let_go);
        let free = slot.free().unwrap();
        assert!(is_gone.load(Ordering::Acquire));
        free.begin("b", |_: &Over| ()).unwrap();
        assert!(slot.close(|_| (), LIMIT));
    }

    #[test]
    fn the_end_of_the_program_stops_the_job_and_forgets_those_that_wait() {
        let (slot, send, began) = slot(1);
        let (end, a) = held("a", &send);
        slot.queue("a", a).unwrap().unwrap();
        let (_, b) = held("b", &send);
        slot.queue("b", b).unwrap().unwrap();
        assert!(!slot.close(|_| (), Duration::ZERO), "nobody has let it end");
        let mut stopped = Vec::new();
        let end_it = |about: &&'static str| {
            stopped.push(*about);
            drop(end);
        };
        assert!(slot.close(end_it, LIMIT));
        assert_eq!(stopped, ["a"]);
        drop(send);
        assert_eq!(began.iter().collect::<Vec<_>>(), ["a"]);
    }
}
