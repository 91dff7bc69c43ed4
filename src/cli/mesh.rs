//! `grainrig mesh`.

use super::mesh_files::{
    Input, Made, check_output, ending, input_help, open, output_help, read_endings, reads, whole,
};
use super::output::{print, print_json};
use super::progress::Progress;
use super::reconstruct::MeshOptions;
use super::{Common, usage};
use crate::daemon::{self, Finished};
use crate::pipeline::MeshResult;
use crate::session::{sha256_hex, to_json_value};
use anyhow::{Context as _, Result};
use clap::Args;
use grainrig_core::formats::{Particulars, inp, inp_read};
use grainrig_core::geometry::Aabb;
use grainrig_core::mesh::{Controls, Distances, mesh};
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::report::{Sheet, mesh_sheet};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A coarse mesh's sizes over a fine one's, as in the published comparison of volumes.
const COARSE: f64 = 2.0;

/// Options of `mesh`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[arg(help = input_help())]
    input: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
    /// Sizes where none are given: fine has about 50 000 tetrahedra, coarse an eighth of them.
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// Nodes of a tetrahedron in .inp, .msh and .vtu: 1 for four, 2 for ten.
    #[arg(long, value_name = "1|2", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    order: u8,
    /// Unit of the file's numbers, unless voxels state theirs; what is written is in mm.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    unit: Unit,
    /// Voxels above this value are the grain; needed unless there are just two values.
    #[arg(long, allow_negative_numbers = true)]
    threshold: Option<f64>,
    #[arg(long, value_name = "FILE", num_args = 1.., help = output_help())]
    out: Vec<PathBuf>,
    /// Write over files that are there already.
    #[arg(long)]
    force: bool,
}

/// Sizes by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Preset {
    /// Twice as large.
    Coarse,
    /// The default.
    Fine,
}

/// Units of length; files do not say theirs.
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

impl Arguments {
    fn order(&self) -> inp::Order {
        if self.order == 2 { inp::Order::Second } else { inp::Order::First }
    }
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let input = &arguments.input;
    let outputs = outputs(arguments)?;
    if reads(input).is_none() {
        return of_session(common, arguments);
    }
    let start = Instant::now();
    let name = || input.display().to_string();
    let Input { body, volume_mm3, what, box_mm, moved_mm, places, turned, bytes } =
        open(input, arguments.unit, arguments.threshold)?;
    let coarser = if arguments.preset == Some(Preset::Coarse) { COARSE } else { 1.0 };
    let diameter_mm = coarser * (6.0 * volume_mm3 / std::f64::consts::PI).cbrt();
    let asked = arguments.mesh.settings().unwrap_or_default();
    let longest_mm = Aabb::of(places.iter().copied()).map_or(0.0, |b| b.size().max());
    let doubts: Vec<Doubt> =
        body_doubt(longest_mm, arguments.unit).into_iter().chain(asked.doubts(longest_mm)).collect();
    plausible::slips(&doubts, common.as_given).with_context(name)?;
    let controls = asked.controls(diameter_mm);
    controls.check().map_err(usage)?;
    let notes = plausible::settle(doubts, common.as_given).with_context(name)?;
    let bar = super::progress::percent("meshing");
    let mut made = mesh(body.as_ref(), &controls, &mut |done| bar.set_position((done * 100.0) as u64))
        .with_context(name)?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let distances = Distances::measure(body.as_ref(), &made, &places).with_context(name)?;
    made.nodes.iter_mut().for_each(|p| *p += moved_mm);
    let result = MeshResult::new(&made, &controls, true);
    let said = Said { result: &result, distances: &distances, volume_mm3, made_mm3: made.volume_mm3() };
    let software = concat!("grainrig ", env!("CARGO_PKG_VERSION"));
    let mut provenance = vec![
        format!("made by {software} from {}", input.display()),
        format!("sha256 of the input {}", sha256_hex(&bytes)),
        format!("controls {}", serde_json::to_string(&controls)?),
    ];
    provenance.extend(notes.iter().cloned());
    if turned {
        provenance.push("the input was inside out and has been turned".to_owned());
    }
    let sheet = said.sheet(&made, &format!("Mesh of {}", input.display()));
    let order = arguments.order();
    let particulars = Particulars { order, band_mm: band(&controls), provenance: &provenance };
    let files = Made { mesh: &made, particulars, sheet: &sheet };
    outputs.iter().try_for_each(|path| files.write(path))?;
    if common.json {
        let mut object = to_json_value(&result)?;
        object["input_volume_mm3"] = volume_mm3.into();
        object["distance_to_input_mm"] = to_json_value(&distances.to_body)?;
        object["distance_from_input_mm"] = to_json_value(&distances.from_body)?;
        object["turned_outwards"] = turned.into();
        object["seconds"] = seconds.into();
        object["warnings"] = notes.into();
        object["files"] = outputs.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().into();
        return print_json(&object);
    }
    let mut lines = vec![format!(
        "{what:<10} {:.4} × {:.4} × {:.4} mm, {volume_mm3:.5} mm³",
        box_mm.x, box_mm.y, box_mm.z
    )];
    lines.extend(said.lines(seconds));
    lines.extend(notes.iter().map(|n| format!("note       {n}")));
    lines.extend(outputs.iter().map(|path| format!("{:<10} {}", ending(path), path.display())));
    print(&(lines.join("\n") + "\n"))
}

