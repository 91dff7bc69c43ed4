//! What no well-behaved client sends.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use grainrig::server::{KEPT_EVENTS, ServeOptions};
use grainrig::session::event::EventKind;

use crate::rig::{Server, client};

const TOKEN: &str = "0123456789abcdef";

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(server.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream
}

/// Everything up to the end of the connection.
fn rest(stream: &mut TcpStream) -> String {
    let mut text = Vec::new();
    // A reset ends the connection as well; what came before it counts.
    let _ = stream.read_to_end(&mut text);
    String::from_utf8_lossy(&text).into_owned()
}

/// Sends these bytes and returns the status and the whole answer.
fn send(server: &Server, request: &str) -> (u16, String) {
    let mut stream = connect(server);
    stream.write_all(request.as_bytes()).unwrap();
    let answer = rest(&mut stream);
    (answer.get(9..12).and_then(|status| status.parse().ok()).unwrap_or(0), answer)
}

/// A request with these header lines, the connection to be closed after it.
fn request(server: &Server, line: &str, headers: &str) -> (u16, String) {
    send(server, &format!("{line} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n"))
}

fn with_token() -> Server {
    let options = ServeOptions {
        token: Some(TOKEN.into()),
        allowed_hosts: vec!["lab.example".into()],
        ..ServeOptions::default()
    };
    Server::with(options, KEPT_EVENTS)
}

#[test]
fn only_our_own_hosts_are_answered() {
    let server = Server::start();
    for host in ["localhost", "127.0.0.1:8080", "[::1]"] {
        assert_eq!(request(&server, "GET /api/v1/status", &format!("Host: {host}\r\n")).0, 200, "{host}");
    }
    for headers in
        ["Host: evil.example\r\n", "Host: lab.example\r\n", "", "Host: localhost\r\nHost: localhost\r\n"]
    {
        let (status, answer) = request(&server, "GET /api/v1/status", headers);
        assert_eq!(status, 421, "{headers}: {answer}");
        assert_eq!(request(&server, "GET /", headers).0, 421);
    }
    assert_eq!(request(&server, "GET http://evil.example/api/v1/status", "Host: localhost\r\n").0, 421);
    let server = with_token();
    let headers = format!("Host: LAB.example:80\r\nAuthorization: Bearer {TOKEN}\r\n");
    assert_eq!(request(&server, "GET /api/v1/status", &headers).0, 200);
}

#[test]
fn a_page_of_another_site_cannot_drive_the_rig() {
    let server = Server::start();
    let post = |headers: &str, body: &str| {
        let length = body.len();
        let head = format!("Host: localhost:7\r\n{headers}Content-Length: {length}\r\n");
        send(&server, &format!("POST /api/v1/runs HTTP/1.1\r\nConnection: close\r\n{head}\r\n{body}")).0
    };
    let json = "Content-Type: application/json\r\n";
    let body = r#"{"name":"quartz"}"#;
    for origin in [
        "http://evil.example",
        "null",
        "http://localhost:8",
        "http://localhost",
        "file://",
        "localhost:7",
        "",
    ] {
        assert_eq!(post(&format!("Origin: {origin}\r\n{json}"), body), 403, "{origin}");
        assert_eq!(
            request(
                &server,
                "POST /api/v1/runs/current/abort",
                &format!("Host: localhost:7\r\nOrigin: {origin}\r\n")
            )
            .0,
            403
        );
    }
    // What a form can send without asking.
    for form in ["", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n"] {
        assert_eq!(post(form, body), 415, "{form}");
    }
    assert_eq!(post(&format!("Origin: http://localhost:7\r\n{json}"), body), 201);
}

#[test]
fn a_token_is_needed_where_there_is_one() {
    let server = with_token();
    let status =
        |headers: &str| request(&server, "GET /api/v1/status", &format!("Host: localhost\r\n{headers}"));
    let (code, answer) = status("");
    assert!(code == 401 && answer.to_lowercase().contains("www-authenticate: bearer"), "{answer}");
    for wrong in [
        "Authorization: Bearer 0123456789abcdeF\r\n",
        "Authorization: Bearer \r\n",
        "Authorization: 0123456789abcdef\r\n",
        "Cookie: grainrig_token=0123456789abcdef\r\n",
        "Cookie: grainrig_token=\r\n",
    ] {
        assert_eq!(status(wrong).0, 401, "{wrong}");
    }
    assert_eq!(status(&format!("Authorization: Bearer {TOKEN}\r\n")).0, 200);
    // Event streams and pictures cannot send headers; what changes the rig's state can.
    let line = format!("GET /api/v1/status?token={TOKEN}");
    assert_eq!(request(&server, &line, "Host: localhost\r\n").0, 200);
    assert_eq!(request(&server, "GET /api/v1/status?token=wrong", "Host: localhost\r\n").0, 401);
    let line = format!("POST /api/v1/runs/current/abort?token={TOKEN}");
    assert_eq!(request(&server, &line, "Host: localhost\r\n").0, 401);
    for path in ["runs", "sessions", "sessions/quartz/frames/0000.jpg", "events", "openapi.json", "none"] {
        assert_eq!(request(&server, &format!("GET /api/v1/{path}"), "Host: localhost\r\n").0, 401, "{path}");
    }
}

