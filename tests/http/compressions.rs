//! Compressions as jobs of the daemon: begun, watched, cancelled, killed, taken up again.

use crate::daemon::{Daemon, Lab, SMALL, files};
use crate::sse::{Message, Stream};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Some thousand elements to a few newtons: seconds.
fn small() -> Value {
    json!({ "size_mm": 0.15, "size_at_contact_mm": 0.1, "to_force_n": 4.0 })
}

/// Far more than any of these tests waits for.
fn long() -> Value {
    json!({ "size_mm": 0.1, "size_at_contact_mm": 0.08, "to_force_n": 1000.0, "speed": 0.1 })
}

/// A laboratory with a complete session.
fn lab() -> (Lab, Daemon) {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", json!({})).0, 201);
    stream.until("complete");
    (lab, daemon)
}

fn press(daemon: &Daemon, settings: &Value) -> (u16, Value) {
    daemon.post("/sessions/quartz/compressions", Some(settings))
}

/// The news up to the first in one of these states; `end` of the stream fails the test.
fn until(stream: &mut Stream, states: &[&str]) -> Vec<Message> {
    let mut news = Vec::new();
    loop {
        let message =
            stream.next().unwrap_or_else(|| panic!("the stream ended before {states:?}: {news:#?}"));
        if message.kind == "compression" {
            let state = message.data["state"].as_str().unwrap().to_owned();
            assert!(state != "failed" || states.contains(&"failed"), "{}", message.data);
            news.push(message);
            if states.contains(&state.as_str()) {
                return news;
            }
        }
    }
}

/// The news up to the first that has a point of the curve.
fn moving(stream: &mut Stream) {
    while until(stream, &["running"]).last().unwrap().data["points"].as_array().unwrap().is_empty() {}
}

fn folder(lab: &Lab, name: &str) -> PathBuf {
    lab.data().join("quartz/compressions").join(name)
}

fn curve(lab: &Lab, name: &str) -> String {
    std::fs::read_to_string(folder(lab, name).join("curve.csv")).unwrap()
}

