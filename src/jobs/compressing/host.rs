//! Compressions in the background, begun by one client and watched by all.
//!
//! ```text
//!  start, resume ─▶ claim ─▶ queue of the background ─▶ DATA/.compression.json, computed
//!  complete, cancelled, failed ─▶ the file is removed       the program ends, however it does ─▶ it stays: go_on
//! ```

use super::asked::{asked, is_finished};
use super::catalogue::{Active, details, list, open};
use super::job::{Registry, RegistryEntry, Run, Work};
use super::of_session::{claim_of, grain};
use super::others::others;
use super::reporter::CompressionReporter;
use super::{Claim, CompressDetails, CompressLine, CompressRequest, JobError, RUN, keep_beside};
use crate::jobs::background::{Background, JobDescription};
use crate::jobs::{BackgroundError, BackgroundWatcher, ErrorKind, Names};
use crate::session::event::JobKind;
use crate::session::{Store, hold};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// So often a compression is taken up again that never came to its first sample: it may be what ended the program.
const MOST_TRIES: u32 = 3;

/// Computes compressions in the background, and knows those that are there.
pub struct CompressHost {
    store: Store,
    watcher: BackgroundWatcher,
    background: Arc<Background>,
    registry: Arc<Registry>,
}

impl CompressHost {
    /// A host of the compressions in a data folder; `watcher` is told of each one's news.
    pub fn new(data: &Path, background: Arc<Background>, watcher: BackgroundWatcher) -> Self {
        let registry = Arc::new(Registry::new(data));
        Self { store: Store::new(data), watcher, background, registry }
    }

    /// Compresses a complete session's grain, once the computations before it have ended; the compression's name: its material,
    /// with a number where there is one already.
    ///
    /// # Errors
    /// [`JobError`] where too many computations wait, for figures that make no sense, and for a session without a finished
    /// grain.
    pub fn start(&self, session: &str, request: &CompressRequest) -> Result<String, JobError> {
        let recording = self.store.read(session)?;
        let curves = others(request, &Names::Exchange(self.store.clone()), Some(&recording))?;
        let (name, claim) = claim_of(&recording, request, false)?;
        if !curves.is_empty() {
            keep_beside(&claim.folder, &curves)?;
        }
        let entry = RegistryEntry { session: session.into(), name: name.clone(), tries: 0 };
        self.begin(entry, Work::New(Box::new(claim)))?;
        Ok(name)
    }

    /// Goes on with a compression that was cancelled or interrupted, once the computations before it have ended.
    ///
    /// # Errors
    /// [`JobError`] where it goes on or waits already, where there is none of that name, or it is complete.
    pub fn resume(&self, session: &str, name: &str) -> Result<(), JobError> {
        self.take_up(RegistryEntry { session: session.into(), name: name.into(), tries: 0 })
    }

    /// Goes on with the compressions that the last program was at when it ended, or that waited; session and name of each.
    pub fn go_on(&self) -> Vec<(String, String)> {
        let Some(left) = self.registry.left() else { return Vec::new() };
        let left = left.unwrap_or_else(|error| {
            tracing::warn!("what the last program computed is not known: {error}; it is left alone until somebody resumes it");
            Vec::new()
        });
        let mut under_way = Vec::new();
        let mut another = false;
        for before in left {
            let (session, name) = (before.session.clone(), before.name.clone());
            if before.tries >= MOST_TRIES {
                tracing::warn!(
                    "compression {name} of session {session} was begun {MOST_TRIES} times and never came to its first sample: \
                     it is left alone until somebody resumes it"
                );
                continue;
            }
            match self.take_up(before) {
                Ok(()) => under_way.push((session, name)),
                Err(error) => {
                    tracing::warn!("compression {name} of session {session} does not go on: {error}");
                    // Another program on the same folder may be at it.
                    another |= error.kind() == ErrorKind::Busy;
                }
            }
        }
        if !another && let Err(error) = self.registry.write() {
            tracing::warn!("{error}");
        }
        under_way
    }

    /// Stops the compression; what is computed stays, and it can go on.
    ///
    /// # Errors
    /// [`JobError::NotNow`] where there is none.
    pub fn cancel(&self) -> Result<(), JobError> {
        let running = self.background.running(|about| about.kind == JobKind::Compress);
        let running = running.ok_or(JobError::NotNow("there is no compression; start one first"))?;
        match self.background.cancel(running) {
            // It has just ended by itself.
            Ok(()) | Err(BackgroundError::Absent) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// The compressions of a session.
    ///
    /// # Errors
    /// [`JobError::Session`] where there is no such session.
    pub fn list(&self, session: &str) -> Result<Vec<CompressLine>, JobError> {
        Ok(list(&self.store.read(session)?, &|name| self.active(session, name)))
    }

    /// One compression, with its results as far as they are there.
    ///
    /// # Errors
    /// [`JobError::NoCompression`] where there is none of that name.
    pub fn details(&self, session: &str, name: &str) -> Result<CompressDetails, JobError> {
        details(&self.store.read(session)?, name, &|name| self.active(session, name))
    }

    /// Opens one of the files that [`Self::details`] lists.
    ///
    /// # Errors
    /// [`JobError::NoCompression`] where it is not listed.
    pub fn open(&self, session: &str, name: &str, file: &str) -> Result<File, JobError> {
        open(&self.store.read(session)?, name, file)
    }

    /// Whether a compression is being computed or waits for that.
    fn active(&self, session: &str, name: &str) -> Option<Active> {
        let is_it = |about: &JobDescription| about.is_compression(session, name);
        if self.background.running(is_it).is_some() {
            return Some(Active::Running);
        }
        self.background.waits(is_it).then_some(Active::Waiting)
    }

    fn take_up(&self, entry: RegistryEntry) -> Result<(), JobError> {
        let recording = self.store.read(&entry.session)?;
        let folder = recording.compression_path(&entry.name)?;
        let before = asked(&folder).ok_or(JobError::NoCompression)?;
        if is_finished(&folder) {
            return Err(JobError::NotNow("this compression has come to its end; its results are there"));
        }
        let work = if folder.join(RUN).exists() {
            let held = hold(&folder)?;
            Work::GoOn(folder, held)
        } else {
            let input = grain(&recording)?;
            Work::New(Box::new(Claim::new(&folder, input, &before.placing, &before.settings)?))
        };
        self.begin(entry, work)
    }

    fn begin(&self, entry: RegistryEntry, work: Work) -> Result<(), JobError> {
        let (session, name) = (entry.session.clone(), entry.name.clone());
        let stop = Arc::new(AtomicBool::new(false));
        let run = Run {
            news: CompressionReporter::new(&session, &name, Arc::clone(&self.watcher)),
            stop: Arc::clone(&stop),
            registry: Arc::clone(&self.registry),
            session: session.clone(),
            name: name.clone(),
        };
        // Before anybody is told of it: from then on it goes on, whatever ends the program.
        self.registry.add(entry)?;
        let (registry, of) = (Arc::clone(&self.registry), (session.clone(), name.clone()));
        let about = JobDescription {
            kind: JobKind::Compress,
            session: session.clone(),
            name: Some(name.clone()),
            stop: Some(stop),
            called_off: Some(Arc::new(move || registry.forget(&of.0, &of.1))),
        };
        self.background
            .queue(about, move |stopped, _| run.carry_out(work, stopped))
            .inspect_err(|_| self.registry.forget(&session, &name))?;
        Ok(())
    }
}
