//! Runs: begun, watched, steered, failed, finished.

use crate::daemon::{Daemon, Lab, SMALL, files};
use crate::sse::Message;
use serde_json::{Value, json};

/// Long enough that whoever steers it comes in time: 25 views with rests between them.
fn slow() -> Value {
    json!({ "plan": { "views": 25, "steps_per_view": 8, "settle_ms": 200 } })
}

fn assert_numbered(events: &[Message]) {
    for (before, event) in events.iter().zip(&events[1..]) {
        assert_eq!(event.id, before.id + 1, "{} after {}", event.kind, before.kind);
        assert_eq!(event.data["seq"], event.id);
        assert_eq!(event.data["event"], event.kind);
    }
}

#[test]
fn a_run_is_watched_from_its_start_to_its_files() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    assert_eq!(daemon.get("/status").1["state"], "idle");
    assert_eq!(daemon.get("/sessions"), (200, json!([])));
    let mut stream = daemon.events(None);
    let snapshot = stream.next().unwrap();
    assert_eq!((snapshot.kind.as_str(), &snapshot.data["status"]["state"]), ("snapshot", &json!("idle")));
    assert_eq!(daemon.start("quartz", json!({})), (201, json!({ "session": "quartz" })));
    let mut events = vec![snapshot];
    events.extend(stream.until("complete"));
    assert_numbered(&events);
    let count = |kind: &str| events.iter().filter(|event| event.kind == kind).count();
    // Five views of the grain, and the closing one, which does not carve.
    assert_eq!(["started", "homed", "captured", "hull"].map(count), [1, 1, 6, 5]);

    // Whoever comes back gets exactly the later ones, wherever it left off.
    for (index, event) in events.iter().enumerate().step_by(7) {
        let mut again = daemon.events(Some(event.id));
        for later in &events[index + 1..] {
            assert_eq!(&again.next().unwrap(), later);
        }
    }

    let (_, status) = daemon.get("/status");
    let expected =
        json!({ "state": "complete", "session": "quartz", "views": 6, "captured": 6, "error": null });
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(&status[key], value, "{key}");
    }
    assert_eq!(status["hull"].as_array().unwrap().len(), 5);
    let volume_mm3 = status["result"]["hull"]["volume_mm3"].as_f64().unwrap();
    // A sphere of the simulated grain's volume has 0.9 mm: the hull of five views is above it, not by far.
    assert!((0.38..0.8).contains(&volume_mm3), "{volume_mm3} mm³");

    the_session_is_served(&lab, &daemon, &status);
    // The one who saw the end may begin the next run at once.
    assert_eq!(daemon.start("quartz-2", json!({})).0, 201);
    daemon.events(Some(events[events.len() - 1].id)).until("complete");
}

fn the_session_is_served(lab: &Lab, daemon: &Daemon, status: &Value) {
    let folder = lab.data().join("quartz");
    let (_, sessions) = daemon.get("/sessions");
    assert_eq!((&sessions[0]["name"], &sessions[0]["captured"]), (&json!("quartz"), &json!(6)));
    let (code, session) = daemon.get("/sessions/quartz");
    assert_eq!((code, &session["state"]), (200, &json!("complete")));
    assert_eq!(session["result"], status["result"]);
    for kind in ["frames", "products"] {
        let list = session[kind].as_array().unwrap();
        assert!(list.len() >= 4, "{kind}: {list:?}");
        for file in list.iter().map(|file| file["file"].as_str().unwrap()) {
            let (code, bytes) = daemon.get_bytes(&format!("/sessions/quartz/{kind}/{file}"));
            assert_eq!(code, 200, "{file}");
            assert!(bytes == std::fs::read(folder.join(kind).join(file)).unwrap(), "{file} is another file");
        }
    }
    for part in ["whole", "grain"] {
        let (code, preview) =
            daemon.get_bytes(&format!("/sessions/quartz/previews/view_000.jpg?part={part}"));
        assert!(code == 200 && preview.starts_with(b"\xff\xd8"), "{part}: {code}");
    }
    let names: Vec<&Value> = session["products"].as_array().unwrap().iter().map(|p| &p["file"]).collect();
    for product in status["products"].as_array().unwrap() {
        assert!(names.contains(&product), "{product} of the status is not in the session");
    }
    // Where the data folder is, is no client's business.
    let place = lab.data().to_string_lossy().into_owned();
    for path in ["/status", "/sessions", "/sessions/quartz", "/sessions/quartz/products/result.json"] {
        let (_, text) = daemon.get_bytes(path);
        assert!(!String::from_utf8_lossy(&text).contains(&place), "{path} tells {place}");
    }
}

