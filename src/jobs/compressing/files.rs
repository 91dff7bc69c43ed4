//! The files of a compression.

use super::{CompressResult, ExperimentResult, JobError, OtherCurve, RockingResult};
use crate::session::{LOCK, write_whole};
use grainrig_core::contact::experiment::LoadingEnd;
use grainrig_core::contact::{Press, Program, Sample, Transition, hertz, section};
use grainrig_core::formats::{press_deck, pvd, vtu};
use grainrig_core::geometry::{Point, Vector};
use grainrig_core::mesh::TetMesh;
use grainrig_core::report::{self, FieldCut, FieldPicture, Mark, Panel, Series, Sheet};
use std::fmt::Write as _;
use std::path::Path;

/// The mesh as it is now with its fields, and a picture of a cut through it.
pub(super) fn stage(folder: &Path, number: usize, mesh: &TetMesh, press: &Press) -> Result<(), JobError> {
    let fields = press.dynamics().fields(press.body());
    let (places, upper_mm) = press.positions_mm();
    let (mises, least) = (fields.mises_mpa(), fields.least_principal_mpa());
    let moved: Vec<f64> = press.displacements_mm().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    // In VTK's order: xx, yy, zz, xy, yz, xz.
    let tensor: Vec<f64> =
        fields.stress_mpa.iter().flat_map(|s| [s[0], s[1], s[2], s[5], s[3], s[4]]).collect();
    let nodal = [vtu::Column { name: "displacement_mm", components: 3, values: &moved }];
    let cells = [
        vtu::Column { name: "von_mises_mpa", components: 1, values: &mises },
        vtu::Column { name: "min_principal_mpa", components: 1, values: &least },
        vtu::Column { name: "cauchy_stress_mpa", components: 6, values: &tensor },
        vtu::Column { name: "plastic_strain", components: 1, values: &fields.plastic_strain },
    ];
    let mut grid = Vec::new();
    let deformed = TetMesh::new(places.clone(), mesh.tets.clone());
    let mut told =
        vec!["lengths in mm, stresses in MPa, tension positive; the places are those under load".to_owned()];
    told.extend(press.samples().last().map(|s| {
        format!(
            "stage {number}: approach {:.4} µm, force {:.5} N, time {:.6e} s",
            1e3 * s.approach_mm,
            s.force_n,
            s.time_s
        )
    }));
    vtu::write_commented(&deformed, &told, &nodal, &cells, &mut grid)?;
    write_whole(folder, &format!("stage_{number:02}.vtu"), &grid)?;

    let Some(sample) = press.samples().last() else { return Ok(()) };
    let (through, along) = plane(&places, sample);
    let cut = section(&deformed, &places, &through, &along);
    let coloured = |caption: &str, values: &[f64], range: [f64; 2]| FieldCut {
        caption: caption.into(),
        polygons: cut.iter().map(|(t, c)| (c.clone(), values[*t])).collect(),
        levels: vec![0.0, upper_mm],
        range,
    };
    // The very largest stresses are in a few elements: the scale ends where one in two hundred is beyond.
    let end = |values: &mut dyn Iterator<Item = f64>| {
        let mut all: Vec<f64> = values.collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len().saturating_sub(1 + all.len() / 200)).copied().unwrap_or(1.0).max(1e-9)
    };
    let most = end(&mut cut.iter().map(|(t, _)| mises[*t]));
    let deepest = end(&mut cut.iter().map(|(t, _)| -least[*t]));
    let mut cuts = vec![
        coloured("minimum principal stress, MPa", &least, [-deepest, 0.0]),
        coloured("von Mises stress, MPa", &mises, [0.0, most]),
    ];
    if fields.plastic_strain.iter().any(|s| *s > 0.0) {
        let most = end(&mut cut.iter().map(|(t, _)| fields.plastic_strain[*t]));
        cuts.push(coloured("equivalent plastic strain", &fields.plastic_strain, [0.0, most]));
    }
    let title = format!(
        "stage {number}: approach {:.2} µm, force {:.3} N, {} contacts",
        1e3 * sample.approach_mm,
        sample.force_n,
        sample.touches.len()
    );
    let png = FieldPicture { title, cuts }.png().map_err(|e| JobError::Encode(e.to_string()))?;
    write_whole(folder, &format!("stage_{number:02}.png"), &png)?;
    Ok(())
}

