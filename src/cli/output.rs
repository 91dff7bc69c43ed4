//! What a person or a program reads: a reader that has gone away ends no job.

use super::logging;
use crate::jobs::{ErrorKind as Kind, stated};
use crate::session::{to_json, to_json_value};
use anyhow::{Context as _, Result};
use serde_json::json;
use std::fmt::Display;
use std::io::{ErrorKind, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::Level;

/// Prints on standard output. A closed pipe (`| head -1`) is no error: what was computed is on the disk.
pub(super) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output; check where it leads to"),
    }
}

/// Whether the one object is printed.
static PRINTED: AtomicBool = AtomicBool::new(false);

/// Prints the one result object on standard output, as [`stated`] has it; nothing of it where a number in it is none.
pub(super) fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let value = to_json_value(value).map(stated).context("cannot encode the result")?;
    let text = to_json(&value).context("cannot encode the result")?;
    PRINTED.store(true, Ordering::Relaxed);
    print(&String::from_utf8_lossy(&text))
}

/// Says a line on standard error; where nobody can read it the job goes on all the same.
pub(super) fn say(line: impl Display) {
    say_at(Level::INFO, line);
}

/// Says what went wrong.
pub(super) fn say_error(error: impl Display) {
    say_at(Level::ERROR, format_args!("error: {error}"));
}

fn say_at(level: Level, line: impl Display) {
    let _ = if logging::is_json() {
        writeln!(std::io::stderr(), "{}", logging::line(level, &line.to_string()))
    } else {
        writeln!(std::io::stderr(), "{line}")
    };
}

/// Prints an error as the one object, where there is none yet: a replay that differs has told its result.
pub(super) fn print_error(kind: Kind, message: &str) {
    if !PRINTED.load(Ordering::Relaxed) {
        let kind = match kind {
            Kind::Usage => "usage",
            Kind::Busy => "busy",
            Kind::Absent => "absent",
            Kind::Failed => "failed",
        };
        // Where that can't be written either, the exit code still tells.
        let _ = print_json(&json!({ "error": { "kind": kind, "message": message } }));
    }
}
