//! Computations beside the rig: whatever the command line does with recorded sessions, asked for over HTTP.

use crate::daemon::{Daemon, Lab, SMALL, files};
use crate::sse::Stream;
use grainrig::session::sha256_hex;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Two poses of one grain can be merged at this size, and not much below.
const POSES: &str = "plan = { views = 12, steps_per_view = 16, settle_ms = 0 }\nmesh = { surface_size_mm = 0.1 }\n\
                     report = { pictures = false }\noptics = { mm_per_px = 0.0075 }\n[simulated]\nseed = 3\nwidth = 324\n\
                     height = 270\nmm_per_px = 0.0075\n";

/// A laboratory with complete sessions, each captured with these settings.
pub fn lab(config: &str, sessions: &[(&str, Value)]) -> (Lab, Daemon) {
    let lab = Lab::new(config);
    let daemon = lab.serve();
    for (name, settings) in sessions {
        let mut stream = daemon.events(None);
        assert_eq!(daemon.start(name, settings.clone()).0, 201);
        stream.until("complete");
    }
    (lab, daemon)
}

fn ask(daemon: &Daemon, request: &Value) -> u64 {
    let (code, body) = daemon.post("/jobs", Some(request));
    assert_eq!(code, 202, "{body}");
    body["job"].as_u64().unwrap()
}

/// The news of a job up to its end.
fn ended(stream: &mut Stream, job: u64) -> Vec<Value> {
    let mut news = Vec::new();
    loop {
        let message = stream.next().unwrap_or_else(|| panic!("the stream ended before job {job}: {news:#?}"));
        if message.kind == "job" && message.data["job"] == job {
            let state = message.data["state"].as_str().unwrap().to_owned();
            news.push(message.data);
            if !["waiting", "running"].contains(&state.as_str()) {
                return news;
            }
        }
    }
}

/// Does a job to its end; what is last told of it.
pub fn done(daemon: &Daemon, request: &Value) -> Value {
    let mut stream = daemon.events(None);
    let job = ask(daemon, request);
    let news = ended(&mut stream, job);
    assert_eq!(news[0]["state"], "waiting", "{news:?}");
    news.into_iter().last().unwrap()
}

/// The hash of each product of a session, but of what says how long it took.
fn products(folder: &Path) -> BTreeMap<PathBuf, String> {
    let mut all = files(&folder.join("products"));
    all.retain(|(path, _)| !path.ends_with("result.json"));
    all.into_iter().map(|(path, bytes)| (path.file_name().unwrap().into(), sha256_hex(&bytes))).collect()
}

/// The surface names no session: two of one grain have the same bytes.
fn surface(folder: &Path) -> String {
    products(folder)[Path::new("grain.stl")].clone()
}

#[test]
fn a_session_is_made_again_checked_and_healed_as_by_the_command_line() {
    let (lab, daemon) = lab(SMALL, &[("quartz", json!({})), ("same", json!({}))]);
    let [quartz, same] = ["quartz", "same"].map(|name| lab.data().join(name));
    let first = products(&quartz);
    assert_eq!(surface(&quartz), surface(&same));
    // Another mesh, by either door: the same bytes.
    let coarser = json!({ "kind": "reconstruct", "session": "quartz", "mesh": { "surface_size_mm": 0.2 } });
    assert_eq!(done(&daemon, &coarser)["state"], "complete");
    assert_eq!(lab.run(&["reconstruct", "same", "--surface-size-mm", "0.2"]).0, Some(0));
    let coarse = products(&quartz);
    assert_ne!(coarse, first);
    assert_eq!(surface(&quartz), surface(&same));
    // What is damaged is told, and made again.
    std::fs::write(quartz.join("products/grain.stl"), b"not what was recorded").unwrap();
    let check = json!({ "kind": "verify", "session": "quartz" });
    let found = done(&daemon, &check);
    assert_eq!(found["state"], "failed", "{found}");
    let error = found["error"].as_str().unwrap();
    assert!(error.contains("grain.stl") && !error.contains(lab.data().to_str().unwrap()), "{error}");
    assert_eq!(done(&daemon, &json!({ "kind": "replay", "session": "quartz" }))["state"], "complete");
    assert_eq!(products(&quartz), coarse);
    assert_eq!(done(&daemon, &check)["state"], "complete");
    // The list has them all, the newest last, and the run's own status is as it was.
    let (code, jobs) = daemon.get("/jobs");
    let told: Vec<_> = jobs.as_array().unwrap().iter().map(|j| (&j["kind"], &j["state"])).collect();
    let expected =
        [("reconstruct", "complete"), ("verify", "failed"), ("replay", "complete"), ("verify", "complete")]
            .map(|(kind, state)| (json!(kind), json!(state)));
    assert_eq!((code, told), (200, expected.iter().map(|(a, b)| (a, b)).collect()));
    let (_, status) = daemon.get("/status");
    assert_eq!((&status["state"], &status["session"]), (&json!("complete"), &json!("same")));
}

