//! One run: the state machine that [`Phase`] draws.

use super::clock::Clock;
use super::control::{Control, Phase};
use super::error::AcquireError;
use super::sink::{FrameSink, StoreOutcome};
use crate::rig::{Camera, Frame, RigError, RotationStage};
use crate::session::event::EventKind;
use crate::session::picture::{Size, probe};
use crate::session::{Plan, PlannedView, as_recorded};
use grainrig_core::geometry::Angle;
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;
use tracing::{Span, debug, debug_span};

/// How a run ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All views of the plan are durable.
    Complete {
        /// Views that this run captured; the others were there before.
        captured: usize,
    },
    /// Somebody stopped the run.
    Aborted {
        /// Views that this run captured.
        captured: usize,
    },
}

/// Captures the views of a plan that the sink does not have yet; blocks until the run ends.
///
/// # Errors
/// [`AcquireError`] with cause and remedy. What was captured stays: another run with the same sink goes on.
pub fn run(
    stage: &mut dyn RotationStage,
    camera: &mut dyn Camera,
    plan: &Plan,
    sink: &mut dyn FrameSink,
    control: &Control,
    clock: &dyn Clock,
) -> Result<Outcome, AcquireError> {
    let mut run = Run {
        stage,
        camera,
        plan,
        sink,
        control,
        clock,
        missing: VecDeque::new(),
        size: None,
        stands: None,
        held: None,
        then: None,
        bad: 0,
        unfit: None,
        captured: 0,
        began: None,
        left_at: None,
        retry: None,
    };
    let mut phase = Phase::Idle;
    loop {
        control.enter(phase);
        let next = match phase {
            Phase::Complete => return Ok(Outcome::Complete { captured: run.captured }),
            Phase::Aborted => return Ok(Outcome::Aborted { captured: run.captured }),
            _ => run.span(phase).in_scope(|| {
                run.checkpoint(phase).and_then(|stop| stop.map_or_else(|| run.announce(phase), Ok))
            }),
        };
        phase = match next {
            Ok(phase) => phase,
            Err(error) => {
                // A picture in hand is kept whatever ends the run. Where it can't be, that is what ended it: it would
                // have, had the stage waited.
                let error = run.settle().err().unwrap_or(error);
                // Where the disk is what failed, this cannot be journalled; the error still reaches the caller.
                let _ = run.sink.event(EventKind::Failed { error: error.to_string() });
                control.enter(Phase::Failed);
                return Err(error);
            }
        };
    }
}

/// A view that the stage stands at.
struct Stands {
    view: usize,
    /// Where the stage says it is.
    reached: Angle,
    /// Since when nothing has moved.
    since: Duration,
}

/// A picture on its way from the camera to the disk.
struct Held<'a> {
    view: &'a PlannedView,
    reached: Angle,
    size: Size,
    /// Pictures of this view that were bad before it.
    bad: u32,
    /// The picture, until the sink has it.
    frame: Option<Frame>,
}

/// Why a view is to be taken again.
struct Refused {
    view: usize,
    cause: String,
}

struct Run<'a> {
    stage: &'a mut dyn RotationStage,
    camera: &'a mut dyn Camera,
    plan: &'a Plan,
    sink: &'a mut dyn FrameSink,
    control: &'a Control,
    clock: &'a dyn Clock,
    /// Views still to be captured, in order; the first is the one at work.
    missing: VecDeque<&'a PlannedView>,
    /// Size of the pictures, from the first one on.
    size: Option<Size>,
    /// Where the stage stands, unless it is on its way.
    stands: Option<Stands>,
    /// The picture of which it is not known yet whether it was stored.
    held: Option<Held<'a>>,
    /// The phase after [`Phase::Storing`]; the next view's where there is none.
    then: Option<Phase>,
    /// Pictures of the view at work that were bad.
    bad: u32,
    /// Why the run is to be suspended once the stage stands at the view at work.
    unfit: Option<String>,
    /// Views captured by this run.
    captured: usize,
    /// When the first view began, moved on by the time that the run was paused since.
    began: Option<Duration>,
    /// Where an earlier run has sent the stage.
    left_at: Option<Angle>,
    /// After how long a run that waits for its camera goes on by itself.
    retry: Option<Duration>,
}

