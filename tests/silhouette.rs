//! Silhouettes of pictures whose outline is known.

use grainrig::rig::{Camera as _, RotationStage as _, simulated};
use grainrig_core::formats::{Photograph, decode};
use grainrig_core::geometry::Angle;
use grainrig_core::silhouette::{
    Channel, Holes, PedestalMode, Picture, Polarity, Segmentation, Settings, Silhouette, SilhouetteError,
    Source, find,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::PI;

const SIZE: [usize; 2] = [320, 260];

/// Reproducible noise of about unit standard deviation (sum of four uniform numbers).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.uniform()).sum::<f64>() - 2.0) * 3f64.sqrt()
    }
}

/// How a synthetic scene is lit and seen.
#[derive(Clone, Copy)]
struct Scene {
    /// Colours (one for grey) of background and grain.
    background: [f64; 3],
    grain: [f64; 3],
    channels: usize,
    /// Width of the blurred edge: the standard deviation of the blur, pixels.
    blur: f64,
    noise: f64,
    /// Grey levels that the background falls from one corner to the opposite one.
    fall: f64,
}

const BACKLIT: Scene =
    Scene { background: [220.0; 3], grain: [60.0; 3], channels: 1, blur: 0.7, noise: 1.0, fall: 0.0 };

/// Share of a pixel's light that comes from inside an edge `distance` pixels away (negative inside): the
/// normal distribution's integral, to 1e-7 (Abramowitz & Stegun 1964, 7.1.26).
fn covered(distance: f64, blur: f64) -> f64 {
    let x = distance / blur.max(0.05) / 2f64.sqrt();
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let tail = 0.5 * poly * (-x * x).exp();
    if x > 0.0 { tail } else { 1.0 - tail }
}

/// A picture of what `distance` (pixels, negative inside) outlines.
fn paint(scene: &Scene, distance: impl Fn(f64, f64) -> f64) -> Picture {
    let [w, h] = SIZE;
    let mut noise = Noise(7);
    let mut data = Vec::with_capacity(w * h * scene.channels);
    for y in 0..h {
        for x in 0..w {
            let share = covered(distance(x as f64, y as f64), scene.blur);
            let light = scene.fall * (0.5 - 0.5 * (x as f64 / w as f64 + y as f64 / h as f64));
            for c in 0..scene.channels {
                let behind = scene.background[c] + light;
                let level = behind + share * (scene.grain[c] - behind) + scene.noise * noise.normal();
                data.push(level.round().clamp(0.0, 255.0) as u8);
            }
        }
    }
    Picture::new(w, h, scene.channels, data).unwrap()
}

fn disc(centre: [f64; 2], radius: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| (x - centre[0]).hypot(y - centre[1]) - radius
}

fn seen(picture: &Picture) -> Segmentation {
    find(picture, None, &Settings::default()).unwrap()
}

fn assert_area(found: &Segmentation, expected: f64, what: &str) {
    let off = found.report.area_px / expected - 1.0;
    assert!(off.abs() < 0.002, "{what}: area off by {:.3} %", 100.0 * off);
    assert!((found.silhouette.area_px() / expected - 1.0).abs() < 0.002, "{what}");
}

/// The noise-free, the noisy, the sharp, the unsharp, either polarity, colours.
fn scenes() -> Vec<(&'static str, Scene)> {
    let dark = Scene { background: [12.0; 3], grain: [180.0; 3], ..BACKLIT };
    let colour = |background, grain| Scene { background, grain, channels: 3, ..BACKLIT };
    vec![
        ("no noise", Scene { noise: 0.0, ..BACKLIT }),
        ("noise 1", BACKLIT),
        ("noise 4", Scene { noise: 4.0, ..BACKLIT }),
        ("sharp", Scene { blur: 0.3, ..BACKLIT }),
        ("blur 1.5", Scene { blur: 1.5, ..BACKLIT }),
        ("blur 3", Scene { blur: 3.0, ..BACKLIT }),
        ("bright grain", dark),
        ("bright grain, blur 2", Scene { blur: 2.0, ..dark }),
        ("uneven background", Scene { fall: 60.0, ..BACKLIT }),
        ("blue screen", colour([70.0, 80.0, 160.0], [150.0, 100.0, 60.0])),
        ("green screen", colour([60.0, 160.0, 70.0], [140.0, 110.0, 90.0])),
        ("same brightness, other colour", colour([70.0, 80.0, 160.0], [110.0, 70.0, 80.0])),
        ("grey in colour", colour([220.0; 3], [60.0; 3])),
    ]
}

