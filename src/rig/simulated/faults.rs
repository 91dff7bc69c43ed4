//! What goes wrong at the simulated rig, and how the real drivers would tell of it.

use crate::rig::RigError;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Faults of a session, each at one exposure or one move, counted from 0. The count goes on where a run is taken up again
/// ([`crate::rig::Before`]): a fault that has come and gone does not come again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// The exposure whose file ends after two thirds of its bytes.
    pub truncate_frame_at: Option<usize>,
    /// The exposure that delivers a file of no bytes.
    pub empty_frame_at: Option<usize>,
    /// The exposure that delivers a picture of half the width and height.
    pub wrong_size_at: Option<usize>,
    /// The exposure at which the camera answers with an error.
    pub fail_capture_at: Option<usize>,
    /// The exposure that is out of focus.
    pub blurred_frame_at: Option<usize>,
    /// The exposure during which the camera shakes, sideways and a little upwards.
    pub shaken_frame_at: Option<usize>,
    /// The exposure that gets twice the light.
    pub overexposed_frame_at: Option<usize>,
    /// The exposure that delivers the file of the one before it again.
    pub repeated_frame_at: Option<usize>,
    /// The exposure in which something hangs into the picture from above, down to the grain's middle.
    pub obstructed_frame_at: Option<usize>,
    /// How many exposures each of these five spoils.
    pub frame_faults_last: usize,
    /// Whether they stay once they have come.
    pub frame_faults_stay: bool,
    /// The camera hangs: it does not answer.
    pub camera_hung: Option<Outage>,
    /// The camera is gone: switched off, or its cable pulled.
    pub camera_gone: Option<Outage>,
    /// The camera's card is full.
    pub card_full: Option<Outage>,
    /// Somebody has changed a setting that can't be set over the cable.
    pub settings_changed: Option<Outage>,
    /// The camera takes long for an exposure.
    pub camera_slow: Option<Slow>,
    /// After how long a run that is suspended tries by itself again, seconds.
    pub suspend_s: f64,
    /// The move in which the motor loses one full step; the next homing finds it again.
    pub lost_step_at: Option<usize>,
    /// The move in which the stage's board starts anew and forgets where it stands.
    pub board_reset_at: Option<usize>,
    /// The stage's board does not answer.
    pub board_silent: Option<Outage>,
    /// The move that ends elsewhere, as the stage itself says.
    pub missed_angle: Option<Missed>,
    /// The exposure before which the grain slips on its pedestal, for good.
    pub slip: Option<Slip>,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            truncate_frame_at: None,
            empty_frame_at: None,
            wrong_size_at: None,
            fail_capture_at: None,
            blurred_frame_at: None,
            shaken_frame_at: None,
            overexposed_frame_at: None,
            repeated_frame_at: None,
            obstructed_frame_at: None,
            frame_faults_last: 1,
            frame_faults_stay: false,
            camera_hung: None,
            camera_gone: None,
            card_full: None,
            settings_changed: None,
            camera_slow: None,
            suspend_s: 60.0,
            lost_step_at: None,
            board_reset_at: None,
            board_silent: None,
            missed_angle: None,
            slip: None,
        }
    }
}

/// A device that fails for some tries, and is then as before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// The exposure, or the move, at which it begins.
    pub at: usize,
    /// How many in a row fail.
    #[serde(default = "once")]
    pub tries: usize,
}

fn once() -> usize {
    1
}

impl Outage {
    fn holds(self, number: usize) -> bool {
        (self.at..self.at.saturating_add(self.tries)).contains(&number)
    }
}

/// An exposure that takes long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slow {
    /// The exposure.
    pub at: usize,
    /// How much longer it takes, seconds; waited for where the rig runs in real time.
    pub seconds: f64,
}

/// A move that ends elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Missed {
    /// The move.
    pub at: usize,
    /// How far from where it was sent, degrees.
    pub deg: f64,
}

/// A grain that turns on its pedestal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slip {
    /// The first exposure that sees the grain turned.
    pub at: usize,
    /// How far it has turned, degrees, counter-clockwise seen from above.
    pub deg: f64,
}

impl Faults {
    /// Whether a fault that comes at an exposure spoils the exposure of this number.
    pub(super) fn spoils(&self, fault_at: Option<usize>, number: usize) -> bool {
        let lasts = if self.frame_faults_stay { usize::MAX } else { self.frame_faults_last };
        fault_at.is_some_and(|at| (at..at.saturating_add(lasts)).contains(&number))
    }

    /// The outages, with their keys.
    pub(super) fn outages(&self) -> impl Iterator<Item = (&'static str, Outage)> {
        [
            ("faults.camera_hung.tries", self.camera_hung),
            ("faults.camera_gone.tries", self.camera_gone),
            ("faults.card_full.tries", self.card_full),
            ("faults.settings_changed.tries", self.settings_changed),
            ("faults.board_silent.tries", self.board_silent),
        ]
        .into_iter()
        .filter_map(|(key, outage)| Some((key, outage?)))
    }

    /// Why the exposure of this number gives no picture, as a real camera's driver tells it.
    ///
    /// # Errors
    /// [`RigError::Suspended`] where somebody has to do something, [`RigError::Device`] where the camera answers with an
    /// error.
    pub(super) fn camera_answers(&self, number: usize) -> Result<(), RigError> {
        let of = |outage: Option<Outage>| outage.is_some_and(|o| o.holds(number));
        let (cause, remedy) = if of(self.camera_gone) {
            ("is not there", "switch the camera on and check its cable")
        } else if of(self.camera_hung) {
            ("did not answer", "switch the camera off and on, and check its cable and battery")
        } else if of(self.card_full) {
            ("has no room left on its card", "delete pictures from the card or put an empty one in")
        } else if of(self.settings_changed) {
            ("has other settings than were asked for", "set the camera as stated")
        } else if self.fail_capture_at == Some(number) {
            return Err(RigError::Device(format!(
                "the simulated camera failed at exposure {number} as [simulated.faults] fail_capture_at asks; \
                 take the picture again"
            )));
        } else {
            return Ok(());
        };
        Err(RigError::Suspended {
            cause: format!("the simulated camera {cause} at exposure {number}, as [simulated.faults] asks"),
            remedy: remedy.to_owned(),
            retry: Duration::from_secs_f64(self.suspend_s),
        })
    }

    /// Why the move of this number is not made, as the controller's driver tells it.
    ///
    /// # Errors
    /// [`RigError::Device`].
    pub(super) fn stage_answers(&self, number: usize) -> Result<(), RigError> {
        let why = if self.board_silent.is_some_and(|o| o.holds(number)) {
            "does not answer; check cable and power, then resume"
        } else if self.board_reset_at == Some(number) {
            "has started anew: the angle is lost; check its power supply, then resume, which looks for the reference again"
        } else {
            return Ok(());
        };
        Err(RigError::Device(format!(
            "the simulated stage's board {why} (move {number}, as [simulated.faults] asks)"
        )))
    }
}
