//! A whole run of the program with the real firmware, and the camera of the simulated rig.

use super::board::Board;
use super::grbl::{Faults, Grbl};
use crate::kit::{self, Lab};

fn config(board: &Board, hardware: bool) -> String {
    let rig =
        if hardware { "kind = \"hardware\"\nstage = \"controller\"\ncamera = \"simulated\"" } else { "" };
    format!(
        "[rig]\n{rig}\n[plan]\nsettle_ms = 0\n[mesh]\nsurface_size_mm = 0.1\n[report]\npictures = false\n[optics]\nmm_per_px = 0.0075\n\
         [simulated]\nwidth = 324\nheight = 270\nmm_per_px = 0.0075\nstep_error = 0.0\n\
         [controller]\nport = \"{}\"\nboot_ms = 0\nspeed_deg_per_s = 400\nacceleration_deg_per_s2 = 9000\nhoming_deg_per_s = 90\n",
        board.port.display()
    )
}

#[test]
fn a_grain_is_captured_by_the_real_firmware_as_by_the_simulated_stage() {
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    let lab = Lab::new();
    let volumes = [true, false].map(|hardware| {
        lab.write("one.toml", config(&board, hardware));
        let name = if hardware { "hardware" } else { "simulated" };
        let done = lab.run(&["--json", "--config", "one.toml", "capture", name]).succeeds().json();
        done["hull"]["volume_mm3"].as_f64().unwrap()
    });
    assert!((volumes[0] / volumes[1] - 1.0).abs() < 1e-3, "{volumes:?}");
    let state = board.state();
    assert_eq!(state["position"], 1600, "half a turn, for the closing view");
    assert_eq!(state["current"], false);
}

/// Without a switch nobody finds the run's zero again: what is left of it is where the stage was sent last.
#[test]
fn a_run_that_was_ended_is_resumed_at_the_angles_that_it_would_have_had() {
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    let lab = Lab::new();
    lab.write("one.toml", config(&board, true));
    let mut running = lab.start(&["--config", "one.toml", "capture", "ended"]);
    running.wait_for("view 3 ");
    running.interrupt();
    running.end();
    let stands = board.position();
    assert!((3 * 64..1600).contains(&stands) && stands % 64 == 0, "{stands}");
    let ran = lab.run(&["--config", "one.toml", "resume", "ended"]).succeeds();
    let deg = f64::from(stands as i32) * 180.0 / 1600.0;
    let told = format!("the stage is taken to stand at {deg:.2}°, where the interrupted run sent it last");
    assert!(ran.stderr.contains(&told), "{told}: {}", ran.stderr);
    let state = board.state();
    assert_eq!((&state["position"], &state["idle_steps"]), (&1600.into(), &0.into()));
    assert_eq!(
        state["steps"].as_i64().unwrap(),
        1600 + 16,
        "each way once, and the play taken up when it began"
    );
    lab.assert_sound("ended");
}

#[test]
fn the_doctor_finds_a_board_healthy_and_says_what_ails_one_that_is_not() {
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    let lab = Lab::new();
    lab.write("one.toml", config(&board, true));
    let told = lab.run(&["--config", "one.toml", "doctor"]).succeeds().stdout;
    for part in [
        "disk         good",
        "stage        good       stage controller 1.0.0",
        "movement     good",
        "324 × 270 px",
    ] {
        assert!(told.contains(part), "{part:?} is missing from {told}");
    }
    let state = board.state();
    assert_eq!(state["position"], 0, "there and back");
    assert!(state["steps"].as_u64().unwrap() >= 16);
    assert_eq!(state["current"], false);

    board.tell("mute on");
    let patient = config(&board, true).replace("boot_ms = 0", "boot_ms = 0\nreply_ms = 20\ntries = 2");
    lab.write("mute.toml", patient);
    let ran = lab.run(&["--json", "--config", "mute.toml", "doctor"]);
    let ran = ran.fails(1, &["1 of ", "checks found something that a run would fail on"]);
    let findings: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let rig = findings["findings"].as_array().unwrap().iter().find(|f| f["check"] == "rig").unwrap();
    assert_eq!(rig["health"], "bad");
    assert!(rig["found"].as_str().unwrap().contains("no whole answer"), "{rig}");
    assert!(rig["remedy"].as_str().unwrap().contains("firmware is on the board"), "{rig}");
    let shot = findings["findings"].as_array().unwrap().iter().find(|f| f["check"] == "test shot").unwrap();
    assert_eq!(shot["health"], "skipped");
}

/// What is said on a line is part of a view's story.
#[test]
fn the_log_has_every_line_to_and_from_a_board_within_its_view() {
    let board = Grbl::start(Faults::default());
    let lab = Lab::new();
    let port = board.port.display();
    lab.write(
        "grbl.toml",
        format!(
            "{}\n[rig]\nkind = \"hardware\"\nstage = \"grbl\"\n[grbl]\nport = \"{port}\"\nsteps_per_deg = 8.889\nboot_ms = 0\n",
            kit::SMALL
        ),
    );
    let mut command = lab.command(&["--config", "grbl.toml", "--log-format", "json", "capture", "a"]);
    let said = command.env("GRAINRIG_LOG", "grainrig=trace").output().unwrap().stderr;
    let said = String::from_utf8(said).unwrap();
    let lines: Vec<serde_json::Value> =
        said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    // The exchange within the move to the view at 90°, which is 89.9989° in whole steps, in its order.
    let is_within = |line: &serde_json::Value| {
        let span = |name: &str| line["spans"].as_array()?.iter().find(|s| s["name"] == name);
        let moves = span("stage").is_some_and(|stage| stage["target_deg"] == 90.0);
        moves && span("view").is_some_and(|view| view["index"] == 2)
    };
    let exchange: Vec<(&str, &str)> = (lines.iter().filter(|line| is_within(line)))
        .filter_map(|l| Some((l["fields"]["message"].as_str()?, l["fields"]["line"].as_str()?)))
        .collect();
    let place = |way: &str, words: &str| {
        let found = exchange.iter().position(|(w, line)| *w == way && line.contains(words));
        found.unwrap_or_else(|| panic!("nothing {way} has {words}: {exchange:?}\n{said}"))
    };
    let order =
        [place("sent", "$J=G53 G90 X89.99"), place("heard", "ok"), place("heard", "<Idle|MPos:89.99")];
    assert!(order.is_sorted(), "{exchange:?}");
}
