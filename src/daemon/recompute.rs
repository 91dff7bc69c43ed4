//! What is computed from recorded sessions, as jobs that anyone may ask for: the command line does the same at once.

use super::background::{About, Background, End, Teller};
use super::{DaemonError, Watcher, merge, reconstruct, replay};
use crate::config::Config;
use crate::pipeline::MeshSettings;
use crate::session::event::{Happening, JobKind};
use crate::session::{Store, verify};
use crate::trace;
use serde::Deserialize;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use utoipa::ToSchema;

/// A computation to be done.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[schema(example = json!({ "kind": "reconstruct", "session": "leighton-buzzard-07", "mesh": { "surface_size_mm": 0.05 } }))]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ComputeRequest {
    /// Hull and mesh of a session again.
    Reconstruct {
        /// The session.
        session: String,
        /// The mesh's controls, where they are not to be the configured ones.
        #[serde(default)]
        mesh: MeshSettings,
        /// Whether outlines and the sheet of the calibration are drawn.
        #[serde(default = "yes")]
        pictures: bool,
        /// Take figures as they are that look like slips of unit.
        #[serde(default)]
        as_given: bool,
    },
    /// The whole way again, from the recording; a product that is missing or damaged is written again.
    Replay {
        /// The session.
        session: String,
    },
    /// Every file of a session against the hashes in its journal.
    Verify {
        /// The session.
        session: String,
    },
    /// Two captures of one grain, another side down in the second, become one.
    Merge {
        /// The merged grain's session, which must not exist yet.
        session: String,
        /// The first capture; the result is in its frame.
        a: String,
        /// The second.
        b: String,
        /// The mesh's controls, where they are not to be the first capture's.
        #[serde(default)]
        mesh: MeshSettings,
    },
}

fn yes() -> bool {
    true
}

impl ComputeRequest {
    fn about(&self) -> About {
        let (kind, session) = match self {
            Self::Reconstruct { session, .. } => (JobKind::Reconstruct, session),
            Self::Replay { session } => (JobKind::Replay, session),
            Self::Verify { session } => (JobKind::Verify, session),
            Self::Merge { session, .. } => (JobKind::Merge, session),
        };
        About { kind, session: session.clone(), name: None, stop: None, called_off: None }
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    fn check(&self, store: &Store) -> Result<(), DaemonError> {
        let mesh = match self {
            Self::Reconstruct { mesh, .. } | Self::Merge { mesh, .. } => Some(mesh),
            Self::Replay { .. } | Self::Verify { .. } => None,
        };
        if let Some(mesh) = mesh {
            Config { mesh: mesh.clone(), ..Config::default() }.check()?;
        }
        match self {
            // One that is damaged is what it is to tell.
            Self::Verify { session } if store.folder(session)?.exists() => {}
            Self::Reconstruct { session, .. } | Self::Replay { session } | Self::Verify { session } => {
                drop(store.read(session)?);
            }
            Self::Merge { session, a, b, .. } => {
                let out = store.folder(session)?;
                if out.symlink_metadata().is_ok() {
                    return Err(DaemonError::Taken { path: out });
                }
                if a == b {
                    return Err(DaemonError::OneSession { folder: store.folder(a)? });
                }
                drop((store.read(a)?, store.read(b)?));
            }
        }
        Ok(())
    }

    fn compute(&self, store: &Store, watcher: &Watcher) -> Result<(), DaemonError> {
        let asked = |mesh: &MeshSettings| (*mesh != MeshSettings::default()).then(|| mesh.clone());
        match self {
            Self::Reconstruct { session, mesh, pictures, as_given } => {
                let folder = store.folder(session)?;
                reconstruct(&folder, asked(mesh).as_ref(), *pictures, *as_given, watcher).map(drop)
            }
            Self::Replay { session } => {
                let done = replay(&store.folder(session)?, watcher)?;
                if done.differs.is_empty() {
                    return Ok(());
                }
                Err(DaemonError::Differs { products: done.differs, software: done.finished.result.software })
            }
            Self::Verify { session } => {
                let report = trace::job("verify", session, || verify(&store.folder(session)?))?;
                if report.is_sound() {
                    return Ok(());
                }
                Err(DaemonError::Damaged { session: session.clone(), faults: report.faults })
            }
            Self::Merge { session, a, b, mesh } => {
                let folders: [&Path; 2] = [&store.folder(a)?, &store.folder(b)?];
                merge(folders, &store.folder(session)?, asked(mesh).as_ref(), watcher).map(drop)
            }
        }
    }
}

impl Background {
    /// Begins a computation over the sessions of a data folder, or lets it wait; its number.
    ///
    /// # Errors
    /// [`DaemonError`] for what makes no sense, and where too many wait.
    pub fn compute(&self, store: &Store, request: ComputeRequest) -> Result<u64, DaemonError> {
        request.check(store)?;
        let store = store.clone();
        self.queue(request.about(), move |_, teller| {
            let teller = Arc::new(Mutex::new(teller.clone()));
            request.compute(&store, &progress(teller)).map_err(|e| e.to_string())?;
            Ok(End::Done)
        })
    }
}

/// Tells a job's progress by the events of its computation. The run's own are not passed on: they are not the rig's.
fn progress(teller: Arc<Mutex<Teller>>) -> Watcher {
    Arc::new(move |event| {
        let mut teller = teller.lock().unwrap_or_else(PoisonError::into_inner);
        match &event.what {
            Happening::Working { stage, done } => teller.progress(stage, *done),
            Happening::Silhouette { .. } => teller.progress("silhouettes", 0.0),
            _ => {}
        }
    })
}
