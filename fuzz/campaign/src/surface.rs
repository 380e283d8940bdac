//! What can be set and seen of a device.

mod channels;
mod stimuli;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use canopen::bench::{Needs, POWER};
use canopen::eds::{Access, Direction, Entry, Term};
use canopen::sdo::{Initiate, Request};
use canopen::{Instant, Mux, Outbox, Value};
use reference_devices::change::Replica;
use reference_devices::devices::ReferenceDevice;

use crate::action::{Action, Kind, Stimulus, Then};

use channels::Channels;
use stimuli::values_of;
pub(crate) use stimuli::{PROCESS, Values, lingers, turns};

/// The first index that is not about communication.
pub(crate) const FIRST_OF_APPLICATION: u16 = 0x2000;

/// What can be set and seen of a device.
#[derive(Clone, Debug)]
pub struct Surface {
    /// What the network can set, by address.
    pub(crate) settings: Vec<Setting>,
    /// The settings of each function: what stands together in the dictionary.
    pub(crate) functions: Vec<Vec<usize>>,
    /// The settings by what they are: those of each instance of a function together.
    pub(crate) kinds: Vec<Vec<usize>>,
    /// The settings of the application that have a few codes.
    pub(crate) selectors: Vec<usize>,
    /// The settings of the application that an RPDO can carry.
    pub(crate) commands: Vec<usize>,
    /// What the bench can set.
    pub(crate) stimuli: Vec<Source>,
    /// What must be set for a stimulus to reach the device.
    pub(crate) needs: Needs,
    /// What the bench shows, stimuli not among them.
    pub(crate) shown: Vec<Arc<str>>,
    /// All objects that can be read.
    pub(crate) readable: Vec<Mux>,
    /// Those of them that the device itself changes.
    pub(crate) moving: Vec<Mux>,
    /// The RPDOs as they are by default.
    pub(crate) rpdos: Vec<Pdo>,
    /// The TPDOs that can be mapped, as they are by default; what they carry is of no interest.
    pub(crate) tpdos: Vec<Pdo>,
    /// Whether it has layer setting services.
    pub(crate) lss: bool,
    /// What can be read only, with values of its length.
    pub(crate) fixed: Vec<(Mux, Vec<u8>)>,
    /// The settings of each channel.
    channels: Channels,
    /// Settings by their names, the numbers in them apart.
    kin: BTreeMap<(String, Vec<u32>), usize>,
    /// The names of objects, for people.
    names: BTreeMap<Mux, String>,
    /// The lengths of objects in bits.
    bits: BTreeMap<Mux, i64>,
}

/// A PDO.
#[derive(Clone, Debug)]
pub(crate) struct Pdo {
    /// The object with its communication parameters.
    pub(crate) index: u16,
    /// Its COB-ID.
    pub(crate) cob: u32,
    /// What it carries: settings by their places, and lengths in bytes.
    pub(crate) fields: Vec<(Option<usize>, usize)>,
    /// Whether it can carry something else.
    pub(crate) mappable: bool,
}

/// A value that the network can set.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    pub(crate) entry: Entry,
    /// The function it is of.
    pub(crate) function: usize,
    /// What a raw 1 is, in its unit.
    pub(crate) scale: f64,
    /// The unit.
    pub(crate) unit: Unit,
}

/// The units that matter for what is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// Seconds.
    Seconds,
    /// Another one, or none.
    Other,
}

/// A stimulus of the bench.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub(crate) name: Arc<str>,
    pub(crate) values: Values,
}

