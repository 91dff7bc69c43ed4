//! The outline by the shape of its blurred edge.
//!
//! Half-way between two levels asks what the grain's level is at the edge itself. A bright grain's facets differ by several times, and
//! near a limb its light falls within a few pixels: where blur is as wide as that, no level that is read inside is the edge's. The shape
//! of the blurred edge needs none. Along the outline's normal, with the depth t, the grain's light near the edge is taken for an
//! exponential, and an edge at t₀ blurred by σ shows
//!
//! ```text
//! E(t) = e^(a + k(t − t₀) + k²σ²/2) · Φ((t − t₀)/σ + kσ)
//! ```
//!
//! a, k and t₀ are fitted to the profile, texture taken for noise in proportion to the light; σ is the lens's, the same everywhere.

use super::distance;
use super::outline::{Field, SMOOTHED_PX};
use super::plane::{PER_LEVEL, Plane};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// The profile reaches so many standard deviations of the blur out and in, and so many pixels more.
const REACH: (f64, f64) = (3.0, 1.0);
/// Texture, and what no lens's blur is normal by, as shares of the light: of a dark grain, and of a bright one, whose facets differ more,
/// so that its edge shows best in the blur's tail.
const UNEVENNESS: [[f64; 2]; 2] = [[0.05, 0.05], [0.1, 0.02]];
/// Usual change of the light towards the inside, per pixel and per standard deviation of the blur, whichever is less.
const STEEP: [f64; 2] = [0.15, 0.3];
/// An edge is this near the outline as placed, standard deviations of the blur (one standard deviation).
const NEAR: f64 = 1.5;
/// What a pixel's own square, which has no tail, moves the edge by under a blur of one pixel; it falls fast with the blur.
const KERNEL_SHIFT_PX: f64 = 0.04;
/// The level inside is read this many standard deviations of the blur below the edge, from so many readings at least.
const INSIDE: f64 = 2.0;
const LEAST_INSIDE: usize = 3;
/// Light that rises outwards by so many standard deviations of the noise is something else's.
const RISES: f64 = 3.0;
/// A profile that ends fewer standard deviations outside than this is less sure, by so many times the variance.
const LEAST_OUTSIDE: f64 = 2.0;
const CUT_OFF: f64 = 25.0;
/// What the light inside is off by at least, as a share, and half-way by that is read from it, pixels.
const LEAST_UNEVEN: f64 = 0.1;
const LEAST_SD_PX: f64 = 0.03;
/// Noise of a picture that shows none, levels.
const LEAST_NOISE: f64 = 1e-3;
/// A grain's edge is no sharper than this share of what it shows itself: the pedestal, whose sides show the lens's blur, may stand elsewhere.
const LEAST_OF_OWN: f64 = 0.7;
/// Steps of the fit, and what ends them, pixels.
const STEPS: usize = 12;
const SETTLED_PX: f64 = 5e-3;
/// Of so many places along the outline one is asked for the blur, or fewer of a long outline, as so many in all say it.
const EVERY: usize = 6;
const ASKED: usize = 160;
/// Shares of the blur as the placed outline shows it, which a wavering outline widens, among which the lens's is sought.
const BLURS: [f64; 12] = [0.26, 0.34, 0.42, 0.5, 0.58, 0.66, 0.74, 0.82, 0.9, 0.98, 1.06, 1.14];
/// The lens's blur is this quantile of the places': few edges look sharper than the lens makes them.
const QUANTILE: f64 = 0.4;
/// Light is read between pixels as a normal distribution's mean of this standard deviation, pixels, of which the four pixels each way
/// leave as much; shares of the way between two pixels that are told apart.
const SPREAD_PX: f64 = 0.65;
const BETWEEN_PX: f64 = 0.64;
const SHARES: usize = 64;
/// Places are this far apart on average, pixels.
const SPACING: f64 = 0.8;
/// Of a softer picture, pixels or a share of the grain's radius, half-way is all there is: its edges are no longer straight over their
/// own width.
const MOST_BLUR_PX: f64 = 4.0;
const MOST_BLUR_SHARE: f64 = 0.06;
/// What the placed outline misses of the blur at most, pixels.
const SHARP_PX: f64 = 0.5;
/// Least blur, pixels: a pixel's own width.
const LEAST_BLUR: f64 = 0.35;

