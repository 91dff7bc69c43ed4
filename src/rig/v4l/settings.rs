//! The `[v4l2]` settings.

use super::camera::V4lCamera;
use crate::rig::discovery::{Found, video_cameras};
use crate::rig::driver::OpenCamera;
use crate::rig::{Before, CameraDriver, Driver, RigError, Shutter};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Longest time that any setting may ask for, seconds.
const LONGEST_S: f64 = 3600.0;
/// Most pixels along one side.
const LONGEST_SIDE: u32 = 32_768;

/// The `[v4l2]` settings: which camera, how it is to be set, and how much patience it gets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The device, by the name that stays: `/dev/v4l/by-id/usb-…-video-index0`. Empty: the only one there.
    pub device: PathBuf,
    /// How the camera delivers its pictures.
    pub format: PixelFormat,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// Pictures per second; 0: as the camera likes.
    pub fps: u32,
    /// What is set once the camera streams and read back for every picture, by the names of `v4l2-ctl -l`. Those with
    /// `auto` in their names go first, as they decide whether the others can be set.
    pub controls: BTreeMap<String, i64>,
    /// Longest time to open the camera, seconds.
    pub open_s: f64,
    /// Longest time between two frames, seconds; then the stream is built anew.
    pub frame_s: f64,
    /// Longest time for a picture, seconds.
    pub shot_s: f64,
    /// Waits before the tries after a failed one, seconds.
    pub retry_s: Vec<f64>,
    /// After how long a suspended run tries again, seconds.
    pub suspend_s: f64,
}

/// How a video camera delivers its pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PixelFormat {
    /// JPEG files, archived as they come.
    #[default]
    Mjpeg,
    /// Brightness for each pixel, colour for each two: archived as PNG in red, green and blue. Nothing is compressed
    /// away; brightness and colour are rounded to whole levels of red, green and blue.
    Yuyv,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            device: PathBuf::new(),
            format: PixelFormat::Mjpeg,
            width: 1920,
            height: 1080,
            fps: 0,
            controls: BTreeMap::new(),
            open_s: 10.0,
            frame_s: 2.0,
            shot_s: 10.0,
            retry_s: vec![0.5, 1.5],
            suspend_s: 30.0,
        }
    }
}

impl Settings {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// [`RigError::Device`] names the first that does not, its limit and the remedy.
    pub fn check(&self) -> Result<(), RigError> {
        let refuse = |cause: String, remedy: String| Err(RigError::fault(cause, remedy));
        for (key, side) in [("width", self.width), ("height", self.height)] {
            if !(2..=LONGEST_SIDE).contains(&side) {
                return refuse(format!("v4l2.{key} is {side} px"), format!("set 2 to {LONGEST_SIDE} px"));
            }
        }
        let least = 0.01;
        let times = [
            ("open_s", self.open_s),
            ("frame_s", self.frame_s),
            ("shot_s", self.shot_s),
            ("suspend_s", self.suspend_s),
        ];
        for (key, value) in times {
            // Written so that a NaN is refused.
            if !(least..=LONGEST_S).contains(&value) {
                return refuse(format!("v4l2.{key} is {value} s"), format!("set {least} to {LONGEST_S} s"));
            }
        }
        if self.frame_s > self.shot_s {
            let remedy = format!("set at most shot_s, {} s, within which the frames come", self.shot_s);
            return refuse(format!("v4l2.frame_s is {} s", self.frame_s), remedy);
        }
        match self.retry_s.iter().find(|s| !(0.0..=LONGEST_S).contains(*s)) {
            Some(bad) => refuse(format!("v4l2.retry_s has {bad} s"), format!("set 0 to {LONGEST_S} s")),
            None => Ok(()),
        }
    }
}

impl Driver for Settings {
    fn check(&self) -> Result<(), RigError> {
        Self::check(self)
    }

    fn built_in(&self) -> Option<bool> {
        Some(cfg!(feature = "v4l"))
    }
}

impl CameraDriver for Settings {
    fn found(&self, root: &Path) -> Result<Vec<Found>, RigError> {
        Ok(video_cameras(root))
    }

    fn means(&self, found: &Found) -> bool {
        self.device.as_os_str().is_empty() || found.is_at(&self.device)
    }

    fn open(&self, _before: Before, _shutter: Option<Box<dyn Shutter>>) -> Result<OpenCamera, RigError> {
        V4lCamera::open(self).map(OpenCamera::of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_make_no_sense_are_refused_with_limit_and_remedy() {
        let d = Settings::default;
        d().check().unwrap();
        for bad in [
            Settings { width: 0, ..d() },
            Settings { height: u32::MAX, ..d() },
            Settings { frame_s: f64::NAN, ..d() },
            Settings { frame_s: 11.0, ..d() },
            Settings { shot_s: 0.0, ..d() },
            Settings { retry_s: vec![f64::INFINITY], ..d() },
        ] {
            let text = bad.check().unwrap_err().to_string();
            assert!(text.starts_with("v4l2.") && text.contains("set "), "{text}");
        }
    }
}
