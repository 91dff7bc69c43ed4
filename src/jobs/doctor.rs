//! Whether the rig is fit for a run: each thing that has been seen to go wrong, looked at before a grain is glued on.

use super::devices::{Rig, open};
use crate::acquire::PlanSettings;
use crate::config::{Config, RigKind};
use crate::rig::discovery::{Found, Role};
pub use crate::rig::driver::{Finding, Health};
use crate::rig::{Camera, RigError, RotationStage};
use crate::session::picture::probe;
use crate::session::{free_bytes, required_bytes};
use grainrig_core::geometry::Angle;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where udev looks for rules.
const RULES: [&str; 3] = ["/etc/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d"];
const RULE: &str = "60-grainrig.rules";
/// USB 2's high speed, megabits a second.
const HIGH_SPEED: f64 = 480.0;

/// Looks at everything that a run needs; the stage makes one step and comes back, the camera takes one picture, which is not
/// kept. `told` hears of each finding as it is made.
pub fn doctor(config: &Config, data: &Path, told: &mut dyn FnMut(&Finding)) -> Vec<Finding> {
    let mut all = Vec::new();
    let mut say = |finding: Finding| {
        told(&finding);
        all.push(finding);
    };
    say(disk(config, data));
    if config.rig.kind == RigKind::Hardware {
        hardware(config, &mut say);
    }
    match open(config) {
        Err(e) => {
            say(Finding::bad("rig", &e));
            for check in ["movement", "test shot"] {
                say(Finding {
                    check,
                    health: Health::Skipped,
                    found: "the rig does not open".into(),
                    remedy: None,
                });
            }
        }
        Ok(Rig { mut stage, mut camera, .. }) => {
            say(Finding::good("stage", stage.describe()));
            say(Finding::good("camera", camera.describe()));
            say(movement(&mut *stage, &config.plan));
            say(shot(&mut *camera));
        }
    }
    all
}

fn disk(config: &Config, data: &Path) -> Finding {
    let check = "disk";
    let needed = required_bytes(config.plan.views as usize + 1, config.camera().view_bytes());
    let there = data.ancestors().find(|p| p.exists()).unwrap_or(Path::new("."));
    let writable = rustix::fs::access(there, rustix::fs::Access::WRITE_OK).is_ok();
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    match free_bytes(data) {
        Err(e) => Finding {
            check,
            health: Health::Bad,
            found: format!("{}: {e}", data.display()),
            remedy: Some("give --data a folder that can be written".into()),
        },
        Ok(_) if !writable => Finding {
            check,
            health: Health::Bad,
            found: format!("{} cannot be written", there.display()),
            remedy: Some("give --data a folder that can be written, or change its owner".into()),
        },
        Ok(free) => {
            let found = format!("{:.1} GiB free for a run of {:.1} GiB", gib(free), gib(needed));
            let fits = free >= needed;
            Finding {
                check,
                health: if fits { Health::Good } else { Health::Bad },
                found,
                remedy: (!fits)
                    .then(|| "delete old sessions, or give --data a folder on another disk".into()),
            }
        }
    }
}

/// What is known of devices without opening them.
fn hardware(config: &Config, say: &mut dyn FnMut(Finding)) {
    let (stage, camera, root) = (config.stage(), config.camera(), Path::new("/"));
    // What can't be set up is told once the rig is opened; what is computed needs no permission.
    let stages = stage.found(root).unwrap_or_default().into_iter().filter(|f| stage.means(f));
    let cameras = camera.found(root).unwrap_or_default().into_iter().filter(|f| camera.means(f));
    let used: Vec<(Found, PathBuf)> =
        stages.chain(cameras).filter_map(|f| f.path.clone().map(|path| (f, path))).collect();
    let rules = RULES.iter().any(|folder| Path::new(folder).join(RULE).exists());
    say(if let Some((one, path)) = used.iter().find(|(f, _)| !f.permitted) {
        let remedy = if rules {
            "log out and in again, so that your groups count; plug the device out and in".to_owned()
        } else {
            format!(
                "sudo cp udev/{RULE} /etc/udev/rules.d/ && sudo udevadm control --reload; plug the device out and in"
            )
        };
        let found = format!("this account may not open {} ({})", path.display(), one.name);
        Finding { check: "permissions", health: Health::Bad, found, remedy: Some(remedy) }
    } else {
        let rules = if rules { "rules are installed" } else { "no rules are installed, none are missing" };
        Finding::good("permissions", format!("{} devices may be opened; {rules}", used.len()))
    });
    for (one, path) in &used {
        if let Some(by) = &one.held_by {
            let remedy = Some("end that program, then look again".to_owned());
            let found = format!("{} is held by {by}", path.display());
            say(Finding { check: "holder", health: Health::Bad, found, remedy });
        }
        if let Some(speed) = one.usb_mbit_per_s.filter(|s| one.role == Role::Camera && *s < HIGH_SPEED) {
            let remedy =
                Some("plug it into a port of the computer itself, with a USB 2 or USB 3 cable".to_owned());
            let found = format!("{} has {speed} Mbit/s", one.name);
            say(Finding { check: "USB", health: Health::Doubtful, found, remedy });
        }
    }
    stage.findings().into_iter().chain(camera.findings()).for_each(say);
}

fn movement(stage: &mut dyn RotationStage, plan: &PlanSettings) -> Finding {
    let began = Instant::now();
    let mut there_and_back = || -> Result<f64, RigError> {
        stage.home()?;
        let reached = stage.move_to(Angle::from_deg(plan.step_deg))?;
        stage.move_to(Angle::default())?;
        Ok(reached.deg())
    };
    match there_and_back() {
        Err(e) => Finding::bad("movement", &e),
        Ok(reached) if (reached - plan.step_deg).abs() > plan.tolerance_deg => Finding {
            check: "movement",
            health: Health::Bad,
            found: format!("a step of {}° ended at {reached:.3}°", plan.step_deg),
            remedy: Some("compare steps_per_turn and microsteps with motor, gear and driver".into()),
        },
        Ok(reached) => {
            let s = began.elapsed().as_secs_f64();
            Finding::good(
                "movement",
                format!("homed, a step to {reached:.3}° and back in {s:.1} s: did the stage turn?"),
            )
        }
    }
}

fn shot(camera: &mut dyn Camera) -> Finding {
    let began = Instant::now();
    let frame = match camera.capture() {
        Err(e) => return Finding::bad("test shot", &e),
        Ok(frame) => frame,
    };
    let s = began.elapsed().as_secs_f64();
    match probe(&frame.bytes, None) {
        Ok((encoding, [width, height])) => {
            let mb = frame.bytes.len() as f64 / 1e6;
            Finding::good(
                "test shot",
                format!("{width} × {height} px, {mb:.1} MB of {encoding:?} in {s:.1} s"),
            )
        }
        Err(fault) => Finding {
            check: "test shot",
            health: Health::Bad,
            found: fault.to_string(),
            remedy: Some("take another; then another cable, another port, another card".into()),
        },
    }
}
