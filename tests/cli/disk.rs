//! A full disk: what fits stays, what does not fit is told with its bytes, and the next run goes on.

use crate::kit::{Lab, Ran, VIEWS, files};
use crate::skip::{Lacking, skip};
use grainrig::session::State;
use std::process::Command;

/// Runs the program where no file may grow beyond this many bytes.
fn limited(lab: &Lab, bytes: u64, args: &[&str]) -> Ran {
    let program = lab.command(args);
    let mut shell = Command::new("sh");
    // POSIX counts blocks of 512 bytes.
    shell.arg("-c").arg(format!("ulimit -f {} && exec \"$0\" \"$@\"", bytes / 512));
    shell.arg(program.get_program()).args(program.get_args()).current_dir(lab.path("."));
    Ran::from(&mut shell)
}

#[test]
fn a_picture_that_cannot_be_written_ends_the_run_and_resume_goes_on() {
    let lab = Lab::new();
    // Room for the manifest, none for a picture.
    let ran = limited(&lab, 8192, &["--config", "small.toml", "capture", "a"]);
    ran.fails(1, &["cannot write", "view_000.jpg", "ulimit -f"]);
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len()), (State::Failed, 0));
    assert!(files(&lab.session("a").join("frames")).is_empty(), "no half picture stays");
    lab.assert_sound("a");
    lab.run(&["resume", "a"]).succeeds();
    lab.assert_sound("a");
}

#[test]
fn products_that_cannot_be_written_lose_no_picture_and_resume_computes_them() {
    let lab = Lab::new();
    // A mesh of more bytes than any picture.
    let config = lab.config(&[("mesh", "surface_size_mm = 0.05")]);
    let ran = limited(&lab, 200 << 10, &["--config", &config, "capture", "a"]);
    ran.fails(1, &["cannot write", "grain.inp"]);
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len()), (State::Failed, VIEWS));
    assert!(files(&lab.session("a").join("products")).is_empty(), "no half product stays");
    lab.assert_sound("a");
    let resumed = lab.run(&["resume", "a"]).succeeds();
    assert!(resumed.stderr.contains("all 5 views are there"), "{}", resumed.stderr);
    let after = lab.recording("a");
    assert_eq!((after.state(), after.views().len()), (State::Complete, VIEWS));
    lab.run(&["replay", "a"]).succeeds();
    lab.assert_sound("a");
}

#[test]
fn a_journal_that_cannot_grow_keeps_its_whole_lines() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let before = lab.products("a");
    let journal = lab.session("a").join("journal.jsonl");
    let length = journal.metadata().unwrap().len();
    let ran = limited(&lab, length / 512 * 512, &["reconstruct", "a"]);
    ran.fails(1, &["cannot write", "ulimit -f"]);
    assert_eq!(journal.metadata().unwrap().len(), length);
    assert_eq!(lab.products("a"), before);
    lab.assert_sound("a");
}

#[test]
fn a_truth_that_has_no_place_to_go_is_refused_before_the_run() {
    let lab = Lab::new();
    let to = |folder: &str| lab.run(&["--config", "small.toml", "capture", "a", "--truth", folder]);
    to("small.toml/truth").fails(1, &["truth to small.toml/truth", "give a folder that can be written"]);
    assert!(!lab.path("data").exists());
    // One that can't be written at the end leaves the run as it is.
    std::fs::create_dir_all(lab.path("truth/truth.json")).unwrap();
    to("truth").fails(1, &["truth", "give a folder"]);
    assert_eq!(lab.recording("a").state(), State::Complete);
    lab.assert_sound("a");
}

#[test]
fn an_import_that_does_not_fit_leaves_nothing() {
    let lab = Lab::new();
    lab.photos("photos");
    let args = ["--config", "small.toml", "import", "photos", "--mm-per-px", "0.009"];
    limited(&lab, 8192, &args).fails(1, &["cannot write", "view_000.jpg", "ulimit -f"]);
    assert!(files(&lab.path("data")).is_empty());
}

#[test]
fn a_run_that_will_not_fit_is_refused_before_it_begins() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("data")).unwrap();
    let program = lab.command(&["--config", "small.toml", "capture", "a"]);
    let mount = "mount -t tmpfs -o size=4m none data";
    let own = |script: &str| {
        let mut shell = Command::new("unshare");
        shell.args(["-rm", "sh", "-c", script]).current_dir(lab.path("."));
        shell.arg(program.get_program()).args(program.get_args());
        shell
    };
    if !own(mount).output().is_ok_and(|o| o.status.success()) {
        return skip(Lacking::System, "nobody may mount a small file system of his own here");
    }
    // What is left in the data folder is printed: it is gone with the process.
    let ran =
        Ran::from(&mut own(&format!("{mount} && {{ \"$0\" \"$@\"; code=$?; ls -A data; exit $code; }}")));
    let ran = ran.fails(1, &["no room for", "bytes needed", "bytes free", "delete old sessions"]);
    assert_eq!(ran.stdout, "", "the name is not taken");
}

#[test]
fn too_many_open_files_are_named_as_that_with_their_remedy() {
    let lab = Lab::new();
    let mut at_work = 0;
    for most in 4..=12 {
        let name = format!("a{most}");
        let program = lab.command(&["--config", "small.toml", "capture", &name]);
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("ulimit -n {most} && exec \"$0\" \"$@\""));
        shell.arg(program.get_program()).args(program.get_args()).current_dir(lab.path("."));
        let ran = Ran::from(&mut shell).fails(1, &["error: ", "ulimit -n"]);
        assert!(!ran.stderr.contains("check the disk"), "at {most}: {}", ran.stderr);
        at_work += usize::from(ran.stderr.contains("Too many open files (os error 24)"));
    }
    assert!(at_work > 0, "every limit was too low to begin");
    lab.capture("a").succeeds();
}
