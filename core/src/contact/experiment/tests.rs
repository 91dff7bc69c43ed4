use super::*;

/// Hertzian force in N at an approach in mm.
fn law(d: f64) -> f64 {
    if d > 0.0 { 4e3 * d.powf(1.5) } else { 0.0 }
}

/// 40 rows from 5 µm above the grain to 34 µm into it, written with this.
fn rows(line: impl Fn(f64, f64, f64) -> String) -> String {
    (0..40).map(|i| line(0.1 * f64::from(i), 1e-3 * f64::from(i), law(1e-3 * f64::from(i - 5)))).collect()
}

fn last(bytes: &[u8], compliance: Compliance) -> CurvePoint {
    *read(bytes).unwrap().read_off(&compliance, 2.0).unwrap().0.last().unwrap()
}

#[test]
fn every_layout_gives_the_same_curve() {
    let comma = |x: f64| format!("\"{x:.6}\"").replace('.', ",");
    let layouts: Vec<(&str, Vec<u8>)> = vec![
        ("preamble", format!("Course,\"AE\"\nRate,4.00,mm/min\n\nTime,Extension,Load\n(sec),(mm),(N)\n{}", rows(|t, d, f| format!("{t},{d:.6},{f:.6}\n"))).into_bytes()),
        ("decimal comma, negative", format!("Specimen properties : Area,\"100,0\",mm^2\n\nTime,Extension,Load,Cycle count\n(s),(mm),(N)\n{}", rows(|t, d, f| format!("{},{},{},\"0,0\"\n", comma(t), comma(-d), comma(-f)))).into_bytes()),
        ("Universal", format!("Raw Data\r\nTime (s),Displacement (um),Force (N)\r\n{}", rows(|t, d, f| format!("{t},{:.4},{f:.6}\r\n", 1e3 * d))).into_bytes()),
        ("results table, kN, quoted, semicolons", format!("Results Table 1\n;Maximum Force (kN)\n1;\"0,5\"\n\nTime (s);Compressive displacement (mm);Compressive force (kN)\n{}", rows(|t, d, f| format!("\"{t}\";\"{d:.6}\";\"{:.9}\"\n", 1e-3 * f)).replace('.', ",")).into_bytes()),
        ("byte-order mark", format!("\u{feff}Time (s),Displacement (mm),Force (N)\n{}", rows(|t, d, f| format!("{t},{d:.6},{f:.6}\n"))).into_bytes()),
        ("GBK", {
            let mut b = vec![0xca, 0xb1, 0xbc, 0xe4, b',', 0xce, 0xbb, 0xd2, 0xc6, b',', 0xd4, 0xd8, 0xba, 0xc9, b'\r', b'\n'];
            b.extend(format!("(s),(mm),(N),\r\n{}", rows(|t, d, f| format!("{t},{d:.6},{f:.6}\r\n"))).into_bytes());
            b
        }),
    ];
    for (name, bytes) in layouts {
        let end = last(&bytes, Compliance::none());
        assert!((end.approach_mm - 0.033).abs() < 1.1e-3, "{name}: {end:?}");
        assert!((end.force_n - law(0.034)).abs() < 1e-3, "{name}: {end:?}");
    }
}

#[test]
fn what_is_not_known_is_refused_with_its_header() {
    let with = |header: &str| {
        read(format!("{header}\n{}", rows(|t, d, f| format!("{t},{d:.6},{f:.6}\n"))).as_bytes())
            .unwrap_err()
            .to_string()
    };
    for (header, needed) in [
        ("Time (s),Displacement (furlong),Force (N)", "furlong"),
        ("Time (s),Displacement (mm),Force (MN)", "MN"),
        ("Time (s),Displacement (mm),Force", "unit `` of force"),
        ("Time (s),Tiefe (mm),Force (N)", "displacement"),
        ("Zeit (s),Weg (mm),Kraft (N)", "Kraft"),
    ] {
        let text = with(header);
        assert!(text.contains(needed) && text.contains(header), "{text}");
    }
    assert!(matches!(read(b""), Err(ExperimentError::Column { .. })));
    let broken = "Time (s),Displacement (mm),Force (N)\n0,0,0\n1,x,2\n";
    assert!(matches!(read(broken.as_bytes()), Err(ExperimentError::Number { line: 3, .. })));
}

#[test]
fn a_machines_compliance_is_measured_on_its_plates_and_taken_off() {
    // 0.2 µm/N, after a micrometre of bedding in.
    let plates = (0..60).fold("Time (s),Displacement (mm),Force (N)\n".to_owned(), |text, i| {
        let f = f64::from(i);
        let d = 1e-3 * (0.2 * f + 1.0 - (-f / 3.0).exp());
        text + &format!("{i},{d:.9},{f}\n")
    });
    let compliance = Compliance::measured(&read(plates.as_bytes()).unwrap()).unwrap();
    assert!((compliance.um_per_n() - 0.2).abs() < 2e-3, "{}", compliance.um_per_n());
    let bytes = format!(
        "Time (s),Displacement (mm),Force (N)\n{}",
        rows(|t, d, f| format!("{t},{:.9},{f:.6}\n", d + 0.2e-3 * f))
    );
    let (with, without) = (last(bytes.as_bytes(), compliance), last(bytes.as_bytes(), Compliance::none()));
    assert!((without.approach_mm - with.approach_mm - 0.2e-3 * with.force_n).abs() < 1e-5);
    assert!(Compliance::given(-0.1).is_err() && Compliance::given(f64::NAN).is_err());
}
