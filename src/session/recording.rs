//! A session as it stands on the disk, read without changing it.

use super::SessionError;
use super::disk::{LOCK, Lock, sha256_hex};
use super::event::{CapturedView, Event, EventKind, ProductRecord};
use super::hashes::Hashes;
use super::journal::{Chain, Damage, Decoder};
use super::manifest::{ArchivedFile, FORMAT_VERSION, Manifest, Origin};
use super::name::check_name;
use super::open::{JOURNAL_LIMIT, MANIFEST_LIMIT, PRODUCT_LIMIT, check_folder, open_inside, read_inside};
use super::picture::FILE_LIMIT;
use crate::rig::{Encoding, Frame};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

pub(super) const MANIFEST: &str = "manifest.json";
pub(super) const JOURNAL: &str = "journal.jsonl";
pub(super) const FRAMES: &str = "frames";
pub(super) const PRODUCTS: &str = "products";
pub(super) const COMPRESSIONS: &str = "compressions";
pub(super) const REJECTED: &str = "rejected";

/// How far a session has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Created; nothing has happened yet.
    Created,
    /// A run began and has not ended: it goes on now, or the program was killed.
    Interrupted,
    /// Somebody stopped the run.
    Aborted,
    /// The run failed; the journal's last record says why.
    Failed,
    /// All views are captured; the products are not written yet, or the record that all is done is missing.
    Captured,
    /// Everything is done.
    Complete,
    /// A run is taking pictures now. No journal says so: it is what [`State::seen`] makes of a session that is written.
    Capturing,
    /// All views are captured, and a run computes from them now; as [`State::Capturing`].
    Computing,
}

impl State {
    /// What the state is for who looks on, where `busy` says whether somebody writes the session now.
    #[must_use]
    pub fn seen(self, busy: bool) -> Self {
        match self {
            Self::Created | Self::Interrupted if busy => Self::Capturing,
            Self::Captured if busy => Self::Computing,
            other => other,
        }
    }
}

/// A session as it stands on the disk.
#[derive(Debug, Clone)]
pub struct Recording {
    pub(super) folder: PathBuf,
    pub(super) manifest: Manifest,
    pub(super) events: Vec<Event>,
    pub(super) views: BTreeMap<usize, CapturedView>,
    pub(super) products: BTreeMap<String, ProductRecord>,
    pub(super) chain: Chain,
    pub(super) good_bytes: u64,
    pub(super) torn_bytes: usize,
}

impl Recording {
    /// Reads the session in a folder: manifest and journal, not the pictures. Nothing is changed, so that a
    /// session may be read while it is written; a torn last line is left out.
    ///
    /// # Errors
    /// [`SessionError`] where the folder is no session, or its manifest or journal is damaged.
    pub fn read(folder: &Path) -> Result<Self, SessionError> {
        match Self::read_to_damage(folder)? {
            (it, None) => Ok(it),
            (_, Some(Damage { line, reason, is_newer: true })) => Err(SessionError::OtherVersion {
                path: folder.join(JOURNAL),
                reason: format!("line {line}: {reason}"),
            }),
            (_, Some(Damage { line, reason, .. })) => {
                Err(SessionError::Journal { path: folder.join(JOURNAL), line, reason })
            }
        }
    }

    /// As [`Self::read`], but a damaged journal is read as far as it is whole.
    pub(super) fn read_to_damage(folder: &Path) -> Result<(Self, Option<Damage>), SessionError> {
        let bytes = read_manifest(folder)?;
        let mut it = Self {
            folder: folder.to_owned(),
            manifest: parse_manifest(folder, &bytes)?,
            events: Vec::new(),
            views: BTreeMap::new(),
            products: BTreeMap::new(),
            chain: Chain::new(&bytes),
            good_bytes: 0,
            torn_bytes: 0,
        };
        let path = folder.join(JOURNAL);
        let file = match open_inside(folder, JOURNAL) {
            Err(e) if e.is_missing() => {
                return Ok((
                    it,
                    Some(Damage { line: 1, reason: "the file is missing".to_owned(), is_newer: false }),
                ));
            }
            other => other?,
        };
        let bytes = file.metadata().map_err(SessionError::io("read", &path, 0))?.len();
        if bytes > JOURNAL_LIMIT {
            return Err(SessionError::TooLong { path, bytes, limit: JOURNAL_LIMIT });
        }
        let mut file = file.take(JOURNAL_LIMIT);
        let mut decoder = Decoder::new(it.chain.clone());
        let mut buffer = vec![0; 1 << 16];
        let mut damage = None;
        loop {
            let n = file.read(&mut buffer).map_err(SessionError::io("read", &path, 0))?;
            decoder.push(&buffer[..n]);
            while let Some(next) = decoder.next()
                && damage.is_none()
            {
                let line = it.events.len() + 1;
                let contradiction = |reason| Damage { line, reason, is_newer: false };
                match next.and_then(|r| it.check(&r.event.what).map(|()| r).map_err(contradiction)) {
                    Ok(record) => it.take(record.event),
                    Err(found) => damage = Some(found),
                }
            }
            if n == 0 || damage.is_some() {
                break;
            }
        }
        (it.chain, it.good_bytes, it.torn_bytes) = decoder.finish();
        Ok((it, damage))
    }

