//! The thread of one compression, and what the data folder remembers of it.

use super::reporter::CompressionReporter;
use super::{Claim, Compression, JobError, TEXT_LIMIT};
use crate::jobs::background::{JobEnd, StopState};
use crate::jobs::ended;
use crate::session::event::CompressionState;
use crate::session::{Held, read_inside, write_whole};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// The file in the data folder that names the compressions that wait or are computed.
const REGISTRY: &str = ".compression.json";

/// A compression that waits or is computed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct RegistryEntry {
    pub session: String,
    pub name: String,
    /// How often it was begun since it last came to a sample.
    pub tries: u32,
}

impl RegistryEntry {
    pub(super) fn is(&self, session: &str, name: &str) -> bool {
        self.session == session && self.name == name
    }
}

/// The compressions that wait or are computed, as the data folder remembers them for the next program.
pub(super) struct Registry {
    data: PathBuf,
    all: Mutex<Vec<RegistryEntry>>,
}

impl Registry {
    pub(super) fn new(data: &Path) -> Self {
        Self { data: data.to_owned(), all: Mutex::default() }
    }

    /// What the last program left; `None` where it left nothing, an error where nobody can read it.
    pub(super) fn left(&self) -> Option<Result<Vec<RegistryEntry>, String>> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Left {
            All(Vec<RegistryEntry>),
            // As an earlier version left it.
            One(RegistryEntry),
        }
        let text = read_inside(&self.data, REGISTRY, TEXT_LIMIT).ok()?;
        Some(match serde_json::from_slice(&text) {
            Ok(Left::All(all)) => Ok(all),
            Ok(Left::One(one)) => Ok(vec![one]),
            Err(e) => Err(e.to_string()),
        })
    }

    pub(super) fn add(&self, entry: RegistryEntry) -> Result<(), JobError> {
        self.change(|all| all.push(entry))
    }

    pub(super) fn forget(&self, session: &str, name: &str) {
        // Where this fails the next program takes the compression up, and sees that it has ended.
        let _ = self.change(|all| all.retain(|p| !p.is(session, name)));
    }

    /// It begins once more.
    pub(super) fn begins(&self, session: &str, name: &str) -> Result<(), JobError> {
        self.change(|all| all.iter_mut().filter(|p| p.is(session, name)).for_each(|p| p.tries += 1))
    }

    /// It came to a sample: it is not what ended the program before.
    pub(super) fn computes(&self, session: &str, name: &str) {
        let done =
            self.change(|all| all.iter_mut().filter(|p| p.is(session, name)).for_each(|p| p.tries = 0));
        if let Err(error) = done {
            tracing::warn!(%error, "the data folder does not remember that a compression computes");
        }
    }

    /// Writes down what is registry now; what the last program left is forgotten.
    pub(super) fn write(&self) -> Result<(), JobError> {
        self.change(|_| ())
    }

    fn change(&self, change: impl FnOnce(&mut Vec<RegistryEntry>)) -> Result<(), JobError> {
        let mut all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut all);
        if all.is_empty() {
            let _ = std::fs::remove_file(self.data.join(REGISTRY));
            return Ok(());
        }
        let text = serde_json::to_vec(&*all).map_err(|e| JobError::Encode(e.to_string()))?;
        write_whole(&self.data, REGISTRY, &text)?;
        Ok(())
    }
}

/// What the thread is to compute.
pub(super) enum Work {
    New(Box<Claim>),
    GoOn(PathBuf, Held),
}

/// What the thread needs besides the work.
pub(super) struct Run {
    pub news: CompressionReporter,
    /// Set where it is to stop.
    pub stop: Arc<AtomicBool>,
    pub registry: Arc<Registry>,
    pub session: String,
    pub name: String,
}

impl Run {
    /// Computes, and makes sure that the watchers are told of an end, whatever it is.
    pub(super) fn carry_out(mut self, work: Work, stopped: &StopState) -> Result<JobEnd, String> {
        let begun = self.registry.begins(&self.session, &self.name);
        let defect = "the compression ended by a defect of the program: please report it with the log";
        let done = ended(defect, || begun.and_then(|()| self.compute(work)));
        let (state, error) = match done {
            Ok(true) => (CompressionState::Complete, None),
            Ok(false) if stopped.by_somebody() => (CompressionState::Cancelled, None),
            Ok(false) => (CompressionState::Interrupted, None),
            Err(error) => (CompressionState::Failed, Some(error)),
        };
        if state != CompressionState::Interrupted {
            self.registry.forget(&self.session, &self.name);
        }
        // First, so that whoever is told may begin the next.
        stopped.over();
        self.news.ended(state, error.clone());
        match (state, error) {
            (CompressionState::Complete, _) => Ok(JobEnd::Done),
            (_, Some(error)) => Err(error),
            _ => Ok(JobEnd::Stopped),
        }
    }

    /// Whether the end was reached.
    fn compute(&mut self, work: Work) -> Result<bool, JobError> {
        let news = &mut self.news;
        let mut compression = match work {
            Work::New(claim) => {
                news.setting_up("reading the body", 0.0);
                claim.build(&mut |phase, done| news.setting_up(phase, done))?
            }
            Work::GoOn(folder, held) => Compression::open(&folder, held)?,
        };
        news.running(compression.done(), compression.curve());
        let mut is_first = true;
        let result = compression.run(&self.stop, &mut |progress| {
            if std::mem::take(&mut is_first) {
                self.registry.computes(&self.session, &self.name);
            }
            news.sampled(&progress);
        })?;
        Ok(result.finished)
    }
}
