//! A camera that libgphoto2 takes for a real one, with a plain camera's personality and that of a Canon EOS, and what goes
//! wrong with either. It is on the network (PTP over IP, CIPA DC-005), or on the USB of a computer that takes devices from
//! the network (USB/IP): one body, two cables.
//!
//! ```text
//!  libgphoto2 ──commands──▶ server ──operation──▶ Body (store, properties, shutter) ──picture──▶ the test's callback
//!             ◀──events────                       eos: Canon's own operations and its queue of changes
//!  libusb ─▶ kernel ──URBs──▶ usbip ─▶ usb ──operation──▶ the same
//! ```
//!
//! The pictures come from the test, which may render them at the angle that a stage has reached.

// Each test file uses its own part of this.
#![allow(dead_code)]

mod answer;
mod body;
mod eos;
mod server;
mod usb;
mod usbip;
mod wire;

use crate::skip::{Lacking, skip};
use body::Body;
use std::net::TcpListener;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// Whether the library can talk to a camera on the network: Debian keeps that in a file of its own.
pub fn speaks_ptpip() -> bool {
    let there = ["/usr/lib", "/usr/local/lib"].iter().any(|root| has_port(Path::new(root), 3));
    if !there {
        skip(Lacking::Tools, "libgphoto2 has no port `ptpip` here; install libgphoto2-port12");
    }
    there
}

fn has_port(folder: &Path, depth: usize) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().any(|e| {
        let name = e.file_name();
        let name = name.to_string_lossy();
        name == "ptpip.so"
            || depth > 0
                && (name.contains("linux")
                    || name.contains("gphoto")
                    || name.starts_with('0')
                    || name.starts_with("2."))
                && has_port(&e.path(), depth - 1)
    })
}

/// How the camera behaves when nothing is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Personality {
    /// The standard's own operations; events come on a connection of their own.
    Generic,
    /// A Canon EOS: remote release, changes that are polled, pictures held in RAM or on the card.
    Eos,
}

/// What goes wrong at an exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The release is answered with "device busy".
    Busy,
    /// The release is never answered.
    Stall,
    /// The release is answered, and nothing comes of it.
    NoEvent,
    /// The camera hangs up in mid-release and refuses the next so many connections.
    Die {
        /// Connections refused before it is there again.
        refusals: usize,
    },
    /// The picture is taken, and the camera hangs up half-way through fetching it; it refuses the next so many connections.
    Torn {
        /// Connections refused before it is there again.
        refusals: usize,
    },
    /// The release is answered with "store full".
    FullCard,
    /// Only the RAW file is written.
    RawWithoutJpeg,
    /// Only the first half of the picture can be had.
    Truncated,
    /// The picture takes so much longer.
    Slow(Duration),
    /// Before the exposure the sensitivity changes by itself.
    Drift,
}

/// A fault, and the exposures that it spoils: `count` of them from the one numbered `at`, counted from 0 with every
/// release.
#[derive(Debug, Clone, Copy)]
pub struct Planned {
    pub fault: Fault,
    pub at: usize,
    pub count: usize,
}

/// How the camera is set up.
#[derive(Debug, Clone)]
pub struct Setup {
    pub personality: Personality,
    /// Whether each exposure makes a RAW file beside the JPEG.
    pub raw: bool,
    /// Pictures that the card (or the camera's RAM) holds.
    pub capacity: usize,
    /// Whether somebody has left it in live view.
    pub live_view: bool,
    pub faults: Vec<Planned>,
}

impl Setup {
    /// A camera with which nothing is wrong.
    pub fn new(personality: Personality) -> Self {
        Self { personality, raw: false, capacity: usize::MAX, live_view: false, faults: Vec::new() }
    }
    /// The same with a fault at one exposure.
    #[must_use]
    pub fn with(self, fault: Fault, at: usize) -> Self {
        self.with_many(fault, at, 1)
    }
    /// The same with a fault at several exposures in a row.
    #[must_use]
    pub fn with_many(mut self, fault: Fault, at: usize, count: usize) -> Self {
        self.faults.push(Planned { fault, at, count });
        self
    }
}

