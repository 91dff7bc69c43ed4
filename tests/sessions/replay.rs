//! A recorded session replays to the same bytes, and `verify` finds every change of them.

use crate::kit::{Lab, MM_PER_PX, Ran, VIEWS, files, read};
use grainrig::acquire::Control;
use grainrig::config::Config;
use grainrig::jobs::{self, JobError, Watcher};
use grainrig::pipeline::{Cameras, TurntableSettings};
use grainrig::session::event::{Event, EventKind};
use grainrig::session::import::{ImportRequest, scan};
use grainrig::session::{Manifest, Recording, State, Store, verify};
use grainrig_core::geometry::Angle;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Mesh in three forms, figures, the calibration's sheet and the hull's convergence in two each, and an outline for each
/// view.
const PRODUCTS: usize = 4 + 2 + 2 + VIEWS;

fn captured() -> Lab {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    lab
}

#[test]
fn a_replay_gives_the_recorded_bytes_on_any_number_of_threads() {
    let lab = captured();
    let (recorded, journal) = (lab.products("a"), read(&lab.session("a").join("journal.jsonl")));
    assert_eq!(recorded.len(), PRODUCTS);
    for threads in ["1", "3", "2"] {
        let ran = Ran::from(lab.command(&["replay", "a"]).env("RAYON_NUM_THREADS", threads)).succeeds();
        assert!(ran.stdout.ends_with("every product has the recorded bytes\n"), "{}", ran.stdout);
        assert_eq!(lab.products("a"), recorded, "{threads} threads");
    }
    assert_eq!(read(&lab.session("a").join("journal.jsonl")), journal);
    lab.assert_sound("a");
}

/// Which plans: a few, among them some that did not replay once, or all of 2 to 72 views.
fn plans() -> Vec<u32> {
    if std::env::var_os("GRAINRIG_PLANS").is_some() { (2..=72).collect() } else { vec![2, 12, 15, 25] }
}

/// A plan of so many views over half a turn (over a whole one where `whole_turn`), as quick as can be.
fn quick(views: u32, whole_turn: bool, faults: &str) -> Config {
    let half_turn = if whole_turn { 400 } else { 200 };
    let text = format!(
        "plan = {{ views = {views}, steps_per_view = {}, settle_ms = 0 }}\nreport = {{ pictures = false }}\n\
         optics = {{ mm_per_px = 0.018 }}\nhull = {{ voxel_mm = 0.06 }}\nmesh = {{ surface_size_mm = 0.24 }}\n\
         [simulated]\nwidth = 162\nheight = 108\nmm_per_px = 0.018\nwobble_px = 0.0\nnoise_sd = 1.0\n{faults}",
        half_turn / views
    );
    toml::from_str(&text).unwrap()
}

/// Captures a plan, aborting it after so many views and going on with it where that is asked, and replays it.
fn replays(views: u32, whole_turn: bool, faults: &str, abort_after: Option<usize>) {
    let what = format!("{views} views, whole turn {whole_turn}, {faults:?}, aborted after {abort_after:?}");
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("a");
    let control = Arc::new(Control::new());
    let (seen, stop) = (Arc::new(Mutex::new(0)), Arc::clone(&control));
    let watcher: Watcher = Arc::new(move |event| {
        let mut seen = seen.lock().unwrap();
        *seen += usize::from(matches!(event.what, EventKind::Captured { .. }));
        if abort_after == Some(*seen) {
            stop.abort();
        }
    });
    let done = jobs::capture(dir.path(), "a", &quick(views, whole_turn, faults), None, &control, &watcher);
    let quiet: Watcher = Arc::new(|_| {});
    match (done, abort_after) {
        (Err(JobError::Aborted { .. }), Some(_)) => {
            jobs::resume(&folder, None, &Control::new(), &quiet).unwrap_or_else(|e| panic!("{what}: {e}"));
        }
        (done, _) => drop(done.unwrap_or_else(|e| panic!("{what}: {e}"))),
    }
    if faults.contains("_frame_at") {
        let recording = Recording::read(&folder).unwrap();
        let rejected = |e: &&Event| matches!(e.what, EventKind::Rejected { .. });
        assert!(recording.events().iter().find(rejected).is_some(), "{what}: no picture was taken again");
    }
    let again = jobs::replay(&folder, &quiet).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(again.differs, Vec::<String>::new(), "{what}");
    assert!(verify(&folder).unwrap().is_sound(), "{what}");
}

#[test]
fn every_plan_replays_to_the_recorded_bytes_also_where_pictures_were_taken_again_and_runs_taken_up() {
    let spoilt = "faults = { obstructed_frame_at = 1 }";
    for views in plans() {
        replays(views, false, "", None);
        replays(views, false, spoilt, Some(1));
        // Two views over a whole turn look at the grain from opposite sides, which bounds nothing.
        if std::env::var_os("GRAINRIG_PLANS").is_some() && views > 2 {
            replays(views, true, "", Some(views as usize / 2));
        }
    }
}

