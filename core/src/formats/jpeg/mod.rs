//! JPEG files as cameras write them, decoded only where the grain is.
//!
//! ```text
//! file ─▶ header ─▶ scan: every block's mean, where each unit begins ─┬─▶ cells: the picture at 1/8, from the means
//!                                                                     └─▶ blocks ─▶ planes: pixels of a rectangle
//! ```
//!
//! All of the entropy-coded data must be passed over to find anything in them. But a grain fills a few per cent of
//! the picture: elsewhere the coefficients need not even be put together, so that several are passed over at a time,
//! and nothing is transformed. Baseline files of grey or YCbCr colour are read; others are for the general decoder.

mod blocks;
mod header;
mod huffman;
mod planes;
mod scan;
#[cfg(test)]
mod tests;

use crate::silhouette::{Grid, Picture, SilhouetteError, Source};
use header::Header;
use planes::{Plane, REACH, Row, Samples};
use rayon::prelude::*;
use scan::Scan;
use std::borrow::Cow;
use std::ops::Range;

/// Pixels along a block.
const BLOCK: usize = 8;
/// Bytes of all pixels, at most: as the general decoder has it.
const MOST_BYTES: usize = 1 << 30;
/// The longer side of a picture's small copy, cells, at most about this many …
const LONGEST: usize = 600;
/// … and at least this many: with fewer blocks than that all pixels are better looked at.
const SHORTEST: usize = 300;

/// A JPEG whose data have been passed over once.
///
/// It holds the coded data and about a tenth of a byte a pixel beside them, not the pixels.
#[derive(Debug, Clone)]
pub struct Jpeg {
    header: Header,
    scan: Scan,
}

impl Jpeg {
    /// Passes over a file's data. `None` where it is damaged or of a kind that is for the general decoder, or so
    /// small that decoding all of it costs nothing.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let header = Header::read(bytes)?;
        let [width, height] = header.size;
        let fits = Picture::fits(width, height) && width * height * header.components.len() <= MOST_BYTES;
        if width.max(height) < SHORTEST * BLOCK || !fits {
            return None;
        }
        let scan = Scan::read(bytes, &header)?;
        Some(Self { header, scan })
    }

    /// A plane of a picture of this size for the samples of each component.
    fn planes<T>(&self, size: [usize; 2], samples: impl IntoIterator<Item = Samples<T>>) -> Vec<Plane<T>> {
        let unit = self.header.unit();
        (self.header.components.iter().zip(samples))
            .map(|(c, samples)| {
                let halved = [0, 1].map(|axis| c.blocks[axis] < unit[axis]);
                let whole = [0, 1].map(|axis| size[axis].div_ceil(1 + usize::from(halved[axis])));
                Plane { samples, halved, whole }
            })
            .collect()
    }

    /// The samples that the pixels of a rectangle depend on.
    fn region(&self, columns: &Range<usize>, rows: &Range<usize>) -> Vec<Plane<u8>> {
        let unit = self.header.unit();
        let around = |range: &Range<usize>, axis: usize| {
            let side = BLOCK * unit[axis];
            let end = (range.end + REACH).min(self.header.size[axis]);
            range.start.saturating_sub(REACH) / side..end.div_ceil(side)
        };
        let units = [&around(columns, 0), &around(rows, 1)];
        self.planes(self.header.size, blocks::samples(&self.header, &self.scan, units))
    }

    /// The means of all blocks as a picture of an eighth of the size.
    fn eighth(&self) -> Vec<Plane<f32>> {
        let means = self.header.components.iter().zip(&self.scan.means).map(|(c, means)| {
            let step = f32::from(c.steps[0]) / BLOCK as f32;
            let values = means.values.iter().map(|&v| f32::from(v) * step + 128.0).collect();
            Samples { origin: [0, 0], width: means.width, values }
        });
        self.planes(self.header.size.map(|side| side.div_ceil(BLOCK)), means)
    }
}

