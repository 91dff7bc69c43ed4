//! Voxel volumes in NRRD (Nearly Raw Raster Data, teem.sourceforge.net/nrrd/format.html), as 3D Slicer, Fiji, ITK and
//! scikit-image write them: a text header, an empty line, then the samples, x fastest.
//!
//! Read are three dimensions of numbers, raw or gzip, in one file, with cubic voxels whose axes are x, y and z.

use super::numbers::Kind;
use super::{ExportError, Format, Reads};
use std::io::Read as _;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "NRRD",
    endings: &["nrrd"],
    media_type: "application/octet-stream",
    reads: Some(Reads::Voxels(read)),
    writes: None,
};

/// The most voxels that are read: what is made of them takes some 9 bytes each, beside the file's own.
const MOST_VOXELS: usize = 400_000_000;

/// A volume of samples as the file has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Samples along x, y and z.
    pub size: [usize; 3],
    /// The edge of a voxel, where the file states it.
    pub pitch: Option<f64>,
    /// The centre of the first voxel; zeros where the file does not state it.
    pub origin: [f64; 3],
    /// The unit of lengths in the file's own words, where it states one.
    pub unit: Option<String>,
    kind: Kind,
    big_endian: bool,
    bytes: Vec<u8>,
}

impl Volume {
    /// The samples in the file's order, x fastest.
    pub fn samples(&self) -> impl Iterator<Item = f64> + '_ {
        // A chunk has the bytes of one sample.
        (self.bytes.chunks_exact(self.kind.size()))
            .filter_map(|sample| self.kind.read(sample, self.big_endian))
    }

    /// Halfway between the two values of a volume that has just two; `None` of any other.
    pub fn between_two_values(&self) -> Option<f64> {
        let mut values: Vec<f64> = Vec::new();
        for sample in self.samples() {
            // The same number, not nearly the same.
            if !values.iter().any(|v| v.total_cmp(&sample).is_eq()) {
                values.push(sample);
            }
            if values.len() > 2 {
                return None;
            }
        }
        let [first, second] = values.try_into().ok()?;
        Some(f64::midpoint(first, second))
    }
}

fn bad(what: String) -> ExportError {
    ExportError::Read { format: "NRRD", what }
}

/// Reads a volume.
///
/// # Errors
/// [`ExportError::Read`] for what is not such a file, with the field and its value.
pub fn read(file: &[u8]) -> Result<Volume, ExportError> {
    let (header, data) = split(file)?;
    let mut lines = header.lines();
    if !lines.next().is_some_and(|magic| magic.starts_with("NRRD000")) {
        return Err(bad("it does not begin with NRRD000".into()));
    }
    // A comment begins with #, a key and value of somebody's own has := between them.
    let fields: Vec<(String, &str)> = lines
        .filter(|l| !l.starts_with('#') && !l.contains(":="))
        .filter_map(|l| l.split_once(':'))
        .map(|(name, value)| (name.trim().to_ascii_lowercase(), value.trim()))
        .collect();
    let field = |names: &[&str]| fields.iter().find(|(n, _)| names.contains(&n.as_str())).map(|(_, v)| *v);
    let needed = |name: &str| field(&[name]).ok_or_else(|| bad(format!("it has no field `{name}`")));
    if let Some(name) = field(&["data file", "datafile"]) {
        return Err(bad(format!("its samples are in another file, `{name}`: save both as one .nrrd")));
    }
    let kind = needed("type")?;
    let kind = Kind::named(&kind.to_ascii_lowercase()).ok_or_else(|| {
        bad(format!("type `{kind}` is not read, only integers of up to 32 bits, float and double"))
    })?;
    if needed("dimension")? != "3" {
        return Err(bad(format!("dimension is {}, not 3: one number for each voxel", needed("dimension")?)));
    }
    let sizes = needed("sizes")?;
    let size: Vec<usize> = sizes.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    let size: [usize; 3] =
        size.try_into().map_err(|_| bad(format!("sizes `{sizes}` are not three counts")))?;
    let count =
        size.iter().try_fold(1usize, |n, s| n.checked_mul(*s)).filter(|n| (1..=MOST_VOXELS).contains(n));
    let count = count.ok_or_else(|| {
        bad(format!(
            "sizes `{sizes}` are none or more than {MOST_VOXELS} voxels: crop it, or halve its resolution"
        ))
    })?;
    let big_endian = match field(&["endian"]) {
        Some("big") => true,
        Some("little") => false,
        None if kind.size() == 1 => false,
        other => return Err(bad(format!("endian is `{}`, not little or big", other.unwrap_or("missing")))),
    };
    let expected = count * kind.size();
    let bytes = samples(needed("encoding")?, data, expected)?;
    if bytes.len() != expected {
        let than = if bytes.len() > expected { "more than" } else { "not" };
        return Err(bad(format!(
            "it holds {} bytes of samples, {than} the {expected} of {sizes} samples of {} bytes",
            bytes.len().min(expected + 1),
            kind.size()
        )));
    }
    let bad_sample = bytes
        .chunks_exact(kind.size())
        .enumerate()
        .filter_map(|(i, sample)| Some((i, kind.read(sample, big_endian)?)))
        .find(|(_, sample)| !sample.is_finite());
    if let Some((i, sample)) = bad_sample {
        return Err(bad(format!("sample {i} is {sample}, not a finite number")));
    }
    let origin = field(&["space origin"]).map_or(Ok([0.0; 3]), vector)?;
    // Units of three axes, each in quotation marks.
    let unit = field(&["space units", "units"])
        .and_then(|u| u.split('"').map(str::trim).find(|w| !w.is_empty()))
        .map(str::to_owned);
    let pitch = pitch(field(&["space directions"]), field(&["spacings"]))?;
    Ok(Volume { size, pitch, origin, unit, kind, big_endian, bytes })
}

