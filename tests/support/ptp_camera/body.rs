//! The camera's body: what it holds, how its shutter works, and the operations that every PTP camera has.

use super::answer::{Answer, Reply, code};
use super::eos::{self, Eos};
use super::wire::{Bytes, u16_at, u32_at};
use super::{Fault, Personality, Pictures, Served, Setup};
use std::collections::BTreeMap;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant, SystemTime};

/// Events (clause 12.5).
const OBJECT_ADDED: u16 = 0x4002;
const PROPERTY_CHANGED: u16 = 0x4006;
const CAPTURE_COMPLETE: u16 = 0x400d;

/// The one store.
pub const STORE: u32 = 0x0001_0001;
/// The folder that pictures go to.
pub const FOLDER: u32 = 2;
/// Kinds of object: a folder, a JPEG with EXIF, Canon's RAW.
const ASSOCIATION: u16 = 0x3001;
const JPEG: u16 = 0x3801;
const RAW: u16 = 0xb103;

/// From the release to the first file, and from there to the second.
const SHUTTER: Duration = Duration::from_millis(20);
const SECOND_FILE: Duration = Duration::from_millis(60);

/// Sensitivity as the standard has it.
const EXPOSURE_INDEX: u16 = 0x500f;

/// Operations of every personality.
const OPERATIONS: [u16; 15] = [
    0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1006, 0x1007, 0x1008, 0x1009, 0x100a, 0x100b, 0x1014, 0x1015,
    0x1016, 0x101b,
];
const INITIATE_CAPTURE: u16 = 0x100e;
const GET_OBJECT: u16 = 0x1009;
const GET_PART: u16 = 0x101b;

/// A file or a folder.
pub struct Object {
    pub name: String,
    pub format: u16,
    pub parent: u32,
    pub data: Vec<u8>,
    /// What it says it has, where it lies.
    pub claims: usize,
}

impl Object {
    fn folder(name: &str, parent: u32) -> Self {
        Self { name: name.into(), format: ASSOCIATION, parent, data: Vec::new(), claims: 0 }
    }
    fn info(&self) -> Bytes {
        let is_folder = u16::from(self.format == ASSOCIATION);
        Bytes::new()
            .u32(STORE)
            .u16(self.format)
            .u16(0)
            .u32(self.claims as u32)
            .u16(0)
            .all32(&[0; 6])
            .u32(self.parent)
            .u16(is_folder)
            .all32(&[0, 0])
            .string(&self.name)
            .string("20260101T120000")
            .string("20260101T120000")
            .string("")
    }
}

/// A picture that was taken: each of its files, and when it is there.
pub struct Taken {
    pub files: Vec<(u32, Instant)>,
    /// When the camera is done with the first.
    pub complete: Instant,
}

/// A standard property of 16 or 32 bits with its choices.
struct Property {
    wide: bool,
    value: u32,
    choices: &'static [u32],
}

pub struct Body {
    setup: Setup,
    take: Box<Pictures>,
    show: Option<Box<Pictures>>,
    shown: usize,
    pub off: bool,
    pub releases: usize,
    pub sessions: usize,
    pub served: Vec<Served>,
    pub exposed: Vec<SystemTime>,
    pub objects: BTreeMap<u32, Object>,
    next: u32,
    refusals: usize,
    /// The connection ends while the next picture is fetched, and so many others are refused then.
    tears: Option<usize>,
    /// The last release found no room.
    full: bool,
    properties: BTreeMap<u16, Property>,
    listener: Option<Sender<(Instant, Bytes)>>,
    listeners: usize,
    eos: Eos,
}

