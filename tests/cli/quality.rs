//! Pictures that are whole but no good: the camera takes them again, the run is suspended where that does not help,
//! and a folder of photographs is labelled.

use super::kit::{Lab, Ran, read};
use grainrig::rig::simulated::{self, Faults, Settings};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig::session::State;
use grainrig::session::event::EventKind;
use grainrig_core::geometry::Angle;
use serde_json::Value;

/// Views of a plan whose neighbours are 7.2° apart.
const VIEWS: usize = 9;
const PLAN: &str = "views = 8\nsteps_per_view = 8\nretakes = 1";

/// A capture in which one exposure is spoiled.
fn capture(lab: &Lab, name: &str, fault: &str, more: &[&str]) -> Ran {
    let faults = format!("faults = {{ {fault} }}");
    let config = lab.config(&[("plan", PLAN), ("simulated", &faults)]);
    lab.run(&[&["--config", &config, "--json", "capture", name], more].concat())
}

/// The causes for which pictures of this view were refused.
fn refused(lab: &Lab, name: &str, of: usize) -> Vec<String> {
    let cause = |what: &EventKind| match what {
        EventKind::Rejected { view, cause, tries: Some(_) } if *view == of => Some(cause.clone()),
        _ => None,
    };
    lab.recording(name).events().iter().filter_map(|e| cause(&e.what)).collect()
}

fn volume(ran: &Ran) -> f64 {
    ran.json()["hull"]["volume_mm3"].as_f64().unwrap()
}

/// Each view's verdict, as `result.json` has it.
fn verdicts(lab: &Lab, name: &str) -> Vec<(u64, String, Vec<String>)> {
    let result: Value =
        serde_json::from_slice(&read(&lab.session(name).join("products/result.json"))).unwrap();
    let one = |view: &Value| {
        let quality = &view["quality"];
        let names = quality["checks"].as_array().unwrap().iter().filter(|c| c["verdict"] != "good");
        let text = |v: &Value| v.as_str().unwrap().to_owned();
        (
            view["index"].as_u64().unwrap(),
            text(&quality["verdict"]),
            names.map(|c| text(&c["name"])).collect(),
        )
    };
    result["view_details"].as_array().unwrap().iter().map(one).collect()
}

#[test]
fn a_picture_that_is_no_good_once_is_taken_again_and_the_result_is_as_without_it() {
    let lab = Lab::new();
    let clean = volume(&capture(&lab, "clean", "", &[]).succeeds());
    assert!(verdicts(&lab, "clean").iter().all(|v| v.1 == "good"), "{:?}", verdicts(&lab, "clean"));
    let faults = [
        ("blurred", "focus is "),
        ("shaken", "motion is "),
        ("overexposed", "exposure is "),
        ("repeated", "duplicate is "),
        ("obstructed", "the grain reaches the top border"),
    ];
    for (fault, named) in faults {
        let ran = capture(&lab, fault, &format!("{fault}_frame_at = 3"), &[]).succeeds();
        let causes = refused(&lab, fault, 3);
        assert!(causes.len() == 1 && causes[0].contains(named), "{fault}: {causes:?}");
        let said = format!("view 3: picture 1 is no good: {}", causes[0]);
        assert!(ran.stderr.contains(&said), "{}", ran.stderr);
        assert!((volume(&ran) / clean - 1.0).abs() < 1e-3, "{fault}: {} instead of {clean}", volume(&ran));
        assert!(verdicts(&lab, fault).iter().all(|v| v.1 == "good"), "{:?}", verdicts(&lab, fault));
        assert_eq!(lab.recording(fault).views().len(), VIEWS);
        lab.assert_sound(fault);
    }
}

#[test]
fn an_overexposed_picture_is_taken_again_however_far_apart_the_views_are() {
    for views in ["6", "10"] {
        let lab = Lab::new();
        let volumes = ["", "overexposed_frame_at = 3"].map(|fault| {
            let faults = format!("faults = {{ {fault} }}");
            let config = lab.config(&[("plan", "retakes = 1"), ("simulated", &faults)]);
            let name = if fault.is_empty() { "clean" } else { "spoiled" };
            volume(&lab.run(&["--config", &config, "--json", "capture", name, "--views", views]).succeeds())
        });
        let causes = refused(&lab, "spoiled", 3);
        assert!(causes.len() == 1 && causes[0].contains("exposure "), "{views} views: {causes:?}");
        assert!((volumes[1] / volumes[0] - 1.0).abs() < 2e-3, "{views} views: {volumes:?}");
        assert!(refused(&lab, "clean", 3).is_empty());
    }
}

