//! Sessions that go on over HTTP, and pictures that were refused.

use crate::daemon::{Lab, SMALL};
use serde_json::{Value, json};

/// Ten views with rests between them.
fn slow() -> Value {
    json!({ "plan": { "views": 10, "steps_per_view": 20, "settle_ms": 200 } })
}

#[test]
fn a_session_goes_on_after_an_abort_and_after_the_daemon_was_killed() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    let resume = "/sessions/quartz/resume";
    assert_eq!(daemon.post(resume, None).0, 404);
    assert_eq!(daemon.start("quartz", slow()).0, 201);
    stream.until("captured");
    let (code, body) = daemon.post(resume, None);
    assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")), "{body}");
    assert_eq!(daemon.post("/runs/current/abort", None).0, 204);
    stream.until("aborted");
    // At once, though the run's thread may still be letting go of the session.
    assert_eq!(daemon.post(resume, None), (201, json!({ "session": "quartz" })));
    stream.until("captured");
    drop(daemon);

    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    assert_eq!(daemon.get("/status").1["state"], "idle");
    assert_eq!(daemon.post(resume, None), (201, json!({ "session": "quartz" })));
    let events = stream.until("complete");
    let started = events.iter().find(|e| e.kind == "started").unwrap();
    let before = started.data["already_captured"].as_u64().unwrap();
    assert!((2..11).contains(&before), "{before}");
    assert_eq!(events.iter().filter(|e| e.kind == "captured").count() as u64, 11 - before);
    assert_eq!(daemon.get("/status").1["captured"], 11);
    let (code, body) = daemon.post(resume, None);
    assert_eq!((code, &body["error"]["kind"]), (409, &json!("busy")), "{body}");
    assert!(body["error"]["message"].as_str().unwrap().contains("nothing is left to do"), "{body}");
}

#[test]
fn a_refused_picture_is_kept_beside_the_session_and_served() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    let faults = json!({ "blurred_frame_at": 2, "frame_faults_stay": true });
    assert_eq!(daemon.start("quartz", json!({ "simulated": { "faults": faults } })).0, 201);
    let rejected = stream.until("suspended");
    let rejected = &rejected.iter().rfind(|e| e.kind == "rejected").unwrap().data;
    let status = daemon.get("/status").1;
    let expected = json!({ "view": 2, "tries": rejected["tries"], "cause": rejected["cause"] });
    assert_eq!(status["rejected"], expected);
    let session = daemon.get("/sessions/quartz").1;
    assert_eq!(session["rejected"], json!([expected]));
    let address = "/sessions/quartz/rejected/2";
    let (code, picture) = daemon.get_bytes(address);
    let file = lab.data().join("quartz/rejected/view_002.jpg");
    assert!(code == 200 && picture == std::fs::read(&file).unwrap() && picture.starts_with(b"\xff\xd8"));
    for none in ["1", "3", "99", "x", "-1", "..%2f2"] {
        let code = daemon.get_bytes(&format!("/sessions/quartz/rejected/{none}")).0;
        assert!(code == 404 || code == 400, "{none}: {code}");
    }
    // It is no evidence: the session is sound with it, without it, and with another in its place.
    assert_eq!(daemon.post("/runs/current/abort", None).0, 204);
    stream.until("aborted");
    drop(daemon);
    for change in [None, Some(&b"changed"[..])] {
        if let Some(bytes) = change {
            std::fs::write(&file, bytes).unwrap();
        }
        let (code, out, err) = lab.run(&["verify", "quartz"]);
        assert_eq!(code, Some(0), "{out}{err}");
    }
    // What is no picture, or lies elsewhere, is not served.
    let daemon = lab.serve();
    assert_eq!(daemon.get_bytes(address).0, 500);
    let elsewhere = lab.data().join("other.jpg");
    std::fs::write(&elsewhere, &picture).unwrap();
    std::fs::remove_file(&file).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &file).unwrap();
    assert_eq!(daemon.get_bytes(address).0, 500);
}
