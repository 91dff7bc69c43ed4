//! Elastic spheres between plates against the two-plate form.
//!
//! `GRAINRIG_CONTACT=1 cargo test --release --test contact sphere bead -- --nocapture` computes the whole tables of refinements;
//! else one mesh of each sphere is pressed.

use crate::bodies::graded_ball;
use grainrig_core::contact::{Loading, Material, Press, QUASI_STATIC, hertz};

/// Whether the long tests are asked for.
pub fn long() -> bool {
    std::env::var_os("GRAINRIG_CONTACT").is_some()
}

/// Plates that begin four times as fast as by default and gain speed four times as quickly: half the steps. The sphere of sand
/// is pressed by default and shows that the speeds are slow enough; what else is pressed is held to the same limits.
pub fn quicker() -> Loading {
    Loading { slowest: 1.6e-5, ..Loading::default() }
}

/// Presses a ball to an approach of each plate (mm), without friction: the approach of one plate, the force, and the contacts'
/// mean area at each sample.
pub fn pressed(
    material: &Material,
    radius: f64,
    [at_contact, elsewhere]: [f64; 2],
    to: f64,
    speeds: &Loading,
) -> (Press, Vec<[f64; 3]>) {
    // The contact's rim, at a² = Rδ, lies δ/2 below the pole; some more for what is pushed there.
    let mesh = graded_ball(radius, at_contact, 0.6 * to, elsewhere);
    let loading = Loading { to_force_n: None, to_approach_mm: Some(2.0 * to), ..*speeds };
    let mut press = Press::new(&mesh, material, 0.0, 2.0 * radius, 0.0, &loading).unwrap();
    while !press.finished() {
        press.next_sample().unwrap();
    }
    let curve = (press.samples().iter())
        .map(|s| [0.5 * s.approach_mm, s.force_n, 0.5 * s.touches.iter().map(|t| t.area_mm2).sum::<f64>()])
        .collect();
    (press, curve)
}

/// The force at an approach of one plate.
fn force_at(curve: &[[f64; 3]], delta: f64) -> f64 {
    let w = curve.windows(2).find(|w| w[0][0] <= delta && delta <= w[1][0]).unwrap_or_else(|| {
        panic!("{delta} mm is not on the curve from {:?} to {:?}", curve.first(), curve.last())
    });
    // Between samples the force follows the power 3/2.
    let at = |p: &[f64; 3]| p[1] / p[0].powf(1.5);
    let part = (delta - w[0][0]) / (w[1][0] - w[0][0]);
    (at(&w[0]) + part * (at(&w[1]) - at(&w[0]))) * delta.powf(1.5)
}

/// One row of a table: sizes at the contacts and elsewhere, and the approach of each plate to which it is pressed, mm. The finer
/// the elements, the smaller the contact that they are needed for.
struct Row {
    sizes: [f64; 2],
    to: f64,
}

/// Presses a sphere with each mesh and holds the forces against the two-plate form at these approaches of one plate (mm): 2 %
/// up to 15 µm, 4 % beyond, where finite strain begins to count. What each row is off at the approaches that it reaches.
fn table(
    name: &str,
    (material, radius): (&Material, f64),
    speeds: &Loading,
    deltas: &[f64],
    rows: &[Row],
) -> Vec<Vec<f64>> {
    rows.iter()
        .map(|row| {
            let (press, curve) = pressed(material, radius, row.sizes, row.to, speeds);
            check_balance(&press);
            let ratios: Vec<f64> = (deltas.iter().filter(|d| **d < row.to))
                .map(|d| force_at(&curve, *d) / hertz::two_plate_force_n(material, radius, *d))
                .collect();
            println!(
                "{name}, {:4.1} um at the contacts, {:6} elements, {:6} steps, force over the form: {}",
                1e3 * row.sizes[0],
                press.body().elements(),
                press.dynamics().steps,
                ratios.iter().map(|r| format!("{r:.4}")).collect::<Vec<_>>().join(" ")
            );
            ratios.iter().map(|r| r - 1.0).collect()
        })
        .collect()
}

