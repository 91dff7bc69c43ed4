//! A surface's or a session's mesh, written as the files that are asked for.

use super::error::Of as _;
use super::finish::Finished;
use super::mesh_files::{
    Input, Made, Unit, check_output, ending, input_help, open, output_help, read_endings, reads, whole,
};
use super::reconstructing::reconstruct;
use super::{Context, JobError};
use crate::pipeline::{MeshResult, MeshSettings};
use crate::session::{sha256_hex, to_json_value};
use grainrig_core::formats::{Particulars, inp, inp_read};
use grainrig_core::geometry::{Aabb, Vector};
use grainrig_core::mesh::{Controls, Distances, TetMesh, mesh};
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::report::{Sheet, mesh_sheet};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A coarse mesh's sizes over a fine one's, as in the published comparison of volumes.
const COARSE: f64 = 2.0;

/// A mesh whose volume is farther off its body's, as a share, is said to be too coarse; by default it is a few parts in ten thousand.
const COARSE_VOLUME: f64 = 0.02;

/// A body to be meshed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct MeshOptions {
    /// A closed surface, a mesh whose surface is taken, voxels, or a session.
    #[arg(help = input_help())]
    #[schema(value_type = String)]
    pub input: PathBuf,
    /// The mesh's controls.
    #[command(flatten)]
    #[serde(default)]
    pub mesh: MeshSettings,
    /// Sizes where none are given: fine has about 50 000 tetrahedra, coarse an eighth of them.
    #[arg(long, value_enum)]
    pub preset: Option<MeshPreset>,
    /// Nodes of a tetrahedron in .inp, .msh and .vtu: 1 for four, 2 for ten.
    #[arg(long, value_name = "1|2", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    #[serde(default = "first_order")]
    pub order: u8,
    /// Unit of the file's numbers, unless voxels state theirs; what is written is in mm.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    #[serde(default)]
    pub unit: Unit,
    /// Voxels above this value are the grain; needed unless there are just two values.
    #[arg(long, allow_negative_numbers = true)]
    pub threshold: Option<f64>,
    /// Files to write; the ending says what. By default NAME.inp for a file; a session has its products in its own folder.
    #[arg(long, value_name = "FILE", num_args = 1.., help = output_help())]
    #[serde(default)]
    #[schema(value_type = Vec<String>)]
    pub out: Vec<PathBuf>,
    /// Write over files that are there already.
    #[arg(long)]
    #[serde(default)]
    pub force: bool,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

fn first_order() -> u8 {
    1
}

/// Sizes by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum MeshPreset {
    /// Twice as large.
    Coarse,
    /// The default.
    Fine,
}

/// A mesh that was made.
pub enum Meshed {
    /// Of a file.
    File(Box<MeshedFile>),
    /// Of a session's hull; its products are made anew with it.
    Session(Box<Finished>),
}

/// The mesh of a file's body.
pub struct MeshedFile {
    /// Its measures.
    pub result: MeshResult,
    /// How far it is from the body, and the body from it.
    pub distances: Distances,
    /// The body's volume, mm³, what that is the volume of, and its box, mm.
    pub body: (f64, &'static str, Vector),
    /// The mesh's volume, mm³.
    pub volume_mm3: f64,
    /// Whether the input's triangles faced inwards and were turned.
    pub turned: bool,
    /// Computing time, s.
    pub seconds: f64,
    /// What a person should know of the file.
    pub warnings: Vec<String>,
    /// Figures that look like slips of unit and were taken as they are.
    pub notes: Vec<String>,
    /// What was written, as it was named.
    pub files: Vec<PathBuf>,
}

impl MeshOptions {
    fn order(&self) -> inp::Order {
        if self.order == 2 { inp::Order::Second } else { inp::Order::First }
    }

    pub(super) fn is_file(&self) -> bool {
        reads(&self.input).is_some()
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        if !(1..=2).contains(&self.order) {
            return Err(JobError::Usage(format!("order is {}; it is 1 (four nodes) or 2 (ten)", self.order)));
        }
        self.outputs(context)?;
        if self.is_file() {
            context.names.input(&self.input)?;
        } else {
            self.check_of_session()?;
            context.names.session(&self.input)?;
        }
        self.mesh.controls(1.0).check()?;
        Ok(())
    }

