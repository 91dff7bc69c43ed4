//! `kill -9` while products are made: at every instant a session's products are of one set, and what is not complete is
//! not called so.

use crate::kit::{Lab, Ran, files};
use crate::random::Random;
use grainrig::session::State;
use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::process::Stdio;

/// Files that must be of one mesh.
const MESH: [&str; 3] = ["grain.inp", "grain.stl", "grain.vtu"];

/// How many kills: 200 under `GRAINRIG_KILLS=200`, for instance.
fn kills() -> usize {
    std::env::var("GRAINRIG_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(12)
}

/// An event out of so many, every other time one of the last third, where products are written.
fn event(random: &mut Random, events: usize) -> usize {
    let all = events.max(3);
    if random.below(2) == 0 { random.below(all) } else { all - 1 - random.below(all / 3) }
}

/// What a watcher sees of the data folder: each file with its number and length.
fn seen(data: &Path) -> BTreeSet<(String, u64, u64)> {
    fn add(folder: &Path, into: &mut BTreeSet<(String, u64, u64)>) {
        let Ok(entries) = std::fs::read_dir(folder) else { return };
        for entry in entries.flatten() {
            let Ok(meta) = entry.metadata() else { continue };
            into.insert((entry.path().display().to_string(), meta.ino(), meta.len()));
            if meta.is_dir() && entry.file_name() != "frames" {
                add(&entry.path(), into);
            }
        }
    }
    let mut all = BTreeSet::new();
    add(data, &mut all);
    all
}

/// Runs the program and kills it once the data folder has changed so often (never, where that is `None`); how often it
/// changed, and whether it was killed.
fn run_and_kill(lab: &Lab, args: &[&str], kill_at: Option<usize>) -> (usize, bool) {
    let data = lab.path("data");
    let (mut changes, mut before) = (0, seen(&data));
    let mut child = lab.command(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{args:?} ended with {status}");
            return (changes, false);
        }
        let now = seen(&data);
        changes += usize::from(now != before);
        before = now;
        if kill_at.is_some_and(|at| changes > at) {
            child.kill().unwrap();
            let status = child.wait().unwrap();
            return (changes, !status.success());
        }
        std::thread::yield_now();
    }
}

/// Hashes of the mesh's files, as a reader finds them now.
fn mesh_of(lab: &Lab, session: &str) -> Vec<Option<String>> {
    let there =
        if lab.session(session).join("products").is_dir() { lab.products(session) } else { BTreeMap::new() };
    MESH.map(|file| there.get(file).cloned()).into()
}

/// A killed session is made whole by `resume`, which says what it does; what was sound before may be called complete.
fn made_whole(lab: &Lab, session: &str, what: &str) {
    let sound =
        lab.run(&["verify", session]).code == Some(0) && lab.recording(session).state() == State::Complete;
    let ran: Ran = lab.run(&["resume", session]).succeeds();
    let complete = ran.stderr.contains("nothing is left to do");
    let tells = ["in their place now", "made again", "computing", "is complete now"];
    assert!(
        sound || !complete || tells.iter().any(|t| ran.stderr.contains(t)),
        "{what}: called complete and was not: {}",
        ran.stderr
    );
    let after = lab.run(&["verify", session]);
    assert_eq!(after.code, Some(0), "{what}: {}", after.stderr);
    assert_eq!(lab.recording(session).state(), State::Complete, "{what}");
}

#[test]
fn whenever_reconstruct_and_replay_are_killed_the_products_are_one_set_and_resume_makes_them_whole() {
    let lab = Lab::new();
    lab.capture("a").succeeds();
    let fine = mesh_of(&lab, "a");
    let coarse_args = ["reconstruct", "a", "--surface-size-mm", "0.2"];
    let fine_args = ["reconstruct", "a"];
    let (events, _) = run_and_kill(&lab, &coarse_args, None);
    let coarse = mesh_of(&lab, "a");
    assert_ne!(fine, coarse);
    let mut random = Random::new(1);
    let mut killed = 0;
    for n in 0..kills() / 4 {
        let args: &[&str] = if n % 2 == 0 { &fine_args } else { &coarse_args };
        let at = event(&mut random, events);
        killed += usize::from(run_and_kill(&lab, args, Some(at)).1);
        let (what, there) = (format!("reconstruct {n}, killed at change {at}"), mesh_of(&lab, "a"));
        assert!(there == fine || there == coarse, "{what}: files of different meshes");
        made_whole(&lab, "a", &what);
    }
    println!("reconstruct: {killed} of {} killed in time, {events} changes", kills() / 4);

    let lose = |which: usize| {
        let folder = lab.session("a").join("products");
        let names = files(&folder);
        std::fs::remove_file(folder.join(&names[which % names.len()])).unwrap();
        std::fs::write(folder.join(&names[(which + 5) % names.len()]), b"damaged").unwrap();
    };
    lose(0);
    let (events, _) = run_and_kill(&lab, &["replay", "a"], None);
    killed = 0;
    for n in 0..kills() / 4 {
        lose(random.below(13));
        let at = event(&mut random, events);
        killed += usize::from(run_and_kill(&lab, &["replay", "a"], Some(at)).1);
        made_whole(&lab, "a", &format!("replay {n}, killed at change {at}"));
    }
    println!("replay: {killed} of {} killed in time, {events} changes", kills() / 4);
    lab.run(&["replay", "a"]).succeeds();
}

