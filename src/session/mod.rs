//! The session: a folder that holds everything a run saw and did.
//!
//! ```text
//! DATA/NAME/manifest.json    what it was to be; written once, first link of the chain of hashes
//!           journal.jsonl    what happened, a line each, each with the hash of the line before
//!           frames/          the camera's own bytes
//!           products/        what was computed from them
//!           compressions/    the grain between two plates, a folder for each; no part of what was recorded
//!           lock             held by the one process that writes
//! ```
//!
//! A view is captured when its bytes are written, synced, hashed and journalled, in that order.

pub mod cameras;
mod disk;
mod error;
pub mod event;
pub mod import;
pub mod journal;
pub mod manifest;
mod name;
mod pattern;
pub mod picture;
mod recording;
pub mod replay;
mod store;
mod verify;
mod writer;

pub use disk::{Held, LOCK, check_space, free_bytes, hold, sha256_hex, sha256_of, write_whole};
pub use error::SessionError;
pub use manifest::{Manifest, Origin, Plan, PlannedView, required_bytes};
pub use name::check_name;
pub use recording::{Recording, State};
pub use store::{Staged, Store, Summary};
pub use verify::{Fault, VerifyReport, verify};
pub use writer::{ProductWriter, Session};
