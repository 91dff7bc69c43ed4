//! A crowd at the door, of every kind that holds a connection, while a run goes on: the operator is let in.

use std::collections::VecDeque;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::daemon::{Lab, SMALL};
use serde_json::{Value, json};

const TOKEN: &str = "0123456789abcdef";
/// Connections unless `GRAINRIG_CROWD` says otherwise: more than there are places.
const CROWD: usize = 2200;
/// What the operator's request may take where the crowd is as large as was asked for, and on a computer that builds and tests
/// other things at the same time.
const AT_ONCE: Duration = Duration::from_secs(1);
const AT_LEAST: Duration = Duration::from_secs(10);

/// What one of the crowd sends.
fn sent(kind: usize) -> Vec<u8> {
    let api = |line: &str, rest: &str| format!("{line} HTTP/1.1\r\nHost: localhost\r\n{rest}");
    match kind % 6 {
        0 => String::new(),
        1 => "GET /api/v1/status HTTP/1.1\r\nHost: loc".into(),
        2 => api("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 1000\r\n\r\n{"),
        // Its answer is never read.
        3 => api("GET /api/v1/events", "\r\n"),
        4 => api("GET /api/v1/status", "Authorization: Bearer fedcba9876543210\r\n\r\n"),
        _ => api("GET /", "\r\n"),
    }
    .into_bytes()
}

/// Keeps as many connections open, and replaces the oldest for ever, until `enough`.
fn crowd(address: SocketAddr, size: usize, open: &AtomicUsize, enough: &AtomicBool) {
    let mut held: VecDeque<TcpStream> = VecDeque::new();
    for kind in 0.. {
        if enough.load(Ordering::Relaxed) {
            return;
        }
        if let Ok(mut stream) = TcpStream::connect_timeout(&address, Duration::from_secs(5)) {
            let _ = stream.write_all(&sent(kind));
            held.push_back(stream);
        }
        if held.len() > size {
            held.pop_front();
        }
        open.store(held.len(), Ordering::Relaxed);
    }
}

/// A request of the operator on a connection of its own; its status, and what it took.
fn asked(address: SocketAddr, line: &str, token: Option<&str>) -> (u16, Duration) {
    let begun = Instant::now();
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
    let token = token.map_or_else(String::new, |token| format!("Authorization: Bearer {token}\r\n"));
    let head = format!("{line} HTTP/1.1\r\nHost: localhost\r\n{token}Connection: close\r\n\r\n");
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap_or_else(|e| panic!("{line}: {e} after {:?}", begun.elapsed()));
    let status = String::from_utf8_lossy(&answer).get(9..12).and_then(|code| code.parse().ok());
    (status.unwrap_or_else(|| panic!("{line}: no answer")), begun.elapsed())
}

/// Sends the crowd away, also where an assertion fails.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Asks for as many open files as the system allows, each connection being one; how many those are.
fn more_files() -> usize {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    setrlimit(Resource::Nofile, limit).unwrap();
    limit.maximum.map_or(usize::MAX, |most| most as usize)
}

#[test]
fn the_operator_is_let_in_whoever_else_is_at_the_door() {
    let files = more_files();
    let asked_for: Option<usize> = std::env::var("GRAINRIG_CROWD").ok().map(|n| n.parse().unwrap());
    let (size, limit) = asked_for.map_or((CROWD, AT_LEAST), |size| (size, AT_ONCE));
    let size = size.min(files - 200);
    for token in [None, Some(TOKEN)] {
        let serve = token.map_or_else(String::new, |token| format!("[serve]\ntoken = \"{token}\"\n"));
        let lab = Lab::new(&format!("{SMALL}{serve}"));
        let mut daemon = lab.serve();
        daemon.token = token;
        let address = daemon.address;
        let run =
            json!({ "name": "quartz", "plan": { "views": 25, "steps_per_view": 8, "settle_ms": 60_000 } });
        let (status, answer) = daemon.post("/runs", Some(&run));
        assert_eq!(status, 201, "{answer}");
        let (open, enough) = (AtomicUsize::new(0), AtomicBool::new(false));
        let worst = std::thread::scope(|scope| {
            let _ends = Ends(&enough);
            scope.spawn(|| crowd(address, size, &open, &enough));
            while open.load(Ordering::Relaxed) < size {
                std::thread::yield_now();
            }
            let mut worst = (Duration::ZERO, "");
            for _ in 0..20 {
                for line in
                    ["GET /", "GET /api/v1/status", "GET /api/v1/sessions", "GET /api/v1/sessions/quartz"]
                {
                    let (status, took) = asked(address, line, token);
                    assert_eq!(status, 200, "{line}");
                    worst = worst.max((took, line));
                }
            }
            let (status, took) = asked(address, "POST /api/v1/runs/current/abort", token);
            assert_eq!(status, 204);
            worst.max((took, "abort"))
        });
        println!("{size} connections, token: {}: at most {worst:?}", token.is_some());
        assert!(worst.0 < limit, "{worst:?}");
        let (_, status) = daemon.get("/status");
        assert_ne!(status["state"], Value::Null);
    }
}

#[test]
fn wrong_tokens_are_slowed_down_and_the_right_one_is_not() {
    let lab = Lab::new(&format!("{SMALL}[serve]\ntoken = \"{TOKEN}\"\n"));
    let mut daemon = lab.serve();
    daemon.token = Some(TOKEN);
    let mut answers = [0, 0];
    for _ in 0..200 {
        match asked(daemon.address, "GET /api/v1/status", Some("fedcba9876543210")).0 {
            401 => answers[0] += 1,
            429 => answers[1] += 1,
            other => panic!("{other}"),
        }
    }
    // A burst, and one every two seconds: however long the two hundred took, the most of them were not looked at.
    assert!(answers[0] >= 30 && answers[1] > 0, "{answers:?}");
    let refused = daemon.raw(
        b"GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer wrong\r\nConnection: close\r\n\r\n",
    );
    assert!(
        refused.starts_with("HTTP/1.1 429") && refused.to_lowercase().contains("retry-after: "),
        "{refused}"
    );
    assert_eq!(daemon.get("/status").0, 200);
    // Without any token nothing is guessed.
    assert_eq!(asked(daemon.address, "GET /api/v1/status", None).0, 401);
}
