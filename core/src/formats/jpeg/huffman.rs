//! Huffman codes and the bits they are read from (ITU-T T.81, annexes C and F).

/// Bits by which the next symbols are looked up when their values are not wanted.
const SKIP_BITS: u32 = 13;
/// Bits by which one symbol, with its value, is looked up.
const READ_BITS: u32 = 11;
/// Added to the position in a block by a lookup that meets the block's end.
const END: u32 = 128;
/// The same for a lookup without result.
const NOTHING: u32 = 255;
/// Coefficients in a block.
const BLOCK: u32 = 64;

/// Reads bits, the first ones highest.
#[derive(Debug, Clone)]
pub(super) struct Bits<'a> {
    data: &'a [u8],
    next: usize,
    /// The next bits, left-aligned.
    held: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    /// From the bit `position` of data that go on for at least [`Bits::AHEAD`] bytes after what is coded.
    pub(super) fn new(data: &'a [u8], position: usize) -> Self {
        let mut bits = Self { data, next: position / 8, held: 0, count: 0 };
        bits.fill();
        bits.drop_bits((position % 8) as u32);
        bits
    }

    /// Bytes that may be looked at after the last one that is coded.
    pub(super) const AHEAD: usize = 64;

    /// Holds at least 56 bits; zeros where the data have ended.
    #[inline]
    fn fill(&mut self) {
        let word = match self.data.get(self.next..self.next + 8) {
            Some(word) => u64::from_be_bytes(word.try_into().unwrap_or_default()),
            None => 0,
        };
        self.held |= word >> self.count;
        self.next += ((63 - self.count) >> 3) as usize;
        self.count |= 0b11_1000;
    }

    /// The next `n` bits, 1 to 32.
    #[inline]
    fn peek(&self, n: u32) -> usize {
        (self.held >> (64 - n)) as usize
    }

    #[inline]
    fn drop_bits(&mut self, n: u32) {
        self.held <<= n;
        self.count = self.count.wrapping_sub(n);
    }

    /// The value of `size` further bits (T.81, F.2.2.1, EXTEND).
    #[inline]
    fn value(&mut self, size: u32) -> i32 {
        let raw = (self.held >> 1 >> (63 - size)) as i32;
        self.drop_bits(size);
        // A leading 0 stands for a negative value.
        let positive = raw >> size.saturating_sub(1);
        if positive == 0 && size > 0 { raw + 1 - (1 << size) } else { raw }
    }

    /// Bits read so far.
    pub(super) fn position(&self) -> usize {
        8 * self.next - self.count as usize
    }
}

/// A canonical Huffman code.
#[derive(Debug, Clone)]
pub(super) struct Code {
    symbols: Vec<u8>,
    /// For each length 1 … 16: 16 bits that are less than this begin with a code of at most that length.
    ends: [u32; 16],
    /// What to add to a code of each length to get the symbol's index.
    offsets: [i32; 16],
}

impl Code {
    /// From the number of codes of each length 1 … 16 and the symbols in order; `None` where there are more
    /// codes than such lengths allow.
    pub(super) fn new(counts: [u8; 16], symbols: &[u8]) -> Option<Self> {
        let (mut ends, mut offsets) = ([0; 16], [0; 16]);
        let (mut code, mut index) = (0u32, 0i32);
        for (k, &count) in counts.iter().enumerate() {
            offsets[k] = index - code as i32;
            code += u32::from(count);
            index += i32::from(count);
            ends[k] = code << (15 - k);
            if code > 1 << (k + 1) {
                return None;
            }
            code <<= 1;
        }
        (index as usize == symbols.len()).then(|| Self { symbols: symbols.to_vec(), ends, offsets })
    }

    /// Length and symbol of the code that 16 bits begin with.
    fn first(&self, bits: u32) -> Option<(u32, u8)> {
        let k = self.ends.iter().position(|&end| bits < end)?;
        let code = (bits >> (15 - k)) as i32;
        let index = usize::try_from(code + self.offsets[k]).ok()?;
        Some((k as u32 + 1, *self.symbols.get(index)?))
    }

    /// For each of the next `bits` bits: what comes first, where its code is that short.
    fn table(&self, bits: u32) -> Vec<Option<(u32, u8)>> {
        let short = |k: u32| self.first(k << (16 - bits)).filter(|(length, _)| *length <= bits);
        (0..1 << bits).map(short).collect()
    }
}

/// Reads the mean values of blocks.
pub(super) struct Means {
    code: Code,
    table: Vec<Option<(u32, u8)>>,
}

impl Means {
    /// Bits of a mean value's difference, at most.
    const MOST: u8 = 11;

