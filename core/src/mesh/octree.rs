//! A balanced octree of cubes about a body: where the background grid is fine and where it is coarse.
//!
//! Cubes that surely lie outside are left out, cubes of a wanted width are leaves, and cubes that share a face or an
//! edge differ by at most a factor of two in width. Coordinates are whole numbers: half the width of the finest cubes
//! is the unit, so that every corner and every centre has its own.

use super::MeshError;
use super::sizes::Sizes;
use crate::geometry::{ImplicitBody, Point, Vector};
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// The most tetrahedra that a mesh may be expected to have.
pub(super) const MOST_TETS: f64 = 2e7;
/// The most cubes that the tree may hold, and bytes that a tetrahedron and what belongs to it take while it is made.
const MOST_CUBES: usize = 8_000_000;
const BYTES_PER_TET: f64 = 450.0;
/// Shifts of the grid, one for each attempt, in spacings: the first keeps a centred body's own planes of
/// symmetry off the grid's points, the later ones are only different.
const SHIFTS: [[f64; 3]; 5] =
    [[0.137, 0.271, 0.389], [0.61, 0.83, 0.21], [0.29, 0.47, 0.73], [0.91, 0.07, 0.57], [0.43, 0.67, 0.11]];
/// Tetrahedra reach no farther from the centre of one of their cubes than this, in widths of that cube: to the
/// centre of a neighbour of twice the width.
const REACH: f64 = 1.75;
/// Half the diagonal of a cube over its width, a hair more.
const HALF_DIAGONAL: f64 = 0.8661;
/// At most so many halvings, so that coordinates fit into 21 bits.
const MOST_LEVELS: u32 = 12;

/// Packs whole coordinates, which are less than 2²¹, into a key.
pub(super) fn key([x, y, z]: [i32; 3]) -> u64 {
    x as u64 | (y as u64) << 21 | (z as u64) << 42
}

/// A hash for packed coordinates: one multiplication.
#[derive(Debug, Default)]
pub(super) struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u64(u64::from(*b)));
    }
    fn write_u64(&mut self, k: u64) {
        let mixed = (self.0 ^ k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

/// A map from packed coordinates.
pub(super) type Map<V> = HashMap<u64, V, BuildHasherDefault<KeyHasher>>;

/// A cube of some level: its index counted in cubes of that level.
#[derive(Debug, Clone, Copy)]
struct Cube {
    at: [i32; 3],
    /// The body's value at its centre, mm.
    value: f64,
    split: bool,
}

#[derive(Debug, Default)]
struct Level {
    cubes: Vec<Cube>,
    index: Map<u32>,
}

/// A cube that is not divided.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    /// Its centre, in units.
    pub(super) center: [i32; 3],
    /// Half its width, in units.
    pub(super) half: i32,
    /// The body's value at its centre, mm.
    pub(super) value: f64,
}

/// The leaves, and where their units lie.
#[derive(Debug)]
pub(super) struct Octree {
    pub(super) leaves: Vec<Leaf>,
    pub(super) origin: Point,
    pub(super) unit_mm: f64,
    /// Whether leaves differ in width.
    pub(super) graded: bool,
}

/// What the tree is grown from.
struct Growth<'a> {
    body: &'a dyn ImplicitBody,
    steep: Option<f64>,
    sizes: &'a Sizes,
    origin: Point,
    unit_mm: f64,
    levels: u32,
}

