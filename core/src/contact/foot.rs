//! The part of a grain's surface that its pedestal hid.
//!
//! A hull from silhouettes is cut flat where the pedestal begins, and just above that the grain's and the pedestal's light
//! mix. What the grain has there, in the bore of a tube or in glue, no view shows. Left as it is, the flat carries a plate like a side
//! of the grain, which it is not. Here it is closed by the surface that bends least among those that go through the part of the
//! surface around it, as seen from below: the thin plate
//!
//! ```text
//! z(x, y) = a + b x + c y + Σ wₖ r² ln r,   r = |(x, y) − (xₖ, yₖ)|        (Duchon 1977)
//! ```
//!
//! of the heights of the vertices beside it, as wide a belt as the flat's radius. The depth is that of an
//! ellipsoid to a tenth; of real grains that were sunk and cut, two in three are within a factor of two (`tests/contact/foot.rs`).

use crate::geometry::{Point, TriangleMesh, Vector};
use nalgebra::{DMatrix, DVector};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Widths of the belt that tells how the surface goes on, over the radius of the flat's area: the first that has enough vertices.
const BELTS: [f64; 3] = [1.0, 1.6, 2.5];
/// Vertices of the belt: fewer say nothing; of more every so many count.
const BELT: [usize; 2] = [12, 400];
/// The belt ends where the surface is steeper than this, as the third component of its outward normal.
const STEEPEST: f64 = -0.2;
/// What the plate bends away from single vertices, which are as unsteady as outlines are.
const STIFFNESS: f64 = 3e-3;
/// The depth of a closing that can be believed, over the radius of the flat's area: half a ball.
const DEEPEST: f64 = 1.0;

/// The foot of a grain that stood on its pedestal, upright, with the pedestal's top at the height 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Foot {
    /// The height up to which no view shows the surface, mm.
    pub height_mm: f64,
    /// The area of the surface up to there, as it was carved, mm².
    pub area_mm2: f64,
    /// How far below the lowest place of the carved surface the closed one is, mm; none where the surface around does not tell.
    pub depth_mm: Option<f64>,
    /// The vertices in it, and their heights where it is closed, mm.
    closed: Vec<(u32, f64)>,
}

impl Foot {
    /// The foot of a closed surface, whose triangles are counter-clockwise seen from outside: what lies below a height. None where
    /// nothing does.
    pub fn of(surface: &TriangleMesh, height_mm: f64) -> Option<Self> {
        let is_low = |p: &Point| p.z < height_mm;
        let inside: Vec<u32> =
            (0..surface.vertices.len() as u32).filter(|v| is_low(&surface.vertices[*v as usize])).collect();
        let area = |t: usize| {
            let [a, b, c] = surface.corners(t);
            if [a, b, c].iter().all(is_low) { 0.5 * (b - a).cross(&(c - a)).norm() } else { 0.0 }
        };
        let area_mm2: f64 = (0..surface.triangles.len()).map(area).sum();
        if area_mm2 <= 0.0 {
            return None;
        }
        let mut foot = Self { height_mm, area_mm2, depth_mm: None, closed: Vec::new() };
        if let Some(heights) = foot.heights(surface, &inside) {
            foot.close(surface, inside.into_iter().zip(heights).collect());
        }
        Some(foot)
    }

    /// The surface with its foot closed, by this share of the way from how it was carved: 0 leaves it, 1 is the most likely,
    /// 2 twice as deep.
    pub fn closed(&self, surface: &TriangleMesh, share: f64) -> TriangleMesh {
        let mut vertices = surface.vertices.clone();
        for &(v, z) in &self.closed {
            let height = &mut vertices[v as usize].z;
            *height += share * (z - *height);
        }
        TriangleMesh { vertices, triangles: surface.triangles.clone() }
    }

    /// Whether a place of the surface, in the frame in which it stood on the pedestal, is in the foot.
    pub fn holds(&self, p: &Point) -> bool {
        p.z < self.height_mm
    }

    /// The radius of a circle of the foot's area, mm.
    fn radius(&self) -> f64 {
        (self.area_mm2 / std::f64::consts::PI).sqrt()
    }

