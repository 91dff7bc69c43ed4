//! Settings in the file and on the command line: refused with exit code 2, value, limit and remedy.

use crate::kit::{Lab, Ran, files};

/// What `capture` says to a configuration; it must make no session.
#[track_caller]
fn capture_with(lab: &Lab, toml: impl AsRef<[u8]>) -> Ran {
    let path = lab.write("bad.toml", toml);
    let ran = lab.run(&["--config", &path, "capture", "a"]);
    assert!(!lab.path("data").exists(), "{}", ran.stderr);
    ran
}

#[test]
fn a_key_that_is_not_known_is_named_with_its_line_and_the_one_that_was_meant() {
    let lab = Lab::new();
    let bad = "[plan]\nviews = 4\nstep_per_view = 50\n";
    let parts =
        ["bad.toml", "line 3", "`step_per_view`", "did you mean `steps_per_view`?", "config/simulated.toml"];
    capture_with(&lab, bad).fails(2, &parts);
    capture_with(&lab, "[simulatd]\nwidth = 300\n").fails(2, &["`simulatd`", "did you mean `simulated`?"]);
    capture_with(&lab, "[simulated.faults]\nslip = { at = 1, degrees = 3.0 }\n").fails(2, &["`degrees`"]);
    let far = capture_with(&lab, "[plan]\nquite_something_else = 1\n").fails(2, &["expected one of `views`"]);
    assert!(!far.stderr.contains("did you mean"), "{}", far.stderr);
}

#[test]
fn a_value_of_the_wrong_kind_is_named_with_its_line() {
    let lab = Lab::new();
    capture_with(&lab, "[plan]\nviews = \"many\"\n").fails(2, &["line 2", "views = \"many\"", "string"]);
    capture_with(&lab, "[plan]\nviews = -3\n").fails(2, &["line 2", "views = -3"]);
    capture_with(&lab, "[plan]\nviews = 4.5\n").fails(2, &["line 2", "views = 4.5"]);
    capture_with(&lab, "[rig]\nkind = \"imaginary\"\n").fails(2, &["line 2", "imaginary", "simulated"]);
    capture_with(&lab, "plan = 3\n").fails(2, &["line 1", "plan = 3"]);
}

#[test]
fn a_value_outside_its_limits_is_refused_with_both() {
    let lab = Lab::new();
    let cases = [
        ("[plan]\nviews = 0\n", ["views is 0", "2 to 2000"]),
        ("[plan]\nsteps_per_view = 17\n", ["steps_per_view is 17", "1 to 16"]),
        ("[plan]\nstep_deg = nan\n", ["step_deg is NaN°", "0.0001 to 45"]),
        ("[plan]\nsettle_ms = 60001\n", ["settle_ms is 60001 ms", "0 to 60000 ms"]),
        ("[plan]\ntolerance_deg = -1\n", ["tolerance_deg is -1°", "more than 0"]),
        ("[optics]\nmm_per_px = nan\n", ["mm_per_px is NaN mm", "positive"]),
        ("[optics]\nmm_per_px = 0\n", ["mm_per_px is 0 mm", "positive"]),
        ("[optics]\nmm_per_px = -0.0043\n", ["mm_per_px is -0.0043 mm", "positive"]),
        ("[optics]\nmm_per_px = inf\n", ["mm_per_px is inf mm", "positive"]),
        ("[optics]\ncamera_distance_mm = 0\n", ["camera_distance_mm is 0 mm", "telecentric"]),
        ("[optics]\nroll_deg = 90\n", ["roll_deg is 90 °", "-45 and 45"]),
        ("[hull]\nvoxel_mm = 0\n", ["voxel size 0 mm", "positive"]),
        ("[mesh]\nfacet_angle_deg = 60\n", ["facet_angle_deg is 60", "30"]),
        ("[mesh]\nsurface_size_mm = nan\n", ["surface_size_mm is NaN mm", "positive"]),
        ("[simulated]\nmm_per_px = nan\n", ["mm_per_px is NaN mm", "[simulated]"]),
        ("[simulated]\nwidth = 0\n", ["width is 0 px", "32 to 65500"]),
        ("[simulated]\ngrain_stl = \"nowhere.stl\"\n", ["nowhere.stl", "grain_stl"]),
    ];
    for (toml, parts) in cases {
        let ran = capture_with(&lab, toml);
        // A file that is not there is found on opening the rig: no setting is wrong in itself.
        let code = if toml.contains("grain_stl") { 1 } else { 2 };
        ran.fails(code, &parts);
    }
}

