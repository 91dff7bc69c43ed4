//! Evaluation of a force–displacement curve: the transition to a Hertzian response, Hertz' parameters after it, agreement with
//! a test.

use super::{Material, Sample};
use serde::{Deserialize, Serialize};

/// A point of a curve of force against the approach of the plates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// The approach of the plates, mm.
    pub approach_mm: f64,
    /// The force, N.
    pub force_n: f64,
}

impl From<&Sample> for CurvePoint {
    fn from(s: &Sample) -> Self {
        Self { approach_mm: s.approach_mm, force_n: s.force_n }
    }
}

/// The force must rise to so many times the transition's, without falling below that again, before a crossing counts as the last:
/// a grain that topples does so while little holds it.
pub const SETTLED: f64 = 4.0;

/// Where a curve passes the transition's force on its way up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// The approach `δ_i` at which it passes for the last time, mm: Nadimi and Fonseca (2017) read the transition to a Hertzian
    /// response at 2 N.
    pub delta_i_mm: f64,
    /// The approach at which it passes for the first time, mm.
    pub first_crossing_mm: f64,
    /// The largest force since `delta_i_mm`, N.
    pub reached_n: f64,
    /// The force that had to be reached for it to be known that the crossing is the last one, N.
    pub needed_n: f64,
    /// Whether it was reached, and the force is not below the transition's at the end.
    pub settled: bool,
}

impl Transition {
    /// What a person should know of a `δ_i` that may not be the last.
    pub fn warning(&self) -> Option<String> {
        (!self.settled).then(|| {
            format!(
                "δ_i is preliminary: the force reached {:.2} N after {:.2} µm, and from {} N on it counts as known that it does not \
                 fall below the transition again; press on to {} N",
                self.reached_n,
                1e3 * self.delta_i_mm,
                self.needed_n,
                self.needed_n
            )
        })
    }
}

/// Where a curve passes `force_n`. None where the force never gets there, or starts above.
pub fn transition(curve: &[CurvePoint], force_n: f64) -> Option<Transition> {
    let up = |w: &&[CurvePoint]| w[0].force_n < force_n && w[1].force_n >= force_n;
    let at = |w: &[CurvePoint]| {
        let part = (force_n - w[0].force_n) / (w[1].force_n - w[0].force_n);
        w[0].approach_mm + part * (w[1].approach_mm - w[0].approach_mm)
    };
    let first = curve.windows(2).find(up)?;
    let last = curve.windows(2).rposition(|w| up(&w))?;
    let after = &curve[last + 1..];
    let reached_n = after.iter().map(|p| p.force_n).fold(0.0, f64::max);
    let stays = after.iter().all(|p| p.force_n >= force_n);
    let needed_n = SETTLED * force_n;
    Some(Transition {
        delta_i_mm: at(&curve[last..]),
        first_crossing_mm: at(first),
        reached_n,
        needed_n,
        settled: stays && reached_n >= needed_n,
    })
}

/// Hertz' law fitted to a curve: `F = 4/3 E* √R ((δ − δ₀)/2)^(3/2)`, a contact at each plate; `F^(2/3)` is linear in δ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HertzFit {
    /// Where the law's force would be zero, mm of the plates' approach.
    pub origin_mm: f64,
    /// E* of a sphere as high as the grain that follows the law, MPa.
    pub contact_modulus_mpa: f64,
    /// Radius of a sphere of the grain's material that follows the law, mm.
    pub radius_mm: f64,
    /// Root mean square of the force's difference from the law, N.
    pub residual_n: f64,
    /// How many points it rests on.
    pub points: usize,
}

