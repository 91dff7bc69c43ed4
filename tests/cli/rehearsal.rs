//! A recovery can be rehearsed: what a real rig does is provoked by configuration, ends the run with cause and remedy, and is
//! over when the run is taken up.

use crate::kit::{Lab, VIEWS};
use grainrig::session::State;

/// A capture that ends with this cause; resumed as often as its tries, it completes and replays byte for byte.
#[track_caller]
fn rehearsed(fault: &str, resumes: usize, parts: &[&str]) {
    let lab = Lab::new();
    let config = lab.config(&[("plan", "retakes = 1")]);
    let text = std::fs::read_to_string(&config).unwrap() + &format!("\n[simulated.faults]\n{fault}\n");
    let config = lab.write("faulty.toml", text);
    let mut ran = lab.run(&["--config", &config, "capture", "a"]);
    for n in 0..resumes {
        let said = ran.fails(1, parts);
        assert!(said.stderr.contains("view 2"), "{fault}, run {n}: {}", said.stderr);
        let recording = lab.recording("a");
        assert_eq!((recording.state(), recording.views().len()), (State::Failed, 2), "{fault}, run {n}");
        lab.assert_sound("a");
        ran = lab.run(&["resume", "a"]);
    }
    ran.succeeds();
    assert_eq!(lab.recording("a").views().len(), VIEWS, "{fault}");
    lab.run(&["replay", "a"]).succeeds();
    lab.assert_sound("a");
}

#[test]
fn a_camera_that_fails_once_is_well_again_on_resuming() {
    rehearsed(
        "fail_capture_at = 2",
        1,
        &["the simulated camera failed at exposure 2", "take the picture again"],
    );
}

#[test]
fn a_camera_that_hangs_is_gone_is_full_or_was_changed_comes_back_after_its_tries() {
    let due = "the next try is due in 60 s";
    rehearsed("camera_hung = { at = 2, tries = 2 }", 2, &["did not answer", "off and on", due]);
    rehearsed("camera_gone = { at = 2, tries = 3 }", 3, &["is not there", "check its cable", due]);
    rehearsed("card_full = { at = 2 }", 1, &["no room left on its card", "put an empty one in", due]);
    rehearsed("settings_changed = { at = 2 }", 1, &["other settings", "set the camera as stated", due]);
}

#[test]
fn a_board_that_starts_anew_or_is_silent_is_homed_on_resuming() {
    rehearsed("board_reset_at = 2", 1, &["has started anew", "the angle is lost", "check its power supply"]);
    rehearsed("board_silent = { at = 2, tries = 2 }", 2, &["does not answer", "check cable and power"]);
}

#[test]
fn a_missed_angle_ends_the_run_with_both_angles() {
    rehearsed(
        "missed_angle = { at = 2, deg = 1.8 }",
        1,
        &["sent to 90.000° and reads 91.800°", "check the coupling"],
    );
}

#[test]
fn a_picture_that_is_cut_off_or_of_another_size_is_taken_again_at_once() {
    for fault in ["wrong_size_at = 2", "truncate_frame_at = 2", "empty_frame_at = 2"] {
        rehearsed(fault, 0, &[]);
    }
    // Two in a row are more than the one retake; the third is good again.
    rehearsed("wrong_size_at = 3\ntruncate_frame_at = 2", 1, &["2 of 2 pictures were bad", "162 × 108 px"]);
}

#[test]
fn a_slow_camera_only_takes_its_time() {
    rehearsed("camera_slow = { at = 2, seconds = 30.0 }", 0, &[]);
}

#[test]
fn an_outage_without_tries_or_beyond_its_limits_is_refused() {
    let lab = Lab::new();
    for (fault, part) in [
        ("camera_gone = { at = 2, tries = 0 }", "faults.camera_gone.tries is 0 tries"),
        ("suspend_s = 0.0", "faults.suspend_s is 0 s"),
        ("missed_angle = { at = 1, deg = nan }", "faults.missed_angle.deg is NaN"),
    ] {
        let config = lab.write("bad.toml", format!("[simulated.faults]\n{fault}\n"));
        lab.run(&["--config", &config, "capture", "a"]).fails(2, &[part]);
    }
    assert!(!lab.path("data").exists());
}
