//! Voxelisation of the slices, a bit a voxel.

use super::cut::Corner;
use super::{SliceError, SlicedHull};
use crate::geometry::Point;
use rayon::prelude::*;

/// The most voxels: 2³⁴ of them take 2 GiB.
const MOST_VOXELS: f64 = 17_179_869_184.0;

/// A regular grid of voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelGrid {
    /// Centre of the first voxel.
    pub origin: Point,
    /// Edge of a voxel, mm.
    pub pitch_mm: f64,
    /// Voxels along x, y and z.
    pub dims: [usize; 3],
}

/// Voxels of the hull: a bit each, set where the voxel's centre is inside.
#[derive(Debug, Clone, PartialEq)]
pub struct BitVoxels {
    grid: VoxelGrid,
    /// Words of 64 voxels in a row along x; the first voxel is the lowest bit.
    stride: usize,
    /// `[z, y, word]`.
    words: Vec<u64>,
}

impl BitVoxels {
    /// The grid.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// The bits, `[z, y, word]`, with [`BitVoxels::stride`] words of 64 voxels a row along x.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Words in a row along x.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Whether a voxel is set.
    pub fn get(&self, [x, y, z]: [usize; 3]) -> bool {
        self.words[(z * self.grid.dims[1] + y) * self.stride + x / 64] >> (x % 64) & 1 == 1
    }

    /// How many voxels are set.
    pub fn count(&self) -> u64 {
        self.words.par_chunks(1 << 14).map(|w| w.iter().map(|w| u64::from(w.count_ones())).sum::<u64>()).sum()
    }
}

impl SlicedHull {
    /// The voxels whose centres are inside. A layer of voxels is cut from the row in whose slab its centres lie; a
    /// row grid with a row for each layer makes them exact.
    ///
    /// Each slice is filled line by line between its left and right chain of edges: the cost is as the layers' lines
    /// that the hull crosses and the words that are set, whatever the number of views.
    ///
    /// # Errors
    /// [`SliceError::Voxels`] where the pitch is not a positive number or the voxels are too many.
    pub fn voxels(&self, grid: VoxelGrid) -> Result<BitVoxels, SliceError> {
        let VoxelGrid { origin, pitch_mm, dims } = grid;
        let sound = pitch_mm.is_finite() && pitch_mm > 0.0 && origin.iter().all(|x| x.is_finite());
        let stride = dims[0].div_ceil(64);
        let voxels = 64.0 * stride as f64 * dims[1] as f64 * dims[2] as f64;
        if !sound || voxels > MOST_VOXELS {
            return Err(SliceError::Voxels { pitch_mm, dims });
        }
        let layer = stride * dims[1];
        let mut words = vec![0_u64; layer * dims[2]];
        if layer > 0 {
            words.par_chunks_mut(layer).enumerate().for_each_init(Lines::default, |lines, (k, words)| {
                let row = (origin.z + k as f64 * pitch_mm - self.row_grid.first_mm) / self.row_grid.pitch_mm;
                let row = (row + 0.5).floor();
                if row >= 0.0 && row < self.row_grid.rows as f64 {
                    for piece in self.slice(row as usize) {
                        lines.fill(piece, &grid, stride, words);
                    }
                }
            });
        }
        Ok(BitVoxels { grid, stride, words })
    }
}

/// Where a piece begins and ends on each line of voxels.
#[derive(Debug, Default)]
struct Lines {
    ends: Vec<[f64; 2]>,
}

