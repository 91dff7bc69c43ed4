//! The grain on the board's motor, before a lens; and what the simulated rig makes of it.

// Each test file uses its own part of this.
#![allow(dead_code)]

use crate::board::Board;
use crate::kit::Lab;
use grainrig::config::Config;
use grainrig::rig::simulated::{self, SimulatedCamera, SimulatedStage};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig::session::sha256_hex;
use grainrig_core::geometry::Angle;
use serde_json::Value;
use std::sync::{Arc, Mutex};

/// Pictures of a webcam's size, in which a pixel is as large as in a DSLR's: the grain is 210 px across. The motor's steps
/// have their errors, and the views their shifts.
pub const SETTINGS: &str = "\
[plan]
settle_ms = 0
[report]
pictures = false
[optics]
mm_per_px = 0.0043
[mesh]
surface_size_mm = 0.05
[simulated]
width = 640
height = 480
mm_per_px = 0.0043
microsteps = 8
";

/// Views of the plan, the closing one among them.
pub const VIEWS: usize = 26;
/// Microsteps of one turn, and from one view to the next.
const TURN: f64 = 3200.0;
pub const VIEW: i64 = 64;

/// How the real program reaches the board, which turns fast. On a busy computer the chip is slow to answer.
pub fn controller(board: &Board) -> String {
    format!(
        "[controller]\nport = \"{}\"\nboot_ms = 0\nspeed_deg_per_s = 400\nacceleration_deg_per_s2 = 9000\n\
         reply_ms = 2000\ntries = 20\n",
        board.port.display()
    )
}

/// The grain. Its motor is where the board's pins have brought it, its own step errors included.
pub struct Grain {
    board: Arc<Mutex<Board>>,
    motor: SimulatedStage,
    camera: SimulatedCamera,
    exposed: Exposed,
}

/// Where the pins were at each exposure, microsteps, and the picture's hash.
pub type Exposed = Arc<Mutex<Vec<(i64, String)>>>;

impl Grain {
    /// `change` is what differs from the simulated rig's camera.
    pub fn new(lab: &Lab, board: &Arc<Mutex<Board>>, change: impl FnOnce(&mut simulated::Settings)) -> Self {
        let file = lab.write("grain.toml", SETTINGS);
        let mut settings = Config::read(file.as_ref()).unwrap().simulated;
        change(&mut settings);
        let (motor, camera, _) = simulated::open(&settings).unwrap();
        Self { board: Arc::clone(board), motor, camera, exposed: Arc::default() }
    }

    /// Where the pins were at each exposure so far, for whoever asks later.
    pub fn exposed(&self) -> Exposed {
        Arc::clone(&self.exposed)
    }

    /// What a lens before the grain sees now.
    pub fn photograph(&mut self) -> Vec<u8> {
        let position = self.board.lock().unwrap().position();
        self.motor.move_to(Angle::from_deg(position as f64 * 360.0 / TURN)).unwrap();
        let picture = self.camera.capture().unwrap().bytes;
        self.exposed.lock().unwrap().push((position, sha256_hex(&picture)));
        picture
    }
}

/// The result of the simulated rig, captured under this name.
pub fn simulated(lab: &Lab, name: &str) -> Value {
    let config = lab.write("simulated.toml", SETTINGS);
    lab.run(&["--json", "--config", &config, "capture", name]).succeeds().json()
}

/// A figure of a result.
pub fn figure(result: &Value, pointer: &str) -> f64 {
    result.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} is no number"))
}
