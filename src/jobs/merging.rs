//! Two finished sessions of one grain, with another side down, become one grain: a session like others, without pictures of
//! its own.

use super::finish::{self, Finished, Made};
use super::recorded::{check_views, computation, fed, record};
use super::replaying::Numbered;
use super::{Context, JobError, Watcher};
use crate::pipeline::{
    self, Merged, MeshSettings, Pipeline, PipelineError, Product, ResultFile, ResultHead, SeenPose, Settings,
};
use crate::session::event::EventKind;
use crate::session::{Manifest, MergeSource, Origin, Plan, Recording, SessionError, Store, check_name};
use crate::trace;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Two captures of one grain, another side down in the second, to become one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct MergeOptions {
    /// The first session: its name in the data folder, or its folder's path. The result is in its frame.
    #[schema(value_type = String)]
    pub a: PathBuf,
    /// The second session: the same grain with another side down.
    #[schema(value_type = String)]
    pub b: PathBuf,
    /// The merged grain's session, which must not exist yet: its name in the data folder, or its folder's path.
    #[arg(long = "out", value_name = "NAME")]
    #[schema(value_type = String)]
    pub session: PathBuf,
    /// The mesh's controls, where they are not to be the first capture's.
    #[command(flatten)]
    #[serde(default)]
    pub mesh: MeshSettings,
}

impl MergeOptions {
    fn places(&self, context: &Context) -> Result<([PathBuf; 2], PathBuf), JobError> {
        let sources = [context.names.session(&self.a)?, context.names.session(&self.b)?];
        Ok((sources, context.names.new_session(&self.session)?))
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        self.mesh.controls(1.0).check()?;
        let ([a, b], out) = self.places(context)?;
        open([&a, &b], &out).map(drop)
    }

    /// Merges.
    ///
    /// # Errors
    /// As [`merge`].
    pub fn run(&self, context: &Context) -> Result<Finished, JobError> {
        let ([a, b], out) = self.places(context)?;
        merge([&a, &b], &out, self.mesh.asked(), &context.watcher)
    }
}

/// The name of a session that is to be made of two, and the two.
fn open([a, b]: [&Path; 2], out: &Path) -> Result<(String, [Recording; 2]), JobError> {
    let name = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
    check_name("session name", &name)?;
    if out.symlink_metadata().is_ok() {
        return Err(JobError::Taken { path: out.into() });
    }
    if a == b || a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b)) {
        return Err(JobError::OneSession { folder: a.into() });
    }
    Ok((name, [Recording::read(a)?, Recording::read(b)?]))
}

/// Computes the cones of two sessions from their recordings, finds how the grain lies in the second to how it lies in
/// the first, carves it by the views of both, and makes a session of it in the folder `out`, whose name is the session's.
/// The two are only read; the first one's settings and frame are the result's. Blocks until all is done. The session
/// appears whole, with its products, or not at all.
///
/// # Errors
/// [`JobError`]; nothing is written then.
pub fn merge(
    poses: [&Path; 2],
    out: &Path,
    mesh: Option<&MeshSettings>,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    trace::job_of("merge", out, || merged(poses, out, mesh, watcher))
}

fn merged(
    [a, b]: [&Path; 2],
    out: &Path,
    mesh: Option<&MeshSettings>,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    let (name, recordings) = open([a, b], out)?;
    let (made, mesh) = combine(&recordings, mesh, watcher)?;
    let data = match out.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(data).map_err(|source| JobError::Write { path: data.into(), source })?;
    let first = recordings[0].manifest();
    let plan = Plan { views: Vec::new(), ..first.plan.clone() };
    let mut manifest = Manifest::new(&name, Origin::Merge, plan, first.config.clone());
    manifest.geometry = first.geometry.clone();
    for recording in &recordings {
        manifest.merged_from.push(source(recording, data)?);
    }
    let mut staged = Store::new(data).stage(&manifest)?;
    let session = staged.session();
    let started = EventKind::Started { session: name.clone(), views: 0, already_captured: 0 };
    session.append(started)?;
    let Finished { files, .. } = record(session, &made, mesh.as_ref())?;
    let session = staged.publish()?;
    Ok(finish::finished(&made, &manifest.software, session.recording().folder(), &name, files))
}

