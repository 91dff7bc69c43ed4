//! grainrig turns a stepper motor, a camera and one sand grain into a numerical grain.
//!
//! This is the program: rig, acquisition, sessions, the daemon and its page. What it computes is in `grainrig-core`. The rooms,
//! from the top of the house down; a room imports only rooms below it, which `tests/layering.rs` proves. Lengths are mm, angles
//! radians inside; see `ARCHITECTURE.md`.

pub mod acquire;
pub mod cli;
pub mod config;
pub mod jobs;
pub mod pipeline;
pub mod rig;
pub mod server;
pub mod session;
pub mod system;
pub mod trace;
