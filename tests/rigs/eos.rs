//! The firmware's stage and a Canon EOS.

use crate::board::Board;
use crate::grain::{Exposed, Grain, SETTINGS, VIEW, VIEWS, controller, figure, simulated};
use crate::kit::{Lab, Ran};
use crate::ptp_camera::{Personality, PtpCamera, Setup, speaks_ptpip};
use std::sync::{Arc, Mutex};

/// What releases the shutter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Release {
    /// The camera, asked over its own cable.
    Camera,
    /// The controller's output, which is wired to the camera.
    Controller,
    /// The same with its plug out.
    Unplugged,
}

/// The board, and a camera before the grain on its motor.
struct Rig {
    lab: Lab,
    board: Arc<Mutex<Board>>,
    exposed: Exposed,
    _camera: Arc<PtpCamera>,
    config: String,
}

impl Rig {
    /// `more` are further settings of the camera. `None` where the chip's tools are not there.
    fn new(release: Release, more: &str) -> Option<Self> {
        let mut board = Board::start(0, -1_000_000)?;
        let lab = Lab::new();
        let contact = board.shutter();
        let controller = controller(&board);
        let board = Arc::new(Mutex::new(board));
        let mut grain = Grain::new(&lab, &board, |_| ());
        let exposed = grain.exposed();
        let camera = Arc::new(PtpCamera::start(Setup::new(Personality::Eos), move |_| grain.photograph()));
        let name = if release == Release::Camera { "camera" } else { "controller" };
        let rig = format!(
            "[rig]\nkind = \"hardware\"\nstage = \"controller\"\ncamera = \"gphoto2\"\nrelease = \"{name}\"\n"
        );
        let gphoto = format!(
            "[gphoto2]\nmodel = \"{}\"\nport = \"{}\"\nset = {{ iso = \"100\" }}\n\
             require = {{ autoexposuremode = \"Manual\", focusmode = \"Manual\" }}\n{more}\n",
            camera.model(),
            camera.address()
        );
        let contacts = "focus_ms = 5\nshutter_ms = 20\n";
        let config = lab.write("hardware.toml", [SETTINGS, &rig, &gphoto, &controller, contacts].concat());
        if release == Release::Controller {
            // The wire; it ends with the board.
            let wired = Arc::clone(&camera);
            std::thread::spawn(move || contact.iter().for_each(|_| wired.press()));
        }
        Some(Self { lab, board, exposed, _camera: camera, config })
    }

    fn capture(&self, name: &str) -> Ran {
        self.lab.run(&["--json", "--config", &self.config, "capture", name])
    }
}

/// The lens's, the sensor's and the motor's errors follow from the settings, so the pictures are those of the simulated rig to
/// the last bit if and only if the pins were at each view's very microstep at its exposure. What follows from them is the same
/// but for the last digits of the angles, which the stages reckon from microsteps and from steps.
#[test]
fn the_firmware_and_an_eos_give_what_the_simulated_rig_gives() {
    if !speaks_ptpip() {
        return;
    }
    let lab = Lab::new();
    let ideal = simulated(&lab, "simulated");
    let ideal_session = lab.recording("simulated");
    for release in [Release::Camera, Release::Controller] {
        let Some(rig) = Rig::new(release, "") else { return };
        let real = rig.capture("real").succeeds().json();

        let exposed: Vec<i64> = rig.exposed.lock().unwrap().iter().map(|(position, _)| *position).collect();
        assert_eq!(exposed, (0..VIEWS as i64).map(|view| view * VIEW).collect::<Vec<_>>(), "{release:?}");
        let state = rig.board.lock().unwrap().state();
        assert_eq!((&state["idle_steps"], &state["current"]), (&0.into(), &false.into()));
        let shots = if release == Release::Controller { VIEWS } else { 0 };
        assert_eq!(state["shots"], shots, "{release:?}");

        let real_session = rig.lab.recording("real");
        let devices = &real_session.manifest().devices;
        assert!(devices[0].contains("controller") && devices[1].contains("Canon EOS 60D"), "{devices:?}");
        for n in 0..VIEWS {
            let [mine, theirs] = [&real_session, &ideal_session].map(|s| s.frame(n).unwrap().bytes);
            assert!(mine == theirs, "{release:?}: view {n} shows another grain or another angle");
        }
        for pointer in
            ["/hull/volume_mm3", "/hull/surface_area_mm2", "/mesh/volume_mm3", "/axis/axis_column_px"]
        {
            let [mine, theirs] = [&real, &ideal].map(|r| figure(r, pointer));
            assert!((mine / theirs - 1.0).abs() < 1e-9, "{release:?}: {pointer} is {mine}, not {theirs}");
        }
        assert_eq!(real["warnings"], ideal["warnings"]);
        assert_eq!(real["mesh"]["tetrahedra"], ideal["mesh"]["tetrahedra"], "{release:?}");
        // What a real stage and a real camera gave comes out of the recording as it was, byte for byte.
        let again = rig.lab.run(&["--json", "replay", "real"]).succeeds().json();
        assert_eq!(again["differs"], serde_json::json!([]), "{release:?}");
        rig.lab.assert_sound("real");
    }
}

#[test]
fn a_release_whose_plug_is_out_is_told_with_what_to_check() {
    if !speaks_ptpip() {
        return;
    }
    let patience = "shot_s = 1.0\nbusy_s = 0.5\nquiet_s = 0.2\nretry_s = [0.02]";
    let Some(rig) = Rig::new(Release::Unplugged, patience) else { return };
    let parts = [
        "view 0: ",
        "released by the controller and made no file within 0.7 s (2 tries)",
        "check that cable",
    ];
    rig.capture("real").fails(1, &parts);
    assert!(rig.exposed.lock().unwrap().is_empty());
}

#[test]
fn a_release_by_a_controller_that_is_not_there_is_refused() {
    let lab = Lab::new();
    for other in
        ["stage = \"simulated\"\ncamera = \"gphoto2\"", "stage = \"simulated\"\ncamera = \"simulated\""]
    {
        let rig = format!("[rig]\nkind = \"hardware\"\nrelease = \"controller\"\n{other}\n");
        let config = lab.write("bad.toml", rig);
        lab.run(&["--config", &config, "capture", "a"])
            .fails(2, &["rig.release is \"controller\"", "set \"camera\""]);
    }
}
