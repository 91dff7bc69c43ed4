//! `grainrig compress` as a user runs it.

use crate::bodies::ball;
use crate::skip::shared_data;
use grainrig_core::contact::experiment::{Compliance, read};
use grainrig_core::geometry::TriangleMesh;
use serde_json::Value;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A small, quick sphere.
const SPHERE: [&str; 7] =
    ["--sphere-diameter-mm", "0.8", "--size-mm", "0.12", "--size-at-contact-mm", "0.06", "--json"];

fn grainrig(folder: &TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainrig"));
    command.current_dir(folder.path()).arg("compress");
    command
}

fn json(command: &mut Command) -> Value {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

fn refused(command: &mut Command) -> (i32, String) {
    let out = command.output().unwrap();
    (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
}

#[test]
fn a_sphere_gives_its_curve_its_files_and_its_figures() {
    let folder = TempDir::new().unwrap();
    let experiment =
        (0..40).fold("Raw Data\nTime (s),Displacement (mm),Force (N)\n".to_owned(), |text, i| {
            let d = 2e-4 * f64::from(i);
            text + &format!("{i},{d},{}\n", 3.2e4 * d.powf(1.5))
        });
    std::fs::write(folder.path().join("test.csv"), experiment).unwrap();
    let r = json(grainrig(&folder).args(SPHERE).args([
        "--out",
        "s",
        "--to-force-n",
        "5",
        "--experiment",
        "test.csv",
    ]));
    let curve = r["curve"].as_array().unwrap();
    let last = curve.last().unwrap();
    assert!(
        last["force_n"].as_f64().unwrap() >= 5.0
            && last["approach_mm"].as_f64() > curve[0]["approach_mm"].as_f64()
    );
    for key in ["delta_i_mm", "elements", "steps", "wall_s"] {
        assert!(r[key].as_f64().unwrap() > 0.0, "{key}");
    }
    let energy = |key: &str| r["energy"][key].as_f64().unwrap();
    assert!(energy("kinetic_n_mm") < 0.05 * energy("internal_n_mm"));
    assert!(energy("internal_n_mm") <= 1.01 * energy("external_n_mm"));
    assert!(energy("balance_error").abs() < 0.01);
    assert_eq!(r["finished"], true);
    // What is printed is what the file says, with the version of its form and of the program.
    let file = std::fs::read(folder.path().join("s/result.json")).unwrap();
    let file: Value = serde_json::from_slice(&file).unwrap();
    assert_eq!((&file["schema"], &file["software"]), (&r["schema"], &r["software"]));
    assert_eq!(file["schema"], 1);
    for name in [
        "curve.csv",
        "curve.svg",
        "curve.png",
        "result.json",
        "stages.pvd",
        "stage_08.vtu",
        "stage_08.png",
        "abaqus.inp",
        "calculix.inp",
    ] {
        assert!(folder.path().join("s").join(name).metadata().unwrap().len() > 100, "{name}");
    }
    let of = &r["experiment"];
    assert!((of["delta_i_mm"].as_f64().unwrap() - (2.0f64 / 3.2e4).powf(2.0 / 3.0)).abs() < 3e-4, "{of}");
    assert_eq!(of["delta_i_mm"], of["first_crossing_mm"]);
    assert!(of["zero_n"].as_f64().unwrap().abs() < 0.05 && of["contact_n"].as_f64().unwrap() > 0.0, "{of}");
    assert!(
        of["agreement"]["rms_n"].is_number() && of["end"] == "record_ends" && of["notes"].is_array(),
        "{of}"
    );
    let svg = std::fs::read_to_string(folder.path().join("s/curve.svg")).unwrap();
    assert!(
        svg.contains("experiment: zero")
            && svg.contains("experiment")
            && svg.contains("two plates")
            && svg.contains("determination")
    );
    let pvd = std::fs::read_to_string(folder.path().join("s/stages.pvd")).unwrap();
    assert_eq!(pvd.matches("<DataSet").count(), 8);
    let again = refused(grainrig(&folder).args(SPHERE).args(["--out", "s"]));
    assert!(again.0 == 2 && again.1.contains("not an empty folder"), "{again:?}");
}

#[test]
fn a_killed_compression_goes_on_to_the_same_bits() {
    let folder = TempDir::new().unwrap();
    let to = ["--to-force-n", "40"];
    let whole = json(grainrig(&folder).args(SPHERE).args(to).args(["--out", "whole"]));
    // Ended in the middle, by Ctrl-C's signal: what there is can be read, and says so.
    let mut child = grainrig(&folder)
        .args(SPHERE)
        .args(to)
        .args(["--out", "part"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    lines.by_ref().map(Result::unwrap).find(|l| l.contains("contacts, about")).unwrap();
    let pid = rustix::process::Pid::from_raw(child.id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    lines.for_each(drop);
    assert!(child.wait().unwrap().success());
    let text = std::fs::read_to_string(folder.path().join("part/result.json")).unwrap();
    let partial: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(partial["finished"], false);
    let resumed = json(grainrig(&folder).args(["--resume", "part", "--json"]));
    assert_eq!(resumed["finished"], true);
    for key in ["curve", "steps", "energy", "contacts"] {
        assert_eq!(resumed[key], whole[key], "{key}");
    }
    for name in ["curve.csv", "stage_08.vtu", "stage_02.vtu"] {
        let read = |of: &str| std::fs::read(folder.path().join(of).join(name)).unwrap();
        assert!(read("part") == read("whole"), "{name}");
    }
}

/// Bodies with which something is wrong, as files.
fn bad_bodies(folder: &Path) {
    let write = |name: &str, text: &[u8]| std::fs::write(folder.join(name), text).unwrap();
    let ball = ball(0.4, 4.0).surface().triangles;
    let stl = |name: &str, by: f64, change: &dyn Fn(&mut TriangleMesh)| {
        let mut surface = ball.clone();
        surface.vertices.iter_mut().for_each(|p| p.coords *= by);
        change(&mut surface);
        let mut bytes = Vec::new();
        grainrig_core::formats::stl::write(&surface, &mut bytes).unwrap();
        write(name, &bytes);
        bytes
    };
    stl("metres.stl", 1e-3, &|_| ());
    stl("open.stl", 1.0, &|s| s.triangles.truncate(s.triangles.len() - 1));
    let mut odd = stl("inwards.stl", 1.0, &|s| s.triangles.iter_mut().for_each(|t| t.swap(1, 2)));
    // The first corner of the first triangle, behind the header, the count and the normal.
    odd[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    write("nan.stl", &odd);
    let deck = |name: &str, last: &str, tets: &str| {
        let nodes = "1, 0, 0, 0\n2, .5, 0, 0\n3, 0, .5, 0\n4, 0, 0, .5\n";
        write(name, format!("*NODE\n{nodes}{last}\n*ELEMENT, TYPE=C3D4\n{tets}\n").as_bytes());
    };
    deck("inverted.inp", "5, .5, .5, .5", "1, 1, 3, 2, 4\n2, 2, 3, 4, 5");
    deck("nan.inp", "5, nan, 0, 0", "1, 1, 2, 3, 4\n2, 2, 3, 4, 5");
    let far = "5, 2, 0, 0\n6, 2.5, 0, 0\n7, 2, .5, 0\n8, 2, 0, .5";
    deck("detached.inp", far, "1, 1, 2, 3, 4\n2, 5, 6, 7, 8");
    write("no.inp", b"hello\n");
}

#[test]
fn a_surface_that_is_inside_out_is_turned_and_that_is_said() {
    let folder = TempDir::new().unwrap();
    bad_bodies(folder.path());
    let small = ["--size-mm", "0.15", "--size-at-contact-mm", "0.1", "--to-force-n", "1", "--out", "s"];
    let out = grainrig(&folder).arg("inwards.stl").args(small).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.contains("inwards.stl: it was inside out"), "{said}");
}

#[test]
fn what_cannot_be_compressed_is_refused_with_what_to_do() {
    let folder = TempDir::new().unwrap();
    bad_bodies(folder.path());
    std::fs::write(folder.path().join("no.stl"), b"this is no mesh").unwrap();
    // A gigabyte of nothing, which takes no place on the disk.
    std::fs::File::create(folder.path().join("sparse.csv")).unwrap().set_len(1 << 30).unwrap();
    std::fs::write(folder.path().join("odd.csv"), "Zeit,Weg\n(s),(mm)\n1,2\n3,4\n").unwrap();
    let ball = "--sphere-diameter-mm";
    for (args, code, needed) in [
        (
            vec![ball, "0.8", "--poisson", "0.5"],
            2,
            "poisson = 0.5: it must be above -1 and below 0.495; quartz has about 0.22",
        ),
        (vec![ball, "0.8", "--poisson", "nan"], 2, "poisson = NaN: it must be above -1"),
        (
            vec![ball, "0.8", "--material", "plastic", "--yield-mpa", "0"],
            2,
            "yield_mpa = 0 MPa: it must be positive and finite; give the stress at which it flows, or take an elastic material",
        ),
        (vec![ball, "-1"], 2, "--sphere-diameter-mm -1: it must be positive, in mm"),
        (
            vec![ball, "0.0008"],
            2,
            "sphere_diameter_mm is 0.0008 mm; above 0.01 and below 100 mm is usual: did you mean 0.8 mm (it looks given in m)?",
        ),
        (vec!["metres.stl"], 2, "metres.stl: the body's longest side is"),
        (vec!["metres.stl"], 2, "did you mean 0.8"),
        (vec!["open.stl"], 1, "open.stl: the surface does not bound a solid: the edge from vertex"),
        (vec!["open.stl"], 1, "close it"),
        (
            vec!["nan.stl"],
            1,
            "nan.stl: this is not a usable STL file: triangle 0 has a coordinate that is not a finite number",
        ),
        (
            vec!["inverted.inp"],
            1,
            "inverted.inp: the mesh cannot be compressed: tetrahedron 0 has a volume of -",
        ),
        (vec!["inverted.inp"], 1, "mm³; mesh the body again, or repair the file's elements"),
        (
            vec!["detached.inp"],
            1,
            "detached.inp: the mesh has 2 pieces that share no node (the smaller ones have 1 of 2 tetrahedra)",
        ),
        (vec!["nan.inp"], 1, "nan.inp: the mesh cannot be compressed: node 4 is not finite"),
        (vec!["no.inp"], 1, "no.inp: this is not a usable Abaqus file: it has no tetrahedron"),
        (
            vec![ball, "0.8", "--size-mm", "0.2", "--size-at-contact-mm", "0.1", "--time-step-s", "1e-6"],
            2,
            "a time step of 1.000e-6 s is above the stable one of",
        ),
        (
            vec![ball, "0.8", "--friction", "-0.1", "--size-mm", "0.2", "--size-at-contact-mm", "0.1"],
            2,
            "friction",
        ),
        (vec!["no.stl"], 1, "no.stl: this is not a usable STL file"),
        (vec!["missing.stl"], 1, "cannot read"),
        (
            vec!["odd.csv"],
            2,
            "odd.csv: a body is read from .inp, .msh, .stl, .ply or .obj; `grainrig mesh` makes one",
        ),
        (vec![ball, "0.8", "--experiment", "odd.csv"], 1, "Zeit,Weg"),
        (
            vec![ball, "0.8", "--experiment", "sparse.csv"],
            1,
            "sparse.csv has 1073741824 bytes: a Bluehill export has at most",
        ),
        (
            vec![ball, "0.8", "--experiment", "/dev/zero"],
            1,
            "/dev/zero does not end: a Bluehill export has at most",
        ),
        (vec!["--resume", "nowhere"], 1, "no compression to go on with"),
        (vec![], 2, "required"),
    ] {
        let (status, said) = refused(grainrig(&folder).args(&args));
        assert!(status == code && said.contains(needed), "{args:?}: {status} {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
}

#[test]
fn the_laboratorys_real_exports_are_read() {
    let Some(folder) = shared_data("bluehill") else { return };
    // The largest force of the file, and the most rows of the first loading.
    for (name, most_n, rows) in [
        ("cyclic_compression_gbk_header.csv", None, 24_676),
        ("tensile_preamble_1.csv", Some(22_840.0), 400),
        ("tensile_preamble_2.csv", None, 400),
    ] {
        let test = read(&std::fs::read(folder.join(name)).unwrap()).unwrap();
        let (curve, _) = test.read_off(&Compliance::none(), 2.0).unwrap();
        // Nothing is cut by a share of the largest force: a bar that necks is read to its end.
        let last = curve.iter().max_by(|a, b| a.force_n.total_cmp(&b.force_n)).unwrap();
        assert!(
            test.force_n.len() > 50 && curve.len() <= rows && curve.len() >= 5,
            "{name}: {} of {}",
            curve.len(),
            test.force_n.len()
        );
        assert!(last.force_n > 0.0 && last.approach_mm > 0.0, "{name}: {last:?}");
        if let Some(n) = most_n {
            // The zero lies at the 43 N that the machine showed before.
            assert!((last.force_n - 43.5 - n).abs() < 0.01 * n, "{name}: {last:?}");
        }
    }
    // Ten lines typed off a page hold no loading; they are read, and that is said.
    let short = read(&std::fs::read(folder.join("layout_comma_decimal_example.csv")).unwrap());
    assert!(short.unwrap_err().to_string().contains("2 rows"));
}
