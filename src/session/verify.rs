//! Whether a session is still what was recorded.

use super::SessionError;
use super::disk::{LOCK, Lock, sha256_hex};
use super::recording::{COMPRESSIONS, FRAMES, JOURNAL, MANIFEST, PRODUCTS, REJECTED, Recording, State};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// What [`verify`] found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VerifyReport {
    /// The session's name, from its manifest; `None` where that is damaged.
    pub session: Option<String>,
    /// How far the session has come, as far as its journal is whole.
    pub state: Option<State>,
    /// Whether somebody writes it now: unfinished files are then no faults.
    pub busy: bool,
    /// Records of the journal that are whole and chained.
    pub records: usize,
    /// Views in the plan.
    pub planned: usize,
    /// Pictures and RAW files whose hash was compared.
    pub frames: usize,
    /// Products whose hash was compared.
    pub products: usize,
    /// Everything that is not as recorded.
    pub faults: Vec<Fault>,
}

impl VerifyReport {
    /// Whether everything is as recorded.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }
}

/// Something that is not as recorded. Paths are relative to the session's folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum Fault {
    /// The manifest is missing, unreadable or from another version.
    #[error("manifest.json: {reason}")]
    Manifest {
        /// What is wrong.
        reason: String,
    },
    /// The journal is damaged.
    #[error("journal.jsonl, line {line}: {reason}")]
    Journal {
        /// Line number, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// The journal's last line is torn: a run was killed in mid-write; the next run cuts it off.
    #[error(
        "journal.jsonl: the last {bytes} bytes are no whole line; opening the session to resume it cuts them off"
    )]
    Torn {
        /// Bytes after the last whole line.
        bytes: usize,
    },
    /// A recorded file is not there.
    #[error("{file}: missing; restore it from a backup")]
    Missing {
        /// The file.
        file: String,
    },
    /// A recorded file cannot be read.
    #[error("{file}: {reason}; check its permissions and the disk")]
    Unreadable {
        /// The file.
        file: String,
        /// The system's reason.
        reason: String,
    },
    /// A recorded file has changed.
    #[error(
        "{file}: changed ({found_bytes} bytes, SHA-256 {found}; recorded {recorded_bytes} bytes, {recorded}); restore it from a backup"
    )]
    Changed {
        /// The file.
        file: String,
        /// Bytes found.
        found_bytes: u64,
        /// Bytes recorded.
        recorded_bytes: u64,
        /// SHA-256 found.
        found: String,
        /// SHA-256 recorded.
        recorded: String,
    },
    /// A file that nothing has recorded.
    #[error("{file}: not in the journal; remove it, or resume the session")]
    Extra {
        /// The file.
        file: String,
    },
}

/// Compares every file of the session in a folder with what was recorded. Changes nothing; reads everything.
///
/// # Errors
/// [`SessionError`] where there is no session, or a folder cannot be listed.
pub fn verify(folder: &Path) -> Result<VerifyReport, SessionError> {
    let mut report = VerifyReport {
        session: None,
        state: None,
        busy: Lock::is_held(folder),
        records: 0,
        planned: 0,
        frames: 0,
        products: 0,
        faults: Vec::new(),
    };
    let (recording, damage) = match Recording::read_to_damage(folder) {
        Ok(found) => found,
        Err(SessionError::Manifest { reason, .. }) => {
            report.faults.push(Fault::Manifest { reason });
            return Ok(report);
        }
        Err(e) => return Err(e),
    };
    report.session = Some(recording.manifest().name.clone());
    report.state = Some(recording.state());
    report.records = recording.events().len();
    report.planned = recording.manifest().plan.views.len();
    if let Some(d) = damage {
        report.faults.push(Fault::Journal { line: d.line, reason: d.reason });
    } else if recording.torn_bytes() > 0 && !report.busy {
        report.faults.push(Fault::Torn { bytes: recording.torn_bytes() });
    }
    let mut known = BTreeSet::from(
        [MANIFEST, JOURNAL, LOCK, FRAMES, PRODUCTS, COMPRESSIONS, REJECTED].map(str::to_owned),
    );
    for v in recording.views() {
        report.frames += 1;
        let file = format!("{FRAMES}/{}", v.file);
        report.faults.extend(compare(folder, &file, v.bytes, &v.sha256));
        known.insert(file);
        for other in &v.others {
            report.frames += 1;
            let file = format!("{FRAMES}/{}", other.file);
            report.faults.extend(compare(folder, &file, other.bytes, &other.sha256));
            known.insert(file);
        }
    }
    if let Some(b) = &recording.manifest().background {
        report.frames += 1;
        let file = format!("{FRAMES}/{}", b.file);
        report.faults.extend(compare(folder, &file, b.bytes, &b.sha256));
        known.insert(file);
    }
    for p in recording.products() {
        report.products += 1;
        let file = format!("{PRODUCTS}/{}", p.file);
        report.faults.extend(compare(folder, &file, p.bytes, &p.sha256));
        known.insert(file);
    }
    if !report.busy {
        for sub in ["", FRAMES, PRODUCTS] {
            let extra = list(folder, sub)?.into_iter().filter(|f| !known.contains(f));
            report.faults.extend(extra.map(|file| Fault::Extra { file }));
        }
    }
    Ok(report)
}

fn compare(folder: &Path, file: &str, recorded_bytes: u64, recorded: &str) -> Option<Fault> {
    let file = file.to_owned();
    match std::fs::read(folder.join(&file)) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Some(Fault::Missing { file }),
        Err(e) => Some(Fault::Unreadable { file, reason: e.to_string() }),
        Ok(bytes) => {
            let (found_bytes, found) = (bytes.len() as u64, sha256_hex(&bytes));
            (found_bytes != recorded_bytes || found != recorded).then(|| Fault::Changed {
                file,
                found_bytes,
                recorded_bytes,
                found,
                recorded: recorded.to_owned(),
            })
        }
    }
}

/// The names in a folder, relative to the session's, sorted; none where it is missing.
fn list(folder: &Path, sub: &str) -> Result<Vec<String>, SessionError> {
    let path = folder.join(sub);
    let entries = match std::fs::read_dir(&path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(SessionError::io("list", &path, 0))?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let name = entry.map_err(SessionError::io("list", &path, 0))?.file_name();
        let name = name.to_string_lossy();
        names.push(if sub.is_empty() { name.into_owned() } else { format!("{sub}/{name}") });
    }
    names.sort();
    Ok(names)
}
