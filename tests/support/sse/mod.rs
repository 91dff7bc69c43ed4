//! A client of the event stream, as a browser reads it.

// Each test file uses its own part of this.
#![allow(dead_code)]

use serde_json::Value;
use std::io::{BufRead as _, BufReader};
use ureq::http::Response;
use ureq::typestate::WithoutBody;
use ureq::{Body, RequestBuilder};

/// One message of the event stream.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    pub id: u64,
    pub kind: String,
    pub data: Value,
}

/// An open event stream.
pub struct Stream(BufReader<ureq::BodyReader<'static>>);

impl Stream {
    /// Opens the stream after the event `last`; from now on without.
    pub fn open(request: RequestBuilder<WithoutBody>, last: Option<u64>) -> Self {
        let request = match last {
            Some(last) => request.header("last-event-id", last.to_string()),
            None => request,
        };
        let response = request.call().unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self::of(response)
    }

    /// The stream that an answer carries.
    pub fn of(response: Response<Body>) -> Self {
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

    /// Every message up to the first of this kind, that one included.
    pub fn until(&mut self, kind: &str) -> Vec<Message> {
        let mut all = Vec::new();
        loop {
            let message = self.next().unwrap_or_else(|| panic!("the stream ended before `{kind}`: {all:#?}"));
            let is_end = ["failed", "aborted", "complete"].contains(&message.kind.as_str());
            all.push(message);
            let last = &all[all.len() - 1];
            if last.kind == kind {
                return all;
            }
            assert!(!is_end, "the run ended before `{kind}`: {last:?}");
        }
    }
}
