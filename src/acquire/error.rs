//! Why a plan is refused or a run failed.

use crate::rig::RigError;
use crate::session::SessionError;
use crate::session::picture::PictureFault;

/// A setting of a plan that is refused, never clamped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{setting} is {value}; {remedy}")]
pub struct PlanError {
    /// The setting's name.
    pub setting: &'static str,
    /// Its value and unit.
    pub value: String,
    /// The limit and what to do.
    pub remedy: String,
}

/// Why a run failed. What was captured stays; the run can be resumed.
#[derive(Debug, thiserror::Error)]
pub enum AcquireError {
    /// The stage did not find its reference.
    #[error("homing failed: {0}")]
    Home(#[source] RigError),
    /// The stage failed on the way to a view.
    #[error("view {view}: {source}")]
    Stage {
        /// The view's index.
        view: usize,
        /// The stage's reason.
        source: RigError,
    },
    /// The stage stands elsewhere than it was sent to.
    #[error(
        "view {view}: the stage was sent to {commanded_deg:.3}° and reads {reached_deg:.3}°, more than \
         {tolerance_deg}° off; check the coupling and the motor's current, then resume"
    )]
    Missed {
        /// The view's index.
        view: usize,
        /// Where it was sent, degrees.
        commanded_deg: f64,
        /// Where it says it is, degrees.
        reached_deg: f64,
        /// The limit, degrees.
        tolerance_deg: f64,
    },
    /// The camera failed.
    #[error("view {view}: {source}")]
    Camera {
        /// The view's index.
        view: usize,
        /// The camera's reason.
        source: RigError,
    },
    /// Every picture of a view was bad.
    #[error("view {view}: {tries} of {tries} pictures were bad, the last one so: {fault}")]
    BadFrames {
        /// The view's index.
        view: usize,
        /// Pictures taken.
        tries: u32,
        /// What was wrong with the last one.
        fault: PictureFault,
    },
    /// Every picture of a view was whole, and none was good enough to carve with.
    #[error(
        "view {view}: none of {tries} picture(s) is good enough, the last one is not for this: {cause}. Mend that, then \
         `grainrig resume` goes on with this view; `--quality label` keeps it as it is"
    )]
    Unfit {
        /// The view's index.
        view: usize,
        /// Pictures taken.
        tries: u32,
        /// Value, unit, limit and remedy of what was wrong with the last one.
        cause: String,
    },
    /// The pictures could not be kept.
    #[error(transparent)]
    Session(#[from] SessionError),
}
