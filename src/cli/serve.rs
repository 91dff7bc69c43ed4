//! `grainrig serve`.

use super::{Common, usage};
use crate::config::Config;
use crate::daemon::{DaemonError, Host, HostError, Watcher};
use crate::server::{
    EventFeed, KEPT_EVENTS, Refusal, RefusalKind, Rig, RunRequest, RunStarted, ServeOptions, check_bind,
    serve,
};
use crate::session::event::Event;
use crate::session::{Recording, SessionError, Summary};
use anyhow::{Context as _, Result};
use clap::Args;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;

/// Options of `serve`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Address and port, instead of the configuration's (127.0.0.1:7272 unless told); port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let config = common.config()?;
    let settings = config.serve.clone();
    let address = match arguments.listen {
        Some(address) => address,
        None => settings.listen.parse::<SocketAddr>().map_err(|_| {
            usage(format!(
                "serve.listen is {:?}, it must be an address and a port such as 127.0.0.1:7272; change it in the \
                 configuration",
                settings.listen
            ))
        })?,
    };
    check_bind(address, settings.token.as_deref()).map_err(usage)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start the server")?;
    runtime.block_on(listen(common, config, address))
}

async fn listen(common: &Common, config: Config, address: SocketAddr) -> Result<()> {
    let listener = tokio::net::TcpListener::bind(address).await.with_context(|| {
        format!(
            "cannot listen on {address}; stop the program that has the port, or choose another with --listen"
        )
    })?;
    let options = ServeOptions {
        token: config.serve.token.clone(),
        allowed_hosts: config.serve.allowed_hosts.clone(),
        ..ServeOptions::default()
    };
    let rig = Arc::new(LocalRig::new(&common.data, config));
    let (open, query) = (listener.local_addr()?, options.token.as_ref().map_or("", |_| "?token=…"));
    super::output::say(format!(
        "the monitor is at http://{open}/{query} (Ctrl-C ends it); sessions are in {}",
        common.data.display()
    ));
    let served = serve(listener, rig.clone(), options, stopped()).await;
    // The run's view in hand is finished; `resume` goes on from there.
    tokio::task::spawn_blocking(move || rig.host.finish()).await.context("cannot end the run")?;
    Ok(served?)
}

/// Resolves at Ctrl-C, or when the system asks the program to end.
async fn stopped() {
    use tokio::signal::unix::{SignalKind, signal};
    let interrupt = tokio::signal::ctrl_c();
    match signal(SignalKind::terminate()) {
        Ok(mut terminate) => {
            tokio::select! { _ = interrupt => {}, _ = terminate.recv() => {} }
        }
        Err(_) => {
            let _ = interrupt.await;
        }
    }
}

/// The host as the server sees it.
struct LocalRig {
    host: Host,
    feed: EventFeed,
}

impl LocalRig {
    fn new(data: &Path, config: Config) -> Self {
        // Numbers go on across a restart, and stay below 2^53.
        let seconds = u64::try_from(jiff::Timestamp::now().as_second()).unwrap_or(1).max(1);
        let feed = EventFeed::new(seconds * 1_000_000, KEPT_EVENTS);
        let push = feed.clone();
        let watcher: Watcher = Arc::new(move |event: &Event| {
            push.push(event.what.clone(), event.time);
        });
        Self { host: Host::new(data.to_owned(), config, watcher), feed }
    }

    fn read(&self, id: &str) -> Result<Recording, Refusal> {
        self.host.store().read(id).map_err(|e| refused(&e))
    }
}

impl Rig for LocalRig {
    fn start(&self, request: RunRequest) -> Result<RunStarted, Refusal> {
        let overrides = request.overrides.into_iter().collect();
        let session = self.host.start(&request.name, overrides).map_err(|e| host_refused(&e))?;
        Ok(RunStarted { session })
    }

    fn pause(&self) -> Result<(), Refusal> {
        self.host.pause().map_err(|e| host_refused(&e))
    }