#[test]
fn a_run_is_paused_resumed_and_aborted_and_goes_on_from_the_command_line() {
    let lab = Lab::new(SMALL);
    let mut daemon = lab.serve();
    let steer = |daemon: &Daemon, verb: &str| daemon.post(&format!("/runs/current/{verb}"), None);
    for verb in ["pause", "resume", "abort"] {
        let (code, body) = steer(&daemon, verb);
        assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")), "{body}");
    }
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", slow()).0, 201);
    stream.until("captured");
    assert_eq!(steer(&daemon, "pause").0, 204);
    stream.until("paused");
    assert_eq!(daemon.get("/status").1["state"], "paused");
    assert_eq!(steer(&daemon, "pause").0, 409);
    let (code, body) = daemon.start("other", json!({}));
    assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")));
    let message = body["error"]["message"].as_str().unwrap();
    assert!(message.contains("quartz") && message.contains("abort"), "{message}");
    assert!(!lab.data().join("other").exists());
    assert_eq!(steer(&daemon, "resume").0, 204);
    // At once: the run may not have woken up in between.
    assert_eq!(steer(&daemon, "pause").0, 204);
    assert_eq!(steer(&daemon, "resume").0, 204);
    stream.until("captured");
    assert_eq!(daemon.get("/status").1["state"], "running");
    assert_eq!(steer(&daemon, "abort").0, 204);
    let events = stream.until("aborted");
    assert_numbered(&events);
    assert_eq!(daemon.get("/status").1["state"], "aborted");
    assert_eq!(daemon.get("/sessions/quartz").1["state"], "aborted");

    // The rig is free at once; the session is when the daemon has let go of it.
    assert_eq!(daemon.start("next", json!({})).0, 201);
    stream.until("complete");
    let captured = daemon.get("/sessions/quartz").1["frames"].as_array().unwrap().len();
    assert!((2..26).contains(&captured), "{captured} views");
    let before = files(&lab.data().join("quartz/frames"));
    let (code, out, err) = lab.run(&["resume", "quartz", "--json"]);
    assert_eq!(code, Some(0), "{err}");
    assert_eq!(serde_json::from_str::<Value>(&out).unwrap()["views"], 25);
    let after = files(&lab.data().join("quartz/frames"));
    assert_eq!((before.len(), after.len()), (captured, 26));
    assert!(before.iter().all(|file| after.contains(file)), "a captured view was changed");
    assert_eq!(daemon.get("/sessions/quartz").1["state"], "complete");
    daemon.signal("TERM");
    assert_eq!(daemon.ended().0.code(), Some(0));
}

#[test]
fn the_rig_is_looked_at_between_runs_and_its_hardware_is_the_hosts() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let (code, devices) = daemon.get("/devices");
    assert_eq!(
        (code, &devices[0]["driver"], &devices[0]["configured"]),
        (200, &json!("simulated"), &json!(true))
    );
    let (code, findings) = daemon.post("/doctor", None);
    assert_eq!(code, 200, "{findings}");
    let health = |check: &str| {
        let found = findings.as_array().unwrap().iter().find(|f| f["check"] == check);
        found.unwrap_or_else(|| panic!("{check} is missing from {findings}"))["health"].clone()
    };
    for check in ["disk", "stage", "camera", "movement", "test shot"] {
        assert_eq!(health(check), "good", "{check}");
    }
    for setting in
        [json!({ "controller": { "limits_deg": [-1e4, 1e4] } }), json!({ "rig": { "kind": "hardware" } })]
    {
        let (code, body) = daemon.start("taken-over", setting);
        assert_eq!((code, &body["error"]["kind"]), (400, &json!("invalid")), "{body}");
    }
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", slow()).0, 201);
    stream.until("captured");
    let (code, body) = daemon.post("/doctor", None);
    assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")), "{body}");
}

