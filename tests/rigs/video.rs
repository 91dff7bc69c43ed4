//! The firmware's stage and a video camera.

use crate::board::Board;
use crate::grain::{Grain, SETTINGS, VIEW, VIEWS, controller, figure, simulated};
use crate::kit::{Lab, Ran};
use crate::video_camera::{DEVICE, FOLDER, SCENE, SIZE, answer, library, yuyv};
use grainrig::session::sha256_hex;
use serde_json::Value;
use std::os::unix::net::UnixListener;
use std::sync::{Arc, Mutex};

#[test]
fn the_firmware_and_a_video_camera_give_what_the_simulated_rig_gives() {
    let Some(library) = library() else { return };
    let lab = Lab::new();
    let ideal = simulated(&lab, "simulated");
    for format in ["yuyv", "mjpeg"] {
        let Some(board) = Board::start(0, -1_000_000) else { return };
        let board = Arc::new(Mutex::new(board));
        // What a sensor gives, before it is made a JPEG by the camera or not at all.
        let quality = if format == "yuyv" { 100 } else { 95 };
        let mut grain = Grain::new(&lab, &board, |s| s.jpeg_quality = quality);
        let exposed = grain.exposed();
        let folder = lab.path(format);
        std::fs::create_dir(&folder).unwrap();
        let scene = folder.join("scene");
        answer(UnixListener::bind(&scene).unwrap(), move || {
            let jpeg = grain.photograph();
            if format == "yuyv" { yuyv(&jpeg) } else { jpeg }
        });
        let device = folder.join("video9");
        let rig = "[rig]\nkind = \"hardware\"\nstage = \"controller\"\ncamera = \"v4l2\"\n";
        let video = format!(
            "[v4l2]\ndevice = \"{}\"\nformat = \"{format}\"\nwidth = 640\nheight = 480\n\
             frame_s = 30.0\nshot_s = 60.0\n\
             controls = {{ auto_exposure = 1, exposure_time_absolute = 100 }}\n",
            device.display()
        );
        let config = [SETTINGS, rig, &video, &controller(&board.lock().unwrap())].concat();
        let config = lab.write("hardware.toml", config);
        let mut command = lab.command(&["--json", "--config", &config, "capture", format]);
        command.env("LD_PRELOAD", library).env(DEVICE, &device).env(FOLDER, &folder);
        command.env(SCENE, &scene).env(SIZE, "640x480");
        let real = Ran::from(&mut command).succeeds().json();
        let exposed = exposed.lock().unwrap();
        let session = lab.recording(format);
        assert!(session.manifest().devices[1].contains("Simulated video camera"));
        let mut before = None;
        for n in 0..VIEWS {
            let hash = sha256_hex(&session.frame(n).unwrap().bytes);
            // Frames that were begun on the way, or before, are in no view. YUYV becomes a PNG: which it was, nobody knows.
            let at = |(_, (position, made)): &(usize, &(i64, String))| {
                *position == n as i64 * VIEW && (format == "yuyv" || *made == hash)
            };
            let found = exposed.iter().enumerate().find(at).map(|(k, _)| k);
            assert!(
                found.is_some() && found > before,
                "{format}: view {n} was not exposed where it should be"
            );
            before = found;
        }
        alike(&real, &ideal, format);
    }
}

/// By how much a place of an outline may be off for the noise of its pixels, px: the noise over the slope of an edge of this
/// contrast, blurred by a Gaussian. Pixels err each for itself, so that a whole outline is off by a small part of that; what
/// it has in common, the levels of grain and background between which it is laid, does not average, but is known better than
/// a pixel is.
fn noise_px(view: &Value, blur_px: f64) -> f64 {
    let slope = figure(view, "/silhouette/contrast_levels") / (blur_px * std::f64::consts::TAU.sqrt());
    figure(view, "/silhouette/noise_levels") / slope
}

/// Two captures of one grain whose pictures have their own noise and their own shifts.
fn alike(real: &Value, ideal: &Value, what: &str) {
    let blur_px = figure(ideal, "/pedestal/blur_px/value");
    let [mine, theirs] = [real, ideal].map(|r| r["view_details"].as_array().unwrap());
    assert_eq!((mine.len(), theirs.len()), (VIEWS - 1, VIEWS - 1));
    let (mut worst, mut widest) = (0.0_f64, 0.0_f64);
    for (n, (a, b)) in mine.iter().zip(theirs).enumerate() {
        let area = |v: &Value| figure(v, "/silhouette/area_px");
        let shift_px = (area(a) - area(b)) / figure(b, "/silhouette/outline_length_px");
        let limit_px = f64::max(noise_px(a, blur_px), noise_px(b, blur_px));
        assert!(
            shift_px.abs() < limit_px,
            "{what}: view {n}: {shift_px} px off, {limit_px} px are the noise"
        );
        (worst, widest) = (worst.max(shift_px.abs()), widest.max(limit_px));
    }
    // No surface can be off by more than the outlines that it was carved with.
    let surface_mm2 = figure(ideal, "/hull/surface_area_mm2");
    let limit_mm3 = widest * figure(ideal, "/scale_mm_per_px") * surface_mm2;
    let volume_mm3 = figure(ideal, "/hull/volume_mm3");
    for volume in ["/hull/volume_mm3", "/mesh/volume_mm3"] {
        let off_mm3 = figure(real, volume) - figure(ideal, volume);
        assert!(
            off_mm3.abs() < limit_mm3,
            "{what}: {volume} is {off_mm3} mm³ off, {limit_mm3} mm³ are the noise"
        );
    }
    for name in ["axis_column_px", "roll_deg"] {
        let get = |r: &Value, part: &str| figure(r, &format!("/calibration/{name}/{part}"));
        let sigma = get(real, "sigma").hypot(get(ideal, "sigma"));
        let off = get(real, "value") - get(ideal, "value");
        assert!(off.abs() < 3.0 * sigma, "{what}: {name} is {off} off, its uncertainty is {sigma}");
    }
    println!(
        "{what}: outlines within {worst:.3} px in the mean (noise of a place {widest:.3} px), volume {:+.3} % (limit {:.2} %)",
        100.0 * (figure(real, "/hull/volume_mm3") / volume_mm3 - 1.0),
        100.0 * limit_mm3 / volume_mm3
    );
}
