//! The contact sheet: each set's worst view with the true outline and the one that was found.

use super::compare::Compared;
use super::plan::Row;
use super::render::{Rendered, file_name};
use anyhow::{Result, anyhow};
use grainrig_core::formats::decode;
use grainrig_core::silhouette::Silhouette;
use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};
use std::path::Path;

/// Width and height of one picture, and of the line below it.
const TILE: [u32; 2] = [320, 260];
const LINE: u32 = 18;
const LETTER: u32 = 7;
const COLUMNS: u32 = 6;
const TRUE: Rgb<u8> = Rgb([0, 220, 60]);
const FOUND: Rgb<u8> = Rgb([255, 0, 150]);

/// A set's worst view around both outlines, green the true one, pink the found one.
///
/// # Errors
/// Where the set cannot be read.
pub fn tile(row: &Row, set: &Rendered, worst: &Compared) -> Result<RgbImage> {
    let read = |name: String| -> Result<_> {
        decode(&std::fs::read(set.folder.join(name))?).map_err(|e| anyhow!("{e}"))
    };
    let picture = read(file_name(row, &format!("grain_{:02}", worst.view)))?;
    let mask = read(format!("truth/mask_{:02}.png", worst.view))?;
    let size = [picture.width(), picture.height()];
    let coverage: Vec<f32> = mask.data().iter().map(|c| f32::from(*c) / 255.0).collect();
    let truth = Silhouette::of_coverage(size, &coverage);
    let of = |s: Option<&Silhouette>| s.map_or_else(Vec::new, Silhouette::segments);
    let lines = [(of(truth.as_ref()), TRUE), (of(worst.found.as_ref()), FOUND)];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in lines.iter().flat_map(|l| &l.0).flatten() {
        for k in 0..2 {
            (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
        }
    }
    let shown = [TILE[0], TILE[1] - LINE].map(f64::from);
    let scale = (0..2).map(|k| shown[k] / (1.25 * (high[k] - low[k]) + 8.0)).fold(f64::INFINITY, f64::min);
    let middle = [0, 1].map(|k| f64::midpoint(low[k], high[k]));
    let mut out = RgbImage::from_pixel(TILE[0], TILE[1], Rgb([255; 3]));
    for y in 0..TILE[1] - LINE {
        for x in 0..TILE[0] {
            let at = [0, 1].map(|k| (f64::from([x, y][k]) - 0.5 * shown[k]) / scale + middle[k]);
            if (0..2).any(|k| at[k] < 0.0 || at[k].round() >= size[k] as f64) {
                continue;
            }
            let at = at[1].round() as usize * size[0] + at[0].round() as usize;
            let n = picture.channels();
            out.put_pixel(x, y, Rgb([0, 1, 2].map(|c| picture.data()[at * n + c.min(n - 1)])));
        }
    }
    for (segments, ink) in lines {
        for [a, b] in segments {
            for step in 0..=4 {
                let s = f64::from(step) / 4.0;
                let at = [0, 1].map(|k| (a[k] + s * (b[k] - a[k]) - middle[k]) * scale + 0.5 * shown[k]);
                if (0..2).all(|k| at[k] >= 0.0 && at[k] < shown[k]) {
                    out.put_pixel(at[0] as u32, at[1] as u32, ink);
                }
            }
        }
    }
    write(&mut out, &format!("{} {:02} {:.3}", row.name, worst.view, worst.iou));
    Ok(out)
}

/// A whole picture, small.
///
/// # Errors
/// Where its bytes are no picture.
pub fn small(name: &str, bytes: &[u8]) -> Result<RgbImage> {
    let mut out = RgbImage::from_pixel(TILE[0], TILE[1], Rgb([255; 3]));
    let kind = image::imageops::FilterType::Triangle;
    let picture = image::load_from_memory(bytes)?.resize(TILE[0], TILE[1] - LINE, kind).to_rgb8();
    image::imageops::replace(&mut out, &picture, 0, 0);
    write(&mut out, name);
    Ok(out)
}

fn write(out: &mut RgbImage, text: &str) {
    for (n, letter) in text.chars().enumerate() {
        let Some(raster) = get_raster(letter, FontWeight::Regular, RasterHeight::Size16) else { continue };
        for (j, row) in raster.rows().enumerate() {
            for (i, ink) in row.iter().enumerate() {
                let (x, y) = (n as u32 * LETTER + i as u32 + 2, TILE[1] - LINE + j as u32);
                if *ink > 0 && x < TILE[0] && y < TILE[1] {
                    out.put_pixel(x, y, Rgb([255 - ink; 3]));
                }
            }
        }
    }
}

/// All tiles on one sheet.
///
/// # Errors
/// Where the file cannot be written.
pub fn save(tiles: &[RgbImage], file: &Path) -> Result<()> {
    let rows = (tiles.len() as u32).div_ceil(COLUMNS).max(1);
    let columns = (tiles.len() as u32).clamp(1, COLUMNS);
    let mut sheet = RgbImage::from_pixel(columns * TILE[0], rows * TILE[1], Rgb([255; 3]));
    for (k, tile) in (0u32..).zip(tiles) {
        let at = [k % COLUMNS * TILE[0], k / COLUMNS * TILE[1]].map(i64::from);
        image::imageops::replace(&mut sheet, tile, at[0], at[1]);
    }
    Ok(sheet.save(file)?)
}
