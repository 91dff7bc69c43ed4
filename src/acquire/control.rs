//! The handle by which others steer and watch a run.

use serde::Serialize;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Where a run stands.
///
/// ```text
///  Idle ──▶ Homing ──▶ Moving ──▶ Storing ──▶ Settling ──▶ Exposing ──▶ Storing ──▶ Complete
///    │                  ▲  ▲        │ the view before       │  │ ▲        the last     ▲
///    │                  │  └────────┘ where it is refused    │  └─┘ bad picture,       │
///    │                  └─────────────── next view ──────────┘      taken again        │
///    └───────────────────────────── nothing missing ───────────────────────────────────┘
///
///                      Paused        between any two of the above but Storing and what is before it, and back
///
///  any of the above ──abort──▶ Aborted        any of the above ──error──▶ Failed
/// ```
///
/// The picture of a view is looked at and made durable while the stage turns to the next one; what becomes of it is
/// waited for there (Storing names the view before), so it is known before the next exposure. Where it is refused
/// the stage goes back and the view is taken again. The last view's picture is waited for where it was taken.
///
/// A view of which every picture was no good suspends a run that is attended: back at this view it pauses, and goes on
/// with it. One that nobody attends fails. So it is with a camera that gives no picture, but that the run tries it again
/// by itself after a while.
///
/// A whole picture is stored before a run pauses, is aborted or fails. Aborted and failed runs keep what is
/// captured; a new run goes on with the missing views, from Idle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(tag = "phase", rename_all = "snake_case")]
pub enum Phase {
    /// Not begun.
    #[default]
    Idle,
    /// The stage looks for its reference.
    Homing,
    /// The stage goes to a view's angle.
    Moving {
        /// The view's index.
        view: usize,
    },
    /// The grain comes to rest.
    Settling {
        /// The view's index.
        view: usize,
    },
    /// The camera takes a picture.
    Exposing {
        /// The view's index.
        view: usize,
        /// Pictures of this view that were bad.
        bad: u32,
    },
    /// A picture is looked at and made durable.
    Storing {
        /// The view's index.
        view: usize,
    },
    /// Waits for `resume` or `abort`.
    Paused,
    /// All views are captured.
    Complete,
    /// Somebody stopped the run.
    Aborted,
    /// The run failed.
    Failed,
}

impl Phase {
    /// The view that it is about.
    pub const fn view(self) -> Option<usize> {
        match self {
            Self::Moving { view }
            | Self::Settling { view }
            | Self::Exposing { view, .. }
            | Self::Storing { view } => Some(view),
            _ => None,
        }
    }

    /// What is done in it, in one word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "begin",
            Self::Homing => "home",
            Self::Moving { .. } => "move",
            Self::Settling { .. } => "settle",
            Self::Exposing { .. } => "expose",
            Self::Storing { .. } => "wait until the picture is stored or refused",
            Self::Paused => "pause",
            Self::Complete => "complete",
            Self::Aborted => "abort",
            Self::Failed => "fail",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Wish {
    #[default]
    Go,
    Pause,
    Abort,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<(Wish, Phase)>,
    changed: Condvar,
}

/// Steers and watches one run from any thread; clones steer the same run.
#[derive(Debug, Clone, Default)]
pub struct Control {
    shared: Arc<Shared>,
    attended: bool,
}

impl Control {
    /// A control whose run may go.
    pub fn new() -> Self {
        Self::default()
    }

    /// A control whose run may go, and waits for somebody where it can't go on by itself.
    pub fn attended() -> Self {
        Self { attended: true, ..Self::default() }
    }

    /// Whether there is somebody who can let a suspended run go on.
    pub fn is_attended(&self) -> bool {
        self.attended
    }

    fn lock(&self) -> MutexGuard<'_, (Wish, Phase)> {
        // The pair is consistent after any panic.
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wish(&self, wish: Wish) {
        let mut state = self.lock();
        // An abort is final.
        if state.0 != Wish::Abort {
            state.0 = wish;
            self.shared.changed.notify_all();
        }
    }

    /// The run stops before its next step and waits.
    pub fn pause(&self) {
        self.wish(Wish::Pause);
    }
    /// A paused run goes on.
    pub fn resume(&self) {
        self.wish(Wish::Go);
    }
    /// The run ends before its next step, for good.
    pub fn abort(&self) {
        self.wish(Wish::Abort);
    }
    /// Where the run stands.
    pub fn phase(&self) -> Phase {
        self.lock().1
    }

    pub(super) fn enter(&self, phase: Phase) {
        self.lock().1 = phase;
        self.shared.changed.notify_all();
    }

    /// Waits until the run has reached a phase that `is_it` accepts, or has ended; the phase.
    pub fn wait_for(&self, is_it: impl Fn(Phase) -> bool) -> Phase {
        let ended = |p| matches!(p, Phase::Complete | Phase::Aborted | Phase::Failed);
        let waits = |s: &mut (Wish, Phase)| !is_it(s.1) && !ended(s.1);
        let state = self.shared.changed.wait_while(self.lock(), waits);
        state.unwrap_or_else(PoisonError::into_inner).1
    }

    /// Whether the run is paused, or will be before its next step.
    pub fn is_pausing(&self) -> bool {
        self.lock().0 == Wish::Pause
    }

    /// Whether the run is aborted, or will be before its next step.
    pub fn is_aborting(&self) -> bool {
        self.lock().0 == Wish::Abort
    }

    /// Waits until the run may go on, or is aborted; where there is a limit, it may go on after that.
    pub(super) fn wait_while_paused(&self, limit: Option<Duration>) {
        let (state, paused) = (self.lock(), |s: &mut (Wish, Phase)| s.0 == Wish::Pause);
        let Some(limit) = limit else {
            let state = self.shared.changed.wait_while(state, paused);
            drop(state.unwrap_or_else(PoisonError::into_inner));
            return;
        };
        let waited = self.shared.changed.wait_timeout_while(state, limit, paused);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if state.0 == Wish::Pause {
            state.0 = Wish::Go;
        }
    }

    /// Waits for an abort, `time` at most.
    pub(super) fn wait_for_abort(&self, time: Duration) {
        let waited = self.shared.changed.wait_timeout_while(self.lock(), time, |s| s.0 != Wish::Abort);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }
}
