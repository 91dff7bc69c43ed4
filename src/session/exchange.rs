//! Files that clients put beside the sessions, and that computations leave there for them: `DATA/.files/NAME` and
//! `DATA/.files/FOLDER/NAME`.
//!
//! A client names no place on the disk: a name has one or two plain parts, looked for here and nowhere else, and no link is
//! followed.

use super::SessionError;
use super::disk::{WholeFile, remove_parts};
use super::name::check_name;
use super::open::{check_folder, open_inside};
use serde::Serialize;
use std::fmt::{self, Display};
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The folder in the data folder: no session's, whose names begin with a letter or a digit.
const FOLDER: &str = ".files";

/// A file's name, with its folder's before it where it lies in one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ExchangeName {
    folder: Option<String>,
    name: String,
}

impl FromStr for ExchangeName {
    type Err = SessionError;

    fn from_str(text: &str) -> Result<Self, SessionError> {
        let (folder, name) = text.split_once('/').map_or((None, text), |(folder, name)| (Some(folder), name));
        if let Some(folder) = folder {
            check_name("folder", folder)?;
        }
        check_name("file", name)?;
        Ok(Self { folder: folder.map(str::to_owned), name: name.to_owned() })
    }
}

impl Display for ExchangeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.folder {
            Some(folder) => write!(f, "{folder}/{}", self.name),
            None => f.write_str(&self.name),
        }
    }
}

/// A file that is there.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, utoipa::ToSchema)]
pub struct ExchangedFile {
    /// `NAME` or `FOLDER/NAME`.
    pub file: String,
    /// Its length, bytes.
    pub bytes: u64,
}

/// The files of a data folder that are no session's.
#[derive(Debug, Clone)]
pub struct Exchange {
    root: PathBuf,
}

impl Exchange {
    /// Those of a data folder; it is made with the first file.
    pub fn of(data: &Path) -> Self {
        Self { root: data.join(FOLDER) }
    }

    /// The plain files with plain names, by name.
    ///
    /// # Errors
    /// [`SessionError::Io`] where a folder can't be listed.
    pub fn list(&self) -> Result<Vec<ExchangedFile>, SessionError> {
        let mut all = Vec::new();
        for (name, about) in entries(&self.root)? {
            if about.is_file() {
                all.push(ExchangedFile { file: name, bytes: about.len() });
            } else if about.is_dir() {
                let inside =
                    entries(&self.root.join(&name))?.into_iter().filter(|(_, about)| about.is_file());
                all.extend(inside.map(|(file, about)| ExchangedFile {
                    file: format!("{name}/{file}"),
                    bytes: about.len(),
                }));
            }
        }
        all.sort_by(|a, b| a.file.cmp(&b.file));
        Ok(all)
    }

    /// Opens a file for reading.
    ///
    /// # Errors
    /// [`SessionError`]: there is none of that name, or it is a link or anything else but a plain file.
    pub fn open(&self, name: &ExchangeName) -> Result<File, SessionError> {
        open_inside(&self.root, &name.to_string())
    }

    /// Begins a file, which replaces one of that name once it is whole.
    ///
    /// # Errors
    /// [`SessionError`] where its folder is none, or the disk fails.
    pub fn create(&self, name: &ExchangeName) -> Result<NewFile, SessionError> {
        let folder = match &name.folder {
            Some(folder) => self.root.join(folder),
            None => self.root.clone(),
        };
        std::fs::create_dir_all(&folder).map_err(SessionError::io("create", &folder, 0))?;
        check_folder(&self.root)?;
        check_folder(&folder)?;
        WholeFile::create(&folder, &name.name).map(NewFile)
    }

    /// Removes a file, and its folder where that was the last one.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn remove(&self, name: &ExchangeName) -> Result<(), SessionError> {
        drop(self.open(name)?);
        let path = self.root.join(name.to_string());
        std::fs::remove_file(&path).map_err(SessionError::io("remove", &path, 0))?;
        if let Some(folder) = &name.folder {
            // Where others are in it, it stays.
            let _ = std::fs::remove_dir(self.root.join(folder));
        }
        Ok(())
    }

    /// Where a file or a folder of this name lies, or would lie: real folders down to it, and no link.
    ///
    /// # Errors
    /// [`SessionError`] for a name that is not allowed, and for a link.
    pub fn place(&self, given: &Path) -> Result<PathBuf, SessionError> {
        let name: ExchangeName = given.to_string_lossy().parse()?;
        let mut place = self.root.clone();
        for part in name.folder.iter().chain([&name.name]) {
            if place.symlink_metadata().is_ok() {
                check_folder(&place)?;
            }
            place.push(part);
        }
        if place.is_symlink() {
            return Err(SessionError::Irregular { path: place, found: "a link", wanted: "a plain file" });
        }
        Ok(place)
    }

    /// Removes what uploads have left that were broken off with the program.
    ///
    /// # Errors
    /// [`SessionError::Io`] where a folder can't be listed, or what is left can't be removed.
    pub fn tidy(&self) -> Result<(), SessionError> {
        for (name, about) in entries(&self.root)? {
            if about.is_dir() {
                remove_parts(&self.root.join(name))?;
            }
        }
        if self.root.exists() { remove_parts(&self.root) } else { Ok(()) }
    }
}