impl Run<'_> {
    /// Before each step: waits while the run is paused; `Some(Aborted)` where it was aborted. A picture in hand is
    /// stored before either. Not before the first step: what begins the run is its first event.
    fn checkpoint(&mut self, phase: Phase) -> Result<Option<Phase>, AcquireError> {
        if matches!(phase, Phase::Idle | Phase::Storing { .. }) {
            return Ok(None);
        }
        if let Some(held) = &self.held
            && (self.control.is_pausing() || self.control.is_aborting())
        {
            self.then = Some(phase);
            return Ok(Some(Phase::Storing { view: held.view.index }));
        }
        if self.control.is_pausing() {
            let from = self.clock.now();
            self.sink.event(EventKind::Paused)?;
            self.control.enter(Phase::Paused);
            self.control.wait_while_paused(self.retry.take());
            if !self.control.is_aborting() {
                self.sink.event(EventKind::Resumed)?;
                self.control.enter(phase);
            }
            let now = self.clock.now();
            self.began = self.began.map(|t| t + now.saturating_sub(from));
            // Somebody may have touched it.
            if let Some(stands) = &mut self.stands {
                stands.since = now;
            }
        }
        if self.control.is_aborting() {
            self.sink.event(EventKind::Aborted)?;
            return Ok(Some(Phase::Aborted));
        }
        Ok(None)
    }

    /// What the log's lines of a phase have in common: its view.
    fn span(&self, phase: Phase) -> Span {
        let Some(index) = phase.view() else { return Span::none() };
        let angle_deg = self.plan.views.iter().find(|v| v.index == index).map(|v| v.angle_deg);
        debug_span!("view", index, angle_deg)
    }

    /// Does a phase's work, and has the log tell of it.
    fn announce(&mut self, phase: Phase) -> Result<Phase, AcquireError> {
        let from = self.clock.now();
        let next = self.step(phase);
        let ms = self.clock.now().saturating_sub(from).as_micros() as f64 / 1e3;
        match &next {
            Ok(_) => debug!(ms, ?phase, outcome = "done", "{}", phase.name()),
            Err(error) => debug!(ms, ?phase, outcome = "failed", %error, "{}", phase.name()),
        }
        next
    }

    /// Does a phase's work; the phase that follows.
    fn step(&mut self, phase: Phase) -> Result<Phase, AcquireError> {
        Ok(match phase {
            Phase::Idle => {
                let earlier = self.sink.begin()?;
                let there: BTreeSet<usize> = earlier.captured.into_iter().collect();
                self.missing = self.plan.views.iter().filter(|v| !there.contains(&v.index)).collect();
                self.size = earlier.size;
                self.left_at = earlier.stands_deg.map(Angle::from_deg);
                if self.missing.is_empty() { self.complete()? } else { Phase::Homing }
            }
            Phase::Homing => {
                let homed = match self.left_at.take() {
                    Some(stands) => self.stage.take_up(stands),
                    None => self.stage.home(),
                };
                homed.map_err(AcquireError::Home)?;
                self.sink.event(EventKind::Homed)?;
                self.next_view()?
            }
            Phase::Moving { view } => {
                if let Some(planned) = self.missing.front() {
                    self.go_to(view, planned.angle_deg)?;
                }
                let settling = Phase::Settling { view };
                match &self.held {
                    None => settling,
                    Some(held) => {
                        self.then = Some(settling);
                        Phase::Storing { view: held.view.index }
                    }
                }
            }
            Phase::Settling { view } => {
                let now = self.clock.now();
                let rested = self.stands.as_ref().map_or(Duration::ZERO, |s| now.saturating_sub(s.since));
                let settle = Duration::from_millis(self.plan.settle_ms);
                self.clock.wait(settle.saturating_sub(rested), self.control);
                Phase::Exposing { view, bad: self.bad }
            }
            Phase::Exposing { view, bad } => match self.unfit.take() {
                // Whoever watches mends it and lets the run go on: with this view, and all its tries.
                Some(cause) => self.suspend(view, cause)?,
                None => self.expose(view, bad)?,
            },
            Phase::Storing { .. } => self.store()?,
            Phase::Paused | Phase::Complete | Phase::Aborted | Phase::Failed => phase,
        })
    }

    fn next_view(&mut self) -> Result<Phase, AcquireError> {
        self.began.get_or_insert(self.clock.now());
        match (self.missing.front(), &self.held) {
            (Some(v), _) => Ok(Phase::Moving { view: v.index }),
            // Nowhere to go while the last picture is looked at.
            (None, Some(held)) => Ok(Phase::Storing { view: held.view.index }),
            (None, None) => self.complete(),
        }
    }

    fn complete(&mut self) -> Result<Phase, AcquireError> {
        self.sink.event(EventKind::AcquisitionComplete { views: self.plan.views.len() })?;
        Ok(Phase::Complete)
    }

    /// Turns to a view; the picture before it is looked at and stored meanwhile. Its event comes first: the journal's
    /// order does not depend on what takes longer.
    fn go_to(&mut self, view: usize, commanded_deg: f64) -> Result<(), AcquireError> {
        self.sink.event(EventKind::Moving { view, target_deg: commanded_deg })?;
        self.offer();
        self.stands = None;
        let target = Angle::from_deg(commanded_deg);
        let reached = self.stage.move_to(target).map_err(|source| AcquireError::Stage { view, source })?;
        // From here on there is only the angle that the record will have: what a run judges by, a replay judges by too.
        let reached = as_recorded(reached);
        let reached_deg = reached.deg();
        let tolerance_deg = self.plan.tolerance_deg;
        // Written so that a reading which is no number is a miss.
        if (reached_deg - commanded_deg).abs() <= tolerance_deg {
            self.stands = Some(Stands { view, reached, since: self.clock.now() });
            Ok(())
        } else {
            Err(AcquireError::Missed { view, commanded_deg, reached_deg, tolerance_deg })
        }
    }

    fn expose(&mut self, view: usize, bad: u32) -> Result<Phase, AcquireError> {
        let mut frame = match self.camera.capture() {
            Ok(frame) => frame,
            Err(source) => return self.no_picture(view, source),
        };
        let (encoding, size) = match probe(&frame.bytes, self.size) {
            Ok(found) => found,
            Err(fault) => {
                if let Some(planned) = self.missing.front() {
                    self.sink.refused(planned, &frame);
                }
                let tries = self.reject(view, bad, &fault.to_string())?;
                if tries > self.plan.retakes {
                    return Err(AcquireError::BadFrames { view, tries, fault });
                }
                return Ok(Phase::Exposing { view, bad: tries });
            }
        };
        // What the bytes are counts, not what the driver takes them for.
        frame.encoding = encoding;
        if let (Some(stands), Some(view)) = (&self.stands, self.missing.pop_front()) {
            self.held = Some(Held { view, reached: stands.reached, size, bad, frame: Some(frame) });
        }
        self.next_view()
    }

    /// The camera gave no picture. A run that is attended waits until somebody lets it go on or it is time to try again.
    fn no_picture(&mut self, view: usize, source: RigError) -> Result<Phase, AcquireError> {
        match source {
            RigError::Suspended { retry, .. } if self.control.is_attended() => {
                self.retry = Some(retry);
                self.suspend(view, source.to_string())
            }
            source => Err(AcquireError::Camera { view, source }),
        }
    }

    /// The run waits, and goes on with this view and all its tries.
    fn suspend(&mut self, view: usize, cause: String) -> Result<Phase, AcquireError> {
        self.sink.event(EventKind::Suspended { view, cause })?;
        self.control.pause();
        self.bad = 0;
        Ok(Phase::Exposing { view, bad: 0 })
    }

    /// A picture is no use: journalled with its cause. Pictures of this view so far.
    fn reject(&mut self, view: usize, bad: u32, cause: &str) -> Result<u32, AcquireError> {
        let tries = bad + 1;
        self.sink.event(EventKind::Rejected { view, tries: Some(tries), cause: cause.to_owned() })?;
        Ok(tries)
    }

    /// Hands the picture in hand to the sink, unless it has it.
    fn offer(&mut self) {
        if let Some(held) = &mut self.held
            && let Some(frame) = held.frame.take()
        {
            let busy = self.began.map(|t| self.clock.now().saturating_sub(t).as_secs_f64());
            let remaining_s = busy.map(|s| s / (self.captured + 1) as f64 * self.missing.len() as f64);
            self.sink.offer(held.view, held.reached, frame, remaining_s);
        }
    }

    /// Waits until the picture in hand, where there is one, is durable or refused.
    fn settle(&mut self) -> Result<Option<Refused>, AcquireError> {
        self.offer();
        let Some(held) = self.held.take() else { return Ok(None) };
        let view = held.view.index;
        match self.sink.outcome()? {
            StoreOutcome::Kept => {
                self.captured += 1;
                self.size = Some(held.size);
                self.bad = 0;
                self.camera.kept();
                Ok(None)
            }
            StoreOutcome::Refused(cause) => {
                self.missing.push_front(held.view);
                self.bad = self.reject(view, held.bad, &cause)?;
                Ok(Some(Refused { view, cause }))
            }
        }
    }

    /// Waits for the picture in hand. Where it is refused the stage goes back, and it is taken again.
    fn store(&mut self) -> Result<Phase, AcquireError> {
        let then = self.then.take();
        let Some(Refused { view, cause }) = self.settle()? else {
            return then.map_or_else(|| self.next_view(), Ok);
        };
        if self.bad > self.plan.retakes {
            if !self.control.is_attended() {
                return Err(AcquireError::Unfit { view, tries: self.bad, cause });
            }
            self.unfit = Some(cause);
        }
        let is_there = self.stands.as_ref().is_some_and(|s| s.view == view);
        Ok(if is_there { Phase::Exposing { view, bad: self.bad } } else { Phase::Moving { view } })
    }
}
