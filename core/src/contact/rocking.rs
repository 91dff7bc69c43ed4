//! The rigid stage of a compression: a stiff grain between closing plates rocks until they hold it.
//!
//! ```text
//! W(n) = max p·n − min p·n                    the plates' distance at which both touch; n the plates' normal in the grain
//! g    = shortest of {u − l}, seen along n    from what touches below, l in conv L, to what touches above, u in conv U
//! ω    ∥ n × g                                the grain turns over its feet, down the steepest slope of W
//! ```
//!
//! The plates push along the line from the lower to the upper contacts. Where its slope against their normal, |g|/W, is at most
//! the friction of either plate, they hold the grain as it is, whatever they press with; where it is more, no forces on the
//! contacts that there are can be in balance, and the grain turns, nearly without a force, until others come. Without
//! friction that ends where W has a local minimum: the upper contacts stand above the lower ones (g = 0). The motion is that of
//! slow plates: without inertia; with a weight and a drag that are small beside what presses later, the drag the same about every
//! axis, so that of all ways down the grain takes the steepest.
//!
//! The grain is its convex hull, a polyhedron, on which everything is exact: between two events (a corner that comes to a
//! plate) the grain turns about one level axis, and when the next corner comes is an angle in closed form.

use crate::geometry::{ConvexHull, Point, Vector};
use nalgebra::{Rotation3, Unit};

/// Heights and places that differ by less than this share of the grain's size are one.
const LEVEL: f64 = 1e-9;
/// Events after which a grain that still turns is given up: many times what the roundest of surfaces takes.
const MOST_EVENTS: usize = 1_000_000;

/// Where the plates stop turning the grain, and how it came there.
#[derive(Debug, Clone, PartialEq)]
pub struct Rocking {
    /// How the grain was turned, from how it lay to where it is held.
    pub turned: Rotation3<f64>,
    /// The plates' distance where both first touch, mm.
    pub from_mm: f64,
    /// The plates' distance where the grain is held, mm.
    pub to_mm: f64,
    /// Whether friction holds it; if not, the upper contacts stand above the lower ones.
    pub held_by_friction: bool,
    /// The slope of the line between the contacts at the beginning and at the end, over the plates' normal.
    pub slopes: [f64; 2],
    /// The contacts where the plates first touch the grain, as it lies then.
    pub first: Contacts,
    /// The contacts where the plates hold it, as it lies then.
    pub held: Contacts,
}

/// The corners of a grain that touch the plates, where they are, mm.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contacts {
    /// On the lower plate.
    pub lower: Vec<Point>,
    /// On the upper plate.
    pub upper: Vec<Point>,
}

impl Rocking {
    /// How far the plates came while the grain turned, mm.
    pub fn approach_mm(&self) -> f64 {
        self.from_mm - self.to_mm
    }

    /// How far the grain turned, rad.
    pub fn angle(&self) -> f64 {
        self.turned.angle()
    }
}

/// What touches a plate, and the shortest way between both sets seen from above.
#[derive(Debug, Clone)]
struct Touching {
    lower: Vec<u32>,
    upper: Vec<u32>,
    /// From the lower to the upper contacts, level.
    gap: Vector,
    /// The plates' distance.
    width: f64,
}

impl Touching {
    fn contacts(&self, hull: &ConvexHull, pose: &Rotation3<f64>) -> Contacts {
        let places = |which: &[u32]| which.iter().map(|v| pose * hull.vertices[*v as usize]).collect();
        Contacts { lower: places(&self.lower), upper: places(&self.upper) }
    }
}

/// Lets level plates close on a grain that lies as it is turned here, until they hold it.
///
/// `friction` is Coulomb's of both plates. Cost: that of the corners around the contacts, for each event.
pub fn rocking(hull: &ConvexHull, laid: &Rotation3<f64>, friction: f64) -> Rocking {
    let size = hull.vertices.iter().map(|p| (p - hull.vertices[0]).norm()).fold(0.0, f64::max);
    let mut turned = Rotation3::identity();
    let mut touching = touching(hull, laid, size, [0; 2]);
    let from_mm = touching.width;
    let first = touching.contacts(hull, laid);
    let first_slope = touching.gap.norm() / touching.width;
    let mut events = 0;
    loop {
        let slope = touching.gap.norm() / touching.width;
        let stands = touching.gap.norm() <= LEVEL * size;
        let turn = (!stands && slope > friction && events < MOST_EVENTS)
            .then(|| next_turn(hull, &(turned * laid), &touching, size))
            .flatten();
        let Some(turn) = turn else {
            return Rocking {
                turned,
                from_mm,
                to_mm: touching.width,
                held_by_friction: !stands,
                slopes: [first_slope, slope],
                first,
                held: touching.contacts(hull, &(turned * laid)),
            };
        };
        turned = turn * turned;
        // Rounding of thousands of turns stays where it is that of one.
        turned.renormalize();
        let near = [touching.lower[0], touching.upper[0]];
        touching = self::touching(hull, &(turned * laid), size, near);
        events += 1;
    }
}

