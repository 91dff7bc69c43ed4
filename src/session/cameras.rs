//! Camera files: a projection for each photograph.
//!
//! Two kinds are read. Middlebury's `_par.txt`: a line with the number of cameras, then for each the picture's
//! name, K (9 numbers, row by row), R (9) and t (3), with P = K·[R|t] and lengths in metres. A table with
//! commas: for each picture, optionally its name, then the twelve numbers of P row by row, lengths in mm; a
//! line of headings is allowed.

use super::SessionError;
use super::name::few;
use super::picture::Size;
use grainrig_core::geometry::{Point, Projection};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3x4, Vector3};
use std::collections::BTreeMap;

/// How far R·Rᵀ may be from the identity before R is no rotation: files are written with six digits or more.
const ROTATION_TOLERANCE: f64 = 1e-3;
const MM_PER_M: f64 = 1000.0;
/// Greater numbers are no camera's, and their products might overflow.
const GREATEST: f64 = 1e15;
/// Far more rounds than the decomposition of a matrix with three columns takes.
const ROUNDS: usize = 1000;

/// A line's number, the picture's name where the line has one, and P in mm.
type Row = (usize, Option<String>, Matrix3x4<f64>);

/// The cameras of `images`, in their order, matched by file name (or by order where the file has no names),
/// in mm and with w > 0 where the scene is. The scene is the place nearest to what all pictures have in their
/// middle; `size` is the pictures' width and height in pixels.
///
/// # Errors
/// [`SessionError`] with the line number for a number that cannot be read or is not finite and for a wrong
/// count; with the picture's name where it has no camera or its camera looks past the scene.
pub fn parse(text: &str, images: &[&str], size: Size) -> Result<Vec<(String, Projection)>, SessionError> {
    let lines: Vec<(usize, &str)> = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .map(|(i, l)| (i + 1, l.trim()))
        .filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
        .collect();
    let &(first, head) = lines.first().ok_or_else(|| {
        fault(
            1,
            "the file has no cameras; it needs Middlebury's `_par.txt` or a table of 12 numbers a picture",
        )
    })?;
    let rows = match head.parse::<usize>() {
        Ok(count) => middlebury(first, count, &lines[1..])?,
        Err(_) => table(&lines)?,
    };
    let cameras = matched(rows, images)?;
    in_front(cameras, size)
}

fn fault(line: usize, reason: impl Into<String>) -> SessionError {
    SessionError::Cameras { line, reason: reason.into() }
}

fn middlebury(head: usize, count: usize, lines: &[(usize, &str)]) -> Result<Vec<Row>, SessionError> {
    if lines.len() != count {
        let reason = format!("it says {count} cameras, {} lines follow; complete the file", lines.len());
        return Err(fault(head, reason));
    }
    let row = |&(line, text): &(usize, &str)| {
        let mut fields = text.split_whitespace();
        let name = fields.next().unwrap_or_default().to_owned();
        let v: [f64; 21] = numbers(line, fields)?;
        let k = Matrix3::from_row_slice(&v[..9]);
        let r = Matrix3::from_row_slice(&v[9..18]);
        // Lengths become mm: K·[R|t] at metres and K·[R|1000 t] at millimetres are the same picture.
        let t = Vector3::new(v[18], v[19], v[20]) * MM_PER_M;
        let off = (r * r.transpose() - Matrix3::identity()).abs().max();
        if off > ROTATION_TOLERANCE {
            let reason = format!(
                "R is no rotation: R·Rᵀ is {off:.2e} from the identity, the limit is {ROTATION_TOLERANCE}; \
                 check the order of the columns (name, K, R, t)"
            );
            return Err(fault(line, reason));
        }
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(&r);
        rt.set_column(3, &t);
        Ok((line, Some(name), k * rt))
    };
    lines.iter().map(row).collect()
}

fn table(lines: &[(usize, &str)]) -> Result<Vec<Row>, SessionError> {
    let split = |text: &str| text.split(',').map(|f| f.trim().to_owned()).collect::<Vec<_>>();
    let heading = |fields: &[String]| fields.iter().all(|f| f.parse::<f64>().is_err());
    let mut rows: Vec<Row> = Vec::new();
    for (i, &(line, text)) in lines.iter().enumerate() {
        let fields = split(text);
        if i == 0 && heading(&fields) {
            continue;
        }
        let (name, rest) = match fields.len() {
            12 => (None, &fields[..]),
            13 => (Some(fields[0].clone()), &fields[1..]),
            n => {
                let reason = format!("it has {n} fields; 12 numbers are needed, or a name and 12 numbers");
                return Err(fault(line, reason));
            }
        };
        if rows.first().is_some_and(|(_, other, _)| other.is_some() != name.is_some()) {
            return Err(fault(line, "some lines have a picture's name and some have none; name all or none"));
        }
        let v: [f64; 12] = numbers(line, rest.iter().map(String::as_str))?;
        rows.push((line, name, Matrix3x4::from_row_slice(&v)));
    }
    Ok(rows)
}