#[test]
fn the_page_opened_with_the_token_gets_a_cookie() {
    let server = with_token();
    // The page itself holds no secret.
    assert_eq!(request(&server, "GET /", "Host: localhost\r\n").0, 200);
    let wrong = request(&server, "GET /?token=wrong", "Host: localhost\r\n");
    assert!(wrong.0 == 200 && !wrong.1.to_lowercase().contains("set-cookie"));
    let reply = client().get(server.url(&format!("/?token={TOKEN}"))).call().unwrap();
    assert_eq!((reply.status().as_u16(), reply.headers()["location"].to_str().unwrap()), (303, "/"));
    let cookie = reply.headers()["set-cookie"].to_str().unwrap();
    assert!(cookie.ends_with("; Path=/; HttpOnly; SameSite=Strict") && !cookie.contains(TOKEN), "{cookie}");
    let cookie = cookie.split(';').next().unwrap();
    let headers = format!("Host: localhost\r\nCookie: other=1; {cookie}\r\n");
    assert_eq!(request(&server, "GET /api/v1/status", &headers).0, 200);
}

#[test]
fn no_name_leaves_the_data_folder() {
    let server = Server::start();
    let names = [
        "..",
        "%2e%2e",
        "..%2f..%2fetc%2fpasswd",
        "%2e%2e%2f",
        "a%2fb",
        "a%5cb",
        "a%00b",
        "%00",
        "%0a",
        "%ff%fe",
        ".git",
        "%",
        "%zz",
        "...",
        "a%7fb",
    ];
    for name in names {
        for path in [
            name.to_string(),
            format!("{name}/frames/0000.jpg"),
            format!("quartz/frames/{name}"),
            format!("quartz/products/{name}"),
        ] {
            let (status, answer) =
                request(&server, &format!("GET /api/v1/sessions/{path}"), "Host: localhost\r\n");
            assert!(status == 400 || status == 404, "{path}: {answer}");
        }
    }
    let long = "x".repeat(300);
    let (status, answer) = request(&server, &format!("GET /api/v1/sessions/{long}"), "Host: localhost\r\n");
    assert!(status == 400 && answer.len() < 1200, "{answer}");
    for path in ["/../Cargo.toml", "/%2e%2e/Cargo.toml", "//etc/passwd", "/monitor.js/..", "/./"] {
        assert_eq!(request(&server, &format!("GET {path}"), "Host: localhost\r\n").0, 404, "{path}");
    }
}

#[test]
fn a_gigabyte_is_refused_unread() {
    let server = Server::start();
    let head = "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
    // Nothing of the body is sent, and the answer comes all the same.
    for length in ["1073741824", "65537", "99999999999999999999999999"] {
        let (status, answer) = send(&server, &format!("{head}Content-Length: {length}\r\n\r\n"));
        assert!(status == 413 || (status == 400 && length.len() > 20), "{length}: {answer}");
    }
    // Without a length it is read up to the limit; the client is cut off long before its end.
    let mut stream = connect(&server);
    let mut sending = stream.try_clone().unwrap();
    write!(sending, "{head}Transfer-Encoding: chunked\r\n\r\n").unwrap();
    let sender = std::thread::spawn(move || {
        let chunk = format!("10000\r\n{}\r\n", " ".repeat(0x10000));
        (0..16384).take_while(|_| sending.write_all(chunk.as_bytes()).is_ok()).count()
    });
    let answer = rest(&mut stream);
    assert!(answer.starts_with("HTTP/1.1 413") && answer.contains("too_large"), "{answer}");
    let chunks = sender.join().unwrap();
    assert!(chunks < 1024, "{chunks} chunks of 64 KiB were taken");
    assert_eq!(request(&server, "GET /api/v1/status", "Host: localhost\r\n").0, 200);
}

#[test]
fn requests_that_never_end_are_cut_off() {
    let options = ServeOptions { idle_limit: Duration::from_millis(100), ..ServeOptions::default() };
    let server = Server::with(options, KEPT_EVENTS);
    let beginnings = [
        "",
        "GET /api/v1/sta",
        "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nX-",
        "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n{",
        "GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\n\r\n",
    ];
    for beginning in beginnings {
        // Each waits for the server to hang up; none keeps it from answering others.
        let mut hanging = connect(&server);
        hanging.write_all(beginning.as_bytes()).unwrap();
        assert_eq!(request(&server, "GET /api/v1/status", "Host: localhost\r\n").0, 200);
        rest(&mut hanging);
    }
    // A head that trickles in is cut off too: the limit is on the whole of it.
    let mut trickling = connect(&server);
    let mut sent = 0;
    while trickling.write_all(b"G").is_ok() {
        sent += 1;
        assert!(sent < 1_000_000_000, "never cut off");
        std::thread::yield_now();
    }
    // An event stream on which nothing happens is not idle: it comes through many limits.
    let mut stream = crate::events::open(&server, None);
    stream.next().unwrap();
    for _ in 0..6 {
        rest(&mut connect(&server));
    }
    server.rig.happened(EventKind::Homed);
    assert_eq!(stream.next().unwrap().kind, "homed");
}

#[test]
fn nonsense_is_answered_or_cut_off() {
    let server = Server::start();
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(1 << 20));
    let deep = format!("{}{}", "[".repeat(60_000), "]");
    let deep = format!(
        "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{deep}",
        deep.len()
    );
    let nonsense = [
        "\0\0\0\0\r\n\r\n",
        "GET\r\n\r\n",
        "\x16\x03\x01\x02\r\n\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        &long,
        &deep,
    ];
    for nonsense in nonsense {
        let mut stream = connect(&server);
        // The server may hang up before all of it is sent.
        let _ = stream.write_all(nonsense.as_bytes());
        let answer = rest(&mut stream);
        assert!(!answer.starts_with("HTTP/1.1 2"), "{answer}");
    }
    assert_eq!(request(&server, "GET /api/v1/status", "Host: localhost\r\n").0, 200);
}
