//! The command line: a file per command; `--help` teaches.

mod calibrate;
mod capture;
mod compress;
mod devices;
mod doctor;
mod focus;
mod help;
mod import;
mod laws;
mod local_compressions;
mod local_rig;
mod merge;
mod mesh;
mod mesh_files;
mod next;
mod output;
mod progress;
mod reconstruct;
mod serve;
mod sessions;
mod signals;
mod study;
mod verify;

use crate::acquire::QualityMode;
use crate::config::Config;
use crate::daemon::ErrorKind;
use crate::session::Store;
use anyhow::Result;
use clap::{Args, Parser, Subcommand};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The version, with the drivers of cameras that were built in.
const VERSION: &str = match (cfg!(feature = "gphoto2"), cfg!(feature = "v4l")) {
    (true, true) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: gphoto2, v4l2)"),
    (true, false) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: gphoto2)"),
    (false, true) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: v4l2)"),
    (false, false) => concat!(env!("CARGO_PKG_VERSION"), " (built without drivers of cameras)"),
};

/// Turns a stepper, a camera and a sand grain into a numerical grain.
///
/// Without hardware everything runs on a simulated rig:
///
///   grainrig capture first-grain        25 views, hull, mesh, Abaqus input
///   grainrig replay first-grain         the same again from the recording, byte for byte
///   grainrig import photos --step-deg 7.2 --mm-per-px 0.0043
///   grainrig calibrate scale balls --ball-diameter-mm 2 --out scale.json
///   grainrig serve                      the monitor on <http://127.0.0.1:7272/>
#[derive(Debug, Parser)]
#[command(name = "grainrig", version = VERSION, verbatim_doc_comment)]
#[command(arg_required_else_help = true, after_help = help::ALL)]
pub struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

const COMMON: &str = "Common options";
/// Names the configuration where the command line does not.
const CONFIG_ENV: &str = "GRAINRIG_CONFIG";
/// The data folder, unless told.
const DATA: &str = "data";

/// Options that every command takes.
#[derive(Debug, Args)]
struct Common {
    /// Configuration (TOML) for a new session; without one, the simulated rig. config/simulated.toml shows
    /// every key with its unit and default.
    #[arg(long, global = true, value_name = "FILE", env = CONFIG_ENV, help_heading = COMMON)]
    config: Option<PathBuf>,
    /// Folder that holds the sessions.
    #[arg(long, global = true, value_name = "DIR", env = "GRAINRIG_DATA", default_value = DATA, help_heading = COMMON)]
    data: PathBuf,
    /// Take figures as they are that look like slips of unit (a pixel of 4.3 mm, a modulus of 100 MPa); the result says so.
    #[arg(long, global = true, help_heading = COMMON)]
    as_given: bool,
    /// Print one result object (JSON) on stdout; progress and logs stay on stderr.
    #[arg(long, global = true, help_heading = COMMON)]
    json: bool,
}

impl Common {
    fn config(&self) -> Result<Config> {
        let mut config = self.config.as_deref().map_or_else(|| Ok(Config::default()), Config::read)?;
        config.as_given |= self.as_given;
        config.check()?;
        Ok(config)
    }

    fn store(&self) -> Store {
        Store::new(&self.data)
    }

    /// A recorded session keeps the configuration that it was made with: who gives another is told.
    fn without_config(&self) {
        let of_the_shell = std::env::var_os(CONFIG_ENV).map(PathBuf::from);
        // Whoever has set it for all commands need not hear of it at each.
        if let Some(path) = self.config.as_ref().filter(|path| of_the_shell.as_ref() != Some(path)) {
            output::say(format!(
                "note: --config {} is not used: a session keeps the configuration that it was made with",
                path.display()
            ));
        }
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Serve the monitor and the HTTP interface until Ctrl-C.
    #[command(after_help = help::SERVE)]
    Serve(serve::Arguments),
    /// Capture a grain on the rig: turn, photograph, carve, mesh, write.
    #[command(after_help = help::CAPTURE)]
    Capture(capture::Arguments),
    /// Go on with an interrupted session: capture the missing views, compute what is not computed.
    #[command(after_help = help::RESUME)]
    Resume(capture::ResumeArguments),
    /// Run a recorded session again, without the rig: the same way through the program, the same bytes.
    #[command(after_help = help::REPLAY)]
    Replay(reconstruct::ReplayArguments),
    /// Take in a folder of photographs and reconstruct the object.
    #[command(after_help = help::IMPORT)]
    Import(import::Arguments),
    /// Compute hull and mesh of a session again, with other settings if wanted.
    #[command(after_help = help::RECONSTRUCT)]
    Reconstruct(reconstruct::Arguments),
    /// Fill a closed surface (STL) or a session's hull with tetrahedra.
    #[command(after_help = help::MESH)]
    Mesh(mesh::Arguments),
    /// Put two captures of one grain, another side down in the second, together to one closer hull and mesh.
    #[command(after_help = help::MERGE)]
    Merge(merge::Arguments),
    /// Press a grain between two rigid plates: force against displacement, by explicit dynamics.
    #[command(after_help = help::COMPRESS)]
    Compress(compress::Arguments),
    /// List the sessions of the data folder, the newest first.
    List,
    /// Show what there is to know of a session: how far it has come, its figures, its files.
    Show(sessions::ShowArguments),
    /// Remove sessions, with their pictures and everything computed from them.
    #[command(after_help = help::RM)]
    Rm(sessions::RemoveArguments),
    /// Check every file of a session against the hashes in its journal.
    #[command(after_help = help::VERIFY)]
    Verify(verify::Arguments),
    /// Measure what the rig's geometry hangs on.
    Calibrate(calibrate::Arguments),
    /// Study the method on bodies of known volume.
    Study(study::Arguments),
    /// Show which devices are there, whether they may be opened, and who holds them.
    Devices,
    /// Look at everything that a run needs, and say what to do about what is wrong. The stage makes a step and comes back, the
    /// camera takes a picture, which is not kept.
    Doctor,
    /// Show what is before the camera, and how sharp it is, to focus by: live view of a DSLR, frames of a video camera.
    #[command(after_help = help::FOCUS)]
    Focus(focus::Arguments),
    /// The process in which a DSLR is driven; started by this program.
    #[command(hide = true)]
    CameraWorker,
}

/// What becomes of a picture that is no good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Quality {
    /// Take it again; where that does not help, suspend the run.
    Gate,
    /// Keep it and say so in the result.
    Label,
    /// Do not look.
    Off,
}

