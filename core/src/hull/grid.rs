//! Space carving on a sparse block grid: views are added one by one or together, in any order.

use super::cone::Side;
use super::{Cone, HullError};
use crate::geometry::{Aabb, Point, Vector};
use rayon::prelude::*;

/// Lattice points along an edge of a block.
pub(super) const B: usize = 8;
/// Lattice points in a block.
pub(super) const POINTS: usize = B * B * B;
/// Blocks along an edge of a group: as many as a word has bits.
pub(super) const R: usize = 4;
/// Blocks in a group.
pub(super) const BLOCKS: usize = R * R * R;
/// The most cells along an edge: 1024³ cells of mixed blocks stay far below a laptop's memory, since only
/// blocks at the surface hold values.
pub const MAX_CELLS: usize = 1200;
/// How often progress is reported.
const STEPS: usize = 16;

/// What is known of a block of 8³ lattice points.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Block {
    /// All points, and those one cell around, are outside: some view excludes the whole block.
    Outside,
    /// All points, and those one cell around, are inside every view so far.
    Inside,
    /// The greatest signed distance (mm) over the views whose outline may pass, `[z, y, x]`.
    Mixed(Box<[f32; POINTS]>),
}

/// What is known of a group of 4³ blocks.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Group {
    /// All its blocks are outside.
    Outside,
    /// All its blocks are inside every view so far.
    Inside,
    /// Its blocks, `[z, y, x]`.
    Split(Box<[Block; BLOCKS]>),
}

/// The hull on a regular lattice of `pitch_mm`: groups of 4³ blocks of 8³ points. Only groups at the surface hold
/// blocks, and only blocks at the surface hold values.
///
/// A view costs one test a group, 64 for each group that its outline crosses, and 512 evaluations for each block that
/// it crosses and no view removes: as the surface. The result depends neither on the order of the views, nor on how
/// many are added at a time, nor on the number of threads.
#[derive(Debug, Clone, PartialEq)]
pub struct HullGrid {
    pub(super) origin: Point,
    pub(super) pitch_mm: f64,
    /// Groups along x, y and z.
    pub(super) groups_along: [usize; 3],
    pub(super) groups: Vec<Group>,
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
        let groups_along = blocks_along.map(|n| n.div_ceil(R));
        // Groups at the end may reach beyond the box: what they have there is outside.
        let group = |n: usize| {
            let at = unravel(n, groups_along).map(|x| R * x);
            if (0..3).all(|k| at[k] + R <= blocks_along[k]) {
                return Group::Inside;
            }
            Group::Split(Box::new(std::array::from_fn(|b| {
                let within = unravel(b, [R; 3]).iter().zip(at).zip(blocks_along).all(|((x, a), n)| a + x < n);
                if within { Block::Inside } else { Block::Outside }
            })))
        };
        let groups = (0..groups_along.iter().product()).map(group).collect();
        Ok(Self { origin: bounds.min, pitch_mm, groups_along, groups, views: 0 })
    }

    /// Views added so far.
    pub fn views(&self) -> usize {
        self.views
    }

    /// Carves by one more view.
    pub fn carve(&mut self, cone: &Cone) {
        self.carve_all(std::slice::from_ref(cone), &mut |_| {});
    }

    /// Carves by several views at once, which gives the same grid as one after the other, and sooner: no block is
    /// evaluated that any of them removes. `progress` is called with the part that is done, 0 to 1.
    pub fn carve_all(&mut self, cones: &[Cone], progress: &mut dyn FnMut(f64)) {
        let (groups, along, origin, pitch_mm) =
            (self.groups.len(), self.groups_along, self.origin, self.pitch_mm);
        let some = groups.div_ceil(STEPS).max(1);
        for (step, part) in self.groups.chunks_mut(some).enumerate() {
            part.par_iter_mut().enumerate().for_each_init(Vec::new, |across, (n, group)| {
                let at = unravel(step * some + n, along).map(|x| (R * B * x) as f64);
                carve_group(group, &(origin + Vector::from(at) * pitch_mm), pitch_mm, cones, across);
            });
            progress(((step + 1) * some).min(groups) as f64 / groups as f64);
        }
        self.views += cones.len();
    }

    /// Counts the voxels (one about each lattice point) that are inside, as Nadimi & Fonseca (2017) do.
    pub fn count_voxels(&self) -> VoxelCount {
        let count = |b: &Block| match b {
            Block::Outside => 0,
            Block::Inside => POINTS as u64,
            Block::Mixed(v) => v.iter().map(|d| u64::from(*d < 0.0)).sum(),
        };
        let voxels: u64 = (self.groups.par_iter())
            .map(|r| match r {
                Group::Outside => 0,
                Group::Inside => (BLOCKS * POINTS) as u64,
                Group::Split(blocks) => blocks.iter().map(count).sum(),
            })
            .sum();
        VoxelCount { voxels, voxel_mm: self.pitch_mm, volume_mm3: voxels as f64 * self.pitch_mm.powi(3) }
    }

    /// The block at an index, counted in blocks along x, y and z.
    pub(super) fn block(&self, at: [usize; 3]) -> &Block {
        let [nx, ny, nz] = self.groups_along;
        let [x, y, z] = at.map(|i| i / R);
        if x >= nx || y >= ny || z >= nz {
            return &Block::Outside;
        }
        match &self.groups[(z * ny + y) * nx + x] {
            Group::Outside => &Block::Outside,
            Group::Inside => &Block::Inside,
            Group::Split(blocks) => &blocks[((at[2] % R) * R + at[1] % R) * R + at[0] % R],
        }
    }

    /// The values at the 9³ corners of the cells that a block owns, `[z, y, x]`; neighbours fill the far faces.
    pub(super) fn corners_of(&self, at: [usize; 3], out: &mut [f32; (B + 1) * (B + 1) * (B + 1)]) {
        for (dz, dy, dx) in (0..8).map(|i| (i >> 2 & 1, i >> 1 & 1, i & 1)) {
            let block = self.block([at[0] + dx, at[1] + dy, at[2] + dz]);
            let range = |d: usize| if d == 0 { 0..B } else { B..B + 1 };
            let across = range(dx);
            for z in range(dz) {
                for y in range(dy) {
                    let row = (z * (B + 1) + y) * (B + 1);
                    let row = &mut out[row + across.start..row + across.end];
                    match block {
                        Block::Outside => row.fill(f32::MAX),
                        Block::Inside => row.fill(f32::MIN),
                        Block::Mixed(v) => {
                            let from = ((z % B) * B + y % B) * B;
                            row.copy_from_slice(&v[from..from + row.len()]);
                        }
                    }
                }
            }
        }
    }
}

