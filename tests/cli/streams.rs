//! Readers that go away, and what is said to whom.

use crate::kit::{Lab, VIEWS};
use grainrig::session::State;
use std::io::Read as _;
use std::process::Stdio;

/// Runs the program while nobody reads its standard output (or error); the exit code and what else it said.
fn unread(lab: &Lab, args: &[&str], also_stderr: bool) -> (Option<i32>, String) {
    let mut command = lab.command(args);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let mut said = String::new();
    let mut stderr = child.stderr.take().unwrap();
    if also_stderr {
        drop(stderr);
    } else {
        stderr.read_to_string(&mut said).unwrap();
    }
    (child.wait().unwrap().code(), said)
}

#[test]
fn a_reader_of_standard_output_that_goes_away_is_no_error() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let commands: [&[&str]; 9] = [
        &["--json", "replay", "a"],
        &["replay", "a"],
        &["--json", "verify", "a"],
        &["verify", "a"],
        &["--json", "resume", "a"],
        &["--json", "devices"],
        &["devices"],
        &["capture", "--help"],
        &["--version"],
    ];
    for args in commands {
        let (code, said) = unread(&lab, args, false);
        assert_eq!(code, Some(0), "{args:?}: {said}");
        assert!(!said.contains("panicked") && !said.contains("error"), "{args:?}: {said}");
    }
}

#[test]
fn a_capture_goes_on_where_nobody_reads_what_it_says() {
    let lab = Lab::new();
    let (code, _) = unread(&lab, &["--config", "small.toml", "capture", "a"], true);
    assert_eq!(code, Some(0));
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len()), (State::Complete, VIEWS));
}

#[test]
fn without_a_terminal_each_view_and_each_stage_of_the_computation_is_a_line() {
    let lab = Lab::new();
    let ran = lab.capture("a").succeeds();
    let lines: Vec<&str> = ran.stderr.lines().collect();
    assert_eq!(lines[0], "session a: 5 views");
    for n in 0..VIEWS {
        let begins = format!("view {n} at {}.00°: {} of 5 captured", 45 * n, n + 1);
        assert!(lines.iter().any(|l| l.starts_with(&begins)), "{begins}: {}", ran.stderr);
    }
    for stage in ["calibrate", "hull", "mesh"] {
        assert!(lines.contains(&format!("computing: {stage}").as_str()), "{stage}: {}", ran.stderr);
    }
    // What matters most comes first.
    assert!(ran.stdout.starts_with("verdict "), "{}", ran.stdout);
    assert!(ran.stdout.lines().any(|l| l.starts_with("session ")), "{}", ran.stdout);
}

#[test]
fn an_error_is_on_standard_error_and_where_json_is_asked_for_an_object_too() {
    let lab = Lab::new();
    for args in [&["replay", "nobody"][..], &["capture", "../x"], &["juggle"]] {
        let ran = lab.run(args);
        assert!(ran.code != Some(0) && ran.stdout.is_empty() && !ran.stderr.is_empty(), "{ran:?}");
        let ran = lab.run(&[args, &["--json"]].concat());
        let object: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert!(ran.code != Some(0) && !ran.stderr.is_empty(), "{ran:?}");
        assert!(object["error"]["message"].as_str().is_some_and(|text| !text.is_empty()), "{object}");
    }
}

#[test]
fn help_of_every_command_has_an_example_that_names_it() {
    let lab = Lab::new();
    for command in ["serve", "capture", "resume", "replay", "import", "reconstruct", "mesh", "verify"] {
        let help = lab.run(&[command, "--help"]).succeeds().stdout;
        assert!(
            help.contains(&format!("\n  grainrig {command} ")) || command == "import",
            "{command}: {help}"
        );
        assert!(help.contains("Examples:") && help.contains("Common options:"), "{command}: {help}");
    }
}

/// It is started as `/proc/self/exe`; whoever asks the system what holds the camera is told its name.
#[test]
fn the_process_that_holds_a_camera_has_a_name_that_tells() {
    let lab = Lab::new();
    let mut command = lab.command(&["camera-worker"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    // It says that it has started.
    child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
    let name = std::fs::read_to_string(format!("/proc/{}/comm", child.id())).unwrap();
    assert_eq!(name, "grainrig-camera\n");
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}
