//! The tone curve that edges show, and the outline's place in light: discs whose light is known, coded as a camera does and as they
//! are.

use crate::random::Random;
use grainrig_core::silhouette::{Picture, Settings, ToneCurve, find};
use rayon::prelude::*;

/// Grey values of the lighter and the darker side.
const LEVELS: [f64; 2] = [220.0, 20.0];
const SIZE: [usize; 2] = [340, 300];
/// Light is averaged over this many places a pixel, each way.
const SPLIT: usize = 4;

struct Disc {
    radius_px: f64,
    blur_px: f64,
    noise: f64,
    is_bright: bool,
    curve: ToneCurve,
    /// Whether the edge is a ramp, as something out of focus or moved has it, with no tail.
    is_ramp: bool,
}

impl Disc {
    /// The disc's edge is a normal distribution's integral over the distance from it, in light.
    fn picture(&self, seed: u64) -> Picture {
        let mut random = Random::new(seed);
        let [light, dark] = LEVELS.map(|v| f64::from(self.curve.decode(v as f32)));
        let (inside, outside) = if self.is_bright { (light, dark) } else { (dark, light) };
        let centre = [170.3, 141.8];
        let mut data = Vec::with_capacity(SIZE[0] * SIZE[1]);
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                let mut covered = 0.0;
                for k in 0..SPLIT * SPLIT {
                    let at = [x as f64, y as f64].map(|v| v - 0.5 + 0.5 / SPLIT as f64);
                    let at = [
                        at[0] + (k % SPLIT) as f64 / SPLIT as f64,
                        at[1] + (k / SPLIT) as f64 / SPLIT as f64,
                    ];
                    let depth = self.radius_px - (at[0] - centre[0]).hypot(at[1] - centre[1]);
                    let share = if self.is_ramp {
                        (0.5 + depth / (12.0f64.sqrt() * self.blur_px)).clamp(0.0, 1.0)
                    } else {
                        integral(depth / self.blur_px)
                    };
                    covered += share / (SPLIT * SPLIT) as f64;
                }
                let shown = self.curve.encode((outside + covered * (inside - outside)) as f32);
                data.push(
                    (f64::from(shown) + self.noise * normal(&mut random)).round().clamp(0.0, 255.0) as u8
                );
            }
        }
        Picture::new(SIZE[0], SIZE[1], 1, data).unwrap()
    }
}

/// One of a normal distribution (Box and Muller 1958).
fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (std::f64::consts::TAU * random.unit()).cos()
}

/// The normal distribution's integral (Abramowitz and Stegun 7.1.26, to 1.5e-7).
fn integral(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let erf = 1.0 - series * (-x * x).exp();
    if z < 0.0 { 0.5 * (1.0 - erf) } else { 0.5 * (1.0 + erf) }
}

/// Discs of both polarities and curves whose curve is not found, or whose area is off by more than the limit; and how many there are.
fn wrong(blurs: &[f64], noises: &[f64], is_ramp: bool, limit: f64) -> (Vec<String>, usize) {
    let mut discs = Vec::new();
    for radius_px in [60.0, 110.0] {
        for &blur_px in blurs {
            for &noise in noises {
                for is_bright in [false, true] {
                    for curve in [ToneCurve::Linear, ToneCurve::Srgb] {
                        discs.push(Disc { radius_px, blur_px, noise, is_bright, curve, is_ramp });
                    }
                }
            }
        }
    }
    let wrong = (discs.par_iter().enumerate())
        .filter_map(|(seed, disc)| {
            let found = find(&disc.picture(7 + seed as u64), None, &Settings::default()).unwrap();
            let off = found.report.area_px / (std::f64::consts::PI * disc.radius_px.powi(2)) - 1.0;
            let Disc { radius_px, blur_px, noise, is_bright, curve, .. } = disc;
            (found.report.tone_curve != *curve || off.abs() > limit).then(|| {
                format!(
                    "radius {radius_px}, blur {blur_px}, noise {noise}, bright {is_bright}, {curve:?}: \
                     {:?}, area {:+.3} %",
                    found.report.tone_curve,
                    100.0 * off
                )
            })
        })
        .collect();
    (wrong, discs.len())
}

