//! The drawings among the products: outlines over the photographs, the sheet of the calibration.

use crate::kit::{Lab, files, read};
use grainrig_core::report::{Marks, Shot};
use grainrig_core::silhouette::{Picture, Settings, find};
use image::RgbImage;
use std::path::Path;

fn picture(path: &Path) -> RgbImage {
    image::load_from_memory(&read(path)).unwrap().into_rgb8()
}

/// The outline's colour, as far as it is laid over the photograph's.
fn is_outline(p: image::Rgb<u8>) -> bool {
    let [r, g, b] = p.0.map(i32::from);
    r > 180 && g < 90 && b > 90
}

fn is_drawing(name: &str) -> bool {
    ["outline_", "calibration", "convergence"].iter().any(|drawing| name.starts_with(drawing))
}

#[test]
fn every_view_has_its_outline_on_the_edge_of_the_grain() {
    let lab = Lab::new();
    let result = lab.run(&["--config", "small.toml", "--json", "capture", "a"]).succeeds().json();
    let products = lab.session("a").join("products");
    let outlines: Vec<String> = files(&products).into_iter().filter(|f| f.starts_with("outline_")).collect();
    assert_eq!(outlines.len(), lab.recording("a").views().len());
    for file in &outlines {
        let path = result["products"][file.trim_end_matches(".png")].as_str().unwrap();
        assert_eq!(Path::new(path), products.canonicalize().unwrap().join(file));
        let drawn = picture(&products.join(file));
        assert!(drawn.width().max(drawn.height()) <= 1100, "{file}: {:?}", drawn.dimensions());
        // Row by row from the left: bright background, the outline, the darker grain; half of their light is a grey value of 165.
        let (mut rows, mut between) = (0, 0);
        for y in (0..drawn.height() - 30).step_by(7) {
            let Some(x) = (12..drawn.width() - 12).find(|x| is_outline(*drawn.get_pixel(*x, y))) else {
                continue;
            };
            let level = |x: u32| drawn.get_pixel(x, y).0[1];
            rows += 1;
            between += usize::from(level(x - 8) > 165 && level(x + 10) < 165);
        }
        assert!(rows > 20 && 10 * between >= 9 * rows, "{file}: {between} of {rows} rows");
    }
    let sheet = picture(&products.join("calibration.png"));
    assert!(sheet.width() == 1200 && sheet.height() > 600);
    let text = String::from_utf8(read(&products.join("calibration.svg"))).unwrap();
    for part in ["<svg", "mm per pixel at the axis", "axis: column", "Otsu, 2", "ends of the outline"] {
        assert!(text.contains(part), "{part}");
    }
    assert!(result["products"]["calibration"].as_str().unwrap().ends_with("calibration.svg"));
    let sheet = picture(&products.join("convergence.png"));
    assert!(sheet.width() == 1200 && sheet.height() > 360);
    assert!(result["products"]["convergence_png"].as_str().unwrap().ends_with("convergence.png"));
    let hull = &result["hull"];
    let steps = hull["convergence"].as_array().unwrap();
    let [views, volumes]: [Vec<f64>; 2] =
        ["views", "volume_mm3"].map(|name| steps.iter().map(|s| s[name].as_f64().unwrap()).collect());
    assert!(views[0] < 2.5 && views.is_sorted(), "{views:?}");
    assert_eq!(views.last().copied(), result["views"].as_f64());
    assert_eq!(volumes.last().copied(), hull["volume_mm3"].as_f64());
    assert!(volumes[0] > 1.1 * volumes[volumes.len() - 1], "{volumes:?}");

    lab.run(&["replay", "a"]).succeeds();
    lab.assert_sound("a");
    std::fs::remove_file(products.join("outline_01.png")).unwrap();
    lab.run(&["replay", "a"]).succeeds();
    lab.assert_sound("a");
}

#[test]
fn who_wants_no_pictures_gets_none() {
    let lab = Lab::new();
    lab.run(&["--config", "small.toml", "capture", "a", "--no-pictures"]).succeeds();
    let products = lab.session("a").join("products");
    assert!(!files(&products).iter().any(|f| is_drawing(f)), "{:?}", files(&products));
    lab.run(&["replay", "a"]).succeeds();
    lab.photos("photos");
    lab.import("photos", &["--no-pictures", "--name", "b"]).succeeds();
    assert!(!files(&lab.session("b").join("products")).iter().any(|f| is_drawing(f)));
    lab.import("photos", &["--name", "c"]).succeeds();
    assert!(files(&lab.session("c").join("products")).iter().any(|f| is_drawing(f)));
    lab.run(&["reconstruct", "c", "--no-pictures"]).succeeds();
    lab.run(&["replay", "c"]).succeeds();
}

/// A dark disc before a bright background.
fn disc(size: [usize; 2], [x, y]: [f64; 2], radius: f64) -> Picture {
    let level = |k: usize| {
        let d = ((k % size[0]) as f64 - x).hypot((k / size[0]) as f64 - y) - radius;
        (150.0 + 70.0 * (d / 1.5).clamp(-1.0, 1.0)).round() as u8
    };
    Picture::new(size[0], size[1], 1, (0..size[0] * size[1]).map(level).collect()).unwrap()
}

#[test]
fn the_outline_is_drawn_where_it_is_at_every_size() {
    for (size, center, radius, scale) in
        [([3000, 2400], [1470.0, 1210.0], 950.0, 1.0 / 3.0), ([700, 600], [340.0, 301.0], 60.0, 4.0)]
    {
        let photo = disc(size, center, radius);
        let found = find(&photo, None, &Settings::default()).unwrap();
        let marks = Marks { pedestal: None, axis: None, caption: "a disc" };
        let png = Shot::of(&photo, &found.silhouette).drawn(&found.silhouette, &marks).unwrap();
        let drawn = image::load_from_memory(&png).unwrap().into_rgb8();
        let pink: Vec<[f64; 2]> = (drawn.enumerate_pixels())
            .filter(|(_, _, p)| is_outline(**p))
            .map(|(x, y, _)| [f64::from(x), f64::from(y)])
            .collect();
        let n = pink.len() as f64;
        assert!(n > 2.0 * radius * scale, "{n} px");
        let middle = [0, 1].map(|k| pink.iter().map(|p| p[k]).sum::<f64>() / n);
        let mean = pink.iter().map(|p| (p[0] - middle[0]).hypot(p[1] - middle[1])).sum::<f64>() / n;
        assert!((mean - radius * scale).abs() < 0.6, "{mean} px instead of {}", radius * scale);
    }
}
