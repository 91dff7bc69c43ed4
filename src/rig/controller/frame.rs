//! Frames of the controller's serial protocol (`firmware/PROTOCOL.md`): a line of ASCII with a mark, a sequence number and a
//! CRC-16, both ways. The firmware's half is `firmware/frame.c`; both read `firmware/vectors.txt` in their tests.

/// Longest frame, mark and line feed included.
pub const FRAME_MOST: usize = 64;

/// CRC-16/CCITT-FALSE: polynomial 0x1021, first 0xFFFF, neither mirrored nor inverted.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |crc, byte| {
        (0..8)
            .fold(crc ^ (u16::from(*byte) << 8), |c: u16, _| (c << 1) ^ if c >> 15 == 1 { 0x1021 } else { 0 })
    })
}

/// A frame that asks (`:`), as it goes over the line. The body is plain ASCII without `:`, at most 54 bytes.
pub fn request(seq: u8, body: &str) -> Vec<u8> {
    frame(':', seq, body)
}

fn frame(mark: char, seq: u8, body: &str) -> Vec<u8> {
    let text = format!("{seq:02X} {body}");
    format!("{mark}{text}*{:04X}\n", crc16(text.as_bytes())).into_bytes()
}

/// What the controller said.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Said {
    /// The answer to the request of this number.
    Reply {
        /// The request's number.
        seq: u8,
        /// `ok …` or `err …`.
        body: String,
    },
    /// Something that nobody asked for: that it has started, or that it got a damaged frame (`nak`).
    Announcement(String),
    /// A frame that is damaged or too long.
    Damaged,
}

/// Finds frames in a stream of bytes.
#[derive(Debug, Clone, Default)]
pub struct Reader {
    mark: Option<u8>,
    text: Vec<u8>,
}

impl Reader {
    /// Takes one byte; what it completes.
    pub fn take(&mut self, byte: u8) -> Option<Said> {
        if matches!(byte, b'=' | b'!') {
            // Wherever it comes, a frame begins: the one before was cut off.
            self.mark = Some(byte);
            self.text.clear();
            return None;
        }
        let mark = self.mark?;
        if byte == b'\n' {
            self.mark = None;
            return Some(whole(mark, &self.text).unwrap_or(Said::Damaged));
        }
        if !(b' '..=b'~').contains(&byte) || self.text.len() >= FRAME_MOST - 2 {
            self.mark = None;
            return Some(Said::Damaged);
        }
        self.text.push(byte);
        None
    }
}

fn whole(mark: u8, text: &[u8]) -> Option<Said> {
    let star = text.len().checked_sub(5).filter(|star| *star >= 3 && text[*star] == b'*')?;
    if hex(&text[star + 1..])? != crc16(&text[..star]) || text[2] != b' ' {
        return None;
    }
    let seq = u8::try_from(hex(&text[..2])?).ok()?;
    let body = String::from_utf8(text[3..star].to_vec()).ok()?;
    Some(if mark == b'=' { Said::Reply { seq, body } } else { Said::Announcement(body) })
}

/// Upper-case hexadecimal digits, and nothing else.
fn hex(digits: &[u8]) -> Option<u16> {
    digits.iter().try_fold(0u16, |n, d| {
        let value = match d {
            b'0'..=b'9' => d - b'0',
            b'A'..=b'F' => d - b'A' + 10,
            _ => return None,
        };
        Some(n << 4 | u16::from(value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8]) -> Vec<Said> {
        let mut reader = Reader::default();
        bytes.iter().filter_map(|b| reader.take(*b)).collect()
    }

    /// Lines of `request|reply|announcement|damaged`, tab, number, tab, body, tab, the frame with its line feed left out.
    fn vectors() -> Vec<[String; 4]> {
        include_str!("../../../firmware/vectors.txt")
            .lines()
            .filter(|l| !l.is_empty() && !l.starts_with('#'))
            .map(|l| l.splitn(4, '\t').map(str::to_owned).collect::<Vec<_>>().try_into().unwrap())
            .collect()
    }

    #[test]
    fn the_shared_vectors_hold() {
        let all = vectors();
        assert!(all.len() >= 12, "{}", all.len());
        for [kind, seq, body, line] in all {
            let bytes = format!("{line}\n").into_bytes();
            let number = || u8::from_str_radix(&seq, 16).unwrap();
            match kind.as_str() {
                "request" => assert_eq!(request(number(), &body), bytes, "{line}"),
                "reply" => assert_eq!(read(&bytes), [Said::Reply { seq: number(), body }], "{line}"),
                "announcement" => assert_eq!(read(&bytes), [Said::Announcement(body)], "{line}"),
                "damaged" => assert!(
                    read(&bytes.iter().map(|b| if *b == b':' { b'=' } else { *b }).collect::<Vec<_>>())
                        .iter()
                        .all(|s| *s == Said::Damaged),
                    "{line}"
                ),
                other => panic!("{other} is no kind of vector"),
            }
        }
    }

    #[test]
    fn the_crc_is_the_published_one() {
        assert_eq!(crc16(b"123456789"), 0x29b1);
    }

    proptest! {
        #[test]
        fn a_frame_is_read_after_any_garbage(
            garbage in proptest::collection::vec(any::<u8>(), 0..200),
            seq: u8,
            body in "[ -9;<>-~]{0,54}",
        ) {
            let bytes = [garbage, frame('=', seq, &body.replace(['=', '!'], "-"))].concat();
            let body = body.replace(['=', '!'], "-");
            prop_assert_eq!(read(&bytes).pop(), Some(Said::Reply { seq, body }));
        }

        #[test]
        fn one_changed_byte_is_seen(seq: u8, body in "[ a-z0-9]{0,54}", at: prop::sample::Index, flip in 1..=255u8) {
            let mut bytes = frame('=', seq, &body);
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            for said in read(&bytes) {
                prop_assert!(!matches!(said, Said::Reply { .. }), "{:?}", said);
            }
        }
    }
}
