//! The content of an electronic data sheet (CiA 306).

use std::fmt;

use crate::mux::Mux;
use crate::value::{DataType, Value, ValueError};

/// An electronic data sheet: the description of one kind of device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Eds {
    /// Section `[FileInfo]`.
    pub file: FileInfo,
    /// Section `[DeviceInfo]`.
    pub device: DeviceInfo,
    /// Dummy objects (0001h to 0007h) that may fill gaps in an RPDO, section `[DummyUsage]`.
    pub dummies: Vec<u16>,
    /// Lines of section `[Comments]`.
    pub comments: Vec<String>,
    /// The objects, by ascending index.
    pub objects: Vec<Object>,
    /// Sections and keys that have no place here, and values that could not be understood, kept
    /// so that writing loses nothing. Ordered like the sections of a file.
    pub unknown: Vec<UnknownSection>,
}

/// About the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileInfo {
    /// File name.
    pub name: String,
    /// Version of the file.
    pub version: u32,
    /// Revision of the file.
    pub revision: u32,
    /// Version of CiA 306 it follows, such as `4.0`.
    pub eds_version: String,
    /// The purpose of the file.
    pub description: String,
    /// Time of creation, as written.
    pub creation_time: String,
    /// Date of creation, as written.
    pub creation_date: String,
    /// Its author.
    pub created_by: String,
    /// Time of the last change, as written.
    pub modification_time: String,
    /// Date of the last change, as written.
    pub modification_date: String,
    /// The author of the last change.
    pub modified_by: String,
}

/// About the device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Name of the vendor.
    pub vendor_name: String,
    /// Vendor number of object 1018:01.
    pub vendor_number: u32,
    /// Name of the product.
    pub product_name: String,
    /// Product code of object 1018:02.
    pub product_number: u32,
    /// Revision number of object 1018:03.
    pub revision_number: u32,
    /// Order code.
    pub order_code: String,
    /// Bit rates that can be set, in kbit/s.
    pub bit_rates: Vec<u32>,
    /// Whether the device can be the simple boot-up master.
    pub boot_up_master: bool,
    /// Whether it can be a slave.
    pub boot_up_slave: bool,
    /// Smallest mappable unit in bits; 0 when mapping cannot be changed.
    pub granularity: u8,
    /// Whether multiplexed PDOs are supported.
    pub group_messaging: bool,
    /// How many RPDOs there are.
    pub rpdo_count: u16,
    /// How many TPDOs there are.
    pub tpdo_count: u16,
    /// Whether the layer setting services are supported.
    pub lss: bool,
}

/// One object.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Name.
    pub name: String,
    /// Object code.
    pub kind: ObjectKind,
    /// `ObjFlags`: bit 0 refuse on write of a configuration, bit 1 refuse on scan; `None` when the
    /// sheet does not state them, which counts as 0.
    pub flags: Option<u32>,
    /// Its values by ascending sub-index; a variable has just sub-index 0.
    pub entries: Vec<Entry>,
    /// Line of its section, counted from 1; 0 when it comes from no file.
    pub line: usize,
}

/// One value of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Address.
    pub mux: Mux,
    /// Name.
    pub name: String,
    /// Data type.
    pub data_type: DataType,
    /// Access over the network: read, write, or both.
    pub access: Access,
    /// Whether it may be mapped into a PDO. [`Entry::maps_into`] also asks the access type.
    pub mappable: bool,
    /// Value after power-on of a device that stored nothing; `None` when the sheet names none.
    pub default: Option<Term>,
    /// Smallest value.
    pub low: Option<Term>,
    /// Largest value.
    pub high: Option<Term>,
    /// Line of its section, counted from 1; 0 when it comes from no file.
    pub line: usize,
}

/// A value that may depend on the node id.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The value, or what is added to the node id.
    pub value: Value,
    /// Whether the node id is added.
    pub plus_node: bool,
}

/// A section that has no place in an [`Eds`], or such keys of one that has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownSection {
    /// Name between the brackets.
    pub name: String,
    /// Its keys and values in order.
    pub keys: Vec<(String, String)>,
}

/// Object code (CiA 301, 7.4.3). Unknown ones are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct ObjectKind(pub u8);

impl ObjectKind {
    /// A large amount of data without structure.
    pub const DOMAIN: Self = Self(2);
    /// A data type definition.
    pub const DEFTYPE: Self = Self(5);
    /// A record type definition.
    pub const DEFSTRUCT: Self = Self(6);
    /// A single value.
    pub const VAR: Self = Self(7);
    /// Values of one type.
    pub const ARRAY: Self = Self(8);
    /// Values of different types.
    pub const RECORD: Self = Self(9);

