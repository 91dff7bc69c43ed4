//! The lens's blur, from the pedestal's sides.
//!
//! A side is straight and, of a turned body, has the same profile in all its rows, in which noise adds up to nothing: the blur shows where
//! the step is a few grey levels. Its light near the edge is taken for an exponential, as a grain's is (`edge_fit.rs`):
//!
//! ```text
//! E(t) = c + A e^(kt + k²σ²/2) · Φ(t/σ + kσ),     t = (x − x₀ − m(y − y₀)) / √(1 + m²) inwards
//! ```
//!
//! c, A, k, σ, x₀ and m are fitted (Levenberg and Marquardt) to all pixels beside the side.

use super::Pedestal;
use crate::silhouette::edge_fit::normal;
use crate::silhouette::plane::Plane;
use nalgebra::{Matrix6, Vector6};

/// Rows below the top that are left out, and this many standard deviations of the blur more: the top's light mixes with the side's.
const BELOW_TOP: (f64, f64) = (3.0, 3.0);
/// Rows that are averaged, where the side leans by less than a tenth of a pixel over them.
const AVERAGED: usize = 6;
const LEAN_PX: f64 = 0.1;
/// Averages of which a side is told at least.
const LEAST_AVERAGES: usize = 5;
/// How far to either side of the edge is looked, standard deviations of the blur and pixels; inwards no further than this share of
/// the half width.
const REACH: (f64, f64) = (4.0, 3.0);
const OF_HALF: f64 = 0.9;
/// Beside a row of the pedestal is background where it differs by less than so many standard deviations of the noise, or this share of
/// the step.
const BACKGROUND: (f64, f64) = (4.0, 0.1);
/// A step of less than so many standard deviations of an average's noise tells nothing, and no lens makes edges sharper than this, pixels.
const LEAST_STEP: f64 = 2.0;
const LEAST_PX: f64 = 0.3;
/// Steps of the fit, and the change of σ, as a share, that ends them.
const STEPS: usize = 40;
const SETTLED: f64 = 1e-4;
/// The fit tells the blur where it is this sure (a share, one standard deviation), and what it leaves is less than this share of the step.
const LEAST_SURE: f64 = 0.12;
const MOST_LEFT: (f64, f64) = (0.03, 0.15);

/// Standard deviation of the blur of lens and pixel together, pixels, as the sides of a pedestal show it in a plane in light whose noise is
/// this many levels and whose blur is about so many pixels; of two sides that differ, the sharper one's. `None` where neither tells.
pub(in crate::silhouette) fn lens_blur_px(
    plane: &Plane,
    pedestal: &Pedestal,
    noise: f64,
    about_px: f64,
) -> Option<f64> {
    let sides = [(pedestal.left, 1.0), (pedestal.right, -1.0)];
    let half = pedestal.centre().1;
    let blur_px = |(line, inwards)| {
        Side { plane, line, inwards, half, noise, about_px }.blur_px(pedestal.top_at(pedestal.centre().0))
    };
    sides.into_iter().filter_map(blur_px).min_by(f64::total_cmp)
}

struct Side<'a> {
    plane: &'a Plane,
    line: [f64; 2],
    inwards: f64,
    half: f64,
    noise: f64,
    about_px: f64,
}

/// An average of pixels: how far inwards of the side as it was known, rows below the middle, levels.
type Sample = [f64; 3];

