//! The camera's settings: looked up, set, read back.

use super::super::message::{Failure, FailureKind};
use gphoto2::Camera;
use gphoto2::widget::{GroupWidget, Widget};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Choices that a message names.
const MOST_CHOICES: usize = 16;
/// How long a value that was set may take to show: a camera's display takes a second or two.
const SHOWS_WITHIN: Duration = Duration::from_secs(3);
/// How long the camera's events are listened to between two looks at a value.
const LOOK: Duration = Duration::from_millis(40);

/// The library's failure, in our kinds. Its numbers are in `gphoto2-result.h` and `gphoto2-port-result.h`.
pub(super) fn failure(doing: &str, error: &gphoto2::Error) -> Failure {
    use gphoto2::error::ErrorKind as E;
    let kind = match error.kind() {
        E::IoUsbClaim | E::IoLock => FailureKind::Claimed,
        E::ModelNotFound | E::IoUsbFind | E::UnknownPort => FailureKind::Absent,
        E::CameraBusy => FailureKind::Busy,
        E::NoMemory | E::NoSpace => FailureKind::Full,
        _ => FailureKind::Transport,
    };
    Failure::new(kind, format!("the camera fails to {doing}: {error}"))
}

fn setting(cause: String) -> Failure {
    Failure::new(FailureKind::Setting, cause)
}

/// The names of everything that can be set or read.
///
/// Asking the library for a name that the camera lacks is a segmentation fault, so the tree is walked once, and only
/// names that stand in it are asked for later. One that goes away afterwards (the mode dial was turned) costs this
/// process; the next one does not find it in the tree and says so.
pub(super) fn names(camera: &Camera) -> Result<BTreeSet<String>, Failure> {
    fn walk(group: &GroupWidget, into: &mut BTreeSet<String>) {
        for child in group.children_iter() {
            match child {
                Widget::Group(group) => walk(&group, into),
                other => drop(into.insert(other.name())),
            }
        }
    }
    let mut names = BTreeSet::new();
    walk(&camera.config().wait().map_err(|e| failure("list its settings", &e))?, &mut names);
    Ok(names)
}

/// A setting, read afresh.
pub(super) fn fresh(camera: &Camera, name: &str) -> Result<Widget, Failure> {
    camera.config_key::<Widget>(name).wait().map_err(|e| failure(&format!("tell {name}"), &e))
}

/// The choices of a setting; none where it has a free value.
pub(super) fn choices(widget: &Widget) -> Vec<String> {
    match widget {
        Widget::Radio(radio) => radio.choices_iter().collect(),
        _ => Vec::new(),
    }
}

/// The value of a setting, as the library's own program prints it.
pub(super) fn value(widget: &Widget) -> String {
    match widget {
        // A choice without choices has no value, and asking for it can crash.
        Widget::Radio(radio) if radio.choices_iter().next().is_none() => String::new(),
        Widget::Radio(radio) => radio.choice(),
        Widget::Text(text) => text.value(),
        Widget::Range(range) => range.value().to_string(),
        Widget::Toggle(toggle) => toggle.toggled().map_or_else(|| "2".into(), |on| u8::from(on).to_string()),
        Widget::Date(date) => date.timestamp().to_string(),
        Widget::Button(_) | Widget::Group(_) => String::new(),
    }
}

/// Changes a setting; it may take a while to show.
fn put(camera: &Camera, widget: &Widget, wanted: &str) -> Result<(), Failure> {
    let name = widget.name();
    let bad = |what: &str| setting(format!("the camera's {name} can't be {wanted:?}: it is {what}"));
    match widget {
        Widget::Radio(radio) => {
            let choices = choices(widget);
            if !choices.iter().any(|c| c == wanted) {
                let some =
                    choices.iter().take(MOST_CHOICES).map(String::as_str).collect::<Vec<_>>().join(", ");
                return Err(bad(&format!("one of {} choices: {some}", choices.len())));
            }
            radio.set_choice(wanted)
        }
        Widget::Text(text) => text.set_value(wanted),
        Widget::Range(range) => {
            let number: f32 = wanted.parse().map_err(|_| bad("a number"))?;
            range.set_value(number);
            Ok(())
        }
        Widget::Toggle(toggle) => {
            toggle.set_toggled(match wanted {
                "0" => false,
                "1" => true,
                _ => return Err(bad("0 or 1")),
            });
            Ok(())
        }
        _ => return Err(bad("no value")),
    }
    .and_then(|()| camera.set_config(widget).wait())
    .map_err(|e| failure(&format!("set {name} to {wanted:?}"), &e))
}

/// Sets a value and waits until it shows. What it was before, where that is something else.
pub(super) fn assert(camera: &Camera, name: &str, wanted: &str) -> Result<Option<String>, Failure> {
    let widget = fresh(camera, name)?;
    let before = value(&widget);
    if before == wanted {
        return Ok(None);
    }
    if widget.readonly() {
        return Err(setting(format!(
            "the camera's {name} is {before:?}, {wanted:?} is needed; it is read-only"
        )));
    }
    put(camera, &widget, wanted)?;
    let end = Instant::now() + SHOWS_WITHIN;
    loop {
        // The library learns of changes only from events.
        drain(camera, LOOK)?;
        let now = value(&fresh(camera, name)?);
        if now == wanted {
            return Ok(Some(before));
        }
        if Instant::now() > end {
            let limit = SHOWS_WITHIN.as_secs_f64();
            return Err(setting(format!(
                "the camera's {name} stays {now:?} for {limit} s, {wanted:?} was set"
            )));
        }
    }
}

/// Takes events until none comes for `quiet`; the files that were among them.
pub(super) fn drain(camera: &Camera, quiet: Duration) -> Result<Vec<(String, String)>, Failure> {
    use gphoto2::camera::CameraEvent as Event;
    let mut files = Vec::new();
    // A camera that never stops is stopped by the deadline of the whole.
    loop {
        match camera.wait_event(quiet).wait().map_err(|e| failure("tell its events", &e))? {
            Event::Timeout => return Ok(files),
            Event::NewFile(path) => files.push((path.folder().into_owned(), path.name().into_owned())),
            _ => {}
        }
    }
}
