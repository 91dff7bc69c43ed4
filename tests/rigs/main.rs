//! Whole rigs: 25 views by the real program through the real firmware on a simulated chip and a simulated camera that looks at
//! the grain at the angle which the pins have reached, up to hull and mesh; held against the simulated rig.

#[cfg(any(feature = "gphoto2", feature = "v4l"))]
#[path = "../support/board/mod.rs"]
mod board;
#[cfg(feature = "gphoto2")]
mod eos;
#[cfg(any(feature = "gphoto2", feature = "v4l"))]
mod grain;
#[cfg(any(feature = "gphoto2", feature = "v4l"))]
#[path = "../support/kit/mod.rs"]
mod kit;
#[cfg(feature = "gphoto2")]
#[path = "../support/ptp_camera/mod.rs"]
mod ptp_camera;
#[path = "../support/skip.rs"]
mod skip;
#[cfg(feature = "v4l")]
mod video;
#[cfg(feature = "v4l")]
#[path = "../support/video_camera/mod.rs"]
mod video_camera;
