//! A session is taken away whole.

use super::disk::hold;
use super::{Recording, SessionError, Store};
use std::fs;
use std::path::PathBuf;

/// Removes a session with everything in its folder: it is there, or it is gone, at any instant.
///
/// # Errors
/// [`SessionError::Absent`] where there is no session, [`SessionError::Locked`] while somebody writes it,
/// [`SessionError::Needed`] for a capture that a merged grain of the data folder is made from; the system's reason otherwise.
pub fn remove(store: &Store, name: &str) -> Result<(), SessionError> {
    let folder = store.folder(name)?;
    // Of a damaged one only that it is one need be known.
    if let Err(e @ (SessionError::Absent { .. } | SessionError::Irregular { .. })) = Recording::read(&folder)
    {
        return Err(e);
    }
    let needed_by: Vec<String> = merged_from(store, name)?;
    if !needed_by.is_empty() {
        return Err(SessionError::Needed { name: name.to_owned(), by: needed_by });
    }
    let held = hold(&folder)?;
    // A compression is computed by whoever holds its own folder.
    let compressions = Recording::read(&folder).and_then(|r| r.compressions_path());
    let entries = compressions.ok().and_then(|path| fs::read_dir(path).ok()).into_iter().flatten().flatten();
    let folders = entries.filter(|e| e.file_type().is_ok_and(|kind| kind.is_dir()));
    let all_held: Vec<_> = folders.map(|e| hold(&e.path())).collect::<Result<_, _>>()?;
    let away: PathBuf = store.data().join(format!(".removed-{name}"));
    // What an earlier removal left that was interrupted.
    let _ = fs::remove_dir_all(&away);
    fs::rename(&folder, &away).map_err(SessionError::io("remove", &folder, 0))?;
    drop((held, all_held));
    fs::remove_dir_all(&away).map_err(SessionError::io("remove", &away, 0))
}

/// The merged grains of a data folder that this session is a source of.
fn merged_from(store: &Store, name: &str) -> Result<Vec<String>, SessionError> {
    let all = store.list()?;
    let is_source = |other: &str| {
        let recording = store.read(other).ok()?;
        recording.manifest().merged_from.iter().any(|source| source.name == name).then_some(())
    };
    Ok(all.into_iter().map(|s| s.name).filter(|other| is_source(other).is_some()).collect())
}