    /// Makes the mesh and writes the files.
    ///
    /// # Errors
    /// [`JobError`]; where there is no mesh, or a file can't be written, none of the files is half there.
    pub fn run(&self, context: &Context) -> Result<Meshed, JobError> {
        let outputs = self.outputs(context)?;
        if self.is_file() {
            self.of_file(context, &outputs).map(|made| Meshed::File(Box::new(made)))
        } else {
            self.check_of_session()?;
            self.of_session(context, &outputs).map(|done| Meshed::Session(Box::new(done)))
        }
    }

    fn of_file(&self, context: &Context, outputs: &[(PathBuf, PathBuf)]) -> Result<MeshedFile, JobError> {
        let start = Instant::now();
        let path = context.names.input(&self.input)?;
        context.working("reading the body", 0.0);
        let Input { body, volume_mm3, what, box_mm, moved_mm, places, turned, mut warnings, bytes } =
            open(&path, self.unit, self.threshold)?;
        let coarser = if self.preset == Some(MeshPreset::Coarse) { COARSE } else { 1.0 };
        let diameter_mm = coarser * (6.0 * volume_mm3 / std::f64::consts::PI).cbrt();
        let longest_mm = Aabb::of(places.iter().copied()).map_or(0.0, |b| b.size().max());
        let doubts: Vec<Doubt> =
            body_doubt(longest_mm, self.unit).into_iter().chain(self.mesh.doubts(longest_mm)).collect();
        let as_given = context.as_given || self.as_given;
        plausible::slips(&doubts, as_given).of(&self.input)?;
        let controls = self.mesh.controls(diameter_mm);
        controls.check()?;
        let notes = plausible::settle(doubts, as_given).of(&self.input)?;
        let mut made =
            mesh(body.as_ref(), &controls, &mut |done| context.working("meshing", done)).of(&self.input)?;
        let seconds = start.elapsed().as_secs_f64();
        let distances = Distances::measure(body.as_ref(), &made, &places).of(&self.input)?;
        made.nodes.iter_mut().for_each(|p| *p += moved_mm);
        let mut provenance = vec![
            format!("made by {} from {}", super::SOFTWARE, self.input.display()),
            format!("sha256 of the input {}", sha256_hex(&bytes)),
            format!("controls {}", to_json_value(&controls)?),
        ];
        provenance.extend(notes.iter().cloned());
        if turned {
            provenance.push("the input was inside out and has been turned".to_owned());
        }
        let off = made.volume_mm3() / volume_mm3 - 1.0;
        if off.abs() > COARSE_VOLUME {
            warnings.push(format!(
                "the mesh's volume is {:+.1} % off the input's: its elements are too large for this shape; give a smaller \
                 --surface-size-mm, or the distance that it may be off (--distance-mm)",
                100.0 * off
            ));
        }
        let done = MeshedFile {
            result: MeshResult::new(&made, &controls, true),
            distances,
            body: (volume_mm3, what, box_mm),
            volume_mm3: made.volume_mm3(),
            turned,
            seconds,
            warnings,
            notes,
            files: outputs.iter().map(|(named, _)| named.clone()).collect(),
        };
        let sheet = done.sheet(&made, &format!("Mesh of {}", self.input.display()));
        let particulars =
            Particulars { order: self.order(), band_mm: band(&controls), provenance: &provenance };
        let files = Made { mesh: &made, particulars, sheet: &sheet };
        outputs.iter().try_for_each(|(_, place)| files.write(place))?;
        Ok(done)
    }

    fn check_of_session(&self) -> Result<(), JobError> {
        if self.unit != Unit::Mm || self.preset.is_some() || self.threshold.is_some() {
            return Err(JobError::Usage(format!(
                "{}: --unit, --preset and --threshold go with a file (ending {}); a session knows its scale",
                self.input.display(),
                read_endings()
            )));
        }
        Ok(())
    }

