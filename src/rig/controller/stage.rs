//! The stage: a thread of its own owns the controller, and speaks to it also while nobody wants anything. The camera's
//! release, which is on the same board, asks the same thread.

use super::machine::Machine;
use super::settings::Settings;
use crate::rig::{RigError, RotationStage, Shutter};
use grainrig_core::geometry::Angle;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;
use tracing::Span;

/// The stage on a serial line.
pub struct ControllerStage {
    limits: [Angle; 2],
    about: String,
    wanted: Sender<(Span, Wanted)>,
    reached: Receiver<Result<f64, RigError>>,
    thread: Option<JoinHandle<()>>,
}

/// What the thread is asked for.
enum Wanted {
    Home,
    /// Degrees.
    TakeUp(f64),
    /// Degrees.
    MoveTo(f64),
    /// Who asks is told by a line of its own.
    Photograph(Sender<Result<(), RigError>>),
    /// The motor is let go, and the thread ends.
    End,
}

fn gone() -> RigError {
    RigError::fault("the stage's thread has ended", "open the rig again")
}

/// The camera's release on the controller's board. Good as long as its stage.
pub struct ControllerShutter(Sender<(Span, Wanted)>);

impl Shutter for ControllerShutter {
    fn release(&mut self) -> Result<(), RigError> {
        let (answer, done) = channel();
        self.0.send((Span::current(), Wanted::Photograph(answer))).map_err(|_| gone())?;
        done.recv().map_err(|_| gone())?
    }
}

impl ControllerStage {
    pub(super) fn open(settings: Settings) -> Result<Self, RigError> {
        let limits = settings.limits_deg.map(Angle::from_deg);
        // The firmware lets go where it hears nothing: a run may be paused for an hour.
        let each = Duration::from_secs(u64::from(settings.silence_s.max(3)) / 3);
        let machine = Machine::open(settings)?;
        let about = machine.describe();
        let (wanted, wants) = channel();
        let (answer, reached) = channel();
        let thread = std::thread::Builder::new()
            .name("stage".into())
            .spawn(move || serve(machine, each, &wants, &answer))
            .map_err(|e| RigError::Device(format!("no thread for the stage: {e}")))?;
        Ok(Self { limits, about, wanted, reached, thread: Some(thread) })
    }

    /// The camera's release, which is on the same board.
    pub fn shutter(&self) -> ControllerShutter {
        ControllerShutter(self.wanted.clone())
    }

    fn ask(&self, wanted: Wanted) -> Result<Angle, RigError> {
        self.wanted.send((Span::current(), wanted)).map_err(|_| gone())?;
        self.reached.recv().map_err(|_| gone())?.map(Angle::from_deg)
    }
}

fn serve(
    mut machine: Machine,
    each: Duration,
    wants: &Receiver<(Span, Wanted)>,
    answer: &Sender<Result<f64, RigError>>,
) {
    loop {
        let (span, wanted) =
            wants.recv_timeout(each).map_or_else(|e| (Span::none(), Err(e)), |(s, w)| (s, Ok(w)));
        // What is said on the line belongs to what was asked for.
        let _within = span.entered();
        let done = match wanted {
            Ok(Wanted::Home) => machine.home(),
            Ok(Wanted::TakeUp(deg)) => machine.take_up(deg),
            Ok(Wanted::MoveTo(deg)) => machine.move_to(deg),
            Ok(Wanted::Photograph(answer)) => {
                // Whoever asked and went away does not want to know.
                let _ = answer.send(machine.photograph());
                continue;
            }
            Err(RecvTimeoutError::Timeout) => {
                machine.keep_alive();
                continue;
            }
            Ok(Wanted::End) | Err(RecvTimeoutError::Disconnected) => break,
        };
        if answer.send(done).is_err() {
            break;
        }
    }
    machine.release();
}

impl RotationStage for ControllerStage {
    fn home(&mut self) -> Result<Angle, RigError> {
        self.ask(Wanted::Home)
    }

    fn take_up(&mut self, stands: Angle) -> Result<Angle, RigError> {
        self.ask(Wanted::TakeUp(stands.deg()))
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let [low, high] = self.limits;
        // Written so that a NaN is refused.
        if !(low..=high).contains(&target) {
            return Err(RigError::OutOfLimits { asked: target, low, high });
        }
        self.ask(Wanted::MoveTo(target.deg()))
    }

    fn describe(&self) -> String {
        self.about.clone()
    }
}

impl Drop for ControllerStage {
    /// Waits until the motor is let go.
    fn drop(&mut self) {
        // The camera's release may be there still, so that the end of the line alone would not tell.
        let _ = self.wanted.send((Span::none(), Wanted::End));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
