//! The `[grbl]` settings.

use crate::rig::discovery::{Found, serial_ports};
use crate::rig::driver::OpenStage;
use crate::rig::{Before, Driver, RigError, StageDriver};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A board with GRBL 1.1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The serial port, best by its name under `/dev/serial/by-id`.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
    /// The axis that the stage is on.
    pub axis: Axis,
    /// Microsteps for one degree of the grain: what `$100` (`$101`, `$102`) of the board must be.
    pub steps_per_deg: f64,
    /// Speed, degrees a second.
    pub speed_deg_per_s: f64,
    /// Least and greatest angle that the stage may go to.
    pub limits_deg: [f64; 2],
    /// Every angle is approached from below by at least this much, degrees.
    pub backlash_deg: f64,
    /// Where zero is.
    pub reference: Reference,
    /// How long an answer may take, ms.
    pub reply_ms: u64,
    /// How long a board that opening the port resets may take to start, ms.
    pub boot_ms: u64,
    /// How long homing (`$H`) may take, seconds.
    pub homing_s: u64,
}

/// An axis of the board.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum Axis {
    /// The first.
    #[default]
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}

/// Where zero is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Where the stage stands when a run begins. A run that is taken up again goes on from where it left the stage.
    #[default]
    Here,
    /// Where the board's own homing (`$H`) ends.
    Switch,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            port: String::new(),
            baud: 115_200,
            axis: Axis::X,
            // A motor of 0.9° and 8 microsteps.
            steps_per_deg: 80.0 / 9.0,
            speed_deg_per_s: 36.0,
            limits_deg: [-10.0, 370.0],
            backlash_deg: 0.9,
            reference: Reference::Here,
            reply_ms: 1000,
            boot_ms: 2500,
            homing_s: 60,
        }
    }
}

impl Settings {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that does not, with limit and remedy.
    pub fn check(&self) -> Result<(), String> {
        let said = |name: &str, value: String, limit: &str, remedy: &str| {
            Err(format!("grbl.{name} is {value}, it must be {limit}; {remedy}"))
        };
        if self.port.is_empty() {
            let remedy = "`ls /dev/serial/by-id` shows what is plugged in";
            return said("port", "empty".into(), "the serial port's path", remedy);
        }
        let positive = [
            (
                "steps_per_deg",
                self.steps_per_deg,
                0.1,
                10_000.0,
                "400 steps a turn with 8 microsteps make 8.889",
            ),
            ("speed_deg_per_s", self.speed_deg_per_s, 0.1, 3600.0, "36 is usual"),
        ];
        for (name, value, low, high, remedy) in positive {
            if !(low..=high).contains(&value) {
                return said(name, value.to_string(), &format!("{low} to {high}"), remedy);
            }
        }
        let [low, high] = self.limits_deg;
        if !(low <= 0.0 && high >= 0.0 && low >= -36_000.0 && high <= 36_000.0) {
            let remedy = "set [-10, 370] for a stage that turns freely";
            return said("limits_deg", format!("[{low}, {high}]"), "around 0 and within ±36000", remedy);
        }
        if !(0.0..=45.0).contains(&self.backlash_deg) {
            let remedy = "twice the drive's play is enough; 0 where it has none";
            return said("backlash_deg", self.backlash_deg.to_string(), "0 to 45", remedy);
        }
        if !(10..=60_000).contains(&self.reply_ms) {
            return said("reply_ms", self.reply_ms.to_string(), "10 to 60000", "1000 is usual");
        }
        Ok(())
    }
}

impl Driver for Settings {
    fn check(&self) -> Result<(), RigError> {
        Self::check(self).map_err(RigError::Device)
    }
}

impl StageDriver for Settings {
    fn found(&self, root: &Path) -> Result<Vec<Found>, RigError> {
        Ok(serial_ports(root))
    }

    fn means(&self, found: &Found) -> bool {
        found.is_at(Path::new(&self.port))
    }

    fn open(&self, _before: Before) -> Result<OpenStage, RigError> {
        super::open(self).map(OpenStage::alone)
    }
}