#[test]
fn a_disc_and_an_ellipse_have_their_area_in_any_light() {
    for (name, scene) in scenes() {
        let picture = paint(&scene, disc([161.3, 128.7], 70.0));
        assert_area(&seen(&picture), PI * 70.0 * 70.0, name);
        // An ellipse; its distance to first order, which is exact enough within the blur.
        let (a, b, (s, c)) = (85.0, 50.0, 0.5f64.sin_cos());
        let picture = paint(&scene, |x, y| {
            let (x, y) = (x - 158.0, y - 131.0);
            let (u, v) = (x * c + y * s, y * c - x * s);
            let f = (u / a).hypot(v / b).max(1e-9);
            (f - 1.0) * f / (u / (a * a)).hypot(v / (b * b)).max(1e-9)
        });
        assert_area(&seen(&picture), PI * a * b, name);
    }
}

#[test]
fn a_background_picture_takes_out_any_light_and_must_fit() {
    // A light that no smooth surface follows.
    let light = |x: f64, y: f64| 25.0 * (x / 23.0).sin() * (y / 31.0).cos();
    let scene = Scene { noise: 0.0, ..BACKLIT };
    let lit = |distance: &dyn Fn(f64, f64) -> f64| {
        let flat = paint(&scene, distance);
        let data = (flat.data().iter().enumerate())
            .map(|(k, &v)| {
                let share = (f64::from(v) - 60.0) / 160.0;
                let (x, y) = ((k % SIZE[0]) as f64, (k / SIZE[0]) as f64);
                (f64::from(v) + share * light(x, y)).round() as u8
            })
            .collect();
        Picture::new(SIZE[0], SIZE[1], 1, data).unwrap()
    };
    let empty = lit(&|_, _| 1e3);
    let picture = lit(&disc([161.3, 128.7], 70.0));
    let found = find(&picture, Some(&empty), &Settings::default()).unwrap();
    assert_area(&found, PI * 70.0 * 70.0, "background picture");
    let small = Picture::new(32, 32, 1, vec![200; 1024]).unwrap();
    let error = find(&picture, Some(&small), &Settings::default()).unwrap_err();
    assert!(error.to_string().contains("32") && error.to_string().contains("320"), "{error}");
}

/// A disc that stands 3 px deep in a pedestal with its top at a row.
fn on_pedestal(top: f64, half_width: f64) -> Picture {
    let centre = [160.0, top - 67.0];
    let pedestal = move |x: f64, y: f64| (top - y).max((x - 160.0).abs() - half_width);
    let mut picture = paint(&BACKLIT, disc(centre, 70.0)).data().to_vec();
    let mut noise = Noise(11);
    for (k, v) in picture.iter_mut().enumerate() {
        let (x, y) = ((k % SIZE[0]) as f64, (k / SIZE[0]) as f64);
        let share = covered(pedestal(x, y), BACKLIT.blur);
        let level = f64::from(*v) + share * (25.0 + noise.normal() - f64::from(*v));
        *v = level.round().clamp(0.0, 255.0) as u8;
    }
    Picture::new(SIZE[0], SIZE[1], 1, picture).unwrap()
}

#[test]
fn a_pedestal_is_cut_off_at_its_top() {
    let (top, half_width) = (210.4, 30.0);
    let picture = on_pedestal(top, half_width);
    let found = seen(&picture);
    let pedestal = found.report.pedestal.expect("a pedestal");
    assert!((pedestal.top_row - top).abs() < 0.15, "{pedestal:?}");
    assert!((pedestal.centre_column - 160.0).abs() < 0.2, "{pedestal:?}");
    assert!((pedestal.half_width - half_width).abs() < 0.3, "{pedestal:?}");
    // The disc without the segment 3 px high that stands in the pedestal.
    let angle = (67.0f64 / 70.0).acos();
    let segment = 70.0 * 70.0 * (angle - angle.sin() * angle.cos());
    assert_area(&found, PI * 70.0 * 70.0 - segment, "on a pedestal");
    let keep = Settings { pedestal: PedestalMode::None, ..Settings::default() };
    let whole = find(&picture, None, &keep).unwrap();
    assert!(whole.report.pedestal.is_none());
    assert!(whole.report.area_px > found.report.area_px + 2000.0);
    assert_eq!(whole.report.touches_border, [false, false, false, true]);
}

