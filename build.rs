//! Tells the program which commit it is built from: of a release build in a clone, or where `GRAINRIG_COMMIT` says it (a
//! package's build has no clone). Other builds would be made anew with every commit, and go without.

use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=GRAINRIG_COMMIT");
    let given = std::env::var("GRAINRIG_COMMIT").ok().filter(|c| !c.is_empty());
    let is_release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let found = || {
        let git = git_folder(Path::new(&std::env::var("CARGO_MANIFEST_DIR").ok()?))?;
        // Cargo runs a script each time whose watched file is not there.
        let watched =
            ["HEAD", "logs/HEAD"].map(|name| git.join(name)).into_iter().filter(|path| path.exists());
        watched.for_each(|path| println!("cargo:rerun-if-changed={}", path.display()));
        commit(&git)
    };
    if let Some(commit) = given.or_else(|| is_release.then(found).flatten()) {
        println!("cargo:rustc-env=GRAINRIG_COMMIT={commit}");
    }
}

/// The repository's own folder of a working tree: `.git`, or where a file of that name leads.
pub(crate) fn git_folder(tree: &Path) -> Option<PathBuf> {
    let git = tree.join(".git");
    match fs::read_to_string(&git) {
        Ok(text) => Some(tree.join(text.trim().strip_prefix("gitdir: ")?)),
        Err(_) => git.is_dir().then_some(git),
    }
}

/// The commit that is checked out.
pub(crate) fn commit(git: &Path) -> Option<String> {
    let head = fs::read_to_string(git.join("HEAD")).ok()?;
    let Some(name) = head.trim().strip_prefix("ref: ") else { return whole(head.trim()) };
    // Branches of a further working tree are those of the first.
    let common = fs::read_to_string(git.join("commondir")).map_or(git.into(), |to| git.join(to.trim()));
    if let Ok(id) = fs::read_to_string(common.join(name)) {
        return whole(id.trim());
    }
    let packed = fs::read_to_string(common.join("packed-refs")).ok()?;
    packed.lines().find_map(|line| line.strip_suffix(name)?.strip_suffix(' ')).and_then(whole)
}

/// A hash, whole.
fn whole(id: &str) -> Option<String> {
    (id.len() >= 40 && id.bytes().all(|b| b.is_ascii_hexdigit())).then(|| id.to_owned())
}
