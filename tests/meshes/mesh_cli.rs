//! `grainrig mesh` as a person uses it.

use grainrig_core::formats::stl;
use grainrig_core::geometry::{Ball, Point, TriangleMesh};
use grainrig_core::mesh::{Controls, mesh};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn grainrig(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grainrig")).args(arguments).current_dir(folder).output().unwrap()
}

/// Runs it, expects this exit code and that standard error says every part.
fn refused(folder: &Path, arguments: &[&str], code: i32, parts: &[&str]) {
    let out = grainrig(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    assert!(out.stdout.is_empty() && !said.contains("panicked"), "{said}");
    for part in parts {
        assert!(said.contains(part), "{arguments:?} should say `{part}`: {said}");
    }
}

/// A ball's surface of some hundred triangles, radius 0.5.
fn ball() -> TriangleMesh {
    let body = Ball { center: Point::new(1.0, 2.0, 3.0), radius_mm: 0.5 };
    mesh(&body, &Controls::for_size(4.0), &mut |_| ()).unwrap().surface().triangles
}

fn written(surface: &TriangleMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    stl::write(surface, &mut bytes).unwrap();
    bytes
}

#[test]
fn a_surface_becomes_three_files_and_one_object_of_figures() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("ball.STL"), written(&ball())).unwrap();
    let sizes = ["--surface-size-mm", "0.1"];
    let files = ["--out", "a.inp", "b.vtu", "c.stl"];
    let out = grainrig(at, &[&["mesh", "ball.STL", "--json"][..], &sizes[..], &files[..]].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result: Value = serde_json::from_slice(&out.stdout).unwrap();
    let volume = result["volume_mm3"].as_f64().unwrap();
    assert!((volume / std::f64::consts::FRAC_PI_6 - 1.0).abs() < 0.1, "{volume}");
    assert_eq!(result["files"], serde_json::json!(["a.inp", "b.vtu", "c.stl"]));
    assert_eq!(result["controls"]["surface_size_mm"], 0.1);
    let again = stl::read(&fs::read(at.join("c.stl")).unwrap()).unwrap();
    assert_eq!(again.check(), Ok(()));
    assert_eq!(again.triangles.len() as u64, result["triangles"].as_u64().unwrap());
    assert!(fs::read_to_string(at.join("a.inp")).unwrap().contains("*ELEMENT, TYPE=C3D4"));
    assert!(fs::read_to_string(at.join("b.vtu")).unwrap().contains("NumberOfPoints"));
    // Nothing else is left behind.
    assert_eq!(fs::read_dir(at).unwrap().count(), 4);
    // What is there is not written over unasked, not even where another file would be new.
    let coarser = ["mesh", "ball.STL", "--surface-size-mm", "0.2", "--out", "d.inp", "c.stl"];
    refused(at, &coarser, 2, &["c.stl is there already", "--force"]);
    assert!(!at.join("d.inp").exists());
    assert_eq!(
        stl::read(&fs::read(at.join("c.stl")).unwrap()).unwrap().triangles.len(),
        again.triangles.len()
    );
    assert!(grainrig(at, &[&coarser[..], &["--force"]].concat()).status.success());
    assert!(stl::read(&fs::read(at.join("c.stl")).unwrap()).unwrap().triangles.len() < again.triangles.len());

    // The same numbers read as micrometres: the same mesh, a thousand times smaller; and text for people.
    let sizes = ["--surface-size-mm", "0.0001", "--unit", "um", "--as-given"];
    let out = grainrig(at, &[&["mesh", "ball.STL"][..], &sizes[..]].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(said.contains("tetrahedra") && said.contains("inp        ball.inp"), "{said}");
    let count = |name: &str| fs::read_to_string(at.join(name)).unwrap().lines().count();
    assert!(count("ball.inp").abs_diff(count("a.inp")) < 100);
}

#[test]
fn what_cannot_be_meshed_is_refused_with_its_name_and_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let save = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).unwrap();
    let whole = ball();
    save("ball.stl", &written(&whole));
    let mut open = whole.clone();
    open.triangles.truncate(open.triangles.len() - 2);
    save("open.stl", &written(&open));
    let mut inside_out = whole.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    save("inverted.stl", &written(&inside_out));
    // A third sheet at an edge.
    let mut sheets = whole.clone();
    let [a, b, _] = sheets.triangles[0];
    sheets.vertices.push(Point::new(9.0, 9.0, 9.0));
    sheets.triangles.push([a, b, sheets.vertices.len() as u32 - 1]);
    save("sheets.stl", &written(&sheets));
    save("empty.stl", b"");
    save("cut.stl", &written(&whole)[..500]);
    save("not.stl", b"solid grain\nthis is a letter\n");
    let mut text = String::from("solid one\n");
    for t in 0..whole.triangles.len() {
        text += "facet normal 0 0 0\nouter loop\n";
        whole.corners(t).iter().for_each(|p| writeln!(text, "vertex {} {} {}", p.x, p.y, p.z).unwrap());
        text += "endloop\nendfacet\n";
    }
    save("text.stl", (text + "endsolid one\n").as_bytes());

    refused(at, &["mesh", "open.stl"], 1, &["open.stl", "edge", "close it"]);
    refused(at, &["mesh", "sheets.stl"], 1, &["sheets.stl", "edge"]);
    refused(at, &["mesh", "empty.stl"], 1, &["empty.stl"]);
    refused(at, &["mesh", "cut.stl"], 1, &["cut.stl", "cut short", "500 bytes"]);
    refused(at, &["mesh", "not.stl"], 1, &["not.stl", "STL"]);
    refused(at, &["mesh", "missing.stl"], 1, &["missing.stl", "cannot read"]);
    refused(at, &["mesh", "ball.stl", "--out", "ball.off"], 2, &["ball.off", ".vtu"]);
    refused(at, &["mesh", "ball.stl", "--out", "./ball.stl"], 2, &["ball.stl", "another name"]);
    refused(at, &["mesh", "ball.stl", "--out", "no/such/a.inp"], 1, &["no/such/a.inp", "cannot write"]);
    refused(at, &["mesh", "ball.stl", "--facet-angle-deg", "45"], 2, &["45 °", "at most 30°"]);
    refused(
        at,
        &["mesh", "ball.stl", "--surface-size-mm", "1e-5", "--as-given"],
        2,
        &["tetrahedra", "set surface_size_mm"],
    );
    refused(at, &["mesh", "ball.stl", "--surface-size-mm", "50", "--as-given"], 1, &["ball.stl", "smaller"]);
    refused(at, &["mesh", "ball.stl", "--unit", "inch"], 2, &["um", "mm"]);
    assert!(!at.join("ball.inp").exists());
    let out = grainrig(at, &["mesh", "text.stl", "--surface-size-mm", "0.2"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(at.join("text.inp").exists());
}

#[test]
fn what_is_inside_out_is_turned_and_said_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut inside_out = ball();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    fs::write(at.join("inverted.stl"), written(&inside_out)).unwrap();
    let out = grainrig(at, &["mesh", "inverted.stl", "--preset", "coarse", "--json"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.success() && said.contains("inside out") && said.contains("turned outwards"),
        "{said}"
    );
    let result: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(result["turned_outwards"], true);
    let deck = fs::read_to_string(at.join("inverted.inp")).unwrap();
    assert!(
        deck.contains("** the input was inside out") && deck.contains("** sha256 of the input\n"),
        "{deck:.900}"
    );
}

#[test]
fn surfaces_without_an_inside_and_controls_that_contradict_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let save = |name: &str, mesh: &TriangleMesh| fs::write(at.join(name), written(mesh)).unwrap();
    let whole = ball();
    save("ball.stl", &whole);
    // The same ball again, a third of its diameter aside.
    let mut two = whole.clone();
    let n = whole.vertices.len() as u32;
    two.vertices
        .extend(whole.vertices.iter().map(|p| p + grainrig_core::geometry::Vector::new(0.3, 0.01, 0.02)));
    two.triangles.extend(whole.triangles.iter().map(|t| t.map(|v| v + n)));
    save("two.stl", &two);
    // A sheet with a back.
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.3, 0.3, 0.]].map(Point::from).to_vec();
    let sheet =
        TriangleMesh { vertices: corners, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] };
    save("sheet.stl", &sheet);
    let mut nan = written(&whole);
    nan[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(at.join("nan.stl"), nan).unwrap();
    // Ten million triangles: header and length are enough (the file has a hole for them).
    let mut many = vec![b' '; 84];
    many[80..84].copy_from_slice(&10_000_000u32.to_le_bytes());
    fs::write(at.join("many.stl"), many).unwrap();
    fs::File::options().write(true).open(at.join("many.stl")).unwrap().set_len(84 + 50 * 10_000_000).unwrap();

    refused(at, &["mesh", "two.stl"], 1, &["two.stl", "cut one another", "repair it"]);
    refused(at, &["mesh", "sheet.stl"], 1, &["sheet.stl", "mm³"]);
    refused(at, &["mesh", "nan.stl"], 1, &["nan.stl", "not a finite"]);
    refused(at, &["mesh", "many.stl"], 1, &["many.stl", "10000000 triangles", "5000000", "decimate"]);
    let asked = |more: &[&str], code, parts: &[&str]| {
        refused(at, &[&["mesh", "ball.stl"][..], more].concat(), code, parts);
    };
    asked(
        &["--surface-size-mm", "0.02", "--size-at-contact-mm", "0.1"],
        2,
        &["size_at_contact_mm is 0.1 mm", "at most"],
    );
    asked(&["--distance-mm", "-1"], 2, &["distance_mm is -1 mm", "positive"]);
    asked(&["--distance-mm", "1e-7", "--as-given"], 1, &["distance_mm", "could not be kept"]);
    asked(&["--surface-size-mm", "1e-5", "--as-given"], 2, &["GB of memory", "set surface_size_mm"]);
    asked(&["--contact-depth-mm", "0.1"], 2, &["--size-at-contact-mm"]);
    asked(&["--order", "3"], 2, &["--order"]);
}