#[test]
fn of_runs_that_are_begun_at_once_one_begins() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut codes: Vec<u16> = std::thread::scope(|scope| {
        let start = |k: usize| {
            let daemon = &daemon;
            scope.spawn(move || daemon.start(&format!("grain-{k}"), slow()).0)
        };
        let asked: Vec<_> = (0..8).map(start).collect();
        asked.into_iter().map(|asked| asked.join().unwrap()).collect()
    });
    codes.sort_unstable();
    assert_eq!(codes, [201, 409, 409, 409, 409, 409, 409, 409]);
    assert_eq!(daemon.get("/sessions").1.as_array().unwrap().len(), 1);
}

#[test]
fn a_run_that_fails_says_why_and_the_next_one_works() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    let failures = [
        // The camera fails, or delivers half a picture and may not try again; a step is lost.
        ("camera", json!({ "simulated": { "faults": { "fail_capture_at": 2 } } }), "view 2"),
        (
            "picture",
            json!({ "plan": { "retakes": 0 }, "simulated": { "faults": { "truncate_frame_at": 1 } } }),
            "view 1",
        ),
        // No grain is in view: a warning at each, and the run's error at its end.
        (
            "empty",
            json!({ "silhouette": { "min_area_px": 250_000.0 }, "acquire": { "quality": "label" } }),
            "250000",
        ),
        ("coarse", json!({ "hull": { "voxel_mm": 1e-9 }, "as_given": true }), "voxel"),
        ("fine", json!({ "mesh": { "tet_volume_mm3": 1e-15 }, "as_given": true }), "tetrahedra"),
    ];
    for (name, overrides, named) in failures {
        assert_eq!(daemon.start(name, overrides).0, 201, "{name}");
        let events = stream.until("failed");
        let error = events[events.len() - 1].data["error"].as_str().unwrap();
        assert!(error.contains(named), "{name}: {error}");
        let (_, status) = daemon.get("/status");
        assert_eq!((&status["state"], &status["error"]), (&json!("failed"), &json!(error)), "{name}");
        assert_eq!(daemon.get(&format!("/sessions/{name}")).1["state"], "failed", "{name}");
    }
    // The run after a failed one owes it nothing; a bad picture alone is taken again.
    assert_eq!(daemon.start("good", json!({ "simulated": { "faults": { "truncate_frame_at": 1 } } })).0, 201);
    stream.until("complete");
    let (_, status) = daemon.get("/status");
    assert_eq!((&status["state"], &status["error"]), (&json!("complete"), &json!(null)));
}

#[test]
fn a_run_whose_pictures_stay_no_good_waits_with_the_cause_until_it_is_resumed() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    // Three tries a view: the second view's, and all of them again.
    let faults = json!({ "blurred_frame_at": 1, "frame_faults_stay": true });
    let overrides = json!({ "plan": { "retakes": 2 }, "simulated": { "faults": faults } });
    assert_eq!(daemon.start("soft", overrides).0, 201);
    for _ in 0..2 {
        let events = stream.until("paused");
        let of = |kind: &str| events.iter().filter(|e| e.data["event"] == kind).collect::<Vec<_>>();
        assert_eq!((of("rejected").len(), of("suspended").len()), (3, 1));
        let (_, status) = daemon.get("/status");
        assert_eq!(status["state"], "paused");
        let cause = status["error"].as_str().unwrap();
        assert!(cause.contains("focus ") && cause.contains("the limit is "), "{cause}");
        let last = status["warnings"].as_array().unwrap().last().unwrap();
        assert_eq!((&last["view"], &last["verdict"]), (&json!(1), &json!("bad")), "{last}");
        assert_eq!(daemon.post("/runs/current/resume", None).0, 204);
        stream.until("resumed");
        assert_eq!(daemon.get("/status").1["session"], "soft");
    }
    stream.until("paused");
    assert_eq!(daemon.post("/runs/current/abort", None).0, 204);
    stream.until("aborted");
    assert_eq!(daemon.get("/sessions/soft").1["frames"].as_array().unwrap().len(), 1);
}

