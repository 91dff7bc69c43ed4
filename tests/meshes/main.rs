//! Meshes as files: `grainrig mesh`, and other programs that read what it writes.

mod calculix;
mod gmsh;
mod mesh_cli;
#[path = "../support/skip.rs"]
mod skip;
