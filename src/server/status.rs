//! Where the run stands: the events so far, folded into one picture.
//!
//! ```text
//!            started            homed, moving         acquisition_complete / working
//!   idle ─────────────▶ starting ─────▶ running ──────────────────────▶ computing ──▶ complete
//!                           │           ▲     │ paused                     │
//!                           │   resumed │     ▼                            │
//!                           │           paused                             │
//!                           └──────────────┴──── aborted │ failed ◀────────┘
//! ```
//!
//! `web/status.js` is the same fold for the browser; `web/test/fold.json` holds both to the same answers.

use serde::Serialize;
use utoipa::ToSchema;

use super::compressing::CompressionStatus;
use super::jobs;
use super::schemas::GrainResult;
use crate::session::event::{BackgroundEvent, EventKind, FeedEvent, JobStatus};
use grainrig_core::silhouette::Verdict;

/// More warnings than this help nobody: a run has 26 views.
const WARNINGS_KEPT: usize = 200;
/// Points of the hull's history that are kept; a plan with more views is charted to here.
const HULL_POINTS_KEPT: usize = 2000;

/// What the rig is doing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    /// No run since the daemon came up.
    #[default]
    Idle,
    /// A run has begun; the stage looks for its reference.
    Starting,
    /// Views are being captured.
    Running,
    /// The run waits for `resume`.
    Paused,
    /// All views are captured; hull and mesh are being made.
    Computing,
    /// The products are there.
    Complete,
    /// Somebody stopped the run.
    Aborted,
    /// The run could not go on; `error` says why.
    Failed,
}

/// The volume after so many views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct HullPoint {
    /// Views in the hull.
    pub views: usize,
    /// Volume, mm³: an upper bound; `null` where the session has no scale.
    pub volume_mm3: Option<f64>,
}

/// What the computation is at.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Stage {
    /// `calibrate`, `hull`, `mesh` or `export`.
    pub name: String,
    /// How much of it is done, 0 to 1.
    pub done: f64,
}

/// How good a view is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ViewVerdict {
    /// Nothing is wrong with it.
    Good,
    /// Usable, but a person should look at it.
    Doubtful,
    /// It should be, or was, taken again.
    Bad,
}

/// Something a person should know of a view.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ViewWarning {
    /// Index of the view.
    pub view: usize,
    /// How good the view, or the picture that was taken again, was; `null` where it was not judged.
    pub verdict: Option<ViewVerdict>,
    /// The warning.
    pub text: String,
}

/// A picture that was no good.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct RejectedPicture {
    /// Index of its view.
    pub view: usize,
    /// Pictures taken of this view so far.
    pub tries: u32,
    /// Value, unit, limit and remedy.
    pub cause: String,
}

/// Where the run stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Status {
    /// What the rig is doing.
    pub state: RunState,
    /// Name of the session, the last one's after its end; `null` before the first.
    pub session: Option<String>,
    /// Views in the plan.
    pub views: usize,
    /// Views captured so far.
    pub captured: usize,
    /// Index of the view that the stage is at or on its way to, or of the last one taken.
    pub view: Option<usize>,
    /// Angle of the stage, degrees: where it was last sent or last said that it is.
    pub angle_deg: Option<f64>,
    /// Estimated time to the last view, seconds; `null` before it can be told.
    pub remaining_s: Option<f64>,
    /// File name of the last captured view: `sessions/{session}/frames/{last_frame}`.
    pub last_frame: Option<String>,
    /// How the live hull's volume came down, view by view.
    pub hull: Vec<HullPoint>,
    /// What the computation is at.
    pub stage: Option<Stage>,
    /// What a person should know of the views.
    pub warnings: Vec<ViewWarning>,
    /// The last picture that was refused, until its view is captured: `sessions/{session}/rejected/{view}`.
    pub rejected: Option<RejectedPicture>,
    /// File names of the products: `sessions/{session}/products/{file}`.
    pub products: Vec<String>,
    /// What `result.json` holds, at the end.
    #[schema(value_type = Option<GrainResult>)]
    pub result: Option<serde_json::Value>,
    /// Why the run failed or is suspended: value, limit, remedy.
    pub error: Option<String>,
    /// The compression that goes on beside the runs, or the last one; `null` before the first.
    pub compression: Option<CompressionStatus>,
    /// The computations beside the rig that wait or go on, and the last ones that have ended, the newest last.
    pub jobs: Vec<JobStatus>,
}