#[test]
fn whenever_an_import_is_killed_there_is_no_session_or_one_that_resume_completes() {
    let lab = Lab::new();
    lab.photos("photos");
    let import = |name: &str| -> Vec<String> {
        let known =
            ["--config", "small.toml", "import", "photos", "--step-deg", "45", "--mm-per-px", "0.009"];
        let more = ["--closing-view", "4", "--name", name];
        known.iter().chain(&more).map(|s| (*s).to_owned()).collect()
    };
    let run = |name: &str, at| {
        let args = import(name);
        run_and_kill(&lab, &args.iter().map(String::as_str).collect::<Vec<_>>(), at)
    };
    let (events, _) = run("whole", None);
    let whole = lab.products("whole")["grain.vtu"].clone();
    let (mut random, mut killed) = (Random::new(2), 0);
    for n in 0..kills() / 4 {
        let (name, at) = (format!("i{n}"), event(&mut random, events));
        killed += usize::from(run(&name, Some(at)).1);
        let what = format!("import {n}, killed at change {at}");
        if !lab.session(&name).exists() {
            run(&name, None);
        }
        let there = mesh_of(&lab, &name);
        assert!(there.iter().all(Option::is_none) || there.iter().all(Option::is_some), "{what}: {there:?}");
        made_whole(&lab, &name, &what);
        assert_eq!(lab.products(&name)["grain.vtu"], whole, "{what}");
        std::fs::remove_dir_all(lab.session(&name)).unwrap();
    }
    println!("import: {killed} of {} killed in time, {events} changes", kills() / 4);
}

/// A configuration for two quick captures of one grain, the second with another side down.
fn pose(rotation: &str) -> String {
    format!(
        "plan = {{ views = 12, steps_per_view = 16, settle_ms = 0 }}\nmesh = {{ surface_size_mm = 0.1 }}\n\
         report = {{ pictures = false }}\noptics = {{ mm_per_px = 0.0075 }}\n[simulated]\nseed = 3\nwidth = 324\n\
         height = 270\nmm_per_px = 0.0075\n{rotation}"
    )
}

#[test]
fn whenever_a_merging_is_killed_there_is_no_session_or_a_whole_one() {
    let lab = Lab::new();
    for (name, rotation) in [("a", ""), ("b", "grain_rotation_deg = [90.0, 0.0, 65.0]")] {
        lab.write("pose.toml", pose(rotation));
        lab.run(&["--config", "pose.toml", "capture", name]).succeeds();
    }
    let (events, _) = run_and_kill(&lab, &["merge", "a", "b", "--out", "whole"], None);
    let whole = mesh_of(&lab, "whole");
    let (mut random, mut killed) = (Random::new(3), 0);
    for n in 0..kills() / 4 {
        let (name, at) = (format!("m{n}"), event(&mut random, events));
        killed += usize::from(run_and_kill(&lab, &["merge", "a", "b", "--out", &name], Some(at)).1);
        let what = format!("merge {n}, killed at change {at}");
        if !lab.session(&name).exists() {
            // Whatever is left of the killed attempt is in nobody's way.
            run_and_kill(&lab, &["merge", "a", "b", "--out", &name], None);
        }
        assert_eq!(mesh_of(&lab, &name), whole, "{what}");
        assert_eq!(lab.run(&["verify", &name]).code, Some(0), "{what}");
        made_whole(&lab, &name, &what);
        std::fs::remove_dir_all(lab.session(&name)).unwrap();
    }
    println!("merge: {killed} of {} killed in time, {events} changes", kills() / 4);
}
