//! A camera on the bench: what it looks at can be changed, and a picture tells what it shows.

use crate::kit::pictures;
use grainrig::rig::{Camera, Frame};
use std::sync::OnceLock;

/// What the camera looks at: one of the kit's pictures.
pub struct Bench {
    pub camera: Box<dyn Camera>,
    /// Puts a scene before the camera.
    pub set: Box<dyn FnMut(usize)>,
}

/// Scenes that are told apart.
pub const SCENES: usize = 4;

/// Which scene a picture shows: the one that it is most alike.
pub fn scene(frame: &Frame) -> usize {
    static SHADES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let references = SHADES.get_or_init(|| pictures()[..SCENES].iter().map(|bytes| shades(bytes)).collect());
    let seen = shades(&frame.bytes);
    let far = |r: &Vec<u8>| r.iter().zip(&seen).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
    (0..SCENES).min_by_key(|n| far(&references[*n])).unwrap()
}

fn shades(bytes: &[u8]) -> Vec<u8> {
    image::load_from_memory(bytes).unwrap().to_luma8().into_raw()
}
