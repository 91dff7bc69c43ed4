//! A whole run of the program with the real firmware, and the camera of the simulated rig.

use super::board::Board;
use crate::kit::Lab;

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
