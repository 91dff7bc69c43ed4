//! Colours at full resolution from planes of which some have half of it.

use rayon::prelude::*;
use std::ops::Range;

/// Samples of one component over a rectangle.
pub(super) struct Samples<T> {
    /// Column and row of the first sample, in the component's own resolution.
    pub origin: [usize; 2],
    /// Samples across.
    pub width: usize,
    /// `[row, column]`.
    pub values: Vec<T>,
}

/// The same, and how they lie in the picture.
pub(super) struct Plane<T> {
    pub samples: Samples<T>,
    /// Whether it has half the picture's resolution, across and down.
    pub halved: [bool; 2],
    /// Samples of the whole component, across and down: what the coder added beyond is not looked at.
    pub whole: [usize; 2],
}

/// Pixels beyond a rectangle that its colours depend on, where chrominance is halved.
pub(super) const REACH: usize = 2;

impl<T: Copy + Into<f32> + Sync> Plane<T> {
    /// A row of samples, by its number in the whole component.
    fn line(&self, row: usize) -> &[T] {
        let Samples { origin, width, values } = &self.samples;
        &values[(row - origin[1]) * width..][..*width]
    }

    /// Full-resolution row `y` from column `x0` on. Between halved samples three parts of the nearer one and one of
    /// the other: they lie in the middle of the pixels that they stand for (JFIF 1.02).
    fn row(&self, y: usize, x0: usize, held: &mut Vec<f32>, out: &mut [f32]) {
        let other = |at: usize, size: usize| {
            if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { (at / 2 + 1).min(size - 1) }
        };
        let (near, far) = if self.halved[1] { (y / 2, other(y, self.whole[1])) } else { (y, y) };
        let (end, first_sample) = (x0 + out.len(), self.samples.origin[0]);
        if !self.halved[0] {
            let part = x0 - first_sample..end - first_sample;
            mix(&self.line(near)[part.clone()], &self.line(far)[part], out);
            return;
        }
        // One sample more at each end: the neighbour, or at the picture's end the last one again.
        let (first, last) = (x0 / 2, (end - 1) / 2);
        held.clear();
        held.resize(last - first + 3, 0.0);
        let (from, to) = (other(2 * first, self.whole[0]), other(2 * last + 1, self.whole[0]));
        let part = from - first_sample..to + 1 - first_sample;
        let skipped = usize::from(from == first);
        let count = part.len();
        mix(&self.line(near)[part.clone()], &self.line(far)[part], &mut held[skipped..skipped + count]);
        if skipped == 1 {
            held[0] = held[1];
        }
        if to == last {
            held[last - first + 2] = held[last - first + 1];
        }
        let (mut out, mut held) = (out, &held[..]);
        if x0 % 2 == 1 {
            out[0] = 0.75 * held[1] + 0.25 * held[2];
            (out, held) = (&mut out[1..], &held[1..]);
        }
        let pairs = out.len() / 2;
        let (even, odd) = out.split_at_mut(2 * pairs);
        for (o, h) in even.chunks_exact_mut(2).zip(held.windows(3)) {
            let middle = 0.75 * h[1];
            o[0] = middle + 0.25 * h[0];
            o[1] = middle + 0.25 * h[2];
        }
        if let [o] = odd {
            *o = 0.75 * held[pairs + 1] + 0.25 * held[pairs];
        }
    }
}

fn mix<T: Copy + Into<f32>>(near: &[T], far: &[T], out: &mut [f32]) {
    for ((o, &n), &f) in out.iter_mut().zip(near).zip(far) {
        *o = 0.75 * n.into() + 0.25 * f.into();
    }
}

/// One row of a grey or YCbCr picture, made into grey or red, green and blue.
#[derive(Default)]
pub(super) struct Row {
    held: Vec<f32>,
    /// Red, green and blue, or grey in the first alone.
    pub levels: [Vec<f32>; 3],
}

impl Row {
    /// Reads row `y` of a picture of one plane or three; to whole numbers from 0 to 255 where `whole`.
    pub(super) fn read<T>(&mut self, planes: &[Plane<T>], y: usize, columns: &Range<usize>, whole: bool)
    where
        T: Copy + Into<f32> + Sync,
    {
        for (plane, levels) in planes.iter().zip(&mut self.levels) {
            levels.resize(columns.len(), 0.0);
            plane.row(y, columns.start, &mut self.held, levels);
        }
        if planes.len() < 3 {
            return;
        }
        let [red, green, blue] = &mut self.levels;
        // ITU-T T.871, 7: the planes hold Y, Cb and Cr.
        let colours = |[y, cb, cr]: [f32; 3]| {
            let (cb, cr) = (cb - 128.0, cr - 128.0);
            [y + 1.402 * cr, y - 0.344_136_3 * cb - 0.714_136_3 * cr, y + 1.772 * cb]
        };
        let pixels = red.iter_mut().zip(green).zip(blue);
        if whole {
            pixels.for_each(|((r, g), b)| [*r, *g, *b] = colours([*r, *g, *b]).map(nearest));
        } else {
            pixels.for_each(|((r, g), b)| [*r, *g, *b] = colours([*r, *g, *b]).map(|v| v.clamp(0.0, 255.0)));
        }
    }
}

/// Gives `take` each row of a rectangle (whole numbers) and the part of `out` that belongs to it.
pub(super) fn rows<T, O>(
    planes: &[Plane<T>],
    [columns, rows]: [&Range<usize>; 2],
    out: &mut [O],
    take: impl Fn(&[Vec<f32>; 3], &mut [O]) + Sync,
) where
    T: Copy + Into<f32> + Sync,
    O: Send,
{
    let width = (out.len() / rows.len().max(1)).max(1);
    out.par_chunks_mut(width).enumerate().for_each_init(Row::default, |row, (k, out)| {
        row.read(planes, rows.start + k, columns, true);
        take(&row.levels, out);
    });
}

/// The nearest whole number from 0 to 255.
#[inline]
fn nearest(v: f32) -> f32 {
    // From 2²³ on there are no fractions.
    v.clamp(0.0, 255.0) + 8_388_608.0 - 8_388_608.0
}
