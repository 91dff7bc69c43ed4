//! Whether a view is good enough to carve with: focus, motion blur, light, and whether it fits the views beside it.

mod assess;
mod check;
mod edge;
mod neighbours;
mod sharpness;
mod smear;

pub use assess::{Traits, assess};
pub use check::{Bound, Check, Verdict, ViewQuality};
pub use neighbours::{Placed, against, between};
pub use sharpness::sharpness;