#[test]
fn a_configuration_that_is_no_text_or_no_toml_or_not_there_is_refused() {
    let lab = Lab::new();
    let garbage: Vec<u8> = (0..=255).rev().cycle().take(4096).collect();
    capture_with(&lab, garbage).fails(2, &["bad.toml", "line 1", "not UTF-8"]);
    capture_with(&lab, "views = [1, 2\n").fails(2, &["bad.toml", "line"]);
    capture_with(&lab, "[plan]\nviews = 4\nviews = 5\n").fails(2, &["line 3", "duplicate"]);
    lab.run(&["--config", "nowhere.toml", "capture", "a"]).fails(2, &["nowhere.toml", "--config"]);
    lab.run(&["--config", ".", "capture", "a"]).fails(2, &["--config"]);
}

#[test]
fn options_outside_their_limits_are_usage_errors() {
    let lab = Lab::new();
    lab.photos("photos");
    let capture = |views: &str| lab.run(&["--config", "small.toml", "capture", "a", "--views", views]);
    capture("0").fails(2, &["--views is 0", "2 to 200"]);
    capture("201").fails(2, &["--views is 201", "2 to 200", "0.9°"]);
    capture("-4").fails(2, &["--views"]);
    capture("many").fails(2, &["--views", "many"]);
    for scale in ["nan", "0", "-0.0043", "inf"] {
        let ran = lab.run(&["import", "photos", "--mm-per-px", scale]);
        ran.fails(2, &["mm_per_px is ", "mm per pixel", "positive"]);
    }
    lab.run(&["import", "photos"]).fails(2, &["the scale is missing", "--mm-per-px", "--cameras"]);
    let import =
        |option: &str, value: &str| lab.run(&["import", "photos", "--mm-per-px", "0.009", option, value]);
    import("--step-deg", "0").fails(2, &["step_deg is 0°", "at most 180°"]);
    import("--step-deg", "-7.2").fails(2, &["step_deg is -7.2°", "cw"]);
    import("--step-deg", "nan").fails(2, &["step_deg is NaN°"]);
    import("--first-deg", "inf").fails(2, &["first_deg is inf°", "360°"]);
    import("--camera-distance-mm", "-1").fails(2, &["camera_distance_mm is -1 mm"]);
    import("--axis-column-px", "nan").fails(2, &["axis_column_px is NaN px"]);
    import("--surface-size-mm", "-1").fails(2, &["surface_size_mm is -1 mm", "positive"]);
    import("--rotation", "left").fails(2, &["ccw", "cw"]);
    lab.run(&["import", "photos", "--cameras", "c.csv", "--mm-per-px", "1"])
        .fails(2, &["cannot be used with"]);
    lab.run(&["juggle"]).fails(2, &["juggle", "--help"]);
    lab.run(&["capture"]).fails(2, &["<NAME>"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn mesh_controls_that_cannot_be_kept_leave_the_products_as_they_are() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let before = lab.products("a");
    let again = |option: &str, value: &str| lab.run(&["reconstruct", "a", option, value]);
    again("--surface-size-mm", "nan").fails(2, &["surface_size_mm is NaN mm", "positive"]);
    again("--surface-size-mm", "-1").fails(2, &["surface_size_mm is -1 mm"]);
    again("--facet-angle-deg", "60").fails(2, &["facet_angle_deg is 60", "30"]);
    again("--tet-volume-mm3", "0").fails(2, &["tet_volume_mm3 is 0 mm³"]);
    again("--surface-size-mm", "1e-6").fails(2, &["surface_size_mm is 1e-6 mm", "--as-given"]);
    lab.run(&["reconstruct", "a", "--surface-size-mm", "1e-6", "--as-given"])
        .fails(2, &["tetrahedra, more than", "surface_size_mm"]);
    assert_eq!(lab.products("a"), before);
    lab.assert_sound("a");
}

#[test]
fn a_surface_that_cannot_be_meshed_is_refused_and_no_file_is_written() {
    let lab = Lab::new();
    let garbage: Vec<u8> = (0..=255).cycle().take(10_000).collect();
    lab.write("garbage.stl", &garbage);
    lab.write("empty.stl", b"");
    let corner =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    lab.write("open.stl", format!("solid open\n{corner}endsolid open\n"));
    let there = files(&lab.path("."));
    lab.run(&["mesh", "garbage.stl"]).fails(1, &["garbage.stl", "STL", "export it again"]);
    lab.run(&["mesh", "empty.stl"]).fails(1, &["empty.stl", "STL"]);
    lab.run(&["mesh", "open.stl"]).fails(1, &["open.stl", "close it"]);
    lab.run(&["mesh", "nowhere.stl"]).fails(1, &["nowhere.stl", "check the path"]);
    lab.run(&["mesh", "open.stl", "--out", "grain.off"])
        .fails(2, &["grain.off", "one of .inp, .vtu, .msh, .stl"]);
    lab.run(&["mesh", "open.stl", "--out", "grain"]).fails(2, &["grain", "one of .inp, .vtu, .msh, .stl"]);
    assert_eq!(files(&lab.path(".")), there);
}

#[test]
fn a_configuration_given_to_a_recorded_session_is_said_to_be_unused() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let ran = lab.run(&["--config", "small.toml", "replay", "a"]).succeeds();
    assert!(ran.stderr.contains("small.toml is not used"), "{}", ran.stderr);
}

#[test]
fn a_hostile_pattern_is_refused_in_one_line() {
    let lab = Lab::new();
    lab.photos("photos");
    let import = |pattern: &str| lab.run(&["import", "photos", "--mm-per-px", "0.009", "--pattern", pattern]);
    let nested = |n: usize| "{".repeat(n) + "a" + &"}".repeat(n);
    import(&nested(250)).fails(2, &["pattern is 250 braces deep", "at most 10", "{jpg,png}"]);
    import(&nested(60_000)).fails(2, &["pattern is 120001 bytes long", "at most 1000"]);
    import("[z-a].jpg").fails(2, &["pattern is ", "grain_*.png"]);
    import("{a,b").fails(2, &["pattern is ", "grain_*.png"]);
    // Many ways to match, none of them by going back.
    import(&("*a".repeat(300) + ".png")).fails(1, &["no file in photos matches"]);
    let scale = ["calibrate", "scale", "photos", "--ball-diameter-mm", "1", "--out", "s.json", "--pattern"];
    lab.run(&[&scale[..], &[&nested(250)]].concat()).fails(2, &["250 braces deep"]);
    assert!(!lab.path("data").exists());
}

#[test]
fn a_lost_step_is_told_in_steps_of_the_motor_that_the_plan_has() {
    let lab = Lab::new();
    // 1.8°: a step of this motor, two of the default one.
    let plan = ["views = 25", "steps_per_view = 4", "step_deg = 1.8"].map(|line| ("plan", line));
    let motor = ["steps_per_turn = 200", "faults = { lost_step_at = 12 }"].map(|line| ("simulated", line));
    let size = ["width = 648", "height = 432", "mm_per_px = 0.006"].map(|line| ("simulated", line));
    let config = lab.config(&[&plan[..], &motor[..], &size[..], &[("optics", "mm_per_px = 0.006")]].concat());
    let ran = lab.run(&["--config", &config, "capture", "a"]).succeeds();
    assert!(ran.stdout.contains(": 1 full step of the motor lost"), "{}", ran.stdout);
}
