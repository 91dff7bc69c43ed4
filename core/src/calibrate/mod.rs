//! Calibration from the pictures: scale, rotation axis, camera, and how the grain truly turned.
//!
//! | symbol | in the code | what it is | unit |
//! | --- | --- | --- | --- |
//! | x, y, z | [`Point`](crate::geometry::Point) | a point of the grain at stage angle 0, world frame | mm |
//! | x′, y′ | | the same turned by the stage: x′ to the right, y′ away from the camera | mm |
//! | θ | `angle` | angle of the grain, counter-clockwise seen from above | rad |
//! | m | `mm_per_px` | size of a pixel at the axis | mm/px |
//! | c | `axis_column_px` | column of the axis in the row r₀ | px |
//! | r₀ | `origin_row_px` | row of z = 0 | px |
//! | ρ | `roll_rad` | roll: the axis leans to smaller columns towards the top | rad |
//! | ε | `elevation_rad` | elevation: rise of the view rays going away from the camera, at the axis' foot | rad |
//! | D | `camera_distance_mm` | distance from the centre of projection to the axis; ∞ for a telecentric lens | mm |
//! | q | `RECIPROCAL` | reciprocal distance m/D | 1/px |
//! | b | `offset_px` | a view's own sideways shift; its standard deviation is the radial runout | px |
//! | α | `ahead_rad` | how far the grain is ahead of the stage in a view | rad |
//! | h(t, z) | `reach_px` | support function of the slice at the height z in the direction t: how far it reaches | px |
//! | h′, `h_z` | `along`, `up` | its derivatives along t and along z | px, 1 |
//!
//! **Projection** ([`Turntable`]): a pinhole, or parallel rays for D = ∞, before a turning grain.
//!
//! ```text
//! x′ = x cos θ − y sin θ,   y′ = x sin θ + y cos θ,   w = 1 + y′/D
//! u = x′/(m w),             v = (ε y′ − z)/(m w)
//! column = c + b + u cos ρ + v sin ρ
//! row    = r₀    − u sin ρ + v cos ρ
//! ```
//!
//! **Reaches** (`fit.rs`): to the first order a view at θ reaches to the right (s = 1, t = θ) and to the left (s = −1, t = θ + π) by
//!
//! ```text
//! r = h(t, z) + s (δc + b) − s ρ (z + h h_z) + s q h′ (h − z h_z) − s ε h′ h_z + α h′
//! ```
//!
//! with h a random function of t and z (`support.rs`); δc and ρ are corrections to the line that the reaches are read about, and what is
//! known of q and ε is taken out exactly before (`round.rs`).
//!
//! **Frontier points** (`frontier.rs`): two views Δ apart are touched from above at pictures of one point, v downwards,
//!
//! ```text
//! min (v₁ + a u₁) = min (v₂ − a u₂),   a = (ε + q z) tan ½Δ   at the top's height z
//! ```
//!
//! **Closing views** (`closing.rs`): two views that see the same outline, Δ apart by the stage, where the grain turned by Δ + δ:
//!
//! ```text
//! r₂ − r₁ − Δ h′ = δ h′ + s b + µ s (2 q h′ (h − z h_z) − 2 ε h′ h_z − ρ (z + h h_z))
//! ```
//!
//! s is the side of the second; µ = 1 where one sees the other's mirror image (half a turn), 0 where it sees the same (a whole one).
//!
//! Sources: support functions, Rockafellar, Convex Analysis, 1970, §13; epipolar tangency of turntable outlines, Mendonça, Wong and
//! Cipolla 2001; random functions, Rasmussen and Williams 2006.

mod axis;
mod ball;
mod calibration;
mod closing;
mod fit;
mod frontier;
mod measured;
mod pin;
mod profile;
mod refine;
mod rig;
mod round;
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