impl Body {
    pub fn new(setup: Setup, take: Box<Pictures>) -> Self {
        let objects = [(1, Object::folder("DCIM", 0)), (FOLDER, Object::folder("100SIMCA", 1))].into();
        let properties = [
            (0x5007, Property { wide: false, value: 800, choices: &[400, 560, 800, 1100] }),
            (0x500d, Property { wide: true, value: 80, choices: &[10, 40, 80, 1250, 10_000] }),
            (EXPOSURE_INDEX, Property { wide: false, value: 100, choices: &[100, 200, 400, 800] }),
        ];
        let eos = Eos::new(setup.live_view);
        Self {
            setup,
            take,
            show: None,
            shown: 0,
            off: false,
            releases: 0,
            sessions: 0,
            served: Vec::new(),
            exposed: Vec::new(),
            objects,
            next: 0x10,
            refusals: 0,
            tears: None,
            full: false,
            properties: properties.into(),
            listener: None,
            listeners: 0,
            eos,
        }
    }

    pub fn personality(&self) -> Personality {
        self.setup.personality
    }

    pub fn pictures(&self) -> Vec<String> {
        self.objects.values().filter(|o| o.format != ASSOCIATION).map(|o| o.name.clone()).collect()
    }

    pub fn iso(&self) -> String {
        match self.setup.personality {
            Personality::Generic => self.properties[&EXPOSURE_INDEX].value.to_string(),
            Personality::Eos => self.eos.iso(),
        }
    }

    /// Whether a new connection is refused; counts it.
    pub fn refuses(&mut self) -> bool {
        let refused = self.refusals > 0;
        self.refusals = self.refusals.saturating_sub(1);
        refused
    }

    pub fn mend(&mut self) {
        self.setup.faults.clear();
        (self.refusals, self.tears, self.full) = (0, None, false);
    }

    /// Takes over the events; the number of this listener.
    pub fn listen(&mut self, listener: Sender<(Instant, Bytes)>) -> usize {
        self.listener = Some(listener);
        self.listeners += 1;
        self.listeners
    }
    pub fn listening(&self) -> usize {
        self.listeners
    }

    fn event(&self, due: Instant, event: u16, parameter: u32) {
        if let Some(listener) = &self.listener {
            // Whoever hung up hears no more.
            let _ = listener.send((due, Bytes::new().u16(event).u32(0).u32(parameter)));
        }
    }

    fn spoils(&self, number: usize, is_it: impl Fn(&Fault) -> bool) -> Option<Fault> {
        let planned = |p: &&super::Planned| (p.at..p.at + p.count).contains(&number) && is_it(&p.fault);
        self.setup.faults.iter().find(planned).map(|p| p.fault)
    }

    /// The shutter is released.
    ///
    /// # Errors
    /// What the camera answers where there is no picture.
    pub fn release(&mut self) -> Result<Taken, Answer> {
        let number = self.releases;
        self.releases += 1;
        let first = |f: &Fault| {
            matches!(f, Fault::Busy | Fault::FullCard | Fault::Stall | Fault::NoEvent | Fault::Die { .. })
        };
        match self.spoils(number, first) {
            Some(Fault::Busy) => return Err(Answer::code(code::BUSY)),
            Some(Fault::FullCard) => return Err(self.no_room()),
            Some(Fault::Stall) => return Err(Answer::Silence),
            Some(Fault::NoEvent) => return Err(Answer::ok()),
            Some(Fault::Die { refusals }) => {
                self.refusals = refusals;
                self.listener = None;
                return Err(Answer::HangUp);
            }
            _ => {}
        }
        if self.pictures().len() >= self.setup.capacity {
            return Err(self.no_room());
        }
        let slow = match self.spoils(number, |f| matches!(f, Fault::Slow(_))) {
            Some(Fault::Slow(by)) => by,
            _ => Duration::ZERO,
        };
        if let Some(Fault::Torn { refusals }) = self.spoils(number, |f| matches!(f, Fault::Torn { .. })) {
            self.tears = Some(refusals);
        }
        let complete = Instant::now() + SHUTTER + slow;
        let jpeg = self.spoils(number, |f| *f == Fault::RawWithoutJpeg).is_none();
        let mut files = Vec::new();
        if self.setup.raw || !jpeg {
            let data = [b"II*\0\x10\0\0\0CR\x02\0".as_slice(), &number.to_le_bytes(), &[7; 4096]].concat();
            files.push((self.add(number, "CR2", RAW, data), complete));
        }
        if jpeg {
            let data = (self.take)(number);
            let handle = self.add(number, "JPG", JPEG, data);
            if self.spoils(number, |f| *f == Fault::Truncated).is_some()
                && let Some(object) = self.objects.get_mut(&handle)
            {
                object.data.truncate(object.claims / 2);
            }
            // The second file comes when the camera has already said that it is done.
            let due = if files.is_empty() { complete } else { complete + SECOND_FILE };
            files.push((handle, due));
        }
        if self.spoils(number, |f| *f == Fault::Drift).is_some() {
            self.properties.entry(EXPOSURE_INDEX).and_modify(|p| p.value = 800);
            self.event(Instant::now(), PROPERTY_CHANGED, EXPOSURE_INDEX.into());
            self.eos.drift();
        }
        let last = files.last().map_or(complete, |(_, due)| *due);
        self.exposed.push(SystemTime::now() + last.saturating_duration_since(Instant::now()));
        Ok(Taken { files, complete })
    }