/// The index `[x, y, z]` of element `n` of an array of `along` elements along each axis; x varies fastest.
pub(super) fn unravel(n: usize, along: [usize; 3]) -> [usize; 3] {
    [n % along[0], n / along[0] % along[1], n / along[0] / along[1]]
}

/// Half the edge of a box of `points` lattice points and one cell around them.
fn half(points: usize, pitch_mm: f64) -> Vector {
    Vector::repeat(0.5 * (points + 1) as f64 * pitch_mm)
}

/// Carves a group, whose first point is `first`. `across` keeps the views that cross it, and their blocks.
///
/// A block is outside when a view excludes it or its group; otherwise it holds the distances of the views that
/// cross both. Neither depends on the other views, so views may come in any order.
fn carve_group(
    group: &mut Group,
    first: &Point,
    pitch_mm: f64,
    cones: &[Cone],
    across: &mut Vec<(usize, u64)>,
) {
    let mut alive = match group {
        Group::Outside => return,
        Group::Inside => u64::MAX,
        Group::Split(blocks) => (blocks.iter().enumerate())
            .fold(0, |bits, (b, block)| bits | u64::from(*block != Block::Outside) << b),
    };
    let middle = first + Vector::repeat(0.5 * (R * B - 1) as f64 * pitch_mm);
    across.clear();
    for (k, cone) in cones.iter().enumerate() {
        match cone.side_of_box(&middle, &half(R * B, pitch_mm)) {
            Side::Inside => {}
            Side::Across => across.push((k, 0)),
            Side::Outside => {
                *group = Group::Outside;
                return;
            }
        }
    }
    let corner = |b: usize| first + Vector::from(unravel(b, [R; 3]).map(|x| (B * x) as f64)) * pitch_mm;
    let to_middle = Vector::repeat(0.5 * (B - 1) as f64 * pitch_mm);
    for (k, crossed) in across.iter_mut() {
        for b in bits(alive) {
            match cones[*k].side_of_box(&(corner(b) + to_middle), &half(B, pitch_mm)) {
                Side::Inside => {}
                Side::Across => *crossed |= 1 << b,
                Side::Outside => alive &= !(1 << b),
            }
        }
    }
    if alive == 0 {
        *group = Group::Outside;
        return;
    }
    if *group == Group::Inside {
        if alive == u64::MAX && across.iter().all(|(_, crossed)| *crossed == 0) {
            return;
        }
        *group = Group::Split(Box::new([const { Block::Inside }; BLOCKS]));
    }
    let Group::Split(blocks) = group else { return };
    for (b, block) in blocks.iter_mut().enumerate() {
        if alive >> b & 1 == 0 {
            *block = Block::Outside;
            continue;
        }
        for (k, _) in across.iter().filter(|(_, crossed)| crossed >> b & 1 == 1) {
            if *block == Block::Inside {
                *block = Block::Mixed(Box::new([f32::NEG_INFINITY; POINTS]));
            }
            if let Block::Mixed(values) = block {
                cones[*k].raise(&corner(b), pitch_mm, values);
            }
        }
    }
}

/// The numbers of the bits that are set.
fn bits(word: u64) -> impl Iterator<Item = usize> {
    std::iter::successors((word != 0).then_some(word), |w| (w & (w - 1) != 0).then_some(w & (w - 1)))
        .map(|w| w.trailing_zeros() as usize)
}
