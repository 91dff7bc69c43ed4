//! Slips of unit: named, refused, and taken where somebody says that they are meant so.

use crate::kit::{Lab, Ran};

/// Refused as a slip, with what was probably meant.
#[track_caller]
fn slip(ran: Ran, parts: &[&str]) {
    ran.fails(2, parts).fails(2, &["--as-given"]);
}

#[test]
fn a_pixel_of_four_millimetres_makes_no_grain() {
    let lab = Lab::new();
    lab.photos("photos");
    let import = |args: &[&str]| lab.run(&[&["--config", "small.toml", "import", "photos"], args].concat());
    let meant = ["did you mean 0.009 mm (it looks given in µm)?", "a grain 200 px wide would be 1800 mm"];
    slip(import(&["--mm-per-px", "9"]), &meant);
    slip(import(&["--mm-per-px", "9e-6"]), &["did you mean 0.009 mm (it looks given in m)?"]);
    let scale = ["--mm-per-px", "0.009"];
    slip(import(&[&scale[..], &["--camera-distance-mm", "0.12"]].concat()), &["did you mean 120 mm", "in m"]);
    slip(import(&[&scale[..], &["--step-deg", "0.1257"]].concat()), &["step_deg is", "7.202°", "in radians"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn a_grain_that_is_too_small_is_refused_before_its_products_are_written() {
    let lab = Lab::new();
    lab.photos("photos");
    // Such a pixel a microscope has; of the grain only the pictures tell.
    let config = lab.config(&[("hull", "voxel_mm = 0.00015"), ("mesh", "surface_size_mm = 0.0007")]);
    let geometry = ["--step-deg", "45", "--closing-view", "4", "--mm-per-px", "0.00005"];
    let ran = lab.run(&[&["--config", &config, "import", "photos"], &geometry[..]].concat());
    slip(ran, &["the body's longest side is 0.00", "did you mean", "by mm_per_px = 0.05 instead of 5e-5"]);
    assert!(!lab.session("photos").join("products/grain.inp").exists());
    lab.assert_sound("photos");
    // The pictures are there: who means it says so.
    lab.run(&["resume", "photos", "--as-given"]).fails(2, &["grainrig reconstruct"]);
    let ran = lab.run(&["reconstruct", "photos", "--as-given", "--json"]).succeeds();
    let warnings = ran.json()["warnings"].to_string();
    assert!(warnings.contains("taken as given: the body's longest side is 0.00"), "{warnings}");
    lab.run(&["replay", "photos"]).succeeds();
}

#[test]
fn slips_in_the_configuration_are_refused_and_those_that_are_meant_are_noted() {
    let lab = Lab::new();
    for (section, line, meant) in [
        ("optics", "mm_per_px = 9.0", "did you mean 0.009 mm"),
        ("optics", "mm_per_px_sigma = 0.003", "did you mean 3e-6 mm"),
        ("optics", "camera_distance_mm = 120000.0", "did you mean 120 mm"),
        ("hull", "voxel_mm = 30.0", "did you mean 0.03 mm"),
        ("simulated", "grain_size_mm = 900.0", "did you mean 0.9 mm"),
        ("simulated", "sphere_diameter_mm = 800.0", "did you mean 0.8 mm"),
        ("simulated", "camera_distance_mm = 0.12", "did you mean 120 mm"),
        ("simulated", "mm_per_px = 9.0", "did you mean 0.009 mm"),
        ("plan", "step_deg = 0.001", "from one view to the next is 0.05°"),
    ] {
        let config = lab.config(&[(section, line)]);
        slip(lab.run(&["--config", &config, "capture", "a"]), &[meant]);
    }
    let config = lab.config(&[("mesh", "surface_size_mm = 120.0")]);
    slip(
        lab.run(&["--config", &config, "capture", "a"]),
        &["surface_size_mm is 120 mm", "did you mean 0.12 mm"],
    );
    // Its views are there all the same, and the size can be given anew.
    lab.run(&["reconstruct", "a", "--surface-size-mm", "0.12"]).succeeds();
    let config = lab.config(&[("optics", "mm_per_px_sigma = 0.003")]);
    let ran = lab.run(&["--config", &config, "--as-given", "--json", "capture", "b"]).succeeds();
    let warnings = ran.json()["warnings"].to_string();
    assert!(warnings.contains("taken as given: mm_per_px_sigma is 0.003 mm"), "{warnings}");
    lab.run(&["replay", "b"]).succeeds();
}

#[test]
fn a_surface_in_another_unit_is_named_with_the_option_that_mends_it() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let stl = lab.session("a").join("products/grain.stl").display().to_string();
    let mesh = |args: &[&str]| lab.run(&[&["mesh", &stl, "--out", "m.inp"], args].concat());
    slip(mesh(&["--unit", "um"]), &["the body's longest side is", "did you mean 0.9", "mm (--unit mm)?"]);
    slip(mesh(&["--unit", "m"]), &["mm (--unit mm)?"]);
    slip(mesh(&["--surface-size-mm", "120"]), &["did you mean 0.12 mm (it looks given in µm)?"]);
    slip(mesh(&["--tet-volume-mm3", "1e5"]), &["did you mean 0.0001 mm³", "in µm³"]);
    assert!(!lab.path("m.inp").exists());
    let ran = mesh(&["--unit", "um", "--as-given", "--json"]).succeeds();
    assert!(ran.json()["warnings"].to_string().contains("taken as given"), "{}", ran.stdout);
    let study = ["study", "sensitivity", "--stl", &stl, "--unit", "m", "--views", "4"];
    slip(lab.run(&study), &["mm (--unit mm)?"]);
}

#[test]
fn a_material_or_load_in_another_unit_is_refused_with_what_was_meant() {
    let lab = Lab::new();
    let compress =
        |args: &[&str]| lab.run(&[&["compress", "--sphere-diameter-mm", "0.8", "--out", "c"], args].concat());
    for (args, meant) in [
        (&["--young-mpa", "100"][..], "did you mean 100000 MPa (it looks given in GPa)?"),
        (&["--young-mpa", "1e11"], "did you mean 100000 MPa (it looks given in Pa)?"),
        (&["--poisson", "22"], "did you mean 0.22 (it looks given in per cent)?"),
        (&["--density-t-mm3", "2650"], "did you mean 2.65e-9 t/mm³ (it looks given in kg/m³)?"),
        (&["--density-t-mm3", "2.65"], "did you mean 2.65e-9 t/mm³ (it looks given in g/cm³)?"),
        (&["--material", "plastic", "--yield-mpa", "1e8"], "did you mean 100 MPa (it looks given in Pa)?"),
        (&["--friction", "20"], "did you mean 0.2 (it looks given in per cent)?"),
        (&["--to-force-n", "10000"], "did you mean 10 N (it looks given in mN)?"),
        (&["--to-approach-mm", "10"], "did you mean 0.01 mm (it looks given in µm)?"),
        (&["--size-mm", "100"], "did you mean 0.1 mm (it looks given in µm)?"),
        (&["--transition-n", "20000"], "did you mean 20 N (it looks given in mN)?"),
        (&["--time-step-s", "0.5"], "did you mean"),
    ] {
        slip(compress(args), &[meant]);
        let _ = std::fs::remove_dir_all(lab.path("c"));
    }
    for (d, meant) in
        [("800", "did you mean 0.8 mm (it looks given in µm)?"), ("0.0008", "did you mean 0.8 mm")]
    {
        slip(lab.run(&["compress", "--sphere-diameter-mm", d]), &[meant]);
    }
    let soft =
        ["--young-mpa", "100", "--to-force-n", "0.01", "--size-mm", "0.2", "--size-at-contact-mm", "0.1"];
    let ran = compress(&[&soft[..], &["--as-given", "--json"]].concat()).succeeds();
    let warnings = ran.json()["warnings"].to_string();
    assert!(warnings.contains("taken as given: young_mpa is 100 MPa"), "{warnings}");
}

#[test]
fn a_ball_for_the_scale_has_a_size_and_a_camera_a_distance() {
    let lab = Lab::new();
    lab.photos("photos");
    let scale =
        |args: &[&str]| lab.run(&[&["calibrate", "scale", "photos", "--out", "s.json"], args].concat());
    slip(scale(&["--ball-diameter-mm", "2000"]), &["ball_diameter_mm", "did you mean 2 mm"]);
    slip(scale(&["--pin-diameter-mm", "0.001"]), &["pin_diameter_mm", "did you mean 1 mm"]);
    slip(scale(&["--ball-diameter-mm", "2", "--camera-distance-mm", "0.1"]), &["did you mean 100 mm"]);
    slip(scale(&["--ball-diameter-mm", "2", "--ball-tolerance-mm", "2"]), &["did you mean 0.002 mm"]);
    slip(scale(&["--ball-diameter-mm", "2", "--step-deg", "0.1257"]), &["in radians"]);
    assert!(!lab.path("s.json").exists());
}

#[test]
fn voxels_in_another_unit_make_no_grain() {
    let lab = Lab::new();
    let header =
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 12 12 12\nencoding: raw\nspacings: 80 80 80\n\n";
    let inside = |i: usize| [i % 12, i / 12 % 12, i / 144].iter().all(|k| (2..10).contains(k));
    let bytes: Vec<u8> = header.bytes().chain((0..1728).map(|i| u8::from(inside(i)))).collect();
    let path = lab.write("grain.nrrd", bytes);
    slip(lab.run(&["mesh", &path]), &["did you mean 0.6", "mm (--unit um)?"]);
    lab.run(&["mesh", &path, "--unit", "um", "--out", "m.inp"]).succeeds();
}
