//! A recording as a stage and a camera: it goes the same way through the house as the rig.

use super::recording::Recording;
use crate::rig::{Camera, Frame, RigError, RotationStage};
use grainrig_core::geometry::Angle;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Angles this close are the same target: below any stage's resolution, above the rounding of the record.
const SAME_DEG: f64 = 1e-6;

struct Shared {
    recording: Recording,
    position: Mutex<Position>,
}

#[derive(Default)]
struct Position {
    current: Option<usize>,
    played: BTreeSet<usize>,
}

impl Shared {
    fn position(&self) -> MutexGuard<'_, Position> {
        self.position.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Stage and camera that play a recording: sent to a recorded view's angle, the stage returns the angle that
/// was reached, and the camera returns the picture's own bytes, its hash checked.
pub fn replay(recording: Recording) -> (ReplayStage, ReplayCamera) {
    let shared = Arc::new(Shared { recording, position: Mutex::default() });
    (ReplayStage(Arc::clone(&shared)), ReplayCamera(shared))
}

/// The stage of a recording.
pub struct ReplayStage(Arc<Shared>);

impl RotationStage for ReplayStage {
    fn home(&mut self) -> Result<Angle, RigError> {
        *self.0.position() = Position::default();
        Ok(Angle::default())
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let mut position = self.0.position();
        let recording = &self.0.recording;
        // Two views may have one angle (a closing view in a full turn): each is played once, in order.
        let unplayed = |v: &&_| -> bool {
            let v: &super::event::CapturedView = v;
            !position.played.contains(&v.view) && (v.commanded_deg - target.deg()).abs() < SAME_DEG
        };
        let Some(view) = recording.views().find(unplayed) else {
            let recorded = recording.views().len();
            if position.played.len() == recorded {
                return Err(RigError::RecordingEnds(recorded));
            }
            return Err(RigError::fault(
                format!(
                    "the recording {} has no view at {target} that was not played",
                    recording.folder().display()
                ),
                "replay it with its own plan",
            ));
        };
        position.played.insert(view.view);
        position.current = Some(view.view);
        Ok(Angle::from_deg(view.reached_deg))
    }

    fn describe(&self) -> String {
        format!("stage of the recording {}", self.0.recording.manifest().name)
    }
}

/// The camera of a recording.
pub struct ReplayCamera(Arc<Shared>);

impl Camera for ReplayCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        let current = self.0.position().current;
        let view = current.ok_or_else(|| {
            RigError::fault("the recording has no picture before the first move", "move the stage")
        })?;
        self.0.recording.frame(view).map_err(|e| RigError::Device(e.to_string()))
    }

    fn describe(&self) -> String {
        format!("camera of the recording {}", self.0.recording.manifest().name)
    }
}
