//! Focus measure of a picture (Tenengrad): a figure to focus by.

use crate::silhouette::Picture;
use rayon::prelude::*;

/// Sharpness: the mean square of the gradient of the brightness over the square of its mean, per square pixel; 0 for a picture
/// without light. It grows as a lens is brought into focus, and does not change with the light. Only pictures of one scene, of
/// one size and with one noise can be compared. Gradients are Sobel's, of the mean of the channels.
///
/// Source: "Tenengrad", GRA6 of Pertuz, Puig and Garcia, Analysis of focus measure operators for shape-from-focus, Pattern
/// Recognition 46 (2013), 1415–1432; there it is not divided by the light.
pub fn sharpness(picture: &Picture) -> f64 {
    let (width, height, channels) = (picture.width(), picture.height(), picture.channels());
    let line = |row: usize| -> Vec<i32> {
        let bytes = &picture.data()[row * width * channels..(row + 1) * width * channels];
        bytes.chunks_exact(channels).map(|pixel| pixel.iter().map(|v| i32::from(*v)).sum()).collect()
    };
    // Whole numbers: the same on any number of cores.
    let (light, squares) = (1..height - 1)
        .into_par_iter()
        .map(|row| {
            let [above, here, below] = [row - 1, row, row + 1].map(line);
            let mut sums = (0u64, 0u64);
            for x in 1..width - 1 {
                let across = above[x + 1] + 2 * here[x + 1] + below[x + 1]
                    - (above[x - 1] + 2 * here[x - 1] + below[x - 1]);
                let down =
                    below[x - 1] + 2 * below[x] + below[x + 1] - (above[x - 1] + 2 * above[x] + above[x + 1]);
                sums.0 += u64::from(here[x].unsigned_abs());
                sums.1 += u64::from((across * across + down * down).unsigned_abs());
            }
            sums
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if light == 0 {
        return 0.0;
    }
    // Sobel's weights add up to eight for a slope of one a pixel.
    let pixels = ((width - 2) * (height - 2)) as f64;
    let mean = light as f64 / pixels;
    squares as f64 / 64.0 / pixels / (mean * mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(width: usize, height: usize, channels: usize, level: impl Fn(usize, usize) -> u8) -> Picture {
        let pixel = |k: usize| level(k % width, k / width);
        let data = (0..width * height).flat_map(|k| vec![pixel(k); channels]).collect();
        Picture::new(width, height, channels, data).unwrap()
    }

    #[test]
    fn an_even_slope_has_the_square_of_its_steepness_over_its_light() {
        // 50 in the middle, 2 a pixel.
        let across = slope(17, 20, 1, |x, _| (34 + 2 * x) as u8);
        assert!((sharpness(&across) - (2.0_f64 / 50.0).powi(2)).abs() < 1e-15);
        let down = slope(20, 17, 3, |_, y| (34 + 2 * y) as u8);
        assert!((sharpness(&down) - (2.0_f64 / 50.0).powi(2)).abs() < 1e-15);
        for flat in [0, 255] {
            assert_eq!(sharpness(&slope(16, 16, 3, |_, _| flat)).to_bits(), 0.0_f64.to_bits());
        }
    }

    #[test]
    fn a_blurred_edge_is_less_sharp_and_light_does_not_count() {
        let edge = |wide: usize, light: usize| {
            let ramp = move |x: usize| (light * (x.clamp(20, 20 + wide) - 20) / wide + light) as u8;
            sharpness(&slope(60, 20, 1, move |x, _| ramp(x)))
        };
        assert!(edge(2, 100) > 1.5 * edge(4, 100) && edge(4, 100) > 1.5 * edge(8, 100));
        assert!((edge(4, 100) / edge(4, 40) - 1.0).abs() < 1e-12);
    }
}