    fn resume(&self) -> Result<(), Refusal> {
        self.host.resume().map_err(|e| host_refused(&e))
    }

    fn abort(&self) -> Result<(), Refusal> {
        self.host.abort().map_err(|e| host_refused(&e))
    }

    fn sessions(&self) -> Result<Value, Refusal> {
        let mut all: Vec<Summary> = self.host.store().list().map_err(|e| refused(&e))?;
        all.sort_by(|a, b| b.created.cmp(&a.created).then_with(|| a.name.cmp(&b.name)));
        Ok(json!(all))
    }

    fn session(&self, id: &str) -> Result<Value, Refusal> {
        let recording = self.read(id)?;
        let manifest = recording.manifest();
        Ok(json!({
            "name": id,
            "created": manifest.created,
            "software": manifest.software,
            "origin": manifest.origin,
            "devices": manifest.devices,
            "state": recording.state(),
            "plan": manifest.plan,
            "config": manifest.config,
            "frames": recording.views().collect::<Vec<_>>(),
            "products": recording.products().collect::<Vec<_>>(),
            "result": recording.result(),
        }))
    }

    fn frame(&self, id: &str, file: &str) -> Result<(Vec<u8>, &'static str), Refusal> {
        let recording = self.read(id)?;
        let view = recording.views().find(|v| v.file == file).ok_or_else(|| absent(id, "frame", file))?;
        let frame = recording.frame(view.view).map_err(|e| refused(&e))?;
        Ok((frame.bytes, frame.encoding.media_type()))
    }

    fn product(&self, id: &str, file: &str) -> Result<(Vec<u8>, &'static str), Refusal> {
        let recording = self.read(id)?;
        let product =
            recording.products().find(|p| p.file == file).ok_or_else(|| absent(id, "product", file))?;
        let path = recording.product_path(&product.file).map_err(|e| refused(&e))?;
        let bytes = std::fs::read(&path).map_err(|e| {
            let message =
                format!("product {file} of session {id} cannot be read; run `grainrig verify {id}`");
            Refusal::new(RefusalKind::Failed, message).with_detail(e)
        })?;
        let kind = match file.rsplit('.').next() {
            Some("json") => "application/json",
            Some("stl") => "model/stl",
            Some("vtu") => "application/xml",
            _ => "text/plain; charset=utf-8",
        };
        Ok((bytes, kind))
    }

    fn events(&self) -> EventFeed {
        self.feed.clone()
    }
}

fn absent(id: &str, what: &str, file: &str) -> Refusal {
    Refusal::new(
        RefusalKind::NotFound,
        format!("session {id} has no {what} of the name {file:?}; see its list"),
    )
}

fn host_refused(error: &HostError) -> Refusal {
    match error {
        HostError::Busy(_) | HostError::NotNow(_) => Refusal::new(RefusalKind::Busy, error.to_string()),
        HostError::Config(_) => Refusal::new(RefusalKind::Invalid, error.to_string()),
        HostError::Daemon(DaemonError::Session(e)) => refused(e),
        HostError::Daemon(DaemonError::Config(_) | DaemonError::Acquire(_)) => {
            Refusal::new(RefusalKind::Invalid, error.to_string())
        }
        HostError::Daemon(_) => Refusal::new(RefusalKind::Failed, error.to_string()),
    }
}

/// A session's error for a client: places on the disk stay in the log.
fn refused(error: &SessionError) -> Refusal {
    match error {
        SessionError::Name { .. } => Refusal::new(RefusalKind::Invalid, error.to_string()),
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
        SessionError::Io { .. } => Refusal::new(
            RefusalKind::Disk,
            "the data folder cannot be read or written; the daemon's log has the reason",
        )
        .with_detail(error),
        _ => Refusal::new(
            RefusalKind::Failed,
            "the session is damaged; `grainrig verify` names what is wrong with it",
        )
        .with_detail(error),
    }
}
