//! Time, injected: a test's run takes none.

use super::control::Control;
use std::time::{Duration, Instant};

/// Time as a run sees it.
pub trait Clock: Sync {
    /// Time since some fixed instant; never goes back.
    fn now(&self) -> Duration;
    /// Waits; returns earlier where the run is aborted.
    fn wait(&self, time: Duration, control: &Control);
}

/// The computer's clock.
#[derive(Debug, Clone, Copy)]
pub struct SystemClock {
    start: Instant,
}

impl SystemClock {
    /// A clock that starts at 0 now.
    pub fn new() -> Self {
        Self { start: Instant::now() }
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Duration {
        self.start.elapsed()
    }
    fn wait(&self, time: Duration, control: &Control) {
        control.wait_for_abort(time);
    }
}
