//! A stage and a camera, each request to which the log tells: what was asked, how long it took, how it ended.

use super::{Camera, Frame, RigError, RotationStage};
use crate::trace::ms_since;
use grainrig_core::geometry::Angle;
use std::time::Instant;
use tracing::{Span, debug, debug_span};

struct Traced<T: ?Sized>(Box<T>);

/// This stage, whose requests are told at debug.
pub fn traced_stage(stage: Box<dyn RotationStage>) -> Box<dyn RotationStage> {
    Box::new(Traced(stage))
}

/// This camera, whose requests are told at debug.
pub fn traced_camera(camera: Box<dyn Camera>) -> Box<dyn Camera> {
    Box::new(Traced(camera))
}

/// Asks within `span`; `came` says what came of it.
fn told<T>(
    span: &Span,
    ask: impl FnOnce() -> Result<T, RigError>,
    came: impl FnOnce(&T) -> String,
) -> Result<T, RigError> {
    span.in_scope(|| {
        let begun = Instant::now();
        let ended = ask();
        let ms = ms_since(begun);
        match &ended {
            Ok(answer) => debug!(ms, outcome = came(answer), "done"),
            Err(error) => debug!(ms, outcome = "failed", %error, "failed"),
        }
        ended
    })
}

fn at(reached: Angle) -> String {
    format!("at {:.4}°", reached.deg())
}

fn got(frame: &Frame) -> String {
    format!("{} bytes, and {} more files", frame.bytes.len(), frame.others.len())
}

impl RotationStage for Traced<dyn RotationStage> {
    fn home(&mut self) -> Result<Angle, RigError> {
        told(&debug_span!("stage", verb = "home"), || self.0.home(), |reached| at(*reached))
    }

    fn take_up(&mut self, stands: Angle) -> Result<Angle, RigError> {
        let span = debug_span!("stage", verb = "take_up", stands_deg = stands.deg());
        told(&span, || self.0.take_up(stands), |reached| at(*reached))
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let span = debug_span!("stage", verb = "move_to", target_deg = target.deg());
        told(&span, || self.0.move_to(target), |reached| at(*reached))
    }

    fn describe(&self) -> String {
        self.0.describe()
    }
}

impl Camera for Traced<dyn Camera> {
    fn capture(&mut self) -> Result<Frame, RigError> {
        told(&debug_span!("camera", verb = "capture"), || self.0.capture(), got)
    }

    fn preview(&mut self) -> Result<Frame, RigError> {
        told(&debug_span!("camera", verb = "preview"), || self.0.preview(), got)
    }

    fn kept(&mut self) {
        debug_span!("camera", verb = "kept").in_scope(|| {
            let begun = Instant::now();
            self.0.kept();
            debug!(ms = ms_since(begun), outcome = "told", "done");
        });
    }

    fn describe(&self) -> String {
        self.0.describe()
    }
}