#[test]
fn the_edges_of_a_disc_tell_the_tone_curve_and_its_area_is_that_of_its_light() {
    let (wrong, all) = wrong(&[0.5, 0.8, 1.2, 2.0], &[0.0, 1.5, 3.0], false, 0.002);
    assert!(wrong.is_empty() && all == 96, "{} of {all}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn so_do_edges_that_are_out_of_focus() {
    let (wrong, all) = wrong(&[0.9, 1.4], &[0.0, 1.5], true, 0.004);
    assert!(wrong.is_empty() && all == 32, "{} of {all}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Edges between two pixels, as in a drawing or a test pattern: no blur, no noise, nothing for a fit to hold on to.
#[test]
fn the_sides_of_a_drawn_square_lie_between_the_pixels_where_it_ends() {
    const SIDE: usize = 100;
    for (inside, outside) in [(16u8, 235u8), (0, 255), (80, 180), (235, 16), (180, 80)] {
        let is_inside =
            |k: usize| (120..120 + SIDE).contains(&(k % SIZE[0])) && (90..90 + SIDE).contains(&(k / SIZE[0]));
        let data = (0..SIZE[0] * SIZE[1]).map(|k| if is_inside(k) { inside } else { outside }).collect();
        let picture = Picture::new(SIZE[0], SIZE[1], 1, data).unwrap();
        let found = find(&picture, None, &Settings::default()).unwrap();
        let half = SIDE as f64 / 2.0;
        for middle in [
            [119.5, 89.5 + half],
            [119.5 + 2.0 * half, 89.5 + half],
            [119.5 + half, 89.5],
            [119.5 + half, 89.5 + 2.0 * half],
        ] {
            let off = found.silhouette.signed_distance_px(middle);
            assert!(off.abs() < 0.01, "{inside} in {outside}, at {middle:?}: {off:+.4} px");
        }
    }
}

/// A glossy ball on a pedestal before a panel: near its limb it mirrors the panel (Fresnel), up to all of the light at the limb.
fn glossy_ball(radius_px: f64, blur_px: f64, index: f64) -> (Picture, f64) {
    let size = [400_usize, 400];
    let [panel, body] = [200.0, 60.0].map(|v| f64::from(ToneCurve::Srgb.decode(v)));
    let (centre, top, half_width) = ([200.3, 160.6], 160.6 + radius_px - 6.0, 45.0);
    let at_depth = |depth: f64| {
        if depth <= 0.0 {
            return panel;
        }
        let cos = (1.0 - (1.0 - depth / radius_px).max(0.0).powi(2)).sqrt();
        let inside = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
        let across = ((cos - index * inside) / (cos + index * inside)).powi(2);
        let along = ((index * cos - inside) / (index * cos + inside)).powi(2);
        let mirrored = f64::midpoint(across, along);
        panel * mirrored + body * (1.0 - mirrored)
    };
    // The lens and the pixel, about a limb that is straight over their width.
    let spread = blur_px.hypot(12.0f64.sqrt().recip());
    let blurred = |depth: f64| {
        let parts = (-40..=40).map(|k| {
            let away = f64::from(k) / 10.0;
            [(-0.5 * away * away).exp(), (-0.5 * away * away).exp() * at_depth(depth + spread * away)]
        });
        let [weights, light] = parts.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        light / weights
    };
    let mut random = Random::new(5);
    let mut data = Vec::with_capacity(size[0] * size[1]);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let depth = radius_px - (x as f64 - centre[0]).hypot(y as f64 - centre[1]);
            let beside = half_width - (x as f64 - centre[0]).abs();
            let covered = integral(beside / spread) * integral((y as f64 - top) / spread);
            let light = blurred(depth) * (1.0 - covered) + 0.01 * panel * covered;
            let shown = f64::from(ToneCurve::Srgb.encode(light as f32)) + 1.2 * normal(&mut random);
            data.push(shown.round().clamp(0.0, 255.0) as u8);
        }
    }
    // The circle above the pedestal's top.
    let below = top - centre[1];
    let cap =
        radius_px.powi(2) * (below / radius_px).acos() - below * (radius_px.powi(2) - below * below).sqrt();
    (Picture::new(size[0], size[1], 1, data).unwrap(), std::f64::consts::PI * radius_px.powi(2) - cap)
}

#[test]
fn a_rim_that_mirrors_the_panel_is_given_back_where_it_shows_and_no_more() {
    for (radius_px, blur_px, limit) in
        [(80.0, 0.7, 0.3), (80.0, 1.1, 0.9), (130.0, 0.7, 0.7), (130.0, 1.1, 0.9)]
    {
        for index in [1.33, 1.55] {
            let (picture, area_px) = glossy_ball(radius_px, blur_px, index);
            let mut found = find(&picture, None, &Settings::default()).unwrap();
            let before = 100.0 * (found.report.area_px / area_px - 1.0);
            found.grow(found.tail.map_or(0.0, |tail| tail.rim_px()));
            let after = 100.0 * (found.report.area_px / area_px - 1.0);
            let case =
                format!("radius {radius_px}, blur {blur_px}, index {index}: {before:+.2} %, {after:+.2} %");
            assert!(before < -0.4 && after >= before && after.abs() < limit, "{case}");
        }
    }
}
