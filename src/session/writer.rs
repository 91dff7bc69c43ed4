//! A session that is being written: one writer at a time.

use super::SessionError;
use super::disk::{Lock, WholeFile, check_space, remove_parts, write_whole};
use super::event::{CapturedView, Event, EventKind, ProductRecord};
use super::manifest::{ArchivedFile, PlannedView, required_bytes};
use super::name::check_name;
use super::open::{append_inside, check_folder, read_inside};
use super::recording::{FRAMES, JOURNAL, MANIFEST, PRODUCTS, Recording};
use crate::rig::Frame;
use grainrig_core::geometry::Angle;
use jiff::Timestamp;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Told of every event, in order, once it is in the journal.
type Observer = Box<dyn FnMut(&Event) + Send>;

/// A session that is being written; it holds the session's lock.
pub struct Session {
    recording: Recording,
    /// The manifest's bytes, should somebody remove the file.
    manifest: Vec<u8>,
    journal: File,
    lock: Arc<Lock>,
    broken: bool,
    observer: Option<Observer>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("recording", &self.recording).finish_non_exhaustive()
    }
}

impl Session {
    /// Opens the session in a folder to go on with it: takes its lock, replays its journal, cuts off a torn
    /// last line (see [`Recording::torn_bytes`] for how much that was) and removes unfinished files.
    ///
    /// # Errors
    /// [`SessionError`] where the folder is no session, is damaged, or another process writes it.
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        // A folder that is no session gets no lock file.
        super::recording::read_manifest(folder)?;
        Self::with_lock(folder, Lock::take(folder)?)
    }

    pub(super) fn with_lock(folder: &Path, lock: Lock) -> Result<Self, SessionError> {
        let recording = Recording::read(folder)?;
        let path = folder.join(JOURNAL);
        let journal = append_inside(folder, JOURNAL)?;
        let manifest = super::recording::read_manifest(folder)?;
        if recording.torn_bytes > 0 {
            journal
                .set_len(recording.good_bytes)
                .and_then(|()| journal.sync_all())
                .map_err(SessionError::io("repair", &path, 0))?;
        }
        super::products::settle(&recording)?;
        // Products are made again from the frames, so their folder may have been cleared away.
        let products = folder.join(PRODUCTS);
        std::fs::create_dir_all(&products).map_err(SessionError::io("create", &products, 0))?;
        for name in [FRAMES, PRODUCTS] {
            // What is written there must not land elsewhere.
            check_folder(&folder.join(name))?;
            remove_parts(&folder.join(name))?;
        }
        Ok(Self { recording, manifest, journal, lock: Arc::new(lock), broken: false, observer: None })
    }

    pub(super) fn moved_to(&mut self, folder: PathBuf) {
        self.recording.folder = folder;
    }

    /// The session as it stands.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Sends every later event to `observer`, in order and once it is in the journal. It is called while
    /// the session is borrowed: it must not block.
    pub fn observe(&mut self, observer: impl FnMut(&Event) + Send + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Checks that the disk has room for the views still to be captured, `frame_bytes` each.
    ///
    /// # Errors
    /// [`SessionError::DiskFull`] with both figures.
    pub fn check_space(&self, frame_bytes: u64) -> Result<(), SessionError> {
        let missing = self.recording.manifest.plan.views.len() - self.recording.views.len();
        check_space(&self.recording.folder, required_bytes(missing, frame_bytes))
    }

    /// Numbers an event, writes it to the journal and returns it as the journal has it. What somebody may
    /// rely on (a captured view, products, the end of a run) is synced before this returns; the rest is
    /// synced with it.
    ///
    /// # Errors
    /// [`SessionError`] where the event contradicts the plan or the disk fails; the journal is then as it
    /// was before, or the session refuses every later event.
    pub fn append(&mut self, what: EventKind) -> Result<Event, SessionError> {
        let path = self.recording.folder.join(JOURNAL);
        if self.broken {
            return Err(SessionError::Broken { path });
        }
        let sync = !matches!(
            what,
            EventKind::Moving { .. }
                | EventKind::Working { .. }
                | EventKind::Silhouette { .. }
                | EventKind::Judged { .. }
                | EventKind::Hull { .. }
        );
        let unrecordable = |reason| SessionError::Unrecordable { reason };
        let record = self.recording.chain.encode(Timestamp::now(), what).map_err(unrecordable)?;
        self.recording.check(&record.event.what).map_err(unrecordable)?;
        if sync {
            self.keep_in_place()?;
        }
        let before = self.recording.good_bytes;
        if let Err(e) = self.journal.write_all(record.line.as_bytes()) {
            // A half line must not stay before the next one.
            self.broken = self.journal.set_len(before).is_err();
            return Err(SessionError::io("write", &path, record.line.len() as u64)(e));
        }
        if sync && let Err(e) = self.journal.sync_data() {
            // After a failed sync nobody knows what the disk has.
            self.broken = true;
            return Err(SessionError::io("sync", &path, 0)(e));
        }
        self.recording.chain.advance(&record);
        self.recording.good_bytes += record.line.len() as u64;
        let event = record.event;
        self.recording.take(event.clone());
        if let Some(observer) = &mut self.observer {
            observer(&event);
        }
        Ok(event)
    }

    /// Looks whether journal and manifest still are in their place, and puts back the one that somebody has removed: what
    /// is written into a file without a name is lost with the process.
    fn keep_in_place(&mut self) -> Result<(), SessionError> {
        let folder = &self.recording.folder;
        let path = folder.join(MANIFEST);
        match read_inside(folder, MANIFEST, self.manifest.len() as u64) {
            Ok(bytes) if bytes == self.manifest => {}
            Err(e) if e.is_missing() => {
                write_whole(folder, MANIFEST, &self.manifest)?;
                tracing::warn!("{} was removed during the run and is put back", path.display());
            }
            Ok(_) | Err(SessionError::TooLong { .. }) => return Err(SessionError::Replaced { path }),
            Err(e) => return Err(e),
        }
        let path = folder.join(JOURNAL);
        let ours = self.journal.metadata().map_err(SessionError::io("read", &path, 0))?;
        match path.symlink_metadata() {
            Ok(there) if (there.dev(), there.ino()) == (ours.dev(), ours.ino()) => return Ok(()),
            Ok(_) => return Err(SessionError::Replaced { path }),
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(SessionError::io("read", &path, 0)(e));
            }
            Err(_) => {}
        }
        // The file that is open still has every line.
        let mut lines = Vec::new();
        let mut file = &self.journal;
        file.rewind()
            .and_then(|()| file.read_to_end(&mut lines))
            .map_err(SessionError::io("read", &path, 0))?;
        write_whole(folder, JOURNAL, &lines)?;
        self.journal = append_inside(folder, JOURNAL)?;
        tracing::warn!("{} was removed during the run and is put back, with all its lines", path.display());
        Ok(())
    }

    /// Makes a picture and the files beside it durable: written and synced, hashed, journalled with the journal synced, in that order.
    /// Angles are recorded to 10⁻⁹ degrees, so that their decimal text reads back to the same number.
    ///
    /// # Errors
    /// [`SessionError`] where the plan has no such view, the view is captured already, or the disk fails.
    pub fn record_frame(
        &mut self,
        view: usize,
        reached: Angle,
        frame: &Frame,
        remaining_s: Option<f64>,
    ) -> Result<CapturedView, SessionError> {
        let plan = &self.recording.manifest.plan;
        let planned: &PlannedView =
            plan.views.get(view).ok_or(SessionError::NotPlanned { view, views: plan.views.len() })?;
        if let Some(there) = self.recording.views.get(&view) {
            return Err(SessionError::Captured { view, file: there.file.clone() });
        }
        let (role, commanded_deg) = (planned.role, on_record(planned.angle_deg));
        let file = format!("view_{view:03}.{}", frame.encoding.extension());
        let folder = self.recording.folder.join(FRAMES);
        let mut others: Vec<ArchivedFile> = Vec::new();
        for other in &frame.others {
            // The camera's ending, and a number where it stands twice.
            let same = |o: &&ArchivedFile| o.file.ends_with(&format!(".{}", other.extension));
            let nth = match others.iter().filter(same).count() {
                0 => String::new(),
                n => format!("_{}", n + 1),
            };
            let name = format!("view_{view:03}_raw{nth}.{}", other.extension);
            check_name("frame file", &name)?;
            let (bytes, sha256) = write_whole(&folder, &name, &other.bytes)?;
            others.push(ArchivedFile { file: name, bytes, sha256 });
        }
        let (bytes, sha256) = write_whole(&folder, &file, &frame.bytes)?;
        let reached_deg = on_record(reached.deg());
        let view = CapturedView { view, role, file, bytes, sha256, commanded_deg, reached_deg, others };
        match self.append(EventKind::Captured { view, remaining_s })?.what {
            EventKind::Captured { view, .. } => Ok(view),
            other => Err(SessionError::Unrecordable { reason: format!("it came back as {other:?}") }),
        }
    }

    /// Archives the picture without the grain that the manifest names.
    pub(super) fn archive(&self, file: &str, bytes: &[u8]) -> Result<(), SessionError> {
        check_name("background file", file)?;
        write_whole(&self.recording.folder.join(FRAMES), file, bytes).map(|_| ())
    }

    /// Begins a product: an `impl Write` that appears in `products/` whole, or not at all. It holds the
    /// session's lock, so it may be written on another thread.
    ///
    /// # Errors
    /// [`SessionError`] where the name is no plain file name or the disk fails.
    pub fn product(&self, file: &str) -> Result<ProductWriter, SessionError> {
        check_name("product file", file)?;
        let file_on_disk = WholeFile::create(&self.recording.folder.join(PRODUCTS), file)?;
        Ok(ProductWriter { file: file_on_disk, name: file.to_owned(), _lock: Arc::clone(&self.lock) })
    }
}

/// An angle as it is recorded: its shortest decimal text has at most 15 digits, which every reader
/// turns into the same number, and a replayed angle is recorded as the same text again.
fn on_record(deg: f64) -> f64 {
    (deg * 1e9).round() / 1e9
}

/// The angle that a reader of the record gets for this one.
pub fn as_recorded(angle: Angle) -> Angle {
    Angle::from_deg(on_record(angle.deg()))
}

/// A product that is being written.
#[derive(Debug)]
pub struct ProductWriter {
    file: WholeFile,
    name: String,
    _lock: Arc<Lock>,
}

impl ProductWriter {
    /// Makes the product durable under its name.
    ///
    /// # Errors
    /// [`SessionError`] where the disk fails.
    pub fn finish(self) -> Result<ProductRecord, SessionError> {
        let (bytes, sha256) = self.file.finish()?;
        Ok(ProductRecord { file: self.name, bytes, sha256 })
    }
}

impl Write for ProductWriter {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        self.file.write(buf)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}
