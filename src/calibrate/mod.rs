//! What the pictures say of the rig: the size of a pixel, the rotation axis, the camera of each view.

mod axis;
mod ball;
mod measured;
mod pin;
mod scale;
mod turntable;

pub use axis::{Axis, AxisError, AxisMethod, axis_from_closing_view, axis_from_tangency, find_axis};
pub use ball::{BallError, Disc, LEAST_RADIUS_PX, MOST_ELLIPTIC, MOST_UNROUND, fit_disc};
pub use measured::{How, Measured};
pub use pin::{MOST_CROOKED, PinError, Sides, fit_sides};
pub use scale::{
    Gauge, MOST_DISAGREEMENT, NEAREST_CAMERA_MM, Parts, Scale, ScaleError, Sighting, pixel_size,
};
pub use turntable::Turntable;
