//! A capture that is killed, interrupted or fails at any time goes on with `resume`.

use crate::kit::{self, Lab, Ran, VIEWS, read};
use grainrig::session::event::{Event, EventKind};
use grainrig::session::{Session, State};
use std::collections::BTreeMap;

/// Slow enough that the next view is not there before a signal is sent.
const SETTLE: &str = "settle_ms = 150";

/// The first move takes hours.
const STUCK: &str = "realtime = true\nspeed_deg_per_s = 0.001";

fn start(lab: &Lab, config: &str) -> kit::Running {
    lab.start(&["--config", config, "capture", "a"])
}

/// Hash of each view that the journal has.
fn captured(lab: &Lab) -> BTreeMap<usize, String> {
    lab.recording("a").views().map(|v| (v.view, v.sha256.clone())).collect()
}

/// Resumes a session and asserts that it is complete, that what was there is still the same, and that nothing
/// was captured twice; the hull's volume.
fn resumed(lab: &Lab, before: &BTreeMap<usize, String>) -> f64 {
    let ran = lab.run(&["--json", "resume", "a"]).succeeds();
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len()), (State::Complete, VIEWS));
    let takes = recording.events().iter().filter(|e| matches!(e.what, EventKind::Captured { .. })).count();
    assert_eq!(takes, VIEWS, "each view is taken once");
    let after = captured(lab);
    assert!(before.iter().all(|(view, hash)| after[view] == *hash), "what was captured stays");
    lab.assert_sound("a");
    let product = ran.json()["products"]["inp"].as_str().unwrap().to_owned();
    assert!(std::path::Path::new(&product).is_file(), "{product}");
    ran.json()["hull"]["volume_mm3"].as_f64().unwrap()
}

#[test]
fn a_run_killed_at_any_line_that_it_says_loses_no_view_and_is_resumed() {
    let whole = Lab::new();
    let ran = whole.run(&["--json", "--config", "small.toml", "capture", "a"]).succeeds();
    let volume = ran.json()["hull"]["volume_mm3"].as_f64().unwrap();
    let lines = ran.stderr.lines().count();
    assert!(lines > VIEWS + 3, "{}", ran.stderr);
    for line in 0..lines {
        let lab = Lab::new();
        let mut running = start(&lab, &lab.config(&[("plan", SETTLE)]));
        let mut announced = 0;
        for _ in 0..=line {
            announced += usize::from(running.next_line().is_some_and(|l| l.starts_with("view ")));
        }
        running.kill();
        let before = captured(&lab);
        assert!(before.len() >= announced, "{announced} views were announced, {} are there", before.len());
        let again = resumed(&lab, &before);
        let off = (again / volume - 1.0).abs();
        assert!(off < 1e-3, "killed after line {line}: {again} mm³ instead of {volume} mm³");
    }
}

#[test]
fn a_run_killed_again_and_again_still_comes_to_its_end() {
    let lab = Lab::new();
    let config = lab.config(&[("plan", SETTLE)]);
    let mut running = start(&lab, &config);
    for _ in 0..VIEWS {
        running.wait_for("view ");
        running.kill();
        if lab.recording("a").views().len() == VIEWS {
            break;
        }
        running = lab.start(&["resume", "a"]);
    }
    resumed(&lab, &captured(&lab));
}

#[test]
fn a_journal_that_is_removed_in_mid_run_is_put_back_and_a_lost_picture_is_not_called_complete() {
    let lab = Lab::new();
    let config = lab.config(&[("plan", "settle_ms = 500")]);
    let mut running = start(&lab, &config);
    running.wait_for("view 1 ");
    for file in ["journal.jsonl", "manifest.json"] {
        std::fs::remove_file(lab.session("a").join(file)).unwrap();
    }
    let ran = running.end().succeeds();
    assert!(ran.stderr.contains("was removed during the run and is put back"), "{}", ran.stderr);
    assert_eq!((lab.recording("a").state(), captured(&lab).len()), (State::Complete, VIEWS));
    lab.assert_sound("a");

    let mut running = lab.start(&["--config", &config, "capture", "b"]);
    running.wait_for("view 1 ");
    std::fs::remove_file(lab.session("b").join("frames/view_000.jpg")).unwrap();
    running.end().fails(1, &["view_000.jpg is not there any more", "restore it"]);
    assert_eq!(lab.recording("b").state(), State::Failed);
}

#[test]
fn ctrl_c_stops_after_the_view_in_hand_and_says_how_to_go_on() {
    let lab = Lab::new();
    let mut running = start(&lab, &lab.config(&[("plan", "settle_ms = 500")]));
    running.wait_for("view 1 ");
    running.interrupt();
    let parts =
        ["stopping after the view in hand", "the run was stopped after", "`grainrig resume a` goes on"];
    running.end().fails(1, &parts);
    let recording = lab.recording("a");
    assert_eq!(recording.state(), State::Aborted);
    assert!((2..VIEWS).contains(&recording.views().len()));
    lab.assert_sound("a");
    resumed(&lab, &captured(&lab));
}

