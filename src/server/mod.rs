//! The HTTP server: an API to watch and drive the rig, a stream of events, and the monitor page.
//!
//! ```text
//!  connection ─▶ guard ─▶ routes ─▶ Rig (the daemon)
//!   places,       Host,     │  ▲
//!   idle limit    Origin,   │  └── refusal → error: kind and message out, detail to the log
//!                 token     └────▶ feed ─▶ server-sent events
//! ```
//!
//! It is for one laboratory: loopback by default, one token beyond it, no TLS (put a proxy or an SSH
//! tunnel before it on a network that others use).

mod assets;
mod compressing;
mod connection;
mod download;
mod error;
mod feed;
mod files;
mod guard;
mod guesses;
mod jobs;
mod openapi;
mod places;
mod routes;
mod schemas;
mod status;
mod stream;

use std::collections::BTreeMap;
use std::future::Future;
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use crate::acquire::QualityMode;
use crate::jobs::Job;
use serde::{Deserialize, Serialize};
use tokio::net::TcpListener;
use tokio::sync::watch;
use utoipa::ToSchema;

pub use compressing::{CompressionStarted, CompressionStatus, Compressions};
pub use download::{Content, Download};
pub use error::{ErrorBody, ErrorText, Refusal, RefusalKind, ServerError};
pub use feed::{EventFeed, KEPT_EVENTS, Snapshot, Subscription};
pub use files::{Files, Upload};
pub use guard::{MIN_TOKEN_LENGTH, check_bind};
pub use jobs::JobStarted;
pub use status::{HullPoint, RejectedPicture, RunState, Stage, Status, ViewVerdict, ViewWarning};

/// How long open requests may take after the end was asked for.
const GRACE: Duration = Duration::from_secs(5);

/// What the server drives. Its methods may block for a moment (they are called off the async threads),
/// but not for the length of a run.
pub trait Rig: Compressions + Files {
    /// Where the run stands, at least as a [`Status`]; more may be added to it.
    fn status(&self) -> serde_json::Value {
        serde_json::json!(self.events().status())
    }

    /// Begins a run and returns when it is certain that there will be one.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] while another run goes on, [`RefusalKind::Invalid`] for a name or an
    /// override that makes no sense, [`RefusalKind::Disk`] where the session cannot be made.
    fn start(&self, request: RunRequest) -> Result<RunStarted, Refusal>;

    /// Pauses the run after the view being taken.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] when nothing runs that can be paused.
    fn pause(&self) -> Result<(), Refusal>;

    /// Lets a paused run go on.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] when no run is paused.
    fn resume(&self) -> Result<(), Refusal>;

    /// Goes on with a session that was aborted, interrupted or has failed, and returns when it is certain that there
    /// will be a run.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] while another run goes on or where nothing is left to do, [`RefusalKind::NotFound`] where
    /// there is no such session.
    fn resume_session(&self, id: &str, quality: Option<QualityMode>) -> Result<RunStarted, Refusal>;

    /// Stops the run; what was captured stays.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] when there is none.
    fn abort(&self) -> Result<(), Refusal>;

    /// The devices that are there: a JSON array of objects.
    ///
    /// # Errors
    /// [`RefusalKind::Failed`] where they can't be listed.
    fn devices(&self) -> Result<serde_json::Value, Refusal>;

    /// Looks at everything that a run needs: a JSON array of findings with `check`, `health`, `found` and `remedy`.
    ///
    /// # Errors
    /// [`RefusalKind::Busy`] while a run goes on.
    fn doctor(&self) -> Result<serde_json::Value, Refusal>;

    /// The sessions in the data folder: a JSON array of objects with at least `name`; the page also shows
    /// `created`, `captured`, `planned`, `state` and `damage` where they are there.
    ///
    /// # Errors
    /// [`RefusalKind::Disk`] when the folder cannot be read.
    fn sessions(&self) -> Result<serde_json::Value, Refusal>;

    /// One session: a JSON object; the page shows the `file` of each object in its arrays `frames` and
    /// `products`.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] when there is none of that name.
    fn session(&self, id: &str) -> Result<serde_json::Value, Refusal>;

    /// Removes a session with everything in its folder.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] where there is none of that name, [`RefusalKind::Busy`] while somebody writes it or needs it.
    fn remove_session(&self, id: &str) -> Result<(), Refusal>;

    /// A captured picture. `file` comes from the network: look it up in the session's own list, never join
    /// it to a path.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] when the session does not list it.
    fn frame(&self, id: &str, file: &str) -> Result<Download, Refusal>;

