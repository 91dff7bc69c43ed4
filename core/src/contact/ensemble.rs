//! How far closing plates turn a grain that is not laid exactly, nor known exactly.
//!
//! One pose of one surface gives one rocking of many: a degree or two decide what touches first. Here the rigid stage is followed from
//! many poses about the places where a grain may lie, at frictions up to the one given, on surfaces that the grain may as well have. The
//! draws are an even sequence (Roberts' generalisation of the golden section to several dimensions), the same ones always.

use super::rocking;
use crate::geometry::{ConvexHull, Vector};
use nalgebra::{Rotation3, Unit};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What is not known of how a grain is pressed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard deviation of the tilt about each level axis with which the grain is laid, rad.
    pub placing: f64,
    /// Coulomb's friction of the plates: anything between these.
    pub friction: [f64; 2],
    /// Young's modulus, MPa: anything between these.
    pub young_mpa: [f64; 2],
}

/// A way in which the grain may lie on the lower plate.
#[derive(Debug, Clone, PartialEq)]
pub struct Lying {
    /// How likely it is, over the sum of all.
    pub chance: f64,
    /// How it is turned so, for each of the surfaces.
    pub turns: Vec<Rotation3<f64>>,
}

/// One case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Which of the surfaces.
    pub surface: usize,
    /// Which of the ways to lie.
    pub lying: usize,
    /// How far the grain lay off that, rad.
    pub tilt: f64,
    /// Coulomb's friction of the plates.
    pub friction: f64,
    /// Young's modulus, MPa.
    pub young_mpa: f64,
    /// How the grain is turned where it is laid.
    pub laid: Rotation3<f64>,
    /// How it is turned where the plates hold it.
    pub held: Rotation3<f64>,
    /// How far the plates came while they turned the grain, mm.
    pub approach_mm: f64,
    /// How far they turned it, rad.
    pub turned: f64,
    /// A place among all draws that has nothing to do with the others, from 0 to below 1.
    pub place: f64,
}

/// Follows the rigid stage in so many cases. Cost: a rigid stage each, on all cores; the result does not depend on their number.
///
/// The surfaces are the grain's as it may be, one as likely as the other, each as its convex hull about its centre.
///
/// # Panics
/// Where there is no surface or no way to lie, or a way does not have a turn for each surface.
pub fn ensemble(surfaces: &[&ConvexHull], lyings: &[Lying], spread: &Spread, count: usize) -> Vec<Drawn> {
    let whole: f64 = lyings.iter().map(|l| l.chance).sum();
    let between = |[low, high]: [f64; 2], share: f64| low + share * (high - low);
    (0..count)
        .into_par_iter()
        .map(|k| {
            let [which, slip, about, size, young, lies, place] = even(k);
            let surface = ((which * surfaces.len() as f64) as usize).min(surfaces.len() - 1);
            let mut left = lies * whole;
            let passed = lyings.iter().position(|l| {
                left -= l.chance;
                left < 0.0
            });
            let lying = passed.unwrap_or(lyings.len() - 1);
            let friction = between(spread.friction, slip);
            // Both tilts are normal: their size is Rayleigh's, and their axis is any (Box and Muller).
            let tilt = spread.placing * (-2.0 * (1.0 - size).ln()).sqrt();
            let (s, c) = (TAU * about).sin_cos();
            let tilting = Rotation3::from_axis_angle(&Unit::new_unchecked(Vector::new(c, s, 0.0)), tilt);
            let laid = tilting * lyings[lying].turns[surface];
            let done = rocking(surfaces[surface], &laid, friction);
            Drawn {
                surface,
                lying,
                tilt,
                friction,
                young_mpa: between(spread.young_mpa, young),
                laid,
                held: done.turned * laid,
                approach_mm: done.approach_mm(),
                turned: done.angle(),
                place,
            }
        })
        .collect()
}

/// Of an even sequence of places in a cube the one of this number; each coordinate from 0 to below 1.
pub(super) fn even<const D: usize>(k: usize) -> [f64; D] {
    let root = root(D);
    std::array::from_fn(|axis| (0.5 + (k as f64 + 1.0) * root.powi(-(axis as i32 + 1))).fract())
}

