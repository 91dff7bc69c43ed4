//! What is read off a laboratory's record, on records of many kinds whose truth is known.

use crate::skip::shared_data;
use grainrig_core::contact::experiment::{Compliance, Experiment, LoadingEnd, Reading, read};

/// Where 2 N are passed, µm after contact.
const TRUE_UM: f64 = 16.0;

/// Normal noise from a fixed seed.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn next(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0)
    }
}

/// 2 N at 16 µm, a single smooth rise.
fn smooth(um: f64) -> f64 {
    2.0 * (um.max(0.0) / TRUE_UM).powf(1.5)
}

/// A contact that carries up to 3 N, lets go at 6 µm, and 2 N passed for good at 16 µm.
fn turning(um: f64) -> f64 {
    match um {
        u if u <= 0.0 => 0.0,
        u if u <= 5.0 => 0.6 * u,
        u if u <= 7.0 => 3.0 - 1.3 * (u - 5.0),
        u if u <= 12.0 => 0.4,
        u => 0.4 + 0.4 * (u - 12.0),
    }
}

/// Places of the crosshead, µm from contact: from `from` to each of `turns` in steps of `step`.
fn way(from: f64, turns: &[f64], step: f64) -> Vec<f64> {
    let mut out = vec![from];
    for &to in turns {
        let begin = out[out.len() - 1];
        let n = ((to - begin).abs() / step).round() as usize;
        out.extend((1..=n).map(|i| begin + (to - begin) * i as f64 / n as f64));
    }
    out
}

fn record(places_um: &[f64], law: impl Fn(f64) -> f64, sigma: f64) -> Experiment {
    let mut noise = Noise(7);
    Experiment {
        displacement_mm: places_um.iter().map(|u| 1.234 + 1e-3 * u).collect(),
        force_n: places_um.iter().map(|&u| law(u) + noise.next(sigma)).collect(),
    }
}

fn read_off(record: &Experiment) -> Reading {
    let (curve, reading) = record.read_off(&Compliance::none(), 2.0).unwrap();
    assert!(curve.iter().all(|p| p.approach_mm.is_finite() && p.force_n.is_finite()));
    reading
}

#[test]
fn the_transition_is_found_in_records_of_every_kind() {
    let to = |end: f64| way(-50.0, &[end], 0.5);
    let shifted = |mut r: Experiment, by: &dyn Fn(usize) -> f64| {
        r.force_n.iter_mut().enumerate().for_each(|(i, f)| *f += by(i));
        r
    };
    let mut spiked = record(&to(40.0), smooth, 0.01);
    (spiked.force_n[10], spiked.force_n[60]) = (1.5, -1.5);
    let mut repeated = record(&to(40.0), smooth, 0.01);
    repeated.displacement_mm = repeated.displacement_mm.iter().flat_map(|d| [*d, *d]).collect();
    repeated.force_n = repeated.force_n.iter().flat_map(|f| [*f, *f]).collect();
    let mut coarse = record(&to(40.0), smooth, 0.01);
    coarse.force_n.iter_mut().for_each(|f| *f = (*f / 0.05).round() * 0.05);
    let mut negative = record(&to(40.0), smooth, 0.01);
    negative.force_n.iter_mut().for_each(|f| *f = -*f);
    negative.displacement_mm.iter_mut().for_each(|d| *d = -*d);
    // Name, record, and how far off δ_i may be, µm.
    for (name, record, within) in [
        ("no noise at all", record(&to(40.0), smooth, 0.0), 0.6),
        ("little noise", record(&to(40.0), smooth, 0.001), 0.6),
        ("usual noise", record(&to(40.0), smooth, 0.012), 1.0),
        ("much noise", record(&to(40.0), smooth, 0.1), 3.0),
        ("an offset of -35 N", shifted(record(&to(40.0), smooth, 0.02), &|_| -35.0), 1.0),
        (
            "a drift of 0.2 N before contact",
            shifted(record(&to(40.0), smooth, 0.02), &|i| 2e-3 * i as f64),
            1.5,
        ),
        ("a drift that no noise hides", shifted(record(&to(40.0), smooth, 0.0), &|i| 1e-3 * i as f64), 1.5),
        ("pressed to 500 N", record(&to(640.0), smooth, 0.012), 1.0),
        ("pressed to 500 N, slowly", record(&way(-50.0, &[640.0], 0.05), smooth, 0.012), 1.0),
        ("single spikes before contact", spiked, 1.0),
        ("every row twice", repeated, 1.0),
        ("steps of 0.05 N", coarse, 1.5),
        ("compression negative", negative, 1.0),
        ("unloaded at the end", record(&way(-50.0, &[60.0, -80.0], 0.5), smooth, 0.012), 1.0),
        ("loaded three times", record(&way(-50.0, &[60.0, 5.0, 70.0, 5.0, 80.0], 0.5), smooth, 0.012), 1.0),
        ("a row each 4 µm", record(&way(-50.0, &[60.0], 4.0), smooth, 0.012), 4.0),
        ("a row each 12 µm", record(&way(-60.0, &[60.0], 12.0), smooth, 0.0), 6.0),
        ("a contact lost again", record(&to(60.0), turning, 0.012), 1.0),
        ("the same, to 400 N", record(&to(1000.0), turning, 0.012), 1.0),
    ] {
        let r = read_off(&record);
        let um = 1e3 * r.delta_i_mm.unwrap_or(f64::NAN);
        println!(
            "{name}: delta_i {um:.2} um, first {:.2}, zero {:.4} N, contact {:.4} N above at {:.2} um; {:?} {:?}",
            1e3 * r.first_crossing_mm.unwrap_or(f64::NAN),
            r.zero_n,
            r.contact_n,
            1e3 * (r.contact_mm.abs() - 1.234),
            r.end,
            r.notes
        );
        assert!((um - TRUE_UM).abs() <= within, "{name}: {um} um, {r:?}");
        let turns = name.contains("unloaded") || name.contains("three times");
        assert_eq!(r.end == LoadingEnd::TurnedRound, turns, "{name}: {r:?}");
        let first = 1e3 * r.first_crossing_mm.unwrap();
        let lost = name.contains("lost") || name.contains("400 N");
        assert!(
            if lost { (first - 2.0 / 0.6).abs() < 1.0 } else { (first - um).abs() < 1e-9 },
            "{name}: {first}"
        );
    }
}

