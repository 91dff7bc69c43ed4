//! One compression at a time, begun by one client and watched by all, beside whatever the rig does.
//!
//! ```text
//!  start, resume ─▶ claim, DATA/.compression.json ─▶ a thread, waiting for a pool of its own, at the lowest priority
//!  complete, cancelled, failed ─▶ the file is removed       the program ends, however it does ─▶ it stays: go_on
//! ```
//! The pool keeps a capture's work from queueing behind a compression's, and its threads' priority leaves a capture every
//! core that it wants; the curve does not depend on either.

use super::asked::{asked, is_finished};
use super::job::{Flags, Pointer, Run, Work};
use super::news::News;
use super::shelf::{details, list, open};
use super::{
    Claim, CompressDetails, CompressInput, CompressLine, CompressMaterial, CompressRequest, DaemonError, RUN,
};
use crate::daemon::Watcher;
use crate::session::{Recording, SessionError, State, Store, check_name, hold};
use grainrig_core::formats::stl;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// So often a compression is taken up again that never came to its first sample: it may be what ended the program.
const MOST_TRIES: u32 = 3;
/// The surface of a session's grain.
const SURFACE: &str = "grain.stl";

/// Why a compression was not done as asked.
#[derive(Debug, thiserror::Error)]
pub enum CompressError {
    /// Another one goes on.
    #[error("compression {name} of session {session} goes on; wait for its end, or cancel it")]
    Busy {
        /// Name of its session.
        session: String,
        /// Its name.
        name: String,
    },
    /// There is nothing to do it with.
    #[error("{0}")]
    NotNow(&'static str),
    /// A session without a finished grain.
    #[error(
        "session {session} is not complete: it has no surface to compress; `grainrig resume {session}` makes it"
    )]
    Unfinished {
        /// The session.
        session: String,
    },
    /// No such compression or file.
    #[error("there is no compression or file of that name; see the session's list")]
    Absent,
    /// The compression.
    #[error(transparent)]
    Daemon(#[from] DaemonError),
}

impl From<SessionError> for CompressError {
    fn from(error: SessionError) -> Self {
        Self::Daemon(error.into())
    }
}

/// Computes one compression at a time.
pub struct CompressHost {
    store: Store,
    watcher: Watcher,
    job: Mutex<Option<Job>>,
    /// The program ends: none begins any more.
    closed: AtomicBool,
}

struct Job {
    session: String,
    name: String,
    flags: Arc<Flags>,
    /// Nothing is ever sent: it hangs up when the thread has let go of everything.
    thread: Receiver<()>,
}

impl CompressHost {
    /// A host of the compressions in a data folder; `watcher` is told of each one's news.
    pub fn new(data: &Path, watcher: Watcher) -> Self {
        Self { store: Store::new(data), watcher, job: Mutex::new(None), closed: AtomicBool::new(false) }
    }

    /// Begins to compress a complete session's grain; the compression's name: its material, with a number where there is one
    /// already.
    ///
    /// # Errors
    /// [`CompressError`] while another one goes on, for figures that make no sense, and for a session without a finished grain.
    pub fn start(&self, session: &str, request: &CompressRequest) -> Result<String, CompressError> {
        let mut job = self.free()?;
        let settings = request.settings().map_err(DaemonError::from)?;
        let recording = self.store.read(session)?;
        let input = grain(&recording, session)?;
        let (name, folder) = next_name(&recording, request.material)?;
        let claim = Claim::new(&folder, input, &request.placing(), settings)?;
        self.begin(
            &mut job,
            Pointer { session: session.into(), name: name.clone(), tries: 1 },
            Work::New(Box::new(claim)),
        )?;
        Ok(name)
    }

    /// Goes on with a compression that was cancelled or interrupted.
    ///
    /// # Errors
    /// [`CompressError`] while another one goes on, where there is none of that name, or it is complete.
    pub fn resume(&self, session: &str, name: &str) -> Result<(), CompressError> {
        self.take_up(Pointer { session: session.into(), name: name.into(), tries: 1 })
    }

    /// Goes on with the compression that the last program was at when it ended, if there is one; session and name.
    pub fn go_on(&self) -> Option<(String, String)> {
        let before = Pointer::read(self.store.data())?;
        let Some(before) = Some(before).filter(|p| p.tries < MOST_TRIES) else {
            tracing::warn!(
                "a compression was begun {MOST_TRIES} times and never came to its first sample: it is left alone until \
                 somebody resumes it"
            );
            Pointer::forget(self.store.data());
            return None;
        };
        let named = (before.session.clone(), before.name.clone());
        match self.take_up(Pointer { tries: before.tries + 1, ..before }) {
            Ok(()) => Some(named),
            Err(error) => {
                tracing::warn!("compression {} of session {} does not go on: {error}", named.1, named.0);
                // Another program on the same folder may be at it.
                if !matches!(error, CompressError::Daemon(DaemonError::Session(SessionError::Locked { .. })))
                {
                    Pointer::forget(self.store.data());
                }
                None
            }
        }
    }

    /// Stops the compression; what is computed stays, and it can go on.
    ///
    /// # Errors
    /// [`CompressError::NotNow`] where there is none.
    pub fn cancel(&self) -> Result<(), CompressError> {
        let job = self.lock();
        let running = job.as_ref().filter(|j| !j.flags.told.load(Ordering::Acquire));
        let running = running.ok_or(CompressError::NotNow("there is no compression; start one first"))?;
        running.flags.cancelled.store(true, Ordering::Release);
        running.flags.stop.store(true, Ordering::Release);
        Ok(())
    }

