//! Closing views, which see the same outline, and the angle between them: after half a turn an outline comes back mirrored, after
//! a whole one as it was. Where it comes back moved in proportion to how fast it grows with the angle, the grain has
//! not turned as the stage did.
//!
//! The difference of two such reaches is δ·h′ + what a shift, the roll, a near camera and inclined rays make of it (see
//! [`super::fit`]): a robust linear regression over all heights. An outline is as sure along its normal everywhere, so
//! a reach is as much less sure as the outline is inclined there. h′ is the chord's over the neighbouring views; where
//! the slice is sharply bent between them it may be another.

use super::fit::Sample;
use super::profile::{AxisLine, Profiles};
use crate::silhouette::Silhouette;
use nalgebra::{Matrix5, Vector5};
use std::f64::consts::{PI, TAU};

/// Heights that are compared.
const HEIGHTS: usize = 128;
/// Two directions see the same outline where the next ones are at least this many times as far.
const FURTHER: f64 = 2.0;
/// Furthest neighbour that h′ is taken from, radians.
const FURTHEST_RAD: f64 = 0.4;
/// How far h′ may be off, as a share of its change between the neighbours (standard deviation).
const BENT: f64 = 0.2;
/// Rounds of weighing.
const ROUNDS: usize = 20;
/// Where residuals count less (Huber), standard deviations.
const HUBER: f64 = 1.5;
/// The least noise that is believed, pixels.
const LEAST_NOISE_PX: f64 = 0.05;
/// Share of the height over which residuals are alike, and blocks whose sums are compared for the uncertainty.
const ALIKE: f64 = 0.08;
const BLOCKS: usize = 10;
/// But no fewer pixels of the height: blur, pixels and a file's blocks move a whole stretch of an outline, however small the grain.
const ALIKE_PX: f64 = 10.0;
const LEAST_BLOCKS: usize = 3;

/// Turns that are alike, radians.
const SAME_RAD: f64 = 0.02;
/// Outlines whose mean square difference is below this share of what a turn makes of them have not turned so.
const ALIKE_SHARE: f64 = 0.15;
/// What is known beforehand (standard deviations): elevation, shift in pixels, roll left over.
const ELEVATION_RAD: f64 = 0.03;
const SHIFT_PX: f64 = 10.0;
const ROLL_RAD: f64 = 0.004;

/// Two views that see the same outline.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Closing {
    /// Indices among the views.
    pub views: [usize; 2],
    /// How much farther than it should the grain has turned from the first to the second, radians.
    pub rad: f64,
    /// Its standard deviation, radians.
    pub sigma_rad: f64,
    /// How far the directions lie from one another at most, radians: over it the outline's growth is not known well.
    pub gap_rad: f64,
    /// Mean square by which the two outlines differ, px².
    pub unlike_px2: f64,
    /// The same of either view and each of the others that look from elsewhere, with how far the grain turns between these,
    /// radians: what such a turn does to this outline.
    pub turned_px2: Vec<[f64; 2]>,
}

impl Closing {
    /// Whether the outlines are too much alike for the grain to have turned so much farther between them: much more alike
    /// than each of them is to the view that lies so far from it.
    pub(super) fn refutes(&self, rad: f64) -> bool {
        let nearest = self.turned_px2.iter().map(|t| (t[0] - rad.abs()).abs()).fold(f64::INFINITY, f64::min);
        let such = self.turned_px2.iter().filter(|t| (t[0] - rad.abs()).abs() < nearest + SAME_RAD);
        // Between views that lie farther apart an outline grows in proportion to the angle at first.
        let least = such.map(|t| t[1] * (rad / t[0]).powi(2).min(1.0)).fold(f64::INFINITY, f64::min);
        least.is_finite() && self.unlike_px2 < ALIKE_SHARE * least
    }
}

/// One reach: its direction, its view and its side.
#[derive(Clone, Copy)]
struct Reach {
    t: f64,
    view: usize,
    right: bool,
}

/// One pair's directions: the two, and their neighbours before and behind.
struct DirectionPair {
    /// First and second view's own.
    own: [Reach; 2],
    beside: [Reach; 2],
}

/// All pairs of views that see the same outline at these (signed) angles; none where the views share too few rows.
pub(super) fn closings(views: &[Sample], angles: &[f64], line: &AxisLine) -> Vec<Closing> {
    paired(views, angles, line, FURTHER)
}

/// The same of all neighbouring directions that different views look from, even midway between two others: only where much is
/// asked for, as an outline is not known well between views.
pub(super) fn near_closings(views: &[Sample], angles: &[f64], line: &AxisLine) -> Vec<Closing> {
    paired(views, angles, line, 1.0)
}

