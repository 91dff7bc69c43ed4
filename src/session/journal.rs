//! The journal's codec: bytes to records and back, without I/O.
//!
//! A record is one line of JSON. `prev` is the hash of the record before (of `manifest.json` for the first),
//! `hash` is the SHA-256 of the line as it stands in the file without the `hash` member itself. The text is
//! hashed, not the values, so that no reader has to write numbers the way this program does.
//!
//! ```text
//! manifest.json ─sha256─▶ {"seq":0,…,"prev":"m"  ,"hash":"a"}\n
//!                         {"seq":1,…,"prev":"a"  ,"hash":"b"}\n
//!                         {"seq":2,…,"pre            ◀─ torn: no line end, the program was killed here
//! ```

use super::disk::sha256_hex;
use super::event::{Event, EventKind};
use jiff::Timestamp;

/// `,"hash":"` + 64 digits + `"}`.
const SEAL: usize = 9 + 64 + 2;
/// What stands before and after the hash.
const SEAL_BEGINS: &str = ",\"hash\":\"";
const SEAL_ENDS: &str = "\"}";
/// A longer line is not one of ours: it would only fill the memory.
const LONGEST_LINE: usize = 16 << 20;

/// Where a chain of records stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chain {
    next_seq: u64,
    prev: String,
}

impl Chain {
    /// The beginning of a chain; `manifest` is the manifest's bytes.
    pub fn new(manifest: &[u8]) -> Self {
        Self { next_seq: 0, prev: sha256_hex(manifest) }
    }

    /// The next record: its line, and the event as a reader of that line gets it. The chain moves on only
    /// by [`Self::advance`], once the line is written.
    ///
    /// # Errors
    /// Why the event would not be read back (a number that is not finite, say).
    pub fn encode(&self, time: Timestamp, what: EventKind) -> Result<Record, String> {
        let event = Event { seq: self.next_seq, time, what };
        let mut value = super::to_json_value(&event).map_err(|e| e.to_string())?;
        value["prev"] = serde_json::Value::String(self.prev.clone());
        let body = value.to_string();
        let hash = sha256_hex(body.as_bytes());
        let open = &body[..body.len() - 1];
        let line = format!("{open},\"hash\":\"{hash}\"}}\n");
        if line.len() > LONGEST_LINE {
            return Err(format!("it has {} bytes, the limit is {LONGEST_LINE}", line.len()));
        }
        let event = serde_json::from_str(&line).map_err(|e| e.to_string())?;
        Ok(Record { event, hash, line })
    }

    /// Moves on past a record.
    pub fn advance(&mut self, record: &Record) {
        self.next_seq = record.event.seq + 1;
        self.prev.clone_from(&record.hash);
    }

    /// Reads the next line (without its line end) and moves on.
    fn decode(&mut self, line: &[u8]) -> Result<Record, Unreadable> {
        let text = self.sealed(line).map_err(Unreadable::Damaged)?;
        // The line is whole and in its place: whoever wrote it knows a kind of event, or a field, that this program does not.
        let event: Event = serde_json::from_str(text).map_err(|e| Unreadable::Unknown(e.to_string()))?;
        if event.seq != self.next_seq {
            let reason = format!("its number is {}, {} is due", event.seq, self.next_seq);
            return Err(Unreadable::Damaged(reason));
        }
        let hash = &text[text.len() - SEAL + SEAL_BEGINS.len()..text.len() - SEAL_ENDS.len()];
        let record = Record { event, hash: hash.to_owned(), line: format!("{text}\n") };
        self.advance(&record);
        Ok(record)
    }

    /// The text of a line that has its own hash and follows the one before it.
    fn sealed<'a>(&self, line: &'a [u8]) -> Result<&'a str, String> {
        let text = std::str::from_utf8(line).map_err(|e| format!("it is not UTF-8 ({e})"))?;
        let cut = text.len().checked_sub(SEAL).filter(|&at| text.is_char_boundary(at));
        let (open, seal) = text.split_at(cut.ok_or("it is too short for a record")?);
        let hash = seal
            .strip_prefix(SEAL_BEGINS)
            .and_then(|s| s.strip_suffix(SEAL_ENDS))
            .ok_or("it does not end with its hash")?;
        let found = sha256_hex(format!("{open}}}").as_bytes());
        if found != hash {
            return Err(format!("its SHA-256 is {found}, the line says {hash}"));
        }
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
        if value["prev"] != self.prev.as_str() {
            let before = if self.next_seq == 0 { "manifest.json" } else { "the line before" };
            return Err(format!("it does not follow {before}, which was changed, removed or added"));
        }
        Ok(text)
    }
}

/// Why a line is no record.
enum Unreadable {
    /// It is not what was written.
    Damaged(String),
    /// It is what was written, by a program that knows more than this one.
    Unknown(String),
}

/// A record of the journal.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// What happened.
    pub event: Event,
    /// SHA-256 of the line without its `hash` member, hexadecimal.
    pub hash: String,
    /// The line, with its end.
    pub line: String,
}

/// Damage that is no torn last line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Line number, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
    /// Whether it is as it was written, by a version that knows more than this one.
    pub is_newer: bool,
}

/// Reads a journal: push bytes as they come, pull records.
#[derive(Debug)]
pub struct Decoder {
    chain: Chain,
    pending: Vec<u8>,
    line: usize,
    good_bytes: u64,
    damaged: bool,
}

impl Decoder {
    /// A decoder at the beginning of the chain.
    pub fn new(chain: Chain) -> Self {
        Self { chain, pending: Vec::new(), line: 0, good_bytes: 0, damaged: false }
    }

    /// Takes the next bytes of the file.
    pub fn push(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    /// The next whole record, or `None` where more bytes are needed, or after damage.
    ///
    /// # Errors
    /// [`Damage`] at the first line that is not what was written; nothing follows it.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> Option<Result<Record, Damage>> {
        if self.damaged {
            return None;
        }
        let found = match self.pending.iter().position(|&b| b == b'\n') {
            None if self.pending.len() <= LONGEST_LINE => return None,
            None => Err(Unreadable::Damaged(format!("it has more than {LONGEST_LINE} bytes"))),
            Some(end) => {
                let line: Vec<u8> = self.pending.drain(..=end).collect();
                self.chain.decode(&line[..end])
            }
        };
        self.line += 1;
        Some(match found {
            Ok(record) => {
                self.good_bytes += record.line.len() as u64;
                Ok(record)
            }
            Err(why) => {
                self.damaged = true;
                let is_newer = matches!(why, Unreadable::Unknown(_));
                let (Unreadable::Damaged(reason) | Unreadable::Unknown(reason)) = why;
                Err(Damage { line: self.line, reason, is_newer })
            }
        })
    }

    /// At the end of the file: where the chain stands, how many bytes hold whole records, and how many
    /// bytes of a torn last line follow them (0 where there is none).
    pub fn finish(self) -> (Chain, u64, usize) {
        (self.chain, self.good_bytes, self.pending.len())
    }
}
