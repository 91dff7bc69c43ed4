//! The command that a person will want next.

use crate::kit::Lab;

/// The arguments of the command in the last line of what was said.
fn next(stdout: &str) -> Vec<String> {
    let line = stdout.lines().last().unwrap();
    let command = line.strip_prefix("next       grainrig ").unwrap_or_else(|| panic!("{stdout}"));
    let (command, _why) = command.split_once("    # ").unwrap();
    command.split(' ').map(str::to_owned).collect()
}

#[test]
fn what_made_a_grain_ends_with_the_next_command_to_try() {
    let lab = Lab::new();
    let data = lab.path("data").display().to_string();
    let compress = |name: &str| ["compress", name, "--data", &data].map(str::to_owned);
    let command = next(&lab.capture("a").succeeds().stdout);
    assert_eq!(command, compress("a"));
    // This program takes it: it finds the session, and gets as far as a figure that makes no sense.
    let args: Vec<&str> = command[..2].iter().map(String::as_str).chain(["--poisson", "0.5"]).collect();
    lab.run(&args).fails(2, &["poisson = 0.5"]);
    assert_eq!(next(&lab.run(&["reconstruct", "a"]).succeeds().stdout), compress("a"));
    lab.photos("photos");
    assert_eq!(next(&lab.import("photos", &[]).succeeds().stdout), compress("photos"));
    let config = lab.config(&[("simulated", "faults = { fail_capture_at = 2 }")]);
    lab.run(&["--config", &config, "capture", "b"]).fails(1, &["view 2: "]);
    // The rehearsed fault may come again.
    let resumed = (0..3).map(|_| lab.run(&["resume", "b"])).find(|ran| ran.code == Some(0)).unwrap();
    assert_eq!(next(&resumed.stdout), compress("b"));
    // A program that reads the result is not told what to type.
    let ran = lab.run(&["--json", "reconstruct", "a"]).succeeds();
    assert!(serde_json::from_str::<serde_json::Value>(&ran.stdout).is_ok(), "{}", ran.stdout);
    assert!(!ran.stderr.contains("next  "), "{}", ran.stderr);
}

#[test]
fn a_grain_that_slipped_is_to_be_captured_again() {
    let lab = Lab::new();
    let plan = ["views = 25", "steps_per_view = 8"].map(|line| ("plan", line));
    let size = ["width = 648", "height = 432", "mm_per_px = 0.006"].map(|line| ("simulated", line));
    let more = [("optics", "mm_per_px = 0.006"), ("simulated", "faults = { slip = { at = 12, deg = 6.0 } }")];
    let config = lab.config(&[&plan[..], &size[..], &more[..]].concat());
    let ran = lab.run(&["--config", &config, "capture", "a"]).succeeds();
    assert!(ran.stdout.contains("it slipped on its pedestal"), "{}", ran.stdout);
    assert_eq!(next(&ran.stdout)[..2], ["capture", "a-2"]);
}
