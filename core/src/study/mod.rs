//! Studies of the method on bodies whose volume is known.

mod body;
mod picture;
mod sensitivity;
mod views;

pub use body::Body;
pub use picture::{curves, shapes, silhouettes, table};
pub use sensitivity::{Ratios, Row, Study, StudyError, sensitivity};