/// The positive root of xᵈ⁺¹ = x + 1, whose powers make d places even at once.
fn root(d: usize) -> f64 {
    // x ← (1 + x)^(1/(d + 1)) contracts: 40 rounds are more than the last bit.
    (0..40).fold(1.5, |x: f64, _| (1.0 + x).powf(1.0 / (d as f64 + 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Rests;
    use crate::geometry::Point;

    fn block(size: [f64; 3]) -> Rests {
        let half = |k: usize, bit: usize| if bit & 1 == 0 { -0.5 * size[k] } else { 0.5 * size[k] };
        let corners: Vec<Point> =
            (0..8).map(|i| Point::new(half(0, i), half(1, i >> 1), half(2, i >> 2))).collect();
        Rests::new(ConvexHull::new(&corners).unwrap(), &Point::origin(), None)
    }

    fn lying(surfaces: &[Rests], down: &Vector, chance: f64) -> Lying {
        Lying { chance, turns: surfaces.iter().map(|s| s.rests[s.reached_from(down)].turn).collect() }
    }

    fn flat(surfaces: &[Rests], spread: &Spread, count: usize) -> Vec<Drawn> {
        let hulls: Vec<&ConvexHull> = surfaces.iter().map(Rests::hull).collect();
        ensemble(&hulls, &[lying(surfaces, &-Vector::z(), 1.0)], spread, count)
    }

    const SPREAD: Spread = Spread { placing: 0.03, friction: [0.0, 0.3], young_mpa: [9e4, 1.1e5] };

    #[test]
    fn the_sequence_is_even() {
        for d in 1..9 {
            assert!((root(d).powi(d as i32 + 1) - root(d) - 1.0).abs() < 1e-12);
        }
        let count = 4000;
        for axis in 0..7 {
            for part in 0..10 {
                let low = 0.1 * f64::from(part);
                let inside = (0..count).filter(|k| (low..low + 0.1).contains(&even::<7>(*k)[axis])).count();
                assert!(inside.abs_diff(count / 10) < 8, "{axis} {part}: {inside}");
            }
        }
    }

    /// A flat block laid a little askew tips back onto its side: the plates come by what it stood up, h cos t + √(w² …) − h; here
    /// w·|sin t| to the first order about one axis, between that of its shorter and of its longer side.
    #[test]
    fn a_block_that_is_laid_askew_comes_down_onto_its_side() {
        let size = [1.0, 0.8, 0.5];
        let spread = Spread { placing: f64::to_radians(1.0), friction: [0.0, 0.0], ..SPREAD };
        let drawn = flat(&[block(size)], &spread, 500);
        let mut square = 0.0;
        for d in &drawn {
            let t = d.tilt;
            let diagonal = (size[0] * size[0] + size[1] * size[1]).sqrt();
            let stood_up = |across: f64| size[2] * t.cos() + across * t.sin() - size[2];
            let range = stood_up(0.99 * size[1])..=stood_up(diagonal) + 1e-12;
            assert!(range.contains(&d.approach_mm), "{d:?}: {range:?}");
            assert!((d.turned - t).abs() < 1e-3 + 0.1 * t, "{d:?}");
            // The plates lay it on its side again.
            assert!((d.held.inverse() * Vector::z()).z > 1.0 - 1e-9, "{d:?}");
            square += t * t / drawn.len() as f64;
        }
        // Two tilts of a standard deviation each.
        assert!((square.sqrt() / (2f64.sqrt() * spread.placing) - 1.0).abs() < 0.02);
        // Steep enough friction holds it as it was laid.
        let held = Spread { friction: [3.0, 3.0], ..spread };
        assert!(flat(&[block(size)], &held, 50).iter().all(|d| d.turned < 1e-12));
    }

    #[test]
    fn each_surface_and_way_to_lie_has_its_share_and_the_bits_do_not_depend_on_the_cores() {
        let surfaces = [block([1.0, 0.8, 0.5]), block([1.0, 0.8, 0.6]), block([1.0, 0.8, 0.7])];
        let hulls: Vec<&ConvexHull> = surfaces.iter().map(Rests::hull).collect();
        let lyings = [lying(&surfaces, &-Vector::z(), 0.6), lying(&surfaces, &Vector::x(), 0.2)];
        let of = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ensemble(&hulls, &lyings, &SPREAD, 600))
        };
        let drawn = of(1);
        assert_eq!(drawn, of(3));
        for k in 0..3 {
            assert!(drawn.iter().filter(|d| d.surface == k).count().abs_diff(200) < 5);
        }
        assert!(drawn.iter().filter(|d| d.lying == 1).count().abs_diff(150) < 5);
        assert!(
            drawn.iter().all(|d| (0.0..0.3).contains(&d.friction) && (9e4..1.1e5).contains(&d.young_mpa))
        );
    }
}
