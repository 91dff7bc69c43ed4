//! The child: one camera, one thread that calls the library, no state worth keeping.
//!
//! Requests come on standard input, replies go out where standard output was; what the library itself prints goes to
//! standard error. The end of the input means that the parent is gone or wants no more.

#[cfg(not(feature = "gphoto2"))]
mod absent;
#[cfg(feature = "gphoto2")]
mod body;
#[cfg(feature = "gphoto2")]
mod control;
#[cfg(feature = "gphoto2")]
mod files;

#[cfg(not(feature = "gphoto2"))]
use absent::Body;
#[cfg(feature = "gphoto2")]
use body::Body;

use super::message::{Failure, FailureKind, Reply, Request};
use super::wire::{self, Kind};
use std::fs::File;
use std::io::{BufReader, Write};
use std::process::ExitCode;
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// How long the library may take to let go of the camera once nobody wants it any more.
const LEAVING: Duration = Duration::from_millis(1500);

/// What this process is called, of at most 15 letters.
const NAME: &str = "grainrig-camera";

/// A file of the camera: its name there, and its bytes.
type NamedFile = (String, Vec<u8>);

/// Does what the parent asks, until its requests end.
pub fn run() -> ExitCode {
    // It was started as `/proc/self/exe`, and `exe` is what others would be told that holds the camera. A name is a courtesy.
    let _ = std::fs::write("/proc/self/comm", NAME);
    match serve() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("the camera's process ends: {e}");
            ExitCode::FAILURE
        }
    }
}

fn serve() -> std::io::Result<()> {
    // A line that the library prints must not stand among the replies.
    let mut replies = File::from(rustix::io::dup(rustix::stdio::stdout())?);
    rustix::stdio::dup2_stdout(rustix::stdio::stderr())?;
    let (send, requests) = channel();
    std::thread::spawn(move || listen(&send));
    reply(&mut replies, &Reply::Started)?;
    let mut body: Option<Body> = None;
    for request in requests {
        match request {
            Request::Open { settings, after_failure } => {
                // One camera at a time.
                body = None;
                match Body::open(*settings, after_failure) {
                    Ok((opened, answer)) => {
                        body = Some(opened);
                        reply(&mut replies, &answer)?;
                    }
                    Err(failure) => reply(&mut replies, &Reply::Failed(failure))?,
                }
            }
            Request::Capture => deliver(&mut replies, open(&mut body).and_then(Body::capture))?,
            Request::Ready => match open(&mut body).and_then(Body::ready) {
                Ok(notes) => reply(&mut replies, &Reply::Ready { notes })?,
                Err(failure) => reply(&mut replies, &Reply::Failed(failure))?,
            },
            Request::Collect => {
                let files = open(&mut body).and_then(Body::released);
                deliver(&mut replies, files.map(|files| (files, Vec::new())))?;
            }
            Request::Preview => deliver(&mut replies, open(&mut body).and_then(Body::preview))?,
            Request::Kept => {
                if let Some(body) = &mut body {
                    body.kept();
                }
            }
        }
    }
    if let Some(body) = &body {
        body.leave();
    }
    Ok(())
}

fn open(body: &mut Option<Body>) -> Result<&mut Body, Failure> {
    let not_open =
        || Failure::new(FailureKind::Transport, "a picture was asked for before the camera was opened");
    body.as_mut().ok_or_else(not_open)
}

/// Sends the files of an exposure and what is to be said of them, or why there are none.
fn deliver(to: &mut impl Write, shot: Result<(Vec<NamedFile>, Vec<String>), Failure>) -> std::io::Result<()> {
    match shot {
        Ok((files, notes)) => {
            let (names, files): (Vec<String>, Vec<Vec<u8>>) = files.into_iter().unzip();
            for bytes in &files {
                wire::write(to, Kind::File, bytes)?;
            }
            reply(to, &Reply::Shot { names, notes })
        }
        Err(failure) => reply(to, &Reply::Failed(failure)),
    }
}

fn reply(to: &mut impl Write, reply: &Reply) -> std::io::Result<()> {
    wire::write(to, Kind::Message, &serde_json::to_vec(reply)?)
}

/// Reads requests for the main thread. At their end that thread lets go of the camera; where it hangs in the library,
/// this one ends the process all the same.
fn listen(send: &Sender<Request>) {
    let mut from = BufReader::new(std::io::stdin());
    while let Ok(Some((Kind::Message, bytes))) = wire::read(&mut from) {
        let Ok(request) = serde_json::from_slice(&bytes) else { break };
        if send.send(request).is_err() {
            break;
        }
    }
    let killer = std::thread::spawn(|| {
        std::thread::sleep(LEAVING);
        // No destructor of the library may run here: they are what hangs.
        let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    });
    drop(killer);
}