/// What has a plain name in a folder, with what it is; a folder that is not there has nothing.
fn entries(folder: &Path) -> Result<Vec<(String, std::fs::Metadata)>, SessionError> {
    let all = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(SessionError::io("list", folder, 0))?,
    };
    let named = all.flatten().filter_map(|entry| {
        let name = entry.file_name().to_str()?.to_owned();
        check_name("file", &name).ok()?;
        // A link's own kind, not that of what it leads to.
        Some((name, entry.metadata().ok()?))
    });
    Ok(named.collect())
}

/// A file that is being put there.
pub struct NewFile(WholeFile);

impl NewFile {
    /// Its length and SHA-256, once it is durable under its name.
    ///
    /// # Errors
    /// [`SessionError`] where the disk fails.
    pub fn finish(self) -> Result<(u64, String), SessionError> {
        self.0.finish()
    }
}

impl Write for NewFile {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        self.0.write(buf)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read as _;
    use std::os::unix::fs::symlink;

    fn put(exchange: &Exchange, name: &str, bytes: &[u8]) -> Result<(u64, String), SessionError> {
        let mut file = exchange.create(&name.parse()?)?;
        file.write_all(bytes).unwrap();
        file.finish()
    }

    #[test]
    fn what_is_put_there_is_listed_read_replaced_and_removed() {
        let data = tempfile::tempdir().unwrap();
        let exchange = Exchange::of(data.path());
        assert_eq!(exchange.list().unwrap(), []);
        put(&exchange, "balls/b.png", b"two").unwrap();
        put(&exchange, "test.csv", b"first").unwrap();
        assert_eq!(put(&exchange, "test.csv", b"other").unwrap().0, 5);
        // One that is begun and not finished is none.
        drop(exchange.create(&"half.csv".parse().unwrap()).unwrap());
        let listed: Vec<String> = exchange.list().unwrap().into_iter().map(|f| f.file).collect();
        assert_eq!(listed, ["balls/b.png", "test.csv"]);
        let mut text = String::new();
        exchange.open(&"test.csv".parse().unwrap()).unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "other");
        exchange.remove(&"balls/b.png".parse().unwrap()).unwrap();
        assert!(!data.path().join(".files/balls").exists());
        assert!(exchange.remove(&"balls/b.png".parse().unwrap()).is_err());
    }

    #[test]
    fn no_name_and_no_link_leads_out_of_it() {
        let data = tempfile::tempdir().unwrap();
        let exchange = Exchange::of(data.path());
        for bad in ["", "/", "..", "../x", "a/../b", "/etc/passwd", "a/b/c", ".hidden", "a//b", "a/.b"] {
            assert!(bad.parse::<ExchangeName>().is_err(), "{bad:?}");
            assert!(exchange.place(Path::new(bad)).is_err(), "{bad:?}");
        }
        put(&exchange, "a/b", b"").unwrap();
        let secret = tempfile::tempdir().unwrap();
        std::fs::write(secret.path().join("b"), b"secret").unwrap();
        symlink(secret.path(), data.path().join(".files/link")).unwrap();
        symlink(secret.path().join("b"), data.path().join(".files/file")).unwrap();
        for bad in ["link/b", "file", "link"] {
            let name: ExchangeName = bad.parse().unwrap();
            assert!(exchange.open(&name).is_err() && exchange.remove(&name).is_err(), "{bad}");
            assert!(exchange.place(Path::new(bad)).is_err(), "{bad}");
        }
        assert!(put(&exchange, "link/c", b"").is_err());
        assert_eq!(std::fs::read_dir(secret.path()).unwrap().count(), 1);
        assert_eq!(exchange.list().unwrap().len(), 1);
    }
}
