//! Sessions with something missing or damaged.

use crate::kit::{Lab, VIEWS, read};
use grainrig::session::{State, sha256_hex};
use std::io::Write as _;

const READERS: [&str; 3] = ["replay", "reconstruct", "mesh"];

/// A session whose camera failed at its third view.
fn interrupted(lab: &Lab) {
    let config = lab.config(&[("simulated", "faults = { fail_capture_at = 2 }")]);
    lab.run(&["--config", &config, "capture", "a"]).fails(1, &["view 2: "]);
}

/// A complete session, its file with one byte changed in the middle.
fn damaged(file: &str) -> Lab {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let path = lab.session("a").join(file);
    let mut bytes = read(&path);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    lab
}

#[test]
fn an_interrupted_session_is_not_computed_but_to_be_resumed() {
    let lab = Lab::new();
    interrupted(&lab);
    let journal = read(&lab.session("a").join("journal.jsonl"));
    for command in READERS {
        lab.run(&[command, "a"]).fails(1, &["2 of 5 views are there", "resume the session"]);
    }
    assert_eq!(read(&lab.session("a").join("journal.jsonl")), journal, "the journal is left as it is");
    lab.run(&["resume", "a"]).succeeds();
    assert_eq!(lab.recording("a").state(), State::Complete);
    lab.assert_sound("a");
}

#[test]
fn a_view_whose_file_is_removed_is_named() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let before = lab.products("a");
    std::fs::remove_file(lab.session("a").join("frames/view_003.jpg")).unwrap();
    for command in READERS {
        lab.run(&[command, "a"]).fails(1, &["view_003.jpg", "check the path"]);
    }
    lab.run(&["verify", "a"]).fails(1, &["frames/view_003.jpg: missing", "backup"]);
    assert_eq!(lab.products("a"), before);
}

#[test]
fn a_view_that_has_changed_is_no_evidence() {
    let lab = damaged("frames/view_001.jpg");
    let before = lab.products("a");
    for command in READERS {
        lab.run(&[command, "a"]).fails(1, &["view_001.jpg has changed", "SHA-256", "backup"]);
    }
    assert_eq!(lab.products("a"), before);
}

#[test]
fn a_journal_with_a_damaged_line_is_refused_with_the_lines_number() {
    let lab = damaged("journal.jsonl");
    for command in ["resume", "replay", "reconstruct", "mesh"] {
        lab.run(&[command, "a"]).fails(1, &["journal.jsonl, line ", "restore the file from a backup"]);
    }
    lab.run(&["verify", "a"]).fails(1, &["journal.jsonl, line ", "SHA-256"]);
    std::fs::remove_file(lab.session("a").join("journal.jsonl")).unwrap();
    lab.run(&["replay", "a"]).fails(1, &["journal.jsonl", "missing"]);
    lab.run(&["verify", "a"]).fails(1, &["journal.jsonl", "missing"]);
}

#[test]
fn a_torn_last_line_is_said_by_verify_and_cut_off_by_the_next_opening() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let path = lab.session("a").join("journal.jsonl");
    let whole = read(&path);
    let mut file = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
    file.write_all(br#"{"seq":99,"time":"2026-"#).unwrap();
    drop(file);
    lab.run(&["verify", "a"]).fails(1, &["journal.jsonl: the last 23 bytes are no whole line"]);
    lab.run(&["replay", "a"]).succeeds();
    lab.run(&["resume", "a"]).succeeds();
    assert_eq!(read(&path), whole);
    lab.assert_sound("a");
}

