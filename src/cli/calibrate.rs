//! `grainrig calibrate`.

use super::output::{print, print_json};
use super::{Common, help, usage};
use crate::daemon::{Angles, BodyKind, ScaleFile, ScaleRequest, calibrate_scale};
use crate::session::{to_json, write_whole};
use anyhow::{Context as _, Result};
use clap::{Args, Subcommand};
use grainrig_core::plausible::{self, Doubt};
use std::path::{Path, PathBuf};

/// Options of `calibrate`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Measure the size of a pixel from pictures of a ball or pin of known diameter on the pedestal.
    #[command(after_help = help::CALIBRATE_SCALE)]
    Scale(ScaleArguments),
}

/// Options of `calibrate scale`.
#[derive(Debug, Args)]
struct ScaleArguments {
    /// Folder of photographs (JPEG, PNG, TIFF) of the body, taken with the settings of the grain's pictures.
    folder: PathBuf,
    /// Which files show the body, as a glob over file names.
    #[arg(long, value_name = "GLOB", default_value = super::import::PICTURES)]
    pattern: String,
    /// The ball's diameter, mm.
    #[arg(
        long,
        value_name = "MM",
        allow_negative_numbers = true,
        conflicts_with = "pin_diameter_mm",
        required_unless_present = "pin_diameter_mm"
    )]
    ball_diameter_mm: Option<f64>,
    /// The diameter of an upright cylindrical pin, instead of a ball's, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pin_diameter_mm: Option<f64>,
    /// How far the true diameter may be from the one given, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, default_value_t = 0.0)]
    ball_tolerance_mm: f64,
    /// A picture of the stage without the body, of the same size.
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Distance from the lens's centre to the axis, mm; where it is not given, what it leaves open is part of the
    /// uncertainty.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    camera_distance_mm: Option<f64>,
    /// Angle of the table between one picture and the next, degrees, counter-clockwise seen from above; negative
    /// where it turns clockwise. With it, how far the body stands before or behind the axis is known.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "angles")]
    step_deg: Option<f64>,
    /// Angle of the table in each picture, degrees, instead of an even step: 0,36,72.
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', allow_negative_numbers = true)]
    angles: Option<Vec<f64>>,
    /// The file to write; one that is there is replaced.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(common: &Common, arguments: Arguments) -> Result<()> {
    let What::Scale(scale) = arguments.what;
    run_scale(common, scale)
}

fn run_scale(common: &Common, arguments: ScaleArguments) -> Result<()> {
    let config = common.config()?;
    let (body, diameter_mm) = match (arguments.ball_diameter_mm, arguments.pin_diameter_mm) {
        (Some(d), _) => (BodyKind::Ball, d),
        (None, Some(d)) => (BodyKind::Pin, d),
        (None, None) => return Err(usage("give --ball-diameter-mm or --pin-diameter-mm")),
    };
    let angles = match (arguments.step_deg, arguments.angles.clone()) {
        (Some(step), _) => Angles::Step(step),
        (None, Some(each)) => Angles::Each(each),
        (None, None) => Angles::Unknown,
    };
    let finite = match &angles {
        Angles::Unknown => true,
        Angles::Step(step) => step.is_finite(),
        Angles::Each(each) => each.iter().all(|a| a.is_finite()),
    };
    if !finite {
        return Err(usage("an angle is not a finite number of degrees; correct --step-deg or --angles"));
    }
    let doubts = doubts(body, diameter_mm, &arguments);
    plausible::slips(&doubts, common.as_given)?;
    let (folder, name) = whole_name(&arguments.out)?;
    if arguments.out.extension().and_then(|e| e.to_str()).is_some_and(super::import::is_picture) {
        return Err(usage(format!(
            "--out {} has a picture's ending; a calibration is JSON: end it in .json",
            arguments.out.display()
        )));
    }
    let request = ScaleRequest {
        folder: arguments.folder,
        pattern: arguments.pattern,
        background: arguments.background,
        body,
        diameter_mm,
        tolerance_mm: arguments.ball_tolerance_mm,
        camera_distance_mm: arguments.camera_distance_mm,
        angles,
        silhouette: config.silhouette,
    };
    let mut file = calibrate_scale(&request)?;
    let doubts = doubts.into_iter().chain(file.mm_per_px.value.and_then(|v| plausible::MM_PER_PX.doubt(v)));
    file.warnings.extend(plausible::settle(doubts.collect(), common.as_given)?);
    let text = to_json(&file).context("cannot encode the calibration")?;
    write_whole(&folder, &name, &text)
        .with_context(|| format!("cannot write {}", arguments.out.display()))?;
    if common.json { print_json(&file) } else { print(&summary(&file, &arguments.out)) }
}

/// What of the figures no laboratory has.
fn doubts(body: BodyKind, diameter_mm: f64, a: &ScaleArguments) -> Vec<Doubt> {
    let name = match body {
        BodyKind::Ball => "ball_diameter_mm",
        BodyKind::Pin => "pin_diameter_mm",
    };
    let tolerance = plausible::share_of("ball_tolerance_mm", diameter_mm, [0.0, 0.1]);
    let step = plausible::VIEW_STEP.named("step_deg");
    [
        plausible::DIAMETER.named(name).doubt(diameter_mm),
        tolerance.doubt(a.ball_tolerance_mm),
        a.camera_distance_mm.and_then(|d| plausible::CAMERA_DISTANCE.doubt(d)),
        a.step_deg.and_then(|s| step.doubt(s.abs())),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The folder and the name of a file that is to be written.
fn whole_name(path: &Path) -> Result<(PathBuf, String)> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match path.file_name().and_then(|n| n.to_str()) {
        Some(name) if !path.is_dir() => Ok((folder.to_owned(), name.to_owned())),
        _ => {
            Err(usage(format!("--out {} is no name for a file; give one such as scale.json", path.display())))
        }
    }
}

/// The scale in words.
fn summary(file: &ScaleFile, path: &Path) -> String {
    let value = file.mm_per_px.value.unwrap_or(f64::NAN);
    let sigma = file.mm_per_px.sigma.unwrap_or(f64::NAN);
    let r = &file.relative_sigma;
    let percent = |share: f64| format!("{:.4} %", 100.0 * share);
    let body = match file.body {
        BodyKind::Ball => "ball",
        BodyKind::Pin => "pin",
    };
    let mut lines = vec![
        format!(
            "scale      {value:.7} ± {sigma:.7} mm per pixel at the axis ({}, one standard deviation)",
            percent(sigma / value)
        ),
        format!(
            "           from {} picture(s) of a {body} of {} mm; outline {}, between pictures {}, perspective {}, \
             diameter {}, edge {}",
            file.pictures.len(),
            file.diameter_mm,
            percent(r.fit),
            percent(r.spread),
            percent(r.perspective),
            percent(r.body),
            percent(r.edge)
        ),
    ];
    if let Some(e) = file.eccentricity_mm {
        lines.push(format!("axis       the {body} stands {e:.4} mm off it"));
    }
    lines.extend(file.pictures.iter().map(|p| {
        format!(
            "picture    {}: radius {:.3} ± {:.3} px, {:.3} px off its shape, {:.7} mm per pixel",
            p.file, p.radius_px, p.sigma_px, p.residual_px, p.mm_per_px
        )
    }));
    lines.push(format!("json       {}", path.display()));
    lines.extend(file.warnings.iter().map(|w| format!("note       {w}")));
    lines.join("\n") + "\n"
}
