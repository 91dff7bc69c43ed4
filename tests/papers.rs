//! What the papers say of the repository is so: links and anchors lead somewhere, the book has all its pages and pictures,
//! commands and their options exist, and so do the tests and benches that print its figures. Files are read, and the program
//! is asked for its help; nothing else is run.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

/// The repository.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A paper: where it stands in the repository, and its text.
struct Paper {
    path: PathBuf,
    text: String,
}

impl Paper {
    fn read(path: &Path) -> Self {
        let text =
            fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        Self { path: path.into(), text }
    }

    /// Whether it is a page of the book, of which nothing outside the book's folder is published.
    fn is_in_book(&self) -> bool {
        self.path.starts_with("docs/src")
    }

    /// The lines, each with its number, and whether it stands in a fenced block.
    fn lines(&self) -> impl Iterator<Item = (usize, &str, bool)> {
        let mut fenced = false;
        self.text.lines().enumerate().map(move |(i, line)| {
            let fence = line.trim_start().starts_with("```");
            let inside = fenced || fence;
            fenced ^= fence;
            (i + 1, line, inside)
        })
    }

    /// The prose: everything that is not in a fenced block.
    fn prose(&self) -> impl Iterator<Item = (usize, &str)> {
        self.lines().filter(|(.., fenced)| !fenced).map(|(n, line, _)| (n, line))
    }

    /// Everything that a person may type: the lines of fenced blocks, continued ones joined, and inline code, which may go
    /// on in the next line.
    fn commands(&self) -> Vec<(usize, String)> {
        let mut all: Vec<(usize, String)> = Vec::new();
        let mut continued = false;
        for (n, line, _) in self.lines().filter(|(.., fenced)| *fenced) {
            let part = line.trim_end().trim_end_matches('\\');
            match all.last_mut() {
                Some((_, before)) if continued => before.push_str(part),
                _ => all.push((n, part.to_owned())),
            }
            continued = line.trim_end().ends_with('\\');
        }
        let mut text = String::new();
        let mut begun = 1;
        // A span ends with its paragraph at the latest.
        for (n, line) in self.prose().chain([(usize::MAX, "")]) {
            if line.trim().is_empty() {
                all.extend(text.split('`').skip(1).step_by(2).map(|span| (begun, span.replace('\n', " "))));
                text.clear();
                begun = n.saturating_add(1);
            } else {
                text.push_str(line);
                text.push('\n');
            }
        }
        all
    }

    /// Targets of links and pictures, and whether it is a picture.
    fn links(&self) -> Vec<(usize, String, bool)> {
        let mut all = Vec::new();
        for (n, line) in self.prose() {
            // What is in code is no link.
            let plain: String = line.split('`').step_by(2).collect::<Vec<_>>().join("code");
            let mut rest = plain.as_str();
            while let Some(at) = rest.find("](") {
                let opened = rest[..at].rfind('[').unwrap_or(0);
                let is_picture = rest[..opened].ends_with('!');
                let after = &rest[at + 2..];
                let end = after.find(')').unwrap_or(after.len());
                all.push((n, after[..end].to_owned(), is_picture));
                rest = &after[end..];
            }
        }
        all
    }

    /// The anchors of its headings, as both GitHub and mdBook make them.
    fn anchors(&self) -> BTreeSet<String> {
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        let mut all = BTreeSet::new();
        for (_, line) in self.prose() {
            let Some(heading) = line.strip_prefix('#') else { continue };
            let anchor: String = (heading.trim_start_matches('#').trim().to_lowercase().chars())
                .filter_map(|c| match c {
                    ' ' => Some('-'),
                    '-' | '_' => Some(c),
                    _ => c.is_alphanumeric().then_some(c),
                })
                .collect();
            let times = seen.entry(anchor.clone()).or_default();
            all.insert(if *times == 0 { anchor } else { format!("{anchor}-{times}") });
            *times += 1;
        }
        all
    }
}

/// Files below a folder of the repository, in order; what begins with a dot is none of ours.
fn below(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = (fs::read_dir(root().join(folder)).unwrap())
        .map(|entry| folder.join(entry.unwrap().file_name()))
        .filter(|path| !path.file_name().unwrap().to_string_lossy().starts_with('.'))
        .collect();
    entries.sort();
    entries.into_iter().flat_map(|p| if root().join(&p).is_dir() { below(&p) } else { vec![p] }).collect()
}

