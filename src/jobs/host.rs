//! The rig's one job at a time, begun by one client and watched by all.

use super::capturing::{PreparedRun, Resumption, begin, take_up};
use super::slot::{NotTaken, Over, Slot};
use super::{CaptureOptions, Context, DeviceLine, Finding, JobError, Names, Watcher, devices, doctor, ended};
use crate::acquire::{Control, Phase, QualityMode};
use crate::config::Config;
use crate::session::Store;
use crate::session::event::{Event, EventKind};
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// Runs one capture at a time on a thread of its own.
pub struct Host {
    store: Store,
    config: Config,
    watcher: Watcher,
    /// No run waits in it: somebody must put the next grain on the pedestal first.
    slot: Slot<Run>,
    /// Held while the rig is looked at: no run begins meanwhile.
    examined: Mutex<()>,
}

/// What is known of a run.
#[derive(Clone)]
struct Run {
    session: String,
    control: Control,
}

impl Host {
    /// A host of sessions in `data`, captured as `config` says; `watcher` is told of every run's events.
    pub fn new(data: PathBuf, config: Config, watcher: Watcher) -> Self {
        Self { store: Store::new(data), config, watcher, slot: Slot::new("run", 0), examined: Mutex::new(()) }
    }

    /// The sessions.
    pub fn store(&self) -> Store {
        self.store.clone()
    }

    /// What a job beside the rig has of its surroundings: a client's names lead to sessions and to what clients have put there.
    pub fn context(&self) -> Context {
        Context {
            names: Names::Exchange(self.store()),
            config: self.config.clone(),
            as_given: false,
            watcher: Arc::clone(&self.watcher),
            stop: Arc::default(),
        }
    }

    /// Begins a capture and returns its session's name once rig and session are there. `overrides` are settings by their names
    /// in the configuration.
    ///
    /// # Errors
    /// [`JobError`] while another run goes on, for overrides that make no sense, and where the rig or the
    /// session can't be had.
    pub fn start(
        &self,
        options: &CaptureOptions,
        overrides: serde_json::Map<String, serde_json::Value>,
    ) -> Result<String, JobError> {
        self.carry_on(&options.name, || {
            let config = options.over(&self.config.with(overrides)?, &self.context().names)?;
            begin(self.store.data(), &options.name, &config)
        })
    }

    /// Goes on with a session that was aborted, interrupted or has failed, missing views judged so, and returns its name once rig and session are
    /// there.
    ///
    /// # Errors
    /// [`JobError`] while another run goes on, where nothing is left to do, and where the rig or the session can't be had.
    pub fn resume_session(&self, name: &str, quality: Option<QualityMode>) -> Result<String, JobError> {
        self.carry_on(name, || {
            let folder = self.store().folder(name)?;
            match take_up(&folder, quality)? {
                Resumption::Run(begun) => Ok(*begun),
                Resumption::Nothing(_) => Err(JobError::NotNow(
                    "the session is complete, nothing is left to do; start a run of another name",
                )),
                Resumption::Again { .. } | Resumption::Merge(_) => Err(JobError::NotNow(
                    "its views are complete and its products are to be made again; `grainrig resume` does that",
                )),
            }
        })
    }

    /// Begins a run on a thread of its own, one at a time.
    fn carry_on(
        &self,
        name: &str,
        begin: impl FnOnce() -> Result<PreparedRun, JobError>,
    ) -> Result<String, JobError> {
        let _at_the_rig = self.rig_alone()?;
        let free = self.slot.free()?;
        let begun = begin()?;
        let run = Run { session: name.to_owned(), control: Control::attended() };
        let (first_told, first) = channel();
        let (control, watcher) = (run.control.clone(), Arc::clone(&self.watcher));
        let work = move |over: &Over| carry_out(begun, &control, over, &watcher, first_told);
        free.begin(run, work).map_err(|source| JobError::Thread { source })?;
        // Whoever is told that there is a run finds it in the status, and not the end of the one before. Where the run ends
        // without a word the sender is gone.
        let _ = first.recv();
        Ok(name.to_owned())
    }

