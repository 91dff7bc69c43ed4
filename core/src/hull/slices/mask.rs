//! Strips from binary masks.

use super::sight::{Line, Sight, push_crossing};
use super::{RowGrid, SliceError, Strips};
use crate::geometry::Projection;

/// A mask of whole pixels, a bit each: set where the pixel is in the silhouette.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BitMask {
    width: usize,
    height: usize,
    /// Words of 64 pixels in a row; the first pixel is the lowest bit.
    stride: usize,
    words: Vec<u64>,
}

impl BitMask {
    /// From a byte a pixel, `[row, column]`, set where that is not 0. Rows beyond `pixels` are empty, and so is what
    /// is left of a last row that is cut short.
    pub fn from_bytes(width: usize, pixels: &[u8]) -> Self {
        let height = if width == 0 { 0 } else { pixels.len().div_ceil(width) };
        let stride = width.div_ceil(64);
        let mut words = vec![0; stride * height];
        if width > 0 {
            for (row, out) in pixels.chunks(width).zip(words.chunks_exact_mut(stride)) {
                for (part, word) in row.chunks(64).zip(out) {
                    *word = packed(part);
                }
            }
        }
        Self { width, height, stride, words }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Whether a pixel is set; outside the mask none is.
    #[inline]
    pub fn get(&self, column: i64, row: i64) -> bool {
        let within = (0..self.width as i64).contains(&column) && (0..self.height as i64).contains(&row);
        within && self.words[row as usize * self.stride + column as usize / 64] >> (column % 64) & 1 == 1
    }

    /// Adds the edges of the runs of set pixels in a row: half a pixel before the first, half a pixel after the last.
    fn runs(&self, row: usize, out: &mut Vec<f64>) {
        let mut last = 0;
        for (k, word) in self.words[row * self.stride..][..self.stride].iter().enumerate() {
            // Bits that differ from the pixel before them.
            let mut edges = word ^ (word << 1 | last);
            last = word >> 63;
            while edges != 0 {
                out.push((64 * k) as f64 + f64::from(edges.trailing_zeros()) - 0.5);
                edges &= edges - 1;
            }
        }
        if last == 1 {
            out.push((64 * self.stride) as f64 - 0.5);
        }
    }

    /// The edges of the set pixels that a line crosses, in order along its major coordinate.
    fn cross(&self, line: &Line, out: &mut Vec<f64>) {
        out.clear();
        if line.major == 0 && line.slope == 0.0 {
            let row = line.at_zero.round();
            if (0.0..self.height as f64).contains(&row) {
                self.runs(row as usize, out);
            }
            return;
        }
        let get = |s: i64, other: f64| {
            let other = other.round() as i64;
            if line.major == 0 { self.get(s, other) } else { self.get(other, s) }
        };
        let mut inside = false;
        for s in 0..self.size()[line.major] as i64 {
            // Over one pixel of the major coordinate the line is in one pixel of the other, or in two.
            let (from, to) = (s as f64 - 0.5, s as f64 + 0.5);
            let (a, b) = (line.at_zero + line.slope * from, line.at_zero + line.slope * to);
            let mut visit = |at: f64, other: f64| {
                let now = get(s, other);
                if now != inside {
                    push_crossing(out, at);
                    inside = now;
                }
            };
            if a.round() as i64 == b.round() as i64 {
                visit(from, 0.5 * (a + b));
            } else {
                let between = 0.5 * (a.round() + b.round());
                let at = ((between - line.at_zero) / line.slope).clamp(from, to);
                visit(from, a.round());
                visit(at, b.round());
            }
        }
        if inside {
            out.push(self.size()[line.major] as f64 - 0.5);
        }
    }
}

/// Up to 64 pixels as bits.
fn packed(pixels: &[u8]) -> u64 {
    let (eights, rest) = pixels.as_chunks::<8>();
    let whole = eights.iter().rfold(0, |word, eight| word << 8 | bits(*eight));
    if rest.is_empty() {
        return whole;
    }
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    whole | bits(last) << (8 * eights.len())
}

/// Eight pixels as the lowest bits.
#[inline]
fn bits(pixels: [u8; 8]) -> u64 {
    // The highest bit of each byte shows whether it is 0; the product brings these eight bits together.
    let x = u64::from_le_bytes(pixels);
    let low = 0x7f7f_7f7f_7f7f_7f7f;
    let set = ((((x & low) + low) | x) & !low) >> 7;
    set.wrapping_mul(0x0102_0408_1020_4080) >> 56
}

impl RowGrid {
    /// The rows of a picture's pixels where the axis stands upright in it: a row through each pixel's centre on the
    /// axis, from the lowest row of the picture to the highest.
    ///
    /// # Errors
    /// [`SliceError::NotLevel`], and [`SliceError::RowGrid`] for a picture of no rows.
    pub fn of_rows(camera: &Projection, height: usize) -> Result<Self, SliceError> {
        let sight = Sight::of(camera)?;
        let per_mm = sight.up_px[1];
        let last = height.saturating_sub(1) as f64;
        let at = |row: f64| (row - sight.origin_px[1]) / per_mm;
        let first_mm = at(last).min(at(0.0));
        Self { first_mm, pitch_mm: 1.0 / per_mm.abs(), rows: height }.checked()
    }
}

impl Strips {
    /// From a mask on the rows of a row grid: the grain is where a row's line passes through set pixels, whose edges are
    /// half a pixel from their centres.
    ///
    /// # Errors
    /// [`SliceError::RowGrid`], and [`SliceError::NotLevel`] where the view's rays are not parallel and level.
    pub fn from_mask(mask: &BitMask, camera: &Projection, row_grid: RowGrid) -> Result<Self, SliceError> {
        let sight = Sight::of(camera)?;
        let mut crossings = Vec::new();
        Self::from_fn(row_grid, sight.angle_rad, |z, out| {
            let line = sight.line(z);
            mask.cross(&line, &mut crossings);
            line.push_intervals(&crossings, out);
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Turntable;
    use crate::geometry::Angle;

    #[test]
    fn bits_are_the_bytes() {
        let pixels: Vec<u8> = (0..70 * 5_u32).map(|k| (k * k % 7 % 3) as u8 * 90).collect();
        let mask = BitMask::from_bytes(70, &pixels);
        assert_eq!(mask.size(), [70, 5]);
        for (k, p) in pixels.iter().enumerate() {
            assert_eq!(mask.get((k % 70) as i64, (k / 70) as i64), *p != 0, "{k}");
        }
        assert!(!mask.get(-1, 0) && !mask.get(0, -1) && !mask.get(70, 0) && !mask.get(0, 5));
    }

    #[test]
    fn runs_and_slanting_lines_cross_the_same_pixels() {
        let (w, h) = (130, 90);
        let pixels: Vec<u8> =
            (0..w * h).map(|k| u8::from((k % w / 9 + k / w / 11) % 2 == 0 || k % w > 120)).collect();
        let mask = BitMask::from_bytes(w, &pixels);
        let upright = Turntable {
            mm_per_px: 0.01,
            axis_column_px: 60.3,
            origin_row_px: 80.0,
            elevation_rad: 0.0,
            roll_rad: 0.0,
            camera_distance_mm: None,
        };
        for roll_rad in [0.0, 0.03, -0.05] {
            let camera = Turntable { roll_rad, ..upright }.view(Angle::from_deg(20.0), 0.0);
            let row_grid = RowGrid::of_rows(&camera, h).unwrap();
            let strips = Strips::from_mask(&mask, &camera, row_grid).unwrap();
            let sight = Sight::of(&camera).unwrap();
            for k in (0..h).step_by(7) {
                let z = row_grid.height(k);
                for i in 0..2000 {
                    let u = -0.8 + f64::from(i) * 8.1e-4;
                    let [x, y] = sight.pixel(u, z);
                    let near = (x - x.floor() - 0.5).abs() < 1e-6 || (y - y.floor() - 0.5).abs() < 1e-6;
                    let inside = strips.row(k).iter().any(|[a, b]| (*a..=*b).contains(&u));
                    assert!(near || inside == mask.get(x.round() as i64, y.round() as i64), "{x} {y}");
                }
            }
        }
    }
}
