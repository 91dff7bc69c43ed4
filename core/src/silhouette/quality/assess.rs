//! Quality of one view by itself: blur, motion blur, clipping, contrast, their limits and remedies.
//!
//! [`super::neighbours`] compares a view with the views beside it.

use super::edge::{self, Crop, Edge};
use super::motion_blur::{self, MotionBlur};
use super::{Bound, Check, Verdict, ViewQuality};
use crate::silhouette::{Polarity, Segmentation, Side, Silhouette, Source};

/// A blur of this share of the grain's diameter is doubtful, of the other bad. Half-way levels put a blurred
/// outline of radius R about σ²/2R too far inside, and round corners off to a radius of σ: at 2.5 % the radius is
/// 0.13 % and the volume 0.4 % too small, at 5 % the volume is 1.5 % too small.
const BLUR_SHARE: [f64; 2] = [0.025, 0.05];
/// But no picture is blamed for less than this many pixels: lens, pixel and colour sampling do as much in focus, so that
/// of a grain of a few dozen pixels it is the magnification that is wanting, not the focus.
const BLUR_PX: [f64; 2] = [1.5, 3.0];
/// The softest direction may be softer than the sharpest by this many pixels; video cards and colour sampling do
/// as much without any motion.
const MOTION_PX: [f64; 2] = [1.5, 3.0];
/// And by this share of the sharpest direction's blur: a lens is not equally sharp in all directions.
const MOTION_OF_BLUR: [f64; 2] = [0.5, 1.0];
/// And by this share of the grain's diameter: below it the volume does not feel it, by the formula above.
const MOTION_SHARE: [f64; 2] = [0.0125, 0.025];
/// More full pixels than this on the lit side of the outline: the true level there is not known, and the outline
/// lies where the half of a lower level is.
const FULL_SHARE: f64 = 0.5;
/// Contrast over noise. Outlines are placed on means of about a dozen pixels a side: at 6 the outline of each
/// pixel wavers by a quarter of the blur; a threshold at 6 standard deviations needs as much to be clear.
const CONTRAST_OF_NOISE: [f64; 2] = [10.0, 6.0];

/// Figures of a view that are compared with those of the views beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Traits {
    /// Blur of the outline, pixels (standard deviation).
    pub blur_px: f64,
    /// Share of full pixels on the lit side of the outline.
    pub full_share: f64,
    /// Level of the background beside the outline, grey levels of the channel.
    pub background: f64,
    /// Mean distance of the grain from the background, grey levels.
    pub contrast: f64,
    /// Noise of single pixels beside the outline, grey levels.
    pub noise: f64,
    /// Area between each row's first and last column of the silhouette, square pixels.
    pub filled_px: f64,
    /// Least and greatest column of the outline, pixels.
    pub columns: [f64; 2],
    /// Its least row, pixels.
    pub top: f64,
    /// Rows that it spans, pixels.
    pub height: f64,
    /// A number of the pixels around the silhouette: the same only for the same pixels.
    pub pixels: u64,
}

impl Traits {
    /// Takes area, columns, top and height from an outline: again where it was cut otherwise.
    pub fn take_outline(&mut self, s: &Silhouette) {
        let extents = s.extents_px();
        let spans = || extents.iter().flatten();
        let first = extents.iter().position(Option::is_some).unwrap_or(0);
        let last = extents.iter().rposition(Option::is_some).unwrap_or(0);
        // The deepest pixel of the first row lies as far below the outline's top as its distance.
        let line = &s.distance_px[first * s.size[0]..(first + 1) * s.size[0]];
        let depth = f64::from(line.iter().copied().fold(0.0, f32::min));
        self.filled_px = spans().map(|[left, right]| right - left).sum();
        self.columns = [
            spans().map(|e| e[0]).fold(f64::INFINITY, f64::min),
            spans().map(|e| e[1]).fold(f64::NEG_INFINITY, f64::max),
        ];
        self.top = (s.origin[1] + first) as f64 + depth;
        self.height = (last + 1 - first) as f64;
    }
}

impl ViewQuality {
    /// States anew at which ends of the picture (as [`crate::silhouette::Report::touches_border`]) the grain is cut off: before a
    /// turntable only all views together show whether it is the pedestal that reaches the bottom.
    pub fn state_border(&mut self, touches: [bool; 4]) {
        let stated = border(touches);
        self.checks.iter_mut().filter(|c| c.name == stated.name).for_each(|c| *c = stated.clone());
        *self = Self::of(std::mem::take(&mut self.checks));
    }
}