    /// A captured picture made small for a screen; as for [`Rig::frame`]. `of_grain` asks for the grain and
    /// what is near it rather than the whole picture.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] when the session does not list it.
    fn preview(&self, id: &str, file: &str, of_grain: bool) -> Result<Download, Refusal>;

    /// The last picture of a view that was refused.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] where none was, or none is kept.
    fn rejected(&self, id: &str, view: usize) -> Result<Download, Refusal>;

    /// A product; as for [`Rig::frame`].
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] when the session does not list it.
    fn product(&self, id: &str, file: &str) -> Result<Download, Refusal>;

    /// Begins a job beside the rig, or lets it wait; its number.
    ///
    /// # Errors
    /// [`RefusalKind::Invalid`] for what makes no sense, [`RefusalKind::NotFound`] where there is no such session,
    /// [`RefusalKind::Busy`] where too many wait.
    fn compute(&self, job: Job) -> Result<u64, Refusal>;

    /// What a job came to: what the command line prints for it under `--json`; `None` before its end and once it is long ago.
    fn job_result(&self, job: u64) -> Option<serde_json::Value>;

    /// Takes a waiting computation out of the queue, or stops the one that goes on.
    ///
    /// # Errors
    /// [`RefusalKind::NotFound`] where there is none of this number, [`RefusalKind::Busy`] where it can't be stopped.
    fn cancel_job(&self, job: u64) -> Result<(), Refusal>;

    /// The feed into which the rig pushes what happens.
    fn events(&self) -> EventFeed;
}

/// A run to begin.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize, ToSchema)]
#[schema(example = json!({ "session": "leighton-buzzard-07", "plan": { "views": 25 } }))]
pub struct RunRequest {
    /// Name of the session: 1 to 64 letters, digits, `.`, `_` or `-`, beginning with a letter or a digit, without `..`;
    /// `name` is understood as well.
    #[serde(alias = "name")]
    #[schema(min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    pub session: String,
    /// Number of views over half a turn, instead of the configuration's; the step between them follows from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub views: Option<u32>,
    /// A file of a measured scale (`calibrate_scale`), whose pixel and camera distance are taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Settings that differ from the daemon's configuration for this run, by their name in it. The rig
    /// refuses those it does not know.
    #[serde(flatten)]
    pub overrides: BTreeMap<String, serde_json::Value>,
}

/// A run that has begun.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct RunStarted {
    /// Name of its session.
    pub session: String,
}

/// How to serve.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// What a client must show; needed off loopback.
    pub token: Option<String>,
    /// Names, beside loopback's, by which a browser may open the page: a proxy's or the machine's own.
    pub allowed_hosts: Vec<String>,
    /// A connection to which nothing could be written for this long is closed.
    pub idle_limit: Duration,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self { token: None, allowed_hosts: Vec::new(), idle_limit: Duration::from_secs(30) }
    }
}

/// Serves the rig on `listener` until `shutdown`, then ends the event streams, lets open requests finish
/// for up to 5 s, and returns.
///
/// # Errors
/// What [`check_bind`] says of the listener's address and the token, and failures of the listener.
pub async fn serve(
    listener: TcpListener,
    rig: Arc<dyn Rig>,
    options: ServeOptions,
    shutdown: impl Future<Output = ()>,
) -> io::Result<()> {
    let address = listener.local_addr()?;
    let token = options.token.as_deref();
    check_bind(address, token).map_err(io::Error::other)?;
    let (stop, stopping) = watch::channel(false);
    let app = routes::App {
        rig,
        guard: Arc::new(guard::Guard::new(address, token, &options.allowed_hosts)),
        stopping: stopping.clone(),
        // Twice in the limit, so that a silent event stream is not taken for an idle connection.
        keep_alive: options.idle_limit / 2,
    };
    let doorkeeper = connection::Doorkeeper::new(listener, options.idle_limit);
    let stopped = async move {
        let mut stopping = stopping;
        // An error means that the sender is gone, and with it this server.
        let _ = stopping.wait_for(|stopping| *stopping).await;
    };
    let server =
        axum::serve(doorkeeper, routes::router(app).into_make_service_with_connect_info::<places::Ticket>())
            .with_graceful_shutdown(stopped);
    let mut server = pin!(server.into_future());
    tokio::select! {
        ended = &mut server => return ended,
        () = shutdown => {}
    }
    stop.send_replace(true);
    tokio::time::timeout(GRACE, server).await.unwrap_or_else(|_| {
        tracing::warn!(grace_s = GRACE.as_secs(), "connections were still open at the end");
        Ok(())
    })
}
