//! The log on standard error: as text for eyes, or an object a line for programs.

use clap::ValueEnum;
use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::Level;
use tracing_subscriber::EnvFilter;

/// Says what the log has.
const FILTER_ENV: &str = "GRAINRIG_LOG";
/// What it has where nobody says.
const USUAL: &str = "warn";
/// Says the log's form where the command line does not.
pub(super) const FORMAT_ENV: &str = "GRAINRIG_LOG_FORMAT";

/// The form of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum LogFormat {
    /// Lines for a person.
    Text,
    /// A JSON object a line, of everything that goes to standard error.
    Json,
}

/// Whether all that goes to standard error is JSON.
static IS_JSON: AtomicBool = AtomicBool::new(false);

pub(super) fn is_json() -> bool {
    IS_JSON.load(Ordering::Relaxed)
}

/// Begins the log, once.
pub(super) fn begin(format: LogFormat) {
    IS_JSON.store(format == LogFormat::Json, Ordering::Relaxed);
    let (filter, refused) = match std::env::var(FILTER_ENV).map(|given| EnvFilter::try_new(&given)) {
        Ok(Ok(filter)) => (filter, None),
        Ok(Err(error)) => (EnvFilter::new(USUAL), Some(error.to_string())),
        Err(std::env::VarError::NotPresent) => (EnvFilter::new(USUAL), None),
        Err(error) => (EnvFilter::new(USUAL), Some(error.to_string())),
    };
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        // Colours are for eyes: a file or a service's journal would keep their codes.
        .with_ansi(std::io::stderr().is_terminal() && format == LogFormat::Text)
        // A log that nobody can read any more must not end the job.
        .log_internal_errors(false);
    match format {
        LogFormat::Text => log.init(),
        LogFormat::Json => log.json().init(),
    }
    if let Some(why) = refused {
        tracing::warn!("{FILTER_ENV} is not used: {why}; set it to warn, info, debug or trace");
    }
}

/// A line that is no event of the log, in the form that its events have.
pub(super) fn line(level: Level, message: &str) -> String {
    let line = serde_json::json!({
        "timestamp": jiff::Timestamp::now(), "level": level.as_str(), "fields": { "message": message }, "target": "grainrig",
    });
    line.to_string()
}