#[test]
fn a_disk_that_fails_is_told_without_telling_where_it_is() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", slow()).0, 201);
    assert_eq!(daemon.post("/runs/current/pause", None).0, 204);
    stream.until("paused");
    std::fs::remove_dir_all(lab.data().join("quartz/frames")).unwrap();
    assert_eq!(daemon.post("/runs/current/resume", None).0, 204);
    let events = stream.until("failed");
    let error = events[events.len() - 1].data["error"].as_str().unwrap();
    assert!(error.contains("quartz/frames/"), "{error}");
    let place = lab.data().to_string_lossy().into_owned();
    assert!(!error.contains(&place), "{error} tells {place}");
    // A session whose journal is damaged is listed as that, and stops nobody.
    std::fs::write(lab.data().join("quartz/journal.jsonl"), "nonsense\n").unwrap();
    let (_, sessions) = daemon.get("/sessions");
    let damage = sessions[0]["damage"].as_str().unwrap();
    assert!(damage.contains("quartz/journal.jsonl") && !damage.contains(&place), "{damage}");
    let (code, body) = daemon.get("/sessions/quartz");
    assert_eq!(code, 500, "{body}");
    assert!(body.to_string().contains("grainrig verify") && !body.to_string().contains(&place), "{body}");
    assert_eq!(daemon.start("next", json!({})).0, 201);
    stream.until("complete");
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name_and_make_no_session() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let cases = [
        (json!({ "vews": 25 }), "vews"),
        (json!({ "plan": { "vews": 25 } }), "vews"),
        (json!({ "plan": { "views": "many" } }), "many"),
        (json!({ "plan": { "views": 0 } }), "views"),
        (json!({ "plan": null }), "null"),
        (json!({ "plan": { "step_deg": -0.9 } }), "step_deg"),
        (json!({ "simulated": { "width": 4_000_000_000_u64 } }), "width"),
        // Whoever runs the daemon decides on these.
        (json!({ "serve": { "token": "0123456789abcdef" } }), "serve"),
        (json!({ "simulated": { "grain_stl": "/etc/passwd" } }), "simulated.grain_stl"),
    ];
    for (overrides, named) in cases {
        let (code, body) = daemon.start("quartz", overrides.clone());
        assert_eq!((code, &body["error"]["kind"]), (400, &json!("invalid")), "{overrides}: {body}");
        let message = body["error"]["message"].as_str().unwrap();
        assert!(message.contains(named), "{overrides}: {message}");
    }
    assert_eq!(daemon.get("/sessions"), (200, json!([])));
    assert_eq!(daemon.get("/status").1["state"], "idle");
    // A name is used once.
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", json!({})).0, 201);
    stream.until("complete");
    let (code, body) = daemon.start("quartz", json!({}));
    let message = body["error"]["message"].as_str().unwrap();
    assert_eq!(code, 400, "{body}");
    assert!(message.contains("quartz") && message.contains("another name"), "{message}");
    assert_eq!(daemon.get("/status").1["state"], "complete");
}

#[test]
fn slips_of_unit_are_refused_with_what_was_meant_unless_they_are_meant_so() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let (code, said) = daemon.start("a", json!({ "optics": { "mm_per_px": 9.0 } }));
    assert_eq!(code, 400, "{said}");
    for part in ["did you mean 0.009 mm", "as_given"] {
        assert!(said.to_string().contains(part), "{part}: {said}");
    }
    let meant = json!({ "as_given": true, "optics": { "mm_per_px_sigma": 0.003 } });
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("b", meant).0, 201);
    stream.until("complete");
    let (_, status) = daemon.get("/status");
    let warnings = status["result"]["warnings"].to_string();
    assert!(warnings.contains("taken as given: mm_per_px_sigma is 0.003 mm"), "{warnings}");
    let press = |request: Value| daemon.post("/sessions/b/compressions", Some(&request));
    for (request, meant) in [
        (json!({ "young_mpa": 100.0 }), "did you mean 100000 MPa"),
        (json!({ "density_t_mm3": 2650.0 }), "did you mean 2.65e-9"),
        (json!({ "to_approach_mm": 10.0 }), "did you mean 0.01 mm"),
    ] {
        let (code, said) = press(request);
        assert!(code == 400 && said.to_string().contains(meant), "{code} {said}");
    }
}