#[test]
fn what_the_command_line_compresses_the_monitor_lists() {
    let (lab, daemon) = lab(SMALL, &[("quartz", json!({}))]);
    let options = ["--size-mm", "0.15", "--size-at-contact-mm", "0.1", "--to-force-n", "4", "--json"];
    let (code, out, said) = lab.run(&[&["compress", "quartz"][..], &options].concat());
    assert_eq!(code, Some(0), "{said}");
    let folder = PathBuf::from(serde_json::from_str::<Value>(&out).unwrap()["folder"].as_str().unwrap());
    assert_eq!(folder, lab.data().join("quartz/compressions/elastic").canonicalize().unwrap());
    let (_, listed) = daemon.get("/sessions/quartz/compressions");
    assert_eq!(
        (&listed[0]["name"], &listed[0]["state"]),
        (&json!("elastic"), &json!("complete")),
        "{listed}"
    );
    // The same by the other door lies beside it, with the same bits.
    let mut stream = daemon.events(None);
    let asked = json!({ "size_mm": 0.15, "size_at_contact_mm": 0.1, "to_force_n": 4.0 });
    let begun = daemon.post("/sessions/quartz/compressions", Some(&asked)).1;
    assert_eq!(begun["name"], "elastic-2");
    let (_, jobs) = daemon.get("/jobs");
    assert_eq!(ended(&mut stream, jobs[0]["job"].as_u64().unwrap()).last().unwrap()["state"], "complete");
    let curve = |name: &str| std::fs::read(folder.with_file_name(name).join("curve.csv")).unwrap();
    assert!(curve("elastic") == curve("elastic-2"), "the curves differ");
}

