//! The computation's products become files.

use super::JobError;
use crate::pipeline::MeshSettings;
use crate::pipeline::{
    CONVERGENCE, PipelineError, Product, Reconstruction, ResultFile, ResultHead, SHEET, products,
};
use crate::session::event::{Event, EventKind, ProductRecord};
use crate::session::{Recording, Session, read_inside, sha256_hex, to_json};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The file in `products/` that holds the figures.
pub const RESULT: &str = "result.json";

/// What a command hands to its user.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The session's folder.
    pub folder: PathBuf,
    /// The figures, with the products' whole paths and this run's own timing.
    pub result: ResultFile,
    /// The files that were written.
    pub files: Vec<ProductRecord>,
}

/// What a computation made: of one session's views, or of two sessions merged.
pub(super) trait Made {
    /// Its files, but for `result.json`.
    fn products(&self, software: &str, session: &str) -> Result<Vec<Product>, PipelineError>;
    /// Its figures, with what is to be stated beside them.
    fn result_file(&self, head: ResultHead) -> ResultFile;
    /// Seconds each stage took.
    fn timing_s(&self) -> serde_json::Value;
}

impl Made for Reconstruction {
    fn products(&self, software: &str, session: &str) -> Result<Vec<Product>, PipelineError> {
        products(self, software, session)
    }

    fn result_file(&self, head: ResultHead) -> ResultFile {
        self.result_file(head)
    }

    fn timing_s(&self) -> serde_json::Value {
        serde_json::json!(self.timing_s)
    }
}

/// The bytes of every product, `result.json` last; `timing` is what the file states.
pub(super) fn render(
    made: &dyn Made,
    software: &str,
    session: &str,
    timing: serde_json::Value,
) -> Result<Vec<(String, Vec<u8>)>, JobError> {
    let mut out: Vec<(String, Vec<u8>)> = Vec::new();
    let mut names = BTreeMap::new();
    for p in made.products(software, session)? {
        names.insert(p.kind, p.file.clone());
        out.push((p.file, p.bytes));
    }
    let head =
        ResultHead { software: software.into(), session: session.into(), products: names, timing_s: timing };
    let result = made.result_file(head);
    let text = to_json(&result).map_err(|e| JobError::Encode(e.to_string()))?;
    out.push((RESULT.into(), text));
    Ok(out)
}

/// What the rendered `result.json` holds.
pub(super) fn result_of(files: &[(String, Vec<u8>)]) -> Result<serde_json::Value, JobError> {
    let text = files.iter().find(|(name, _)| name == RESULT).map_or(&[][..], |(_, text)| text);
    serde_json::from_slice(text).map_err(|e| JobError::Encode(e.to_string()))
}

/// Writes the products into the session, valid all at once, and journals them.
pub(super) fn write(
    session: &mut Session,
    files: &[(String, Vec<u8>)],
    timing_s: serde_json::Value,
    mesh: Option<&MeshSettings>,
) -> Result<Vec<ProductRecord>, JobError> {
    let settings = mesh.map(serde_json::to_value).transpose().map_err(|e| JobError::Encode(e.to_string()))?;
    Ok(session.put_products(files, timing_s, settings)?)
}

/// Whether the newest products are journalled, and that all is done is not: a run was killed between the two.
pub(super) fn lacks_end(recording: &Recording) -> bool {
    let of = |e: &Event| match e.what {
        EventKind::Products { .. } => Some(true),
        EventKind::Complete { .. }
        | EventKind::Failed { .. }
        | EventKind::Aborted
        | EventKind::Started { .. } => Some(false),
        _ => None,
    };
    recording.events().iter().rev().find_map(of).unwrap_or(false)
}

/// Journals that all is done where only that is missing and the products are whole.
pub(super) fn end(session: &mut Session) -> Result<(), JobError> {
    let recording = session.recording();
    if !lacks_end(recording) || !recording.changed_products().is_empty() {
        return Ok(());
    }
    let Some(record) = recording.products().find(|p| p.file == RESULT) else { return Ok(()) };
    let text = read_inside(recording.folder(), &format!("products/{RESULT}"), record.bytes)?;
    let result = serde_json::from_slice(&text).map_err(|e| JobError::Encode(e.to_string()))?;
    session.append(EventKind::Complete { result })?;
    let folder = session.recording().folder().display();
    tracing::warn!("{folder}: a run was killed before it recorded its end; the session is complete now");
    Ok(())
}

fn write_one(session: &Session, name: &str, bytes: &[u8]) -> Result<ProductRecord, JobError> {
    let path = session.recording().product_path(name)?;
    let mut file = session.product(name)?;
    file.write_all(bytes).map_err(|source| JobError::Write { path, source })?;
    Ok(file.finish()?)
}

/// The names of the products that differ from the recorded ones. What has the recorded bytes but is missing or
/// damaged on the disk is written again.
pub(super) fn compare(recording: &Recording, files: Vec<(String, Vec<u8>)>) -> Result<Vec<String>, JobError> {
    let mut differs = Vec::new();
    let mut lost = Vec::new();
    for (name, bytes) in files {
        let sha256 = sha256_hex(&bytes);
        if recording.products().any(|p| p.file == name && p.sha256 == sha256) {
            // Its hash is the recorded one, which this one's is as well.
            if recording.product(&name).is_err() {
                lost.push((name, bytes));
            }
        } else {
            differs.push(name);
        }
    }
    if !lost.is_empty() {
        let session = Session::open(recording.folder())?;
        for (name, bytes) in lost {
            write_one(&session, &name, &bytes)?;
        }
    }
    Ok(differs)
}

/// The whole path of each product, by kind: `inp`, `vtu`, `stl`, `result`, `calibration`, `outline_00` and so on.
pub(super) fn product_paths<'a>(
    folder: &Path,
    files: impl IntoIterator<Item = &'a ProductRecord>,
) -> BTreeMap<String, String> {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let mut paths = BTreeMap::new();
    for f in files {
        let path = folder.join("products").join(&f.file);
        paths.insert(kind(&f.file), path.display().to_string());
    }
    paths
}

/// What a product's file is.
fn kind(file: &str) -> String {
    let (stem, ending) = file.rsplit_once('.').unwrap_or((file, ""));
    match (stem, ending) {
        ("grain", ending) => ending.into(),
        (SHEET | CONVERGENCE, "png") => format!("{stem}_png"),
        (stem, _) => stem.into(),
    }
}

/// The result as a command prints it: whole paths, this run's timing.
pub(super) fn finished(
    made: &dyn Made,
    software: &str,
    folder: &Path,
    session: &str,
    files: Vec<ProductRecord>,
) -> Finished {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let paths = product_paths(&folder, &files);
    let timing = made.timing_s();
    let (software, session) = (software.into(), session.into());
    let head = ResultHead { software, session, products: paths, timing_s: timing };
    Finished { result: made.result_file(head), folder, files }
}