#[test]
fn a_grain_is_compressed_and_its_results_are_served() {
    let (lab, daemon) = lab();
    assert_eq!(daemon.get("/sessions/quartz/compressions"), (200, json!([])));
    let mut stream = daemon.events(None);
    let begun = press(&daemon, &small());
    assert_eq!(begun, (201, json!({ "session": "quartz", "name": "elastic" })));
    let news = until(&mut stream, &["complete"]);
    assert_eq!(news[0].data["state"], "meshing");
    // Told at once, before anything is computed, and then what is being done.
    assert_eq!(news[0].data["phase"], "reading the body");
    // The news, one after the other, make the whole curve, and so does the status.
    let mut told: Vec<Value> = Vec::new();
    for message in &news {
        assert_eq!(message.data["from"], told.len());
        told.extend(message.data["points"].as_array().unwrap().iter().cloned());
    }
    let (_, one) = daemon.get("/sessions/quartz/compressions/elastic");
    assert_eq!((&one["state"], &one["result"]["finished"]), (&json!("complete"), &json!(true)));
    // A result states nine digits.
    let nine = |curve: &Value| -> Vec<[String; 2]> {
        let of = |point: &Value, key: &str| format!("{:.8e}", point[key].as_f64().unwrap());
        curve.as_array().unwrap().iter().map(|p| ["approach_mm", "force_n"].map(|key| of(p, key))).collect()
    };
    assert_eq!(nine(&one["result"]["curve"]), nine(&json!(told)));
    assert!(one["result"]["curve"].as_array().unwrap().last().unwrap()["force_n"].as_f64().unwrap() >= 4.0);
    let (_, status) = daemon.get("/status");
    assert_eq!((&status["state"], &status["compression"]["state"]), (&json!("complete"), &json!("complete")));
    assert_eq!(status["compression"]["curve"], json!(told));
    // A mesh as coarse as this does not tell how the surface goes on where the pedestal hid it; that is said.
    let foot = &one["result"]["settings"]["foot"];
    assert!(foot["height_mm"].as_f64().unwrap() > 0.0 && foot["area_mm2"].as_f64().unwrap() > 0.0, "{foot}");
    assert!(foot["depth_mm"].is_null() && foot["lower_share"].as_f64().unwrap() > 0.0, "{foot}");
    let warnings = one["result"]["warnings"].to_string();
    assert!(
        warnings.contains("a flat that the grain need not have") && !warnings.contains("  "),
        "{warnings}"
    );
    // Every file that is listed is served as it is, and none that only a resumed run reads.
    let names: Vec<String> =
        one["files"].as_array().unwrap().iter().map(|f| f["file"].as_str().unwrap().to_owned()).collect();
    for wanted in
        ["curve.csv", "curve.svg", "curve.png", "result.json", "stage_08.png", "stages.pvd", "abaqus.inp"]
    {
        assert!(names.iter().any(|name| name == wanted), "{wanted} is missing: {names:?}");
    }
    for name in &names {
        let (code, bytes) = daemon.get_bytes(&format!("/sessions/quartz/compressions/elastic/files/{name}"));
        assert_eq!(code, 200, "{name}");
        assert!(bytes == std::fs::read(folder(&lab, "elastic").join(name)).unwrap(), "{name}");
    }
    for hidden in ["mesh.bin", "state.bin", "lock", "nothing.csv"] {
        let (code, _) = daemon.get(&format!("/sessions/quartz/compressions/elastic/files/{hidden}"));
        assert_eq!(code, 404, "{hidden}");
    }
    // The session is what it was: a compression is no part of what was recorded.
    let (code, out, err) = lab.run(&["verify", "quartz", "--json"]);
    assert_eq!(code, Some(0), "{out}{err}");
    let place = lab.data().to_string_lossy().into_owned();
    for path in ["/status", "/sessions/quartz/compressions", "/sessions/quartz/compressions/elastic"] {
        assert!(!String::from_utf8_lossy(&daemon.get_bytes(path).1).contains(&place), "{path} tells {place}");
    }
    // The next one of this material has a number, and a plastic grain is softer.
    let mut plastic = small();
    plastic["material"] = json!("plastic");
    plastic["yield_mpa"] = json!(300.0);
    assert_eq!(press(&daemon, &plastic).1["name"], "plastic");
    until(&mut stream, &["complete"]);
    let last = |name: &str| -> f64 {
        let one = daemon.get(&format!("/sessions/quartz/compressions/{name}")).1;
        let curve = one["result"]["curve"].as_array().unwrap();
        let at = |p: &&Value| p["force_n"].as_f64().unwrap() >= 2.0;
        curve.iter().find(at).unwrap()["approach_mm"].as_f64().unwrap()
    };
    assert!(last("plastic") > last("elastic"));
    let states = daemon.get("/sessions/quartz/compressions").1;
    assert_eq!(states.as_array().unwrap().len(), 2);
}

