//! What a Canon EOS does its own way: properties of its own, a release in two steps, changes that are polled.

use super::answer::{Answer, code};
use super::body::{Body, STORE};
use super::wire::{Bytes, u32_at};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Canon's properties.
const APERTURE: u32 = 0xd101;
const SHUTTER_SPEED: u32 = 0xd102;
const ISO: u32 = 0xd103;
const EXPOSURE_MODE: u32 = 0xd105;
const FOCUS_MODE: u32 = 0xd108;
const BATTERY: u32 = 0xd111;
const AVAILABLE_SHOTS: u32 = 0xd11b;
const DESTINATION: u32 = 0xd11c;
const VIEWFINDER_OUTPUT: u32 = 0xd1b0;
const FOCUS_INFO: u32 = 0xd1d3;

/// Pictures are held in the camera's RAM until the computer has them.
const TO_COMPUTER: u32 = 4;
/// The mirror is up and the picture goes to the computer: no still until that ends.
const TO_COMPUTER_SCREEN: u32 = 2;
/// ISO 100 and 800.
const ISO_100: u32 = 0x48;
const ISO_800: u32 = 0x60;
/// The shutter's half press and full press.
pub const FULL_PRESS: u32 = 2;
/// Canon's changes.
const OBJECT_ADDED: u32 = 0xc181;
const OBJECT_TRANSFER: u32 = 0xc186;
const PROPERTY_CHANGED: u32 = 0xc189;
const CHOICES_CHANGED: u32 = 0xc18a;
const STATUS_CHANGED: u32 = 0xc18b;

/// Live view has no picture yet.
const NOT_READY: u16 = 0xa102;
/// So often live view has none at its beginning.
const DARK: usize = 2;

/// How long a value that was set takes to show.
const SHOWS_AFTER: Duration = Duration::from_millis(80);

struct Property {
    value: u32,
    choices: &'static [u32],
}

struct Change {
    due: Instant,
    kind: u32,
    body: Bytes,
    /// The property whose value is told, as it is when the computer asks.
    property: Option<u32>,
}

/// Canon's part of the body.
pub struct Eos {
    properties: BTreeMap<u32, Property>,
    changes: Vec<Change>,
    /// Pictures of live view asked for since it began.
    shown: usize,
}

impl Eos {
    /// A camera that somebody has left in live view, or not.
    pub fn new(live_view: bool) -> Self {
        let property = |value, choices| Property { value, choices };
        let properties = [
            (APERTURE, property(0x30, &[0x28, 0x30, 0x38][..])),
            (SHUTTER_SPEED, property(0x60, &[0x0c, 0x60, 0x68, 0x70])),
            (ISO, property(ISO_100, &[ISO_100, 0x50, 0x58, ISO_800])),
            (EXPOSURE_MODE, property(3, &[3])),
            (FOCUS_MODE, property(3, &[])),
            (BATTERY, property(2, &[])),
            (AVAILABLE_SHOTS, property(999, &[])),
            (DESTINATION, property(2, &[2, TO_COMPUTER])),
            (VIEWFINDER_OUTPUT, property(if live_view { TO_COMPUTER_SCREEN } else { 0 }, &[0, 1, 2])),
        ];
        Self { properties: properties.into(), changes: Vec::new(), shown: 0 }
    }

