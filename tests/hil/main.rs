//! The real program on a real kernel: udev, the FTDI adapter's driver, libusb and the camera library on the USB, V4L2. Only
//! what is at the ends of the cables is simulated: the board (the real firmware on a simulated chip), the camera (PTP in its
//! containers), the kernel's own video camera. `make test-hil` prepares the guest and runs this.

#![cfg(all(feature = "gphoto2", feature = "v4l"))]

#[path = "../support/board/mod.rs"]
mod board;
#[path = "../rigs/grain.rs"]
mod grain;
mod guest;
#[path = "../support/kit/mod.rs"]
mod kit;
#[path = "../support/ptp_camera/mod.rs"]
mod ptp_camera;
#[path = "../support/skip.rs"]
mod skip;

use board::Board;
use grain::{Exposed, Grain, figure};
use grainrig::session::sha256_hex;
use guest::{Agent, Guest, Monitor};
use kit::{Lab, Ran};
use ptp_camera::{Fault, Personality, PtpCamera, Setup};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Views, the closing one among them; degrees and microsteps from one to the next.
const VIEWS: usize = 6;
const STEP_DEG: f64 = 36.0;
const STEP: i64 = 320;
/// Of the kernel's camera; and of the grain's pictures, of a quarter of the pixels that they have in other tests.
const VIDEO_MM_PER_PX: f64 = 0.0043;
const GRAIN_MM_PER_PX: f64 = 0.0086;
/// The side of the square that the kernel's camera shows, pixels.
const SQUARE: usize = 256;
/// An emulated processor is slow: what is computed from the pictures is coarse.
const COARSE: &str = "\
[plan]
views = 5
steps_per_view = 40
settle_ms = 0
[report]
pictures = false
[hull]
voxel_mm = 0.05
[mesh]
surface_size_mm = 0.15
";

/// The exposure at which the serial line is pulled out, counted from 0.
const LINE_OUT: usize = 4;
/// The releases at which the camera goes away: for a moment when nothing is taken yet, for a moment half-way through fetching
/// the picture, for good.
const CAMERA_OUT: usize = 1;
const CAMERA_TORN: usize = 3;
const CAMERA_GONE: usize = 9;

struct Rig {
    lab: Lab,
    /// Ends with the rig.
    _guest: Guest,
    agent: Agent,
    board: Arc<Mutex<Board>>,
    camera: PtpCamera,
    exposed: Exposed,
    /// What `grainrig devices` says.
    devices: Vec<Value>,
}

impl Rig {
    /// `None`, with the reason on the screen, where there is no guest, or the chip's tools are not there.
    fn new() -> Option<Self> {
        let Some(folder) = std::env::var_os("GRAINRIG_HIL").map(PathBuf::from) else {
            // Not for `GRAINRIG_REQUIRE`: it is `make test-hil` that prepares the guest, and runs this.
            println!("skipped: GRAINRIG_HIL names no folder with a guest; run `make test-hil`");
            return None;
        };
        let board = Board::start(0, -1_000_000)?;
        let line = board.port.clone();
        let (lab, board) = (Lab::new(), Arc::new(Mutex::new(board)));
        let mut grain = Grain::new(&lab, &board, |settings| {
            (settings.width, settings.height) = (320, 240);
            settings.mm_per_px = GRAIN_MM_PER_PX;
        });
        let exposed = grain.exposed();
        let setup = Setup::new(Personality::Eos)
            .with(Fault::Die { refusals: 2 }, CAMERA_OUT)
            .with(Fault::Torn { refusals: 2 }, CAMERA_TORN)
            .with(Fault::Die { refusals: usize::MAX }, CAMERA_GONE);
        let monitor = lab.path("monitor");
        let watcher: Arc<Mutex<Option<Agent>>> = Arc::default();
        let (hand, seen_by) = (monitor.clone(), Arc::clone(&watcher));
        let mut photographs = 0;
        let camera = PtpCamera::plugged(setup, move |_| {
            if photographs == LINE_OUT {
                let mut monitor = Monitor::connect(&hand);
                monitor.unplug();
                let seen_by = Arc::clone(&seen_by);
                // Put in again once nobody waits at the old one.
                std::thread::spawn(move || {
                    let mut watcher = seen_by.lock().unwrap().take().unwrap();
                    watcher.wait_until("! ls -l /proc/[0-9]*/fd 2>/dev/null | grep -q ttyUSB");
                    monitor.plug();
                });
            }
            photographs += 1;
            grain.photograph()
        });
        let mut guest = Guest::boot(&folder, &lab, &line, camera.port(), &monitor);
        *watcher.lock().unwrap() = Some(guest.agent());
        let agent = guest.agent();
        Some(Self { lab, _guest: guest, agent, board, camera, exposed, devices: Vec::new() })
    }

