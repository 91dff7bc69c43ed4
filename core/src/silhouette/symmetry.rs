//! Symmetry of blurred edges: which tone curve the grey values are coded by.
//!
//! A lens spreads light alike to both sides of an edge. Where grey values are proportional to light, an edge's profile is as
//! wide above its half-way level as below it, and its tails are a normal distribution's; coded by sRGB's curve, the brighter
//! side is about a tenth wider and the darker side's tail shorter. Only edges with an even level on both sides count: where a
//! grain turns away from the lamp its level changes towards the outline, and that is no blur.

use super::tone::{Light, ToneCurve};
use super::{Settings, Silhouette};

/// Samples of a profile for each standard deviation of the blur.
const PER_SIGMA: usize = 4;
/// A profile reaches so many standard deviations to either side; the part of it that is summed up does not.
const REACH: usize = 8;
const SUMMED: usize = 4;
/// Positions of a profile, and of the part that is summed up.
const LENGTH: usize = 2 * REACH * PER_SIGMA + 1;
const BINS: usize = 2 * SUMMED * PER_SIGMA + 1;
/// Standard deviations away from the outline at which a level is read: from this many on.
const CLEAR: f64 = 3.0;
/// Points of an outline that are looked at, about.
const POINTS: usize = 800;
/// Rounds in which the blur is measured on edges that the round before has chosen.
const ROUNDS: usize = 2;
/// The sharpest edges are one in so many, and those up to this many times as soft count.
const SHARPEST: usize = 5;
const SOFTEST: f64 = 1.35;
/// The least blur looked for, pixels.
const LEAST_BLUR: f64 = 0.6;
/// Least contrast, grey levels.
const LEAST_CONTRAST: f32 = 30.0;
/// A level is even when it changes by less than this share of the contrast over the pixels in which it is read …
const EVEN: f32 = 0.03;
/// … and scatters by less than this, in standard deviations of the noise and at least in grey levels.
const SCATTER: (f32, f32) = (2.5, 3.5);
/// With fewer edges than this nothing is said.
pub(super) const LEAST_EDGES: f64 = 60.0;
/// Edges look the same way whose normals have this scalar product.
const ALIKE: f64 = 0.7;
/// A normal distribution's quartiles are this many standard deviations apart.
const QUARTILES: f64 = 1.349;
/// The share of the step at which widths on both sides are compared.
const TAIL: f64 = 0.1;
/// Where the flank ends that begins half-way, and the tail, of a profile's darker half, shares of the step.
const DARKER: [f64; 2] = [0.25, 0.05];
/// The tail over the flank between these shares, of an edge at a bright grain and at a dark one: (1.645 − 0.674) / 0.674 = 1.44
/// for a normal distribution, from which a pixel's width takes a little, as measured on pictures whose curve is known.
const TAIL_OF_FLANK: [f64; 2] = [1.46, 1.425];
/// The sum of both deviations from which on the grey values are coded, about a bright grain and about a dark one. Half-way
/// between what linear and coded pictures show, of discs and of grains in every kind of light.
const CODED: [f64; 2] = [0.075, 0.083];

/// Of a blur with a tail as short as this, out of focus or moved, only the two sides tell: an even blur that is coded has a brighter side
/// wider than its darker one by half and more.
const NOT_NORMAL: f64 = -0.22;
const SKEWED: f64 = 0.2;
/// No lens makes edges as sharp as this, pixels: such a picture was drawn, and not coded.
const DRAWN_PX: f64 = 0.53;

/// Summed profiles of even edges, 0 in the background and 1 in the grain.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeSymmetry {
    sums: [f64; BINS],
    /// Sum of their blurs, pixels.
    blur_px: f64,
    edges: f64,
    /// Whether the grain is the brighter side.
    is_bright: bool,
}

impl EdgeSymmetry {
    /// Of no edge yet.
    pub(super) fn none(is_bright: bool) -> Self {
        Self { sums: [0.0; BINS], blur_px: 0.0, edges: 0.0, is_bright }
    }

    /// With the edges of another view.
    pub fn add(&mut self, other: &Self) {
        self.sums.iter_mut().zip(&other.sums).for_each(|(s, m)| *s += m);
        self.blur_px += other.blur_px;
        self.edges += other.edges;
    }

    fn take(&mut self, edge: &Profile) {
        self.sums.iter_mut().zip(&edge.shares).for_each(|(s, p)| *s += p);
        self.blur_px += edge.blur_px;
        self.edges += 1.0;
    }

    /// Edges looked at.
    pub fn edges(&self) -> f64 {
        self.edges
    }

