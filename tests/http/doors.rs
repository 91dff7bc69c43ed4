//! Whatever the command line does with files and sessions is asked for over HTTP as well, with the same options, and comes out
//! with the same bytes.

use crate::daemon::{Daemon, Lab, SMALL};
use crate::jobs::{done, lab};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::PathBuf;

/// A laboratory whose files have been put beside the sessions as well, so that both doors have them by the same names.
struct Both {
    lab: Lab,
    daemon: Daemon,
    here: PathBuf,
}

impl Both {
    fn new(sessions: &[(&str, Value)]) -> Self {
        let (lab, daemon) = lab(SMALL, sessions);
        let here = lab.data().parent().unwrap().to_owned();
        Self { lab, daemon, here }
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        let path = self.here.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
        assert_eq!(self.daemon.put(name, bytes), 204, "{name}");
    }

    /// Runs the command line in the folder of its files; what it prints under `--json`.
    fn run(&self, arguments: &[&str]) -> Value {
        let mut command = self.lab.command(&[arguments, &["--json"]].concat());
        let output = command.current_dir(&self.here).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Does a job over HTTP to its end; what it came to.
    fn job(&self, request: &Value) -> Value {
        let told = done(&self.daemon, request);
        assert_eq!(told["state"], "complete", "{told}");
        let (code, details) = self.daemon.get(&format!("/jobs/{}", told["job"]));
        assert_eq!((code, &details["state"]), (200, &json!("complete")));
        assert!(!details.to_string().contains(self.here.to_str().unwrap()), "a place is told: {details}");
        details["result"].clone()
    }

    /// Asserts that both doors have made the same file.
    fn same(&self, name: &str) {
        let (code, bytes) = self.daemon.get_bytes(&format!("/files/{name}"));
        let here = std::fs::read(self.here.join(name)).unwrap();
        assert!(code == 200 && bytes == here, "{name}: {} and {} bytes", bytes.len(), here.len());
    }
}

/// A dark disc before a bright background, its edge mixed.
fn ball(radius_px: f64) -> Vec<u8> {
    let picture = image::GrayImage::from_fn(648, 432, |x, y| {
        let from_middle = f64::hypot(f64::from(x) - 324.3, f64::from(y) - 216.6);
        image::Luma([(40.0 + 180.0 * (from_middle - radius_px + 0.5).clamp(0.0, 1.0)).round() as u8])
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// An octahedron 1 mm high, in binary STL.
fn octahedron() -> Vec<u8> {
    let at = |axis: usize, sign: f32| std::array::from_fn(|k| if k == axis { 0.5 * sign } else { 0.0 });
    let mut bytes = vec![0; 80];
    bytes.extend(8_u32.to_le_bytes());
    for signs in (0..8_u8).map(|n| [0, 1, 2].map(|k| if n >> k & 1 == 0 { 1.0 } else { -1.0_f32 })) {
        let corners: [[f32; 3]; 3] = [0, 1, 2].map(|axis| at(axis, signs[axis]));
        let is_outwards = signs.iter().product::<f32>() > 0.0;
        let order = if is_outwards { [0, 1, 2] } else { [0, 2, 1] };
        bytes.extend([0; 12]);
        bytes.extend(order.iter().flat_map(|k| corners[*k]).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A laboratory's test: a law of Hertz that begins at 2 µm, N over mm to the power of 3/2.
fn test(stiffness: f64) -> String {
    (0..200).fold("Raw Data\nTime (s),Displacement (mm),Force (N)\n".to_owned(), |text, k| {
        let x = f64::from(k) * 1e-4;
        text + &format!("{k},{x:.6},{:.5}\n", stiffness * (x - 0.002).max(0.0).powf(1.5))
    })
}

#[test]
fn photographs_become_a_session_by_either_door() {
    let both = Both::new(&[("quartz", json!({}))]);
    let frames = both.lab.data().join("quartz/frames");
    for entry in std::fs::read_dir(frames).unwrap().flatten() {
        let name = entry.file_name().into_string().unwrap();
        both.put(&format!("photos/{name}"), &std::fs::read(entry.path()).unwrap());
    }
    both.put("scale/ball_0.png", &ball(90.0));
    let scale =
        both.run(&["calibrate", "scale", "scale", "--ball-diameter-mm", "1.08", "--out", "scale.json"]);
    let asked = json!({ "kind": "calibrate_scale", "folder": "scale", "ball_diameter_mm": 1.08, "out": "scale.json" });
    assert_eq!(both.job(&asked), scale);
    both.same("scale.json");

    let line = ["import", "photos", "--step-deg", "36", "--calibration", "scale.json", "--closing-view", "5"];
    let here = both.run(&[&line[..], &["--name", "here", "--surface-size-mm", "0.2"]].concat());
    let there = both.job(&json!({
        "kind": "import", "folder": "photos", "step_deg": 36.0, "calibration": "scale.json", "closing_view": 5,
        "name": "there", "mesh": { "surface_size_mm": 0.2 },
    }));
    assert_eq!((&there["hull"], &there["mesh"]), (&here["hull"], &here["mesh"]));
    assert_eq!(there["hull"]["volume_mm3"].as_f64().map(|v| v > 0.01), Some(true), "{there}");
    let surface = |name: &str| std::fs::read(both.lab.data().join(name).join("products/grain.stl")).unwrap();
    assert!(surface("here") == surface("there"));
    // A session's mesh in another format, by either door.
    both.run(&["mesh", "here", "--surface-size-mm", "0.2", "--out", "grain.msh"]);
    both.job(
        &json!({ "kind": "mesh", "input": "here", "mesh": { "surface_size_mm": 0.2 }, "out": ["grain.ply"] }),
    );
    let (code, ply) = both.daemon.get_bytes("/files/grain.ply");
    assert!(code == 200 && ply.starts_with(b"ply\n"));
    // A capture with the measured scale and another number of views.
    let (code, _) = both
        .daemon
        .start("scaled", json!({ "calibration": "scale.json", "views": 6, "plan": { "settle_ms": 0 } }));
    assert_eq!(code, 201);
    let mut stream = both.daemon.events(Some(0));
    stream.until("complete");
    let manifest = std::fs::read(both.lab.data().join("scaled/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_slice(&manifest).unwrap();
    assert_eq!(manifest["config"]["optics"]["mm_per_px"], scale["mm_per_px"]["value"]);
    assert_eq!(manifest["config"]["plan"]["views"], 6);
    // What is no longer wanted is removed.
    assert_eq!(both.daemon.delete("/sessions/there"), 204);
    assert_eq!((both.daemon.delete("/sessions/there"), both.daemon.get("/sessions/there").0), (404, 404));
    assert!(!both.lab.data().join("there").exists());
}

#[test]
fn a_surface_is_meshed_and_compressed_by_either_door() {
    let both = Both::new(&[]);
    both.put("grain.stl", &octahedron());
    both.put("test.csv", test(3000.0).as_bytes());

    let line = ["mesh", "grain.stl", "--surface-size-mm", "0.3", "--out", "grain.inp", "grain.svg"];
    let mut here = both.run(&line);
    let mut there = both.job(&json!({
        "kind": "mesh", "input": "grain.stl", "mesh": { "surface_size_mm": 0.3 }, "out": ["grain.inp", "grain.svg"],
    }));
    for one in [&mut here, &mut there] {
        one["seconds"] = Value::Null;
    }
    assert_eq!(there, here);
    both.same("grain.inp");
    both.same("grain.svg");

    let sizes = ["--size-mm", "0.3", "--size-at-contact-mm", "0.2", "--to-approach-mm", "0.0005"];
    let other = [
        "compress",
        "grain.stl",
        "--rotate-deg",
        "10",
        "20",
        "30",
        "--material",
        "plastic",
        "--out",
        "other",
    ];
    both.run(&[&other[..], &sizes].concat());
    let line = ["compress", "grain.stl", "--experiment", "test.csv", "--beside", "other", "--out", "pressed"];
    let here = both.run(&[&line[..], &sizes].concat());
    let figures = json!({ "size_mm": 0.3, "size_at_contact_mm": 0.2, "to_approach_mm": 0.0005 });
    let with = |more: Value| {
        let mut request = figures.clone();
        request.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        request
    };
    let plastic = with(json!({ "material": "plastic", "rotate_deg": [10.0, 20.0, 30.0] }));
    both.job(&json!({ "kind": "compress", "input": "grain.stl", "out": "other", "request": plastic }));
    let there = both.job(&json!({
        "kind": "compress", "input": "grain.stl", "out": "pressed",
        "request": with(json!({ "experiment": "test.csv", "beside": ["other"] })),
    }));
    assert_eq!((&there["curve"], &there["experiment"]), (&here["curve"], &here["experiment"]));
    assert!(here["experiment"]["file"] == "test.csv" && here["finished"] == true, "{here}");
    both.same("pressed/curve.csv");
    both.same("pressed/curve.svg");

    both.run(&[
        "study",
        "sensitivity",
        "--stl",
        "grain.stl",
        "--views",
        "2,4",
        "--pixel-mm",
        "0.02",
        "--out",
        "study",
    ]);
    let study =
        json!({ "kind": "study", "stl": "grain.stl", "views": [2, 4], "pixel_mm": 0.02, "out": "study" });
    assert_eq!(both.job(&study)["rows"].as_array().unwrap().len(), 2);
    both.same("study/sensitivity.csv");
}

/// The laboratory's test and another compression are drawn beside a session's, also by the program after the one that was killed.
#[test]
fn a_test_is_drawn_beside_a_sessions_grain_and_outlives_the_program() {
    let (lab, mut daemon) = lab(SMALL, &[("quartz", json!({}))]);
    assert_eq!(daemon.put("test.csv", test(900.0).as_bytes()), 204);
    let asked = json!({
        "size_mm": 0.15, "size_at_contact_mm": 0.1, "to_force_n": 4.0, "experiment": "test.csv",
        "compliance_um_per_n": 0.1,
    });
    assert_eq!(daemon.post("/sessions/quartz/compressions", Some(&asked)).1["name"], "elastic");
    daemon.signal("KILL");
    daemon.ended();
    let next = lab.serve();
    assert_eq!(next.delete("/files/test.csv"), 204);
    // One is computed at a time: when this one has ended, so has that.
    assert_eq!(done(&next, &json!({ "kind": "verify", "session": "quartz" }))["state"], "complete");
    let (_, one) = next.get("/sessions/quartz/compressions/elastic");
    assert_eq!(one["result"]["experiment"]["file"], "test.csv", "{}", one["result"]["experiment"]);
    let listed: Vec<_> = one["files"].as_array().unwrap().iter().map(|f| f["file"].clone()).collect();
    assert!(!listed.contains(&json!("beside.json")), "{listed:?}");
    // By its name, or the session's before it.
    for beside in ["elastic", "quartz/elastic"] {
        let asked =
            json!({ "size_mm": 0.2, "size_at_contact_mm": 0.15, "to_approach_mm": 1e-4, "beside": [beside] });
        assert_eq!(next.post("/sessions/quartz/compressions", Some(&asked)).0, 201, "{beside}");
    }
    let nothing = json!({ "beside": ["plastic"] });
    let (code, body) = next.post("/sessions/quartz/compressions", Some(&nothing));
    assert_eq!(code, 400, "{body}");
}

#[test]
fn no_name_of_a_client_leads_out_of_its_files() {
    let both = Both::new(&[]);
    std::fs::write(both.here.join("secret.stl"), octahedron()).unwrap();
    let secret = both.here.join("secret.stl");
    for bad in [
        "../secret.stl",
        "../../secret.stl",
        secret.to_str().unwrap(),
        ".hidden.stl",
        "a/b/c.stl",
        "secret.stl",
        "",
    ] {
        let requests = [
            json!({ "kind": "mesh", "input": bad, "out": ["x.inp"] }),
            json!({ "kind": "compress", "input": bad }),
            json!({ "kind": "import", "folder": bad, "mm_per_px": 0.005, "name": "x" }),
            json!({ "kind": "study", "stl": bad }),
            json!({ "kind": "calibrate_scale", "folder": bad, "ball_diameter_mm": 1.0, "out": "x.json" }),
        ];
        for request in requests {
            let (code, body) = both.daemon.post("/jobs", Some(&request));
            assert!([400, 404].contains(&code), "{request}: {code} {body}");
            assert!(!body.to_string().contains("data/.files"), "{body}");
        }
    }
    both.put("grain.stl", &octahedron());
    for bad in ["../out.inp", "/tmp/out.inp", ".out.inp"] {
        let (code, _) =
            both.daemon.post("/jobs", Some(&json!({ "kind": "mesh", "input": "grain.stl", "out": [bad] })));
        assert_eq!(code, 400, "{bad}");
    }
    for bad in ["..%2fx", ".x", "a/b/c", "a%20b", "%00"] {
        assert!([400, 404].contains(&both.daemon.put(bad, b"x")), "{bad}");
        assert!([400, 404].contains(&both.daemon.get(&format!("/files/{bad}")).0), "{bad}");
    }
    // What breaks off is not there, and nor is what was there before it spoilt.
    let (head, body) = ("PUT /api/v1/files/grain.stl HTTP/1.1\r\nhost: localhost\r\n", "half");
    let mut broken = std::net::TcpStream::connect(both.daemon.address).unwrap();
    write!(broken, "{head}content-length: 400\r\n\r\n{body}").unwrap();
    drop(broken);
    let (_, kept) = both.daemon.get_bytes("/files/grain.stl");
    assert!(kept == octahedron());
    let left = both.lab.data().join(".files/.grain.stl.1.1.part");
    std::fs::write(&left, b"of a program that was killed").unwrap();
    let _next = both.lab.serve();
    assert!(!left.exists());
    let long = format!("{head}connection: close\r\ncontent-length: 2000000000\r\n\r\n");
    assert!(both.daemon.raw(long.as_bytes()).starts_with("HTTP/1.1 413"));
    let foreign =
        format!("{head}origin: http://evil.example\r\nconnection: close\r\ncontent-length: 4\r\n\r\n{body}");
    assert!(both.daemon.raw(foreign.as_bytes()).starts_with("HTTP/1.1 403"));
    assert_eq!(both.daemon.get("/files").1, json!([{ "file": "grain.stl", "bytes": octahedron().len() }]));
}
