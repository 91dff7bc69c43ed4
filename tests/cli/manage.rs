//! The sessions of the data folder: listed, shown, removed; errors for programs; what the environment says.

use crate::kit::{self, Lab, VIEWS};
use grainrig::session::event::EventKind;
use grainrig::session::{Manifest, MergeSource, Origin, Plan, Session, Store};
use serde_json::{Value, json};

#[test]
fn sessions_are_listed_and_shown() {
    let lab = Lab::new();
    // A folder that was named is there.
    lab.run(&["list"]).fails(2, &["there is no data folder", "data", "--data"]);
    std::fs::create_dir(lab.path("data")).unwrap();
    let empty = lab.run(&["list"]).succeeds();
    assert_eq!(empty.stdout, "");
    assert!(empty.stderr.contains("grainrig capture"), "{}", empty.stderr);
    lab.capture("a").succeeds();
    let list = lab.run(&["list"]).succeeds().stdout;
    assert!(list.starts_with("a ") && list.contains(&format!("{VIEWS} of {VIEWS} views")), "{list}");
    assert!(list.trim_end().ends_with("complete"), "{list}");
    let listed = lab.run(&["list", "--json"]).succeeds().json();
    assert_eq!(
        (&listed["sessions"][0]["name"], &listed["sessions"][0]["state"]),
        (&json!("a"), &json!("complete"))
    );
    let shown = lab.run(&["show", "a", "--json"]).succeeds().json();
    assert_eq!(shown["frames"].as_array().unwrap().len(), VIEWS);
    assert_eq!(shown["result"], *lab.recording("a").result().unwrap());
    let text = lab.run(&["show", "a"]).succeeds().stdout;
    for part in ["state      complete", "volume     ", "mesh       ", "file       products/grain.inp"] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    // What is damaged is listed as that, and tells why.
    std::fs::write(lab.session("a").join("manifest.json"), b"{").unwrap();
    let list = lab.run(&["list"]).succeeds().stdout;
    assert!(list.contains("damaged") && list.contains("manifest.json"), "{list}");
}

