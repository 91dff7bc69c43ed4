//! Pixel-accurate masks: connected components by runs (He, Chao & Suzuki 2008).

use super::rect::Rect;
use memchr::{memchr, memrchr};

/// A mask over a rectangle: one byte a pixel, 0 or 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mask {
    pub width: usize,
    pub height: usize,
    pub bits: Vec<u8>,
}

/// Pixels `start..end` of one row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    pub row: usize,
    pub start: usize,
    pub end: usize,
    /// Index of its component.
    pub component: usize,
}

/// A connected set of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Component {
    pub area: usize,
    /// Least and greatest column and row, inclusive.
    pub least: [usize; 2],
    pub greatest: [usize; 2],
}

/// What connects two pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Connect {
    /// A common side.
    Sides,
    /// A common side or corner.
    Corners,
}

impl Mask {
    pub(super) fn empty(width: usize, height: usize) -> Self {
        Self { width, height, bits: vec![0; width * height] }
    }

    pub(super) fn get(&self, x: usize, y: usize) -> bool {
        self.bits[y * self.width + x] != 0
    }

    pub(super) fn area(&self) -> usize {
        self.bits.iter().map(|&b| usize::from(b)).sum()
    }

    /// Length of the mask's edge, pixels, to 5 % whichever way it runs: Crofton's formula, by the pixels that differ
    /// from their neighbours in four directions.
    pub(super) fn edge_length(&self) -> f64 {
        let differ =
            |step: usize| self.bits.iter().zip(&self.bits[step..]).filter(|(a, b)| a != b).count() as f64;
        let straight = differ(1) + differ(self.width);
        let slanting = differ(self.width - 1) + differ(self.width + 1);
        std::f64::consts::FRAC_PI_8 * (straight + slanting * std::f64::consts::FRAC_1_SQRT_2)
    }

    /// How far this mask's edge is from another's on average, pixels.
    pub(super) fn mean_shift(&self, other: &Self) -> f64 {
        let differ = self.bits.iter().zip(&other.bits).filter(|(a, b)| a != b).count();
        differ as f64 / self.edge_length().max(1.0)
    }

    /// Columns and rows that hold a set pixel.
    pub(super) fn extents(&self) -> (usize, usize) {
        let mut columns = vec![0u8; self.width];
        let mut rows = 0;
        for row in self.bits.chunks_exact(self.width) {
            columns.iter_mut().zip(row).for_each(|(c, b)| *c |= b);
            rows += usize::from(row.contains(&1));
        }
        (columns.iter().map(|&c| usize::from(c)).sum(), rows)
    }

    /// The least rectangle that holds all set pixels; `None` where there are none.
    pub(super) fn bounds(&self) -> Option<Rect> {
        let set = |y: &usize| memchr(1, &self.bits[y * self.width..][..self.width]).is_some();
        let y0 = (0..self.height).find(set)?;
        let y1 = (y0..self.height).rev().find(set)? + 1;
        let mut columns = vec![0u8; self.width];
        for row in self.bits[y0 * self.width..y1 * self.width].chunks_exact(self.width) {
            columns.iter_mut().zip(row).for_each(|(c, b)| *c |= b);
        }
        Some(Rect { x0: memchr(1, &columns)?, y0, x1: memrchr(1, &columns)? + 1, y1 })
    }

    /// A part.
    pub(super) fn part(&self, part: &Rect) -> Self {
        Self { width: part.width(), height: part.height(), bits: part.part_of(&self.bits, self.width) }
    }

    /// Takes in what is in another mask of the same size.
    pub(super) fn add(&mut self, other: &Self) {
        self.bits.iter_mut().zip(&other.bits).for_each(|(bit, other)| *bit |= other);
    }

    pub(super) fn complement(&self) -> Self {
        Self { bits: self.bits.iter().map(|b| 1 - b).collect(), ..*self }
    }

    /// Runs in reading order, and the components in the order of their first pixel.
    pub(super) fn components(&self, connect: Connect) -> (Vec<Run>, Vec<Component>) {
        let mut runs: Vec<Run> = Vec::new();
        let mut parent: Vec<usize> = Vec::new();
        let reach = usize::from(connect == Connect::Corners);
        let mut above = 0..0;
        for (row, bits) in self.bits.chunks_exact(self.width).enumerate() {
            let first = runs.len();
            let mut x = 0;
            let mut k = above.start;
            while let Some(start) = memchr(1, &bits[x..]).map(|p| p + x) {
                let end = memchr(0, &bits[start..]).map_or(self.width, |p| p + start);
                let mut label = None;
                while k < above.end && runs[k].end + reach <= start {
                    k += 1;
                }
                let mut j = k;
                while j < above.end && runs[j].start < end + reach {
                    let other = root(&mut parent, runs[j].component);
                    label = Some(match label {
                        None => other,
                        Some(mine) => {
                            let (low, high) = if mine < other { (mine, other) } else { (other, mine) };
                            parent[high] = low;
                            low
                        }
                    });
                    j += 1;
                }
                let component = label.unwrap_or_else(|| {
                    parent.push(parent.len());
                    parent.len() - 1
                });
                runs.push(Run { row, start, end, component });
                x = end;
            }
            above = first..runs.len();
        }
        let mut names = vec![usize::MAX; parent.len()];
        let mut components: Vec<Component> = Vec::new();
        for run in &mut runs {
            let root = root(&mut parent, run.component);
            if names[root] == usize::MAX {
                names[root] = components.len();
                components.push(Component { area: 0, least: [usize::MAX; 2], greatest: [0; 2] });
            }
            run.component = names[root];
            let c = &mut components[run.component];
            c.area += run.end - run.start;
            c.least = [c.least[0].min(run.start), c.least[1].min(run.row)];
            c.greatest = [c.greatest[0].max(run.end - 1), c.greatest[1].max(run.row)];
        }
        (runs, components)
    }

    /// Keeps only the components for which `keep` holds.
    pub(super) fn select(&self, runs: &[Run], keep: impl Fn(usize) -> bool) -> Self {
        let mut out = Self::empty(self.width, self.height);
        for run in runs.iter().filter(|run| keep(run.component)) {
            let start = run.row * self.width;
            out.bits[start + run.start..start + run.end].fill(1);
        }
        out
    }

    /// Only its largest component (the first of equals), connected by sides.
    pub(super) fn largest(&self) -> Self {
        let (runs, components) = self.components(Connect::Sides);
        let best = (0..components.len()).rev().max_by_key(|&k| components[k].area);
        self.select(&runs, |k| Some(k) == best)
    }

    /// The largest component that holds a pixel (column, row) for which `marked` holds, provided it is no speck beside
    /// the largest of all (a tenth of its area); else that one.
    pub(super) fn largest_that(&self, marked: impl Fn(f64, f64) -> bool) -> Self {
        let (runs, components) = self.components(Connect::Sides);
        let mut is_marked = vec![false; components.len()];
        for run in &runs {
            let marks = &mut is_marked[run.component];
            *marks = *marks || (run.start..run.end).any(|x| marked(x as f64, run.row as f64));
        }
        let greatest = components.iter().map(|c| c.area).max().unwrap_or(0);
        let candidate = |k: usize| is_marked[k] && 10 * components[k].area >= greatest;
        let best = (0..components.len()).rev().max_by_key(|&k| (candidate(k), components[k].area));
        self.select(&runs, |k| Some(k) == best)
    }
}

fn root(parent: &mut [usize], mut k: usize) -> usize {
    while parent[k] != k {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    k
}
