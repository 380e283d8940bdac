//! The words about profiles: which one a suite is about, and what a device of it may lack.

use std::borrow::Cow;
use std::fmt;

use canopen::Mux;
use canopen::catalogue::{self, Catalogue, Profile};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer};

use crate::nearest::did_you_mean;

/// The profile that a suite is about.
#[derive(Clone, Debug)]
pub enum About {
    /// The device profile of that number, by the low 16 bits of 1000h.
    Number(u16),
    /// The profile of that name in the catalogue, which is recognised by another object.
    Named(String),
}

impl About {
    /// The profile of that name in a catalogue, with its parts beyond objects.
    ///
    /// # Errors
    /// That no profile has the name, with the existing names.
    pub fn named<'c>(&self, catalogue: &'c Catalogue) -> Result<Option<&'c Profile>, String> {
        let name = match self {
            Self::Named(name) => name,
            // Numbers are those of CiA's device profiles, of which not all are in a catalogue.
            Self::Number(number) => return Ok(catalogue.profile(&format!("cia{number}"))),
        };
        let known = recognisable(catalogue).find(|profile| profile.name == *name);
        known.map(Some).ok_or_else(|| {
            let names: Vec<&str> =
                recognisable(catalogue).map(|profile| profile.name.as_str()).collect();
            let meant = did_you_mean(name, names.iter().copied());
            let names = names.join(", ");
            format!("no profile `{name}`: there are numbers and {names}{meant}")
        })
    }
}

/// The profiles that a suite can name.
fn recognisable(catalogue: &Catalogue) -> impl Iterator<Item = &Profile> {
    let profiles = catalogue.profiles().iter().map(|profile| &**profile);
    profiles.filter(|profile| profile.recognised.is_some())
}

impl<'de> Deserialize<'de> for About {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrName;
        impl Visitor<'_> for NumberOrName {
            type Value = About;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number such as 401, or the name of a profile")
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<About, E> {
                let number = number.try_into().map_err(|_| E::custom("a profile has 16 bits"))?;
                Ok(About::Number(number))
            }
            fn visit_u64<E: de::Error>(self, number: u64) -> Result<About, E> {
                let number = number.try_into().map_err(|_| E::custom("a profile has 16 bits"))?;
                Ok(About::Number(number))
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<About, E> {
                Ok(About::Named(name.to_owned()))
            }
        }
        deserializer.deserialize_any(NumberOrName)
    }
}

impl JsonSchema for About {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "About".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let profiles = recognisable(Catalogue::built_in());
        let names: Vec<&str> = profiles.map(|profile| profile.name.as_str()).collect();
        json_schema!({
            "description": "A profile: its number, or its name in the catalogue.",
            "oneOf": [
                { "type": "integer", "minimum": 0, "maximum": 65535 },
                { "enum": names }
            ]
        })
    }
}

/// What a device may or may not be able to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Capability {
    /// Layer setting services, by its data sheet.
    Lss,
    /// SDO block transfer in both directions; the device is asked once, at the start of a run.
    BlockTransfer,
    /// SDO block upload, asked likewise.
    BlockUpload,
    /// SDO block download, asked likewise.
    BlockDownload,
    /// It enters OPERATIONAL without a command, which 1F80h or the device itself shows at the start
    /// of a run.
    SelfStart,
    /// It stores parameters on command: bit 0 of 1010h sub 1, asked at the start of a run.
    SaveOnCommand,
    /// It stores the parameters that the case writes by itself: bit 1 of 1010h, of the sub-index of
    /// their group, asked likewise.
    AutonomousStorage,
    /// Minutes of its bus take no time, as on the simulated bus.
    VirtualTime,
    /// There is another node on its bus, `$partner`: one of the same device file, or one that is
    /// simulated beside a simulated device.
    AnotherNode,
    /// An option of the profile that the suite is about. No EDS expresses it: a device has it
    /// unless `--without` says otherwise.
    Option(String),
}

impl Capability {
    /// Whether it is block transfer, in whichever direction, and which it needs.
    pub fn blocks(&self) -> Option<BlockDirections> {
        let blocks = |upload, download| Some(BlockDirections { upload, download });
        match self {
            Self::BlockTransfer => blocks(true, true),
            Self::BlockUpload => blocks(true, false),
            Self::BlockDownload => blocks(false, true),
            _ => None,
        }
    }
}

/// What a device does by itself, and how time passes on its bus; known when a run begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Habits {
    /// It enters OPERATIONAL without a command.
    pub self_start: bool,
    /// It stores parameters on command.
    pub save_on_command: bool,
    /// Which parameters it stores without one.
    pub autonomous_storage: Autonomous,
    /// The sub-indices of 1010h whose bit 0 says that "save" stores nothing there, a bit for each.
    pub no_save: u128,
    /// The sub-indices of 1011h whose bit 0 says that "load" restores nothing there.
    pub no_load: u128,
    /// Minutes take no time.
    pub virtual_time: bool,
}

/// The parameters that a device stores by itself, by bit 1 of the sub-indices of 1010h. A group
/// without a sub-index of its own goes with all parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Autonomous {
    /// By sub-index 1.
    pub all: bool,
    /// Those of the communication, 1000h to 1FFFh, by sub-index 2.
    pub communication: bool,
    /// Those of the standardised application, 6000h to 9FFFh, by sub-index 3.
    pub application: bool,
}

impl Autonomous {
    /// Whether the group of an object is one of them.
    pub const fn stores(self, index: u16) -> bool {
        match index {
            0x1000..=0x1FFF => self.communication,
            0x6000..=0x9FFF => self.application,
            _ => self.all,
        }
    }
}