/// Every paper of the repository: those at its root, of the firmware, and the book.
fn papers() -> Vec<Paper> {
    let at_root = (fs::read_dir(root()).unwrap()).map(|entry| PathBuf::from(entry.unwrap().file_name()));
    let mut paths: Vec<PathBuf> =
        at_root.chain(below(Path::new("firmware"))).chain(below(Path::new("docs"))).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "md"));
    paths.sort();
    paths.iter().map(|p| Paper::read(p)).collect()
}

/// A path without `.` and `..`; `None` where it leaves the repository.
fn tidy(path: &Path) -> Option<PathBuf> {
    let mut tidied = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                if !tidied.pop() {
                    return None;
                }
            }
            part => tidied.push(part),
        }
    }
    Some(tidied)
}

/// Fails with all that is wrong at once.
fn none(wrong: &str) {
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn every_link_and_anchor_leads_somewhere() {
    let papers = papers();
    let mut wrong = String::new();
    for paper in &papers {
        for (line, target, _) in paper.links() {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let place = format!("{}:{line}: {target}", paper.path.display());
            let (file, anchor) =
                target.split_once('#').map_or((target.as_str(), None), |(f, a)| (f, Some(a)));
            let path = if file.is_empty() {
                paper.path.clone()
            } else if let Some(path) = tidy(&paper.path.parent().unwrap().join(file)) {
                path
            } else {
                writeln!(wrong, "{place} leaves the repository").unwrap();
                continue;
            };
            if !root().join(&path).exists() {
                writeln!(wrong, "{place} is not there").unwrap();
            } else if paper.is_in_book() && !path.starts_with("docs/src") {
                writeln!(wrong, "{place} is dead in the book's pages: name the file instead of linking it")
                    .unwrap();
            } else if let Some(anchor) = anchor {
                let found =
                    papers.iter().find(|p| p.path == path).is_some_and(|p| p.anchors().contains(anchor));
                if !found {
                    writeln!(wrong, "{place}: no heading of {} is so", path.display()).unwrap();
                }
            }
        }
    }
    none(&wrong);
}

#[test]
fn the_book_has_every_page_and_every_picture_once() {
    let book = Path::new("docs/src");
    let summary = Paper::read(&book.join("SUMMARY.md"));
    let listed: Vec<PathBuf> = summary.links().into_iter().map(|(_, target, _)| book.join(target)).collect();
    let used: BTreeSet<PathBuf> = (papers().iter())
        .flat_map(|p| p.links().into_iter().filter_map(|(_, t, _)| tidy(&p.path.parent().unwrap().join(t))))
        .collect();
    let mut wrong = String::new();
    for path in below(book) {
        let told = path.display();
        if path.extension().is_some_and(|e| e == "md") {
            let times = listed.iter().filter(|p| **p == path).count();
            if times != 1 && path != summary.path {
                writeln!(wrong, "{told} is {times} times in SUMMARY.md").unwrap();
            }
        } else if !used.contains(&path) {
            writeln!(wrong, "{told} is shown on no page").unwrap();
        }
        let bytes = fs::metadata(root().join(&path)).unwrap().len();
        if bytes > 250_000 {
            writeln!(wrong, "{told} has {bytes} bytes; 250 kB load over a slow line").unwrap();
        }
    }
    none(&wrong);
}

/// The long options of commands, by their names (`calibrate scale`), as their `--help` defines them.
#[derive(Default)]
struct Help {
    known: BTreeMap<String, Option<BTreeSet<String>>>,
}

impl Help {
    /// The options of a command; `None` where there is no such command.
    fn of(&mut self, command: &str) -> Option<&BTreeSet<String>> {
        let ask = || {
            let asked = Command::new(env!("CARGO_BIN_EXE_grainrig"))
                .args(command.split_whitespace())
                .arg("--help")
                .output()
                .unwrap();
            // Options are defined where a line begins with one; examples may have those of other commands.
            asked.status.success().then(|| {
                (String::from_utf8_lossy(&asked.stdout).lines())
                    .map(str::trim_start)
                    .filter(|line| line.starts_with('-'))
                    .flat_map(|line| line.split([' ', ',', '=']).filter(|w| w.starts_with("--")).take(1))
                    .map(str::to_owned)
                    .collect()
            })
        };
        self.known.entry(command.to_owned()).or_insert_with(ask).as_ref()
    }
}

/// Commands with commands of their own.
const NESTED: [&str; 2] = ["calibrate", "study"];
/// Options before a command that take a value.
const VALUED: [&str; 3] = ["--config", "--data", "--log-format"];

/// What is wrong with a command line of this program; `words` are those after its name.
fn fault(words: &[&str], help: &mut Help) -> Option<String> {
    let mut rest = words.iter().copied().peekable();
    let mut options = Vec::new();
    while let Some(option) = rest.next_if(|w| w.starts_with('-')) {
        options.push(option);
        if VALUED.contains(&option) {
            rest.next();
        }
    }
    let mut command = rest.next().unwrap_or_default().to_owned();
    // A placeholder, as in a sentence about all commands.
    if command.chars().all(|c| c.is_ascii_uppercase()) {
        return None;
    }
    if NESTED.contains(&command.as_str()) {
        command = format!("{command} {}", rest.next().unwrap_or_default());
    }
    options.extend(rest.filter(|w| w.starts_with("--")));
    let Some(known) = help.of(&command) else { return Some(format!("there is no `grainrig {command}`")) };
    let unknown = options.into_iter().map(|o| o.split('=').next().unwrap_or(o)).find(|o| !known.contains(*o));
    unknown.map(|o| format!("`grainrig {command}` has no {o}"))
}

/// The words of a command line: what is quoted is one, what follows ` #` is none.
fn words(line: &str) -> Vec<&str> {
    let line = line.split(" #").next().unwrap_or(line);
    line.split_whitespace().take_while(|w| !["|", ">", "&&", ";"].contains(w)).collect()
}

#[test]
fn every_command_and_option_is_the_programs() {
    let mut help = Help::default();
    let (mut wrong, mut held) = (String::new(), 0);
    for paper in papers() {
        for (line, command) in paper.commands() {
            let words = words(&command);
            let place = || format!("{}:{line}", paper.path.display());
            if words.first() == Some(&"grainrig") && words.len() > 1 {
                // A sentence of the program's, or its name and version.
                if words[1] == "VERSION" || words[1].starts_with(|c: char| c.is_ascii_digit()) {
                    continue;
                }
                held += 1;
                if let Some(fault) = fault(&words[1..], &mut help) {
                    writeln!(wrong, "{}: {fault}", place()).unwrap();
                }
            }
        }
    }
    none(&wrong);
    assert!(held > 60, "only {held} commands were found: how are they written?");
}

/// Cargo's own, in sentences about tests.
const CARGOS: [&str; 2] = ["--test", "--bench"];

#[test]
fn an_option_by_itself_is_one_of_the_programs() {
    let mut help = Help::default();
    let commands: Vec<String> = help_of_all(&mut help);
    let mut wrong = String::new();
    for paper in papers() {
        for (line, span) in paper.commands() {
            let Some(option) = span.split([' ', '=']).next().filter(|o| o.starts_with("--")) else {
                continue;
            };
            let is_known = CARGOS.contains(&option)
                || commands.iter().any(|c| help.of(c).is_some_and(|known| known.contains(option)));
            if !is_known {
                writeln!(wrong, "{}:{line}: no command has {option}", paper.path.display()).unwrap();
            }
        }
    }
    none(&wrong);
}

/// All commands, those within others too.
fn help_of_all(help: &mut Help) -> Vec<String> {
    let listed = |command: &[&str]| -> Vec<String> {
        let asked =
            Command::new(env!("CARGO_BIN_EXE_grainrig")).args(command).arg("--help").output().unwrap();
        let text = String::from_utf8_lossy(&asked.stdout).into_owned();
        (text.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.trim().is_empty()))
            .filter_map(|l| l.split_whitespace().next().map(str::to_owned))
            .filter(|name| name != "help")
            .collect()
    };
    let mut all: Vec<String> = listed(&[]);
    all.extend(NESTED.iter().flat_map(|n| listed(&[n]).into_iter().map(move |c| format!("{n} {c}"))));
    assert!(all.len() > 12, "{all:?}");
    // The program itself has some, too.
    all.push(String::new());
    all.retain(|c| help.of(c).is_some());
    all
}

