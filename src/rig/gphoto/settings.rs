//! The `[gphoto2]` settings.

use super::camera::{GphotoCamera, Launch};
use crate::rig::discovery::{Found, runs, still_cameras};
use crate::rig::driver::{FRAME_BYTES, Finding, Health, OpenCamera, RAW_BYTES};
use crate::rig::{Before, CameraDriver, Driver, RigError, Shutter};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Longest time that any setting may ask for, seconds.
const LONGEST_S: f64 = 3600.0;
/// The desktop's helper that takes every camera for itself.
const DESKTOP: &str = "gvfs-gphoto2-volume-monitor";

/// The `[gphoto2]` settings: which camera, how it is to be set, and how much patience it gets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The camera's name as `gphoto2 --auto-detect` prints it; empty: the only one that is found.
    pub model: String,
    /// Its port as libgphoto2 writes it (`usb:001,005`, `ptpip:192.168.1.20`); empty: found by model and serial number.
    /// A USB port changes every time the camera is switched on, so name one only where there is no other way.
    pub port: String,
    /// Its serial number; empty: any.
    pub serial: String,
    /// Where the camera keeps a picture until it is fetched.
    pub target: Target,
    /// What is set and read back before every picture, by the names and choices of `gphoto2 --list-all-config`.
    pub set: BTreeMap<String, String>,
    /// What must be so and can't be set over the cable (the mode dial, the focus switch); read before every picture.
    pub require: BTreeMap<String, String>,
    /// Press the shutter at once instead of half-way first, so that no autofocus is waited for.
    pub release_at_once: bool,
    /// Delete pictures from the camera once they are durable here.
    pub delete: bool,
    /// Longest time for the child process to start, seconds.
    pub start_s: f64,
    /// Longest time to open the camera, seconds.
    pub open_s: f64,
    /// Longest time for a picture, from the settings to its last byte, seconds; past it the camera's process is killed.
    pub shot_s: f64,
    /// How long a camera may say that it is busy, seconds.
    pub busy_s: f64,
    /// Rest after which no further file of an exposure is waited for, seconds.
    pub quiet_s: f64,
    /// Waits before the tries after a failed one, seconds.
    pub retry_s: Vec<f64>,
    /// The same where another program holds the camera, which it may do for minutes.
    pub claimed_retry_s: Vec<f64>,
    /// After how long a suspended run tries again, seconds; doubled each time, up to 16 times as long.
    pub suspend_s: f64,
}

/// Where the camera keeps a picture until it is fetched.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// On its card: a picture outlives whatever happens to the cable.
    #[default]
    Card,
    /// In its memory: no card is needed, and an unfetched picture is lost with the connection.
    Ram,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: String::new(),
            port: String::new(),
            serial: String::new(),
            target: Target::Card,
            set: BTreeMap::new(),
            require: BTreeMap::new(),
            release_at_once: false,
            delete: true,
            start_s: 10.0,
            open_s: 20.0,
            shot_s: 30.0,
            busy_s: 5.0,
            quiet_s: 0.3,
            retry_s: vec![0.5, 1.5],
            claimed_retry_s: vec![5.0, 15.0, 30.0],
            suspend_s: 60.0,
        }
    }
}

/// Seconds as a duration; checked before.
pub(super) fn seconds(s: f64) -> Duration {
    Duration::from_secs_f64(s)
}

impl Settings {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// [`RigError::Device`] names the first that does not, its limit and the remedy.
    pub fn check(&self) -> Result<(), RigError> {
        let times = [
            ("start_s", self.start_s),
            ("open_s", self.open_s),
            ("shot_s", self.shot_s),
            ("busy_s", self.busy_s),
            ("quiet_s", self.quiet_s),
            ("suspend_s", self.suspend_s),
        ];
        let waits = self.retry_s.iter().map(|s| ("retry_s", *s));
        let claimed = self.claimed_retry_s.iter().map(|s| ("claimed_retry_s", *s));
        for (key, value) in times.into_iter().chain(waits).chain(claimed) {
            // Written so that a NaN is refused.
            if !(0.0..=LONGEST_S).contains(&value) {
                return Err(RigError::fault(
                    format!("gphoto2.{key} is {value} s"),
                    format!("set 0 to {LONGEST_S} s"),
                ));
            }
        }
        for (key, value, least) in
            [("start_s", self.start_s, 0.1), ("open_s", self.open_s, 0.1)].into_iter().chain([
                ("shot_s", self.shot_s, self.busy_s + self.quiet_s),
                ("suspend_s", self.suspend_s, 0.001),
            ])
        {
            if value < least {
                return Err(RigError::fault(
                    format!("gphoto2.{key} is {value} s"),
                    format!("set at least {least} s (busy_s and quiet_s lie within shot_s)"),
                ));
            }
        }
        if !self.port.is_empty() && self.model.is_empty() {
            return Err(RigError::fault(
                "gphoto2.port is set and gphoto2.model is empty",
                "set the model as `gphoto2 --auto-detect` prints it",
            ));
        }
        let own = ["capturetarget", "viewfinder", "eosremoterelease"];
        if let Some(name) = own.iter().find(|n| self.set.contains_key(**n)) {
            return Err(RigError::fault(
                format!("gphoto2.set has {name}, which is set by itself"),
                "use gphoto2.target and release_at_once, and remove it",
            ));
        }
        Ok(())
    }
}

impl Driver for Settings {
    fn check(&self) -> Result<(), RigError> {
        Self::check(self)
    }

    fn built_in(&self) -> Option<bool> {
        Some(cfg!(feature = "gphoto2"))
    }

    fn findings(&self) -> Vec<Finding> {
        let check = "desktop";
        vec![if runs(DESKTOP) {
            Finding {
                check,
                health: Health::Bad,
                found: format!("{DESKTOP} runs and takes every camera that is plugged in"),
                remedy: Some(format!(
                    "systemctl --user mask --now {DESKTOP}, or `gio mount -s gphoto2` each time"
                )),
            }
        } else {
            Finding::good(check, "nothing takes cameras for itself")
        }]
    }
}

impl CameraDriver for Settings {
    fn found(&self, root: &Path) -> Result<Vec<Found>, RigError> {
        Ok(still_cameras(root))
    }

    fn takes_release(&self) -> bool {
        true
    }

    fn view_bytes(&self) -> u64 {
        FRAME_BYTES + RAW_BYTES
    }

    fn open(&self, _before: Before, shutter: Option<Box<dyn Shutter>>) -> Result<OpenCamera, RigError> {
        let camera = GphotoCamera::open(self, Launch::this_program())?;
        Ok(OpenCamera::of(match shutter {
            Some(shutter) => camera.released_by(shutter),
            None => camera,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_settings_that_make_no_sense_are_refused_with_limit_and_remedy() {
        let d = Settings::default;
        d().check().unwrap();
        let twice = BTreeMap::from([("capturetarget".to_owned(), "Internal RAM".to_owned())]);
        for bad in [
            Settings { shot_s: f64::NAN, ..d() },
            Settings { shot_s: 2.0, ..d() },
            Settings { open_s: 0.0, ..d() },
            Settings { retry_s: vec![0.5, -1.0], ..d() },
            Settings { suspend_s: 1e9, ..d() },
            Settings { port: "usb:001,002".into(), ..d() },
            Settings { set: twice, ..d() },
        ] {
            let text = bad.check().unwrap_err().to_string();
            assert!(
                text.starts_with("gphoto2.") && (text.contains("set ") || text.contains("use ")),
                "{text}"
            );
        }
    }
}