#[test]
fn two_captures_are_merged_as_by_the_command_line() {
    let turned = json!({ "simulated": { "grain_rotation_deg": [90.0, 0.0, 65.0] } });
    let (lab, daemon) = lab(POSES, &[("a", json!({})), ("b", turned)]);
    let merged = done(&daemon, &json!({ "kind": "merge", "session": "whole", "a": "a", "b": "b" }));
    assert_eq!(merged["state"], "complete", "{merged}");
    assert_eq!(daemon.get("/sessions/whole").1["state"], "complete");
    let (code, _, said) = lab.run(&["merge", "a", "b", "--out", "beside"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(surface(&lab.data().join("whole")), surface(&lab.data().join("beside")));
    let taken = json!({ "kind": "merge", "session": "whole", "a": "a", "b": "b" });
    assert_eq!(daemon.post("/jobs", Some(&taken)).0, 400);
}

#[test]
fn jobs_wait_for_one_another_and_are_called_off() {
    let (_lab, daemon) = lab(SMALL, &[("quartz", json!({}))]);
    let mut stream = daemon.events(None);
    let long = json!({ "size_mm": 0.1, "size_at_contact_mm": 0.08, "to_force_n": 1000.0, "speed": 0.1 });
    let press = || daemon.post("/sessions/quartz/compressions", Some(&long));
    assert_eq!(press(), (201, json!({ "session": "quartz", "name": "elastic" })));
    assert_eq!(press(), (201, json!({ "session": "quartz", "name": "elastic-2" })));
    let check = json!({ "kind": "verify", "session": "quartz" });
    let [first, second] = [ask(&daemon, &check), ask(&daemon, &check)];
    let (_, jobs) = daemon.get("/jobs");
    let number =
        |name: &str| jobs.as_array().unwrap().iter().find(|j| j["name"] == name).unwrap()["job"].clone();
    let states: Vec<_> = jobs.as_array().unwrap().iter().map(|j| j["state"].clone()).collect();
    assert_eq!(states[1..], ["waiting", "waiting", "waiting"], "{jobs}");
    let (_, listed) = daemon.get("/sessions/quartz/compressions");
    assert_eq!(listed[1]["state"], "waiting", "{listed}");
    // What waits is taken out at once; what goes on stops.
    let cancel = |job: &Value| daemon.post(&format!("/jobs/{job}/cancel"), None).0;
    assert_eq!((cancel(&json!(first)), cancel(&json!(first))), (204, 404));
    assert_eq!(cancel(&number("elastic-2")), 204);
    let (_, listed) = daemon.get("/sessions/quartz/compressions");
    assert_eq!(listed[1]["state"], "interrupted", "{listed}");
    assert_eq!(cancel(&number("elastic")), 204);
    assert_eq!(ended(&mut stream, number("elastic").as_u64().unwrap()).last().unwrap()["state"], "cancelled");
    assert_eq!(ended(&mut stream, second).last().unwrap()["state"], "complete");
    // One that was taken out of the queue can be gone on with.
    assert_eq!(daemon.post("/sessions/quartz/compressions/elastic-2/resume", None).0, 204);
    assert_eq!(daemon.post("/compressions/current/cancel", None).0, 204);
}

#[test]
fn compressions_that_wait_go_on_after_the_program_was_killed() {
    let (lab, mut daemon) = lab(SMALL, &[("quartz", json!({}))]);
    let asked = json!({ "size_mm": 0.15, "size_at_contact_mm": 0.1, "to_force_n": 4.0 });
    for name in ["elastic", "elastic-2"] {
        assert_eq!(daemon.post("/sessions/quartz/compressions", Some(&asked)).1["name"], name);
    }
    daemon.signal("KILL");
    daemon.ended();
    let next = lab.serve();
    let mut stream = next.events(None);
    let (_, jobs) = next.get("/jobs");
    let names: Vec<_> = jobs.as_array().unwrap().iter().map(|job| job["name"].clone()).collect();
    assert_eq!(names, ["elastic", "elastic-2"], "{jobs}");
    assert_eq!(ended(&mut stream, jobs[1]["job"].as_u64().unwrap()).last().unwrap()["state"], "complete");
    assert!(!lab.data().join(".compression.json").exists());
}

#[test]
fn what_makes_no_sense_is_refused_at_once() {
    let (_lab, daemon) = lab(SMALL, &[("quartz", json!({}))]);
    let refused = [
        (json!({}), 400, "kind"),
        (json!({ "kind": "polish", "session": "quartz" }), 400, "polish"),
        (json!({ "kind": "replay", "session": "quartz", "mesh": {} }), 400, "mesh"),
        (json!({ "kind": "replay", "session": "nothing" }), 404, "session"),
        (json!({ "kind": "verify", "session": "nothing" }), 404, "session"),
        (json!({ "kind": "verify", "session": "../quartz" }), 400, "name"),
        (
            json!({ "kind": "reconstruct", "session": "quartz", "mesh": { "surface_size_mm": -1.0 } }),
            400,
            "surface_size_mm",
        ),
        (json!({ "kind": "reconstruct", "session": "quartz", "mesh": { "size": 1.0 } }), 400, "size"),
        (json!({ "kind": "merge", "session": "whole", "a": "quartz", "b": "quartz" }), 400, "both"),
        (json!({ "kind": "merge", "session": "whole", "a": "quartz", "b": "nothing" }), 404, "session"),
        (json!({ "kind": "merge", "session": "..", "a": "quartz", "b": "quartz" }), 400, "name"),
    ];
    for (request, code, named) in &refused {
        let (got, body) = daemon.post("/jobs", Some(request));
        let message = body["error"]["message"].as_str().unwrap_or_default();
        assert!(got == *code && message.contains(named), "{request}: {got} {body}");
    }
    assert_eq!(daemon.get("/jobs"), (200, json!([])));
    assert_eq!(daemon.post("/jobs/7/cancel", None).0, 404);
    assert_eq!(daemon.post("/jobs/seven/cancel", None).0, 400);
}
