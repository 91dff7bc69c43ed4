//! What a session was to be: written once, before the first picture, and never changed.

use super::event::Role;
use grainrig_core::geometry::Angle;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The version of the folder's layout that this program writes and reads.
pub const FORMAT_VERSION: u32 = 1;

/// Bytes kept free beside the pictures, for the journal and the products.
const RESERVE_BYTES: u64 = 64 << 20;

/// What a session was to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the folder's layout: [`FORMAT_VERSION`].
    pub format: u32,
    /// The session's name when it was created.
    pub name: String,
    /// When it was created, UTC.
    pub created: Timestamp,
    /// Version of the program that created it.
    pub software: String,
    /// Where its pictures come from.
    pub origin: Origin,
    /// One line for each device, as it describes itself.
    pub devices: Vec<String>,
    /// The views to be captured.
    pub plan: Plan,
    /// The frozen configuration; opaque here.
    pub config: serde_json::Value,
    /// The geometry of the views, where it is known beforehand (imported cameras); opaque here.
    #[serde(default)]
    pub geometry: serde_json::Value,
    /// The photographs' own file names, a view each; empty for the rig.
    #[serde(default)]
    pub sources: Vec<String>,
    /// A picture without the grain, where there is one.
    #[serde(default)]
    pub background: Option<ArchivedFile>,
    /// The two captures that a merged grain was made from; empty otherwise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub merged_from: Vec<MergeSource>,
}

/// A capture that a merged grain was made from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MergeSource {
    /// The session's name.
    pub name: String,
    /// Its folder, from the merged session's folder on; from the root on where the two lie in different data folders.
    pub folder: PathBuf,
    /// What it was: SHA-256 of the hashes of its manifest and its pictures, hexadecimal
    /// ([`Recording::evidence_sha256`](super::Recording::evidence_sha256)).
    pub sha256: String,
}

impl Manifest {
    /// A manifest of today, by this program, for a plan on the rig; the other fields are set by the caller.
    pub fn new(name: &str, origin: Origin, plan: Plan, config: serde_json::Value) -> Self {
        Self {
            format: FORMAT_VERSION,
            name: name.to_owned(),
            created: Timestamp::now(),
            software: concat!("grainrig ", env!("CARGO_PKG_VERSION")).to_owned(),
            origin,
            devices: Vec::new(),
            plan,
            config,
            geometry: serde_json::Value::Null,
            sources: Vec::new(),
            background: None,
            merged_from: Vec::new(),
        }
    }
}

/// Where a session's pictures come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The rig turned the grain and photographed it.
    Rig,
    /// Somebody else's photographs.
    Import,
    /// Two sessions of one grain: it has no pictures of its own.
    Merge,
}

/// A file inside `frames/` beside the views' pictures.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArchivedFile {
    /// File name inside `frames/`.
    pub file: String,
    /// Size of the file.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// The views of a run and how each is taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// The views, in the order in which they are captured; `views[i].index == i`.
    pub views: Vec<PlannedView>,
    /// Time between the end of a move and the exposure, ms.
    pub settle_ms: u64,
    /// How often a bad picture of one view is taken again before the run fails.
    pub retakes: u32,
    /// Greatest difference between the angle reached and the angle commanded, degrees.
    pub tolerance_deg: f64,
}

/// One view of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedView {
    /// Its place in the plan, from 0.
    pub index: usize,
    /// What it is for.
    pub role: Role,
    /// Stage angle, degrees, counter-clockwise seen from above.
    pub angle_deg: f64,
    /// The same in full steps of the motor from its reference; `None` where no motor turned the grain.
    pub steps: Option<i64>,
}

impl PlannedView {
    /// The stage angle.
    pub fn angle(&self) -> Angle {
        Angle::from_deg(self.angle_deg)
    }
}

/// Free space that a run needs: `views` pictures of `frame_bytes` each, and a reserve of 64 MiB for the
/// journal and the products.
pub fn required_bytes(views: usize, frame_bytes: u64) -> u64 {
    frame_bytes.saturating_mul(views as u64).saturating_add(RESERVE_BYTES)
}
