//! What can be drawn on: an SVG file and a bitmap, in the same coordinates.

/// Width of a letter, pixels; every letter has the same.
pub(super) const LETTER: f64 = 8.0;
/// Height of a line of text, pixels.
pub(super) const LINE: f64 = 18.0;

/// Red, green, blue.
pub(super) type Ink = [u8; 3];

/// Where a text's given point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

impl Anchor {
    /// Where a text of this many letters begins.
    pub(super) fn left(self, x: f64, letters: usize) -> f64 {
        let width = LETTER * letters as f64;
        match self {
            Self::Left => x,
            Self::Middle => x - 0.5 * width,
            Self::Right => x - width,
        }
    }
}

/// Something to draw on; columns to the right, rows down, in pixels.
pub(super) trait Canvas {
    /// Fills a rectangle: left, top, width, height.
    fn rectangle(&mut self, corners: [f64; 4], ink: Ink);
    /// Draws a line of this width through these points.
    fn line(&mut self, points: &[[f64; 2]], width: f64, ink: Ink);
    /// Fills a polygon.
    fn polygon(&mut self, corners: &[[f64; 2]], ink: Ink);
    /// Fills a circle.
    fn disc(&mut self, center: [f64; 2], radius: f64, ink: Ink);
    /// Writes a line of text whose middle height is at the given row.
    fn text(&mut self, point: [f64; 2], anchor: Anchor, text: &str, ink: Ink);

    /// Draws a line that is interrupted every few pixels.
    fn dashed(&mut self, from: [f64; 2], to: [f64; 2], width: f64, ink: Ink) {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let dashes = (length / 10.0).ceil().max(1.0);
        let at = |part: f64| {
            let t = (part / dashes).min(1.0);
            [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])]
        };
        for k in 0..dashes as usize {
            self.line(&[at(k as f64), at(k as f64 + 0.6)], width, ink);
        }
    }
}

/// A text in letters that the program has: what is beyond Latin-1 is written with others.
pub(super) fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '−' | '–' | '—' => out.push('-'),
            '…' => out.push_str("..."),
            '‘' | '’' => out.push('\''),
            '“' | '”' => out.push('"'),
            'σ' => out.push_str("sd"),
            '→' => out.push_str("->"),
            ' '..='~' | '\u{a1}'..='\u{ff}' => out.push(c),
            _ => out.push('?'),
        }
    }
    out
}