impl Side<'_> {
    fn blur_px(&self, top: f64) -> Option<f64> {
        let (samples, rows) = self.samples(top)?;
        let step = step(&samples, self.about_px)?;
        // Levels of an average of so many rows.
        let noise = self.noise.max(0.05) / (rows as f64).sqrt();
        if step.abs() < LEAST_STEP * noise {
            return None;
        }
        let mut p = Vector6::new(0.0, step, 0.0, self.about_px.ln(), 0.0, 0.0);
        // The level further inside may go any way, but not far over the blur.
        let steep = (0.3 / self.about_px).powi(-2);
        let scale = (noise.hypot(0.01 * step)).powi(-2);
        let cost_of = |p: &Vector6<f64>| {
            let squares: f64 = samples.iter().map(|s| (s[2] - model(p, s).0).powi(2)).sum();
            scale * squares + steep * p[2] * p[2]
        };
        let (mut cost, mut damping) = (cost_of(&p), 1e-2);
        let mut normal = Matrix6::identity();
        for _ in 0..STEPS {
            let mut pull = Vector6::zeros();
            normal = Matrix6::zeros();
            for s in &samples {
                let (e, slopes) = model(&p, s);
                pull += slopes * (scale * (s[2] - e));
                normal += slopes * slopes.transpose() * scale;
            }
            pull[2] -= steep * p[2];
            normal[(2, 2)] += steep;
            let mut taken = None;
            for _ in 0..8 {
                let mut damped = normal;
                (0..6).for_each(|k| damped[(k, k)] *= 1.0 + damping);
                let step = damped.try_inverse()? * pull;
                let next = p + step;
                let next_cost = cost_of(&next);
                if next_cost <= cost {
                    (p, cost, taken) = (next, next_cost, Some(step));
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if taken.is_none_or(|step| step[3].abs() < SETTLED) {
                break;
            }
        }
        let left =
            samples.iter().map(|s| (s[2] - model(&p, s).0).powi(2)).sum::<f64>() / samples.len() as f64;
        let amplitude = p[1].abs();
        // What is left over noise and rounding, where the model is right.
        let misfit = (left - noise * noise).max(0.0).sqrt();
        let share = (left * scale).max(1.0) * normal.try_inverse()?[(3, 3)];
        let (px, sure) = (p[3].exp(), share.max(0.0).sqrt());
        let is_told = px.is_finite()
            && px > LEAST_PX
            && sure < LEAST_SURE
            && misfit < (MOST_LEFT.0 * amplitude).max(MOST_LEFT.1)
            && p[4].abs() < 3.0;
        is_told.then_some(px)
    }

    /// Averages of pixels about the side, in rows beside which background shows, and how many rows are one.
    fn samples(&self, top: f64) -> Option<(Vec<Sample>, usize)> {
        let Self { plane, line, inwards, half, noise, about_px } = *self;
        let first = top + BELOW_TOP.0 + BELOW_TOP.1 * about_px;
        let first = first.max(0.0) as usize;
        let rows = ((LEAN_PX / line[1].abs().max(1e-9)) as usize).clamp(1, AVERAGED);
        let groups = plane.height.saturating_sub(first) / rows;
        let reach = REACH.0 * about_px + REACH.1;
        let (out, into) = (reach.ceil() as isize, reach.min(OF_HALF * half).floor() as isize);
        let middle = first as f64 + 0.5 * (groups * rows) as f64;
        let mut samples = Vec::new();
        let mut taken = 0;
        for group in 0..groups {
            let top = first + group * rows;
            let y = top as f64 + 0.5 * (rows - 1) as f64;
            let column = line[0] + line[1] * y;
            let nearest = column.round();
            let at = |k: isize| -> Option<f64> {
                let x = nearest as isize + if inwards > 0.0 { k } else { -k };
                (0..plane.width as isize).contains(&x).then(|| {
                    let sum: f64 = (top..top + rows).map(|y| f64::from(plane.at(x as usize, y))).sum();
                    sum / rows as f64
                })
            };
            let Some(levels) = (-out..=into).map(at).collect::<Option<Vec<f64>>>() else { continue };
            let n = levels.len();
            let step = (levels[n - 2..].iter().sum::<f64>() / 2.0).abs();
            let beside = levels[..2].iter().sum::<f64>() / 2.0;
            if beside.abs() > (BACKGROUND.0 * noise / (2.0 * rows as f64).sqrt()).max(BACKGROUND.1 * step) {
                continue;
            }
            taken += 1;
            samples.extend(
                (-out..=into)
                    .zip(levels)
                    .map(|(k, level)| [k as f64 - inwards * (column - nearest), y - middle, level]),
            );
        }
        (taken >= LEAST_AVERAGES).then_some((samples, rows))
    }
}

/// How much the light changes from outside to inside, levels; `None` where it does not.
fn step(samples: &[Sample], about_px: f64) -> Option<f64> {
    let mean = |keep: &dyn Fn(f64) -> bool| {
        let (sum, n) =
            samples.iter().filter(|s| keep(s[0])).fold((0.0, 0.0), |(a, n), s| (a + s[2], n + 1.0));
        (n > 0.0).then(|| sum / n)
    };
    let step = mean(&|t| t > 1.5 * about_px)? - mean(&|t| t < -2.0 * about_px)?;
    (step.abs() > 1e-6).then_some(step)
}

/// The light at a place, and its derivatives after c, A, k, ln σ, x₀ and m.
fn model(p: &Vector6<f64>, [x, y, _]: &Sample) -> (f64, Vector6<f64>) {
    let (sigma, k) = (p[3].exp(), p[2]);
    let t = x - p[4] - p[5] * y;
    let amplitude = (k * t + 0.5 * k * k * sigma * sigma).min(20.0).exp();
    let (integral, density) = normal(t / sigma + k * sigma);
    let shape = amplitude * integral;
    let slope = p[1] * amplitude * density;
    let after_t = p[1] * k * shape + slope / sigma;
    let after_k = p[1] * shape * (t + k * sigma * sigma) + slope * sigma;
    let after_log = p[1] * shape * k * k * sigma * sigma + slope * (k * sigma - t / sigma);
    (p[0] + p[1] * shape, Vector6::new(1.0, shape, after_k, after_log, -after_t, -after_t * y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silhouette::plane::PER_LEVEL;
    use crate::silhouette::rect::Rect;

    const SIZE: [usize; 2] = [240, 180];

    fn pedestal(lean: f64) -> Pedestal {
        Pedestal {
            top: [20.0, 0.0],
            left: [70.0, lean],
            right: [170.0, lean],
            top_seen: true,
            slope_seen: true,
            level: 0.0,
            level_slope: 0.0,
            blur: 1.0,
        }
    }

    /// A pedestal whose light at some depth below its limb is given, blurred by σ, with noise.
    fn picture(pedestal: &Pedestal, sigma: f64, noise: f64, light: impl Fn(f64) -> f64) -> Plane {
        let [width, height] = SIZE;
        let mut state = 7u64;
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let [left, right] = pedestal.sides_at(y as f64);
            for x in 0..width {
                let parts = 60;
                let sum: f64 = (0..parts)
                    .map(|k| {
                        let away = 8.0 * sigma * ((f64::from(k) + 0.5) / f64::from(parts) - 0.5);
                        let at = x as f64 + away;
                        let depth = (at - left).min(right - at);
                        let weight =
                            (-0.5 * (away / sigma).powi(2)).exp() * 8.0 / f64::from(parts) * 0.398_942;
                        if depth > 0.0 { weight * light(depth) } else { 0.0 }
                    })
                    .sum();
                // Twelve even numbers add up to nearly a normal one.
                let normal: f64 = (0..12)
                    .map(|_| {
                        state = state
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        (state >> 11) as f64 / (1u64 << 53) as f64
                    })
                    .sum::<f64>()
                    - 6.0;
                values.push((f64::from(PER_LEVEL) * (sum + noise * normal)).round() as i16);
            }
        }
        let rect = Rect { x0: 0, y0: 0, x1: width, y1: height };
        Plane { rect, width, height, values }
    }

    fn told(pedestal: &Pedestal, sigma: f64, noise: f64, light: impl Fn(f64) -> f64) -> Option<f64> {
        lens_blur_px(&picture(pedestal, sigma, noise, light), pedestal, noise, 1.0)
    }

    #[test]
    fn a_matt_pedestal_shows_the_blur_to_a_few_per_cent_bright_or_dark_and_upright_or_not() {
        for lean in [0.0, 0.004, -0.012] {
            for sigma in [0.6, 0.85, 1.4, 2.2] {
                for level in [150.0, -90.0, 20.0] {
                    let px = told(&pedestal(lean), sigma, 1.5, |_| level).unwrap();
                    // A step of twenty levels is thirteen times the noise.
                    let within = if level > 0.0 && level < 50.0 { 0.08 } else { 0.04 };
                    assert!((px / sigma - 1.0).abs() < within, "{lean} {sigma} {level}: {px}");
                }
            }
        }
    }

    #[test]
    fn a_side_that_is_hardly_seen_still_shows_it_and_one_that_is_not_says_nothing() {
        let px = told(&pedestal(0.0), 0.85, 1.0, |_| 3.0).unwrap();
        assert!((px / 0.85 - 1.0).abs() < 0.15, "{px}");
        assert_eq!(told(&pedestal(0.0), 0.85, 1.0, |_| 0.0), None);
    }

    #[test]
    fn light_that_changes_below_the_limb_is_no_blur() {
        // Lit from the side: brightest at the limb, or by the root of the depth, as a round body's is.
        let falling = |depth: f64| 40.0 + 60.0 * (-depth / 8.0).exp();
        let rising = |depth: f64| 60.0 + 12.0 * depth.min(50.0).sqrt();
        for px in [told(&pedestal(0.0), 0.9, 1.0, falling), told(&pedestal(0.0), 0.9, 1.0, rising)] {
            assert!((px.unwrap() / 0.9 - 1.0).abs() < 0.12, "{px:?}");
        }
    }

    #[test]
    fn what_hangs_beside_the_pedestal_is_left_out() {
        let shape = pedestal(0.0);
        let mut seen = picture(&shape, 0.85, 1.0, |_| 80.0);
        // A grain beside the left side in the upper half.
        for y in 0..90 {
            for x in 40..66 {
                seen.values[y * SIZE[0] + x] = (90.0 * PER_LEVEL) as i16;
            }
        }
        let px = lens_blur_px(&seen, &shape, 1.0, 1.0).unwrap();
        assert!((px / 0.85 - 1.0).abs() < 0.05, "{px}");
    }
}