/// What touches the plates when the grain lies like this; looked for from a lower and an upper corner.
fn touching(hull: &ConvexHull, pose: &Rotation3<f64>, size: f64, [below, above]: [u32; 2]) -> Touching {
    let normal = pose.inverse() * Vector::z();
    let lower = level_with(hull, &-normal, hull.farthest(&-normal, below), size);
    let upper = level_with(hull, &normal, hull.farthest(&normal, above), size);
    let at = |v: u32| pose * hull.vertices[v as usize].coords;
    let width = at(upper[0]).z - at(lower[0]).z;
    let differences: Vec<Vector> = (upper.iter())
        .flat_map(|u| lower.iter().map(move |l| (u, l)))
        .map(|(u, l)| at(*u) - at(*l))
        .map(|d| Vector::new(d.x, d.y, 0.0))
        .collect();
    let gap = super::rest::nearest_on_hull(&differences);
    Touching { lower, upper, gap, width }
}

/// The corners that lie as far in a direction as this one, which lies farthest.
fn level_with(hull: &ConvexHull, direction: &Vector, farthest: u32, size: f64) -> Vec<u32> {
    let reach = |v: u32| hull.vertices[v as usize].coords.dot(direction);
    let level = reach(farthest) - LEVEL * size;
    let mut found = vec![farthest];
    let mut next = 0;
    while let Some(&v) = found.get(next) {
        next += 1;
        for &n in hull.neighbours(v) {
            if reach(n) >= level && !found.contains(&n) {
                found.push(n);
            }
        }
    }
    found
}

