//! What the system tells the program while it works.

use super::output::say;
use crate::acquire::{Control, Phase};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use tokio::runtime::{Builder, Runtime};
use tokio::signal::unix::{SignalKind, signal};

/// Exit code of a run that was stopped at once.
const STOPPED: i32 = 1;

/// Whether this program was started to outlive its terminal (`nohup`): a handler would undo that.
pub(super) fn hangup_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

fn runtime() -> std::io::Result<Runtime> {
    Builder::new_current_thread().enable_io().build()
}

/// Lets a write beyond the limit of a file's size (`ulimit -f`) fail with a reason; by itself the system
/// would end the program in mid-write, without a word.
pub(super) fn survive_file_limit() {
    let kind = SignalKind::from_raw(rustix::process::Signal::XFSZ.as_raw());
    if let Ok(runtime) = runtime() {
        let _inside = runtime.enter();
        // The handler stays for as long as the program runs. Where the system gives none, nothing is worse.
        drop(signal(kind));
    }
}

/// A flag that Ctrl-C, or the system's wish to end the program, sets; the second time the program ends at once.
pub(super) fn stop_flag(said: &'static str) -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let on_signal = Arc::clone(&flag);
    each_time(move || {
        if on_signal.swap(true, Ordering::Relaxed) {
            std::process::exit(STOPPED);
        }
        say(said);
    });
    flag
}

/// A control that Ctrl-C, or the system's wish to end the program, aborts: the view in hand is finished, what
/// was captured stays. The second time, or where only the computation is left, the program ends at once:
/// everything durable is whole.
pub(super) fn stoppable() -> Control {
    let control = Control::new();
    let on_signal = control.clone();
    each_time(move || {
        if on_signal.phase() == Phase::Complete {
            say("stopped; all views are captured, `grainrig resume` computes the rest");
            std::process::exit(STOPPED);
        }
        if on_signal.is_aborting() {
            say("stopped at once; `grainrig resume` goes on with the missing views");
            std::process::exit(STOPPED);
        }
        say("stopping after the view in hand (once more: at once); `grainrig resume` goes on from there");
        on_signal.abort();
    });
    control
}

/// Does this at each Ctrl-C and each wish of the system to end the program. Where the system gives no handlers, Ctrl-C ends
/// the program as ever. Returns when somebody listens.
fn each_time(mut act: impl FnMut() + Send + 'static) {
    let (listening, listens) = sync_channel::<()>(1);
    std::thread::spawn(move || {
        let Ok(runtime) = runtime() else { return };
        let _: std::io::Result<()> = runtime.block_on(async move {
            let mut interrupt = signal(SignalKind::interrupt())?;
            let mut terminate = signal(SignalKind::terminate())?;
            let mut hangup = if hangup_is_ignored() { None } else { Some(signal(SignalKind::hangup())?) };
            drop(listening);
            loop {
                let hung_up = async {
                    match &mut hangup {
                        Some(hangup) => hangup.recv().await,
                        None => std::future::pending().await,
                    }
                };
                tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {}, _ = hung_up => {} }
                act();
            }
        });
    });
    // Nothing begins before somebody listens, or can't: then the sender is gone.
    let _: Result<(), _> = listens.recv();
}