#[test]
fn a_damaged_manifest_is_refused_and_named_by_verify() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let path = lab.session("a").join("manifest.json");
    let whole = String::from_utf8(read(&path)).unwrap();
    let cases: [(Vec<u8>, &str); 5] = [
        (whole.as_bytes()[..whole.len() / 2].to_vec(), "EOF"),
        ((0..=255).collect(), "expected value"),
        (Vec::new(), "EOF"),
        (whole.replace("\"name\": \"a\"", "\"name\": \"../a\"").into(), "is not allowed"),
        (whole.replace("\"index\": 1", "\"index\": 7").into(), "view 1 of its plan has index 7"),
    ];
    for (bytes, reason) in cases {
        std::fs::write(&path, bytes).unwrap();
        for command in ["resume", "replay", "reconstruct", "mesh"] {
            lab.run(&[command, "a"]).fails(1, &["manifest.json", reason, "backup"]);
        }
        lab.run(&["verify", "a"]).fails(1, &["manifest.json", reason]);
    }
    // One that reads well, but is not the one that the journal was begun with.
    std::fs::write(&path, whole.replace("45.0", "46.0")).unwrap();
    lab.run(&["replay", "a"]).fails(1, &["journal.jsonl, line 1", "does not follow manifest.json"]);
    std::fs::remove_file(&path).unwrap();
    lab.run(&["replay", "a"]).fails(1, &["manifest.json", "missing"]);
    lab.run(&["verify", "a"]).fails(1, &["manifest.json", "missing"]);
}

/// What a newer version has written is no damage: nobody is told to delete it.
#[test]
fn a_session_of_a_newer_version_is_told_as_that() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let told = |file: &str, what: &str| {
        for command in ["resume", "replay", "reconstruct", "verify"] {
            let ran = lab.run(&[command, "a"]);
            ran.fails(1, &[file, what, "use the version of grainrig that made the session"]);
        }
    };
    let manifest = lab.session("a").join("manifest.json");
    let whole = read(&manifest);
    let newer = String::from_utf8(whole.clone()).unwrap().replace("\"format\": 1", "\"format\": 2");
    std::fs::write(&manifest, newer).unwrap();
    told("manifest.json", "format version is 2, this program reads 1");
    std::fs::write(&manifest, whole).unwrap();
    // A kind of event that is not known here, in a line with its own hash.
    let journal = lab.session("a").join("journal.jsonl");
    let text = String::from_utf8(read(&journal)).unwrap();
    let (before, last) = text.trim_end().rsplit_once('\n').unwrap();
    let body =
        last.rsplit_once(",\"hash\":").unwrap().0.replace("\"event\":\"complete\"", "\"event\":\"polished\"");
    let hash = sha256_hex(format!("{body}}}").as_bytes());
    std::fs::write(&journal, format!("{before}\n{body},\"hash\":\"{hash}\"}}\n")).unwrap();
    told("journal.jsonl", "polished");
}

#[test]
fn a_frozen_configuration_of_another_version_is_told_as_that() {
    let lab = Lab::new();
    interrupted(&lab);
    // As another version would have written it: manifest and journal agree.
    let folder = lab.session("a");
    let manifest = String::from_utf8(read(&folder.join("manifest.json"))).unwrap();
    std::fs::write(
        folder.join("manifest.json"),
        manifest.replace("\"retakes\": 3,\n      \"tol", "\"redos\": 3,\n      \"tol"),
    )
    .unwrap();
    std::fs::write(folder.join("journal.jsonl"), b"").unwrap();
    lab.run(&["resume", "a"]).fails(1, &["redos", "version"]);
}

#[test]
fn an_imported_session_that_lost_its_journals_end_is_not_filled_up_by_the_rig() {
    let lab = Lab::new();
    lab.photos("photos");
    lab.import("photos", &[]).succeeds();
    let path = lab.session("photos").join("journal.jsonl");
    let text = String::from_utf8(read(&path)).unwrap();
    // Cut after the third captured view, at a line's end.
    let end = text.match_indices("\"event\":\"captured\"").nth(3).unwrap().0;
    std::fs::write(&path, &text[..=text[..end].rfind('\n').unwrap()]).unwrap();
    lab.run(&["resume", "photos"]).fails(1, &["3 of 5 views are there", "import the missing pictures"]);
    assert_eq!(lab.recording("photos").views().len(), 3);
}

#[test]
fn the_mesh_of_a_session_is_copied_to_where_it_is_asked_for() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    lab.run(&["mesh", "a", "--out", "x.inp", "y.stl"]).succeeds();
    assert_eq!(read(&lab.path("x.inp")), read(&lab.session("a").join("products/grain.inp")));
    assert_eq!(read(&lab.path("y.stl")), read(&lab.session("a").join("products/grain.stl")));
    assert_eq!(lab.recording("a").views().len(), VIEWS);
}
