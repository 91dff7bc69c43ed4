//! What `--version` says.

use crate::config::Config;
use crate::rig::driver::Driver;
use std::sync::LazyLock;

/// The version, with the drivers of cameras that were built in.
pub(super) static SHORT: LazyLock<String> = LazyLock::new(|| {
    let config = Config::default();
    // Those that a build may be without.
    let built = config.cameras().filter(|(_, driver)| driver.built_in() == Some(true)).map(|(name, _)| name);
    let about = match &built.collect::<Vec<_>>()[..] {
        [] => "built without drivers of cameras".to_owned(),
        cameras => format!("cameras: {}", cameras.join(", ")),
    };
    format!("{} ({about})", env!("CARGO_PKG_VERSION"))
});

/// The version, and all that tells one build from another: a line each, with what it is before it.
pub(super) static LONG: LazyLock<String> = LazyLock::new(|| {
    fn named<'a>(drivers: impl Iterator<Item = (&'static str, &'a (impl Driver + ?Sized + 'a))>) -> String {
        let built = drivers.filter(|(_, driver)| driver.built_in() != Some(false)).map(|(name, _)| name);
        built.collect::<Vec<_>>().join(", ")
    }
    let config = Config::default();
    let commit = option_env!("GRAINRIG_COMMIT").unwrap_or("not known (no release build in a clone)");
    let features = [("gphoto2", cfg!(feature = "gphoto2")), ("v4l", cfg!(feature = "v4l"))];
    let features: Vec<&str> = features.iter().filter(|(_, is_on)| *is_on).map(|(name, _)| *name).collect();
    format!(
        "{}\ncommit     {commit}\nfeatures   {}\nstages     {}\ncameras    {}\nbuilt for  {} {}, {}",
        env!("CARGO_PKG_VERSION"),
        if features.is_empty() { "none".into() } else { features.join(", ") },
        named(config.stages()),
        named(config.cameras()),
        std::env::consts::OS,
        std::env::consts::ARCH,
        if cfg!(debug_assertions) { "for development" } else { "optimised" },
    )
});
