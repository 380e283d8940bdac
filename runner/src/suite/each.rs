//! The notation of `each`, and of the choice of objects and PDOs, as data. The JSON schema comes
//! from the same types.

use schemars::JsonSchema;
use serde::Deserialize;

use super::literal::ObjectRef;
use super::profile::BlockNumber;
use crate::source::At;

/// One instance for each ...
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Each {
    /// ... entry of the data sheet that fits. Binds `$mux`, `$value` (default), `$another` (a
    /// whole number beside the default), `$size` (bytes), `$low`, `$high`, `$below`, `$above`,
    /// `$longer` and `$shorter` (the default value with a byte more or less), `$entry` (what maps
    /// it into a PDO), `$subs` (the number of sub-indices its object has beside 0), `$beyond` (the
    /// address after its last one) and `$kind` (the code of its object).
    Objects(Objects),
    /// ... PDO of the data sheet that fits. Binds `$pdo` (its CAN identifier), `$on` and `$off`
    /// (its COB-ID, valid and not), `$number`, the addresses `$parameters` (sub-index 0),
    /// `$cob-id`, `$transmission`, `$inhibit`, `$reserved`, `$event-timer`, `$sync-start`,
    /// `$count`, `$first` and `$second` (mapping entries), `$entries` (how many of them there
    /// are) and `$length` (bytes of the default mapping); of the next PDO in use `$neighbour`
    /// (its identifier), `$neighbour-on`, `$neighbour-off`, `$neighbour-cob-id`,
    /// `$neighbour-transmission`, `$neighbour-inhibit` and `$neighbour-count`.
    Pdos(Pdos),
    /// ... block of objects that the profile of the suite repeats and the device has whole. Binds
    /// the address of each object by its name in the catalogue, those of the next block with
    /// `next-` before it, and `$number`.
    Block(Blocks),
}

impl Each {
    /// Whether it makes several instances where the device has several of what fits.
    pub(crate) fn is_of_several(&self) -> bool {
        match self {
            Self::Objects(Objects { most, .. }) | Self::Pdos(Pdos { most, .. }) => *most != Some(1),
            Self::Block(blocks) => blocks.at.len() != 1,
        }
    }
}

/// Which blocks of objects.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Blocks {
    /// The name of the block in the catalogue.
    pub name: At<String>,
    /// Numbers, counted from 1, and `last`; all unless said otherwise.
    #[serde(default)]
    pub at: Vec<At<BlockNumber>>,
    /// Also those that the data sheet does not have, to ask the device for them by frames.
    #[serde(default)]
    pub undeclared: bool,
    /// The PDO that each block comes with: the first one that fits. Binds the names of that PDO,
    /// too, but for `$number`.
    #[serde(default)]
    pub pdo: Option<Pdos>,
}

/// Which entries.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Objects {
    /// Access types, any of.
    #[serde(default)]
    pub access: Vec<At<AccessName>>,
    /// Range of indices, such as `1000..1FFF`.
    #[serde(default, rename = "in")]
    pub range: Option<At<String>>,
    /// Data types in CiA's names, any of, such as `unsigned16`.
    #[serde(default)]
    pub types: Vec<At<String>>,
    /// What the entry must state.
    #[serde(default)]
    pub has: Vec<Has>,
    /// Sub-indices, any of; sub-index 0 of objects with sub-indices is chosen by `0`.
    #[serde(default)]
    pub subs: Vec<u8>,
    /// Entries left out.
    #[serde(default)]
    pub except: Vec<At<ObjectRef>>,
    /// At most so many, spread over the dictionary.
    #[serde(default)]
    pub most: Option<usize>,
    /// Of these only the one with the longest value, the first of several.
    #[serde(default)]
    pub longest: bool,
    /// In `defaults`: another value is LENIENT where the data sheet has this object.
    #[serde(default)]
    pub unless: Option<At<ObjectRef>>,
    /// The PDO that each entry comes with: the first one that fits. Binds the names of that PDO,
    /// too.
    #[serde(default)]
    pub pdo: Option<Pdos>,
}

/// What an entry can state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Has {
    /// A lower limit above the smallest value of its type.
    Low,
    /// An upper limit below the largest value of its type.
    High,
    /// A default value.
    Default,
    /// Fixed length.
    Size,
    /// More than four bytes, by its type, as the device said when it was asked, or by default.
    Long,
    /// More than seven bytes, which is more than one segment.
    Segments,
    /// The right to be mapped into an RPDO.
    Rpdo,
    /// The right to be mapped into a TPDO.
    Tpdo,
    /// A place in the default mapping of a PDO. With `pdo` it comes with the first one that fits,
    /// maps it and has whole bytes for each object. Binds `$ahead` and `$behind` then, the bytes
    /// before and after it: the defaults of the other objects.
    Mapped,
    /// No right to be mapped.
    NotMappable,
    /// No right to be mapped into an RPDO.
    NotRpdo,
    /// No right to be mapped into a TPDO.
    NotTpdo,
    /// Nothing against being read in passing: bit 1 of `ObjFlags` is 0.
    Scan,
    /// Nothing against being written in passing: bit 0 of `ObjFlags` is 0.
    Download,
    /// The right to be written with anything: the data sheet states `ObjFlags` with bit 0 at 0, or
    /// the user allows it with `--free-to-write`. A DOMAIN of a data sheet that states nothing may
    /// be a firmware download.
    Free,
}

/// Access types of a data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AccessName {
    /// Read only.
    Ro,
    /// Write only.
    Wo,
    /// Read and write, whatever the process data direction.
    Rw,
    /// Constant.
    Const,
}

/// Which PDOs.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Pdos {
    /// `receive` for RPDOs, `transmit` for TPDOs.
    pub direction: DirectionName,
    /// Only PDOs whose COB-ID is valid by default and that map something.
    #[serde(default)]
    pub used: bool,
    /// Only PDOs that have these sub-indices in their communication parameter, to be written.
    #[serde(default)]
    pub with: Vec<u8>,
    /// What the PDO must have.
    #[serde(default)]
    pub has: Vec<PdoHas>,
    /// At most so many, the first ones.
    #[serde(default)]
    pub most: Option<usize>,
}

/// What a PDO can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PdoHas {
    /// A COB-ID, a transmission type and a mapping that can be written.
    Variable,
    /// A COB-ID and a transmission type that can be written, whatever the mapping.
    Settable,
    /// A mapping that cannot be written.
    Fixed,
    /// A COB-ID that allows remote requests.
    Rtr,
    /// A COB-ID that forbids them.
    NoRtr,
    /// A later PDO of its direction that is in use by default.
    Neighbour,
    /// A later PDO in use whose mapping can be written, too.
    VariableNeighbour,
    /// Gaps of eight bits, by the data type UNSIGNED8 (`Dummy0005` of the data sheet).
    Dummy,
    /// No event timer, or one that is 0 or can be written: nothing is transmitted without an event.
    Quiet,
    /// No sub-index 4 of its communication parameter, which was a compatibility entry in early
    /// editions.
    NoReserved,
}

/// The way of a PDO, seen from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DirectionName {
    /// RPDO.
    Receive,
    /// TPDO.
    Transmit,
}
