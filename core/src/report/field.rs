//! Cuts through a body coloured by a figure, side by side, as PNG.

use super::bitmap::Bitmap;
use super::canvas::{Anchor, Canvas, Ink};

/// Edge of a picture, room above it for its caption and below it for the scale, pixels.
const EDGE: f64 = 560.0;
const ABOVE: f64 = 64.0;
const BELOW: f64 = 60.0;
/// Share of a picture that is left around what is shown.
const AROUND: f64 = 0.04;
const BLACK: Ink = [0; 3];
const GREY: Ink = [90; 3];
/// Colours from the scale's low to its high end (after matplotlib's viridis: even steps of lightness).
const COLOURS: [Ink; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Coloured cuts with a title.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldPicture {
    /// What they show.
    pub title: String,
    /// The cuts; all have the same scale of length.
    pub cuts: Vec<FieldCut>,
}

/// A cut.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldCut {
    /// What its colours mean, with the unit.
    pub caption: String,
    /// Corners (to the right, upwards; any unit) and the figure.
    pub polygons: Vec<(Vec<[f64; 2]>, f64)>,
    /// Level lines across the cut: plates.
    pub levels: Vec<f64>,
    /// The figures at the ends of the scale; what is beyond has the end's colour.
    pub range: [f64; 2],
}

impl FieldPicture {
    /// The picture as a PNG file.
    ///
    /// # Errors
    /// The encoder's message.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let corners = || self.cuts.iter().flat_map(|c| &c.polygons).flat_map(|p| &p.0);
        let reach = |k: usize| {
            corners().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c[k]), h.max(c[k])))
        };
        let (across, up) = (reach(0), reach(1));
        let side = (across.1 - across.0).max(up.1 - up.0);
        // A flat body needs no high picture.
        let high = if side.is_finite() && side > 0.0 { EDGE * ((up.1 - up.0) / side).max(0.2) } else { EDGE };
        let size = [(EDGE * self.cuts.len().max(1) as f64) as usize, (ABOVE + high + BELOW) as usize];
        let mut canvas = Bitmap::new(size);
        canvas.text([14.0, 16.0], Anchor::Left, &self.title, BLACK);
        if side.is_finite() && side > 0.0 {
            let scale = EDGE * (1.0 - 2.0 * AROUND) / side;
            for (k, cut) in self.cuts.iter().enumerate() {
                let middle = [EDGE * (k as f64 + 0.5), ABOVE + 0.5 * high];
                let to_canvas = |c: &[f64; 2]| {
                    let off = [c[0] - 0.5 * (across.0 + across.1), c[1] - 0.5 * (up.0 + up.1)];
                    [middle[0] + scale * off[0], middle[1] - scale * off[1]]
                };
                cut.draw(&mut canvas, &to_canvas, EDGE * k as f64, ABOVE + high + 12.0);
            }
        }
        canvas.png()
    }
}

impl FieldCut {
    fn draw(&self, canvas: &mut Bitmap, to_canvas: &dyn Fn(&[f64; 2]) -> [f64; 2], left: f64, top: f64) {
        canvas.text([left + 14.0, 42.0], Anchor::Left, &self.caption, BLACK);
        let [low, high] = self.range;
        for (corners, value) in &self.polygons {
            let corners: Vec<[f64; 2]> = corners.iter().map(to_canvas).collect();
            canvas.polygon(&corners, colour((value - low) / (high - low)));
        }
        for level in &self.levels {
            let y = to_canvas(&[0.0, *level])[1];
            canvas.line(&[[left + 8.0, y], [left + EDGE - 8.0, y]], 2.0, GREY);
        }
        let bar = EDGE - 160.0;
        let steps = 100;
        for i in 0..steps {
            let part = f64::from(i) / f64::from(steps);
            let x = left + 80.0 + bar * part;
            canvas.rectangle([x, top, bar / f64::from(steps) + 1.0, 14.0], colour(part));
        }
        for part in [0.0, 0.5, 1.0] {
            let value = low + part * (high - low);
            let text =
                if high.abs().max(low.abs()) < 10.0 { format!("{value:.3}") } else { format!("{value:.0}") };
            canvas.text([left + 80.0 + bar * part, top + 28.0], Anchor::Middle, &text, GREY);
        }
    }
}

fn colour(part: f64) -> Ink {
    let last = COLOURS.len() - 1;
    let at = if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) * last as f64 };
    let k = (at as usize).min(last - 1);
    let share = at - k as f64;
    [0, 1, 2].map(|i| {
        (f64::from(COLOURS[k][i]) * (1.0 - share) + f64::from(COLOURS[k + 1][i]) * share).round() as u8
    })
}
