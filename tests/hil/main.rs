//! The real program on a real kernel: udev, the FTDI adapter's driver, libusb and the camera library on the USB, V4L2. Only
//! what is at the ends of the cables is simulated: the board (the real firmware on a simulated chip), the camera (PTP in its
//! containers), the kernel's own video camera. `make test-hil` prepares the guest and runs this.

#![cfg(all(feature = "gphoto2", feature = "v4l"))]

#[path = "../board/mod.rs"]
mod board;
#[path = "../rigs/grain.rs"]
mod grain;
mod guest;
#[path = "../kit/mod.rs"]
mod kit;
#[path = "../ptp_camera/mod.rs"]
mod ptp_camera;

use board::Board;
use grain::{Exposed, Grain, SETTINGS, figure};
use grainrig::session::sha256_hex;
use guest::{Guest, Monitor};
use kit::{Lab, Ran};
use ptp_camera::{Fault, Personality, PtpCamera, Setup};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Views of half a turn, and the closing one; microsteps from one to the next.
const VIEWS: usize = 5;
const VIEW: i64 = 320;

/// The exposure at which the serial line is pulled out and put in again, counted from 0.
const LINE_OUT: usize = 4;
/// The releases at which the camera goes away for a moment (nothing taken; half-way through fetching), and for good.
const CAMERA_OUT: usize = 1;
const CAMERA_TORN: usize = 3;
const CAMERA_GONE: usize = 9;

struct Rig {
    lab: Lab,
    guest: Guest,
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
            println!("skipped: GRAINRIG_HIL names no folder with a guest: run `make test-hil`");
            return None;
        };
        let board = Board::start(0, -1_000_000)?;
        let line = board.port.clone();
        let (lab, board) = (Lab::new(), Arc::new(Mutex::new(board)));
        let mut grain = Grain::new(&lab, &board, |_| ());
        let exposed = grain.exposed();
        let monitor = lab.path("monitor");
        let hand = monitor.clone();
        let setup = Setup::new(Personality::Eos)
            .with(Fault::Die { refusals: 2 }, CAMERA_OUT)
            .with(Fault::Torn { refusals: 2 }, CAMERA_TORN)
            .with(Fault::Die { refusals: usize::MAX }, CAMERA_GONE);
        let mut photographs = 0;
        let camera = PtpCamera::plugged(setup, move |_| {
            if photographs == LINE_OUT {
                let mut monitor = Monitor::connect(&hand);
                monitor.unplug();
                monitor.plug();
            }
            photographs += 1;
            grain.photograph()
        });
        let guest = Guest::boot(&folder, &lab, &line, camera.port(), &monitor);
        Some(Self { lab, guest, board, camera, exposed, devices: Vec::new() })
    }

    /// Runs the program as a user who has no rights but those of the group that udev's rules name.
    fn grainrig(&mut self, arguments: &str) -> Ran {
        let line = format!("su grainrig -c 'grainrig --data /data --json --config /etc/rig.toml {arguments}'");
        self.guest.run(&line)
    }

    /// The path of the device whose name has this in it; it must be permitted.
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

    fn configure(&mut self, camera: &str) {
        let port = self.device("controller or grbl", "USB");
        let stage = format!(
            "[rig]\nkind = \"hardware\"\nstage = \"controller\"\ncamera = \"{camera}\"\n\
             [controller]\nport = \"{port}\"\nboot_ms = 0\nspeed_deg_per_s = 400\n\
             acceleration_deg_per_s2 = 9000\nreply_ms = 2000\ntries = 20\n"
        );
        let camera = if camera == "gphoto2" {
            "[gphoto2]\nset = { iso = \"100\" }\nrequire = { autoexposuremode = \"Manual\" }\n\
             retry_s = [1.0, 2.0, 4.0]\n"
                .to_owned()
        } else {
            let device = self.device("v4l2", "vivid");
            // White, with a dark square in the middle; nothing written over it.
            format!(
                "[acquire]\nquality = \"off\"\n[v4l2]\ndevice = \"{device}\"\nformat = \"yuyv\"\nwidth = 640\n\
                 height = 480\nframe_s = 10.0\nshot_s = 30.0\n\
                 controls = {{ test_pattern = 6, show_square = 1, osd_text_mode = 2 }}\n"
            )
        };
        self.guest.write("/etc/rig.toml", &[SETTINGS, &stage, &camera].concat());
    }
}

#[test]
fn the_program_drives_the_devices_of_a_real_kernel() {
    let Some(mut rig) = Rig::new() else { return };
    what_is_plugged_in_is_found(&mut rig);
    rig.configure("gphoto2");
    nothing_is_lost_or_doubled_while_cables_are_pulled(&mut rig);
    a_camera_that_stays_away_suspends_the_run(&mut rig);
    rig.configure("v4l2");
    a_video_camera_is_locked_and_captured(&mut rig);
}

fn what_is_plugged_in_is_found(rig: &mut Rig) {
    rig.guest.write("/etc/rig.toml", "");
    // udev has named what is there when it has handled all that the kernel told it.
    let ready = "for i in $(seq 200); do ls /dev/bus/usb/*/* /dev/serial/by-id/* && udevadm settle && break; done";
    rig.guest.run(ready);
    let found = rig.grainrig("devices").succeeds().json();
    rig.devices = found.as_array().unwrap().clone();
    println!("{found:#}");
}

fn nothing_is_lost_or_doubled_while_cables_are_pulled(rig: &mut Rig) {
    let ran = rig.grainrig(&format!("capture pulled --views {VIEWS}"));
    println!("{}", ran.stderr);
    if ran.code != Some(0) {
        let dm = rig.guest.run("ls -l /dev/serial/by-id /dev/ttyUSB*; dmesg | tail -40; cat /sys/bus/usb/devices/*/product");
        println!("{} {}", dm.stdout, dm.stderr);
    }
    let real = ran.succeeds().json();
    println!("{real:#}");
}

fn a_camera_that_stays_away_suspends_the_run(_rig: &mut Rig) {}

fn a_video_camera_is_locked_and_captured(rig: &mut Rig) {
    let ran = rig.grainrig(&format!("capture video --views {VIEWS}"));
    println!("{} {} {:?}", ran.stdout, ran.stderr, ran.code);
    rig.guest.fetch(&rig.lab, "video");
    Command::new("cp").arg("-r").arg(rig.lab.path("data/video")).arg("/tmp/hil-video").status().unwrap();
}
use std::process::Command;
