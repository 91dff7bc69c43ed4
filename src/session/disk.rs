//! Files that appear whole or not at all, the lock, the free space.

use super::SessionError;
use rustix::fs::FlockOperation;
use sha2::{Digest, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The ending of a file that is being written; such a file is never read and is removed on opening.
pub(super) const PART: &str = ".part";
/// The lock's file name.
pub const LOCK: &str = "lock";

/// SHA-256, hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(digest: &[u8]) -> String {
    use std::fmt::Write as _;
    digest.iter().fold(String::with_capacity(64), |mut text, b| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{b:02x}");
        text
    })
}

/// Bytes free for this user on the file system that holds `path` (its folder, where it does not exist).
///
/// # Errors
/// The system's reason.
pub fn free_bytes(path: &Path) -> std::io::Result<u64> {
    let there = path.ancestors().find(|p| p.exists()).unwrap_or(Path::new("."));
    let s = rustix::fs::statvfs(there)?;
    Ok(s.f_bavail.saturating_mul(s.f_frsize))
}

/// Checks that a run which needs `required` bytes below `path` has them.
///
/// # Errors
/// [`SessionError::DiskFull`] with both figures.
pub fn check_space(path: &Path, required: u64) -> Result<(), SessionError> {
    let free = free_bytes(path).map_err(SessionError::io("read the free space of", path, required))?;
    if free < required {
        return Err(SessionError::DiskFull { path: path.to_owned(), needed: required, free });
    }
    Ok(())
}

/// Makes a folder's entries durable.
pub(super) fn sync_folder(path: &Path) -> Result<(), SessionError> {
    File::open(path).and_then(|f| f.sync_all()).map_err(SessionError::io("sync", path, 0))
}

/// A file that is written under a temporary name, hashed on the way, and appears whole by
/// [`Self::finish`]; dropped before, it leaves nothing.
#[derive(Debug)]
pub(super) struct WholeFile {
    file: std::io::BufWriter<File>,
    hash: Sha256,
    bytes: u64,
    part: PathBuf,
    path: PathBuf,
    done: bool,
}

impl WholeFile {
    /// Begins `folder/name`; the name is one that this program made or has checked.
    pub(super) fn create(folder: &Path, name: &str) -> Result<Self, SessionError> {
        // Two writers of one name must not share a temporary file.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let part = folder.join(format!(".{name}.{}.{count}{PART}", std::process::id()));
        let path = folder.join(name);
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&part)
            .map_err(SessionError::io("create", &part, 0))?;
        let file = std::io::BufWriter::with_capacity(1 << 16, file);
        Ok(Self { file, hash: Sha256::new(), bytes: 0, part, path, done: false })
    }

    /// Bytes and SHA-256, once the file is durable under its name.
    pub(super) fn finish(mut self) -> Result<(u64, String), SessionError> {
        let fail = |action| SessionError::io(action, &self.path, self.bytes);
        self.file.flush().map_err(fail("write"))?;
        self.file.get_ref().sync_all().map_err(fail("sync"))?;
        std::fs::rename(&self.part, &self.path).map_err(fail("rename"))?;
        self.done = true;
        if let Some(folder) = self.path.parent() {
            sync_folder(folder)?;
        }
        let digest = std::mem::take(&mut self.hash).finalize();
        Ok((self.bytes, hex(&digest)))
    }
}

impl Write for WholeFile {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        let n = self.file.write(buf)?;
        self.hash.update(&buf[..n]);
        self.bytes += n as u64;
        Ok(n)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.done {
            // Nothing is lost where this fails: the next opening removes it.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// Writes a file that appears whole or not at all (temporary name, sync, rename, sync of the folder); its bytes and
/// SHA-256.
///
/// # Errors
/// [`SessionError`] where the disk is full or fails; nothing is left of the file then.
pub fn write_whole(folder: &Path, name: &str, bytes: &[u8]) -> Result<(u64, String), SessionError> {
    let mut file = WholeFile::create(folder, name)?;
    file.write_all(bytes).map_err(SessionError::io("write", &folder.join(name), bytes.len() as u64))?;
    file.finish()
}

/// Removes what an interrupted write has left in a folder.
pub(super) fn remove_parts(folder: &Path) -> Result<(), SessionError> {
    for entry in std::fs::read_dir(folder).map_err(SessionError::io("list", folder, 0))? {
        let entry = entry.map_err(SessionError::io("list", folder, 0))?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(PART) {
            std::fs::remove_file(entry.path()).map_err(SessionError::io("remove", &entry.path(), 0))?;
        }
    }
    Ok(())
}

/// The right to fill a folder: one process has it at a time, until this is dropped or the process ends, however it does.
#[derive(Debug)]
pub struct Held {
    _lock: Lock,
}

/// Takes the right to fill a folder, and removes what an interrupted write has left in it.
///
/// # Errors
/// [`SessionError::Locked`] where another process has it; the system's reason otherwise.
pub fn hold(folder: &Path) -> Result<Held, SessionError> {
    let lock = Lock::take(folder)?;
    remove_parts(folder)?;
    Ok(Held { _lock: lock })
}

/// SHA-256 of what is left of a file, hexadecimal, and how many bytes that is; read piece by piece.
///
/// # Errors
/// The system's reason.
pub fn sha256_of(file: &mut File) -> std::io::Result<(String, u64)> {
    let (mut hash, mut bytes) = (Sha256::new(), 0);
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok((hex(&hash.finalize()), bytes)),
            n => {
                hash.update(&piece[..n]);
                bytes += n as u64;
            }
        }
    }
}

/// A session's lock, held until it is dropped; the kernel lets go of it when the process ends, however it does.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of the session in `folder`.
    pub(super) fn take(folder: &Path) -> Result<Self, SessionError> {
        let path = folder.join(LOCK);
        let mut file = super::open::create_inside(folder, LOCK)?;
        // `is_held` holds the lock for an instant: a few tries tell it from a writer.
        let mut taken = rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive);
        for _ in 0..10 {
            if taken != Err(rustix::io::Errno::WOULDBLOCK) {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
            taken = rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive);
        }
        if let Err(e) = taken {
            if e != rustix::io::Errno::WOULDBLOCK {
                return Err(SessionError::io("lock", &path, 0)(e.into()));
            }
            return Err(SessionError::Locked { path: folder.to_owned(), holder: holder(&mut file) });
        }
        let note = |f: &mut File| -> std::io::Result<()> {
            f.set_len(0)?;
            f.rewind()?;
            writeln!(f, "{}", std::process::id())
        };
        note(&mut file).map_err(SessionError::io("write", &path, 16))?;
        Ok(Self { _file: file })
    }

    /// Whether somebody holds the lock of the session in `folder`.
    pub(super) fn is_held(folder: &Path) -> bool {
        super::open::open_inside(folder, LOCK).is_ok_and(|f| {
            rustix::fs::flock(&f, FlockOperation::NonBlockingLockShared) == Err(rustix::io::Errno::WOULDBLOCK)
        })
    }
}

fn holder(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.take(32).read_to_string(&mut text);
    match text.trim().parse::<u32>() {
        Ok(pid) if read.is_ok() => pid.to_string(),
        _ => "unknown".to_owned(),
    }
}
