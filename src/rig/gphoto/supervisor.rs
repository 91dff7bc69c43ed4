//! The child process: started, asked with a deadline, killed.

use super::home::Home;
use super::message::{Failure, FailureKind, Reply, Request};
use super::wire::{self, Kind};
use std::collections::VecDeque;
use std::io::{BufReader, Read as _};
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Files that may wait between the reading thread and whoever asked.
const WAITING_FILES: usize = 4;
/// How long a killed child is waited for, and what it said. One that hangs in the kernel on a dead USB device is left
/// behind.
const DYING: Duration = Duration::from_secs(1);
/// How long a child may take to let go of the camera in good order.
const LEAVING: Duration = Duration::from_secs(2);
/// Of what the child says on its standard error, so much is kept for the message about its death.
const LAST_WORDS: usize = 400;

/// How the child is started.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The program, which is this one.
    pub program: PathBuf,
}

impl Launch {
    /// This program itself: the very one that runs, though another version may have taken its place on the disk since.
    pub fn this_program() -> Self {
        Self { program: "/proc/self/exe".into() }
    }
}

/// A child that is running. Dropped, it may leave in good order; see [`Worker::kill`].
pub(super) struct Worker {
    child: Option<Child>,
    requests: Option<ChildStdin>,
    incoming: Receiver<Incoming>,
    last_words: Arc<Mutex<VecDeque<u8>>>,
    /// Closed once the child's standard error has been read to its end.
    all_heard: Receiver<()>,
    /// Goes away after the child.
    _home: Home,
}

enum Incoming {
    Reply(Reply),
    File(Vec<u8>),
    /// The stream is damaged.
    Damaged(String),
}

/// A reply, and the files that came before it.
pub(super) type Answer = (Reply, Vec<Vec<u8>>);

impl Worker {
    /// Starts the child and waits until it says that it is ready.
    pub(super) fn start(launch: &Launch, deadline: Duration) -> Result<Self, Failure> {
        let failed = |e: std::io::Error| {
            let cause = format!("the camera's process {} does not start: {e}", launch.program.display());
            Failure::new(FailureKind::Transport, cause)
        };
        let home = Home::make().map_err(failed)?;
        let mut child = Command::new(&launch.program)
            .arg0("grainrig")
            .arg("camera-worker")
            // The library translates the names of choices otherwise.
            .envs([("LANGUAGE", "C"), ("LC_ALL", "C")])
            .env("HOME", home.path())
            // Ctrl-C ends the run after the view in hand, which needs its camera.
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let (send, incoming) = sync_channel(WAITING_FILES);
        let last_words = Arc::new(Mutex::new(VecDeque::new()));
        let requests = child.stdin.take();
        if let Some(replies) = child.stdout.take() {
            std::thread::spawn(move || receive(replies, &send));
        }
        let (hearing, all_heard) = channel();
        if let Some(said) = child.stderr.take() {
            let kept = Arc::clone(&last_words);
            std::thread::spawn(move || {
                listen(said, &kept);
                drop(hearing);
            });
        }
        let mut worker = Self { child: Some(child), requests, incoming, last_words, all_heard, _home: home };
        match worker.answer("start", deadline)? {
            (Reply::Started, _) => Ok(worker),
            (other, _) => Err(unexpected(&other)),
        }
    }

    /// Asks the child; its reply and the files before it. Where none comes within `deadline` the child is killed.
    pub(super) fn ask(
        &mut self,
        request: &Request,
        what: &str,
        deadline: Duration,
    ) -> Result<Answer, Failure> {
        self.tell(request)?;
        self.answer(what, deadline)
    }

    /// Sends a request without waiting for what becomes of it.
    pub(super) fn tell(&mut self, request: &Request) -> Result<(), Failure> {
        tracing::trace!(?request, "sent");
        let bytes = serde_json::to_vec(request).map_err(std::io::Error::from);
        let requests = self.requests.as_mut().ok_or_else(|| std::io::ErrorKind::BrokenPipe.into());
        let sent = requests.and_then(|to| wire::write(to, Kind::Message, &bytes?));
        sent.map_err(|e| self.died(&e.to_string()))
    }