/// What is seen, its noise, and where nothing else stands before or beside the grain.
#[derive(Clone, Copy)]
struct Seen<'a> {
    plane: &'a Plane,
    weights: &'a Weights,
    noise: f64,
    /// Texture, and what no lens's blur is normal by, as shares of the light.
    unevenness: [f64; 2],
    open: &'a (dyn Fn(f64, f64) -> bool + Sync),
}

/// A place on the outline.
struct Place {
    at: [f64; 2],
    /// Unit vector into the grain.
    inwards: [f64; 2],
}

/// An edge that was fitted.
#[derive(Clone, Copy)]
struct Edge {
    /// How deep below the place it lies, pixels.
    depth: f64,
    variance: f64,
    cost: f64,
}

/// The outline placed again, and the lens's blur, pixels; `None` where the picture is too soft. `blur_px` is as the placed outline
/// shows it in the smoothed values, `noise` the light's in levels, `lens_px` what the pedestal's sides show, and `open` tells whether the grain is seen unmixed at a place.
pub(super) fn fitted(
    plane: &Plane,
    placed: &Field,
    (blur_px, noise, is_bright): (f64, f64, bool),
    lens_px: Option<f64>,
    open: impl Fn(f64, f64) -> bool + Sync,
) -> Option<(Field, f64)> {
    let weights = Weights::new();
    let unevenness = UNEVENNESS[usize::from(is_bright)];
    let seen = Seen { plane, weights: &weights, noise, unevenness, open: &open };
    let smooth = softened(placed, blur_px);
    let distance = distance::signed(&smooth);
    let (w, h) = (placed.width, placed.height);
    let places = places(&distance, w, h);
    let places: Vec<Place> = places.into_iter().filter(|p| open(p.at[0], p.at[1])).collect();
    // Of a sharp edge the placed outline shows too little: few pixels lie on it.
    let shown = (blur_px.powi(2) - SMOOTHED_PX.powi(2)).max(0.0).sqrt().hypot(SHARP_PX);
    let mut blurs: Vec<f64> = (places.par_iter().step_by(EVERY.max(places.len() / ASKED)))
        .map(|place| {
            let cost = |share: &f64| edge(&seen, place, (share * shown).max(LEAST_BLUR), shown).cost;
            least(&BLURS.iter().map(cost).collect::<Vec<_>>())
        })
        .collect();
    let rank = (QUANTILE * blurs.len() as f64) as usize;
    let sigma =
        if blurs.is_empty() { shown } else { shown * *blurs.select_nth_unstable_by(rank, f64::total_cmp).1 };
    let of_lens = lens_px.map_or(sigma, |px| px.max(LEAST_OF_OWN * sigma));
    let sigma = sigma.min(of_lens).max(LEAST_BLUR);
    let area = placed.values.iter().filter(|v| **v < 0.0).count() as f64;
    if sigma > MOST_BLUR_PX.min(MOST_BLUR_SHARE * (area / std::f64::consts::PI).sqrt()) {
        return None;
    }
    let edges: Vec<Edge> = places.par_iter().map(|p| edge(&seen, p, sigma, sigma)).collect();
    // Spread from the places to the pixels about them, the surer the more.
    let reach = (2.0 * sigma).ceil() as isize + 4;
    let spread = sigma.max(1.0);
    let mut sums = vec![[0f32; 3]; w * h];
    for (place, edge) in places.iter().zip(&edges) {
        let [x, y] = place.at.map(|v| v.round() as isize);
        for j in (y - reach).max(0)..=(y + reach).min(h as isize - 1) {
            for i in (x - reach).max(0)..=(x + reach).min(w as isize - 1) {
                let d2 = (i as f64 - place.at[0]).powi(2) + (j as f64 - place.at[1]).powi(2);
                let near = (-0.5 * d2 / (spread * spread)).exp();
                let weight = (near + 1e-6) / edge.variance;
                let sum = &mut sums[j as usize * w + i as usize];
                sum[0] += (weight * edge.depth) as f32;
                sum[1] += weight as f32;
                sum[2] += near as f32;
            }
        }
    }
    // Where no place is near, at the pedestal, the outline stays as it was placed. Half of what the places of a straight outline
    // make at its end counts as all.
    let all = (0.25 * spread * std::f64::consts::TAU.sqrt() / SPACING) as f32;
    let values = (distance.iter().zip(&sums).zip(&placed.values))
        .map(|((d, [sum, weight, near]), placed)| {
            if *weight <= 0.0 {
                return *placed;
            }
            let share = (near * (0.5 * (d / spread as f32).powi(2)).min(8.0).exp() / all).min(1.0);
            let fitted = (d + sum / weight).clamp(-1.0, 1.0);
            placed + share * (fitted - placed)
        })
        .collect();
    Some((Field { width: w, height: h, values }, sigma))
}