impl Status {
    /// Takes one more event into account.
    pub(super) fn apply(&mut self, what: &FeedEvent) {
        match what {
            FeedEvent::Run(what) => self.go_on(what),
            FeedEvent::Beside(BackgroundEvent::Compression(news)) => {
                self.compression = Some(CompressionStatus::after(self.compression.take(), news));
            }
            FeedEvent::Beside(BackgroundEvent::Job(news)) => jobs::apply(&mut self.jobs, news),
        }
    }

    fn go_on(&mut self, what: &EventKind) {
        match what {
            EventKind::Started { session, views, already_captured } => {
                *self = Self {
                    state: RunState::Starting,
                    session: Some(session.clone()),
                    views: *views,
                    captured: *already_captured,
                    compression: self.compression.take(),
                    jobs: std::mem::take(&mut self.jobs),
                    ..Self::default()
                };
            }
            EventKind::Homed => self.leave_start_for(RunState::Running),
            EventKind::Moving { view, target_deg } => {
                self.leave_start_for(RunState::Running);
                self.view = Some(*view);
                self.angle_deg = Some(*target_deg);
            }
            EventKind::Captured { view, remaining_s } => {
                self.captured += 1;
                self.rejected.take_if(|rejected| rejected.view == view.view);
                // A view is kept while the stage is on its way to a later one.
                if self.view <= Some(view.view) {
                    self.view = Some(view.view);
                    self.angle_deg = Some(view.reached_deg);
                }
                self.remaining_s = *remaining_s;
                self.last_frame = Some(view.file.clone());
            }
            EventKind::Paused => self.state = RunState::Paused,
            EventKind::Resumed => {
                self.state = RunState::Running;
                self.error = None;
            }
            EventKind::Aborted => self.end(RunState::Aborted),
            EventKind::AcquisitionComplete { .. } => {
                self.state = RunState::Computing;
                self.remaining_s = None;
            }
            EventKind::Silhouette { view, verdict, warnings, .. } => self.warn(*view, *verdict, warnings),
            EventKind::Judged { view, verdict, warnings } => self.warn(*view, Some(*verdict), warnings),
            EventKind::Rejected { view, tries, cause } => {
                self.warn(*view, Some(Verdict::Bad), std::slice::from_ref(cause));
                // Without a number it is a picture that was kept.
                if let Some(tries) = *tries {
                    self.rejected = Some(RejectedPicture { view: *view, tries, cause: cause.clone() });
                }
            }
            EventKind::Suspended { cause, .. } => self.error = Some(cause.clone()),
            EventKind::Hull { views, volume_mm3 } => {
                if self.hull.len() < HULL_POINTS_KEPT {
                    self.hull.push(HullPoint { views: *views, volume_mm3: *volume_mm3 });
                }
            }
            EventKind::Working { stage, done } => {
                // A replay computes without having captured anything.
                self.leave_start_for(RunState::Computing);
                self.stage = Some(Stage { name: stage.clone(), done: *done });
            }
            EventKind::Products { files, .. } => {
                self.products = files.iter().map(|product| product.file.clone()).collect();
            }
            EventKind::Failed { error } => {
                self.end(RunState::Failed);
                self.error = Some(error.clone());
            }
            EventKind::Complete { result } => {
                self.end(RunState::Complete);
                self.result = Some(result.clone());
            }
        }
    }

    fn warn(&mut self, view: usize, verdict: Option<Verdict>, warnings: &[String]) {
        let room = WARNINGS_KEPT.saturating_sub(self.warnings.len());
        let verdict = verdict.map(|v| match v {
            Verdict::Good => ViewVerdict::Good,
            Verdict::Doubtful => ViewVerdict::Doubtful,
            Verdict::Bad => ViewVerdict::Bad,
        });
        let told = warnings.iter().take(room).map(|text| ViewWarning { view, verdict, text: text.clone() });
        self.warnings.extend(told);
    }

    fn leave_start_for(&mut self, state: RunState) {
        if self.state == RunState::Starting {
            self.state = state;
        }
    }

    fn end(&mut self, state: RunState) {
        self.state = state;
        self.remaining_s = None;
        self.stage = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The browser's fold is held to the same file by `web/test/fold.test.mjs`.
    #[test]
    fn the_fold_is_the_one_in_the_shared_example() {
        let steps: Vec<serde_json::Value> =
            serde_json::from_str(include_str!("../../web/test/fold.json")).unwrap();
        let mut status = Status::default();
        for step in steps {
            let event: FeedEvent = serde_json::from_value(step["event"].clone()).unwrap();
            status.apply(&event);
            let status = serde_json::to_value(&status).unwrap();
            for (key, expected) in step["expect"].as_object().unwrap() {
                assert_eq!(&status[key], expected, "{key} after {}", step["event"]);
            }
        }
    }
}
