//! A rig that does nothing but keep its state, and a server that drives it on a port of its own.

use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use grainrig::acquire::QualityMode;
use grainrig::jobs::{CompressRequest, Job};
use grainrig::server::{
    CompressionStarted, Compressions, Content, Download, EventFeed, Files, KEPT_EVENTS, Refusal, RefusalKind,
    Rig, RunRequest, RunStarted, RunState, ServeOptions, Upload, serve,
};
use grainrig::session::event::EventKind;
use grainrig::session::{ExchangedFile, sha256_hex};
use jiff::Timestamp;
use serde_json::{Value, json};
use tokio::sync::oneshot;

/// The number of the first event.
pub const FIRST: u64 = 1_700_000_000_000_000;
/// What must never reach a client.
pub const SECRET: &str = "/home/lab/data: no space left on device";
/// A picture's bytes.
pub const PICTURE: &[u8] = b"\xff\xd8 picture";

/// The fake.
pub struct FakeRig {
    pub feed: EventFeed,
}

impl FakeRig {
    pub fn happened(&self, what: EventKind) {
        self.feed.push(what, Timestamp::UNIX_EPOCH);
    }

    fn change(&self, from: RunState, what: EventKind) -> Result<(), Refusal> {
        let state = self.feed.status().state;
        if state != from {
            return Err(Refusal::new(RefusalKind::Busy, format!("the rig is {state:?}, not {from:?}")));
        }
        self.happened(what);
        Ok(())
    }
}

impl Compressions for FakeRig {
    fn compress(&self, id: &str, request: CompressRequest) -> Result<CompressionStarted, Refusal> {
        match request.settings() {
            Ok(_) => Ok(CompressionStarted { session: id.to_owned(), name: "elastic".into() }),
            Err(e) => Err(Refusal::new(RefusalKind::Invalid, e.to_string())),
        }
    }

    fn resume_compression(&self, _: &str, name: &str) -> Result<(), Refusal> {
        Err(Refusal::new(RefusalKind::NotFound, format!("there is no compression `{name}`")))
    }

    fn cancel_compression(&self) -> Result<(), Refusal> {
        Err(Refusal::new(RefusalKind::Busy, "there is no compression"))
    }

    fn compressions(&self, _: &str) -> Result<Value, Refusal> {
        Ok(json!([{ "name": "elastic" }]))
    }

    fn compression(&self, _: &str, name: &str) -> Result<Value, Refusal> {
        Ok(json!({ "name": name, "files": [{ "file": "curve.svg" }] }))
    }

    fn compression_file(&self, _: &str, name: &str, file: &str) -> Result<Download, Refusal> {
        match (name, file) {
            ("elastic", "curve.svg") => {
                Ok(download("image/svg+xml", b"<svg><script>alert(1)</script></svg>"))
            }
            _ => Err(Refusal::new(RefusalKind::NotFound, format!("`{name}` has no file `{file}`"))),
        }
    }
}

/// One that keeps nothing.
impl Files for FakeRig {
    fn files(&self) -> Result<Vec<ExchangedFile>, Refusal> {
        Ok(Vec::new())
    }

    fn file(&self, name: &str) -> Result<Download, Refusal> {
        Err(Refusal::new(RefusalKind::NotFound, format!("there is no file `{name}`")))
    }

    fn put_file(&self, _: &str) -> Result<Box<dyn Upload>, Refusal> {
        Ok(Box::new(Gone))
    }

    fn remove_file(&self, name: &str) -> Result<(), Refusal> {
        self.file(name).map(drop)
    }
}

struct Gone;

impl io::Write for Gone {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        Ok(buf.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Upload for Gone {
    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        Ok(())
    }

    fn refused(&self, error: &io::Error) -> Refusal {
        Refusal::new(RefusalKind::Disk, error.to_string())
    }
}

impl Rig for FakeRig {
    fn start(&self, request: RunRequest) -> Result<RunStarted, Refusal> {
        if request.session == "full" {
            let refusal = Refusal::new(RefusalKind::Disk, "0 MiB are free of the 500 MiB needed; make room");
            return Err(refusal.with_detail(SECRET));
        }
        if let Some(unknown) = request.overrides.keys().find(|key| *key != "views") {
            return Err(Refusal::new(RefusalKind::Invalid, format!("there is no setting `{unknown}`")));
        }
        if self.feed.status().state != RunState::Idle {
            return Err(Refusal::new(RefusalKind::Busy, "a run goes on; wait for its end or abort it"));
        }
        let session = request.session;
        self.happened(EventKind::Started { session: session.clone(), views: 25, already_captured: 0 });
        self.happened(EventKind::Homed);
        Ok(RunStarted { session })
    }

