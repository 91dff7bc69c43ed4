//! A silhouette's outline drawn over the photograph that it was found in.

use super::bitmap::Bitmap;
use super::canvas::{Anchor, Canvas as _, Ink, LETTER, LINE};
use crate::silhouette::{PedestalOutline, Silhouette, Source};

/// Longest side of a drawn picture, pixels: small enough for a page of 26 of them.
const LONGEST: usize = 1000;
/// Bits of a colour that are kept: the eye sees no less, and the noise of the rest would be most of the file.
const KEPT: u8 = 0b1111_1100;
/// A small grain's pixels are drawn this many times as large at most.
const LARGEST_PIXEL: usize = 4;
/// What is shown around the outline, as a share of its longer side.
const AROUND: f64 = 0.12;
/// Colours that no grain, backdrop or pedestal has: the outline, the cut above the pedestal, the axis.
const OUTLINE: Ink = [255, 0, 150];
const CUT: Ink = [255, 150, 0];
const AXIS: Ink = [0, 190, 255];
const TEXT: Ink = [0, 0, 0];
/// The cut's line goes on beside the pedestal by this share of its half width.
const BEYOND: f64 = 0.25;

/// The grain's surroundings in one picture, small enough to keep until the axis is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Column and row of the first pixel in the picture.
    origin: [usize; 2],
    /// Columns and rows kept.
    size: [usize; 2],
    /// Pixels of the photograph that one kept pixel is the mean of, along either side.
    reduced: usize,
    /// Red, green, blue, row-major.
    pixels: Vec<u8>,
}

/// What is drawn over a photograph beside the outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Marks<'a> {
    /// The pedestal that was cut off.
    pub pedestal: Option<&'a PedestalOutline>,
    /// The rotation axis: a point on it (column, row) and the roll, radians.
    pub axis: Option<([f64; 2], f64)>,
    /// What stands below the picture.
    pub caption: &'a str,
}

impl Shot {
    /// The surroundings of a silhouette in the picture it was found in.
    pub fn of(picture: &dyn Source, silhouette: &Silhouette) -> Self {
        let [width, height, channels] = picture.shape();
        let whole = [width, height];
        let around = (AROUND * silhouette.size[0].max(silhouette.size[1]) as f64) as usize;
        let origin = silhouette.origin.map(|o| o.saturating_sub(around));
        let end: [usize; 2] =
            std::array::from_fn(|k| (silhouette.origin[k] + silhouette.size[k] + around).min(whole[k]));
        let full = [end[0] - origin[0], end[1] - origin[1]];
        let reduced = full[0].max(full[1]).div_ceil(LONGEST).max(1);
        let size = full.map(|s| (s / reduced).max(1));
        let data = picture.part(&(origin[0]..end[0]), &(origin[1]..end[1]));
        let mut pixels = Vec::with_capacity(3 * size[0] * size[1]);
        let mut sums = vec![[0u32; 3]; size[0]];
        for row in 0..size[1] {
            sums.fill([0; 3]);
            for y in 0..reduced.min(full[1]) {
                let start = (row * reduced + y) * full[0];
                for (column, sum) in sums.iter_mut().enumerate() {
                    for x in 0..reduced.min(full[0]) {
                        let at = (start + column * reduced + x) * channels;
                        for (k, s) in sum.iter_mut().enumerate() {
                            *s += u32::from(data[at + k.min(channels - 1)]);
                        }
                    }
                }
            }
            let count = (reduced.min(full[0]) * reduced.min(full[1])) as u32;
            pixels.extend(sums.iter().flatten().map(|s| ((s + count / 2) / count) as u8 & KEPT));
        }
        Self { origin, size, reduced, pixels }
    }

    /// The photograph with the outline over it, as PNG.
    ///
    /// # Errors
    /// The encoder's message.
    pub fn drawn(&self, silhouette: &Silhouette, marks: &Marks) -> Result<Vec<u8>, image::ImageError> {
        let larger = (LONGEST / self.size[0].max(self.size[1])).clamp(1, LARGEST_PIXEL);
        let [w, h] = self.size.map(|s| s * larger);
        let strip = LINE as usize + 4;
        let caption = LETTER as usize * (marks.caption.chars().count() + 1);
        let mut out = Bitmap::new([w.max(caption), h + strip]);
        for y in 0..h {
            for x in 0..w {
                let from = 3 * (y / larger * self.size[0] + x / larger);
                let to = 3 * (y * out.width + x);
                out.pixels[to..to + 3].copy_from_slice(&self.pixels[from..from + 3]);
            }
        }
        // From the picture's pixels to the drawing's, middle to middle.
        let scale = larger as f64 / self.reduced as f64;
        let to_canvas = |p: [f64; 2]| -> [f64; 2] {
            std::array::from_fn(|k| (p[k] - self.origin[k] as f64 + 0.5) * scale - 0.5)
        };
        if let Some(([column, row], roll)) = marks.axis {
            // With a positive roll the axis leans to smaller columns towards the top.
            let at = |y: usize| [column + roll.tan() * (y as f64 - row), y as f64];
            let (top, low) = (self.origin[1], self.origin[1] + self.size[1] * self.reduced - 1);
            out.dashed(to_canvas(at(top)), to_canvas(at(low)), 1.2, AXIS);
        }
        if let Some(p) = marks.pedestal {
            let half = (1.0 + BEYOND) * p.half_width;
            let at = |x: f64| [p.centre_column + x, p.top_row + p.top_slope * x];
            out.line(&[to_canvas(at(-half)), to_canvas(at(half))], 1.2, CUT);
        }
        let segments: Vec<[[f64; 2]; 2]> =
            silhouette.segments().into_iter().map(|s| s.map(to_canvas)).collect();
        out.segments(&segments, 1.4, OUTLINE);
        let width = out.width as f64;
        out.rectangle([0.0, h as f64, width, strip as f64], [255; 3]);
        out.text([4.0, h as f64 + 0.5 * strip as f64], Anchor::Left, marks.caption, TEXT);
        out.png()
    }
}
