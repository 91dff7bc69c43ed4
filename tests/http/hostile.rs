//! What a stranger should not be able to do. `tests/serve` has the finer cases, with a rig that does nothing.

use std::io::Write;
use std::net::TcpStream;

use crate::daemon::{Daemon, Lab, SMALL, files};
use serde_json::json;

const SECRET: &str = "the farm's key";

fn code(answer: &str) -> u16 {
    answer.get(9..12).and_then(|code| code.parse().ok()).unwrap_or(0)
}

fn get(daemon: &Daemon, path: &str, headers: &str) -> String {
    daemon.raw(format!("GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n").as_bytes())
}

#[test]
fn no_name_reads_anything_outside_a_session() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let mut stream = daemon.events(None);
    assert_eq!(daemon.start("quartz", json!({})).0, 201);
    stream.until("complete");
    std::fs::write(lab.data().join("secret.txt"), SECRET).unwrap();
    std::fs::write(lab.data().join("quartz/secret.txt"), SECRET).unwrap();
    let before = files(&lab.data());
    let host = "Host: localhost\r\n";
    for up in ["..", "%2e%2e", ".%2e", "..%2f..", "..%5c..", "%2e%2e%2fquartz", "....//", "%252e%252e", "."] {
        for path in [
            format!("/api/v1/sessions/{up}/secret.txt"),
            format!("/api/v1/sessions/{up}"),
            format!("/api/v1/sessions/{up}%2fsecret.txt"),
            format!("/api/v1/sessions/quartz/frames/{up}%2fsecret.txt"),
            format!("/api/v1/sessions/quartz/frames/{up}/secret.txt"),
            format!("/api/v1/sessions/quartz/products/{up}%2f..%2fsecret.txt"),
            format!("/api/v1/sessions/quartz/products/{up}"),
            format!("/api/v1/sessions/quartz/previews/{up}%2fsecret.txt"),
            format!("/{up}/secret.txt"),
        ] {
            let answer = get(&daemon, &path, host);
            assert!([400, 404].contains(&code(&answer)), "{path}: {answer}");
            assert!(!answer.contains(SECRET), "{path}: {answer}");
        }
    }
    // Files that are in the session's folder, but in no list of it.
    for file in ["secret.txt", "manifest.json", "journal.jsonl", "lock"] {
        for kind in ["frames", "products", "previews"] {
            assert_eq!(daemon.get(&format!("/sessions/quartz/{kind}/{file}")).0, 404, "{kind}/{file}");
        }
    }
    for name in ["../x", "..", "", "a/b", ".hidden", "a\0b", "-rf", "x".repeat(65).as_str()] {
        assert_eq!(daemon.start(name, json!({})).0, 400, "{name:?}");
    }
    assert!(before == files(&lab.data()), "asking has changed the data folder");
}

#[test]
fn a_gigabyte_is_refused_and_the_daemon_answers_afterwards() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let head = "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
    let declared = daemon.raw(format!("{head}Content-Length: 1073741824\r\n\r\n").as_bytes());
    assert_eq!(code(&declared), 413, "{declared}");
    let mut sending = TcpStream::connect(daemon.address).unwrap();
    write!(sending, "{head}Transfer-Encoding: chunked\r\n\r\n").unwrap();
    let chunk = format!("100000\r\n{}\r\n", " ".repeat(0x10_0000));
    let taken = (0..1024).take_while(|_| sending.write_all(chunk.as_bytes()).is_ok()).count();
    assert!(taken < 64, "{taken} MiB of 1024 were taken");
    assert_eq!(daemon.get("/status").0, 200);
    assert_eq!(daemon.get("/sessions"), (200, json!([])));
}

#[test]
fn a_token_opens_the_door_and_is_told_to_nobody() {
    const TOKEN: &str = "correct-horse-battery";
    let lab = Lab::new(&format!("{SMALL}\n[serve]\ntoken = \"{TOKEN}\"\n"));
    let mut daemon = lab.serve();
    assert_eq!(daemon.get("/status").0, 401);
    assert_eq!(daemon.start("quartz", json!({})).0, 401);
    daemon.token = Some("wrong-horse-battery");
    assert_eq!(daemon.get("/status").0, 401);
    daemon.token = Some(TOKEN);
    assert_eq!(daemon.get("/status").0, 200);
    let body = r#"{"name":"quartz"}"#;
    let answer = daemon.raw(
        format!(
            "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
             Authorization: Bearer {TOKEN}\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        )
        .as_bytes(),
    );
    assert_eq!(code(&answer), 201, "{answer}");
    // A session is handed to others with its settings; the token is not among them.
    let (status, session) = daemon.get("/sessions/quartz");
    assert_eq!(status, 200);
    assert_eq!(session["config"]["serve"]["token"], json!(null));
    for (path, bytes) in files(&lab.data()) {
        assert!(!String::from_utf8_lossy(&bytes).contains(TOKEN), "the token is in {}", path.display());
    }
}

#[test]
fn pages_and_names_of_others_are_refused() {
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let port = daemon.address.port();
    let post = |host: &str, origin: &str| {
        let lines =
            format!("Host: {host}\r\nOrigin: {origin}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        code(&daemon.raw(format!("POST /api/v1/runs/current/abort HTTP/1.1\r\n{lines}").as_bytes()))
    };
    let own = format!("localhost:{port}");
    // There is no run to abort: that is what our own page is told.
    assert_eq!(post(&own, &format!("http://{own}")), 409);
    assert_eq!(post(&own, "http://evil.example"), 403);
    assert_eq!(post(&own, "null"), 403);
    // 421, Misdirected Request: the name is not ours, whoever sent it.
    assert_eq!(post("evil.example", "http://evil.example"), 421);
    assert_eq!(code(&get(&daemon, "/api/v1/status", "Host: evil.example\r\n")), 421);
    assert_eq!(code(&get(&daemon, "/api/v1/status", &format!("Host: 127.0.0.1:{port}\r\n"))), 200);
}