#[test]
fn salt_pepper_and_dust_do_not_change_the_outline() {
    let mut noise = Noise(3);
    let grain = disc([161.3, 128.7], 70.0);
    let dust: Vec<[f64; 2]> = vec![[20.0, 30.0], [290.0, 60.0], [40.0, 220.0], [262.0, 128.0], [160.0, 25.0]];
    let clean = paint(&BACKLIT, |x, y| dust.iter().map(|d| disc(*d, 4.0)(x, y)).fold(grain(x, y), f64::min));
    let data: Vec<u8> = (clean.data().iter())
        .map(|&v| match noise.uniform() {
            u if u < 0.002 => 0,
            u if u > 0.998 => 255,
            _ => v,
        })
        .collect();
    let found = seen(&Picture::new(SIZE[0], SIZE[1], 1, data).unwrap());
    assert_area(&found, PI * 70.0 * 70.0, "salt, pepper and dust");
    for d in dust {
        assert!(!found.silhouette.contains(d[0] as usize, d[1] as usize), "dust at {d:?}");
    }
}

#[test]
fn what_plain_otsu_gives_is_stated_beside_the_outline() {
    let report = seen(&paint(&BACKLIT, disc([161.3, 128.7], 70.0))).report;
    assert!((report.outline_length_px / (2.0 * PI * 70.0) - 1.0).abs() < 0.005, "{report:?}");
    // In even light half-way is half-way: the pixels that are counted make up the disc.
    for (area, shift) in [
        (report.area_otsu_two_px, report.shift_otsu_two_px),
        (report.area_otsu_three_px, report.shift_otsu_three_px),
    ] {
        assert!((shift - (area - report.area_px) / report.outline_length_px).abs() < 1e-9);
    }
    assert!((report.area_otsu_two_px / (PI * 4900.0) - 1.0).abs() < 0.003, "{report:?}");
    // On a pedestal the same disc is cut at the same top, and a speck far off does not count.
    let found = seen(&on_pedestal(210.4, 30.0));
    assert!(found.report.shift_otsu_two_px.abs() < 0.2, "{:?}", found.report);
}

#[test]
fn a_hole_is_kept_or_filled_as_set() {
    let ring = |x: f64, y: f64| disc([160.0, 130.0], 80.0)(x, y).max(-disc([150.0, 140.0], 25.0)(x, y));
    let blue = Scene { background: [70.0, 80.0, 160.0], grain: [150.0, 100.0, 60.0], channels: 3, ..BACKLIT };
    let (whole, hole) = (PI * 6400.0, PI * 625.0);
    let area = |scene: &Scene, holes: Holes, expected: f64, open: usize| {
        let settings = Settings { holes, ..Settings::default() };
        let found = find(&paint(scene, ring), None, &settings).unwrap();
        assert_area(&found, expected, &format!("{holes:?}"));
        assert_eq!(found.report.holes_open, open);
    };
    // By brightness alone a clear grain's highlight cannot be told from a gap: filled unless asked for.
    area(&BACKLIT, Holes::Auto, whole, 0);
    area(&BACKLIT, Holes::Fill, whole, 0);
    area(&BACKLIT, Holes::Background, whole - hole, 1);
    area(&blue, Holes::Auto, whole - hole, 1);
    area(&blue, Holes::Fill, whole, 0);
}

#[test]
fn a_side_in_the_shade_belongs_to_the_grain() {
    // The light falls to a tenth from right to left.
    let (dark, lit) = (10.0, 200.0);
    let grain = disc([160.0, 130.0], 80.0);
    let mut noise = Noise(5);
    let data = (0..SIZE[0] * SIZE[1])
        .map(|k| {
            let (x, y) = ((k % SIZE[0]) as f64, (k / SIZE[0]) as f64);
            let light = 0.1 + 0.9 * ((x - 80.0) / 160.0).clamp(0.0, 1.0);
            let level = dark + covered(grain(x, y), 0.8) * lit * light + noise.normal();
            level.round().clamp(0.0, 255.0) as u8
        })
        .collect();
    let found = seen(&Picture::new(SIZE[0], SIZE[1], 1, data).unwrap());
    let off = found.report.area_px / (PI * 6400.0) - 1.0;
    assert!(off.abs() < 0.005, "{off}");
    assert!(found.report.threshold_used < 0.5 * found.report.threshold_two);
    // The published threshold cuts the shaded side off.
    assert!(found.report.area_otsu_two_px < 0.95 * PI * 6400.0, "{}", found.report.area_otsu_two_px);
    assert!(found.report.shift_otsu_two_px < -1.0);
}