#[test]
fn a_picture_that_stays_no_good_suspends_the_run_which_goes_on_once_it_is_mended() {
    let lab = Lab::new();
    let faults: [(&str, &[&str]); 5] = [
        ("blurred", &["focus", " px, the limit is ", "focus the lens"]),
        ("shaken", &["motion", " px, the limit is ", "settle longer"]),
        ("overexposed", &["exposure", " grey levels, the limit is ", "keep lamp"]),
        ("repeated", &["duplicate", "view 4, noise and all"]),
        ("obstructed", &["reaches the top border", "centre the grain"]),
    ];
    for (fault, parts) in faults {
        let stays = format!("{fault}_frame_at = 5, frame_faults_last = 2");
        let ran = capture(&lab, fault, &stays, &[]);
        ran.fails(
            1,
            &[parts, &["view 5: none of 2 picture(s)", "grainrig resume", "--quality label"]].concat(),
        );
        let recording = lab.recording(fault);
        assert_eq!((recording.state(), recording.views().len()), (State::Failed, 5), "{fault}");
        assert_eq!(refused(&lab, fault, 5).len(), 2, "{fault}");
        lab.assert_sound(fault);
        let before: Vec<_> = recording.views().map(|v| v.sha256.clone()).collect();
        // Exposures are counted through the whole session: the fault has come and gone.
        lab.run(&["resume", fault]).succeeds();
        let after = lab.recording(fault);
        assert_eq!((after.state(), after.views().len()), (State::Complete, VIEWS), "{fault}");
        assert!(after.views().map(|v| v.sha256.clone()).collect::<Vec<_>>().starts_with(&before));
        assert!(verdicts(&lab, fault).iter().all(|v| v.1 == "good"), "{:?}", verdicts(&lab, fault));
        lab.assert_sound(fault);
    }
}

#[test]
fn what_may_not_be_taken_again_is_kept_and_labelled_or_not_looked_at() {
    let lab = Lab::new();
    // Two tries, and the one of the resumed run.
    let stays = "blurred_frame_at = 5, frame_faults_last = 3";
    capture(&lab, "a", stays, &[]).fails(1, &["view 5"]);
    lab.run(&["resume", "--quality", "label", "a"]).succeeds();
    assert_eq!(lab.recording("a").state(), State::Complete);

    let ran = capture(&lab, "labelled", "shaken_frame_at = 3", &["--quality", "label"]).succeeds();
    assert!(refused(&lab, "labelled", 3).is_empty());
    for (view, verdict, checks) in verdicts(&lab, "labelled") {
        assert_eq!(verdict, if view == 3 { "bad" } else { "good" }, "view {view}: {checks:?}");
    }
    let warnings = ran.json()["warnings"].to_string();
    assert!(warnings.contains("view 3: motion is"), "{warnings}");

    let ran = capture(&lab, "off", "shaken_frame_at = 3", &["--quality", "off"]).succeeds();
    assert!(ran.json()["view_details"][3]["quality"].is_null());
    assert!(!ran.stderr.contains("motion"), "{}", ran.stderr);
    capture(&lab, "b", "", &["--quality", "maybe"]).fails(2, &["maybe", "gate", "label", "off"]);
}

#[test]
fn an_import_labels_just_the_pictures_that_are_no_good() {
    let lab = Lab::new();
    let faults = Faults {
        blurred_frame_at: Some(3),
        repeated_frame_at: Some(7),
        overexposed_frame_at: Some(11),
        ..Faults::default()
    };
    let settings = Settings { width: 324, height: 216, mm_per_px: 0.009, faults, ..Settings::default() };
    let (mut stage, mut camera, _) = simulated::open(&settings).unwrap();
    for n in 0..16 {
        stage.move_to(Angle::from_deg(7.2 * f64::from(n))).unwrap();
        lab.write(&format!("photos/photo_{n}.jpg"), camera.capture().unwrap().bytes);
    }
    let import = ["--config", "small.toml", "import", "photos", "--mm-per-px", "0.009"];
    let ran = lab.run(&[&import[..], &["--axis-column-px", "167.8"]].concat()).succeeds();
    let expected = [(3, "focus"), (7, "duplicate"), (11, "exposure")];
    for (view, verdict, checks) in verdicts(&lab, "photos") {
        match expected.iter().find(|e| e.0 == view) {
            Some((_, name)) => {
                assert_eq!(verdict, "bad", "view {view}: {checks:?}");
                assert!(checks.iter().any(|c| c == name), "view {view}: {checks:?}");
                assert!(ran.stdout.contains(&format!("view {view}: {name} is ")), "{}", ran.stdout);
            }
            None => assert_eq!((verdict.as_str(), checks.len()), ("good", 0), "view {view}: {checks:?}"),
        }
    }
}
