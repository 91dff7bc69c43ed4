//! A mesh's quality as a sheet of histograms.

use super::{Mark, Panel, Point, Series, Sheet};
use crate::mesh::{Histogram, Quality, Spread};

/// Histograms of dihedral and facet angles, radius–edge ratio, aspect and altitude, with the figures below.
pub fn mesh_sheet(title: String, spread: &Spread, quality: &Quality, figures: Vec<String>) -> Sheet {
    let q = quality;
    let upright = |what: &str, x: f64| Mark::Upright(what.to_owned(), x);
    let panels = vec![
        panel(
            "dihedral angles, %",
            "degrees",
            &spread.dihedral_deg,
            vec![upright("least", q.dihedral_deg.min), upright("greatest", q.dihedral_deg.max)],
        ),
        panel(
            "facet angles, %",
            "degrees",
            &spread.facet_angle_deg,
            vec![upright("least", q.facet_angle_deg)],
        ),
        panel(
            "circumradius over shortest edge, %",
            "ratio; 0.61 is regular",
            &spread.radius_edge,
            Vec::new(),
        ),
        panel("longest edge over smallest altitude, %", "ratio; 1.22 is regular", &spread.aspect, Vec::new()),
        panel(
            "smallest altitude over its median, %",
            "ratio; the least sets an explicit simulation's time step",
            &spread.altitude,
            vec![upright("least", q.altitude_min_mm / q.altitude_median_mm)],
        ),
    ];
    Sheet { title, panels, figures, warnings: Vec::new() }
}

fn panel(title: &str, abscissa: &str, histogram: &Histogram, marks: Vec<Mark>) -> Panel {
    let total = histogram.counts.iter().sum::<u64>().max(1) as f64;
    let width = (histogram.high - histogram.low) / histogram.counts.len() as f64;
    // Stairs: two points for each bin.
    let points = histogram
        .counts
        .iter()
        .enumerate()
        .flat_map(|(i, n)| [i, i + 1].map(|k| (k, 100.0 * *n as f64 / total)))
        .map(|(k, y)| Point { x: histogram.low + k as f64 * width, y, sigma: None })
        .collect();
    let series = vec![Series { name: String::new(), points, joined: true }];
    Panel { title: title.to_owned(), abscissa: abscissa.to_owned(), series, marks }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ball;
    use crate::mesh::{Controls, mesh};

    #[test]
    fn a_sheet_has_five_histograms_that_add_up_to_a_hundred() {
        let ball = Ball { center: crate::geometry::Point::origin(), radius_mm: 1.0 };
        let made = mesh(&ball, &Controls::for_size(8.0), &mut |_| ()).unwrap();
        let sheet = mesh_sheet("a ball".to_owned(), &made.spread(), &made.quality(), Vec::new());
        assert_eq!(sheet.panels.len(), 5);
        for panel in &sheet.panels {
            let sum: f64 = panel.series[0].points.iter().step_by(2).map(|p| p.y).sum();
            assert!((sum - 100.0).abs() < 1e-9, "{}: {sum}", panel.title);
        }
        assert!(String::from_utf8(sheet.svg()).unwrap().contains("dihedral"));
    }
}
