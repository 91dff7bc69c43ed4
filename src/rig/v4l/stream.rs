//! Frames as they come, the stale ones dropped.

use crate::rig::Frame;
use rustix::time::{ClockId, clock_gettime};
use std::io;
use std::time::Duration;
use v4l::buffer::{Flags, Type};
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream as _;

/// Buffers between the kernel and us.
const BUFFERS: u32 = 4;

/// A stream of frames.
pub(super) struct Frames {
    stream: Stream<'static>,
    /// Number of the frame before.
    before: Option<u32>,
    /// Frames to drop whose time is on no clock of ours.
    undated: u32,
    asked: Duration,
}

/// The clock by which the kernel dates frames.
pub(super) fn now() -> Duration {
    let t = clock_gettime(ClockId::Monotonic);
    Duration::new(t.tv_sec.unsigned_abs(), t.tv_nsec.unsigned_abs() as u32)
}

impl Frames {
    /// Begins a stream in which no frame may be later than `patience`.
    pub(super) fn begin(device: &v4l::Device, patience: Duration) -> io::Result<Self> {
        let mut stream = Stream::with_buffers(device, Type::VideoCapture, BUFFERS)?;
        stream.set_timeout(patience);
        // The first call begins it; `start` before it would leave the kernel without buffers.
        stream.next()?;
        Ok(Self { stream, before: None, undated: 0, asked: Duration::ZERO })
    }

    /// The next frame, as `read` makes it a picture; `None` where it was begun before `after` or is damaged.
    ///
    /// # Errors
    /// The system's; after one the stream is not to be used any more.
    pub(super) fn next(
        &mut self,
        after: Duration,
        interval: Duration,
        read: impl FnOnce(&[u8]) -> Result<Frame, String>,
    ) -> io::Result<Option<Result<Frame, String>>> {
        if self.asked != after {
            // Whatever waits in the buffers is old, and one frame may be under way.
            (self.asked, self.undated) = (after, BUFFERS + 1);
        }
        let (bytes, meta) = self.stream.next()?;
        let lost = self.before.map_or(0, |before| meta.sequence.wrapping_sub(before).saturating_sub(1));
        if lost > 0 && lost < u32::MAX / 2 {
            tracing::debug!("{lost} frame(s) were lost before frame {}", meta.sequence);
        }
        self.before = Some(meta.sequence);
        if meta.flags.contains(Flags::ERROR) {
            return Ok(None);
        }
        if meta.flags.contains(Flags::TIMESTAMP_MONOTONIC) {
            let begins = meta.flags.contains(Flags::TSTAMP_SRC_SOE);
            let seconds = u64::try_from(meta.timestamp.sec).unwrap_or(0);
            let time = Duration::new(seconds, 0) + Duration::from_micros(meta.timestamp.usec.unsigned_abs());
            if time <= if begins { after } else { after + interval } {
                return Ok(None);
            }
        } else if self.undated > 0 {
            self.undated -= 1;
            return Ok(None);
        }
        let used = (meta.bytesused as usize).min(bytes.len());
        Ok(Some(read(&bytes[..used])))
    }
}