#[test]
fn every_kind_of_file_is_written_and_meshes_and_surfaces_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("ball.stl"), written(&ball())).unwrap();
    let files = ["a.inp", "a.vtu", "a.msh", "a.stl", "a.ply", "a.obj", "a.glb", "a.svg", "a.png"];
    let start = [
        "mesh",
        "ball.stl",
        "--order",
        "2",
        "--surface-size-mm",
        "0.1",
        "--size-at-contact-mm",
        "0.05",
        "--out",
    ];
    let out = grainrig(at, &[&start[..], &files[..]].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(said.contains("distance to the surface") && said.contains("s in quartz"), "{said}");
    let has = |file: &str, what: &str| {
        let bytes = fs::read(at.join(file)).unwrap();
        assert!(String::from_utf8_lossy(&bytes).contains(what), "{file} should have `{what}`");
    };
    has("a.inp", "*ELEMENT, TYPE=C3D10, ELSET=GRAIN");
    has("a.msh", "sha256 of the input ");
    has("a.vtu", "<!-- made by grainrig ");
    has("a.ply", "comment sha256 of the input ");
    has("a.obj", "# sha256 of the input ");
    has("a.stl", "from sha256 ");
    has("a.glb", "sha256 of the input ");
    has("a.svg", "dihedral angles");
    assert_eq!(&fs::read(at.join("a.png")).unwrap()[1..4], b"PNG");
    for file in ["a.inp", "a.msh", "a.stl", "a.ply", "a.obj"] {
        let out =
            grainrig(at, &["mesh", file, "--preset", "coarse", "--json", "--force", "--out", "again.vtu"]);
        assert!(out.status.success(), "{file}: {}", String::from_utf8_lossy(&out.stderr));
        let result: Value = serde_json::from_slice(&out.stdout).unwrap();
        let volume = result["input_volume_mm3"].as_f64().unwrap();
        assert!((volume - std::f64::consts::FRAC_PI_6).abs() < 0.01, "{file}: {volume}");
        assert!(result["distance_to_input_mm"]["mean_mm"].as_f64().unwrap() < 0.01, "{file}");
        assert!(result["time_step_quartz_s"].as_f64().unwrap() > 0.0, "{file}");
    }
}