    /// The right to open the rig: given back when it is dropped.
    fn rig_alone(&self) -> Result<MutexGuard<'_, ()>, JobError> {
        match self.examined.try_lock() {
            Ok(alone) => Ok(alone),
            Err(TryLockError::Poisoned(left)) => Ok(left.into_inner()),
            Err(TryLockError::WouldBlock) => {
                Err(JobError::NotNow("the rig is being looked at; it takes a few seconds"))
            }
        }
    }

    /// The devices that are there; none is opened.
    ///
    /// # Errors
    /// [`JobError::Rig`] where the simulated rig can't be set up.
    pub fn devices(&self) -> Result<Vec<DeviceLine>, JobError> {
        devices(&self.config).map_err(JobError::Rig)
    }

    /// Looks at everything that a run needs; the stage makes a step and comes back, the camera takes a picture.
    ///
    /// # Errors
    /// [`JobError::Busy`] while a run goes on, [`JobError::NotNow`] while the rig is looked at already.
    pub fn doctor(&self) -> Result<Vec<Finding>, JobError> {
        let _at_the_rig = self.rig_alone()?;
        if let Some(running) = self.slot.running() {
            return Err(JobError::Busy(running.session));
        }
        Ok(doctor(&self.config, self.store.data(), &mut |_| {}))
    }

    /// Pauses the run before its next step.
    ///
    /// # Errors
    /// [`JobError::NotNow`] where nothing is being captured, or a pause was asked for already.
    pub fn pause(&self) -> Result<(), JobError> {
        self.steer(|c| {
            // By what was asked and not by where the run stands, which takes a moment to follow.
            if c.is_pausing() {
                Err(JobError::NotNow("the run is paused already, or about to be; resume it to go on"))
            } else {
                c.pause();
                Ok(())
            }
        })
    }

    /// Lets a paused run go on.
    ///
    /// # Errors
    /// [`JobError::NotNow`] where no run is paused, nor about to be.
    pub fn resume(&self) -> Result<(), JobError> {
        self.steer(|c| {
            if !c.is_pausing() {
                return Err(JobError::NotNow("the run is not paused"));
            }
            c.resume();
            Ok(())
        })
    }

    /// Stops the run; what was captured stays.
    ///
    /// # Errors
    /// [`JobError::NotNow`] where nothing is being captured.
    pub fn abort(&self) -> Result<(), JobError> {
        self.steer(|c| {
            c.abort();
            Ok(())
        })
    }

    fn steer(&self, act: impl FnOnce(&Control) -> Result<(), JobError>) -> Result<(), JobError> {
        let Some(running) = self.slot.running() else {
            return Err(JobError::NotNow("there is no run; start one first"));
        };
        if matches!(running.control.phase(), Phase::Complete | Phase::Aborted | Phase::Failed) {
            return Err(JobError::NotNow(
                "all views are captured, the mesh is being made; it ends by itself",
            ));
        }
        act(&running.control)
    }

    /// Stops the run, if there is one, for good, and waits for its end, `limit` at most; whether it came.
    ///
    /// A view in hand is finished. A mesh that is being made can't be stopped, but what it is made from is on
    /// the disk: a program that ends in spite of it loses nothing that `grainrig resume` doesn't bring back.
    pub fn finish(&self, limit: Duration) -> bool {
        self.slot.close(|run| run.control.abort(), limit)
    }
}

impl From<NotTaken<Run>> for JobError {
    fn from(why: NotTaken<Run>) -> Self {
        match why {
            NotTaken::Closed => Self::NotNow("the program is ending; start it again, then the run"),
            NotTaken::Busy(run) => Self::Busy(run.session),
        }
    }
}

/// Runs, and makes sure that the watchers are told of an end, whatever it is. `first_told` hears when they were told of the
/// run's first event.
fn carry_out(begun: PreparedRun, control: &Control, over: &Over, watcher: &Watcher, first_told: Sender<()>) {
    let (tell, first) = (Arc::clone(watcher), Mutex::new(Some(first_told)));
    let is_over = over.clone();
    let watcher: Watcher = Arc::new(move |event: &Event| {
        // First, so that whoever is told may begin the next run.
        if matches!(event.what, EventKind::Complete { .. } | EventKind::Failed { .. } | EventKind::Aborted) {
            is_over.set();
        }
        tell(event);
        let began = first.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(began) = began {
            // Nobody may be waiting any more.
            let _ = began.send(());
        }
    });
    let what = "the run ended by a defect of the program; what was captured stays: please report it with the log, and resume \
                the session";
    let Err(error) = ended(what, || begun.run(None, control, &watcher)) else { return };
    tracing::warn!("{error}");
    // A journal that can't be written can't tell of the end.
    if !over.is_set() {
        watcher(&Event { seq: 0, time: jiff::Timestamp::now(), what: EventKind::Failed { error } });
    }
}
