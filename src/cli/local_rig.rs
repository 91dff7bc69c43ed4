//! The rig of this computer as the server sees it: the host, its sessions, and what clients may know of them.

use crate::acquire::QualityMode;
use crate::config::Config;
use crate::jobs::{
    Background, BackgroundWatcher, CaptureOptions, CompressHost, ErrorKind, Host, Job, JobError, PreviewPart,
    Previews, Watcher,
};
use crate::server::{
    Content, Download, EventFeed, KEPT_EVENTS, Refusal, RefusalKind, Rig, RunRequest, RunStarted,
};
use crate::session::event::{BackgroundEvent, CompressionUpdate, Event, EventKind, JobStatus};
use crate::session::{Exchange, Hashes, Recording, SessionError, Summary, remove, sha256_hex};
use grainrig_core::formats::Format;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Settings that belong to whoever runs the daemon, as JSON pointers: how it is reached, its hardware with its limits, and files
/// of its computer.
fn fixed() -> Vec<String> {
    let config = Config::default();
    let of_drivers = config
        .drivers()
        .into_iter()
        .flat_map(|(name, driver)| driver.fixed().iter().map(move |key| format!("/{name}{key}")));
    ["/serve", "/rig"].map(String::from).into_iter().chain(of_drivers).collect()
}

/// The host as the server sees it.
pub(super) struct LocalRig {
    host: Arc<Host>,
    pub(super) background: Arc<Background>,
    pub(super) compressing: Arc<CompressHost>,
    feed: EventFeed,
    pub(super) places: Places,
    previews: Previews,
    hashes: Hashes,
}

impl LocalRig {
    pub(super) fn new(data: &Path, config: Config) -> Self {
        // Numbers go on across a restart, and stay below 2^53.
        let seconds = u64::try_from(jiff::Timestamp::now().as_second()).unwrap_or(1).max(1);
        let feed = EventFeed::new(seconds * 1_000_000, KEPT_EVENTS);
        let places = Places::of(data);
        let (push, hide) = (feed.clone(), places.clone());
        let watcher: Watcher = Arc::new(move |event: &Event| {
            let what = match &event.what {
                EventKind::Failed { error } => EventKind::Failed { error: hide.hidden(error) },
                what => what.clone(),
            };
            push.push(what, event.time);
        });
        let (push, hide) = (feed.clone(), places.clone());
        let news: BackgroundWatcher = Arc::new(move |mut news| {
            let (BackgroundEvent::Compression(CompressionUpdate { error, .. })
            | BackgroundEvent::Job(JobStatus { error, .. })) = &mut news;
            *error = error.as_deref().map(|error| hide.hidden(error));
            push.push(news, jiff::Timestamp::now());
        });
        let background = Arc::new(Background::new(Arc::clone(&news)));
        let compressing = CompressHost::new(data, Arc::clone(&background), news);
        Self {
            background,
            compressing: Arc::new(compressing),
            host: Arc::new(Host::new(data.to_owned(), config, watcher)),
            feed,
            places,
            previews: Previews::default(),
            hashes: Hashes::default(),
        }
    }

    /// The host, for the program's end.
    pub(super) fn host(&self) -> Arc<Host> {
        Arc::clone(&self.host)
    }

    /// The host of compressions, for the program's beginning.
    pub(super) fn compressing(&self) -> Arc<CompressHost> {
        Arc::clone(&self.compressing)
    }

    /// What is computed beside the rig, for the program's end.
    pub(super) fn background(&self) -> Arc<Background> {
        Arc::clone(&self.background)
    }

    /// The files beside the sessions.
    pub(super) fn exchange(&self) -> Exchange {
        Exchange::of(self.host.store().data())
    }

    fn read(&self, id: &str) -> Result<Recording, Refusal> {
        self.host.store().read(id).map_err(|e| refused(&e))
    }

    pub(super) fn job_refused(&self, error: &JobError) -> Refusal {
        match error {
            JobError::Session(e) => refused(e),
            e => self.refusal(e.kind(), e),
        }
    }

    /// What a client is told; places on the disk stay here.
    pub(super) fn refusal(&self, kind: ErrorKind, error: &impl std::fmt::Display) -> Refusal {
        let kind = match kind {
            ErrorKind::Usage => RefusalKind::Invalid,
            ErrorKind::Busy => RefusalKind::Busy,
            ErrorKind::Absent => RefusalKind::NotFound,
            ErrorKind::Failed => RefusalKind::Failed,
        };
        Refusal::new(kind, self.places.hidden(&error.to_string()))
    }
}

