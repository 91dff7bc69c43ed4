//! From the camera's bytes to pixels: all of them, or those that are looked at.

use super::Encoding;
use super::jpeg::Jpeg;
use crate::silhouette::{Grid, Picture, SilhouetteError, Source, ToneCurve};
use image::{ImageFormat, ImageReader, Limits};
use std::borrow::Cow;
use std::io::Cursor;
use std::ops::Range;

/// A photograph in which the grain can be looked for: large JPEGs as cameras write them stay as they are and are
/// decoded where they are looked at, all others are decoded already.
#[derive(Debug, Clone)]
pub struct Photograph {
    form: Form,
    tone_curve: Option<ToneCurve>,
}

#[derive(Debug, Clone)]
enum Form {
    /// Looked through once.
    Jpeg(Jpeg),
    /// Decoded.
    Pixels(Picture),
}

impl Photograph {
    /// Takes a file in.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn open(bytes: &[u8]) -> Result<Self, String> {
        let tone_curve = stated_tone_curve(bytes);
        // A file that is in any way unusual, or damaged, is the general decoder's to judge.
        if Encoding::sniff(bytes) == Some(Encoding::Jpeg)
            && is_ended(bytes)
            && let Some(jpeg) = Jpeg::read(bytes)
        {
            return Ok(Self { form: Form::Jpeg(jpeg), tone_curve });
        }
        Ok(Self { form: Form::Pixels(decode(bytes)?), tone_curve })
    }

    fn source(&self) -> &dyn Source {
        match &self.form {
            Form::Jpeg(jpeg) => jpeg,
            Form::Pixels(picture) => picture,
        }
    }
}

impl Source for Photograph {
    fn shape(&self) -> [usize; 3] {
        self.source().shape()
    }

    fn tone_curve(&self) -> Option<ToneCurve> {
        self.tone_curve
    }

    fn at_hand(&self) -> Option<&Picture> {
        self.source().at_hand()
    }

    fn pixels(&self) -> Result<Cow<'_, Picture>, SilhouetteError> {
        self.source().pixels()
    }

    fn grid(&self, columns: &Range<usize>, rows: &Range<usize>) -> Grid {
        self.source().grid(columns, rows)
    }

    fn cells(&self, grid: &Grid) -> Result<Vec<Vec<f32>>, SilhouetteError> {
        self.source().cells(grid)
    }

    fn weighted(&self, columns: &Range<usize>, rows: &Range<usize>, weights: [i16; 3]) -> Vec<i16> {
        self.source().weighted(columns, rows, weights)
    }

    fn part(&self, columns: &Range<usize>, rows: &Range<usize>) -> Vec<u8> {
        self.source().part(columns, rows)
    }
}

/// Bytes at a file's beginning in which it says how it is coded.
const HEAD: usize = 1 << 16;

/// The tone curve that a file states: a PNG in words, a JPEG by being a camera's (Exif) or by having a colour profile, all
/// common ones of which are coded by sRGB's curve or one close to it.
fn stated_tone_curve(bytes: &[u8]) -> Option<ToneCurve> {
    let head = &bytes[..bytes.len().min(HEAD)];
    match Encoding::sniff(bytes)? {
        Encoding::Jpeg => {
            let says = |mark: &[u8]| memchr::memmem::find(head, mark).is_some();
            (says(b"Exif\0\0") || says(b"ICC_PROFILE\0")).then_some(ToneCurve::Srgb)
        }
        Encoding::Png => {
            // Length, name, data and check of each chunk, up to the pixels (PNG 3, 5.3).
            let mut rest = head.get(8..)?;
            let mut gamma = None;
            while let [a, b, c, d, n0, n1, n2, n3, data @ ..] = rest {
                let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
                match &[*n0, *n1, *n2, *n3] {
                    b"sRGB" | b"iCCP" => return Some(ToneCurve::Srgb),
                    b"gAMA" => gamma = data.get(..4).and_then(|v| v.try_into().ok()).map(u32::from_be_bytes),
                    b"IDAT" => break,
                    _ => {}
                }
                rest = data.get(length.checked_add(4)?..)?;
            }
            // 100000 times the exponent that made the file from light.
            match gamma? {
                95_000..=105_000 => Some(ToneCurve::Linear),
                40_000..=60_000 => Some(ToneCurve::Srgb),
                _ => None,
            }
        }
        Encoding::Tiff => None,
    }
}

/// No camera in view has more than this many bytes of pixels; a header that claims more is a lie.
const MOST_BYTES: u64 = 1 << 30;

