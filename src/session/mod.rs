//! The session: a folder that holds everything a run saw and did.
//!
//! ```text
//! DATA/NAME/manifest.json    what it was to be; written once, first link of the chain of hashes
//!           journal.jsonl    what happened, a line each, each with the hash of the line before
//!           frames/          the camera's own bytes
//!           products/        what was computed from them
//!           products.next/   a set of products that is about to take their place
//!           rejected/        pictures that were refused, for whoever looks for the cause; no part of what was recorded
//!           compressions/    the grain between two plates, a folder for each; no part of what was recorded
//!           lock             held by the one process that writes
//! ```
//!
//! A view is captured when its bytes are written, synced, hashed and journalled, in that order.

pub mod cameras;
mod disk;
mod error;
pub mod event;
mod exchange;
mod finite;
mod hashes;
pub mod import;
pub mod journal;
pub mod manifest;
mod name;
mod open;
mod pattern;
pub mod picture;
mod products;
mod recording;
mod rejected;
mod remove;
pub mod replay;
mod store;
mod summaries;
mod verify;
mod writer;

pub use disk::{Held, LOCK, check_space, free_bytes, hold, sha256_hex, sha256_of, write_whole};
pub use error::SessionError;
pub use exchange::{Exchange, ExchangeName, ExchangedFile, NewFile};
pub use finite::{EncodeError, check_finite, to_json, to_json_value};
pub use hashes::{Hashes, Identity};
pub use manifest::{Manifest, MergeSource, Origin, Plan, PlannedView, required_bytes};
pub use name::check_name;
pub use open::{open_inside, read_inside, read_named};
pub use recording::{Recording, State};
pub use rejected::Rejection;
pub use remove::remove;
pub use store::{Staged, Store};
pub use summaries::Summary;
pub use verify::{Fault, VerifyReport, damage, verify};
pub use writer::{ProductWriter, Session, as_recorded};
