//! The event feed: what happened, numbered, kept for a while, and handed to whoever watches.
//!
//! ```text
//!  push ──▶ ┌───────────── kept, at most `keep` ─────────────┐
//!           │ oldest │ … │ next of a slow reader │ … │ newest │ ──▶ wakes the readers
//!           └─────────────────────────────────────────────────┘
//! ```
//!
//! A reader is only a number: the next event it wants. So nothing is queued for it, it cannot hold up
//! the run, and it cannot see a gap: when its event has fallen out of the log, its subscription ends
//! and it must come back for a snapshot.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use jiff::Timestamp;
use tokio::sync::watch;

use super::status::Status;
use crate::session::event::{Event, FeedEvent};

/// How many events the daemon keeps: about thirty runs of 25 views.
pub const KEPT_EVENTS: NonZeroUsize = NonZeroUsize::new(4096).unwrap();

/// An append-only, bounded log of events with consecutive numbers; a clone is another handle on it.
#[derive(Debug, Clone)]
pub struct EventFeed {
    log: Arc<Mutex<Log>>,
    /// Number of the newest event; readers wait on it. Changed only under the log's lock, so it never
    /// goes back.
    newest: watch::Sender<u64>,
}

#[derive(Debug)]
struct Log {
    next: u64,
    kept: VecDeque<Arc<Event<FeedEvent>>>,
    keep: NonZeroUsize,
    status: Status,
}

/// What a reader must know before the first event it is given.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Number of the last event that `status` contains.
    pub seq: u64,
    /// Where the run stood after that event.
    pub status: Status,
}

/// One reader of the feed; see [`EventFeed::subscribe`].
#[derive(Debug)]
pub struct Subscription {
    feed: EventFeed,
    next: u64,
    newest: watch::Receiver<u64>,
}

impl EventFeed {
    /// An empty feed whose first event will have the number `first`, and which keeps the last `keep`.
    ///
    /// The daemon passes its start in Unix seconds × 1 000 000, so that numbers do not come again after
    /// a restart, and a browser (whose integers end at 2^53) still reads them exactly.
    ///
    /// # Panics
    /// If `first` is 0: there must be a number for "nothing happened yet".
    pub fn new(first: u64, keep: NonZeroUsize) -> Self {
        assert!(first > 0, "the first event's number is at least 1");
        let log = Log { next: first, kept: VecDeque::new(), keep, status: Status::default() };
        Self { log: Arc::new(Mutex::new(log)), newest: watch::Sender::new(first - 1) }
    }

    /// Appends what happened at `time` and wakes the readers; returns it with its number. Never waits
    /// for a reader.
    pub fn push(&self, what: impl Into<FeedEvent>, time: Timestamp) -> Event<FeedEvent> {
        let mut log = self.lock();
        let event = Event { seq: log.next, time, what: what.into() };
        log.status.apply(&event.what);
        if log.kept.len() == log.keep.get() {
            log.kept.pop_front();
        }
        log.kept.push_back(Arc::new(event.clone()));
        log.next += 1;
        self.newest.send_replace(event.seq);
        event
    }

    /// Where the run stands after the newest event.
    pub fn status(&self) -> Status {
        self.lock().status.clone()
    }

    /// Begins to read after the event `after`: every later event, each once.
    ///
    /// A snapshot comes with it where that is not possible: `after` is not given, is older than what is
    /// kept, or was never given out here (an earlier daemon's). The subscription then begins right
    /// after the snapshot.
    pub fn subscribe(&self, after: Option<u64>) -> (Option<Snapshot>, Subscription) {
        let log = self.lock();
        let oldest = log.next - log.kept.len() as u64;
        let next = after.and_then(|seq| seq.checked_add(1)).filter(|next| (oldest..=log.next).contains(next));
        let snapshot = match next {
            Some(_) => None,
            None => Some(Snapshot { seq: log.next - 1, status: log.status.clone() }),
        };
        let next = next.unwrap_or(log.next);
        (snapshot, Subscription { feed: self.clone(), next, newest: self.newest.subscribe() })
    }