/// The header, and what follows its empty line.
fn split(file: &[u8]) -> Result<(&str, &[u8]), ExportError> {
    let ends = [&b"\n\n"[..], b"\r\n\r\n"];
    let end = ends
        .iter()
        .filter_map(|end| Some((file.windows(end.len()).position(|w| w == *end)?, end.len())))
        .min()
        .ok_or_else(|| bad("no empty line ends its header".into()))?;
    let header = std::str::from_utf8(&file[..end.0]).map_err(|_| bad("its header is not text".into()))?;
    Ok((header, &file[end.0 + end.1..]))
}

/// The samples, decoded: at most one byte more than expected, however much the data would unpack to.
fn samples(encoding: &str, data: &[u8], expected: usize) -> Result<Vec<u8>, ExportError> {
    match encoding.to_ascii_lowercase().as_str() {
        "raw" => Ok(data.to_vec()),
        "gzip" | "gz" => {
            let mut out = Vec::new();
            flate2::read::MultiGzDecoder::new(data)
                .take(expected as u64 + 1)
                .read_to_end(&mut out)
                .map_err(|e| bad(format!("its gzip data does not unpack: {e}")))?;
            Ok(out)
        }
        other => Err(bad(format!("encoding `{other}` is not read: save it as raw or gzip"))),
    }
}

/// `(x,y,z)`.
fn vector(text: &str) -> Result<[f64; 3], ExportError> {
    let inner = text.trim().trim_start_matches('(').trim_end_matches(')');
    let numbers: Vec<f64> = inner.split(',').filter_map(|w| w.trim().parse().ok()).collect();
    numbers
        .try_into()
        .ok()
        .filter(|v: &[f64; 3]| v.iter().all(|x| x.is_finite()))
        .ok_or_else(|| bad(format!("`{text}` are not three finite numbers")))
}

