//! Whether a session is still what was recorded.

use super::SessionError;
use super::disk::{LOCK, Lock, sha256_of};
use super::open::{check_folder, open_inside};
use super::products::{NEXT, OLD};
use super::recording::{COMPRESSIONS, FRAMES, JOURNAL, MANIFEST, PRODUCTS, REJECTED, Recording, State};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// A file of at most this length is hashed even where it is longer than it was recorded.
const HASHED_ANYWAY: u64 = 64 << 20;

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
    #[error("{file}: missing; {}", heals(file))]
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
    /// A link, a pipe or something else is in a file's or a folder's place.
    #[error("{file}: it is {found}, not {wanted}; remove it, then: {}", heals(file))]
    Irregular {
        /// Its place.
        file: String,
        /// What it is.
        found: String,
        /// What it should be.
        wanted: String,
    },
    /// A recorded file is longer than it was; its bytes are not looked at.
    #[error("{file}: changed ({found_bytes} bytes; recorded {recorded_bytes} bytes); {}", heals(file))]
    Longer {
        /// The file.
        file: String,
        /// Bytes found.
        found_bytes: u64,
        /// Bytes recorded.
        recorded_bytes: u64,
    },
    /// A recorded file has changed.
    #[error(
        "{file}: changed ({found_bytes} bytes, SHA-256 {found}; recorded {recorded_bytes} bytes, {recorded}); {}",
        heals(file)
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
    /// Products that were made and recorded, and are not in their place: a run was killed in that instant.
    #[error(
        "{file}: the newest products, which a killed run left there; `grainrig resume` puts them in their place"
    )]
    Unfinished {
        /// Their folder.
        file: String,
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
        Err(e @ SessionError::Irregular { .. }) if check_folder(folder).is_ok() => {
            let journal = matches!(&e, SessionError::Irregular { path, .. } if path.ends_with(JOURNAL));
            report.faults.push(fault(if journal { JOURNAL } else { MANIFEST }.to_owned(), &e));
            return Ok(report);
        }
        Err(e) => return Err(e),
    };
    report.session = Some(recording.manifest().name.clone());
    report.state = Some(recording.state().seen(report.busy));
    report.records = recording.events().len();
    report.planned = recording.manifest().plan.views.len();
    if let Some(d) = damage {
        let remedy = if d.is_newer { "; use the version of grainrig that made the session" } else { "" };
        report.faults.push(Fault::Journal { line: d.line, reason: d.reason + remedy });
    } else if recording.torn_bytes() > 0 && !report.busy {
        report.faults.push(Fault::Torn { bytes: recording.torn_bytes() });
    }
    let checked = Checked::of(&recording);
    (report.frames, report.products) = (checked.frames, checked.products);
    report.faults.extend(checked.faults);
    let mut known = checked.files;
    known.extend([MANIFEST, JOURNAL, LOCK, FRAMES, PRODUCTS, COMPRESSIONS, REJECTED].map(str::to_owned));
    let places = [FRAMES, PRODUCTS, COMPRESSIONS, REJECTED].map(|sub| (sub, check_folder(&folder.join(sub))));
    let lock = (LOCK, open_inside(folder, LOCK).map(|_| ()));
    for (file, found) in places.into_iter().chain([lock]) {
        match found {
            Err(e) if !e.is_missing() => report.faults.push(fault(file.to_owned(), &e)),
            _ => {}
        }
    }
    let place = recording.products_place();
    if place != PRODUCTS && !report.busy {
        report.faults.push(Fault::Unfinished { file: place.to_owned() });
    }
    if !report.busy {
        // What a killed run has left beside the products the next opening removes.
        known.extend([NEXT, OLD].map(str::to_owned));
        for sub in ["", FRAMES, place] {
            if check_folder(&folder.join(sub)).is_ok() {
                let extra = list(folder, sub)?.into_iter().filter(|f| !known.contains(f));
                report.faults.extend(extra.map(|file| Fault::Extra { file }));
            }
        }
    }
    Ok(report)
}

