//! The camera as a device on the USB: its descriptors, and PTP in containers over two bulk endpoints (PIMA 15740, annex D).

use super::Served;
use super::answer::{Answer, Reply};
use super::body::Body;
use super::wire::{Bytes, u16_at, u32_at};
use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::SystemTime;

/// An EOS 60D.
pub const VENDOR: u16 = 0x04a9;
pub const PRODUCT: u16 = 0x3215;
pub const RELEASE: u16 = 0x0100;

/// The class of still-image cameras, and the one protocol that it has: bulk only.
const STILL_IMAGE: [u8; 3] = [6, 1, 1];
/// The endpoint on which events come, with its direction; the bulk endpoints are 1 (in) and 2 (out).
const EVENTS: u8 = 0x83;
/// Bytes of a bulk packet at high speed: a transfer ends with a shorter one.
const PACKET: usize = 512;

/// Kinds of container.
const COMMAND: u16 = 1;
const DATA: u16 = 2;
const RESPONSE: u16 = 3;
const HEAD: usize = 12;
/// Operations that the computer sends data with: a value that is set, PTP's way and Canon's.
const WITH_DATA: [u16; 2] = [0x1016, 0x9110];

/// What one half of a control transfer comes to; `None` where the device refuses it (a stall).
pub type Control = Option<Vec<u8>>;

/// The device.
#[derive(Default)]
pub struct Device {
    /// What the computer has sent of a container that is not whole yet.
    received: Vec<u8>,
    /// A command whose data are still to come.
    command: Option<Vec<u8>>,
    /// Transfers to the computer, and whether an empty packet must still end the first.
    outgoing: VecDeque<Vec<u8>>,
    unended: bool,
    /// Bytes after which the plug is pulled.
    left: Option<usize>,
    pulled: bool,
}

impl Device {
    /// A control transfer: its eight bytes of set-up.
    pub fn control(&mut self, setup: [u8; 8]) -> Control {
        let [kind, request, number, of, ..] = setup;
        let mut answer = match (kind, request) {
            (0x80, 6) => descriptor(of, number)?,
            // Status, configuration.
            (0x80..=0x82, 0) => vec![0, 0],
            (0x80, 8) => vec![1],
            // A feature, the configuration, the interface: there is one of each.
            (0..=2, 1 | 3 | 9 | 11) => Vec::new(),
            // The class's own: how it is, start anew, cancel.
            (0xa1, 0x67) => Bytes::new().u16(4).u16(0x2001).0,
            (0x21, 0x64 | 0x66) => {
                *self = Self::default();
                Vec::new()
            }
            _ => return None,
        };
        answer.truncate(u16_at(&setup, 6).into());
        Some(answer)
    }

    /// Bytes from the computer; what they ask for is done.
    pub fn take(&mut self, bytes: &[u8], body: &Mutex<Body>) {
        self.received.extend(bytes);
        loop {
            let length = u32_at(&self.received, 0) as usize;
            if length < HEAD || self.received.len() < length {
                return;
            }
            let container: Vec<u8> = self.received.drain(..length).collect();
            let operation = u16_at(&container, 6);
            match u16_at(&container, 4) {
                COMMAND if WITH_DATA.contains(&operation) => self.command = Some(container),
                COMMAND => self.perform(&container, &[], body),
                DATA => {
                    if let Some(command) = self.command.take() {
                        self.perform(&command, &container[HEAD..], body);
                    }
                }
                _ => {}
            }
        }
    }

    /// Whether the plug has been pulled.
    pub fn is_pulled(&self) -> bool {
        self.pulled
    }

    fn perform(&mut self, command: &[u8], data: &[u8], body: &Mutex<Body>) {
        let (operation, transaction) = (u16_at(command, 6), u32_at(command, 8));
        let parameters: Vec<u32> = (HEAD..command.len()).step_by(4).map(|at| u32_at(command, at)).collect();
        let began = SystemTime::now();
        let mut body = body.lock().unwrap();
        match body.answer(operation, &parameters, data) {
            Answer::Reply(reply) => {
                self.reply(operation, transaction, &reply);
                body.served.push(Served { operation, began, ended: SystemTime::now() });
            }
            Answer::Torn(reply) => {
                self.left = Some(reply.data.as_ref().map_or(0, Vec::len) / 2);
                self.reply(operation, transaction, &reply);
            }
            Answer::Silence => {}
            Answer::HangUp => self.pulled = true,
        }
    }

    fn reply(&mut self, operation: u16, transaction: u32, reply: &Reply) {
        let container = |kind: u16, code: u16, holds: &[u8]| {
            let length = (HEAD + holds.len()) as u32;
            Bytes::new().u32(length).u16(kind).u16(code).u32(transaction).raw(holds).0
        };
        if let Some(data) = &reply.data {
            self.outgoing.push_back(container(DATA, operation, data));
        }
        let parameters = Bytes::new().all32(&reply.parameters);
        self.outgoing.push_back(container(RESPONSE, reply.code, &parameters.0));
    }

    /// What fills a request of the computer for so many bytes; `None` where there is nothing to send.
    pub fn give(&mut self, most: usize) -> Option<Vec<u8>> {
        if std::mem::take(&mut self.unended) {
            return Some(Vec::new());
        }
        let transfer = self.outgoing.front_mut()?;
        if let Some(left) = &mut self.left {
            let Some(after) = left.checked_sub(most.min(transfer.len())) else {
                self.pulled = true;
                return None;
            };
            *left = after;
        }
        let rest = transfer.split_off(most.min(transfer.len()));
        let part = std::mem::replace(transfer, rest);
        if transfer.is_empty() {
            self.outgoing.pop_front();
            // The computer can't know that this was all.
            self.unended = part.len() == most && part.len().is_multiple_of(PACKET);
        }
        Some(part)
    }
}

/// A descriptor by its kind and number (USB 2.0, 9.6).
fn descriptor(kind: u8, index: u8) -> Control {
    let texts = ["Canon Inc.", "Canon Digital Camera", "0123456789ab"];
    match (kind, index) {
        (1, 0) => {
            let head = Bytes::new().raw(&[18, 1]).u16(0x200).raw(&[0, 0, 0, 64]);
            Some(head.u16(VENDOR).u16(PRODUCT).u16(RELEASE).raw(&[1, 2, 3, 1]).0)
        }
        (2, 0) => {
            let [class, sub, protocol] = STILL_IMAGE;
            let endpoint =
                |b: Bytes, address, kind, packet, every| b.raw(&[7, 5, address, kind]).u16(packet).u8(every);
            let interface = Bytes::new().raw(&[9, 4, 0, 0, 3, class, sub, protocol, 0]);
            let interface = endpoint(interface, 0x81, 2, PACKET as u16, 0);
            let interface = endpoint(interface, 0x02, 2, PACKET as u16, 0);
            let interface = endpoint(interface, EVENTS, 3, 64, 8);
            let total = 9 + interface.0.len() as u16;
            Some(Bytes::new().raw(&[9, 2]).u16(total).raw(&[1, 1, 0, 0xc0, 1]).raw(&interface.0).0)
        }
        // The languages: American English.
        (3, 0) => Some(vec![4, 3, 9, 4]),
        (3, number) => {
            let text = texts.get(usize::from(number) - 1)?;
            let letters = text.encode_utf16().fold(Bytes::new(), Bytes::u16).0;
            Some([&[letters.len() as u8 + 2, 3], &letters[..]].concat())
        }
        _ => None,
    }
}
