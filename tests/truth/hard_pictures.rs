//! Pictures as a laboratory takes them: what must not change the outline is put into pictures of the simulated rig (and
//! into rendered ones, where they are there), and the outline's area is held against that of the clean picture.

use crate::skip::shared_data;
use grainrig::rig::simulated::{self, Settings as Rig};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig_core::formats::decode;
use grainrig_core::geometry::Angle;
use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use grainrig_core::silhouette::{Picture, Segmentation, Settings, find};
use rayon::prelude::*;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, OnceLock};

/// Reproducible numbers between 0 and 1.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }
}

struct Clean {
    name: String,
    picture: Picture,
    found: Segmentation,
}

/// Grains before a bright and before a dark background; rendered ones too, where they are there.
fn clean() -> &'static [Clean] {
    static CLEAN: OnceLock<Vec<Clean>> = OnceLock::new();
    CLEAN.get_or_init(|| {
        let mut pictures = Vec::new();
        for (seed, bright_background) in [(1, true), (2, true), (5, false)] {
            let rig = Rig { seed, bright_background, width: 1000, height: 760, ..Rig::default() };
            let (mut stage, mut camera, _) = simulated::open(&rig).unwrap();
            stage.home().unwrap();
            for turn in [0.0, 57.6, 115.2] {
                stage.move_to(Angle::from_deg(turn)).unwrap();
                let bytes = camera.capture().unwrap().bytes;
                let name = if bright_background { "bright" } else { "dark" };
                pictures.push((format!("{name} {seed} at {turn}°"), decode(&bytes).unwrap()));
            }
        }
        if let Some(folder) = shared_data("turntable-rendered/sand_ma107_00002") {
            for k in [0, 9, 17] {
                let name = format!("grain_{k:02}.png");
                pictures.push((name.clone(), decode(&std::fs::read(folder.join(&name)).unwrap()).unwrap()));
            }
        }
        let cut = |(name, picture)| Clean { name, found: seen(&picture), picture };
        pictures.into_par_iter().map(cut).collect()
    })
}

fn seen(picture: &Picture) -> Segmentation {
    find(picture, None, &Settings::default()).unwrap()
}

/// A picture with every channel of every pixel changed by a function of its column, row and value.
fn changed(picture: &Picture, mut change: impl FnMut(f64, f64, f64) -> f64) -> Picture {
    let (w, c) = (picture.width(), picture.channels());
    let data = (picture.data().iter().enumerate())
        .map(|(k, &v)| {
            let level = change((k / c % w) as f64, (k / c / w) as f64, f64::from(v));
            level.round().clamp(0.0, 255.0) as u8
        })
        .collect();
    Picture::new(w, picture.height(), c, data).unwrap()
}

/// The outline's area in each clean picture is kept, to `limit`, when the picture is disturbed; side by side.
fn keeps_its_area(what: &str, limit: f64, disturb: impl Fn(usize, &Clean) -> Picture + Sync) {
    let off: Vec<f64> = (clean().par_iter().enumerate())
        .map(|(k, one)| seen(&disturb(k, one)).report.area_px / one.found.report.area_px - 1.0)
        .collect();
    let mut worst = (0.0_f64, "");
    for (off, one) in off.into_iter().zip(clean()) {
        if off.abs() >= worst.0.abs() {
            worst = (off, &one.name);
        }
        if off.abs() > limit {
            println!("{what}, {}: {:+.3} %", one.name, 100.0 * off);
        }
    }
    println!("{what}: at most {:+.3} % ({})", 100.0 * worst.0, worst.1);
    assert!(worst.0.abs() <= limit, "{what}: the area of {} changes by {:+.3} %", worst.1, 100.0 * worst.0);
}

/// Raw carving lost 13 % of a wheat seed's volume to salt and pepper in 0.2 to 1 % of the pixels (Roussel et al. 2016).
#[test]
fn salt_and_pepper_leave_the_outline_where_it_is() {
    for share in [0.002, 0.005, 0.01] {
        keeps_its_area(&format!("{} % salt and pepper", 100.0 * share), 0.005, |k, one| {
            struck(&one.picture, share, 17 + k as u64)
        });
    }
}

/// Every so many pixels of a picture, at random, black or white.
fn struck(picture: &Picture, share: f64, seed: u64) -> Picture {
    let (w, mut chance) = (picture.width(), Chance(seed));
    let fates: Vec<f64> = (0..w * picture.height()).map(|_| chance.next() / share).collect();
    changed(picture, |x, y, v| match fates[y as usize * w + x as usize] {
        u if u < 0.5 => 0.0,
        u if u < 1.0 => 255.0,
        _ => v,
    })
}

