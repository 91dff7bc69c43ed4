//! `grainrig study`.

use super::output::{print, print_json};
use super::progress::Progress;
use super::{Common, help};
use crate::jobs::StudyOptions;
use anyhow::Result;
use clap::{Args, Subcommand};
use std::fmt::Write as _;

/// Options of `study`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// How the reconstructed volume depends on the number of views, on bodies of known volume.
    #[command(after_help = help::STUDY_SENSITIVITY)]
    Sensitivity(StudyOptions),
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let What::Sensitivity(options) = &arguments.what;
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    let studied = outcome?;
    if common.json {
        return print_json(&studied.to_json()?);
    }
    let mut text = format!(
        "V_R/V_M, real over reconstructed volume\n{:<16} {:>5} {:>8}  {:>8} {:>8} {:>11} {:>9} {:>9}\n",
        "body", "views", "angle", "voxels", "exact", "coarse mesh", "fine mesh", "analytic"
    );
    // Writing to a string cannot fail.
    for r in &studied.rows {
        let v = &r.vr_over_vm;
        let _ = writeln!(
            text,
            "{:<16} {:>5} {:>7.2}°  {:>8.4} {:>8.4} {:>11.4} {:>9.4} {:>9}",
            r.body,
            r.views,
            r.angle_deg,
            v.voxel,
            v.exact,
            v.coarse_mesh,
            v.fine_mesh,
            r.analytic.map_or_else(String::new, |a| format!("{a:.4}"))
        );
    }
    for line in studied.files.into_iter().chain(studied.warnings.iter().map(|w| format!("note: {w}"))) {
        let _ = writeln!(text, "{line}");
    }
    print(&text)
}