/// The doubt at a body's length, with the unit that its file's numbers seem to have.
pub(super) fn body_doubt(longest_mm: f64, unit: Unit) -> Option<Doubt> {
    let doubt = plausible::GRAIN.doubt(longest_mm)?;
    let Some(factor) = doubt.factor() else { return Some(doubt) };
    let in_mm = (factor * unit.in_mm()).log10().round() as i32;
    Some(match [(-3, "um"), (0, "mm"), (3, "m")].iter().find(|(power, _)| *power == in_mm) {
        Some((_, unit)) => {
            let meant = plausible::figure(factor * longest_mm);
            doubt.where_change(format!("{meant} mm (--unit {unit})"))
        }
        None => doubt,
    })
}

/// How far the contact sets reach: as far as the contacts were made fine, else one surface size, mm.
fn band(controls: &Controls) -> f64 {
    controls.contact_depth_mm.unwrap_or(controls.surface_size_mm)
}

/// Makes the mesh of a session's hull again, and writes what was asked for beside its products.
fn of_session(common: &Common, arguments: &Arguments) -> Result<()> {
    let input = &arguments.input;
    if arguments.unit != Unit::Mm || arguments.preset.is_some() || arguments.threshold.is_some() {
        return Err(usage(format!(
            "{}: --unit, --preset and --threshold go with a file (ending {}); a session knows its scale",
            input.display(),
            read_endings()
        )));
    }
    let folder = super::session_folder(common, input)?;
    let progress = Progress::new();
    let outcome = daemon::reconstruct(
        &folder,
        arguments.mesh.settings().as_ref(),
        true,
        common.as_given,
        &progress.watcher(),
    );
    progress.finish();
    let done = outcome?;
    for path in &arguments.out {
        match done.result.products.get(&ending(path)) {
            Some(made) if arguments.order == 1 => {
                whole(path, &std::fs::read(made).with_context(|| format!("cannot read {made}"))?)?;
            }
            _ => convert(arguments, &done, path)?,
        }
    }
    super::capture::report(common, &done)
}

/// Writes a session's mesh as a file that is not among its products.
fn convert(arguments: &Arguments, done: &Finished, path: &Path) -> Result<()> {
    let deck = &done.result.products["inp"];
    let bytes = std::fs::read(deck).with_context(|| format!("cannot read {deck}"))?;
    let mesh = inp_read::read(&bytes).with_context(|| deck.clone())?;
    let controls = done.result.mesh.controls.unwrap_or_else(|| Controls::for_size(1.0));
    let provenance = [
        format!("made by grainrig {} from {deck}", env!("CARGO_PKG_VERSION")),
        format!("sha256 of the input {}", sha256_hex(&bytes)),
    ];
    let sheet = mesh_sheet(
        format!("Mesh of {}", arguments.input.display()),
        &mesh.spread(),
        &mesh.quality(),
        Vec::new(),
    );
    let order = arguments.order();
    let particulars = Particulars { order, band_mm: band(&controls), provenance: &provenance };
    Made { mesh: &mesh, particulars, sheet: &sheet }.write(path)
}

/// What is told of a mesh.
struct Said<'a> {
    result: &'a MeshResult,
    distances: &'a Distances,
    volume_mm3: f64,
    made_mm3: f64,
}

impl Said<'_> {
    fn lines(&self, seconds: f64) -> Vec<String> {
        let (r, d) = (self.result, self.distances);
        vec![
            format!(
                "mesh       {} nodes, {} triangles, {} tetrahedra, {:.5} mm³ ({:+.3} %) in {seconds:.2} s",
                r.nodes,
                r.triangles,
                r.tetrahedra,
                self.made_mm3,
                100.0 * (self.made_mm3 / self.volume_mm3 - 1.0)
            ),
            format!(
                "           dihedral angles {:.1}° to {:.1}° (1 %: {:.1}°), facet angles from {:.1}°",
                r.dihedral_deg.min, r.dihedral_deg.max, r.dihedral_deg.p01, r.facet_angle_deg.min
            ),
            format!(
                "           distance to the surface {:.2e} mm in the mean, {:.2e} at most; from it {:.2e} and {:.2e}",
                d.to_body.mean_mm, d.to_body.max_mm, d.from_body.mean_mm, d.from_body.max_mm
            ),
            format!(
                "           least altitude {:.2} of the median: explicit steps of {:.2e} s in quartz",
                r.altitude_min_over_median,
                r.time_step_quartz_s.unwrap_or(f64::NAN)
            ),
        ]
    }

    fn sheet(&self, mesh: &grainrig_core::mesh::TetMesh, title: &str) -> Sheet {
        // The time it took is left out: the same input gives the same file.
        let figures = self.lines(0.0).iter().map(|l| l.replace(" in 0.00 s", "").trim().to_owned()).collect();
        mesh_sheet(title.to_owned(), &mesh.spread(), &mesh.quality(), figures)
    }
}

/// The files to write: of a known kind, and not the one that is read.
fn outputs(arguments: &Arguments) -> Result<Vec<PathBuf>> {
    let input = &arguments.input;
    let asked = if !arguments.out.is_empty() {
        arguments.out.clone()
    } else if reads(input).is_some() {
        // Not `with_extension`: of `grain.v2.stl` the name is `grain.v2`.
        let mut name = input.file_stem().unwrap_or_default().to_owned();
        name.push(".inp");
        vec![PathBuf::from(name)]
    } else {
        Vec::new()
    };
    asked.iter().try_for_each(|path| check_output(path, input, arguments.force))?;
    Ok(asked)
}