/// The hull's volume in mm³ of a folder of rendered views, of which every other one and the closing one are taken, by
/// `grainrig import`.
fn imported_volume(folder: &Path) -> f64 {
    let home = tempfile::tempdir().unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .arg("--data")
        .arg(home.path())
        // No configuration of whoever runs this.
        .env("XDG_CONFIG_HOME", home.path())
        .args(["--json", "import"])
        .arg(folder)
        .args(["--pattern", "grain_{?[02468],25}.png", "--name", "one", "--step-deg", "14.4"])
        .args(["--closing-view", "13", "--no-pictures", "--surface-size-mm", "0.2"])
        .args(["--mm-per-px", "0.00437", "--camera-distance-mm", "120", "--background"])
        .arg(folder.join("empty.png"))
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let result: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    result["hull"]["volume_mm3"].as_f64().unwrap()
}

#[test]
fn salt_and_pepper_leave_the_volume_of_an_imported_grain_as_it_is() {
    let Some(folder) = shared_data("turntable-rendered/sand_ma107_00002") else { return };
    let clean = imported_volume(&folder);
    let views = (0..26).step_by(2).chain([25]);
    let mut names: Vec<String> = views.map(|k| format!("grain_{k:02}.png")).collect();
    names.push("empty.png".into());
    for share in [0.002, 0.005, 0.01] {
        let noisy = tempfile::tempdir().unwrap();
        for (seed, name) in (1..).zip(&names) {
            let picture = decode(&std::fs::read(folder.join(name)).unwrap()).unwrap();
            let clean = picture.data().to_vec();
            let picture = struck(&picture, share, seed);
            let hit = picture.data().iter().zip(&clean).filter(|(a, b)| a != b).count();
            let hit = hit as f64 / clean.len() as f64;
            assert!((0.9 * share..1.1 * share).contains(&hit), "{name}: {hit} of the pixels");
            let colour = if picture.channels() == 1 { image::ColorType::L8 } else { image::ColorType::Rgb8 };
            let [w, h] = [picture.width() as u32, picture.height() as u32];
            image::save_buffer(noisy.path().join(name), picture.data(), w, h, colour).unwrap();
        }
        let off = imported_volume(noisy.path()) / clean - 1.0;
        println!("{} % salt and pepper: volume {:+.3} %", 100.0 * share, 100.0 * off);
        assert!(off.abs() <= 0.005, "{} %: the volume changes by {:+.3} %", 100.0 * share, 100.0 * off);
    }
}

/// A place on the outline's right side, at a share of its height from its top, and the grain's longer side.
fn right_side(found: &Segmentation, share: f64) -> ([f64; 2], f64) {
    let s = &found.silhouette;
    let extents = s.extents_px();
    let filled: Vec<usize> = (0..extents.len()).filter(|&k| extents[k].is_some()).collect();
    let row = filled[(share * (filled.len() - 1) as f64) as usize];
    let columns: Vec<[f64; 2]> = extents.iter().flatten().copied().collect();
    let left = columns.iter().map(|c| c[0]).fold(f64::INFINITY, f64::min);
    let right = columns.iter().map(|c| c[1]).fold(0.0, f64::max);
    ([extents[row].unwrap()[1], (s.origin[1] + row) as f64], (right - left).max(filled.len() as f64))
}

/// The grey level at the middle of the grain.
fn grain_level(one: &Clean) -> f64 {
    let s = &one.found.silhouette;
    let (x, y) = (s.origin[0] + s.size[0] / 2, s.origin[1] + s.size[1] / 2);
    f64::from(one.picture.data()[(y * one.picture.width() + x) * one.picture.channels()])
}

/// Draws discs of a level with an edge one pixel wide, each over those before.
fn with_discs(picture: &Picture, places: &[[f64; 2]], radius: f64, level: f64) -> Picture {
    changed(picture, |x, y, old| {
        let near = |[u, v]: &&[f64; 2]| (x - u).abs() < radius + 1.0 && (y - v).abs() < radius + 1.0;
        let share = |[u, v]: &[f64; 2]| (0.5 + radius - (x - u).hypot(y - v)).clamp(0.0, 1.0);
        // Each is drawn into a picture of whole levels.
        let draw = |old: f64, place| (old + share(place) * (level - old)).round();
        places.iter().filter(near).fold(old, draw)
    })
}

#[test]
fn dust_beside_the_grain_is_not_the_grain() {
    for gap in [2.0, 4.0, 8.0, 20.0] {
        for radius in [1.5, 4.0, 8.0] {
            keeps_its_area(&format!("dust of {radius} px at {gap} px"), 0.005, |_, one| {
                let s = &one.found.silhouette;
                let extents = s.extents_px();
                let places = [0.1, 0.35, 0.6].map(|share| {
                    let ([u, v], _) = right_side(&one.found, share);
                    // To the right of the rightmost column of these rows, so that the gap is that or more.
                    let near = (v as isize - 12..v as isize + 12)
                        .filter_map(|row| extents.get((row - s.origin[1] as isize) as usize)?.map(|e| e[1]))
                        .fold(u, f64::max);
                    [near + gap + radius, v]
                });
                with_discs(&one.picture, &places, radius, grain_level(one))
            });
        }
    }
}