/// Fits Hertz' law to the points from `δ_i` on: F^(2/3) is a straight line in δ. `height_mm` is the grain's between the plates.
/// None with fewer than five points, or where the force does not rise.
pub fn fit_hertz(
    curve: &[CurvePoint],
    from_mm: f64,
    material: &Material,
    height_mm: f64,
) -> Option<HertzFit> {
    let used: Vec<&CurvePoint> =
        curve.iter().filter(|p| p.approach_mm >= from_mm && p.force_n > 0.0).collect();
    if used.len() < 5 {
        return None;
    }
    let n = used.len() as f64;
    let y = |p: &CurvePoint| p.force_n.powf(2.0 / 3.0);
    let (mx, my) =
        (used.iter().map(|p| p.approach_mm).sum::<f64>() / n, used.iter().map(|p| y(p)).sum::<f64>() / n);
    let sxx: f64 = used.iter().map(|p| (p.approach_mm - mx).powi(2)).sum();
    let sxy: f64 = used.iter().map(|p| (p.approach_mm - mx) * (y(p) - my)).sum();
    let slope = sxy / sxx;
    if !(slope.is_finite() && slope > 0.0) {
        return None;
    }
    let origin_mm = mx - my / slope;
    // F = k (δ−δ₀)^(3/2) with k = 4/3 E* √R / 2^(3/2).
    let k = slope.powf(1.5);
    let product = 0.75 * k * 2f64.powf(1.5);
    let square: f64 =
        used.iter().map(|p| (p.force_n - k * (p.approach_mm - origin_mm).max(0.0).powf(1.5)).powi(2)).sum();
    Some(HertzFit {
        origin_mm,
        contact_modulus_mpa: product / (0.5 * height_mm).sqrt(),
        radius_mm: (product / material.contact_modulus_mpa()).powi(2),
        residual_n: (square / n).sqrt(),
        points: used.len(),
    })
}

/// How well a computed curve agrees with a measured one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// Root mean square of the difference of the forces, N.
    pub rms_n: f64,
    /// The same over the largest measured force.
    pub relative: f64,
    /// Coefficient of determination: 1 is the same curve, 0 no better than the measured mean.
    pub determination: f64,
    /// Measured points that lie within the computed curve's reach.
    pub points: usize,
}

/// Compares a computed curve with a measured one at the measured approaches both have. None where fewer than two are
/// common, or all are alike.
pub fn agreement(computed: &[CurvePoint], measured: &[CurvePoint]) -> Option<Agreement> {
    let pairs: Vec<(f64, f64)> = measured
        .iter()
        .filter_map(|m| {
            let w = computed
                .windows(2)
                .find(|w| w[0].approach_mm <= m.approach_mm && m.approach_mm < w[1].approach_mm)?;
            let part = (m.approach_mm - w[0].approach_mm) / (w[1].approach_mm - w[0].approach_mm);
            Some((w[0].force_n + part * (w[1].force_n - w[0].force_n), m.force_n))
        })
        .collect();
    if pairs.len() < 2 {
        return None;
    }
    let n = pairs.len() as f64;
    let mean = pairs.iter().map(|p| p.1).sum::<f64>() / n;
    let off: f64 = pairs.iter().map(|(c, m)| (c - m).powi(2)).sum();
    let spread: f64 = pairs.iter().map(|(_, m)| (m - mean).powi(2)).sum();
    let most = pairs.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
    // A record that is flat where both are has nothing to be compared with.
    if spread <= 0.0 {
        return None;
    }
    let rms_n = (off / n).sqrt();
    Some(Agreement { rms_n, relative: rms_n / most, determination: 1.0 - off / spread, points: pairs.len() })
}

/// The share of motion in a compression, after the first contact has formed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct QuasiStatic {
    /// The approach at which it had formed: both plates carried 2 % of the largest force, mm. A grain that is carried by less
    /// tips and slides; it stores hardly any energy, whatever the speed, with which its motion could be compared.
    #[serde(default)]
    pub formed_mm: f64,
    /// The largest kinetic over internal energy at the end of a window since; 10 stands for anything above, where hardly any
    /// energy is stored.
    pub largest: f64,
    /// The approach at which it was so, mm.
    pub at_mm: f64,
    /// The part of the approach since then in which it was above 5 %.
    pub above_limit: f64,
    /// Where it was above 5 % first and last, mm of approach.
    #[serde(default)]
    pub above_mm: Option<[f64; 2]>,
    /// The largest force at which it was above 5 %, N.
    #[serde(default)]
    pub above_n: f64,
}

