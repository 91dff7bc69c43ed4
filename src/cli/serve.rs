//! `grainrig serve`.

use super::local_rig::LocalRig;
use super::output::say;
use super::signals::hangup_is_ignored;
use super::{Common, usage};
use crate::config::Config;
use crate::server::{ServeOptions, check_bind, serve};
use anyhow::{Context as _, Result, bail};
use clap::Args;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// How long a run that was told to stop may take: the view in hand, or what is left of a mesh.
const END_LIMIT: Duration = Duration::from_secs(10);

/// Files that may be open at once: all connections, and what is read for them.
const OPEN_FILES: u64 = 4096;

/// Options of `serve`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Address and port, instead of the configuration's (127.0.0.1:7272 unless told); port 0 takes a free
    /// one.
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
                "serve.listen is {:?}, it must be an address and a port such as 127.0.0.1:7272; change it in \
                 the configuration",
                settings.listen
            ))
        })?,
    };
    check_bind(address, settings.token.as_deref()).map_err(usage)?;
    more_files();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start the server")?;
    let outcome = runtime.block_on(listen(common, config, address));
    // What still reads a disk or waits for a rig does not hold up the end.
    runtime.shutdown_background();
    outcome
}

/// Asks for room for as many open files as connections and sessions may need, as far as the system's limit goes.
fn more_files() {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    let most = limit.maximum.unwrap_or(OPEN_FILES).min(OPEN_FILES);
    if limit.current.is_some_and(|now| now < most) {
        limit.current = Some(most);
        if let Err(error) = setrlimit(Resource::Nofile, limit) {
            tracing::warn!(%error, "the limit of open files stays as it is");
        }
    }
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
    let mut signals = Signals::listen().context("cannot listen for Ctrl-C")?;
    let monitor = monitor(listener.local_addr()?, options.token.is_some());
    let rig = Arc::new(LocalRig::new(&common.data, config));
    let (host, compressing, background) = (rig.host(), rig.compressing(), rig.background());
    if let Err(error) = rig.exchange().tidy() {
        tracing::warn!("what broken uploads have left is not removed: {error}");
    }
    say(format!(
        "the monitor is at {monitor} (Ctrl-C ends it); sessions are in {}; configuration: {}",
        common.data.display(),
        common.found()?
    ));

    for (session, name) in compressing.go_on() {
        say(format!("compression {name} of session {session} goes on from where the last program ended"));
    }

    let (stop, stopped) = tokio::sync::oneshot::channel();
    let mut served = pin!(serve(listener, rig, options, async {
        // An error means that the sender is gone, and with it the wish to serve.
        let _ = stopped.await;
    }));
    tokio::select! {
        served = &mut served => return Ok(served?),
        () = signals.next() => {}
    }
    let _ = stop.send(());
    let finished = tokio::task::spawn_blocking(move || {
        std::thread::scope(|scope| {
            // Both at once; a compression that needs longer has a checkpoint, and goes on from there. Another computation changes
            // nothing before its end.
            scope.spawn(|| background.finish(END_LIMIT));
            host.finish(END_LIMIT)
        })
    });
    tokio::select! {
        (served, finished) = async { tokio::join!(served, finished) } => {
            if !finished.context("cannot end the run")? {
                say(format!(
                    "the run was still computing after {} s; `grainrig resume` makes its products",
                    END_LIMIT.as_secs()
                ));
            }
            Ok(served?)
        }
        () = signals.next() => {
            bail!("ended at the second signal, in the middle of the run; `grainrig resume` goes on with it")
        }
    }
}

/// The page's address as this computer's browser opens it.
fn monitor(mut open: SocketAddr, has_token: bool) -> String {
    let elsewhere = if open.ip().is_unspecified() {
        open.set_ip(IpAddr::V4(Ipv4Addr::LOCALHOST));
        ", on other computers at this one's address"
    } else {
        ""
    };
    let query = if has_token { "?token=…" } else { "" };
    format!("http://{open}/{query}{elsewhere}")
}

/// Ctrl-C, the system's wish that the program end, and a terminal that was closed.
struct Signals {
    interrupt: Signal,
    terminate: Signal,
    /// `None` where whoever started the program wants it to outlive its terminal (`nohup`).
    hangup: Option<Signal>,
}

impl Signals {
    fn listen() -> std::io::Result<Self> {
        let hangup = if hangup_is_ignored() { None } else { Some(signal(SignalKind::hangup())?) };
        let (interrupt, terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
        Ok(Self { interrupt, terminate, hangup })
    }

    async fn next(&mut self) {
        let hung_up = async {
            match &mut self.hangup {
                Some(hangup) => hangup.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! { _ = self.interrupt.recv() => {}, _ = self.terminate.recv() => {}, _ = hung_up => {} }
    }
}
