//! Silhouettes of rendered pictures against the projection of the very grain that was rendered. The data are not part
//! of the project; where they are not there, each test says so and passes.

use crate::skip::shared_data;
use grainrig_core::formats::decode;
use grainrig_core::formats::stl;
use grainrig_core::silhouette::{Picture, Segmentation, Settings, Source, find};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Lines measured in each row of pixels.
const SUBROWS: usize = 16;
/// Rows above the pedestal's top that count as the contact.
const CONTACT_ROWS: f64 = 8.0;

fn data() -> Option<PathBuf> {
    shared_data("turntable-rendered/sand_ma107_00002")
}

fn picture(path: &Path) -> Picture {
    decode(&std::fs::read(path).unwrap()).unwrap()
}

/// The camera of the pictures, as their maker states it; pixels, radians, mm.
struct Camera {
    distance: f64,
    mm_per_px: f64,
    foot: [f64; 2],
    roll: f64,
}

/// One view's truth.
struct View {
    name: String,
    angle: f64,
    wobble: f64,
}

struct Truth {
    camera: Camera,
    triangles: Vec<[[f64; 3]; 3]>,
    views: Vec<View>,
}

impl Truth {
    fn read(folder: &Path) -> Self {
        let bytes = std::fs::read(folder.join("truth/truth.json")).unwrap();
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        let number = |key: &str| json["camera"][key].as_f64().unwrap();
        let camera = Camera {
            distance: number("D"),
            mm_per_px: number("mm_per_px"),
            foot: [number("axis_u"), number("row0")],
            roll: number("roll").to_radians(),
        };
        let mesh =
            stl::read(&std::fs::read(folder.join("truth/truth_mesh_table_frame.stl")).unwrap()).unwrap();
        let corner = |v: u32| {
            let p = mesh.vertices[v as usize];
            [p.x, p.y, p.z]
        };
        let table = std::fs::read_to_string(folder.join("truth/true_angles.csv")).unwrap();
        let views = (table.lines().skip(1))
            .map(|line| {
                let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
                View {
                    name: format!("grain_{:02}.png", cells[0] as usize),
                    angle: cells[2].to_radians(),
                    wobble: cells[3],
                }
            })
            .collect();
        Self { camera, triangles: mesh.triangles.iter().map(|t| t.map(corner)).collect(), views }
    }

    /// How much of each pixel the grain above the pedestal's top covers, `[row, column]`: the exact length of the
    /// union of all triangles' spans along each of [`SUBROWS`] lines.
    fn coverage(&self, view: &View, [width, height]: [usize; 2]) -> Vec<f64> {
        let c = &self.camera;
        let ((sin, cos), (sr, cr)) = (view.angle.sin_cos(), c.roll.sin_cos());
        let foot = [c.foot[0] + view.wobble, c.foot[1]];
        let project = |[x, y, z]: [f64; 3]| {
            let (x, y) = (x * cos - y * sin, x * sin + y * cos);
            let scale = c.distance / (c.distance + y) / c.mm_per_px;
            let (u, v) = (x * scale, -z * scale);
            [foot[0] + u * cr + v * sr, foot[1] - u * sr + v * cr]
        };
        let lines = height * SUBROWS;
        let row_of = |line: usize| (line as f64 + 0.5) / SUBROWS as f64 - 0.5;
        let mut spans: Vec<Vec<[f64; 2]>> = vec![Vec::new(); lines];
        for t in &self.triangles {
            let p = t.map(project);
            let low = p.iter().map(|q| q[1]).fold(f64::INFINITY, f64::min);
            let high = p.iter().map(|q| q[1]).fold(f64::NEG_INFINITY, f64::max);
            let first = ((low + 0.5) * SUBROWS as f64 - 0.5).ceil().max(0.0) as usize;
            for (line, spans) in spans.iter_mut().enumerate().skip(first) {
                let row = row_of(line);
                if row > high {
                    break;
                }
                let mut span = [f64::INFINITY, f64::NEG_INFINITY];
                for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
                    if (a[1] <= row) != (b[1] <= row) {
                        let x = a[0] + (row - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                        span = [span[0].min(x), span[1].max(x)];
                    }
                }
                if span[0] < span[1] {
                    spans.push(span);
                }
            }
        }
        let mut out = vec![0.0; width * height];
        for (line, mut spans) in spans.into_iter().enumerate() {
            spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let out = &mut out[line / SUBROWS * width..][..width];
            let mut done = f64::NEG_INFINITY;
            for [low, high] in spans {
                // Above the top: (column − foot) sin r + (row − foot) cos r < 0.
                let (mut low, mut high) = (low.max(done), high);
                done = done.max(high);
                let down = (row_of(line) - foot[1]) * cr;
                if sr == 0.0 {
                    high = if down < 0.0 { high } else { low };
                } else if sr > 0.0 {
                    high = high.min(foot[0] - down / sr);
                } else {
                    low = low.max(foot[0] - down / sr);
                }
                let (low, high) = (low + 0.5, (high + 0.5).min(width as f64));
                let mut x = low.max(0.0);
                while x < high {
                    let end = (x.floor() + 1.0).min(high);
                    out[x as usize] += (end - x) / SUBROWS as f64;
                    x = end;
                }
            }
        }
        out
    }
}

