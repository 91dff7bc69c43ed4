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
use crate::session::write_whole;
use anyhow::{Context as _, Result};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `mesh`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A closed surface (binary or ASCII STL), or a session.
    input: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
    /// Unit of the STL file's numbers; what is written is in mm.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    unit: Unit,
    /// Files to write; the ending says what: .inp (Abaqus), .vtu (`ParaView`), .stl. By default NAME.inp here
    /// for a surface; a session has its products in its own folder.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    out: Vec<PathBuf>,
}

/// Units of length; STL files do not say theirs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Unit {
    /// Micrometres.
    Um,
    /// Millimetres.
    Mm,
    /// Metres.
    M,
}

impl Unit {
    pub(super) fn in_mm(self) -> f64 {
        match self {
            Self::Um => 1e-3,
            Self::Mm => 1.0,
            Self::M => 1e3,
        }
    }
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let input = &arguments.input;
    let outputs = outputs(arguments)?;
    if ending(input) != "stl" {
        if arguments.unit != Unit::Mm {
            return Err(usage(format!(
                "{}: --unit goes with an STL file (ending .stl); a session knows its scale",
                input.display()
            )));
        }
        let folder = super::session_folder(common, input)?;
        let progress = Progress::new();
        let outcome =
            daemon::reconstruct(&folder, arguments.mesh.settings().as_ref(), true, &progress.watcher());
        progress.finish();
        let done = outcome?;
        for path in &arguments.out {
            let made = &done.result.products[&ending(path)];
            write(path, &std::fs::read(made).with_context(|| format!("cannot read {made}"))?)?;
        }
        return super::capture::report(common, &done);
    }
    let bytes =
        std::fs::read(input).with_context(|| format!("cannot read {}; check the path", input.display()))?;
    let mut surface = stl::read(&bytes).with_context(|| input.display().to_string())?;
    surface.vertices.iter_mut().for_each(|p| p.coords *= arguments.unit.in_mm());
    let volume_mm3 = surface.volume_mm3();
    let diameter_mm = (6.0 * volume_mm3 / std::f64::consts::PI).cbrt();
    let solid = Solid::new(surface).with_context(|| input.display().to_string())?;
    let controls = arguments.mesh.settings().unwrap_or_default().controls(diameter_mm);
    controls.check().map_err(usage)?;
    let bar = super::progress::percent("meshing");
    let start = Instant::now();
    let made = mesh(&solid, &controls, &mut |done| bar.set_position((done * 100.0) as u64))
        .with_context(|| input.display().to_string())?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let software = concat!("grainrig ", env!("CARGO_PKG_VERSION"));
    let provenance = [format!("made by {software} from {}", input.display())];
    for path in &outputs {
        let mut out = Vec::new();
        match ending(path).as_str() {
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

/// The files to write: of a known kind, and not the one that is read.
fn outputs(arguments: &Arguments) -> Result<Vec<PathBuf>> {
    let input = &arguments.input;
    let asked = if arguments.out.is_empty() && ending(input) != "stl" {
        Vec::new()
    } else if arguments.out.is_empty() {
        // Not `with_extension`: of `grain.v2.stl` the name is `grain.v2`.
        let mut name = input.file_stem().unwrap_or_default().to_owned();
        name.push(".inp");
        vec![PathBuf::from(name)]
    } else {
        arguments.out.clone()
    };
    let read = input.canonicalize().ok();
    for path in &asked {
        if !["inp", "vtu", "stl"].contains(&ending(path).as_str()) {
            return Err(usage(format!("{}: the ending must be .inp, .vtu or .stl", path.display())));
        }
        if read.is_some() && path.canonicalize().ok() == read {
            return Err(usage(format!(
                "{}: this is the file that is read; give --out another name",
                path.display()
            )));
        }
    }
    Ok(asked)
}

/// Writes a file, which appears whole or not at all.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_whole(folder, &name, bytes).map(|_| ()).with_context(|| format!("cannot write {}", path.display()))
}

/// The ending of a file's name, in small letters.
fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}