    fn no_room(&mut self) -> Answer {
        self.full = true;
        Answer::code(code::STORE_FULL)
    }

    fn add(&mut self, number: usize, ending: &str, format: u16, data: Vec<u8>) -> u32 {
        let handle = self.next;
        self.next += 1;
        let name = format!("IMG_{number:04}.{ending}");
        let claims = data.len();
        self.objects.insert(handle, Object { name, format, parent: FOLDER, data, claims });
        handle
    }

    pub fn answer(&mut self, operation: u16, parameters: &[u32], data: &[u8]) -> Answer {
        let answer = self.obeyed(operation, parameters, data);
        let Answer::Reply(reply) = answer else { return answer };
        if matches!(operation, GET_OBJECT | GET_PART)
            && let Some(refusals) = self.tears.take()
        {
            (self.refusals, self.listener) = (refusals, None);
            return Answer::Torn(reply);
        }
        Answer::Reply(reply)
    }

    fn obeyed(&mut self, operation: u16, parameters: &[u32], data: &[u8]) -> Answer {
        let first = parameters.first().copied().unwrap_or(0);
        let is_eos = self.setup.personality == Personality::Eos;
        let object = self.objects.get(&first);
        match operation {
            0x1001 => Answer::data(self.device_info()),
            0x1002 | 0x1003 => Answer::ok(),
            0x1004 | 0x9101 => Answer::data(Bytes::new().array32(&[STORE])),
            0x1005 | 0x9102 => {
                let free = if self.full { 0 } else { 31 << 30 };
                let kinds = Bytes::new().u16(3).u16(2).u16(0).u64(32 << 30).u64(free);
                Answer::data(kinds.u32(if self.full { 0 } else { 9999 }).string("SD").string("SIMCARD"))
            }
            0x1006 => Answer::value(self.handles(parameters).len() as u32),
            0x1007 => Answer::data(Bytes::new().array32(&self.handles(parameters))),
            0x1008 => object.map_or(Answer::code(code::NO_SUCH_OBJECT), |o| Answer::data(o.info())),
            GET_OBJECT => {
                object.map_or(Answer::code(code::NO_SUCH_OBJECT), |o| Answer::data(Bytes(o.data.clone())))
            }
            0x100a => Answer::code(code::NO_THUMBNAIL),
            0x100b => {
                self.full = false;
                Answer::code(self.objects.remove(&first).map_or(code::NO_SUCH_OBJECT, |_| code::OK))
            }
            GET_PART => object.map_or(Answer::code(code::NO_SUCH_OBJECT), |o| {
                let [from, most] = [1, 2].map(|i| parameters.get(i).copied().unwrap_or(0) as usize);
                let part = &o.data[from.min(o.data.len())..(from + most).min(o.data.len())];
                let parameters = vec![part.len() as u32];
                Answer::Reply(Reply { code: code::OK, parameters, data: Some(part.to_vec()) })
            }),
            0x1014..=0x1016 => self.property(operation, first as u16, data),
            INITIATE_CAPTURE if !is_eos => self.capture(),
            _ if is_eos => Eos::answer(self, operation, parameters, data),
            _ => Answer::code(code::NOT_SUPPORTED),
        }
    }

