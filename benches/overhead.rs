//! What grainrig itself costs for a view: the real program takes 25 views and a closing one with the real libgphoto2 from a
//! Canon EOS on the network that is simulated beside it, on the simulated stage, which takes no time. Run: `cargo bench
//! --features gphoto2 --bench overhead` (a minute).
//!
//! What counts is grainrig's own time, with neither shutter nor transfer nor motion. From a view's time (from its move to
//! the next one's) are taken off: from the shutter's full press to the files; the files' transfer; and the time that the
//! grain is given to settle, 150 ms, which stands for all of the motion. Behind that motion the picture of the view before
//! is judged, hashed, written and synced: this counts only as far as it outlasts the motion, since the next exposure waits
//! for it. How long it takes is told beside, counted from the move. The yardstick is the disk: a file of the picture's
//! size, written and synced.

mod common;
#[path = "../tests/support/ptp_camera/mod.rs"]
mod ptp_camera;
#[path = "../tests/support/skip.rs"]
mod skip;

use common::{median_s, rig, tell};
use grainrig::rig::{Camera as _, RotationStage as _, simulated::open};
use grainrig::session::Recording;
use grainrig::session::event::EventKind;
use grainrig_core::geometry::Angle;
use ptp_camera::{Personality, PtpCamera, Served, Setup, speaks_ptpip};
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::SystemTime;

const VIEWS: usize = 26;
/// All the motion there is: the simulated stage turns in no time. A real one takes longer.
const SETTLE_MS: u64 = 150;
const MOTION_S: f64 = SETTLE_MS as f64 * 1e-3;
/// Canon's button, and the ways in which a file is fetched.
const BUTTON: u16 = 0x9128;
const FETCHES: [u16; 3] = [0x1009, 0x101b, 0x9107];

fn main() {
    if !speaks_ptpip() {
        return;
    }
    for (width, height) in [(1296, 864), (5184, 3456)] {
        let (mut stage, mut camera, _) = open(&rig(width, height)).expect("the built-in grain");
        let pictures: Vec<Vec<u8>> = (0..VIEWS)
            .map(|view| {
                stage.move_to(Angle::from_deg(7.2 * view as f64)).expect("the simulated stage");
                camera.capture().expect("the simulated camera").bytes
            })
            .collect();
        let pictures = Arc::new(pictures);
        let folder = tempfile::tempdir().expect("a folder");
        let disk = median_s(|| written(folder.path(), &pictures[0]));
        let megabytes = pictures[0].len() as f64 * 1e-6;
        for gate in ["gate", "off"] {
            let views = captured(&pictures, (width, height), gate);
            let size = format!("{width} × {height} px, {megabytes:.1} MB");
            let part = |what: &str, of: fn(&View) -> f64| {
                let seconds = median(views.iter().map(of));
                tell(what, &size, seconds, "", ("written and synced", disk));
            };
            let asked = median(views.iter().map(|v| v.asked as f64));
            println!("quality = {gate:?}; the camera is asked {asked} times a view");
            part("a view", |v| v.all);
            part("  the camera: shutter", |v| v.shutter);
            part("  the camera: transfer", |v| v.transfer);
            part("  the motion", |_| MOTION_S);
            part("  grainrig", |v| v.all - v.shutter - v.transfer - MOTION_S);
            part("    before the shutter", |v| v.before - MOTION_S);
            part("    until the transfer", |v| v.noticed);
            part("    after the transfer", |v| v.after);
            part("  kept behind motion", |v| v.kept);
        }
    }
}

/// Seconds of one view.
struct View {
    all: f64,
    before: f64,
    shutter: f64,
    noticed: f64,
    transfer: f64,
    after: f64,
    /// From the move away from it until the picture is durable.
    kept: f64,
    /// Operations that the camera was asked for.
    asked: usize,
}

fn written(folder: &Path, bytes: &[u8]) {
    let mut file = std::fs::File::create(folder.join("picture")).expect("a file");
    file.write_all(bytes).and_then(|()| file.sync_all()).expect("a disk");
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// The views of a run but the first, in which the program gets warm, and the last, which no move follows.
fn captured(pictures: &Arc<Vec<Vec<u8>>>, (width, height): (usize, usize), gate: &str) -> Vec<View> {
    let folder = tempfile::tempdir().expect("a folder");
    let served = Arc::clone(pictures);
    let camera = PtpCamera::start(Setup::new(Personality::Eos), move |n| served[n].clone());
    let scale = rig(width, height).mm_per_px;
    let config = format!(
        "[rig]\nkind = \"hardware\"\nstage = \"simulated\"\ncamera = \"gphoto2\"\n[plan]\nsettle_ms = {SETTLE_MS}\n\
         [acquire]\nquality = \"{gate}\"\n[optics]\nmm_per_px = {scale}\n[report]\npictures = false\n\
         [gphoto2]\nmodel = \"{}\"\nport = \"{}\"\nset = {{ iso = \"100\", aperture = \"8\", shutterspeed = \"1/60\" }}\n\
         require = {{ autoexposuremode = \"Manual\", focusmode = \"Manual\" }}\n",
        camera.model(),
        camera.address()
    );
    let file = folder.path().join("overhead.toml");
    std::fs::write(&file, config).expect("a configuration");
    let data = folder.path().join("data");
    let ran = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .arg("--data")
        .arg(&data)
        .arg("--config")
        .arg(&file)
        .args(["capture", "a"])
        .output()
        .expect("the program");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let session = Recording::read(&data.join("a")).expect("the session");
    let times = |of: fn(&EventKind) -> bool| -> Vec<SystemTime> {
        session.events().iter().filter(|e| of(&e.what)).map(|e| SystemTime::from(e.time)).collect()
    };
    let moves = times(|what| matches!(what, EventKind::Moving { .. }));
    let kept = times(|what| matches!(what, EventKind::Captured { .. }));
    let (served, exposed) = (camera.served(), camera.exposed());
    assert_eq!((moves.len(), exposed.len()), (VIEWS, VIEWS), "a view was taken again");
    (1..VIEWS - 1).map(|n| view([moves[n], moves[n + 1], kept[n]], exposed[n], &served)).collect()
}

fn view([from, to, kept]: [SystemTime; 3], exposed: SystemTime, served: &[Served]) -> View {
    let seconds = |a: SystemTime, b: SystemTime| b.duration_since(a).map_or(0.0, |d| d.as_secs_f64());
    let mine = || served.iter().filter(|s| (from..to).contains(&s.began));
    // Half-way, then all the way down.
    let pressed = mine().filter(|s| s.operation == BUTTON).nth(1).expect("a full press").began;
    let fetches: Vec<&Served> = mine().filter(|s| FETCHES.contains(&s.operation)).collect();
    let (first, last) = (fetches[0].began, fetches[fetches.len() - 1].ended);
    View {
        all: seconds(from, to),
        before: seconds(from, pressed),
        shutter: seconds(pressed, exposed),
        noticed: seconds(exposed, first),
        transfer: seconds(first, last),
        after: seconds(last, to),
        kept: seconds(to, kept),
        asked: mine().count(),
    }
}