/// The turn about the feet until another corner comes to a plate; none where none would come.
fn next_turn(
    hull: &ConvexHull,
    pose: &Rotation3<f64>,
    touching: &Touching,
    size: f64,
) -> Option<Rotation3<f64>> {
    let ahead = touching.gap.normalize();
    let axis = Vector::z().cross(&ahead);
    let at = |v: u32| pose * hull.vertices[v as usize].coords;
    // What stays: of the lower contacts the foremost, over which the grain turns, of the upper ones the hindmost.
    let foremost = |of: &[u32], sign: f64| {
        let most = of.iter().map(|v| sign * at(*v).dot(&ahead)).fold(f64::NEG_INFINITY, f64::max);
        let stays = |v: &u32| sign * at(*v).dot(&ahead) >= most - LEVEL * size;
        of.iter().copied().filter(stays).collect::<Vec<u32>>()
    };
    // Seen along the axis, upside down for the upper plate: forwards and height over what stays.
    let first = |stays: &[u32], sign: f64| {
        let pivot = at(*stays.first()?);
        (stays.iter().flat_map(|v| hull.neighbours(*v)))
            .filter_map(|n| {
                let from = sign * (at(*n) - pivot);
                let (forward, height) = (from.dot(&ahead), from.z);
                if forward.hypot(height) < LEVEL * size {
                    return None;
                }
                let angle = height.atan2(forward);
                (angle > 1e-12 && angle < std::f64::consts::PI - 1e-9).then_some(angle)
            })
            .min_by(f64::total_cmp)
    };
    let below = first(&foremost(&touching.lower, 1.0), 1.0);
    let above = first(&foremost(&touching.upper, -1.0), -1.0);
    let angle = below.into_iter().chain(above).min_by(f64::total_cmp)?;
    Some(Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, TAU};

    fn about_y(deg: f64) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector::y_axis(), deg.to_radians())
    }

    fn hull(points: &[Point]) -> ConvexHull {
        ConvexHull::new(points).unwrap()
    }

    /// A block, its middle at the origin.
    fn block(size: [f64; 3]) -> ConvexHull {
        let half = |k: usize, bit: usize| if bit & 1 == 0 { -0.5 * size[k] } else { 0.5 * size[k] };
        hull(&(0..8).map(|i| Point::new(half(0, i), half(1, i >> 1), half(2, i >> 2))).collect::<Vec<_>>())
    }

    /// An ellipsoid, fine along x and z, where it turns.
    fn ellipsoid(a: [f64; 3]) -> ConvexHull {
        let mut points = Vec::new();
        for i in -3..=3 {
            let (y, across) = (f64::from(i) * 0.45).sin_cos();
            for k in 0..7200 {
                let (z, x) = (f64::from(k) * TAU / 7200.0).sin_cos();
                points.push(Point::new(a[0] * across * x, a[1] * y, a[2] * across * z));
            }
        }
        hull(&points)
    }

    fn deg(angle: f64) -> f64 {
        angle.to_degrees()
    }

    #[test]
    fn a_block_tips_at_the_angle_of_its_diagonal() {
        let (w, h) = (0.4, 1.0);
        let body = block([w, 0.7, h]);
        let diagonal = deg(f64::atan2(w, h));
        for tilt in [0.0, 1.0, 8.0, diagonal - 0.1, diagonal + 0.1, 30.0, 60.0, 89.0] {
            let (s, c) = f64::to_radians(tilt).sin_cos();
            let from = h * c + w * s;
            for friction in [0.0, 0.2] {
                let done = rocking(&body, &about_y(tilt), friction);
                let lies_flat = tilt == 0.0;
                let holds = !lies_flat && (f64::to_radians(tilt - diagonal)).tan().abs() <= friction;
                let (to, turned) = match (holds || lies_flat, tilt < diagonal) {
                    (true, _) => (from, 0.0),
                    (false, true) => (h, tilt),
                    (false, false) => (w, 90.0 - tilt),
                };
                assert!((done.from_mm - from).abs() < 1e-12, "{tilt}: {done:?}");
                assert!((done.to_mm - to).abs() < 1e-9, "{tilt}, {friction}: {done:?}");
                assert!((deg(done.angle()) - turned).abs() < 1e-6, "{tilt}, {friction}: {done:?}");
                assert_eq!(done.held_by_friction, holds, "{tilt}, {friction}");
            }
        }
        // On a corner: it lies down on a side in the end, its corners on both plates.
        let pose = Rotation3::from_euler_angles(0.5, 0.4, 0.3);
        let done = rocking(&body, &pose, 0.0);
        assert_eq!((done.held.lower.len(), done.held.upper.len()), (4, 4));
        assert!([w, 0.7, h].iter().any(|side| (done.to_mm - side).abs() < 1e-9), "{done:?}");
    }

    #[test]
    fn an_ellipsoid_rolls_until_friction_holds_it() {
        let [a, c] = [0.3, 0.55];
        let body = ellipsoid([a, 0.6, c]);
        // Half the plates' distance, and the slope of the line between the contacts, where the plates' normal is so far from z.
        let half = |t: f64| (a * t.sin()).hypot(c * t.cos());
        let slope = |t: f64| ((c * c - a * a) * t.sin() * t.cos()) / half(t).powi(2);
        for (tilt, friction) in [(0.0, 0.0), (2.0, 0.2), (30.0, 0.0), (45.0, 0.2), (80.0, 0.2), (88.0, 0.2)] {
            let t = f64::to_radians(tilt);
            let end = if slope(t) <= friction {
                t
            } else {
                let (mut low, mut high) = (t.max(0.6), FRAC_PI_2);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if slope(middle) > friction { low = middle } else { high = middle }
                }
                high
            };
            let done = rocking(&body, &about_y(tilt), friction);
            assert!((deg(done.angle()) - deg(end - t)).abs() < 0.1, "{tilt}: {} {done:?}", deg(end - t));
            let expected = 2.0 * (half(t) - half(end));
            assert!((done.approach_mm() - expected).abs() < 1e-4, "{tilt}: {expected} {done:?}");
            assert!(done.slopes[1] <= friction.max(1e-3), "{done:?}");
        }
    }

    #[test]
    fn a_tetrahedron_ends_on_a_side_or_between_two_edges() {
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let body = hull(&corners.map(Point::from));
        let edge = 8f64.sqrt();
        let (on_side, on_edges) = (edge * (2f64 / 3.0).sqrt(), edge / 2f64.sqrt());
        let mut ends = [0, 0];
        for k in 0..200 {
            let k = f64::from(k);
            let pose = Rotation3::from_euler_angles(1.3 * k, 0.7 * k, 2.1 * k);
            let done = rocking(&body, &pose, 0.0);
            let which = [on_side, on_edges].iter().position(|w| (done.to_mm - w).abs() < 1e-9);
            ends[which.unwrap_or_else(|| panic!("{done:?}"))] += 1;
            // What friction holds, it holds sooner.
            let held = rocking(&body, &pose, 0.2);
            assert!(held.approach_mm() <= done.approach_mm() + 1e-12);
            assert!(held.slopes[1] <= 0.2 && (held.held_by_friction || held.slopes[1] < 1e-9), "{held:?}");
        }
        assert!(ends[0] > 20 && ends[1] > 20, "{ends:?}");
    }

    #[test]
    fn the_plates_only_come_nearer_and_no_corner_passes_them() {
        let points: Vec<Point> = (0..300)
            .map(|i| {
                let t = f64::from(i);
                let r = 1.0 + 0.15 * (3.7 * t).sin();
                let (s, c) = (0.618 * t * TAU).sin_cos();
                let z = 1.0 - (2.0 * t + 1.0) / 300.0;
                Point::new(0.8 * r * c * (1.0 - z * z).sqrt(), r * s * (1.0 - z * z).sqrt(), 0.6 * r * z)
            })
            .collect();
        let body = hull(&points);
        for k in 0..100 {
            let k = f64::from(k);
            let pose = Rotation3::from_euler_angles(1.9 * k, 0.9 * k, 0.4 * k);
            for friction in [0.0, 0.1, 0.3] {
                let done = rocking(&body, &pose, friction);
                let z = |p: &Point| (done.turned * pose * p).z;
                let reach = |f: fn(f64, f64) -> f64, from| points.iter().map(z).fold(from, f);
                let width = reach(f64::max, f64::NEG_INFINITY) - reach(f64::min, f64::INFINITY);
                assert!((width - done.to_mm).abs() < 1e-9 && done.approach_mm() >= 0.0, "{done:?}");
            }
        }
    }
}
