//! The products for a person's eye: each view's outline over its photograph, and the sheet of the calibration.

use super::result::{AxisResult, ViewResult};
use super::{Cameras, PipelineError, Product, SegmentedView};
use crate::session::event::Role;
use grainrig_core::calibrate::{Calibration, Measured};
use grainrig_core::report::{Mark, Marks, Panel, Point, Series, Sheet};
use rayon::prelude::*;

/// The sheet's name, without its endings.
pub const SHEET: &str = "calibration";
/// What the names of outlines begin with.
pub const OUTLINE: &str = "outline_";
/// Warnings of single views that the sheet repeats.
const MOST_WARNINGS: usize = 12;

/// Each view's outline over its photograph, as `outline_00.png` and so on.
pub(super) fn outlines(
    segmented: &[SegmentedView],
    axis: Option<&AxisResult>,
) -> Result<Vec<Product>, PipelineError> {
    let one = |t: &SegmentedView| {
        let file = format!("{OUTLINE}{:02}.png", t.index);
        let closing = if t.role == Role::Closing { " (closing)" } else { "" };
        let marks = Marks {
            pedestal: t.found.report.pedestal.as_ref(),
            axis: axis.map(|a| ([a.axis_column_px, a.origin_row_px], a.roll_deg.to_radians())),
            caption: &format!(
                "view {:02}, {:.2}°{closing}: outline pink, cut orange, axis blue",
                t.index,
                t.angle.deg()
            ),
        };
        let shot = t.shot.as_ref()?;
        let drawn = shot.drawn(&t.silhouette, &marks);
        Some(
            drawn
                .map(|bytes| Product {
                    kind: file.trim_end_matches(".png").into(),
                    file: file.clone(),
                    bytes,
                })
                .map_err(|e| PipelineError::Drawing { file: file.clone(), reason: e.to_string() }),
        )
    };
    segmented.par_iter().filter_map(one).collect()
}

/// A sheet, as SVG and PNG.
pub(super) fn sheet_files(name: &str, sheet: &Sheet) -> Result<[Product; 2], PipelineError> {
    let file = |ending: &str| format!("{name}.{ending}");
    let png =
        (sheet.png()).map_err(|e| PipelineError::Drawing { file: file("png"), reason: e.to_string() })?;
    Ok([
        Product { kind: name.into(), file: file("svg"), bytes: sheet.svg() },
        Product { kind: format!("{name}_png"), file: file("png"), bytes: png },
    ])
}

/// What the sheet shows of a finished computation.
pub(super) fn sheet(
    cameras: &Cameras,
    segmented: &[SegmentedView],
    views: &[ViewResult],
    axis: Option<&AxisResult>,
    calibration: Option<&Calibration>,
    warnings: &[String],
) -> Sheet {
    let mut figures = vec![scale_in_words(cameras)];
    figures.extend(calibration.map(camera_in_words));
    if let Some(a) = axis {
        figures.push(format!(
            "axis: column {:.3} px in row {:.2} px (z = 0), roll {:.4}°, outlines {:.3} px apart (root mean square), by {}",
            a.axis_column_px,
            a.origin_row_px,
            a.roll_deg,
            a.residual_px,
            serde_json::to_value(a.method).ok().and_then(|m| m.as_str().map(str::to_owned)).unwrap_or_default()
        ));
    }
    let of_views = |name: &str, value: &dyn Fn(&SegmentedView) -> f64| {
        let (low, high) = segmented
            .iter()
            .map(value)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        format!("{name} {low:.2} to {high:.2}")
    };
    figures.push(format!(
        "silhouettes of {} views: {}, {}, {} grey levels; {} px of blur",
        segmented.len(),
        of_views("contrast", &|t| t.found.report.contrast),
        of_views("noise", &|t| t.found.report.noise),
        of_views("threshold", &|t| t.found.report.threshold_used),
        of_views("", &|t| t.found.blur_px).trim()
    ));
    let mut all: Vec<String> = warnings.to_vec();
    let of_one = segmented
        .iter()
        .flat_map(|t| t.found.report.warnings.iter().map(move |w| format!("view {}: {w}", t.index)));
    let each: Vec<String> = of_one.collect();
    all.extend(each.iter().take(MOST_WARNINGS).cloned());
    if each.len() > MOST_WARNINGS {
        all.push(format!("and {} more of single views", each.len() - MOST_WARNINGS));
    }
    Sheet {
        title: String::new(),
        panels: [extents(segmented, axis), histogram(segmented)]
            .into_iter()
            .chain(calibration.into_iter().flat_map(|c| [offsets(c), angles(c)]))
            .chain([agreement(views), light(segmented)])
            .collect(),
        figures,
        warnings: all,
    }
}

fn scale_in_words(cameras: &Cameras) -> String {
    let Cameras::Turntable(table) = cameras else {
        return "scale: each view has a camera of its own".into();
    };
    let sigma = table.mm_per_px_sigma.map_or_else(
        || "its uncertainty is not known".to_owned(),
        |s| format!("± {s:.7} ({:.4} %, one standard deviation)", 100.0 * s / table.mm_per_px),
    );
    let lens = table
        .camera_distance_mm
        .map_or("no distance given".to_owned(), |d| format!("camera {d} mm from the axis"));
    format!("scale: {:.7} mm per pixel at the axis, {sigma}; {lens}", table.mm_per_px)
}

