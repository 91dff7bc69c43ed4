//! A DSLR by libgphoto2, in a child process of its own.
//!
//! A wedged camera holds whoever called the C library, for ever, and a crash in it takes the process along. So the
//! library lives in a child, `grainrig camera-worker`, which is killed and started again as often as it takes:
//!
//! ```text
//!  GphotoCamera ──▶ Worker ══ stdin, stdout: framed messages (wire, message) ══▶ camera-worker ──▶ libgphoto2 ──▶ camera
//!   tries, waits,    deadline,                                                    one thread,
//!   suspends         SIGKILL                                                      no state worth keeping
//! ```
//!
//! This side has no line of C in it and is part of every build. The child's side is the feature `gphoto2`.

mod camera;
mod home;
mod message;
mod policy;
mod settings;
mod supervisor;
mod wire;
pub mod worker;

pub use camera::{GphotoCamera, Launch};
pub use settings::{Settings, Target};
