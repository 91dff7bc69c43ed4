//! The real v4l crate before a device in user space, which `tests/support/video_camera` is.
//!
//! The device comes into a process when that process starts, so each test runs itself again with it.

use crate::bench::{Bench, SCENES, scene};
use crate::conformance::conforms;
use crate::kit::{Lab, VIEWS, pictures};
use crate::video_camera::{DEVICE, FOLDER, library, yuyv};
use grainrig::rig::v4l::{PixelFormat, Settings, V4lCamera};
use grainrig::rig::{Camera as _, Encoding, RigError};
use grainrig::session::State;
use grainrig::session::event::EventKind;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;

/// Whether the device is in this process. Where it is not, runs the named test again in one that has it.
fn inside(test: &str) -> bool {
    if std::env::var_os(FOLDER).is_some() {
        return true;
    }
    let Some(library) = library() else { return false };
    let dir = tempfile::tempdir().unwrap();
    let ran = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &format!("video::{test}"), "--nocapture"])
        .env("LD_PRELOAD", library)
        .env(DEVICE, dir.path().join("video9"))
        .env(FOLDER, dir.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success() && said.contains("1 passed"), "{said}");
    false
}

/// What the device delivers, written so that it never sees half of it.
fn put(name: &str, bytes: &[u8]) {
    let folder = PathBuf::from(std::env::var_os(FOLDER).unwrap());
    std::fs::write(folder.join("new"), bytes).unwrap();
    std::fs::rename(folder.join("new"), folder.join(name)).unwrap();
}

fn fault(word: &str) {
    put("fault", word.as_bytes());
}

fn settings(format: PixelFormat) -> Settings {
    let controls = [
        ("auto_exposure", 1),
        ("exposure_time_absolute", 100),
        ("white_balance_automatic", 0),
        ("white_balance_temperature", 5000),
    ];
    Settings {
        device: std::env::var_os(DEVICE).unwrap().into(),
        format,
        width: 324,
        height: 216,
        controls: controls.map(|(name, value)| (name.to_owned(), value)).into(),
        frame_s: 0.5,
        retry_s: vec![0.02, 0.05],
        suspend_s: 0.5,
        ..Settings::default()
    }
}

fn open(settings: &Settings) -> V4lCamera {
    put("frame", &pictures()[0]);
    V4lCamera::open(settings).unwrap()
}

/// The next picture shows this scene.
fn shows(camera: &mut V4lCamera, n: usize) {
    put("frame", &pictures()[n]);
    assert_eq!(scene(&camera.capture().unwrap()), n);
}

#[test]
fn a_video_camera_conforms_and_never_delivers_what_was_before_it_earlier() {
    if !inside("a_video_camera_conforms_and_never_delivers_what_was_before_it_earlier") {
        return;
    }
    put("frame", &pictures()[0]);
    let camera = Box::new(open(&settings(PixelFormat::Mjpeg)));
    conforms("mjpeg", Bench { camera, set: Box::new(|n| put("frame", &pictures()[n])) });
    put("frame", &yuyv(&pictures()[0]));
    let camera = Box::new(V4lCamera::open(&settings(PixelFormat::Yuyv)).unwrap());
    assert!(camera.describe().contains("yuyv as PNG"), "{}", camera.describe());
    conforms("yuyv", Bench { camera, set: Box::new(|n| put("frame", &yuyv(&pictures()[n]))) });
}

#[test]
fn mjpeg_is_archived_as_it_comes() {
    if !inside("mjpeg_is_archived_as_it_comes") {
        return;
    }
    let mut camera = open(&settings(PixelFormat::Mjpeg));
    for n in 0..SCENES {
        put("frame", &pictures()[n]);
        let frame = camera.capture().unwrap();
        assert_eq!((frame.bytes == pictures()[n], frame.encoding), (true, Encoding::Jpeg));
    }
}

#[test]
fn what_passes_is_got_over() {
    if !inside("what_passes_is_got_over") {
        return;
    }
    let mut camera = open(&settings(PixelFormat::Mjpeg));
    shows(&mut camera, 1);
    for (n, word) in ["stall", "cut", "gone", "forgets"].into_iter().enumerate() {
        fault(word);
        put("frame", &pictures()[n % SCENES]);
        let mut given_up = 0;
        std::thread::scope(|scope| {
            let capturing = scope.spawn(|| {
                loop {
                    match camera.capture() {
                        Ok(frame) => return frame,
                        Err(RigError::Suspended { .. }) => given_up += 1,
                        Err(e) => panic!("{word}: {e}"),
                    }
                }
            });
            // It meets the fault for a while; what it does meanwhile is its own business.
            let _ = std::sync::mpsc::channel::<()>().1.recv_timeout(std::time::Duration::from_millis(700));
            fault("");
            assert_eq!(scene(&capturing.join().unwrap()), n % SCENES, "{word}");
        });
        shows(&mut camera, (n + 1) % SCENES);
    }
}

