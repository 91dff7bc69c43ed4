//! From a photograph to the outline of the grain.
//!
//! ```text
//! source ─▶ frame ─▶ reduced ─▶ backdrop, channel, polarity, region ─▶ plane (full resolution, region only)
//!                                                                             │
//!     silhouette ◀── distance ◀── outline ◀── pedestal, holes ◀── threshold ◀─┘
//! ```
//!
//! A mask that is one pixel too large everywhere costs 1.2 % of a grain's volume, so the outline is placed
//! between pixels, where the grey value is half-way between the grain and the background beside it.

mod backdrop;
mod channel;
mod despeckle;
mod distance;
mod error;
mod field;
mod find;
mod frame;
mod holes;
mod ideal;
mod mask;
mod otsu;
mod outline;
mod pedestal;
mod picture;
mod pieces;
mod plain;
mod plane;
mod quality;
mod quiet;
mod rect;
mod recut;
mod reduced;
mod report;
mod search;
mod settings;
mod shine;
mod source;

pub use channel::Channel;
pub use error::SilhouetteError;
pub use field::Silhouette;
pub use find::{Found, find};
pub use otsu::{Histogram, Split2, Split3};
pub use pedestal::{Joint, Stand, Uncut, joint_stand};
pub use picture::Picture;
pub use quality::{Bound, Check, Placed, Traits, Verdict, ViewQuality, against, assess, between, sharpness};
pub use report::{PedestalSeen, Report, Side};
pub use settings::{Classes, Holes, PedestalMode, Polarity, Settings};
pub use source::{Grid, Source};