/// Judges a picture by itself; also its figures for [`between`](super::between()). Reads only the pixels within a few
/// dozen of the outline.
pub fn assess(picture: &dyn Source, found: &Segmentation) -> (ViewQuality, Traits) {
    let crop = Crop::of(picture, found);
    let edge = edge::measure(&crop, found);
    let report = &found.report;
    let diameter_px = (4.0 * report.area_px / std::f64::consts::PI).sqrt().max(1.0);
    let mut checks = vec![focus(&edge, diameter_px)];
    checks.extend(motion_blur::measure(&crop, found, edge.contrast).map(|blur| motion(&blur, diameter_px)));
    checks.push(clipping(&edge, report.polarity));
    checks.push(border(report.touches_border));
    checks.push(contrast(report.contrast, report.noise));
    let mut traits = Traits {
        blur_px: edge.blur_px,
        full_share: edge.full_share,
        background: edge.background,
        contrast: report.contrast,
        noise: edge.noise,
        filled_px: 0.0,
        columns: [0.0; 2],
        top: 0.0,
        height: 0.0,
        pixels: fingerprint(&crop, found),
    };
    traits.take_outline(&found.silhouette);
    (ViewQuality::of(checks), traits)
}

fn focus(edge: &Edge, diameter_px: f64) -> Check {
    let limits = [0, 1].map(|k| BLUR_PX[k].max(BLUR_SHARE[k] * diameter_px));
    Check::at_most("focus", edge.blur_px, "px", limits).or(|| {
        format!(
            "the outline is soft over {:.1} % of the grain's {diameter_px:.0} px: focus the lens on the rotation axis, or \
             close the aperture",
            100.0 * edge.blur_px / diameter_px
        )
    })
}

fn motion(blur: &MotionBlur, diameter_px: f64) -> Check {
    let MotionBlur { softest_px, sharpest_px, softest_deg } = *blur;
    let limits =
        [0, 1].map(|k| MOTION_PX[k].max(MOTION_OF_BLUR[k] * sharpest_px).max(MOTION_SHARE[k] * diameter_px));
    Check::at_most("motion", softest_px - sharpest_px, "px", limits).or(|| {
        format!(
            "the outline is softer along about {softest_deg:.0}° from the horizontal ({softest_px:.1} px) than across it \
             ({sharpest_px:.1} px), something moved during the exposure: let the stage settle longer, expose shorter, or \
             fasten the camera"
        )
    })
}

fn clipping(edge: &Edge, polarity: Polarity) -> Check {
    // By itself never bad: a background that is wholly white is what some laboratories want.
    let limits = [100.0 * FULL_SHARE, 100.0];
    let lit = if polarity == Polarity::DarkBackground { "grain" } else { "background" };
    Check::at_most("clipping", 100.0 * edge.full_share, "%", limits).or(|| {
        format!(
            "so much of the {lit} beside the outline is full (level 252 and above), where no half-way level can be \
             told: expose shorter, or dim the lamp"
        )
    })
}

fn border(touches: [bool; 4]) -> Check {
    let sides: Vec<&str> = Side::ALL.iter().zip(touches).filter(|s| s.1).map(|s| s.0.name()).collect();
    // By itself never bad: pictures with a camera each may show a part. Before a turntable the pipeline refuses it.
    Check::at_most("border", sides.len() as f64, "sides", [0.0, 4.0]).or(|| {
        let what = if touches == [false, false, false, true] {
            "the grain, or what it stands on where that was not recognised as a pedestal,"
        } else {
            "the grain"
        };
        format!(
            "{what} reaches the {} end of the picture, and what lies beyond is missing: move the camera or the grain, \
             or take away what hangs into the picture",
            sides.join(" and the ")
        )
    })
}

fn contrast(contrast: f64, noise: f64) -> Check {
    let value = contrast / noise.max(0.1);
    let verdict = match value {
        v if v < CONTRAST_OF_NOISE[1] => Verdict::Bad,
        v if v < CONTRAST_OF_NOISE[0] => Verdict::Doubtful,
        _ => Verdict::Good,
    };
    let limit = CONTRAST_OF_NOISE[usize::from(verdict == Verdict::Bad)];
    let check = Check {
        name: "contrast",
        value,
        unit: "× noise",
        bound: Bound::AtLeast,
        limit,
        verdict,
        remedy: None,
    };
    check.or(|| {
        format!(
            "the grain stands only {contrast:.1} grey levels off the background, whose noise is {noise:.1}: more light \
             would make the outline surer"
        )
    })
}

/// A number of the pixels in the silhouette's rectangle and of where it lies (FNV-1a's steps on eight bytes at a
/// time): two pictures with the same number show the same pixels.
fn fingerprint(crop: &Crop, found: &Segmentation) -> u64 {
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let s = &found.silhouette;
    let mut sum = 0xcbf2_9ce4_8422_2325_u64;
    let mut mix = |word: u64| {
        sum = (sum ^ word).wrapping_mul(PRIME);
        sum ^= sum >> 29;
    };
    for v in s.origin.iter().chain(&s.size) {
        mix(*v as u64);
    }
    for y in s.origin[1]..s.origin[1] + s.size[1] {
        for word in crop.row(y, &(s.origin[0]..s.origin[0] + s.size[0])).chunks(8) {
            let mut bytes = [0; 8];
            bytes[..word.len()].copy_from_slice(word);
            mix(u64::from_le_bytes(bytes));
        }
    }
    sum
}
