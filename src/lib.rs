//! grainrig turns a stepper motor, a camera and one sand grain into a numerical grain.
//!
//! The rooms, from the top of the house to its foundation; a room imports only rooms below it, which
//! `tests/layering.rs` proves. Lengths are mm, angles radians inside; see `ARCHITECTURE.md`.

pub mod acquire;
pub mod cli;
pub mod config;
pub mod daemon;
pub mod export;
pub mod pipeline;
pub mod report;
pub mod rig;
pub mod server;
pub mod session;
pub mod study;
pub mod system;
// Below this line: pure computation. No files, clock, threads of its own, logging or async; rayon only.
pub mod calibrate;
pub mod contact;
pub mod geometry;
pub mod hull;
pub mod mesh;
pub mod plausible;
pub mod register;
pub mod silhouette;