    /// Whether values are addressed by sub-index.
    pub const fn has_subs(self) -> bool {
        matches!(self, Self::ARRAY | Self::RECORD | Self::DEFSTRUCT)
    }
}

impl fmt::Debug for ObjectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::DOMAIN => f.write_str("DOMAIN"),
            Self::DEFTYPE => f.write_str("DEFTYPE"),
            Self::DEFSTRUCT => f.write_str("DEFSTRUCT"),
            Self::VAR => f.write_str("VAR"),
            Self::ARRAY => f.write_str("ARRAY"),
            Self::RECORD => f.write_str("RECORD"),
            Self(code) => write!(f, "object code {code}"),
        }
    }
}

/// Access type (CiA 306, AccessType; CiA 311 has one more).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Read only.
    Ro,
    /// Write only.
    Wo,
    /// Read and write.
    Rw,
    /// Read and write; as process data it is read, thus for TPDOs.
    Rwr,
    /// Read and write; as process data it is written, thus for RPDOs.
    Rww,
    /// Read only and never changing.
    Const,
    /// Neither read nor written by an SDO, thus process data at most (`noAccess` of CiA 311).
    None,
}

impl Access {
    /// Every access type of CiA 306.
    pub const ALL: [Self; 6] = [Self::Ro, Self::Wo, Self::Rw, Self::Rwr, Self::Rww, Self::Const];

    /// The name in a data sheet.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ro => "ro",
            Self::Wo => "wo",
            Self::Rw => "rw",
            Self::Rwr => "rwr",
            Self::Rww => "rww",
            Self::Const => "const",
            Self::None => "noAccess",
        }
    }

    /// The access type of CiA 306 with that name, in small letters.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|access| access.name() == name)
    }

    /// Whether an SDO upload is allowed.
    pub const fn readable(self) -> bool {
        !matches!(self, Self::Wo | Self::None)
    }

    /// Whether an SDO download is allowed.
    pub const fn writable(self) -> bool {
        !matches!(self, Self::Ro | Self::Const | Self::None)
    }

    /// Whether PDOs of that direction may carry such a value: an RPDO writes it, a TPDO reads it.
    pub const fn fits(self, direction: Direction) -> bool {
        match direction {
            Direction::Receive => matches!(self, Self::Wo | Self::Rw | Self::Rww | Self::None),
            Direction::Transmit => !matches!(self, Self::Wo | Self::Rww),
        }
    }
}

/// Which way a PDO goes, seen from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// RPDO: the device receives it.
    Receive,
    /// TPDO: the device transmits it.
    Transmit,
}

impl Entry {
    /// Whether the entry may be mapped into a PDO of that direction: it must be mappable, and the
    /// access type must allow to write it (RPDO) or to read it (TPDO), or be for PDOs alone.
    pub const fn maps_into(&self, direction: Direction) -> bool {
        self.mappable && self.access.fits(direction)
    }

    /// The default value's bytes for a node id; zeros of the type's length when the sheet names
    /// none, and nothing for types of variable length.
    ///
    /// # Errors
    /// When the default value is not one of the entry's type.
    pub fn default_bytes(&self, node: u8) -> Result<Vec<u8>, ValueError> {
        match &self.default {
            Some(term) => self.data_type.encode(&term.resolve(node)),
            None => Ok(vec![0; self.data_type.size().unwrap_or(0)]),
        }
    }
}

impl Term {
    /// A value that does not depend on the node id.
    pub const fn fixed(value: Value) -> Self {
        Self { value, plus_node: false }
    }

    /// The value for a node id.
    pub fn resolve(&self, node: u8) -> Value {
        match (&self.value, self.plus_node) {
            (Value::Int(offset), true) => Value::Int(offset + i128::from(node)),
            (value, _) => value.clone(),
        }
    }
}

impl Eds {
    /// The object at `index`.
    pub fn object(&self, index: u16) -> Option<&Object> {
        let place = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        Some(&self.objects[place])
    }

    /// The entry at `mux`.
    pub fn entry(&self, mux: Mux) -> Option<&Entry> {
        self.object(mux.index)?.entry(mux.sub)
    }

    /// All entries by ascending address.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.objects.iter().flat_map(|object| &object.entries)
    }

    /// The same description without line numbers, to compare descriptions of different files.
    pub fn without_lines(mut self) -> Self {
        for object in &mut self.objects {
            object.line = 0;
            for entry in &mut object.entries {
                entry.line = 0;
            }
        }
        self
    }
}

impl Object {
    /// The entry with that sub-index.
    pub fn entry(&self, sub: u8) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.mux.sub == sub)
    }
}
