//! The compressions of a session as they lie in its folder.

use super::asked::{asked, is_finished};
use super::{BESIDE, CompressSettings, JobError, MESH, Placing, RESULT, STATE, TEXT_LIMIT};
use crate::session::{LOCK, Recording, SessionError, check_name, open_inside, read_inside};
use serde::Serialize;
use std::fs::File;
use std::path::{Path, PathBuf};

/// How a compression stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CompressState {
    /// Other computations come first.
    Waiting,
    /// It is being computed.
    Running,
    /// It can go on.
    Interrupted,
    /// It came to its end.
    Complete,
}

/// One line of the list of compressions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompressLine {
    /// The folder's name.
    pub name: String,
    /// How it stands.
    pub state: CompressState,
    /// What was asked.
    pub settings: CompressSettings,
    /// How the body was to be meshed and laid down.
    pub placing: Placing,
}

/// A file of a compression.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CompressFile {
    /// Its name.
    pub file: String,
    /// Its length.
    pub bytes: u64,
}

/// A compression with its results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompressDetails {
    /// What the list says of it.
    #[serde(flatten)]
    pub line: CompressLine,
    /// What `result.json` holds, where it is there: when the compression has ended or was stopped.
    pub result: Option<serde_json::Value>,
    /// The results so far.
    pub files: Vec<CompressFile>,
}

/// What is under way with a compression in this program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Active {
    /// Other computations come first.
    Waiting,
    /// It is being computed.
    Running,
}

/// The compressions of a session, by name; `active` tells of a name what is under way with it.
pub(super) fn list(recording: &Recording, active: &dyn Fn(&str) -> Option<Active>) -> Vec<CompressLine> {
    let folder = recording.compressions_path().ok();
    let entries = folder.and_then(|folder| std::fs::read_dir(folder).ok()).into_iter().flatten().flatten();
    let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
    let mut all: Vec<CompressLine> =
        names.filter_map(|name| line(&recording.compression_path(&name).ok()?, name, active)).collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

fn line(folder: &Path, name: String, active: &dyn Fn(&str) -> Option<Active>) -> Option<CompressLine> {
    let asked = asked(folder)?;
    let state = match active(&name) {
        Some(Active::Waiting) => CompressState::Waiting,
        Some(Active::Running) => CompressState::Running,
        None if is_finished(folder) => CompressState::Complete,
        None => CompressState::Interrupted,
    };
    Some(CompressLine { name, state, settings: asked.settings, placing: asked.placing })
}

pub(super) fn details(
    recording: &Recording,
    name: &str,
    active: &dyn Fn(&str) -> Option<Active>,
) -> Result<CompressDetails, JobError> {
    let folder = place(recording, name)?;
    let line = line(&folder, name.to_owned(), active).ok_or(JobError::NoCompression)?;
    let text = read_inside(&folder, RESULT, TEXT_LIMIT).ok();
    let result = text.and_then(|text| serde_json::from_slice(&text).ok());
    Ok(CompressDetails { line, result, files: files(&folder) })
}

/// The folder of a compression: a file or a link of its name is none.
fn place(recording: &Recording, name: &str) -> Result<PathBuf, JobError> {
    match recording.compression_path(name) {
        Err(SessionError::Irregular { .. }) => Err(JobError::NoCompression),
        other => Ok(other?),
    }
}

/// Opens one of the files that the details list; the name is looked for there and nowhere else.
pub(super) fn open(recording: &Recording, name: &str, file: &str) -> Result<File, JobError> {
    let folder = place(recording, name)?;
    let listed = files(&folder).into_iter().find(|f| f.file == file).ok_or(JobError::NoCompression)?;
    open_inside(&folder, &listed.file).map_err(|_| JobError::NoCompression)
}

/// The results in a folder: plain files with plain names; not what only a resumed run reads.
fn files(folder: &Path) -> Vec<CompressFile> {
    let mut all: Vec<CompressFile> = (std::fs::read_dir(folder).into_iter().flatten().flatten())
        .filter_map(|entry| {
            let file = entry.file_name().to_str()?.to_owned();
            // A link's own kind is told here, not that of what it leads to.
            let about = entry.metadata().ok().filter(std::fs::Metadata::is_file)?;
            check_name("file", &file).ok()?;
            (![MESH, STATE, BESIDE, LOCK].contains(&file.as_str()))
                .then_some(CompressFile { file, bytes: about.len() })
        })
        .collect();
    all.sort_by(|a, b| a.file.cmp(&b.file));
    all
}