impl From<Quality> for QualityMode {
    fn from(quality: Quality) -> Self {
        match quality {
            Quality::Gate => Self::Gate,
            Quality::Label => Self::Label,
            Quality::Off => Self::Off,
        }
    }
}

/// Parses the command line and runs one command; 0 is success, 1 failure, 2 usage.
pub fn run() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| {
        if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
            output::print_error(ErrorKind::Usage, error.render().to_string().trim_end());
        }
        error.exit()
    });
    if let Command::CameraWorker = cli.command {
        return crate::rig::gphoto::worker::run();
    }
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_env("GRAINRIG_LOG")
                .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn")),
        )
        .with_writer(std::io::stderr)
        // Colours are for eyes: a file or a service's journal would keep their codes.
        .with_ansi(std::io::stderr().is_terminal())
        // A log that nobody can read any more must not end the job.
        .log_internal_errors(false)
        .init();
    if let Err(error) = enough_files() {
        output::say(format!("error: {error}"));
        return ExitCode::FAILURE;
    }
    signals::survive_file_limit();
    let common = &cli.common;
    if !matches!(
        cli.command,
        Command::Serve(_)
            | Command::Capture(_)
            | Command::Import(_)
            | Command::Calibrate(_)
            | Command::Study(_)
            | Command::Devices
            | Command::Doctor
            | Command::Focus(_)
    ) {
        common.without_config();
    }
    let outcome = match cli.command {
        Command::Serve(a) => serve::run(common, &a),
        Command::Capture(a) => capture::run(common, &a),
        Command::Resume(a) => capture::resume(common, &a),
        Command::Replay(a) => reconstruct::replay(common, &a),
        Command::Import(a) => import::run(common, a),
        Command::Reconstruct(a) => reconstruct::run(common, &a),
        Command::Mesh(a) => mesh::run(common, &a),
        Command::Merge(a) => merge::run(common, &a),
        Command::Compress(a) => compress::run(common, &a),
        Command::List => sessions::list(common),
        Command::Show(a) => sessions::show(common, &a),
        Command::Rm(a) => sessions::rm(common, &a),
        Command::Verify(a) => verify::run(common, &a),
        Command::Calibrate(a) => calibrate::run(common, a),
        Command::Study(a) => study::run(common, &a),
        Command::Devices => devices::run(common),
        Command::Doctor => doctor::run(common),
        Command::Focus(a) => focus::run(common, &a),
        Command::CameraWorker => Ok(()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let text = told(&error);
            output::say(format!("error: {text}"));
            let kind = kind(&error);
            if common.json {
                output::print_error(kind, &text);
            }
            ExitCode::from(if kind == ErrorKind::Usage { 2 } else { 1 })
        }
    }
}

/// Whether the program may open as many files as it takes to begin: listening to signals takes some, before anything can
/// fail in an orderly way.
fn enough_files() -> Result<()> {
    const LEAST: u64 = 10;
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    match most.filter(|most| *most < LEAST) {
        Some(most) => anyhow::bail!(
            "this program may have {most} files open, too few to begin with {LEAST}: raise the limit (`ulimit -n`, of a \
             service `LimitNOFILE=`)"
        ),
        None => Ok(()),
    }
}

/// An error with its causes, each once: most messages hold their cause's words already.
fn told(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// An error in what was asked, not in what was done: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// What is at fault: the command line or the configuration where any cause says so.
fn kind(error: &anyhow::Error) -> ErrorKind {
    let of = |cause: &(dyn std::error::Error + 'static)| {
        if cause.is::<Usage>() { Some(ErrorKind::Usage) } else { ErrorKind::of(cause) }
    };
    let known: Vec<ErrorKind> = error.chain().filter_map(of).collect();
    let usage = known.iter().find(|kind| **kind == ErrorKind::Usage);
    *usage.or(known.first()).unwrap_or(&ErrorKind::Failed)
}

/// Marks an error as one of usage.
fn usage(error: impl std::fmt::Display) -> anyhow::Error {
    Usage(error.to_string()).into()
}

/// The folder of a session: a plain name is looked for in the data folder first; anything else is a folder's
/// path.
fn session_folder(common: &Common, given: &Path) -> Result<PathBuf> {
    match common.store().folder(given.to_str().unwrap_or("")) {
        Ok(folder) if folder.exists() || !given.join("manifest.json").is_file() => Ok(folder),
        Err(error) if !given.is_dir() => Err(error.into()),
        // A link that a person names is that person's own; below it none is followed.
        _ if given.is_symlink() => Ok(given.canonicalize()?),
        _ => Ok(given.to_owned()),
    }
}
