//! What is set, and what set it; what a shell and `man` know of the program; what it was built from.

use crate::kit::Lab;
use serde_json::Value;
use std::path::Path;

#[allow(dead_code, reason = "what Cargo runs")]
#[path = "../../build.rs"]
mod build;

/// A JSON Schema with its references, as far as this program's own has them.
struct Schema(Value);

impl Schema {
    fn resolved<'a>(&'a self, mut node: &'a Value) -> &'a Value {
        loop {
            let inner = node["anyOf"].as_array().and_then(|any| any.iter().find(|one| one["type"] != "null"));
            node = match (node["$ref"].as_str(), inner) {
                (Some(reference), _) => self.0.pointer(reference.trim_start_matches('#')).unwrap(),
                (None, Some(inner)) => inner,
                (None, None) => return node,
            };
        }
    }

    /// What of a configuration's keys it does not know; a table that may have any key is known as a whole.
    fn unknown(&self, node: &Value, table: &toml::Table, path: &str, out: &mut Vec<String>) {
        let node = self.resolved(node);
        for (key, value) in table {
            let (below, path) = (&node["properties"][key], format!("{path}.{key}"));
            match (below.is_null() && !node["additionalProperties"].is_object(), value.as_table()) {
                (true, _) => out.push(path),
                (false, Some(table)) if !below.is_null() => self.unknown(below, table, &path, out),
                _ => {}
            }
        }
    }
}

/// The default configuration with the keys that are only shown as examples set, too.
fn every_key(text: &str) -> toml::Table {
    let mut all = toml::Table::new();
    let mut section = String::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            name.trim_end_matches(']').clone_into(&mut section);
        }
        let is_pair = |l: &&str| l.split_once(" = ").is_some_and(|(key, _)| !key.contains(' '));
        let Some(pair) = Some(line.trim_start_matches("# ")).filter(is_pair) else { continue };
        let Ok(pair) = pair.parse::<toml::Table>() else { continue };
        let mut at = &mut all;
        for part in section.split('.').filter(|part| !part.is_empty()) {
            at = at.entry(part).or_insert_with(|| toml::Table::new().into()).as_table_mut().unwrap();
        }
        at.extend(pair);
    }
    all
}

#[test]
fn the_schema_knows_every_key_that_the_defaults_show() {
    let lab = Lab::new();
    let text = lab.run(&["config", "--default"]).succeeds().stdout;
    assert_eq!(text, include_str!("../../config/simulated.toml"));
    let schema = Schema(lab.run(&["config", "--schema"]).succeeds().json());
    let all = every_key(&text);
    assert!(all["optics"].get("camera_distance_mm").is_some(), "examples are read");
    let mut unknown = Vec::new();
    schema.unknown(&schema.0, &all, "", &mut unknown);
    assert!(unknown.is_empty(), "{unknown:?}");
    // What it has, it has from the program: a key that is not there, and a choice.
    let slip: toml::Table = "[plan]\nvews = 3\n".parse().unwrap();
    schema.unknown(&schema.0, &slip, "", &mut unknown);
    assert_eq!(unknown, [".plan.vews"]);
    let kinds = schema.resolved(&schema.resolved(&schema.0["properties"]["rig"])["properties"]["kind"]);
    assert!(kinds.to_string().contains("hardware"), "{kinds}");
}

#[test]
fn each_setting_is_shown_with_what_set_it() {
    let lab = Lab::new();
    let shown = lab.run(&["--config", "small.toml", "--as-given", "config", "--json"]).succeeds().json();
    let setting =
        |key: &str| (shown["settings"][key]["value"].clone(), shown["settings"][key]["source"].clone());
    assert_eq!(setting("plan.views"), (4.into(), "file".into()));
    assert_eq!(setting("plan.steps_per_view"), (50.into(), "file".into()));
    assert_eq!(setting("plan.retakes"), (3.into(), "default".into()));
    assert_eq!(setting("as_given"), (true.into(), "--as-given".into()));
    assert_eq!(setting("optics.camera_distance_mm"), (Value::Null, "default".into()));
    assert_eq!(shown["configuration"]["source"], "--config");
    assert_eq!(shown["data"]["source"], "--data");
    // As text it is a configuration again, the same one.
    let text = lab.run(&["--config", "small.toml", "config"]).succeeds().stdout;
    assert!(text.contains("# optics.camera_distance_mm is not set"), "{text}");
    lab.write("again.toml", &text);
    let again = lab.run(&["--config", "again.toml", "config", "--json"]).succeeds().json();
    let values = |shown: &Value| -> Vec<(String, Value)> {
        let settings = shown["settings"].as_object().unwrap();
        settings
            .iter()
            .filter(|(k, _)| *k != "as_given")
            .map(|(k, v)| (k.clone(), v["value"].clone()))
            .collect()
    };
    assert_eq!(values(&again), values(&shown));
}

