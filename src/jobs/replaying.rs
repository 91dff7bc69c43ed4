//! A recorded session sent the whole way again, without the rig.

use super::finish::{self, Finished, Made};
use super::recorded::{
    PriorProducts, WAITING_VIEWS, check_views, computation, joined, prior_products, record,
};
use super::{Context, JobError, Watcher, merging};
use crate::acquire::{self, Control, Earlier, FrameSink, Outcome, StoreOutcome, SystemClock};
use crate::pipeline::{Reconstruction, View};
use crate::rig::Frame;
use crate::session::event::{Event, EventKind};
use crate::session::replay::replay as play;
use crate::session::{Origin, Plan, PlannedView, Recording, Session, SessionError, to_json_value};
use crate::trace;
use grainrig_core::geometry::Angle;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

/// A session, to be sent the whole way again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ReplayOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
}

impl ReplayOptions {
    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        drop(Recording::read(&context.names.session(&self.session)?)?);
        Ok(())
    }

    /// Replays.
    ///
    /// # Errors
    /// As [`replay`]; products that differ are none.
    pub fn run(&self, context: &Context) -> Result<Replayed, JobError> {
        replay(&context.names.session(&self.session)?, &context.watcher)
    }
}

/// What a replay made, and how it compares.
#[derive(Debug, Clone)]
pub struct Replayed {
    /// The result.
    pub finished: Finished,
    /// Products whose bytes differ from the recorded ones; the recorded ones are left as they are.
    pub differs: Vec<String>,
}

impl Replayed {
    /// What `--json` prints.
    ///
    /// # Errors
    /// [`JobError::Encode`] where a figure is not finite.
    pub fn to_json(&self) -> Result<serde_json::Value, JobError> {
        let mut object = to_json_value(&self.finished.result)?;
        object["differs"] = serde_json::json!(self.differs);
        Ok(object)
    }

    /// Whether every product has the recorded bytes.
    ///
    /// # Errors
    /// [`JobError::Differs`] where one has not.
    pub fn check(self) -> Result<(), JobError> {
        if self.differs.is_empty() {
            return Ok(());
        }
        Err(JobError::Differs { products: self.differs, software: self.finished.result.software })
    }
}

/// Sends a recording the whole way again: through the acquisition, with the recording as stage and camera, through
/// the computation, to the products. A product that is missing or damaged on the disk is written again; the journal
/// stays as it is, except that a session without products gets its first ones.
///
/// # Errors
/// [`JobError`] where views are missing, a file has changed, or the computation fails.
pub fn replay(folder: &Path, watcher: &Watcher) -> Result<Replayed, JobError> {
    trace::job_of("replay", folder, || replayed(folder, watcher))
}

fn replayed(folder: &Path, watcher: &Watcher) -> Result<Replayed, JobError> {
    let mut recording = Recording::read(folder)?;
    if recording.is_unsettled() || finish::lacks_end(&recording) {
        // A run was killed while it put its products in their place.
        let mut session = Session::open(folder)?;
        finish::end(&mut session)?;
        recording = session.recording().clone();
    }
    let prior_products = prior_products(&recording)?;
    if recording.manifest().origin == Origin::Merge {
        let mesh = prior_products.as_ref().and_then(|before| before.mesh.as_ref());
        let (made, _) = merging::again(&recording, mesh, watcher)?;
        return compared(&recording, &made, prior_products, watcher);
    }
    let made = played(&recording, prior_products.as_ref(), watcher)?;
    compared(&recording, &made, prior_products, watcher)
}

