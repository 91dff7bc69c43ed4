//! A stage on a board with GRBL 1.1, as people own them: one axis, whose unit is a degree.
//!
//! GRBL has neither sequence numbers nor checksums. So every target is absolute, in machine coordinates; nothing is asked twice
//! before the position has been looked at; and a move counts when the board, at rest, states the target's position.

mod board;
mod settings;

pub use settings::{Reference, Settings};

use super::{RigError, RotationStage, warn_taken_up};
use board::Board;
use grainrig_core::geometry::Angle;

/// A stage that a GRBL board turns.
pub struct GrblStage {
    settings: Settings,
    board: Board,
}

/// Opens the stage. Nothing moves.
///
/// # Errors
/// [`RigError::Device`] where the port can't be opened, no GRBL answers, or it is set to another number of steps for a degree.
pub fn open(settings: &Settings) -> Result<GrblStage, RigError> {
    let board = Board::open(settings)?;
    Ok(GrblStage { settings: settings.clone(), board })
}

impl RotationStage for GrblStage {
    fn home(&mut self) -> Result<Angle, RigError> {
        match self.settings.reference {
            Reference::Here => self.board.stands_at(0.0)?,
            Reference::Switch => self.board.find_switch()?,
        }
        self.board.go_from_below(0.0).map(Angle::from_deg)
    }

    fn take_up(&mut self, stands: Angle) -> Result<Angle, RigError> {
        match self.settings.reference {
            Reference::Here => {
                warn_taken_up(stands.deg());
                self.board.stands_at(stands.deg()).map(|()| stands)
            }
            Reference::Switch => self.home(),
        }
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let [low, high] = self.settings.limits_deg.map(Angle::from_deg);
        // Written so that a NaN is refused.
        if !(low..=high).contains(&target) {
            return Err(RigError::OutOfLimits { asked: target, low, high });
        }
        self.board.go_from_below(target.deg()).map(Angle::from_deg)
    }

    fn describe(&self) -> String {
        let s = &self.settings;
        format!("{} on {}, axis {}, {} steps/degree", self.board.version(), s.port, s.axis, s.steps_per_deg)
    }
}
