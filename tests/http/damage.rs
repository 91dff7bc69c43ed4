//! A session that was damaged, or forged, in hundreds of ways: nothing of it is shown as recorded that is not, nothing
//! outside it is shown at all, nothing waits for ever, and nobody calls it whole.

use crate::random::Random;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::daemon::{Daemon, Lab, SMALL, files};

/// Mutations unless `GRAINRIG_MUTATIONS` says otherwise.
const MUTATIONS: u64 = 17;
const KINDS: u64 = 17;

fn copy(from: &Path, to: &Path) {
    for (path, bytes) in files(from) {
        let target = to.join(path.strip_prefix(from).unwrap());
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::write(target, bytes).unwrap();
    }
}

fn pipe(at: &Path) {
    assert!(Command::new("mkfifo").arg(at).status().unwrap().success());
}

/// Damages one thing; what it was, and whether it may look like a run that was killed before its end.
fn damage(kind: u64, dice: &mut Random, folder: &Path, outside: &Path) -> (String, bool) {
    let mut all: Vec<PathBuf> = files(folder).into_iter().map(|(path, _)| path).collect();
    all.retain(|path| !path.ends_with("lock"));
    let file = all[dice.below(all.len())].clone();
    let name = file.strip_prefix(folder).unwrap().display().to_string();
    let journal = folder.join("journal.jsonl");
    let bytes = fs::read(&file).unwrap();
    let text = fs::read_to_string(&journal).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let sub = folder.join(["frames", "products"][dice.below(2)]);
    let away = outside.join("elsewhere");
    let replaced = |with: &dyn Fn(&Path)| {
        fs::remove_file(&file).unwrap();
        with(&file);
    };
    // A journal that ends sooner looks as one whose program was killed.
    let tail = file == journal;
    match kind {
        0 => {
            let mut bytes = bytes;
            let at = dice.below(bytes.len());
            bytes[at] ^= 1 << dice.below(8);
            fs::write(&file, bytes).unwrap();
            (format!("bit of byte {at} of {name}"), tail)
        }
        1 => {
            let left = dice.below(bytes.len());
            fs::write(&file, &bytes[..left]).unwrap();
            (format!("{name} cut to {left} bytes"), tail)
        }
        2 => {
            fs::write(&file, [&bytes[..], b"more"].concat()).unwrap();
            (format!("{name} with more"), tail)
        }
        3 => {
            let other = all.iter().find(|o| **o != file && fs::read(o).unwrap() != bytes).unwrap();
            let their = fs::read(other).unwrap();
            fs::write(&file, their).unwrap();
            fs::write(other, &bytes).unwrap();
            (format!("{name} and {} exchanged", other.display()), false)
        }
        4 => {
            // The very bytes, but not the session's own.
            fs::write(outside.join("twin"), &bytes).unwrap();
            replaced(&|at| symlink(outside.join("twin"), at).unwrap());
            (format!("{name} a link to its twin"), false)
        }
        5 => {
            replaced(&|at| symlink("/dev/zero", at).unwrap());
            (format!("{name} a link to /dev/zero"), false)
        }
        6 => {
            // As long as what was recorded.
            fs::write(outside.join("secret"), vec![b's'; bytes.len()]).unwrap();
            replaced(&|at| symlink(outside.join("secret"), at).unwrap());
            (format!("{name} a link to a secret"), false)
        }
        7 => {
            replaced(&pipe);
            (format!("{name} a pipe"), false)
        }
        8 => {
            replaced(&|at| fs::create_dir(at).unwrap());
            (format!("{name} a folder"), false)
        }
        9 => {
            replaced(&|_| {});
            (format!("{name} missing"), false)
        }
        10 => {
            let file = fs::OpenOptions::new().write(true).open(&file).unwrap();
            file.set_len(1 << 40).unwrap();
            (format!("{name} of 1 TiB"), tail)
        }
        11 => {
            let dropped = dice.below(lines.len());
            let kept = lines.iter().enumerate().filter(|(n, _)| *n != dropped);
            fs::write(&journal, kept.flat_map(|(_, line)| [line, "\n"]).collect::<String>()).unwrap();
            (format!("line {dropped} of {} dropped", lines.len()), dropped + 1 == lines.len())
        }
        12 => {
            let twice = dice.below(lines.len());
            let doubled =
                lines.iter().enumerate().flat_map(|(n, line)| vec![*line; 1 + usize::from(n == twice)]);
            fs::write(&journal, doubled.flat_map(|line| [line, "\n"]).collect::<String>()).unwrap();
            (format!("line {twice} twice"), false)
        }
        13 => {
            let manifest = folder.join("manifest.json");
            let text = fs::read_to_string(&manifest).unwrap();
            let edits =
                [("\"settle_ms\": 0", "\"settle_ms\": 1"), ("quartz", "basalt"), ("\"rig\"", "\"import\"")];
            let (from, to) = edits[dice.below(edits.len())];
            assert!(text.contains(from), "{text}");
            fs::write(&manifest, text.replacen(from, to, 1)).unwrap();
            (format!("manifest with {to}"), false)
        }
        14 => {
            fs::rename(&sub, &away).unwrap();
            symlink(&away, &sub).unwrap();
            (format!("{} a link to a folder", sub.display()), false)
        }
        15 => {
            fs::rename(&sub, &away).unwrap();
            pipe(&sub);
            (format!("{} a pipe", sub.display()), false)
        }
        _ => {
            let lock = folder.join("lock");
            fs::remove_file(&lock).unwrap();
            fs::write(outside.join("precious"), "precious").unwrap();
            if dice.below(2) == 0 {
                pipe(&lock);
            } else {
                symlink(outside.join("precious"), &lock).unwrap();
            }
            ("another lock".into(), false)
        }
    }
}

