//! From light to a file: background, blur, coding, noise, and the encoder.

use super::chance::Chance;
use super::plan::{Curve, Hair, Row};
use super::trace::Traced;
use anyhow::{Result, anyhow};
use image::ImageEncoder as _;

/// Light of dust and hairs before a bright background, and in a dark field, where they are lit.
const DIRT: [f64; 2] = [0.1, 0.25];
/// Backgrounds darker than this are dark fields.
const DARK: f64 = 0.2;
/// Half a hair's width, pixels.
const HAIR_PX: f64 = 1.3;
/// Pieces that a hair's curve is made of.
const HAIR_PIECES: usize = 48;

/// What all pictures of a set share: the background's light, and how much the sensor's dust lets through.
pub struct Backdrop {
    level: Vec<f32>,
    sensor: Option<Vec<f32>>,
}

impl Backdrop {
    /// Of a row; `wide_px` is how far from the axis the grain reaches.
    pub fn new(row: &Row, wide_px: f64) -> Self {
        let (w, h) = (row.camera.width, row.camera.height);
        let light = &row.light;
        let mut chance = Chance::new(row.seed, "dirt");
        let dirt = DIRT[usize::from(light.background < DARK)] as f32;
        let mut level: Vec<f32> = (0..w * h)
            .map(|k| {
                let dx = (k % w) as f64 / w as f64 - 0.5;
                let dy = ((k / w) as f64 - 0.5 * h as f64) / h as f64;
                let fall = light.vignette * 2.0 * (dx * dx + dy * dy);
                let slope = light.gradient * dx + light.gradient_down * dy;
                (light.background * (1.0 - fall + slope)).max(0.0) as f32
            })
            .collect();
        let mut cover = |k: usize, share: f64| level[k] += share as f32 * (dirt - level[k]);
        for _ in 0..row.dirt.specks {
            let at = [chance.between(0.0, w as f64), chance.between(0.0, h as f64)];
            let (radius, share) = (chance.between(1.0, 6.0), chance.between(0.3, 0.9));
            spot(at, radius, 1.0, [w, h], |k, s| cover(k, share * s));
        }
        if let Some(hair) = row.dirt.hair {
            hair_over(row, hair, wide_px, &mut cover);
        }
        let sensor = (row.dirt.sensor > 0).then(|| {
            let mut passes = vec![1f32; w * h];
            for _ in 0..row.dirt.sensor {
                let at = [chance.between(0.0, w as f64), chance.between(0.0, h as f64)];
                let (radius, share) = (chance.between(4.0, 11.0), chance.between(0.1, 0.35));
                spot(at, radius, 5.0, [w, h], |k, s| passes[k] *= (1.0 - share * s) as f32);
            }
            passes
        });
        Self { level, sensor }
    }

    /// A traced view as the bytes of a file.
    ///
    /// # Errors
    /// Where the encoder fails.
    pub fn develop(&self, row: &Row, traced: &Traced, chance: &mut Chance) -> Result<Vec<u8>> {
        let size = [row.camera.width, row.camera.height];
        let channels = if row.file.colour.is_some() { 3 } else { 1 };
        let light = row.file.colour.unwrap_or([1.0; 3]);
        let (tint, backdrop) =
            if channels == 3 { (row.skin.tint, row.file.backdrop) } else { ([1.0; 3], [1.0; 3]) };
        let mut bytes = vec![0u8; channels * size[0] * size[1]];
        for c in 0..channels {
            let (light, tint, behind) = (light[c] as f32, tint[c] as f32, backdrop[c] as f32);
            let mut plane: Vec<f32> = self.level.iter().map(|l| light * behind * l).collect();
            let [w, _] = traced.window.size;
            for (k, [white, tinted, share]) in traced.pixels.iter().enumerate() {
                let at = (traced.window.origin[1] + k / w) * size[0] + traced.window.origin[0] + k % w;
                plane[at] = plane[at] * share + light * (white + tint * tinted);
            }
            if row.camera.disc_px > 0.0 {
                plane = disc(&plane, size, row.camera.disc_px);
            }
            gauss(&mut plane, size, row.camera.blur_px);
            for (k, value) in plane.iter().enumerate() {
                let passes = self.sensor.as_ref().map_or(1.0, |s| s[k]);
                let light = f64::from(value * passes).clamp(0.0, 1.0);
                let level = 255.0 * coded(row.file.curve, light);
                let noise = row.file.noise.hypot(row.file.shot * light.sqrt());
                bytes[channels * k + c] = (level + noise * chance.normal()).round().clamp(0.0, 255.0) as u8;
            }
        }
        encode(&bytes, size, row.file.quality)
    }
}

/// Adds a round spot with a soft edge: each pixel's place and share.
fn spot([u, v]: [f64; 2], radius: f64, edge: f64, [w, h]: [usize; 2], mut add: impl FnMut(usize, f64)) {
    let reach = radius + edge;
    let range = |middle: f64, end: usize| {
        ((middle - reach).max(0.0) as usize).min(end)..((middle + reach).max(0.0) as usize + 1).min(end)
    };
    for y in range(v, h) {
        for x in range(u, w) {
            let share = ((reach - (x as f64 - u).hypot(y as f64 - v)) / (2.0 * edge)).clamp(0.0, 1.0);
            if share > 0.0 {
                add(y * w + x, share);
            }
        }
    }
}