    /// Makes the mesh of a session's hull again, and writes what was asked for beside its products.
    fn of_session(&self, context: &Context, outputs: &[(PathBuf, PathBuf)]) -> Result<Finished, JobError> {
        let folder = context.names.session(&self.input)?;
        let as_given = context.as_given || self.as_given;
        let done = reconstruct(&folder, self.mesh.asked(), true, as_given, &context.watcher)?;
        for (_, path) in outputs {
            match done.result.products.get(&ending(path)) {
                Some(made) if self.order == 1 => whole(path, &crate::system::read(Path::new(made))?)?,
                _ => self.convert(&done, path)?,
            }
        }
        Ok(done)
    }

    /// Writes a session's mesh as a file that is not among its products.
    fn convert(&self, done: &Finished, path: &Path) -> Result<(), JobError> {
        let deck = Path::new(&done.result.products["inp"]);
        let bytes = crate::system::read(deck)?;
        let mesh = inp_read::read(&bytes).of(deck)?;
        let controls = done.result.mesh.controls.unwrap_or_else(|| Controls::for_size(1.0));
        let provenance = [
            format!("made by {} from {}", super::SOFTWARE, deck.display()),
            format!("sha256 of the input {}", sha256_hex(&bytes)),
        ];
        let sheet = mesh_sheet(
            format!("Mesh of {}", self.input.display()),
            &mesh.spread(),
            &mesh.quality(),
            Vec::new(),
        );
        let particulars =
            Particulars { order: self.order(), band_mm: band(&controls), provenance: &provenance };
        Made { mesh: &mesh, particulars, sheet: &sheet }.write(path)
    }

    /// The files to write, as they are named and where they are: of a known kind, and not the one that is read.
    fn outputs(&self, context: &Context) -> Result<Vec<(PathBuf, PathBuf)>, JobError> {
        let asked = if !self.out.is_empty() {
            self.out.clone()
        } else if self.is_file() {
            // Not `with_extension`: of `grain.v2.stl` the name is `grain.v2`.
            let mut name = self.input.file_stem().unwrap_or_default().to_owned();
            name.push(".inp");
            vec![PathBuf::from(name)]
        } else {
            Vec::new()
        };
        let input = if self.is_file() { context.names.input(&self.input)? } else { self.input.clone() };
        let placed = asked.into_iter().map(|named| {
            let place = context.names.output(&named)?;
            check_output(&place, &input, self.force)?;
            Ok((named, place))
        });
        placed.collect()
    }
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

impl MeshedFile {
    /// What `--json` prints.
    ///
    /// # Errors
    /// [`JobError::Encode`] where a figure is not finite.
    pub fn to_json(&self) -> Result<Value, JobError> {
        let mut object = to_json_value(&self.result)?;
        object["input_volume_mm3"] = self.body.0.into();
        object["distance_to_input_mm"] = to_json_value(&self.distances.to_body)?;
        object["distance_from_input_mm"] = to_json_value(&self.distances.from_body)?;
        object["turned_outwards"] = self.turned.into();
        object["seconds"] = self.seconds.into();
        object["warnings"] = [&self.notes[..], &self.warnings].concat().into();
        object["files"] = self.files.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().into();
        Ok(object)
    }

    /// The figures in words, a line each; in the time that is given, s.
    pub fn lines(&self, seconds: f64) -> Vec<String> {
        let (r, d) = (&self.result, &self.distances);
        vec![
            format!(
                "mesh       {} nodes, {} triangles, {} tetrahedra, {:.5} mm³ ({:+.3} %) in {seconds:.2} s",
                r.nodes,
                r.triangles,
                r.tetrahedra,
                self.volume_mm3,
                100.0 * (self.volume_mm3 / self.body.0 - 1.0)
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

    fn sheet(&self, mesh: &TetMesh, title: &str) -> Sheet {
        // The time it took is left out: the same input gives the same file.
        let figures = self.lines(0.0).iter().map(|l| l.replace(" in 0.00 s", "").trim().to_owned()).collect();
        mesh_sheet(title.to_owned(), &mesh.spread(), &mesh.quality(), figures)
    }
}
