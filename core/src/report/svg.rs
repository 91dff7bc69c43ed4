//! Drawing into an SVG file.

use super::canvas::{Anchor, Canvas, Ink, LETTER, plain};
use std::fmt::Write as _;

/// An SVG file in the making.
pub(super) struct Svg {
    body: String,
}

impl Svg {
    /// A white sheet, pixels.
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        let body = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
             {height}\" font-family=\"monospace\" font-size=\"13\">\n<rect width=\"{width}\" height=\"{height}\" \
             fill=\"#ffffff\"/>\n"
        );
        Self { body }
    }

    /// The file.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.body.push_str("</svg>\n");
        self.body.into_bytes()
    }

    /// Writing to a string cannot fail.
    fn push(&mut self, arguments: std::fmt::Arguments) {
        let _ = self.body.write_fmt(arguments);
        self.body.push('\n');
    }
}

fn colour([r, g, b]: Ink) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

impl Canvas for Svg {
    fn rectangle(&mut self, [x, y, w, h]: [f64; 4], ink: Ink) {
        let ink = colour(ink);
        self.push(format_args!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" fill=\"{ink}\"/>"
        ));
    }

    fn line(&mut self, points: &[[f64; 2]], width: f64, ink: Ink) {
        let listed: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        let (points, ink) = (listed.join(" "), colour(ink));
        self.push(format_args!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{ink}\" stroke-width=\"{width:.2}\"/>"
        ));
    }

    fn polygon(&mut self, corners: &[[f64; 2]], ink: Ink) {
        let points: Vec<String> = corners.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        let (points, ink) = (points.join(" "), colour(ink));
        // Drawn round in its own colour: else the paper shows between neighbours.
        self.push(format_args!(
            "<polygon points=\"{points}\" fill=\"{ink}\" stroke=\"{ink}\" stroke-width=\"0.4\"/>"
        ));
    }

    fn disc(&mut self, [x, y]: [f64; 2], radius: f64, ink: Ink) {
        let ink = colour(ink);
        self.push(format_args!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\" fill=\"{ink}\"/>"));
    }

    fn text(&mut self, [x, y]: [f64; 2], anchor: Anchor, text: &str, ink: Ink) {
        let text = plain(text);
        let letters = text.chars().count();
        let (left, width, ink) = (anchor.left(x, letters), LETTER * letters as f64, colour(ink));
        let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        // The width is that of the bitmap's letters, whatever font the reader has.
        self.push(format_args!(
            "<text x=\"{left:.2}\" y=\"{:.2}\" textLength=\"{width:.2}\" fill=\"{ink}\" xml:space=\"preserve\">{text}</text>",
            y + 4.5
        ));
    }
}
