//! A progress bar on standard error: what is being done, how far it is, how long it takes.

use super::output::say;
use crate::jobs::Watcher;
use crate::session::event::{Event, EventKind};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Arc, Mutex, PoisonError};

/// The bar's steps for the computation after the last view.
const COMPUTATION: u64 = 100;

/// A bar that follows a job's events; nothing is drawn where standard error is no terminal.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// An empty bar.
    pub fn new() -> Self {
        let bar = ProgressBar::no_length();
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} [{elapsed}]")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        draw(&bar);
        Self { bar }
    }

    /// What a job calls with each event.
    pub fn watcher(&self) -> Watcher {
        let bar = self.bar.clone();
        let last_stage = Mutex::new(String::new());
        Arc::new(move |event: &Event| show(&bar, &last_stage, &event.what))
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn show(bar: &ProgressBar, last_stage: &Mutex<String>, what: &EventKind) {
    // Where nobody sees a bar a plain line per view tells the same.
    let line = |text: String| {
        if bar.is_hidden() {
            say(text);
        } else {
            bar.set_message(text);
        }
    };
    match what {
        EventKind::Started { views, already_captured, session } => {
            bar.set_length(*views as u64);
            bar.set_position(*already_captured as u64);
            line(match already_captured {
                0 => format!("session {session}: {views} views"),
                n if n == views => format!("session {session}: all {views} views are there"),
                n => format!("session {session}: {n} of {views} views are there, going on with the others"),
            });
        }
        EventKind::Captured { view, remaining_s } => {
            bar.inc(1);
            let (done, all) = (bar.position(), bar.length().unwrap_or(0));
            let left = remaining_s
                .filter(|_| done < all)
                .map_or_else(String::new, |s| format!(", about {} s left", s.ceil()));
            line(format!("view {} at {:.2}°: {done} of {all} captured{left}", view.view, view.reached_deg));
        }
        EventKind::Silhouette { view, warnings, .. } | EventKind::Judged { view, warnings, .. } => {
            for w in warnings {
                bar.suspend(|| say(format!("view {view}: {w}")));
            }
        }
        EventKind::Rejected { view, tries: Some(n), cause } => {
            bar.suspend(|| say(format!("view {view}: picture {n} is no good: {cause}")));
        }
        EventKind::Rejected { tries: None, cause, .. } => bar.suspend(|| say(cause)),
        EventKind::Hull { views, volume_mm3: Some(v) } if !bar.is_hidden() => {
            bar.set_message(format!("hull of {views} views: {v:.4} mm³"));
        }
        EventKind::Working { stage, done } => {
            let mut last = last_stage.lock().unwrap_or_else(PoisonError::into_inner);
            if *last != *stage {
                last.clone_from(stage);
                line(format!("computing: {stage}"));
            }
            bar.set_length(COMPUTATION);
            bar.set_position((done * COMPUTATION as f64) as u64);
        }
        EventKind::Paused => line("paused; the monitor resumes or aborts the run".into()),
        EventKind::Resumed => line("going on".into()),
        _ => {}
    }
}

/// A bar in per cent for work that has no session.
pub fn percent(what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(100).with_message(what);
    let style = ProgressStyle::with_template("{bar:30} {pos} % {msg} [{elapsed}]")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    draw(&bar);
    bar
}

/// A bar is no line of JSON.
fn draw(bar: &ProgressBar) {
    if super::logging::is_json() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
}