/// Decodes a JPEG, PNG or TIFF into grey or colour pixels of 8 bits.
///
/// # Errors
/// The decoder's reason: an unknown kind of file, a truncated one, or one that claims more than 1 GiB.
pub fn decode(bytes: &[u8]) -> Result<Picture, String> {
    if bytes.is_empty() {
        return Err("the file is empty (0 bytes)".into());
    }
    let format = match Encoding::sniff(bytes) {
        Some(Encoding::Jpeg) => {
            // The decoder fills what a cut-off file lacks with grey: it reports no damage.
            if !is_ended(bytes) {
                return Err("the JPEG is truncated: it has no end marker".into());
            }
            ImageFormat::Jpeg
        }
        Some(Encoding::Png) => ImageFormat::Png,
        Some(Encoding::Tiff) => ImageFormat::Tiff,
        None => return Err("it is no JPEG, PNG or TIFF file".into()),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    limits.max_image_width = Some(1 << 16);
    limits.max_image_height = Some(1 << 16);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| e.to_string())?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let (channels, data) = if picture.color().has_color() {
        (3, picture.into_rgb8().into_raw())
    } else {
        (1, picture.into_luma8().into_raw())
    };
    let picture = Picture::new(width, height, channels, data).map_err(|e| e.to_string())?;
    Ok(picture.coded(stated_tone_curve(bytes)))
}

/// Whether a JPEG has its end marker; some cameras fill the file up with zeros after it.
fn is_ended(bytes: &[u8]) -> bool {
    let filled = bytes.iter().rev().take_while(|b| **b == 0).count();
    bytes[..bytes.len() - filled].ends_with(&[0xff, 0xd9])
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, GrayImage, RgbImage};

    fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        picture.write_to(&mut out, format).unwrap();
        out.into_inner()
    }

    #[test]
    fn a_file_that_says_how_it_codes_light_is_heard() {
        let grey = DynamicImage::from(GrayImage::from_fn(40, 30, |x, y| image::Luma([(x * 5 + y) as u8])));
        let png = encoded(&grey, ImageFormat::Png);
        let with = |name: &[u8], data: &[u8]| {
            // After the header's chunk: 8 bytes of signature, 25 of the chunk; nobody checks the sum here.
            let mut bytes = png[..33].to_vec();
            bytes.extend((data.len() as u32).to_be_bytes());
            [name, data, &[0; 4], &png[33..]].iter().for_each(|part| bytes.extend_from_slice(part));
            bytes
        };
        assert_eq!(stated_tone_curve(&png), None);
        assert_eq!(stated_tone_curve(&with(b"sRGB", &[0])), Some(ToneCurve::Srgb));
        assert_eq!(stated_tone_curve(&with(b"gAMA", &100_000u32.to_be_bytes())), Some(ToneCurve::Linear));
        assert_eq!(stated_tone_curve(&with(b"gAMA", &45_455u32.to_be_bytes())), Some(ToneCurve::Srgb));
        let jpeg = encoded(&grey, ImageFormat::Jpeg);
        assert_eq!(stated_tone_curve(&jpeg), None);
        let camera = [&jpeg[..2], &[0xff, 0xe1, 0, 8], b"Exif\0\0", &jpeg[2..]].concat();
        assert_eq!(stated_tone_curve(&camera), Some(ToneCurve::Srgb));
        for cut in 0..png.len().min(80) {
            stated_tone_curve(&with(b"gAMA", &[0, 0])[..cut]);
        }
    }

    #[test]
    fn grey_and_colour_come_through_and_damage_is_reported() {
        let grey = DynamicImage::from(GrayImage::from_fn(40, 30, |x, y| image::Luma([(x * 5 + y) as u8])));
        let colour = DynamicImage::from(RgbImage::from_fn(40, 30, |x, y| image::Rgb([x as u8, y as u8, 7])));
        let p = decode(&encoded(&grey, ImageFormat::Png)).unwrap();
        assert_eq!((p.width(), p.height(), p.channels()), (40, 30, 1));
        assert_eq!(p.data()[41], 6);
        let jpeg = encoded(&colour, ImageFormat::Jpeg);
        assert_eq!(decode(&jpeg).unwrap().channels(), 3);
        for cut in [0, 1, 2, 10, jpeg.len() / 2, jpeg.len() - 1] {
            assert!(decode(&jpeg[..cut]).is_err(), "{cut} of {} bytes were taken for a picture", jpeg.len());
        }
        let png = encoded(&grey, ImageFormat::Png);
        assert!(decode(&png[..png.len() / 2]).is_err());
        assert!(decode(b"hello").is_err());
    }
}
