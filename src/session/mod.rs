//! The session: a folder that holds everything a run saw and did.

pub mod event;