/// The field with its outline smoothed over about the blur.
fn softened(field: &Field, blur_px: f64) -> Field {
    let (w, h) = (field.width, field.height);
    let radius = blur_px.round().max(1.0) as usize;
    let mut values = field.values.clone();
    for _ in 0..2 {
        values = boxed(&boxed(&values, w, radius), h, radius);
    }
    Field { width: w, height: h, values }
}

/// Means over rows of so many pixels to either side, transposed.
fn boxed(values: &[f32], w: usize, radius: usize) -> Vec<f32> {
    let h = values.len() / w;
    let mut out = vec![0f32; values.len()];
    for (y, row) in values.chunks_exact(w).enumerate() {
        let at = |x: isize| row[x.clamp(0, w as isize - 1) as usize];
        let r = radius as isize;
        let mut sum: f32 = (-r..=r).map(at).sum();
        for x in 0..w {
            out[x * h + y] = sum / (2 * radius + 1) as f32;
            sum += at(x as isize + r + 1) - at(x as isize - r);
        }
    }
    out
}

fn places(distance: &[f32], w: usize, h: usize) -> Vec<Place> {
    let mut out = Vec::new();
    for y in 1..h.saturating_sub(2) {
        for x in 1..w.saturating_sub(2) {
            let k = y * w + x;
            let corners = [distance[k], distance[k + 1], distance[k + w + 1], distance[k + w]];
            if corners.iter().all(|c| (*c < 0.0) == (corners[0] < 0.0)) {
                continue;
            }
            for [a, b] in distance::segments(corners).into_iter().flatten() {
                let middle = [0, 1].map(|n| f64::from(f32::midpoint(a[n], b[n])));
                let at = [x as f64 + middle[0], y as f64 + middle[1]];
                let d = |i: isize, j: isize| f64::from(distance[k.wrapping_add_signed(j * w as isize + i)]);
                // Over the square about the four pixels.
                let gx = d(2, 0) + d(2, 1) - d(-1, 0) - d(-1, 1);
                let gy = d(0, 2) + d(1, 2) - d(0, -1) - d(1, -1);
                let size = gx.hypot(gy);
                if size > 0.0 {
                    out.push(Place { at, inwards: [-gx / size, -gy / size] });
                }
            }
        }
    }
    out
}

/// The share of the blur at which a place's fit costs least, by a parabola about the least.
fn least(costs: &[f64]) -> f64 {
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(costs.len() / 2);
    if best == 0 || best + 1 == costs.len() {
        return BLURS[best];
    }
    let [before, at, after] = [costs[best - 1], costs[best], costs[best + 1]];
    let bend = before - 2.0 * at + after;
    let part = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    BLURS[best] + part * (BLURS[1] - BLURS[0])
}