    pub(super) fn new(code: &Code) -> Self {
        Self { code: code.clone(), table: code.table(READ_BITS) }
    }

    /// By how much the next block's mean differs from the last one's; holds at least 28 bits afterwards.
    #[inline]
    pub(super) fn read(&self, bits: &mut Bits) -> Option<i32> {
        bits.fill();
        let (length, size) = match self.table[bits.peek(READ_BITS)] {
            Some(found) => found,
            None => self.code.first(bits.peek(16) as u32)?,
        };
        if size > Self::MOST {
            return None;
        }
        bits.drop_bits(length);
        Some(bits.value(size.into()))
    }
}

/// Passes over the other coefficients of blocks, several at a time.
pub(super) struct Skip {
    code: Code,
    /// For each of the next bits: low byte, how many bits are passed over; above, by how many coefficients.
    table: Vec<u32>,
}

impl Skip {
    pub(super) fn new(code: &Code) -> Self {
        let one = code.table(SKIP_BITS);
        let entry = |start: usize| {
            let (mut bits, mut coefficients) = (0u32, 0u32);
            // The bits of a value need not be seen, so the last one may reach beyond the looked-up bits.
            while bits < SKIP_BITS {
                let rest = start << bits & ((1 << SKIP_BITS) - 1);
                let Some((length, symbol)) = one[rest].filter(|(length, _)| bits + length <= SKIP_BITS)
                else {
                    break;
                };
                let Some(passed) = coefficients_of(symbol) else { break };
                if passed != END && coefficients + passed >= BLOCK {
                    break;
                }
                bits += length + u32::from(symbol & 15);
                coefficients += passed;
                if passed == END {
                    break;
                }
            }
            if bits == 0 { NOTHING << 8 } else { bits | coefficients << 8 }
        };
        Self { code: code.clone(), table: (0..1 << SKIP_BITS).map(entry).collect() }
    }

    /// Passes over the rest of a block, whose mean value has just been read.
    #[inline]
    pub(super) fn block(&self, bits: &mut Bits) -> Option<()> {
        let mut at = 1;
        loop {
            for fill in [true, false] {
                let entry = self.table[bits.peek(SKIP_BITS)];
                let next = at + (entry >> 8);
                if next >= BLOCK {
                    if next == BLOCK || (END..END + BLOCK).contains(&next) {
                        bits.drop_bits(entry & 255);
                        return Some(());
                    }
                    return self.rest(bits, at);
                }
                bits.drop_bits(entry & 255);
                at = next;
                // A lookup takes at most 13 + 15 bits, so that 56 are enough for two.
                if fill {
                    bits.fill();
                }
            }
        }
    }

    /// The same, one coefficient at a time: where a code is long, or several codes reach into the next block.
    #[inline(never)]
    fn rest(&self, bits: &mut Bits, mut at: u32) -> Option<()> {
        while at < BLOCK {
            bits.fill();
            let (length, symbol) = self.code.first(bits.peek(16) as u32)?;
            bits.drop_bits(length + u32::from(symbol & 15));
            at += coefficients_of(symbol)?;
            if at >= END {
                return Some(());
            }
        }
        (at == BLOCK).then_some(())
    }
}

/// By how many coefficients a symbol goes on, [`END`] for the block's end; `None` where it means nothing.
fn coefficients_of(symbol: u8) -> Option<u32> {
    match symbol {
        0x00 => Some(END),
        // Sixteen zeros.
        0xf0 => Some(16),
        _ => (symbol & 15 > 0).then_some(u32::from(symbol >> 4) + 1),
    }
}

/// Reads the other coefficients of blocks.
pub(super) struct Values {
    code: Code,
    table: Vec<Option<(u32, u8)>>,
}

impl Values {
    pub(super) fn new(code: &Code) -> Self {
        Self { code: code.clone(), table: code.table(READ_BITS) }
    }

    /// Gives `put` the index (in zigzag order) and value of each coefficient of a block that is not 0.
    #[inline]
    pub(super) fn block(&self, bits: &mut Bits, mut put: impl FnMut(usize, i32)) -> Option<()> {
        let mut at = 1;
        while at < BLOCK {
            bits.fill();
            let (length, symbol) = match self.table[bits.peek(READ_BITS)] {
                Some(found) => found,
                None => self.code.first(bits.peek(16) as u32)?,
            };
            bits.drop_bits(length);
            let size = u32::from(symbol & 15);
            if size == 0 {
                at += coefficients_of(symbol)?;
                continue;
            }
            at += u32::from(symbol >> 4);
            if at >= BLOCK {
                return None;
            }
            put(at as usize, bits.value(size));
            at += 1;
        }
        Some(())
    }
}
