//! The `[controller]` settings.

use crate::rig::discovery::{Found, serial_ports};
use crate::rig::driver::OpenStage;
use crate::rig::{Before, Driver, RigError, StageDriver};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The firmware's limits on speed and acceleration, microsteps a second (a second).
const SPEEDS: [f64; 2] = [10.0, 8000.0];
const ACCELERATIONS: [f64; 2] = [10.0, 200_000.0];

/// The firmware's longest times for the camera's contacts, ms.
const LONGEST_CONTACT_MS: u32 = 60_000;

/// A stepper controller with grainrig's firmware.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The serial port, best by its name under `/dev/serial/by-id`, which stays when others come and go.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
    /// Full steps of the motor for one turn of the grain.
    pub steps_per_turn: u32,
    /// Microsteps of a full step, as set on the driver.
    pub microsteps: u32,
    /// Greatest speed, degrees a second.
    pub speed_deg_per_s: f64,
    /// Acceleration, degrees a second each second.
    pub acceleration_deg_per_s2: f64,
    /// Least and greatest angle that the stage may go to.
    pub limits_deg: [f64; 2],
    /// Every angle is approached from below by at least this much, degrees: the play of the drive does not count.
    pub backlash_deg: f64,
    /// Where zero is.
    pub reference: Reference,
    /// Speed towards the reference switch, degrees a second.
    pub homing_deg_per_s: f64,
    /// The other sense of rotation.
    pub invert: bool,
    /// The firmware stops and lets go where it hears nothing for so long, seconds; 0: never.
    pub silence_s: u32,
    /// How long the camera's focus contact is closed before the shutter's is too, ms; of use with `rig.release` only.
    pub focus_ms: u32,
    /// How long both are closed then, ms: the exposure itself where the camera is set to bulb.
    pub shutter_ms: u32,
    /// How long an answer may take before it is asked for again, ms.
    pub reply_ms: u64,
    /// How often something is asked before the controller counts as gone.
    pub tries: u32,
    /// How long a board that was reset by opening its port may take to say that it has started, ms.
    pub boot_ms: u64,
    /// How long a controller that was unplugged may take to come back, seconds.
    pub return_s: u64,
}

/// Where zero is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Where the stage stands when a run begins. A run that is taken up again goes on from where it left the stage.
    #[default]
    Here,
    /// Where the reference switch opens.
    Switch,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            port: String::new(),
            baud: 115_200,
            steps_per_turn: 400,
            microsteps: 8,
            speed_deg_per_s: 36.0,
            acceleration_deg_per_s2: 180.0,
            limits_deg: [-10.0, 370.0],
            backlash_deg: 0.9,
            reference: Reference::Here,
            homing_deg_per_s: 9.0,
            invert: false,
            silence_s: 60,
            focus_ms: 100,
            shutter_ms: 200,
            reply_ms: 250,
            tries: 8,
            boot_ms: 2500,
            return_s: 15,
        }
    }
}

impl Settings {
    /// Microsteps of a whole turn.
    pub(super) fn per_turn(&self) -> f64 {
        f64::from(self.steps_per_turn) * f64::from(self.microsteps)
    }

    /// The position nearest to an angle in degrees, microsteps.
    pub(super) fn position(&self, deg: f64) -> i32 {
        (deg / 360.0 * self.per_turn()).round() as i32
    }

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that does not, with limit and remedy.
    pub fn check(&self) -> Result<(), String> {
        let said = |name: &str, value: String, limit: &str, remedy: &str| {
            Err(format!("controller.{name} is {value}, it must be {limit}; {remedy}"))
        };
        if self.port.is_empty() {
            let remedy = "`ls /dev/serial/by-id` shows what is plugged in";
            return said("port", "empty".into(), "the serial port's path", remedy);
        }
        if !(100..=51_200).contains(&self.steps_per_turn) {
            let remedy = "a motor of 0.9° has 400, times the gear's ratio";
            return said("steps_per_turn", self.steps_per_turn.to_string(), "100 to 51200", remedy);
        }
        if !(1..=256).contains(&self.microsteps) {
            let remedy = "set it as the jumpers on the driver are";
            return said("microsteps", self.microsteps.to_string(), "1 to 256", remedy);
        }
        let rate = |deg: f64| deg / 360.0 * self.per_turn();
        for (name, deg, limits) in [
            ("speed_deg_per_s", self.speed_deg_per_s, SPEEDS),
            ("homing_deg_per_s", self.homing_deg_per_s, SPEEDS),
            ("acceleration_deg_per_s2", self.acceleration_deg_per_s2, ACCELERATIONS),
        ] {
            let [low, high] = limits.map(|l| l / self.per_turn() * 360.0);
            if !(limits[0]..=limits[1]).contains(&rate(deg)) {
                let remedy = "the firmware makes 10 to 8000 microsteps a second; fewer microsteps allow more";
                return said(name, format!("{deg}"), &format!("{low:.3} to {high:.0}"), remedy);
            }
        }
        let [low, high] = self.limits_deg;
        if !(low <= 0.0 && high >= 0.0 && low >= -36_000.0 && high <= 36_000.0) {
            let remedy = "set [-10, 370] for a stage that turns freely";
            return said("limits_deg", format!("[{low}, {high}]"), "around 0 and within ±36000", remedy);
        }
        if !(0.0..=45.0).contains(&self.backlash_deg) {
            let remedy = "twice the drive's play is enough; 0 where it has none";
            return said("backlash_deg", format!("{}", self.backlash_deg), "0 to 45", remedy);
        }
        if !(self.reply_ms >= 10 && self.reply_ms <= 10_000 && (1..=100).contains(&self.tries)) {
            let value = format!("{} ms, {} tries", self.reply_ms, self.tries);
            return said(
                "reply_ms, tries",
                value,
                "10 to 10000 ms, 1 to 100 tries",
                "250 ms and 8 are usual",
            );
        }
        for (name, ms, least) in [("focus_ms", self.focus_ms, 0), ("shutter_ms", self.shutter_ms, 1)] {
            if !(least..=LONGEST_CONTACT_MS).contains(&ms) {
                let limit = format!("{least} to {LONGEST_CONTACT_MS} ms");
                return said(name, format!("{ms} ms"), &limit, "100 and 200 are usual");
            }
        }
        if self.silence_s != 0 && !(5..=86_400).contains(&self.silence_s) {
            let remedy = "60 is usual; grainrig speaks up a third as often";
            return said("silence_s", self.silence_s.to_string(), "0 or 5 to 86400", remedy);
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

    /// The board has outputs for the camera's remote socket.
    fn has_release(&self) -> bool {
        true
    }

    fn open(&self, _before: Before) -> Result<OpenStage, RigError> {
        let stage = super::open(self)?;
        Ok(OpenStage { shutter: Some(Box::new(stage.shutter())), stage: Box::new(stage) })
    }
}
