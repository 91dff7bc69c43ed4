//! One pass over all entropy-coded data: the mean of every block, and where every unit begins.

use super::header::Header;
use super::huffman::{Bits, Means, Skip};
use memchr::memchr;

/// The means of one component's blocks.
#[derive(Debug, Clone)]
pub(super) struct BlockMeans {
    /// Blocks across, whole units.
    pub width: usize,
    /// `[row, column]`: quantised.
    pub values: Vec<i16>,
}

/// The result of one pass over the data.
#[derive(Debug, Clone)]
pub(super) struct Scan {
    /// The coded data without the zeros stuffed after each byte of ones, and without markers.
    pub data: Vec<u8>,
    /// `[row, column]`: the bit of `data` at which each unit begins.
    pub units: Vec<u32>,
    /// For each component.
    pub means: Vec<BlockMeans>,
}

impl Scan {
    /// Passes over the data. `None` where they are damaged, or go on after the last unit.
    pub(super) fn read(bytes: &[u8], header: &Header) -> Option<Self> {
        let (data, ends) = unstuffed(bytes.get(header.data..)?)?;
        let [across, down] = header.units();
        u32::try_from(8 * data.len()).ok()?;
        let mut units = Vec::with_capacity(across * down);
        let mut means: Vec<BlockMeans> = (header.components.iter())
            .map(|c| BlockMeans {
                width: across * c.blocks[0],
                values: vec![0; across * c.blocks[0] * down * c.blocks[1]],
            })
            .collect();
        let codes: Vec<(Means, Skip, [usize; 2])> =
            (header.components.iter()).map(|c| (Means::new(&c.dc), Skip::new(&c.ac), c.blocks)).collect();
        let mut bits = Bits::new(&data, 0);
        let mut last = vec![0i32; codes.len()];
        let mut ends = ends.into_iter();
        let mut end = ends.next()?;
        let mut until_restart = header.restart;
        for row in 0..down {
            if bits.position() > 8 * data.len() {
                // The header promises more than there is.
                return None;
            }
            for column in 0..across {
                if header.restart > 0 {
                    if until_restart == 0 {
                        ends_at(&bits, end)?;
                        bits = Bits::new(&data, 8 * end);
                        end = ends.next()?;
                        last.fill(0);
                        until_restart = header.restart;
                    }
                    until_restart -= 1;
                }
                units.push(bits.position() as u32);
                for (((mean, skip, blocks), out), last) in codes.iter().zip(&mut means).zip(&mut last) {
                    for y in 0..blocks[1] {
                        for x in 0..blocks[0] {
                            *last += mean.read(&mut bits)?;
                            let at = (row * blocks[1] + y) * out.width + column * blocks[0] + x;
                            out.values[at] = i16::try_from(*last).ok()?;
                            skip.block(&mut bits)?;
                        }
                    }
                }
            }
        }
        ends_at(&bits, end)?;
        ends.next().is_none().then_some(Self { data, units, means })
    }
}

/// Whether all whole bytes up to `end` have been read.
fn ends_at(bits: &Bits, end: usize) -> Option<()> {
    (bits.position().div_ceil(8) == end).then_some(())
}

/// The coded data up to the end-of-image marker as the coder made them, and where each part between restart
/// markers ends. `None` where another marker comes in between.
fn unstuffed(coded: &[u8]) -> Option<(Vec<u8>, Vec<usize>)> {
    let mut data = Vec::with_capacity(coded.len() + Bits::AHEAD);
    let mut ends = Vec::new();
    let mut rest = coded;
    loop {
        let at = memchr(0xff, rest)?;
        data.extend_from_slice(&rest[..at]);
        match *rest.get(at + 1)? {
            0 => data.push(0xff),
            marker @ 0xd0..=0xd7 => {
                if usize::from(marker - 0xd0) != ends.len() % 8 {
                    return None;
                }
                ends.push(data.len());
            }
            0xd9 => break,
            _ => return None,
        }
        rest = &rest[at + 2..];
    }
    ends.push(data.len());
    data.resize(data.len() + Bits::AHEAD, 0);
    Some((data, ends))
}
