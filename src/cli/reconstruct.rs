//! `grainrig reconstruct` and `grainrig replay`.

use super::Common;
use super::capture::{conclude, report};
use super::output::{print, print_json};
use super::progress::Progress;
use crate::daemon::{self, DaemonError};
use crate::pipeline::MeshSettings;
use crate::session::to_json_value;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// The mesh's three controls on the command line.
#[derive(Debug, Args)]
pub struct MeshOptions {
    /// Largest circumradius of a surface facet, mm; by default 0.034 of the grain's equivalent diameter.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    surface_size_mm: Option<f64>,
    /// Smallest angle of a surface facet, degrees, up to 30; by default 25.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    facet_angle_deg: Option<f64>,
    /// Largest volume of a tetrahedron, mm³; by default what fits the surface's size.
    #[arg(long, value_name = "MM3", allow_negative_numbers = true)]
    tet_volume_mm3: Option<f64>,
    /// Largest distance between the mesh's surface and the body's, either way, mm; by default none is promised.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    distance_mm: Option<f64>,
    /// Largest circumradius of a surface facet where plates will touch the grain, at its top and bottom, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    size_at_contact_mm: Option<f64>,
    /// How far the contacts reach below the highest and above the lowest place, mm; by default 2 % of the height.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, requires = "size_at_contact_mm")]
    contact_depth_mm: Option<f64>,
}

impl MeshOptions {
    /// The settings, or `None` where nothing was asked.
    pub(super) fn settings(&self) -> Option<MeshSettings> {
        let asked = MeshSettings {
            surface_size_mm: self.surface_size_mm,
            facet_angle_deg: self.facet_angle_deg,
            tet_volume_mm3: self.tet_volume_mm3,
            distance_mm: self.distance_mm,
            size_at_contact_mm: self.size_at_contact_mm,
            contact_depth_mm: self.contact_depth_mm,
        };
        (asked != MeshSettings::default()).then_some(asked)
    }
}

/// Options of `reconstruct`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The session: its name in the data folder, or its folder's path.
    session: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long)]
    no_pictures: bool,
}

/// Options of `replay`.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The session: its name in the data folder, or its folder's path.
    session: PathBuf,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let progress = Progress::new();
    let outcome = daemon::reconstruct(
        &folder,
        arguments.mesh.settings().as_ref(),
        !arguments.no_pictures,
        common.as_given,
        &progress.watcher(),
    );
    progress.finish();
    conclude(common, &outcome?)
}

pub(super) fn replay(common: &Common, arguments: &ReplayArguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let progress = Progress::new();
    let outcome = daemon::replay(&folder, &progress.watcher());
    progress.finish();
    let done = outcome?;
    if common.json {
        let mut object = to_json_value(&done.finished.result)?;
        object["differs"] = serde_json::json!(done.differs);
        print_json(&object)?;
    } else {
        report(common, &done.finished)?;
    }
    if done.differs.is_empty() {
        return if common.json { Ok(()) } else { print("replay     every product has the recorded bytes\n") };
    }
    Err(DaemonError::Differs { products: done.differs, software: done.finished.result.software }.into())
}