impl Surface {
    /// That of a reference device.
    pub fn of(device: &ReferenceDevice, node: u8, built: &dyn Replica) -> Self {
        let description = &device.description;
        let mut surface = Self {
            settings: Vec::new(),
            functions: Vec::new(),
            kinds: Vec::new(),
            selectors: Vec::new(),
            commands: Vec::new(),
            stimuli: Vec::new(),
            needs: built.bench_needs(),
            shown: Vec::new(),
            readable: Vec::new(),
            moving: Vec::new(),
            rpdos: Vec::new(),
            tpdos: Vec::new(),
            lss: description.eds.device.lss,
            fixed: Vec::new(),
            channels: Channels::default(),
            kin: BTreeMap::new(),
            names: BTreeMap::new(),
            bits: BTreeMap::new(),
        };
        for object in &description.eds.objects {
            let mut function = None;
            for entry in &object.entries {
                let name = match object.entries.len() {
                    1 => object.name.clone(),
                    _ => format!("{}, {}", object.name, entry.name),
                };
                surface.names.insert(entry.mux, name);
                let bytes = entry.data_type.size().unwrap_or(0) as i64;
                surface.bits.insert(entry.mux, 8 * bytes);
                let readable = entry.access.readable().then_some(entry.mux);
                surface.readable.extend(readable);
                surface.moving.extend(readable.filter(|_| moves(entry)));
                if !entry.access.writable()
                    && let Some(bytes) = entry.default_bytes(node).ok()
                {
                    surface.fixed.push((entry.mux, bytes.into_iter().take(4).collect()));
                }
                if !is_setting(entry) {
                    function = None;
                    continue;
                }
                let function = *function.get_or_insert_with(|| {
                    surface.functions.push(Vec::new());
                    surface.functions.len() - 1
                });
                surface.functions[function].push(surface.settings.len());
                let is_command = entry.maps_into(Direction::Receive);
                if is_command && entry.mux.index >= FIRST_OF_APPLICATION {
                    surface.commands.push(surface.settings.len());
                }
                if has_few_codes(entry, node) {
                    surface.selectors.push(surface.settings.len());
                }
                let name = &surface.names[&entry.mux];
                surface.kin.insert(parted(name), surface.settings.len());
                let note = description.notes.get(&entry.mux);
                let (unit, scale) = unit(note.and_then(|note| note.unit.as_deref()));
                let scale = scale * note.and_then(|note| note.scale).unwrap_or(1.0);
                surface.settings.push(Setting { entry: entry.clone(), function, scale, unit });
            }
        }
        surface.kinds = surface.of_one_kind();
        surface.channels = Channels::of(&surface.settings, &surface.functions, &surface.names);
        surface.take_pdos(device, node);
        surface.take_bench(built, &description.not_judged);
        surface
    }

    /// The settings by what they are, whatever they belong to.
    fn of_one_kind(&self) -> Vec<Vec<usize>> {
        let mut kinds: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for ((name, _), setting) in &self.kin {
            kinds.entry(name).or_default().push(*setting);
        }
        kinds.into_values().collect()
    }

    /// The PDOs as they are by default.
    fn take_pdos(&mut self, device: &ReferenceDevice, node: u8) {
        let eds = &device.description.eds;
        let number = |index, sub| {
            let entry = eds.entry(Mux::new(index, sub))?;
            entry.default.as_ref()?.resolve(node).as_int()
        };
        let mappable = |index| {
            let count = eds.entry(Mux::new(index, 0));
            count.is_none_or(|entry| entry.access.writable())
        };
        for pdo in 0..eds.device.tpdo_count {
            if let Some(cob) = number(0x1800 + pdo, 1).filter(|_| mappable(0x1A00 + pdo)) {
                let (index, cob, fields) = (0x1800 + pdo, cob as u32, Vec::new());
                self.tpdos.push(Pdo { index, cob, fields, mappable: true });
            }
        }
        for pdo in 0..eds.device.rpdo_count {
            let Some(cob) = number(0x1400 + pdo, 1).filter(|cob| cob >> 31 == 0) else { continue };
            let count = number(0x1600 + pdo, 0).unwrap_or(0) as u8;
            let entries = (1..=count).filter_map(|sub| number(0x1600 + pdo, sub));
            let fields = entries.map(|entry| {
                let mux = Mux::new((entry >> 16) as u16, (entry >> 8) as u8);
                let setting = self.settings.iter().position(|setting| setting.entry.mux == mux);
                (setting, (entry & 0xFF) as usize / 8)
            });
            let fields: Vec<_> = fields.collect();
            if !fields.is_empty() {
                let (index, cob, mappable) = (0x1400 + pdo, cob as u32, mappable(0x1600 + pdo));
                self.rpdos.push(Pdo { index, cob, fields, mappable });
            }
        }
    }

