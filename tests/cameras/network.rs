//! The real libgphoto2 in the real child process, before a camera on the network.

use crate::bench::{Bench, SCENES};
use crate::conformance::conforms;
use crate::kit::pictures;
use crate::ptp_camera::{Personality, PtpCamera, Setup, speaks_ptpip};
use grainrig::rig::RigError;
use grainrig::rig::gphoto::{GphotoCamera, Launch, Settings, Target};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A camera on the network, what it looks at, and how it is opened.
pub struct Network {
    pub body: PtpCamera,
    pub settings: Settings,
    scene: Arc<AtomicUsize>,
}

impl Network {
    pub fn new(setup: Setup, target: Target) -> Self {
        // What the driver logs is shown where a test fails.
        let _ = tracing_subscriber::fmt().with_test_writer().try_init();
        let scene = Arc::new(AtomicUsize::new(0));
        // Taken before anybody waits for one.
        pictures();
        let looks_at = Arc::clone(&scene);
        let personality = setup.personality;
        let body = PtpCamera::start(setup, move |_| pictures()[looks_at.load(Ordering::SeqCst)].clone());
        let iso = BTreeMap::from([("iso".to_owned(), "100".to_owned())]);
        let require = match personality {
            Personality::Generic => BTreeMap::new(),
            Personality::Eos => [("autoexposuremode", "Manual"), ("focusmode", "Manual")]
                .map(|(name, value)| (name.to_owned(), value.to_owned()))
                .into(),
        };
        let settings = Settings {
            model: body.model().into(),
            port: body.address(),
            target,
            set: iso,
            require,
            shot_s: 6.0,
            busy_s: 1.0,
            quiet_s: 0.2,
            retry_s: vec![0.02, 0.05],
            suspend_s: 0.5,
            ..Settings::default()
        };
        Self { body, settings, scene }
    }

    /// Opens it; the real program is the camera's process.
    pub fn open(&self) -> Result<GphotoCamera, RigError> {
        GphotoCamera::open(&self.settings, Launch { program: env!("CARGO_BIN_EXE_grainrig").into() })
    }

    pub fn look_at(&self, scene: usize) {
        self.scene.store(scene % SCENES, Ordering::SeqCst);
    }
}

/// Every way in which a picture comes over.
pub const WAYS: [(Personality, Target); 3] =
    [(Personality::Generic, Target::Card), (Personality::Eos, Target::Card), (Personality::Eos, Target::Ram)];

#[test]
fn a_camera_on_the_network_conforms() {
    if !speaks_ptpip() {
        return;
    }
    for (personality, target) in WAYS {
        for raw in [false, true] {
            let network = Network::new(Setup { raw, ..Setup::new(personality) }, target);
            let camera = Box::new(network.open().unwrap());
            let scene = Arc::clone(&network.scene);
            let set = Box::new(move |n| scene.store(n, Ordering::SeqCst));
            conforms(&format!("{personality:?} {target:?} raw {raw}"), Bench { camera, set });
            drop(network);
        }
    }
}