    /// The compressions of a session.
    ///
    /// # Errors
    /// [`CompressError::Daemon`] where there is no such session.
    pub fn list(&self, session: &str) -> Result<Vec<CompressLine>, CompressError> {
        Ok(list(&self.store.read(session)?, self.running(session).as_deref()))
    }

    /// One compression, with its results as far as they are there.
    ///
    /// # Errors
    /// [`CompressError::Absent`] where there is none of that name.
    pub fn details(&self, session: &str, name: &str) -> Result<CompressDetails, CompressError> {
        details(&self.store.read(session)?, name, self.running(session).as_deref())
    }

    /// Opens one of the files that [`Self::details`] lists.
    ///
    /// # Errors
    /// [`CompressError::Absent`] where it is not listed.
    pub fn open(&self, session: &str, name: &str, file: &str) -> Result<File, CompressError> {
        open(&self.store.read(session)?, name, file)
    }

    /// Stops the compression, if there is one, because the program ends, and waits for a checkpoint, `limit` at most; whether
    /// it came. The next program goes on with it either way.
    pub fn finish(&self, limit: Duration) -> bool {
        self.closed.store(true, Ordering::Release);
        let Some(running) = self.lock().take() else { return true };
        running.flags.stop.store(true, Ordering::Release);
        running.thread.recv_timeout(limit) != Err(RecvTimeoutError::Timeout)
    }

    fn lock(&self) -> MutexGuard<'_, Option<Job>> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The name of the session's compression that is being computed.
    fn running(&self, session: &str) -> Option<String> {
        let job = self.lock();
        let running = job.as_ref().filter(|j| j.session == session && !j.flags.told.load(Ordering::Acquire));
        running.map(|j| j.name.clone())
    }

    /// The right to begin one.
    fn free(&self) -> Result<MutexGuard<'_, Option<Job>>, CompressError> {
        let mut job = self.lock();
        if self.closed.load(Ordering::Acquire) {
            return Err(CompressError::NotNow("the program is ending; start it again, then the compression"));
        }
        if let Some(before) = job.as_ref() {
            if !before.flags.told.load(Ordering::Acquire) {
                let (session, name) = (before.session.clone(), before.name.clone());
                return Err(CompressError::Busy { session, name });
            }
            // Who saw the end may begin the next at once; the folder is free in a moment.
            let _ = before.thread.recv();
        }
        *job = None;
        Ok(job)
    }

    fn take_up(&self, pointer: Pointer) -> Result<(), CompressError> {
        let mut job = self.free()?;
        let recording = self.store.read(&pointer.session)?;
        let folder = recording.compression_path(&pointer.name)?;
        let before = asked(&folder).ok_or(CompressError::Absent)?;
        if is_finished(&folder) {
            return Err(CompressError::NotNow("this compression has come to its end; its results are there"));
        }
        let work = if folder.join(RUN).exists() {
            let held = hold(&folder)?;
            Work::GoOn(folder, held)
        } else {
            let input = grain(&recording, &pointer.session)?;
            Work::New(Box::new(Claim::new(&folder, input, &before.placing, before.settings)?))
        };
        self.begin(&mut job, pointer, work)
    }

    fn begin(&self, job: &mut Option<Job>, pointer: Pointer, work: Work) -> Result<(), CompressError> {
        let (session, name) = (pointer.session.clone(), pointer.name.clone());
        pointer.write(self.store.data())?;
        let flags = Arc::new(Flags::default());
        let (hang_up, thread) = channel();
        let run = Run {
            news: News::new(&session, &name, Arc::clone(&self.watcher)),
            flags: Arc::clone(&flags),
            data: self.store.data().to_owned(),
            pointer,
        };
        let spawned = std::thread::Builder::new()
            .name("compression".into())
            .spawn(move || run.carry_out(work, hang_up));
        if let Err(source) = spawned {
            Pointer::forget(self.store.data());
            return Err(DaemonError::Thread { source }.into());
        }
        *job = Some(Job { session, name, flags, thread });
        Ok(())
    }
}

/// The session's grain as it was recorded.
fn grain(recording: &Recording, session: &str) -> Result<CompressInput, CompressError> {
    let record = recording.products().find(|p| p.file == SURFACE);
    let record = record.filter(|_| recording.state() == State::Complete);
    let record = record.ok_or_else(|| CompressError::Unfinished { session: session.into() })?;
    let bytes = recording.product(&record.file)?;
    let surface = stl::read(&bytes).map_err(DaemonError::from)?;
    Ok(CompressInput::Surface(surface, format!("session {session}")))
}

/// The first free one of `elastic`, `elastic-2` and so on, and its folder.
fn next_name(recording: &Recording, material: CompressMaterial) -> Result<(String, PathBuf), CompressError> {
    let first = match material {
        CompressMaterial::Elastic => "elastic",
        CompressMaterial::Plastic => "plastic",
    };
    let mut name = first.to_owned();
    for number in 2.. {
        let folder = recording.compression_path(&name)?;
        if folder.symlink_metadata().is_err() {
            return Ok((name, folder));
        }
        name = format!("{first}-{number}");
        check_name("compression", &name)?;
    }
    Err(CompressError::Absent)
}