    /// How far the mean profile is from that of an edge whose light a lens has spread: the skew (logarithm of the background's
    /// over the grain's width), and the shape of the darker half's tail (logarithm of its length over the flank's, over that of
    /// a lens and a pixel). `None` with too few edges.
    pub fn misfit(&self) -> Option<[f64; 2]> {
        if self.edges < LEAST_EDGES {
            return None;
        }
        let at = |share: f64| crossing(&self.sums, share * self.edges);
        let (outside, inside) = (at(TAIL)?, at(1.0 - TAIL)?);
        let [flank, tail] = DARKER.map(|share| at(if self.is_bright { share } else { 1.0 - share }));
        let shape = (tail? - flank?) / flank?;
        (outside < 0.0 && inside > 0.0 && shape > 0.0)
            .then(|| [(-outside / inside).ln(), (shape / TAIL_OF_FLANK[usize::from(!self.is_bright)]).ln()])
    }

    /// The curve that the edges show; `None` where they say nothing.
    pub fn curve(&self) -> Option<ToneCurve> {
        let [skew, shape] = self.misfit()?;
        if self.blur_px < DRAWN_PX * self.edges {
            return Some(ToneCurve::Linear);
        }
        let brighter = if self.is_bright { -skew } else { skew };
        if shape < NOT_NORMAL {
            return Some(if brighter > SKEWED { ToneCurve::Srgb } else { ToneCurve::Linear });
        }
        let limit = CODED[usize::from(!self.is_bright)];
        Some(if brighter - shape > limit { ToneCurve::Srgb } else { ToneCurve::Linear })
    }
}

/// Where, in bins from the middle towards the grain, a rising profile reaches a level.
fn crossing(sums: &[f64; BINS], level: f64) -> Option<f64> {
    let middle = SUMMED * PER_SIGMA;
    let at = |k: usize| k as f64 - middle as f64;
    if level < sums[middle] {
        let k = (1..=middle).rev().find(|&k| sums[k - 1] < level && sums[k] >= level)?;
        Some(at(k - 1) + (level - sums[k - 1]) / (sums[k] - sums[k - 1]))
    } else {
        let k = (middle..BINS - 1).find(|&k| sums[k] < level && sums[k + 1] >= level)?;
        Some(at(k) + (level - sums[k]) / (sums[k + 1] - sums[k]))
    }
}