impl Source for Jpeg {
    fn shape(&self) -> [usize; 3] {
        [self.header.size[0], self.header.size[1], self.header.components.len()]
    }

    fn at_hand(&self) -> Option<&Picture> {
        None
    }

    fn pixels(&self) -> Result<Cow<'_, Picture>, SilhouetteError> {
        let [width, height, channels] = self.shape();
        let data = self.part(&(0..width), &(0..height));
        Picture::new(width, height, channels, data).map(Cow::Owned)
    }

    fn grid(&self, columns: &Range<usize>, rows: &Range<usize>) -> Grid {
        let blocks = columns.len().max(rows.len()) / BLOCK;
        let factor = BLOCK * ((blocks + LONGEST / 2) / LONGEST).max(1);
        let origin = [columns, rows].map(|range| range.start.next_multiple_of(BLOCK));
        let cells = |axis: usize, range: &Range<usize>| range.end.saturating_sub(origin[axis]) / factor;
        Grid { factor, origin, size: [cells(0, columns), cells(1, rows)] }
    }

    fn cells(&self, grid: &Grid) -> Result<Vec<Vec<f32>>, SilhouetteError> {
        let Grid { factor, origin, size } = grid;
        if factor % BLOCK != 0 || origin.iter().any(|o| o % BLOCK != 0) {
            return self.pixels()?.cells(grid);
        }
        let (planes, blocks) = (self.eighth(), factor / BLOCK);
        let columns = origin[0] / BLOCK..origin[0] / BLOCK + size[0] * blocks;
        let share = 1.0 / (blocks * blocks) as f32;
        let rows: Vec<Vec<Vec<f32>>> = (0..size[1])
            .into_par_iter()
            .map_init(Row::default, |row, j| {
                let mut sums = vec![vec![0f32; size[0]]; planes.len()];
                for y in origin[1] / BLOCK + j * blocks..origin[1] / BLOCK + (j + 1) * blocks {
                    row.read(&planes, y, &columns, false);
                    for (sums, levels) in sums.iter_mut().zip(&row.levels) {
                        for (sum, levels) in sums.iter_mut().zip(levels.chunks_exact(blocks)) {
                            *sum += levels.iter().sum::<f32>() * share;
                        }
                    }
                }
                sums
            })
            .collect();
        Ok((0..planes.len()).map(|c| rows.iter().flat_map(|row| row[c].iter().copied()).collect()).collect())
    }

    fn weighted(&self, columns: &Range<usize>, rows: &Range<usize>, weights: [i16; 3]) -> Vec<i16> {
        let mut out = vec![0i16; columns.len() * rows.len()];
        let [r, g, b] = weights.map(f32::from);
        let grey = r + g + b;
        let planes = self.region(columns, rows);
        planes::rows(&planes, [columns, rows], &mut out, |[red, green, blue], out| {
            if planes.len() == 1 {
                out.iter_mut().zip(red).for_each(|(o, v)| *o = whole(grey * v));
            } else {
                let pixels = red.iter().zip(green).zip(blue);
                out.iter_mut().zip(pixels).for_each(|(o, ((x, y), z))| *o = whole(r * x + g * y + b * z));
            }
        });
        out
    }

    fn part(&self, columns: &Range<usize>, rows: &Range<usize>) -> Vec<u8> {
        let channels = self.header.components.len();
        let mut data = vec![0u8; columns.len() * rows.len() * channels];
        planes::rows(&self.region(columns, rows), [columns, rows], &mut data, |levels, out| {
            for (k, pixel) in out.chunks_exact_mut(channels).enumerate() {
                pixel.iter_mut().zip(levels).for_each(|(p, level)| *p = level[k] as u8);
            }
        });
        data
    }
}

/// A whole number from −2¹⁵ to 2¹⁵ − 1 as an integer.
#[inline]
fn whole(v: f32) -> i16 {
    // In 2²³ … 2²⁴ a number's last bits are its whole part.
    (v + 12_582_912.0).to_bits() as i16
}
