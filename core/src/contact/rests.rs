//! All stable rests of a grain on a level plate, and how likely each is.
//!
//! ```text
//! h(d) = max (p − c)·d                the centre c's height over the plate; d the plate's direction in the grain
//! ```
//!
//! A grain that is let down slowly rolls, without sliding, down the slope of h over the sphere of directions: away from the
//! corner it stands on, along an edge, over the sides of its convex hull, until the centre is above the side that it lies on.
//! Which rest a direction leads to follows from a walk over the hull's corners, edges and sides; once on a side the way is
//! the same for all that come there. The chance of a rest is its share of all directions, counted on an even grid of them.
//!
//! A polyhedron that stands for a round surface can rest on every one of its facets. A rest counts here where it takes more
//! than a least lift of the centre to leave it for a lower one (the persistence of a minimum of h: Edelsbrunner, Letscher and
//! Zomorodian, Discrete Comput. Geom. 28, 511, 2002); what is shallower belongs to the rest that it is left for over its
//! lowest edge. Facets of a round surface that are a degree wide take a lift of 4·10⁻⁵ of its radius, one from the other; so
//! rests near to each other that take little more are one as well.

use crate::geometry::{ConvexHull, Point, Vector};
use nalgebra::Rotation3;

/// The least lift of the centre that a rest is worth, over the radius of the ball about the centre that holds the grain: 5 nm
/// of a grain of 1 mm.
const LEAST_LIFT: f64 = 1e-5;
/// The same beside a rest that is nearer than this angle, rad: facets of a round surface that are up to 1.6° wide.
const LEAST_BESIDE: f64 = 1e-4;
const BESIDE: f64 = 0.052;
/// Directions on which chances are counted: they are right to about a thousandth.
const DIRECTIONS: usize = 20_000;
/// Places that differ by less than this share of the grain's size are one.
const LEVEL: f64 = 1e-9;

/// A stable rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// The direction of the plate below, in the grain as it was given.
    pub down: Vector,
    /// The turn that lays the grain so, about a level axis.
    pub turn: Rotation3<f64>,
    /// The chance that the grain comes to lie so when it is let down at random, 0 to 1.
    pub chance: f64,
    /// The height of the grain's centre over the plate, mm.
    pub center_mm: f64,
    /// The lift of the centre that it takes to leave it for a lower rest, mm; infinite for the lowest.
    pub lift_mm: f64,
    /// The corners of the hull that it stands on.
    pub feet: Vec<u32>,
}

/// The rests of a grain.
#[derive(Debug, Clone, PartialEq)]
pub struct Rests {
    /// In the order of their chances, the most likely first.
    pub rests: Vec<Rest>,
    /// For each facet of the hull where the grain comes to lie from there.
    of_facet: Vec<usize>,
    /// The grain's hull about its centre.
    hull: ConvexHull,
    size: f64,
    /// The least lift that made a rest of its own, mm.
    pub least_lift_mm: f64,
}

impl Rests {
    /// The rests of a grain with this hull and centre of mass, which must lie in it. With none the least lift is
    /// a hundred thousandth of its size.
    pub fn new(hull: ConvexHull, center: &Point, least_lift_mm: Option<f64>) -> Self {
        let hull = hull.about(center);
        let size = hull.vertices.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
        let least_lift_mm = least_lift_mm.unwrap_or(LEAST_LIFT * size);
        let mut found = Self { rests: Vec::new(), of_facet: Vec::new(), hull, size, least_lift_mm };
        let ends = found.ends_of_facets();
        let lowest = found.merged(&ends, least_lift_mm);
        found.gather(&ends, &lowest);
        found.count();
        found
    }

    /// The hull, with the grain's centre at the origin.
    pub fn hull(&self) -> &ConvexHull {
        &self.hull
    }

    /// The rest that the grain comes to when it is let down with this direction below.
    pub fn reached_from(&self, down: &Vector) -> usize {
        let down = down.normalize();
        let start = Place::Corner(self.hull.farthest(&down, 0), down);
        self.of_facet[self.lands_on(start)]
    }

    fn ray(&self, v: u32) -> Vector {
        self.hull.vertices[v as usize].coords
    }

    /// Walks from a place down to the first side of the hull that the grain lies on, stable or not.
    fn lands_on(&self, mut place: Place) -> usize {
        // Each step lowers the centre, so that no place is met twice.
        for _ in 0..4 * self.hull.facets.len() {
            place = match place {
                Place::Facet(f) => return f,
                Place::Corner(v, down) => self.over_corner(v, &down),
                Place::Edge(v, w, down) => self.over_edge(v, w, &down),
            };
        }
        match place {
            Place::Facet(f) => f,
            Place::Corner(v, _) | Place::Edge(v, _, _) => self.hull.facet_at(v) as usize,
        }
    }

