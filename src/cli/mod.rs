//! The command line: a file per command; `--help` teaches.

mod capture;
mod devices;
mod import;
mod local_rig;
mod mesh;
mod progress;
mod reconstruct;
mod serve;
mod verify;

use crate::config::{Config, ConfigError};
use crate::daemon::DaemonError;
use crate::session::SessionError;
use anyhow::{Context as _, Result};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// Turns a stepper, a camera and a sand grain into a numerical grain.
///
/// Without hardware everything runs on a simulated rig:
///
///   grainrig capture first-grain        25 views, hull, mesh, Abaqus input
///   grainrig replay first-grain         the same again from the recording, byte for byte
///   grainrig import photos --step-deg 7.2 --mm-per-px 0.0043
///   grainrig serve                      the monitor on <http://127.0.0.1:7272/>
#[derive(Debug, Parser)]
#[command(name = "grainrig", version, verbatim_doc_comment, arg_required_else_help = true)]
pub struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Options that every command takes.
#[derive(Debug, Args)]
struct Common {
    /// Configuration (TOML); the defaults are the simulated rig's, see `config/`.
    #[arg(long, global = true, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder that holds the sessions.
    #[arg(long, global = true, value_name = "DIR", default_value = "data")]
    data: PathBuf,
    /// Print one result object (JSON) on stdout; progress and logs stay on stderr.
    #[arg(long, global = true)]
    json: bool,
}

impl Common {
    fn config(&self) -> Result<Config> {
        let config = self.config.as_deref().map_or_else(|| Ok(Config::default()), Config::read)?;
        config.check()?;
        Ok(config)
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Serve the monitor and the HTTP interface until Ctrl-C.
    Serve(serve::Arguments),
    /// Capture a grain on the rig: turn, photograph, carve, mesh, write.
    Capture(capture::Arguments),
    /// Go on with an interrupted session from its journal.
    Resume(capture::ResumeArguments),
    /// Run a recorded session again, without the rig: the same way through the program, the same bytes.
    Replay(reconstruct::ReplayArguments),
    /// Take in a folder of photographs and reconstruct the object.
    Import(import::Arguments),
    /// Compute hull and mesh of a session again, with other settings if wanted.
    Reconstruct(reconstruct::Arguments),
    /// Fill a closed surface (STL) or a session's hull with tetrahedra.
    Mesh(mesh::Arguments),
    /// Check every file of a session against the hashes in its journal.
    Verify(verify::Arguments),
    /// Show which devices are there.
    Devices,
}

/// Parses the command line and runs one command; 0 is success, 1 failure, 2 usage.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_env("GRAINRIG_LOG")
                .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn")),
        )
        .with_writer(std::io::stderr)
        .init();
    let common = &cli.common;
    let outcome = match cli.command {
        Command::Serve(a) => serve::run(common, &a),
        Command::Capture(a) => capture::run(common, &a),
        Command::Resume(a) => capture::resume(common, &a),
        Command::Replay(a) => reconstruct::replay(common, &a),
        Command::Import(a) => import::run(common, a),
        Command::Reconstruct(a) => reconstruct::run(common, &a),
        Command::Mesh(a) => mesh::run(common, &a),
        Command::Verify(a) => verify::run(common, &a),
        Command::Devices => devices::run(common),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(if is_usage(&error) { 2 } else { 1 })
        }
    }
}

/// An error in what was asked, not in what was done: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// Whether the command line or the configuration is at fault, rather than what was found or done.
fn is_usage(error: &anyhow::Error) -> bool {
    let session = |e: &SessionError| matches!(e, SessionError::Name { .. } | SessionError::Setting { .. });
    error.chain().any(|cause| {
        cause.is::<Usage>()
            || cause.is::<ConfigError>()
            || cause.downcast_ref::<SessionError>().is_some_and(session)
            || match cause.downcast_ref::<DaemonError>() {
                Some(DaemonError::Config(_)) => true,
                Some(DaemonError::Session(e)) => session(e),
                _ => false,
            }
    })
}

/// Marks an error as one of usage.
fn usage(error: impl std::fmt::Display) -> anyhow::Error {
    Usage(error.to_string()).into()
}

/// Prints the one result object on stdout.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    use std::io::Write as _;
    let text = serde_json::to_string_pretty(value).context("cannot encode the result")?;
    writeln!(std::io::stdout(), "{text}").context("cannot write to standard output")
}

/// The folder of a session given by its name in the data folder, or by its path.
fn session_folder(common: &Common, given: &std::path::Path) -> Result<PathBuf> {
    if given.join("manifest.json").is_file() {
        return Ok(given.to_owned());
    }
    let name = given.to_str().unwrap_or("");
    Ok(crate::session::Store::new(&common.data).folder(name)?)
}