#[test]
fn without_a_grain_the_error_says_what_was_seen_and_what_to_do() {
    let empty = paint(&BACKLIT, |_, _| 1e3);
    let error = find(&empty, None, &Settings::default()).unwrap_err();
    let SilhouetteError::NoContrast { contrast, limit, .. } = error else { panic!("{error}") };
    assert!(contrast < limit);
    let text = error.to_string();
    assert!(text.contains(&format!("{limit:.1}")) && text.contains("check the lamp"), "{text}");
    let dust = paint(&BACKLIT, disc([100.0, 100.0], 5.0));
    let error = find(&dust, None, &Settings::default()).unwrap_err();
    let text = error.to_string();
    let small = |area: f64, limit: f64| area < 120.0 && limit > 399.0;
    let value = matches!(error, SilhouetteError::TooSmall { area_px, limit_px } if small(area_px, limit_px));
    assert!(value && text.contains("400 px") && text.contains("min_area_px"), "{text}");
    let bad = Settings { min_area_px: f64::NAN, ..Settings::default() };
    assert!(matches!(find(&empty, None, &bad), Err(SilhouetteError::Setting { name: "min_area_px", .. })));
    let colour = Settings { channel: Channel::RedMinusBlue, ..Settings::default() };
    assert!(matches!(find(&empty, None, &colour), Err(SilhouetteError::NoColour { .. })));
}

#[test]
fn a_grain_cut_by_the_border_is_told() {
    for (k, centre) in [[20.0, 130.0], [300.0, 130.0], [160.0, 20.0], [160.0, 245.0]].into_iter().enumerate()
    {
        let found = seen(&paint(&BACKLIT, disc(centre, 60.0)));
        let expected: [bool; 4] = std::array::from_fn(|side| side == k);
        assert_eq!(found.report.touches_border, expected, "{centre:?}");
        // Outside the picture is background: the outline closes there.
        let beyond = [-5.0, 325.0, -5.0, 265.0][k];
        let place = if k < 2 { [beyond, 130.0] } else { [160.0, beyond] };
        assert!(found.silhouette.signed_distance_px(place) > 0.0);
    }
    let found = seen(&paint(&BACKLIT, disc([160.0, 130.0], 60.0)));
    assert_eq!(found.report.touches_border, [false; 4]);
}