/// Fits the edge at a place; the profile reaches as far as a blur of `wide` does.
fn edge(seen: &Seen, place: &Place, lens_px: f64, wide: f64) -> Edge {
    let Seen { plane, weights, noise, unevenness: [texture, kernel], open } = *seen;
    let sigma = lens_px.hypot(BETWEEN_PX);
    let reach = (REACH.0 * wide.hypot(BETWEEN_PX) + REACH.1).ceil() as isize;
    let mut profile: Vec<[f64; 2]> = (-reach..=reach)
        .filter_map(|t| {
            let t = t as f64;
            let [x, y] = [0, 1].map(|n| place.at[n] + t * place.inwards[n]);
            if open(x, y) { weights.light(plane, x, y).map(|light| [t, light]) } else { None }
        })
        .collect();
    let inner = profile.iter().filter(|[t, _]| *t > sigma).map(|p| p[1]);
    let (count, sum) = inner.fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v));
    let start = if count > 0.0 { (sum / count).max(4.0 * noise) } else { 4.0 * noise };
    let noise = noise.max(LEAST_NOISE).hypot(kernel * start);
    // Beyond a notch's floor its other side begins.
    let middle = profile.iter().position(|[t, _]| *t >= 0.0).unwrap_or(0);
    let mut least = f64::INFINITY;
    let other_side = (0..middle).rev().find(|&k| {
        least = least.min(profile[k][1]);
        profile[k][1] > least + RISES * noise
    });
    profile.drain(..other_side.map_or(0, |k| k + 1));
    // By the light that is seen: a variance that followed the fit would draw it towards little light.
    let weights: Vec<f64> = (0..profile.len())
        .map(|i| {
            let at = |k: usize| profile[k.min(profile.len() - 1)][1];
            let seen = 0.25 * (at(i.saturating_sub(1)) + 2.0 * at(i) + at(i + 1));
            1.0 / (noise * noise + (texture * seen).powi(2))
        })
        .collect();
    let near = (NEAR * sigma).powi(-2);
    let steep = STEEP[0].min(STEEP[1] / sigma).powi(-2);
    let mut p = Vector3::new(0.0, start.max(1e-3).ln(), 0.0);
    let cost_of = |p: &Vector3<f64>| {
        let mut cost = near * p[0] * p[0] + steep * p[2] * p[2];
        for ([t, light], weight) in profile.iter().zip(&weights) {
            cost += weight * (light - model(p, *t, sigma).0).powi(2);
        }
        cost
    };
    let mut cost = cost_of(&p);
    let mut damping = 1e-2;
    let mut normal = Matrix3::identity();
    for _ in 0..STEPS {
        let mut pull = Vector3::new(-near * p[0], 0.0, -steep * p[2]);
        normal = Matrix3::from_diagonal(&Vector3::new(near, 1e-6, steep));
        for ([t, light], weight) in profile.iter().zip(&weights) {
            let (e, slopes) = model(&p, *t, sigma);
            pull += slopes * (weight * (light - e));
            normal += slopes * slopes.transpose() * *weight;
        }
        let mut moved = false;
        let mut step = Vector3::zeros();
        for _ in 0..6 {
            let mut damped = normal;
            (0..3).for_each(|k| damped[(k, k)] *= 1.0 + damping);
            let Some(found) = damped.try_inverse() else { break };
            step = found * pull;
            let next = p + step;
            let next_cost = cost_of(&next);
            if next_cost <= cost {
                (p, cost, moved) = (next, next_cost, true);
                damping = (damping * 0.2).max(1e-6);
                break;
            }
            damping *= 6.0;
        }
        if !moved || step[0].abs() < SETTLED_PX {
            break;
        }
    }
    let inverse = normal.try_inverse().map_or(1.0, |inverse| inverse[(0, 0)]).max(0.0);
    // A profile that does not reach the background is less sure.
    let outside = profile.first().map_or(0.0, |first| (p[0] - first[0]) / sigma);
    let cut_off = if outside < LEAST_OUTSIDE { CUT_OFF } else { 1.0 };
    let own = cut_off * inverse + (KERNEL_SHIFT_PX * sigma.powi(-12)).powi(2);
    let fitted = [p[0], own.recip()];
    let [depth, weight] = match halfway(&profile, &p, sigma) {
        Some([depth, sd]) => {
            let weight = sd.powi(-2);
            [(fitted[0] * fitted[1] + depth * weight) / (fitted[1] + weight), fitted[1] + weight]
        }
        None => fitted,
    };
    Edge { depth, variance: weight.recip(), cost }
}

