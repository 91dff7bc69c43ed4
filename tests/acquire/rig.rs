//! A stage, a camera, a clock and a sink that do what a test tells them, at the step that it tells.

use grainrig::acquire::{
    self, AcquireError, Clock, Control, Earlier, FrameSink, Judge, Outcome, SessionSink, StoreOutcome,
};
use grainrig::rig::{Camera, Encoding, Frame, RigError, RotationStage};
use grainrig::session::event::{CapturedView, EventKind, Role};
use grainrig::session::{Manifest, Origin, Plan, PlannedView, Recording, Session, SessionError, Store};
use grainrig_core::geometry::Angle;
use image::{DynamicImage, ImageFormat, RgbImage};
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tempfile::TempDir;

/// Views of the plan.
pub const VIEWS: usize = 4;

/// What the run does at one moment; each is counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    Begin,
    Home,
    Move(usize),
    Settle(usize),
    Expose(usize),
    /// A picture is handed to the sink.
    Store(usize),
    /// A picture is looked at, on the sink's own thread.
    Examine(usize),
    /// What becomes of a picture is asked for.
    Verdict(usize),
    /// The camera is told that its picture is durable.
    Kept,
    /// The event with this number is handed to the sink.
    Event(usize),
}

/// What a test has planned for a run.
pub struct Script {
    /// The step at which something breaks.
    pub fails_at: Option<Step>,
    /// Called at each step, before it is done.
    pub at: Box<dyn Fn(Step) + Send + Sync>,
    /// The bytes of each exposure; a good picture where there are none.
    pub pictures: Vec<Option<Vec<u8>>>,
    /// Pictures, counted from 0 in the order in which they are looked at, that are no good.
    pub unfit: Vec<usize>,
    /// Exposures for which the camera is given up, and after how long it is to be tried again.
    pub suspended: (Vec<usize>, Duration),
    /// What the stage answers to a target, degrees.
    pub reached: fn(f64) -> f64,
}

impl Default for Script {
    fn default() -> Self {
        Self {
            fails_at: None,
            at: Box::new(|_| {}),
            pictures: Vec::new(),
            unfit: Vec::new(),
            suspended: (Vec::new(), Duration::ZERO),
            reached: |deg| deg,
        }
    }
}

impl Script {
    /// Tells the test of a step; whether it is to fail.
    fn fails(&self, step: Step) -> bool {
        (self.at)(step);
        self.fails_at == Some(step)
    }
}

fn device() -> RigError {
    RigError::Device("the fake fails here; let it".into())
}

fn disk() -> SessionError {
    SessionError::DiskFull { path: "/data".into(), needed: 70_000, free: 12 }
}

/// The script, the moves so far, and where they went.
struct FakeStage(Arc<Script>, usize, Arc<Mutex<Vec<f64>>>);

impl RotationStage for FakeStage {
    fn home(&mut self) -> Result<Angle, RigError> {
        if self.0.fails(Step::Home) { Err(device()) } else { Ok(Angle::default()) }
    }
    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let failing = self.0.fails(Step::Move(self.1));
        self.1 += 1;
        self.2.lock().unwrap().push(target.deg());
        if failing { Err(device()) } else { Ok(Angle::from_deg((self.0.reached)(target.deg()))) }
    }
    fn describe(&self) -> String {
        "fake stage".into()
    }
}

struct FakeCamera(Arc<Script>, usize);

impl Camera for FakeCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        let failing = self.0.fails(Step::Expose(self.1));
        let told = self.0.pictures.get(self.1).cloned().flatten();
        let (suspended, retry) = &self.0.suspended;
        if suspended.contains(&self.1) {
            self.1 += 1;
            let (cause, remedy) = ("it sleeps".into(), "wake it".into());
            return Err(RigError::Suspended { cause, remedy, retry: *retry });
        }
        self.1 += 1;
        // The driver's own idea of the encoding is not to be believed.
        let frame = |bytes| Frame::new(bytes, Encoding::Tiff);
        if failing { Err(device()) } else { Ok(frame(told.unwrap_or_else(|| picture(16, 8)))) }
    }
    fn kept(&mut self) {
        (self.0.at)(Step::Kept);
    }
    fn describe(&self) -> String {
        "fake camera".into()
    }
}

/// A good picture of this size.
pub fn picture(width: u32, height: u32) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    DynamicImage::from(RgbImage::new(width, height)).write_to(&mut out, ImageFormat::Jpeg).unwrap();
    out.into_inner()
}

/// Time that passes only where somebody waits for it, a second for each exposure besides.
pub struct FakeClock {
    script: Arc<Script>,
    now: Arc<Mutex<Duration>>,
    waits: Mutex<usize>,
}

impl Clock for FakeClock {
    fn now(&self) -> Duration {
        *self.now.lock().unwrap()
    }
    fn wait(&self, time: Duration, _: &Control) {
        let mut waits = self.waits.lock().unwrap();
        (self.script.at)(Step::Settle(*waits));
        *waits += 1;
        *self.now.lock().unwrap() += time;
    }
}