impl Octree {
    /// Over a body's box, with at least a spacing to spare on each side; shifted otherwise in each attempt.
    pub(super) fn over(body: &dyn ImplicitBody, sizes: &Sizes, attempt: usize) -> Result<Self, MeshError> {
        let bounds = body.bounds();
        let size = bounds.size();
        if !size.iter().all(|x| x.is_finite() && *x > 0.0) || !bounds.min.iter().all(|x| x.is_finite()) {
            return Err(MeshError::Box(size.into()));
        }
        check_count(&size, sizes, body.steepness().is_some())?;
        let finest = sizes.finest_mm;
        let mut levels = 0;
        // Few large cubes at first: what is far from the body goes early.
        while levels < MOST_LEVELS && finest * f64::from(1 << (levels + 1)) < 0.12 * size.max() {
            levels += 1;
        }
        let root_mm = finest * f64::from(1 << levels);
        let spare = sizes.surface_mm.max(finest);
        let shift = Vector::from(SHIFTS[attempt % SHIFTS.len()]) * finest;
        let origin = bounds.min - Vector::repeat(2.0 * spare) + shift;
        let roots: [i32; 3] = size.map(|x| ((x + 4.0 * spare) / root_mm).ceil() as i32).into();
        let growth = Growth { body, steep: body.steepness(), sizes, origin, unit_mm: 0.5 * finest, levels };
        let mut all: Vec<Level> = Vec::new();
        let first: Vec<[i32; 3]> = (0..roots[2])
            .flat_map(|z| (0..roots[1]).flat_map(move |y| (0..roots[0]).map(move |x| [x, y, z])))
            .collect();
        all.push(growth.level(first, 0)?);
        for l in 0..levels {
            let wanted: Vec<bool> =
                all[l as usize].cubes.par_iter().map(|c| growth.must_split(c, l)).collect();
            if !wanted.iter().any(|w| *w) {
                break;
            }
            let level = &mut all[l as usize];
            level.cubes.iter_mut().zip(wanted).for_each(|(c, w)| c.split = w);
            let children: Vec<[i32; 3]> =
                level.cubes.iter().filter(|c| c.split).flat_map(|c| children(c.at)).collect();
            let next = growth.level(children, l + 1)?;
            all.push(next);
            if all.iter().map(|level| level.cubes.len()).sum::<usize>() > MOST_CUBES {
                return Err(too_many(finest, 12.0 * MOST_CUBES as f64));
            }
        }
        growth.balance(&mut all)?;
        Ok(growth.leaves(&all))
    }
}

/// Refuses sizes that need more tetrahedra than memory holds.
fn check_count(size: &Vector, sizes: &Sizes, pruned: bool) -> Result<(), MeshError> {
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let (s, i) = (sizes.surface_mm, sizes.inside_mm);
    // A body fills about half of its box (a ball: π/6): coarse inside, fine in some layers along the surface.
    let half = std::f64::consts::FRAC_PI_6 * size.product();
    let layers = (4.0 * s * 0.5 * area).min(half);
    let mut estimate = 12.0 * ((half - layers) / i.powi(3) + layers / s.powi(3));
    if !pruned {
        // Without a bound on the body's steepness the whole box is looked at.
        estimate = estimate.max(size.map(|x| (x / s).ceil() + 3.0).product());
    }
    if estimate.is_finite() && estimate <= MOST_TETS { Ok(()) } else { Err(too_many(s, estimate)) }
}

fn too_many(spacing_mm: f64, estimate: f64) -> MeshError {
    let remedy_mm = 1.05 * (estimate / MOST_TETS).cbrt() * spacing_mm;
    let gigabytes = estimate * BYTES_PER_TET / 1e9;
    MeshError::TooMany { spacing_mm, estimate, gigabytes, limit: MOST_TETS, remedy_mm }
}

fn children([x, y, z]: [i32; 3]) -> [[i32; 3]; 8] {
    std::array::from_fn(|i| [2 * x + (i & 1) as i32, 2 * y + (i >> 1 & 1) as i32, 2 * z + (i >> 2) as i32])
}

