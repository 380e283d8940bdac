//! A device for unit tests: frames go in, and the device's frames come out with their times.

use canopen::eds::{Access, Eds, Entry, Object, ObjectKind, Term};
use canopen::{DataType, Device, Dictionary, Frame, Instant, Mux, Outbox, Value};

use crate::rules::Rules;
use crate::stack::{Behaviour, Inert, Node, NodeSettings};

pub(crate) struct Fixture {
    pub(crate) node: Node,
    pub(crate) now: Instant,
    sent: Vec<(u64, String)>,
    out: Outbox,
}

impl Fixture {
    /// Node 5 after boot-up, with default settings and no application.
    pub(crate) fn new(eds: &Eds) -> Self {
        Self::with(eds, NodeSettings::default(), Rules::default(), Box::new(Inert))
    }

    /// The same with a decision taken otherwise, as [`Rules::otherwise`] reads it.
    pub(crate) fn mutant(eds: &Eds, name: &str) -> Self {
        let rules = Rules::otherwise(name);
        Self::with(eds, NodeSettings::default(), rules, Box::new(Inert))
    }

    pub(crate) fn with(
        eds: &Eds,
        settings: NodeSettings,
        rules: Rules,
        behaviour: Box<dyn Behaviour>,
    ) -> Self {
        let od = Dictionary::new(eds, 5).unwrap();
        let node = Node::new(eds, od, 5, settings, rules, behaviour);
        let mut fixture =
            Self { node, now: Instant::ZERO, sent: Vec::new(), out: Outbox::default() };
        fixture.run_to(1000);
        fixture.sent.clear();
        fixture
    }

    /// Lets time pass until `at` microseconds.
    pub(crate) fn run_to(&mut self, at: u64) {
        let until = Instant(at * 1000);
        while let Some(due) = self.node.poll_at().filter(|due| *due <= until) {
            self.now = self.now.max(due);
            self.node.handle_timeout(self.now, &mut self.out);
            assert!(self.node.poll_at().is_none_or(|next| next > self.now), "spins at {due}");
            self.collect();
        }
        self.now = self.now.max(until);
    }

    /// Sends a frame at the present time.
    pub(crate) fn send(&mut self, frame: &str) {
        let frame: Frame = frame.parse().unwrap();
        self.node.handle_frame(self.now, &frame, &mut self.out);
        self.collect();
    }

    /// Sends a frame and returns what comes at once.
    pub(crate) fn ask(&mut self, frame: &str) -> Vec<String> {
        self.sent.clear();
        self.send(frame);
        std::mem::take(&mut self.sent).into_iter().map(|(_, frame)| frame).collect()
    }

    /// Lets time pass until `at` microseconds and returns what was sent, with its time.
    pub(crate) fn until(&mut self, at: u64) -> Vec<(u64, String)> {
        self.run_to(at);
        std::mem::take(&mut self.sent)
    }

    /// Downloads a value of up to four bytes; the abort code when it was refused.
    pub(crate) fn write(&mut self, mux: Mux, bytes: &[u8]) -> Result<(), u32> {
        let [low, high, sub] = mux.bytes();
        let mut data = [0x23 | (4 - bytes.len() as u8) << 2, low, high, sub, 0, 0, 0, 0];
        data[4..4 + bytes.len()].copy_from_slice(bytes);
        match self.answer(data) {
            [0x60, ..] => Ok(()),
            [0x80, _, _, _, a, b, c, d] => Err(u32::from_le_bytes([a, b, c, d])),
            other => panic!("{other:02X?}"),
        }
    }

    /// Uploads a value of up to four bytes.
    pub(crate) fn read(&mut self, mux: Mux) -> Result<Vec<u8>, u32> {
        let [low, high, sub] = mux.bytes();
        match self.answer([0x40, low, high, sub, 0, 0, 0, 0]) {
            [command @ (0x43 | 0x47 | 0x4B | 0x4F), _, _, _, data @ ..] => {
                Ok(data[..4 - usize::from(command >> 2 & 3)].to_vec())
            }
            [0x80, _, _, _, a, b, c, d] => Err(u32::from_le_bytes([a, b, c, d])),
            other => panic!("{other:02X?}"),
        }
    }

