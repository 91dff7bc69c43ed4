//! What is done about a failure: tried again how often, after how long, and what a person is told to do.

use super::message::FailureKind;
use super::settings::{Settings, seconds};
use std::time::Duration;

/// Most that the time to the next try grows to, over the first.
const MOST_DOUBLINGS: u32 = 4;

/// Waits before the tries that follow a first failure of this kind. A connection that broke is back in seconds or not at
/// all; a program that holds the camera lets go of it in minutes; a full card does not empty itself.
pub(super) fn waits(kind: FailureKind, settings: &Settings) -> Vec<Duration> {
    use FailureKind as K;
    let all = |s: &[f64]| s.iter().copied().map(seconds).collect();
    match kind {
        K::Claimed => all(&settings.claimed_retry_s),
        K::Absent | K::Transport | K::Busy | K::NoPicture | K::BadPicture => all(&settings.retry_s),
        // The controller has been asked often enough by then.
        K::Full | K::Setting | K::Release | K::Unsupported => Vec::new(),
    }
}

/// Whether the connection is no good any more, so that the next try begins with a new child.
pub(super) fn needs_new_child(kind: FailureKind) -> bool {
    use FailureKind as K;
    !matches!(kind, K::BadPicture | K::Full | K::Setting | K::Release)
}

/// What to do, where trying again did not help.
pub(super) fn remedy(kind: FailureKind) -> &'static str {
    use FailureKind as K;
    match kind {
        K::Claimed => {
            "end the program that holds the camera; on a desktop `gio mount -s gphoto2` makes it let go, and \
             `systemctl --user stop gvfs-gphoto2-volume-monitor` keeps it so"
        }
        K::Absent => {
            "switch the camera on, check the cable and gphoto2.model, port and serial, and set auto power off to `disable` \
             in the camera's menu (it can't be set over the cable)"
        }
        K::Transport => {
            "check the cable and the battery, set auto power off to `disable` in the camera's menu; where it stays so, \
             switch the camera off and on"
        }
        K::Busy => "end live view, playback or a menu on the camera; where it stays so, switch it off and on",
        K::NoPicture => {
            "set the lens to manual focus, the camera to single shot without self-timer and mirror lock-up; where the \
             controller releases it (rig.release), check that cable and make controller.focus_ms and shutter_ms longer"
        }
        K::Release => {
            "mend the stage's controller, which releases the camera, or set rig.release = \"camera\""
        }
        K::BadPicture => "set the picture quality to JPEG, or RAW + JPEG; check the card",
        K::Full => "delete pictures from the card or put an empty one in, or set gphoto2.target = \"ram\"",
        K::Setting => "set the camera as stated, or change [gphoto2.set] and [gphoto2.require]",
        K::Unsupported => {
            "use a program that was built with `--features gphoto2`, and a camera that it drives"
        }
    }
}

/// After how long a camera that failed so often in a row is tried again.
pub(super) fn suspension(settings: &Settings, failures: u32) -> Duration {
    seconds(settings.suspend_s) * 2u32.pow(failures.saturating_sub(1).min(MOST_DOUBLINGS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_camera_is_waited_for_and_a_broken_connection_is_not() {
        let settings = Settings::default();
        assert_eq!(waits(FailureKind::Claimed, &settings), [5, 15, 30].map(Duration::from_secs));
        assert_eq!(waits(FailureKind::Transport, &settings), [500, 1500].map(Duration::from_millis));
        assert!(waits(FailureKind::Full, &settings).is_empty());
    }

    #[test]
    fn the_time_to_the_next_try_doubles_up_to_sixteen_times() {
        let settings = Settings { suspend_s: 60.0, ..Settings::default() };
        let minutes = |n| suspension(&settings, n).as_secs() / 60;
        assert_eq!([1, 2, 3, 4, 5, 6, 99].map(minutes), [1, 2, 4, 8, 16, 16, 16]);
    }
}
