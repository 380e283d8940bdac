//! The device under test, as far as the harness knows it.
//!
//! What the data sheet, the user and a first look say. Nothing here sends a frame.

mod sheet;

use std::collections::BTreeMap;
use std::fmt::{self, Debug};
use std::sync::Arc;

use canopen::bench::Needs;
use canopen::eds::{Eds, Entry};
use canopen::pdo::Mapping;
use canopen::{BusError, Mux, lss};
use reports::{DeviceStarted, Identity, Versions};

use crate::protect::{Protection, Wire};

pub use sheet::{COMPOSED, Sheet};

/// The device under test as the harness knows it: by name, node id and data sheet.
#[derive(Clone, Debug)]
pub struct Dut {
    /// The name in reports.
    pub name: String,
    /// Its node id.
    pub node: u8,
    /// The device's description of itself.
    pub eds: Arc<Eds>,
    /// The places of its statements.
    pub sheet: Arc<Sheet>,
    /// The names that the bench around it can set and observe.
    pub bench: Vec<String>,
    /// Whether that bench is the user's, not that of a simulation.
    pub own_bench: bool,
    /// How the device must be set up for a stimulus of that bench to reach it.
    pub bench_needs: Needs,
    /// The interface that it is on, when it is not simulated.
    pub interface: Option<String>,
    /// Whether other stations can be on its bus: it is neither in this process nor at the end of
    /// pipes. What comes there with another identifier than its own may be theirs.
    pub shares_its_bus: bool,
    /// The other nodes of its bus that are known: they are watched, and kept from what is meant for
    /// the device.
    pub other_nodes: Vec<OtherNode>,
    /// The one of them that cases may change, or one that is simulated beside a simulated device.
    pub partner: Option<OtherNode>,
    /// Whether it is a program on a machine that can be too busy to run it in time.
    pub shares_its_machine: bool,
    /// Bit rate of its bus in bit/s, when it is known.
    pub bit_rate: Option<u32>,
    /// What is worth a remark of its bus: how frames get their times, and what loads it.
    pub of_bus: Vec<String>,
    /// Options of its profile that it does not have.
    pub without: Vec<String>,
    /// The name of the profile that the device gave when asked, by an object that the catalogue
    /// knows.
    pub told: Option<String>,
    /// How many bytes the values of variable length had when it was asked.
    pub lengths: BTreeMap<Mux, usize>,
    /// The actions that it is protected from.
    pub protection: Arc<Protection>,
    /// How it takes frames, by its data sheet.
    pub wire: Arc<Wire>,
    /// The ways to bring it back when it does not answer.
    pub hooks: Hooks,
}

/// A node beside the device under test, on the same bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherNode {
    /// The name in reports.
    pub name: String,
    /// Its node id.
    pub node: u8,
}

impl fmt::Display for OtherNode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, node {}", self.name, self.node)
    }
}

/// The user's means to bring the device back.
#[derive(Clone, Debug, Default)]
pub struct Hooks {
    /// Resets the device.
    pub reset: Option<Arc<dyn Hook>>,
    /// Switches its supply; the argument is `off` or `on`.
    pub power: Option<Arc<dyn Hook>>,
}

/// Something outside of the bus that can be done to the device, such as a program of the user's.
pub trait Hook: Debug + Send + Sync {
    /// The name in reports.
    fn name(&self) -> &str;

    /// Runs the hook and returns once it is done; the inner error is the reason why it failed.
    /// `look` is called several times a second in the meantime, and ends the hook with an error.
    ///
    /// # Errors
    /// That of `look`.
    fn call(&self, argument: Option<&str>, look: Look) -> Result<Result<(), String>, BusError>;
}

/// Looks at the bus, which notices an interruption.
pub type Look<'l> = &'l mut dyn FnMut() -> Result<(), BusError>;

impl Dut {
    /// A device of which only the data sheet is known.
    pub fn new(name: impl Into<String>, node: u8, eds: Eds) -> Self {
        Self {
            name: name.into(),
            node,
            eds: Arc::new(eds),
            sheet: Arc::default(),
            bench: Vec::new(),
            own_bench: false,
            bench_needs: Needs::new(),
            interface: None,
            shares_its_bus: false,
            other_nodes: Vec::new(),
            partner: None,
            shares_its_machine: false,
            bit_rate: None,
            of_bus: Vec::new(),
            without: Vec::new(),
            told: None,
            lengths: BTreeMap::new(),
            protection: Arc::default(),
            wire: Arc::default(),
            hooks: Hooks::default(),
        }
    }

