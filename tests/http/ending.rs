//! How the program begins and ends.

use std::net::TcpListener;

use crate::daemon::{Lab, SMALL};
use serde_json::{Value, json};

#[test]
fn a_port_in_use_is_named_with_what_to_do() {
    let lab = Lab::new(SMALL);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let (code, out, err) = lab.run(&["serve", "--listen", &address]);
    assert_eq!(code, Some(1), "{err}");
    assert!(out.is_empty(), "{out}");
    assert!(err.contains(&address) && err.contains("--listen"), "{err}");
    assert!(!err.contains("http://"), "{err}");
}

#[test]
fn what_cannot_be_meant_is_a_usage_error() {
    let open = Lab::new(SMALL);
    let cases = [
        // Off loopback without a token, by option and by configuration; a token that can be guessed.
        (open.run(&["serve", "--listen", "0.0.0.0:0"]), ["0.0.0.0:0", "serve.token", "127.0.0.1"]),
        (Lab::new("[serve]\nlisten = \"[::]:0\"\n").run(&["serve"]), ["[::]:0", "serve.token", "127.0.0.1"]),
        (Lab::new("[serve]\ntoken = \"lab\"\n").run(&["serve"]), ["3", "16", "openssl"]),
        (Lab::new("[serve]\nlisten = \"here\"\n").run(&["serve"]), ["here", "serve.listen", "7272"]),
        (Lab::new("[serve]\nport = 1\n").run(&["serve"]), ["port", "listen", "rig.toml"]),
    ];
    for ((code, out, err), named) in cases {
        assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
        assert!(named.iter().all(|name| err.contains(name)), "{named:?}: {err}");
    }
}

#[test]
fn a_daemon_that_is_told_to_end_leaves_a_session_to_go_on_with() {
    for signal in ["TERM", "INT", "HUP"] {
        let lab = Lab::new(SMALL);
        let mut daemon = lab.serve();
        let mut stream = daemon.events(None);
        let overrides = json!({ "plan": { "views": 25, "steps_per_view": 8, "settle_ms": 60_000 } });
        assert_eq!(daemon.start("quartz", overrides).0, 201);
        // It is to rest for a minute at each view; the end does not wait for that.
        stream.until("moving");
        daemon.signal(signal);
        let (status, said) = daemon.ended();
        assert_eq!(status.code(), Some(0), "{said}");
        while stream.next().is_some() {}
        let (code, out, err) = lab.run(&["verify", "quartz", "--json"]);
        assert_eq!(code, Some(0), "{out}{err}");
        // The journal says that somebody ended the run: it was not cut off in its midst.
        let report: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(report["state"], "aborted", "{signal}: {out}");
    }
}

#[test]
fn a_paused_run_goes_on_after_the_end_of_its_daemon() {
    let lab = Lab::new(SMALL);
    let mut daemon = lab.serve();
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", json!({ "plan": { "settle_ms": 200 } })).0, 201);
    assert_eq!(daemon.post("/runs/current/pause", None).0, 204);
    stream.until("paused");
    daemon.signal("TERM");
    assert_eq!(daemon.ended().0.code(), Some(0));
    // Another daemon on the same folder shows it, and counts on from later numbers.
    let next = lab.serve();
    let (_, session) = next.get("/sessions/quartz");
    assert_eq!(session["state"], "aborted");
    assert_eq!(next.get("/status").1["state"], "idle");
    let (code, out, err) = lab.run(&["resume", "quartz", "--json"]);
    assert_eq!(code, Some(0), "{err}");
    assert_eq!(serde_json::from_str::<Value>(&out).unwrap()["views"], 5);
    assert_eq!(next.get("/sessions/quartz").1["state"], "complete");
}

#[test]
fn a_mesh_that_is_being_made_does_not_hold_up_the_end() {
    let lab = Lab::new(SMALL);
    let mut daemon = lab.serve();
    let mut stream = daemon.events(None);
    // Millions of tetrahedra: on most computers more than fit into the time that the end may take.
    let fine = json!({ "mesh": { "surface_size_mm": 0.008 } });
    assert_eq!(daemon.start("quartz", fine).0, 201);
    while stream.until("working").last().unwrap().data["stage"] != "mesh" {}
    let (code, body) = (daemon.post("/runs/current/abort", None), daemon.get("/status").1);
    assert_eq!((code.0, &body["state"]), (409, &json!("computing")), "{code:?}");
    daemon.signal("TERM");
    let (status, said) = daemon.ended();
    assert_eq!(status.code(), Some(0), "{said}");
    // Whoever broke off a mesh says how to go on; whoever did not has made it.
    let broken_off = said.contains("grainrig resume");
    let (_, out, err) = lab.run(&["verify", "quartz", "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out}{err}"));
    // All that was recorded is whole. Where the end came while products were written, those are not recorded yet.
    for fault in report["faults"].as_array().unwrap() {
        let unrecorded =
            fault["fault"] == "extra" && fault["file"].as_str().unwrap().starts_with("products/");
        assert!(broken_off && unrecorded, "{fault}");
    }
    let state = if broken_off { "captured" } else { "complete" };
    assert_eq!(lab.serve().get("/sessions/quartz").1["state"], state);
}
