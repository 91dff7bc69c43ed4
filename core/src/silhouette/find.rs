//! Segmentation: the order of the steps from a picture to its silhouette.

use super::finish::finish;
use super::look::{Seen, look};
use super::rect::Rect;
use super::reduced::Reduced;
use super::report::{PedestalOutline, Report};
use super::search::{Scene, search};
use super::symmetry::{self, EdgePoint, LEAST_EDGES, Surroundings};
use super::{
    EdgeBlur, EdgeSymmetry, EdgeTail, HeldByOthers, Histogram, LocalRim, Plateaus, Settings, Silhouette,
    SilhouetteError, SmallCopy, Source, ToneCurve, ToneSource, Uncut,
};
use super::{frame, lit};

/// Rows about the pedestal's top in which no edge is looked at by itself.
const CLEAR_OF_TOP: f64 = 10.0;

/// The segmentation of one picture: the silhouette, how it was got, and what a recut needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// The outline of the grain.
    pub silhouette: Silhouette,
    /// How it was found.
    pub report: Report,
    /// The outline before the pedestal was cut off, near its top; `None` where none was.
    pub uncut: Option<Uncut>,
    /// Grey levels near the grain, away from the background towards it: what the thresholds were read off.
    pub histogram: Histogram,
    /// How much of the picture's part that holds the grain is even, by its level.
    pub plateaus: Plateaus,
    /// Standard deviation of the outline's blur, pixels: lens, pixel and the mean over 3×3 pixels together.
    pub blur_px: f64,
    /// The same of lens and pixel alone, where the pedestal's sides show it.
    pub lens_px: Option<f64>,
    /// What the edges say of the tone curve, where neither the file nor the settings say which it is.
    pub symmetry: Option<EdgeSymmetry>,
    /// What the edges' outer tail says of a bright rim; `None` where it says nothing.
    pub tail: Option<EdgeTail>,
    /// How that rim differs along the outline; empty where none shows.
    pub rims: Vec<LocalRim>,
    /// Area of parts that touch the grain and differ from the background, but were left out as no background shows beyond them, square
    /// pixels: what the other views hold of them is the grain's.
    pub unsure_px: usize,
    /// The small copy on which the grain was sought.
    pub small: SmallCopy,
}

/// Finds the grain's outline in a picture.
///
/// `background` is a picture of the empty stage under the same light, where there is one; without it a
/// smooth surface is laid through the background. Only the region that holds the grain is looked at in full
/// resolution: the cost is one partial reading of the picture and a few passes over that region. A [`Picture`](super::Picture)
/// is decoded already; other sources decode no more than is looked at.
///
/// # Errors
/// When the settings make no sense, the background does not fit, or no grain is in view.
pub fn find(
    picture: &dyn Source,
    background: Option<&dyn Source>,
    settings: &Settings,
) -> Result<Segmentation, SilhouetteError> {
    find_with(picture, background, settings, &Known::default())
}

/// What the other views of the same grain say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Known<'a> {
    /// The threshold of all views, grey levels; held where Otsu's would be less.
    pub threshold: Option<f64>,
    /// The pedestal, and by how many pixels it may be off.
    pub pedestal: Option<(PedestalOutline, f64)>,
    /// Where their hull lies, once it is known: within it a part that differs from the background is the grain's.
    pub held: Option<&'a HeldByOthers>,
}