fn camera_in_words(c: &Calibration) -> String {
    let figure = |name: &str, m: &Measured, unit: &str, digits: usize| match (m.value, m.sigma) {
        (Some(v), Some(s)) => format!("{name} {v:.digits$} ± {s:.digits$}{unit}"),
        (Some(v), None) => format!("{name} {v:.digits$}{unit}"),
        (None, _) => format!("{name} unknown"),
    };
    format!(
        "{}, {}, {} ({}), {}; views stand {:.2} px (standard deviation) off each other, outlines {:.2} px",
        figure("axis at", &c.axis_column_px, " px", 2),
        figure("roll", &c.roll_deg, "°", 3),
        figure("distance", &c.camera_distance_mm, " mm", 1),
        c.camera_distance_note,
        figure("rays rise", &c.elevation_deg, "°", 2),
        c.radial_runout_px,
        c.residual_px
    )
}

/// Each view's sideways shift, with its standard uncertainty.
fn offsets(c: &Calibration) -> Panel {
    let points = c.views.iter().map(|v| Point {
        x: v.nominal_angle_deg,
        y: v.offset_px,
        sigma: Some(v.offset_sigma_px),
    });
    Panel {
        title: "sideways shift of each view, px (bars: one standard deviation)".into(),
        abscissa: "angle of the table, °".into(),
        series: vec![series("", false, points.collect())],
        marks: vec![Mark::Level("none".into(), 0.0)],
    }
}

/// How far each view's angle is from the table's, with its standard uncertainty.
fn angles(c: &Calibration) -> Panel {
    let points = c.views.iter().map(|v| Point {
        x: v.nominal_angle_deg,
        y: v.angle_deg - v.nominal_angle_deg,
        sigma: Some(v.angle_sigma_deg),
    });
    Panel {
        title: "grain's angle less the table's, ° (bars: one standard deviation)".into(),
        abscissa: "angle of the table, °".into(),
        series: vec![series("", false, points.collect())],
        marks: vec![Mark::Level("none".into(), 0.0)],
    }
}

fn point(x: f64, y: f64) -> Point {
    Point { x, y, sigma: None }
}

fn series(name: &str, joined: bool, points: Vec<Point>) -> Series {
    Series { name: name.into(), points, joined }
}

/// The outline's ends in each view against the angle, and the axis between them.
fn extents(segmented: &[SegmentedView], axis: Option<&AxisResult>) -> Panel {
    let ends = |t: &SegmentedView| {
        let rows = t.silhouette.extents_px();
        let inside = || rows.iter().flatten();
        let left = inside().map(|e| e[0]).fold(f64::INFINITY, f64::min);
        let right = inside().map(|e| e[1]).fold(f64::NEG_INFINITY, f64::max);
        [left, right]
    };
    let all: Vec<(f64, [f64; 2])> = segmented.iter().map(|t| (t.angle.deg(), ends(t))).collect();
    let side = |k: usize| all.iter().map(|(a, e)| point(*a, e[k])).collect();
    let middle = all.iter().map(|(a, e)| point(*a, 0.5 * (e[0] + e[1]))).collect();
    Panel {
        title: "ends of the outline, column in px".into(),
        abscissa: "angle of the table, °".into(),
        series: vec![
            series("left", false, side(0)),
            series("right", false, side(1)),
            series("middle", false, middle),
        ],
        marks: axis.iter().map(|a| Mark::Level("axis".into(), a.axis_column_px)).collect(),
    }
}

/// The first view's histogram, and the thresholds that were read off it.
fn histogram(segmented: &[SegmentedView]) -> Panel {
    let Some(first) = segmented.first() else { return Panel::default() };
    let report = &first.found.report;
    let counts =
        (first.found.histogram.bins()).map(|(level, n)| point(level, ((1 + n) as f64).log10())).collect();
    let upright = |name: &str, at: f64| Mark::Upright(name.into(), at);
    Panel {
        title: format!("view {}: grey levels near the grain, log10 of pixels", first.index),
        abscissa: "grey levels away from the background".into(),
        series: vec![series("", true, counts)],
        marks: vec![
            upright("Otsu, 2", report.threshold_two),
            upright("Otsu, 3 low", report.thresholds_three[0]),
            upright("3 high", report.thresholds_three[1]),
            upright("used", report.threshold_used),
        ],
    }
}

/// How well the hull, seen again, fills each silhouette.
fn agreement(views: &[ViewResult]) -> Panel {
    Panel {
        title: "hull seen again over silhouette (intersection over union)".into(),
        abscissa: "angle of the table, °".into(),
        series: vec![series("", false, views.iter().map(|v| point(v.angle_deg, v.iou)).collect())],
        marks: Vec::new(),
    }
}

/// Contrast and threshold over the views: whether the light has drifted.
fn light(segmented: &[SegmentedView]) -> Panel {
    let of = |value: &dyn Fn(&SegmentedView) -> f64| {
        segmented.iter().map(|t| point(t.angle.deg(), value(t))).collect()
    };
    Panel {
        title: "light, grey levels away from the background".into(),
        abscissa: "angle of the table, °".into(),
        series: vec![
            series("grain", false, of(&|t| t.found.report.contrast)),
            series("threshold", false, of(&|t| t.found.report.threshold_used)),
        ],
        marks: Vec::new(),
    }
}
