//! A video camera by V4L2: a UVC camera, a frame grabber.
//!
//! The device belongs to a thread of its own, which is asked with a deadline; what a driver does to it (or what the
//! crate's stream does when the device is pulled out) does not reach the run.
//!
//! ```text
//!  V4lCamera ──▶ Asked ══ bounded channel ══▶ thread: device, stream ──▶ kernel
//!   tries, waits,  deadline                    frames older than the question are dropped
//!   suspends
//! ```

mod camera;
#[cfg(feature = "v4l")]
mod device;
mod picture;
mod settings;
#[cfg(feature = "v4l")]
mod stream;
#[cfg(not(feature = "v4l"))]
mod without;

pub use camera::V4lCamera;
pub use settings::{PixelFormat, Settings};
