//! A video camera in user space: `video_camera.c`, which comes into a program when that starts, and its pictures.

// Each test file uses its own part of this.
#![allow(dead_code)]

use crate::skip::{Lacking, skip};
use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;

/// What the device is told by, in a program's environment: its path; the folder of its pictures and its fault; who is asked
/// for each picture instead; and the size of the pictures, where that is not 324 × 216.
pub const DEVICE: &str = "GRAINRIG_VIDEO";
pub const FOLDER: &str = "GRAINRIG_VIDEO_DIR";
pub const SCENE: &str = "GRAINRIG_VIDEO_SCENE";
pub const SIZE: &str = "GRAINRIG_VIDEO_SIZE";

/// The device, compiled; `None` without a compiler of C.
pub fn library() -> Option<&'static Path> {
    static MADE: OnceLock<Option<(TempDir, PathBuf)>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let library = dir.path().join("video_camera.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/support/video_camera/video_camera.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O2", "-pthread", "-o"]).arg(&library).arg(source).arg("-ldl");
        match compiler.output() {
            Ok(done) => {
                assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
                Some((dir, library))
            }
            Err(e) => {
                skip(Lacking::Tools, format_args!("no C compiler `cc` ({e}); install gcc"));
                None
            }
        }
    });
    made.as_ref().map(|(_, library)| library.as_path())
}

/// A picture as brightness and colour (ITU-R BT.601, limited range), the colour of two pixels together.
pub fn yuyv(file: &[u8]) -> Vec<u8> {
    let picture = image::load_from_memory(file).unwrap().to_rgb8();
    let level = |x: f32| x.round() as u8;
    let pair = |two: &[u8]| {
        let [[r0, g0, b0], [r1, g1, b1]] = [0, 3].map(|at| [0, 1, 2].map(|k| f32::from(two[at + k]) / 255.0));
        let bright = |r: f32, g: f32, b: f32| level(16.0 + 65.481 * r + 128.553 * g + 24.966 * b);
        let (r, g, b) = (0.5 * (r0 + r1), 0.5 * (g0 + g1), 0.5 * (b0 + b1));
        let blue = level(128.0 - 37.797 * r - 74.203 * g + 112.0 * b);
        let red = level(128.0 + 112.0 * r - 93.786 * g - 18.214 * b);
        [bright(r0, g0, b0), blue, bright(r1, g1, b1), red]
    };
    picture.as_raw().chunks_exact(6).flat_map(pair).collect()
}

/// Answers a device that asks for each of its pictures, until the program that it is in has ended. The answer is what is
/// before the lens at that instant: the device has dated the picture before it asks.
pub fn answer(listener: UnixListener, mut picture: impl FnMut() -> Vec<u8> + Send + 'static) {
    std::thread::spawn(move || {
        for asking in listener.incoming() {
            let mut asking = asking.unwrap();
            // Whoever hangs up wants no more.
            while asking.read_exact(&mut [0]).is_ok() {
                let bytes = picture();
                let length = (bytes.len() as u32).to_le_bytes();
                if asking.write_all(&length).and_then(|()| asking.write_all(&bytes)).is_err() {
                    break;
                }
            }
        }
    });
}