/// What a daemon gives of a session is what was recorded, or an error.
fn nothing_else_is_shown(daemon: &Daemon, id: &str, recorded: &BTreeMap<String, Vec<u8>>, what: &str) {
    for (file, bytes) in recorded {
        let (status, got) = daemon.get_bytes(&format!("/sessions/{id}/{file}"));
        assert!(status >= 400 || got == *bytes, "{what}: {file} is shown changed ({status})");
        if status >= 400 {
            let text = String::from_utf8(got).unwrap();
            assert!(text.contains("\"error\""), "{what}: {text}");
        }
    }
    let (status, list) = daemon.get("/sessions");
    assert!(status == 200 && list.as_array().unwrap().iter().any(|s| s["name"] == id), "{what}: {list}");
}

#[test]
fn no_damaged_session_is_shown_as_recorded_or_called_whole() {
    let lab = Lab::new(SMALL);
    let (code, _, err) = lab.run(&["capture", "quartz"]);
    assert_eq!(code, Some(0), "{err}");
    let whole = lab.data().join("quartz");
    let recorded: BTreeMap<String, Vec<u8>> = (files(&whole).into_iter())
        .map(|(path, bytes)| (path.strip_prefix(&whole).unwrap().display().to_string(), bytes))
        .filter(|(name, _)| name.contains('/'))
        .collect();
    assert!(recorded.len() > 10);
    let daemon = lab.serve();
    nothing_else_is_shown(&daemon, "quartz", &recorded, "nothing");
    let (status, _) = daemon.get_bytes("/sessions/quartz/products/grain.inp");
    assert_eq!(status, 200);
    let mutations = std::env::var("GRAINRIG_MUTATIONS").map_or(MUTATIONS, |n| n.parse().unwrap());
    let mut dice = Random::new(15);
    for n in 0..mutations {
        let id = format!("m{n}");
        let folder = lab.data().join(&id);
        let outside = tempfile::tempdir().unwrap();
        copy(&whole, &folder);
        let (what, may_be_killed) = damage(n % KINDS, &mut dice, &folder, outside.path());
        let what = format!("mutation {n}, {what}");
        nothing_else_is_shown(&daemon, &id, &recorded, &what);
        let (code, out, err) = lab.run(&["verify", &id]);
        if code == Some(0) {
            assert!(may_be_killed && out.contains("not complete"), "{what}: verify says {out}");
        } else {
            assert!(err.len() > 20 && !err.contains("panicked"), "{what}: {err}");
        }
        let (code, _, err) = lab.run(&["resume", &id]);
        // What lacks only the journal's last line was killed there, as far as anybody can see: that line is written again.
        let all_done = err.contains("nothing is left to do");
        assert!((may_be_killed || !all_done) && !err.contains("panicked"), "{what}: {err}");
        if code == Some(0) {
            // It was gone on with from where its journal ends, or its products were made again, which is said; it is whole now.
            assert!(may_be_killed || err.contains("are made again"), "{what}: resume says {err}");
            assert_eq!(lab.run(&["verify", &id]).0, Some(0), "{what}");
        }
        let precious = outside.path().join("precious");
        assert!(!precious.exists() || fs::read(&precious).unwrap() == b"precious", "{what}: overwritten");
        fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
fn what_is_damaged_is_named_with_what_heals_it() {
    let lab = Lab::new(SMALL);
    assert_eq!(lab.run(&["capture", "quartz"]).0, Some(0));
    let daemon = lab.serve();
    let product = lab.data().join("quartz/products/grain.inp");
    let recorded = fs::read(&product).unwrap();
    let get = || daemon.get("/sessions/quartz/products/grain.inp");
    // The same length, so that only the hash tells; then a link to the recorded bytes themselves.
    let mut changed = recorded.clone();
    changed[100] ^= 1;
    fs::write(&product, &changed).unwrap();
    for links in [false, true] {
        if links {
            fs::rename(&product, lab.data().join("twin")).unwrap();
            symlink(lab.data().join("twin"), &product).unwrap();
        }
        let (status, answer) = get();
        let message = answer["error"]["message"].as_str().unwrap();
        assert_eq!(status, 500);
        assert!(message.contains("grain.inp") && message.contains("grainrig replay quartz"), "{message}");
        // It is made again from the pictures, and that is said.
        let (code, _, err) = lab.run(&["resume", "quartz"]);
        assert_eq!(code, Some(0), "{err}");
        assert!(err.contains("grain.inp") && err.contains("are made again"), "{err}");
        assert!(!product.is_symlink() && fs::read(&product).unwrap() == recorded);
    }
    assert_eq!(daemon.get_bytes("/sessions/quartz/products/grain.inp"), (200, recorded));
    let frame = lab.data().join("quartz/frames/view_001.jpg");
    fs::remove_file(&frame).unwrap();
    let (code, _, err) = lab.run(&["resume", "quartz"]);
    assert!(code == Some(1) && err.contains("frames/view_001.jpg") && err.contains("backup"), "{err}");
}

#[test]
fn pipes_in_place_of_files_take_no_thread_and_do_not_keep_the_daemon_from_its_end() {
    let lab = Lab::new(SMALL);
    assert_eq!(lab.run(&["capture", "quartz"]).0, Some(0));
    for file in ["manifest.json", "journal.jsonl", "lock", "products/grain.inp", "frames/view_000.jpg"] {
        let folder = lab.data().join(file.replace(['/', '.'], "-"));
        copy(&lab.data().join("quartz"), &folder);
        fs::remove_file(folder.join(file)).unwrap();
        pipe(&folder.join(file));
    }
    let mut daemon = lab.serve();
    // More of them than there are threads that may wait.
    for _ in 0..110 {
        for path in ["/sessions/products-grain-inp/products/grain.inp", "/sessions/journal-jsonl"] {
            assert_eq!(daemon.get_bytes(path).0, 500);
        }
        for path in ["/sessions/manifest-json", "/sessions/frames-view_000-jpg/previews/view_000.jpg"] {
            assert_eq!(daemon.get_bytes(path).0, 500);
        }
        assert_eq!(daemon.get("/sessions").1.as_array().unwrap().len(), 6);
    }
    daemon.signal("TERM");
    assert_eq!(daemon.ended().0.code(), Some(0));
}
