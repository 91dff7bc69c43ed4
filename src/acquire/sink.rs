//! Where a run's pictures and events go.

use crate::rig::Frame;
use crate::session::event::{CapturedView, EventKind};
use crate::session::picture::{Size, probe};
use crate::session::{PlannedView, Session, SessionError};
use crate::trace::ms_since;
use grainrig_core::geometry::Angle;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Instant;
use tracing::{Span, debug, debug_span};

/// What an earlier run has captured.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Earlier {
    /// Indices of the views that are durable.
    pub captured: Vec<usize>,
    /// Size of their pictures.
    pub size: Option<Size>,
    /// Where the stage was sent last, degrees.
    pub stands_deg: Option<f64>,
}

/// What becomes of a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StoreOutcome {
    /// It is durable.
    Kept,
    /// It is not kept and is to be taken again: value, unit, limit and remedy.
    Refused(String),
}

/// Keeps a run's pictures and events.
pub trait FrameSink {
    /// The run begins, or goes on: says so to whoever listens, and returns what an earlier run has captured.
    ///
    /// # Errors
    /// [`SessionError`] where the sink cannot keep anything.
    fn begin(&mut self) -> Result<Earlier, SessionError>;
    /// Begins to look at a whole picture and to make it durable, which may go on behind while the stage turns. The
    /// next thing that is asked of the sink is its [`outcome`](Self::outcome).
    fn offer(&mut self, view: &PlannedView, reached: Angle, frame: Frame, remaining_s: Option<f64>);
    /// Waits for what becomes of the picture that was offered.
    ///
    /// # Errors
    /// [`SessionError`] where it is good but not durable.
    fn outcome(&mut self) -> Result<StoreOutcome, SessionError>;
    /// A picture is no whole picture, or not like the others: it may be kept for whoever looks for the cause.
    fn refused(&mut self, view: &PlannedView, frame: &Frame) {
        let _ = (view, frame);
    }
    /// Something else happened.
    ///
    /// # Errors
    /// [`SessionError`] where it cannot be recorded.
    fn event(&mut self, what: EventKind) -> Result<(), SessionError>;
}

/// Looks at pictures before they are kept and takes those that are.
pub trait Judge: Send {
    /// What it works out about a picture, for [`Judge::kept`].
    type Seen;
    /// Looks at a whole picture before it is kept. The angle is the one that the record will have.
    ///
    /// # Errors
    /// Why it is to be taken again: value, unit, limit and remedy.
    fn examine(&mut self, view: &PlannedView, reached: Angle, frame: &Frame) -> Result<Self::Seen, String>;
    /// A picture is durable and its verdict is told. This may block (a bounded channel): the session is not locked
    /// meanwhile, and only the next picture waits.
    fn kept(&mut self, view: CapturedView, frame: Frame, seen: Self::Seen);
}

/// A picture on its way to the thread that keeps it.
struct Offered {
    view: PlannedView,
    reached: Angle,
    frame: Frame,
    remaining_s: Option<f64>,
}

/// Keeps pictures and events in a session. Pictures are judged and made durable on a thread of their own.
pub struct SessionSink<'scope> {
    session: Arc<Mutex<Session>>,
    offers: SyncSender<Offered>,
    outcomes: Receiver<Result<StoreOutcome, SessionError>>,
    /// Ends with `offers`.
    keeper: Option<ScopedJoinHandle<'scope, ()>>,
    /// A picture was offered of which nothing has been heard.
    waits: bool,
}

impl<'scope> SessionSink<'scope> {
    /// A sink into `session`; its thread lives in `scope` and ends when the sink is dropped.
    pub fn new(
        scope: &'scope Scope<'scope, '_>,
        session: Arc<Mutex<Session>>,
        judge: impl Judge + 'scope,
    ) -> Self {
        // One picture may wait while the judge passes the one before on.
        let (offers, offered) = sync_channel(1);
        let (tell, outcomes) = channel();
        let keeps = Arc::clone(&session);
        let span = Span::current();
        let keeper = scope.spawn(move || span.in_scope(|| keep(&keeps, judge, &offered, &tell)));
        Self { session, offers, outcomes, keeper: Some(keeper), waits: false }
    }
}