    fn pause(&self) -> Result<(), Refusal> {
        self.change(RunState::Running, EventKind::Paused)
    }

    fn resume(&self) -> Result<(), Refusal> {
        self.change(RunState::Paused, EventKind::Resumed)
    }

    fn compute(&self, _: Job) -> Result<u64, Refusal> {
        Ok(1)
    }

    fn job_result(&self, _: u64) -> Option<Value> {
        None
    }

    fn cancel_job(&self, job: u64) -> Result<(), Refusal> {
        Err(Refusal::new(RefusalKind::NotFound, format!("there is no computation {job}")))
    }

    fn resume_session(&self, id: &str, _: Option<QualityMode>) -> Result<RunStarted, Refusal> {
        self.session(id)?;
        Ok(RunStarted { session: id.into() })
    }

    fn abort(&self) -> Result<(), Refusal> {
        self.change(RunState::Running, EventKind::Aborted)
    }

    fn devices(&self) -> Result<Value, Refusal> {
        Ok(json!([]))
    }

    fn doctor(&self) -> Result<Value, Refusal> {
        Ok(json!([]))
    }

    fn sessions(&self) -> Result<Value, Refusal> {
        Ok(json!([{ "name": "quartz" }]))
    }

    fn session(&self, id: &str) -> Result<Value, Refusal> {
        match id {
            "quartz" => Ok(json!({ "name": "quartz", "frames": [{ "file": "0000.jpg" }] })),
            "panic" => panic!("{SECRET}"),
            _ => Err(Refusal::new(RefusalKind::NotFound, format!("there is no session `{id}`"))),
        }
    }

    fn remove_session(&self, id: &str) -> Result<(), Refusal> {
        self.session(id).map(drop)
    }

    fn frame(&self, id: &str, file: &str) -> Result<Download, Refusal> {
        match (id, file) {
            ("quartz", "0000.jpg") => Ok(download("image/jpeg", PICTURE)),
            _ => Err(Refusal::new(RefusalKind::NotFound, format!("`{id}` has no frame `{file}`"))),
        }
    }

    fn preview(&self, id: &str, file: &str, of_grain: bool) -> Result<Download, Refusal> {
        self.frame(id, file)?;
        Ok(download("image/jpeg", if of_grain { b"grain" } else { b"whole" }))
    }

    fn rejected(&self, id: &str, view: usize) -> Result<Download, Refusal> {
        match (id, view) {
            ("quartz", 3) => Ok(download("image/jpeg", PICTURE)),
            _ => Err(Refusal::new(
                RefusalKind::NotFound,
                format!("`{id}` has no refused picture of view {view}"),
            )),
        }
    }

    fn product(&self, id: &str, file: &str) -> Result<Download, Refusal> {
        match (id, file) {
            ("quartz", "report.html") => Ok(download("text/html", b"<script>alert(1)</script>")),
            _ => Err(Refusal::new(RefusalKind::NotFound, format!("`{id}` has no product `{file}`"))),
        }
    }

    fn events(&self) -> EventFeed {
        self.feed.clone()
    }
}

fn download(content_type: &'static str, bytes: &[u8]) -> Download {
    Download { content_type, sha256: sha256_hex(bytes), content: Content::Bytes(bytes.to_vec()) }
}

/// A server on a port of its own; it ends when dropped.
pub struct Server {
    pub address: SocketAddr,
    pub rig: Arc<FakeRig>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Server {
    pub fn start() -> Self {
        Self::with(ServeOptions::default(), KEPT_EVENTS)
    }

    pub fn with(options: ServeOptions, keep: NonZeroUsize) -> Self {
        let rig = Arc::new(FakeRig { feed: EventFeed::new(FIRST, keep) });
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = listener.local_addr().unwrap();
        let (stop, stopped) = oneshot::channel();
        let serving = serve(listener, rig.clone(), options, async {
            stopped.await.ok();
        });
        let thread = std::thread::spawn(move || runtime.block_on(serving));
        Self { address, rig, stop: Some(stop), thread: Some(thread) }
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// Asks the server to end and waits until it has.
    pub fn stop(&mut self) -> io::Result<()> {
        if let Some(stop) = self.stop.take() {
            stop.send(()).ok();
        }
        self.thread.take().map_or(Ok(()), |thread| thread.join().unwrap())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop().unwrap();
    }
}

/// A client that returns errors' bodies, and does not wait for ever.
pub fn client() -> ureq::Agent {
    ureq::Agent::config_builder()
        .http_status_as_error(false)
        .max_redirects(0)
        .timeout_global(Some(Duration::from_secs(60)))
        .build()
        .new_agent()
}
