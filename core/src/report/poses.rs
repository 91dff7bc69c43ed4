//! A grain in several poses between level plates, side by side, as PNG.

use super::bitmap::Bitmap;
use super::canvas::{Anchor, Canvas, Ink, LINE};
use super::shaded::{from_the_side, shaded};
use crate::geometry::{Point, Vector};

/// Edge of a pose's picture, pixels; and how many stand in a row.
const EDGE: f64 = 280.0;
const IN_A_ROW: usize = 4;
/// Room for the title, pixels.
const TITLE: f64 = 36.0;
/// Share of a picture that is left around the grain.
const AROUND: f64 = 0.08;
const BLACK: Ink = [0; 3];
const PLATE: Ink = [120; 3];
const LOWER: Ink = [20, 90, 200];
const UPPER: Ink = [210, 40, 30];
/// Radius of a contact's mark and width of lines, pixels.
const MARK: f64 = 4.0;

/// Poses of a grain, with a title.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Poses {
    /// What they show.
    pub title: String,
    /// The poses; all have the same scale.
    pub poses: Vec<Pose>,
}

/// A grain between plates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pose {
    /// What is written above it, a line each.
    pub captions: Vec<String>,
    /// The grain's surface as it lies, z up, mm.
    pub surface: Vec<[Point; 3]>,
    /// What touches the lower plate, mm.
    pub lower: Vec<Point>,
    /// What touches the upper plate, mm.
    pub upper: Vec<Point>,
}

impl Pose {
    /// The direction from the middle of the lower to the middle of the upper contacts, level; x where they are above one another.
    fn leaning(&self) -> Vector {
        let middle = |of: &[Point]| of.iter().map(|p| p.coords).sum::<Vector>() / of.len().max(1) as f64;
        let along = middle(&self.upper) - middle(&self.lower);
        Vector::new(along.x, along.y, 0.0).try_normalize(1e-9).unwrap_or_else(Vector::x)
    }
}

impl Poses {
    /// The poses as a PNG file, each seen from the side so that it leans to the right: contacts with the lower plate are blue, with
    /// the upper one red, and a line leads from the middle of the ones to that of the others.
    ///
    /// # Errors
    /// The encoder's message.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let lines = self.poses.iter().map(|p| p.captions.len()).max().unwrap_or(0);
        let above = LINE * lines as f64 + 6.0;
        let rows = self.poses.len().div_ceil(IN_A_ROW).max(1);
        let across = self.poses.len().clamp(2, IN_A_ROW);
        let size = [EDGE * across as f64, TITLE + rows as f64 * (above + EDGE) + 8.0];
        let mut canvas = Bitmap::new(size.map(|s| s as usize));
        canvas.text([12.0, 18.0], Anchor::Left, &self.title, BLACK);
        let far = |p: &Pose| p.surface.iter().flatten().map(|q| q.coords.norm()).fold(0.0, f64::max);
        let reach = self.poses.iter().map(far).fold(f64::MIN_POSITIVE, f64::max);
        let scale = (0.5 - AROUND) * EDGE / reach;
        for (k, pose) in self.poses.iter().enumerate() {
            let left = EDGE * (k % IN_A_ROW) as f64;
            let top = TITLE + (above + EDGE) * (k / IN_A_ROW) as f64;
            for (n, line) in pose.captions.iter().enumerate() {
                canvas.text([left + 0.5 * EDGE, top + LINE * (n as f64 + 0.5)], Anchor::Middle, line, BLACK);
            }
            draw(pose, &mut canvas, [left + 0.5 * EDGE, top + above + 0.5 * EDGE], scale);
        }
        canvas.png()
    }
}

/// Draws a pose about the middle of its picture.
fn draw(pose: &Pose, canvas: &mut dyn Canvas, middle: [f64; 2], scale: f64) {
    let leaning = pose.leaning();
    let view = from_the_side(-leaning.y.atan2(leaning.x), 0.0);
    let on = |x: f64, y: f64| [middle[0] + scale * x, middle[1] - scale * y];
    let at = |p: &Point| {
        let seen = view * p.coords;
        on(seen.x, seen.y)
    };
    for (corners, grey) in shaded(pose.surface.iter().copied(), &view) {
        let corners: Vec<[f64; 2]> = corners.iter().map(|c| on(c[0], c[1])).collect();
        canvas.polygon(&corners, [grey; 3]);
    }
    let heights = || pose.surface.iter().flatten().map(|p| p.z);
    let ends = [heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max)];
    for (height, beyond) in ends.into_iter().zip([2.0, -2.0]) {
        let row = middle[1] - scale * height + beyond;
        canvas.line(&[[middle[0] - 0.47 * EDGE, row], [middle[0] + 0.47 * EDGE, row]], 3.0, PLATE);
    }
    let centre =
        |of: &[Point]| Point::from(of.iter().map(|p| p.coords).sum::<Vector>() / of.len().max(1) as f64);
    if !pose.lower.is_empty() && !pose.upper.is_empty() {
        canvas.dashed(at(&centre(&pose.lower)), at(&centre(&pose.upper)), 1.5, UPPER);
    }
    for (points, ink) in [(&pose.lower, LOWER), (&pose.upper, UPPER)] {
        points.iter().for_each(|p| canvas.disc(at(p), MARK, ink));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_stand_in_rows_and_lean_to_the_right() {
        let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from);
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let pose = Pose {
            captions: vec!["one".into(), "10 %".into()],
            surface: faces.map(|f| f.map(|k: usize| corners[k])).into(),
            lower: vec![corners[0], corners[1], corners[2]],
            upper: vec![corners[3]],
        };
        assert!(pose.leaning().x < 0.0 && pose.leaning().y < 0.0);
        let view = from_the_side(-pose.leaning().y.atan2(pose.leaning().x), 0.0);
        assert!((view * pose.leaning() - Vector::x()).norm() < 1e-12);
        let poses = Poses { title: "poses".into(), poses: vec![pose; 5] };
        let png = image::load_from_memory(&poses.png().unwrap()).unwrap().to_rgb8();
        assert_eq!(png.width(), 4 * 280);
        assert!(png.height() > 2 * 280);
        for ink in [LOWER, UPPER, PLATE] {
            assert!(png.pixels().any(|p| p.0 == ink), "{ink:?}");
        }
    }
}
