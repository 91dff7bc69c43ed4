//! What grainrig computes: from photographs of a turning sand grain to its outlines, its visual hull, its meshes and its response
//! to being compressed between two plates.
//!
//! Pure computation: no files, clock, threads of its own, logging or async; `rayon` alone. The same input gives the same bits on
//! any number of cores. Lengths are mm, forces N, stresses MPa, masses tonnes, times s; angles are radians inside.
//!
//! The rooms, from the top down; a room imports only rooms below it.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`study`] | the method held against bodies of known volume |
//! | [`report`] | figures: curves, outlines, fields, as SVG and as pixels |
//! | [`formats`] | photographs, voxels and meshes read; decks and meshes written |
//! | [`contact`] | a meshed grain between two rigid plates: explicit dynamics, curves, Hertz, laboratory tests |
//! | [`mesh`] | surfaces and solids in triangles and tetrahedra |
//! | [`register`] | one grain seen in two poses |
//! | [`hull`] | what all silhouettes share: volume, surface, an interval for the grain's own volume |
//! | [`calibrate`] | the rotation axis, the camera and each view's angle, from outlines alone |
//! | [`silhouette`] | the grain's outline in a photograph, to a fraction of a pixel, and whether it can be trusted |
//! | [`geometry`] | points, transforms, cameras, angles |
//! | [`plausible`] | figures that look like slips of unit |
//!
//! A body is anything that is negative inside (a hull, a surface, a ball), and is meshed as such:
//!
//! ```
//! use grainrig_core::geometry::{Ball, Point};
//! use grainrig_core::mesh::{Controls, mesh};
//!
//! let ball = Ball { center: Point::origin(), radius_mm: 0.5 };
//! let controls = Controls { surface_size_mm: 0.15, ..Controls::for_size(2.0) };
//! let tets = mesh(&ball, &controls, &mut |_| ())?;
//! assert!((tets.volume_mm3() / 0.5236 - 1.0).abs() < 0.01);
//! assert!(tets.quality().dihedral_deg.min > 15.0);
//! # Ok::<(), grainrig_core::mesh::MeshError>(())
//! ```
//!
//! Larger ones, each narrated: `examples/silhouettes_to_hull.rs`, `body_to_abaqus.rs`, `sphere_between_plates.rs`.

pub mod calibrate;
pub mod contact;
pub mod formats;
pub mod geometry;
pub mod hull;
pub mod mesh;
pub mod plausible;
pub mod register;
pub mod report;
pub mod silhouette;
pub mod study;
