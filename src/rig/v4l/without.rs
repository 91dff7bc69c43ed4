//! A program without the driver says so.

use super::camera::Trouble;
use super::settings::Settings;
use crate::rig::Frame;

/// There is none.
pub(super) enum Device {}

impl Device {
    pub(super) fn open(_: &Settings) -> Result<Self, Trouble> {
        let remedy = "use a program that was built with `--features v4l`";
        Err(Trouble::lasting("this grainrig was built without the driver of video cameras", remedy))
    }
    pub(super) fn describe(&self) -> String {
        match *self {}
    }
    pub(super) fn capture(&mut self) -> Result<Frame, Trouble> {
        match *self {}
    }
}