/// A ball of voxels as NRRD: `half` across its radius in voxels of 20 µm, in grey values.
fn nrrd(half: i32, encoding: &str, extra: &str, value: impl Fn(f64) -> u8) -> Vec<u8> {
    let n = 2 * half + 6;
    let samples: Vec<u8> = (0..n * n * n)
        .map(|i| [i % n, i / n % n, i / n / n].map(|x| f64::from(x) - f64::from(n - 1) / 2.0))
        .map(|c| value(c.iter().map(|x| x * x).sum::<f64>().sqrt()))
        .collect();
    let data = if encoding == "gzip" {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, &samples).unwrap();
        packed.finish().unwrap()
    } else {
        samples
    };
    let header =
        format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: {n} {n} {n}\nencoding: {encoding}\n{extra}\n\n");
    [header.as_bytes(), &data].concat()
}

#[test]
fn voxels_become_a_mesh_of_their_volume() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mm = "space directions: (0.02,0,0) (0,0.02,0) (0,0,0.02)\nspace units: \"mm\" \"mm\" \"mm\"";
    let solid = |r: f64| u8::from(r < 25.0);
    let grey = |r: f64| (200.0 - 4.0 * r).clamp(0.0, 255.0) as u8;
    fs::write(at.join("a.nrrd"), nrrd(25, "raw", mm, solid)).unwrap();
    // The same in micrometres, packed, in whole grey values: from 100 on it is within 25 voxels.
    fs::write(at.join("b.nrrd"), nrrd(25, "gzip", "spacings: 20 20 20", grey)).unwrap();
    let mut made = Vec::new();
    for (name, more) in [("a.nrrd", &[][..]), ("b.nrrd", &["--threshold", "99.5", "--unit", "um"])] {
        let out = grainrig(at, &[&["mesh", name, "--json", "--force", "--out", "m.inp"][..], more].concat());
        assert!(out.status.success(), "{name}: {}", String::from_utf8_lossy(&out.stderr));
        let result: Value = serde_json::from_slice(&out.stdout).unwrap();
        let counted = result["input_volume_mm3"].as_f64().unwrap();
        assert!((counted / (4.0 / 3.0 * std::f64::consts::PI * 0.125) - 1.0).abs() < 0.005, "{counted}");
        // Smoothing takes half a percent at this resolution.
        let volume = result["volume_mm3"].as_f64().unwrap();
        assert!((-0.01..0.0).contains(&(volume / counted - 1.0)), "{volume} of {counted}");
        assert!(result["distance_from_input_mm"]["max_mm"].as_f64().unwrap() < 0.02, "{result}");
        made.push(volume);
    }
    assert!((made[0] / made[1] - 1.0).abs() < 0.005, "{made:?}");

    // A mesh that is far from its body is not passed over.
    let coarse = grainrig(at, &["mesh", "a.nrrd", "--surface-size-mm", "0.5", "--force", "--json"]);
    let result: Value = serde_json::from_slice(&coarse.stdout).unwrap();
    let warned = result["warnings"].to_string().contains("too large for this shape");
    let off = result["volume_mm3"].as_f64().unwrap() / result["input_volume_mm3"].as_f64().unwrap() - 1.0;
    assert!(warned && off.abs() > 0.02, "{off}: {result}");

    // Half a ball: the middle of the other half lies on the edge.
    let whole = String::from_utf8_lossy(&grainrig(at, &["mesh", "a.nrrd"]).stderr).into_owned();
    assert!(!whole.contains("edge"), "{whole}");
    let (bytes, n) = (nrrd(25, "raw", mm, solid), 56);
    let header = String::from_utf8_lossy(&bytes[..bytes.len() - n * n * n])
        .replace(&format!("sizes: {n} {n} {n}"), &format!("sizes: {n} {n} {}", n / 2));
    fs::write(at.join("half.nrrd"), [header.as_bytes(), &bytes[bytes.len() - n * n * n / 2..]].concat())
        .unwrap();
    let half = grainrig(at, &["mesh", "half.nrrd"]);
    let said = String::from_utf8_lossy(&half.stderr);
    assert!(
        half.status.success() && said.contains("half.nrrd: the grain reaches the volume's edge at z = 0:"),
        "{said}"
    );

    fs::write(at.join("grey.nrrd"), nrrd(9, "raw", mm, |r| (200.0 - 4.0 * r) as u8)).unwrap();
    refused(at, &["mesh", "grey.nrrd"], 1, &["grey.nrrd", "not just two, but from", "--threshold"]);
    refused(at, &["mesh", "grey.nrrd", "--threshold", "999"], 1, &["no voxel is above 999"]);
    refused(at, &["mesh", "grey.nrrd", "--threshold", "nan"], 2, &["--threshold NaN", "finite"]);
    fs::write(at.join("inches.nrrd"), nrrd(9, "raw", &mm.replace("mm", "in"), |r| u8::from(r < 9.0)))
        .unwrap();
    refused(at, &["mesh", "inches.nrrd"], 1, &["its unit is `in`", "space units"]);
    fs::write(at.join("bare.nrrd"), nrrd(9, "raw", "# nothing", |r| u8::from(r < 9.0))).unwrap();
    refused(at, &["mesh", "bare.nrrd"], 1, &["how large its voxels are", "spacings"]);
    fs::write(at.join("ball.stl"), written(&ball())).unwrap();
    refused(at, &["mesh", "ball.stl", "--threshold", "1"], 2, &["--threshold goes with voxels"]);
}

