//! Why a session could not be written or read.

use std::path::{Path, PathBuf};

/// Why a session could not be written or read. Each message has the value, the limit and what to do.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// A name that could lead out of the data folder, or that a file system would not take.
    #[error(
        "the {kind} {value:?} is not allowed: {limit}; use 1 to 64 letters, digits, '.', '_' or '-', \
         beginning with a letter or a digit, without '..'"
    )]
    Name {
        /// What the name is for.
        kind: &'static str,
        /// The name, shortened where it is long.
        value: String,
        /// The limit that it breaks.
        limit: &'static str,
    },
    /// The name is taken.
    #[error("session {name:?} exists already in {}; choose another name, or resume it", data.display())]
    Exists {
        /// The session's name.
        name: String,
        /// The data folder.
        data: PathBuf,
    },
    /// There is no such session.
    #[error("there is no session at {}; check its name and the data folder (--data)", path.display())]
    Absent {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// Another process, or another part of this one, writes the session.
    #[error("{} is being written by process {holder}; wait for it, or stop it", path.display())]
    Locked {
        /// The session's folder.
        path: PathBuf,
        /// The process's number, or `unknown`.
        holder: String,
    },
    /// The disk is full, or will be.
    #[error(
        "no room for {}: {needed} bytes needed, {free} bytes free; delete old sessions or set another data folder",
        path.display()
    )]
    DiskFull {
        /// The file or folder that was to be written.
        path: PathBuf,
        /// Bytes needed.
        needed: u64,
        /// Bytes free for this user.
        free: u64,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {source}; {}", path.display(), crate::system::remedy(source))]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// What should be a session's own file or folder is a link, a pipe or something else.
    #[error(
        "{} is {found}, not {wanted}: a session is read no further than that; remove it and restore {wanted} from a backup",
        path.display()
    )]
    Irregular {
        /// Where it is.
        path: PathBuf,
        /// What it is.
        found: &'static str,
        /// What it should be.
        wanted: &'static str,
    },
    /// A file that is longer than any that this program writes.
    #[error("{} has {bytes} bytes, the limit is {limit}; check which file it is", path.display())]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// A product that is not the one that was recorded.
    #[error(
        "product {file} of session {session} is not as recorded: {reason}; `grainrig replay {session}` writes it again"
    )]
    Product {
        /// The session's name.
        session: String,
        /// The product.
        file: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A stored file has another length than was recorded.
    #[error(
        "{} has changed since it was recorded ({found} bytes, recorded {recorded}); restore it from a backup",
        path.display()
    )]
    Length {
        /// The file.
        path: PathBuf,
        /// Bytes found.
        found: u64,
        /// Bytes recorded.
        recorded: u64,
    },
    /// A session that another version made, which this one cannot read.
    #[error("{}: {reason}; use the version of grainrig that made the session", path.display())]
    OtherVersion {
        /// The file.
        path: PathBuf,
        /// What this version does not know.
        reason: String,
    },
    /// A capture that merged grains are made from.
    #[error("session {name} is what {} was merged from, and is needed to replay it; remove that first", by.join(" and "))]
    Needed {
        /// Name of the capture.
        name: String,
        /// Names of the merged grains.
        by: Vec<String>,
    },
    /// The manifest is missing or unreadable.
    #[error("{}: {reason}; restore manifest.json from a backup, or delete the session", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The journal is damaged elsewhere than in its torn last line.
    #[error(
        "{}, line {line}: {reason}; restore the file from a backup, or import the frames as a new session",
        path.display()
    )]
    Journal {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// An event that could not be read back from the journal, so it is not written.
    #[error("the event cannot be journalled: {reason}; every number in an event must be finite")]
    Unrecordable {
        /// Why.
        reason: String,
    },
    /// An earlier write failed and could not be undone.
    #[error("{}: an earlier write failed; open the session again, which repairs the journal", path.display())]
    Broken {
        /// The journal.
        path: PathBuf,
    },
    /// Somebody has put another file in the place of one that is being written.
    #[error(
        "{} is another file than the one that this run writes: somebody has replaced it; put the former one back, then \
         `grainrig resume`",
        path.display()
    )]
    Replaced {
        /// The file.
        path: PathBuf,
    },
    /// A picture that was recorded and is gone.
    #[error("{} is not there any more, {bytes} bytes were recorded; restore it from a backup", path.display())]
    Gone {
        /// The file.
        path: PathBuf,
        /// Bytes recorded.
        bytes: u64,
    },
    /// A view that the plan does not have, or a role that is not the plan's.
    #[error("view {view} is not in the plan of {views} views; check the index")]
    NotPlanned {
        /// The view's index.
        view: usize,
        /// Views in the plan.
        views: usize,
    },
    /// A view whose picture is durable already: evidence is never overwritten.
    #[error("view {view} is captured already as {file}; a new picture needs a new session")]
    Captured {
        /// The view's index.
        view: usize,
        /// Its file.
        file: String,
    },
    /// A view that was not captured.
    #[error("view {view} was not captured ({captured} views were); resume the session")]
    NotCaptured {
        /// The view's index.
        view: usize,
        /// Views captured.
        captured: usize,
    },
    /// A stored file is not the one that was recorded.
    #[error(
        "{} has changed since it was recorded (SHA-256 {found}, recorded {recorded}); restore it from a backup",
        path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// The hash found.
        found: String,
        /// The hash recorded.
        recorded: String,
    },
    /// A picture that cannot be used.
    #[error("{file}: {fault}")]
    Picture {
        /// The file.
        file: String,
        /// What is wrong with it.
        fault: super::picture::PictureFault,
    },
    /// A setting of an import that makes no sense.
    #[error("{setting} is {value}; {remedy}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Its value.
        value: String,
        /// The limit and what to do.
        remedy: String,
    },
    /// No file matches an import's pattern.
    #[error("no file in {} matches {pattern:?}; {there}; change the pattern", folder.display())]
    NoMatch {
        /// The folder.
        folder: PathBuf,
        /// The pattern.
        pattern: String,
        /// A few names that are there.
        there: String,
    },
    /// A picture without a camera.
    #[error(
        "the camera file has no camera for {image}; it has {known}; add a line for it, or narrow the pattern"
    )]
    NoCamera {
        /// The picture's file name.
        image: String,
        /// Some names that it has.
        known: String,
    },
    /// A camera that does not see what the others see.
    #[error(
        "{image}: the place that the cameras look at comes to column {column:.0}, row {row:.0} of a picture of \
         {width} × {height} px; check that each camera stands beside its own picture's name"
    )]
    Astray {
        /// The picture's file name.
        image: String,
        /// Column, px.
        column: f64,
        /// Row, px.
        row: f64,
        /// Width of the picture, px.
        width: u32,
        /// Height of the picture, px.
        height: u32,
    },
    /// A camera file that cannot be used.
    #[error("camera file, line {line}: {reason}")]
    Cameras {
        /// Line number, from 1.
        line: usize,
        /// What is wrong with it, the limit and what to do.
        reason: String,
    },
}

