//! Outlines against the true ones.

use super::plan::Row;
use super::render::{Rendered, VIEWS, file_name};
use super::view::View;
use anyhow::{Result, anyhow};
use grainrig_core::formats::{Photograph, decode};
use grainrig_core::silhouette::{
    Known, PedestalOutline, Picture, Segmentation, Settings, Silhouette, Source, find, find_with,
};
use rayon::prelude::*;
use serde_json::Value;

/// Beside the pedestal nothing below its top counts as far as this, pixels: there its light is mixed with the grain's.
const BESIDE_PX: f64 = 7.0;
/// Areas that differ by more than this come from different outlines.
const SAME_AREA: f64 = 1e-3;

/// By how much a stated pedestal may be off, pixels.
const KNOWN_PX: f64 = 1.0;
/// Light is read so far inside and outside the true outline, pixels, beyond what blur mixes.
const BESIDE_OUTLINE_PX: [f64; 3] = [2.0, 3.0, 4.0];
/// An outline is seen where the light on its two sides differs by as many grey levels, or standard deviations of the noise.
const SEEN_LEVELS: f64 = 4.0;
const SEEN_NOISES: f64 = 2.5;

/// One view's outline against the truth.
pub struct Compared {
    /// Index of the view.
    pub view: usize,
    /// Intersection over union of the pixels; 0 where there is no outline.
    pub iou: f64,
    /// The outline's area over the true one, less one.
    pub area: f64,
    /// Share of the true outline that differs from the background beside it: the rest can only be guessed.
    pub seen: f64,
    /// The outline.
    pub found: Option<Silhouette>,
    /// Whether the program states another area than this outline's.
    pub is_other: bool,
}

/// The outlines of a set as this build finds them by what the program states that it cut them by, against the true masks.
///
/// # Errors
/// Where the set cannot be read.
pub fn compared(row: &Row, set: &Rendered, result: Option<&Value>) -> Result<Vec<Compared>> {
    let read = |name: &str| std::fs::read(set.folder.join(name));
    let open = |bytes: &[u8]| Photograph::open(bytes).map_err(|e| anyhow!("{e}"));
    let empty = row.gives_empty.then(|| open(&read(&file_name(row, "empty"))?)).transpose()?;
    let views = set.views(row)?;
    (0..=VIEWS)
        .into_par_iter()
        .map(|k| {
            let mask = decode(&read(&format!("truth/mask_{k:02}.png"))?).map_err(|e| anyhow!("{e}"))?;
            let bytes = read(&file_name(row, &format!("grain_{k:02}")))?;
            let picture = open(&bytes)?;
            let background = empty.as_ref().map(|e| e as &dyn Source);
            let details = result.and_then(|r| r["view_details"].as_array()?.iter().find(|v| v["index"] == k));
            let stated = details.map(|d| &d["silhouette"]);
            let found = match stated {
                Some(stated) => cut_as_stated(&picture, background, stated),
                None => find(&picture, background, &Settings::default()).ok(),
            };
            let area = stated.and_then(|stated| stated["area_px"].as_f64());
            let is_other = found
                .as_ref()
                .zip(area)
                .is_some_and(|(f, area)| (f.report.area_px / area - 1.0).abs() > SAME_AREA);
            let found = found.map(|f| f.silhouette);
            let (iou, area) = against(row, &views[k], mask.data(), found.as_ref());
            let whole = decode(&bytes).map_err(|e| anyhow!("{e}"))?;
            let seen = seen(row, &views[k], mask.data(), &whole);
            Ok(Compared { view: k, iou, area, seen, found, is_other })
        })
        .collect()
}

/// A view's outline by what the program states that it was cut by.
fn cut_as_stated(
    picture: &dyn Source,
    background: Option<&dyn Source>,
    stated: &Value,
) -> Option<Segmentation> {
    let settings = Settings {
        channel: serde_json::from_value(stated["channel"].clone()).ok()?,
        polarity: serde_json::from_value(stated["polarity"].clone()).ok()?,
        tone_curve: serde_json::from_value(stated["tone_curve"].clone()).ok()?,
        ..Settings::default()
    };
    let pedestal = pedestal(&stated["pedestal"]);
    let threshold = stated["threshold_used_levels"].as_f64();
    let known = Known { threshold, pedestal: pedestal.map(|p| (p, KNOWN_PX)), held: None };
    let mut found = find_with(picture, background, &settings, &known).ok()?;
    if let Some(pedestal) = pedestal {
        found.recut(pedestal);
    }
    let rim_px = stated["rim_px"].as_f64().unwrap_or(0.0);
    if rim_px > 0.0 {
        found.grow(rim_px);
    }
    Some(found)
}