#[test]
fn a_second_ctrl_c_stops_at_once_even_where_a_device_does_not_answer() {
    let lab = Lab::new();
    let mut running = start(&lab, &lab.config(&[("simulated", STUCK)]));
    running.wait_for("view 0 ");
    let moving = |e: &Event| matches!(e.what, EventKind::Moving { view: 1, .. });
    while !lab.recording("a").events().iter().any(moving) {
        std::thread::yield_now();
    }
    running.interrupt();
    running.wait_for("stopping after the view in hand");
    running.interrupt();
    running.end().fails(1, &["stopped at once", "`grainrig resume` goes on"]);
    assert_eq!((lab.recording("a").state(), captured(&lab).len()), (State::Interrupted, 1));
    lab.assert_sound("a");
}

#[test]
fn ctrl_c_in_the_computation_ends_it_and_loses_no_view() {
    let lab = Lab::new();
    // A mesh that takes far longer than a signal.
    let mut running = start(&lab, &lab.config(&[("mesh", "surface_size_mm = 0.008")]));
    running.wait_for("computing: mesh");
    running.interrupt();
    running.end().fails(1, &["all views are captured", "`grainrig resume` computes the rest"]);
    assert_eq!((lab.recording("a").state(), captured(&lab).len()), (State::Captured, VIEWS));
    lab.assert_sound("a");
}

#[test]
fn a_complete_session_has_nothing_to_resume_and_is_left_as_it_is() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let (journal, products) = (read(&lab.session("a").join("journal.jsonl")), lab.products("a"));
    let ran = lab.run(&["resume", "a"]).succeeds();
    assert!(ran.stderr.contains("session a is complete: its 5 views are captured"), "{}", ran.stderr);
    let result = lab.run(&["--json", "resume", "a"]).succeeds().json();
    assert_eq!(result["views"], 4);
    assert_eq!(
        (read(&lab.session("a").join("journal.jsonl")), lab.products("a")),
        (journal.clone(), products.clone())
    );
    // Without a product it is not complete; that is made again, the same.
    std::fs::remove_file(lab.session("a").join("products/grain.inp")).unwrap();
    std::fs::write(lab.session("a").join("products/grain.stl"), b"damaged").unwrap();
    let ran = lab.run(&["resume", "a"]).succeeds();
    assert!(ran.stderr.contains("made again") && !ran.stderr.contains("nothing is left"), "{}", ran.stderr);
    assert_eq!((read(&lab.session("a").join("journal.jsonl")), lab.products("a")), (journal, products));
    // Moved elsewhere, its products are where it is.
    std::fs::rename(lab.session("a"), lab.path("b")).unwrap();
    let result = lab.run(&["--json", "resume", "./b"]).succeeds().json();
    let inp = result["products"]["inp"].as_str().unwrap().to_owned();
    assert_eq!(std::path::Path::new(&inp), lab.path("b").canonicalize().unwrap().join("products/grain.inp"));
}

#[test]
fn a_computation_that_failed_is_done_again_without_the_rig() {
    let lab = Lab::new();
    // No silhouette is that large, so each attempt fails in the same way, and takes no picture again.
    let label = ("acquire", "quality = 'label'");
    let config = lab.config(&[("silhouette", "min_area_px = 60000.0"), label]);
    let ran: Ran = lab.run(&["--config", &config, "capture", "a"]);
    ran.fails(1, &["error: view ", "no grain in view"]);
    let before = captured(&lab);
    assert_eq!((lab.recording("a").state(), before.len()), (State::Failed, VIEWS));
    let again = lab.run(&["resume", "a"]).fails(1, &["error: view ", "no grain in view"]);
    assert!(again.stderr.contains("all 5 views are there"), "{}", again.stderr);
    assert_eq!(captured(&lab), before);
    assert!(!lab.recording("a").events().iter().skip(20).any(|e| matches!(e.what, EventKind::Homed)));
}

#[test]
fn a_session_that_somebody_writes_is_locked_for_others_but_may_be_read() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let held = Session::open(&lab.session("a")).unwrap();
    let holder = format!("is being written by process {}", std::process::id());
    for command in ["resume", "reconstruct", "mesh"] {
        lab.run(&[command, "a"]).fails(1, &[&holder, "wait for it, or stop it"]);
    }
    lab.run(&["replay", "a"]).succeeds();
    lab.run(&["verify", "a"]).succeeds();
    drop(held);
    lab.run(&["reconstruct", "a"]).succeeds();
}

#[test]
fn two_runs_of_one_session_never_write_together() {
    let lab = Lab::new();
    let mut running = start(&lab, &lab.config(&[("simulated", STUCK)]));
    running.wait_for("view 0 ");
    lab.run(&["resume", "a"]).fails(1, &["is being written by process"]);
    running.kill();
    assert_eq!(captured(&lab).len(), 1);
    lab.assert_sound("a");
}
