//! `grainrig reconstruct` and `grainrig replay`.

use super::capture::report;
use super::progress::Progress;
use super::{Common, print_json};
use crate::daemon;
use crate::pipeline::MeshSettings;
use anyhow::{Result, bail};
use clap::Args;
use std::path::PathBuf;

/// The mesh's three controls on the command line.
#[derive(Debug, Args)]
pub struct MeshOptions {
    /// Largest circumradius of a surface facet, mm.
    #[arg(long, value_name = "MM")]
    surface_size_mm: Option<f64>,
    /// Smallest angle of a surface facet, degrees.
    #[arg(long, value_name = "DEG")]
    facet_angle_deg: Option<f64>,
    /// Largest volume of a tetrahedron, mm³.
    #[arg(long, value_name = "MM3")]
    tet_volume_mm3: Option<f64>,
}

impl MeshOptions {
    /// The settings, or `None` where nothing was asked.
    pub(super) fn settings(&self) -> Option<MeshSettings> {
        let asked = MeshSettings {
            surface_size_mm: self.surface_size_mm,
            facet_angle_deg: self.facet_angle_deg,
            tet_volume_mm3: self.tet_volume_mm3,
        };
        (asked != MeshSettings::default()).then_some(asked)
    }
}

/// Options of `reconstruct`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Session: its name in the data folder, or its folder.
    session: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
}

/// Options of `replay`.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// Session: its name in the data folder, or its folder.
    session: PathBuf,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let progress = Progress::new();
    let outcome = daemon::reconstruct(&folder, arguments.mesh.settings().as_ref(), &progress.watcher());
    progress.finish();
    report(common, &outcome?)
}

pub(super) fn replay(common: &Common, arguments: &ReplayArguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let progress = Progress::new();
    let outcome = daemon::replay(&folder, &progress.watcher());
    progress.finish();
    let done = outcome?;
    if common.json {
        let mut object = serde_json::to_value(&done.finished.result)?;
        object["differs"] = serde_json::json!(done.differs);
        print_json(&object)?;
    } else {
        report(common, &done.finished)?;
    }
    if done.differs.is_empty() {
        if !common.json {
            println!("replay     every product has the recorded bytes");
        }
        return Ok(());
    }
    bail!(
        "the replay differs from the recorded products in {}; the recording was made by {}",
        done.differs.join(", "),
        done.finished.result.software
    )
}