fn paired(views: &[Sample], angles: &[f64], line: &AxisLine, further: f64) -> Vec<Closing> {
    let mut pairs: Vec<([usize; 2], Vec<DirectionPair>)> = Vec::new();
    for met in meetings(angles, further) {
        let views = met.own.map(|s| s.view);
        match pairs.iter_mut().find(|(v, _)| *v == views) {
            Some((_, all)) => all.push(met),
            None => pairs.push((views, vec![met])),
        }
    }
    if pairs.is_empty() {
        return Vec::new();
    }
    let outlines: Vec<&Silhouette> = views.iter().map(|v| v.silhouette).collect();
    let Some(profiles) = Profiles::read(&outlines, line, HEIGHTS, &|_, z| z) else { return Vec::new() };
    pairs.iter().filter_map(|(views, met)| closing(*views, met, angles, &profiles)).collect()
}

/// Where two reaches of different views look the same way, closer than their neighbours do.
fn meetings(angles: &[f64], further: f64) -> Vec<DirectionPair> {
    let mut all: Vec<Reach> = (angles.iter().enumerate())
        .flat_map(|(view, a)| {
            [true, false].map(|right| Reach {
                t: (a + if right { 0.0 } else { PI }).rem_euclid(TAU),
                view,
                right,
            })
        })
        .collect();
    all.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.view.cmp(&b.view)));
    let n = all.len();
    let ahead = |a: &Reach, b: &Reach| (b.t - a.t).rem_euclid(TAU);
    (0..n)
        .filter_map(|i| {
            let [before, a, b, after] = [n - 1, 0, 1, 2].map(|k| all[(i + k) % n]);
            let gap = ahead(&a, &b);
            let wide = [ahead(&before, &a), ahead(&b, &after)];
            let apart = wide.iter().all(|w| *w > further * gap.max(1e-3) && *w < FURTHEST_RAD);
            (n > 3 && a.view != b.view && apart).then(|| {
                let own = if a.view < b.view { [a, b] } else { [b, a] };
                DirectionPair { own, beside: [before, after] }
            })
        })
        .collect()
}

/// One height's equation.
struct Row {
    x: Vector5<f64>,
    y: f64,
    /// 1 + (∂h/∂z)²: what the outline's inclination makes of its variance.
    inclined: f64,
    reach_px: f64,
    /// Change of h′ between the neighbours, pixels.
    bend_px: f64,
}

fn closing(views: [usize; 2], met: &[DirectionPair], angles: &[f64], profiles: &Profiles) -> Option<Closing> {
    let m = profiles.z_px.len();
    let reach = |s: &Reach| {
        let sample = s.view + if s.right { angles.len() } else { 0 };
        &profiles.reach_px[sample * m..(sample + 1) * m]
    };
    let pitch = (profiles.z_px[m - 1] - profiles.z_px[0]) / (m - 1) as f64;
    let mirrored = if met.iter().all(|p| p.own[0].right != p.own[1].right) { 1.0 } else { 0.0 };
    let mut rows = Vec::new();
    let mut gap_rad = 0.0_f64;
    for pair in met {
        let [first, second] = pair.own.map(|s| s.t);
        let turned = (second - first + PI).rem_euclid(TAU) - PI;
        gap_rad = gap_rad.max(turned.abs());
        let middle = first + 0.5 * turned;
        let [back, ahead] = [middle - pair.beside[0].t, pair.beside[1].t - middle].map(|d| d.rem_euclid(TAU));
        let [a, b] = pair.own.map(|s| reach(&s));
        let [before, after] = pair.beside.map(|s| reach(&s));
        let mean: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
        let slope = smooth(&(0..m).map(|k| (after[k] - before[k]) / (back + ahead)).collect::<Vec<_>>());
        let (sb, sa, sab) = (back.sin(), ahead.sin(), (back + ahead).sin());
        // The mean radius of curvature between three directions (see [`super::turning`]), times the way.
        let weight =
            4.0 * (0.5 * ahead).sin() * (0.5 * back).sin() * (0.5 * (ahead + back)).sin() / (ahead + back);
        let bend = smooth(
            &(0..m).map(|k| (before[k] * sa + after[k] * sb - mean[k] * sab) / weight).collect::<Vec<_>>(),
        );
        let up = smooth(
            &(0..m)
                .map(|k| {
                    let (low, high) = (k.saturating_sub(1), (k + 1).min(m - 1));
                    (mean[high] - mean[low]) / ((high - low) as f64 * pitch)
                })
                .collect::<Vec<_>>(),
        );
        let side = if pair.own[1].right { 1.0 } else { -1.0 };
        for k in 0..m {
            let (h, z, s) = (mean[k], profiles.z_px[k], slope[k]);
            rows.push(Row {
                x: Vector5::new(
                    s,
                    mirrored * 2.0 * side * s * (h - z * up[k]),
                    mirrored * -2.0 * side * s * up[k],
                    side,
                    mirrored * -side * (z + h * up[k]),
                ),
                y: b[k] - a[k] - s * turned,
                inclined: 1.0 + up[k] * up[k],
                reach_px: h,
                bend_px: bend[k],
            });
        }
    }
    let [rad, sigma_rad] = regress(&rows, m, profiles.height_px, pitch)?;
    let turned_px2 = (0..angles.len())
        .filter(|other| !views.contains(other))
        .flat_map(|other| views.map(|v| ((angles[v] - angles[other]).abs() % TAU, [v, other])))
        // Beyond a quarter turn outlines grow alike again.
        .filter(|(turn, _)| (SAME_RAD..0.5 * PI).contains(turn))
        .map(|(turn, pair)| [turn, unlike_px2(pair, false, angles.len(), profiles)])
        .collect();
    let unlike_px2 = unlike_px2(views, mirrored > 0.0, angles.len(), profiles);
    Some(Closing { views, rad, sigma_rad, gap_rad, unlike_px2, turned_px2 })
}

