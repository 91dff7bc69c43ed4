//! The simulated camera: a view of the scene at the stage's true angle, with shot noise, as a JPEG file.

use super::jpeg::{self, STRIP_ROWS, Strip};
use super::random::{self, Normal, Purpose};
use super::scene::{Patch, Scene, Spoiled};
use super::stage::lock;
use super::{Exposure, Settings, Shared, exif};
use crate::rig::{Camera, Encoding, Frame, RigError};
use grainrig_core::geometry::Angle;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Blue and red chrominance of lamp and tube (nearly neutral), and of the grain (sand).
const NEUTRAL: [f32; 2] = [127.0, 129.0];
const SAND: [f32; 2] = [117.0, 136.0];
/// Noise of a chrominance that the file stores, over that of the luminance: red, green and blue pixels are equally
/// noisy, and the file stores the mean of four.
const CHROMA_NOISE: f32 = 0.46;

/// What a camera out of focus adds to the lens's blur, pixels.
const DEFOCUS_PX: f64 = 8.0;
/// How far the picture moves during a shaken exposure, pixels.
const SHAKE_PX: f64 = 24.0;
/// Twice the light: one stop.
const OVEREXPOSED: f32 = 2.0;

/// The camera. The same settings, true angle and exposure number give the same bytes.
pub struct SimulatedCamera {
    scene: Arc<Scene>,
    shared: Arc<Mutex<Shared>>,
    normal: Normal,
    exposures: usize,
    /// The file that was delivered last.
    last: Vec<u8>,
}

/// What the faults do to the exposure of this number.
fn spoiled(settings: &Settings, number: usize) -> Spoiled {
    let faults = &settings.faults;
    let clean = Spoiled::default();
    Spoiled {
        defocus_px: if faults.spoils(faults.blurred_frame_at, number) {
            DEFOCUS_PX
        } else {
            clean.defocus_px
        },
        shake_px: if faults.spoils(faults.shaken_frame_at, number) { SHAKE_PX } else { clean.shake_px },
        light: if faults.spoils(faults.overexposed_frame_at, number) { OVEREXPOSED } else { clean.light },
        obstructed: faults.spoils(faults.obstructed_frame_at, number),
    }
}

/// A picture of half the width and height.
fn halved(jpeg: &[u8]) -> Result<Vec<u8>, RigError> {
    let trouble = |e: image::ImageError| RigError::Device(format!("the simulated camera's picture: {e}"));
    let whole = image::load_from_memory(jpeg).map_err(trouble)?;
    let half = whole.thumbnail_exact(whole.width() / 2, whole.height() / 2);
    let mut out = std::io::Cursor::new(Vec::new());
    half.write_to(&mut out, image::ImageFormat::Jpeg).map_err(trouble)?;
    Ok(out.into_inner())
}

impl SimulatedCamera {
    pub(super) fn new(scene: Arc<Scene>, shared: Arc<Mutex<Shared>>, exposures: usize) -> Self {
        Self { scene, shared, normal: Normal::new(), exposures, last: Vec::new() }
    }

    /// One strip of the picture, with noise.
    fn strip(&self, n: usize, noise: u64, patch: &Patch, light: f32) -> Strip {
        let [width, height] = self.scene.optics.picture;
        let rows = n * STRIP_ROWS..((n + 1) * STRIP_ROWS).min(height);
        let [left, top] = patch.window.origin;
        let [wide, high] = patch.window.size;
        let mut line = vec![0f32; width];
        let mut tint = vec![0f32; width];
        let mut grains = vec![0f32; width.div_ceil(2)];
        let plane = || vec![0; width * rows.len()];
        let mut strip = Strip { luma: plane(), chroma: [plane(), plane()], width };
        for (i, row) in rows.enumerate() {
            let here = i * width..(i + 1) * width;
            let down = self.scene.background_down(row);
            for (x, across) in line.iter_mut().zip(self.scene.background_across()) {
                *x = across * down;
            }
            tint.fill(0.0);
            if (top..top + high).contains(&row) {
                let from = (row - top) * wide;
                line[left..left + wide].copy_from_slice(&patch.level[from..from + wide]);
                tint[left..left + wide].copy_from_slice(&patch.grain[from..from + wide]);
            }
            line.iter_mut().for_each(|x| *x *= light);
            self.expose(&line, random::bits(noise, row as u64), &mut strip.luma[here.clone()]);
            for (k, plane) in strip.chroma.iter_mut().enumerate() {
                // Two rows share their noise, as they share what the file stores.
                let key = random::bits(noise ^ (k as u64 + 1), row as u64 / 2);
                self.colour_noise(&line, key, &mut grains);
                for (x, pixel) in plane[here.clone()].iter_mut().enumerate() {
                    let level = NEUTRAL[k] + tint[x] * (SAND[k] - NEUTRAL[k]) + grains[x / 2];
                    *pixel = (level + 0.5) as u8;
                }
            }
        }
        strip
    }