/// Kinetic over internal energy that still counts as quasi-static.
pub const QUASI_STATIC: f64 = 0.05;
/// A contact has formed when both plates carry this share of the largest force.
const FORMED: f64 = 0.02;
/// Kinetic over internal energy is stated up to here; beyond, hardly anything is stored and the figure shows only that.
const MOST_MOTION: f64 = 10.0;

impl QuasiStatic {
    /// The largest share of motion as a person reads it.
    pub fn share(&self) -> String {
        if self.largest < MOST_MOTION {
            format!("{:.1} %", 100.0 * self.largest)
        } else {
            "more than ten times it".into()
        }
    }

    /// What a person should know where the motion was above 5 %: where, at which forces, and what helps.
    pub fn warning(&self) -> Option<String> {
        let [from_mm, to_mm] = self.above_mm?;
        Some(format!(
            "not quasi-static between {:.2} and {:.2} µm of approach, at up to {:.3} N: after the first contact had formed (at \
             {:.2} µm) the kinetic energy was above 5 % of the internal one over {:.1} % of the approach, and reached {} at {:.2} \
             µm; use a lower --speed",
            1e3 * from_mm,
            1e3 * to_mm,
            self.above_n,
            1e3 * self.formed_mm,
            100.0 * self.above_limit,
            self.share(),
            1e3 * self.at_mm
        ))
    }
}

