//! `grainrig calibrate`.

use super::output::{print, print_json};
use super::progress::Progress;
use super::{Common, help};
use crate::jobs::{BodyKind, ScaleFile, ScaleOptions};
use anyhow::Result;
use clap::{Args, Subcommand};
use std::path::Path;

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
    Scale(ScaleOptions),
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let What::Scale(options) = &arguments.what;
    let progress = Progress::new();
    let outcome = options.run(&common.configured(&progress)?);
    progress.finish();
    let file = outcome?;
    if common.json { print_json(&file) } else { print(&summary(&file, &options.out)) }
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
