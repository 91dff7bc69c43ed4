//! Frames on a stream of bytes: length, kind, bytes, checksum.
//!
//! ```text
//!  length  u32  of the bytes, little-endian
//!  kind    u8
//!  bytes   [u8; length]
//!  check   u32  CRC-32 (IEEE 802.3) of kind and bytes
//! ```

use std::io::{Error, ErrorKind, Read, Result, Write};

/// Longest frame: the RAW file of a camera with 100 million pixels.
const LONGEST: u32 = 256 << 20;

/// A kind of frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A message, as JSON.
    Message = 1,
    /// The bytes of a file, as the camera has them.
    File = 2,
}

fn checksum(kind: u8, bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&[kind]);
    hasher.update(bytes);
    hasher.finalize()
}

/// Writes a frame and flushes it.
///
/// # Errors
/// The stream's, and [`ErrorKind::InvalidInput`] where it has more than 256 MiB.
pub(super) fn write(to: &mut impl Write, kind: Kind, bytes: &[u8]) -> Result<()> {
    let length = u32::try_from(bytes.len()).ok().filter(|l| *l <= LONGEST);
    let length = length.ok_or_else(|| Error::new(ErrorKind::InvalidInput, too_long(bytes.len())))?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(&[kind as u8])?;
    to.write_all(bytes)?;
    to.write_all(&checksum(kind as u8, bytes).to_le_bytes())?;
    to.flush()
}

fn too_long(bytes: impl std::fmt::Display) -> String {
    format!("a frame of {bytes} bytes, the limit is {LONGEST}")
}

/// Reads the next frame; `None` at the end of the stream.
///
/// # Errors
/// The stream's; [`ErrorKind::InvalidData`] for a frame that is too long, of no known kind or damaged, after which
/// nothing on the stream can be trusted.
pub(super) fn read(from: &mut impl Read) -> Result<Option<(Kind, Vec<u8>)>> {
    let mut head = [0; 5];
    loop {
        match from.read(&mut head[..1]) {
            Ok(0) => return Ok(None),
            Ok(_) => break from.read_exact(&mut head[1..])?,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    let damaged = |what: String| Error::new(ErrorKind::InvalidData, what);
    let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]);
    if length > LONGEST {
        return Err(damaged(too_long(length)));
    }
    let kind = match head[4] {
        1 => Kind::Message,
        2 => Kind::File,
        other => return Err(damaged(format!("a frame of kind {other}, which there is not"))),
    };
    // Grown as the bytes come: a damaged length asks for no memory.
    let mut bytes = Vec::new();
    from.take(u64::from(length)).read_to_end(&mut bytes)?;
    if bytes.len() < length as usize {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    let mut check = [0; 4];
    from.read_exact(&mut check)?;
    if u32::from_le_bytes(check) != checksum(head[4], &bytes) {
        return Err(damaged("a frame whose checksum is wrong".to_owned()));
    }
    Ok(Some((kind, bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn frames_come_back_one_after_the_other(frames in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 0..6)) {
            let mut stream = Vec::new();
            for bytes in &frames {
                write(&mut stream, Kind::File, bytes).unwrap();
            }
            let mut from = &stream[..];
            for bytes in frames {
                prop_assert_eq!(read(&mut from).unwrap(), Some((Kind::File, bytes)));
            }
            prop_assert_eq!(read(&mut from).unwrap(), None);
        }

        #[test]
        fn a_stream_with_one_byte_changed_or_cut_off_is_an_error_and_no_other_frame(
            bytes in prop::collection::vec(any::<u8>(), 0..300), at in any::<prop::sample::Index>(), flip in 1u8..,
        ) {
            let mut stream = Vec::new();
            write(&mut stream, Kind::Message, &bytes).unwrap();
            let at = at.index(stream.len());
            prop_assert!(at == 0 || read(&mut &stream[..at]).is_err());
            stream[at] ^= flip;
            prop_assert!(read(&mut &stream[..]).is_err());
        }
    }
}