/// How much of the energy was motion after the first contact had formed between both plates; none where it has not yet: where
/// both have carried 2 % of the largest force, and of `of_n` at least.
pub fn quasi_static(samples: &[Sample], of_n: f64) -> Option<QuasiStatic> {
    let largest_n = samples.iter().map(|s| s.force_n).fold(of_n, f64::max);
    let formed = |s: &Sample| s.lower_n[2].min(-s.upper_n[2]) >= FORMED * largest_n;
    let after = &samples[samples.iter().position(formed)?..];
    let of = |s: &Sample| {
        let (motion, stored) = (s.energy.kinetic, s.energy.internal());
        if motion < MOST_MOTION * stored { motion / stored } else { MOST_MOTION }
    };
    let worst = after.iter().max_by(|a, b| of(a).total_cmp(&of(b)))?;
    let (mut above, mut all) = (0.0, 0.0);
    for w in after.windows(2) {
        let by = w[1].approach_mm - w[0].approach_mm;
        all += by;
        if of(&w[1]) > QUASI_STATIC {
            above += by;
        }
    }
    let fast: Vec<&Sample> = after.iter().filter(|s| of(s) > QUASI_STATIC).collect();
    Some(QuasiStatic {
        formed_mm: after[0].approach_mm,
        largest: of(worst),
        at_mm: worst.approach_mm,
        above_limit: if all > 0.0 { above / all } else { 0.0 },
        above_mm: fast.first().zip(fast.last()).map(|(a, b)| [a.approach_mm, b.approach_mm]),
        above_n: fast.iter().map(|s| s.force_n).fold(0.0, f64::max),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Energy;
    use super::*;

    fn hertzian(origin_mm: f64, radius_mm: f64) -> Vec<CurvePoint> {
        let m = Material::default();
        (0..60)
            .map(|i| {
                let approach_mm = 1e-3 * f64::from(i);
                let force_n = super::super::hertz::force_n(&m, radius_mm, 0.5 * (approach_mm - origin_mm));
                CurvePoint { approach_mm, force_n }
            })
            .collect()
    }

    #[test]
    fn a_hertzian_curve_gives_back_its_radius_modulus_and_origin() {
        let curve = hertzian(0.004, 0.3);
        let from = transition(&curve, 2.0).unwrap().delta_i_mm;
        let fit = fit_hertz(&curve, from, &Material::default(), 0.6).unwrap();
        assert!((fit.origin_mm - 0.004).abs() < 1e-9 && (fit.radius_mm - 0.3).abs() < 1e-6, "{fit:?}");
        assert!((fit.contact_modulus_mpa / Material::default().contact_modulus_mpa() - 1.0).abs() < 1e-6);
        assert!(fit.residual_n < 1e-6);
    }

    #[test]
    fn the_transition_is_the_last_time_the_force_is_passed() {
        let at = |points: &[[f64; 2]]| {
            let c: Vec<CurvePoint> =
                points.iter().map(|p| CurvePoint { approach_mm: p[0], force_n: p[1] }).collect();
            transition(&c, 2.0)
        };
        // LBS3 of the paper falls back after a first contact.
        let fell = at(&[[0.0, 0.0], [0.02, 3.0], [0.03, 0.5], [0.05, 4.5]]).unwrap();
        assert!((fell.delta_i_mm - (0.03 + 0.02 * 1.5 / 4.0)).abs() < 1e-15, "{fell:?}");
        assert!((fell.first_crossing_mm - 0.02 * 2.0 / 3.0).abs() < 1e-15, "{fell:?}");
        // At 4.5 N nobody knows whether it falls again; at four times the transition's force it counts as known.
        assert!(!fell.settled && fell.warning().unwrap().contains("preliminary"), "{fell:?}");
        let known = at(&[[0.0, 0.0], [0.02, 3.0], [0.03, 0.5], [0.05, 4.5], [0.06, 8.0]]).unwrap();
        assert!(
            known.settled
                && known.warning().is_none()
                && known.delta_i_mm.to_bits() == fell.delta_i_mm.to_bits(),
            "{known:?}"
        );
        let lost = at(&[[0.0, 0.0], [0.02, 9.0], [0.03, 0.5]]).unwrap();
        assert!(!lost.settled, "{lost:?}");
        assert_eq!(at(&[[0.0, 0.0], [0.1, 1.9]]), None);
        assert_eq!(at(&[]), None);
    }

    #[test]
    fn motion_counts_since_a_contact_has_formed_and_is_stated_with_its_range() {
        let sample = |um: f64, force_n: f64, kinetic: f64| Sample {
            time_s: 0.0,
            steps: 0,
            approach_mm: 1e-3 * um,
            force_n,
            lower_n: [0.0, 0.0, force_n],
            upper_n: [0.0, 0.0, -force_n],
            energy: Energy { kinetic, stored: 1.0, ..Energy::default() },
            rotation_rad: [0.0; 3],
            touches: Vec::new(),
            step_s: 1e-9,
            speed_mm_s: 1.0,
        };
        // The grain tips for 2 µm, then carries; at 4 µm it slips.
        let mut samples = vec![
            sample(1.0, 0.01, 9.0),
            sample(2.0, 0.1, 9.0),
            sample(3.0, 0.3, 0.04),
            sample(5.0, 10.0, 0.01),
        ];
        let calm = quasi_static(&samples, 2.0).unwrap();
        assert!((calm.formed_mm - 0.003).abs() < 1e-12 && (calm.largest - 0.04).abs() < 1e-12, "{calm:?}");
        assert_eq!((calm.above_mm, calm.warning()), (None, None));
        samples.insert(3, sample(4.0, 0.1, 0.2));
        let slipped = quasi_static(&samples, 2.0).unwrap();
        assert_eq!((slipped.above_mm, slipped.above_limit), (Some([0.004, 0.004]), 0.5));
        let warning = slipped.warning().unwrap();
        for part in ["4.00 and 4.00 µm", "0.100 N", "3.00 µm", "50.0 %", "20.0 %", "--speed"] {
            assert!(warning.contains(part), "{warning}");
        }
        assert_eq!(quasi_static(&[], 2.0), None);
    }

    #[test]
    fn a_curve_agrees_with_itself_and_not_with_another() {
        let (a, b) = (hertzian(0.0, 0.3), hertzian(0.005, 0.3));
        let same = agreement(&a, &a).unwrap();
        assert!(same.rms_n < 1e-12 && (same.determination - 1.0).abs() < 1e-12);
        let other = agreement(&a, &b).unwrap();
        assert!(other.relative > 0.05 && other.determination < same.determination, "{other:?}");
        assert_eq!(agreement(&a[..1], &b), None);
    }
}