/// How one silhouette compares with the truth.
struct Comparison {
    iou: f64,
    /// Relative error of the area.
    area: f64,
    /// Square pixels too many within [`CONTACT_ROWS`] of the pedestal's top, and above them.
    contact_px: f64,
    above_px: f64,
    /// Relative error of the areas that plain Otsu gives, with two classes and with three.
    otsu: [f64; 2],
}

fn compare(truth: &[f64], camera: &Camera, found: &Segmentation) -> Comparison {
    let s = &found.silhouette;
    let [width, height] = s.picture;
    let (mut both, mut either, mut area) = (0_u32, 0_u32, 0.0);
    let mut off = [0.0; 2];
    for y in 0..height {
        for x in 0..width {
            let covered = truth[y * width + x];
            let (a, b) = (covered >= 0.5, s.contains(x, y));
            both += u32::from(a && b);
            either += u32::from(a || b);
            let share = (0.5 - s.signed_distance_px([x as f64, y as f64])).clamp(0.0, 1.0);
            area += covered;
            let lean = (x as f64 - camera.foot[0]) * camera.roll.tan();
            off[usize::from(y as f64 + lean + CONTACT_ROWS < camera.foot[1])] += share - covered;
        }
    }
    Comparison {
        iou: f64::from(both) / f64::from(either),
        area: s.area_px() / area - 1.0,
        contact_px: off[0],
        above_px: off[1],
        otsu: [found.report.area_otsu_two_px, found.report.area_otsu_three_px].map(|a| a / area - 1.0),
    }
}

/// A shift of the whole outline by a thirtieth of a pixel changes the area of these grains by 0.02 %.
#[test]
fn rendered_silhouettes_cover_what_the_grain_covers() {
    let Some(folder) = data() else { return };
    let truth = Truth::read(&folder);
    let empty = picture(&folder.join("empty.png"));
    let pictures: Vec<Picture> = truth.views.iter().map(|v| picture(&folder.join(&v.name))).collect();
    let coverages: Vec<Vec<f64>> = (truth.views.iter().zip(&pictures))
        .map(|(v, p)| truth.coverage(v, [p.width(), p.height()]))
        .collect();
    for (what, background) in [("without a background", None), ("with a background", Some(&empty))] {
        let all: Vec<Comparison> = (pictures.iter().zip(&coverages))
            .map(|(picture, coverage)| {
                let found =
                    find(picture, background.map(|b| b as &dyn Source), &Settings::default()).unwrap();
                let c = compare(coverage, &truth.camera, &found);
                println!("IoU {:.5}, area {:+.3} %", c.iou, 100.0 * c.area);
                c
            })
            .collect();
        let mean = |f: fn(&Comparison) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        let (iou, bias) = (mean(|c| c.iou), mean(|c| c.area));
        let least = all.iter().map(|c| c.iou).fold(1.0, f64::min);
        let worst = all.iter().map(|c| c.area.abs()).fold(0.0, f64::max);
        println!(
            "{what}: IoU {iou:.5} (least {least:.5}), area {:+.3} % (worst {:.3} %); contact {:+.1} px, above {:+.1} px",
            100.0 * bias,
            100.0 * worst,
            mean(|c| c.contact_px),
            mean(|c| c.above_px)
        );
        let (two, three) = (mean(|c| c.otsu[0]), mean(|c| c.otsu[1]));
        println!(
            "{what}: plain Otsu's area {:+.3} % (two classes), {:+.3} % (three)",
            100.0 * two,
            100.0 * three
        );
        assert!(iou >= 0.997, "{what}: IoU {iou}");
        assert!(bias.abs() <= 0.002, "{what}: area {bias}");
    }
}
