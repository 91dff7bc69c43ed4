//! The pictures' Exif block: a TIFF file of tags (Exif 2.32, section 4.6) with what importers look for.

/// A tag's value.
enum Value {
    Text(String),
    Short(u16),
    Long(u32),
    Ratio(u32, u32),
    Raw(&'static [u8]),
}

impl Value {
    /// The TIFF type number, the count and the bytes.
    fn parts(&self) -> (u16, u32, Vec<u8>) {
        match self {
            Self::Text(s) => (2, s.len() as u32 + 1, [s.as_bytes(), &[0]].concat()),
            Self::Short(x) => (3, 1, x.to_le_bytes().to_vec()),
            Self::Long(x) => (4, 1, x.to_le_bytes().to_vec()),
            Self::Ratio(a, b) => (5, 1, [a.to_le_bytes(), b.to_le_bytes()].concat()),
            Self::Raw(b) => (7, b.len() as u32, b.to_vec()),
        }
    }
}

/// The block for the `exposure`-th picture. Its date is made up (one second after another from noon of
/// 1 January 2026), so that the same exposure gives the same bytes.
pub fn block([width, height]: [usize; 2], exposure_s: f64, exposure: usize) -> Vec<u8> {
    let second = exposure % 43_200;
    let date = format!("2026:01:01 {:02}:{:02}:{:02}", 12 + second / 3600, second / 60 % 60, second % 60);
    let main = |sub: u32| {
        vec![
            (0x010f, Value::Text("grainrig".into())),
            (0x0110, Value::Text("simulated camera".into())),
            (0x0112, Value::Short(1)),
            (0x0132, Value::Text(date.clone())),
            (0x8769, Value::Long(sub)),
        ]
    };
    let details = vec![
        (0x829a, Value::Ratio((exposure_s * 1e6).round() as u32, 1_000_000)),
        (0x9000, Value::Raw(b"0232")),
        (0x9003, Value::Text(date.clone())),
        (0xa002, Value::Long(width as u32)),
        (0xa003, Value::Long(height as u32)),
    ];
    // Little-endian TIFF header; the first directory follows at 8.
    let mut out = b"II\x2a\0\x08\0\0\0".to_vec();
    let first = directory(8, &main(0)).len() as u32;
    out.extend(directory(8, &main(8 + first)));
    out.extend(directory(8 + first, &details));
    out
}

/// A directory that begins at `start`: its entries, then the values that do not fit into four bytes.
fn directory(start: u32, entries: &[(u16, Value)]) -> Vec<u8> {
    let mut out = (entries.len() as u16).to_le_bytes().to_vec();
    let mut beyond = Vec::new();
    let after = start + 2 + 12 * entries.len() as u32 + 4;
    for (tag, value) in entries {
        let (kind, count, mut bytes) = value.parts();
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(count.to_le_bytes());
        if bytes.len() <= 4 {
            bytes.resize(4, 0);
            out.extend(bytes);
        } else {
            out.extend((after + beyond.len() as u32).to_le_bytes());
            // Values begin at even places.
            bytes.resize(bytes.len().next_multiple_of(2), 0);
            beyond.extend(bytes);
        }
    }
    out.extend([0; 4]);
    out.extend(beyond);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_found_where_the_directory_says() {
        let b = block([640, 480], 0.02, 61);
        let u16_at = |i: usize| u16::from_le_bytes([b[i], b[i + 1]]);
        let u32_at = |i: usize| u32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]) as usize;
        let entry = |dir: usize, tag: u16| {
            (0..usize::from(u16_at(dir))).map(|k| dir + 2 + 12 * k).find(|&e| u16_at(e) == tag).unwrap()
        };
        let date = u32_at(entry(8, 0x0132) + 8);
        assert_eq!(&b[date..date + 20], b"2026:01:01 12:01:01\0");
        let sub = u32_at(entry(8, 0x8769) + 8);
        assert_eq!(u32_at(entry(sub, 0xa002) + 8), 640);
        let exposure = u32_at(entry(sub, 0x829a) + 8);
        assert_eq!((u32_at(exposure), u32_at(exposure + 4)), (20_000, 1_000_000));
    }
}