    /// Takes these heights where they make a surface: one that nowhere turns over, and is no deeper than can be believed.
    fn close(&mut self, surface: &TriangleMesh, closed: Vec<(u32, f64)>) {
        let lowest = |heights: &mut dyn Iterator<Item = f64>| heights.fold(f64::INFINITY, f64::min);
        let carved = lowest(&mut closed.iter().map(|(v, _)| surface.vertices[*v as usize].z));
        let depth_mm = carved - lowest(&mut closed.iter().map(|(_, z)| *z));
        let before = std::mem::replace(&mut self.closed, closed);
        let moved = self.closed(surface, 1.0);
        let folds = (0..surface.triangles.len()).any(|t| {
            let up = |m: &TriangleMesh| {
                let [a, b, c] = m.corners(t);
                (b - a).cross(&(c - a)).z
            };
            up(surface) < 0.0 && up(&moved) >= 0.0
        });
        if folds || depth_mm > DEEPEST * self.radius() {
            self.closed = before;
        } else {
            self.depth_mm = Some(depth_mm.max(0.0));
        }
    }

    /// The heights of the thin plate at these vertices; none where too little of the surface around tells of it.
    fn heights(&self, surface: &TriangleMesh, inside: &[u32]) -> Option<Vec<f64>> {
        let around = distances(surface, inside, BELTS[BELTS.len() - 1] * self.radius());
        let normals = normals(surface);
        let belts = BELTS.map(|wide| {
            (0..around.len())
                .filter(|&v| around[v] > 0.0 && around[v] <= wide * self.radius() && normals[v].z < STEEPEST)
                .map(|v| surface.vertices[v])
                .collect::<Vec<Point>>()
        });
        let belt = belts.into_iter().find(|b| b.len() >= BELT[0])?;
        let every = belt.len().div_ceil(BELT[1]);
        let belt: Vec<Point> = belt.into_iter().step_by(every).collect();
        let plate = ThinPlate::through(&belt, STIFFNESS)?;
        let heights: Vec<f64> = inside.iter().map(|v| plate.at(&surface.vertices[*v as usize])).collect();
        heights.iter().all(|z| z.is_finite()).then_some(heights)
    }
}

/// How far each vertex is from the nearest of some, along the surface's edges, mm; infinite beyond a limit.
fn distances(surface: &TriangleMesh, from: &[u32], most_mm: f64) -> Vec<f64> {
    let mut beside = vec![Vec::new(); surface.vertices.len()];
    for t in &surface.triangles {
        (0..3).for_each(|k| beside[t[k] as usize].push(t[(k + 1) % 3]));
    }
    let mut found = vec![f64::INFINITY; surface.vertices.len()];
    // Distances are not negative, and so in the order of their bits.
    let mut next: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
    for v in from {
        found[*v as usize] = 0.0;
        next.push(Reverse((0, *v)));
    }
    while let Some(Reverse((bits, v))) = next.pop() {
        let distance = f64::from_bits(bits);
        if distance > found[v as usize] {
            continue;
        }
        for &w in &beside[v as usize] {
            let step = (surface.vertices[w as usize] - surface.vertices[v as usize]).norm();
            let there = distance + step;
            if there < found[w as usize] && there <= most_mm {
                found[w as usize] = there;
                next.push(Reverse((there.to_bits(), w)));
            }
        }
    }
    found
}

/// The outward normals at the vertices, of the triangles around by their areas.
pub(super) fn normals(surface: &TriangleMesh) -> Vec<Vector> {
    let mut sums = vec![Vector::zeros(); surface.vertices.len()];
    for (t, corners) in surface.triangles.iter().enumerate() {
        let [a, b, c] = surface.corners(t);
        let normal = (b - a).cross(&(c - a));
        corners.iter().for_each(|v| sums[*v as usize] += normal);
    }
    sums.into_iter().map(|s| s.try_normalize(0.0).unwrap_or_default()).collect()
}

/// A surface z(x, y) that bends as little as it can.
struct ThinPlate {
    middle: Point,
    size: f64,
    at: Vec<[f64; 2]>,
    weights: DVector<f64>,
}

impl ThinPlate {
    /// Through these places, as nearly as a stiffness allows. None where they lie on a line. Cost: the cube of their number.
    fn through(places: &[Point], stiffness: f64) -> Option<Self> {
        let n = places.len();
        let middle = Point::from(places.iter().map(|p| p.coords).sum::<Vector>() / n as f64);
        let square = |p: &Point| (p.x - middle.x).powi(2) + (p.y - middle.y).powi(2);
        let size = (places.iter().map(square).sum::<f64>() / n as f64).sqrt();
        let at: Vec<[f64; 2]> =
            places.iter().map(|p| [(p.x - middle.x) / size, (p.y - middle.y) / size]).collect();
        let mut matrix = DMatrix::zeros(n + 3, n + 3);
        let mut heights = DVector::zeros(n + 3);
        for (i, [x, y]) in at.iter().copied().enumerate() {
            for (j, b) in at.iter().enumerate() {
                matrix[(i, j)] = bump(&[x, y], b);
            }
            matrix[(i, i)] += stiffness;
            for (k, term) in [1.0, x, y].into_iter().enumerate() {
                matrix[(i, n + k)] = term;
                matrix[(n + k, i)] = term;
            }
            heights[i] = places[i].z - middle.z;
        }
        let weights = matrix.lu().solve(&heights)?;
        weights.iter().all(|w| w.is_finite()).then_some(Self { middle, size, at, weights })
    }

