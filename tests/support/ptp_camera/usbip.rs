//! The cable: USB/IP, by which Linux plugs in a device that is elsewhere (its documentation: `usbip_protocol`). Whatever ends
//! the connection pulls the plug.

use super::body::Body;
use super::usb::{Device, PRODUCT, RELEASE, VENDOR};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read as _, Result, Write as _};
use std::net::TcpStream;
use std::sync::Mutex;

const VERSION: u16 = 0x0111;
const IMPORT: u16 = 0x8003;
const IMPORTED: u16 = 0x0003;
const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;
/// Error numbers of Linux: the device refused; the request was taken back.
const STALL: i32 = -32;
const TAKEN_BACK: i32 = -104;
/// High speed, as Linux counts speeds.
const HIGH_SPEED: u32 = 3;
/// Where the bulk data to the computer go; 3 is for events, of which an EOS has none that are not polled.
const BULK_IN: u32 = 1;
/// Most bytes that the computer may send at once.
const LONGEST: u32 = 1 << 20;

/// A request for bytes that is not answered yet.
struct Waiting {
    number: u32,
    endpoint: u32,
    most: usize,
}

/// A device that is imported, until the connection ends.
pub fn connection(mut stream: TcpStream, body: &Mutex<Body>) -> Result<()> {
    stream.set_nodelay(true)?;
    let mut head = [0; 8];
    stream.read_exact(&mut head)?;
    let mut bus = [0; 32];
    stream.read_exact(&mut bus)?;
    if [head[2], head[3]] != IMPORT.to_be_bytes() {
        return Err(ErrorKind::InvalidData.into());
    }
    stream.write_all(&imported(&bus))?;
    body.lock().unwrap().sessions += 1;
    let mut device = Device::default();
    let mut waiting: VecDeque<Waiting> = VecDeque::new();
    loop {
        let mut bytes = [0; 48];
        stream.read_exact(&mut bytes)?;
        let word = |at: usize| u32::from_be_bytes([0, 1, 2, 3].map(|k| bytes[4 * at + k]));
        let (command, number, inwards, endpoint, length) = (word(0), word(1), word(3) == 1, word(4), word(6));
        match command {
            UNLINK => {
                let unwanted = word(5);
                let before = waiting.len();
                waiting.retain(|w| w.number != unwanted);
                let status = if waiting.len() < before { TAKEN_BACK } else { 0 };
                stream.write_all(&packet(UNLINKED, number, status, 0, &[]))?;
            }
            SUBMIT if length > LONGEST => return Err(ErrorKind::InvalidData.into()),
            SUBMIT => {
                let mut sent = vec![0; if inwards { 0 } else { length as usize }];
                stream.read_exact(&mut sent)?;
                if endpoint == 0 {
                    let setup = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| bytes[40 + k]);
                    let answer = device.control(setup);
                    let status = if answer.is_some() { 0 } else { STALL };
                    let data = answer.unwrap_or_default();
                    let actual = if inwards { data.len() } else { sent.len() };
                    stream.write_all(&packet(SUBMITTED, number, status, actual, &data))?;
                } else if inwards {
                    waiting.push_back(Waiting { number, endpoint, most: length as usize });
                } else {
                    stream.write_all(&packet(SUBMITTED, number, 0, sent.len(), &[]))?;
                    device.take(&sent, body);
                }
            }
            _ => return Err(ErrorKind::InvalidData.into()),
        }
        while let Some(first) = waiting.iter().position(|w| w.endpoint == BULK_IN)
            && let Some(data) = device.give(waiting[first].most)
        {
            let number = waiting[first].number;
            waiting.remove(first);
            stream.write_all(&packet(SUBMITTED, number, 0, data.len(), &data))?;
        }
        if device.is_pulled() {
            return Ok(());
        }
    }
}

/// The answer to an import: the device, on the bus that was asked for.
fn imported(bus: &[u8; 32]) -> Vec<u8> {
    let mut answer = [&VERSION.to_be_bytes()[..], &IMPORTED.to_be_bytes(), &[0; 4]].concat();
    // Where it lies in the exporting computer's sysfs.
    answer.extend([0; 256]);
    answer.extend(bus);
    // Bus and device number, which together name it from now on.
    answer.extend([1, 2, HIGH_SPEED].iter().flat_map(|n: &u32| n.to_be_bytes()));
    answer.extend([VENDOR, PRODUCT, RELEASE].iter().flat_map(|n| n.to_be_bytes()));
    // Class, subclass and protocol (the interface has them), configuration, configurations, interfaces.
    answer.extend([0, 0, 0, 1, 1, 1]);
    answer
}

fn packet(kind: u32, number: u32, status: i32, actual: usize, data: &[u8]) -> Vec<u8> {
    let words = [kind, number, 0, 0, 0, status as u32, actual as u32, 0, 0, 0, 0, 0];
    words.iter().flat_map(|w| w.to_be_bytes()).chain(data.iter().copied()).collect()
}