#[test]
fn the_default_configuration_replays_and_heals() {
    let lab = Lab::new();
    lab.run(&["capture", "a"]).succeeds();
    let recorded = lab.products("a");
    lab.run(&["replay", "a"]).succeeds();
    std::fs::remove_file(lab.session("a").join("products/grain.inp")).unwrap();
    lab.run(&["replay", "a"]).succeeds();
    assert_eq!(lab.products("a"), recorded);
    lab.assert_sound("a");
}

#[test]
fn products_that_are_lost_or_damaged_are_written_again() {
    let lab = captured();
    let recorded = lab.products("a");
    let folder = lab.session("a").join("products");
    std::fs::remove_file(folder.join("grain.inp")).unwrap();
    std::fs::write(folder.join("grain.stl"), b"not what was recorded").unwrap();
    lab.run(&["replay", "a"]).succeeds();
    assert_eq!(lab.products("a"), recorded);
    std::fs::remove_dir_all(&folder).unwrap();
    lab.run(&["replay", "a"]).succeeds();
    assert_eq!(lab.products("a"), recorded);
    lab.assert_sound("a");
}

#[test]
fn a_replay_repeats_the_newest_mesh_that_was_asked_for() {
    let lab = captured();
    let first = lab.products("a");
    let object = lab.run(&["--json", "reconstruct", "a", "--surface-size-mm", "0.2"]).succeeds().json();
    let coarse = lab.products("a");
    assert_ne!(first["grain.inp"], coarse["grain.inp"]);
    let replayed = lab.run(&["--json", "replay", "a"]).succeeds().json();
    assert_eq!((&replayed["differs"], &replayed["mesh"]), (&serde_json::json!([]), &object["mesh"]));
    assert_eq!(lab.products("a"), coarse);
    // One control alone leaves the session's others as they were configured.
    lab.run(&["reconstruct", "a", "--facet-angle-deg", "5"]).succeeds();
    let controls = lab.run(&["--json", "replay", "a"]).succeeds().json()["mesh"]["controls"].clone();
    assert_eq!((&controls["surface_size_mm"], &controls["facet_angle_deg"]), (&0.12.into(), &5.0.into()));
    lab.run(&["reconstruct", "a"]).succeeds();
    assert_eq!(lab.products("a")["grain.inp"], first["grain.inp"]);
}

#[test]
fn an_imported_session_replays() {
    let lab = Lab::new();
    lab.photos("photos");
    lab.import("photos", &[]).succeeds();
    let recorded = lab.products("photos");
    lab.run(&["replay", "photos"]).succeeds();
    assert_eq!(lab.products("photos"), recorded);
    lab.assert_sound("photos");
}

#[test]
fn a_session_without_products_gets_its_first_ones_and_then_replays_to_them() {
    let lab = Lab::new();
    let found = scan(&ImportRequest { step_deg: 45.0, ..ImportRequest::new(lab.photos("photos"), "*.jpg") });
    let config = Config::read(&lab.path("small.toml")).unwrap();
    let cameras =
        Cameras::Turntable(TurntableSettings { mm_per_px: MM_PER_PX, ..TurntableSettings::default() });
    let (config, cameras) = (serde_json::to_value(config).unwrap(), serde_json::to_value(cameras).unwrap());
    drop(found.unwrap().import(&Store::new(lab.path("data")), "a", config, cameras).unwrap());
    assert_eq!(lab.recording("a").state(), State::Captured);
    lab.run(&["replay", "a"]).succeeds();
    assert_eq!(lab.recording("a").state(), State::Complete);
    let made = lab.products("a");
    assert_eq!(made.len(), PRODUCTS);
    lab.run(&["replay", "a"]).succeeds();
    assert_eq!(lab.products("a"), made);
    lab.assert_sound("a");
}

#[test]
fn json_is_one_object_with_every_figure_and_products_that_exist() {
    let lab = Lab::new();
    let capture = lab.run(&["--json", "--config", "small.toml", "capture", "a"]).succeeds().json();
    let replay = lab.run(&["--json", "replay", "a"]).succeeds().json();
    let import = {
        lab.photos("photos");
        let args = ["--json", "--config", "small.toml", "import", "photos", "--step-deg", "45"];
        lab.run(&[&args[..], &["--mm-per-px", "0.009", "--closing-view", "4"]].concat()).succeeds().json()
    };
    let positive = [
        "/views",
        "/scale_mm_per_px",
        "/hull/volume_mm3",
        "/hull/voxel_volume_mm3",
        "/hull/surface_area_mm2",
        "/mesh/nodes",
        "/mesh/triangles",
        "/mesh/tetrahedra",
        "/mesh/volume_mm3",
        "/mesh/dihedral_deg/min",
        "/mesh/dihedral_deg/p01",
        "/mesh/dihedral_deg/max",
        "/mesh/facet_angle_deg/min",
        "/mesh/radius_edge/max",
        "/timing_s/silhouette",
        "/timing_s/hull",
        "/timing_s/mesh",
        "/timing_s/total",
    ];
    for object in [&capture, &replay, &import] {
        for pointer in positive {
            let value = object.pointer(pointer).and_then(Value::as_f64);
            assert!(value.is_some_and(|v| v > 0.0), "{pointer} is {value:?}: {object}");
        }
        assert!(
            object["hull"]["bounding_box_mm"].is_object() || object["hull"]["bounding_box_mm"].is_array()
        );
        for kind in ["inp", "vtu", "stl"] {
            let path = object["products"][kind].as_str().unwrap();
            assert!(Path::new(path).is_absolute() && Path::new(path).is_file(), "{path}");
        }
    }
    assert_eq!(capture["views"], 4);
    // The replay's own timing apart, it is the same result.
    for key in ["views", "scale_mm_per_px", "axis", "hull", "mesh", "products", "warnings"] {
        assert_eq!(capture[key], replay[key], "{key}");
    }
}

