//! Two finished sessions of one grain, with another side down, become one grain.

use super::finish::RESULT;
use super::recorded::{Numbered, WAITING_VIEWS, check_views, computation, send_recorded};
use super::{DaemonError, Watcher};
use crate::pipeline::{self, Merged, MergedFile, MeshSettings, Pipeline, SeenPose, Settings};
use crate::session::event::Happening;
use crate::session::{Recording, to_json, write_whole};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::time::Instant;

/// What a merging hands to its user.
#[derive(Debug, Clone)]
pub struct MergeFinished {
    /// The folder of the products.
    pub folder: PathBuf,
    /// The figures, with the products' whole paths.
    pub result: MergedFile,
}

/// Computes the cones of two sessions from their recordings, finds how the grain lies in the second to how it lies in
/// the first, carves it by the views of both, and writes `grain.inp`, `grain.vtu`, `grain.stl` and `result.json` into
/// `out`. The sessions are only read; the first one's settings and frame are the result's. Blocks until all is done.
///
/// # Errors
/// [`DaemonError`]; nothing is written then.
pub fn merge(
    [a, b]: [&Path; 2],
    out: &Path,
    mesh: Option<&MeshSettings>,
    watcher: &Watcher,
) -> Result<MergeFinished, DaemonError> {
    check_free(out)?;
    if a.canonicalize().ok() == b.canonicalize().ok() {
        return Err(DaemonError::OneSession { folder: a.into() });
    }
    let told = Numbered::new(watcher);
    let start = Instant::now();
    let (first, settings) = seen(a, &told)?;
    let (second, _) = seen(b, &told)?;
    let names = [first.name.as_str(), second.name.as_str()];
    let mut settings = settings;
    if let Some(asked) = mesh {
        settings.mesh = asked.over(&settings.mesh);
        settings.check()?;
    }
    let poses_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let made = pipeline::merge(&settings, [&first.pose, &second.pose], names, &|what| told.tell(what))?;
    let merge_s = start.elapsed().as_secs_f64();
    let timing = serde_json::json!({ "poses": poses_s, "merge": merge_s, "total": poses_s + merge_s });
    write(&made, out, &timing)
}

/// A session's pose.
struct Posed {
    name: String,
    pose: SeenPose,
}

/// Recomputes a session's cameras and silhouettes from its recording.
fn seen(folder: &Path, told: &Numbered) -> Result<(Posed, Settings), DaemonError> {
    let recording = Recording::read(folder)?;
    check_views(&recording)?;
    let (_, mut pipeline): (_, Pipeline) = computation(&recording)?;
    pipeline.settings.report.pictures = false;
    let name = recording.manifest().name.clone();
    let views = recording.views().len();
    told.tell(Happening::Started { session: name.clone(), views, already_captured: views });
    let (send, receive) = sync_channel(WAITING_VIEWS);
    let pose = std::thread::scope(|scope| {
        let recording = &recording;
        let feeding = scope.spawn(move || send_recorded(recording, &send, |view| view));
        let pose = pipeline.pose(&name, receive, &|what| told.tell(what));
        match feeding.join() {
            Ok(fed) => fed?,
            Err(panic) => std::panic::resume_unwind(panic),
        }
        Ok::<_, DaemonError>(pose?)
    })?;
    Ok((Posed { name, pose }, pipeline.settings))
}

/// Whether the products may go there: a folder with something in it is somebody's.
pub(super) fn check_free(out: &Path) -> Result<(), DaemonError> {
    let taken = match std::fs::read_dir(out) {
        Ok(mut entries) => entries.next().is_some(),
        Err(e) => e.kind() != std::io::ErrorKind::NotFound,
    };
    if taken { Err(DaemonError::NotFree { path: out.into() }) } else { Ok(()) }
}

fn write(made: &Merged, out: &Path, timing: &serde_json::Value) -> Result<MergeFinished, DaemonError> {
    const SOFTWARE: &str = concat!("grainrig ", env!("CARGO_PKG_VERSION"));
    let products = made.products(SOFTWARE)?;
    let names: BTreeMap<String, String> = products.iter().map(|p| (p.kind.clone(), p.file.clone())).collect();
    let result = made.result_file(SOFTWARE, names, timing.clone());
    let text = to_json(&result).map_err(|e| DaemonError::Encode(e.to_string()))?;
    std::fs::create_dir_all(out).map_err(|source| DaemonError::Write { path: out.into(), source })?;
    let mut paths = BTreeMap::new();
    let folder = out.canonicalize().unwrap_or_else(|_| out.to_owned());
    for p in products {
        write_whole(out, &p.file, &p.bytes)?;
        paths.insert(p.kind, folder.join(&p.file).display().to_string());
    }
    write_whole(out, RESULT, &text)?;
    paths.insert("result".into(), folder.join(RESULT).display().to_string());
    Ok(MergeFinished { result: made.result_file(SOFTWARE, paths, timing.clone()), folder })
}