#[test]
fn a_session_is_removed_only_where_that_is_meant_and_can_be() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    lab.capture("b").succeeds();
    lab.run(&["rm", "a"]).fails(2, &["nothing was removed", "--yes"]);
    // A slip of the hand among many removes nothing.
    lab.run(&["rm", "--yes", "a", "nothing"]).fails(1, &["nothing"]);
    assert!(lab.session("a").exists());
    // Not what somebody writes, nor what a merged grain needs, nor what is no session.
    {
        let _writing = Session::open(&lab.session("a")).unwrap();
        lab.run(&["rm", "--yes", "a"]).fails(1, &["a"]);
        assert!(lab.session("a").exists());
    }
    let plan = Plan { views: Vec::new(), ..lab.recording("a").manifest().plan.clone() };
    let mut merged = Manifest::new("whole", Origin::Merge, plan, json!({}));
    merged.merged_from = ["a", "c"]
        .map(|name| MergeSource {
            name: name.into(),
            folder: format!("../{name}").into(),
            sha256: String::new(),
        })
        .to_vec();
    drop(Store::new(lab.path("data")).create(&merged).unwrap());
    lab.run(&["rm", "--yes", "a"]).fails(1, &["whole", "remove that first"]);
    std::fs::create_dir(lab.session("notes")).unwrap();
    lab.run(&["rm", "--yes", "notes"]).fails(1, &["notes"]);
    lab.run(&["rm", "--yes", "../a"]).fails(2, &["../a"]);
    // Then it is gone, whole, and the others are not.
    lab.run(&["rm", "--yes", "whole", "a"]).succeeds();
    assert!(!lab.session("a").exists() && !lab.session("whole").exists());
    let left: Vec<String> = std::fs::read_dir(lab.path("data"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(left.iter().all(|name| ["b", "notes"].contains(&name.as_str())), "{left:?}");
    assert!(lab.session("notes").exists());
    lab.assert_sound("b");
    // One that is damaged is the likeliest to be removed.
    std::fs::write(lab.session("b").join("manifest.json"), b"{").unwrap();
    lab.run(&["rm", "--yes", "b"]).succeeds();
    assert!(!lab.session("b").exists());
}

#[test]
fn a_program_reads_errors_as_json() {
    let lab = Lab::new();
    let told = |args: &[&str], code: i32| -> Value {
        let ran = lab.run(args);
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
        let object: Value =
            serde_json::from_str(&ran.stdout).unwrap_or_else(|e| panic!("{e}: {}", ran.stdout));
        let message = object["error"]["message"].as_str().unwrap();
        assert!(ran.stderr.contains(message), "{message} is not in {}", ran.stderr);
        object["error"]["kind"].clone()
    };
    assert_eq!(told(&["--json", "show", "nothing"], 1), "absent");
    assert_eq!(told(&["--json", "capture", "a/b"], 2), "usage");
    assert_eq!(told(&["--json", "compress", "--sphere-diameter-mm", "0.8", "--poisson", "0.5"], 2), "usage");
    lab.capture("a").succeeds();
    let writing = Session::open(&lab.session("a")).unwrap();
    assert_eq!(told(&["--json", "reconstruct", "a"], 1), "busy");
    // What has told its result tells no second object.
    drop(writing);
    std::fs::remove_file(lab.session("a").join("products/grain.inp")).unwrap();
    let ran = lab.run(&["--json", "verify", "a"]);
    assert_eq!(ran.code, Some(1));
    assert!(serde_json::from_str::<Value>(&ran.stdout).unwrap()["faults"].is_array(), "{}", ran.stdout);
}

/// Whoever reads an object can tell which form it has, and what wrote it.
#[test]
fn every_object_says_the_version_of_its_form_and_of_the_program() {
    let lab = Lab::new();
    let software = concat!("grainrig ", env!("CARGO_PKG_VERSION"));
    let first = lab.run(&["--json", "--config", "small.toml", "capture", "a"]).succeeds().json();
    let file: Value =
        serde_json::from_slice(&kit::read(&lab.session("a").join("products/result.json"))).unwrap();
    let rest = [
        &["replay", "a"][..],
        &["show", "a"],
        &["verify", "a"],
        &["list"],
        &["devices"],
        &["config"],
        &["resume", "a"],
    ];
    let rest = rest.map(|args| lab.run(&[&["--json"], args].concat()).succeeds().json());
    let refused: Value = serde_json::from_str(&lab.run(&["--json", "show", "b"]).stdout).unwrap();
    for object in [first, file, refused].iter().chain(&rest) {
        assert_eq!((&object["schema"], &object["software"]), (&json!(1), &json!(software)), "{object}");
    }
}

/// What an older version recorded is read as it was: its form has no number.
#[test]
fn a_result_from_before_its_form_was_numbered_is_told_as_that() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    // The same session, as a version wrote it that knew no such key.
    let mut events = lab.recording("a").events().to_vec();
    let Some(EventKind::Complete { result }) = events.last_mut().map(|e| &mut e.what) else {
        panic!("{events:?}")
    };
    let removed = result.as_object_mut().unwrap().shift_remove("schema");
    assert_eq!(removed, Some(json!(1)));
    let result = result.clone();
    let journal = String::from_utf8(kit::read(&lab.session("a").join("journal.jsonl"))).unwrap();
    let (before, _) = journal.trim_end().rsplit_once('\n').unwrap();
    std::fs::write(lab.session("a").join("journal.jsonl"), format!("{before}\n")).unwrap();
    Session::open(&lab.session("a")).unwrap().append(EventKind::Complete { result }).unwrap();
    assert_eq!(lab.run(&["--json", "resume", "a"]).succeeds().json()["schema"], 0);
    assert!(lab.run(&["--json", "show", "a"]).succeeds().json()["result"].get("schema").is_none());
    lab.run(&["replay", "a"]).succeeds();
    lab.assert_sound("a");
}

#[test]
fn the_environment_names_the_data_folder_and_the_configuration() {
    let lab = Lab::new();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_grainrig"));
    crate::kit::quiet(&mut command, &lab.path("."));
    command.current_dir(lab.path(".")).env("GRAINRIG_DATA", lab.path("elsewhere"));
    command.env("GRAINRIG_CONFIG", lab.path("small.toml"));
    assert!(command.args(["capture", "a"]).output().unwrap().status.success());
    assert!(lab.path("elsewhere").join("a/manifest.json").is_file());
    // Whoever set it for all commands is not told at each that it is not used.
    let mut verify = std::process::Command::new(env!("CARGO_BIN_EXE_grainrig"));
    crate::kit::quiet(&mut verify, &lab.path("."));
    verify.env("GRAINRIG_DATA", lab.path("elsewhere")).env("GRAINRIG_CONFIG", lab.path("small.toml"));
    let ran = verify.args(["verify", "a"]).output().unwrap();
    assert!(ran.status.success() && ran.stderr.is_empty(), "{}", String::from_utf8_lossy(&ran.stderr));
}
