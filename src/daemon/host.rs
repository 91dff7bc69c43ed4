//! The rig's one job at a time, begun by one client and watched by all.

use super::live::begin;
use super::{DaemonError, Watcher};
use crate::acquire::{Control, Phase};
use crate::config::{Config, ConfigError};
use crate::session::Store;
use crate::session::event::{Event, Happening};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Runs one capture at a time on a thread of its own.
pub struct Host {
    data: PathBuf,
    config: Config,
    watcher: Watcher,
    job: Mutex<Option<Job>>,
}

struct Job {
    session: String,
    control: Control,
    thread: JoinHandle<()>,
}

/// Why the host did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// Another run goes on.
    #[error("the rig is capturing session {0}; wait for its end, or abort it")]
    Busy(String),
    /// There is nothing to steer.
    #[error("{0}")]
    NotNow(&'static str),
    /// What was asked makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The run could not begin.
    #[error(transparent)]
    Daemon(#[from] DaemonError),
}

impl Host {
    /// A host of sessions in `data`, captured as `config` says; `watcher` is told of every run's events.
    pub fn new(data: PathBuf, config: Config, watcher: Watcher) -> Self {
        Self { data, config, watcher, job: Mutex::new(None) }
    }

    /// The sessions.
    pub fn store(&self) -> Store {
        Store::new(&self.data)
    }

    fn job(&self) -> MutexGuard<'_, Option<Job>> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a capture and returns its session's name once rig and session are there.
    ///
    /// # Errors
    /// [`HostError`] while another run goes on, for overrides that make no sense, and where the rig or the session
    /// can't be had.
    pub fn start(
        &self,
        name: &str,
        overrides: serde_json::Map<String, serde_json::Value>,
    ) -> Result<String, HostError> {
        let mut job = self.job();
        if let Some(running) = job.as_ref().filter(|j| !j.thread.is_finished()) {
            return Err(HostError::Busy(running.session.clone()));
        }
        let config = self.config.with(overrides)?;
        let begun = begin(&self.data, name, &config)?;
        let control = Control::new();
        let (steered, outside) = (control.clone(), Arc::clone(&self.watcher));
        let thread = std::thread::Builder::new()
            .name("run".into())
            .spawn(move || {
                let told = Arc::new(AtomicBool::new(false));
                let (inside, tell) = (Arc::clone(&told), Arc::clone(&outside));
                let watcher: Watcher = Arc::new(move |event: &Event| {
                    let is_end = matches!(
                        event.what,
                        Happening::Complete { .. } | Happening::Failed { .. } | Happening::Aborted
                    );
                    inside.fetch_or(is_end, Ordering::Relaxed);
                    tell(event);
                });
                let ended = catch_unwind(AssertUnwindSafe(|| begun.run(None, &steered, &watcher)));
                let error = match ended {
                    Ok(Ok(_)) => return,
                    Ok(Err(error)) => error.to_string(),
                    Err(_) => {
                        "the run ended by a defect of the program; what was captured stays: please report \
                               it with the log, and resume the session"
                            .into()
                    }
                };
                tracing::warn!("{error}");
                // A journal that can't be written can't tell of the end.
                if !told.load(Ordering::Relaxed) {
                    outside(&Event {
                        seq: 0,
                        time: jiff::Timestamp::now(),
                        what: Happening::Failed { error },
                    });
                }
            })
            .map_err(|source| DaemonError::Thread { source })?;
        *job = Some(Job { session: name.to_owned(), control, thread });
        Ok(name.to_owned())
    }

    /// Pauses the run before its next step.
    ///
    /// # Errors
    /// [`HostError::NotNow`] where nothing is being captured.
    pub fn pause(&self) -> Result<(), HostError> {
        self.steer(|c| {
            if c.phase() == Phase::Paused {
                Err(HostError::NotNow("the run is paused already; resume it to go on"))
            } else {
                c.pause();
                Ok(())
            }
        })
    }

    /// Lets a paused run go on.
    ///
    /// # Errors
    /// [`HostError::NotNow`] where no run is paused, nor about to be.
    pub fn resume(&self) -> Result<(), HostError> {
        self.steer(|c| {
            if !c.is_pausing() {
                return Err(HostError::NotNow("the run is not paused"));
            }
            c.resume();
            Ok(())
        })
    }

    /// Stops the run; what was captured stays.
    ///
    /// # Errors
    /// [`HostError::NotNow`] where nothing is being captured.
    pub fn abort(&self) -> Result<(), HostError> {
        self.steer(|c| {
            c.abort();
            Ok(())
        })
    }

    fn steer(&self, act: impl FnOnce(&Control) -> Result<(), HostError>) -> Result<(), HostError> {
        let job = self.job();
        let Some(running) = job.as_ref().filter(|j| !j.thread.is_finished()) else {
            return Err(HostError::NotNow("there is no run; start one first"));
        };
        if matches!(running.control.phase(), Phase::Complete | Phase::Aborted | Phase::Failed) {
            return Err(HostError::NotNow(
                "all views are captured, the mesh is being made; it ends by itself",
            ));
        }
        act(&running.control)
    }

    /// Stops the run, if there is one, and waits for its end.
    pub fn finish(&self) {
        let running = self.job().take();
        if let Some(running) = running {
            running.control.abort();
            // A panic in there is caught and told already.
            let _ = running.thread.join();
        }
    }
}