/// The ball in a file of a kind, every coordinate `scale` times its own and then `shift` on.
fn moved(kind: &str, scale: f64, shift: f64) -> Vec<u8> {
    let mut surface = ball();
    surface.vertices.iter_mut().for_each(|p| *p = Point::from(p.coords * scale).map(|x| x + shift));
    if kind == "stl" {
        // Written here: the program itself refuses to write such a file.
        let mut bytes = vec![0u8; 80];
        bytes.extend((surface.triangles.len() as u32).to_le_bytes());
        for t in 0..surface.triangles.len() {
            bytes.extend([0u8; 12]);
            surface.corners(t).iter().flat_map(|p| [p.x, p.y, p.z]).for_each(|x| {
                bytes.extend((x as f32).to_le_bytes());
            });
            bytes.extend([0, 0]);
        }
        return bytes;
    }
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", surface.vertices.len());
    text += "property double x\nproperty double y\nproperty double z\n";
    writeln!(text, "element face {}", surface.triangles.len()).unwrap();
    text += "property list uchar uint vertex_indices\nend_header\n";
    surface.vertices.iter().for_each(|p| writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap());
    surface.triangles.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c}").unwrap());
    text.into_bytes()
}

#[test]
fn coordinates_that_overflow_or_have_lost_their_digits_are_refused_with_value_and_limit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let save = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).unwrap();
    let origin = "move it to the origin before it is exported";
    save("shifted.stl", &moved("stl", 1.0, 1e7));
    refused(
        at,
        &["mesh", "shifted.stl"],
        1,
        &["shifted.stl", "single precision are 1 apart", "1000", origin],
    );
    refused(at, &["compress", "shifted.stl"], 1, &["shifted.stl", "single precision are 1 apart", origin]);
    refused(at, &["study", "sensitivity", "--stl", "shifted.stl"], 1, &["shifted.stl", origin]);
    save("shifted.ply", &moved("ply", 1.0, 1e15));
    refused(at, &["mesh", "shifted.ply"], 1, &["shifted.ply", "double precision are 0.125 apart", origin]);
    for (kind, scale) in [("stl", 1e37), ("ply", 1e37), ("ply", 1e200), ("stl", 1e-37), ("ply", 1e-300)] {
        let name = format!("scaled.{kind}");
        save(&name, &moved(kind, scale, 0.0));
        let limits = "it must be 1e-6 to 1e6 mm";
        refused(at, &["mesh", &name, "--as-given"], 1, &[&name, "mm long", limits, "--unit"]);
    }
    save("overflown.stl", &moved("stl", 1e39, 0.0));
    refused(at, &["mesh", "overflown.stl"], 1, &["overflown.stl", "not a finite number", "inf"]);
    save(
        "nan.ply",
        String::from_utf8(moved("ply", 1.0, 0.0)).unwrap().replacen("\n1", "\nNaN", 40).as_bytes(),
    );
    refused(at, &["mesh", "nan.ply"], 1, &["nan.ply", "NaN"]);
    let deck = |x: &str| {
        format!(
            "*NODE\n1, {x}, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
        )
    };
    for (x, part) in [("NaN", "not finite"), ("inf", "not finite"), ("1e38", "1e-6 to 1e6 mm")] {
        save("deck.inp", deck(x).as_bytes());
        refused(at, &["mesh", "deck.inp", "--out", "made.inp", "--as-given"], 1, &["deck.inp", part]);
    }
    let volume = |origin: &str, pitch: &str| {
        let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n";
        let space = "space dimension: 3\n";
        let mut bytes =
            format!("{header}{space}space origin: ({origin},0,0)\nspacings: {pitch} {pitch} {pitch}\n\n");
        (0..64).for_each(|i| bytes.push(if (21..43).contains(&i) { '\u{1}' } else { '\0' }));
        bytes.into_bytes()
    };
    for (from, pitch, part) in
        [("1e20", "0.1", origin), ("0", "1e38", "1e-6 to 1e6 mm"), ("0", "1e-38", "1e-6 to 1e6 mm")]
    {
        save("voxels.nrrd", &volume(from, pitch));
        refused(at, &["mesh", "voxels.nrrd", "--as-given"], 1, &["voxels.nrrd", part]);
    }
    assert!(!at.join("shifted.inp").exists() && !at.join("scaled.inp").exists());
}