/// The edge of a voxel from the directions or the spacings of the axes.
fn pitch(directions: Option<&str>, spacings: Option<&str>) -> Result<Option<f64>, ExportError> {
    let (text, edges) = if let Some(text) = directions {
        let axes: Vec<[f64; 3]> = text.split_inclusive(')').map(vector).collect::<Result<_, _>>()?;
        let crooked = axes.iter().enumerate().any(|(i, a)| (0..3).any(|k| (a[k] != 0.0) != (k == i)));
        if axes.len() != 3 || crooked {
            return Err(bad(format!("space directions `{text}` are not along x, y and z: resample it")));
        }
        (text, axes.iter().enumerate().map(|(i, a)| a[i]).collect::<Vec<f64>>())
    } else if let Some(text) = spacings {
        (text, text.split_whitespace().filter_map(|w| w.parse().ok()).collect())
    } else {
        return Ok(None);
    };
    if edges.iter().any(|e| e.is_nan()) {
        return Ok(None);
    }
    let even = edges.len() == 3 && edges.iter().all(|e| *e > 0.0 && (e / edges[0] - 1.0).abs() < 1e-6);
    if !even {
        return Err(bad(format!("its voxels `{text}` are not cubes along x, y and z: resample it")));
    }
    Ok(Some(edges[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        [format!("NRRD0004\n# made by hand\n{header}\n\n").as_bytes(), data].concat()
    }

    #[test]
    fn samples_of_every_kind_and_order_are_read() {
        let head = |kind: &str, endian: &str| {
            format!("type: {kind}\ndimension: 3\nsizes: 2 1 1\nendian: {endian}\nencoding: raw")
        };
        let read_back = |h: String, data: &[u8]| read(&file(&h, data)).unwrap().samples().collect::<Vec<_>>();
        assert_eq!(read_back(head("int8", "little"), &[0xFF, 2]), [-1.0, 2.0]);
        assert_eq!(read_back(head("ushort", "big"), &[1, 0, 0, 2]), [256.0, 2.0]);
        assert_eq!(read_back(head("short", "little"), &[0xFE, 0xFF, 2, 0]), [-2.0, 2.0]);
        let both = [1.5f32.to_be_bytes(), (-2.0f32).to_be_bytes()].concat();
        assert_eq!(read_back(head("float", "big"), &both), [1.5, -2.0]);
        let both = [1.5f64.to_le_bytes(), (-2.0f64).to_le_bytes()].concat();
        assert_eq!(read_back(head("double", "little"), &both), [1.5, -2.0]);
    }

    #[test]
    fn the_frame_and_the_unit_are_read() {
        let h = "type: uchar\ndimension: 3\nsizes: 1 1 2\nencoding: raw\nspace: left-posterior-superior\n\
                 space directions: (0.02,0,0) (0,0.02,0) (0,0,0.02)\nspace origin: (1,2,3)\n\
                 space units: \"mm\" \"mm\" \"mm\"\nowner:=somebody";
        let v = read(&file(h, &[0, 9])).unwrap();
        assert_eq!((v.size, v.pitch, v.origin), ([1, 1, 2], Some(0.02), [1.0, 2.0, 3.0]));
        assert_eq!((v.unit.as_deref(), v.between_two_values()), (Some("mm"), Some(4.5)));
        let plain =
            read(&file("type: uchar\ndimension: 3\nsizes: 3 1 1\nencoding: raw", &[0, 1, 2])).unwrap();
        assert_eq!((plain.pitch, plain.unit.clone(), plain.between_two_values()), (None, None, None));
    }

    #[test]
    fn what_is_no_such_file_is_refused_with_the_field() {
        let good = "type: uchar\ndimension: 3\nsizes: 2 1 1\nencoding: raw";
        assert!(read(&file(good, &[0, 1])).is_ok());
        for (from, to, part) in [
            ("uchar", "block", "type `block`"),
            ("dimension: 3", "dimension: 4", "dimension is 4"),
            ("sizes: 2 1 1", "sizes: 2 1", "sizes `2 1`"),
            ("sizes: 2 1 1", "sizes: 0 1 1", "none or more"),
            ("sizes: 2 1 1", "sizes: 99999999999 9999999 9999999", "none or more"),
            ("sizes: 2 1 1", "sizes: 3 1 1", "2 bytes of samples, not the 3"),
            ("raw", "bzip2", "bzip2"),
            ("raw", "gzip", "does not unpack"),
            ("encoding: raw", "encoding: raw\ndata file: x.raw", "x.raw"),
            ("encoding: raw", "encoding: raw\nspacings: 1 1 2", "not cubes"),
            ("encoding: raw", "encoding: raw\nspace directions: (0,1,0) (1,0,0) (0,0,1)", "not along"),
            ("encoding: raw", "encoding: raw\nspace origin: (0,nan,0)", "three finite numbers"),
            ("uchar", "short", "endian is `missing`"),
        ] {
            let message = read(&file(&good.replace(from, to), &[0, 1])).unwrap_err().to_string();
            assert!(message.contains(part), "{from} → {to}: {message}");
        }
        let float = good.replace("uchar", "float").replace("sizes: 2", "endian: little\nsizes: 1");
        let message = read(&file(&float, &f32::NAN.to_le_bytes())).unwrap_err().to_string();
        assert!(message.contains("sample 0 is NaN"), "{message}");
        assert!(read(b"solid x\n\n").unwrap_err().to_string().contains("NRRD000"));
        assert!(read(b"NRRD0004\ntype: uchar").unwrap_err().to_string().contains("empty line"));
        // What unpacks to more than it states is not unpacked.
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, &vec![7; 100_000]).unwrap();
        let message =
            read(&file(&good.replace("raw", "gzip"), &packed.finish().unwrap())).unwrap_err().to_string();
        assert!(message.contains("3 bytes of samples, more than the 2"), "{message}");
    }
}