fn check_within(deltas: &[f64], off: &[f64]) {
    for (delta, off) in deltas.iter().zip(off) {
        let limit = if *delta < 0.0151 { 0.02 } else { 0.04 };
        assert!(off.abs() < limit, "{off} at {delta} mm");
    }
}

/// Balance, and motion at every sample since the first contact had formed, not only at the last.
fn check_balance(press: &Press) {
    let samples = press.samples();
    let e = samples.last().unwrap().energy;
    assert!(e.balance_error().abs() < 0.01, "{e:?}");
    let formed = samples.iter().position(|s| s.force_n > 0.02 * samples.last().unwrap().force_n).unwrap();
    for s in &samples[formed..] {
        let share = s.energy.kinetic / s.energy.internal();
        assert!(share < QUASI_STATIC, "{share} at {} mm, {} N", s.approach_mm, s.force_n);
    }
    assert!(press.overclosure_mm() < 1e-9, "{}", press.overclosure_mm());
}

#[test]
fn a_sphere_is_pressed_as_the_two_plate_form_says() {
    let (radius, material) = (0.4075, Material::default());
    let deltas = [0.003, 0.005, 0.010, 0.015, 0.030];
    let rows: &[Row] = if long() {
        &[
            Row { sizes: [0.016, 0.08], to: 0.0302 },
            Row { sizes: [0.011, 0.08], to: 0.0302 },
            Row { sizes: [0.008, 0.08], to: 0.0152 },
            Row { sizes: [0.0055, 0.08], to: 0.0052 },
        ]
    } else {
        &[Row { sizes: [0.012, 0.08], to: 0.0152 }]
    };
    let off = table("sphere of 0.815 mm", (&material, radius), &Loading::default(), &deltas, rows);
    if long() {
        off[1..].iter().for_each(|off| check_within(&deltas, off));
        // The smallest contacts are those that the elements hardly resolve: there the error falls with them.
        let worst: Vec<f64> = off.iter().map(|row| row[0].abs().max(row[1].abs())).collect();
        assert!(worst.windows(2).all(|w| w[1] < w[0]), "{worst:?}");
    } else {
        check_within(&deltas, &off[0]);
    }
    // The slope of log F against the form's, over all approaches: a decade of them with the hours, else half of one.
    let whole = &off[usize::from(long())];
    let last = whole.len() - 1;
    let forms = deltas.map(|d| hertz::two_plate_force_n(&material, radius, d));
    let slope = 1.0 + ((1.0 + whole[last]) / (1.0 + whole[0])).ln() / (forms[last] / forms[0]).ln();
    println!("log slope {slope:.4}");
    assert!((slope - 1.0).abs() < 0.02, "{slope}");
}

#[test]
fn a_glass_bead_is_pressed_as_the_two_plate_form_says() {
    let (radius, material) = (1.075, Material { young_mpa: 63e3, ..Material::default() });
    let deltas = [0.003, 0.005, 0.010, 0.015, 0.030];
    let rows: &[Row] = if long() {
        &[
            Row { sizes: [0.030, 0.21], to: 0.0302 },
            Row { sizes: [0.022, 0.21], to: 0.0302 },
            Row { sizes: [0.015, 0.21], to: 0.0152 },
            Row { sizes: [0.011, 0.21], to: 0.0052 },
        ]
    } else {
        &[Row { sizes: [0.019, 0.25], to: 0.0052 }]
    };
    let speeds = if long() { Loading::default() } else { quicker() };
    let off = table("glass bead of 2.15 mm", (&material, radius), &speeds, &deltas, rows);
    // Against its size this bead is pressed least: only the finer elements resolve its smallest contacts.
    if long() {
        check_within(&deltas[2..], &off[1][2..]);
    }
    off[2 * usize::from(long())..].iter().for_each(|off| check_within(&deltas, off));
    if long() {
        let worst: Vec<f64> = off.iter().map(|row| row[0].abs().max(row[1].abs())).collect();
        assert!(worst.windows(2).all(|w| w[1] < w[0]), "{worst:?}");
    }
}
