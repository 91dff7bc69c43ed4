//! Opening what lies in a session's folder, which anybody may have packed: only plain files, each folder on the way a
//! real one, nothing waited for, and no more read than was announced.
//!
//! ```text
//! DATA/NAME ─▶ frames ─▶ view_003.jpg
//!   folder      folder     plain file      each is looked at without following it, then opened below the one before
//! ```
//!
//! A link in a session could lead to any file of the computer, `/dev/zero` has no end, and a pipe keeps whoever opens it
//! until somebody writes. Each part is opened by itself, relative to the one before and without following links, because
//! that is the same on every kernel.

use super::SessionError;
use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags};
use std::fs::File;
use std::io::Read as _;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;

/// Longest manifest, bytes: the names and cameras of some 100,000 photographs.
pub(super) const MANIFEST_LIMIT: u64 = 64 << 20;
/// Longest journal, bytes: a run of 72 views writes a hundred kilobytes.
pub(super) const JOURNAL_LIMIT: u64 = 256 << 20;
/// Longest product, bytes: ten times the largest deck that is meshed.
pub(super) const PRODUCT_LIMIT: u64 = 4 << 30;

/// Opens a plain file of a folder for reading; `inside` is its path from there, `frames/view_003.jpg`.
///
/// # Errors
/// [`SessionError::Irregular`] where the file, or a folder on the way to it, is a link or anything else; the system's
/// reason otherwise.
pub fn open_inside(folder: &Path, inside: &str) -> Result<File, SessionError> {
    open_with(folder, inside, OFlags::RDONLY)
}

/// As [`open_inside`], to append to it and read it.
pub(super) fn append_inside(folder: &Path, inside: &str) -> Result<File, SessionError> {
    open_with(folder, inside, OFlags::RDWR | OFlags::APPEND)
}

/// As [`open_inside`], to read and write it; it is made where it is not there.
pub(super) fn create_inside(folder: &Path, inside: &str) -> Result<File, SessionError> {
    open_with(folder, inside, OFlags::RDWR | OFlags::CREATE)
}

/// Reads a plain file of a folder whole, if it has at most `limit` bytes.
///
/// # Errors
/// As [`open_inside`]; [`SessionError::TooLong`] with both figures.
pub fn read_inside(folder: &Path, inside: &str, limit: u64) -> Result<Vec<u8>, SessionError> {
    read_whole(open_inside(folder, inside)?, &folder.join(inside), limit)
}

/// Reads a file that a person has named, if it has at most `limit` bytes. Links are followed: they are that person's own.
///
/// # Errors
/// As [`read_inside`].
pub fn read_named(path: &Path, limit: u64) -> Result<Vec<u8>, SessionError> {
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    // Before it is opened: that alone can do something to a device.
    let about = rustix::fs::stat(path).map_err(system("open", path))?;
    check_kind(about.st_mode, FileType::RegularFile, path)?;
    let opened = rustix::fs::open(path, flags, Mode::empty()).map_err(system("open", path))?;
    read_whole(regular(opened, path)?, path, limit)
}

/// Checks that a folder is one and no link to one.
///
/// # Errors
/// [`SessionError::Irregular`] where it is something else; the system's reason otherwise.
pub(super) fn check_folder(folder: &Path) -> Result<(), SessionError> {
    folder_at(CWD, folder, folder).map(|_| ())
}

fn open_with(folder: &Path, inside: &str, flags: OFlags) -> Result<File, SessionError> {
    let mut at = folder_at(CWD, folder, folder)?;
    let mut place = folder.to_owned();
    let mut inside = inside;
    while let Some((sub, rest)) = inside.split_once('/') {
        place.push(sub);
        at = folder_at(at, Path::new(sub), &place)?;
        inside = rest;
    }
    place.push(inside);
    match rustix::fs::statat(&at, inside, AtFlags::SYMLINK_NOFOLLOW) {
        Ok(about) => check_kind(about.st_mode, FileType::RegularFile, &place)?,
        Err(rustix::io::Errno::NOENT) if flags.contains(OFlags::CREATE) => {}
        Err(e) => return Err(system("open", &place)(e)),
    }
    let flags = flags | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let opened =
        rustix::fs::openat(&at, inside, flags, Mode::from_raw_mode(0o666)).map_err(system("open", &place))?;
    regular(opened, &place)
}

