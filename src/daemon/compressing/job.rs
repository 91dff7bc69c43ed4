//! The thread of one compression, and what the data folder remembers of it.

use super::news::News;
use super::{Claim, Compression, DaemonError, TEXT_LIMIT};
use crate::session::event::CompressionState;
use crate::session::{Held, read_inside, write_whole};
use serde::{Deserialize, Serialize};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;

/// The file in the data folder that names the compression being computed.
const POINTER: &str = ".compression.json";
/// The lowest priority: a thread of the usual one has 68 times its share of a core.
const NICE: i32 = 19;

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

#[derive(Default)]
pub(super) struct Flags {
    pub stop: AtomicBool,
    pub cancelled: AtomicBool,
    /// The watchers were told of the end.
    pub told: AtomicBool,
}

/// What the thread is to compute.
pub(super) enum Work {
    New(Box<Claim>),
    GoOn(PathBuf, Held),
}

/// What the thread needs besides the work.
pub(super) struct Run {
    pub news: News,
    pub flags: Arc<Flags>,
    pub data: PathBuf,
    pub pointer: Pointer,
}

impl Run {
    /// Computes, and makes sure that the watchers are told of an end, whatever it is.
    pub(super) fn carry_out(mut self, work: Work, hang_up: Sender<()>) {
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let source =
                |e: rayon::ThreadPoolBuildError| DaemonError::Thread { source: std::io::Error::other(e) };
            let pool = rayon::ThreadPoolBuilder::new()
                .thread_name(|n| format!("compress-{n}"))
                .start_handler(|_| step_back())
                .build()
                .map_err(source)?;
            pool.install(|| self.compute(work))
        }));
        let (state, error) = match ended {
            Ok(Ok(true)) => (CompressionState::Complete, None),
            Ok(Ok(false)) if self.flags.cancelled.load(Ordering::Acquire) => {
                (CompressionState::Cancelled, None)
            }
            Ok(Ok(false)) => (CompressionState::Interrupted, None),
            Ok(Err(error)) => (CompressionState::Failed, Some(error.to_string())),
            Err(_) => (
                CompressionState::Failed,
                Some(
                    "the compression ended by a defect of the program: please report it with the log".into(),
                ),
            ),
        };
        if let Some(error) = &error {
            tracing::warn!("{error}");
        }
        if state != CompressionState::Interrupted {
            Pointer::forget(&self.data);
        }
        // First, so that whoever is told may begin the next.
        self.flags.told.store(true, Ordering::Release);
        self.news.ended(state, error);
        drop(hang_up);
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
        let result = compression.run(&[], &self.flags.stop, &mut |progress| {
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

/// Gives this thread the lowest priority.
fn step_back() {
    // On Linux a priority is a thread's; no process means the caller.
    if let Err(error) = rustix::process::setpriority_process(None, NICE) {
        tracing::warn!(%error, "a compression keeps the usual priority");
    }
}
