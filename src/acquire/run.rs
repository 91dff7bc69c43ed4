//! One run: the state machine that [`Phase`] draws.

use super::clock::Clock;
use super::control::{Control, Phase};
use super::error::AcquireError;
use super::sink::FrameSink;
use crate::geometry::Angle;
use crate::rig::{Camera, Frame, RigError, RotationStage};
use crate::session::event::Happening;
use crate::session::picture::{Size, probe};
use crate::session::{Plan, PlannedView};
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

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
        reached: Angle::default(),
        frame: None,
        captured: 0,
        began: None,
        stands: None,
        retry: None,
    };
    let mut phase = Phase::Idle;
    loop {
        control.enter(phase);
        let next = match phase {
            Phase::Complete => return Ok(Outcome::Complete { captured: run.captured }),
            Phase::Aborted => return Ok(Outcome::Aborted { captured: run.captured }),
            _ => run.checkpoint(phase).and_then(|stop| stop.map_or_else(|| run.step(phase), Ok)),
        };
        phase = match next {
            Ok(phase) => phase,
            Err(error) => {
                // Where the disk is what failed, this cannot be journalled; the error still reaches the caller.
                let _ = run.sink.event(Happening::Failed { error: error.to_string() });
                control.enter(Phase::Failed);
                return Err(error);
            }
        };
    }
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
    /// Where the stage says it is.
    reached: Angle,
    /// The picture between camera and sink.
    frame: Option<Frame>,
    /// Views captured by this run.
    captured: usize,
    /// When the first view began, moved on by the time that the run was paused since.
    began: Option<Duration>,
    /// Where an earlier run has sent the stage.
    stands: Option<Angle>,
    /// After how long a run that waits for its camera goes on by itself.
    retry: Option<Duration>,
}

