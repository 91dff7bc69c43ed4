//! Whether a view is good enough to carve with: focus, motion blur, light, and whether it fits the views beside it.

mod assess;
mod check;
mod edge;
mod motion_blur;
mod neighbours;
mod sharpness;

pub use assess::{Traits, assess};
pub use check::{Bound, Check, Verdict, ViewQuality};
pub use neighbours::{ViewTraits, against, between};
pub use sharpness::sharpness;
