//! What the pictures say of the rig: the rotation axis, the camera of each view.

mod axis;
mod measured;
mod turntable;

pub use axis::{Axis, AxisError, AxisMethod, axis_from_closing_view, axis_from_tangency, find_axis};
pub use measured::{How, Measured};
pub use turntable::Turntable;
