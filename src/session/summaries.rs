//! One line for each session of a data folder; what was read is kept for as long as its files stay as they were.

use super::SessionError;
use super::disk::Lock;
use super::hashes::Identity;
use super::manifest::Origin;
use super::name::check_name;
use super::open::open_inside;
use super::recording::{JOURNAL, MANIFEST, Recording, State};
use jiff::Timestamp;
use serde::Serialize;
use std::collections::HashMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// One line of the list of sessions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The folder's name.
    pub name: String,
    /// When it was created; `None` where the manifest is damaged.
    pub created: Option<Timestamp>,
    /// Where its pictures come from.
    pub origin: Option<Origin>,
    /// Views in the plan.
    pub planned: usize,
    /// Views whose pictures are durable.
    pub captured: usize,
    /// How far it has come; `None` where it is damaged.
    pub state: Option<State>,
    /// Whether somebody writes it now.
    pub busy: bool,
    /// Bytes of a torn last line of the journal, which the next run cuts off.
    pub torn_bytes: usize,
    /// What is wrong with it and what to do; `None` where nothing is.
    pub damage: Option<String>,
}

/// The summaries that were made, by the states that manifest and journal were in.
#[derive(Debug, Default)]
pub(super) struct Summaries {
    known: Mutex<HashMap<String, ([Identity; 2], Summary)>>,
}

impl Summaries {
    /// The list of these sessions of a data folder, by name. One caller reads at a time: those that wait find it read.
    /// Beside it how many were read.
    pub(super) fn of(&self, data: &Path, mut names: Vec<String>, time: SystemTime) -> (Vec<Summary>, usize) {
        names.sort();
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let mut now = HashMap::with_capacity(names.len());
        let mut all = Vec::with_capacity(names.len());
        let mut read = 0;
        for name in names {
            let folder = data.join(&name);
            // Before it is read: what changes meanwhile makes the summary one of an older state, which is read again.
            let state = [MANIFEST, JOURNAL].map(|file| {
                let opened = open_inside(&folder, file).ok()?;
                Identity::of(&opened).ok().filter(|it| it.is_settled(time))
            });
            let state = match state {
                [Some(manifest), Some(journal)] => Some([manifest, journal]),
                _ => None,
            };
            let before = known.remove(&name).filter(|(before, _)| Some(before) == state.as_ref());
            let mut line = before.map_or_else(
                || {
                    read += 1;
                    summarise(&name, &folder)
                },
                |(_, line)| line,
            );
            line.busy = Lock::is_held(&folder);
            if let Some(state) = state {
                now.insert(name, (state, line.clone()));
            }
            line.state = line.state.map(|state| state.seen(line.busy));
            all.push(line);
        }
        *known = now;
        (all, read)
    }
}

fn summarise(name: &str, folder: &Path) -> Summary {
    let read: Result<Recording, SessionError> =
        check_name("session name", name).and_then(|()| Recording::read(folder));
    let mut line = Summary {
        name: name.to_owned(),
        created: None,
        origin: None,
        planned: 0,
        captured: 0,
        state: None,
        busy: false,
        torn_bytes: 0,
        damage: None,
    };
    match read {
        Err(e) => line.damage = Some(e.to_string()),
        Ok(r) => {
            line.created = Some(r.manifest().created);
            line.origin = Some(r.manifest().origin);
            line.planned = r.manifest().plan.views.len();
            line.captured = r.views().len();
            line.state = Some(r.state());
            line.torn_bytes = r.torn_bytes();
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::event::{EventKind, Role};
    use crate::session::{Manifest, Plan, PlannedView, Store};
    use std::time::Duration;

    #[test]
    fn a_journal_is_read_again_when_it_has_changed_and_not_otherwise() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(dir.path());
        let view = PlannedView { index: 0, role: Role::Grain, angle_deg: 0.0, steps: None };
        let plan = Plan { views: vec![view], settle_ms: 0, retakes: 0, tolerance_deg: 1.0 };
        let names = ["a", "b", "c"].map(str::to_owned);
        for name in &names {
            store.create(&Manifest::new(name, Origin::Rig, plan.clone(), serde_json::Value::Null)).unwrap();
        }
        let summaries = Summaries::default();
        // As an hour later: nothing has been written lately.
        let later = SystemTime::now() + Duration::from_secs(3600);
        let list = |at| summaries.of(dir.path(), names.to_vec(), at);
        assert_eq!(list(later).1, 3);
        assert_eq!(list(later).1, 0);
        let mut session = store.open("b").unwrap();
        session.append(EventKind::Aborted).unwrap();
        let (all, read) = list(later);
        assert_eq!((read, all[1].state, all[1].busy), (1, Some(State::Aborted), true));
        drop(session);
        let (all, read) = list(later);
        assert_eq!((read, all[1].busy), (0, false));
        std::fs::write(dir.path().join("c/journal.jsonl"), "no journal\n").unwrap();
        let (all, read) = list(later);
        assert!(read == 1 && all[2].damage.is_some(), "{all:?}");
        // What was changed a moment ago may change again unseen: it is read each time.
        assert_eq!(list(SystemTime::now()).1, 3);
    }
}