    /// From a stand on a corner to the edge that comes down next.
    fn over_corner(&self, v: u32, down: &Vector) -> Place {
        let ray = self.ray(v);
        let aside = ray - down * ray.dot(down);
        let Some(turns) = (-aside).try_normalize(LEVEL * self.size) else {
            // It stands on its point: the least breath decides, and here the order of the hull's facets does.
            return Place::Facet(self.hull.facet_at(v) as usize);
        };
        let next = (self.hull.neighbours(v).iter())
            .filter_map(|&w| {
                let from = self.ray(w) - ray;
                let (above, ahead) = (-from.dot(down), from.dot(&turns));
                (ahead > LEVEL * self.size).then(|| (w, above.max(0.0).atan2(ahead)))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match next {
            Some((w, angle)) => Place::Edge(v, w, (down * angle.cos() + turns * angle.sin()).normalize()),
            None => Place::Facet(self.hull.facet_at(v) as usize),
        }
    }

    /// From a stand on an edge to the side that it tips over to, or over one of its ends.
    fn over_edge(&self, v: u32, w: u32, down: &Vector) -> Place {
        let (a, b) = (self.ray(v), self.ray(w));
        let along = b - a;
        let part = -a.dot(&along) / along.norm_squared();
        if part <= 0.0 {
            return Place::Corner(v, *down);
        }
        if part >= 1.0 {
            return Place::Corner(w, *down);
        }
        let foot = a + along * part;
        let aside = foot - down * foot.dot(down);
        // The facet on the side of the edge on which the centre is.
        let leans = |f: usize| {
            let third = self.hull.facets[f].into_iter().find(|c| *c != v && *c != w);
            third.map_or(f64::NEG_INFINITY, |c| -(self.ray(c) - foot).dot(&aside))
        };
        let [f, g] = self.hull.facets_of_edge(v, w).map(|f| f as usize);
        Place::Facet(if leans(f) >= leans(g) { f } else { g })
    }

    /// Where the grain tips to from a facet: itself where it is stable.
    fn tips_from(&self, f: usize) -> Place {
        let down = self.hull.normal(f);
        let corners = self.hull.facets[f];
        let rays = corners.map(|v| self.ray(v));
        let level = |p: Vector| p - down * p.dot(&down);
        // The centre's place in the facet's plane is the origin.
        let nearest = |side: usize| {
            let (a, b) = (level(rays[side]), level(rays[(side + 1) % 3]));
            let along = b - a;
            let part = (-a.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (part, (a + along * part).norm())
        };
        let outside = |side: usize| {
            let (a, b) = (level(rays[side]), level(rays[(side + 1) % 3]));
            // Counter-clockwise seen from outside, along the normal.
            (b - a).cross(&-a).dot(&down) < -LEVEL * self.size * (b - a).norm()
        };
        let side = (0..3).filter(|s| outside(*s)).min_by(|a, b| nearest(*a).1.total_cmp(&nearest(*b).1));
        let Some(side) = side else { return Place::Facet(f) };
        let part = nearest(side).0;
        if part <= 0.0 {
            Place::Corner(corners[side], down)
        } else if part >= 1.0 {
            Place::Corner(corners[(side + 1) % 3], down)
        } else {
            Place::Facet(self.hull.beside[f][side] as usize)
        }
    }

    /// For each facet the stable one that the grain comes to from there.
    fn ends_of_facets(&self) -> Vec<usize> {
        let mut ends: Vec<Option<usize>> = vec![None; self.hull.facets.len()];
        for start in 0..ends.len() {
            let mut way = Vec::new();
            let mut at = start;
            let end = loop {
                if let Some(end) = ends[at] {
                    break end;
                }
                way.push(at);
                let place = self.tips_from(at);
                let next = self.lands_on(place);
                // On itself it is stable; a facet met twice, by rounding, is as good as that.
                if next == at || way.contains(&next) {
                    break next;
                }
                at = next;
            };
            way.iter().for_each(|f| ends[*f] = Some(end));
            ends[end] = Some(end);
        }
        ends.into_iter().flatten().collect()
    }

    fn height(&self, f: usize) -> f64 {
        self.hull.normal(f).dot(&self.ray(self.hull.facets[f][0]))
    }

    /// For each facet on which the grain is stable the one whose rest it belongs to, and what lift it takes to leave that.
    fn merged(&self, ends: &[usize], least_lift: f64) -> Vec<(usize, f64)> {
        let count = ends.len();
        // Passes from one facet to another, over the edge between them: where the centre stands over it at its highest.
        let mut passes = Vec::new();
        for f in 0..count {
            for side in 0..3 {
                let other = self.hull.beside[f][side] as usize;
                if other < f || ends[f] == ends[other] {
                    continue;
                }
                let corners = self.hull.facets[f];
                let (a, b) = (self.ray(corners[side]), self.ray(corners[(side + 1) % 3]));
                let along = b - a;
                let part = (-a.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                let foot = a + along * part;
                // Where the edge is no ridge between both, the way over it is as high as its higher side.
                let height = foot.norm().max(self.height(f)).max(self.height(other));
                passes.push((height, ends[f], ends[other]));
            }
        }
        passes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut root: Vec<usize> = (0..count).collect();
        let mut belongs: Vec<(usize, f64)> = (0..count).map(|f| (f, f64::INFINITY)).collect();
        let find = |root: &mut Vec<usize>, mut f: usize| {
            while root[f] != f {
                root[f] = root[root[f]];
                f = root[f];
            }
            f
        };
        for (height, a, b) in passes {
            let (ra, rb) = (find(&mut root, a), find(&mut root, b));
            if ra == rb {
                continue;
            }
            let lower_is_a = (self.height(ra), ra) <= (self.height(rb), rb);
            let (lower, upper, beyond) = if lower_is_a { (ra, rb, a) } else { (rb, ra, b) };
            let lift = height - self.height(upper);
            let apart = self.hull.normal(upper).angle(&self.hull.normal(beyond));
            let is_facets = lift < LEAST_BESIDE * self.size && apart < BESIDE;
            belongs[upper] = if lift < least_lift || is_facets { (beyond, lift) } else { (upper, lift) };
            root[upper] = lower;
        }
        (0..count)
            .map(|f| {
                let mut at = f;
                while belongs[at].0 != at {
                    at = belongs[at].0;
                }
                belongs[at]
            })
            .collect()
    }

    /// Makes the rests, without their chances yet.
    fn gather(&mut self, ends: &[usize], lowest: &[(usize, f64)]) {
        let mut number = vec![usize::MAX; ends.len()];
        for f in 0..ends.len() {
            let (own, lift_mm) = lowest[ends[f]];
            if number[own] == usize::MAX {
                number[own] = self.rests.len();
                let down = self.hull.normal(own);
                let height = self.height(own);
                let feet = self.level_with(own, height, &down);
                let turn = to_below(&down);
                self.rests.push(Rest { down, turn, chance: 0.0, center_mm: height, lift_mm, feet });
            }
            self.of_facet.push(number[own]);
        }
    }

    /// The corners in the plane of a facet.
    fn level_with(&self, f: usize, height: f64, down: &Vector) -> Vec<u32> {
        let mut feet: Vec<u32> = self.hull.facets[f].into();
        let mut next = 0;
        while let Some(&v) = feet.get(next) {
            next += 1;
            for &w in self.hull.neighbours(v) {
                if self.ray(w).dot(down) > height - LEVEL * self.size && !feet.contains(&w) {
                    feet.push(w);
                }
            }
        }
        feet
    }

    /// Counts the chances, and puts the rests in their order.
    fn count(&mut self) {
        let mut counts = vec![0usize; self.rests.len()];
        let mut corner = 0;
        for k in 0..DIRECTIONS {
            let down = direction(k, DIRECTIONS);
            corner = self.hull.farthest(&down, corner);
            counts[self.of_facet[self.lands_on(Place::Corner(corner, down))]] += 1;
        }
        for (rest, n) in self.rests.iter_mut().zip(&counts) {
            rest.chance = *n as f64 / DIRECTIONS as f64;
        }
        let mut order: Vec<usize> = (0..self.rests.len()).collect();
        order.sort_by(|a, b| {
            let key = |k: usize| (counts[k], -self.rests[k].center_mm);
            key(*b).partial_cmp(&key(*a)).unwrap_or(std::cmp::Ordering::Equal).then(a.cmp(b))
        });
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, old)| place[*old] = new);
        self.of_facet.iter_mut().for_each(|r| *r = place[*r]);
        self.rests = order.iter().map(|k| self.rests[*k].clone()).collect();
    }
}

/// What a grain stands on, with the plate's direction where that is not the facet's.
#[derive(Debug, Clone, Copy)]
enum Place {
    Corner(u32, Vector),
    Edge(u32, u32, Vector),
    Facet(usize),
}

/// The turn about a level axis that brings a direction to below.
fn to_below(down: &Vector) -> Rotation3<f64> {
    Rotation3::rotation_between(down, &-Vector::z())
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI))
}

