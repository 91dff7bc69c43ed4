//! Names that would lead out of the data folder, that are taken, or that nothing has.

use crate::kit::{Lab, files, read};

#[test]
fn a_name_that_leads_out_of_the_data_folder_is_refused_by_every_command() {
    let lab = Lab::new();
    lab.photos("photos");
    for bad in ["../x", "..", "a/../../x", "/tmp/nowhere/x", ".hidden", "", "a b", "ä"] {
        let parts = ["session name", "is not allowed", "use 1 to 64 letters"];
        lab.run(&["capture", bad]).fails(2, &parts);
        lab.import("photos", &["--name", bad]).fails(2, &parts);
    }
    for bad in ["../x", "a/../../x", "/tmp/nowhere/x", ".hidden"] {
        for command in ["resume", "replay", "reconstruct", "verify", "mesh"] {
            lab.run(&[command, bad]).fails(2, &["session name", "is not allowed"]);
        }
    }
    lab.run(&["capture", &"x".repeat(65)]).fails(2, &["longer than 64"]);
    assert!(!lab.path("data").exists() && !lab.path("x").exists());
}

#[test]
fn a_folder_that_is_no_session_is_told_as_that() {
    let lab = Lab::new();
    lab.photos("photos");
    for command in ["resume", "replay", "reconstruct", "verify", "mesh"] {
        lab.run(&[command, "nobody"]).fails(1, &["there is no session at ", "nobody", "--data"]);
        lab.run(&[command, "./photos"]).fails(1, &["there is no session at ", "photos"]);
    }
    assert!(!files(&lab.path("photos")).iter().any(|f| f == "lock"));
}

#[test]
fn a_name_that_is_taken_is_refused_and_the_session_is_untouched() {
    let lab = Lab::new();
    lab.photos("photos");
    lab.capture("photos").succeeds();
    let journal = read(&lab.session("photos").join("journal.jsonl"));
    lab.capture("photos").fails(1, &["\"photos\" exists already", "choose another name, or resume it"]);
    lab.import("photos", &[]).fails(1, &["\"photos\" exists already"]);
    assert_eq!(read(&lab.session("photos").join("journal.jsonl")), journal);
    assert_eq!(files(&lab.path("data")), ["photos"]);
    lab.assert_sound("photos");
}

#[test]
fn a_folder_whose_name_is_no_session_name_needs_one() {
    let lab = Lab::new();
    lab.photos("my photos");
    lab.import("my photos", &[]).fails(2, &["\"my photos\" is not allowed", "--name"]);
    lab.import("my photos", &["--name", "mine"]).succeeds();
}

#[test]
fn a_session_of_the_data_folder_comes_before_a_folder_of_the_same_name() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    lab.write("a/manifest.json", "{}");
    lab.run(&["verify", "a"]).succeeds();
    lab.run(&["verify", "./a"]).fails(1, &["manifest.json"]);
    let path = lab.session("a").display().to_string();
    lab.run(&["verify", &path]).succeeds();
}