impl Run<'_> {
    /// Before each step: waits while the run is paused; `Some(Aborted)` where it was aborted. Not before
    /// the first step: what begins the run is its first event. Not before a picture is stored: until then it
    /// is only in memory.
    fn checkpoint(&mut self, phase: Phase) -> Result<Option<Phase>, AcquireError> {
        if matches!(phase, Phase::Idle | Phase::Storing { .. }) {
            return Ok(None);
        }
        if self.control.is_pausing() {
            let from = self.clock.now();
            self.sink.event(Happening::Paused)?;
            self.control.enter(Phase::Paused);
            self.control.wait_while_paused(self.retry.take());
            if !self.control.is_aborting() {
                self.sink.event(Happening::Resumed)?;
                self.control.enter(phase);
            }
            let paused = self.clock.now().saturating_sub(from);
            self.began = self.began.map(|t| t + paused);
        }
        if self.control.is_aborting() {
            self.sink.event(Happening::Aborted)?;
            return Ok(Some(Phase::Aborted));
        }
        Ok(None)
    }

    /// Does a phase's work; the phase that follows.
    fn step(&mut self, phase: Phase) -> Result<Phase, AcquireError> {
        Ok(match phase {
            Phase::Idle => {
                let earlier = self.sink.begin()?;
                let there: BTreeSet<usize> = earlier.captured.into_iter().collect();
                self.missing = self.plan.views.iter().filter(|v| !there.contains(&v.index)).collect();
                self.size = earlier.size;
                self.stands = earlier.stands_deg.map(Angle::from_deg);
                if self.missing.is_empty() { self.complete()? } else { Phase::Homing }
            }
            Phase::Homing => {
                let homed = match self.stands.take() {
                    Some(stands) => self.stage.take_up(stands),
                    None => self.stage.home(),
                };
                homed.map_err(AcquireError::Home)?;
                self.sink.event(Happening::Homed)?;
                self.next_view()?
            }
            Phase::Moving { view } => {
                if let Some(planned) = self.missing.front() {
                    self.go_to(view, planned.angle_deg)?;
                }
                Phase::Settling { view }
            }
            Phase::Settling { view } => {
                self.clock.wait(Duration::from_millis(self.plan.settle_ms), self.control);
                Phase::Exposing { view, bad: 0 }
            }
            Phase::Exposing { view, bad } => self.expose(view, bad)?,
            Phase::Storing { .. } => {
                self.store()?;
                self.next_view()?
            }
            Phase::Paused | Phase::Complete | Phase::Aborted | Phase::Failed => phase,
        })
    }

    fn next_view(&mut self) -> Result<Phase, AcquireError> {
        self.began.get_or_insert(self.clock.now());
        match self.missing.front() {
            Some(v) => Ok(Phase::Moving { view: v.index }),
            None => self.complete(),
        }
    }

    fn complete(&mut self) -> Result<Phase, AcquireError> {
        self.sink.event(Happening::AcquisitionComplete { views: self.plan.views.len() })?;
        Ok(Phase::Complete)
    }

    fn go_to(&mut self, view: usize, commanded_deg: f64) -> Result<(), AcquireError> {
        self.sink.event(Happening::Moving { view, target_deg: commanded_deg })?;
        let target = Angle::from_deg(commanded_deg);
        self.reached = self.stage.move_to(target).map_err(|source| AcquireError::Stage { view, source })?;
        let reached_deg = self.reached.deg();
        let tolerance_deg = self.plan.tolerance_deg;
        // Written so that a reading which is no number is a miss.
        if (reached_deg - commanded_deg).abs() <= tolerance_deg {
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
                return match self.reject(view, bad, &fault.to_string())? {
                    Some(again) => Ok(again),
                    None => Err(AcquireError::BadFrames { view, tries: bad + 1, fault }),
                };
            }
        };
        // What the bytes are counts, not what the driver takes them for.
        frame.encoding = encoding;
        if let Some(planned) = self.missing.front()
            && let Err(cause) = self.sink.examine(planned, self.reached, &frame)
        {
            return match self.reject(view, bad, &cause)? {
                Some(again) => Ok(again),
                None if self.control.is_attended() => {
                    // Whoever watches mends it and lets the run go on: with this view, and all its tries.
                    self.sink.event(Happening::Suspended { view, cause })?;
                    self.control.pause();
                    Ok(Phase::Exposing { view, bad: 0 })
                }
                None => Err(AcquireError::Unfit { view, tries: bad + 1, cause }),
            };
        }
        self.size = Some(size);
        self.frame = Some(frame);
        Ok(Phase::Storing { view })
    }

    /// The camera gave no picture. A run that is attended waits until somebody lets it go on or it is time to try again.
    fn no_picture(&mut self, view: usize, source: RigError) -> Result<Phase, AcquireError> {
        match source {
            RigError::Suspended { retry, .. } if self.control.is_attended() => {
                self.sink.event(Happening::Suspended { view, cause: source.to_string() })?;
                self.control.pause();
                self.retry = Some(retry);
                Ok(Phase::Exposing { view, bad: 0 })
            }
            source => Err(AcquireError::Camera { view, source }),
        }
    }

    /// A picture is no use: journalled with its cause. The phase in which it is taken again, where it may be.
    fn reject(&mut self, view: usize, bad: u32, cause: &str) -> Result<Option<Phase>, AcquireError> {
        let tries = bad + 1;
        self.sink.event(Happening::Rejected { view, tries: Some(tries), cause: cause.to_owned() })?;
        Ok((bad < self.plan.retakes).then_some(Phase::Exposing { view, bad: tries }))
    }

    fn store(&mut self) -> Result<(), AcquireError> {
        if let (Some(frame), Some(view)) = (self.frame.take(), self.missing.pop_front()) {
            self.captured += 1;
            let busy = self.began.map(|t| self.clock.now().saturating_sub(t).as_secs_f64());
            let remaining_s = busy.map(|s| s / self.captured as f64 * self.missing.len() as f64);
            self.sink.store(view, self.reached, frame, remaining_s)?;
            self.camera.kept();
        }
        Ok(())
    }
}
