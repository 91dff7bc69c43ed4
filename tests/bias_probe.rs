use grainrig::calibrate::fit_disc;
use grainrig::pipeline::decode;
use grainrig::silhouette::{find, Settings};
use grainrig::rig::simulated;
use grainrig::rig::{Camera, RotationStage};
use grainrig::geometry::Angle;

#[test]
fn rendered() {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/turntable-rendered/sand_ma107_00002"));
    let empty = decode(&std::fs::read(folder.join("empty.png")).unwrap()).unwrap();
    for bg in [true, false] {
    for (k, i) in ["00", "05", "10", "15", "20"].iter().enumerate() {
        let p = decode(&std::fs::read(folder.join(format!("ball_{i}.png"))).unwrap()).unwrap();
        let f = find(&p, bg.then_some(&empty), &Settings::default()).unwrap();
        let d = fit_disc(&f.silhouette, f.report.pedestal.as_ref()).unwrap();
        let a = (36.0 * k as f64).to_radians();
        let y = -0.05 * a.sin() + 0.03 * a.cos();
        let t = 120.0 / ((120.0 + y) * (120.0 + y) - 1.0).sqrt() / 0.00437;
        println!("bg {bg} ball {i}: {:.4} ± {:.4}, true {t:.4}, bias {:+.4}  rms {:.3} ell {:.5}±{:.5} @{:.0} n {} indep {:.0} c {:?} ped {:?}", d.radius_px, d.sigma_px, d.radius_px - t, d.residual_px, d.ellipticity, d.ellipticity_sigma, d.greater_axis_rad.to_degrees(), d.points, d.independent, d.center_px, f.report.pedestal.map(|p| (p.top_row, p.half_width)));
    }
    }
}

#[test]
fn simulated_balls() {
    for bright in [true, false] {
        for blur in [0.5, 1.0, 2.0, 3.0] {
            for dist in [None, Some(60.0)] {
                let s = simulated::Settings {
                    sphere_diameter_mm: Some(2.0), width: 1000, height: 800, mm_per_px: 0.0045, camera_distance_mm: dist,
                    blur_px: blur, bright_background: bright, ..Default::default()
                };
                let (mut stage, mut cam, _) = simulated::open(&s).unwrap();
                stage.home().unwrap();
                for k in 0..2 {
                    let a = Angle::from_deg(36.0 * k as f64);
                    stage.move_to(a).unwrap();
                    let p = decode(&cam.capture().unwrap().bytes).unwrap();
                    let f = match find(&p, None, &Settings::default()) { Ok(f) => f, Err(e) => { println!("bright {bright} blur {blur} {dist:?}: {e}"); continue } };
                    let y = 0.03 * a.rad().sin() - 0.02 * a.rad().cos();
                    let t = dist.map_or(1.0, |d| d / ((d + y) * (d + y) - 1.0f64).sqrt()) / 0.0045;
                    match fit_disc(&f.silhouette, f.report.pedestal.as_ref()) {
                        Ok(d) => println!("bright {bright} blur {blur} {dist:?}: {:.4} ± {:.4} bias {:+.4} rms {:.3} ell {:.5}±{:.5} @{:.0} indep {:.0}/{} ch {:?} ped {}", d.radius_px, d.sigma_px, d.radius_px - t, d.residual_px, d.ellipticity, d.ellipticity_sigma, d.greater_axis_rad.to_degrees(), d.independent, d.points, f.report.channel, f.report.pedestal.is_some()),
                        Err(e) => println!("bright {bright} blur {blur} {dist:?}: {e}"),
                    }
                }
            }
        }
    }
}
