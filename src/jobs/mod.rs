//! Everything that the program does for somebody, in one form: options that the command line, HTTP and a person's own program
//! state alike, run against one [`Context`], to one outcome or one error.
//!
//! ```text
//!  grainrig NAME …   ─▶ options ─▶ run(context), in the foreground            ─▶ a person's words, or --json
//!  POST /api/v1/jobs ─▶ Job     ─▶ a slot: the rig's, or the one beside it    ─▶ GET /api/v1/jobs/{n}
//! ```

mod background;
mod capturing;
mod compressing;
mod devices;
mod doctor;
mod ensemble;
mod error;
mod finish;
mod focus;
mod host;
mod importing;
mod job;
mod kind;
mod merging;
mod mesh_files;
mod meshing;
mod names;
mod preview;
mod reconstructing;
mod recorded;
mod replaying;
mod resting;
mod scale_file;
mod scaling;
mod slot;
mod studying;

pub use background::{Background, BackgroundError};
pub use capturing::{CaptureOptions, ResumeOptions, Resumed, capture, resume};
pub use compressing::{
    Claim, CompressDetails, CompressFile, CompressHost, CompressInput, CompressLine, CompressMaterial,
    CompressOptions, CompressProgress, CompressRequest, CompressResult, CompressSettings, CompressState,
    Compression, EnergyResult, ExperimentResult, FootBy, FootResult, OtherCurve, Placing, RockingBy,
    RockingResult, experiment_lines, rocking_line, transition_line,
};
pub use devices::{DeviceLine, devices};
pub use doctor::{Finding, Health, doctor};
pub use ensemble::{
    EnsembleFigures, EnsembleOptions, EnsembleResult, EnsembleSpread, Interval, ensemble_lines,
};
pub use error::JobError;
pub use finish::{Finished, RESULT};
pub use focus::{Focused, focus};
pub use host::Host;
pub use importing::{ImportGeometry, ImportOptions, import};
pub use job::Job;
pub use kind::ErrorKind;
pub use merging::{MergeOptions, merge};
pub use mesh_files::{Unit, ending as file_ending};
pub use meshing::{MeshOptions, MeshPreset, Meshed, MeshedFile};
pub use names::Names;
pub use preview::{Preview, PreviewPart, Previews};
pub use reconstructing::{ReconstructOptions, VerifyOptions, reconstruct};
pub use replaying::{ReplayOptions, Replayed, replay};
pub use resting::{Askew, AskewResult, RestLine, RestsOptions, RestsResult};
pub use scale_file::{BodyKind, GivenScale, PictureScale, ScaleFile};
pub use scaling::{Angles, ScaleOptions, ScaleRequest, calibrate_scale};
pub use studying::{Studied, StudyOptions};

use crate::config::Config;
use crate::session::event::{BackgroundEvent, Event, EventKind};
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The program and its version, as files name what made them.
const SOFTWARE: &str = concat!("grainrig ", env!("CARGO_PKG_VERSION"));

/// The version of the form of what a job comes to; raised where a key changes its name, unit or meaning.
const SCHEMA: u32 = 1;

/// A result with the version of its form and the program's, where it does not state them itself.
pub fn stated(mut result: Value) -> Value {
    if let Some(object) = result.as_object_mut().filter(|object| !object.contains_key("version")) {
        for (key, stated) in [("software", SOFTWARE.into()), ("schema", SCHEMA.into())] {
            if !object.contains_key(key) {
                object.shift_insert(0, key.into(), stated);
            }
        }
    }
    result
}

/// Told of every event of a job, in order. Called while the session is held: it must not block.
pub type Watcher = Arc<dyn Fn(&Event) + Send + Sync>;

/// Told of what goes on beside the runs. It must not block.
pub type BackgroundWatcher = Arc<dyn Fn(BackgroundEvent) + Send + Sync>;

/// What a job has of its surroundings, whoever asked for it.
#[derive(Clone)]
pub struct Context {
    /// Where the names in its options lead.
    pub names: Names,
    /// What a new session is made with.
    pub config: Config,
    /// Take figures as they are that look like slips of unit.
    pub as_given: bool,
    /// Told of every event.
    pub watcher: Watcher,
    /// Set where it is to stop, if it can in its middle.
    pub stop: Arc<AtomicBool>,
}

impl Context {
    /// Tells what is being done, and how much of that is done, 0 to 1.
    pub(crate) fn working(&self, stage: &str, done: f64) {
        let what = EventKind::Working { stage: stage.into(), done };
        (self.watcher)(&Event { seq: 0, time: jiff::Timestamp::now(), what });
    }
}

/// What came of a job on a thread of its own; in words what went wrong, `defect` where it panicked.
fn ended<T, E: std::fmt::Display>(defect: &str, job: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(job)) {
        Ok(ended) => ended.map_err(|error| error.to_string()),
        Err(_) => Err(defect.to_owned()),
    }
}
