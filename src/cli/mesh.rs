//! `grainrig mesh`.

use super::output::{print, print_json};
use super::progress::Progress;
use super::reconstruct::MeshOptions;
use super::{Common, usage};
use crate::daemon;
use crate::export::{inp, stl, vtu};
use crate::geometry::ImplicitBody as _;
use crate::mesh::{Solid, mesh};
use crate::pipeline::MeshResult;
use anyhow::{Context as _, Result};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `mesh`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A closed surface (binary or ASCII STL, mm), or a session.
    input: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
    /// Files to write; the ending says what: .inp (Abaqus), .vtu (`ParaView`), .stl. By default NAME.inp here
    /// for a surface; a session has its products in its own folder.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    out: Vec<PathBuf>,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let input = &arguments.input;
    for path in &arguments.out {
        if !["inp", "vtu", "stl"].contains(&ending(path)) {
            return Err(usage(format!("{}: the ending must be .inp, .vtu or .stl", path.display())));
        }
    }
    if !input.extension().is_some_and(|e| e.eq_ignore_ascii_case("stl")) {
        let folder = super::session_folder(common, input)?;
        let progress = Progress::new();
        let outcome = daemon::reconstruct(&folder, arguments.mesh.settings().as_ref(), &progress.watcher());
        progress.finish();
        let done = outcome?;
        for path in &arguments.out {
            let made = &done.result.products[ending(path)];
            write(path, &std::fs::read(made).with_context(|| format!("cannot read {made}"))?)?;
        }
        return super::capture::report(common, &done);
    }
    let outputs = if arguments.out.is_empty() {
        vec![PathBuf::from(input.file_stem().unwrap_or_default()).with_extension("inp")]
    } else {
        arguments.out.clone()
    };
    let bytes =
        std::fs::read(input).with_context(|| format!("cannot read {}; check the path", input.display()))?;
    let surface = stl::read(&bytes).with_context(|| input.display().to_string())?;
    let volume_mm3 = surface.volume_mm3();
    let diameter_mm = (6.0 * volume_mm3 / std::f64::consts::PI).cbrt();
    let solid = Solid::new(surface).with_context(|| input.display().to_string())?;
    let controls = arguments.mesh.settings().unwrap_or_default().controls(diameter_mm);
    let bar = super::progress::percent("meshing");
    let start = Instant::now();
    let made = mesh(&solid, &controls, &mut |done| bar.set_position((done * 100.0) as u64))?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let software = concat!("grainrig ", env!("CARGO_PKG_VERSION"));
    let provenance = [format!("made by {software} from {}", input.display())];
    for path in &outputs {
        let mut out = Vec::new();
        match ending(path) {
            "inp" => inp::write(&made, &provenance, controls.surface_size_mm, &mut out)?,
            "vtu" => vtu::write(&made, &[], &[], &mut out)?,
            _ => stl::write(&made.surface().triangles, &mut out)?,
        }
        write(path, &out)?;
    }
    let result = MeshResult::new(&made, &controls, true);
    let box_mm = solid.bounds().size();
    if common.json {
        let mut object = serde_json::to_value(result)?;
        object["seconds"] = seconds.into();
        object["files"] = outputs.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().into();
        return print_json(&object);
    }
    let mut lines = vec![
        format!("surface    {:.4} × {:.4} × {:.4} mm, {volume_mm3:.5} mm³", box_mm.x, box_mm.y, box_mm.z),
        format!(
            "mesh       {} nodes, {} triangles, {} tetrahedra, {:.5} mm³ in {seconds:.2} s",
            result.nodes,
            result.triangles,
            result.tetrahedra,
            made.volume_mm3()
        ),
        format!(
            "           dihedral angles {:.1}° to {:.1}° (1 %: {:.1}°), facet angles from {:.1}°",
            result.dihedral_deg.min,
            result.dihedral_deg.max,
            result.dihedral_deg.p01,
            result.facet_angle_deg.min
        ),
    ];
    lines.extend(outputs.iter().map(|path| format!("{:<10} {}", ending(path), path.display())));
    print(&(lines.join("\n") + "\n"))
}

/// Writes a whole file, or leaves what was there.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let written = std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path));
    written.with_context(|| {
        // Half a file is of use to nobody; where there is none, there is nothing to remove.
        let _ = std::fs::remove_file(&part);
        format!("cannot write {}; check its folder and the disk's free space", path.display())
    })
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or("")
}