    /// The contact at the remote socket closes. What comes of it nobody is answered, but the events tell.
    pub fn press(&mut self) {
        let _ = match self.setup.personality {
            Personality::Generic => self.capture(),
            Personality::Eos => Eos::press(self, eos::FULL_PRESS),
        };
    }

    /// What live view shows from now on, by its number.
    pub fn shows(&mut self, show: Box<Pictures>) {
        self.show = Some(show);
    }

    /// What is before the lens, for live view.
    pub fn look(&mut self) -> Vec<u8> {
        self.shown += 1;
        self.show.as_mut().map_or_else(Vec::new, |show| show(self.shown - 1))
    }

    /// Canon's own state.
    pub fn eos(&mut self) -> &mut Eos {
        &mut self.eos
    }

    fn capture(&mut self) -> Answer {
        match self.release() {
            Ok(taken) => {
                for (i, (handle, due)) in taken.files.iter().enumerate() {
                    self.event(*due, OBJECT_ADDED, *handle);
                    if i == 0 {
                        self.event(taken.complete, CAPTURE_COMPLETE, 0);
                    }
                }
                Answer::ok()
            }
            Err(answer) => answer,
        }
    }

    /// Objects in the folder that the third parameter names: all of them, those at the root, or its own.
    fn handles(&self, parameters: &[u32]) -> Vec<u32> {
        let parent = parameters.get(2).copied().unwrap_or(0);
        let wanted = if parent == u32::MAX { 0 } else { parent };
        let inside = |o: &Object| parent == 0 || o.parent == wanted;
        self.objects.iter().filter(|(_, o)| inside(o)).map(|(h, _)| *h).collect()
    }

    fn property(&mut self, operation: u16, number: u16, data: &[u8]) -> Answer {
        let Some(property) = self.properties.get_mut(&number) else {
            return Answer::code(code::NO_SUCH_PROPERTY);
        };
        let wide = property.wide;
        let put = |b: Bytes, v: u32| if wide { b.u32(v) } else { b.u16(v as u16) };
        match operation {
            0x1014 => {
                let description = Bytes::new().u16(number).u16(if wide { 6 } else { 4 }).u8(1);
                let description = put(put(description, property.choices[0]), property.value);
                let choices = description.u8(2).u16(property.choices.len() as u16);
                Answer::data(property.choices.iter().fold(choices, |b, v| put(b, *v)))
            }
            0x1015 => Answer::data(put(Bytes::new(), property.value)),
            _ => {
                let value = if wide { u32_at(data, 0) } else { u16_at(data, 0).into() };
                if !property.choices.contains(&value) {
                    return Answer::code(code::BAD_VALUE);
                }
                property.value = value;
                self.event(Instant::now(), PROPERTY_CHANGED, number.into());
                Answer::ok()
            }
        }
    }

    fn device_info(&self) -> Bytes {
        let eos = self.setup.personality == Personality::Eos;
        let own: &[u16] = if eos { Eos::OPERATIONS } else { &[INITIATE_CAPTURE] };
        let properties: Vec<u16> = if eos { Vec::new() } else { self.properties.keys().copied().collect() };
        let [maker, model] = if eos { ["Canon Inc.", "Canon EOS 60D"] } else { ["Simulated", "PTP/IP"] };
        Bytes::new()
            .u16(100)
            .u32(if eos { 0xb } else { 6 })
            .u16(100)
            .string(if eos { "" } else { "simulated" })
            .u16(0)
            .array16(&[&OPERATIONS, own].concat())
            .array16(&[OBJECT_ADDED, 0x4003, PROPERTY_CHANGED, CAPTURE_COMPLETE, 0xc101])
            .array16(&properties)
            .array16(&[JPEG])
            .array16(&[JPEG, ASSOCIATION])
            .string(maker)
            .string(model)
            .string("1.0.0")
            .string("0123456789abcdef")
    }
}