impl SessionError {
    /// Whether it says that a file is not there.
    pub(super) fn is_missing(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound)
    }

    /// Wraps the system's reason with the file and what was tried; a full disk becomes `DiskFull`.
    pub(super) fn io<'a>(
        action: &'static str,
        path: &'a Path,
        needed: u64,
    ) -> impl FnOnce(std::io::Error) -> Self + use<'a> {
        move |source| match source.kind() {
            // With bytes free it is something else that is used up: places for files.
            std::io::ErrorKind::StorageFull
                if super::disk::free_bytes(path).is_ok_and(|free| free <= needed.max(4096)) =>
            {
                let free = super::disk::free_bytes(path).unwrap_or(0);
                Self::DiskFull { path: path.to_owned(), needed, free }
            }
            _ => Self::Io { action, path: path.to_owned(), source },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error, ErrorKind};

    fn told(reason: Error, needed: u64) -> String {
        SessionError::io("write", Path::new("/tmp/x"), needed)(reason).to_string()
    }

    #[test]
    fn a_full_disk_is_told_with_bytes_and_remedy() {
        // More than any disk has free.
        let text = told(ErrorKind::StorageFull.into(), u64::MAX);
        assert!(text.contains(&format!("{} bytes needed", u64::MAX)), "{text}");
        assert!(text.contains("delete old sessions"), "{text}");
    }

    #[test]
    fn a_disk_with_room_that_is_said_to_be_full_lacks_places_for_files() {
        let text = told(ErrorKind::StorageFull.into(), 16);
        assert!(text.contains("df -i") && text.contains("delete old sessions"), "{text}");
    }

    #[test]
    fn too_many_open_files_are_no_matter_of_the_disk() {
        let text = told(Error::from_raw_os_error(24), 16);
        assert!(text.contains("ulimit -n") && !text.contains("check the disk"), "{text}");
    }
}
