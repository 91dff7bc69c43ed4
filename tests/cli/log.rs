//! The log tells the story of a run: which job, which view, what was asked of the rig, what came of it and how long it took.

use crate::kit::{Lab, VIEWS};
use serde_json::Value;
use std::collections::BTreeMap;

/// A small capture with this much of the log, in this form; its lines.
fn logged(lab: &Lab, filter: &str, format: &str) -> Vec<String> {
    let mut command = lab.command(&["--config", "small.toml", "--log-format", format, "capture", "a"]);
    let ran = command.env("GRAINRIG_LOG", filter).output().unwrap();
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(ran.status.success(), "{said}");
    said.lines().map(str::to_owned).collect()
}

/// The places at which the lines have these words, one line each, all within the job and the view.
fn story(lines: &[String], view: &str, words: &[&[&str]]) -> Vec<usize> {
    let all = ["job{kind=\"capture\" session=\"a\"}", view];
    let place = |words: &&[&str]| {
        let found = lines.iter().position(|l| all.iter().chain(*words).all(|word| l.contains(word)));
        found.unwrap_or_else(|| panic!("no line of {view} has {words:?} in\n{}", lines.join("\n")))
    };
    words.iter().map(place).collect()
}

#[test]
fn a_view_can_be_followed_through_its_capture() {
    let lab = Lab::new();
    let lines = logged(&lab, "debug", "text");
    let steps: [&[&str]; 6] = [
        &["stage{verb=\"move_to\" target_deg=90", "ms=", "outcome=\"at "],
        &[" move ", "ms=", "outcome=\"done\""],
        &[" settle ", "ms="],
        &["camera{verb=\"capture\"}", "ms=", "bytes"],
        &[" silhouette ", "ms=", "outcome=\"found\"", "area_px="],
        &[" store ", "ms=", "outcome=\"kept\"", "view_002.jpg"],
    ];
    let places = story(&lines, "view{index=2 angle_deg=90", &steps);
    assert!(places.is_sorted(), "{places:?}: {}", lines.join("\n"));
    // The last one's too, which nothing moves after.
    story(&lines, "view{index=4 angle_deg=180", &[&[" store "]]);
    assert!(
        lines
            .iter()
            .any(|l| l.contains("job{kind") && l.contains(" ended ") && l.contains("outcome=\"done\""))
    );
}

#[test]
fn every_line_is_an_object_where_that_is_asked_for() {
    let lab = Lab::new();
    let lines: Vec<Value> = (logged(&lab, "debug", "json").iter())
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}")))
        .collect();
    // What the events of each view are about, by the spans that they are within.
    let mut steps: BTreeMap<u64, Vec<&str>> = BTreeMap::new();
    for line in &lines {
        assert!(line["timestamp"].is_string() && line["level"].is_string(), "{line}");
        let message = line["fields"]["message"].as_str().unwrap();
        let spans = line["spans"].as_array().into_iter().flatten();
        let within = |name: &str| spans.clone().find(|s| s["name"] == name);
        if let Some(view) = within("view") {
            assert_eq!(within("job").map(|job| &job["session"]), Some(&"a".into()), "{line}");
            steps.entry(view["index"].as_u64().unwrap()).or_default().push(message);
        }
    }
    assert_eq!(steps.len(), VIEWS);
    for (view, steps) in steps {
        for step in ["move", "settle", "expose", "silhouette", "store"] {
            assert!(steps.contains(&step), "view {view} has no {step}: {steps:?}");
        }
    }
    // What is said to a person is among them, in the same form.
    let said = |words: &str| lines.iter().any(|l| l["fields"]["message"].as_str().unwrap().contains(words));
    assert!(said("5 of 5 captured"));
    let mut failing = lab.command(&["show", "nothing"]);
    let told = failing.env("GRAINRIG_LOG_FORMAT", "json").output().unwrap().stderr;
    let told: Value = serde_json::from_slice(&told).unwrap();
    assert_eq!(told["level"], "ERROR");
}

#[test]
fn a_log_that_nobody_asked_for_says_nothing_and_a_filter_that_is_none_is_said() {
    let lab = Lab::new();
    for line in lab.capture("quiet").succeeds().stderr.lines() {
        assert!(!line.contains("DEBUG") && !line.contains("job{"), "{line}");
    }
    let mut command = lab.command(&["list"]);
    let told =
        String::from_utf8(command.env("GRAINRIG_LOG", "grainrig=loud").output().unwrap().stderr).unwrap();
    assert!(told.contains("GRAINRIG_LOG is not used") && told.contains("debug"), "{told}");
}