    /// What the bench takes and shows, without what the documents of the device leave open.
    fn take_bench(&mut self, built: &dyn Replica, open: &BTreeMap<String, String>) {
        for name in built.bench_names() {
            let takes = |value: &Value| {
                let (mut device, mut out) = (built.replica(), Outbox::default());
                device.stimulate(Instant::ZERO, &name, value, &mut out).is_ok()
            };
            let values = values_of(&name).and_then(|values| values.kept(takes));
            match values {
                _ if name == POWER || open.contains_key(&name) => {}
                Some(values) => self.stimuli.push(Source { name: name.into(), values }),
                None => self.shown.push(name.into()),
            }
        }
    }

    /// The stimuli that a process moves, which goes on when a session is over, and the values of
    /// one at rest.
    pub fn processes(&self) -> impl Iterator<Item = (&Arc<str>, Value)> {
        self.stimuli.iter().filter_map(|source| match source.values {
            Values::Real { process: Some(at_rest), .. } => {
                Some((&source.name, Value::Real(at_rest)))
            }
            _ => None,
        })
    }

    /// Whether an object can be read.
    pub(crate) fn reads(&self, mux: Mux) -> bool {
        self.readable.binary_search(&mux).is_ok()
    }

    /// The setting at an address.
    pub(crate) fn setting(&self, mux: Mux) -> Option<usize> {
        self.settings.binary_search_by_key(&mux, |setting| setting.entry.mux).ok()
    }

    /// The settings of the same channel; `None` when it is none of a channel.
    pub(crate) fn channel(&self, setting: usize) -> Option<&[usize]> {
        let Setting { entry, function, .. } = &self.settings[setting];
        self.channels.around(setting, entry.mux, self.functions[*function].len())
    }

    /// The same setting of another instance, so many further: that of output 5 for that of output
    /// 3.
    pub(crate) fn kin(&self, setting: usize, further: i32) -> Option<usize> {
        let name = &self.names[&self.settings[setting].entry.mux];
        let (name, numbers) = parted(name);
        (0..numbers.len()).rev().find_map(|place| {
            let mut other = numbers.clone();
            other[place] = other[place].checked_add_signed(further)?;
            self.kin.get(&(name.clone(), other)).copied()
        })
    }

    /// The same stimulus at another instance, so many further.
    pub(crate) fn kin_of_stimulus(&self, name: &str, further: i32) -> Option<Arc<str>> {
        let (name, mut numbers) = parted(name);
        let last = numbers.last_mut()?;
        *last = last.checked_add_signed(further)?;
        let like = |source: &&Source| parted(&source.name) == (name.clone(), numbers.clone());
        self.stimuli.iter().find(like).map(|source| Arc::clone(&source.name))
    }

    /// What people call an object.
    pub fn name(&self, mux: Mux) -> String {
        match self.names.get(&mux) {
            Some(name) => format!("{mux} {name}"),
            None => mux.to_string(),
        }
    }

    /// The length of an object in bits.
    pub(crate) fn bits(&self, mux: Mux) -> i64 {
        self.bits.get(&mux).copied().unwrap_or(0)
    }

