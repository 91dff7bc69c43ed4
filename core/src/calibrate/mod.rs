//! What the pictures say of the rig: scale, rotation axis, camera, and how the grain truly turned.

mod axis;
mod ball;
mod calibration;
mod closing;
mod fit;
mod measured;
mod pin;
mod profile;
mod refine;
mod scale;
mod support;
mod turning;
mod turntable;

pub use axis::{Axis, AxisError, AxisMethod, axis_from_closing_view, axis_from_tangency, find_axis};
pub use ball::{BallError, Disc, LEAST_RADIUS_PX, MOST_ELLIPTIC, MOST_UNROUND, fit_disc};
pub use calibration::{Calibration, Finding, FindingKind, Rotation, ViewCalibration};
pub use fit::PedestalObservation;
pub use measured::{How, Measured};
pub use pin::{MOST_CROOKED, PinError, Sides, fit_sides};
pub use refine::{Known, SeenView, calibrate};
pub use scale::{
    Artefact, MOST_DISAGREEMENT, NEAREST_CAMERA_MM, Observation, Scale, ScaleError, UncertaintyBudget,
    pixel_size,
};
pub use turntable::Turntable;