/// An upright plane through the two contacts that carry most, or through the middle.
fn plane(places: &[Point], sample: &Sample) -> (Point, Vector) {
    let mut touches: Vec<_> = sample.touches.iter().collect();
    touches.sort_by(|a, b| b.force_n.total_cmp(&a.force_n));
    let n = places.len().max(1) as f64;
    let middle = places.iter().fold(Vector::zeros(), |s, p| s + p.coords) / n;
    let at = |i: usize| touches.get(i).map(|t| Vector::new(t.position_mm[0], t.position_mm[1], 0.0));
    let first = at(0).unwrap_or(middle);
    let along = (at(1).unwrap_or(middle) - first).component_mul(&Vector::new(1.0, 1.0, 0.0));
    // Contacts above one another leave the direction open.
    let along = if along.norm() > 1e-3 { along } else { Vector::x() };
    (Point::from(first), along)
}

/// Writes the results; the names of all files in the folder.
pub(super) fn write(
    folder: &Path,
    mesh: &TetMesh,
    press: &Press,
    result: &CompressResult,
    stages: &[usize],
    others: &[OtherCurve],
) -> Result<Vec<String>, JobError> {
    write_whole(folder, "curve.csv", table(press.samples()).as_bytes())?;
    let sheet = sheet(press, result, others);
    write_whole(folder, "curve.svg", &sheet.svg())?;
    write_whole(folder, "curve.png", &sheet.png().map_err(|e| JobError::Encode(e.to_string()))?)?;
    let mut grids: Vec<(f64, String)> = (stages.iter().enumerate())
        .map(|(k, i)| {
            ((1e9 * press.samples()[*i].approach_mm).round() / 1e6, format!("stage_{:02}.vtu", k + 1))
        })
        .filter(|(_, name)| folder.join(name).exists())
        .collect();
    grids.dedup_by(|a, b| a.1 == b.1);
    let mut collection = Vec::new();
    pvd::write(&grids, "approach of the plates, µm", &mut collection)?;
    write_whole(folder, "stages.pvd", &collection)?;
    let s = &result.settings;
    let approach_mm = press.samples().last().map_or(0.0, |x| x.approach_mm);
    // The plates begin at the nodes where these lie outside the plates as they were asked for.
    let beyond = mesh.nodes.iter().map(|p| (p.z - s.middle_mm).abs()).fold(0.5 * s.gap_mm, f64::max);
    let earlier_mm = 2.0 * beyond - s.gap_mm;
    let deck = press_deck::Deck {
        mesh,
        material: &s.material,
        plates_mm: [s.middle_mm - beyond, s.middle_mm + beyond],
        friction: s.friction,
        // The deck begins with the grain as the plates hold it.
        approach_mm: (s.loading.to_approach_mm.unwrap_or(approach_mm) - s.rocked_mm() + earlier_mm).max(1e-6),
        seconds: press.samples().last().map_or(1e-5, |x| x.time_s),
        damping_per_s: press.dynamics().damping_per_s,
        scaled_to_s: press.body().scaled_to_s(),
        steps: 10,
        source: &s.source,
    };
    let mut text = Vec::new();
    deck.abaqus(&mut text)?;
    write_whole(folder, "abaqus.inp", &text)?;
    if s.material.deck(Program::Calculix).is_some() {
        text.clear();
        deck.calculix(&mut text)?;
        write_whole(folder, "calculix.inp", &text)?;
    }
    let mut files: Vec<String> = (std::fs::read_dir(folder).into_iter().flatten().flatten())
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .filter(|n| !n.starts_with('.') && n != LOCK)
        .chain(["result.json".to_owned()])
        .collect();
    files.sort();
    files.dedup();
    Ok(files)
}

fn table(samples: &[Sample]) -> String {
    let mut out = String::from(
        "approach_mm,force_n,lower_n,upper_n,time_s,kinetic_n_mm,internal_n_mm,external_n_mm,plastic_n_mm,balance_error,\
         rotation_deg,contacts,speed_mm_s,step_s\n",
    );
    for s in samples {
        let e = &s.energy;
        let turned = s.rotation_rad.iter().map(|x| x * x).sum::<f64>().sqrt().to_degrees();
        let _ = writeln!(
            out,
            "{:.9},{:.8},{:.8},{:.8},{:.9e},{:.6e},{:.6e},{:.6e},{:.6e},{:.3e},{:.6},{},{:.6},{:.6e}",
            s.approach_mm,
            s.force_n,
            s.lower_n[2],
            -s.upper_n[2],
            s.time_s,
            e.kinetic,
            e.internal(),
            e.external,
            e.plastic,
            e.balance_error(),
            turned,
            s.touches.len(),
            s.speed_mm_s,
            s.step_s
        );
    }
    out
}