#[test]
fn a_highlight_in_the_grain_or_on_its_edge_is_not_a_hole() {
    for (what, inside, limit) in
        [("well inside", 40.0, 0.002), ("near the edge", 14.0, 0.005), ("on the edge", 5.0, 0.005)]
    {
        for radius in [4.0, 9.0] {
            keeps_its_area(&format!("a highlight of {radius} px {what}"), limit, |_, one| {
                [0.3, 0.5].iter().fold(one.picture.clone(), |p, share| {
                    let ([u, v], _) = right_side(&one.found, *share);
                    changed(&p, |x, y, old| {
                        let share = (0.5 + radius - (x - u + inside).hypot(y - v)).clamp(0.0, 1.0);
                        if share == 0.0 {
                            return old;
                        }
                        // Only the grain shines.
                        let covered = (0.5 - one.found.silhouette.signed_distance_px([x, y])).clamp(0.0, 1.0);
                        old + covered * share * (255.0 - old)
                    })
                })
            });
        }
    }
}

#[test]
fn another_object_in_the_picture_is_not_the_grain() {
    for (what, size) in [("smaller", 0.4), ("of the same size", 1.05)] {
        keeps_its_area(&format!("another object, {what}"), 0.005, |_, one| {
            let s = &one.found.silhouette;
            let radius = 0.5 * size * (4.0 / std::f64::consts::PI * one.found.report.area_px).sqrt();
            let gap = 0.5 * radius;
            let left = [s.origin[0] as f64 - gap - radius, (s.origin[1] + s.size[1] / 2) as f64];
            // Rendered pictures are filled by their grain: only what fits.
            let fits = left[0] - radius > 8.0 && left[1] - radius > 8.0;
            if fits {
                with_discs(&one.picture, &[left], radius, grain_level(one))
            } else {
                one.picture.clone()
            }
        });
    }
}

#[test]
fn corners_in_the_dark_leave_the_outline_where_it_is() {
    for fall in [0.4, 0.6] {
        keeps_its_area(&format!("corners darker by {fall}"), 0.005, |_, one| {
            let (w, h) = (one.picture.width() as f64, one.picture.height() as f64);
            changed(&one.picture, |x, y, v| {
                let r2 = (x / w - 0.5).powi(2) * 2.0 + (y / h - 0.5).powi(2) * 2.0;
                v * (1.0 - fall * (0.7 * r2 + 0.3 * r2 * r2))
            })
        });
    }
}

#[test]
fn a_file_of_poor_quality_leaves_the_outline_where_it_is() {
    for quality in [75, 50] {
        keeps_its_area(&format!("JPEG of quality {quality}"), 0.005, |_, one| {
            let p = &one.picture;
            let colour =
                if p.channels() == 1 { image::ExtendedColorType::L8 } else { image::ExtendedColorType::Rgb8 };
            let mut bytes = Vec::new();
            image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality)
                .encode(p.data(), p.width() as u32, p.height() as u32, colour)
                .unwrap();
            decode(&bytes).unwrap()
        });
    }
}

/// The hull of simulated views under their true cameras changes by no more than half a percent.
#[test]
fn salt_and_pepper_leave_the_hull_its_volume() {
    let rig = Rig { width: 480, height: 420, ..Rig::default() };
    let (mut stage, mut camera, truth) = simulated::open(&rig).unwrap();
    stage.home().unwrap();
    let views: Vec<_> = (0..12)
        .map(|k| {
            stage.move_to(Angle::from_deg(14.4 * f64::from(k))).unwrap();
            let picture = decode(&camera.capture().unwrap().bytes).unwrap();
            let exposure = truth.truth().exposures.pop().unwrap();
            (picture, truth.projection(Angle::from_deg(exposure.true_angle_deg), exposure.wobble_px))
        })
        .collect();
    let mut chance = Chance(29);
    let mut volume = |share: f64| {
        let cones: Vec<Cone> = (views.iter())
            .map(|(picture, projection)| {
                let w = picture.width();
                let struck: Vec<Option<f64>> = (0..w * picture.height())
                    .map(|_| {
                        let u = chance.next() / share;
                        (u < 1.0).then_some(if u < 0.5 { 0.0 } else { 255.0 })
                    })
                    .collect();
                let picture = changed(picture, |x, y, v| struck[y as usize * w + x as usize].unwrap_or(v));
                Cone::new(projection.clone(), Arc::new(seen(&picture).silhouette))
            })
            .collect();
        let mut grid = HullGrid::new(&find_bounds(&cones).unwrap(), 2.0 * rig.mm_per_px).unwrap();
        cones.iter().for_each(|cone| grid.carve(cone));
        grid.measures().volume_mm3
    };
    let clean = volume(0.0);
    for share in [0.002, 0.005, 0.01] {
        let off = volume(share) / clean - 1.0;
        println!("{} % salt and pepper: volume {:+.3} %", 100.0 * share, 100.0 * off);
        assert!(off.abs() <= 0.005, "{off}");
    }
}
