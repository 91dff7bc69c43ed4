//! The pixels of some units: coefficients read again, and transformed back.

use super::header::{Component, Header};
use super::huffman::{Bits, Means, Values};
use super::planes::Samples;
use super::scan::Scan;
use rayon::prelude::*;
use std::ops::Range;

/// Column-major index of each coefficient in zigzag order (T.81, figure A.6).
const ZIGZAG: [usize; 64] = [
    0, 8, 1, 2, 9, 16, 24, 17, 10, 3, 4, 11, 18, 25, 32, 40, 33, 26, 19, 12, 5, 6, 13, 20, 27, 34, 41, 48,
    56, 49, 42, 35, 28, 21, 14, 7, 15, 22, 29, 36, 43, 50, 57, 58, 51, 44, 37, 30, 23, 31, 38, 45, 52, 59,
    60, 53, 46, 39, 47, 54, 61, 62, 55, 63,
];

/// How one component's blocks are read.
struct Reader {
    mean: Means,
    values: Values,
    /// What a coefficient in zigzag order counts, with the transform's own factors.
    steps: [f32; 64],
}

impl Reader {
    fn new(component: &Component) -> Self {
        // The factors that the transform leaves out: 1 along the first row and column, else √2·cos(kπ/16).
        let factor = |k: usize| match k {
            0 => 1.0,
            _ => std::f64::consts::SQRT_2 * (k as f64 * std::f64::consts::PI / 16.0).cos(),
        };
        let step = |(k, at): (usize, usize)| {
            (f64::from(component.steps[k]) * factor(at / 8) * factor(at % 8) / 8.0) as f32
        };
        let mut steps = [0.0; 64];
        steps.iter_mut().zip(ZIGZAG.into_iter().enumerate()).for_each(|(s, at)| *s = step(at));
        Self { mean: Means::new(&component.dc), values: Values::new(&component.ac), steps }
    }
}

/// Samples of all components in the units of these columns and rows of units.
///
/// What has been passed over once can be read: only a coefficient beyond the end of its block, which that pass
/// refuses too, would end it, and leaves the rest of its row at 0.
pub(super) fn samples(header: &Header, scan: &Scan, units: [&Range<usize>; 2]) -> Vec<Samples<u8>> {
    let readers: Vec<Reader> = header.components.iter().map(Reader::new).collect();
    let [across, down] = units.map(ExactSizeIterator::len);
    let mut planes: Vec<Samples<u8>> = (header.components.iter())
        .map(|c| Samples {
            origin: [0, 1].map(|k| units[k].start * 8 * c.blocks[k]),
            width: across * 8 * c.blocks[0],
            values: vec![0; across * 8 * c.blocks[0] * down * 8 * c.blocks[1]],
        })
        .collect();
    // One strip of each component for a row of units.
    let mut strips: Vec<Vec<&mut [u8]>> = (0..down).map(|_| Vec::new()).collect();
    for (plane, c) in planes.iter_mut().zip(&header.components) {
        let rows = plane.values.chunks_exact_mut(plane.width * 8 * c.blocks[1]);
        strips.iter_mut().zip(rows).for_each(|(strip, rows)| strip.push(rows));
    }
    strips.par_iter_mut().enumerate().for_each(|(k, strip)| {
        let row = units[1].start + k;
        let _ = read_row(header, scan, &readers, row, units[0], strip);
    });
    planes
}

fn read_row(
    header: &Header,
    scan: &Scan,
    readers: &[Reader],
    row: usize,
    columns: &Range<usize>,
    strip: &mut [&mut [u8]],
) -> Option<()> {
    let all = header.units()[0];
    let mut bits = Bits::new(&scan.data, 0);
    for (k, column) in columns.clone().enumerate() {
        let unit = row * all + column;
        // Between restart markers one unit follows the other.
        if k == 0 || (header.restart > 0 && unit.is_multiple_of(header.restart)) {
            bits = Bits::new(&scan.data, scan.units[unit] as usize);
        }
        for (((reader, c), means), out) in
            readers.iter().zip(&header.components).zip(&scan.means).zip(strip.iter_mut())
        {
            let width = out.len() / (8 * c.blocks[1]);
            for y in 0..c.blocks[1] {
                for x in 0..c.blocks[0] {
                    reader.mean.read(&mut bits)?;
                    let at = (row * c.blocks[1] + y) * means.width + column * c.blocks[0] + x;
                    let mut block = [0f32; 64];
                    block[0] = f32::from(means.values[at]) * reader.steps[0];
                    reader
                        .values
                        .block(&mut bits, |k, v| block[ZIGZAG[k & 63]] = v as f32 * reader.steps[k & 63])?;
                    back(&mut block);
                    let first = 8 * y * width + 8 * (k * c.blocks[0] + x);
                    for (row, levels) in block.chunks_exact(8).enumerate() {
                        let out = &mut out[first + row * width..][..8];
                        for (o, v) in out.iter_mut().zip(levels) {
                            *o = rounded(v + 128.0);
                        }
                    }
                }
            }
        }
    }
    Some(())
}

