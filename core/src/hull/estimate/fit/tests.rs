//! The fit of the module's formulas to the hulls of `hulls.csv`, and how well they hold there.
//!
//! `cargo test -p grainrig-core estimate::fit -- --nocapture` prints what the data give; where a constant of the module
//! is something else, it fails. The data are made anew by `benches/volume_fit`.

use super::combine::Spread;
use super::*;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// A grain's hull of known excess.
struct Hull {
    /// A powder's name, or how the grain was made.
    kind: &'static str,
    pose: &'static str,
    signs: Signs,
    excess: f64,
}

/// Kinds that are no powders.
const MADE: [&str; 4] = ["convex", "cut", "ellipsoid", "box"];

fn hulls() -> Vec<Hull> {
    let rows = include_str!("hulls.csv").lines().skip(1);
    rows.map(|row| {
        let words: Vec<&str> = row.split(',').collect();
        let [views, concavity, curvature_variation, axial_variation, gaps, slenderness, excess] =
            std::array::from_fn(|k| words[k + 2].parse().unwrap());
        let signs = Signs { concavity, curvature_variation, axial_variation, gaps, slenderness, views };
        Hull { kind: words[0], pose: words[1], signs, excess }
    })
    .collect()
}

/// Coefficients of terms that make up ln E, by least squares. A hull counts by how well its ln E is known, ± the spread
/// and ± what of E no sign explains, and less by Cauchy's weights where it is more than two of these off.
fn fitted<const N: usize>(
    hulls: &[&Hull],
    terms: impl Fn(&Signs) -> [f64; N],
    spread: impl Fn(&Signs) -> f64,
) -> [f64; N] {
    let mut coefficients: Option<SVector<f64, N>> = None;
    for _ in 0..40 {
        let (mut normal, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        for hull in hulls {
            let (terms, log_excess) = (SVector::from(terms(&hull.signs)), hull.excess.ln());
            let weight = coefficients.map_or(1.0, |c| {
                let expected = c.dot(&terms);
                let variance = spread(&hull.signs).powi(2) + (UNEXPLAINED / expected.exp()).powi(2);
                1.0 / (variance + 0.25 * (log_excess - expected).powi(2))
            });
            normal += terms * terms.transpose() * weight;
            right += terms * (log_excess * weight);
        }
        coefficients = Some(normal.cholesky().unwrap().solve(&right));
    }
    coefficients.unwrap().into()
}

/// How an estimate of a hull turns out.
struct Outcome<'a> {
    hull: &'a Hull,
    is_in: bool,
    /// Of the grain's volume.
    error: f64,
    /// Of the estimate.
    width: f64,
}

/// As [`estimate`] does it where nothing of the views is uncertain.
fn outcome(hull: &Hull, log_excess: f64, log_sd: f64) -> Outcome<'_> {
    let spread = Spread { log_excess, log_sd, sd: UNEXPLAINED };
    // Over the grain's volume; it is within its hull.
    let [low, middle, high] =
        [0.025, 0.5, 0.975].map(|share| (1.0 + hull.excess) * spread.quantile(share).min(0.0).exp());
    Outcome { hull, is_in: low <= 1.0 && 1.0 <= high, error: middle - 1.0, width: (high - low) / middle }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A class of hulls: its name and what belongs to it.
