//! What is installed beside the program: udev's rules, the service, the shipped configurations.

#[path = "support/kit/mod.rs"]
mod kit;
#[path = "support/skip.rs"]
mod skip;

use grainrig::config::Config;
use kit::Lab;
use skip::{Lacking, skip};
use std::path::{Path, PathBuf};
use std::process::Command;

fn shipped(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// What a program says, and whether it ended well; `None` where it is not there.
fn said(program: &str, arguments: &[&str]) -> Option<(bool, String)> {
    let done = Command::new(program).args(arguments).output();
    let Ok(done) = done else {
        skip(Lacking::System, format_args!("{program} is not there"));
        return None;
    };
    let text = [done.stdout, done.stderr].concat();
    Some((done.status.success(), String::from_utf8_lossy(&text).into_owned()))
}

#[test]
fn the_service_is_sound_and_shut_in() {
    let lab = Lab::new();
    let unit = String::from_utf8(kit::read(&shipped("config/grainrig.service"))).unwrap();
    // Where the program lies on this computer.
    let unit = unit.replace("/usr/local/bin/grainrig", env!("CARGO_BIN_EXE_grainrig"));
    lab.write("grainrig.service", unit);
    let path = lab.path("grainrig.service");
    let path = path.to_str().unwrap();
    // It ends well in spite of keys that it does not know, and says so.
    let Some((_, told)) = said("systemd-analyze", &["verify", path]) else { return };
    let about_it: Vec<&str> = told.lines().filter(|l| l.contains("grainrig")).collect();
    assert!(about_it.is_empty(), "{about_it:?}");
    let Some((good, told)) = said("systemd-analyze", &["security", "--offline=true", "--threshold=40", path])
    else {
        return;
    };
    assert!(good, "{told}");
}

/// One match or assignment of a rule: key, operator, value in quotes.
fn term(text: &str) -> Option<(&str, &str, &str)> {
    let operators = ["==", "!=", "+=", ":=", "="];
    let (at, operator) =
        operators.iter().filter_map(|o| text.find(o).map(|at| (at, *o))).min_by_key(|(at, _)| *at)?;
    let value = text[at + operator.len()..].strip_prefix('"')?.strip_suffix('"')?;
    Some((&text[..at], operator, value))
}

#[test]
fn udevs_rules_have_known_keys_only() {
    let path = shipped("udev/60-grainrig.rules");
    let text = String::from_utf8(kit::read(&path)).unwrap();
    let matches = ["SUBSYSTEM", "ATTRS{idVendor}", "ENV{DEVTYPE}", "ENV{ID_USB_INTERFACES}"];
    let sets = ["GROUP", "MODE", "ENV{ID_MM_DEVICE_IGNORE}"];
    let rules: Vec<&str> = text.lines().filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
    assert_eq!(rules.len(), 3);
    for rule in rules {
        let mut group = None;
        for part in rule.split(", ") {
            let (key, operator, value) = term(part).unwrap_or_else(|| panic!("{part} in {rule}"));
            let known = if operator == "==" {
                matches.contains(&key)
            } else {
                operator == "=" && sets.contains(&key)
            };
            assert!(known && !value.is_empty(), "{part} in {rule}");
            if key == "GROUP" {
                group = Some(value);
            }
        }
        assert_eq!(group, Some("grainrig"), "{rule}");
    }
    // From version 254 on udev can read rules without doing what they say.
    let version: u32 = said("udevadm", &["--version"]).and_then(|(_, v)| v.trim().parse().ok()).unwrap_or(0);
    if version < 254 {
        return skip(Lacking::System, format_args!("udevadm {version} has no `verify`"));
    }
    let (good, told) = said("udevadm", &["verify", path.to_str().unwrap()]).unwrap();
    assert!(good, "{told}");
}

#[test]
fn every_shipped_configuration_is_read_whole() {
    let mut seen = 0;
    for entry in std::fs::read_dir(shipped("config")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let mut config = Config::read(&path).unwrap_or_else(|e| panic!("{e}"));
            // Each rig's own: what is not filled in is said before anything moves.
            config.controller.port = "/dev/ttyACM0".into();
            config.check().unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            seen += 1;
        }
    }
    assert!(seen >= 2, "{seen}");
}

