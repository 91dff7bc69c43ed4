//! A sheet of diagrams and text, as SVG and as PNG.

use super::bitmap::Bitmap;
use super::canvas::{Anchor, Canvas, Ink, LETTER, LINE};
use super::svg::Svg;

/// Width of a sheet, pixels.
const WIDTH: usize = 1200;
/// Height of a diagram with its title and its labels, pixels.
const PANEL: f64 = 320.0;
/// Room around a diagram's field for labels: left, top, right, bottom, pixels.
const ROOM: [f64; 4] = [78.0, 46.0, 20.0, 46.0];
/// Letters on a line of text.
const LETTERS: usize = 144;
const BLACK: Ink = [0; 3];
const GREY: Ink = [120; 3];
const LIGHT: Ink = [228; 3];
const WARNING: Ink = [180, 0, 0];
/// Colours of series and marks that colour-blind readers distinguish (Okabe & Ito 2008).
const INKS: [Ink; 5] = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 86, 86]];

/// A sheet: diagrams two by two, then figures, then warnings.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sheet {
    /// What it is about.
    pub title: String,
    /// The diagrams.
    pub panels: Vec<Panel>,
    /// Lines of text: figures.
    pub figures: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// A diagram.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Panel {
    /// What it shows, with the unit of its values.
    pub title: String,
    /// What its abscissa is, with the unit.
    pub abscissa: String,
    /// What is drawn.
    pub series: Vec<Series>,
    /// Lines across it.
    pub marks: Vec<Mark>,
}

/// Values that belong together.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Their name.
    pub name: String,
    /// The values, in the order in which a line joins them.
    pub points: Vec<Point>,
    /// Whether a line joins them; else each is a dot.
    pub joined: bool,
}

/// A value.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Point {
    /// Where it stands.
    pub x: f64,
    /// The value.
    pub y: f64,
    /// Its standard uncertainty, drawn as a bar.
    pub sigma: Option<f64>,
}

/// A line across a diagram.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// At a value, from left to right.
    Level(String, f64),
    /// At a value of the horizontal axis, from top to bottom.
    Upright(String, f64),
}

impl Sheet {
    /// The sheet as an SVG file.
    pub fn svg(&self) -> Vec<u8> {
        let mut canvas = Svg::new(self.size());
        self.draw(&mut canvas);
        canvas.finish()
    }

    /// The sheet as a PNG file.
    ///
    /// # Errors
    /// The encoder's message.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let mut canvas = Bitmap::new(self.size());
        self.draw(&mut canvas);
        canvas.png()
    }

    fn panels(&self) -> impl Iterator<Item = &Panel> {
        self.panels.iter().filter(|p| p.series.iter().any(|s| !s.points.is_empty()))
    }

    fn lines(&self) -> Vec<(String, Ink)> {
        let figures = self.figures.iter().flat_map(|f| wrapped(f)).map(|l| (l, BLACK));
        let warnings = self.warnings.iter().flat_map(|w| wrapped(&format!("! {w}"))).map(|l| (l, WARNING));
        figures.chain(warnings).collect()
    }

    fn size(&self) -> [usize; 2] {
        let rows = self.panels().count().div_ceil(2);
        let height = 44.0 + PANEL * rows as f64 + LINE * self.lines().len() as f64 + 24.0;
        [WIDTH, height as usize]
    }

    fn draw(&self, canvas: &mut dyn Canvas) {
        canvas.text([20.0, 24.0], Anchor::Left, &self.title, BLACK);
        let half = 0.5 * WIDTH as f64;
        let mut bottom = 44.0;
        for (k, panel) in self.panels().enumerate() {
            let (column, row) = (k % 2, k / 2);
            panel.draw(canvas, [half * column as f64, 44.0 + PANEL * row as f64, half, PANEL]);
            bottom = 44.0 + PANEL * (row + 1) as f64;
        }
        for (n, (line, ink)) in self.lines().iter().enumerate() {
            canvas.text([20.0, bottom + 12.0 + LINE * n as f64], Anchor::Left, line, *ink);
        }
    }
}

/// A text broken at spaces into lines that fit the sheet.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if !lines[last].is_empty() && lines[last].chars().count() + 1 + word.chars().count() > LETTERS {
            lines.push(format!("  {word}"));
        } else if lines[last].is_empty() {
            lines[last].push_str(word);
        } else {
            lines[last].push(' ');
            lines[last].push_str(word);
        }
    }
    lines
}

/// A range of values and where they are drawn.
#[derive(Clone, Copy)]
struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// A scale that holds all these values, with room at both ends.
    fn over(values: impl Iterator<Item = f64>, from: f64, to: f64, room: f64) -> Self {
        let (low, high) = (values.filter(|v| v.is_finite()))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let least = (1e-9 * low.abs().max(high.abs())).max(1e-9);
        let more = if high - low > least { room * (high - low) } else { 0.5 * low.abs().max(1e-3) };
        Self { low: low - more, high: high + more, from, to }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Round values, about as many as asked for, and how many decimals they need.
    fn ticks(&self, count: f64) -> (Vec<f64>, usize) {
        let rough = (self.high - self.low) / count;
        let power = 10f64.powf(rough.log10().floor());
        let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|s| s * power >= rough).unwrap_or(10.0);
        let first = (self.low / step).ceil();
        let last = (self.high / step).floor();
        let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        (
            (0..=(last - first).clamp(0.0, 100.0) as usize).map(|k| (first + k as f64) * step).collect(),
            decimals,
        )
    }
}