type Class = (&'static str, fn(&Hull) -> bool);

const CLASSES: [Class; 17] = [
    ("all", |_| true),
    ("25 views", |h| h.signs.views.to_bits() == 25f64.to_bits()),
    ("powders", is_of_powder),
    ("convex", |h| h.kind == "convex"),
    ("cut by planes", |h| h.kind == "cut"),
    ("ellipsoids", |h| h.kind == "ellipsoid"),
    ("boxes", |h| h.kind == "box"),
    ("any pose", |h| h.pose == "any"),
    ("flat", |h| h.pose == "flat"),
    ("upright", |h| h.pose == "upright"),
    ("resting", |h| h.pose == "resting"),
    ("tipped", |h| h.pose == "tipped"),
    ("powders, flat", |h| is_of_powder(h) && h.pose == "flat"),
    ("powders, upright", |h| is_of_powder(h) && h.pose == "upright"),
    ("lower than half", |h| h.signs.slenderness < 0.5),
    ("powders, lower", |h| is_of_powder(h) && h.signs.slenderness < 0.5),
    ("higher than 1.5", |h| h.signs.slenderness > 1.5),
];

fn is_of_powder(hull: &Hull) -> bool {
    !MADE.contains(&hull.kind)
}

fn share_in(outcomes: &[&Outcome]) -> f64 {
    outcomes.iter().filter(|o| o.is_in).count() as f64 / outcomes.len() as f64
}

fn print(name: &str, outcomes: &[&Outcome]) {
    let percent = |of: fn(&Outcome) -> f64| 100.0 * median(outcomes.iter().map(|o| of(o)));
    println!(
        "{name:18} {:5} hulls, E {:5.2} %: {:5.1} % in the interval, median error {:+.2} %, off by {:.2} %, width {:.2} %",
        outcomes.len(),
        percent(|o| o.hull.excess),
        100.0 * share_in(outcomes),
        percent(|o| o.error),
        percent(|o| o.error.abs()),
        percent(|o| o.width)
    );
}

/// To the digits that are written.
fn agree(written: &[f64], fitted: &[f64]) {
    println!("{fitted:.3?}");
    assert!(written.iter().zip(fitted).all(|(w, f)| (w - f).abs() < 0.000_51), "{written:?}, not {fitted:?}");
}

#[test]
fn the_constants_are_those_of_the_data() {
    let hulls = hulls();
    agree(&COEFFICIENTS, &fitted(&hulls.iter().collect::<Vec<_>>(), terms, spread));
    let usual: Vec<&Hull> = hulls.iter().filter(|h| h.signs.views.to_bits() == 25f64.to_bits()).collect();
    let by_concavity = |s: &Signs| [1.0, (s.concavity + LEAST[0]).ln()];
    agree(&ANY_CAMERAS, &fitted(&usual, by_concavity, |_| ANY_SPREAD));
    let [p, q] = ANY_CAMERAS;
    let by_concavity: Vec<Outcome> =
        (usual.iter()).map(|h| outcome(h, p + q * (h.signs.concavity + LEAST[0]).ln(), ANY_SPREAD)).collect();
    let by_concavity: Vec<&Outcome> = by_concavity.iter().collect();
    print("by concavity alone", &by_concavity);
    assert!(share_in(&by_concavity) >= 0.95);

    let greatest = |of: fn(&Signs) -> f64| hulls.iter().map(|h| of(&h.signs)).fold(0.0, f64::max);
    let most = [
        greatest(|s| s.concavity),
        greatest(|s| s.curvature_variation),
        greatest(|s| s.axial_variation),
        greatest(|s| s.gaps),
    ];
    let slenderness = [1.0 / greatest(|s| 1.0 / s.slenderness), greatest(|s| s.slenderness)];
    let views = [1.0 / greatest(|s| 1.0 / s.views), greatest(|s| s.views)];
    println!("signs up to {most:.3?}, slenderness {slenderness:.3?}, views {views:?}");
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.02;
    assert!(most.iter().zip(MOST_FITTED).all(|(a, b)| near(*a, b)), "{most:?}");
    let written = [*FITTED_SLENDERNESS.start(), *FITTED_SLENDERNESS.end()];
    assert!(near(slenderness[0], written[0]) && near(slenderness[1], written[1]), "{slenderness:?}");
    assert!(near(views[0], *FITTED_VIEWS.start()) && near(views[1], *FITTED_VIEWS.end()), "{views:?}");
}

#[test]
fn the_interval_holds_for_each_kind_and_pose_and_the_estimate_is_right_in_the_median() {
    let hulls = hulls();
    let outcomes: Vec<Outcome> =
        (hulls.iter()).map(|h| outcome(h, log_excess(&h.signs, &COEFFICIENTS), spread(&h.signs))).collect();
    for (k, (name, is_of)) in CLASSES.iter().enumerate() {
        let of: Vec<&Outcome> = outcomes.iter().filter(|o| is_of(o.hull)).collect();
        print(name, &of);
        let least = if k == 0 { 0.95 } else { 0.93 };
        assert!(share_in(&of) >= least, "{name}: {}", share_in(&of));
        let error = median(of.iter().map(|o| o.error));
        // Boxes with rough faces are more hollow by their signs than they are.
        let most = if *name == "boxes" { 0.008 } else { 0.005 };
        assert!(error.abs() < most, "{name}: {error}");
    }
}

#[test]
fn kinds_that_the_fit_does_not_know_lie_in_the_interval_too() {
    let hulls = hulls();
    let mut kinds: Vec<&str> = hulls.iter().map(|h| h.kind).collect();
    kinds.dedup();
    let mut powders = Vec::new();
    for kind in kinds {
        let (known, left_out): (Vec<&Hull>, Vec<&Hull>) = hulls.iter().partition(|h| h.kind != kind);
        let coefficients = fitted(&known, terms, spread);
        let outcomes: Vec<Outcome> = (left_out.par_iter())
            .map(|h| outcome(h, log_excess(&h.signs, &coefficients), spread(&h.signs)))
            .collect();
        print(kind, &outcomes.iter().collect::<Vec<_>>());
        if is_of_powder(left_out[0]) {
            powders.extend(outcomes);
        }
    }
    let powders: Vec<&Outcome> = powders.iter().collect();
    print("each powder", &powders);
    let lying: Vec<&Outcome> = powders.iter().copied().filter(|o| o.hull.pose == "flat").collect();
    print("each powder, flat", &lying);
    assert!(share_in(&powders) >= 0.95 && share_in(&lying) >= 0.93);
}