    /// The noise of a chrominance along a row, a value for each two pixels; `key` is the row pair's own.
    fn colour_noise(&self, line: &[f32], key: u64, out: &mut [f32]) {
        const DRAWS: usize = (u64::BITS / Normal::BITS) as usize;
        let per_root = CHROMA_NOISE * self.scene.settings.noise_sd as f32 / 128f32.sqrt();
        for (n, (levels, values)) in line.chunks(2 * DRAWS).zip(out.chunks_mut(DRAWS)).enumerate() {
            let mut bits = random::bits(key, n as u64);
            for (level, value) in levels.iter().step_by(2).zip(values) {
                *value = per_root * level.max(0.0).sqrt() * self.normal.pick(bits);
                bits >>= Normal::BITS;
            }
        }
    }

    /// Adds shot noise to a row and rounds it to grey levels; `key` is the row's own.
    fn expose(&self, line: &[f32], key: u64, out: &mut [u8]) {
        const DRAWS: usize = (u64::BITS / Normal::BITS) as usize;
        // The variance of counted photons is proportional to their number.
        let per_root = self.scene.settings.noise_sd as f32 / 128f32.sqrt();
        for (n, (levels, pixels)) in line.chunks(DRAWS).zip(out.chunks_mut(DRAWS)).enumerate() {
            let mut bits = random::bits(key, n as u64);
            for (level, pixel) in levels.iter().zip(pixels) {
                let noisy = level + per_root * level.max(0.0).sqrt() * self.normal.pick(bits);
                bits >>= Normal::BITS;
                // `as` rounds towards zero and stops at 0 and 255, as a full or an empty pixel does.
                *pixel = (noisy + 0.5) as u8;
            }
        }
    }
}

impl Camera for SimulatedCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        let settings = &self.scene.settings;
        let faults = &settings.faults;
        let number = self.exposures;
        self.exposures += 1;
        let slow_s = faults.camera_slow.filter(|s| s.at == number).map_or(0.0, |s| s.seconds);
        if settings.realtime {
            std::thread::sleep(Duration::from_secs_f64(settings.exposure_s + slow_s));
        }
        let wobble_px = self.scene.wobble_px(number, &self.normal);
        let slipped = faults.slip.filter(|s| number >= s.at).map_or(0.0, |s| s.deg);
        let mut shared = lock(&self.shared);
        let angle = shared.stage_angle + Angle::from_deg(slipped);
        shared.time_s += settings.exposure_s + slow_s;
        let time_s = shared.time_s;
        shared.exposures.push(Exposure { number, true_angle_deg: angle.deg(), wobble_px, time_s });
        drop(shared);
        faults.camera_answers(number)?;
        let mut bytes = Vec::new();
        if faults.spoils(faults.repeated_frame_at, number) && !self.last.is_empty() {
            bytes.clone_from(&self.last);
        } else if faults.empty_frame_at != Some(number) {
            let spoiled = spoiled(settings, number);
            let patch = self.scene.patch(angle, wobble_px, &spoiled);
            let noise = random::bits(random::key(settings.seed, Purpose::Noise), number as u64);
            let picture = self.scene.optics.picture;
            let exif = exif::block(picture, settings.exposure_s, number);
            bytes = jpeg::encode(picture, settings.jpeg_quality, &exif, |n| {
                self.strip(n, noise, &patch, spoiled.light)
            })?;
        }
        if faults.wrong_size_at == Some(number) {
            bytes = halved(&bytes)?;
        }
        if faults.truncate_frame_at == Some(number) {
            bytes.truncate(bytes.len() / 3 * 2);
        } else {
            self.last.clone_from(&bytes);
        }
        Ok(Frame::new(bytes, Encoding::Jpeg))
    }

    fn describe(&self) -> String {
        let s = &self.scene.settings;
        let lens = s.camera_distance_mm.map_or("telecentric".into(), |d| format!("pinhole at {d} mm"));
        format!(
            "simulated camera, {}×{} px, {} mm/px, {lens}, seed {}",
            s.width, s.height, s.mm_per_px, s.seed
        )
    }
}