impl Panel {
    fn draw(&self, canvas: &mut dyn Canvas, [left, top, width, height]: [f64; 4]) {
        let (x0, x1) = (left + ROOM[0], left + width - ROOM[2]);
        let (y0, y1) = (top + ROOM[1], top + height - ROOM[3]);
        let points = || self.series.iter().flat_map(|s| &s.points);
        let uprights =
            self.marks.iter().filter_map(|m| if let Mark::Upright(_, x) = m { Some(*x) } else { None });
        let levels =
            self.marks.iter().filter_map(|m| if let Mark::Level(_, y) = m { Some(*y) } else { None });
        let across = Scale::over(points().map(|p| p.x).chain(uprights), x0, x1, 0.02);
        let reach = points().flat_map(|p| [p.y - p.sigma.unwrap_or(0.0), p.y + p.sigma.unwrap_or(0.0)]);
        let up = Scale::over(reach.chain(levels), y1, y0, 0.06);
        canvas.text([x0, top + 12.0], Anchor::Left, &self.title, BLACK);
        let (ticks, decimals) = up.ticks(6.0);
        for tick in ticks {
            let y = up.at(tick);
            canvas.line(&[[x0, y], [x1, y]], 1.0, LIGHT);
            canvas.text([x0 - 6.0, y], Anchor::Right, &format!("{tick:.decimals$}"), GREY);
        }
        let (ticks, decimals) = across.ticks(8.0);
        for tick in ticks {
            let x = across.at(tick);
            canvas.line(&[[x, y0], [x, y1]], 1.0, LIGHT);
            canvas.text([x, y1 + 12.0], Anchor::Middle, &format!("{tick:.decimals$}"), GREY);
        }
        canvas.line(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]], 1.0, GREY);
        canvas.text([0.5 * (x0 + x1), y1 + 30.0], Anchor::Middle, &self.abscissa, GREY);

        let mut legend = x0;
        let mut named = |canvas: &mut dyn Canvas, name: &str, ink: Ink| {
            if !name.is_empty() {
                canvas.rectangle([legend, top + 25.0, 10.0, 10.0], ink);
                canvas.text([legend + 14.0, top + 30.0], Anchor::Left, name, ink);
                legend += 14.0 + LETTER * (name.chars().count() + 2) as f64;
            }
        };
        for (k, series) in self.series.iter().enumerate() {
            let ink = INKS[k % INKS.len()];
            named(canvas, &series.name, ink);
            series.draw(canvas, &across, &up, ink);
        }
        for (k, mark) in self.marks.iter().enumerate() {
            let ink = INKS[(self.series.len() + k) % INKS.len()];
            let (name, from, to) = match mark {
                Mark::Level(name, value) => (name, [x0, up.at(*value)], [x1, up.at(*value)]),
                Mark::Upright(name, value) => (name, [across.at(*value), y0], [across.at(*value), y1]),
            };
            named(canvas, name, ink);
            canvas.dashed(from, to, 1.4, ink);
        }
    }
}

impl Series {
    fn draw(&self, canvas: &mut dyn Canvas, across: &Scale, up: &Scale, ink: Ink) {
        let finite = || self.points.iter().filter(|p| p.x.is_finite() && p.y.is_finite());
        if self.joined {
            let points: Vec<[f64; 2]> = finite().map(|p| [across.at(p.x), up.at(p.y)]).collect();
            canvas.line(&points, 1.4, ink);
            return;
        }
        for p in finite() {
            let x = across.at(p.x);
            if let Some(sigma) = p.sigma.filter(|s| s.is_finite()) {
                let (low, high) = (up.at(p.y - sigma), up.at(p.y + sigma));
                canvas.line(&[[x, low], [x, high]], 1.0, ink);
                for y in [low, high] {
                    canvas.line(&[[x - 3.0, y], [x + 3.0, y]], 1.0, ink);
                }
            }
            canvas.disc([x, up.at(p.y)], 2.6, ink);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_broken_at_its_spaces() {
        let text = "word ".repeat(60);
        let lines = wrapped(text.trim());
        assert!(lines.len() == 3 && lines.iter().all(|l| l.chars().count() <= LETTERS), "{lines:?}");
        assert_eq!(lines.iter().flat_map(|l| l.split_whitespace()).count(), 60);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let scale = Scale::over([0.0, 187.2].into_iter(), 0.0, 100.0, 0.0);
        assert_eq!(scale.ticks(8.0).0, [0.0, 50.0, 100.0, 150.0]);
        let flat = Scale::over([3.0, 3.0].into_iter(), 0.0, 100.0, 0.1);
        assert!(flat.low < 3.0 && flat.high > 3.0);
        assert!(flat.ticks(6.0).0.len() > 2);
    }

    #[test]
    fn what_is_not_finite_or_empty_draws_nothing_and_ends() {
        let odd = [f64::NAN, f64::INFINITY, 2.0].map(|y| Point { x: 1.0, y, sigma: Some(f64::NAN) });
        let series = Series { name: "a < b & c".into(), points: odd.into(), joined: false };
        let panel = Panel { series: vec![series], ..Panel::default() };
        let sheet =
            Sheet { title: "σ − ☂".into(), panels: vec![panel, Panel::default()], ..Sheet::default() };
        let text = String::from_utf8(sheet.svg()).unwrap();
        assert!(
            text.contains("a &lt; b &amp; c") && text.contains("sd - ?") && !text.contains("NaN"),
            "{text}"
        );
        assert_eq!(text.matches("<circle").count(), 1);
        let png = sheet.png().unwrap();
        assert_eq!(png, sheet.png().unwrap());
        assert_eq!(image::load_from_memory(&png).unwrap().width(), 1200);
    }
}