fn pedestal(stated: &Value) -> Option<PedestalOutline> {
    Some(PedestalOutline {
        top_row: stated["top_row_px"].as_f64()?,
        top_slope: stated["top_slope"].as_f64()?,
        centre_column: stated["centre_column_px"].as_f64()?,
        half_width: stated["half_width_px"].as_f64()?,
        top_seen: stated["top_seen"].as_bool()?,
        slope_seen: stated["slope_seen"].as_bool()?,
        blur: stated["blur_px"].as_f64()?,
    })
}

/// Share of the true outline, but for the contact with the pedestal, at which any channel changes from inside to outside.
fn seen(row: &Row, view: &View, mask: &[u8], picture: &Picture) -> f64 {
    let size = [picture.width(), picture.height()];
    let coverage: Vec<f32> = mask.iter().map(|c| f32::from(*c) / 255.0).collect();
    let Some(truth) = Silhouette::of_coverage(size, &coverage) else { return 0.0 };
    let beside = 0.5 * row.pedestal.diameter_mm / row.mm_per_px() + BESIDE_PX;
    let camera = &row.camera;
    let mixed = (2.0 * camera.blur_px).max(camera.disc_px);
    let channels = picture.channels();
    let light = |[u, v]: [f64; 2], channel: usize| {
        let (x, y) = (u.round().clamp(0.0, size[0] as f64 - 1.0), v.round().clamp(0.0, size[1] as f64 - 1.0));
        f64::from(picture.data()[(y as usize * size[0] + x as usize) * channels + channel])
    };
    let (mut all, mut differ) = (0u32, 0u32);
    for [a, b] in truth.segments() {
        let at = [0, 1].map(|k| f64::midpoint(a[k], b[k]));
        let [aside, below] = view.beside_foot(at);
        if below > -BESIDE_PX && aside.abs() < beside {
            continue;
        }
        let distance = |dx: f64, dy: f64| truth.signed_distance_px([at[0] + dx, at[1] + dy]);
        let slope = [distance(1.0, 0.0) - distance(-1.0, 0.0), distance(0.0, 1.0) - distance(0.0, -1.0)];
        let steep = slope[0].hypot(slope[1]).max(1e-9);
        let side = |sign: f64, channel: usize| {
            let place = |far: f64| {
                let out = sign * (far + mixed) / steep;
                light([at[0] + out * slope[0], at[1] + out * slope[1]], channel)
            };
            BESIDE_OUTLINE_PX.map(place).iter().sum::<f64>() / BESIDE_OUTLINE_PX.len() as f64
        };
        let least = SEEN_LEVELS.max(SEEN_NOISES * row.file.noise.hypot(row.file.shot));
        let is_seen = (0..channels).any(|c| (side(1.0, c) - side(-1.0, c)).abs() > least);
        all += 1;
        differ += u32::from(is_seen);
    }
    f64::from(differ) / f64::from(all.max(1))
}

fn against(row: &Row, view: &View, mask: &[u8], found: Option<&Silhouette>) -> (f64, f64) {
    let Some(found) = found else { return (0.0, -1.0) };
    let beside = 0.5 * row.pedestal.diameter_mm / row.mm_per_px() + BESIDE_PX;
    let (mut both, mut either, mut area, mut true_area) = (0u32, 0u32, 0.0, 0.0);
    for (k, covered) in mask.iter().enumerate() {
        let (x, y) = (k % row.camera.width, k / row.camera.width);
        let share = (0.5 - found.signed_distance_px([x as f64, y as f64])).clamp(0.0, 1.0);
        if *covered == 0 && share == 0.0 {
            continue;
        }
        let [aside, below] = view.beside_foot([x as f64, y as f64]);
        if below > 0.0 && aside.abs() < beside {
            continue;
        }
        let (a, b) = (*covered >= 128, found.contains(x, y));
        both += u32::from(a && b);
        either += u32::from(a || b);
        area += share;
        true_area += f64::from(*covered) / 255.0;
    }
    (f64::from(both) / f64::from(either.max(1)), area / true_area - 1.0)
}
