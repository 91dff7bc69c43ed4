//! The pixels, the small copy and the silhouettes of this decoder beside those of the general one.

use super::*;
use crate::formats::{Photograph, decode};
use crate::silhouette::{Settings, find};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

const SAMPLINGS: [SamplingFactor; 4] =
    [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_1_2, SamplingFactor::F_2_2];

/// A smooth picture with a round dark grain in it and a little noise.
fn pixels([width, height]: [usize; 2], channels: usize) -> Vec<u8> {
    let (cx, cy, r) = (0.4 * width as f64, 0.5 * height as f64, 0.3 * height as f64);
    let mut seed = 7u32;
    (0..width * height)
        .flat_map(|k| {
            let (x, y) = ((k % width) as f64, (k / width) as f64);
            let part = ((x - cx).hypot(y - cy) - r).clamp(0.0, 1.0);
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(seed >> 24) / 64.0 - 2.0;
            let shade = 20.0 * x / width as f64;
            [200.0, 180.0, 150.0].map(|v| (60.0 + part * (v - 60.0) + shade + noise).clamp(0.0, 255.0) as u8)
        })
        .enumerate()
        .filter(|(k, _)| channels == 3 || k % 3 == 0)
        .map(|(_, v)| v)
        .collect()
}

fn encoded(size: [usize; 2], channels: usize, change: impl FnOnce(&mut Encoder<&mut Vec<u8>>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 92);
    change(&mut encoder);
    let colour = if channels == 1 { ColorType::Luma } else { ColorType::Rgb };
    encoder.encode(&pixels(size, channels), size[0] as u16, size[1] as u16, colour).unwrap();
    bytes
}

#[test]
fn pixels_and_cells_are_those_of_the_general_decoder() {
    // Sizes that end within a block and within a unit.
    let size = [2411, 67];
    let mut files = vec![encoded(size, 1, |_| ())];
    files.extend(SAMPLINGS.map(|s| encoded(size, 3, |e| e.set_sampling_factor(s))));
    files.push(encoded(size, 3, |e| {
        e.set_sampling_factor(SamplingFactor::F_2_2);
        e.set_restart_interval(37);
    }));
    for (k, file) in files.iter().enumerate() {
        let jpeg = Jpeg::read(file).unwrap_or_else(|| panic!("file {k}"));
        let (own, other) = (jpeg.pixels().unwrap().into_owned(), decode(file).unwrap());
        assert_eq!(jpeg.shape(), other.shape());
        let off = own.data().iter().zip(other.data()).map(|(a, b)| a.abs_diff(*b));
        // Decoders may differ by a level in the transform and by a little more where colours are sharp.
        let (most, sum) = off.fold((0, 0u64), |(most, sum), d| (most.max(d), sum + u64::from(d)));
        assert!(most <= 12 && sum * 2 < own.data().len() as u64, "file {k}: {most}, {sum}");

        let (columns, rows) = (37..2203, 9..61);
        for weights in [[5, 9, 2], [16, 0, -16], [0, -16, 0]] {
            let weights = if jpeg.shape()[2] == 1 { [5, 9, 2] } else { weights };
            assert_eq!(jpeg.weighted(&columns, &rows, weights), own.weighted(&columns, &rows, weights));
        }
        let grid = jpeg.grid(&(0..size[0]), &(0..size[1]));
        assert_eq!(grid, Grid { factor: 8, origin: [0, 0], size: [301, 8] });
        for (means, other) in jpeg.cells(&grid).unwrap().iter().zip(other.cells(&grid).unwrap()) {
            let off = means.iter().zip(&other).map(|(a, b)| f64::from((a - b).abs()));
            assert!(off.sum::<f64>() < 1.5 * other.len() as f64, "file {k}");
        }
        // The empty stage may have to be laid over the cells of a picture of another kind.
        let odd = Grid { factor: 5, origin: [3, 1], size: [400, 12] };
        assert_eq!(jpeg.cells(&odd).unwrap(), own.cells(&odd).unwrap());
    }
}

#[test]
fn what_is_damaged_or_of_another_kind_is_left_to_the_general_decoder() {
    let size = [2400, 40];
    let good = encoded(size, 3, |e| e.set_restart_interval(50));
    assert!(Jpeg::read(&good).is_some());
    assert!(Jpeg::read(&encoded([1200, 40], 3, |_| ())).is_none(), "small");
    assert!(Jpeg::read(&encoded(size, 3, |e| e.set_progressive(true))).is_none(), "progressive");
    assert!(
        Jpeg::read(&encoded(size, 3, |e| e.set_sampling_factor(SamplingFactor::F_4_1))).is_none(),
        "4:1:0"
    );
    // This encoder optimises its codes in a scan for each colour.
    assert!(Jpeg::read(&encoded(size, 3, |e| e.set_optimized_huffman_tables(true))).is_none(), "three scans");
    for cut in (0..good.len()).step_by(97) {
        assert!(Jpeg::read(&good[..cut]).is_none(), "{cut} of {} bytes", good.len());
    }
    // Any byte may be wrong: what is taken all the same has pixels, and nothing panics.
    let mut seed = 1u32;
    for _ in 0..3000 {
        let mut bad = good.clone();
        for _ in 0..2 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = (seed >> 8) as usize % if seed.is_multiple_of(2) { 700 } else { bad.len() };
            bad[at] = (seed >> 3) as u8;
        }
        if let Some(jpeg) = Jpeg::read(&bad) {
            let [width, height, _] = jpeg.shape();
            jpeg.weighted(&(width - 60..width), &(0..height.min(40)), [5, 9, 2]);
        }
    }
}

#[test]
fn a_black_frame_is_cut_off_as_in_the_decoded_picture() {
    let size = [2400, 640];
    for lines in [1, 3, 8, 21] {
        let mut data = pixels(size, 1);
        for (k, v) in data.iter_mut().enumerate() {
            if k % size[0] < lines || k / size[0] + lines >= size[1] {
                *v = 12;
            }
        }
        let mut bytes = Vec::new();
        Encoder::new(&mut bytes, 95).encode(&data, size[0] as u16, size[1] as u16, ColorType::Luma).unwrap();
        let photograph = Photograph::open(&bytes).unwrap();
        assert!(photograph.at_hand().is_none());
        let settings = Settings::default();
        let found = find(&photograph, None, &settings).unwrap().report.frame;
        assert_eq!(found, find(&decode(&bytes).unwrap(), None, &settings).unwrap().report.frame);
        assert!(found[0] >= lines && found[3] + lines <= size[1], "{found:?}");
    }
}