#[test]
fn the_distance_is_the_distance_and_a_picture_gives_the_same_on_any_number_of_cores() {
    let picture = paint(&Scene { noise: 0.0, ..BACKLIT }, disc([161.3, 128.7], 70.0));
    let found = seen(&picture);
    for (x, y) in [(161.3, 58.7), (100.0, 128.7), (231.3, 128.7), (210.8, 178.2), (150.0, 54.0)] {
        let expected = disc([161.3, 128.7], 70.0)(x, y);
        let got = found.silhouette.signed_distance_px([x, y]);
        assert!((got - expected).abs() < 0.12, "({x}, {y}): {got}, {expected}");
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(found, one.install(|| seen(&picture)));
}

#[test]
fn pictures_of_one_colour_and_of_noise_are_errors() {
    let every = Settings { min_area_px: 1.0, ..Settings::default() };
    for side in [16, 17, 31, 64] {
        for channels in [1, 3] {
            for v in [0, 1, 127, 255] {
                let p =
                    Picture::new(side, side + 3, channels, vec![v; side * (side + 3) * channels]).unwrap();
                assert!(find(&p, None, &every).is_err());
                assert!(find(&p, Some(&p), &every).is_err());
            }
        }
    }
    assert!(Picture::new(15, 64, 1, vec![0; 960]).is_err());
    assert!(Picture::new(16, 16, 2, vec![0; 512]).is_err());
    assert!(Picture::new(16, 16, 1, vec![0; 255]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    /// Whatever the pixels, an outline or an error, never a panic; what is found is finite and inside.
    #[test]
    fn any_picture_gives_an_outline_or_an_error(
        width in 16usize..48,
        height in 16usize..48,
        colour in any::<bool>(),
        levels in 1u64..=256,
        seed in any::<u64>(),
        setting in 0usize..18,
        blocks in 1usize..9,
    ) {
        let channels = if colour { 3 } else { 1 };
        let picture = |seed: u64| {
            let mut noise = Noise(seed);
            let coarse: Vec<u8> = (0..4096).map(|_| (noise.uniform() * levels as f64) as u8).collect();
            let data = (0..width * height * channels)
                .map(|k| {
                    let (x, y) = (k / channels % width / blocks, k / channels / width / blocks);
                    coarse[(y * 64 + x) * channels % 4000 + k % channels]
                })
                .collect();
            Picture::new(width, height, channels, data).unwrap()
        };
        let settings = Settings {
            polarity: [Polarity::Auto, Polarity::BrightBackground, Polarity::DarkBackground][setting % 3],
            holes: [Holes::Auto, Holes::Fill, Holes::Background][setting / 3 % 3],
            min_area_px: [1.0, 40.0][setting / 9],
            ..Settings::default()
        };
        let empty = picture(seed ^ 0x5555);
        for background in [None, Some(&empty)] {
            if let Ok(found) = find(&picture(seed), background.map(|b| b as &dyn Source), &settings) {
                prop_assert!(found.silhouette.distance_px.iter().all(|d| d.is_finite()));
                prop_assert!(found.report.area_px <= (width * height) as f64);
                prop_assert!(found.silhouette.origin[0] + found.silhouette.size[0] <= width);
                prop_assert!(found.silhouette.origin[1] + found.silhouette.size[1] <= height);
            }
        }
    }
}

/// Area of what is inside both over that of what is inside either.
fn overlap(a: &Silhouette, b: &Silhouette) -> f64 {
    let (mut both, mut either) = (0, 0);
    for y in 0..a.picture[1] {
        for x in 0..a.picture[0] {
            let (a, b) = (a.contains(x, y), b.contains(x, y));
            (both, either) = (both + u32::from(a && b), either + u32::from(a || b));
        }
    }
    f64::from(both) / f64::from(either)
}

/// A colour JPEG of a smooth picture with something round in it.
fn shaded([width, height]: [usize; 2]) -> Vec<u8> {
    let (cx, cy, r) = (0.4 * width as f64, 0.5 * height as f64, 0.3 * height as f64);
    let pixel = |k: usize| {
        let (x, y) = ((k % width) as f64, (k / width) as f64);
        let part = ((x - cx).hypot(y - cy) - r).clamp(0.0, 1.0);
        [200.0, 180.0, 150.0].map(|v| (60.0 + part * (v - 60.0) + 20.0 * x / width as f64) as u8)
    };
    let pixels: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    let mut bytes = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut bytes, 92);
    encoder.encode(&pixels, width as u16, height as u16, jpeg_encoder::ColorType::Rgb).unwrap();
    bytes
}

#[test]
fn silhouettes_of_a_jpeg_are_those_of_the_decoded_picture() {
    let rig = simulated::Settings { width: 2592, height: 1728, ..Default::default() };
    let (mut stage, mut camera, _) = simulated::open(&rig).unwrap();
    stage.home().unwrap();
    let empty = shaded([rig.width, rig.height]);
    for degrees in [0.0, 57.6, 144.0] {
        stage.move_to(Angle::from_deg(degrees)).unwrap();
        let bytes = camera.capture().unwrap().bytes;
        let photograph = Photograph::open(&bytes).unwrap();
        assert!(photograph.at_hand().is_none());
        let settings = Settings::default();
        let own = find(&photograph, None, &settings).unwrap();
        let other = find(&decode(&bytes).unwrap(), None, &settings).unwrap();
        let (a, b) = (own.report.area_px, other.report.area_px);
        assert!((a / b - 1.0).abs() < 5e-4, "{degrees}°: {a}, not {b} px");
        let iou = overlap(&own.silhouette, &other.silhouette);
        assert!(iou >= 0.9995, "{degrees}°: {iou}");
        // Another size of picture is no background.
        let small = decode(&shaded([1200, 40])).unwrap();
        assert!(find(&photograph, Some(&small), &settings).is_err());
        // Whichever of the two is decoded, the empty stage is compared with the picture.
        let stage = Photograph::open(&empty).unwrap();
        let stages: [&dyn Source; 2] = [&stage, &*stage.pixels().unwrap()];
        let found = stages.map(|stage| find(&photograph, Some(stage), &settings).map(|f| f.report.channel));
        assert_eq!(found[0], found[1]);
    }
}
