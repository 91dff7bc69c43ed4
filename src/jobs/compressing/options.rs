//! A compression of a session's grain, of a file or of a sphere, as the command line and HTTP ask for it.

use super::of_session::{claim_of, grain};
use super::others::others;
use super::{Claim, CompressInput, CompressProgress, CompressRequest, CompressResult, Compression};
use crate::jobs::error::Of as _;
use crate::jobs::mesh_files::{TURNED, Unit, outwards};
use crate::jobs::{Context, JobError};
use crate::session::{Recording, to_json_value};
use grainrig_core::contact::ContactError;
use grainrig_core::formats::{Format, Reads, endings};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A grain to be pressed between two plates.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields, default)]
pub struct CompressOptions {
    /// A session, a mesh of tetrahedra or a closed surface.
    #[arg(help = input_help(), required_unless_present_any = ["sphere_diameter_mm", "resume"])]
    #[schema(value_type = Option<String>)]
    pub input: Option<PathBuf>,
    /// A sphere of this diameter instead of an input, mm.
    #[arg(long, value_name = "MM", conflicts_with = "input", allow_negative_numbers = true)]
    pub sphere_diameter_mm: Option<f64>,
    /// Unit of the file's numbers.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    pub unit: Unit,
    /// Material, loading, mesh, and what is drawn beside.
    #[command(flatten)]
    pub request: CompressRequest,
    /// The folder of the results; by default a session's own compressions/, where the monitor shows it, and
    /// NAME-compressed here for a file.
    #[arg(long, value_name = "DIR")]
    #[schema(value_type = Option<String>)]
    pub out: Option<PathBuf>,
    /// Go on with the interrupted compression of this folder; its own settings hold.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["input", "sphere_diameter_mm", "out"])]
    #[schema(value_type = Option<String>)]
    pub resume: Option<PathBuf>,
}

impl CompressOptions {
    /// What is compressed, as results are named after it.
    pub fn subject(&self) -> PathBuf {
        self.resume.clone().or_else(|| self.input.clone()).unwrap_or_else(|| "sphere".into())
    }

