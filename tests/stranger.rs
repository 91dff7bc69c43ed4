//! The core as somebody else's program uses it: a crate of its own that depends on `grainrig-core` and nothing else.

use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const PROGRAM: &str = r#"
use grainrig_core::formats::stl;
use grainrig_core::mesh::{Controls, Solid, mesh};

fn main() {
    let surface = stl::read(&std::fs::read("cube.stl").unwrap()).unwrap();
    let body = Solid::new(surface).unwrap();
    let tets = mesh(&body, &Controls::for_size(1.0), &mut |_| ()).unwrap();
    print!("{:.3} {:.1}", tets.volume_mm3(), tets.quality().dihedral_deg.min);
}
"#;

/// A cube of 1 mm as ASCII STL.
fn cube() -> String {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|c| c as f64);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut text = "solid cube\n".to_owned();
    for [a, b, c, d] in faces {
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\nouter loop\n";
            text.extend(triangle.map(corner).map(|[x, y, z]| format!("vertex {x} {y} {z}\n")));
            text += "endloop\nendfacet\n";
        }
    }
    text + "endsolid cube\n"
}

#[test]
fn a_strangers_crate_meshes_an_stl_with_the_core_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // Below the checkout, so that it asks the same registry.
    let folder = TempDir::new_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    // Its profile is this workspace's, so that what is built already is used again.
    let ours = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let profile = &ours[ours.find("[profile.dev]").unwrap()..ours.find("[profile.release]").unwrap()];
    let core = root.join("core");
    let manifest = format!(
        "[package]\nname = \"stranger\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n\
         grainrig-core = {{ path = {core:?} }}\n{profile}"
    );
    write("Cargo.toml", &manifest);
    // The versions that this program is tested with, and that are here already.
    std::fs::copy(root.join("Cargo.lock"), folder.path().join("Cargo.lock")).unwrap();
    write("src/main.rs", PROGRAM);
    write("cube.stl", &cube());
    let run = Command::new(env!("CARGO"))
        .current_dir(folder.path())
        .args(["run", "--quiet", "--offline"])
        .env(
            "CARGO_TARGET_DIR",
            Path::new(env!("CARGO_BIN_EXE_grainrig")).parent().unwrap().parent().unwrap(),
        )
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
    let told = String::from_utf8_lossy(&run.stdout).into_owned();
    let (volume, angle) = told.split_once(' ').unwrap();
    assert!(
        (volume.parse::<f64>().unwrap() - 1.0).abs() < 0.02 && angle.parse::<f64>().unwrap() > 10.0,
        "{told}"
    );
}