    /// What an action does, in words.
    pub fn words(&self, action: &Action) -> String {
        if let Some(Stimulus { name, value }) = &action.bench {
            return format!("{name} = {value}");
        }
        let written =
            action.frames.first().and_then(|frame| match Request::decode(&frame.data).ok()? {
                Request::Download(mux, Initiate::Expedited(data)) => Some((mux, data)),
                _ => None,
            });
        match (written, action.then) {
            (Some((mux, data)), _) if action.does != Kind::NmtState => {
                let setting = self.setting(mux).map(|place| &self.settings[place].entry);
                let value = setting.and_then(|entry| entry.data_type.decode(&data).ok());
                let value = value.unwrap_or_else(|| Value::Bytes(data.to_vec()));
                format!("{} = {}", self.name(mux), value.of(mux))
            }
            (_, Then::Wait(micros)) if action.does == Kind::Wait => {
                format!("wait {:?}", Duration::from_micros(micros))
            }
            _ => {
                let frames: Vec<String> = action.frames.iter().map(ToString::to_string).collect();
                format!("{} {}", action.does.word(), frames.join(" ")).trim_end().to_owned()
            }
        }
    }

    /// How many objects can be read, and how many names the bench shows.
    pub fn size(&self) -> (usize, usize) {
        (self.readable.len(), self.shown.len())
    }
}

/// A name without its numbers, and these.
fn parted(name: &str) -> (String, Vec<u32>) {
    let (mut words, mut numbers) = (String::new(), Vec::new());
    let mut letters = name.chars().peekable();
    while let Some(letter) = letters.next() {
        let Some(mut number) = letter.to_digit(10) else {
            words.push(letter);
            continue;
        };
        while let Some(digit) = letters.peek().and_then(|next| next.to_digit(10)) {
            number = number.saturating_mul(10).saturating_add(digit);
            letters.next();
        }
        words.push('#');
        numbers.push(number);
    }
    (words, numbers)
}

/// Whether the device itself may change the value.
fn moves(entry: &Entry) -> bool {
    let index = entry.mux.index;
    let of_application = index >= FIRST_OF_APPLICATION && !matches!(entry.access, Access::Const);
    let is_count = entry.mux.sub == 0 && entry.default.is_some();
    let ro = !(entry.access.writable() || is_count);
    index == 0x1001
        || (index == 0x1003 && entry.mux.sub < 3)
        || of_application && (ro || entry.maps_into(Direction::Transmit))
}

/// Whether a session may set it: numbers of the application, and what decides when the application
/// falls into its error state and what it sends.
fn is_setting(entry: &Entry) -> bool {
    let Mux { index, sub } = entry.mux;
    let of_application = match index {
        0x100C | 0x100D | 0x1017 => true,
        0x1006 | 0x1015 => true,
        0x1016 | 0x1029 => sub > 0,
        0x1400..=0x15FF => sub == 2 || sub == 5,
        0x1800..=0x19FF => matches!(sub, 2 | 3 | 5),
        _ => index >= FIRST_OF_APPLICATION,
    };
    let is_reserved = entry.name.to_ascii_lowercase().starts_with("reserved");
    let is_number = entry.data_type.size().is_some_and(|size| size <= 4);
    of_application && !is_reserved && is_number && entry.access.writable()
}

/// Whether it selects one of a few things.
fn has_few_codes(entry: &Entry, node: u8) -> bool {
    let end = |end: &Option<Term>| end.as_ref()?.resolve(node).as_int();
    let few = end(&entry.high).zip(end(&entry.low)).is_some_and(|(high, low)| high - low <= CODES);
    few && entry.mux.index >= FIRST_OF_APPLICATION
}

/// How many codes are a few, less one.
const CODES: i128 = 15;

/// A unit as data have it: `0.1 s`.
fn unit(unit: Option<&str>) -> (Unit, f64) {
    let Some(unit) = unit else { return (Unit::Other, 1.0) };
    let (factor, unit) = match unit.split_once(' ') {
        Some((factor, unit)) => match factor.parse() {
            Ok(factor) => (factor, unit),
            Err(_) => (1.0, unit),
        },
        None => (1.0, unit),
    };
    match unit {
        "us" => (Unit::Seconds, factor * 1e-6),
        "ms" => (Unit::Seconds, factor * 1e-3),
        "s" => (Unit::Seconds, factor),
        "min" => (Unit::Seconds, factor * 60.0),
        "h" => (Unit::Seconds, factor * 3600.0),
        _ => (Unit::Other, factor),
    }
}
