//! What the pictures say of the rig: scale, rotation axis, camera, and how the grain truly turned.

mod axis;
mod calibration;
mod fit;
mod measured;
mod profile;
mod refine;
mod support;
mod turning;
mod turntable;

pub use axis::{Axis, AxisError, AxisMethod, axis_from_closing_view, axis_from_tangency, find_axis};
pub use calibration::{Calibration, Finding, FindingKind, Rotation, ViewCalibration};
pub use measured::{How, Measured};
pub use refine::{Known, SeenView, calibrate};
pub use turntable::Turntable;