/// Opens a folder below another without following links; `place` is its whole path, for messages.
fn folder_at(at: impl AsFd, name: &Path, place: &Path) -> Result<OwnedFd, SessionError> {
    let about = rustix::fs::statat(&at, name, AtFlags::SYMLINK_NOFOLLOW).map_err(system("open", place))?;
    check_kind(about.st_mode, FileType::Directory, place)?;
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    rustix::fs::openat(&at, name, flags, Mode::empty()).map_err(system("open", place))
}

/// What was opened, if it is a plain file: between the look and the opening it may have been replaced.
fn regular(opened: OwnedFd, place: &Path) -> Result<File, SessionError> {
    let about = rustix::fs::fstat(&opened).map_err(system("open", place))?;
    check_kind(about.st_mode, FileType::RegularFile, place)?;
    Ok(File::from(opened))
}

fn check_kind(mode: rustix::fs::RawMode, wanted: FileType, place: &Path) -> Result<(), SessionError> {
    let kind = FileType::from_raw_mode(mode);
    if kind == wanted {
        return Ok(());
    }
    let found = match kind {
        FileType::RegularFile => "a file",
        FileType::Directory => "a folder",
        FileType::Symlink => "a link",
        FileType::Fifo => "a pipe",
        FileType::Socket => "a socket",
        _ => "a device",
    };
    let wanted = if wanted == FileType::Directory { "a folder" } else { "a plain file" };
    Err(SessionError::Irregular { path: place.to_owned(), found, wanted })
}

fn read_whole(file: File, place: &Path, limit: u64) -> Result<Vec<u8>, SessionError> {
    let bytes = file.metadata().map_err(SessionError::io("read", place, 0))?.len();
    let too_long = |bytes| SessionError::TooLong { path: place.to_owned(), bytes, limit };
    if bytes > limit {
        return Err(too_long(bytes));
    }
    let mut read = Vec::with_capacity(bytes as usize);
    // It may grow while it is read.
    file.take(limit.saturating_add(1)).read_to_end(&mut read).map_err(SessionError::io("read", place, 0))?;
    if read.len() as u64 > limit {
        return Err(too_long(read.len() as u64));
    }
    Ok(read)
}

fn system<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(rustix::io::Errno) -> SessionError + use<'a> {
    move |reason| SessionError::io(action, path, 0)(reason.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn only_plain_files_below_real_folders_are_opened_and_nothing_is_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("session");
        std::fs::create_dir_all(root.join("frames")).unwrap();
        std::fs::write(root.join("frames/a"), b"picture").unwrap();
        std::fs::write(dir.path().join("secret"), b"secret").unwrap();
        assert_eq!(read_inside(&root, "frames/a", 7).unwrap(), b"picture");
        let text = read_inside(&root, "frames/a", 6).unwrap_err().to_string();
        assert!(text.contains("7 bytes") && text.contains("limit is 6"), "{text}");

        symlink("../secret", root.join("link")).unwrap();
        symlink("frames", root.join("others")).unwrap();
        symlink("session", dir.path().join("alias")).unwrap();
        symlink("/dev/zero", root.join("frames/zero")).unwrap();
        rustix::fs::mknodat(CWD, root.join("pipe"), FileType::Fifo, Mode::from_raw_mode(0o600), 0).unwrap();
        let bad = [
            ("link", "a link"),
            ("others/a", "a link"),
            ("frames/zero", "a link"),
            ("pipe", "a pipe"),
            ("frames", "a folder"),
            ("frames/a/b", "a file"),
        ];
        for (inside, kind) in bad {
            for opened in
                [open_inside(&root, inside), append_inside(&root, inside), create_inside(&root, inside)]
            {
                let text = opened.unwrap_err().to_string();
                assert!(text.contains(kind) && text.contains("restore"), "{inside}: {text}");
            }
        }
        assert!(matches!(
            open_inside(&dir.path().join("alias"), "frames/a"),
            Err(SessionError::Irregular { found: "a link", .. })
        ));
        // What a person names may be a link, but nothing without an end.
        assert_eq!(read_named(&root.join("link"), 10).unwrap(), b"secret");
        assert!(
            read_named(Path::new("/dev/zero"), 10).is_err() && read_named(&root.join("pipe"), 10).is_err()
        );
    }
}