fn series(name: &str, points: impl Iterator<Item = (f64, f64)>) -> Series {
    let points = points.map(|(x, y)| report::Point { x: 1e3 * x, y, sigma: None }).collect();
    Series { name: name.into(), points, joined: true }
}

fn sheet(press: &Press, result: &CompressResult, others: &[OtherCurve]) -> Sheet {
    let (samples, s) = (press.samples(), &result.settings);
    let mut forces =
        vec![series(s.material.law().legend, result.curve.iter().map(|p| (p.approach_mm, p.force_n)))];
    for other in others {
        forces.push(series(&other.name, other.points.iter().map(|p| (p.approach_mm, p.force_n))));
    }
    let end = result.curve.last().map_or(0.0, |p| p.approach_mm);
    let steps = || (0..=60).map(|i| end * f64::from(i) / 60.0);
    let radius = s.sphere_radius_mm.unwrap_or(0.5 * s.gap_mm);
    let law = |d: f64| hertz::force_n(&s.material, radius, 0.5 * d);
    if s.sphere_radius_mm.is_some() {
        forces.push(series("Hertz", steps().map(|d| (d, law(d)))));
        let form = |d: f64| hertz::two_plate_force_n(&s.material, radius, 0.5 * d);
        forces.push(series("two plates", steps().map(|d| (d, form(d)))));
    } else if let (Some(fit), Some(from)) = (&result.hertz, result.delta_i_mm) {
        let fitted = |d: f64| hertz::force_n(&s.material, fit.radius_mm, 0.5 * (d - fit.origin_mm));
        forces.push(series("Hertz fitted", steps().filter(|d| *d >= from).map(|d| (d, fitted(d)))));
    }
    let mark = result.delta_i_mm.map(|d| Mark::Upright(format!("{} N", s.transition_n), 1e3 * d));
    let energy =
        |name: &str, of: fn(&Sample) -> f64| series(name, samples.iter().map(|x| (x.approach_mm, of(x))));
    let panel = |title: &str, series: Vec<Series>, marks: Vec<Mark>| Panel {
        title: title.into(),
        abscissa: "approach of the plates, µm".into(),
        series,
        marks,
    };
    let turned = |x: &Sample| x.rotation_rad.iter().map(|r| r * r).sum::<f64>().sqrt().to_degrees();
    let most = (samples.iter().flat_map(|x| &x.touches).map(|t| t.id)).max().map_or(0, |m| m + 1);
    let mut carried: Vec<Series> = (0..most)
        .map(|id| {
            let of = |x: &Sample| x.touches.iter().find(|t| t.id == id).map(|t| (x.approach_mm, t.force_n));
            series(&format!("{id}"), samples.iter().filter_map(of))
        })
        .collect();
    // Only those that ever carry something to speak of.
    let last = result.curve.iter().map(|p| p.force_n).fold(0.0, f64::max);
    carried.retain(|c| c.points.iter().any(|p| p.y > 0.02 * last));
    carried.truncate(10);
    let panels = vec![
        panel("force, N", forces, mark.into_iter().collect()),
        panel("force of each contact, N", carried, Vec::new()),
        panel(
            "energy, N mm",
            vec![
                energy("plates' work", |x| x.energy.external),
                energy("internal", |x| x.energy.internal()),
                energy("kinetic", |x| x.energy.kinetic),
            ],
            Vec::new(),
        ),
        panel(
            "rotation, degrees",
            vec![series("", samples.iter().map(|x| (x.approach_mm, turned(x))))],
            Vec::new(),
        ),
    ];
    let mut figures = vec![format!(
        "{}: {} tetrahedra, {} steps, last force {:.3} N at {:.2} µm; E = {} MPa, nu = {}, friction {}",
        s.source,
        result.elements,
        result.steps,
        result.curve.last().map_or(0.0, |p| p.force_n),
        1e3 * end,
        s.material.young_mpa,
        s.material.poisson,
        s.friction
    )];
    figures.extend(s.rocking.as_ref().map(|r| format!("rocking: {}", rocking_line(r))));
    figures.extend(s.goes_on());
    figures.extend(
        result.transition.map(|t| format!("delta_i at {} N: {}", s.transition_n, transition_line(&t))),
    );
    if let Some(fit) = &result.hertz {
        figures.push(format!(
            "Hertz after delta_i: E* = {:.0} MPa at R = {:.4} mm, or R = {:.4} mm at the material's E*; origin {:.2} µm, residual {:.3} N",
            fit.contact_modulus_mpa,
            0.5 * s.gap_mm,
            fit.radius_mm,
            1e3 * fit.origin_mm,
            fit.residual_n
        ));
    }
    let mut warnings = result.warnings.clone();
    if let Some(e) = &result.experiment {
        figures.extend(experiment_lines(e));
        warnings.extend(e.reading.notes.iter().map(|n| format!("experiment: {n}")));
    }
    Sheet { title: format!("Compression of {}", s.source), panels, figures, warnings }
}