    /// Whether it makes sense, as far as that can be told before the body is read.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        self.request(context).settings()?;
        match (&self.resume, &self.input, self.sphere_diameter_mm) {
            (Some(folder), None, None) if self.out.is_none() => context.names.input(folder).map(drop),
            (None, Some(input), None) if self.is_file() => context.names.input(input).map(drop),
            (None, Some(_), None) => {
                let recording = self.recording(context)?.ok_or(JobError::NoCompression)?;
                grain(&recording).map(drop)
            }
            (None, None, Some(d)) => sphere(d).map(drop),
            _ => Err(JobError::Usage(
                "give one of input, sphere_diameter_mm and resume; with resume no out".into(),
            )),
        }
    }

    /// Claims the folder, reads and meshes the body, or takes up an interrupted compression; `told` hears what is being done,
    /// and how much of that is done, 0 to 1.
    ///
    /// # Errors
    /// [`JobError`]: a body, figures or plates that cannot be computed, a folder that is not free, a disk that fails.
    pub fn begin(&self, context: &Context, told: &mut dyn FnMut(&str, f64)) -> Result<Compression, JobError> {
        if let Some(folder) = &self.resume {
            let mut compression = Compression::resume(&context.names.input(folder)?)?;
            let curves = others(&self.request, &context.names, None)?;
            if !curves.is_empty() {
                compression.draw_beside(curves)?;
            }
            return Ok(compression);
        }
        let request = self.request(context);
        let settings = request.settings()?;
        let recording = self.recording(context)?;
        let curves = others(&request, &context.names, recording.as_ref())?;
        // Said before it is read: a large surface alone takes seconds.
        told("reading the body", 0.0);
        let claim = match &recording {
            Some(recording) if self.out.is_none() => claim_of(recording, &request, true)?.1,
            recording => {
                let body = match recording {
                    Some(recording) => grain(recording)?,
                    None => self.body(context, told)?,
                };
                let subject = self.subject();
                let stem = if self.is_file() { subject.file_stem() } else { Some(subject.as_os_str()) };
                let usual =
                    || PathBuf::from(format!("{}-compressed", stem.unwrap_or_default().to_string_lossy()));
                let out = context.names.output(&self.out.clone().unwrap_or_else(usual))?;
                Claim::new(&out, body, &request.placing(), &settings).map_err(|e| self.named(e))?
            }
        };
        let mut compression = claim.build(told).map_err(|e| self.named(e))?;
        if !curves.is_empty() {
            compression.draw_beside(curves)?;
        }
        Ok(compression)
    }

    /// Compresses, and writes the results; what `--json` prints.
    ///
    /// # Errors
    /// As [`Self::begin`] and [`Compression::run`].
    pub fn run(
        &self,
        context: &Context,
        told: &mut dyn FnMut(CompressProgress),
    ) -> Result<(CompressResult, PathBuf), JobError> {
        let mut compression = self.begin(context, &mut |phase, done| context.working(phase, done))?;
        let result = compression.run(&context.stop, told)?;
        Ok((result, compression.folder().to_owned()))
    }

    /// What `--json` prints of a result.
    ///
    /// # Errors
    /// [`JobError::Encode`] where a figure is not finite.
    pub fn to_json(result: &CompressResult, folder: &Path) -> Result<Value, JobError> {
        let mut object = to_json_value(result)?;
        object["folder"] = json!(folder.canonicalize().unwrap_or_else(|_| folder.to_owned()));
        Ok(object)
    }

    pub(in crate::jobs) fn request(&self, context: &Context) -> CompressRequest {
        CompressRequest { as_given: self.request.as_given || context.as_given, ..self.request.clone() }
    }

    pub(in crate::jobs) fn is_file(&self) -> bool {
        self.input.as_ref().and_then(|path| Format::of(path)).is_some_and(is_body)
    }

    /// The session whose grain is compressed; `None` for a file or a sphere.
    ///
    /// # Errors
    /// [`JobError`]: no such session, or a file that is no body.
    pub(in crate::jobs) fn recording(&self, context: &Context) -> Result<Option<Recording>, JobError> {
        let Some(given) = self.input.as_deref().filter(|_| !self.is_file()) else { return Ok(None) };
        // A client has no other files.
        if !context.names.is_clients() && given.is_file() {
            return Err(JobError::Usage(format!(
                "{}: a body is read from {}; `grainrig mesh` makes one of them from other files",
                given.display(),
                endings(is_body, " or ")
            )));
        }
        Ok(Some(Recording::read(&context.names.session(given)?)?))
    }

    /// The body, whatever it comes from.
    ///
    /// # Errors
    /// [`JobError`]: no such session or file, one without a grain, a surface that is not closed.
    pub(in crate::jobs) fn input_body(
        &self,
        context: &Context,
        told: &mut dyn FnMut(&str, f64),
    ) -> Result<CompressInput, JobError> {
        match self.recording(context)? {
            Some(recording) => grain(&recording),
            None => self.body(context, told),
        }
    }

    /// The body of a file, or a sphere; `told` hears of one that was inside out.
    fn body(&self, context: &Context, told: &mut dyn FnMut(&str, f64)) -> Result<CompressInput, JobError> {
        if let Some(d) = self.sphere_diameter_mm {
            return sphere(d);
        }
        let Some(given) = self.input.as_deref() else {
            return Err(JobError::Usage("there is no input; give a session or a file".into()));
        };
        let name = given.display().to_string();
        let bytes = crate::system::read(&context.names.input(given)?)?;
        let in_mm = self.unit.in_mm();
        let mut mesh = match Format::of(given).and_then(|format| format.reads) {
            Some(Reads::Volume(read)) => read(&bytes).of(given)?,
            Some(Reads::Surface(read)) => {
                let mut surface = read(&bytes).of(given)?;
                surface.vertices.iter_mut().for_each(|p| p.coords *= in_mm);
                let (solid, was_inwards) = outwards(surface, given)?;
                if was_inwards {
                    told(&format!("{name}: {TURNED}"), 0.0);
                }
                let surface = solid.surface().clone();
                return Ok(CompressInput::Surface { surface, name, hidden_mm: None });
            }
            _ => {
                return Err(JobError::Usage(format!(
                    "{name}: a body is read from {}",
                    endings(is_body, " or ")
                )));
            }
        };
        mesh.nodes.iter_mut().for_each(|p| p.coords *= in_mm);
        if self.request.size_mm.is_some() || self.request.size_at_contact_mm.is_some() {
            return Err(JobError::Usage(
                "--size-mm and --size-at-contact-mm go with a surface or a session; this file is a mesh already".into(),
            ));
        }
        Ok(CompressInput::Mesh(mesh, name))
    }

    /// What is wrong with a file's body begins with its name.
    fn named(&self, error: JobError) -> JobError {
        let of_body = match &error {
            JobError::Mesh(_) | JobError::Doubt(_) => true,
            JobError::Contact(e) => {
                use ContactError::{NoRest, Parameter, Setting, Unstable};
                !matches!(e, Setting { .. } | Parameter { .. } | Unstable { .. } | NoRest { .. })
            }
            _ => false,
        };
        match &self.input {
            Some(path) if of_body => {
                JobError::Of { name: path.display().to_string(), source: Box::new(error) }
            }
            _ => error,
        }
    }
}

/// Whether a body to be compressed is read of such files.
fn is_body(format: &Format) -> bool {
    matches!(format.reads, Some(Reads::Surface(_) | Reads::Volume(_)))
}

/// What may be compressed, for a help text.
fn input_help() -> String {
    let volumes = endings(|f| matches!(f.reads, Some(Reads::Volume(_))), ", ");
    let surfaces = endings(|f| matches!(f.reads, Some(Reads::Surface(_))), ", ");
    format!("A session, a mesh of tetrahedra ({volumes}) or a closed surface ({surfaces})")
}

fn sphere(diameter_mm: f64) -> Result<CompressInput, JobError> {
    if diameter_mm.is_finite() && diameter_mm > 0.0 {
        return Ok(CompressInput::Sphere(diameter_mm));
    }
    Err(JobError::Usage(format!("--sphere-diameter-mm {diameter_mm}: it must be positive, in mm")))
}
