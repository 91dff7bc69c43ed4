//! What every camera promises, whatever it is made of.

use crate::bench::{Bench, SCENES, scene};
use crate::kit::{Lab, MM_PER_PX, SIZE};
use grainrig::rig::simulated::{self, Settings};
use grainrig::rig::{Encoding, RotationStage};
use grainrig::session::Recording;
use grainrig::session::picture::decode_check;
use grainrig::session::replay::replay;
use grainrig_core::geometry::Angle;

/// At the rig, with any camera and anything before it: `GRAINRIG_CAMERA=my.toml cargo test --features gphoto2,v4l --test
/// cameras at_the_rig -- --ignored`.
#[test]
#[ignore = "needs rig"]
fn the_camera_at_the_rig_delivers_whole_pictures_one_after_the_other() {
    use grainrig::config::{CameraKind, Config};
    use grainrig::rig::gphoto::{GphotoCamera, Launch};
    use grainrig::rig::{Before, Camera};
    let path = std::env::var_os("GRAINRIG_CAMERA").expect("GRAINRIG_CAMERA names a configuration");
    let config = Config::read(std::path::Path::new(&path)).unwrap();
    let launch = Launch { program: env!("CARGO_BIN_EXE_grainrig").into() };
    let mut camera: Box<dyn Camera> = match config.camera_kind() {
        CameraKind::Simulated => panic!("the configuration has no real camera"),
        // Its process is the program, which this test is not.
        CameraKind::Gphoto2 => Box::new(GphotoCamera::open(&config.gphoto2, launch).unwrap()),
        _ => config.camera().open(Before::default(), None).unwrap().camera,
    };
    println!("{}", camera.describe());
    let mut size = None;
    let mut before = Vec::new();
    for n in 0..30 {
        let frame = camera.capture().unwrap_or_else(|e| panic!("picture {n}: {e}"));
        let (encoding, found) = decode_check(&frame.bytes, size).unwrap();
        assert_eq!(encoding, frame.encoding);
        // Noise alone makes two photographs differ.
        assert!(frame.bytes != before, "picture {n} is the one before it");
        println!("{n}: {} bytes, {} other file(s)", frame.bytes.len(), frame.others.len());
        (size, before) = (Some(found), frame.bytes);
        camera.kept();
    }
}

/// Without the libraries the program still runs, and says what it lacks.
#[cfg(not(any(feature = "gphoto2", feature = "v4l")))]
#[test]
fn a_program_without_the_camera_libraries_says_so() {
    let lab = Lab::new();
    for (camera, text) in
        [("gphoto2", "was built without libgphoto2"), ("v4l2", "without the driver of video cameras")]
    {
        let camera = format!("camera = '{camera}'");
        let rig = ["kind = 'hardware'", "stage = 'simulated'", &camera].map(|line| ("rig", line));
        lab.run(&["--config", &lab.config(&rig), "capture", "a"]).fails(1, &[text, "--features"]);
    }
}

/// Holds a camera to the promises of [`grainrig::rig::Camera`].
pub fn conforms(name: &str, mut bench: Bench) {
    let description = bench.camera.describe();
    assert!(!description.trim().is_empty() && !description.contains('\n'), "{name}: {description:?}");
    let mut size = None;
    for n in 0..2 * SCENES {
        let put = n % SCENES;
        (bench.set)(put);
        let frame = bench.camera.capture().unwrap_or_else(|e| panic!("{name}: picture {n}: {e}"));
        // Whole, of one size, and what the driver says it is.
        let (encoding, found) = decode_check(&frame.bytes, size).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            (encoding, Encoding::sniff(&frame.bytes)),
            (frame.encoding, Some(frame.encoding)),
            "{name}"
        );
        size = Some(found);
        // Of what is before it now, not of what was.
        assert_eq!(scene(&frame), put, "{name}: picture {n}");
        // It may be told more often than there is something to tell.
        for _ in 0..n % 3 {
            bench.camera.kept();
        }
    }
    // What it looks at may change back, and a picture that nobody kept does no harm to the next.
    for put in [2, 0, 2] {
        (bench.set)(put);
        assert_eq!(scene(&bench.camera.capture().unwrap()), put, "{name}");
    }
}

/// Angle of each scene: as the kit photographs them.
pub fn angle(scene: usize) -> Angle {
    Angle::from_deg(45.0 * scene as f64)
}

#[test]
fn the_simulated_camera_conforms() {
    let [width, height] = SIZE.map(|s| s as usize);
    let settings = Settings { width, height, mm_per_px: MM_PER_PX, ..Settings::default() };
    let (mut stage, camera, _) = simulated::open(&settings).unwrap();
    let set = move |scene| {
        stage.move_to(angle(scene)).unwrap();
    };
    conforms("simulated", Bench { camera: Box::new(camera), set: Box::new(set) });
}

#[test]
fn a_recording_conforms() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let (mut stage, camera) = replay(Recording::read(&lab.session("a")).unwrap());
    let set = move |scene| {
        // A recording plays each view once for each homing.
        stage.home().unwrap();
        stage.move_to(angle(scene)).unwrap();
    };
    conforms("replay", Bench { camera: Box::new(camera), set: Box::new(set) });
}
