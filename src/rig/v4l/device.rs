//! The device: found, opened, set.

use super::camera::Trouble;
use super::picture;
use super::settings::{PixelFormat, Settings};
use super::stream::Frames;
use crate::rig::Frame;
use crate::rig::holder::holder;
use rustix::io::Errno;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use v4l::capability::Flags;
use v4l::control::{Control, Description, Flags as ControlFlags, Type, Value};
use v4l::video::Capture as _;
use v4l::{Format, FourCC};

/// Where cameras have names that stay.
const BY_ID: &str = "/dev/v4l/by-id";
/// Frames in a row that may be damaged.
const MOST_BAD: usize = 8;
/// Part of the time for a picture after which the device gives up by itself, before its thread is given up.
const OWN_SHARE: f64 = 0.8;

const CABLE: &str = "put the camera's cable in, at a port of its own";
const SETTINGS: &str = "change [v4l2] to what the camera has: `v4l2-ctl --list-formats-ext -L` shows it";

/// An open video camera.
pub(super) struct Device {
    settings: Settings,
    path: PathBuf,
    card: String,
    node: v4l::Device,
    /// By their names.
    controls: BTreeMap<String, Description>,
    /// Bytes from one row to the next.
    stride: usize,
    /// Time from one frame to the next, where the camera says it.
    interval: Duration,
    frames: Option<Frames>,
}

/// What an error of the system means.
pub(super) fn trouble(doing: &str, path: &Path, e: &io::Error) -> Trouble {
    let at = path.display();
    match e.raw_os_error().map(Errno::from_raw_os_error) {
        Some(Errno::NODEV | Errno::NOENT | Errno::NXIO) => {
            Trouble::device(format!("the video camera {at} is not there: {e}"), CABLE)
        }
        Some(Errno::BUSY) => {
            let by = holder(path).map_or_else(String::new, |who| format!(" by {who}"));
            let remedy = "end the program that uses the camera";
            Trouble::device(format!("the video camera {at} is used{by}"), remedy)
        }
        Some(Errno::NOSPC) => {
            let remedy =
                "put the camera at a USB port of its own, or set a smaller picture, fewer frames, or mjpeg";
            Trouble::device(format!("the USB bandwidth does not suffice for the video camera {at}"), remedy)
        }
        Some(Errno::ACCESS | Errno::PERM) => {
            let remedy =
                "add this account to the group that owns the device (usually `video`), and log in again";
            Trouble::lasting(format!("this account may not open the video camera {at}"), remedy)
        }
        _ => Trouble::device(format!("the video camera {at} fails to {doing}: {e}"), CABLE),
    }
}

/// The camera of the settings, or the only one whose name stays.
fn find(settings: &Settings) -> Result<PathBuf, Trouble> {
    if !settings.device.as_os_str().is_empty() {
        return Ok(settings.device.clone());
    }
    let entries = std::fs::read_dir(BY_ID).into_iter().flatten().flatten();
    // Others of the same camera carry data about the pictures.
    let mut found: Vec<PathBuf> =
        entries.map(|e| e.path()).filter(|p| p.to_string_lossy().ends_with("-video-index0")).collect();
    found.sort();
    match &found[..] {
        [one] => Ok(one.clone()),
        [] => Err(Trouble::device(format!("no video camera is in {BY_ID}"), CABLE)),
        more => {
            let names: Vec<String> = more.iter().map(|p| p.display().to_string()).collect();
            let remedy = "set v4l2.device to one of them";
            Err(Trouble::lasting(
                format!("there are {} video cameras: {}", more.len(), names.join(", ")),
                remedy,
            ))
        }
    }
}

/// A control's name as `v4l2-ctl` writes it: small letters, and one line for all that is no letter or digit.
fn plain(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}