impl Lines {
    /// Sets the voxels of a convex polygon in a layer.
    fn fill(&mut self, piece: &[Corner], grid: &VoxelGrid, stride: usize, layer: &mut [u64]) {
        let (per_mm, dims) = (1.0 / grid.pitch_mm, grid.dims);
        let in_voxels = |c: &Corner| [0, 1].map(|k| (c.at[k] - grid.origin[k]) * per_mm);
        let (low, high) = (piece.iter().map(|c| in_voxels(c)[1]))
            .fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y), high.max(y)));
        // Lines y with low ≤ y < high.
        let line = |y: f64| y.ceil().clamp(0.0, dims[1] as f64) as usize;
        let (first, end) = (line(low), line(high));
        if first >= end {
            return;
        }
        self.ends.clear();
        self.ends.resize(end - first, [0.0; 2]);
        let mut a = in_voxels(&piece[piece.len() - 1]);
        for c in piece {
            let b = in_voxels(c);
            // Counter-clockwise, the right chain goes up and the left one down.
            let (side, from, to) = if b[1] > a[1] { (1, a, b) } else { (0, b, a) };
            let slope = (to[0] - from[0]) / (to[1] - from[1]);
            for y in line(from[1])..line(to[1]) {
                self.ends[y - first][side] = from[0] + (y as f64 - from[1]) * slope;
            }
            a = b;
        }
        let last = dims[0] as f64 - 1.0;
        for (k, [left, right]) in self.ends.iter().enumerate() {
            let (left, right) = (left.ceil().max(0.0), right.floor().min(last));
            if left <= right {
                let words = &mut layer[(first + k) * stride..][..stride];
                set(words, left as usize, right as usize);
            }
        }
    }
}

/// Sets the bits from `first` to `last`.
#[inline]
fn set(words: &mut [u64], first: usize, last: usize) {
    let (a, b) = (first / 64, last / 64);
    let (from, to) = (!0 << (first % 64), !0 >> (63 - last % 64));
    if a == b {
        words[a] |= from & to;
    } else {
        words[a] |= from;
        words[a + 1..b].fill(!0);
        words[b] |= to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull::slices::{RowGrid, Strips};

    #[test]
    fn runs_of_bits_are_set_across_words() {
        for (first, last) in [(0, 0), (5, 63), (63, 64), (64, 127), (3, 190), (0, 191), (130, 131)] {
            let mut words = [0_u64; 3];
            set(&mut words, first, last);
            for k in 0..192 {
                assert_eq!(
                    words[k / 64] >> (k % 64) & 1 == 1,
                    (first..=last).contains(&k),
                    "{first} {last} {k}"
                );
            }
        }
    }

    #[test]
    fn voxels_are_those_whose_centres_every_strip_holds() {
        // Two columns and a gap between them in one view; grids that do not fit the hull.
        let row_grid = RowGrid { first_mm: 0.05, pitch_mm: 0.1, rows: 10 };
        let views: Vec<Strips> = (0..5)
            .map(|k| {
                let angle = 0.3 + 0.6 * f64::from(k);
                Strips::from_fn(row_grid, angle, |z, out| match k {
                    2 => out.extend([[-0.5, -0.1 * z], [0.2 + 0.1 * z, 0.6]]),
                    _ => out.push([-0.45 - 0.1 * z, 0.52]),
                })
                .unwrap()
            })
            .collect();
        let hull = SlicedHull::new(&views).unwrap();
        for (origin, pitch_mm, dims) in [
            ([-0.8, -0.8, -0.2], 0.0171, [100, 97, 40]),
            ([-0.1, -0.2, 0.3], 0.003, [130, 65, 3]),
            ([0.0, 0.0, 0.0], 0.1, [0, 4, 4]),
        ] {
            let grid = VoxelGrid { origin: Point::from(origin), pitch_mm, dims };
            let voxels = hull.voxels(grid).unwrap();
            let mut count = 0;
            for n in 0..dims.iter().product() {
                let at = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
                let p: [f64; 3] = std::array::from_fn(|k| origin[k] + at[k] as f64 * pitch_mm);
                let row = (p[2] / 0.1).floor();
                let inside = (0.0..10.0).contains(&row)
                    && views.iter().all(|v| {
                        let u = p[0] * v.angle_rad().cos() - p[1] * v.angle_rad().sin();
                        v.row(row as usize).iter().any(|[a, b]| (*a..=*b).contains(&u))
                    });
                assert_eq!(voxels.get(at), inside, "{at:?}");
                count += u64::from(inside);
            }
            assert_eq!(voxels.count(), count);
        }
        let bad = VoxelGrid { origin: Point::origin(), pitch_mm: 0.0, dims: [8; 3] };
        assert!(matches!(hull.voxels(bad), Err(SliceError::Voxels { .. })));
        let huge = VoxelGrid { pitch_mm: 1.0, dims: [1 << 20; 3], ..bad };
        assert!(matches!(hull.voxels(huge), Err(SliceError::Voxels { .. })));
    }
}
