//! What is said between the supervisor and the child.

use super::settings::Settings;
use serde::{Deserialize, Serialize};

/// What the child is asked. Each is answered by one [`Reply`], but [`Request::Kept`].
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(tag = "request", rename_all = "snake_case")]
pub(super) enum Request {
    /// Find the camera and take it over.
    Open {
        /// Which one, and how it is to be set.
        settings: Box<Settings>,
        /// An earlier child failed: the camera may hold events and pictures of a release that nobody waited for.
        after_failure: bool,
    },
    /// Take a picture: the files come first, then the reply.
    Capture,
    /// Make everything ready for a release that comes from elsewhere.
    Ready,
    /// The shutter was released from elsewhere: take what comes of it, as after [`Request::Capture`].
    Collect,
    /// Show a picture of live view, which begins where it is off. Answered as [`Request::Capture`] is; the next picture ends it.
    Preview,
    /// The files of the last picture are durable. Not answered: the camera deletes while the stage turns.
    Kept,
}

/// What the child answers.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(tag = "reply", rename_all = "snake_case")]
pub(super) enum Reply {
    /// It has started.
    Started,
    /// The camera is open.
    Opened {
        /// Model, as the camera says.
        model: String,
        /// Serial number; empty where it says none.
        serial: String,
        /// Where it is connected.
        port: String,
        /// The library's version.
        library: String,
    },
    /// It waits for a release from elsewhere.
    Ready {
        /// What is worth a line in the log.
        notes: Vec<String>,
    },
    /// A picture was taken.
    Shot {
        /// The camera's name of each file, in the order in which they came.
        names: Vec<String>,
        /// What is worth a line in the log.
        notes: Vec<String>,
    },
    /// It did not do what it was asked.
    Failed(Failure),
}

/// Why the camera did not do what it was asked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Failure {
    /// What sort of failure it is, which decides what is done about it.
    pub kind: FailureKind,
    /// What happened, with value and limit.
    pub cause: String,
}

impl Failure {
    pub(super) fn new(kind: FailureKind, cause: impl Into<String>) -> Self {
        Self { kind, cause: cause.into() }
    }
}

/// The sorts of failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FailureKind {
    /// Another program has the camera (libgphoto2's −53).
    Claimed,
    /// There is no such camera (−105, −52).
    Absent,
    /// The connection failed, an answer did not come, or the child died (−7, −10, −1).
    Transport,
    /// The camera said for too long that it is busy (−110).
    Busy,
    /// What releases the shutter from elsewhere failed.
    Release,
    /// The release came to nothing.
    NoPicture,
    /// A picture came that is empty, cut off or RAW only.
    BadPicture,
    /// The camera has no room.
    Full,
    /// A setting is not what it must be, and can't be made so.
    Setting,
    /// This program or this camera can't do it.
    Unsupported,
}
