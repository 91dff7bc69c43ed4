//! Where a run's pictures and events go.

use crate::geometry::Angle;
use crate::rig::Frame;
use crate::session::event::{CapturedView, Happening};
use crate::session::picture::{Size, probe};
use crate::session::{PlannedView, Session, SessionError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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

/// Keeps a run's pictures and events.
pub trait FrameSink {
    /// The run begins, or goes on: says so to whoever listens, and returns what an earlier run has captured.
    ///
    /// # Errors
    /// [`SessionError`] where the sink cannot keep anything.
    fn begin(&mut self) -> Result<Earlier, SessionError>;
    /// Looks at a whole picture before it is kept. Takes as long as finding the grain in it does.
    ///
    /// # Errors
    /// Why it is to be taken again: value, unit, limit and remedy.
    fn examine(&mut self, _view: &PlannedView, _reached: Angle, _frame: &Frame) -> Result<(), String> {
        Ok(())
    }
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

/// Looks at a picture before it is kept.
type Examine<'a> = dyn FnMut(&PlannedView, Angle, &Frame) -> Result<(), String> + 'a;

/// Keeps pictures and events in a session and passes each durable picture on.
pub struct SessionSink<'a, F> {
    session: Arc<Mutex<Session>>,
    forward: F,
    examine: Option<Box<Examine<'a>>>,
}

impl<'a, F: FnMut(CapturedView, Frame)> SessionSink<'a, F> {
    /// A sink into `session`; `forward` gets each picture once it is durable. It may block (a bounded
    /// channel): the session is not locked meanwhile.
    pub fn new(session: Arc<Mutex<Session>>, forward: F) -> Self {
        Self { session, forward, examine: None }
    }

    /// The same sink with somebody who looks at each picture before it is kept.
    #[must_use]
    pub fn with_gate(
        mut self,
        examine: impl FnMut(&PlannedView, Angle, &Frame) -> Result<(), String> + 'a,
    ) -> Self {
        self.examine = Some(Box::new(examine));
        self
    }

    fn session(&self) -> MutexGuard<'_, Session> {
        // A session that panicked in mid-append is on the disk as far as its journal says.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<F: FnMut(CapturedView, Frame)> FrameSink for SessionSink<'_, F> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        let mut session = self.session();
        let recording = session.recording();
        let captured: Vec<usize> = recording.views().map(|v| v.view).collect();
        // A picture that has changed on the disk since must not pass for evidence: its hash is checked here.
        let size = match captured.first() {
            Some(&view) => probe(&recording.frame(view)?.bytes, None).ok().map(|(_, size)| size),
            None => None,
        };
        let stands_deg = recording.events().iter().rev().find_map(|event| match event.what {
            Happening::Moving { target_deg, .. } => Some(target_deg),
            _ => None,
        });
        let what = Happening::Started {
            session: recording.manifest().name.clone(),
            views: recording.manifest().plan.views.len(),
            already_captured: captured.len(),
        };
        session.append(what)?;
        Ok(Earlier { captured, size, stands_deg })
    }

    fn examine(&mut self, view: &PlannedView, reached: Angle, frame: &Frame) -> Result<(), String> {
        self.examine.as_mut().map_or(Ok(()), |examine| examine(view, reached, frame))
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