/// What heals a recorded file that is lost.
fn heals(file: &str) -> &'static str {
    if file.starts_with(PRODUCTS) { "`grainrig replay` writes it again" } else { "restore it from a backup" }
}

fn fault(file: String, error: &SessionError) -> Fault {
    match error {
        SessionError::Irregular { found, wanted, .. } => {
            Fault::Irregular { file, found: (*found).to_owned(), wanted: (*wanted).to_owned() }
        }
        e if e.is_missing() => Fault::Missing { file },
        SessionError::Io { source, .. } => Fault::Unreadable { file, reason: source.to_string() },
        e => Fault::Unreadable { file, reason: e.to_string() },
    }
}

/// The recorded files, each compared.
struct Checked {
    frames: usize,
    products: usize,
    files: BTreeSet<String>,
    faults: Vec<Fault>,
}

impl Checked {
    fn of(recording: &Recording) -> Self {
        let place = recording.products_place();
        let mut it = Self { frames: 0, products: 0, files: BTreeSet::new(), faults: Vec::new() };
        let mut compare = |sub: &str, file: &str, bytes: u64, sha256: &str| {
            let file = format!("{sub}/{file}");
            it.faults.extend(compare(recording.folder(), &file, bytes, sha256));
            it.files.insert(file);
        };
        for v in recording.views() {
            it.frames += 1 + v.others.len();
            compare(FRAMES, &v.file, v.bytes, &v.sha256);
            v.others.iter().for_each(|o| compare(FRAMES, &o.file, o.bytes, &o.sha256));
        }
        if let Some(b) = &recording.manifest().background {
            it.frames += 1;
            compare(FRAMES, &b.file, b.bytes, &b.sha256);
        }
        for p in recording.products() {
            it.products += 1;
            compare(place, &p.file, p.bytes, &p.sha256);
        }
        it
    }
}

/// The recorded pictures of a session that are not as recorded. Reads them all; the products can be made again from them.
pub fn damage(recording: &Recording) -> Vec<Fault> {
    let mut all = Checked::of(recording).faults;
    all.retain(|fault| !fault.is_of_a_product());
    all
}

impl Fault {
    fn is_of_a_product(&self) -> bool {
        match self {
            Self::Missing { file }
            | Self::Unreadable { file, .. }
            | Self::Irregular { file, .. }
            | Self::Longer { file, .. }
            | Self::Changed { file, .. }
            | Self::Extra { file } => file.starts_with(PRODUCTS),
            Self::Manifest { .. } | Self::Journal { .. } | Self::Torn { .. } | Self::Unfinished { .. } => {
                false
            }
        }
    }
}

fn compare(folder: &Path, file: &str, recorded_bytes: u64, recorded: &str) -> Option<Fault> {
    let name = || file.to_owned();
    let unreadable = |e: std::io::Error| Fault::Unreadable { file: name(), reason: e.to_string() };
    let mut opened = match open_inside(folder, file) {
        Ok(opened) => opened,
        Err(e) => return Some(fault(name(), &e)),
    };
    let found_bytes = match opened.metadata() {
        Ok(about) => about.len(),
        Err(e) => return Some(unreadable(e)),
    };
    // A file may be made as long as a disk, of nothing.
    if found_bytes > recorded_bytes.max(HASHED_ANYWAY) {
        return Some(Fault::Longer { file: name(), found_bytes, recorded_bytes });
    }
    let (found, found_bytes) = match sha256_of(&mut opened) {
        Ok(read) => read,
        Err(e) => return Some(unreadable(e)),
    };
    (found_bytes != recorded_bytes || found != recorded).then(|| Fault::Changed {
        file: name(),
        found_bytes,
        recorded_bytes,
        found,
        recorded: recorded.to_owned(),
    })
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