    /// Runs the program as a user who has no rights but those of the group that grainrig's udev rules name.
    fn grainrig(&mut self, arguments: &str) -> Ran {
        let line =
            format!("su grainrig -c 'grainrig --data /data --json --config /etc/rig.toml {arguments}'");
        self.agent.run(&line)
    }

    /// The path of the device of a driver whose name has this in it; it must be permitted.
    fn device(&self, driver: &str, name: &str) -> &str {
        let fits = |d: &&Value| {
            d["driver"].as_str() == Some(driver) && d["name"].as_str().is_some_and(|n| n.contains(name))
        };
        let [found] = self.devices.iter().filter(fits).collect::<Vec<_>>()[..] else {
            panic!("{driver}, {name}: {:#?}", self.devices)
        };
        assert_eq!(found["permitted"], true, "{found}");
        found["path"].as_str().unwrap()
    }

    /// The stage's controller and a camera with these settings.
    fn configure(&mut self, camera: &str, settings: &str) {
        let port = self.device("controller or grbl", "USB");
        let stage = format!(
            "[rig]\nkind = \"hardware\"\nstage = \"controller\"\ncamera = \"{camera}\"\n\
             [controller]\nport = \"{port}\"\nboot_ms = 0\nspeed_deg_per_s = 400\n\
             acceleration_deg_per_s2 = 9000\nreply_ms = 2000\ntries = 20\n"
        );
        self.agent.write("/etc/rig.toml", &[COARSE, &stage, settings].concat());
    }

    /// Where the pins were at each exposure from the one numbered `from`, microsteps from `start`; and the pictures' hashes.
    fn exposed(&self, from: usize, start: i64) -> Vec<(i64, String)> {
        let all = self.exposed.lock().unwrap();
        all[from..].iter().map(|(at, hash)| (at - start, hash.clone())).collect()
    }

    /// Fetches a session that is whole: each view is there once, the byte for byte what the camera showed at its angle.
    fn assert_whole(&mut self, name: &str, exposed: &[(i64, String)]) {
        self.grainrig(&format!("verify {name}")).succeeds();
        self.agent.fetch(&self.lab, name);
        self.lab.assert_sound(name);
        let session = self.lab.recording(name);
        assert_eq!(session.views().len(), VIEWS, "{name}");
        for n in 0..VIEWS {
            let (_, shown) = exposed.iter().rfind(|(at, _)| *at == n as i64 * STEP).unwrap();
            let kept = sha256_hex(&session.frame(n).unwrap().bytes);
            assert_eq!(*shown, kept, "{name}: view {n} is not what the camera showed");
        }
    }
}

fn positions(exposed: &[(i64, String)]) -> Vec<i64> {
    exposed.iter().map(|(at, _)| *at).collect()
}

#[test]
fn the_program_drives_the_devices_of_a_real_kernel() {
    let Some(mut rig) = Rig::new() else { return };
    what_is_plugged_in_is_found(&mut rig);
    // Nothing names the camera: it is the only one.
    let eos = "[optics]\nmm_per_px = 0.0086\n[gphoto2]\nset = { iso = \"100\" }\n\
               require = { autoexposuremode = \"Manual\" }\nretry_s = [1.0, 2.0, 4.0]\nclaimed_retry_s = [0.5]\n";
    rig.configure("gphoto2", eos);
    a_camera_that_another_program_holds_is_told_with_its_name(&mut rig);
    nothing_is_lost_or_doubled_while_cables_are_pulled(&mut rig);
    a_camera_that_stays_away_ends_the_run_which_is_resumed(&mut rig);
    let device = rig.device("v4l2", "vivid").to_owned();
    // The kernel's camera shows a green square on white, and writes nothing over it; so all pictures are the same.
    let video = format!(
        "[optics]\nmm_per_px = 0.0043\n[acquire]\nquality = \"off\"\n[v4l2]\ndevice = \"{device}\"\nformat = \"yuyv\"\n\
         width = 640\nheight = 480\nframe_s = 10.0\nshot_s = 30.0\n\
         controls = {{ test_pattern = 6, show_square = 1, osd_text_mode = 2 }}\n"
    );
    rig.configure("v4l2", &video);
    a_video_camera_is_set_and_captured(&mut rig);
}

