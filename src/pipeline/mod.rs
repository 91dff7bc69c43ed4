//! The order of the stages: photograph → silhouette → calibrate → hull → mesh → files.
//!
//! The only place that knows it. Views come in over a bounded channel while the stage still turns; each is
//! decoded, cut out and carved into a live hull at once. When the last one is in, the axis is measured from
//! opposite silhouettes, the hull is carved again with the measured cameras, meshed and written.

mod agree;
mod cameras;
mod convergence;
mod held;
mod merge;
mod pedestal;
mod pictures;
mod pose;
mod products;
mod quality;
mod reconstruct;
mod result;
mod settings;
mod stream;
mod verdict;

pub use convergence::{CONVERGENCE, Convergence};
pub use merge::{MergeResult, Merged, PoseResult, merge};
pub use pedestal::ContactPatch;
pub use pictures::{OUTLINE, SHEET};
pub use pose::SeenPose;
pub use products::{Product, products};
pub use quality::Gate;
pub use reconstruct::{Reconstruction, SegmentedView};
pub use result::{
    AxisResult, HullMethod, HullResult, MeshResult, ResultFile, ResultHead, Timing, ViewResult,
};
pub use settings::{
    Cameras, HullSettings, LengthUnit, MeshSettings, ReportSettings, Settings, TurntableSettings,
};
pub use stream::{Observer, Pipeline, SegmentedPicture, View};
pub use verdict::ResultVerdict;

use grainrig_core::calibrate::AxisError;
use grainrig_core::formats::ExportError;
use grainrig_core::hull::HullError;
use grainrig_core::mesh::MeshError;
use grainrig_core::register::RegisterError;
use grainrig_core::silhouette::SilhouetteError;

/// Why a view can't be used; whoever reads it knows which.
#[derive(Debug, thiserror::Error)]
pub enum ViewFault {
    /// Its picture could not be read.
    #[error("the picture ({bytes} bytes) cannot be decoded: {reason}; take the view again or remove it")]
    Decode {
        /// Size of the file.
        bytes: usize,
        /// What the decoder says.
        reason: String,
    },
    /// No silhouette in it.
    #[error(transparent)]
    Silhouette(#[from] SilhouetteError),
    /// A grain that leaves the picture, where the whole grain is needed.
    #[error(
        "the grain reaches the {side} border of the picture, so part of it is not seen; centre the grain or use a smaller \
         magnification"
    )]
    CutByBorder {
        /// Which border.
        side: &'static str,
    },
}

impl ViewFault {
    /// As the fault of a view.
    pub fn of(self, view: usize) -> PipelineError {
        PipelineError::View { view, fault: self }
    }
}

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// A view that can't be used.
    #[error("view {view}: {fault}")]
    View {
        /// Index of the view.
        view: usize,
        /// Why not.
        fault: ViewFault,
    },
    /// A picture has another size than the first.
    #[error(
        "view {view} is {width} × {height} px, the first view is {expected_width} × {expected_height} px; all views \
         of a session must come from one camera setting"
    )]
    Size {
        /// Index of the view.
        view: usize,
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
        /// The first view's width.
        expected_width: usize,
        /// The first view's height.
        expected_height: usize,
    },
    /// A setting of the silhouettes makes no sense.
    #[error(transparent)]
    Silhouettes(SilhouetteError),
    /// A view has no camera.
    #[error("view {view} has no camera; {cameras} cameras were given")]
    NoCamera {
        /// Index of the view.
        view: usize,
        /// How many there are.
        cameras: usize,
    },
    /// Too few views arrived.
    #[error("{got} of {expected} views are there; resume the session, or import the missing pictures")]
    MissingViews {
        /// Views that arrived.
        got: usize,
        /// Views in the plan.
        expected: usize,
    },
    /// A figure that looks like a slip of unit.
    #[error(transparent)]
    Doubt(#[from] grainrig_core::plausible::Doubt),
    /// A setting is outside its limits.
    #[error(
        "{name} is {value} {unit}, it must be {limit}; change it in the configuration or on the command line"
    )]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What is allowed.
        limit: &'static str,
    },
    /// The axis can't be found.
    #[error(transparent)]
    Axis(#[from] AxisError),
    /// The silhouettes have no hull.
    #[error(transparent)]
    Hull(#[from] HullError),
    /// Lengths without a unit, where two sessions must have the same.
    #[error(
        "session {session}: its cameras have no unit of length, so its size cannot be compared with another session's; \
         import the pictures with cameras in mm (--camera-unit mm)"
    )]
    NoUnit {
        /// Name of the session.
        session: String,
    },
    /// Two poses can't be put together.
    #[error(transparent)]
    Register(#[from] RegisterError),
    /// The hull can't be meshed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A picture can't be drawn.
    #[error("{file} cannot be drawn: {reason}; run without pictures (--no-pictures)")]
    Drawing {
        /// The product.
        file: String,
        /// What the encoder says.
        reason: String,
    },
    /// A product can't be written.
    #[error(transparent)]
    Export(#[from] ExportError),
}