    /// Sets a stimulus on the physical side.
    pub(crate) fn stimulate(&mut self, name: &str, value: &Value) {
        self.node.stimulate(self.now, name, value, &mut self.out).unwrap();
        self.collect();
    }

    fn answer(&mut self, data: [u8; 8]) -> [u8; 8] {
        self.node.handle_frame(self.now, &Frame::new(0x605, data), &mut self.out);
        let mut answer = None;
        while let Some(frame) = self.out.pop() {
            if frame.data_id() == Some(0x585) {
                answer = Some(frame.data.padded());
            } else {
                self.sent.push((self.now.0 / 1000, frame.to_string()));
            }
        }
        answer.expect("an answer")
    }

    /// Adds a frame that came another way to what was sent.
    pub(crate) fn note(&mut self, frame: &str) {
        self.sent.push((self.now.0 / 1000, frame.to_owned()));
    }

    fn collect(&mut self) {
        while let Some(frame) = self.out.pop() {
            self.sent.push((self.now.0 / 1000, frame.to_string()));
        }
    }
}

/// The address `index:sub`.
pub(crate) const fn mux(index: u16, sub: u8) -> Mux {
    Mux::new(index, sub)
}

/// Makes a data sheet of entries; entries of one index become one object.
pub(crate) fn eds(entries: Vec<Entry>) -> Eds {
    let mut objects: Vec<Object> = Vec::new();
    for entry in entries {
        let index = entry.mux.index;
        match objects.iter_mut().find(|object| object.index == index) {
            Some(object) => {
                object.kind = ObjectKind::RECORD;
                object.entries.push(entry);
            }
            None => objects.push(Object {
                index,
                name: String::new(),
                kind: ObjectKind::VAR,
                flags: None,
                entries: vec![entry],
                line: 0,
            }),
        }
    }
    objects.sort_by_key(|object| object.index);
    for object in &mut objects {
        object.entries.sort_by_key(|entry| entry.mux.sub);
    }
    Eds { objects, ..Eds::default() }
}

/// An entry with a whole number for default value.
pub(crate) fn entry(mux: Mux, data_type: DataType, access: Access, default: i64) -> Entry {
    Entry {
        mux,
        name: String::new(),
        data_type,
        access,
        mappable: mux.index >= 0x2000,
        default: data_type.is_integer().then(|| Term::fixed(Value::from(default))),
        low: None,
        high: None,
        line: 0,
    }
}

/// The smallest device and some objects to try transfers on.
pub(crate) fn basic() -> Vec<Entry> {
    let (ro, rw) = (Access::Ro, Access::Rw);
    let text = |mux, text: &str| Entry {
        default: Some(Term::fixed(Value::Text(text.into()))),
        ..entry(mux, DataType::VISIBLE_STRING, rw, 0)
    };
    vec![
        entry(mux(0x1000, 0), DataType::UNSIGNED32, ro, 0x191),
        entry(mux(0x1001, 0), DataType::UNSIGNED8, ro, 0),
        entry(mux(0x1017, 0), DataType::UNSIGNED16, rw, 0),
        entry(mux(0x1018, 0), DataType::UNSIGNED8, ro, 1),
        entry(mux(0x1018, 1), DataType::UNSIGNED32, ro, 7),
        entry(mux(0x2000, 0), DataType::UNSIGNED8, rw, 0x11),
        Entry {
            low: Some(Term::fixed(Value::Int(-10))),
            high: Some(Term::fixed(Value::Int(10))),
            ..entry(mux(0x2001, 0), DataType::INTEGER16, rw, 0)
        },
        entry(mux(0x2002, 0), DataType::UNSIGNED32, rw, 0x4433_2211),
        entry(mux(0x2003, 0), DataType::UNSIGNED64, rw, 0x0807_0605_0403_0201),
        text(mux(0x2004, 0), "fifteen letters"),
        text(mux(0x2005, 0), ""),
        entry(mux(0x2006, 0), DataType::UNSIGNED16, Access::Wo, 0),
    ]
}

