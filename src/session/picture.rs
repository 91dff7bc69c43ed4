//! Whether a picture file is whole: looked at before it is archived.

use crate::rig::Encoding;
use image::{ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Most pixels along one side.
const SIDE_LIMIT: u32 = 32_768;
/// Most memory for one decoded picture, bytes.
const MEMORY_LIMIT: u64 = 1 << 30;

/// Most bytes of a picture file: 100 Mpx as 16-bit colour TIFF come to 600 MB.
pub(super) const FILE_LIMIT: u64 = 1 << 30;

/// Why a picture file cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PictureFault {
    /// No bytes at all.
    #[error("the picture has 0 bytes; check the camera's connection, or remove the file")]
    Empty,
    /// Too large to be a photograph.
    #[error("the picture has {bytes} bytes, the limit is {FILE_LIMIT}; export it smaller")]
    TooLarge {
        /// Its size.
        bytes: u64,
    },
    /// No picture file that is known.
    #[error("the picture begins with {0}, which is neither JPEG, PNG nor TIFF; set the camera to JPEG")]
    Unknown(String),
    /// The end is missing.
    #[error("the picture of {bytes} bytes lacks its end ({end}): it is cut off; take or copy it again")]
    CutOff {
        /// Its size.
        bytes: usize,
        /// What it should end with.
        end: &'static str,
    },
    /// It does not decode.
    #[error("the picture does not decode ({0}); take or copy it again")]
    Undecodable(String),
    /// It is of another size than the others.
    #[error(
        "the picture has {width} × {height} px, the others have {others_width} × {others_height} px; use one camera setting for all"
    )]
    OtherSize {
        /// Its width, px.
        width: u32,
        /// Its height, px.
        height: u32,
        /// The others' width, px.
        others_width: u32,
        /// The others' height, px.
        others_height: u32,
    },
}

impl PictureFault {
    /// The fault of bytes that no picture file begins with.
    pub(super) fn unknown(bytes: &[u8]) -> Self {
        Self::Unknown(format!("{:02x?}", &bytes[..bytes.len().min(4)]))
    }
}

/// Width and height, pixels.
pub type Size = [u32; 2];

/// Looks at a picture's beginning and end without decoding it: its kind and size. Where the others' size is
/// given it must have it.
///
/// # Errors
/// [`PictureFault`] where it is empty, unknown, cut off or of another size.
pub fn probe(bytes: &[u8], others: Option<Size>) -> Result<(Encoding, Size), PictureFault> {
    if bytes.is_empty() {
        return Err(PictureFault::Empty);
    }
    let encoding = Encoding::sniff(bytes).ok_or_else(|| PictureFault::unknown(bytes))?;
    // Some cameras fill the file up with zeros after its end.
    let filled = bytes.iter().rev().take_while(|&&b| b == 0).count();
    let (end, name): (&[u8], _) = match encoding {
        Encoding::Jpeg => (&[0xff, 0xd9], "JPEG marker FF D9"),
        Encoding::Png => (b"IEND\xaeB`\x82", "PNG chunk IEND"),
        // A TIFF has no end: its directory may stand anywhere.
        Encoding::Tiff => (&[], ""),
    };
    if !bytes[..bytes.len() - filled].ends_with(end) {
        return Err(PictureFault::CutOff { bytes: bytes.len(), end: name });
    }
    let undecodable = |e: image::ImageError| PictureFault::Undecodable(e.to_string());
    let (width, height) = reader(bytes, encoding).into_dimensions().map_err(undecodable)?;
    if width == 0 || height == 0 || width > SIDE_LIMIT || height > SIDE_LIMIT {
        let what = format!("{width} × {height} px, each side must have 1 to {SIDE_LIMIT}");
        return Err(PictureFault::Undecodable(what));
    }
    match others {
        Some([others_width, others_height]) if [width, height] != [others_width, others_height] => {
            Err(PictureFault::OtherSize { width, height, others_width, others_height })
        }
        _ => Ok((encoding, [width, height])),
    }
}

/// As [`probe`], and decodes the whole picture to see that it can be.
///
/// # Errors
/// As [`probe`], and where it does not decode.
pub fn decode_check(bytes: &[u8], others: Option<Size>) -> Result<(Encoding, Size), PictureFault> {
    let found = probe(bytes, others)?;
    reader(bytes, found.0).decode().map_err(|e| PictureFault::Undecodable(e.to_string()))?;
    Ok(found)
}

fn reader(bytes: &[u8], encoding: Encoding) -> ImageReader<Cursor<&[u8]>> {
    let format = match encoding {
        Encoding::Jpeg => ImageFormat::Jpeg,
        Encoding::Png => ImageFormat::Png,
        Encoding::Tiff => ImageFormat::Tiff,
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_LIMIT);
    limits.max_image_height = Some(SIDE_LIMIT);
    limits.max_alloc = Some(MEMORY_LIMIT);
    reader.limits(limits);
    reader
}
