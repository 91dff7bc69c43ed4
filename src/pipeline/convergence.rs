//! How the hull's volume falls as views are added: whether more of them would be worth it.

use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use grainrig_core::report::{Mark, Panel, Point, Series, Sheet};
use rayon::prelude::*;
use serde::Serialize;

/// The convergence's name, without its endings.
pub const CONVERGENCE: &str = "convergence";
/// Numbers of views whose hulls are measured, besides all of them.
const LADDER: [usize; 16] = [2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128];
/// Cells along the longest edge of such a hull's box.
const CELLS: f64 = 128.0;
/// From here on the diagram shows the last per cents by themselves.
const LATE: usize = 5;

/// The volume of the hull of some of the views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Convergence {
    /// How many views.
    pub views: usize,
    /// The volume of their hull, mm³.
    pub volume_mm3: f64,
}

/// The volumes of the hulls of 2, 3, 4 … views and of all, in rising numbers; `cones` in the order of the angles.
///
/// For k of N views those numbered ⌊jN/k⌋, j = 0 … k − 1, are taken: each time spread evenly over the whole turn of
/// the session (half a turn, as planned), so that the hulls of few views are not nested in one another. They are
/// measured on grids of 128 cells along the longest edge, and all volumes multiplied by what the full hull's,
/// `volume_mm3`, is of the same measured so: the last is the full hull's. Numbers of views that do not bound a hull
/// are left out.
pub(super) fn convergence(cones: &[Cone], volume_mm3: f64) -> Vec<Convergence> {
    let n = cones.len();
    let counts: Vec<usize> = LADDER.into_iter().filter(|k| *k < n).chain([n]).collect();
    let coarse: Vec<Option<f64>> = (counts.par_iter())
        .map(|k| {
            let some: Vec<Cone> = (0..*k).map(|j| cones[j * n / k].clone()).collect();
            let bounds = find_bounds(&some).ok()?;
            let mut grid = HullGrid::new(&bounds, bounds.size().max() / CELLS).ok()?;
            grid.carve_all(&some, &mut |_| {});
            Some(grid.measures().volume_mm3)
        })
        .collect();
    let Some(full) = coarse.last().copied().flatten().filter(|v| *v > 0.0) else { return Vec::new() };
    (counts.into_iter().zip(coarse))
        .filter_map(|(views, v)| Some(Convergence { views, volume_mm3: volume_mm3 * (v? / full) }))
        .collect()
}

/// The volumes as a diagram, and the last per cents by themselves; `None` where there is nothing to show.
pub(super) fn drawn(found: &[Convergence]) -> Option<Sheet> {
    let full = found.last()?.volume_mm3;
    let series = |least: usize, value: &dyn Fn(&Convergence) -> f64| Series {
        name: "hull of views spread evenly".into(),
        points: (found.iter().filter(|c| c.views >= least))
            .map(|c| Point { x: c.views as f64, y: value(c), sigma: None })
            .collect(),
        joined: true,
    };
    Some(Sheet {
        title: String::new(),
        panels: vec![
            Panel {
                title: "volume of the hull, mm³".into(),
                abscissa: "views".into(),
                series: vec![series(0, &|c| c.volume_mm3)],
                marks: vec![Mark::Level("all views".into(), full)],
            },
            Panel {
                title: format!("more than the hull of all views, %, from {LATE} views on"),
                abscissa: "views".into(),
                series: vec![series(LATE, &|c| 100.0 * (c.volume_mm3 / full - 1.0))],
                marks: vec![Mark::Level("all views".into(), 0.0)],
            },
        ],
        figures: (found.iter())
            .map(|c| {
                format!(
                    "{:>4} views: {:.6} mm³, {:+.3} %",
                    c.views,
                    c.volume_mm3,
                    100.0 * (c.volume_mm3 / full - 1.0)
                )
            })
            .collect(),
        warnings: Vec::new(),
    })
}