impl Rig for LocalRig {
    fn start(&self, request: RunRequest) -> Result<RunStarted, Refusal> {
        let overrides = Value::Object(request.overrides.into_iter().collect());
        if let Some(key) = fixed().into_iter().find(|key| overrides.pointer(key).is_some()) {
            let key = key[1..].replace('/', ".");
            let message = format!("{key} is no setting of a run; set it in the daemon's configuration file");
            return Err(Refusal::new(RefusalKind::Invalid, message));
        }
        let Value::Object(overrides) = overrides else { unreachable!("it was made of an object") };
        let calibration = request.calibration.map(PathBuf::from);
        let options = CaptureOptions {
            name: request.session,
            views: request.views,
            calibration,
            ..CaptureOptions::default()
        };
        let session = self.host.start(&options, overrides).map_err(|e| self.job_refused(&e))?;
        Ok(RunStarted { session })
    }

    fn pause(&self) -> Result<(), Refusal> {
        self.host.pause().map_err(|e| self.job_refused(&e))
    }

    fn resume(&self) -> Result<(), Refusal> {
        self.host.resume().map_err(|e| self.job_refused(&e))
    }

    fn resume_session(&self, id: &str, quality: Option<QualityMode>) -> Result<RunStarted, Refusal> {
        let session = self.host.resume_session(id, quality).map_err(|e| self.job_refused(&e))?;
        Ok(RunStarted { session })
    }

    fn abort(&self) -> Result<(), Refusal> {
        self.host.abort().map_err(|e| self.job_refused(&e))
    }

    fn devices(&self) -> Result<Value, Refusal> {
        self.host.devices().map(|all| json!(all)).map_err(|e| self.job_refused(&e))
    }

    fn doctor(&self) -> Result<Value, Refusal> {
        let mut all = self.host.doctor().map_err(|e| self.job_refused(&e))?;
        for finding in &mut all {
            finding.found = self.places.hidden(&finding.found);
        }
        Ok(json!(all))
    }

    fn sessions(&self) -> Result<Value, Refusal> {
        let mut all: Vec<Summary> = self.host.store().list().map_err(|e| refused(&e))?;
        all.sort_by(|a, b| b.created.cmp(&a.created).then_with(|| a.name.cmp(&b.name)));
        for session in &mut all {
            session.damage = session.damage.as_deref().map(|damage| self.places.hidden(damage));
        }
        Ok(json!(all))
    }

    fn session(&self, id: &str) -> Result<Value, Refusal> {
        let mut about = self.read(id)?.about();
        // A folder may have been given another name.
        about["name"] = json!(id);
        Ok(about)
    }

    fn remove_session(&self, id: &str) -> Result<(), Refusal> {
        remove(&self.host.store(), id).map_err(|e| refused(&e))
    }

    fn frame(&self, id: &str, file: &str) -> Result<Download, Refusal> {
        let recording = self.read(id)?;
        let view = recording.views().find(|v| v.file == file).ok_or_else(|| absent(id, "frame", file))?;
        let frame = recording.frame(view.view).map_err(|e| damaged(id, "frame", file, &e))?;
        Ok(Download {
            content_type: frame.encoding.media_type(),
            sha256: view.sha256.clone(),
            content: Content::Bytes(frame.bytes),
        })
    }

    fn preview(&self, id: &str, file: &str, of_grain: bool) -> Result<Download, Refusal> {
        let recording = self.read(id)?;
        let view = recording.views().find(|v| v.file == file).ok_or_else(|| absent(id, "frame", file))?;
        let part = if of_grain { PreviewPart::Grain } else { PreviewPart::Whole };
        let made = self.previews.preview(&recording, view.view, part).map_err(|e| match e {
            JobError::Session(e) => damaged(id, "frame", file, &e),
            e => Refusal::new(RefusalKind::Failed, self.places.hidden(&e.to_string())),
        })?;
        let content = Content::Bytes(made.bytes.to_vec());
        Ok(Download { content_type: "image/jpeg", sha256: made.sha256, content })
    }

    fn rejected(&self, id: &str, view: usize) -> Result<Download, Refusal> {
        let frame = self.read(id)?.rejected(view).map_err(|e| refused(&e))?;
        let frame = frame.ok_or_else(|| absent(id, "refused picture of view", &view.to_string()))?;
        Ok(Download {
            content_type: frame.encoding.media_type(),
            sha256: sha256_hex(&frame.bytes),
            content: Content::Bytes(frame.bytes),
        })
    }

    fn product(&self, id: &str, file: &str) -> Result<Download, Refusal> {
        let recording = self.read(id)?;
        let product =
            recording.products().find(|p| p.file == file).ok_or_else(|| absent(id, "product", file))?;
        let (opened, bytes) = recording
            .product_file(&product.file, &self.hashes)
            .map_err(|e| damaged(id, "product", file, &e))?;
        let content_type = media_type(&product.file);
        Ok(Download {
            content_type,
            sha256: product.sha256.clone(),
            content: Content::File { file: opened, bytes },
        })
    }

