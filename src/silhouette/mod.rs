//! From a photograph to the outline of the grain.

mod field;

pub use field::Silhouette;