    /// The reason why an event contradicts the plan or the events before it, where it does.
    pub(super) fn check(&self, what: &EventKind) -> Result<(), String> {
        match what {
            EventKind::Captured { view, .. } => {
                let planned = self.manifest.plan.views.get(view.view);
                if planned.is_none_or(|p| p.role != view.role) {
                    return Err(format!("the plan has no {:?} view {}", view.role, view.view));
                }
                if self.views.contains_key(&view.view) {
                    return Err(format!("view {} is captured twice", view.view));
                }
                let mut files = view.others.iter().map(|o| &o.file).chain([&view.file]);
                files.try_for_each(|file| check_name("frame file", file)).map_err(|e| e.to_string())
            }
            EventKind::Products { files, .. } => {
                files.iter().try_for_each(|f| check_name("product file", &f.file)).map_err(|e| e.to_string())
            }
            _ => Ok(()),
        }
    }

    /// Takes a checked event in.
    pub(super) fn take(&mut self, event: Event) {
        match &event.what {
            EventKind::Captured { view, .. } => {
                self.views.insert(view.view, view.clone());
            }
            EventKind::Products { files, .. } => {
                self.products.extend(files.iter().map(|f| (f.file.clone(), f.clone())));
            }
            _ => {}
        }
        self.events.push(event);
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
    /// What the session was to be.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
    /// Everything that happened, in order.
    pub fn events(&self) -> &[Event] {
        &self.events
    }
    /// The views whose pictures are durable, by index.
    pub fn views(&self) -> impl ExactSizeIterator<Item = &CapturedView> {
        self.views.values()
    }
    /// One captured view.
    pub fn view(&self, index: usize) -> Option<&CapturedView> {
        self.views.get(&index)
    }
    /// The newest record of each product, by name.
    pub fn products(&self) -> impl ExactSizeIterator<Item = &ProductRecord> {
        self.products.values()
    }
    /// Bytes of a torn last line of the journal (0 where it ends well): a run was killed in mid-write.
    pub fn torn_bytes(&self) -> usize {
        self.torn_bytes
    }

    /// The newest result, as it was when its products were made.
    pub fn result(&self) -> Option<&serde_json::Value> {
        self.events.iter().rev().find_map(|e| match &e.what {
            EventKind::Complete { result } => Some(result),
            _ => None,
        })
    }

    /// How far the session has come: what the last event that begins or ends something says.
    pub fn state(&self) -> State {
        let of = |e: &Event| match e.what {
            EventKind::Started { .. } | EventKind::Captured { .. } | EventKind::Homed => {
                Some(State::Interrupted)
            }
            // The products are there, and the record that says so is due.
            EventKind::AcquisitionComplete { .. } | EventKind::Products { .. } => Some(State::Captured),
            EventKind::Aborted => Some(State::Aborted),
            EventKind::Failed { .. } => Some(State::Failed),
            EventKind::Complete { .. } => Some(State::Complete),
            _ => None,
        };
        self.events.iter().rev().find_map(of).unwrap_or(State::Created)
    }

    /// Whether somebody writes the session now.
    pub fn is_busy(&self) -> bool {
        Lock::is_held(&self.folder)
    }

    /// SHA-256 of the hashes of the manifest and of all pictures with their angles, hexadecimal: what the session was, whatever
    /// has been computed from it since.
    ///
    /// # Errors
    /// [`SessionError`] where the manifest cannot be read.
    pub fn evidence_sha256(&self) -> Result<String, SessionError> {
        let manifest = sha256_hex(&read_manifest(&self.folder)?);
        let views = self.views().map(|v| format!("{} {} {}", v.view, v.reached_deg, v.sha256));
        let lines: Vec<String> = std::iter::once(manifest).chain(views).collect();
        Ok(sha256_hex(lines.join("\n").as_bytes()))
    }

    /// The picture of a view, its hash checked against the journal.
    ///
    /// # Errors
    /// [`SessionError`] where the view was not captured, or its file is missing or has changed.
    pub fn frame(&self, view: usize) -> Result<Frame, SessionError> {
        let record =
            self.views.get(&view).ok_or(SessionError::NotCaptured { view, captured: self.views.len() })?;
        self.read_checked(&record.file, record.bytes, &record.sha256)
    }

    /// Looks whether every recorded picture is there, by its size: a run has their bytes in hand and would not miss them.
    ///
    /// # Errors
    /// [`SessionError::Gone`] names the first that is not.
    pub fn check_frames(&self) -> Result<(), SessionError> {
        for view in self.views() {
            let path = self.folder.join(FRAMES).join(&view.file);
            if !path.symlink_metadata().is_ok_and(|m| m.is_file() && m.len() == view.bytes) {
                return Err(SessionError::Gone { path, bytes: view.bytes });
            }
        }
        Ok(())
    }

    /// The picture without the grain, its hash checked against the manifest; `None` where there is none.
    ///
    /// # Errors
    /// [`SessionError`] where its file is missing or has changed.
    pub fn background(&self) -> Result<Option<Frame>, SessionError> {
        let read = |a: &ArchivedFile| self.read_checked(&a.file, a.bytes, &a.sha256);
        self.manifest.background.as_ref().map(read).transpose()
    }

    /// The folder of a compression of this session's grain, whether there is one of that name or not.
    ///
    /// # Errors
    /// [`SessionError::Name`] for a name that is no plain name; as for [`Self::compressions_path`].
    pub fn compression_path(&self, name: &str) -> Result<PathBuf, SessionError> {
        check_name("compression", name)?;
        let path = self.compressions_path()?.join(name);
        real_or_absent(&path)?;
        Ok(path)
    }

    /// What there is to know of the session, as one object: what it was made with, its files, how far it has come.
    pub fn about(&self) -> serde_json::Value {
        let manifest = &self.manifest;
        serde_json::json!({
            "name": manifest.name,
            "created": manifest.created,
            "software": manifest.software,
            "origin": manifest.origin,
            "devices": manifest.devices,
            "state": self.state().seen(self.is_busy()),
            "plan": manifest.plan,
            "config": manifest.config,
            "frames": self.views().collect::<Vec<_>>(),
            "products": self.products().collect::<Vec<_>>(),
            "rejected": self.rejections(),
            "result": self.result(),
        })
    }

    /// Where the compressions of this session's grain are, if there are any.
    ///
    /// # Errors
    /// [`SessionError::Irregular`] where a link or something else is in the folder's place.
    pub fn compressions_path(&self) -> Result<PathBuf, SessionError> {
        let path = self.folder.join(COMPRESSIONS);
        real_or_absent(&path)?;
        Ok(path)
    }

    /// Opens a product for reading, its hash checked against the journal; its length beside it.
    ///
    /// # Errors
    /// [`SessionError::Product`] where it was never recorded, is missing, no plain file, or has changed.
    pub fn product_file(&self, file: &str, hashes: &Hashes) -> Result<(std::fs::File, u64), SessionError> {
        let damaged = |reason: String| SessionError::Product {
            session: self.manifest.name.clone(),
            file: file.to_owned(),
            reason,
        };
        let record = self.products.get(file).ok_or_else(|| damaged("it was not recorded".to_owned()))?;
        let system = |e: std::io::Error| damaged(e.to_string());
        let mut opened = open_inside(&self.folder, &format!("{PRODUCTS}/{file}")).map_err(|e| match e {
            SessionError::Io { source, .. } => system(source),
            SessionError::Irregular { found, .. } => damaged(format!("it is {found}, not a plain file")),
            e => damaged(e.to_string()),
        })?;
        let bytes = opened.metadata().map_err(system)?.len();
        if bytes != record.bytes || bytes > PRODUCT_LIMIT {
            let limit = record.bytes.min(PRODUCT_LIMIT);
            return Err(damaged(format!("it has {bytes} bytes, {limit} were written")));
        }
        let found = hashes.sha256(&mut opened).map_err(system)?;
        if found != record.sha256 {
            return Err(damaged(format!("its SHA-256 is {found}, recorded is {}", record.sha256)));
        }
        Ok((opened, bytes))
    }

    /// A product's bytes, their hash checked against the journal.
    ///
    /// # Errors
    /// As [`Self::product_file`].
    pub fn product(&self, file: &str) -> Result<Vec<u8>, SessionError> {
        let (opened, bytes) = self.product_file(file, &Hashes::default())?;
        let path = self.product_path(file)?;
        let mut read = Vec::with_capacity(bytes as usize);
        opened.take(bytes).read_to_end(&mut read).map_err(SessionError::io("read", &path, 0))?;
        Ok(read)
    }

    /// Where a product lies, whether it is written yet or not.
    ///
    /// # Errors
    /// [`SessionError::Name`] for a name that is no plain file name.
    pub fn product_path(&self, file: &str) -> Result<PathBuf, SessionError> {
        check_name("product file", file)?;
        Ok(self.folder.join(PRODUCTS).join(file))
    }
}

/// Refuses a link or a file in a folder's place.
fn real_or_absent(folder: &Path) -> Result<(), SessionError> {
    match check_folder(folder) {
        Err(e) if e.is_missing() => Ok(()),
        other => other,
    }
}

impl Recording {
    /// A picture in `frames/`, if it is the one that was recorded.
    fn read_checked(&self, file: &str, bytes: u64, recorded: &str) -> Result<Frame, SessionError> {
        let inside = format!("{FRAMES}/{file}");
        let path = self.folder.join(&inside);
        let read = match read_inside(&self.folder, &inside, bytes.min(FILE_LIMIT)) {
            Err(SessionError::TooLong { path, bytes: found, .. }) => {
                return Err(SessionError::Length { path, found, recorded: bytes });
            }
            other => other?,
        };
        let found = sha256_hex(&read);
        if found != recorded {
            return Err(SessionError::Changed { path, found, recorded: recorded.to_owned() });
        }
        let encoding = Encoding::sniff(&read).ok_or_else(|| SessionError::Picture {
            file: path.display().to_string(),
            fault: super::picture::PictureFault::unknown(&read),
        })?;
        Ok(Frame::new(read, encoding))
    }
}

pub(super) fn read_manifest(folder: &Path) -> Result<Vec<u8>, SessionError> {
    let path = folder.join(MANIFEST);
    match read_inside(folder, MANIFEST, MANIFEST_LIMIT) {
        Err(e) if e.is_missing() => {
            if folder.join(LOCK).exists() {
                return Err(SessionError::Manifest { path, reason: "the file is missing".to_owned() });
            }
            Err(SessionError::Absent { path: folder.to_owned() })
        }
        other => other,
    }
}

#[derive(Deserialize)]
struct Version {
    format: u32,
}

fn parse_manifest(folder: &Path, bytes: &[u8]) -> Result<Manifest, SessionError> {
    let fail = |reason| SessionError::Manifest { path: folder.join(MANIFEST), reason };
    // The version first: a manifest of a later version may have other fields.
    let version: Version = serde_json::from_slice(bytes).map_err(|e| fail(e.to_string()))?;
    if version.format != FORMAT_VERSION {
        let reason = format!("its format version is {}, this program reads {FORMAT_VERSION}", version.format);
        return Err(SessionError::OtherVersion { path: folder.join(MANIFEST), reason });
    }
    let manifest: Manifest = serde_json::from_slice(bytes).map_err(|e| fail(e.to_string()))?;
    check_manifest(&manifest).map_err(fail)?;
    Ok(manifest)
}

/// What every manifest must be: it may come from another place, so no figure in it is trusted.
pub(super) fn check_manifest(manifest: &Manifest) -> Result<(), String> {
    check_name("session name", &manifest.name).map_err(|e| e.to_string())?;
    if let Some(b) = &manifest.background {
        check_name("background file", &b.file).map_err(|e| e.to_string())?;
    }
    let plan = &manifest.plan;
    match (manifest.origin, plan.views.len(), manifest.merged_from.len()) {
        (Origin::Merge, 0, 2) | (Origin::Rig | Origin::Import, 1.., 0) => {}
        (Origin::Merge, views, sources) => {
            return Err(format!("a merged grain has 2 sources and no views, not {sources} and {views}"));
        }
        (_, 0, _) => return Err("its plan has no views".to_owned()),
        _ => return Err("it has views and is merged from others".to_owned()),
    }
    for source in &manifest.merged_from {
        check_name("session name", &source.name).map_err(|e| e.to_string())?;
    }
    for (i, v) in plan.views.iter().enumerate() {
        if v.index != i || !v.angle_deg.is_finite() {
            return Err(format!("view {i} of its plan has index {} and angle {}°", v.index, v.angle_deg));
        }
    }
    if !(plan.tolerance_deg.is_finite() && plan.tolerance_deg > 0.0) {
        return Err(format!("its angle tolerance is {}°, it must be above 0", plan.tolerance_deg));
    }
    Ok(())
}
