//! Tests that can't be done where they run say so in one way: `make test` counts and lists them at its end.
//!
//! `GRAINRIG_REQUIRE` names what may not be lacking (`tools`, `data`, `system`, several with commas between them, or `all`):
//! there a test that would be skipped fails. `GRAINRIG_SKIPPED` names the file that the list is made of.

// Each test file uses its own part of this.
#![allow(dead_code)]

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// What is lacking where a test is skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lacking {
    /// A program or library that `make test` installs where it can.
    Tools,
    /// Data that not every checkout has beside it.
    Data,
    /// What only some systems have or allow.
    System,
}

/// Says that a test, or a part of it, is skipped, and why.
///
/// # Panics
/// Where `GRAINRIG_REQUIRE` asks for what is lacking.
#[track_caller]
pub fn skip(lacking: Lacking, why: impl Display) {
    let kind = match lacking {
        Lacking::Tools => "tools",
        Lacking::Data => "data",
        Lacking::System => "system",
    };
    println!("skipped: {why}");
    let thread = std::thread::current();
    let test = std::env::var("NEXTEST_TEST_NAME").ok();
    let test = test.as_deref().or(thread.name()).unwrap_or("a test");
    if let Some(list) = std::env::var_os("GRAINRIG_SKIPPED") {
        let line = format!("{} {test}: {why} ({kind})\n", env!("CARGO_CRATE_NAME"));
        // One write each: lines of tests side by side don't mix.
        let mut file = OpenOptions::new().create(true).append(true).open(list).unwrap();
        file.write_all(line.as_bytes()).unwrap();
    }
    let required = std::env::var("GRAINRIG_REQUIRE").unwrap_or_default();
    let known = |name: &&str| ["tools", "data", "system", "all", ""].contains(name);
    assert!(required.split(',').all(|name| known(&name)), "GRAINRIG_REQUIRE is {required:?}");
    let is_required = required.split(',').any(|name| name == kind || name == "all");
    assert!(!is_required, "GRAINRIG_REQUIRE={required} asks for this test, which would be skipped: {why}");
}

/// A file or folder of the data that some checkouts have beside them; where it is not there, the test is skipped.
#[track_caller]
pub fn shared_data(path: &str) -> Option<PathBuf> {
    let found = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(path);
    if found.exists() {
        return Some(found);
    }
    skip(Lacking::Data, format_args!("{} is not there", found.display()));
    None
}