    /// A pusher that panicked leaves the log whole enough to read, so poison is not passed on.
    fn lock(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Subscription {
    /// The next event, when it has happened; `None` when it has fallen out of the log because this
    /// reader was too slow. Dropping the future loses nothing.
    pub async fn next(&mut self) -> Option<Arc<Event<FeedEvent>>> {
        loop {
            // Marked as seen before the log is read: a push in between wakes us again.
            self.newest.borrow_and_update();
            {
                let log = self.feed.lock();
                if self.next < log.next {
                    let from_the_end = usize::try_from(log.next - self.next).ok()?;
                    let event = log.kept.get(log.kept.len().checked_sub(from_the_end)?)?;
                    self.next += 1;
                    return Some(Arc::clone(event));
                }
            }
            self.newest.changed().await.ok()?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::event::{BackgroundEvent, EventKind, JobKind, JobState, JobStatus};

    fn feed(first: u64, keep: usize) -> EventFeed {
        EventFeed::new(first, NonZeroUsize::new(keep).unwrap())
    }

    fn push(feed: &EventFeed, count: usize) {
        for view in 0..count {
            feed.push(EventKind::Moving { view, target_deg: 0.0 }, Timestamp::UNIX_EPOCH);
        }
    }

    #[test]
    fn what_goes_on_beside_a_run_is_told_as_a_runs_events_are_and_no_journal_reads_it() {
        let job = JobStatus {
            job: 1,
            kind: JobKind::Replay,
            session: "quartz".into(),
            name: None,
            state: JobState::Waiting,
            phase: None,
            done: 0.0,
            error: None,
        };
        let feed = feed(7, 4);
        let told = |event: &Event<FeedEvent>| serde_json::to_string(event).unwrap();
        let homed = feed.push(EventKind::Homed, Timestamp::UNIX_EPOCH);
        assert_eq!(told(&homed), r#"{"seq":7,"time":"1970-01-01T00:00:00Z","event":"homed"}"#);
        let queued = feed.push(BackgroundEvent::Job(job), Timestamp::UNIX_EPOCH);
        assert_eq!(
            told(&queued),
            r#"{"seq":8,"time":"1970-01-01T00:00:00Z","event":"job","job":1,"kind":"replay","session":"quartz","state":"waiting","done":0.0,"error":null}"#
        );
        assert!(serde_json::from_str::<Event>(&told(&homed)).is_ok());
        assert!(serde_json::from_str::<Event>(&told(&queued)).is_err());
    }

    #[tokio::test]
    async fn a_reader_gets_every_later_event_once() {
        let feed = feed(1_000_000, 16);
        push(&feed, 5);
        let (snapshot, mut reader) = feed.subscribe(Some(1_000_001));
        assert_eq!(snapshot, None);
        for seq in 1_000_002..=1_000_004 {
            assert_eq!(reader.next().await.unwrap().seq, seq);
        }
        push(&feed, 1);
        assert_eq!(reader.next().await.unwrap().seq, 1_000_005);
    }

    #[tokio::test]
    async fn an_unknown_number_gets_a_snapshot_and_what_follows_it() {
        let feed = feed(100, 3);
        // Nothing happened yet: the number before the first is known, others are not.
        assert_eq!(feed.subscribe(Some(99)).0, None);
        assert_eq!(feed.subscribe(None).0.unwrap().seq, 99);
        push(&feed, 10);
        // Kept are 107, 108, 109: a reader that has 106 misses none.
        assert_eq!(feed.subscribe(Some(106)).0, None);
        assert_eq!(feed.subscribe(Some(109)).0, None);
        for unknown in [None, Some(0), Some(105), Some(200), Some(u64::MAX)] {
            let (snapshot, mut reader) = feed.subscribe(unknown);
            let seq = snapshot.unwrap().seq;
            push(&feed, 1);
            assert_eq!(reader.next().await.unwrap().seq, seq + 1, "{unknown:?}");
            // Back to the same place for the next case.
            assert_eq!(feed.subscribe(Some(seq + 1)).0, None);
        }
    }

    #[tokio::test]
    async fn a_reader_that_is_too_slow_is_cut_off() {
        let feed = feed(1, 4);
        let (_, mut reader) = feed.subscribe(None);
        push(&feed, 4);
        assert_eq!(reader.next().await.unwrap().seq, 1);
        push(&feed, 4);
        assert_eq!(reader.next().await, None);
        // Coming back with the last number it saw, it is told where things stand now.
        assert_eq!(feed.subscribe(Some(1)).0.unwrap().seq, 8);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn concurrent_pushes_make_neither_gap_nor_repeat() {
        let feed = feed(7, 10_000);
        let (_, mut from_the_start) = feed.subscribe(None);
        let pushers: Vec<_> = (0..4)
            .map(|_| {
                let feed = feed.clone();
                std::thread::spawn(move || push(&feed, 500))
            })
            .collect();
        // A second reader drops out and comes back after every event, as a bad connection would.
        let reconnecting = {
            let feed = feed.clone();
            tokio::spawn(async move {
                let mut last = 6;
                while last < 2006 {
                    let (snapshot, mut reader) = feed.subscribe(Some(last));
                    assert_eq!(snapshot, None);
                    let seq = reader.next().await.unwrap().seq;
                    assert_eq!(seq, last + 1);
                    last = seq;
                }
            })
        };
        for seq in 7..2007 {
            assert_eq!(from_the_start.next().await.unwrap().seq, seq);
        }
        reconnecting.await.unwrap();
        for pusher in pushers {
            pusher.join().unwrap();
        }
    }

    #[test]
    fn a_snapshot_holds_exactly_the_events_up_to_its_number() {
        let feed = feed(1, 8);
        let pusher = {
            let feed = feed.clone();
            std::thread::spawn(move || {
                for views in 1..=2000 {
                    feed.push(EventKind::Hull { views, volume_mm3: None }, Timestamp::UNIX_EPOCH);
                }
            })
        };
        while !pusher.is_finished() {
            let snapshot = feed.subscribe(None).0.unwrap();
            let carved = snapshot.status.hull.last().map_or(0, |point| point.views);
            assert_eq!(carved as u64, snapshot.seq);
        }
        pusher.join().unwrap();
    }
}
