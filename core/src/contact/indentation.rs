//! How far two plates sink into a grain, from its shape alone.
//!
//! ```text
//! V(h) = ∫ (h − z)₊ dA,  A(h)            the space between surface and a plate moved in by h, and its area on the plate
//! F(h) = Σ 4/3 √(2/π) E* V/√A           over the places that a plate touches
//! ```
//!
//! A ball of radius R has V = πRh², A = 2πRh, and with them Hertz' force to the letter; a flat punch is 6 % softer than its own form,
//! 2 E* √(A/π) h. So one rule goes from tips to flats, in microseconds where finite elements take minutes. It knows
//! nothing of what the places do to each other, of the grain's bulk, or of sliding: a guide by which few computed cases stand for many.

use crate::geometry::{Point, TriangleMesh, Vector};
use nalgebra::Rotation3;
use std::collections::HashMap;

/// The first and the deepest indentation that is looked at, over the grain's height.
const DEPTHS: [f64; 2] = [1e-6, 0.1];
/// Ratio of one depth to the one before.
const FINER: f64 = 1.25;

/// How far both plates together sink into a grain that lies so under each of these forces (N), mm; the grain's E* is in MPa. At forces that
/// it does not bear within a tenth of its height that tenth, twice.
///
/// Cost: the triangles within a tenth of the height of either plate, for each of fifty depths at the most.
pub fn indentation_mm(
    surface: &TriangleMesh,
    held: &Rotation3<f64>,
    contact_modulus_mpa: f64,
    forces_n: &[f64],
) -> Vec<f64> {
    let mut sums = vec![0.0; forces_n.len()];
    for side in [1.0, -1.0] {
        let up = held.inverse() * Vector::new(0.0, 0.0, side);
        let profile = Profile::new(surface, &up);
        // A place's own direction in the plate does not matter, its area does.
        for (sum, depth) in sums.iter_mut().zip(profile.depths(contact_modulus_mpa, forces_n)) {
            *sum += depth;
        }
    }
    sums
}

/// What is near one plate.
struct Profile {
    /// Triangles that reach into the deepest indentation: their corners' numbers, their heights over the plate, and their area on it.
    triangles: Vec<([u32; 3], [f64; 3], f64)>,
    height: f64,
}

impl Profile {
    /// Of a plate with this normal, towards the grain.
    fn new(surface: &TriangleMesh, up: &Vector) -> Self {
        let heights: Vec<f64> = surface.vertices.iter().map(|p| p.coords.dot(up)).collect();
        let (low, high) =
            heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
        let height = high - low;
        let near = |t: &[u32; 3]| t.iter().any(|v| heights[*v as usize] - low < DEPTHS[1] * height);
        let triangles = (surface.triangles.iter().enumerate())
            .filter(|(_, t)| near(t))
            .map(|(k, t)| {
                let [a, b, c]: [Point; 3] = surface.corners(k);
                let area = -0.5 * (b - a).cross(&(c - a)).dot(up);
                (*t, t.map(|v| heights[v as usize] - low), area)
            })
            .collect();
        Self { triangles, height }
    }

    /// The depths at which it bears these forces.
    fn depths(&self, contact_modulus_mpa: f64, forces_n: &[f64]) -> Vec<f64> {
        let [first, deepest] = DEPTHS.map(|share| share * self.height);
        let mut found = vec![deepest; forces_n.len()];
        let mut open: Vec<usize> = (0..forces_n.len()).collect();
        let (mut before, mut depth) = ([0.0, 0.0], first);
        while !open.is_empty() && depth < deepest {
            let force = contact_modulus_mpa * self.bears(depth);
            open.retain(|&k| {
                if force < forces_n[k] {
                    return true;
                }
                // Between two depths it goes as a power, from nought on as a ball's.
                let share = forces_n[k] / force;
                let power =
                    if before[1] > 0.0 { (force / before[1]).ln() / (depth / before[0]).ln() } else { 1.5 };
                found[k] = depth * share.powf(1.0 / power);
                false
            });
            before = [depth, force];
            depth *= FINER;
        }
        found
    }

    /// The force at a depth over E*, mm².
    fn bears(&self, depth: f64) -> f64 {
        let mut places = Places::default();
        for (corners, heights, area) in &self.triangles {
            let wet: Vec<usize> = (0..3).filter(|k| heights[*k] < depth).collect();
            let Some(&first) = wet.first() else { continue };
            let place = places.of(corners[first]);
            let place = wet.iter().skip(1).fold(place, |place, k| places.join(place, corners[*k]));
            let (share, rise) = below(heights, depth);
            places.add(place, area * share, area * share * (depth - rise));
        }
        4.0 / 3.0 * (2.0 / std::f64::consts::PI).sqrt() * places.sum()
    }
}

/// The share of a triangle's area that is below a height, and the mean height there.
fn below(heights: &[f64; 3], level: f64) -> (f64, f64) {
    let mut z = *heights;
    z.sort_by(f64::total_cmp);
    let [a, b, c] = z;
    if c <= level {
        return (1.0, (a + b + c) / 3.0);
    }
    // The corner below, cut off; or all but the corner above.
    if b >= level {
        let share = (level - a).powi(2) / ((b - a) * (c - a));
        return (share, (a + 2.0 * level) / 3.0);
    }
    let above = (c - level).powi(2) / ((c - a) * (c - b));
    let whole = (a + b + c) / 3.0;
    let share = 1.0 - above;
    (share, (whole - above * (c + 2.0 * level) / 3.0) / share)
}

