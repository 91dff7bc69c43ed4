//! The event stream over HTTP: no gap, no repeat.

use std::num::NonZeroUsize;

use grainrig::server::ServeOptions;
use grainrig::session::event::EventKind;

use crate::rig::{FIRST, Server, client};
use crate::sse::Stream;

/// Opens the stream of a server after the event `last`.
pub fn open(server: &Server, last: Option<u64>) -> Stream {
    Stream::open(client().get(server.url("/api/v1/events")), last)
}

#[test]
fn a_new_client_gets_a_snapshot_and_then_every_event() {
    let server = Server::start();
    server.rig.happened(EventKind::Started { session: "quartz".into(), views: 25, already_captured: 3 });
    let mut stream = open(&server, None);
    let snapshot = stream.next().unwrap();
    assert_eq!((snapshot.id, snapshot.kind.as_str()), (FIRST, "snapshot"));
    assert_eq!(snapshot.data["seq"], FIRST);
    assert_eq!(snapshot.data["status"]["captured"], 3);
    server.rig.happened(EventKind::Moving { view: 3, target_deg: 21.6 });
    let moving = stream.next().unwrap();
    assert_eq!((moving.id, moving.kind.as_str()), (FIRST + 1, "moving"));
    assert_eq!(moving.data["target_deg"], 21.6);
    assert_eq!(moving.data["seq"], FIRST + 1);
}

#[test]
fn a_client_that_comes_back_gets_what_it_missed() {
    let server = Server::start();
    for view in 0..5 {
        server.rig.happened(EventKind::Moving { view, target_deg: 0.0 });
    }
    let mut stream = open(&server, Some(FIRST + 1));
    for id in FIRST + 2..FIRST + 5 {
        let message = stream.next().unwrap();
        assert_eq!((message.id, message.kind.as_str()), (id, "moving"));
    }
    // `after` does the same where no header can be sent; the header goes before it.
    let url = server.url(&format!("/api/v1/events?after={FIRST}"));
    let reply = client().get(url).header("last-event-id", (FIRST + 3).to_string()).call().unwrap();
    let mut stream = Stream::of(reply);
    assert_eq!(stream.next().unwrap().id, FIRST + 4);
    let reply = client().get(server.url(&format!("/api/v1/events?after={FIRST}"))).call().unwrap();
    let mut stream = Stream::of(reply);
    assert_eq!(stream.next().unwrap().id, FIRST + 1);
}

#[test]
fn a_number_of_an_earlier_daemon_gets_a_snapshot() {
    let server = Server::start();
    server.rig.happened(EventKind::Homed);
    for unknown in [1, FIRST - 2, FIRST + 1, u64::MAX] {
        let first = open(&server, Some(unknown)).next().unwrap();
        assert_eq!((first.id, first.kind.as_str()), (FIRST, "snapshot"), "{unknown}");
    }
    let reply =
        client().get(server.url("/api/v1/events")).header("last-event-id", "no number").call().unwrap();
    let mut stream = Stream::of(reply);
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
                    rig.happened(EventKind::Moving { view: view as usize, target_deg: 0.0 });
                }
            })
        })
        .collect();
    let mut last = FIRST - 1;
    while last < FIRST + PUSHED - 1 {
        let mut stream = open(&server, Some(last));
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
    let mut slow = open(&server, None);
    assert_eq!(slow.next().unwrap().kind, "snapshot");
    // Far more than the sockets between us hold: if pushing waited for the reader, this would not end.
    for view in 0..PUSHED {
        server.rig.happened(EventKind::Moving { view: view as usize, target_deg: 0.0 });
    }
    let mut last = FIRST - 1;
    while let Some(message) = slow.next() {
        assert_eq!(message.id, last + 1);
        last = message.id;
        assert!(last < FIRST + PUSHED - 1, "the client was not cut off");
    }
    let snapshot = open(&server, Some(last)).next().unwrap();
    assert_eq!((snapshot.kind.as_str(), snapshot.id), ("snapshot", FIRST + PUSHED - 1));
    assert_eq!(snapshot.data["status"]["view"], PUSHED - 1);
}