/// An operation that was answered, and when.
#[derive(Debug, Clone, Copy)]
pub struct Served {
    pub operation: u16,
    pub began: SystemTime,
    pub ended: SystemTime,
}

/// A camera that runs until it is dropped.
pub struct PtpCamera {
    body: Arc<Mutex<Body>>,
    port: u16,
}

/// The picture of an exposure, by its number.
type Pictures = dyn FnMut(usize) -> Vec<u8> + Send;

impl PtpCamera {
    /// Switches a camera on that is on the network; `pictures` makes the JPEG of each exposure that is really taken.
    pub fn start(setup: Setup, pictures: impl FnMut(usize) -> Vec<u8> + Send + 'static) -> Self {
        Self::serving(setup, pictures, server::connection)
    }

    /// Switches a camera on that may be plugged into the USB of whoever asks for it over USB/IP. It has the identity of an
    /// EOS 60D.
    pub fn plugged(setup: Setup, pictures: impl FnMut(usize) -> Vec<u8> + Send + 'static) -> Self {
        Self::serving(setup, pictures, usbip::connection)
    }

    fn serving(
        setup: Setup,
        pictures: impl FnMut(usize) -> Vec<u8> + Send + 'static,
        connection: server::Serve,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let body = Arc::new(Mutex::new(Body::new(setup, Box::new(pictures))));
        let serving = Arc::clone(&body);
        std::thread::spawn(move || server::serve(&listener, &serving, connection));
        Self { body, port }
    }

    /// As libgphoto2 takes it. The port stands twice, or events would go to the standard's port.
    pub fn address(&self) -> String {
        format!("ptpip:127.0.0.1:{0}:{0}", self.port)
    }

    /// Its port on this computer.
    pub fn port(&self) -> u16 {
        self.port
    }

    fn body(&self) -> MutexGuard<'_, Body> {
        // What fails while it is held has failed the test already.
        self.body.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The camera driver's name for it.
    pub fn model(&self) -> &'static str {
        match self.body().personality() {
            Personality::Generic => "PTP/IP Camera",
            Personality::Eos => "Canon EOS (WLAN)",
        }
    }
    /// What live view shows: the JPEG of each of its pictures, by its number.
    pub fn shows(&self, pictures: impl FnMut(usize) -> Vec<u8> + Send + 'static) {
        self.body().shows(Box::new(pictures));
    }
    /// Whether the mirror is up for live view.
    pub fn live_view(&self) -> bool {
        self.body().eos().live_view()
    }
    /// Somebody presses the release at the camera's remote socket.
    pub fn press(&self) {
        self.body().press();
    }
    /// Releases that were asked for, spoilt ones too.
    pub fn releases(&self) -> usize {
        self.body().releases
    }
    /// Pictures that are on the card or in RAM: their names.
    pub fn pictures(&self) -> Vec<String> {
        self.body().pictures()
    }
    /// The sensitivity that is set.
    pub fn iso(&self) -> String {
        self.body().iso()
    }
    /// Somebody has mended whatever was wrong.
    pub fn mend(&self) {
        self.body().mend();
    }
    /// Every operation that was answered, in order.
    pub fn served(&self) -> Vec<Served> {
        self.body().served.clone()
    }
    /// When the files of each exposure were there, in order.
    pub fn exposed(&self) -> Vec<SystemTime> {
        self.body().exposed.clone()
    }
    /// Command connections so far; for one on the USB: how often it was plugged in.
    pub fn sessions(&self) -> usize {
        self.body().sessions
    }
}

impl Drop for PtpCamera {
    fn drop(&mut self) {
        self.body().off = true;
        // Wakes the listener, which looks at the switch.
        let _ = std::net::TcpStream::connect(("127.0.0.1", self.port));
    }
}
