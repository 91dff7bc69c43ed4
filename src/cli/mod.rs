//! The command line: a file per command; `--help` teaches.

mod about;
mod calibrate;
mod capture;
mod compress;
mod config;
mod devices;
mod doctor;
mod focus;
mod help;
mod import;
mod local_compressions;
mod local_files;
mod local_rig;
mod logging;
mod merge;
mod mesh;
mod next;
mod output;
mod progress;
mod reconstruct;
mod rests;
mod serve;
mod sessions;
mod shell;
mod signals;
mod study;
mod verify;

use crate::config::{Config, Found, Place, usual_places};
use crate::jobs::{
    CaptureOptions, Context, ErrorKind, ImportOptions, MergeOptions, MeshOptions, Names, ReconstructOptions,
    ReplayOptions, RestsOptions, ResumeOptions, VerifyOptions,
};
use crate::session::Store;
use anyhow::Result;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use logging::LogFormat;
use progress::Progress;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

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
#[command(name = "grainrig", version = about::SHORT.as_str(), long_version = about::LONG.as_str(), verbatim_doc_comment)]
#[command(arg_required_else_help = true, after_help = help::ALL)]
pub struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

impl Cli {
    fn of(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut cli = Self::from_arg_matches(matches)?;
        cli.common.config_by = matches.value_source("config");
        cli.common.data_by = matches.value_source("data");
        Ok(cli)
    }
}

const COMMON: &str = "Common options";
/// Names the configuration where the command line does not.
const CONFIG_ENV: &str = "GRAINRIG_CONFIG";
/// Names the data folder where the command line does not.
const DATA_ENV: &str = "GRAINRIG_DATA";
/// The data folder, unless told.
const DATA: &str = "data";

/// Options that every command takes.
#[derive(Debug, Args)]
struct Common {
    /// Configuration (TOML) for a new session. Without it the first that is there of `$XDG_CONFIG_HOME/grainrig/config.toml`
    /// (`~/.config` where that is not set) and `/etc/grainrig/config.toml`, else the simulated rig. `grainrig config
    /// --default` shows every key with its unit and default.
    #[arg(long, global = true, value_name = "FILE", env = CONFIG_ENV, help_heading = COMMON)]
    config: Option<PathBuf>,
    /// Folder that holds the sessions.
    #[arg(long, global = true, value_name = "DIR", env = DATA_ENV, default_value = DATA, help_heading = COMMON)]
    data: PathBuf,
    /// Take figures as they are that look like slips of unit (a pixel of 4.3 mm, a modulus of 100 MPa); the result says so.
    #[arg(long, global = true, help_heading = COMMON)]
    as_given: bool,
    /// Print one result object (JSON) on stdout; progress and logs stay on stderr.
    #[arg(long, global = true, help_heading = COMMON)]
    json: bool,
    /// The form of what goes to standard error: `text`, or `json`, an object a line.
    #[arg(
        long, global = true, value_enum, value_name = "FORMAT", env = logging::FORMAT_ENV, default_value = "text",
        help_heading = COMMON
    )]
    log_format: LogFormat,
    /// What named the configuration.
    #[arg(skip)]
    config_by: Option<ValueSource>,
    /// What named the data folder.
    #[arg(skip)]
    data_by: Option<ValueSource>,
}

impl Common {
    /// Which configuration is to be used.
    fn found(&self) -> Result<Found> {
        let by =
            if self.config_by == Some(ValueSource::EnvVariable) { Place::Environment } else { Place::Flag };
        let usual = usual_places(std::env::var_os("XDG_CONFIG_HOME"), std::env::var_os("HOME"));
        let found = Found::of(self.config.clone().map(|path| (by, path)), usual)?;
        tracing::debug!("the configuration is {found}");
        Ok(found)
    }

    fn config(&self) -> Result<Config> {
        let mut config = self.found()?.read()?;
        config.as_given |= self.as_given;
        config.check()?;
        Ok(config)
    }

    /// A folder that nobody named is made by the first capture; one that was named and is not there is a slip.
    fn named_data_is_there(&self) -> Result<()> {
        let is_named = self.data_by.is_some_and(|by| by != ValueSource::DefaultValue);
        let is_absent = || self.data.try_exists().is_ok_and(|there| !there);
        if is_named && is_absent() {
            return Err(usage(format!(
                "there is no data folder {}; check what --data or {DATA_ENV} says, or make it by `grainrig capture NAME`",
                self.data.display()
            )));
        }
        Ok(())
    }

    fn store(&self) -> Store {
        Store::new(&self.data)
    }

    fn names(&self) -> Names {
        Names::Anywhere(self.store())
    }

    /// What a job has that makes no session.
    fn context(&self, progress: &Progress) -> Context {
        Context {
            names: self.names(),
            config: Config::default(),
            as_given: self.as_given,
            watcher: progress.watcher(),
            stop: Arc::default(),
        }
    }