/// Every file of a session that is recorded, relative to its folder.
fn recorded_files(folder: &Path) -> Vec<PathBuf> {
    let sub =
        |sub: &str| files(&folder.join(sub)).into_iter().map(|f| Path::new(sub).join(f)).collect::<Vec<_>>();
    [vec!["manifest.json".into(), "journal.jsonl".into()], sub("frames"), sub("products")].concat()
}

#[test]
fn verify_names_the_file_in_which_one_byte_has_changed() {
    let lab = captured();
    let folder = lab.session("a");
    let all = recorded_files(&folder);
    assert_eq!(all.len(), 2 + VIEWS + PRODUCTS);
    for file in all {
        let path = folder.join(&file);
        let whole = read(&path);
        let report = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            lab.run(&["--json", "verify", "a"])
        };
        for at in [0, 1, whole.len() / 3, whole.len() / 2, whole.len() - 2, whole.len() - 1] {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x04;
            let ran = report(&bytes).fails(1, &[file.to_str().unwrap()]);
            assert!(!ran.json()["faults"].as_array().unwrap().is_empty(), "{} at {at}", file.display());
        }
        report(&whole[..whole.len() - 1]).fails(1, &[file.to_str().unwrap()]);
        report(&[&whole[..], b"\n"].concat()).fails(1, &[file.to_str().unwrap()]);
        report(&whole).succeeds();
    }
    std::fs::write(folder.join("products/extra.inp"), b"from somewhere").unwrap();
    lab.run(&["verify", "a"]).fails(1, &["products/extra.inp: not in the journal"]);
}

#[test]
fn the_replay_takes_the_same_way_through_the_acquisition_as_the_rig() {
    let lab = captured();
    let names: Arc<Mutex<Vec<EventKind>>> = Arc::default();
    let heard = Arc::clone(&names);
    let watcher: Watcher = Arc::new(move |event| heard.lock().unwrap().push(event.what.clone()));
    let done = jobs::replay(&lab.session("a"), &watcher).unwrap();
    assert!(done.differs.is_empty());
    let steps = |events: &[EventKind]| -> Vec<(&'static str, Option<usize>)> {
        let step = |what: &EventKind| match what {
            EventKind::Started { .. } => Some(("started", None)),
            EventKind::Homed => Some(("homed", None)),
            EventKind::Moving { view, .. } => Some(("moving", Some(*view))),
            EventKind::Captured { view, .. } => Some(("captured", Some(view.view))),
            EventKind::AcquisitionComplete { .. } => Some(("all captured", None)),
            _ => None,
        };
        events.iter().filter_map(step).collect()
    };
    let recorded: Vec<EventKind> = lab.recording("a").events().iter().map(|e| e.what.clone()).collect();
    let replayed = names.lock().unwrap().clone();
    assert_eq!(steps(&replayed), steps(&recorded));
    assert_eq!(steps(&recorded).len(), 2 * VIEWS + 3);
}

#[test]
fn a_journal_in_which_each_view_was_kept_before_the_next_move_replays_to_the_same_bytes() {
    let lab = captured();
    let made = lab.recording("a");
    let manifest = Manifest { name: "b".into(), ..made.manifest().clone() };
    let mut session = Store::new(lab.path("data")).create(&manifest).unwrap();
    let views = manifest.plan.views.len();
    session.append(EventKind::Started { session: "b".into(), views, already_captured: 0 }).unwrap();
    session.append(EventKind::Homed).unwrap();
    for view in made.views() {
        session.append(EventKind::Moving { view: view.view, target_deg: view.commanded_deg }).unwrap();
        let (reached, frame) = (Angle::from_deg(view.reached_deg), made.frame(view.view).unwrap());
        session.record_frame(view.view, reached, &frame, None).unwrap();
    }
    session.append(EventKind::AcquisitionComplete { views }).unwrap();
    drop(session);
    for _ in 0..2 {
        lab.run(&["replay", "b"]).succeeds();
        let (a, b) = (lab.products("a"), lab.products("b"));
        assert_eq!((&a["grain.stl"], &a["grain.vtu"]), (&b["grain.stl"], &b["grain.vtu"]));
    }
    lab.assert_sound("b");
}