#[test]
fn what_stays_is_told_with_its_remedy() {
    if !inside("what_stays_is_told_with_its_remedy") {
        return;
    }
    let told = |changed: &Settings| -> String {
        match V4lCamera::open(changed) {
            Err(RigError::Suspended { cause, remedy, .. }) => format!("{cause}; {remedy}"),
            Err(e) => panic!("{e}"),
            Ok(_) => panic!("it opens"),
        }
    };
    let good = settings(PixelFormat::Mjpeg);
    put("frame", &pictures()[0]);
    for (word, parts) in [
        ("gone", ["is not there", "put the camera's cable in"]),
        ("held", ["is used", "end the program that uses the camera"]),
        ("bandwidth", ["USB bandwidth does not suffice", "a USB port of its own"]),
        ("stall", ["fails to stream", "cable"]),
    ] {
        fault(word);
        let text = told(&good);
        assert!(parts.iter().all(|p| text.contains(p)), "{word}: {text}");
    }
    fault("");
    let control = |name: &str, value: i64| {
        let mut changed = good.clone();
        changed.controls = BTreeMap::from([(name.to_owned(), value)]);
        told(&changed)
    };
    let size = told(&Settings { width: 640, ..good.clone() });
    assert!(size.contains("gives 324 × 216 px as MJPG where 640 × 216 px as mjpeg are asked for"), "{size}");
    let unknown = control("zoom", 1);
    assert!(unknown.contains("no control zoom; it has auto_exposure, exposure_time_absolute"), "{unknown}");
    let range = control("auto_exposure", 9);
    assert!(range.contains("auto_exposure can't be 9 (0 to 3)"), "{range}");
    let governed = control("exposure_time_absolute", 100);
    assert!(governed.contains("while an automatic one governs it"), "{governed}");
    // A fault that stays while it captures.
    let mut camera = open(&good);
    shows(&mut camera, 1);
    fault("cut");
    let Err(RigError::Suspended { cause, .. }) = camera.capture() else { panic!("half a picture") };
    assert!(cause.contains("cut off"), "{cause}");
    fault("");
    shows(&mut camera, 2);
}

#[test]
fn a_run_of_the_real_program_shows_each_view_at_its_own_angle() {
    let Some(library) = library() else { return };
    let lab = Lab::new();
    let folder = lab.path("video");
    std::fs::create_dir(&folder).unwrap();
    let put = |n: usize| {
        let new = folder.join("new");
        std::fs::write(&new, &pictures()[n]).unwrap();
        std::fs::rename(new, folder.join("frame")).unwrap();
    };
    put(0);
    let device = format!("device = '{}'", folder.join("video9").display());
    let rig = ["kind = 'hardware'", "stage = 'simulated'", "camera = 'v4l2'"].map(|line| ("rig", line));
    let video = [&device, "width = 324", "height = 216", "shot_s = 20.0"].map(|line| ("v4l2", line));
    // A move takes more than a second, in which the scene changes.
    let changes = [&rig[..], &video[..], &[("simulated", "realtime = true")]].concat();
    let mut command = lab.command(&["--config", &lab.config(&changes), "capture", "a"]);
    command.env("LD_PRELOAD", library).env(DEVICE, folder.join("video9")).env(FOLDER, &folder);
    let mut running =
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    let ended = loop {
        if let Some(status) = running.try_wait().unwrap() {
            break status;
        }
        if let Ok(recording) = grainrig::session::Recording::read(&lab.session("a")) {
            let view = |what: &EventKind| match what {
                EventKind::Moving { view, .. } => Some(*view),
                _ => None,
            };
            put(recording.events().iter().rev().find_map(|e| view(&e.what)).unwrap_or(0));
        }
        std::thread::yield_now();
    };
    assert!(ended.success());
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len()), (State::Complete, VIEWS));
    for n in 0..VIEWS {
        assert!(recording.frame(n).unwrap().bytes == pictures()[n], "view {n} shows another angle");
    }
    assert!(recording.manifest().devices[1].contains("Simulated video camera"));
}
