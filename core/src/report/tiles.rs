//! Small pictures side by side, as SVG and as PNG.

use super::bitmap::Bitmap;
use super::canvas::{Anchor, Canvas, Ink};
use super::svg::Svg;

/// Edge of a picture and room for what is written above it, pixels.
const EDGE: f64 = 280.0;
const ABOVE: f64 = 44.0;
/// Share of a picture that is left around what is shown.
const AROUND: f64 = 0.05;
const BLACK: Ink = [0; 3];

/// Pictures in a row, with a title.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tiles {
    /// What they show.
    pub title: String,
    /// The pictures; all have the same scale.
    pub tiles: Vec<Tile>,
}

/// A picture made of filled polygons.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tile {
    /// What is written above it.
    pub caption: String,
    /// Corners (to the right, upwards; any unit) and grey, 0 black to 255 white; later ones cover earlier ones.
    pub polygons: Vec<(Vec<[f64; 2]>, u8)>,
}

impl Tiles {
    /// The pictures as an SVG file.
    pub fn svg(&self) -> Vec<u8> {
        let mut canvas = Svg::new(self.size());
        self.draw(&mut canvas);
        canvas.finish()
    }

    /// The pictures as a PNG file.
    ///
    /// # Errors
    /// The encoder's message.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let mut canvas = Bitmap::new(self.size());
        self.draw(&mut canvas);
        canvas.png()
    }

    fn size(&self) -> [usize; 2] {
        [(EDGE * self.tiles.len().max(1) as f64) as usize, (EDGE + ABOVE + 24.0) as usize]
    }

    fn draw(&self, canvas: &mut dyn Canvas) {
        canvas.text([12.0, 18.0], Anchor::Left, &self.title, BLACK);
        let points = || self.tiles.iter().flat_map(|t| &t.polygons).flat_map(|(p, _)| p);
        let reach = points().flat_map(|p| p.map(f64::abs)).fold(f64::MIN_POSITIVE, f64::max);
        let scale = (0.5 - AROUND) * EDGE / reach;
        for (k, tile) in self.tiles.iter().enumerate() {
            let middle = [EDGE * (k as f64 + 0.5), ABOVE + 0.5 * EDGE];
            canvas.text([middle[0], ABOVE], Anchor::Middle, &tile.caption, BLACK);
            for (corners, grey) in &tile.polygons {
                let at: Vec<[f64; 2]> = corners
                    .iter()
                    .map(|[x, y]| [middle[0] + scale * x, middle[1] + 12.0 - scale * y])
                    .collect();
                canvas.polygon(&at, [*grey; 3]);
            }
        }
    }
}
