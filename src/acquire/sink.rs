//! Where a run's pictures and events go.

use crate::geometry::Angle;
use crate::rig::Frame;
use crate::session::event::{CapturedView, Happening};
use crate::session::picture::{Size, probe};
use crate::session::{PlannedView, Session, SessionError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What an earlier run has captured.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Earlier {
    /// Indices of the views that are durable.
    pub captured: Vec<usize>,
    /// Size of their pictures.
    pub size: Option<Size>,
}

/// Keeps a run's pictures and events.
pub trait FrameSink {
    /// The run begins, or goes on: says so to whoever listens, and returns what an earlier run has captured.
    ///
    /// # Errors
    /// [`SessionError`] where the sink cannot keep anything.
    fn begin(&mut self) -> Result<Earlier, SessionError>;
    /// Makes a picture durable and passes it on.
    ///
    /// # Errors
    /// [`SessionError`] where it is not durable.
    fn store(
        &mut self,
        view: &PlannedView,
        reached: Angle,
        frame: Frame,
        remaining_s: Option<f64>,
    ) -> Result<(), SessionError>;
    /// Something else happened.
    ///
    /// # Errors
    /// [`SessionError`] where it cannot be recorded.
    fn event(&mut self, what: Happening) -> Result<(), SessionError>;
}

/// Keeps pictures and events in a session and passes each durable picture on.
pub struct SessionSink<F> {
    session: Arc<Mutex<Session>>,
    forward: F,
}

impl<F: FnMut(CapturedView, Frame)> SessionSink<F> {
    /// A sink into `session`; `forward` gets each picture once it is durable. It may block (a bounded
    /// channel): the session is not locked meanwhile.
    pub fn new(session: Arc<Mutex<Session>>, forward: F) -> Self {
        Self { session, forward }
    }

    fn session(&self) -> MutexGuard<'_, Session> {
        // A session that panicked in mid-append is on the disk as far as its journal says.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<F: FnMut(CapturedView, Frame)> FrameSink for SessionSink<F> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        let mut session = self.session();
        let recording = session.recording();
        let captured: Vec<usize> = recording.views().map(|v| v.view).collect();
        // A picture that has changed on the disk since must not pass for evidence: its hash is checked here.
        let size = match captured.first() {
            Some(&view) => probe(&recording.frame(view)?.bytes, None).ok().map(|(_, size)| size),
            None => None,
        };
        let what = Happening::Started {
            session: recording.manifest().name.clone(),
            views: recording.manifest().plan.views.len(),
            already_captured: captured.len(),
        };
        session.append(what)?;
        Ok(Earlier { captured, size })
    }

    fn store(
        &mut self,
        view: &PlannedView,
        reached: Angle,
        frame: Frame,
        remaining_s: Option<f64>,
    ) -> Result<(), SessionError> {
        let captured = self.session().record_frame(view.index, reached, &frame, remaining_s)?;
        (self.forward)(captured, frame);
        Ok(())
    }

    fn event(&mut self, what: Happening) -> Result<(), SessionError> {
        self.session().append(what).map(|_| ())
    }
}