impl Growth<'_> {
    /// Half the width of a level's cubes, in units.
    fn half(&self, level: u32) -> i32 {
        1 << (self.levels - level)
    }

    fn position(&self, at: [i32; 3]) -> Point {
        self.origin + Vector::from(at.map(f64::from)) * self.unit_mm
    }

    fn center(&self, at: [i32; 3], level: u32) -> [i32; 3] {
        at.map(|x| (2 * x + 1) * self.half(level))
    }

    /// The cubes of a level that do not surely lie outside.
    fn level(&self, at: Vec<[i32; 3]>, level: u32) -> Result<Level, MeshError> {
        let width = 2.0 * f64::from(self.half(level)) * self.unit_mm;
        let values: Vec<f64> =
            at.par_iter().map(|at| self.body.value(&self.position(self.center(*at, level)))).collect();
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(MeshError::NotFinite(self.position(self.center(at[i], level)), values[i]));
        }
        let far = self.steep.map_or(f64::INFINITY, |s| s * REACH * width);
        let cubes: Vec<Cube> = at
            .into_iter()
            .zip(values)
            .filter(|(_, v)| *v < far)
            .map(|(at, value)| Cube { at, value, split: false })
            .collect();
        let mut index = Map::with_capacity_and_hasher(cubes.len(), BuildHasherDefault::default());
        for (i, c) in cubes.iter().enumerate() {
            index.insert(key(c.at), i as u32);
        }
        Ok(Level { cubes, index })
    }

    /// Whether a cube is larger than the size field allows.
    fn must_split(&self, cube: &Cube, level: u32) -> bool {
        let width = 2.0 * f64::from(self.half(level)) * self.unit_mm;
        let half_diagonal = HALF_DIAGONAL * width;
        let depth = self.steep.map_or(0.0, |s| (-cube.value / s - half_diagonal).max(0.0));
        let center = self.position(self.center(cube.at, level));
        width > self.sizes.at(&center, half_diagonal, depth) * (1.0 + 1e-9)
    }

    /// Divides cubes until neighbours over faces and edges differ by one level at most.
    fn balance(&self, all: &mut [Level]) -> Result<(), MeshError> {
        for l in (1..all.len()).rev() {
            // Every divided cube of level l needs neighbours of its own width: their parents must be divided.
            let (above, here) = all.split_at_mut(l);
            let parents = &mut above[l - 1];
            let mut divided: Vec<u32> = Vec::new();
            for cube in here[0].cubes.iter().filter(|c| c.split) {
                for d in 0..27 {
                    let step = [d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1];
                    let at: [i32; 3] = std::array::from_fn(|k| (cube.at[k] + step[k]) >> 1);
                    if step.iter().filter(|s| **s != 0).count() == 3 || at.iter().any(|x| *x < 0) {
                        continue;
                    }
                    if let Some(&p) = parents.index.get(&key(at))
                        && !parents.cubes[p as usize].split
                    {
                        parents.cubes[p as usize].split = true;
                        divided.push(p);
                    }
                }
            }
            let at = divided.iter().flat_map(|&p| children(parents.cubes[p as usize].at)).collect();
            let more = self.level(at, l as u32)?;
            let level = &mut here[0];
            for cube in more.cubes {
                level.index.insert(key(cube.at), level.cubes.len() as u32);
                level.cubes.push(cube);
            }
        }
        Ok(())
    }

    /// The leaves along a curve that keeps near what is near (Morton order).
    fn leaves(&self, all: &[Level]) -> Octree {
        let mut leaves: Vec<(u64, Leaf)> = Vec::new();
        for (l, level) in all.iter().enumerate() {
            let half = self.half(l as u32);
            leaves.extend(level.cubes.iter().filter(|c| !c.split).map(|c| {
                let center = self.center(c.at, l as u32);
                (morton(center), Leaf { center, half, value: c.value })
            }));
        }
        leaves.par_sort_unstable_by_key(|(code, _)| *code);
        let leaves: Vec<Leaf> = leaves.into_iter().map(|(_, leaf)| leaf).collect();
        let graded = leaves.iter().any(|leaf| leaf.half != leaves[0].half);
        Octree { leaves, origin: self.origin, unit_mm: self.unit_mm, graded }
    }
}

/// Interleaves the bits of three coordinates.
fn morton(at: [i32; 3]) -> u64 {
    let spread = |x: i32| {
        let mut v = x as u64 & 0x1F_FFFF;
        v = (v | v << 32) & 0x001F_0000_0000_FFFF;
        v = (v | v << 16) & 0x001F_0000_FF00_00FF;
        v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
        v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    spread(at[0]) | spread(at[1]) << 1 | spread(at[2]) << 2
}
