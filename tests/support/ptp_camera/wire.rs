//! The bytes: PTP's little-endian values and strings, and PTP/IP's packets.

use std::io::{Error, ErrorKind, Read, Result, Write};

/// Kinds of packet (CIPA DC-005, table 4).
pub mod packet {
    pub const COMMAND_INIT: u32 = 1;
    pub const COMMAND_ACK: u32 = 2;
    pub const EVENT_INIT: u32 = 3;
    pub const EVENT_ACK: u32 = 4;
    pub const REQUEST: u32 = 6;
    pub const RESPONSE: u32 = 7;
    pub const EVENT: u32 = 8;
    pub const START_DATA: u32 = 9;
    pub const DATA: u32 = 10;
    pub const END_DATA: u32 = 12;
    pub const PING: u32 = 13;
    pub const PONG: u32 = 14;
}

/// Most bytes of one packet that a client may send: settings are small.
const LONGEST: usize = 1 << 20;

/// Values one after the other.
#[derive(Debug, Default, Clone)]
pub struct Bytes(pub Vec<u8>);

impl Bytes {
    pub fn new() -> Self {
        Self::default()
    }
    #[must_use]
    pub fn u8(mut self, v: u8) -> Self {
        self.0.push(v);
        self
    }
    #[must_use]
    pub fn u16(mut self, v: u16) -> Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    #[must_use]
    pub fn u32(mut self, v: u32) -> Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    #[must_use]
    pub fn u64(mut self, v: u64) -> Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    #[must_use]
    pub fn raw(mut self, v: &[u8]) -> Self {
        self.0.extend(v);
        self
    }
    #[must_use]
    pub fn all32(self, values: &[u32]) -> Self {
        values.iter().fold(self, |b, v| b.u32(*v))
    }
    /// An array: its length, then its values.
    #[must_use]
    pub fn array16(self, values: &[u16]) -> Self {
        values.iter().fold(self.u32(values.len() as u32), |b, v| b.u16(*v))
    }
    #[must_use]
    pub fn array32(self, values: &[u32]) -> Self {
        self.u32(values.len() as u32).all32(values)
    }
    /// A string: letters and their end counted, then UTF-16; nothing at all where it is empty.
    #[must_use]
    pub fn string(self, text: &str) -> Self {
        if text.is_empty() {
            return self.u8(0);
        }
        let count = text.encode_utf16().count() as u8 + 1;
        text.encode_utf16().chain([0]).fold(self.u8(count), Self::u16)
    }
    /// A name of single bytes with its end, filled up to a whole number of words.
    #[must_use]
    pub fn name(self, text: &str) -> Self {
        let fill = 4 - text.len() % 4;
        self.raw(text.as_bytes()).raw(&[0; 4][..fill])
    }
}

/// The value at an offset; what is missing counts as zero, as a sloppy camera would have it.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// The value at an offset.
pub fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]))
}

/// Sends a packet.
pub fn send(to: &mut impl Write, kind: u32, body: &[u8]) -> Result<()> {
    to.write_all(&Bytes::new().u32(body.len() as u32 + 8).u32(kind).raw(body).0)
}

/// Receives a packet: its kind and what it holds.
pub fn receive(from: &mut impl Read) -> Result<(u32, Vec<u8>)> {
    let mut head = [0; 8];
    from.read_exact(&mut head)?;
    let length = u32_at(&head, 0) as usize;
    if !(8..=LONGEST).contains(&length) {
        return Err(Error::from(ErrorKind::InvalidData));
    }
    let mut body = vec![0; length - 8];
    from.read_exact(&mut body)?;
    Ok((u32_at(&head, 4), body))
}
