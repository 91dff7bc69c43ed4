//! What a file's bytes hash to, computed once for each state of the file.

use super::disk::sha256_of;
use rustix::fs::Stat;
use std::collections::HashMap;
use std::fs::File;
use std::io::Seek as _;
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Files whose hash is kept; all are forgotten when there are more.
const KEPT: usize = 4096;
/// A file that was changed less than this ago, s, may change again without its times showing it: they are as coarse as
/// the kernel's clock, or a network's.
const SETTLED_S: i64 = 2;

/// A file in one of its states: no program changes its bytes without changing one of these (the last is not to be set).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Identity {
    device: u64,
    inode: u64,
    bytes: u64,
    modified: (i64, i64),
    changed: (i64, i64),
}

impl Identity {
    /// The state that an open file is in.
    ///
    /// # Errors
    /// The system's reason.
    pub fn of(file: &File) -> std::io::Result<Self> {
        Ok(Self::from(&rustix::fs::fstat(file)?))
    }

    /// Whether the file has been left alone for so long that a later change would show.
    pub fn is_settled(&self, now: SystemTime) -> bool {
        let now = now.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs() as i64);
        self.changed.0 + SETTLED_S < now
    }
}

// The fields' types differ from one processor to another.
#[allow(clippy::useless_conversion, clippy::cast_lossless, clippy::unnecessary_cast)]
impl From<&Stat> for Identity {
    fn from(s: &Stat) -> Self {
        Self {
            device: s.st_dev as u64,
            inode: s.st_ino as u64,
            bytes: s.st_size as u64,
            modified: (s.st_mtime as i64, s.st_mtime_nsec as i64),
            changed: (s.st_ctime as i64, s.st_ctime_nsec as i64),
        }
    }
}

/// The hashes of files that were read before.
#[derive(Debug, Default)]
pub struct Hashes {
    known: Mutex<HashMap<Identity, String>>,
}

impl Hashes {
    /// SHA-256 of a file, hexadecimal; the file is at its beginning afterwards.
    ///
    /// # Errors
    /// The system's reason.
    pub fn sha256(&self, file: &mut File) -> std::io::Result<String> {
        let before = Identity::of(file)?;
        if let Some(known) = self.lock().get(&before) {
            return Ok(known.clone());
        }
        file.rewind()?;
        let (sha256, _) = sha256_of(file)?;
        file.rewind()?;
        if before.is_settled(SystemTime::now()) && Identity::of(file)? == before {
            let mut known = self.lock();
            if known.len() >= KEPT {
                known.clear();
            }
            known.insert(before, sha256.clone());
        }
        Ok(sha256)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<Identity, String>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