    fn compute(&self, job: Job) -> Result<u64, Refusal> {
        self.background.compute(job, self.host.context()).map_err(|e| self.job_refused(&e))
    }

    fn job_result(&self, job: u64) -> Option<Value> {
        let text = self.background.result(job)?.to_string();
        serde_json::from_str(&self.places.hidden(&text)).ok()
    }

    fn cancel_job(&self, job: u64) -> Result<(), Refusal> {
        self.background.cancel(job).map_err(|e| self.refusal(e.kind(), &e))
    }

    fn events(&self) -> EventFeed {
        self.feed.clone()
    }
}

/// The media type of a product or another result, by its name's ending.
pub(super) fn media_type(file: &str) -> &'static str {
    if let Some(format) = Format::of(file) {
        return format.media_type;
    }
    match file.rsplit('.').next() {
        Some("json") => "application/json",
        Some("pvd") => "application/xml",
        Some("html") => "text/html; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("csv") => "text/csv; charset=utf-8",
        _ => "text/plain; charset=utf-8",
    }
}

fn absent(id: &str, what: &str, file: &str) -> Refusal {
    Refusal::new(
        RefusalKind::NotFound,
        format!("session {id} has no {what} of the name {file:?}; see its list"),
    )
}

/// What a client is told of a file that is not the one that was recorded; the cause stays in the log.
fn damaged(id: &str, what: &str, file: &str, error: &SessionError) -> Refusal {
    let heals = match what {
        "product" => format!("`grainrig replay {id}` writes it again"),
        _ => "restore it from a backup".to_owned(),
    };
    let message = format!("{what} {file} of session {id} is not as recorded, so it is not shown; {heals}");
    Refusal::new(RefusalKind::Failed, message).with_detail(error)
}

/// A session's error for a client: places on the disk stay in the log.
pub(super) fn refused(error: &SessionError) -> Refusal {
    match error {
        // It names the product and what writes it again, and no place on the disk.
        SessionError::Product { .. } => Refusal::new(RefusalKind::Failed, error.to_string()),
        SessionError::Name { .. } => Refusal::new(RefusalKind::Invalid, error.to_string()),
        SessionError::Needed { .. } => Refusal::new(RefusalKind::Busy, error.to_string()),
        SessionError::Locked { .. } => {
            Refusal::new(RefusalKind::Busy, "another job has the session; wait for its end")
                .with_detail(error)
        }
        SessionError::Exists { name, .. } => Refusal::new(
            RefusalKind::Invalid,
            format!("session {name:?} exists already; choose another name, or `grainrig resume {name}`"),
        ),
        SessionError::Absent { .. } => {
            Refusal::new(RefusalKind::NotFound, "there is no session of that name; see the list of sessions")
                .with_detail(error)
        }
        SessionError::DiskFull { needed, free, .. } => Refusal::new(
            RefusalKind::Disk,
            format!(
                "{needed} bytes are needed, {free} are free; delete old sessions or set another data folder"
            ),
        )
        .with_detail(error),
        SessionError::Io { source, .. } => Refusal::new(
            RefusalKind::Disk,
            format!("the data folder cannot be read or written: {source}; {}", crate::system::remedy(source)),
        )
        .with_detail(error),
        _ => Refusal::new(
            RefusalKind::Failed,
            "the session is damaged; `grainrig verify` names what is wrong with it",
        )
        .with_detail(error),
    }
}

/// Where the data folder is: known to whoever runs the daemon, and no client's business.
#[derive(Debug, Clone)]
pub(super) struct Places(Vec<String>);

impl Places {
    fn of(data: &Path) -> Self {
        let whole = [std::path::absolute(data).ok(), data.canonicalize().ok()];
        let below = |place: PathBuf| format!("{}/", place.to_string_lossy().trim_end_matches('/'));
        // A data folder that is the root would take every slash out of a text.
        Self(whole.into_iter().flatten().map(below).filter(|place| place != "/").collect())
    }

    /// The text with places below the data folder told from there on: `grain-7/journal.jsonl`.
    pub(super) fn hidden(&self, text: &str) -> String {
        self.0.iter().fold(text.to_owned(), |text, place| text.replace(place, ""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_served_with_their_formats_media_types() {
        for format in grainrig_core::formats::FORMATS {
            for ending in format.endings {
                assert_eq!(media_type(&format!("grain.{ending}")), format.media_type);
            }
        }
        assert_eq!(media_type("grain.stl"), "model/stl");
        assert_eq!(media_type("stage_01.vtu"), "application/xml");
        assert_eq!(media_type("abaqus.inp"), "text/plain; charset=utf-8");
        assert_eq!(media_type("curve.svg"), "image/svg+xml");
        assert_eq!(media_type("lock"), "text/plain; charset=utf-8");
    }
}