/// `δ_i` as a person reads it: alone where it is known, else with what is not.
pub fn transition_line(t: &Transition) -> String {
    let mut line = format!("{:.2} µm", 1e3 * t.delta_i_mm);
    if t.first_crossing_mm < t.delta_i_mm {
        let _ =
            write!(line, " (first passed at {:.2} µm, then the force fell again)", 1e3 * t.first_crossing_mm);
    }
    if !t.settled {
        let _ = write!(
            line,
            ", preliminary: not known whether the force falls again (it reached {:.2} N; {} N would tell)",
            t.reached_n, t.needed_n
        );
    }
    line
}

/// How the plates turned a grain before they held it, as a person reads it.
pub fn rocking_line(r: &RockingResult) -> String {
    if r.turned_deg <= 0.0 {
        let by = if r.held_by_friction { " by friction" } else { "" };
        return format!("none: the plates hold the grain as it lies{by} (gap angle {:.2}°)", r.from_gap_deg);
    }
    let end = if r.held_by_friction {
        format!("friction holds it, at a gap angle of {:.2}°", r.to_gap_deg)
    } else {
        "its upper contacts stand above the lower ones".to_owned()
    };
    format!(
        "{:.2} µm of approach: the plates turn the grain by {:.2}° (gap angle {:.2}° at first) until {end}",
        1e3 * r.approach_mm,
        r.turned_deg,
        r.from_gap_deg
    )
}

/// What a test says, and what was taken for zero, contact and end.
pub fn experiment_lines(e: &ExperimentResult) -> Vec<String> {
    let r = &e.reading;
    let mut first = match (r.delta_i_mm, r.first_crossing_mm) {
        (Some(d), Some(f)) if d > f => {
            format!(
                "delta_i {:.2} µm at {} N (first passed at {:.2} µm, then it fell again)",
                1e3 * d,
                r.transition_n,
                1e3 * f
            )
        }
        (Some(d), _) => format!("delta_i {:.2} µm at {} N", 1e3 * d, r.transition_n),
        _ => format!("delta_i not known: {} N are never passed", r.transition_n),
    };
    match &e.agreement {
        Some(a) => {
            let _ = write!(
                first,
                "; root mean square difference {:.3} N ({:.1} % of its largest force), determination {:.3}",
                a.rms_n,
                100.0 * a.relative,
                a.determination
            );
        }
        None => first.push_str("; no approach in common with the computed curve"),
    }
    let noise = r.noise_n.map_or("not known".to_owned(), |n| format!("{n:.4} N"));
    let end = match r.end {
        LoadingEnd::TurnedRound => "where the crosshead turns round",
        LoadingEnd::RecordEnds => "where the record ends",
    };
    vec![
        format!("experiment: {first}"),
        format!(
            "experiment: zero {:.4} N (noise {noise}), contact {:.4} N above it, at {:.5} mm (rows {:.2} µm apart); loading to {:.2} \
             µm, {end}; {} µm/N of the machine taken off",
            r.zero_n,
            r.contact_n,
            r.contact_mm,
            1e3 * r.spacing_mm,
            1e3 * r.end_mm,
            r.compliance_um_per_n
        ),
    ]
}
