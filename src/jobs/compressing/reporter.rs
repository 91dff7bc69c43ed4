//! What those who watch a compression are told, and how often.

use super::CompressProgress;
use crate::jobs::BackgroundWatcher;
use crate::session::event::{self, CompressionState, CompressionUpdate};
use grainrig_core::contact::CurvePoint;
use std::time::{Duration, Instant};

/// Progress is told no more often: the feed keeps a number of events, and a capture's are among them.
const EACH: Duration = Duration::from_millis(500);

/// Tells the watcher of one compression.
pub(super) struct CompressionReporter {
    watcher: BackgroundWatcher,
    /// What is told next; `points` gathers what is new.
    next: CompressionUpdate,
    told: Option<Instant>,
}

impl CompressionReporter {
    pub(super) fn new(session: &str, name: &str, watcher: BackgroundWatcher) -> Self {
        let next = CompressionUpdate {
            session: session.into(),
            name: name.into(),
            state: CompressionState::Meshing,
            phase: None,
            done: 0.0,
            left_s: None,
            contacts: 0,
            from: 0,
            points: Vec::new(),
            error: None,
        };
        Self { watcher, next, told: None }
    }

    /// What is done before the plates move, and how much of that is done, 0 to 1; the next thing is told at once.
    pub(super) fn setting_up(&mut self, phase: &str, done: f64) {
        self.next.done = done;
        if self.next.phase.as_deref() == Some(phase) {
            self.tell_in_time();
        } else {
            self.next.phase = Some(phase.into());
            self.tell();
        }
    }

    /// The plates begin to move, or go on, with this much done and this curve.
    pub(super) fn running(&mut self, done: f64, curve: Vec<CurvePoint>) {
        self.next.state = CompressionState::Running;
        self.next.phase = None;
        self.next.done = done;
        self.next.points = curve;
        self.tell();
        // The first sample is told at once: it shows that the plates move.
        self.told = None;
    }

    pub(super) fn sampled(&mut self, progress: &CompressProgress) {
        self.next.done = progress.done;
        self.next.left_s = progress.left_s;
        self.next.contacts = progress.sample.touches.len();
        self.next.points.push(progress.sample.into());
        self.tell_in_time();
    }

    pub(super) fn ended(&mut self, state: CompressionState, error: Option<String>) {
        self.next.state = state;
        self.next.phase = None;
        self.next.left_s = None;
        self.next.error = error;
        self.tell();
    }

    fn tell_in_time(&mut self) {
        if self.told.is_none_or(|told| told.elapsed() >= EACH) {
            self.tell();
        }
    }

    fn tell(&mut self) {
        (self.watcher)(event::BackgroundEvent::Compression(self.next.clone()));
        self.next.from += self.next.points.len();
        self.next.points.clear();
        self.told = Some(Instant::now());
    }
}