impl Default for Habits {
    fn default() -> Self {
        let (no_save, no_load) = (0, 0);
        Self {
            self_start: false,
            save_on_command: true,
            autonomous_storage: Autonomous::default(),
            no_save,
            no_load,
            virtual_time: false,
        }
    }
}

impl Habits {
    /// Whether this value, written there, is a command that the device says it does not have.
    pub fn lacks_command(self, mux: Mux, value: i128) -> bool {
        let idle = match (mux.index, value) {
            (0x1010, SAVE) => self.no_save,
            (0x1011, LOAD) => self.no_load,
            _ => 0,
        };
        idle.checked_shr(mux.sub.into()).is_some_and(|idle| idle & 1 != 0)
    }

    /// Whether a device of these habits is capable of it where a case writes the objects with these
    /// indices, and the words for one that is and one that is not; `None` for what is no habit.
    pub fn of(
        self,
        capability: &Capability,
        written: &[u16],
    ) -> Option<(bool, &'static str, &'static str)> {
        match capability {
            Capability::SelfStart => Some((
                self.self_start,
                "the device enters OPERATIONAL by itself",
                "the device enters OPERATIONAL by a command only",
            )),
            Capability::SaveOnCommand => Some((
                self.save_on_command,
                "the device stores parameters on command",
                "the device stores no parameters on command (1010h sub 1, bit 0)",
            )),
            Capability::AutonomousStorage => Some((
                written.iter().any(|index| self.autonomous_storage.stores(*index)),
                "the device stores parameters by itself (1010h, bit 1)",
                "the device stores parameters on command only",
            )),
            Capability::VirtualTime => Some((
                self.virtual_time,
                "time on the bus is virtual",
                "time on the bus is real, and the case takes minutes of it",
            )),
            _ => None,
        }
    }
}

/// Directions of SDO block transfer that a device has, or that a case needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockDirections {
    /// From the server.
    pub upload: bool,
    /// To the server.
    pub download: bool,
}

impl<'de> Deserialize<'de> for Capability {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match Cow::<str>::deserialize(deserializer)? {
            name if name == LSS => Self::Lss,
            name if name == BLOCK_TRANSFER => Self::BlockTransfer,
            name if name == BLOCK_UPLOAD => Self::BlockUpload,
            name if name == BLOCK_DOWNLOAD => Self::BlockDownload,
            name if name == SELF_START => Self::SelfStart,
            name if name == SAVE_ON_COMMAND => Self::SaveOnCommand,
            name if name == AUTONOMOUS_STORAGE => Self::AutonomousStorage,
            name if name == VIRTUAL_TIME => Self::VirtualTime,
            name if name == ANOTHER_NODE => Self::AnotherNode,
            name => Self::Option(name.into_owned()),
        })
    }
}

impl JsonSchema for Capability {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Capability".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let options = catalogue::profiles().iter().flat_map(|profile| profile.options.keys());
        let names: Vec<&str> =
            CAPABILITIES.into_iter().chain(options.map(String::as_str)).collect();
        json_schema!({ "description": "A capability, or an option of the profile.", "enum": names })
    }
}

/// What 1010h takes to store: "save", with its first letter in the lowest byte.
const SAVE: i128 = 0x6576_6173;
/// What 1011h takes to restore: "load".
const LOAD: i128 = 0x6461_6F6C;
/// The names of the capabilities that any device can have.
pub(crate) const CAPABILITIES: [&str; 9] = [
    LSS,
    BLOCK_TRANSFER,
    BLOCK_UPLOAD,
    BLOCK_DOWNLOAD,
    SELF_START,
    SAVE_ON_COMMAND,
    AUTONOMOUS_STORAGE,
    VIRTUAL_TIME,
    ANOTHER_NODE,
];
const LSS: &str = "lss";
const ANOTHER_NODE: &str = "another-node";
const BLOCK_TRANSFER: &str = "block-transfer";
const BLOCK_UPLOAD: &str = "block-upload";
const BLOCK_DOWNLOAD: &str = "block-download";
const SELF_START: &str = "self-start";
const SAVE_ON_COMMAND: &str = "save-on-command";
const AUTONOMOUS_STORAGE: &str = "autonomous-storage";
const VIRTUAL_TIME: &str = "virtual-time";

/// The number of one of the blocks that a profile repeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockNumber {
    /// That one, counted from 1.
    At(u8),
    /// The last one that the device has.
    Last,
}

impl<'de> Deserialize<'de> for BlockNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrLast;
        impl Visitor<'_> for NumberOrLast {
            type Value = BlockNumber;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number from 1 on, or `last`")
            }
            fn visit_u64<E: de::Error>(self, number: u64) -> Result<BlockNumber, E> {
                let number = u8::try_from(number).ok().filter(|number| *number > 0);
                let number = number.ok_or_else(|| E::custom("blocks are counted from 1"))?;
                Ok(BlockNumber::At(number))
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<BlockNumber, E> {
                self.visit_u64(u64::try_from(number).unwrap_or_default())
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<BlockNumber, E> {
                match text {
                    "last" => Ok(BlockNumber::Last),
                    _ => Err(E::custom(format!("`{text}`: write a number from 1 on, or `last`"))),
                }
            }
        }
        deserializer.deserialize_any(NumberOrLast)
    }
}

impl JsonSchema for BlockNumber {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "BlockNumber".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "oneOf": [{ "type": "integer", "minimum": 1 }, { "const": "last" }] })
    }
}
