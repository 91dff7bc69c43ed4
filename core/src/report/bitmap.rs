//! Drawing into a bitmap, and the bitmap as PNG.

use super::canvas::{Anchor, Canvas, Ink, LETTER, LINE, plain};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

/// A bitmap of red, green, blue bytes, row-major.
#[derive(Debug, Clone)]
pub(super) struct Bitmap {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<u8>,
}

impl Bitmap {
    /// A white one.
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        Self { width, height, pixels: vec![255; 3 * width * height] }
    }

    /// Mixes a colour into a pixel; a point outside is left out.
    fn mix(&mut self, x: usize, y: usize, share: f64, ink: Ink) {
        if x < self.width && y < self.height {
            let k = 3 * (y * self.width + x);
            for (old, new) in self.pixels[k..k + 3].iter_mut().zip(ink) {
                *old = (f64::from(*old) * (1.0 - share) + f64::from(new) * share).round() as u8;
            }
        }
    }

    /// Draws segments of this width, each pixel once however many of them meet there.
    pub(super) fn segments(&mut self, segments: &[[[f64; 2]; 2]], width: f64, ink: Ink) {
        let reach = 0.5 * width + 1.0;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in segments.iter().flatten() {
            for k in 0..2 {
                low[k] = low[k].min(p[k] - reach);
                high[k] = high[k].max(p[k] + reach);
            }
        }
        let size = [self.width, self.height];
        let from = [0, 1].map(|k| low[k].floor().clamp(0.0, size[k] as f64) as usize);
        let end = [0, 1].map(|k| (high[k].floor() + 1.0).clamp(0.0, size[k] as f64) as usize);
        if from[0] >= end[0] || from[1] >= end[1] {
            return;
        }
        let across = end[0] - from[0];
        let mut cover = vec![0f32; across * (end[1] - from[1])];
        for [a, b] in segments {
            let range = |k: usize| {
                let (l, h) = (a[k].min(b[k]) - reach, a[k].max(b[k]) + reach);
                let l = l.ceil().clamp(from[k] as f64, end[k] as f64) as usize;
                let h = (h.floor() + 1.0).clamp(l as f64, end[k] as f64) as usize;
                l..h
            };
            for y in range(1) {
                for x in range(0) {
                    let share = (0.5 * width + 0.5 - distance([x as f64, y as f64], *a, *b)).clamp(0.0, 1.0);
                    let c = &mut cover[(y - from[1]) * across + x - from[0]];
                    *c = c.max(share as f32);
                }
            }
        }
        for (k, share) in cover.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            self.mix(from[0] + k % across, from[1] + k / across, f64::from(*share), ink);
        }
    }

    /// The bitmap as a PNG file.
    ///
    /// # Errors
    /// Where a side is zero or beyond what the format holds.
    pub(super) fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let mut out = Vec::new();
        // The quickest kind makes files twice as large, the default kind takes twice the time.
        let encoder = PngEncoder::new_with_quality(&mut out, CompressionType::Level(3), FilterType::Adaptive);
        let size = [self.width as u32, self.height as u32];
        encoder.write_image(&self.pixels, size[0], size[1], ExtendedColorType::Rgb8)?;
        Ok(out)
    }
}

/// Distance of a point from a segment.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let t = if length2 > 0.0 {
        (((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p[0] - a[0] - t * along[0]).hypot(p[1] - a[1] - t * along[1])
}

impl Canvas for Bitmap {
    fn rectangle(&mut self, [x, y, w, h]: [f64; 4], ink: Ink) {
        // A pixel's middle is at a whole number, a rectangle's edge between pixels.
        let range = |from: f64, length: f64, size: usize| {
            let first = from.round().clamp(0.0, size as f64) as usize;
            first..((from + length).round().clamp(first as f64, size as f64) as usize)
        };
        for row in range(y, h, self.height) {
            for column in range(x, w, self.width) {
                self.mix(column, row, 1.0, ink);
            }
        }
    }

    fn line(&mut self, points: &[[f64; 2]], width: f64, ink: Ink) {
        let segments: Vec<[[f64; 2]; 2]> = points.windows(2).map(|w| [w[0], w[1]]).collect();
        self.segments(&segments, width, ink);
    }

    fn polygon(&mut self, corners: &[[f64; 2]], ink: Ink) {
        let rows = corners.iter().map(|c| c[1]);
        let first = rows.clone().fold(f64::INFINITY, f64::min).ceil().max(0.0) as usize;
        let last = rows.fold(f64::NEG_INFINITY, f64::max).floor().min(self.height as f64 - 1.0);
        for row in (first..self.height).take_while(|r| *r as f64 <= last) {
            let y = row as f64;
            let ends = corners.iter().zip(corners.iter().cycle().skip(1));
            let mut cuts: Vec<f64> = ends
                .filter(|(a, b)| (a[1] <= y) != (b[1] <= y))
                .map(|(a, b)| a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]))
                .collect();
            cuts.sort_by(f64::total_cmp);
            for cut in cuts.chunks_exact(2) {
                let from = cut[0].ceil().max(0.0) as usize;
                for column in (from..self.width).take_while(|x| *x as f64 <= cut[1]) {
                    self.mix(column, row, 1.0, ink);
                }
            }
        }
    }

    fn disc(&mut self, center: [f64; 2], radius: f64, ink: Ink) {
        self.segments(&[[center, center]], 2.0 * radius, ink);
    }

    fn text(&mut self, [x, y]: [f64; 2], anchor: Anchor, text: &str, ink: Ink) {
        let text = plain(text);
        let left = anchor.left(x, text.chars().count());
        let top = y - 0.5 * LINE + 1.0;
        for (n, c) in text.chars().enumerate() {
            let Some(letter) = get_raster(c, FontWeight::Regular, RasterHeight::Size16) else { continue };
            let at = left + LETTER * n as f64;
            for (j, row) in letter.rows().enumerate() {
                for (i, share) in row.iter().enumerate().filter(|(_, s)| **s > 0) {
                    let (column, row) = ((at + i as f64).round(), (top + j as f64).round());
                    if column >= 0.0 && row >= 0.0 {
                        self.mix(column as usize, row as usize, f64::from(*share) / 255.0, ink);
                    }
                }
            }
        }
    }
}