#[test]
fn a_shift_that_leaves_enough_digits_changes_nothing_but_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let figures = |name: &str, bytes: &[u8]| -> (Value, f64) {
        fs::write(at.join(name), bytes).unwrap();
        let sizes = ["--surface-size-mm", "0.1", "--out", "made.inp", "--force", "--json"];
        let out = grainrig(at, &[&["mesh", name][..], &sizes[..]].concat());
        assert!(out.status.success(), "{name}: {}", String::from_utf8_lossy(&out.stderr));
        let made = grainrig_core::formats::inp_read::read(&fs::read(at.join("made.inp")).unwrap()).unwrap();
        assert_eq!(made.check(), Ok(()));
        let x = made.nodes.iter().map(|p| p.x).sum::<f64>() / made.nodes.len() as f64;
        (serde_json::from_slice(&out.stdout).unwrap(), x)
    };
    let (own, x) = figures("own.ply", &moved("ply", 1.0, 0.0));
    let volume = |v: &Value| v["volume_mm3"].as_f64().unwrap();
    for (name, shift, share) in [
        ("near.stl", 100.0, 1e-4),
        ("far.stl", 5e3, 1e-3),
        ("far.ply", 1e7, 1e-6),
        ("farther.ply", -3e8, 1e-6),
    ] {
        let kind = name.rsplit('.').next().unwrap();
        let (made, there) = figures(name, &moved(kind, 1.0, shift));
        assert!((volume(&made) / volume(&own) - 1.0).abs() < f64::max(share, 2e-3), "{name}: {made}");
        assert!(
            (made["input_volume_mm3"].as_f64().unwrap() / own["input_volume_mm3"].as_f64().unwrap() - 1.0)
                .abs()
                < share
        );
        assert!((there - x - shift).abs() < 0.01, "{name}: {there} {x}");
    }
}