#[test]
fn a_record_without_the_transition_says_so() {
    // The record ends early; the crosshead turns round early, and comes back farther; the force never leaves its noise.
    let short = read_off(&record(&way(-50.0, &[10.0], 0.5), smooth, 0.012));
    assert_eq!((short.delta_i_mm, short.first_crossing_mm), (None, None));
    assert!(
        short.notes.iter().any(|n| n.contains("never passes 2 N") && n.contains("the record ends")),
        "{short:?}"
    );
    let turned = read_off(&record(&way(-50.0, &[10.0, 0.0, 60.0], 0.5), smooth, 0.012));
    assert_eq!(turned.delta_i_mm, None);
    assert!(
        turned.notes.iter().any(|n| n.contains("turns round (rows after that are not used)")),
        "{turned:?}"
    );
    let flat = record(&way(-50.0, &[-1.0], 0.5), smooth, 0.012);
    let error = flat.read_off(&Compliance::none(), 2.0).unwrap_err().to_string();
    assert!(error.contains("the force never leaves its noise"), "{error}");
}

#[test]
fn a_record_that_begins_in_contact_or_in_which_the_grain_breaks_says_so() {
    let loaded = read_off(&record(&way(6.0, &[40.0], 0.5), smooth, 0.0));
    assert!(loaded.notes.iter().any(|n| n.contains("begins in contact")), "{loaded:?}");
    assert_eq!((loaded.noise_n, loaded.rows_before), (None, 0));
    let breaks = |um: f64| if um < 80.0 { smooth(um) } else { 0.2 + 0.3 * (um - 80.0) };
    let broken = read_off(&record(&way(-50.0, &[120.0], 0.5), breaks, 0.012));
    assert!(broken.notes.iter().any(|n| n.contains("if the grain broke there")), "{broken:?}");
    assert!((1e3 * broken.first_crossing_mm.unwrap() - TRUE_UM).abs() < 1.0, "{broken:?}");
    let loose = read_off(&record(&way(-50.0, &[40.0], 0.5), smooth, 0.5));
    assert!(loose.notes.iter().any(|n| n.contains("the noise before contact is large")), "{loose:?}");
}

#[test]
fn the_papers_grains_are_read_as_the_paper_reads_them() {
    // δ_i, the largest force, and how far δ_i may be off, µm.
    for (name, um, largest_n) in
        [("synthetic_lbs1_to_50N.csv", 16.0, 52.4), ("synthetic_lbs3_rotating.csv", 86.7, 11.0)]
    {
        let Some(path) = shared_data(&format!("bluehill/{name}")) else { continue };
        let bytes = std::fs::read(path).unwrap();
        let r = read_off(&read(&bytes).unwrap());
        println!("{name}: {r:?}");
        assert!((1e3 * r.delta_i_mm.unwrap() - um).abs() < 1.0, "{r:?}");
        assert!(r.largest_n > 0.9 * largest_n && r.zero_n.abs() < 0.01 && r.contact_n < 0.1, "{r:?}");
    }
}
