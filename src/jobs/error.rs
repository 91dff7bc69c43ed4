//! Why a job did not end with a result.

use super::BackgroundError;
use crate::acquire::AcquireError;
use crate::config::ConfigError;
use crate::pipeline::PipelineError;
use crate::rig::RigError;
use crate::session::{EncodeError, Fault, SessionError};
use crate::system::FileError;
use grainrig_core::calibrate::ScaleError;
use grainrig_core::contact::ContactError;
use grainrig_core::contact::experiment::ExperimentError;
use grainrig_core::formats::ExportError;
use grainrig_core::geometry::MeshFault;
use grainrig_core::mesh::MeshError;
use grainrig_core::study::StudyError;
use std::path::{Path, PathBuf};

/// The first few faults, each with its remedy.
fn first_faults(faults: &[Fault]) -> String {
    let mut lines: Vec<String> = faults.iter().take(3).map(ToString::to_string).collect();
    if faults.len() > 3 {
        lines.push(format!("and {} more, which `grainrig verify` names", faults.len() - 3));
    }
    lines.join("; ")
}

/// Why a job did not end with a result. What was captured stays.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The session on the disk.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A session whose recorded files are not as recorded.
    #[error("session {session} is damaged: {}", first_faults(faults))]
    Damaged {
        /// The session's name.
        session: String,
        /// What is wrong.
        faults: Vec<Fault>,
    },
    /// A recording that does not come out as it did.
    #[error("the replay differs from the recorded products in {}; the recording was made by {software}", products.join(", "))]
    Differs {
        /// Names of the products that differ.
        products: Vec<String>,
        /// What made the recording.
        software: String,
    },
    /// It is not computed now.
    #[error(transparent)]
    Queue(#[from] BackgroundError),
    /// The capture.
    #[error(transparent)]
    Acquire(#[from] AcquireError),
    /// A device.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The compression.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A body that cannot be meshed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A file of the compression could not be made.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A folder without a compression that can go on.
    #[error("{} has no compression to go on with: {reason}; begin it anew in another folder", path.display())]
    Resume {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The computation.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Somebody stopped the run.
    #[error(
        "the run was stopped after {captured} of {planned} views; `grainrig resume {session}` goes on with it"
    )]
    Aborted {
        /// Name of the session.
        session: String,
        /// Views captured.
        captured: usize,
        /// Views in the plan.
        planned: usize,
    },
    /// What is wrong with a file, or with what is in it.
    #[error("{name}: {source}")]
    Of {
        /// The file, as it was named.
        name: String,
        /// What is wrong.
        source: Box<JobError>,
    },
    /// It is not in the state for that.
    #[error("{0}")]
    NotNow(&'static str),
    /// Another run goes on.
    #[error("the rig is capturing session {0}; wait for its end, or abort it")]
    Busy(String),
    /// A session without a finished grain.
    #[error(
        "session {session} is not complete: it has no surface to compress; `grainrig resume {session}` makes it"
    )]
    Unfinished {
        /// The session.
        session: String,
    },
    /// No such compression or file.
    #[error("there is no compression or file of that name; see the session's list")]
    NoCompression,
    /// What was asked makes no sense; says value, limit and remedy.
    #[error("{0}")]
    Usage(String),
    /// What is in a file makes no sense; says value, limit and remedy.
    #[error("{0}")]
    Content(String),
    /// A file that can't be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A surface that is not closed.
    #[error(transparent)]
    Surface(#[from] MeshFault),
    /// A laboratory's test that can't be read.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A name that leads nowhere a client may go.
    #[error(
        "{given:?} is no name for {what} here: {reason}; give the name of one that was put there (PUT /api/v1/files), or \
         FOLDER/NAME"
    )]
    Name {
        /// As it was given.
        given: String,
        /// What was wanted.
        what: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A figure that looks like a slip of unit.
    #[error(transparent)]
    Doubt(#[from] grainrig_core::plausible::Doubt),
    /// A product could not be written.
    #[error("cannot write {}: {source}; {}; then `grainrig reconstruct`", path.display(), crate::system::remedy(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A folder that is not free.
    #[error("{} is not an empty folder; give --out the name of a folder that does not exist yet", path.display())]
    NotFree {
        /// The folder.
        path: PathBuf,
    },
    /// A session that was to be made is there.
    #[error("{} is there already; give --out the name of a session that does not exist yet", path.display())]
    Taken {
        /// Its folder.
        path: PathBuf,
    },
    /// A capture that a merged grain was made from is not there, or is another.
    #[error(
        "the grain {merged} was merged from session {name}, {reason}; put that session back at {}, or merge anew",
        path.display()
    )]
    Source {
        /// Name of the merged session.
        merged: String,
        /// Name of the capture.
        name: String,
        /// What is wrong.
        reason: String,
        /// Where it was looked for.
        path: PathBuf,
    },
    /// A merged grain where a capture is wanted.
    #[error(
        "{name} is a merged grain and has no views of its own; merge captures: it was made from {}",
        sources.join(" and ")
    )]
    MergedAlready {
        /// Name of the merged session.
        name: String,
        /// Names of its captures.
        sources: Vec<String>,
    },
    /// One session, twice.
    #[error("both sessions are {}; give two captures of the grain, with another side down in the second", folder.display())]
    OneSession {
        /// Its folder.
        folder: PathBuf,
    },
    /// The simulated rig's truth could not be written.
    #[error("cannot write the rig's truth to {}: {reason}; give a folder that can be written", path.display())]
    Truth {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The system gives no thread.
    #[error("the run cannot begin: {source}; close other programs, or raise the limit of processes")]
    Thread {
        /// The system's reason.
        source: std::io::Error,
    },
    /// The figures can't be encoded.
    #[error("the result cannot be encoded: {0}; a figure is not finite, please report it with the session")]
    Encode(String),
    /// The manifest's configuration is from another version.
    #[error(
        "session {session}: its frozen {part} cannot be read by this version: {reason}; use the version that made it"
    )]
    Frozen {
        /// Name of the session.
        session: String,
        /// `configuration` or `cameras`.
        part: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A picture that shows no body of known size.
    #[error("{file}: {reason}")]
    Body {
        /// The picture.
        file: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// No scale from the pictures.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// More or fewer angles than pictures.
    #[error(
        "{angles} angle(s) are given for {pictures} picture(s); give one for each, in the order of the names"
    )]
    Angles {
        /// Angles given.
        angles: usize,
        /// Pictures found.
        pictures: usize,
    },
    /// A file that is no measured scale.
    #[error(
        "{} cannot be used as a calibration: {reason}; give a file that `grainrig calibrate scale --out` wrote",
        path.display()
    )]
    Calibration {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A scale from pictures of another size.
    #[error(
        "the calibration was made with pictures of {} × {} px, these have {} × {} px: a scale holds for one camera \
         setting; calibrate with that setting, or give --mm-per-px",
        calibrated[0], calibrated[1], pictures[0], pictures[1]
    )]
    OtherSize {
        /// Width and height of the calibration's pictures.
        calibrated: [u32; 2],
        /// Width and height of the pictures.
        pictures: [u32; 2],
    },
    /// A background picture that can't be read.
    #[error(
        "the background picture {file} cannot be used: {reason}; give a whole JPEG, PNG or TIFF of the empty stage"
    )]
    Background {
        /// The file.
        file: String,
        /// What is wrong.
        reason: String,
    },
}

impl From<EncodeError> for JobError {
    fn from(error: EncodeError) -> Self {
        Self::Encode(error.to_string())
    }
}

/// What is wrong begins with the name of its file.
pub(super) trait Of<T> {
    /// With the file's name, as it was given.
    fn of(self, file: &Path) -> Result<T, JobError>;
}

impl<T, E: Into<JobError>> Of<T> for Result<T, E> {
    fn of(self, file: &Path) -> Result<T, JobError> {
        self.map_err(|e| JobError::Of { name: file.display().to_string(), source: Box::new(e.into()) })
    }
}