/// A device with every service.
pub(crate) fn full() -> Vec<Entry> {
    let (ro, rw) = (Access::Ro, Access::Rw);
    let (u8, u16, u32) = (DataType::UNSIGNED8, DataType::UNSIGNED16, DataType::UNSIGNED32);
    let of_node = |entry: Entry| Entry {
        default: entry.default.map(|term| Term { plus_node: true, ..term }),
        ..entry
    };
    let array = |index, count: u8, data_type, access, default| {
        (1..=count).map(move |sub| entry(mux(index, sub), data_type, access, default))
    };
    let mut entries = basic();
    entries.push(entry(mux(0x1003, 0), u8, rw, 0));
    entries.extend(array(0x1003, 3, u32, ro, 0));
    entries.push(entry(mux(0x1005, 0), u32, rw, 0x80));
    entries.push(entry(mux(0x1006, 0), u32, rw, 0));
    entries.push(entry(mux(0x1019, 0), u8, rw, 0));
    entries.push(entry(mux(0x100C, 0), u16, rw, 0));
    entries.push(entry(mux(0x100D, 0), u8, rw, 0));
    for index in [0x1010, 0x1011] {
        entries.push(entry(mux(index, 0), u8, ro, 4));
        entries.extend(array(index, 4, u32, rw, 1));
    }
    entries.push(of_node(entry(mux(0x1014, 0), u32, rw, 0x80)));
    entries.push(entry(mux(0x1015, 0), u16, rw, 0));
    entries.push(entry(mux(0x1016, 0), u8, ro, 3));
    entries.extend(array(0x1016, 3, u32, rw, 0));
    entries.push(entry(mux(0x1029, 0), u8, ro, 1));
    entries.push(entry(mux(0x1029, 1), u8, rw, 0));
    for pdo in 0..2 {
        for (index, cob) in [(0x1400 + pdo, 0x200), (0x1800 + pdo, 0x180)] {
            let cob = cob + 0x100 * i64::from(pdo);
            entries.push(entry(mux(index, 0), u8, ro, 6));
            entries.push(of_node(entry(mux(index, 1), u32, rw, cob)));
            entries.push(entry(mux(index, 2), u8, rw, 255));
            entries.push(entry(mux(index, 3), u16, rw, 0));
            entries.push(entry(mux(index, 5), u16, rw, 0));
            entries.push(entry(mux(index, 6), u8, rw, 0));
        }
        for index in [0x1600 + pdo, 0x1A00 + pdo] {
            entries.push(entry(mux(index, 0), u8, rw, 0));
            entries.extend(array(index, 9, u32, rw, 0));
        }
    }
    entries.push(entry(mux(0x6000, 1), u8, ro, 0));
    entries.push(entry(mux(0x6200, 1), u8, Access::Rww, 0));
    entries.push(entry(mux(0x6200, 2), u8, Access::Rww, 0));
    entries.push(entry(mux(0x6401, 1), DataType::INTEGER16, ro, 0));
    entries
}

/// Gives an entry another default value.
pub(crate) fn set(entries: &mut [Entry], mux: Mux, default: i64) {
    let entry = entries.iter_mut().find(|entry| entry.mux == mux).unwrap();
    entry.default = Some(Term::fixed(Value::from(default)));
}

/// The sent frames, in a form that is easy to write down.
pub(crate) fn sent(frames: &[(u64, &str)]) -> Vec<(u64, String)> {
    frames.iter().map(|(at, frame)| (*at, (*frame).to_owned())).collect()
}
