//! The event stream over HTTP: no gap, no repeat.

use std::io::{BufRead, BufReader};
use std::num::NonZeroUsize;

use grainrig::server::ServeOptions;
use grainrig::session::event::Happening;
use serde_json::Value;

use crate::rig::{FIRST, Server, client};

/// One message of the stream.
#[derive(Debug)]
pub struct Message {
    pub id: u64,
    pub kind: String,
    pub data: Value,
}

/// An open stream, read as a browser reads it.
pub struct Stream(BufReader<ureq::BodyReader<'static>>);

impl Stream {
    pub fn open(server: &Server, last: Option<u64>) -> Self {
        let request = client().get(server.url("/api/v1/events"));
        let request = match last {
            Some(last) => request.header("last-event-id", last.to_string()),
            None => request,
        };
        let response = request.call().unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self(BufReader::new(response.into_body().into_reader()))
    }

    /// The next message; `None` when the server has ended the stream.
    pub fn next(&mut self) -> Option<Message> {
        let (mut id, mut kind, mut data) = (None, String::new(), Value::Null);
        loop {
            let mut line = String::new();
            if self.0.read_line(&mut line).unwrap_or(0) == 0 {
                return None;
            }
            match line.trim_end().split_once(": ") {
                Some(("id", value)) => id = Some(value.parse().unwrap()),
                Some(("event", value)) => value.clone_into(&mut kind),
                Some(("data", value)) => data = serde_json::from_str(value).unwrap(),
                _ if line == "\n" && id.is_some() => return Some(Message { id: id.unwrap(), kind, data }),
                _ => {}
            }
        }
    }
}

#[test]
fn a_new_client_gets_a_snapshot_and_then_every_event() {
    let server = Server::start();
    server.rig.happened(Happening::Started { session: "quartz".into(), views: 25, already_captured: 3 });
    let mut stream = Stream::open(&server, None);
    let snapshot = stream.next().unwrap();
    assert_eq!((snapshot.id, snapshot.kind.as_str()), (FIRST, "snapshot"));
    assert_eq!(snapshot.data["seq"], FIRST);
    assert_eq!(snapshot.data["status"]["captured"], 3);
    server.rig.happened(Happening::Moving { view: 3, target_deg: 21.6 });
    let moving = stream.next().unwrap();
    assert_eq!((moving.id, moving.kind.as_str()), (FIRST + 1, "moving"));
    assert_eq!(moving.data["target_deg"], 21.6);
    assert_eq!(moving.data["seq"], FIRST + 1);
}

#[test]
fn a_client_that_comes_back_gets_what_it_missed() {
    let server = Server::start();
    for view in 0..5 {
        server.rig.happened(Happening::Moving { view, target_deg: 0.0 });
    }
    let mut stream = Stream::open(&server, Some(FIRST + 1));
    for id in FIRST + 2..FIRST + 5 {
        let message = stream.next().unwrap();
        assert_eq!((message.id, message.kind.as_str()), (id, "moving"));
    }
    // `after` does the same where no header can be sent; the header goes before it.
    let url = server.url(&format!("/api/v1/events?after={FIRST}"));
    let reply = client().get(url).header("last-event-id", (FIRST + 3).to_string()).call().unwrap();
    let mut stream = Stream(BufReader::new(reply.into_body().into_reader()));
    assert_eq!(stream.next().unwrap().id, FIRST + 4);
    let reply = client().get(server.url(&format!("/api/v1/events?after={FIRST}"))).call().unwrap();
    let mut stream = Stream(BufReader::new(reply.into_body().into_reader()));
    assert_eq!(stream.next().unwrap().id, FIRST + 1);
}

#[test]
fn a_number_of_an_earlier_daemon_gets_a_snapshot() {
    let server = Server::start();
    server.rig.happened(Happening::Homed);
    for unknown in [1, FIRST - 2, FIRST + 1, u64::MAX] {
        let first = Stream::open(&server, Some(unknown)).next().unwrap();
        assert_eq!((first.id, first.kind.as_str()), (FIRST, "snapshot"), "{unknown}");
    }
    let reply =
        client().get(server.url("/api/v1/events")).header("last-event-id", "no number").call().unwrap();
    let mut stream = Stream(BufReader::new(reply.into_body().into_reader()));
    assert_eq!(stream.next().unwrap().kind, "snapshot");
}

#[test]
fn a_client_that_keeps_dropping_out_misses_and_repeats_nothing() {
    const PUSHED: u64 = 2000;
    let server = Server::start();
    let pushers: Vec<_> = (0..4)
        .map(|_| {
            let rig = server.rig.clone();
            std::thread::spawn(move || {
                for view in 0..PUSHED / 4 {
                    rig.happened(Happening::Moving { view: view as usize, target_deg: 0.0 });
                }
            })
        })
        .collect();
    let mut last = FIRST - 1;
    while last < FIRST + PUSHED - 1 {
        let mut stream = Stream::open(&server, Some(last));
        for _ in 0..37 {
            if last == FIRST + PUSHED - 1 {
                break;
            }
            let message = stream.next().unwrap();
            assert_eq!((message.id, message.kind.as_str()), (last + 1, "moving"));
            last = message.id;
        }
    }
    for pusher in pushers {
        pusher.join().unwrap();
    }
}

#[test]
fn a_slow_client_is_cut_off_and_told_where_things_stand() {
    const PUSHED: u64 = 200_000;
    let server = Server::with(ServeOptions::default(), NonZeroUsize::new(64).unwrap());
    let mut slow = Stream::open(&server, None);
    assert_eq!(slow.next().unwrap().kind, "snapshot");
    // Far more than the sockets between us hold: if pushing waited for the reader, this would not end.
    for view in 0..PUSHED {
        server.rig.happened(Happening::Moving { view: view as usize, target_deg: 0.0 });
    }
    let mut last = FIRST - 1;
    while let Some(message) = slow.next() {
        assert_eq!(message.id, last + 1);
        last = message.id;
        assert!(last < FIRST + PUSHED - 1, "the client was not cut off");
    }
    let snapshot = Stream::open(&server, Some(last)).next().unwrap();
    assert_eq!((snapshot.kind.as_str(), snapshot.id), ("snapshot", FIRST + PUSHED - 1));
    assert_eq!(snapshot.data["status"]["view"], PUSHED - 1);
}