/// Refuses the pictures that a test wants refused.
struct Looking {
    script: Arc<Script>,
    examined: usize,
    passed_on: Arc<Mutex<Vec<usize>>>,
}

impl Judge for Looking {
    type Seen = ();

    fn examine(&mut self, _: &PlannedView, _: Angle, _: &Frame) -> Result<(), String> {
        let this = self.examined;
        self.examined += 1;
        (self.script.at)(Step::Examine(this));
        if self.script.unfit.contains(&this) { Err("focus is 9 px".into()) } else { Ok(()) }
    }
    fn kept(&mut self, view: CapturedView, _: Frame, (): ()) {
        self.passed_on.lock().unwrap().push(view.view);
    }
}

/// A sink into a session whose disk fails when it is told to.
struct FailingSink<'scope> {
    inner: SessionSink<'scope>,
    script: Arc<Script>,
    stored: usize,
    events: usize,
    failing: bool,
}

impl FrameSink for FailingSink<'_> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        if self.script.fails(Step::Begin) { Err(disk()) } else { self.inner.begin() }
    }
    fn offer(&mut self, view: &PlannedView, reached: Angle, frame: Frame, remaining_s: Option<f64>) {
        self.failing = self.script.fails(Step::Store(self.stored));
        self.stored += 1;
        if !self.failing {
            self.inner.offer(view, reached, frame, remaining_s);
        }
    }
    fn outcome(&mut self) -> Result<StoreOutcome, SessionError> {
        (self.script.at)(Step::Verdict(self.stored - 1));
        if self.failing { Err(disk()) } else { self.inner.outcome() }
    }
    fn event(&mut self, what: EventKind) -> Result<(), SessionError> {
        let failing = self.script.fails(Step::Event(self.events));
        self.events += 1;
        if failing { Err(disk()) } else { self.inner.event(what) }
    }
}

/// A session that runs are made in, one after the other.
pub struct Runs {
    _dir: TempDir,
    folder: PathBuf,
    /// Time, which a test may let pass.
    pub now: Arc<Mutex<Duration>>,
    /// Views that were passed on, in order, over all runs.
    pub passed_on: Arc<Mutex<Vec<usize>>>,
    /// Where the stage was sent, degrees, in order, over all runs.
    pub went: Arc<Mutex<Vec<f64>>>,
}

impl Runs {
    pub fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(dir.path());
        let view = |index| {
            let role = if index + 1 == VIEWS { Role::Closing } else { Role::Grain };
            PlannedView { index, role, angle_deg: index as f64 * 60.0, steps: None }
        };
        let views = (0..VIEWS).map(view).collect();
        let plan = Plan { views, settle_ms: 1000, retakes: 2, tolerance_deg: 0.45 };
        let manifest = Manifest::new("a", Origin::Rig, plan, serde_json::Value::Null);
        drop(store.create(&manifest).unwrap());
        let folder = store.folder("a").unwrap();
        Self { _dir: dir, folder, now: Arc::default(), passed_on: Arc::default(), went: Arc::default() }
    }

    /// One run, from opening the session to the end.
    pub fn run(&self, script: Script, control: &Control) -> Result<Outcome, AcquireError> {
        let script = Arc::new(script);
        let session = Session::open(&self.folder).unwrap();
        let plan = session.recording().manifest().plan.clone();
        let clock =
            FakeClock { script: Arc::clone(&script), now: Arc::clone(&self.now), waits: Mutex::new(0) };
        let mut stage = FakeStage(Arc::clone(&script), 0, Arc::clone(&self.went));
        let mut camera = FakeCamera(Arc::clone(&script), 0);
        let passed_on = Arc::clone(&self.passed_on);
        let judge = Looking { script: Arc::clone(&script), examined: 0, passed_on };
        std::thread::scope(|scope| {
            let inner = SessionSink::new(scope, Arc::new(Mutex::new(session)), judge);
            let mut sink = FailingSink { inner, script, stored: 0, events: 0, failing: false };
            acquire::run(&mut stage, &mut camera, &plan, &mut sink, control, &clock)
        })
    }

    /// A run to which nothing happens.
    pub fn run_well(&self) -> Outcome {
        self.run(Script::default(), &Control::new()).unwrap()
    }

    /// The session as it stands on the disk.
    pub fn recording(&self) -> Recording {
        Recording::read(&self.folder).unwrap()
    }

    /// The views that are durable, each with its hash checked.
    pub fn durable(&self) -> Vec<usize> {
        let recording = self.recording();
        recording.views().map(|v| recording.frame(v.view).map(|_| v.view).unwrap()).collect()
    }

    /// The names of the newest run's events, as the journal has them.
    pub fn events(&self) -> Vec<String> {
        let name = |what: &EventKind| {
            let value = serde_json::to_value(what).unwrap();
            let view = value.get("view").map_or_else(String::new, |v| format!(" {v}"));
            format!("{}{view}", value["event"].as_str().unwrap())
        };
        let all: Vec<String> = self.recording().events().iter().map(|e| name(&e.what)).collect();
        let begin = all.iter().rposition(|n| n == "started").unwrap_or(0);
        all[begin..].to_vec()
    }
}
