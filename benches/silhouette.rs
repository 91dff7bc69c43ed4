//! Photograph → silhouette. Run: `cargo bench --bench silhouette` (a few seconds).
//!
//! Pictures of the simulated rig at three sizes. The yardstick is one decoding of the same JPEG to pixels, on one
//! thread: 18 megapixels took libjpeg-turbo 40 ms on the machine where `OpenCV` needed 79 ms more for Otsu's
//! threshold and the largest component, which is twice the yardstick.

mod common;

use common::{median_s, rig, tell};
use grainrig::pipeline::decode;
use grainrig::rig::{Camera as _, RotationStage as _, simulated::open};
use grainrig::silhouette::{Settings, assess, find};

fn main() {
    for (width, height) in [(1296, 864), (2592, 1728), (5184, 3456)] {
        let (mut stage, mut camera, _) = open(&rig(width, height)).expect("the built-in grain");
        stage.home().expect("the simulated stage");
        let bytes = camera.capture().expect("the simulated camera").bytes;
        let picture = decode(&bytes).expect("a JPEG");
        let decoding = median_s(|| decode(&bytes));
        let settings = Settings::default();
        let finding = median_s(|| find(&picture, None, &settings));
        let size = format!("{width} × {height} px");
        let rate = |s: f64| format!("{:.0} Mpx/s", (width * height) as f64 / s * 1e-6);
        let yardstick = ("one JPEG decode", decoding);
        tell("decode", &size, decoding, &rate(decoding), yardstick);
        tell("silhouette", &size, finding, &rate(finding), yardstick);
        let found = find(&picture, None, &settings).expect("a grain");
        let judging = median_s(|| assess(&picture, &found));
        tell("view quality", &size, judging, &rate(judging), ("one silhouette", finding));
    }
}
