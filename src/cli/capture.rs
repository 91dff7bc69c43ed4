//! `grainrig capture` and `grainrig resume`.

use super::progress::Progress;
use super::{Common, print_json, usage};
use crate::acquire::Control;
use crate::daemon::{self, Finished};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Options of `capture`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the new session: letters, digits, `.`, `_` or `-`.
    name: String,
    /// Number of views over half a turn; the step between them is the greatest whole number of motor steps that
    /// keeps them within it.
    #[arg(long)]
    views: Option<u32>,
    /// Write the simulated rig's truth (shape, angles, camera) into this folder.
    #[arg(long, value_name = "DIR")]
    truth: Option<PathBuf>,
}

/// Options of `resume`.
#[derive(Debug, Args)]
pub struct ResumeArguments {
    /// Session: its name in the data folder, or its folder.
    session: PathBuf,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let mut config = common.config()?;
    if let Some(views) = arguments.views {
        config.plan.views = views;
        config.plan.steps_per_view = (180.0 / config.plan.step_deg / f64::from(views.max(1))) as u32;
        config.plan.check().map_err(usage)?;
    }
    let control = stoppable();
    let progress = Progress::new();
    let outcome = daemon::capture(
        &common.data,
        &arguments.name,
        &config,
        arguments.truth.as_deref(),
        &control,
        &progress.watcher(),
    );
    progress.finish();
    report(common, &outcome?)
}

pub(super) fn resume(common: &Common, arguments: &ResumeArguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let control = stoppable();
    let progress = Progress::new();
    let outcome = daemon::resume(&folder, &control, &progress.watcher());
    progress.finish();
    report(common, &outcome?)
}

/// A control that Ctrl-C aborts: the view in hand is finished, what was captured stays.
fn stoppable() -> Control {
    let control = Control::default();
    let on_signal = control.clone();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build();
        if let Ok(runtime) = runtime
            && runtime.block_on(tokio::signal::ctrl_c()).is_ok()
        {
            eprintln!("stopping after the view in hand; `grainrig resume` goes on from there");
            on_signal.abort();
        }
    });
    control
}

/// Tells the user what was made and where it is.
pub(super) fn report(common: &Common, done: &Finished) -> Result<()> {
    if common.json {
        return print_json(&done.result);
    }
    let r = &done.result;
    let figure =
        |x: Option<f64>, unit: &str| x.map_or_else(|| "not metric".into(), |x| format!("{x:.5} {unit}"));
    println!("session    {}", done.folder.display());
    println!(
        "hull       {} from {} views (an upper bound of the grain)",
        figure(r.hull.volume_mm3, "mm³"),
        r.views
    );
    println!(
        "           {} by voxels of {}",
        figure(r.hull.voxel_volume_mm3, "mm³"),
        figure(r.hull.voxel_mm, "mm")
    );
    println!("           surface {}", figure(r.hull.surface_area_mm2, "mm²"));
    println!(
        "           silhouettes filled: IoU {:.4} in the mean, {:.4} in the worst view",
        r.hull.silhouette_iou.mean, r.hull.silhouette_iou.min
    );
    println!(
        "mesh       {} nodes, {} triangles, {} tetrahedra",
        r.mesh.nodes, r.mesh.triangles, r.mesh.tetrahedra
    );
    println!(
        "           {}; dihedral angles {:.1}° to {:.1}° (1 %: {:.1}°), facet angles from {:.1}°",
        figure(r.mesh.volume_mm3, "mm³"),
        r.mesh.dihedral_deg.min,
        r.mesh.dihedral_deg.max,
        r.mesh.dihedral_deg.p01,
        r.mesh.facet_angle_deg.min
    );
    for (kind, path) in &r.products {
        println!("{kind:<10} {path}");
    }
    for w in &r.warnings {
        println!("note       {w}");
    }
    Ok(())
}