/// Where the profile is half-way to the level inside, and how sure that is (standard deviation), pixels: surer than the fit where
/// the light inside is even and the same as at the edge, as it does not ask how a blur falls off.
fn halfway(profile: &[[f64; 2]], p: &Vector3<f64>, sigma: f64) -> Option<[f64; 2]> {
    let inside: Vec<f64> = profile.iter().filter(|[t, _]| *t > p[0] + INSIDE * sigma).map(|p| p[1]).collect();
    if inside.len() < LEAST_INSIDE {
        return None;
    }
    let n = inside.len() as f64;
    let level = inside.iter().sum::<f64>() / n;
    let spread = (inside.iter().map(|v| (v - level).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    if level <= 0.0 {
        return None;
    }
    let uneven = (spread / level).max((level / p[1].exp() - 1.0).abs()).max(LEAST_UNEVEN);
    // The crossing that is nearest to the fitted edge.
    let crossings = profile.windows(2).filter_map(|pair| {
        let [a, b] = [pair[0][1], pair[1][1]].map(|v| v - 0.5 * level);
        (a < 0.0 && b >= 0.0).then(|| pair[0][0] + a / (a - b))
    });
    let depth = crossings.min_by(|a, b| (a - p[0]).abs().total_cmp(&(b - p[0]).abs()))?;
    // Half of the level's error, over the slope of the edge.
    Some([depth, 0.5 * uneven * sigma * std::f64::consts::TAU.sqrt() + LEAST_SD_PX])
}

/// The light of an edge at a depth, and its derivatives after t₀, a and k.
fn model(p: &Vector3<f64>, t: f64, sigma: f64) -> (f64, Vector3<f64>) {
    let (depth, k) = (t - p[0], p[2]);
    let amplitude = (p[1] + k * depth + 0.5 * k * k * sigma * sigma).min(30.0).exp();
    let u = depth / sigma + k * sigma;
    let (integral, density) = normal(u);
    let e = amplitude * integral;
    let slope = amplitude * density;
    (e, Vector3::new(-(k * e + slope / sigma), e, e * (depth + k * sigma * sigma) + slope * sigma))
}

/// The normal distribution's integral (Abramowitz and Stegun 26.2.17, to 7.5e-8) and density.
pub(super) fn normal(u: f64) -> (f64, f64) {
    let density = (-0.5 * u * u).exp() * 0.398_942_280_401_432_7;
    let t = 1.0 / (1.0 + 0.231_641_9 * u.abs());
    let tail = density
        * t
        * (0.319_381_530
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    (if u < 0.0 { tail } else { 1.0 - tail }, density)
}

/// Weights of the four pixels along an axis about a place between the second and the third, by its share of the way.
struct Weights(Vec<[f64; 4]>);

impl Weights {
    fn new() -> Self {
        let of = |k: usize| {
            let share = k as f64 / SHARES as f64;
            let weights =
                [-1.0, 0.0, 1.0, 2.0].map(|x: f64| (-0.5 * ((x - share) / SPREAD_PX).powi(2)).exp());
            let sum: f64 = weights.iter().sum();
            weights.map(|w| w / sum)
        };
        Self((0..=SHARES).map(of).collect())
    }

    /// Light between pixels, a normal distribution's mean: straight lines between pixels would blur a place half-way between
    /// two and leave another as it is. `None` where the picture ends.
    fn light(&self, plane: &Plane, x: f64, y: f64) -> Option<f64> {
        if x < 1.0 || y < 1.0 {
            return None;
        }
        let (i, j) = (x as usize, y as usize);
        if i + 2 >= plane.width || j + 2 >= plane.height {
            return None;
        }
        let of = |share: f64| &self.0[(share * SHARES as f64).round() as usize];
        let (across, down) = (of(x - i as f64), of(y - j as f64));
        let mut sum = 0.0;
        for (row, w) in down.iter().enumerate() {
            let pixels = &plane.values[(j + row - 1) * plane.width + i - 1..][..4];
            let line: f64 = pixels.iter().zip(across).map(|(v, w)| w * f64::from(*v)).sum();
            sum += w * line;
        }
        Some(sum / f64::from(PER_LEVEL))
    }
}
