//! What to do about a refusal of the operating system: one table for everything that reads or writes.

use rustix::io::Errno;
use std::io::{Error, ErrorKind, Read as _};

/// What to do about the system's refusal to open, read or write a file.
pub fn remedy(reason: &Error) -> &'static str {
    if let Some(told) = reason.raw_os_error().and_then(|n| of_number(Errno::from_raw_os_error(n))) {
        return told;
    }
    // Errors that the standard library made by itself have no number.
    match reason.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::IsADirectory => ABSENT,
        ErrorKind::PermissionDenied => FORBIDDEN,
        ErrorKind::ReadOnlyFilesystem => READ_ONLY,
        ErrorKind::StorageFull | ErrorKind::WriteZero => FULL,
        ErrorKind::QuotaExceeded => QUOTA,
        ErrorKind::FileTooLarge => TOO_LARGE,
        ErrorKind::InvalidData => "it is no text: check which file it is",
        ErrorKind::UnexpectedEof => "it is shorter than it should be: copy it again",
        _ => UNKNOWN,
    }
}

const ABSENT: &str = "check the path and that it is there";
const FORBIDDEN: &str = "give this account the right to read and write it";
const READ_ONLY: &str = "its file system is mounted read-only: set a data folder (--data) that can be written, or mount it for writing";
const FULL: &str = "the disk is full (`df -h`), or has no room for another file (`df -i`): delete old sessions or set \
                    another data folder";
const QUOTA: &str =
    "this account's quota is used up: delete old sessions, or have the quota raised (`quota -s`)";
const TOO_LARGE: &str =
    "raise the limit of a file's size (`ulimit -f`), or take a file system that holds larger files";
const UNKNOWN: &str = "check the disk and its connection";

fn of_number(number: Errno) -> Option<&'static str> {
    Some(match number {
        Errno::NOENT | Errno::NOTDIR | Errno::ISDIR => ABSENT,
        Errno::ACCESS | Errno::PERM => FORBIDDEN,
        Errno::ROFS => READ_ONLY,
        Errno::NOSPC => FULL,
        Errno::DQUOT => QUOTA,
        Errno::FBIG => TOO_LARGE,
        Errno::MFILE => {
            "this program has as many files open as it may: let clients and other runs end, or raise the limit \
             (`ulimit -n`, of a service `LimitNOFILE=`)"
        }
        Errno::NFILE => {
            "the whole system has as many files open as it may: end other programs, or raise the limit (`sysctl \
             fs.file-max`)"
        }
        Errno::IO => {
            "the disk does not read or write: look at the kernel's log (`dmesg`) and at its cable, and copy what is \
             still readable to another disk"
        }
        Errno::NODEV | Errno::NXIO | Errno::STALE | Errno::NOTCONN | Errno::HOSTDOWN | Errno::TIMEDOUT => {
            "the disk or network folder has gone away: connect or mount it again"
        }
        Errno::LOOP => "its links lead in a circle: name the file itself",
        Errno::NAMETOOLONG => "the name is too long for the file system: choose a shorter one",
        Errno::MLINK => "the folder holds as many entries as it can: use another data folder",
        Errno::NOMEM => "memory is used up: end other programs",
        Errno::BUSY | Errno::TXTBSY => "another program uses it: end that first",
        _ => return None,
    })
}

/// `cannot read FILE: REASON; REMEDY`.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}: {source}; {}", path.display(), remedy(source))]
pub struct FileError {
    /// What was tried.
    pub action: &'static str,
    /// On which file.
    pub path: std::path::PathBuf,
    /// The system's reason.
    pub source: Error,
}

/// A file's bytes.
///
/// # Errors
/// [`FileError`] with the system's reason and what to do about it.
pub fn read(path: &std::path::Path) -> Result<Vec<u8>, FileError> {
    std::fs::read(path).map_err(|source| FileError { action: "read", path: path.into(), source })
}

/// A file's first bytes, and its length.
///
/// # Errors
/// As [`read`].
pub fn read_head(path: &std::path::Path, most: usize) -> Result<(Vec<u8>, u64), FileError> {
    let unread = |source| FileError { action: "read", path: path.into(), source };
    let file = std::fs::File::open(path).map_err(unread)?;
    let length = file.metadata().map_err(unread)?.len();
    let mut head = Vec::new();
    file.take(most as u64).read_to_end(&mut head).map_err(unread)?;
    Ok((head, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_has_its_own_remedy() {
        let told = |number: Errno| remedy(&Error::from_raw_os_error(number.raw_os_error()));
        let each = [
            (Errno::MFILE, "ulimit -n"),
            (Errno::NFILE, "fs.file-max"),
            (Errno::NOSPC, "delete old sessions"),
            (Errno::DQUOT, "quota"),
            (Errno::ACCESS, "give this account the right"),
            (Errno::PERM, "give this account the right"),
            (Errno::ROFS, "read-only"),
            (Errno::IO, "dmesg"),
            (Errno::FBIG, "ulimit -f"),
            (Errno::NOENT, "check the path"),
            (Errno::NAMETOOLONG, "shorter"),
            (Errno::LOOP, "circle"),
            (Errno::STALE, "mount it again"),
        ];
        for (number, part) in each {
            assert!(told(number).contains(part), "{number}: {}", told(number));
            assert!(!told(number).contains("check the disk"), "{number}");
        }
    }

    #[test]
    fn an_error_without_a_number_has_the_same_remedy() {
        for (kind, number) in [
            (ErrorKind::StorageFull, Errno::NOSPC),
            (ErrorKind::QuotaExceeded, Errno::DQUOT),
            (ErrorKind::ReadOnlyFilesystem, Errno::ROFS),
            (ErrorKind::PermissionDenied, Errno::ACCESS),
            (ErrorKind::NotFound, Errno::NOENT),
            (ErrorKind::FileTooLarge, Errno::FBIG),
        ] {
            assert_eq!(remedy(&Error::from(kind)), remedy(&Error::from_raw_os_error(number.raw_os_error())));
        }
    }
}