#[test]
fn a_token_is_nobodys_to_see_and_a_bad_value_is_shown_with_its_fault() {
    let lab = Lab::new();
    let file = lab.write("rig.toml", "[serve]\ntoken = \"0123456789abcdef0123\"\n[plan]\nviews = 0\n");
    for form in [&["config"][..], &["config", "--json"]] {
        let ran = lab.run(&[&["--config", &file], form].concat()).fails(2, &["views is 0"]);
        assert!(ran.stdout.contains("not shown") && !ran.stdout.contains("0123456789"), "{}", ran.stdout);
        assert!(ran.stdout.contains("plan.views"), "{}", ran.stdout);
    }
}

#[test]
fn the_accounts_configuration_is_found_and_said_and_one_that_is_named_goes_before_it() {
    let lab = Lab::new();
    let own = ".config/grainrig/config.toml";
    let shown = |args: &[&str]| lab.run(args).succeeds().stdout;
    assert!(shown(&["config"]).contains(own), "where it was looked for is said");
    lab.write(own, "[plan]\nviews = 9\n");
    let text = shown(&["config"]);
    assert!(text.lines().next().unwrap().ends_with(&format!("{own} (user)")), "{text}");
    assert!(text.lines().any(|l| l.starts_with("plan.views = 9 ") && l.ends_with("# file")), "{text}");
    let named = shown(&["--config", "small.toml", "config"]);
    assert!(named.lines().any(|l| l.starts_with("plan.views = 4 ")), "{named}");
    let mut other = lab.command(&["config"]);
    lab.write("xdg/grainrig/config.toml", "[plan]\nviews = 11\n");
    let other = other.env("XDG_CONFIG_HOME", lab.path("xdg")).output().unwrap();
    assert!(String::from_utf8(other.stdout).unwrap().contains("plan.views = 11 "));
    // What every run with it says, where somebody wants to know.
    let mut devices = lab.command(&["devices"]);
    let said = devices.env("GRAINRIG_LOG", "debug").output().unwrap().stderr;
    assert!(String::from_utf8(said).unwrap().contains(&format!("{own} (user)")));
    // It is there and can't be read: no other takes its place.
    std::fs::remove_file(lab.path(own)).unwrap();
    std::fs::create_dir(lab.path(own)).unwrap();
    lab.run(&["devices"]).fails(2, &["cannot read", own, "--config FILE"]);
}

#[test]
fn shells_and_the_manual_know_the_commands() {
    let lab = Lab::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = lab.run(&["completions", shell]).succeeds().stdout;
        for word in ["capture", "reconstruct", "surface-size-mm"] {
            assert!(script.contains(word), "{shell} has no {word}");
        }
        assert!(!script.contains("camera-worker"), "{shell} offers what is hidden");
    }
    lab.run(&["completions", "cmd"]).fails(2, &["bash"]);
    assert!(lab.run(&["man"]).succeeds().stdout.starts_with(".ie"));
    let made = lab.path("man");
    lab.run(&["man", "--out", &made.display().to_string()]).succeeds();
    let page = |name: &str| std::fs::read_to_string(made.join(name)).unwrap();
    assert!(
        page("grainrig.1").contains("GRAINRIG_CONFIG") && page("grainrig-capture.1").contains("calibration")
    );
    assert!(!Path::new(&made.join("grainrig-camera-worker.1")).exists(), "what is hidden has no page");
    lab.run(&["man", "--out", "small.toml"]).fails(1, &["small.toml", "give a folder"]);
}

#[test]
fn the_version_tells_one_build_from_another() {
    let lab = Lab::new();
    let long = lab.run(&["--version"]).succeeds().stdout;
    for line in
        ["commit  ", "features  ", "stages     controller, grbl, simulated", "cameras  ", "built for  linux"]
    {
        assert!(long.lines().any(|l| l.starts_with(line)), "{line:?} is not in {long}");
    }
    let short = lab.run(&["-V"]).succeeds().stdout;
    assert!(short.lines().count() == 1 && short.starts_with("grainrig "), "{short}");
}

#[test]
fn a_build_finds_its_commit_in_a_clone_a_further_working_tree_and_not_elsewhere() {
    let lab = Lab::new();
    let found = |tree: &str| build::git_folder(&lab.path(tree)).and_then(|git| build::commit(&git));
    let id = |digit: &str| digit.repeat(40);
    assert_eq!(found("."), None, "what is not in a clone has none");
    lab.write("a/.git/HEAD", format!("{}\n", id("1")));
    assert_eq!(found("a"), Some(id("1")));
    lab.write("a/.git/HEAD", "ref: refs/heads/main\n");
    assert_eq!(found("a"), None);
    lab.write(
        "a/.git/packed-refs",
        format!("# pack-refs\n{} refs/heads/domain\n{} refs/heads/main\n", id("2"), id("3")),
    );
    assert_eq!(found("a"), Some(id("3")));
    lab.write("a/.git/refs/heads/main", format!("{}\n", id("4")));
    assert_eq!(found("a"), Some(id("4")));
    lab.write("b/.git", format!("gitdir: {}\n", lab.path("a/.git/worktrees/b").display()));
    lab.write("a/.git/worktrees/b/commondir", "../..\n");
    lab.write("a/.git/worktrees/b/HEAD", "ref: refs/heads/main\n");
    assert_eq!(found("b"), Some(id("4")));
    lab.write("a/.git/HEAD", "no hash");
    assert_eq!(found("a"), None);
}
