//! The data folder: a session in each sub-folder.

use super::SessionError;
use super::disk::{LOCK, Lock, sync_folder, write_whole};
use super::manifest::Manifest;
use super::name::check_name;
use super::recording::{FRAMES, JOURNAL, MANIFEST, PRODUCTS, Recording, check_manifest};
use super::summaries::{Summaries, Summary};
use super::writer::Session;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// The data folder.
#[derive(Debug, Clone)]
pub struct Store {
    data: PathBuf,
    summaries: Arc<Summaries>,
}

impl Store {
    /// The store in a data folder, which is made when the first session is.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self { data: data.into(), summaries: Arc::default() }
    }

    /// The data folder.
    pub fn data(&self) -> &Path {
        &self.data
    }

    /// All sessions by name, damaged ones too. Reads every journal that is not as this store, or a clone of it, read it last.
    ///
    /// # Errors
    /// [`SessionError::Io`] where the data folder cannot be listed.
    pub fn list(&self) -> Result<Vec<Summary>, SessionError> {
        if !self.data.try_exists().map_err(SessionError::io("list", &self.data, 0))? {
            return Ok(Vec::new());
        }
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.data).map_err(SessionError::io("list", &self.data, 0))? {
            let entry = entry.map_err(SessionError::io("list", &self.data, 0))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            // A folder that begins with a dot is a session that is being made, or nothing of ours.
            // A link to a folder is told of as damaged, and not followed.
            let is_session = entry.file_type().is_ok_and(|kind| kind.is_dir() || kind.is_symlink());
            if name.starts_with('.') || !is_session {
                continue;
            }
            names.push(name);
        }
        Ok(self.summaries.of(&self.data, names, SystemTime::now()).0)
    }

    /// The folder of a session of this store.
    ///
    /// # Errors
    /// [`SessionError::Name`] for a name that is not allowed.
    pub fn folder(&self, name: &str) -> Result<PathBuf, SessionError> {
        check_name("session name", name)?;
        Ok(self.data.join(name))
    }

    /// Reads a session without changing it.
    ///
    /// # Errors
    /// [`SessionError`] where there is none of that name, or it is damaged.
    pub fn read(&self, name: &str) -> Result<Recording, SessionError> {
        Recording::read(&self.folder(name)?)
    }

    /// Opens a session to go on with it; see [`Session::open`].
    ///
    /// # Errors
    /// [`SessionError`] where there is none of that name, it is damaged, or another process writes it.
    pub fn open(&self, name: &str) -> Result<Session, SessionError> {
        Session::open(&self.folder(name)?)
    }

    /// Makes a new session under the manifest's name.
    ///
    /// # Errors
    /// [`SessionError`] where the name is not allowed or taken, the manifest makes no sense, or the disk fails.
    pub fn create(&self, manifest: &Manifest) -> Result<Session, SessionError> {
        self.stage(manifest)?.publish()
    }

    /// Makes a new session in a hidden folder: nobody sees it before [`Staged::publish`], and it leaves
    /// nothing where that is not reached.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn stage(&self, manifest: &Manifest) -> Result<Staged, SessionError> {
        let target = self.folder(&manifest.name)?;
        check_manifest(manifest)
            .map_err(|reason| SessionError::Manifest { path: target.join(MANIFEST), reason })?;
        self.refuse_existing(&target, &manifest.name)?;
        let text = serde_json::to_vec_pretty(manifest)
            .map_err(|e| SessionError::Manifest { path: target.join(MANIFEST), reason: e.to_string() })?;
        let folder = self.data.join(format!(".new-{}", manifest.name));
        std::fs::create_dir_all(&folder).map_err(SessionError::io("create", &folder, 0))?;
        super::open::check_folder(&folder)?;
        // Whoever made this folder before and was killed has left its lock; whoever lives holds it.
        let lock = Lock::take(&folder)?;
        empty(&folder)?;
        for name in [FRAMES, PRODUCTS] {
            let sub = folder.join(name);
            std::fs::create_dir(&sub).map_err(SessionError::io("create", &sub, 0))?;
        }
        write_whole(&folder, JOURNAL, b"")?;
        write_whole(&folder, MANIFEST, &text)?;
        let session = Session::with_lock(&folder, lock)?;
        Ok(Staged { session: Some(session), store: self.clone(), name: manifest.name.clone() })
    }

    fn refuse_existing(&self, target: &Path, name: &str) -> Result<(), SessionError> {
        match target.symlink_metadata() {
            Ok(_) => Err(SessionError::Exists { name: name.to_owned(), data: self.data.clone() }),
            Err(_) => Ok(()),
        }
    }
}

/// A session that nobody sees yet.
#[derive(Debug)]
pub struct Staged {
    session: Option<Session>,
    store: Store,
    name: String,
}

impl Staged {
    /// The session, to be filled.
    pub fn session(&mut self) -> &mut Session {
        self.session.as_mut().expect("a session is there until it is published")
    }

    /// Gives the session its name, whole and durable.
    ///
    /// # Errors
    /// [`SessionError::Exists`] where the name was taken meanwhile; the system's reason otherwise.
    pub fn publish(mut self) -> Result<Session, SessionError> {
        let target = self.store.folder(&self.name)?;
        self.store.refuse_existing(&target, &self.name)?;
        let folder = self.session().recording().folder().to_owned();
        sync_folder(&folder)?;
        // A folder is never renamed over one that holds anything: the system refuses.
        std::fs::rename(&folder, &target).map_err(SessionError::io("rename", &target, 0))?;
        sync_folder(&self.store.data)?;
        let mut session = self.session.take().expect("a session is there until it is published");
        session.moved_to(target);
        Ok(session)
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(session) = &self.session {
            // Where this fails the next attempt under this name empties the folder.
            let _ = std::fs::remove_dir_all(session.recording().folder());
        }
    }
}

/// Removes what a killed attempt has left, except the lock that we hold.
fn empty(folder: &Path) -> Result<(), SessionError> {
    for entry in std::fs::read_dir(folder).map_err(SessionError::io("list", folder, 0))? {
        let path = entry.map_err(SessionError::io("list", folder, 0))?.path();
        if path.file_name().is_some_and(|n| n == LOCK) {
            continue;
        }
        let is_folder = path.symlink_metadata().is_ok_and(|m| m.is_dir());
        let removed = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        removed.map_err(SessionError::io("remove", &path, 0))?;
    }
    Ok(())
}
