//! A room imports only rooms below it, and nobody but jobs, cli and configuration names the simulated rig.

use std::fs;
use std::path::{Path, PathBuf};

/// The program, from its roof down; all of it stands on the core, which cannot know it.
const PROGRAM: [&str; 12] = [
    "main", "cli", "server", "jobs", "config", "acquire", "pipeline", "session", "rig", "system", "trace",
    "lib",
];
/// The core. A step of the computation may import the steps whose values it takes, so the way of the data runs upwards from
/// geometry.
const CORE: [&str; 12] = [
    "study",
    "report",
    "formats",
    "contact",
    "mesh",
    "register",
    "hull",
    "calibrate",
    "silhouette",
    "geometry",
    "plausible",
    "lib",
];
/// What has no place in the core: files, clocks, threads of its own, printing. Logging and async are no dependencies of it.
const IMPURE: [&str; 7] =
    ["std::fs", "std::net", "std::thread", "std::time", "println!", "std::env", "std::process"];

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The room of a file: the first folder below `src`, or the file's own name there.
fn room(file: &Path, root: &Path) -> String {
    let first = file.strip_prefix(root).unwrap().components().next().unwrap();
    first.as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned()
}

/// Code without comments and without what is compiled for tests alone, which may look anywhere.
fn code(text: &str) -> String {
    let mut out = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(indent) = line.strip_suffix("#[cfg(test)]") {
            // An item of one line, or one that ends with a brace as far in as it begins.
            let end = format!("{indent}}}");
            let mut item = lines.by_ref().skip_while(|l| l.trim_start().starts_with("#[")).peekable();
            if item.peek().is_some_and(|first| !first.ends_with(';')) {
                item.find(|l| *l == end);
            } else {
                item.next();
            }
            continue;
        }
        out.push_str(line.split("//").next().unwrap_or(""));
        out.push('\n');
    }
    out
}

/// Every source below a folder: path, room, code.
fn files(folder: &str) -> Vec<(PathBuf, String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut found = Vec::new();
    sources(&root, &mut found);
    assert!(found.len() > 20, "the sources are not where this test looks");
    found
        .into_iter()
        .filter(|f| f.file_name().is_some_and(|n| n != "tests.rs"))
        .map(|f| (f.clone(), room(&f, &root), code(&fs::read_to_string(&f).unwrap())))
        .collect()
}

#[test]
fn what_is_compiled_for_tests_alone_is_left_out() {
    let text = "use a;\n#[cfg(test)]\nmod tests;\nuse b;\nimpl X {\n    #[cfg(test)]\n    fn f() {\n        c()\n    }\n    // d\n    e();\n}\n\
                #[cfg(test)]\n#[path = \"f.rs\"]\nmod tests {\n    g\n}\nh\n";
    let left: String = code(text).split_whitespace().collect();
    assert_eq!(left, "usea;useb;implX{e();}h");
}

#[test]
fn imports_point_down_the_house() {
    for (folder, rooms) in [("src", &PROGRAM[..]), ("core/src", &CORE[..])] {
        let place = |room: &str| rooms.iter().position(|r| *r == room);
        for (file, room, code) in files(folder) {
            let here =
                place(&room).unwrap_or_else(|| panic!("{} is in no room of the house", file.display()));
            if room == "lib" {
                continue;
            }
            for (n, line) in code.lines().enumerate() {
                for part in line.split("crate::").skip(1).chain(line.split("grainrig::").skip(1)) {
                    let target: String =
                        part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                    if let Some(there) = place(&target) {
                        assert!(
                            there >= here,
                            "{}:{}: {room} imports {target}, which is above it",
                            file.display(),
                            n + 1
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn the_core_computes_and_nothing_else() {
    for (file, _, code) in files("core/src") {
        for word in IMPURE {
            assert!(!code.contains(word), "{}: the core uses {word}", file.display());
        }
    }
}

#[test]
fn only_jobs_cli_and_configuration_name_the_simulated_rig() {
    for (file, room, code) in files("src") {
        let own = file.components().any(|c| c.as_os_str() == "simulated");
        let declared = file.ends_with("rig/mod.rs");
        if !own && !declared && !["jobs", "cli", "config", "main"].contains(&room.as_str()) {
            assert!(!code.contains("simulated"), "{} names the simulated rig", file.display());
        }
    }
}

/// Session files may come from anywhere: they are opened by one room's helpers, which follow no link, wait for no pipe and
/// know a limit. Named here is what else may open a file by its path, and what for.
#[test]
fn files_of_a_session_are_opened_in_one_place() {
    let allowed = [
        // The helpers; new files, and folders to be synced.
        "session/open.rs",
        "session/disk.rs",
    ];
    let words =
        ["fs::read(", "fs::read_to_string(", "File::open(", "OpenOptions", "fs::copy(", "tokio::fs::read"];
    for (file, room, code) in files("src") {
        let looked_at = ["session", "server", "jobs"].contains(&room.as_str());
        if looked_at && !allowed.iter().any(|allowed| file.ends_with(allowed)) {
            for word in words {
                assert!(!code.contains(word), "{}: {word} instead of session::open", file.display());
            }
        }
    }
}
