//! What `--version` says.

use std::sync::LazyLock;

/// The version, with the drivers of cameras that were built in.
pub(super) const SHORT: &str = match (cfg!(feature = "gphoto2"), cfg!(feature = "v4l")) {
    (true, true) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: gphoto2, v4l2)"),
    (true, false) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: gphoto2)"),
    (false, true) => concat!(env!("CARGO_PKG_VERSION"), " (cameras: v4l2)"),
    (false, false) => concat!(env!("CARGO_PKG_VERSION"), " (built without drivers of cameras)"),
};

/// The version, and all that tells one build from another: a line each, with what it is before it.
pub(super) static LONG: LazyLock<String> = LazyLock::new(|| {
    let named = |all: &[(&str, bool)]| -> String {
        let built: Vec<&str> = all.iter().filter(|(_, built)| *built).map(|(name, _)| *name).collect();
        if built.is_empty() { "none".into() } else { built.join(", ") }
    };
    let (gphoto2, v4l) = (cfg!(feature = "gphoto2"), cfg!(feature = "v4l"));
    let commit = option_env!("GRAINRIG_COMMIT").unwrap_or("not known (no release build in a clone)");
    format!(
        "{}\ncommit     {commit}\nfeatures   {}\nstages     controller, grbl, simulated\ncameras    {}\nbuilt for  {} {}, {}",
        env!("CARGO_PKG_VERSION"),
        named(&[("gphoto2", gphoto2), ("v4l", v4l)]),
        named(&[("gphoto2", gphoto2), ("v4l2", v4l), ("simulated", true)]),
        std::env::consts::OS,
        std::env::consts::ARCH,
        if cfg!(debug_assertions) { "for development" } else { "optimised" },
    )
});