/// Merges a merged session's captures again; also the mesh that it was made with, where one is asked for.
///
/// # Errors
/// [`JobError::Source`] where a capture is missing or is another one; as [`merge`] otherwise.
pub(super) fn again(
    recording: &Recording,
    mesh: Option<&MeshSettings>,
    watcher: &Watcher,
) -> Result<(MadeMerge, Option<MeshSettings>), JobError> {
    let manifest = recording.manifest();
    let mut captures = Vec::new();
    for source in &manifest.merged_from {
        let path = recording.folder().join(&source.folder);
        let wrong = |reason: String| JobError::Source {
            merged: manifest.name.clone(),
            name: source.name.clone(),
            reason,
            path: path.clone(),
        };
        let capture = match Recording::read(&path) {
            Err(SessionError::Absent { .. }) => return Err(wrong("which is not there any more".into())),
            other => other?,
        };
        if capture.evidence_sha256()? != source.sha256 {
            return Err(wrong("and another one has its place: its manifest or its pictures differ".into()));
        }
        captures.push(capture);
    }
    let [a, b] = &captures[..] else {
        return Err(wrong_count(&manifest.name, captures.len()));
    };
    combine(&[a.clone(), b.clone()], mesh, watcher)
}

/// A manifest with another number of sources is refused when it is read.
fn wrong_count(name: &str, sources: usize) -> JobError {
    JobError::Frozen { session: name.into(), part: "sources", reason: format!("there are {sources}, not 2") }
}

/// What is kept of a capture: where it is, and what it was.
fn source(recording: &Recording, data: &Path) -> Result<MergeSource, JobError> {
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = whole(recording.folder());
    // A data folder may be moved; its sessions stay beside one another.
    let folder = match (folder.parent(), folder.file_name()) {
        (Some(parent), Some(name)) if parent == whole(data) => Path::new("..").join(name),
        _ => folder,
    };
    let name = recording.manifest().name.clone();
    Ok(MergeSource { name, folder, sha256: recording.evidence_sha256()? })
}

/// A merging with what it took.
pub(super) struct MadeMerge {
    merged: Merged,
    timing_s: serde_json::Value,
}

impl Made for MadeMerge {
    fn products(&self, software: &str, _: &str) -> Result<Vec<Product>, PipelineError> {
        self.merged.products(software)
    }

    fn result_file(&self, head: ResultHead) -> ResultFile {
        self.merged.result_file(head)
    }

    fn timing_s(&self) -> serde_json::Value {
        self.timing_s.clone()
    }
}

fn combine(
    [a, b]: &[Recording; 2],
    mesh: Option<&MeshSettings>,
    watcher: &Watcher,
) -> Result<(MadeMerge, Option<MeshSettings>), JobError> {
    let told = Numbered::new(watcher);
    let start = Instant::now();
    let (first, mut settings) = seen(a, &told)?;
    let (second, _) = seen(b, &told)?;
    let names = [first.name.as_str(), second.name.as_str()];
    let mesh = mesh.map(|asked| asked.over(&settings.mesh));
    if let Some(mesh) = &mesh {
        settings.mesh = mesh.clone();
        settings.check()?;
    }
    let poses_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let merged = pipeline::merge(&settings, [&first.pose, &second.pose], names, &|what| told.tell(what))?;
    let merge_s = start.elapsed().as_secs_f64();
    let timing_s = serde_json::json!({ "poses": poses_s, "merge": merge_s, "total": poses_s + merge_s });
    Ok((MadeMerge { merged, timing_s }, mesh))
}

/// A session's pose.
struct Posed {
    name: String,
    pose: SeenPose,
}

/// Recomputes a session's cameras and silhouettes from its recording.
fn seen(recording: &Recording, told: &Numbered) -> Result<(Posed, Settings), JobError> {
    let name = recording.manifest().name.clone();
    if recording.manifest().origin == Origin::Merge {
        let sources = recording.manifest().merged_from.iter().map(|s| s.name.clone()).collect();
        return Err(JobError::MergedAlready { name, sources });
    }
    check_views(recording)?;
    let (_, mut pipeline): (_, Pipeline) = computation(recording)?;
    pipeline.settings.report.pictures = false;
    let views = recording.views().len();
    told.tell(EventKind::Started { session: name.clone(), views, already_captured: views });
    let pose = fed(recording, |views| pipeline.pose(&name, views, &|what| told.tell(what)))?;
    Ok((Posed { name, pose }, pipeline.settings))
}