/// The nearest whole number from 0 to 255.
#[inline]
fn rounded(v: f32) -> u8 {
    // In 2²³ … 2²⁴ a number's last bits are its whole part.
    (v.clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
}

/// The inverse cosine transform of 8 × 8 values, but for the factors in the quantisation steps (Arai, Agui and
/// Nakajima 1988). Takes coefficients by columns and gives values by rows: each pass does eight lines at once.
#[inline]
fn back(block: &mut [f32; 64]) {
    columns(block);
    let turned: [f32; 64] = std::array::from_fn(|k| block[8 * (k % 8) + k / 8]);
    *block = turned;
    columns(block);
}

/// All eight columns at once.
#[inline]
fn columns(block: &mut [f32; 64]) {
    type Row = [f32; 8];
    let row = |k: usize| -> Row { std::array::from_fn(|x| block[8 * k + x]) };
    let add = |a: Row, b: Row| -> Row { std::array::from_fn(|x| a[x] + b[x]) };
    let sub = |a: Row, b: Row| -> Row { std::array::from_fn(|x| a[x] - b[x]) };
    let times = |a: Row, by: f32| -> Row { std::array::from_fn(|x| a[x] * by) };
    // Even part.
    let (sum, difference) = (add(row(0), row(4)), sub(row(0), row(4)));
    let middle = add(row(2), row(6));
    let other = sub(times(sub(row(2), row(6)), std::f32::consts::SQRT_2), middle);
    let (e0, e3) = (add(sum, middle), sub(sum, middle));
    let (e1, e2) = (add(difference, other), sub(difference, other));
    // Odd part.
    let (z13, z10) = (add(row(5), row(3)), sub(row(5), row(3)));
    let (z11, z12) = (add(row(1), row(7)), sub(row(1), row(7)));
    let o7 = add(z11, z13);
    let z5 = times(add(z10, z12), 1.847_759_1);
    let o6 = sub(sub(z5, times(z10, 2.613_126)), o7);
    let o5 = sub(times(sub(z11, z13), std::f32::consts::SQRT_2), o6);
    let o4 = sub(sub(z5, times(z12, 1.082_392_2)), o5);
    let rows = [
        add(e0, o7),
        add(e1, o6),
        add(e2, o5),
        add(e3, o4),
        sub(e3, o4),
        sub(e2, o5),
        sub(e1, o6),
        sub(e0, o7),
    ];
    for (out, row) in block.chunks_exact_mut(8).zip(rows) {
        out.copy_from_slice(&row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_of_cosines() {
        // A few coefficients, and the definition (T.81, A.3.3).
        let component = Component {
            blocks: [1, 1],
            steps: [1; 64],
            dc: super::super::huffman::Code::new([0; 16], &[]).unwrap(),
            ac: super::super::huffman::Code::new([0; 16], &[]).unwrap(),
        };
        let reader = Reader::new(&component);
        let coefficients = [(0, 40.0), (1, -13.0), (2, 9.0), (17, 21.0), (35, -30.0), (62, 11.0), (63, 5.0)];
        let mut block = [0f32; 64];
        for (k, v) in coefficients {
            block[ZIGZAG[k]] = v as f32 * reader.steps[k];
        }
        back(&mut block);
        for (at, value) in block.iter().enumerate() {
            let wave = |k: usize, x: usize| {
                let scale = if k == 0 { 0.5f64.sqrt() } else { 1.0 };
                scale * ((2 * x + 1) as f64 * k as f64 * std::f64::consts::PI / 16.0).cos()
            };
            let sum: f64 = (coefficients.iter())
                .map(|&(k, v)| v / 4.0 * wave(ZIGZAG[k] / 8, at % 8) * wave(ZIGZAG[k] % 8, at / 8))
                .sum();
            assert!((f64::from(*value) - sum).abs() < 1e-4, "{at}: {value}, not {sum}");
        }
        assert_eq!([-3.0, 0.4, 0.6, 254.6, 300.0].map(rounded), [0, 0, 1, 255, 255]);
    }
}
