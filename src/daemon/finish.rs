//! The computation's products become files.

use super::DaemonError;
use crate::pipeline::MeshSettings;
use crate::pipeline::{CONVERGENCE, Reconstruction, ResultFile, SHEET, products};
use crate::session::event::{Happening, ProductRecord};
use crate::session::{Recording, Session, sha256_hex, to_json};
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

/// The bytes of every product, `result.json` last; `timing` is what the file states.
pub(super) fn render(
    made: &Reconstruction,
    software: &str,
    session: &str,
    timing: serde_json::Value,
) -> Result<Vec<(String, Vec<u8>)>, DaemonError> {
    let mut out: Vec<(String, Vec<u8>)> = Vec::new();
    let mut names = BTreeMap::new();
    for p in products(made, software, session)? {
        names.insert(p.kind, p.file.clone());
        out.push((p.file, p.bytes));
    }
    let result = made.result_file(software, session, names, timing);
    let text = to_json(&result).map_err(|e| DaemonError::Encode(e.to_string()))?;
    out.push((RESULT.into(), text));
    Ok(out)
}

/// What the rendered `result.json` holds.
pub(super) fn result_of(files: &[(String, Vec<u8>)]) -> Result<serde_json::Value, DaemonError> {
    let text = files.iter().find(|(name, _)| name == RESULT).map_or(&[][..], |(_, text)| text);
    serde_json::from_slice(text).map_err(|e| DaemonError::Encode(e.to_string()))
}

/// Writes the products whole into the session and journals them.
pub(super) fn write(
    session: &mut Session,
    files: Vec<(String, Vec<u8>)>,
    timing_s: serde_json::Value,
    mesh: Option<&MeshSettings>,
) -> Result<Vec<ProductRecord>, DaemonError> {
    let mut records = Vec::new();
    for (name, bytes) in files {
        records.push(write_one(session, &name, &bytes)?);
    }
    let settings =
        mesh.map(serde_json::to_value).transpose().map_err(|e| DaemonError::Encode(e.to_string()))?;
    session.append(Happening::Products { files: records.clone(), timing_s, settings })?;
    Ok(records)
}

fn write_one(session: &Session, name: &str, bytes: &[u8]) -> Result<ProductRecord, DaemonError> {
    let path = session.recording().product_path(name)?;
    let mut file = session.product(name)?;
    file.write_all(bytes).map_err(|source| DaemonError::Write { path, source })?;
    Ok(file.finish()?)
}

/// The names of the products that differ from the recorded ones. What has the recorded bytes but is missing or
/// damaged on the disk is written again.
pub(super) fn compare(
    recording: &Recording,
    files: Vec<(String, Vec<u8>)>,
) -> Result<Vec<String>, DaemonError> {
    let mut differs = Vec::new();
    let mut lost = Vec::new();
    for (name, bytes) in files {
        let sha256 = sha256_hex(&bytes);
        if recording.products().any(|p| p.file == name && p.sha256 == sha256) {
            let there = std::fs::read(recording.product_path(&name)?);
            if there.is_ok_and(|there| there == bytes) {
                continue;
            }
            lost.push((name, bytes));
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
    made: &Reconstruction,
    software: &str,
    folder: &Path,
    session: &str,
    files: Vec<ProductRecord>,
) -> Finished {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let paths = product_paths(&folder, &files);
    let timing = serde_json::json!(made.timing_s);
    Finished { result: made.result_file(software, session, paths, timing), folder, files }
}
