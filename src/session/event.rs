//! What happens during a run, as the journal has it; and what the feed tells beside that, which no journal can have.

use super::manifest::ArchivedFile;
use grainrig_core::contact::CurvePoint;
use grainrig_core::silhouette::Verdict;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// Something that happened, numbered: in a run, unless it is said of what.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event<T = EventKind> {
    /// Number: each is one more than the one before it in the same log.
    pub seq: u64,
    /// When, in UTC.
    pub time: Timestamp,
    /// What.
    #[serde(flatten)]
    pub what: T,
}

/// What a view is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A view of the grain that carves the hull.
    Grain,
    /// A view half a turn after the first: its mirror image, which shows the axis.
    Closing,
}

/// A picture that is durable: written, synced, hashed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CapturedView {
    /// Index of the view in the plan, from 0.
    pub view: usize,
    /// What it is for.
    pub role: Role,
    /// File name inside `frames/`.
    pub file: String,
    /// Size of the file.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Where the stage was sent, degrees.
    pub commanded_deg: f64,
    /// Where the stage says it is, degrees.
    pub reached_deg: f64,
    /// Further files of the same exposure, durable as well: RAW files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<ArchivedFile>,
}

/// A product that is durable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProductRecord {
    /// File name inside `products/`.
    pub file: String,
    /// Size of the file.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// How a compression between two plates stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CompressionState {
    /// The grain is being meshed.
    Meshing,
    /// The plates move.
    Running,
    /// The force or the approach that was asked for is reached.
    Complete,
    /// Somebody stopped it; it can go on.
    Cancelled,
    /// The program ended; it goes on when the program is started again.
    Interrupted,
    /// It could not go on.
    Failed,
}

/// What is new of a compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressionUpdate {
    /// Name of the session whose grain it is.
    pub session: String,
    /// Its name among the session's compressions.
    pub name: String,
    /// How it stands.
    pub state: CompressionState,
    /// What is being done before the plates move, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<String>,
    /// How much of the way to the end, or of the meshing, is done, 0 to 1.
    pub done: f64,
    /// About how much longer, s; `None` before it can be told.
    pub left_s: Option<f64>,
    /// Contacts between grain and plates now.
    pub contacts: usize,
    /// The number, from 0, that the first of `points` has in the curve.
    pub from: usize,
    /// The points of the curve that are new.
    pub points: Vec<CurvePoint>,
    /// Why it failed.
    pub error: Option<String>,
}

/// What a computation beside the rig does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// A session's hull and mesh again.
    Reconstruct,
    /// A session the whole way again, from its recording.
    Replay,
    /// A session's files against the hashes in its journal.
    Verify,
    /// Two captures to one grain.
    Merge,
    /// A grain between two plates.
    Compress,
    /// A grain between two plates, in many ways.
    Ensemble,
    /// Photographs that become a session.
    Import,
    /// A body's mesh, as files.
    Mesh,
    /// The size of a pixel.
    CalibrateScale,
    /// The volume against the number of views.
    Study,
    /// How a grain can come to lie, and how plates turn it.
    Rests,
}

/// How a computation beside the rig stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Others come first.
    Waiting,
    /// It is being computed.
    Running,
    /// It has done what it was to do.
    Complete,
    /// Somebody stopped it, or took it out of the queue.
    Cancelled,
    /// The program ended.
    Interrupted,
    /// It could not go on.
    Failed,
}

/// What is new of a computation beside the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct JobStatus {
    /// Its number since the program began, from 1.
    pub job: u64,
    /// What it does.
    pub kind: JobKind,
    /// The session whose results it makes, or the file or folder that it is about.
    pub session: String,
    /// Of a session's compression: its name among the session's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// How it stands.
    pub state: JobState,
    /// What is being done, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<String>,
    /// How much of that is done, 0 to 1.
    pub done: f64,
    /// Why it failed.
    pub error: Option<String>,
}