    fn at(&self, p: &Point) -> f64 {
        let here = [(p.x - self.middle.x) / self.size, (p.y - self.middle.y) / self.size];
        let n = self.at.len();
        let bent: f64 = self.at.iter().zip(&self.weights).map(|(b, w)| w * bump(&here, b)).sum();
        let w = &self.weights;
        self.middle.z + w[n] + w[n + 1] * here[0] + w[n + 2] * here[1] + bent
    }
}

/// r² ln r.
fn bump(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let square = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    if square > 0.0 { 0.5 * square * square.ln() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// An ellipsoid of these half axes, its lowest place `sunk` below the pedestal's top, by rows from below; what is lower than
    /// the top is cut flat.
    fn cut_ellipsoid(half: [f64; 3], sunk: f64) -> (TriangleMesh, TriangleMesh) {
        let (rows, round) = (60u32, 96u32);
        let mut vertices = vec![Point::new(0.0, 0.0, -sunk)];
        for i in 1..rows {
            // Fine rows below.
            let t = std::f64::consts::PI * (f64::from(i) / f64::from(rows)).powf(1.5);
            for j in 0..round {
                let (s, c) = (f64::from(j) * TAU / f64::from(round)).sin_cos();
                let across = t.sin();
                vertices.push(Point::new(
                    half[0] * across * c,
                    half[1] * across * s,
                    half[2] * (1.0 - t.cos()) - sunk,
                ));
            }
        }
        vertices.push(Point::new(0.0, 0.0, 2.0 * half[2] - sunk));
        let top = vertices.len() as u32 - 1;
        let at = |i: u32, j: u32| 1 + (i - 1) * round + j % round;
        let mut triangles = Vec::new();
        for j in 0..round {
            triangles.push([0, at(1, j + 1), at(1, j)]);
            triangles.push([top, at(rows - 1, j), at(rows - 1, j + 1)]);
            for i in 1..rows - 1 {
                triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
        let whole = TriangleMesh { vertices, triangles };
        assert!(whole.volume_mm3() > 0.0);
        let mut cut = whole.clone();
        cut.vertices.iter_mut().for_each(|p| p.z = p.z.max(0.0));
        (whole, cut)
    }

    #[test]
    fn the_foot_of_an_ellipsoid_is_closed_to_a_tenth_of_its_depth() {
        for (half, sunk) in [([0.45, 0.45, 0.45], 0.02), ([0.5, 0.4, 0.35], 0.02), ([0.5, 0.3, 0.6], 0.01)] {
            let (whole, cut) = cut_ellipsoid(half, sunk);
            let foot = Foot::of(&cut, 0.008).unwrap();
            let depth = foot.depth_mm.unwrap();
            assert!((depth / sunk - 1.0).abs() < 0.1, "{half:?}: {depth} of {sunk}");
            let closed = foot.closed(&cut, 1.0);
            for (p, q) in closed.vertices.iter().zip(&whole.vertices) {
                assert!((p - q).norm() < 0.1 * sunk, "{half:?}: {p} {q}");
            }
            assert_eq!(foot.closed(&cut, 0.0), cut);
            let radius = foot.radius();
            assert!(cut.vertices.iter().all(|p| foot.holds(p) == (p.z < 0.008)));
            assert!(radius > 0.05 && radius < 0.3, "{radius}");
        }
    }

    #[test]
    fn a_surface_that_ends_above_has_no_foot_and_a_block_none_that_can_be_closed() {
        let (whole, _) = cut_ellipsoid([0.5; 3], -0.1);
        assert_eq!(Foot::of(&whole, 0.01), None);
        // All around its foot a block's sides are steep: nothing says how it goes on.
        let corner = |i: u32| Point::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1));
        let triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        let block = TriangleMesh { vertices: (0..8).map(corner).collect(), triangles };
        assert!((block.volume_mm3() - 1.0).abs() < 1e-12);
        let foot = Foot::of(&block, 0.01).unwrap();
        assert_eq!((foot.area_mm2, foot.depth_mm), (1.0, None));
        assert_eq!(foot.closed(&block, 1.0), block);
    }
}