impl Device {
    pub(super) fn open(settings: &Settings) -> Result<Self, Trouble> {
        let path = find(settings)?;
        let failed = |doing: &'static str| {
            let path = path.clone();
            move |e: io::Error| trouble(doing, &path, &e)
        };
        let device = v4l::Device::with_path(&path).map_err(failed("open"))?;
        let caps = device.query_caps().map_err(failed("say what it is"))?;
        if !caps.capabilities.contains(Flags::VIDEO_CAPTURE | Flags::STREAMING) {
            let cause = format!("{} ({}) delivers no stream of pictures", path.display(), caps.card);
            return Err(Trouble::lasting(cause, "set v4l2.device to the node that ends in -video-index0"));
        }
        let (wanted, name) = match settings.format {
            PixelFormat::Mjpeg => (FourCC::new(b"MJPG"), "mjpeg"),
            PixelFormat::Yuyv => (FourCC::new(b"YUYV"), "yuyv"),
        };
        let asked = Format::new(settings.width, settings.height, wanted);
        let got = device.set_format(&asked).map_err(failed("take its format"))?;
        if (got.width, got.height, got.fourcc) != (settings.width, settings.height, wanted) {
            let cause = format!(
                "the video camera {} gives {} × {} px as {} where {} × {} px as {name} are asked for",
                path.display(),
                got.width,
                got.height,
                got.fourcc,
                settings.width,
                settings.height
            );
            return Err(Trouble::lasting(cause, SETTINGS));
        }
        if settings.fps > 0 {
            let parameters = v4l::video::capture::Parameters::with_fps(settings.fps);
            device.set_params(&parameters).map_err(failed("take its number of frames"))?;
        }
        // Not every driver says it.
        let interval = device.params().ok().map(|p| p.interval).filter(|i| i.denominator > 0);
        let interval = interval.map_or(0.0, |i| f64::from(i.numerator) / f64::from(i.denominator));
        // A camera without controls answers with an error.
        let known = device.query_controls().unwrap_or_default();
        let mut opened = Self {
            settings: settings.clone(),
            path,
            card: caps.card,
            node: device,
            controls: known.into_iter().map(|d| (plain(&d.name), d)).collect(),
            stride: got.stride as usize,
            interval: Duration::from_secs_f64(interval.clamp(0.0, 1.0)),
            frames: None,
        };
        let unknown = opened.settings.controls.keys().find(|name| !opened.controls.contains_key(*name));
        if let Some(name) = unknown {
            let known: Vec<&str> = opened.controls.keys().map(String::as_str).collect();
            let cause = format!("the video camera has no control {name}; it has {}", known.join(", "));
            return Err(Trouble::lasting(cause, SETTINGS));
        }
        // It streams from here on: what is set before may be forgotten when the stream begins.
        opened.stream()?;
        opened.lock()?;
        Ok(opened)
    }

    pub(super) fn describe(&self) -> String {
        let s = &self.settings;
        let format = match s.format {
            PixelFormat::Mjpeg => "mjpeg",
            PixelFormat::Yuyv => "yuyv as PNG",
        };
        format!("{} ({}), {} × {} px, {format}", self.card, self.path.display(), s.width, s.height)
    }

    /// The stream; begun where there is none.
    fn stream(&mut self) -> Result<&mut Frames, Trouble> {
        if self.frames.is_none() {
            let patience = Duration::from_secs_f64(self.settings.frame_s);
            let begun = Frames::begin(&self.node, patience).map_err(|e| trouble("stream", &self.path, &e))?;
            self.frames = Some(begun);
        }
        let gone = || Trouble::device("the stream is gone", CABLE);
        self.frames.as_mut().ok_or_else(gone)
    }

    /// Sets every control that is asked for and reads it back. Whether there was anything to set.
    fn lock(&self) -> Result<bool, Trouble> {
        let mut set = false;
        let automatic = |name: &&String| !name.contains("auto");
        let mut names: Vec<&String> = self.settings.controls.keys().collect();
        names.sort_by_key(automatic);
        for name in names {
            let (Some(control), Some(&wanted)) = (self.controls.get(name), self.settings.controls.get(name))
            else {
                continue;
            };
            if self.value(name, control)? == wanted {
                continue;
            }
            set = true;
            let value = match control.typ {
                Type::Boolean => Value::Boolean(wanted != 0),
                _ => Value::Integer(wanted),
            };
            self.node.set_control(Control { id: control.id, value }).map_err(|e| {
                let limits = format!("{} to {}", control.minimum, control.maximum);
                let inactive = if control.flags.contains(ControlFlags::INACTIVE) {
                    "; it can't be set while an automatic one governs it"
                } else {
                    ""
                };
                let cause = format!("the video camera's {name} can't be {wanted} ({limits}): {e}{inactive}");
                Trouble::lasting(cause, SETTINGS)
            })?;
            let is = self.value(name, control)?;
            if is != wanted {
                let cause = format!("the video camera's {name} is {is} after {wanted} was set");
                return Err(Trouble::lasting(cause, SETTINGS));
            }
        }
        Ok(set)
    }

    fn value(&self, name: &str, control: &Description) -> Result<i64, Trouble> {
        match self.node.control(control.id).map(|c| c.value) {
            Ok(Value::Integer(value)) => Ok(value),
            Ok(Value::Boolean(value)) => Ok(value.into()),
            Ok(_) => Err(Trouble::lasting(format!("the video camera's {name} is no number"), SETTINGS)),
            Err(e) => Err(trouble(&format!("tell {name}"), &self.path, &e)),
        }
    }

    /// A picture that was begun after this call.
    pub(super) fn capture(&mut self) -> Result<Frame, Trouble> {
        let asked = super::stream::now();
        let end = Instant::now() + Duration::from_secs_f64(self.settings.shot_s * OWN_SHARE);
        // A frame's time may be that of its end: then it was begun up to a frame earlier.
        let mut after = asked;
        if self.lock()? {
            tracing::warn!("the video camera's controls had changed and were set again");
            after = super::stream::now();
        }
        let mut bad = Vec::new();
        loop {
            if Instant::now() > end {
                let cause = format!("no good frame came within {} s", self.settings.shot_s * OWN_SHARE);
                return Err(Trouble::device(cause, CABLE));
            }
            let (interval, path) = (self.interval, self.path.clone());
            let (format, stride) = (self.settings.format, self.stride);
            let (width, height) = (self.settings.width, self.settings.height);
            let made = self.stream()?.next(after, interval, |bytes| match format {
                PixelFormat::Mjpeg => picture::jpeg(bytes),
                PixelFormat::Yuyv => picture::yuyv(bytes, width, height, stride),
            });
            match made {
                Ok(Some(Ok(frame))) => return Ok(frame),
                Ok(Some(Err(reason))) => {
                    bad.push(reason);
                    if bad.len() == MOST_BAD {
                        let cause = format!("{MOST_BAD} frames in a row are bad: {}", bad.join(", "));
                        return Err(Trouble::device(cause, "check the cable; a long or thin one loses data"));
                    }
                }
                Ok(None) => {}
                // The kernel may own a buffer that the stream believes to be its own: only a new one is sound.
                Err(e) => {
                    self.frames = None;
                    if e.kind() != io::ErrorKind::TimedOut {
                        return Err(trouble("deliver a frame", &path, &e));
                    }
                    tracing::warn!(
                        "no frame came within {} s; the stream is built anew",
                        self.settings.frame_s
                    );
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_called_as_by_the_tool_that_lists_them() {
        assert_eq!(plain("Exposure Time, Absolute"), "exposure_time_absolute");
        assert_eq!(plain("White Balance, Automatic"), "white_balance_automatic");
        assert_eq!(plain("  Gain "), "gain");
    }

    #[test]
    fn errors_of_the_system_name_what_to_do() {
        let told = |errno: Errno| trouble("stream", Path::new("/dev/video9"), &errno.into());
        assert!(told(Errno::NOSPC).cause.contains("USB bandwidth"));
        assert!(told(Errno::ACCESS).remedy.contains("group") && told(Errno::ACCESS).lasting);
        assert!(told(Errno::NODEV).cause.contains("not there") && told(Errno::NODEV).reopen);
    }
}