/// What the feed tells: what happens in a run, and what goes on beside it. No journal takes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum FeedEvent {
    /// Of a run.
    Run(EventKind),
    /// Beside the runs.
    Beside(BackgroundEvent),
}

impl From<EventKind> for FeedEvent {
    fn from(what: EventKind) -> Self {
        Self::Run(what)
    }
}

impl From<BackgroundEvent> for FeedEvent {
    fn from(news: BackgroundEvent) -> Self {
        Self::Beside(news)
    }
}

/// What goes on beside the runs. Whoever watches is told; what is made from a session is no part of its record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum BackgroundEvent {
    /// A compression of a session's grain began, went on or ended.
    Compression(CompressionUpdate),
    /// A computation beside the rig was asked for, began, went on or ended.
    Job(JobStatus),
}

/// What happens in a run: the kinds of event that a journal has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum EventKind {
    /// A run began (or went on, where `already_captured` > 0).
    Started {
        /// Name of the session.
        session: String,
        /// Views in the plan.
        views: usize,
        /// Views that an earlier run has captured.
        already_captured: usize,
    },
    /// The stage found its reference.
    Homed,
    /// The stage is being sent to a view's angle; the view before it is being kept meanwhile, or refused.
    Moving {
        /// Index of the view.
        view: usize,
        /// The angle, degrees.
        target_deg: f64,
    },
    /// A view is captured and durable.
    Captured {
        /// The view.
        #[serde(flatten)]
        view: CapturedView,
        /// Estimated time to the last view, seconds; `None` before it can be told.
        remaining_s: Option<f64>,
    },
    /// A picture is no use: it is not kept and taken again, or the computation ends with it.
    Rejected {
        /// Index of the view.
        view: usize,
        /// Pictures taken of this view so far; absent where it is a picture that was kept.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tries: Option<u32>,
        /// Value, unit, limit and remedy.
        cause: String,
    },
    /// No picture of a view was any use: the run waits until somebody has done something about it.
    Suspended {
        /// Index of the view.
        view: usize,
        /// Value, unit, limit and remedy.
        cause: String,
    },
    /// The run waits for `resume`.
    Paused,
    /// The run goes on.
    Resumed,
    /// Somebody stopped the run; what was captured stays.
    Aborted,
    /// All views are captured.
    AcquisitionComplete {
        /// Views captured.
        views: usize,
    },
    /// The silhouette of a view was found.
    Silhouette {
        /// Index of the view.
        view: usize,
        /// Its area, square pixels.
        area_px: f64,
        /// How good the view is by itself; absent where it was not judged.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        verdict: Option<Verdict>,
        /// What a person should know of it.
        warnings: Vec<String>,
    },
    /// A view does not fit the views beside it.
    Judged {
        /// Index of the view.
        view: usize,
        /// How good the view is, all in all.
        verdict: Verdict,
        /// Value, unit, limit and remedy of each check that is not good.
        warnings: Vec<String>,
    },
    /// The live hull was carved by one more view.
    Hull {
        /// Views in the hull so far.
        views: usize,
        /// Volume so far, mm³; an upper bound. `None` where the session has no scale.
        volume_mm3: Option<f64>,
    },
    /// A stage of the computation began or went on.
    Working {
        /// Its name: `calibrate`, `hull`, `mesh`, `export`.
        stage: String,
        /// How much of it is done, 0 to 1.
        done: f64,
    },
    /// The products are written and durable.
    Products {
        /// The files.
        files: Vec<ProductRecord>,
        /// Seconds each stage took on the run that first made them.
        timing_s: serde_json::Value,
        /// What was asked otherwise than the session's frozen configuration says; absent where nothing was.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        settings: Option<serde_json::Value>,
    },
    /// The run failed; what was captured stays.
    Failed {
        /// Value, unit, limit and remedy.
        error: String,
    },
    /// The run is complete.
    Complete {
        /// What `result.json` holds.
        result: serde_json::Value,
    },
}
