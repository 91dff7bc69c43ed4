//! Pictures that were no good, kept for whoever looks for the cause. They are no evidence: no record names their bytes,
//! nothing is computed from them, and a replay does not know them.

use super::SessionError;
use super::disk::write_whole;
use super::event::EventKind;
use super::open::{check_folder, read_inside};
use super::recording::{REJECTED, Recording};
use super::writer::Session;
use crate::rig::{Encoding, Frame};
use serde::Serialize;
use std::collections::BTreeMap;

/// Most that is read of one, bytes: no camera makes a larger picture.
const MOST_BYTES: u64 = 256 << 20;

fn name(view: usize, encoding: Encoding) -> String {
    format!("view_{view:03}.{}", encoding.extension())
}

impl Session {
    /// Keeps a picture of a view that is refused, in the place of the one before. The cause is the journal's.
    ///
    /// # Errors
    /// [`SessionError`] where the disk fails.
    pub fn keep_rejected(&self, view: usize, frame: &Frame) -> Result<(), SessionError> {
        let folder = self.recording().folder().join(REJECTED);
        std::fs::create_dir_all(&folder).map_err(SessionError::io("create", &folder, 0))?;
        // What is written there must not land elsewhere.
        check_folder(&folder)?;
        for other in [Encoding::Jpeg, Encoding::Png, Encoding::Tiff] {
            // Of another kind than this one: it would be found before it.
            if other != frame.encoding {
                let _ = std::fs::remove_file(folder.join(name(view, other)));
            }
        }
        write_whole(&folder, &name(view, frame.encoding), &frame.bytes).map(|_| ())
    }
}

/// A picture that was refused: the last of its view.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Rejection {
    /// Index of the view.
    pub view: usize,
    /// Pictures taken of the view until then.
    pub tries: u32,
    /// Value, unit, limit and remedy.
    pub cause: String,
}

impl Recording {
    /// The last refused picture of each view that had one, by the view.
    pub fn rejections(&self) -> Vec<Rejection> {
        let mut last = BTreeMap::new();
        for event in self.events() {
            if let EventKind::Rejected { view, tries: Some(tries), cause } = &event.what {
                last.insert(*view, Rejection { view: *view, tries: *tries, cause: cause.clone() });
            }
        }
        last.into_values().collect()
    }

    /// The last picture of a view that was refused; `None` where none was, or none is kept. Its bytes are as they lie
    /// there: nothing has recorded them.
    ///
    /// # Errors
    /// [`SessionError`] where the disk fails, or the file is no picture.
    pub fn rejected(&self, view: usize) -> Result<Option<Frame>, SessionError> {
        if !self.rejections().iter().any(|rejection| rejection.view == view) {
            return Ok(None);
        }
        for encoding in [Encoding::Jpeg, Encoding::Png, Encoding::Tiff] {
            let file = format!("{REJECTED}/{}", name(view, encoding));
            let bytes = match read_inside(self.folder(), &file, MOST_BYTES) {
                Err(e) if e.is_missing() => continue,
                other => other?,
            };
            let encoding = Encoding::sniff(&bytes).ok_or_else(|| SessionError::Picture {
                file,
                fault: super::picture::PictureFault::unknown(&bytes),
            })?;
            return Ok(Some(Frame::new(bytes, encoding)));
        }
        Ok(None)
    }
}