#[test]
fn what_the_pedestal_hid_is_closed_and_told() {
    let (lab, _daemon) = lab();
    // Fine enough to tell how the surface goes on there.
    let (code, _, err) = lab.run(&["reconstruct", "quartz", "--surface-size-mm", "0.04"]);
    assert_eq!(code, Some(0), "{err}");
    let deck = std::fs::read_to_string(lab.data().join("quartz/products/grain.inp")).unwrap();
    assert!(deck.contains("*NSET, NSET=FOOT\n"));
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("rests");
    let [closed, flat] = ["closed", "flat"].map(|by| {
        let (code, out, err) =
            lab.run(&["rests", "quartz", "--json", "--foot", by, "--out", place.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{err}");
        serde_json::from_str::<Value>(&out).unwrap()
    });
    assert!(closed["foot_depth_mm"].as_f64().unwrap() > 0.001, "{closed}");
    assert_eq!(flat["foot_depth_mm"], Value::Null);
    for found in [&closed, &flat] {
        let on_foot = |r: &Value| r["on_foot"].as_bool().unwrap();
        let rests = found["rests"].as_array().unwrap();
        assert!(rests.iter().any(on_foot) && !rests.iter().all(on_foot), "{found}");
        assert!(found["warnings"].to_string().contains("the pedestal hid"), "{}", found["warnings"]);
    }
}

#[test]
fn a_daemon_that_is_killed_or_told_to_end_goes_on_with_its_compression_when_it_is_started_again() {
    let (lab, mut daemon) = lab();
    let mut stream = daemon.events(None);
    assert_eq!(press(&daemon, &small()).0, 201);
    until(&mut stream, &["complete"]);
    let whole = curve(&lab, "elastic");
    // Killed while it meshes, while the plates move (twice: that is, once as it goes on), told to end, and killed again.
    let name = "elastic-2";
    assert_eq!(press(&daemon, &small()).1["name"], name);
    for (signal, moves) in [("KILL", false), ("KILL", true), ("KILL", true), ("TERM", true), ("KILL", true)] {
        if moves {
            moving(&mut stream);
        }
        daemon.signal(signal);
        let (status, said) = daemon.ended();
        assert_eq!(status.code(), (signal == "TERM").then_some(0), "{said}");
        // When it was told to end it left results as far as they are.
        let text = std::fs::read(folder(&lab, name).join("result.json")).unwrap_or_else(|_| b"{}".to_vec());
        let finished = serde_json::from_slice::<Value>(&text).unwrap()["finished"] == true;
        assert!(!finished, "it was over before the signal: a longer one is needed");
        daemon = lab.serve();
        stream = daemon.events(None);
        let snapshot = stream.next().unwrap();
        let compression = &snapshot.data["status"]["compression"];
        // It may not have said anything yet; what it says is of this one.
        assert!(compression.is_null() || compression["name"] == name, "{compression}");
    }
    until(&mut stream, &["complete"]);
    assert_eq!(curve(&lab, name), whole);
    let same = |file: &str| {
        let read = |name: &str| std::fs::read(folder(&lab, name).join(file)).unwrap();
        read("elastic") == read(name)
    };
    assert!(same("stage_01.vtu") && same("stage_08.vtu") && same("mesh.bin"));
    assert!(!files(&folder(&lab, name)).iter().any(|(path, _)| path.to_string_lossy().ends_with(".part")));
    // There is nothing to go on with now.
    daemon.signal("KILL");
    daemon.ended();
    let next = lab.serve();
    assert_eq!(next.get("/status").1["compression"], json!(null));
    assert!(!lab.data().join(".compression.json").exists());
}

#[test]
fn a_compression_is_cancelled_and_goes_on_when_somebody_wants_it() {
    let (lab, mut daemon) = lab();
    let mut stream = daemon.events(None);
    let cancel = |daemon: &Daemon| daemon.post("/compressions/current/cancel", None).0;
    assert_eq!(cancel(&daemon), 409);
    assert_eq!(press(&daemon, &long()).0, 201);
    // One that goes on is not begun twice.
    assert_eq!(daemon.post("/sessions/quartz/compressions/elastic/resume", None).0, 409);
    moving(&mut stream);
    assert_eq!(daemon.get("/sessions/quartz/compressions").1[0]["state"], "running");
    assert_eq!(cancel(&daemon), 204);
    let news = until(&mut stream, &["cancelled"]);
    let points = daemon.get("/status").1["compression"]["curve"].as_array().unwrap().len();
    assert!(points > 0, "{news:?}");
    // What there is can be read; and a daemon that is started again leaves it alone.
    let (_, one) = daemon.get("/sessions/quartz/compressions/elastic");
    assert_eq!((&one["state"], &one["result"]["finished"]), (&json!("interrupted"), &json!(false)));
    assert_eq!(one["result"]["curve"].as_array().unwrap().len(), points);
    daemon.signal("TERM");
    assert_eq!(daemon.ended().0.code(), Some(0));
    // So it does with one that may be what ended the daemon each time, and with a note that nobody can read.
    let note = lab.data().join(".compression.json");
    // The last but one is as an earlier version left it.
    for left in [
        None,
        Some(r#"[{"session":"quartz","name":"elastic","tries":3}]"#),
        Some(r#"{"session":"quartz","name":"elastic","tries":3}"#),
        Some("nonsense"),
    ] {
        if let Some(text) = left {
            std::fs::write(&note, text).unwrap();
        }
        daemon = lab.serve();
        assert_eq!(daemon.get("/status").1["compression"], json!(null), "{left:?}");
        assert!(!note.exists());
    }
    stream = daemon.events(None);
    assert_eq!(daemon.post("/sessions/quartz/compressions/elastic/resume", None).0, 204);
    let news = until(&mut stream, &["running"]);
    assert_eq!(
        news.last().unwrap().data["points"].as_array().unwrap().len(),
        points,
        "it goes on where it was"
    );
    assert_eq!(cancel(&daemon), 204);
    until(&mut stream, &["cancelled"]);
    // A small one to its end: then there is nothing to resume.
    assert_eq!(press(&daemon, &small()).1["name"], "elastic-2");
    until(&mut stream, &["complete"]);
    let (code, body) = daemon.post("/sessions/quartz/compressions/elastic-2/resume", None);
    assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")), "{body}");
}

#[test]
fn what_cannot_be_compressed_is_refused_with_what_to_do() {
    let (lab, daemon) = lab();
    for (settings, named) in [
        (json!({ "poisson": 0.5 }), "poisson"),
        (json!({ "young_mpa": -1.0 }), "young_mpa"),
        (json!({ "material": "plastic", "yield_mpa": 0.0 }), "yield_mpa"),
        (json!({ "material": "rubber" }), "rubber"),
        (json!({ "material": "plastic", "parameters": { "pressure_slope": 0.5 } }), "pressure_slope"),
        (json!({ "material": "drucker_prager", "parameters": { "pressure_slope": -0.5 } }), "pressure_slope"),
        (json!({ "friction": -0.1 }), "friction"),
        (json!({ "to_force_n": 0.0 }), "to_force_n"),
        (json!({ "to_approach_mm": -1.0 }), "to_approach_mm"),
        (json!({ "size_mm": 0.0 }), "size_mm"),
        (json!({ "speed": 0.0 }), "speed"),
        (json!({ "forec": 1.0 }), "forec"),
    ] {
        let (code, body) = press(&daemon, &settings);
        assert_eq!((code, &body["error"]["kind"]), (400, &json!("invalid")), "{settings}: {body}");
        let message = body["error"]["message"].as_str().unwrap();
        assert!(message.contains(named), "{settings}: {message}");
    }
    assert!(!lab.data().join("quartz/compressions").exists(), "a refusal leaves nothing");
    assert_eq!(daemon.post("/sessions/nobody/compressions", Some(&small())).0, 404);
    assert_eq!(daemon.post("/sessions/quartz/compressions/elastic/resume", None).0, 404);
    // What shows itself only once the grain is meshed is told as the end.
    let mut stream = daemon.events(None);
    assert_eq!(
        press(&daemon, &json!({ "size_mm": 1e-5, "size_at_contact_mm": 1e-5, "as_given": true })).0,
        201
    );
    let news = until(&mut stream, &["failed"]);
    let error = news.last().unwrap().data["error"].as_str().unwrap();
    assert!(error.contains("tetrahedra"), "{error}");
    // A session without a grain, and one whose grain was changed.
    let mut unfinished = daemon.events(None);
    assert_eq!(daemon.start("empty", json!({ "hull": { "voxel_mm": 1e-9 }, "as_given": true })).0, 201);
    unfinished.until("failed");
    let (code, body) = daemon.post("/sessions/empty/compressions", Some(&small()));
    assert_eq!((code, &body["error"]["kind"]), (400, &json!("invalid")), "{body}");
    let grain = lab.data().join("quartz/products/grain.stl");
    let mut bytes = std::fs::read(&grain).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&grain, bytes).unwrap();
    let (code, body) = press(&daemon, &small());
    assert_eq!((code, &body["error"]["kind"]), (500, &json!("failed")), "{body}");
    assert!(body["error"]["message"].as_str().unwrap().contains("grainrig replay quartz"), "{body}");
}

#[test]
fn no_name_reads_anything_outside_a_compression() {
    const SECRET: &str = "the farm's key";
    let (lab, daemon) = lab();
    let mut stream = daemon.events(None);
    assert_eq!(press(&daemon, &small()).0, 201);
    until(&mut stream, &["complete"]);
    let secret = lab.data().join("secret.txt");
    std::fs::write(&secret, SECRET).unwrap();
    std::fs::write(lab.data().join("quartz/compressions/secret.txt"), SECRET).unwrap();
    std::os::unix::fs::symlink(&secret, folder(&lab, "elastic").join("link.txt")).unwrap();
    std::fs::write(folder(&lab, "elastic").join(".hidden"), SECRET).unwrap();
    let get = |path: &str| {
        daemon.raw(format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").as_bytes())
    };
    let base = "/api/v1/sessions/quartz/compressions";
    let mut paths = vec![
        format!("{base}/elastic/files/link.txt"),
        format!("{base}/elastic/files/.hidden"),
        format!("{base}/secret.txt"),
        format!("{base}/elastic/files/"),
    ];
    for up in ["..", "%2e%2e", ".%2e", "..%2f..", "..%5c..", "%2e%2e%2felastic", "....//", "%252e%252e", "."]
    {
        paths.extend([
            format!("{base}/{up}/secret.txt"),
            format!("{base}/{up}"),
            format!("{base}/{up}/files/secret.txt"),
            format!("{base}/elastic/files/{up}%2fsecret.txt"),
            format!("{base}/elastic/files/{up}%2f..%2fsecret.txt"),
            format!("{base}/elastic/files/{up}"),
            format!("/api/v1/sessions/{up}/compressions/elastic"),
            format!("/api/v1/sessions/{up}/compressions/elastic/files/curve.csv"),
        ]);
    }
    for path in paths {
        let answer = get(&path);
        let code = answer.get(9..12).unwrap_or_default();
        assert!(["400", "404"].contains(&code), "{path}: {answer}");
        assert!(!answer.contains(SECRET), "{path}: {answer}");
    }
    let (_, one) = daemon.get("/sessions/quartz/compressions/elastic");
    assert!(!one.to_string().contains("link.txt") && !one.to_string().contains("hidden"), "{one}");
    // Other sites' pages can begin and stop nothing.
    let port = daemon.address.port();
    for path in [format!("{base}/elastic/resume"), "/api/v1/compressions/current/cancel".into(), base.into()]
    {
        let request = |origin: &str| {
            let answer = daemon.raw(
                format!(
                    "POST {path} HTTP/1.1\r\nHost: localhost:{port}\r\nOrigin: {origin}\r\nContent-Length: 0\r\n\
                     Connection: close\r\n\r\n"
                )
                .as_bytes(),
            );
            answer.get(9..12).unwrap_or_default().to_owned()
        };
        assert_eq!(request("http://evil.example"), "403", "{path}");
        assert_ne!(request(&format!("http://localhost:{port}")), "403", "{path}");
    }
}

#[test]
fn a_capture_goes_on_beside_a_compression_whose_threads_step_back() {
    let (lab, daemon) = lab();
    let mut stream = daemon.events(None);
    assert_eq!(press(&daemon, &long()).0, 201);
    moving(&mut stream);
    // Every thread that computes has the lowest priority, and no other thread has.
    let mut computing = 0;
    for task in std::fs::read_dir(format!("/proc/{}/task", daemon.id())).unwrap() {
        // A thread may end while it is looked at.
        let Ok(about) = std::fs::read_to_string(task.unwrap().path().join("stat")) else { continue };
        let (name, rest) = about.split_once('(').unwrap().1.rsplit_once(") ").unwrap();
        // `nice` is field 19; the state, field 3, is the first one here.
        let nice: i32 = rest.split(' ').nth(16).unwrap().parse().unwrap();
        let computes = name.starts_with("compute-");
        computing += usize::from(computes);
        assert_eq!(nice, if computes { 19 } else { 0 }, "{name}");
    }
    assert!(computing > 0);
    // A whole run, beside it.
    assert_eq!(daemon.start("beside", json!({})).0, 201);
    stream.until("complete");
    let (_, status) = daemon.get("/status");
    assert_eq!((&status["state"], &status["session"]), (&json!("complete"), &json!("beside")));
    assert_eq!(status["compression"]["state"], "running");
    let hull =
        |name: &str| daemon.get(&format!("/sessions/{name}")).1["result"]["hull"]["volume_mm3"].clone();
    assert_eq!(hull("beside"), hull("quartz"), "both see the same grain");
    assert_eq!(daemon.post("/compressions/current/cancel", None).0, 204);
    until(&mut stream, &["cancelled"]);
    let (code, out, err) = lab.run(&["verify", "beside", "--json"]);
    assert_eq!(code, Some(0), "{out}{err}");
}
