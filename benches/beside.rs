//! How much a capture is slowed by a compression that goes on beside it: the real daemon, asked by HTTP, captures a grain on the
//! simulated rig (25 views and a closing one) through to its mesh, alone and beside an elastic compression that would go on for
//! hours. Run: `cargo bench --bench beside` (two minutes).
//!
//! A view's time goes from its move to the next one's; the whole from the beginning to the result.

#[allow(dead_code)]
#[path = "../tests/http/daemon.rs"]
mod jobs;
#[path = "../tests/support/sse/mod.rs"]
mod sse;

use grainrig::session::Recording;
use grainrig::session::event::EventKind;
use jobs::{Daemon, Lab};
use serde_json::{Value, json};
use std::time::SystemTime;

/// Pictures of 4.5 megapixels, and the plan's own pauses.
const RIG: &str = "
[simulated]
width = 2592
height = 1728
mm_per_px = 0.0086
[optics]
mm_per_px = 0.0086
";
/// Captures of each kind.
const CAPTURES: usize = 3;

fn main() {
    let lab = Lab::new(RIG);
    let daemon = lab.serve();
    captured(&lab, &daemon, "warm");
    let alone = median(&lab, &daemon, "alone");
    let settings = json!({ "to_force_n": 1000.0, "speed": 0.01 });
    let (code, answer) = daemon.post("/sessions/warm/compressions", Some(&settings));
    assert_eq!(code, 201, "{answer}");
    let mut news = daemon.events(None);
    loop {
        let message = news.next().expect("news of the compression");
        if message.kind == "compression" && message.data["state"] == "running" {
            break;
        }
    }
    let before = points(&daemon);
    let beside = median(&lab, &daemon, "beside");
    assert!(points(&daemon) > before, "the compression has stood still");
    for (k, what) in ["a view", "a capture to its mesh"].into_iter().enumerate() {
        let (alone, beside) = (alone[k], beside[k]);
        println!(
            "{what:<22} alone {:>8.1} ms, beside a compression {:>8.1} ms: {:.3} ×",
            1e3 * alone,
            1e3 * beside,
            beside / alone
        );
    }
}

/// Points of the compression's curve so far.
fn points(daemon: &Daemon) -> usize {
    daemon.get("/status").1["compression"]["curve"].as_array().map_or(0, Vec::len)
}

fn median(lab: &Lab, daemon: &Daemon, name: &str) -> [f64; 2] {
    let mut all: Vec<[f64; 2]> =
        (0..CAPTURES).map(|n| captured(lab, daemon, &format!("{name}-{n}"))).collect();
    [0, 1].map(|k| {
        all.sort_by(|a, b| a[k].total_cmp(&b[k]));
        all[CAPTURES / 2][k]
    })
}

/// Captures a session: the median of its views' times, and the whole, seconds.
fn captured(lab: &Lab, daemon: &Daemon, name: &str) -> [f64; 2] {
    let mut stream = daemon.events(None);
    let (code, answer): (u16, Value) = daemon.start(name, json!({}));
    assert_eq!(code, 201, "{answer}");
    stream.until("complete");
    let session = Recording::read(&lab.data().join(name)).expect("the session");
    let times = |is: fn(&EventKind) -> bool| -> Vec<SystemTime> {
        session.events().iter().filter(|e| is(&e.what)).map(|e| SystemTime::from(e.time)).collect()
    };
    let seconds = |a: SystemTime, b: SystemTime| b.duration_since(a).map_or(0.0, |d| d.as_secs_f64());
    let moves = times(|e| matches!(e, EventKind::Moving { .. }));
    let mut views: Vec<f64> = moves.windows(2).map(|w| seconds(w[0], w[1])).collect();
    views.sort_by(f64::total_cmp);
    let from = times(|e| matches!(e, EventKind::Started { .. }))[0];
    let to = times(|e| matches!(e, EventKind::Complete { .. }))[0];
    [views[views.len() / 2], seconds(from, to)]
}