    pub const OPERATIONS: &'static [u16] = &[
        0x9101, 0x9102, 0x9108, 0x9110, 0x9114, 0x9115, 0x9116, 0x9117, 0x911a, 0x911b, 0x911c, 0x911d,
        0x9125, 0x9126, 0x9127, 0x9128, 0x9129, 0x913d, 0x9151, 0x9152, 0x9153,
    ];

    pub fn iso(&self) -> String {
        // One stop is 8, and 0x48 stands for 100.
        let stops = (self.properties[&ISO].value - ISO_100) / 8;
        (100 << stops).to_string()
    }

    pub fn drift(&mut self) {
        self.set(ISO, ISO_800, Duration::ZERO);
    }

    fn change(&mut self, due: Instant, kind: u32, body: Bytes) {
        self.changes.push(Change { due, kind, body, property: None });
    }

    fn show(&mut self, property: u32, after: Duration) {
        let due = Instant::now() + after;
        let body = Bytes::new().u32(property);
        self.changes.push(Change { due, kind: PROPERTY_CHANGED, body, property: Some(property) });
    }

    fn set(&mut self, property: u32, value: u32, shows_after: Duration) {
        self.properties.entry(property).and_modify(|p| p.value = value);
        self.show(property, shows_after);
    }

    /// Everything that is due, and the end mark.
    fn poll(&mut self) -> Bytes {
        let now = Instant::now();
        let due: Vec<Change> = self.changes.extract_if(.., |c| c.due <= now).collect();
        let one = |b: Bytes, c: &Change| {
            let value = c.property.map_or(Bytes::new(), |p| Bytes::new().u32(self.properties[&p].value));
            let body = [&c.body.0[..], &value.0].concat();
            b.u32(body.len() as u32 + 8).u32(c.kind).raw(&body)
        };
        due.iter().fold(Bytes::new(), one).u32(8).u32(0)
    }

    /// All properties with their choices, as after the computer has taken over.
    fn dump(&mut self) {
        let all: Vec<u32> = self.properties.keys().copied().collect();
        for property in all {
            self.show(property, Duration::ZERO);
            let choices = self.properties[&property].choices;
            if !choices.is_empty() {
                let body = Bytes::new().u32(property).u32(3).array32(choices);
                self.change(Instant::now(), CHOICES_CHANGED, body);
            }
        }
    }

    pub fn answer(body: &mut Body, operation: u16, parameters: &[u32], data: &[u8]) -> Answer {
        let first = parameters.first().copied().unwrap_or(0);
        match operation {
            0x9108 => {
                let known: Vec<u32> = body.eos().properties.keys().copied().collect();
                let lists = [OBJECT_ADDED, OBJECT_TRANSFER, PROPERTY_CHANGED];
                let lists = Bytes::new().array32(&lists).array32(&known).array32(&[0]);
                Answer::data(Bytes::new().u32(lists.0.len() as u32 + 4).raw(&lists.0))
            }
            0x9110 => body.eos().set_value(data),
            0x9115 => {
                body.eos().dump();
                Answer::ok()
            }
            0x9116 => Answer::data(body.eos().poll()),
            0x9117 => {
                body.objects.remove(&first);
                Answer::ok()
            }
            0x9127 if !body.eos().properties.contains_key(&first) => Answer::code(code::GENERAL_ERROR),
            0x9128 => Self::press(body, first),
            0x9152 => {
                body.eos().shown = 0;
                body.eos().set(VIEWFINDER_OUTPUT, 0, SHOWS_AFTER);
                Answer::ok()
            }
            0x9153 => Self::present(body),
            known if Self::OPERATIONS.contains(&known) => Answer::ok(),
            _ => Answer::code(code::NOT_SUPPORTED),
        }
    }

    /// Whether the mirror is up.
    pub fn live_view(&self) -> bool {
        self.properties[&VIEWFINDER_OUTPUT].value != 0
    }

    /// A picture of live view: blocks of a length, a kind (1 is the JPEG) and what they hold.
    fn present(body: &mut Body) -> Answer {
        if body.eos().properties[&VIEWFINDER_OUTPUT].value & TO_COMPUTER_SCREEN == 0 {
            return Answer::code(code::BUSY);
        }
        body.eos().shown += 1;
        if body.eos().shown <= DARK {
            return Answer::code(NOT_READY);
        }
        let picture = body.look();
        let zoom = Bytes::new().u32(12).u32(4).u32(1);
        Answer::data(zoom.u32(picture.len() as u32 + 8).u32(1).raw(&picture))
    }

    fn set_value(&mut self, data: &[u8]) -> Answer {
        let [property, value] = [4, 8].map(|at| u32_at(data, at));
        match self.properties.get(&property) {
            None => Answer::code(code::NO_SUCH_PROPERTY),
            Some(p) if !p.choices.is_empty() && !p.choices.contains(&value) => Answer::code(code::BAD_VALUE),
            Some(_) => {
                self.set(property, value, SHOWS_AFTER);
                Answer::ok()
            }
        }
    }

    /// The release's button: half-way it says that it is in focus, all the way down it takes a picture.
    pub fn press(body: &mut Body, button: u32) -> Answer {
        let focus = Bytes::new().u32(FOCUS_INFO).raw(b"type=0,select={1},focus={1},size={0,0}\0\0");
        body.eos().change(Instant::now(), PROPERTY_CHANGED, focus);
        if button & FULL_PRESS == 0 {
            return Answer::ok();
        }
        if body.eos().properties[&VIEWFINDER_OUTPUT].value != 0 {
            return Answer::code(code::BUSY);
        }
        let taken = match body.release() {
            Ok(taken) => taken,
            Err(answer) => return answer,
        };
        let to_computer = body.eos().properties[&DESTINATION].value == TO_COMPUTER;
        body.eos().change(Instant::now(), STATUS_CHANGED, Bytes::new().u32(1));
        for (i, (handle, due)) in taken.files.iter().enumerate() {
            let object = &body.objects[handle];
            let (format, size) = (object.format, object.claims as u32);
            let head = Bytes::new().u32(*handle);
            let (kind, change) = if to_computer {
                (OBJECT_TRANSFER, head.u16(format).u16(0).all32(&[0, size, 0]))
            } else {
                let head = head.u32(STORE).u16(format).u16(0);
                (OBJECT_ADDED, head.all32(&[0, 0, size, object.parent, 0]))
            };
            let change = change.name(&object.name);
            body.eos().change(*due, kind, change);
            if i == 0 {
                body.eos().change(taken.complete, STATUS_CHANGED, Bytes::new().u32(0));
            }
        }
        Answer::ok()
    }
}