/// Mean square by which the second outline (or its mirror image) differs from the first, wherever it stands, px².
fn unlike_px2(pair: [usize; 2], mirrored: bool, views: usize, profiles: &Profiles) -> f64 {
    let m = profiles.z_px.len();
    let reach = |view: usize, right: bool| {
        let sample = view + if right { views } else { 0 };
        &profiles.reach_px[sample * m..(sample + 1) * m]
    };
    let grown = |right: bool| -> Vec<f64> {
        let (a, b) = (reach(pair[0], right != mirrored), reach(pair[1], right));
        a.iter().zip(b).map(|(a, b)| b - a).collect()
    };
    let [left, right] = [grown(false), grown(true)];
    let mean = |of: &[f64]| of.iter().sum::<f64>() / m as f64;
    // A shift of the picture widens one side by what the other loses.
    let shift = 0.5 * (mean(&right) - mean(&left));
    let sum = |of: &[f64], shift: f64| of.iter().map(|d| (d - shift).powi(2)).sum::<f64>();
    (sum(&left, -shift) + sum(&right, shift)) / (2 * m) as f64
}

/// Means over three neighbours.
fn smooth(values: &[f64]) -> Vec<f64> {
    (0..values.len())
        .map(|k| {
            let near = &values[k.saturating_sub(1)..(k + 2).min(values.len())];
            near.iter().sum::<f64>() / near.len() as f64
        })
        .collect()
}