fn numbers<'a, const N: usize>(
    line: usize,
    fields: impl Iterator<Item = &'a str>,
) -> Result<[f64; N], SessionError> {
    let mut values = Vec::with_capacity(N);
    for field in fields {
        let shown: String = field.chars().take(40).collect();
        let value: f64 = field
            .parse()
            .map_err(|_| fault(line, format!("{shown:?} is no number; write it as 1.5 or 1.5e-3")))?;
        // Written so that what is no number is refused too.
        if !(-GREATEST..=GREATEST).contains(&value) {
            let reason = format!("{shown} is not within ±{GREATEST:e}; write the camera in pixels and mm");
            return Err(fault(line, reason));
        }
        values.push(value);
    }
    let n = values.len();
    values.try_into().map_err(|_| fault(line, format!("it has {n} numbers, {N} are needed")))
}

/// The rows in the order of the images.
fn matched(rows: Vec<Row>, images: &[&str]) -> Result<Vec<(String, Matrix3x4<f64>)>, SessionError> {
    if rows.first().is_none_or(|(_, name, _)| name.is_none()) {
        if rows.len() != images.len() {
            let reason = format!(
                "the file has {} cameras without names, there are {} pictures; give as many, or name them",
                rows.len(),
                images.len()
            );
            return Err(fault(rows.last().map_or(1, |r| r.0), reason));
        }
        return Ok(images.iter().zip(rows).map(|(i, (_, _, p))| ((*i).to_owned(), p)).collect());
    }
    let mut by_name = BTreeMap::new();
    for (line, name, p) in rows {
        let name = name.unwrap_or_default();
        if by_name.contains_key(&name) {
            return Err(fault(line, format!("{name} has a camera already; remove one")));
        }
        by_name.insert(name, p);
    }
    let one = |&image: &&str| {
        let known = || few(by_name.keys().map(String::as_str));
        let p = by_name
            .get(image)
            .ok_or_else(|| SessionError::NoCamera { image: image.to_owned(), known: known() })?;
        Ok((image.to_owned(), *p))
    };
    images.iter().map(one).collect()
}

/// Gives each matrix the sign with w > 0 at the scene, and checks that the scene is in each picture.
///
/// The sign of det of the left 3×3 would not do: it is wrong for the mirrored frame of the Oxford dinosaur.
/// The optical axes would not do either: with its unphysical intrinsics they miss the pictures.
fn in_front(
    cameras: Vec<(String, Matrix3x4<f64>)>,
    [width, height]: Size,
) -> Result<Vec<(String, Projection)>, SessionError> {
    let middle = [0.5 * (f64::from(width) - 1.0), 0.5 * (f64::from(height) - 1.0)];
    let scene = scene(&cameras, middle);
    let mut out = Vec::with_capacity(cameras.len());
    for (image, mut p) in cameras {
        let w = (p * scene.to_homogeneous()).z;
        if w < 0.0 {
            p = -p;
        }
        let camera = Projection::new(p);
        let [column, row] = camera.project(&scene).unwrap_or([f64::NAN; 2]);
        let inside = (0.0..=f64::from(width)).contains(&column) && (0.0..=f64::from(height)).contains(&row);
        if !inside {
            return Err(SessionError::Astray { image, column, row, width, height });
        }
        out.push((image, camera));
    }
    Ok(out)
}

/// The place that comes nearest to the middle of all pictures: least squares over the two planes that each
/// middle's column and row span, each at unit distance scale.
fn scene(cameras: &[(String, Matrix3x4<f64>)], middle: [f64; 2]) -> Point {
    let mut a = DMatrix::zeros(2 * cameras.len(), 3);
    let mut b = DVector::zeros(2 * cameras.len());
    for (i, (_, p)) in cameras.iter().enumerate() {
        for (k, at) in middle.iter().enumerate() {
            let plane = p.row(k) - p.row(2) * *at;
            let normal = plane.fixed_columns::<3>(0).into_owned();
            let length = normal.norm();
            if length > 0.0 {
                a.row_mut(2 * i + k).copy_from(&(normal / length));
                b[2 * i + k] = -plane[3] / length;
            }
        }
    }
    // Cameras that are all alike leave a direction open: the solution of least norm is as good as any.
    let solved = a.try_svd(true, true, f64::EPSILON, ROUNDS).and_then(|svd| svd.solve(&b, 1e-12).ok());
    solved.map_or_else(Point::origin, |x| Point::new(x[0], x[1], x[2]))
}