    fn answer(&mut self, what: &str, deadline: Duration) -> Result<Answer, Failure> {
        let end = Instant::now() + deadline;
        let mut files = Vec::new();
        loop {
            let next = self.incoming.recv_timeout(end.saturating_duration_since(Instant::now()));
            match &next {
                Ok(Incoming::Reply(reply)) => tracing::trace!(?reply, "heard"),
                Ok(Incoming::File(bytes)) => tracing::trace!(bytes = bytes.len(), "heard a file"),
                Ok(Incoming::Damaged(reason)) => tracing::trace!(reason, "heard what is damaged"),
                Err(_) => {}
            }
            match next {
                Ok(Incoming::File(bytes)) => files.push(bytes),
                Ok(Incoming::Reply(Reply::Failed(failure))) => return Err(failure),
                Ok(Incoming::Reply(reply)) => return Ok((reply, files)),
                Ok(Incoming::Damaged(reason)) => return Err(self.died(&reason)),
                Err(RecvTimeoutError::Disconnected) => return Err(self.died("it ended")),
                Err(RecvTimeoutError::Timeout) => {
                    self.kill();
                    let cause = format!(
                        "the camera did not {what} within {} s: its process was killed{}",
                        (deadline.as_secs_f64() * 100.0).round() / 100.0,
                        self.words()
                    );
                    return Err(Failure::new(FailureKind::Transport, cause));
                }
            }
        }
    }

    /// The failure of a child that is gone or makes no sense.
    fn died(&mut self, reason: &str) -> Failure {
        let status = self.kill().map_or_else(|| "does not end".to_owned(), |s| s.to_string());
        let words = self.words();
        Failure::new(
            FailureKind::Transport,
            format!("the camera's process failed ({reason}; {status}{words})"),
        )
    }

    /// What the child, which was killed or is gone, said last. The thread that reads it may be behind the child's end.
    fn words(&self) -> String {
        // A process that the child left behind can keep the pipe open: what was heard until then has to do.
        let _ = self.all_heard.recv_timeout(DYING);
        let kept = self.last_words.lock().unwrap_or_else(PoisonError::into_inner);
        let text =
            String::from_utf8_lossy(&kept.iter().copied().collect::<Vec<u8>>()).trim().replace('\n', " / ");
        if text.is_empty() { text } else { format!("; it said: {text}") }
    }

    /// Ends the child at once, whatever it does; how it ended, where that is known within a second.
    pub(super) fn kill(&mut self) -> Option<std::process::ExitStatus> {
        self.requests = None;
        let mut child = self.child.take()?;
        // It may have ended by itself.
        let _ = child.kill();
        wait(child, DYING)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The end of its standard input tells the child to let go of the camera; it kills itself where that hangs.
        self.requests = None;
        if let Some(child) = self.child.take() {
            wait(child, LEAVING);
        }
    }
}

/// Waits for a child on a thread of its own, as the wait has no limit: a process can hang in the kernel.
fn wait(mut child: Child, limit: Duration) -> Option<std::process::ExitStatus> {
    let (send, ended) = channel();
    std::thread::spawn(move || send.send(child.wait()));
    ended.recv_timeout(limit).ok()?.ok()
}

fn unexpected(reply: &Reply) -> Failure {
    Failure::new(FailureKind::Transport, format!("the camera's process answered {reply:?} out of turn"))
}

/// Reads the child's frames until it ends or nobody wants them any more.
fn receive(replies: ChildStdout, send: &SyncSender<Incoming>) {
    let mut from = BufReader::new(replies);
    loop {
        let next = match wire::read(&mut from) {
            Ok(None) => return,
            Ok(Some((Kind::File, bytes))) => Incoming::File(bytes),
            Ok(Some((Kind::Message, bytes))) => match serde_json::from_slice(&bytes) {
                Ok(reply) => Incoming::Reply(reply),
                Err(e) => Incoming::Damaged(e.to_string()),
            },
            Err(e) => Incoming::Damaged(e.to_string()),
        };
        let last = matches!(next, Incoming::Damaged(_));
        if send.send(next).is_err() || last {
            return;
        }
    }
}

/// Reads what the child says on its standard error, which would block it otherwise; keeps the last of it.
fn listen(mut said: ChildStderr, kept: &Mutex<VecDeque<u8>>) {
    let mut buffer = [0; 512];
    while let Ok(n @ 1..) = said.read(&mut buffer) {
        tracing::debug!("camera: {}", String::from_utf8_lossy(&buffer[..n]).trim());
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extend(&buffer[..n]);
        let excess = kept.len().saturating_sub(LAST_WORDS);
        kept.drain(..excess);
    }
}