/// The text of a test's or bench's files; `None` where it has none.
fn sources(folder: &str, name: &str) -> Option<String> {
    let files = [Path::new(folder).join(format!("{name}.rs"))];
    let own = Path::new(folder).join(name);
    let files = files.into_iter().filter(|f| root().join(f).is_file()).chain(if root().join(&own).is_dir() {
        below(&own)
    } else {
        Vec::new()
    });
    let text: String = files.filter_map(|f| fs::read_to_string(root().join(f)).ok()).collect();
    (!text.is_empty()).then_some(text)
}

#[test]
fn what_prints_a_figure_exists() {
    let all_tests: String = (below(Path::new("tests")).iter().chain(&below(Path::new("src"))))
        .filter_map(|f| fs::read_to_string(root().join(f)).ok())
        .collect();
    let makefile = fs::read_to_string(root().join("Makefile")).unwrap();
    let (mut wrong, mut held) = (String::new(), 0);
    for paper in papers() {
        for (line, command) in paper.commands() {
            let mut tell = |what: String| writeln!(wrong, "{}:{line}: {what}", paper.path.display()).unwrap();
            let words = words(&command);
            let set = words.iter().take_while(|w| w.contains('=') && !w.starts_with('-')).count();
            for variable in words[..set].iter().filter_map(|w| w.split('=').next()) {
                if variable.starts_with("GRAINRIG_") && !all_tests.contains(variable) {
                    tell(format!("no test knows {variable}"));
                }
            }
            let rest = &words[set..];
            if rest.first() == Some(&"make") && rest.len() > 1 && !rest[1].starts_with('-') {
                held += 1;
                if !makefile.contains(&format!("\n{}:", rest[1])) {
                    tell(format!("the Makefile has no {}", rest[1]));
                }
            }
            let Some(("cargo", after)) = rest.split_first().map(|(c, after)| (*c, after)) else { continue };
            for (option, folder) in [("--test", "tests"), ("--bench", "benches")] {
                let Some(at) = after.iter().position(|w| *w == option) else { continue };
                held += 1;
                let Some(text) = after.get(at + 1).and_then(|name| {
                    sources(folder, name).or_else(|| sources(&format!("core/{folder}"), name))
                }) else {
                    tell(format!("there is no {option} {:?}", after.get(at + 1)));
                    continue;
                };
                // What comes next chooses tests by a part of their names.
                let filter = after.get(at + 2).filter(|w| !w.starts_with('-'));
                let named = |f: &&str| {
                    text.lines().filter_map(|l| l.trim_start().split("fn ").nth(1)).any(|l| l.contains(*f))
                        || text.contains(&format!("mod {f}"))
                };
                if let Some(filter) = filter.filter(|f| !named(f)) {
                    tell(format!("no test of {} is called {filter}", after[at + 1]));
                }
            }
        }
    }
    none(&wrong);
    assert!(held > 30, "only {held} commands were found: how are they written?");
}

#[test]
fn the_notices_name_versions_that_are_locked() {
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let notices = Paper::read(Path::new("THIRD-PARTY.md"));
    let rows: Vec<Vec<&str>> = (notices.text.lines())
        .map(|line| line.split('|').map(str::trim).collect())
        .filter(|cells: &Vec<&str>| cells.len() == 5 && cells[2].starts_with(|c: char| c.is_ascii_digit()))
        .collect();
    assert!(rows.len() > 100, "{} crates", rows.len());
    let old: Vec<String> = (rows.iter())
        .filter(|r| !lock.contains(&format!("name = \"{}\"\nversion = \"{}\"\n", r[1], r[2])))
        .map(|r| format!("{} {}", r[1], r[2]))
        .collect();
    assert!(old.is_empty(), "not in Cargo.lock any more: {}; run docs/third-party.sh", old.join(", "));
}
