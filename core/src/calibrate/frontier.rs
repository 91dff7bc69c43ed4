//! Elevation of the rays at the grain's top, from epipolar tangency: a plane through two centres of projection that touches the grain
//! touches both outlines, at the pictures of one and the same point, the frontier point.
//!
//! Of two views Δ apart before parallel rays of the elevation ε these are the points at which
//!
//! ```text
//! min (v₁ + a u₁) = min (v₂ − a u₂),   a = ε tan ½Δ,
//! ```
//!
//! u to the right of the axis, v downwards. With rays that are not parallel it is the elevation that they have at the height of the
//! top, ε + q z, to the first order. No shape is presumed, unlike where outlines are compared height by height (see [`super::fit`]).
//!
//! Source: Cipolla and Giblin, Visual Motion of Curves and Surfaces, 2000, §6 (frontier points).

use super::profile::AxisLine;
use crate::silhouette::Silhouette;
use std::f64::consts::{PI, TAU};

/// Views nearer than this, or nearer to half a turn, say little, radians.
const APART_RAD: [f64; 2] = [0.35, 2.5];
/// Elevations that are tried, radians: to either side, and their pitch.
const STEEPEST_RAD: f64 = 0.2;
const PITCH_RAD: f64 = 0.005;
/// Rounds of weighing, and where residuals count less (Huber), standard deviations.
const ROUNDS: usize = 12;
const HUBER: f64 = 1.5;
/// The least noise of a top that is believed, pixels.
const LEAST_NOISE_PX: f64 = 0.03;
/// Median size of what scatters by one standard deviation.
const MEDIAN_SIZE: f64 = 0.6745;
/// The least standard deviation that is believed, radians.
const LEAST_SIGMA_RAD: f64 = 1e-4;
/// Fewest views and pairs.
const LEAST: [usize; 2] = [6, 12];

/// What the tops of all views say of the rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TopElevation {
    /// Elevation at the height `z_px`, radians, and its standard deviation.
    pub rad: f64,
    pub sigma_rad: f64,
    /// Height of the tops above the axis' foot, pixels.
    pub z_px: f64,
}

/// The upper outline of a picture: the vertices of its convex hull from left to right, column and row.
pub(super) fn top_outline(silhouette: &Silhouette) -> Vec<[f64; 2]> {
    let ([width, _], [x0, y0]) = (silhouette.size, silhouette.origin);
    let mut first: Vec<Option<f64>> = vec![None; width];
    let mut above: Option<&[f32]> = None;
    for (y, row) in silhouette.distance_px.chunks_exact(width).enumerate() {
        for (x, d) in row.iter().enumerate().filter(|(_, d)| **d < 0.0) {
            // The picture's end is the outline where there is nothing above.
            let over = above.map_or(0.0, |above| f64::from(*d) / f64::from(*d - above[x]));
            first[x].get_or_insert(y as f64 - over);
        }
        above = Some(row);
    }
    let points =
        first.into_iter().enumerate().filter_map(|(x, row)| Some([(x0 + x) as f64, y0 as f64 + row?]));
    upper_hull(points)
}

/// The vertices of points' convex hull that are seen from above, of points from left to right.
fn upper_hull(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for p in points {
        while let [.., a, b] = hull[..]
            && (b[0] - a[0]) * (p[1] - a[1]) <= (b[1] - a[1]) * (p[0] - a[0])
        {
            hull.pop();
        }
        hull.push(p);
    }
    hull
}

/// The upper outline of a view: u to the right of the axis and v downwards, pixels.
struct Top(Vec<[f64; 2]>);

