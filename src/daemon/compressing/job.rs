//! The thread of one compression, and what the data folder remembers of it.

use super::news::News;
use super::{Claim, Compression, DaemonError, TEXT_LIMIT};
use crate::daemon::background::{End, Stopped};
use crate::daemon::ended;
use crate::session::event::CompressionState;
use crate::session::{Held, read_inside, write_whole};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The file in the data folder that names the compression being computed.
const POINTER: &str = ".compression.json";

/// What is being computed, as the data folder remembers it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Pointer {
    pub session: String,
    pub name: String,
    /// How often it was begun since it last came to a sample.
    pub tries: u32,
}

impl Pointer {
    /// What the last program was at when it ended, if anything; a file that nobody can read counts as begun too often.
    pub(super) fn read(data: &Path) -> Option<Self> {
        let text = read_inside(data, POINTER, TEXT_LIMIT).ok()?;
        let unknown = || Self { session: String::new(), name: String::new(), tries: u32::MAX };
        Some(serde_json::from_slice(&text).unwrap_or_else(|_| unknown()))
    }

    pub(super) fn write(&self, data: &Path) -> Result<(), DaemonError> {
        let text = serde_json::to_vec(self).map_err(|e| DaemonError::Encode(e.to_string()))?;
        write_whole(data, POINTER, &text)?;
        Ok(())
    }

    pub(super) fn forget(data: &Path) {
        // Where this fails the next program takes the compression up, and sees that it has ended.
        let _ = std::fs::remove_file(data.join(POINTER));
    }
}

/// What the thread is to compute.
pub(super) enum Work {
    New(Box<Claim>),
    GoOn(PathBuf, Held),
}

/// What the thread needs besides the work.
pub(super) struct Run {
    pub news: News,
    /// Set where it is to stop.
    pub stop: Arc<AtomicBool>,
    pub data: PathBuf,
    pub pointer: Pointer,
}

impl Run {
    /// Computes, and makes sure that the watchers are told of an end, whatever it is.
    pub(super) fn carry_out(mut self, work: Work, stopped: &Stopped) -> Result<End, String> {
        let begun = self.pointer.write(&self.data);
        let defect = "the compression ended by a defect of the program: please report it with the log";
        let done = ended(defect, || begun.and_then(|()| self.compute(work)));
        let (state, error) = match done {
            Ok(true) => (CompressionState::Complete, None),
            Ok(false) if stopped.by_somebody() => (CompressionState::Cancelled, None),
            Ok(false) => (CompressionState::Interrupted, None),
            Err(error) => (CompressionState::Failed, Some(error)),
        };
        if state != CompressionState::Interrupted {
            Pointer::forget(&self.data);
        }
        // First, so that whoever is told may begin the next.
        stopped.over();
        self.news.ended(state, error.clone());
        match (state, error) {
            (CompressionState::Complete, _) => Ok(End::Done),
            (_, Some(error)) => Err(error),
            _ => Ok(End::Stopped),
        }
    }

    /// Whether the end was reached.
    fn compute(&mut self, work: Work) -> Result<bool, DaemonError> {
        let news = &mut self.news;
        let mut compression = match work {
            Work::New(claim) => {
                news.setting_up("reading the body", 0.0);
                claim.build(&mut |phase, done| news.setting_up(phase, done))?
            }
            Work::GoOn(folder, held) => Compression::open(&folder, held)?,
        };
        news.running(compression.done(), compression.curve());
        let (data, pointer) = (&self.data, &mut self.pointer);
        let result = compression.run(&[], &self.stop, &mut |progress| {
            if pointer.tries > 0 {
                // It computes: it is not what ended the program before.
                pointer.tries = 0;
                if let Err(error) = pointer.write(data) {
                    tracing::warn!(%error, "the data folder does not remember that a compression computes");
                }
            }
            news.sampled(&progress);
        })?;
        Ok(result.finished)
    }
}
