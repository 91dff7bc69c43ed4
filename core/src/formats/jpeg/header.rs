//! The header of a JPEG: what stands before its entropy-coded data (ITU-T T.81, annex B).

use super::huffman::Code;

/// One colour component.
#[derive(Debug, Clone)]
pub(super) struct Component {
    /// Blocks across and down in a unit (MCU).
    pub blocks: [usize; 2],
    /// Quantisation steps in zigzag order.
    pub steps: [u16; 64],
    /// Code of the mean values (DC).
    pub dc: Code,
    /// Code of the other coefficients (AC).
    pub ac: Code,
}

/// The headers of a JPEG of the kind that cameras write.
#[derive(Debug, Clone)]
pub(super) struct Header {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Brightness, then blue and red chrominance where there is colour.
    pub components: Vec<Component>,
    /// Units between restart markers; 0 where there are none.
    pub restart: usize,
    /// Where the entropy-coded data begin.
    pub data: usize,
}

/// A component as the frame header names it.
struct Framed {
    id: u8,
    blocks: [usize; 2],
    steps: usize,
}

impl Header {
    /// Reads up to the first scan. `None` where the file is damaged or of another kind: progressive, lossless,
    /// arithmetic coding, 12 bits, scans of single colours, other colours than grey and YCbCr, or chrominance
    /// at less than half the resolution.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let mut steps: [Option<[u16; 64]>; 4] = [None; 4];
        let mut codes: [[Option<Code>; 4]; 2] = Default::default();
        let mut frame: Option<([usize; 2], Vec<Framed>)> = None;
        let mut restart = 0;
        let (mut jfif, mut adobe) = (false, None);
        let mut at = 2;
        loop {
            if *bytes.get(at)? != 0xff {
                return None;
            }
            let marker = *bytes.get(at + 1)?;
            if marker == 0xff {
                // Fill before a marker.
                at += 1;
                continue;
            }
            let length = word(bytes, at + 2)?;
            let part = bytes.get(at + 4..at + 2 + length)?;
            at += 2 + length;
            match marker {
                0xc0 | 0xc1 if frame.is_none() => frame = Some(read_frame(part)?),
                0xc4 => read_codes(part, &mut codes)?,
                0xdb => read_steps(part, &mut steps)?,
                0xdd => restart = word(part, 0)?,
                0xe0 if part.starts_with(b"JFIF\0") => jfif = true,
                0xee if part.starts_with(b"Adobe") => adobe = Some(*part.get(11)?),
                0xda => {
                    let (size, framed) = frame?;
                    let ids: Vec<u8> = framed.iter().map(|f| f.id).collect();
                    // Adobe's transform 1 is YCbCr, and so is what is not specified.
                    let ycbcr = jfif || adobe.map_or(ids != *b"RGB", |transform| transform == 1);
                    if ids.len() == 3 && !ycbcr {
                        return None;
                    }
                    let used = read_scan(part, &ids)?;
                    let components = (framed.iter().zip(used))
                        .map(|(f, [dc, ac])| {
                            Some(Component {
                                blocks: f.blocks,
                                steps: steps[f.steps]?,
                                dc: codes[0][dc].clone()?,
                                ac: codes[1][ac].clone()?,
                            })
                        })
                        .collect::<Option<Vec<_>>>()?;
                    return Some(Self { size, components, restart, data: at });
                }
                // Other kinds of frame; and markers without a length, which stand nowhere before the scan.
                0x00..=0xd9 => return None,
                _ => {}
            }
        }
    }

    /// Blocks across and down in a unit (MCU).
    pub(super) fn unit(&self) -> [usize; 2] {
        self.components[0].blocks
    }

    /// Units across and down.
    pub(super) fn units(&self) -> [usize; 2] {
        [0, 1].map(|k| self.size[k].div_ceil(8 * self.unit()[k]))
    }
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(*bytes.get(at)?) << 8 | usize::from(*bytes.get(at + 1)?))
}

fn read_frame(part: &[u8]) -> Option<([usize; 2], Vec<Framed>)> {
    let (precision, count) = (*part.first()?, usize::from(*part.get(5)?));
    let size = [word(part, 3)?, word(part, 1)?];
    if precision != 8 || size.contains(&0) || (count != 1 && count != 3) {
        return None;
    }
    let mut framed = (part.get(6..6 + 3 * count)?.chunks_exact(3))
        .map(|c| {
            let blocks = [usize::from(c[1] >> 4), usize::from(c[1] & 15)];
            (c[2] < 4).then_some(Framed { id: c[0], blocks, steps: usize::from(c[2]) })
        })
        .collect::<Option<Vec<_>>>()?;
    if let [grey] = &mut framed[..] {
        // A scan of one component goes block by block, whatever its sampling.
        grey.blocks = [1, 1];
    }
    let fits = |f: &Framed| {
        (f.blocks.iter().zip(framed[0].blocks)).all(|(&b, most)| b >= 1 && most <= 2 && most % b == 0)
    };
    framed.iter().all(fits).then_some((size, framed))
}

fn read_steps(mut part: &[u8], steps: &mut [Option<[u16; 64]>; 4]) -> Option<()> {
    while let [kind, rest @ ..] = part {
        let wide = usize::from(kind >> 4);
        let table = steps.get_mut(usize::from(kind & 15))?;
        let bytes = rest.get(..64 * (1 + wide))?;
        *table = Some(std::array::from_fn(|k| match wide {
            0 => u16::from(bytes[k]),
            _ => u16::from_be_bytes([bytes[2 * k], bytes[2 * k + 1]]),
        }));
        part = &rest[bytes.len()..];
    }
    Some(())
}

fn read_codes(mut part: &[u8], codes: &mut [[Option<Code>; 4]; 2]) -> Option<()> {
    while let [kind, rest @ ..] = part {
        let counts: [u8; 16] = rest.get(..16)?.try_into().ok()?;
        let symbols = rest.get(16..16 + counts.iter().map(|&c| usize::from(c)).sum::<usize>())?;
        let slot = codes.get_mut(usize::from(kind >> 4))?.get_mut(usize::from(kind & 15))?;
        *slot = Some(Code::new(counts, symbols)?);
        part = &rest[16 + symbols.len()..];
    }
    Some(())
}

/// The codes that each component uses: of mean values, of other coefficients.
fn read_scan(part: &[u8], ids: &[u8]) -> Option<Vec<[usize; 2]>> {
    if usize::from(*part.first()?) != ids.len() || part.len() != 4 + 2 * ids.len() {
        return None;
    }
    // All coefficients, with all their bits.
    if part[1 + 2 * ids.len()..] != [0, 63, 0] {
        return None;
    }
    (part[1..].chunks_exact(2).zip(ids))
        .map(|(c, &id)| {
            let used = [usize::from(c[1] >> 4), usize::from(c[1] & 15)];
            (c[0] == id && used.iter().all(|&k| k < 4)).then_some(used)
        })
        .collect()
}