/// Sends the recorded pictures through acquisition and computation.
fn played(
    recording: &Recording,
    prior_products: Option<&PriorProducts>,
    watcher: &Watcher,
) -> Result<Reconstruction, JobError> {
    let plan = Plan { settle_ms: 0, retakes: 0, ..recording.manifest().plan.clone() };
    check_views(recording)?;
    let (_, mut pipeline) = computation(recording)?;
    if let Some(before) = prior_products {
        if let Some(mesh) = &before.mesh {
            pipeline.settings.mesh = mesh.clone();
        }
        // Who made them has said that they are meant so; the result has what was doubtful.
        pipeline.settings.as_given = true;
        // What was not drawn then would only differ.
        pipeline.settings.report.pictures = before.pictures;
    }
    let session = &recording.manifest().name;
    let (send, receive) = sync_channel(WAITING_VIEWS);
    let numbered = Numbered::new(watcher);
    std::thread::scope(|scope| {
        let (numbered, plan, span) = (&numbered, &plan, tracing::Span::current());
        let acquiring = scope.spawn(move || {
            let _within = span.entered();
            let (mut stage, mut camera) = play(recording.clone());
            let mut sink = ReplaySink { recording, send, numbered };
            acquire::run(&mut stage, &mut camera, plan, &mut sink, &Control::new(), &SystemClock::new())
        });
        let made = pipeline.run(receive, &|what| numbered.tell(what));
        match joined(acquiring)? {
            Outcome::Complete { .. } => Ok::<_, JobError>(made?),
            Outcome::Aborted { captured } => {
                let planned = plan.views.len();
                Err(JobError::Aborted { session: session.clone(), captured, planned })
            }
        }
    })
}

/// Holds what was made against the recorded products; a session without products gets its first ones.
fn compared(
    recording: &Recording,
    made: &dyn Made,
    prior_products: Option<PriorProducts>,
    watcher: &Watcher,
) -> Result<Replayed, JobError> {
    let folder = recording.folder();
    let Some(PriorProducts { timing_s, .. }) = prior_products else {
        let mut session = Session::open(folder)?;
        let watch = Arc::clone(watcher);
        session.observe(move |e| watch(e));
        let finished = record(&mut session, made, None)?;
        return Ok(Replayed { finished, differs: Vec::new() });
    };
    let (software, session) = (&recording.manifest().software, &recording.manifest().name);
    let files = finish::render(made, software, session, timing_s)?;
    let differs = finish::compare(recording, files)?;
    if finish::lacks_end(recording) && differs.is_empty() {
        finish::end(&mut Session::open(folder)?)?;
    }
    let records = recording.products().cloned().collect();
    let finished = finish::finished(made, software, folder, session, records);
    Ok(Replayed { finished, differs })
}

/// Numbers the events of a job that journals none: of a replay (the journal's are the recording's), of a merging.
pub(super) struct Numbered<'a> {
    next: Mutex<u64>,
    watcher: &'a Watcher,
}

impl<'a> Numbered<'a> {
    pub fn new(watcher: &'a Watcher) -> Self {
        Self { next: Mutex::new(1), watcher }
    }

    pub fn tell(&self, what: EventKind) {
        // Locked over the call, so that the events come in order.
        let mut next = self.next.lock().unwrap_or_else(PoisonError::into_inner);
        (self.watcher)(&Event { seq: *next, time: jiff::Timestamp::now(), what });
        *next += 1;
    }
}

/// Hands the played pictures to the pipeline: they are durable already.
struct ReplaySink<'a> {
    recording: &'a Recording,
    send: SyncSender<View>,
    numbered: &'a Numbered<'a>,
}

impl FrameSink for ReplaySink<'_> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        let manifest = self.recording.manifest();
        self.numbered.tell(EventKind::Started {
            session: manifest.name.clone(),
            views: manifest.plan.views.len(),
            already_captured: 0,
        });
        Ok(Earlier::default())
    }

    fn offer(&mut self, view: &PlannedView, _: Angle, frame: Frame, remaining_s: Option<f64>) {
        // Every view of the plan is recorded, which is seen to before a replay begins.
        let Some(captured) = self.recording.view(view.index) else { return };
        self.numbered.tell(EventKind::Captured { view: captured.clone(), remaining_s });
        // A pipeline that has failed takes no more; its error is what the replay returns.
        let _ = self.send.send(View::recorded(captured, frame.bytes));
    }

    fn outcome(&mut self) -> Result<StoreOutcome, SessionError> {
        Ok(StoreOutcome::Kept)
    }

    fn event(&mut self, what: EventKind) -> Result<(), SessionError> {
        self.numbered.tell(what);
        Ok(())
    }
}
