//! `grainrig merge`.

use super::Common;
use super::capture::conclude;
use super::progress::Progress;
use super::reconstruct::MeshOptions;
use crate::daemon::{self, Finished};
use crate::pipeline::MergeResult;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Options of `merge`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The first session: its name in the data folder, or its folder's path. The result is in its frame.
    a: PathBuf,
    /// The second session: the same grain with another side down.
    b: PathBuf,
    /// The merged grain's session, which must not exist yet: its name in the data folder, or its folder's path.
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let a = super::session_folder(common, &arguments.a)?;
    let b = super::session_folder(common, &arguments.b)?;
    // A plain name is a session of the data folder, as for every other command.
    let out = match arguments.out.components().count() {
        1 => common.data.join(&arguments.out),
        _ => arguments.out.clone(),
    };
    let progress = Progress::new();
    let outcome = daemon::merge([&a, &b], &out, arguments.mesh.settings().as_ref(), &progress.watcher());
    progress.finish();
    conclude(common, &outcome?)
}

/// The result of a merging in words, a line for each figure.
pub(super) fn summary(done: &Finished, m: &MergeResult) -> String {
    let r = &done.result;
    let [x, y, z] = m.translation_mm;
    let single = |p: &crate::pipeline::PoseResult| {
        format!("           {:.5} mm³ by the {} views of {} alone", p.volume_mm3, p.views, p.session)
    };
    let mut lines = vec![
        format!("merged     {}", done.folder.display()),
        format!(
            "hull       {:.5} mm³ by all {} views (an upper bound of the grain, with the feet that one pose's pedestal hides)",
            m.volume_mm3, r.views
        ),
        single(&m.a),
        single(&m.b),
        format!(
            "motion     {} to {}: turned by {:.2}° about ({:.3}, {:.3}, {:.3}), moved by ({x:.4}, {y:.4}, {z:.4}) mm; \
             upright axes {:.0}° apart",
            m.b.session,
            m.a.session,
            m.rotation_deg,
            m.rotation_axis[0],
            m.rotation_axis[1],
            m.rotation_axis[2],
            m.axes_apart_deg
        ),
        format!(
            "           silhouettes unfilled by {:.3} px along their outlines (limit {:.2} px; each pose alone {:.3} px)",
            m.unfilled.median_view_px, m.limit_px, m.unfilled_alone.median_view_px
        ),
    ];
    if let Some(rival) = &m.rival {
        lines.push(format!(
            "           the next best turn is {:.0}° off and leaves {:.2} px unfilled, this one {:.2} px",
            rival.apart_deg, rival.mean_px, m.unfilled.mean_px
        ));
    }
    lines.push(format!(
        "mesh       {} nodes, {} triangles, {} tetrahedra; {:.5} mm³",
        r.mesh.nodes,
        r.mesh.triangles,
        r.mesh.tetrahedra,
        r.mesh.volume_mm3.unwrap_or_default()
    ));
    lines.extend(r.products.iter().map(|(kind, path)| format!("{kind:<10} {path}")));
    lines.extend(r.warnings.iter().map(|w| format!("note       {w}")));
    lines.join("\n") + "\n"
}