    /// The event that begins it in a report, as far as it is known without asking it. `rerun` is
    /// the command that runs a case again, without its name.
    pub fn started(&self, rerun: String) -> DeviceStarted {
        DeviceStarted {
            device: self.name.clone(),
            node: self.node,
            identity: Identity::default(),
            versions: Versions::default(),
            sheet: Some(self.sheet.used()),
            objects: Arc::clone(&self.sheet.names),
            pdos: Arc::clone(&self.sheet.pdos),
            // Pipes have none.
            bit_rate: self.bit_rate.filter(|_| self.shares_its_bus || !self.shares_its_machine),
            others: self.other_nodes.iter().chain(&self.partner).map(|other| other.node).collect(),
            rerun,
            remark: None,
        }
    }

    /// The ways to bring it back when it does not answer, the gentlest first; for a simulated
    /// device, nothing.
    pub fn ways_back(&self) -> Option<String> {
        let interface = self.interface.as_ref()?;
        let send = |frame: &str| format!("`cansend {interface} {frame}`");
        let mut ways = vec![send(&format!("000#82{:02X}", self.node))];
        let is_alone = self.other_nodes.is_empty();
        if is_alone {
            ways.push(send("000#8100"));
        }
        if self.eds.device.lss && is_alone {
            let lss = ["7E5#0401000000000000", &format!("7E5#11{:02X}000000000000", self.node)];
            let lss = lss.into_iter().chain(["7E5#0400000000000000", "000#8200"]);
            let frames: Vec<String> = lss.map(send).collect();
            let frames = frames.join(", ");
            ways.push(format!("{frames}, which give it its node id where no other LSS slave is"));
        }
        ways.push("its supply switched off and on".to_owned());
        Some(format!("what may bring it back: {}", ways.join("; ")))
    }

    /// How many bytes the value of an entry has: by its type, as the device said, or by default.
    pub fn length(&self, entry: &Entry) -> usize {
        let by_default = || entry.default_bytes(self.node).map_or(0, |bytes| bytes.len());
        let told = || self.lengths.get(&entry.mux).copied();
        entry.data_type.size().or_else(told).unwrap_or_else(by_default)
    }

    /// The whole number that the data sheet gives as default at `mux`.
    pub fn default_int(&self, mux: Mux) -> Option<i128> {
        let entry = self.eds.entry(mux)?;
        match (entry.data_type.limits(), &entry.default) {
            (Some(_), None) => Some(0),
            (Some((low, high)), Some(term)) => {
                let number = term.resolve(self.node).as_int()?;
                (low..=high).contains(&number).then_some(number)
            }
            (None, _) => {
                entry.data_type.decode(&entry.default_bytes(self.node).ok()?).ok()?.as_int()
            }
        }
    }

    /// The entries of 1016h, each with a node that the device may monitor.
    pub fn heartbeat_consumers(&self) -> impl Iterator<Item = Mux> {
        const CONSUMER_HEARTBEAT_TIME: u16 = 0x1016;
        let entries = (1..=u8::MAX).map(|sub| Mux::new(CONSUMER_HEARTBEAT_TIME, sub));
        entries.take_while(|mux| self.eds.entry(*mux).is_some())
    }

    /// The number of the device profile: the low 16 bits of 1000h, by the data sheet.
    pub fn profile_number(&self) -> Option<u16> {
        self.default_int(Mux::new(0x1000, 0)).map(|device_type| device_type as u16)
    }

    /// Why layer setting services cannot leave the bit rate as it is: it is unknown, or it has no
    /// place in their table.
    pub fn unlisted_bit_rate(&self) -> Option<String> {
        match self.bit_rate {
            None => Some("the bit rate of the bus is unknown: --bitrate".to_owned()),
            rate if lss::BIT_RATES.contains(&rate) => None,
            Some(rate) => Some(format!("{rate} bit/s has no place in the table of CiA 305")),
        }
    }

    /// The addresses and lengths that a PDO maps by default; `mapping` is its mapping parameter.
    pub fn default_mapping(&self, mapping: u16) -> Vec<Mapping> {
        let count = self.default_int(Mux::new(mapping, 0)).unwrap_or(0).clamp(0, 64) as u8;
        let words = (1..=count).filter_map(|sub| self.default_int(Mux::new(mapping, sub)));
        words.map(|word| Mapping::decode(word as u32)).collect()
    }
}