    /// What a job has that makes a session.
    fn configured(&self, progress: &Progress) -> Result<Context> {
        Ok(Context { config: self.config()?, ..self.context(progress) })
    }

    /// A recorded session keeps the configuration that it was made with: who gives another is told.
    fn without_config(&self) {
        // Whoever has set it for all commands need not hear of it at each.
        if let Some(path) = self.config.as_ref().filter(|_| self.config_by == Some(ValueSource::CommandLine))
        {
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
    Capture(CaptureOptions),
    /// Go on with an interrupted session: capture the missing views, compute what is not computed.
    #[command(after_help = help::RESUME)]
    Resume(ResumeOptions),
    /// Run a recorded session again, without the rig: the same way through the program, the same bytes.
    #[command(after_help = help::REPLAY)]
    Replay(ReplayOptions),
    /// Take in a folder of photographs and reconstruct the object.
    #[command(after_help = help::IMPORT)]
    Import(ImportOptions),
    /// Compute hull and mesh of a session again, with other settings if wanted.
    #[command(after_help = help::RECONSTRUCT)]
    Reconstruct(ReconstructOptions),
    /// Fill a closed surface (STL) or a session's hull with tetrahedra.
    #[command(after_help = help::MESH)]
    Mesh(MeshOptions),
    /// Put two captures of one grain, another side down in the second, together to one closer hull and mesh.
    #[command(after_help = help::MERGE)]
    Merge(MergeOptions),
    /// Press a grain between two rigid plates: force against displacement, by explicit dynamics.
    #[command(after_help = help::COMPRESS)]
    Compress(compress::Arguments),
    /// Show how a grain can come to lie, how likely each way is, and how far closing plates turn it before they hold it.
    #[command(after_help = help::RESTS)]
    Rests(RestsOptions),
    /// List the sessions of the data folder, the newest first.
    List,
    /// Show what there is to know of a session: how far it has come, its figures, its files.
    Show(sessions::ShowArguments),
    /// Remove sessions, with their pictures and everything computed from them.
    #[command(after_help = help::RM)]
    Rm(sessions::RemoveArguments),
    /// Check every file of a session against the hashes in its journal.
    #[command(after_help = help::VERIFY)]
    Verify(VerifyOptions),
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
    /// Show what is set, and what set it: a file, the command line, the environment or the default.
    #[command(after_help = help::CONFIG)]
    Config(config::Arguments),
    /// Print what a shell needs to complete this program's commands and options.
    #[command(after_help = help::COMPLETIONS)]
    Completions(shell::CompletionsArguments),
    /// Print this program's manual page, or write one for each command.
    #[command(after_help = help::MAN)]
    Man(shell::ManArguments),
    /// The process in which a DSLR is driven; started by this program.
    #[command(hide = true)]
    CameraWorker,
}

/// Parses the command line and runs one command; 0 is success, 1 failure, 2 usage.
pub fn run() -> ExitCode {
    let cli =
        Cli::command().try_get_matches().and_then(|matches| Cli::of(&matches)).unwrap_or_else(|error| {
            if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
                output::print_error(ErrorKind::Usage, error.render().to_string().trim_end());
            }
            error.exit()
        });
    if let Command::CameraWorker = cli.command {
        return crate::rig::gphoto::worker::run();
    }
    logging::begin(cli.common.log_format);
    if let Err(error) = enough_files() {
        output::say_error(error);
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
            | Command::Config(_)
    ) {
        common.without_config();
    }
    let outcome = match cli.command {
        Command::Serve(a) => serve::run(common, &a),
        Command::Capture(a) => capture::run(common, &a),
        Command::Resume(a) => capture::resume(common, &a),
        Command::Replay(a) => reconstruct::replay(common, &a),
        Command::Import(a) => import::run(common, &a),
        Command::Reconstruct(a) => reconstruct::run(common, &a),
        Command::Mesh(a) => mesh::run(common, &a),
        Command::Merge(a) => merge::run(common, &a),
        Command::Compress(a) => compress::run(common, &a),
        Command::Rests(a) => rests::run(common, &a),
        Command::List => sessions::list(common),
        Command::Show(a) => sessions::show(common, &a),
        Command::Rm(a) => sessions::rm(common, &a),
        Command::Verify(a) => verify::run(common, &a),
        Command::Calibrate(a) => calibrate::run(common, &a),
        Command::Study(a) => study::run(common, &a),
        Command::Devices => devices::run(common),
        Command::Doctor => doctor::run(common),
        Command::Focus(a) => focus::run(common, &a),
        Command::Config(a) => config::run(common, &a),
        Command::Completions(a) => shell::completions(&a),
        Command::Man(a) => shell::man(common, &a),
        Command::CameraWorker => Ok(()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let text = with_causes(&error);
            output::say_error(&text);
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
fn with_causes(error: &anyhow::Error) -> String {
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
