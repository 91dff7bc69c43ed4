//! A program without the library says so.

use super::super::message::{Failure, FailureKind, Reply};
use super::super::settings::Settings;
use super::NamedFile;

/// There is none.
pub(super) enum Body {}

impl Body {
    pub(super) fn open(_: Settings, _: bool) -> Result<(Self, Reply), Failure> {
        let cause = "this grainrig was built without libgphoto2: it can't drive a DSLR";
        Err(Failure::new(FailureKind::Unsupported, cause))
    }
    pub(super) fn capture(&mut self) -> Result<(Vec<NamedFile>, Vec<String>), Failure> {
        match *self {}
    }
    pub(super) fn ready(&mut self) -> Result<Vec<String>, Failure> {
        match *self {}
    }
    pub(super) fn released(&mut self) -> Result<Vec<NamedFile>, Failure> {
        match *self {}
    }
    pub(super) fn preview(&mut self) -> Result<(Vec<NamedFile>, Vec<String>), Failure> {
        match *self {}
    }
    pub(super) fn leave(&self) {
        match *self {}
    }
    pub(super) fn kept(&mut self) {
        match *self {}
    }
}
