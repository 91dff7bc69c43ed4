//! What a photograph must give for the grain in it to be found: a small copy of all of it, and pixels of a part.

use super::{Picture, SilhouetteError, ToneCurve};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Cells of `factor` by `factor` pixels, from a pixel of the picture on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Grid {
    /// Pixels per cell, a side.
    pub factor: usize,
    /// First column and row of the picture covered.
    pub origin: [usize; 2],
    /// Cells across and down.
    pub size: [usize; 2],
}

/// A photograph of eight bits a channel, grey or red-green-blue: decoded already, or where it is looked at.
pub trait Source: Sync {
    /// Width and height (pixels), and channels: 1 (grey) or 3 (red, green, blue).
    fn shape(&self) -> [usize; 3];

    /// How the file says that its grey values code light; `None` where it does not.
    fn tone_curve(&self) -> Option<ToneCurve> {
        None
    }

    /// The pixels, where they are decoded already.
    fn at_hand(&self) -> Option<&Picture>;

    /// All pixels.
    ///
    /// # Errors
    /// As [`Picture::new`].
    fn pixels(&self) -> Result<Cow<'_, Picture>, SilhouetteError>;

    /// The cells that a small copy of some columns and rows is best made of.
    fn grid(&self, columns: &Range<usize>, rows: &Range<usize>) -> Grid;

    /// For each channel the means over cells, grey levels: `[row, column]`, row-major.
    ///
    /// # Errors
    /// As [`Self::pixels`], where the cells are such that all pixels are needed.
    fn cells(&self, grid: &Grid) -> Result<Vec<Vec<f32>>, SilhouetteError>;

    /// For each pixel of some columns and rows the sum of its colours (of its grey value thrice) with these
    /// weights, sixteenths that come to no more than one: `[row, column]`, row-major.
    fn weighted(&self, columns: &Range<usize>, rows: &Range<usize>, weights: [i16; 3]) -> Vec<i16>;

    /// The pixels of some columns and rows: `[row, column, channel]`, row-major.
    fn part(&self, columns: &Range<usize>, rows: &Range<usize>) -> Vec<u8>;
}

/// The longer side of the small copy, cells, at most.
const LONGEST: usize = 600;
/// Rows read of each cell: more would cost bytes and add nothing.
const ROWS_READ: usize = 4;

impl Source for Picture {
    fn tone_curve(&self) -> Option<ToneCurve> {
        self.stated_tone_curve()
    }

    fn shape(&self) -> [usize; 3] {
        [self.width(), self.height(), self.channels()]
    }

    fn at_hand(&self) -> Option<&Picture> {
        Some(self)
    }

    fn pixels(&self) -> Result<Cow<'_, Picture>, SilhouetteError> {
        Ok(Cow::Borrowed(self))
    }

    fn grid(&self, columns: &Range<usize>, rows: &Range<usize>) -> Grid {
        let factor = columns.len().max(rows.len()).div_ceil(LONGEST).max(1);
        Grid {
            factor,
            origin: [columns.start, rows.start],
            size: [columns.len() / factor, rows.len() / factor],
        }
    }

    fn cells(&self, grid: &Grid) -> Result<Vec<Vec<f32>>, SilhouetteError> {
        let Grid { factor, origin: [x0, y0], size: [width, height] } = *grid;
        let channels = self.channels();
        let step = (factor / ROWS_READ).max(1);
        let rows: Vec<Vec<u32>> = (0..height)
            .into_par_iter()
            .map(|j| {
                let mut sums = vec![0u32; width * channels];
                let top = y0 + j * factor;
                for y in (top..top + factor).step_by(step) {
                    let row = self.row(y, x0, x0 + width * factor);
                    for (cell, sum) in
                        row.chunks_exact(factor * channels).zip(sums.chunks_exact_mut(channels))
                    {
                        for pixel in cell.chunks_exact(channels) {
                            for (s, &v) in sum.iter_mut().zip(pixel) {
                                *s += u32::from(v);
                            }
                        }
                    }
                }
                sums
            })
            .collect();
        let scale = 1.0 / (factor * factor.div_ceil(step)) as f32;
        let colour = |c: usize| {
            let sums = rows.iter().flat_map(|row| row[c..].iter().step_by(channels));
            sums.map(|&s| s as f32 * scale).collect()
        };
        Ok((0..channels).map(colour).collect())
    }

    fn weighted(&self, columns: &Range<usize>, rows: &Range<usize>, weights: [i16; 3]) -> Vec<i16> {
        let mut out = vec![0i16; columns.len() * rows.len()];
        let [r, g, b] = weights;
        out.par_chunks_mut(columns.len().max(1)).zip(rows.clone()).for_each(|(out, y)| {
            let row = self.row(y, columns.start, columns.end);
            if self.channels() == 1 {
                out.iter_mut().zip(row).for_each(|(o, &v)| *o = (r + g + b) * i16::from(v));
            } else {
                for (o, p) in out.iter_mut().zip(row.chunks_exact(3)) {
                    *o = r * i16::from(p[0]) + g * i16::from(p[1]) + b * i16::from(p[2]);
                }
            }
        });
        out
    }

    fn part(&self, columns: &Range<usize>, rows: &Range<usize>) -> Vec<u8> {
        let mut out = Vec::with_capacity(columns.len() * rows.len() * self.channels());
        rows.clone().for_each(|y| out.extend_from_slice(self.row(y, columns.start, columns.end)));
        out
    }
}
