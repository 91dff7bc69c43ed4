//! Questions and answers: each request has a number, is asked again until its own answer has come, and is obeyed once.

use super::frame::{Reader, Said, request};
use crate::rig::serial::Port;
use std::time::{Duration, Instant};

/// Why a request was not answered.
#[derive(Debug, thiserror::Error)]
pub(super) enum LinkError {
    /// The device has gone.
    #[error("the line broke: {0}")]
    Gone(#[from] std::io::Error),
    /// Nothing came, or nothing whole.
    #[error("no whole answer to {tries} requests, {ms} ms each")]
    Silent { tries: u32, ms: u64 },
    /// The controller has started anew in the meantime.
    #[error("the controller has started anew")]
    Restarted,
}

/// The line to a controller.
pub(super) struct Link {
    /// None once it has been hung up.
    port: Option<Port>,
    reader: Reader,
    seq: u8,
    reply: Duration,
    tries: u32,
}

impl Link {
    pub fn new(port: Port, reply_ms: u64, tries: u32) -> Self {
        let reply = Duration::from_millis(reply_ms);
        Self { port: Some(port), reader: Reader::default(), seq: 0, reply, tries }
    }

    /// Lets go of a device that has gone. While anybody has it open the kernel keeps its name, and what is plugged in again
    /// gets the next one.
    pub fn hang_up(&mut self) {
        self.port = None;
    }

    fn port(&mut self) -> Result<&mut Port, std::io::Error> {
        self.port.as_mut().ok_or_else(|| std::io::ErrorKind::NotConnected.into())
    }

    /// Waits for the controller to say that it has started; whether it did.
    pub fn started(&mut self, within: Duration) -> Result<bool, LinkError> {
        let deadline = Instant::now() + within;
        while let Some(byte) = self.port()?.byte(deadline)? {
            if let Some(Said::Announcement(text)) = self.reader.take(byte)
                && text != "nak"
            {
                tracing::trace!(text, "heard");
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The controller's answer to a request: asked again, under the same number, until it has come. The controller obeys
    /// a number once and answers it as often as it is asked.
    pub fn ask(&mut self, body: &str) -> Result<String, LinkError> {
        self.seq = self.seq.wrapping_add(1);
        let bytes = request(self.seq, body);
        for _ in 0..self.tries {
            tracing::trace!(seq = self.seq, body, "sent");
            self.port()?.send(&bytes)?;
            if let Some(answer) = self.answer()? {
                return Ok(answer);
            }
        }
        Err(LinkError::Silent { tries: self.tries, ms: self.reply.as_millis() as u64 })
    }

    /// The answer to the last request; `None` where it is to be asked again.
    fn answer(&mut self) -> Result<Option<String>, LinkError> {
        let deadline = Instant::now() + self.reply;
        while let Some(byte) = self.port()?.byte(deadline)? {
            let said = self.reader.take(byte);
            if let Some(said) = &said {
                tracing::trace!(?said, "heard");
            }
            match said {
                Some(Said::Reply { seq, body }) if seq == self.seq => return Ok(Some(body)),
                // A late answer to an earlier one.
                Some(Said::Reply { .. }) | None => {}
                Some(Said::Announcement(text)) if text != "nak" => return Err(LinkError::Restarted),
                // Damaged on either way: no need to wait any longer.
                Some(Said::Announcement(_) | Said::Damaged) => return Ok(None),
            }
        }
        Ok(None)
    }
}
