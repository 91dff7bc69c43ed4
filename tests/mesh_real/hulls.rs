//! Visual hulls: flat faces, and ridges where two views' outlines meet, the sharper the fewer the views.

use super::grains::files;
use super::{assert_good, assert_sound, default_controls, on_threads};
use grainrig::rig::simulated::{Settings, open};
use grainrig_core::geometry::Angle;
use grainrig_core::hull::{Cone, HullGrid, VisualHull, find_bounds};
use grainrig_core::mesh::{Controls, mesh};
use grainrig_core::silhouette::{self, PedestalMode, Picture};
use std::sync::Arc;

/// Grey levels of the background and of the grain.
const LIGHT: f32 = 230.0;
const DARK: f32 = 30.0;
/// Cells of the grid that measures a hull's volume, along its longest edge.
const CELLS: f64 = 120.0;

/// The hull of a simulated grain from `views` ideal pictures over half a turn, and its volume, mm³.
fn hull(settings: &Settings, views: usize) -> (VisualHull, f64) {
    let (_, _, truth) = open(settings).unwrap();
    let cut_out = silhouette::Settings { pedestal: PedestalMode::None, ..silhouette::Settings::default() };
    let cones: Vec<Cone> = (0..views)
        .map(|i| {
            let angle = Angle::from_deg(180.0 * i as f64 / views as f64);
            let seen = truth.true_silhouette(angle, 0.0);
            let mut grey = vec![LIGHT as u8; settings.width * settings.height];
            for (k, part) in seen.coverage.iter().enumerate() {
                let (column, row) = (k % seen.window.size[0], k / seen.window.size[0]);
                let at = (row + seen.window.origin[1]) * settings.width + column + seen.window.origin[0];
                grey[at] = (LIGHT + (DARK - LIGHT) * part) as u8;
            }
            let picture = Picture::new(settings.width, settings.height, 1, grey).unwrap();
            let found = silhouette::find(&picture, None, &cut_out).unwrap();
            Cone::new(truth.projection(angle, 0.0), Arc::new(found.silhouette))
        })
        .collect();
    let bounds = find_bounds(&cones).unwrap();
    let longest = bounds.size().max();
    let mut grid = HullGrid::new(&bounds, longest / CELLS).unwrap();
    cones.iter().for_each(|c| grid.carve(c));
    let volume = grid.measures().volume_mm3;
    (VisualHull { cones, bounds: bounds.grown(0.02 * longest) }, volume)
}

/// Pictures of an eighth of the size: the grain is 26 pixels wide, a pixel as large as a facet.
fn small(seed: u64) -> Settings {
    Settings { seed, width: 648, height: 432, mm_per_px: 0.0344, ..Settings::default() }
}

#[test]
fn no_built_in_grain_breaks_the_default_controls() {
    for seed in 1..=6 {
        let (body, volume) = hull(&small(seed), 25);
        let controls = default_controls(volume, 1.0);
        let made = mesh(&body, &controls, &mut |_| ()).unwrap();
        assert_good(&made, &controls, &format!("seed {seed}"));
        let excess = made.volume_mm3() / volume - 1.0;
        assert!(excess.abs() < 0.006, "seed {seed}: {excess}");
    }
}

#[test]
fn hulls_of_two_to_eight_views_have_sharp_ridges_and_are_meshed_too() {
    let mut all: Vec<Settings> = [1, 5].map(small).to_vec();
    let flat_or_rough = ["sand_ma107_00107.stl", "ct_ma160_02444.stl"];
    let chosen = files().into_iter().filter(|f| flat_or_rough.iter().any(|n| f.ends_with(n)));
    all.extend(chosen.map(|f| Settings {
        grain_stl: Some(f),
        width: 1296,
        height: 864,
        mm_per_px: 0.0172,
        ..Settings::default()
    }));
    for settings in &all {
        for views in [2, 3, 4, 8] {
            let (body, volume) = hull(settings, views);
            let controls = default_controls(volume, 1.6);
            let name = format!("seed {}, {:?}, {views} views", settings.seed, settings.grain_stl);
            let made = mesh(&body, &controls, &mut |_| ()).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_good(&made, &controls, &name);
            // Facets across a ridge cut it off.
            let excess = made.volume_mm3() / volume - 1.0;
            assert!(excess.abs() < 0.02, "{name}: {excess}");
        }
    }
}

#[test]
fn a_hull_gives_the_same_mesh_on_one_thread_and_on_three() {
    let (body, volume) = hull(&small(3), 9);
    let controls = default_controls(volume, 2.0);
    let [a, b] = [1, 3].map(|n| on_threads(n, || mesh(&body, &controls, &mut |_| ()).unwrap()));
    assert_eq!(a, b);
}

#[test]
fn the_largest_facet_angle_that_may_be_asked_for_is_kept_on_ridges_and_a_larger_one_is_refused() {
    let (body, volume) = hull(&small(2), 3);
    let asked = |facet_angle_deg| Controls { facet_angle_deg, ..default_controls(volume, 3.0) };
    let mut reached = Vec::new();
    let made = mesh(&body, &asked(30.0), &mut |part| reached.push(part)).unwrap();
    assert!(assert_sound(&made, &asked(30.0), "30°").facet_angle_deg >= 30.0);
    assert!(reached.is_sorted() && reached.iter().all(|p| (0.0..=1.0).contains(p)), "{reached:?}");
    let text = mesh(&body, &asked(30.1), &mut |_| ()).map(|_| ()).unwrap_err().to_string();
    for part in ["facet_angle_deg", "30.1", "at most 30°", "25°"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