fn what_is_plugged_in_is_found(rig: &mut Rig) {
    rig.agent.write("/etc/rig.toml", "");
    // The camera was plugged in when the guest had booted. udev names things once the kernel has told it.
    rig.agent.wait_until("grep -q ^06 /sys/bus/usb/devices/*:*/bInterfaceClass 2>/dev/null");
    rig.agent.run("udevadm settle").succeeds();
    let found = rig.grainrig("devices").succeeds().json();
    rig.devices.clone_from(found["devices"].as_array().unwrap());
    let serial = rig.device("controller or grbl", "USB");
    assert!(serial.starts_with("/dev/serial/by-id/usb-"), "{serial}");
    assert!(rig.device("gphoto2", "Canon Inc. Canon Digital Camera").starts_with("/dev/bus/usb/"));
    let video = rig.device("v4l2", "vivid");
    assert_eq!(video, "/dev/v4l/by-path/platform-vivid.0-video-index0");
}

/// Another program looks through the camera, by live view.
fn a_camera_that_another_program_holds_is_told_with_its_name(rig: &mut Rig) {
    rig.camera.shows(|_| kit::pictures()[0].clone());
    rig.agent.run(
        "su grainrig -c 'echo $$ > /data/focusing; \
         exec grainrig --config /etc/rig.toml focus --save /data/focus.jpg' > /data/focused 2>&1 &",
    );
    rig.agent.wait_until("[ -s /data/focus.jpg ]");
    let shown = rig.agent.run("sha256sum /data/focus.jpg").succeeds().stdout;
    assert_eq!(shown[..64], sha256_hex(&kit::pictures()[0]));
    rig.grainrig("capture held")
        .fails(1, &["Could not claim the USB device", "grainrig-camera (process ", "holds it"]);
    rig.agent.run("kill -INT $(cat /data/focusing)").succeeds();
    rig.agent.wait_until("! ls -l /proc/[0-9]*/fd 2>/dev/null | grep -q /dev/bus/usb");
    assert_eq!((rig.camera.live_view(), rig.camera.releases()), (false, 0));
}

fn nothing_is_lost_or_doubled_while_cables_are_pulled(rig: &mut Rig) {
    let ran = rig.grainrig("capture pulled").succeeds();
    for (what, times) in [
        ("the camera fails to release its shutter: ", 1),
        ("the camera fails to deliver IMG_", 1),
        ("the controller has gone; waiting for it", 1),
    ] {
        assert_eq!(ran.stderr.matches(what).count(), times, "{what:?}: {}", ran.stderr);
    }
    // The view that was half fetched is taken again; at the release before, no picture was taken.
    let exposed = rig.exposed(0, 0);
    assert_eq!(positions(&exposed), [0, 1, 2, 2, 3, 4, 5].map(|view| view * STEP));
    assert_eq!((rig.camera.releases(), rig.camera.sessions()), (8, 3));
    rig.assert_whole("pulled", &exposed);
    let state = rig.board.lock().unwrap().state();
    assert_eq!((&state["idle_steps"], &state["current"]), (&0.into(), &false.into()));
}

fn a_camera_that_stays_away_ends_the_run_which_is_resumed(rig: &mut Rig) {
    let before = rig.exposed.lock().unwrap().len();
    let start = rig.board.lock().unwrap().position();
    let told =
        ["view 1: ", "any camera is looked for, none is there", "switch the camera on, check the cable"];
    rig.grainrig("capture away").fails(1, &told);
    rig.camera.mend();
    rig.grainrig("resume away").succeeds();
    let exposed = rig.exposed(before, start);
    assert_eq!(positions(&exposed), [0, 1, 2, 3, 4, 5].map(|view| view * STEP));
    rig.assert_whole("away", &exposed);
}

/// What is seen from all sides as a square is hulled by a prism over a regular polygon of twice as many sides as views, whose
/// inscribed circle is as wide as the square.
fn a_video_camera_is_set_and_captured(rig: &mut Rig) {
    let result = rig.grainrig("capture video").succeeds().json();
    rig.grainrig("verify video").succeeds();
    rig.agent.fetch(&rig.lab, "video");
    let session = rig.lab.recording("video");
    assert!(session.manifest().devices[1].contains("vivid"), "{:?}", session.manifest().devices);
    assert_eq!(session.views().len(), VIEWS);
    let picture = image::load_from_memory(&session.frame(0).unwrap().bytes).unwrap().to_rgb8();
    let is_square = |pixel: &image::Rgb<u8>| pixel.0[0] < 128;
    assert_eq!(picture.pixels().filter(|p| is_square(p)).count(), SQUARE * SQUARE);
    let half = (STEP_DEG / 2.0).to_radians();
    let side_mm = SQUARE as f64 * VIDEO_MM_PER_PX;
    let prism_mm3 = 180.0 / STEP_DEG * 2.0 * (side_mm / 2.0).powi(2) * half.tan() * side_mm;
    let volume_mm3 = figure(&result, "/hull/volume_mm3");
    assert!((volume_mm3 / prism_mm3 - 1.0).abs() < 1e-3, "{volume_mm3} mm³, {prism_mm3} mm³ expected");
}