#[test]
fn the_doctor_and_the_list_of_devices_know_the_simulated_rig() {
    let lab = Lab::new();
    let told = lab.run(&["--config", "small.toml", "doctor"]).succeeds().stdout;
    for part in [
        "disk         good",
        "stage        good",
        "camera       good",
        "movement     good",
        "test shot    good",
    ] {
        assert!(told.contains(part), "{part:?} is missing from {told}");
    }
    let list = lab.run(&["--config", "small.toml", "devices"]).succeeds().stdout;
    assert!(list.contains("* stage   simulated") && list.contains("* camera  simulated"), "{list}");
    lab.write("absent.toml", "[rig]\nkind = \"hardware\"\n[controller]\nport = \"/dev/serial/by-id/none\"\n");
    let ran = lab.run(&["--config", "absent.toml", "doctor"]).fails(1, &["would fail on"]);
    assert!(
        ran.stdout.contains("it is not there") && ran.stdout.contains("→ plug the controller in"),
        "{}",
        ran.stdout
    );
}

/// Comes into the camera's process before its first instruction and ends it, or lets it hang.
const DYING_CAMERA: &str = r#"
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
__attribute__((constructor)) static void die(void) {
    char told[4096] = {0};
    FILE *from = fopen("/proc/self/cmdline", "r");
    size_t n = from ? fread(told, 1, sizeof told - 1, from) : 0;
    if (from) fclose(from);
    for (size_t i = 0; i < n; i++) if (!told[i]) told[i] = ' ';
    if (!strstr(told, "camera-worker")) return;
    const char *how = getenv("GRAINRIG_DYING");
    if (!strcmp(how, "exit")) {
        fputs("library failed; buy another camera; then go home\n", stderr);
        _exit(3);
    }
    if (!strcmp(how, "late")) {
        pid_t camera = getpid();
        if (fork()) _exit(3);
        close(1);
        while (getppid() == camera) usleep(1000);
        fputs("said when the process was gone\n", stderr);
        _exit(0);
    }
    if (!strcmp(how, "chatter")) {
        puts("hello; world");
        _exit(0);
    }
    if (!strcmp(how, "hang")) for (;;) pause();
    raise(atoi(how));
}
"#;

#[test]
fn the_doctors_remedy_is_one_however_the_cameras_process_dies() {
    let lab = Lab::new();
    let source = lab.write("dying.c", DYING_CAMERA);
    let library = lab.path("dying.so");
    let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).output();
    let Ok(compiled) = compiled else { return skip(Lacking::Tools, "no C compiler `cc`; install gcc") };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let rig = "[rig]\nkind = \"hardware\"\nstage = \"simulated\"\ncamera = \"gphoto2\"\n[gphoto2]\nretry_s = [0.0]\n";
    lab.write("rig.toml", rig);
    lab.write("brief.toml", format!("{rig}start_s = 0.2\n"));
    for (how, config, found) in [
        ("exit", "rig.toml", "exit status: 3; it said: library failed; buy another camera; then go home"),
        ("late", "rig.toml", "exit status: 3; it said: said when the process was gone"),
        ("chatter", "rig.toml", "the camera's process failed"),
        ("11", "rig.toml", "signal: 11"),
        ("9", "rig.toml", "signal: 9"),
        ("hang", "brief.toml", "within 0.2 s: its process was killed"),
    ] {
        let mut command = lab.command(&["--json", "--config", config, "doctor"]);
        let done = command.env("LD_PRELOAD", &library).env("GRAINRIG_DYING", how).output().unwrap();
        assert_eq!(done.status.code(), Some(1), "{how}");
        let findings: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        let rig = findings["findings"].as_array().unwrap().iter().find(|f| f["check"] == "rig").unwrap();
        let [told, remedy] = ["found", "remedy"].map(|key| rig[key].as_str().unwrap_or_default());
        assert!(told.contains(found) && told.contains("(2 tries)"), "{how}: {told}");
        assert!(remedy.starts_with("check the cable and the battery"), "{how}: {remedy}");
    }
}