/// δ and its standard deviation; rows come in groups of `m` heights.
fn regress(rows: &[Row], m: usize, height_px: f64, pitch_px: f64) -> Option<[f64; 2]> {
    let prior =
        [0.0, (2.0 * height_px).powi(2), ELEVATION_RAD.powi(-2), SHIFT_PX.powi(-2), ROLL_RAD.powi(-2)];
    let mut noise = 3.0 * LEAST_NOISE_PX;
    let mut found: Vector5<f64> = Vector5::zeros();
    let mut residuals: Vec<f64> = vec![0.0; rows.len()];
    let mut weights = vec![0.0; rows.len()];
    let mut inverse = Matrix5::zeros();
    for _ in 0..ROUNDS {
        let [turned, near, scatter] = [found[0], found[1], noise];
        let deviation = |r: &Row| {
            let off = turned.powi(2) + (2.0 * near * r.reach_px).powi(2);
            (scatter * scatter * r.inclined + (BENT * r.bend_px).powi(2) * off).sqrt()
        };
        let mut normal = Matrix5::from_diagonal(&Vector5::from(prior));
        let mut right = Vector5::zeros();
        for ((r, e), w) in rows.iter().zip(&residuals).zip(&mut weights) {
            let d = deviation(r);
            *w = (HUBER * d / e.abs().max(1e-9)).min(1.0) / (d * d);
            normal += r.x * r.x.transpose() * *w;
            right += r.x * (*w * r.y);
        }
        inverse = normal.try_inverse()?;
        found = inverse * right;
        let mut scaled: Vec<f64> = Vec::with_capacity(rows.len());
        for (r, e) in rows.iter().zip(&mut residuals) {
            *e = r.y - r.x.dot(&found);
            scaled.push(e.abs() / deviation(r));
        }
        let middle = scaled.len() / 2;
        // The median of a normal deviate's magnitude is 1/1.4826.
        noise =
            (noise * 1.4826 * *scaled.select_nth_unstable_by(middle, f64::total_cmp).1).max(LEAST_NOISE_PX);
    }
    // Neighbouring heights err alike: what whole blocks of them pull at the answer.
    let mut spread = Matrix5::zeros();
    let pulls: Vec<Vector5<f64>> =
        (rows.iter().zip(residuals.iter().zip(&weights))).map(|(r, (e, w))| r.x * (e * w)).collect();
    let alike_rows = (ALIKE * m as f64).max(ALIKE_PX / pitch_px);
    let blocks_in = ((m as f64 / alike_rows) as usize).clamp(LEAST_BLOCKS, BLOCKS);
    for block in pulls.chunks(m).flat_map(|group| group.chunks(m.div_ceil(blocks_in))) {
        let sum: Vector5<f64> = block.iter().sum();
        spread += sum * sum.transpose();
    }
    let blocks = (inverse * spread * inverse)[(0, 0)] * blocks_in as f64 / (blocks_in as f64 - 1.5);
    let sigma = blocks.max(inverse[(0, 0)] * alike_rows).sqrt();
    (found[0].is_finite() && sigma.is_finite()).then_some([found[0], sigma])
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: AxisLine = AxisLine { column_px: 160.0, row_px: 290.0, roll_rad: 0.0 };

    /// A barrel of elliptic slices (their half axes 90 and 60 px at the middle, turned with the height), 8 px off the
    /// axis, seen before parallel rays.
    fn seen(angle: f64, shift: f64) -> Silhouette {
        let size = [320, 300];
        let distance_px = (0..size[0] * size[1])
            .map(|k| {
                let [u, z] = LINE.coordinates([(k % size[0]) as f64 - shift, (k / size[0]) as f64]);
                let barrel = (1.0 - ((z - 140.0) / 125.0).powi(2)).max(0.0).sqrt();
                let t = angle + 0.004 * z;
                let half = barrel * (90.0 * t.cos()).hypot(60.0 * t.sin());
                let across = (u - 8.0 * angle.cos()).abs() - half;
                across.max((z - 140.0).abs() - 125.0) as f32
            })
            .collect();
        Silhouette { picture: size, origin: [0, 0], size, distance_px }
    }

    fn closed(true_angles: &[f64], nominal: &[f64]) -> Vec<Closing> {
        let shift = |i: usize| 0.3 * (1.7 * i as f64).sin();
        let silhouettes: Vec<Silhouette> =
            true_angles.iter().enumerate().map(|(i, a)| seen(*a, shift(i))).collect();
        let views: Vec<Sample> =
            silhouettes.iter().map(|silhouette| Sample { silhouette, pedestal: None, top: &[] }).collect();
        closings(&views, nominal, &LINE)
    }

    #[test]
    fn the_closing_view_tells_how_far_the_grain_has_turned_too_far() {
        let nominal: Vec<f64> = (0..26).map(|i| (7.2 * f64::from(i)).to_radians()).collect();
        for ahead in [-1.8f64, 0.0, 0.9] {
            let angles: Vec<f64> = nominal.iter().map(|a| a * (1.0 + ahead / 180.0)).collect();
            let [c] = &closed(&angles, &nominal)[..] else { panic!("one pair closes") };
            assert_eq!(c.views, [0, 25]);
            let error = c.rad.to_degrees() - ahead;
            assert!(error.abs() < 0.05 + 0.1 * ahead.abs(), "{ahead}: {:.3}°", c.rad.to_degrees());
            assert!(c.sigma_rad.to_degrees() < 0.3);
        }
    }

    #[test]
    fn after_a_whole_turn_every_view_closes_with_its_mirror_and_the_last_with_the_first() {
        let nominal: Vec<f64> = (0..51).map(|i| (7.2 * f64::from(i)).to_radians()).collect();
        let angles: Vec<f64> = nominal
            .iter()
            .enumerate()
            .map(|(i, a)| a + if i >= 30 { 1f64.to_radians() } else { 0.0 })
            .collect();
        let all = closed(&angles, &nominal);
        for c in &all {
            let crossed = c.views[0] < 30 && c.views[1] >= 30;
            let expected = if crossed { 1.0 } else { 0.0 };
            assert!((c.rad.to_degrees() - expected).abs() < 0.2, "{:?}: {:.2}°", c.views, c.rad.to_degrees());
        }
        assert!(all.len() >= 24, "{}", all.len());
    }

    #[test]
    fn views_of_less_than_half_a_turn_close_nowhere() {
        let nominal: Vec<f64> = (0..20).map(|i| (7.2 * f64::from(i)).to_radians()).collect();
        assert!(closed(&nominal, &nominal).is_empty());
    }
}
