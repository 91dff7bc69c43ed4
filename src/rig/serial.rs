//! A serial port that is ours alone.

use super::RigError;
use super::holder::holder;
use rustix::fs::Access;
use serialport::TTYPort;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// How long a read waits for bytes before it looks at the clock again.
const SLICE: Duration = Duration::from_millis(20);

/// An open serial port. Whoever else opens it while it is held is refused.
pub struct Port {
    line: TTYPort,
    waiting: VecDeque<u8>,
}

impl Port {
    /// Opens a port: 8 data bits, no parity, one stop bit. On most boards that resets the controller.
    ///
    /// # Errors
    /// [`RigError::Device`] where the port is not there, not permitted, or held: by whom is named.
    pub fn open(path: &Path, baud: u32) -> Result<Self, RigError> {
        let refused = |why: &str, remedy: &str| {
            RigError::fault(format!("cannot open {}: {why}", path.display()), remedy)
        };
        if !path.exists() {
            return Err(refused(
                "it is not there",
                "plug the controller in; `ls /dev/serial/by-id` shows its name",
            ));
        }
        if rustix::fs::access(path, Access::READ_OK | Access::WRITE_OK).is_err() {
            return Err(refused(
                "permission denied",
                "add yourself to the group that owns it (`ls -l` shows it, usually dialout) and log \
                 in again, or install udev/60-grainrig.rules",
            ));
        }
        // The crate asks the kernel for exclusive use, and locks it against those whom the kernel lets through (root).
        let line =
            serialport::new(path.to_string_lossy(), baud).timeout(SLICE).open_native().map_err(|e| {
                let remedy = "check that it is a serial port, and the cable";
                holder(path).map_or_else(
                    || refused(&e.to_string(), remedy),
                    |who| refused(&e.to_string(), &format!("{who} has it open: end it first")),
                )
            })?;
        Ok(Self { line, waiting: VecDeque::new() })
    }

    /// The next byte; `None` where none came before the deadline.
    ///
    /// # Errors
    /// Where the device has gone.
    pub fn byte(&mut self, deadline: Instant) -> Result<Option<u8>, std::io::Error> {
        loop {
            if let Some(byte) = self.waiting.pop_front() {
                return Ok(Some(byte));
            }
            let mut some = [0; 256];
            match self.line.read(&mut some) {
                // A line that is there has bytes or times out.
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(n) => self.waiting.extend(&some[..n]),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                    if Instant::now() >= deadline {
                        return Ok(None);
                    }
                }
                Err(e) => return Err(e),
            }
        }
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// Where the device has gone.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), std::io::Error> {
        self.line.write_all(bytes)
    }
}
