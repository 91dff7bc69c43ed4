//! Erosion and dilation of masks by squares, 64 pixels at a time.
//!
//! A square is a row of pixels after a column of them, and a row of 2r + 1 set pixels is told by and-ing a line with itself moved on by
//! 1, 2, 4 … pixels. Packed into bits a mask of six million pixels is 0.75 MB, which stays in a core's own cache: what a pass costs is
//! reading the mask once and writing it once, whatever the radius.

use super::mask::Mask;

/// Pixels in a word.
const BITS: usize = 64;

impl Mask {
    /// Pixels whose whole square of half width `radius` is set; what lies outside the rectangle is set.
    pub(super) fn eroded(&self, radius: usize) -> Self {
        self.shrunk(radius, 0)
    }

    /// Pixels whose square of half width `radius` holds a set one.
    pub(super) fn dilated(&self, radius: usize) -> Self {
        self.shrunk(radius, u64::MAX)
    }

    /// With the gaps filled that no square of half width `radius` fits into; nothing is taken away.
    pub(super) fn closed(&self, radius: usize) -> Self {
        self.dilated(radius).eroded(radius)
    }

    /// Erosion of what is set, or of what is not where `flip` has all bits.
    fn shrunk(&self, radius: usize, flip: u64) -> Self {
        let (w, h) = (self.width, self.height);
        let side = 2 * radius + 1;
        // Words of set pixels before and behind each row, and rows of them above and below.
        let (aside, words) = (radius.div_ceil(BITS), w.div_ceil(BITS));
        let mut line = vec![u64::MAX; aside + words + aside + 1];
        let mut rows = vec![u64::MAX; (h + 2 * radius) * words];
        let middle = &mut rows[radius * words..(radius + h) * words];
        for (out, row) in middle.chunks_exact_mut(words.max(1)).zip(self.bits.chunks_exact(w.max(1))) {
            pack(row, flip, &mut line[aside..aside + words]);
            line[aside + words..].fill(u64::MAX);
            line[..aside].fill(u64::MAX);
            for step in doublings(side) {
                for k in 0..line.len() {
                    line[k] &= from(&line, k * BITS + step);
                }
            }
            for (k, out) in out.iter_mut().enumerate() {
                *out = from(&line, (aside + k) * BITS - radius);
            }
        }
        for step in doublings(side) {
            for k in 0..rows.len() - step * words {
                rows[k] &= rows[k + step * words];
            }
        }
        let mut bits = vec![0; w * h];
        for (out, row) in bits.chunks_exact_mut(w.max(1)).zip(rows.chunks_exact(words.max(1))) {
            unpack(row, flip, out);
        }
        Self { width: w, height: h, bits }
    }
}

/// 64 bits of a line from a bit on; what lies behind its end is set.
fn from(line: &[u64], bit: usize) -> u64 {
    let (word, by) = (bit / BITS, bit % BITS);
    let at = |k: usize| line.get(k).copied().unwrap_or(u64::MAX);
    if by == 0 { at(word) } else { at(word) >> by | at(word + 1) << (BITS - by) }
}

/// Bytes of 0 or 1 into bits, flipped; the bits behind the last are set.
fn pack(bytes: &[u8], flip: u64, words: &mut [u64]) {
    let (whole, rest) = bytes.as_chunks::<BITS>();
    for (word, bytes) in words.iter_mut().zip(whole) {
        *word = gathered(bytes) ^ flip;
    }
    if !rest.is_empty() {
        let mut padded = [0; BITS];
        padded[..rest.len()].copy_from_slice(rest);
        words[whole.len()] = gathered(&padded) ^ flip | u64::MAX << rest.len();
    }
}

fn gathered(bytes: &[u8; BITS]) -> u64 {
    let (eights, _) = bytes.as_chunks::<8>();
    // The lowest bit of each of eight bytes comes into the highest byte.
    let packed = |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    eights.iter().enumerate().fold(0, |bits, (k, eight)| bits | packed(eight) << (8 * k))
}

/// Bits, flipped, into bytes of 0 or 1.
fn unpack(words: &[u64], flip: u64, bytes: &mut [u8]) {
    let (whole, rest) = bytes.as_chunks_mut::<BITS>();
    for (bytes, word) in whole.iter_mut().zip(words) {
        *bytes = spread(word ^ flip);
    }
    if let Some(word) = words.get(whole.len()) {
        let length = rest.len();
        rest.copy_from_slice(&spread(word ^ flip)[..length]);
    }
}

fn spread(bits: u64) -> [u8; BITS] {
    let mut out = [0; BITS];
    let (eights, _) = out.as_chunks_mut::<8>();
    for (eight, bits) in eights.iter_mut().zip(bits.to_le_bytes()) {
        // Byte n keeps bit n, then becomes 1 where that is set.
        let kept = u64::from(bits).wrapping_mul(0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
        *eight = (((kept + 0x7f7f_7f7f_7f7f_7f7f) >> 7) & 0x0101_0101_0101_0101).to_le_bytes();
    }
    out
}

/// Steps after which a value and-ed with the one a step on has taken in `side` values: 1, 2, 4 …, and the rest.
fn doublings(side: usize) -> impl Iterator<Item = usize> {
    let mut reached = 1;
    std::iter::from_fn(move || {
        let step = reached.min(side - reached);
        reached += step;
        (step > 0).then_some(step)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By its definition.
    fn dilated(mask: &Mask, radius: usize) -> Mask {
        let mut out = Mask::empty(mask.width, mask.height);
        for (k, bit) in out.bits.iter_mut().enumerate() {
            let (x, y) = (k % mask.width, k / mask.width);
            let columns = x.saturating_sub(radius)..(x + radius + 1).min(mask.width);
            let mut rows = y.saturating_sub(radius)..(y + radius + 1).min(mask.height);
            *bit = u8::from(rows.any(|y| columns.clone().any(|x| mask.get(x, y))));
        }
        out
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]
        #[test]
        fn dilation_and_erosion_are_what_their_squares_hold(
            (w, h) in (1_usize..150, 1_usize..40),
            radius in 0_usize..80,
            set in proptest::collection::vec((0_usize..150, 0_usize..40), 0..12),
        ) {
            let mut mask = Mask::empty(w, h);
            set.iter().filter(|(x, y)| *x < w && *y < h).for_each(|(x, y)| mask.bits[y * w + x] = 1);
            prop_assert_eq!(mask.dilated(radius), dilated(&mask, radius));
            prop_assert_eq!(mask.complement().eroded(radius), dilated(&mask, radius).complement());
        }
    }
}
