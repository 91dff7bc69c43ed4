//! One suite for every camera, and what becomes of a picture when a real camera fails.

mod bench;
mod conformance;
#[cfg(feature = "gphoto2")]
mod faults;
mod folder;
#[path = "../support/kit/mod.rs"]
mod kit;
#[cfg(feature = "gphoto2")]
mod live;
#[cfg(feature = "gphoto2")]
mod network;
#[cfg(feature = "gphoto2")]
#[path = "../support/ptp_camera/mod.rs"]
mod ptp_camera;
#[cfg(feature = "gphoto2")]
mod runs;
#[path = "../support/skip.rs"]
mod skip;
#[cfg(feature = "v4l")]
mod video;
#[cfg(feature = "v4l")]
#[path = "../support/video_camera/mod.rs"]
mod video_camera;
