//! A recorded session computed again, or held against the hashes in its journal.

use super::finish::Finished;
use super::recorded::{check_views, computation, compute, conclude, lock};
use super::{Context, JobError, Watcher, merging};
use crate::pipeline::MeshSettings;
use crate::session::{Origin, Recording, Session, SessionError, VerifyReport, verify};
use crate::trace;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Hull and mesh of a session, to be computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ReconstructOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
    /// The mesh's controls, where they are not to be the configured ones.
    #[command(flatten)]
    #[serde(default)]
    pub mesh: MeshSettings,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long = "no-pictures", action = clap::ArgAction::SetFalse)]
    #[serde(default = "yes")]
    pub pictures: bool,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

fn yes() -> bool {
    true
}

impl ReconstructOptions {
    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        self.mesh.controls(1.0).check()?;
        drop(Recording::read(&context.names.session(&self.session)?)?);
        Ok(())
    }

    /// Computes, and writes the products.
    ///
    /// # Errors
    /// As [`reconstruct`].
    pub fn run(&self, context: &Context) -> Result<Finished, JobError> {
        let folder = context.names.session(&self.session)?;
        let as_given = context.as_given || self.as_given;
        reconstruct(&folder, self.mesh.asked(), self.pictures, as_given, &context.watcher)
    }
}

/// A session whose files are to be held against the hashes in its journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct VerifyOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
}

impl VerifyOptions {
    /// Whether there is such a session; a damaged one is what it is to tell of.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let folder = context.names.session(&self.session)?;
        match Recording::read(&folder) {
            Err(e @ SessionError::Absent { .. }) => Err(e.into()),
            _ => Ok(()),
        }
    }

    /// Reads everything, changes nothing.
    ///
    /// # Errors
    /// [`JobError`] where it can't be read; faults are none.
    pub fn run(&self, context: &Context) -> Result<VerifyReport, JobError> {
        let folder = context.names.session(&self.session)?;
        trace::job_of("verify", &folder, || Ok(verify(&folder)?))
    }
}

/// Computes a session's hull and mesh again and writes the products, with another mesh if wanted, and without pictures
/// where they are not; `as_given` takes figures that look like slips of unit.
///
/// # Errors
/// [`JobError`]; the session's pictures are only read.
pub fn reconstruct(
    folder: &Path,
    mesh: Option<&MeshSettings>,
    pictures: bool,
    as_given: bool,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    trace::job_of("reconstruct", folder, || reconstructed(folder, mesh, pictures, as_given, watcher))
}

fn reconstructed(
    folder: &Path,
    mesh: Option<&MeshSettings>,
    pictures: bool,
    as_given: bool,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    let mut session = Session::open(folder)?;
    let watch = Arc::clone(watcher);
    session.observe(move |e| watch(e));
    let session = Mutex::new(session);
    let recording = lock(&session).recording().clone();
    if recording.manifest().origin == Origin::Merge {
        let (outcome, mesh) = match merging::again(&recording, mesh, watcher) {
            Ok((made, mesh)) => (Ok(made), mesh),
            Err(error) => (Err(error), None),
        };
        return conclude(&session, outcome, mesh.as_ref());
    }
    check_views(&recording)?;
    let (_, mut pipeline) = computation(&recording)?;
    pipeline.settings.report.pictures &= pictures;
    pipeline.settings.as_given |= as_given;
    let mesh = mesh.map(|asked| asked.over(&pipeline.settings.mesh));
    if let Some(mesh) = &mesh {
        pipeline.settings.mesh = mesh.clone();
        pipeline.settings.check()?;
    }
    let outcome = compute(&recording, &pipeline, &session);
    conclude(&session, outcome, mesh.as_ref())
}