impl Top {
    /// The least v + a u, and the u of that point.
    fn touch(&self, a: f64) -> Option<(f64, f64)> {
        // Along a convex outline it falls, then rises.
        let at = |k: usize| self.0[k][1] + a * self.0[k][0];
        let (mut low, mut high) = (0, self.0.len().checked_sub(1)?);
        while low < high {
            let middle = usize::midpoint(low, high);
            if at(middle) <= at(middle + 1) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        Some((at(low), self.0[low][0]))
    }
}

/// Two views and tan ½Δ between them.
struct Pair {
    views: [usize; 2],
    tan: f64,
}

impl Pair {
    /// By how much the views contradict one another at an elevation, pixels, and how that changes with it.
    fn residual(&self, tops: &[Top], rad: f64) -> Option<[f64; 2]> {
        let [one, other] = self.views.map(|k| &tops[k]);
        let (a, b) = (one.touch(rad * self.tan)?, other.touch(-rad * self.tan)?);
        Some([a.0 - b.0, self.tan * (a.1 + b.1)])
    }
}

/// What the tops say; `None` of too few views. Outlines as [`top_outline`] gives them; angles are the grain's, radians.
pub(super) fn top_elevation(
    outlines: &[&[[f64; 2]]],
    angles: &[f64],
    line: &AxisLine,
) -> Option<TopElevation> {
    let tops: Vec<Top> = (outlines.iter())
        .map(|outline| Top(outline.iter().map(|p| line.coordinates(*p)).map(|[u, z]| [u, -z]).collect()))
        .collect();
    let n = tops.len();
    let pairs: Vec<Pair> = (0..n)
        .flat_map(|i| (i + 1..n).map(move |j| [i, j]))
        .filter_map(|views| {
            let [a, b] = views.map(|k| angles[k]);
            let turned = (b - a + PI).rem_euclid(TAU) - PI;
            let is_apart = (APART_RAD[0]..APART_RAD[1]).contains(&turned.abs());
            is_apart.then(|| Pair { views, tan: (0.5 * turned).tan() })
        })
        .collect();
    if n < LEAST[0] || pairs.len() < LEAST[1] {
        return None;
    }
    let tried = (STEEPEST_RAD / PITCH_RAD) as i32;
    let mut rad = (-tried..=tried)
        .map(|k| f64::from(k) * PITCH_RAD)
        .filter_map(|rad| Some((rad, middle_size(&tops, &pairs, rad)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?
        .0;
    let (mut noise, mut all, mut of_views) = (LEAST_NOISE_PX, [0.0; 2], vec![[0.0; 2]; n]);
    for _ in 0..ROUNDS {
        noise = (middle_size(&tops, &pairs, rad)? / MEDIAN_SIZE).max(LEAST_NOISE_PX);
        (all, of_views) = ([0.0; 2], vec![[0.0; 2]; n]);
        for pair in &pairs {
            let Some([off, slope]) = pair.residual(&tops, rad) else { continue };
            let weight = (HUBER * noise / off.abs().max(1e-9)).min(1.0);
            let terms = [weight * slope * slope, weight * slope * off];
            for k in [0, 1] {
                all[k] += terms[k];
                pair.views.iter().for_each(|view| of_views[*view][k] += terms[k]);
            }
        }
        if all[0] <= 0.0 {
            return None;
        }
        rad = (rad - all[1] / all[0]).clamp(-STEEPEST_RAD, STEEPEST_RAD);
    }
    // Pairs share their views: how much comes of each view tells how sure all together are (jackknife).
    let without = of_views.iter().map(|own| (all[1] - own[1]) / (all[0] - own[0]).max(f64::MIN_POSITIVE));
    let squares: f64 = without.map(|rad| (rad - all[1] / all[0]).powi(2)).sum();
    let sigma_rad = ((n - 1) as f64 / n as f64 * squares).sqrt().max(LEAST_SIGMA_RAD);
    let heights: Vec<f64> = tops.iter().filter_map(|top| top.touch(0.0)).map(|(v, _)| -v).collect();
    let z_px = heights.iter().sum::<f64>() / heights.len().max(1) as f64;
    (sigma_rad.is_finite() && noise.is_finite()).then_some(TopElevation { rad, sigma_rad, z_px })
}

/// Median size of the residuals at an elevation, pixels.
fn middle_size(tops: &[Top], pairs: &[Pair], rad: f64) -> Option<f64> {
    let mut sizes: Vec<f64> =
        pairs.iter().filter_map(|p| p.residual(tops, rad)).map(|r| r[0].abs()).collect();
    let middle = sizes.len() / 2;
    (!sizes.is_empty()).then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Turntable;
    use crate::geometry::{Angle, Point};

    const LINE: AxisLine = AxisLine { column_px: 151.2, row_px: 250.0, roll_rad: 0.02 };

    /// A cloud of points wide of the axis, seen by a camera of this elevation and distance: the upper hulls of its pictures.
    fn outlines(elevation_rad: f64, camera_distance_mm: Option<f64>, angles: &[f64]) -> Vec<Vec<[f64; 2]>> {
        let camera = Turntable {
            mm_per_px: 0.005,
            axis_column_px: LINE.column_px,
            origin_row_px: LINE.row_px,
            elevation_rad,
            roll_rad: LINE.roll_rad,
            camera_distance_mm,
        };
        let body: Vec<Point> = (0..4000)
            .map(|k| {
                let (up, round) = (1.0 - f64::from(k) / 4000.0, 2.399_963 * f64::from(k));
                let out = (1.0 - up * up).sqrt();
                Point::new(0.3 + 0.45 * out * round.cos(), -0.1 + 0.3 * out * round.sin(), 0.5 + 0.4 * up)
            })
            .collect();
        let seen = |angle: f64| {
            let view = camera.view(Angle::from_deg(angle.to_degrees()), 0.0);
            let mut points: Vec<[f64; 2]> = body.iter().filter_map(|p| view.project(p)).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            upper_hull(points.into_iter())
        };
        angles.iter().map(|a| seen(*a)).collect()
    }

    #[test]
    fn tops_tell_how_far_the_rays_rise_at_their_height_before_any_camera() {
        let angles: Vec<f64> = (0..25).map(|k| f64::from(k) * PI / 25.0).collect();
        for elevation_rad in [-0.08, -0.01, 0.0, 0.05] {
            for distance in [None, Some(120.0), Some(40.0)] {
                let tops = outlines(elevation_rad, distance, &angles);
                let tops: Vec<&[[f64; 2]]> = tops.iter().map(Vec::as_slice).collect();
                let found = top_elevation(&tops, &angles, &LINE).unwrap();
                let true_rad = elevation_rad + distance.map_or(0.0, |d| found.z_px * 0.005 / d);
                let off = found.rad - true_rad;
                assert!(off.abs() < 0.002, "{elevation_rad} {distance:?}: {found:?}, {off:+.5} off");
                assert!((found.z_px - 180.0).abs() < 12.0);
            }
        }
        assert!(top_elevation(&[], &[], &LINE).is_none());
    }

    #[test]
    fn the_upper_outline_of_a_disc_is_its_upper_half_and_of_one_that_leaves_the_picture_its_end() {
        let size = [90, 80];
        for (row, first) in [(40.3, 10.3), (20.0, 0.0)] {
            let distance_px = (0..size[0] * size[1])
                .map(|k| (((k % size[0]) as f64 - 44.6).hypot((k / size[0]) as f64 - row) - 30.0) as f32)
                .collect();
            let s = Silhouette { picture: [400, 400], origin: [100, 50], size, distance_px };
            let outline = top_outline(&s);
            let top = outline.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            assert!((top - 50.0 - first).abs() < 0.02, "{top}");
            assert!(outline.iter().all(|p| (114.0..176.0).contains(&p[0])));
        }
    }
}