/// A curved hair from the left end of the picture towards the grain.
fn hair_over(row: &Row, hair: Hair, wide_px: f64, cover: &mut impl FnMut(usize, f64)) {
    let (w, h) = (row.camera.width, row.camera.height);
    let [column, line] = row.foot_px();
    let end = match hair {
        Hair::Beside => [column - wide_px - 0.06 * w as f64, line - 0.9 * row.size_px.min(line)],
        Hair::Touching => [column - 0.2 * row.size_px, line - 0.45 * row.size_px],
    };
    let (start, bend) = ([-4.0, 0.45 * h as f64], [0.6 * end[0], 0.1 * h as f64]);
    let at = |s: f64| -> [f64; 2] {
        [0, 1].map(|k| (1.0 - s).powi(2) * start[k] + 2.0 * s * (1.0 - s) * bend[k] + s * s * end[k])
    };
    let points: Vec<[f64; 2]> = (0..=HAIR_PIECES).map(|k| at(k as f64 / HAIR_PIECES as f64)).collect();
    for k in 0..w * h {
        let p = [(k % w) as f64, (k / w) as f64];
        let near = points.windows(2).map(|piece| away(p, piece[0], piece[1])).fold(f64::INFINITY, f64::min);
        let share = (HAIR_PX + 0.5 - near).clamp(0.0, 1.0);
        if share > 0.0 {
            cover(k, 0.9 * share);
        }
    }
}

/// Distance of a point from a piece of a line.
fn away(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let t = (((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / square).clamp(0.0, 1.0);
    (p[0] - a[0] - t * along[0]).hypot(p[1] - a[1] - t * along[1])
}

/// Levels of light as a file has them, both from 0 to 1.
fn coded(curve: Curve, light: f64) -> f64 {
    let srgb = |x: f64| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    match curve {
        Curve::Linear => light,
        Curve::Srgb => srgb(light),
        Curve::Film => {
            let shoulder = (1.0 - (-1.8 * light).exp()) / (1.0 - (-1.8f64).exp());
            let y = srgb(shoulder);
            let steep = y * y * (3.0 - 2.0 * y);
            0.015 + 0.97 * (0.55 * y + 0.45 * steep)
        }
    }
}

/// Blurs by a normal distribution; ends are continued.
fn gauss(plane: &mut [f32], [w, h]: [usize; 2], sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total = 2.0 * weights.iter().sum::<f64>() - weights[0];
    let weights: Vec<f32> = weights.iter().map(|x| (x / total) as f32).collect();
    let mut aside = vec![0f32; w * h];
    for (from, to) in plane.chunks(w).zip(aside.chunks_mut(w)) {
        let mut wide = vec![from[0]; reach];
        wide.extend_from_slice(from);
        wide.extend(std::iter::repeat_n(from[w - 1], reach));
        for (x, out) in to.iter_mut().enumerate() {
            let own = weights[0] * wide[x + reach];
            *out = (1..=reach)
                .fold(own, |sum, k| sum + weights[k] * (wide[x + reach - k] + wide[x + reach + k]));
        }
    }
    for (y, out) in plane.chunks_mut(w).enumerate() {
        out.fill(0.0);
        for k in 0..=2 * reach {
            let row = (y + k).saturating_sub(reach).min(h - 1);
            let weight = weights[k.abs_diff(reach)];
            out.iter_mut().zip(&aside[row * w..][..w]).for_each(|(o, a)| *o += weight * a);
        }
    }
}

/// Blurs by a disc, as a lens out of focus does; ends are continued.
fn disc(plane: &[f32], [w, h]: [usize; 2], radius: f64) -> Vec<f32> {
    let reach = (radius + 0.5).ceil() as isize;
    let mut taps = Vec::new();
    for y in -reach..=reach {
        for x in -reach..=reach {
            let share = (radius + 0.5 - (x as f64).hypot(y as f64)).clamp(0.0, 1.0);
            if share > 0.0 {
                taps.push((x, y, share as f32));
            }
        }
    }
    let total: f32 = taps.iter().map(|t| t.2).sum();
    let mut out = vec![0f32; w * h];
    for (dx, dy, weight) in taps {
        let weight = weight / total;
        for y in 0..h {
            let row = (y as isize + dy).clamp(0, h as isize - 1) as usize;
            let (from, to) = (&plane[row * w..][..w], &mut out[y * w..][..w]);
            for (x, value) in to.iter_mut().enumerate() {
                *value += weight * from[(x as isize + dx).clamp(0, w as isize - 1) as usize];
            }
        }
    }
    out
}

/// A JPEG of this quality, or a PNG for 0; grey or red, green and blue.
///
/// # Errors
/// Where the encoder fails.
pub fn encode(bytes: &[u8], [w, h]: [usize; 2], quality: u8) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let is_grey = bytes.len() == w * h;
    if quality == 0 {
        let kind = if is_grey { image::ExtendedColorType::L8 } else { image::ExtendedColorType::Rgb8 };
        image::codecs::png::PngEncoder::new(&mut out).write_image(bytes, w as u32, h as u32, kind)?;
    } else {
        let kind = if is_grey { jpeg_encoder::ColorType::Luma } else { jpeg_encoder::ColorType::Rgb };
        let sides = [w, h].map(u16::try_from);
        let [Ok(w), Ok(h)] = sides else { return Err(anyhow!("{w} x {h} px are too many for a JPEG")) };
        jpeg_encoder::Encoder::new(&mut out, quality).encode(bytes, w, h, kind)?;
    }
    Ok(out)
}