/// As [`find`], with what the other views of the same grain say.
///
/// # Errors
/// As [`find`].
pub fn find_with(
    picture: &dyn Source,
    background: Option<&dyn Source>,
    settings: &Settings,
    known: &Known<'_>,
) -> Result<Segmentation, SilhouetteError> {
    settings.check()?;
    let shape = picture.shape();
    if let Some(empty) = background.map(Source::shape)
        && empty != shape
    {
        return Err(SilhouetteError::BackgroundMismatch { background: empty, picture: shape });
    }
    let (frame, reduced) = if let Some(pixels) = picture.at_hand() {
        let frame = frame::inner(pixels);
        (frame, Reduced::of(picture, &frame)?)
    } else {
        let whole = Rect { x0: 0, y0: 0, x1: shape[0], y1: shape[1] };
        let reduced = Reduced::of(picture, &whole)?;
        if frame::possible(&reduced) {
            // Its lines must be counted.
            let pixels = picture.pixels()?.into_owned().coded(picture.tone_curve());
            return find_with(&pixels, background, settings, known);
        }
        (whole, reduced)
    };
    let empty = background.map(|stage| reduced.alike(stage)).transpose()?;
    let mut scene = search(&reduced, empty.as_ref(), &frame, settings)?;
    let mut seen = look(picture, &frame, &scene, (settings, known))?;
    let r = &seen.plane.rect;
    let inside = [r.x0 > frame.x0, r.x1 < frame.x1, r.y0 > frame.y0, r.y1 < frame.y1];
    if seen.reaches.iter().zip(inside).any(|(reaches, inside)| *reaches && inside) {
        // The region was guessed too small on the reduced picture: look at everything.
        scene.region = frame;
        seen = look(picture, &frame, &scene, (settings, known))?;
    }
    let made = |curve, from| {
        finish(picture, &frame, &scene, settings, (&seen, curve, from))
            .map(|found| Segmentation { small: reduced.small_copy(), ..found })
    };
    // A bright grain's own shading hides what its edges say, and colour is a camera's.
    let usual = (scene.bright_grain && shape[2] == 3).then_some(ToneCurve::Srgb);
    let known_curve = settings.curve_of(picture.tone_curve());
    let stated = known_curve.or(usual);
    let is_set = settings.tone_curve != ToneCurve::Auto;
    let from =
        stated.map_or(ToneSource::Custom, |_| if is_set { ToneSource::Setting } else { ToneSource::File });
    let mut found = made(stated.unwrap_or(ToneCurve::Srgb), from)?;
    let mut edges = Edges::of(&scene, &seen, &found);
    let (mut symmetry, mut sharpest_px) = edges.around.symmetry(&edges.points);
    if stated.is_none() {
        if let Some(curve) = symmetry.curve() {
            if curve != found.report.tone_curve {
                found = made(curve, ToneSource::Edges)?;
                edges = Edges::of(&scene, &seen, &found);
                (symmetry, sharpest_px) = edges.around.symmetry(&edges.points);
            }
            found.report.tone_curve_from = ToneSource::Edges;
        }
        found.symmetry = Some(symmetry);
    }
    if let Some(mut sharpest_px) = sharpest_px {
        // A pedestal that is glossy, or out of focus, is no measure of the grain's edges.
        if found.report.pedestal.is_some_and(|p| p.blur > sharpest_px.min(found.blur_px)) {
            let (_, own) = edges.around.symmetry(&edges.points[..edges.of_grain]);
            sharpest_px = own.map_or(sharpest_px, |own| own.min(sharpest_px));
        }
        let edge = EdgeBlur { sharpest_px, lens_px: found.lens_px };
        let blur_px = edge.px();
        let profile =
            edges.around.mean_profile(&edges.points[..edges.of_grain], found.report.tone_curve, blur_px);
        let noise = found.report.noise / found.report.contrast.abs().max(1.0);
        let is_bright = scene.bright_grain;
        found.tail = EdgeTail::of(|share| profile.reaches(share, LEAST_EDGES), (edge, noise, is_bright));
        if found.tail.is_some_and(|tail| tail.rim_px() > 0.0) {
            let r = &seen.plane.rect;
            let shown = (found.report.tone_curve, edge, [r.x0, r.y0]);
            found.rims = LocalRim::along(&edges.around, &edges.points[..edges.of_grain], shown);
        }
    }
    Ok(found)
}

/// The edges that a view shows.
struct Edges {
    around: Surroundings,
    /// Places along the grain's outline, then along the pedestal's sides.
    points: Vec<EdgePoint>,
    of_grain: usize,
}

impl Edges {
    fn of(scene: &Scene, seen: &Seen, found: &Segmentation) -> Self {
        let Seen { plane, pedestal, .. } = seen;
        let r = &plane.rect;
        let clear =
            pedestal.map_or(f64::INFINITY, |p| r.y0 as f64 + p.clear_above(plane.width, CLEAR_OF_TOP));
        let mut points = symmetry::along(&found.silhouette, clear, [r.x0, r.y0]);
        let of_grain = points.len();
        if let Some(p) = pedestal {
            let first = (p.top_at(p.centre().0) + CLEAR_OF_TOP).max(0.0) as usize;
            points.extend((first..plane.height).flat_map(|y| {
                let sides = p.sides_at(y as f64).into_iter().zip([1.0, -1.0]);
                sides.map(move |(x, inwards)| EdgePoint { at: [x, y as f64], inwards: [inwards, 0.0] })
            }));
        }
        let around = Surroundings {
            width: plane.width,
            height: plane.height,
            values: lit::grey_values(plane, scene),
            noise: seen.noise,
            blur_px: found.blur_px,
            is_bright: scene.bright_grain,
        };
        Self { around, points, of_grain }
    }
}