/// A session that panicked in mid-append is on the disk as far as its journal says.
fn lock(session: &Mutex<Session>) -> MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Judges each picture that is offered, makes it durable and tells of it, until none comes any more.
fn keep(
    session: &Mutex<Session>,
    mut judge: impl Judge,
    offered: &Receiver<Offered>,
    tell: &Sender<Result<StoreOutcome, SessionError>>,
) {
    for Offered { view, reached, frame, remaining_s } in offered {
        let _within = debug_span!("view", index = view.index, angle_deg = view.angle_deg).entered();
        let begun = Instant::now();
        let (outcome, captured) = match judge.examine(&view, reached, &frame) {
            Err(cause) => {
                debug!(ms = ms_since(begun), outcome = "refused", cause, "store");
                keep_rejected(session, &view, &frame);
                (Ok(StoreOutcome::Refused(cause)), None)
            }
            Ok(seen) => match lock(session).record_frame(view.index, reached, &frame, remaining_s) {
                Ok(captured) => {
                    debug!(ms = ms_since(begun), outcome = "kept", file = captured.file, "store");
                    (Ok(StoreOutcome::Kept), Some((captured, seen)))
                }
                Err(error) => {
                    debug!(ms = ms_since(begun), outcome = "failed", %error, "store");
                    (Err(error), None)
                }
            },
        };
        // Where the run is gone nobody wants to know; the picture is kept all the same.
        let _ = tell.send(outcome);
        if let Some((captured, seen)) = captured {
            judge.kept(captured, frame, seen);
        }
    }
}

/// A picture that is no evidence ends no run where it can't be kept.
fn keep_rejected(session: &Mutex<Session>, view: &PlannedView, frame: &Frame) {
    if frame.bytes.is_empty() {
        return;
    }
    if let Err(error) = lock(session).keep_rejected(view.index, frame) {
        tracing::warn!("the refused picture of view {} is not kept: {error}", view.index);
    }
}

impl FrameSink for SessionSink<'_> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        let mut session = lock(&self.session);
        let recording = session.recording();
        let captured: Vec<usize> = recording.views().map(|v| v.view).collect();
        // A picture that has changed on the disk since must not pass for evidence: its hash is checked here.
        let size = match captured.first() {
            Some(&view) => probe(&recording.frame(view)?.bytes, None).ok().map(|(_, size)| size),
            None => None,
        };
        let stands_deg = recording.events().iter().rev().find_map(|event| match event.what {
            EventKind::Moving { target_deg, .. } => Some(target_deg),
            _ => None,
        });
        let what = EventKind::Started {
            session: recording.manifest().name.clone(),
            views: recording.manifest().plan.views.len(),
            already_captured: captured.len(),
        };
        session.append(what)?;
        Ok(Earlier { captured, size, stands_deg })
    }

    fn offer(&mut self, view: &PlannedView, reached: Angle, frame: Frame, remaining_s: Option<f64>) {
        // A thread that takes nothing any more has panicked: the verdict says so.
        self.waits = true;
        let _ = self.offers.send(Offered { view: view.clone(), reached, frame, remaining_s });
    }

    fn outcome(&mut self) -> Result<StoreOutcome, SessionError> {
        let unheard = |reason: &str| SessionError::Unrecordable { reason: reason.to_owned() };
        if !std::mem::take(&mut self.waits) {
            return Err(unheard("a verdict was asked for on no picture"));
        }
        if let Ok(outcome) = self.outcomes.recv() {
            return outcome;
        }
        // As if it had happened here.
        match self.keeper.take().map(ScopedJoinHandle::join) {
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            _ => Err(unheard("the thread that keeps pictures has ended")),
        }
    }

    fn refused(&mut self, view: &PlannedView, frame: &Frame) {
        keep_rejected(&self.session, view, frame);
    }

    fn event(&mut self, what: EventKind) -> Result<(), SessionError> {
        lock(&self.session).append(what).map(|_| ())
    }
}