/// Grey values about an outline.
pub(super) struct Surroundings {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[row, column]`, grey values of the file, 0 … 255.
    pub values: Vec<f32>,
    /// Standard deviation of their noise.
    pub noise: f64,
    /// Standard deviation of the edges' blur, pixels.
    pub blur_px: f64,
    /// Whether the grain is brighter than the background.
    pub is_bright: bool,
}

/// A place on an edge and the direction into the grain, a unit vector.
pub(super) struct EdgePoint {
    /// Column and row.
    pub at: [f64; 2],
    /// Columns and rows.
    pub inwards: [f64; 2],
}

impl Surroundings {
    /// The profiles across these places.
    pub(super) fn symmetry(&self, points: &[EdgePoint]) -> (EdgeSymmetry, Option<f64>) {
        let points: Vec<&EdgePoint> = points.iter().step_by(points.len().div_ceil(POINTS).max(1)).collect();
        // Where the grain's level falls off towards its limb an edge seems softer than it is: the sharpest ones are edges.
        let mut blur = self.blur_px.max(LEAST_BLUR);
        let mut out = EdgeSymmetry::none(self.is_bright);
        let mut sharpest_px = None;
        for _ in 0..ROUNDS {
            let edges: Vec<Profile> = points.iter().filter_map(|point| self.profile(point, blur)).collect();
            let mut widths: Vec<f64> = edges.iter().map(|e| e.blur_px).collect();
            widths.sort_by(f64::total_cmp);
            let Some(sharpest) = widths.get(widths.len() / SHARPEST) else { break };
            blur = sharpest.max(LEAST_BLUR);
            sharpest_px = (widths.len() as f64 >= LEAST_EDGES).then_some(*sharpest);
            out = EdgeSymmetry::none(self.is_bright);
            for edge in edges.iter().filter(|e| e.blur_px <= SOFTEST * sharpest) {
                out.take(edge);
            }
        }
        (out, sharpest_px)
    }

    /// The mean profile from background to grain in light, over all places, whatever their grain is like further inside:
    /// where it reaches a share, pixels inwards of half-way.
    pub(super) fn mean_profile(&self, points: &[EdgePoint], curve: ToneCurve, blur_px: f64) -> MeanProfile {
        let light = curve.light();
        let pitch = blur_px.max(LEAST_BLUR) / PER_SIGMA as f64;
        let mut mean = MeanProfile { pitch, sums: [0.0; LENGTH], count: 0.0 };
        for point in points.iter().step_by(points.len().div_ceil(POINTS).max(1)) {
            if let Some(shares) = self.shares(point, pitch, &light) {
                mean.add(&shares, 1.0);
            }
        }
        mean
    }

    /// The mean profiles about places along an outline, over the points within some `radius` of each, pixels, that look the same way; one
    /// for every so many points, with its place.
    pub(super) fn mean_profiles(
        &self,
        points: &[EdgePoint],
        curve: ToneCurve,
        (blur_px, radius, every): (f64, f64, usize),
    ) -> Vec<([f64; 2], MeanProfile)> {
        let light = curve.light();
        let pitch = blur_px.max(LEAST_BLUR) / PER_SIGMA as f64;
        let shown = |point| self.shares(point, pitch, &light).map(|shares| (point, shares));
        let profiles: Vec<(&EdgePoint, [f64; LENGTH])> = points.iter().filter_map(shown).collect();
        (profiles.iter().step_by(every))
            .map(|(place, _)| {
                let mut mean = MeanProfile { pitch, sums: [0.0; LENGTH], count: 0.0 };
                for (point, shares) in &profiles {
                    let away = [0, 1].map(|k| point.at[k] - place.at[k]);
                    let squares = away[0].powi(2) + away[1].powi(2);
                    let alike = place.inwards[0] * point.inwards[0] + place.inwards[1] * point.inwards[1];
                    if squares < (3.0 * radius).powi(2) && alike > ALIKE {
                        mean.add(shares, (-0.5 * squares / (radius * radius)).exp());
                    }
                }
                (place.at, mean)
            })
            .collect()
    }

    /// The profile across a place in shares of the way from background to grain, whatever its grain is like further inside.
    fn shares(&self, point: &EdgePoint, pitch: f64, light: &Light) -> Option<[f64; LENGTH]> {
        let values = self.samples(point, pitch, &|v| light.at(v))?;
        let clear = (CLEAR * PER_SIGMA as f64) as usize;
        let middle = REACH * PER_SIGMA;
        let (b, b_scatter, _) = even(&values[..=middle - clear]);
        let (g, ..) = even(&values[middle + clear..]);
        let contrast = g - b;
        let is_seen = contrast.abs() >= LEAST_CONTRAST && b_scatter <= 0.1 * contrast.abs();
        is_seen.then(|| values.map(|v| f64::from((v - b) / contrast)))
    }

    /// Values across a place from outside to inside; `None` where they are not all there.
    fn samples(&self, point: &EdgePoint, pitch: f64, of: &dyn Fn(f32) -> f32) -> Option<[f32; LENGTH]> {
        let place = |k: usize| {
            let z = (k as f64 - (REACH * PER_SIGMA) as f64) * pitch;
            [0, 1].map(|axis| point.at[axis] + z * point.inwards[axis])
        };
        let holds = |[x, y]: [f64; 2]| {
            x >= 0.0 && y >= 0.0 && x + 1.0 < self.width as f64 && y + 1.0 < self.height as f64
        };
        if !holds(place(0)) || !holds(place(LENGTH - 1)) {
            return None;
        }
        Some(std::array::from_fn(|k| {
            let [x, y] = place(k);
            let (i, j) = (x as usize, y as usize);
            let (fx, fy) = ((x - i as f64) as f32, (y - j as f64) as f32);
            let v = &self.values[j * self.width + i..];
            let top = of(v[0]) + fx * (of(v[1]) - of(v[0]));
            let (a, b) = (of(v[self.width]), of(v[self.width + 1]));
            top + fy * (a + fx * (b - a) - top)
        }))
    }

    /// The profile across a place, where both of its sides are even.
    fn profile(&self, point: &EdgePoint, blur_px: f64) -> Option<Profile> {
        let pitch = blur_px / PER_SIGMA as f64;
        let coded = self.samples(point, pitch, &|v| v)?;
        let clear = (CLEAR * PER_SIGMA as f64) as usize;
        let middle = REACH * PER_SIGMA;
        let (outside, inside) = (0..middle - clear + 1, middle + clear..LENGTH);
        let (b, b_scatter, b_slope) = even(&coded[outside.clone()]);
        let (g, g_scatter, g_slope) = even(&coded[inside.clone()]);
        let contrast = (g - b).abs();
        let scatter = (SCATTER.0 * self.noise as f32).max(SCATTER.1);
        // What noise alone makes of a line through so many pixels.
        let pixels = (outside.len() as f64 * pitch).max(1.0);
        let rise = (2.0 * self.noise * (12.0 / pixels).sqrt()) as f32;
        if contrast < LEAST_CONTRAST
            || b_scatter.max(g_scatter) > scatter
            || b_slope.abs().max(g_slope.abs()) > rise.max(EVEN * contrast)
        {
            return None;
        }
        let share = coded.map(|v| f64::from((v - b) / (g - b)));
        // The half-way crossing nearest to the middle.
        let crossings = (middle - clear..middle + clear).filter(|&k| share[k] < 0.5 && share[k + 1] >= 0.5);
        let k = crossings.min_by_key(|k| k.abs_diff(middle))?;
        let part = (0.5 - share[k]) / (share[k + 1] - share[k]);
        let mut shares = [0.0; BINS];
        for (bin, value) in shares.iter_mut().enumerate() {
            let from = (k + bin).checked_sub(SUMMED * PER_SIGMA).filter(|from| from + 1 < LENGTH)?;
            *value = share[from] + part * (share[from + 1] - share[from]);
        }
        let between = crossing(&shares, 0.75)? - crossing(&shares, 0.25)?;
        Some(Profile { shares, blur_px: pitch * between / QUARTILES })
    }
}

/// An edge's profile.
struct Profile {
    shares: [f64; BINS],
    /// Standard deviation of the blur that it seems to have, pixels.
    blur_px: f64,
}

/// The mean of many profiles.
pub(super) struct MeanProfile {
    pitch: f64,
    sums: [f64; LENGTH],
    count: f64,
}

impl MeanProfile {
    fn add(&mut self, shares: &[f64; LENGTH], weight: f64) {
        self.sums.iter_mut().zip(shares).for_each(|(s, v)| *s += weight * v);
        self.count += weight;
    }

    /// Where it reaches a share of the way from background to grain, pixels inwards; `None` where it is of fewer edges than that.
    pub(super) fn reaches(&self, share: f64, least_edges: f64) -> Option<f64> {
        if self.count < least_edges {
            return None;
        }
        let level = share * self.count;
        // From half-way outwards for the outer half, inwards for the other.
        let middle = REACH * PER_SIGMA;
        let k = if level < self.sums[middle] {
            (1..=middle).rev().find(|&k| self.sums[k - 1] < level && self.sums[k] >= level)? - 1
        } else {
            (middle..LENGTH - 1).find(|&k| self.sums[k] < level && self.sums[k + 1] >= level)?
        };
        let part = (level - self.sums[k]) / (self.sums[k + 1] - self.sums[k]);
        Some((k as f64 + part - middle as f64) * self.pitch)
    }
}

/// Mean, standard deviation about a straight line, and how far that line rises over the whole.
fn even(values: &[f32]) -> (f32, f32, f32) {
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let middle = 0.5 * (n - 1.0);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (k, v) in values.iter().enumerate() {
        let (x, y) = (k as f32 - middle, v - mean);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let slope = xy / xx;
    (mean, ((yy - slope * xy).max(0.0) / n).sqrt(), slope * n)
}

/// Places along a silhouette's outline, above `clear_row` of the picture, shifted to a rectangle's first column and row.
pub(super) fn along(silhouette: &Silhouette, clear_row: f64, first: [usize; 2]) -> Vec<EdgePoint> {
    let distance = |p: [f64; 2]| silhouette.signed_distance_px(p);
    (silhouette.segments().into_iter())
        .filter_map(|[a, b]| {
            let at = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            let slope = [
                distance([at[0] - 2.0, at[1]]) - distance([at[0] + 2.0, at[1]]),
                distance([at[0], at[1] - 2.0]) - distance([at[0], at[1] + 2.0]),
            ];
            let length = slope[0].hypot(slope[1]);
            (at[1] < clear_row && length > 1.0).then(|| EdgePoint {
                at: [at[0] - first[0] as f64, at[1] - first[1] as f64],
                inwards: slope.map(|s| s / length),
            })
        })
        .collect()
}

impl Settings {
    /// The curve that is set, or that the file states; `None` where neither says anything.
    pub(super) fn curve_of(&self, stated: Option<ToneCurve>) -> Option<ToneCurve> {
        match self.tone_curve {
            ToneCurve::Auto => stated.filter(|c| *c != ToneCurve::Auto),
            set => Some(set),
        }
    }
}