/// Of `count` directions, even over the sphere, the one of this number: a spiral of Fibonacci's, neighbours beside each other in height.
fn direction(k: usize, count: usize) -> Vector {
    let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
    let across = (1.0 - z * z).max(0.0).sqrt();
    let turn = k as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    Vector::new(across * turn.cos(), across * turn.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::super::rest;
    use super::*;
    use std::f64::consts::TAU;

    fn block(size: [f64; 3]) -> Vec<Point> {
        let half = |k: usize, bit: usize| if bit & 1 == 0 { -0.5 * size[k] } else { 0.5 * size[k] };
        (0..8).map(|i| Point::new(half(0, i), half(1, i >> 1), half(2, i >> 2))).collect()
    }

    fn rests(points: &[Point], center: Point) -> Rests {
        Rests::new(ConvexHull::new(points).unwrap(), &center, None)
    }

    /// How often a body comes to lie with each direction below, let down from many: every point of it looked at in every turn.
    fn dropped(points: &[Point], center: &Point, count: usize) -> Vec<(Vector, f64)> {
        let mut found: Vec<(Vector, f64)> = Vec::new();
        for k in 0..count {
            let lay = to_below(&direction(k, count));
            let turned: Vec<Point> = points.iter().map(|p| center + lay * (p - center)).collect();
            let down = (rest::rotation(&turned, center) * lay).inverse() * -Vector::z();
            match found.iter_mut().find(|(d, _)| d.dot(&down) > 1.0 - 1e-6) {
                Some((_, n)) => *n += 1.0 / count as f64,
                None => found.push((down, 1.0 / count as f64)),
            }
        }
        found
    }

    /// A ball of which a plane cut a piece off.
    fn cut_sphere(radius: f64, at: f64, round: usize) -> Vec<Point> {
        let mut points = Vec::new();
        for i in 0..=round / 2 {
            let z = radius * (f64::from(i as u32) * TAU / round as f64).cos();
            let across = (radius * radius - z * z).max(0.0).sqrt();
            let (z, across) = if z < at { (z, across) } else { (at, (radius * radius - at * at).sqrt()) };
            for j in 0..round {
                let (s, c) = ((j as f64 + 0.5 * (i % 2) as f64) * TAU / round as f64).sin_cos();
                points.push(Point::new(across * c, across * s, z));
            }
        }
        points
    }

    #[test]
    fn a_cube_lies_on_each_side_as_often_and_a_tetrahedron_too() {
        let cube = rests(&block([1.0; 3]), Point::origin());
        assert_eq!(cube.rests.len(), 6);
        for r in &cube.rests {
            assert!((r.chance - 1.0 / 6.0).abs() < 2e-3 && (r.center_mm - 0.5).abs() < 1e-12, "{r:?}");
            assert_eq!(r.feet.len(), 4);
            // Over an edge.
            assert!(r.lift_mm > 1e9 || (r.lift_mm - (0.5f64.sqrt() - 0.5)).abs() < 1e-12, "{r:?}");
        }
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let four = rests(&corners.map(Point::from), Point::origin());
        assert_eq!(four.rests.len(), 4);
        assert!(four.rests.iter().all(|r| (r.chance - 0.25).abs() < 2e-3), "{:?}", four.rests);
    }

    #[test]
    fn chances_are_those_of_letting_it_down() {
        let leaning: Vec<Point> = block([1.0, 0.8, 0.5])
            .into_iter()
            .chain([Point::new(0.9, 0.1, 0.4), Point::new(-0.2, -0.9, 0.1), Point::new(0.1, 0.2, -0.7)])
            .collect();
        for (name, points, center) in [
            ("block", block([1.0, 0.7, 0.4]), Point::origin()),
            ("block, heavy at an end", block([1.0, 0.7, 0.4]), Point::new(0.3, 0.1, 0.05)),
            ("eleven corners", leaning, Point::new(0.05, 0.0, -0.05)),
        ] {
            let found = rests(&points, center);
            let dropped = dropped(&points, &center, 4000);
            // What is too shallow to be a rest here counts for the one that it is left for.
            let mut shares = vec![0.0; found.rests.len()];
            for (down, share) in &dropped {
                let k = found.reached_from(down);
                shares[k] += share;
                let own = found.rests[k].down.dot(down) > 1.0 - 1e-6;
                let height = points.iter().map(|p| (p - center).dot(down)).fold(0.0, f64::max);
                assert!(own || height > found.rests[k].center_mm, "{name}: {down} is lower than its rest");
            }
            for (r, share) in found.rests.iter().zip(shares) {
                assert!((r.chance - share).abs() < 0.01, "{name}: {share} of the drops, {r:?}");
            }
            assert!((found.rests.iter().map(|r| r.chance).sum::<f64>() - 1.0).abs() < 1e-9);
            let mut chances = found.rests.iter().map(|r| r.chance);
            let first = chances.next().unwrap();
            chances.try_fold(first, |before, c| (c <= before).then_some(c)).unwrap();
        }
    }

    #[test]
    fn a_cut_sphere_lies_on_its_cut_or_stands_on_its_pole_whatever_facets_it_has() {
        // Its centre is below that of the ball by z = 3 (R+h)²(R−h)²/..., found here from the cap's volume.
        let (r, h) = (0.5, 0.3);
        let cap = r - h;
        let v_cap = std::f64::consts::PI * cap * cap * (3.0 * r - cap) / 3.0;
        let z_cap = 3.0 * (2.0 * r - cap).powi(2) / (4.0 * (3.0 * r - cap));
        let v = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let center = Point::new(0.0, 0.0, -v_cap * z_cap / (v - v_cap));
        for round in [300, 360] {
            let found = rests(&cut_sphere(r, h, round), center);
            let downs: Vec<f64> = found.rests.iter().map(|r| r.down.z).collect();
            assert_eq!(found.rests.len(), 2, "{round}: {downs:?}");
            let flat = found.rests.iter().find(|r| r.down.z > 0.999).unwrap();
            let pole = found.rests.iter().find(|r| r.down.z < -0.99).unwrap();
            // It tips off the cut where its centre passes the rim.
            let half_angle = ((r * r - h * h).sqrt() / (h - center.z)).atan();
            let share = 0.5 * (1.0 - half_angle.cos());
            assert!((flat.chance - share).abs() < 5e-3, "{}: {share}", flat.chance);
            assert!((flat.center_mm - (h - center.z)).abs() < 1e-9);
            assert!((pole.center_mm - (r + center.z)).abs() < 1e-3);
        }
    }

    /// Of a mesher's block most vertices lie in the middle of its sides.
    #[test]
    fn a_block_with_vertices_all_over_its_sides_is_the_plain_block() {
        let size = [1.0, 0.7, 0.4];
        let mut points = Vec::new();
        for i in 0..7 * 7 * 7 {
            let at = [i % 7, i / 7 % 7, i / 49];
            let place = |k: usize| size[k] * (f64::from(at[k]) / 6.0 - 0.5);
            points.push(Point::new(place(0), place(1), place(2)));
        }
        let center = Point::new(0.2, 0.05, -0.05);
        let (plain, all_over) = (rests(&block(size), center), rests(&points, center));
        assert!(all_over.hull().vertices.len() > 8);
        assert_eq!(plain.rests.len(), all_over.rests.len());
        for (a, b) in plain.rests.iter().zip(&all_over.rests) {
            assert!((a.chance - b.chance).abs() < 1e-3 && (a.down - b.down).norm() < 1e-9, "{a:?}, {b:?}");
            assert!((a.center_mm - b.center_mm).abs() < 1e-9, "{a:?}, {b:?}");
            assert!(
                a.lift_mm > 1e9 && b.lift_mm > 1e9 || (a.lift_mm - b.lift_mm).abs() < 1e-9,
                "{a:?}, {b:?}"
            );
        }
        for k in 0..60 {
            let k = f64::from(k);
            let lay = Rotation3::from_euler_angles(1.3 * k, 0.7 * k, 2.1 * k);
            for friction in [0.0, 0.2] {
                let [a, b] = [&plain, &all_over].map(|r| super::super::rocking(r.hull(), &lay, friction));
                assert!(
                    (a.from_mm - b.from_mm).abs() < 1e-9 && (a.to_mm - b.to_mm).abs() < 1e-9,
                    "{a:?}, {b:?}"
                );
                assert_eq!(a.held_by_friction, b.held_by_friction);
            }
        }
    }

    #[test]
    fn a_direction_leads_to_the_rest_that_it_counts_for() {
        let found = rests(&block([1.0, 0.7, 0.4]), Point::new(0.1, 0.0, 0.0));
        for (k, r) in found.rests.iter().enumerate() {
            assert_eq!(found.reached_from(&r.down), k);
            assert!((r.turn * r.down + Vector::z()).norm() < 1e-12);
        }
        assert_eq!(found.reached_from(&(Vector::z() + 0.1 * Vector::x())), found.reached_from(&Vector::z()));
    }
}
