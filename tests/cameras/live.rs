//! Live view, to focus by.

use crate::bench::scene;
use crate::kit::{Lab, pictures, read};
use crate::network::Network;
use crate::ptp_camera::{Personality, PtpCamera, Setup, speaks_ptpip};
use grainrig::rig::gphoto::Target;
use grainrig::rig::simulated::{self, Settings};
use grainrig::rig::{Camera as _, RigError, RotationStage as _};
use grainrig_core::geometry::Angle;

#[test]
fn live_view_shows_what_is_there_and_is_over_before_the_next_picture() {
    if !speaks_ptpip() {
        return;
    }
    for target in [Target::Card, Target::Ram] {
        let network = Network::new(Setup::new(Personality::Eos), target);
        network.body.shows(|n| pictures()[n % 3].clone());
        let mut camera = network.open().unwrap();
        for n in 0..3 {
            assert_eq!(scene(&camera.preview().unwrap()), n);
            assert!(network.body.live_view());
        }
        network.look_at(3);
        assert_eq!(scene(&camera.capture().unwrap()), 3);
        assert!(!network.body.live_view() && network.body.releases() == 1);
        camera.kept();
        camera.preview().unwrap();
        // Whoever leaves lets the mirror down, and leaves no picture behind.
        drop(camera);
        assert!(!network.body.live_view());
        assert_eq!(network.body.pictures(), Vec::<String>::new());
    }
}

#[test]
fn a_camera_without_live_view_says_so_and_takes_pictures_all_the_same() {
    if !speaks_ptpip() {
        return;
    }
    let network = Network::new(Setup::new(Personality::Generic), Target::Card);
    let mut camera = network.open().unwrap();
    let Err(RigError::Suspended { cause, .. }) = camera.preview() else { panic!("it shows something") };
    assert!(cause.contains("no live view"), "{cause}");
    camera.capture().unwrap();
}

/// The same grain ever more in focus, and then less again.
fn through_focus() -> Vec<Vec<u8>> {
    let blurs = [6.0, 3.0, 1.0, 2.0, 5.0];
    blurs
        .map(|blur_px| {
            let size = Settings { width: 640, height: 480, ..Settings::default() };
            let (mut stage, mut camera, _) = simulated::open(&Settings { blur_px, ..size }).unwrap();
            stage.move_to(Angle::default()).unwrap();
            camera.capture().unwrap().bytes
        })
        .into()
}

#[test]
fn the_program_says_which_picture_is_the_sharpest_and_keeps_the_newest() {
    if !speaks_ptpip() {
        return;
    }
    let shown = through_focus();
    let last = shown.last().unwrap().clone();
    let camera = PtpCamera::start(Setup::new(Personality::Eos), |_| pictures()[0].clone());
    camera.shows(move |n| shown[n].clone());
    let lab = Lab::new();
    let config = lab.write(
        "eos.toml",
        format!(
            "[rig]\nkind = \"hardware\"\nstage = \"simulated\"\ncamera = \"gphoto2\"\n[gphoto2]\nmodel = \"{}\"\nport = \"{}\"\n",
            camera.model(),
            camera.address()
        ),
    );
    let ran = lab.run(&["--json", "--config", &config, "focus", "--pictures", "5", "--save", "newest.jpg"]);
    let all = ran.succeeds().json();
    let figures = |name: &str| -> Vec<f64> {
        all["pictures"].as_array().unwrap().iter().map(|p| p[name].as_f64().unwrap()).collect()
    };
    let (sharp, best, blur) = (figures("sharpness"), figures("best"), figures("blur_px"));
    let falls = |v: &[f64]| v.windows(2).all(|w| w[1] < w[0]);
    let rises = |v: &[f64]| v.windows(2).all(|w| w[1] > w[0]);
    assert!(rises(&sharp[..3]) && falls(&sharp[2..]), "{sharp:?}");
    assert_eq!((best[2], best[4]), (sharp[2], sharp[2]));
    // What the lens does, as far as an outline tells.
    for (told, is) in blur.iter().zip([6.0, 3.0, 1.0, 2.0, 5.0]) {
        assert!((told / is - 1.0).abs() < 0.25, "{told} px told of {is} px: {blur:?}");
    }
    assert!(read(&lab.path("newest.jpg")) == last);
    assert!(!camera.live_view() && camera.releases() == 0);
    // One line each for a person; of the simulated rig too, without a configuration.
    let told = lab.run(&["focus", "--pictures", "1"]).succeeds().stdout;
    assert!(told.contains("100 % of the best") && told.contains("outline is blurred by"), "{told}");
}
