//! What an operation is answered with.

use super::wire::Bytes;

/// Response codes (PTP, ISO 15740, clause 11.3).
pub mod code {
    pub const OK: u16 = 0x2001;
    pub const GENERAL_ERROR: u16 = 0x2002;
    pub const NOT_SUPPORTED: u16 = 0x2005;
    pub const NO_SUCH_OBJECT: u16 = 0x2009;
    pub const NO_SUCH_PROPERTY: u16 = 0x200a;
    pub const STORE_FULL: u16 = 0x200c;
    pub const NO_THUMBNAIL: u16 = 0x2010;
    pub const BUSY: u16 = 0x2019;
    pub const BAD_VALUE: u16 = 0x201c;
}

/// What an operation comes to.
pub enum Answer {
    Reply(Reply),
    /// Nothing, ever.
    Silence,
    /// The connection ends.
    HangUp,
    /// It ends when half of the data are through.
    Torn(Reply),
}

/// A response, with the data that go before it.
pub struct Reply {
    pub code: u16,
    pub parameters: Vec<u32>,
    pub data: Option<Vec<u8>>,
}

impl Answer {
    pub fn code(code: u16) -> Self {
        Self::Reply(Reply { code, parameters: Vec::new(), data: None })
    }
    pub fn ok() -> Self {
        Self::code(code::OK)
    }
    pub fn data(data: Bytes) -> Self {
        Self::Reply(Reply { code: code::OK, parameters: Vec::new(), data: Some(data.0) })
    }
    pub fn value(value: u32) -> Self {
        Self::Reply(Reply { code: code::OK, parameters: vec![value], data: None })
    }
}