/// Areas and spaces by connected place, as the triangles come.
#[derive(Default)]
struct Places {
    number: HashMap<u32, usize>,
    parent: Vec<usize>,
    area: Vec<f64>,
    space: Vec<f64>,
}

impl Places {
    fn of(&mut self, vertex: u32) -> usize {
        let next = self.parent.len();
        let k = *self.number.entry(vertex).or_insert(next);
        if k == next {
            self.parent.push(next);
            self.area.push(0.0);
            self.space.push(0.0);
        }
        self.root(k)
    }

    fn root(&mut self, mut k: usize) -> usize {
        while self.parent[k] != k {
            self.parent[k] = self.parent[self.parent[k]];
            k = self.parent[k];
        }
        k
    }

    fn join(&mut self, place: usize, vertex: u32) -> usize {
        let other = self.of(vertex);
        let (one, other) = (place.min(other), place.max(other));
        if one != other {
            self.parent[other] = one;
            self.area[one] += self.area[other];
            self.space[one] += self.space[other];
        }
        one
    }

    fn add(&mut self, place: usize, area: f64, space: f64) {
        self.area[place] += area;
        self.space[place] += space;
    }

    /// Σ V/√A; what overhangs takes away, and a place that is nothing else bears nothing.
    fn sum(&self) -> f64 {
        let roots = (0..self.parent.len()).filter(|k| self.parent[*k] == *k);
        roots.filter(|&k| self.area[k] > 0.0).map(|k| self.space[k].max(0.0) / self.area[k].sqrt()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Material, hertz};
    use crate::geometry::Ball;
    use crate::mesh::{Controls, mesh};

    fn solid(vertices: Vec<Point>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
        TriangleMesh { vertices, triangles }
    }

    fn block(w: f64, d: f64, h: f64) -> TriangleMesh {
        let corner = |i: usize| {
            let at = |bit: usize, s: f64| if i >> bit & 1 == 0 { 0.0 } else { s };
            Point::new(at(0, w), at(1, d), at(2, h))
        };
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        solid((0..8).map(corner).collect(), triangles)
    }

    #[test]
    fn a_ball_is_hertz_and_a_block_a_punch() {
        let m = Material::default();
        let controls = Controls { surface_size_mm: 0.012, tet_volume_mm3: 1e-3, ..Controls::for_size(0.8) };
        let ball = mesh(&Ball { center: Point::origin(), radius_mm: 0.4 }, &controls, &mut |_| ()).unwrap();
        let surface = ball.surface().triangles;
        let (force_n, e_star) = (20.0, m.contact_modulus_mpa());
        let one = indentation_mm(&surface, &Rotation3::identity(), e_star, &[force_n])[0];
        let each = 0.5 * one;
        assert!((hertz::force_n(&m, 0.4, each) / force_n - 1.0).abs() < 0.06, "{each}");
        // A punch: F = 2 E* a h with the radius a of its area.
        let plate = indentation_mm(&block(0.5, 0.4, 0.3), &Rotation3::identity(), e_star, &[force_n])[0];
        let punch = force_n / (2.0 * e_star * (0.2f64 / std::f64::consts::PI).sqrt());
        assert!((0.5 * plate / punch - 1.0).abs() < 0.07, "{plate} {punch}");
    }

    #[test]
    fn three_feet_bear_three_times_what_one_does() {
        let pyramid = |x: f64| {
            let (tip, r) = (Point::new(x, 0.0, 0.0), 0.1);
            let base = [[-r, -r], [r, -r], [r, r], [-r, r]].map(|[a, b]| Point::new(x + a, b, 0.2));
            [vec![tip], base.to_vec()].concat()
        };
        let sides = |n: u32| {
            let fans = [[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [1, 2, 3], [1, 3, 4]];
            fans.map(|t| t.map(|v| v + 5 * n)).to_vec()
        };
        let one = solid(pyramid(0.0), sides(0));
        let three = solid(
            [pyramid(0.0), pyramid(1.0), pyramid(2.0)].concat(),
            [sides(0), sides(1), sides(2)].concat(),
        );
        let up = Vector::z();
        let bears = |s: &TriangleMesh| Profile::new(s, &up).bears(0.01);
        assert!(bears(&one) > 0.0 && (bears(&three) / bears(&one) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn what_lies_below_a_level_is_the_cut_triangles() {
        for (heights, level, share, rise) in [
            ([0.0, 0.0, 1.0], 1.0, 1.0, 1.0 / 3.0),
            ([0.0, 1.0, 1.0], 0.5, 0.25, 1.0 / 3.0),
            ([1.0, 0.0, 0.0], 0.5, 0.75, (1.0 / 3.0 - 0.25 * 2.0 / 3.0) / 0.75),
        ] {
            let (s, z) = below(&heights, level);
            assert!((s - share).abs() < 1e-12 && (z - rise).abs() < 1e-12, "{heights:?}: {s} {z}");
        }
    }

    #[test]
    fn more_force_sinks_deeper_and_too_much_to_the_end() {
        let b = block(0.5, 0.4, 0.3);
        let tilted = Rotation3::from_euler_angles(0.3, 0.2, 0.1);
        let found = indentation_mm(&b, &tilted, 1e5, &[0.5, 1.0, 2.0, 4.0, 1e9]);
        assert!(found.windows(2).all(|w| w[1] > w[0]), "{found:?}");
        assert!(found.iter().all(|x| x.is_finite()));
    }
}
