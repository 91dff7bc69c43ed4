//! Where the names in a job's options lead: the same options are given on the command line, by whoever owns the computer, and
//! over HTTP, by clients who own what they have put there.

use super::JobError;
use crate::session::{Exchange, Store};
use std::path::{Path, PathBuf};

/// Where names lead.
#[derive(Clone)]
pub enum Names {
    /// The command line's: a plain name of a session is one of the data folder, anything else is a path of this computer.
    Anywhere(Store),
    /// A client's: sessions of the data folder, and files of its [`Exchange`].
    Exchange(Store),
}

impl Names {
    /// The sessions of the data folder.
    pub fn store(&self) -> &Store {
        match self {
            Self::Anywhere(store) | Self::Exchange(store) => store,
        }
    }

    /// The folder of a session: a plain name is looked for in the data folder first.
    ///
    /// # Errors
    /// [`JobError`] for what can be no session.
    pub fn session(&self, given: &Path) -> Result<PathBuf, JobError> {
        let named = self.store().folder(given.to_str().unwrap_or(""));
        if let Self::Exchange(_) = self {
            return Ok(named?);
        }
        match named {
            Ok(folder) if folder.exists() || !given.join("manifest.json").is_file() => Ok(folder),
            Err(error) if !given.is_dir() => Err(error.into()),
            // A link that a person names is that person's own; below it none is followed.
            _ if given.is_symlink() => given.canonicalize().map_err(|source| {
                crate::system::FileError { action: "follow", path: given.into(), source }.into()
            }),
            _ => Ok(given.to_owned()),
        }
    }

    /// The folder of a session that is to be made.
    ///
    /// # Errors
    /// [`JobError`] for a client's name that is no session's.
    pub fn new_session(&self, given: &Path) -> Result<PathBuf, JobError> {
        match self {
            Self::Anywhere(_) if given.components().count() != 1 => Ok(given.to_owned()),
            // A plain name is a session of the data folder, as for every other command.
            Self::Anywhere(store) => Ok(store.data().join(given)),
            Self::Exchange(store) => Ok(store.folder(given.to_str().unwrap_or(""))?),
        }
    }

    /// A file or folder to read.
    ///
    /// # Errors
    /// [`JobError::Name`] for a client's name where nothing is.
    pub fn input(&self, given: &Path) -> Result<PathBuf, JobError> {
        let place = self.place(given, "a file")?;
        match self {
            Self::Exchange(_) if !place.exists() => {
                Err(name(given, "a file", "nothing of that name is there"))
            }
            _ => Ok(place),
        }
    }

    /// A file or folder to write.
    ///
    /// # Errors
    /// [`JobError::Name`] for a client's name that is not allowed.
    pub fn output(&self, given: &Path) -> Result<PathBuf, JobError> {
        let place = self.place(given, "a file to write")?;
        if let (Self::Exchange(_), Some(folder)) = (self, place.parent()) {
            std::fs::create_dir_all(folder)
                .map_err(|source| JobError::Write { path: folder.to_owned(), source })?;
        }
        Ok(place)
    }

    /// Whether a client asks, who sees none of this computer's folders.
    pub fn is_clients(&self) -> bool {
        matches!(self, Self::Exchange(_))
    }

    fn place(&self, given: &Path, what: &'static str) -> Result<PathBuf, JobError> {
        match self {
            Self::Anywhere(_) => Ok(given.to_owned()),
            Self::Exchange(store) => {
                Exchange::of(store.data()).place(given).map_err(|e| name(given, what, e))
            }
        }
    }
}

fn name(given: &Path, what: &'static str, reason: impl std::fmt::Display) -> JobError {
    JobError::Name { given: given.display().to_string(), what, reason: reason.to_string() }
}
