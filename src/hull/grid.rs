//! The standing hull on a grid of blocks: views are added one by one, in any order.

use super::{Cone, HullError, cone::Side};
use crate::geometry::{Aabb, Point, Vector};
use rayon::prelude::*;

/// Lattice points along an edge of a block.
pub(super) const B: usize = 8;
/// Lattice points in a block.
const POINTS: usize = B * B * B;
/// The most cells along an edge: 1024³ cells of mixed blocks stay far below a laptop's memory, since only
/// blocks at the surface hold values.
pub const MAX_CELLS: usize = 1200;

/// What is known of a block of 8³ lattice points.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Block {
    /// All points, and those one cell around, are outside: some view says so for the whole block.
    Outside,
    /// All points, and those one cell around, are inside every view so far.
    Inside,
    /// The greatest signed distance (mm) over the views whose outline may pass, `[z, y, x]`.
    Mixed(Box<[f32; POINTS]>),
}

/// The hull on a regular lattice of `pitch_mm`, stored as blocks; only those at the surface hold values.
///
/// Adding a view costs one test a block and 512 evaluations for each block that its outline crosses: as the
/// surface. The result does not depend on the order of the views, nor on the number of threads.
#[derive(Debug, Clone, PartialEq)]
pub struct HullGrid {
    pub(super) origin: Point,
    pub(super) pitch_mm: f64,
    /// Blocks along x, y and z.
    pub(super) blocks_along: [usize; 3],
    pub(super) blocks: Vec<Block>,
    views: usize,
}

/// The hull's voxels as the paper counts them.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct VoxelCount {
    /// Voxels whose centre is inside.
    pub voxels: u64,
    /// Edge of a voxel, mm.
    pub voxel_mm: f64,
    /// Their volume, mm³.
    pub volume_mm3: f64,
}

impl HullGrid {
    /// An uncarved grid over a box (it is the box, filled, until views are added).
    ///
    /// # Errors
    /// [`HullError::Voxel`] and [`HullError::TooFine`].
    pub fn new(bounds: &Aabb, pitch_mm: f64) -> Result<Self, HullError> {
        if !(pitch_mm.is_finite() && pitch_mm > 0.0) {
            return Err(HullError::Voxel(pitch_mm));
        }
        // Two cells of margin, so that the hull never touches the grid's edge.
        let bounds = bounds.grown(2.0 * pitch_mm);
        let cells = bounds.size() / pitch_mm;
        if cells.max() > MAX_CELLS as f64 {
            return Err(HullError::TooFine {
                voxel_mm: pitch_mm,
                cells: cells.max().ceil(),
                limit: MAX_CELLS,
            });
        }
        let blocks_along: [usize; 3] = std::array::from_fn(|k| (cells[k].ceil() as usize + 1).div_ceil(B));
        let blocks = vec![Block::Inside; blocks_along.iter().product()];
        Ok(Self { origin: bounds.min, pitch_mm, blocks_along, blocks, views: 0 })
    }

    /// Views added so far.
    pub fn views(&self) -> usize {
        self.views
    }

    /// Carves by one more view.
    pub fn carve(&mut self, cone: &Cone) {
        let [nx, ny, _] = self.blocks_along;
        let (origin, h) = (self.origin, self.pitch_mm);
        // The block's points and one cell around them.
        let half = 0.5 * (B + 1) as f64 * h;
        let reach = half * 3f64.sqrt();
        self.blocks.par_iter_mut().enumerate().for_each(|(n, block)| {
            if *block == Block::Outside {
                return;
            }
            let first = [n % nx * B, n / nx % ny * B, n / nx / ny * B];
            let corner = origin + Vector::new(first[0] as f64, first[1] as f64, first[2] as f64) * h;
            let center = corner + Vector::repeat(0.5 * (B - 1) as f64 * h);
            match cone.side_of_ball(&center, reach) {
                Side::Inside => {}
                Side::Outside => *block = Block::Outside,
                Side::Across => {
                    let mut values = match std::mem::replace(block, Block::Inside) {
                        Block::Mixed(values) => values,
                        _ => Box::new([f32::NEG_INFINITY; POINTS]),
                    };
                    for (k, row) in values.chunks_exact_mut(B).enumerate() {
                        let first = corner + Vector::new(0.0, (k % B) as f64, (k / B) as f64) * h;
                        cone.carve_row(&first, h, row);
                    }
                    *block = Block::Mixed(values);
                }
            }
        });
        self.views += 1;
    }

    /// Counts the voxels (one about each lattice point) that are inside, as Nadimi & Fonseca (2017) do.
    pub fn count_voxels(&self) -> VoxelCount {
        let counts: Vec<u64> = (self.blocks.par_iter())
            .map(|b| match b {
                Block::Outside => 0,
                Block::Inside => POINTS as u64,
                Block::Mixed(v) => v.iter().filter(|d| **d < 0.0).count() as u64,
            })
            .collect();
        let voxels = counts.iter().sum::<u64>();
        VoxelCount { voxels, voxel_mm: self.pitch_mm, volume_mm3: voxels as f64 * self.pitch_mm.powi(3) }
    }

    /// The values at the 9³ corners of the cells that block `n` owns; neighbours fill the far faces.
    pub(super) fn corners_of(&self, n: usize, out: &mut [f32; (B + 1) * (B + 1) * (B + 1)]) {
        let [nx, ny, nz] = self.blocks_along;
        let at = [n % nx, n / nx % ny, n / nx / ny];
        for (dz, dy, dx) in (0..8).map(|i| (i >> 2 & 1, i >> 1 & 1, i & 1)) {
            let (bx, by, bz) = (at[0] + dx, at[1] + dy, at[2] + dz);
            let block = if bx < nx && by < ny && bz < nz {
                &self.blocks[(bz * ny + by) * nx + bx]
            } else {
                &Block::Outside
            };
            let range = |d: usize| if d == 0 { 0..B } else { B..B + 1 };
            for z in range(dz) {
                for y in range(dy) {
                    for x in range(dx) {
                        out[(z * (B + 1) + y) * (B + 1) + x] = match block {
                            Block::Outside => f32::MAX,
                            Block::Inside => f32::MIN,
                            Block::Mixed(v) => v[((z % B) * B + y % B) * B + x % B],
                        };
                    }
                }
            }
        }
    }

    /// The place of the first lattice point of block `n`.
    pub(super) fn block_corner(&self, n: usize) -> Point {
        let [nx, ny, _] = self.blocks_along;
        let at = Vector::new((n % nx) as f64, (n / nx % ny) as f64, (n / nx / ny) as f64);
        self.origin + at * (B as f64 * self.pitch_mm)
    }
}
