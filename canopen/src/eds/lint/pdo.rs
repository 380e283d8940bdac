//! PDOs: parameters that belong together, identifiers, default mappings.

use std::collections::HashMap;

use super::{DEFAULT, Lint};
use crate::eds::codes;
use crate::eds::ini::Name;
use crate::eds::model::{Access, Direction, Entry, Object, Term};
use crate::mux::Mux;
use crate::pdo::{CobId, Mapping, holds_cob_id, is_restricted};
use crate::source::Place;
use crate::value::{DataType, Value};

/// One direction of process data.
#[derive(Clone, Copy)]
struct Pdos {
    direction: Direction,
    name: &'static str,
    /// Index of the first communication parameter; that of the mapping is 200h higher.
    first: u16,
    /// Key of the device's section that counts them.
    count_key: &'static str,
    /// The offset that is added to the node id for the first PDO; 100h more for each of the next
    /// three.
    cob_id: u16,
}

impl<'e> Lint<'e, '_, '_> {
    pub(super) fn pdos(&mut self) {
        for pdos in [RPDOS, TPDOS] {
            self.pdo_count(pdos);
            for object in self.in_range(pdos.first) {
                self.pdo_pair(object, object.index + 0x200);
                self.communication(pdos, object);
            }
            for object in self.in_range(pdos.first + 0x200) {
                self.pdo_pair(object, object.index - 0x200);
                self.mapping(pdos, object);
            }
        }
        self.cob_ids();
    }

    fn pdo_count(&mut self, pdos: Pdos) {
        let stated = match pdos.direction {
            Direction::Receive => self.eds.device.rpdo_count,
            Direction::Transmit => self.eds.device.tpdo_count,
        };
        let there_are = self.in_range(pdos.first).len();
        if usize::from(stated) != there_are {
            let at = self.place(Name::DeviceInfo, Some(pdos.count_key));
            let at = at.or_else(|| self.place(Name::DeviceInfo, None)).unwrap_or(Place::new(1, 1));
            let message = format!("{} is {stated} instead of {there_are}", pdos.count_key);
            self.findings.add(&codes::PDO_COUNT, at, message);
        }
    }

    fn pdo_pair(&mut self, object: &Object, other: u16) {
        if self.eds.object(other).is_none() {
            let message = format!("object {:04X}h has no counterpart {other:04X}h", object.index);
            self.add(&codes::PDO_PAIR, object, message);
        }
    }

    fn communication(&mut self, pdos: Pdos, object: &Object) {
        for (sub, data_type) in COMMUNICATION {
            match object.entry(sub) {
                Some(entry) if entry.data_type != data_type => {
                    let message =
                        format!("{} is {} instead of {data_type}", entry.mux, entry.data_type);
                    self.add_at(&codes::PDO_ENTRY, entry, "DataType", message);
                }
                None if sub <= 2 => {
                    let message = format!("{} is missing", Mux::new(object.index, sub));
                    self.add(&codes::PDO_ENTRY, object, message);
                }
                _ => {}
            }
        }
        if let Some(entry) = object.entry(4) {
            let message = format!("{} is reserved", entry.mux);
            self.add_at(&codes::PDO_RESERVED, entry, "ParameterName", message);
        }
        if let Some(entry) = object.entry(2)
            && let Some(number) = self.fixed(entry.mux)
        {
            let wrong = match pdos.direction {
                Direction::Receive => (241..=253).contains(&number),
                Direction::Transmit => (241..=251).contains(&number),
            };
            if wrong {
                let message =
                    format!("{}: {number} is not a transmission type of {}s", entry.mux, pdos.name);
                self.add_at(&codes::TRANSMISSION_TYPE, entry, DEFAULT, message);
            }
        }
        self.predefined(pdos, object);
    }

    /// Whether one of the first four PDOs has the identifier of the predefined connection set.
    fn predefined(&mut self, pdos: Pdos, object: &Object) {
        let number = object.index - pdos.first;
        let Some(entry) = object.entry(1).filter(|_| number < 4) else { return };
        let Some(Term { value: Value::Int(value), plus_node }) = &entry.default else { return };
        let (cob_id, expected) = (CobId(*value as u32), pdos.cob_id + 0x100 * number);
        if cob_id.valid() && !(*plus_node && cob_id.can_id() == expected.into()) {
            let message =
                format!("{}: the default identifier is usually $NODEID+0x{expected:X}", entry.mux);
            self.add_at(&codes::COB_ID_PREDEFINED, entry, DEFAULT, message);
        }
    }

    fn mapping(&mut self, pdos: Pdos, object: &Object) {
        let entries = || object.entries.iter().filter(|entry| (1..=64).contains(&entry.mux.sub));
        let value = |entry: &Entry| match &entry.default {
            Some(Term { value: Value::Int(number), plus_node: false }) => *number as u32,
            _ => 0,
        };
        let set = entries().take_while(|entry| value(entry) != 0).count() as u8;
        let count = match self.fixed(Mux::new(object.index, 0)) {
            None => set,
            // Multiplexed PDOs map nothing.
            Some(254 | 255) => 0,
            Some(count) => u8::try_from(count).unwrap_or(u8::MAX),
        };
        if let Some(sub0) = object.entry(0).filter(|_| count > set) {
            let message = format!(
                "{} is {count}, but the number of entries that map an object is {set}",
                sub0.mux
            );
            self.add_at(&codes::MAPPING_COUNT, sub0, DEFAULT, message);
        }
        if let Some(spare) = entries().find(|entry| entry.mux.sub > count && value(entry) != 0) {
            let message = format!(
                "{} maps an object, but the number of mapped objects is {count}",
                spare.mux
            );
            self.add_at(&codes::MAPPING_SPARE, spare, DEFAULT, message);
        }
        let mut bits = 0;
        for entry in entries().take(usize::from(count)).filter(|entry| value(entry) != 0) {
            let mapping = Mapping::decode(value(entry));
            self.mapped(pdos, entry, mapping);
            bits += u32::from(mapping.bits);
            if bits > 64 {
                let message = format!("{}: the PDO has {bits} bits with this entry", entry.mux);
                return self.add_at(&codes::MAPPING_SUM, entry, DEFAULT, message);
            }
        }
    }

    fn mapped(&mut self, pdos: Pdos, at: &Entry, mapping: Mapping) {
        let Mapping { mux, bits } = mapping;
        if mux.index < FIRST_OBJECT {
            let known = self.eds.dummies.contains(&mux.index);
            if !known || pdos.direction == Direction::Transmit {
                let message = format!(
                    "{}: dummy object {:04X}h cannot be mapped into this PDO",
                    at.mux, mux.index
                );
                self.add_at(&codes::MAPPING_OBJECT, at, DEFAULT, message);
            }
            return;
        }
        let Some(entry) = self.eds.entry(mux) else {
            // A device that has more modules has it.
            if self.origin.of_modules.contains(&mux.index) {
                return;
            }
            let message = format!("{}: the mapped object {mux} does not exist", at.mux);
            return self.add_at(&codes::MAPPING_OBJECT, at, DEFAULT, message);
        };
        if !entry.mappable {
            let message = format!("{}: the mapped object {mux} has PDOMapping=0", at.mux);
            self.add_at(&codes::MAPPING_ACCESS, at, DEFAULT, message);
        } else if !entry.maps_into(pdos.direction) {
            let (at_mux, name) = (at.mux, pdos.name);
            let message = match entry.access {
                Access::Rwr | Access::Rww if self.origin.is_xml => format!(
                    "{at_mux}: {mux} is not for {name}s, by its PDOmapping or the access of its \
                     parameter"
                ),
                other => format!(
                    "{at_mux}: {mux} has access type {}, which is not for {name}s",
                    other.name()
                ),
            };
            self.add_at(&codes::PDO_DIRECTION, at, DEFAULT, message);
        }
        let size = entry.data_type.size().map(|size| 8 * size);
        let boolean = entry.data_type == DataType::BOOLEAN && bits == 1;
        if let Some(size) = size
            && size != usize::from(bits)
            && !boolean
        {
            let message = format!("{}: {mux} has {size} bits, but {bits} are mapped", at.mux);
            self.add_at(&codes::MAPPING_LENGTH, at, DEFAULT, message);
        }
    }

    /// Identifiers of all services: each once, none that CiA 301 keeps for another one, and each of
    /// more than 11 bits with bit 29 (CiA 301, 7.5.2.35).
    fn cob_ids(&mut self) {
        let mut seen = HashMap::new();
        for object in &self.eds.objects {
            // A client has the identifiers of servers elsewhere.
            if (0x1280..0x1300).contains(&object.index) {
                continue;
            }
            for entry in object.entries.iter().filter(|entry| holds_cob_id(entry.mux)) {
                let Some(Term { value: Value::Int(value), plus_node }) = &entry.default else {
                    continue;
                };
                let cob_id = CobId(*value as u32);
                // In 1005h and 1012h bit 31 has another meaning.
                if object.index > 0x1012 && !cob_id.valid() {
                    continue;
                }
                if cob_id.stray_bits() != 0 {
                    let message = format!(
                        "{}: the default identifier has more than 11 bits, and bit 29 is 0",
                        entry.mux
                    );
                    self.add_at(&codes::COB_ID_LENGTH, entry, DEFAULT, message);
                    continue;
                }
                if restricted(object.index, cob_id, *plus_node) {
                    let message =
                        format!("{}: the default identifier is restricted by CiA 301", entry.mux);
                    self.add_at(&codes::COB_ID_RESTRICTED, entry, DEFAULT, message);
                }
                if let Some(first) = seen.insert((cob_id.can_id(), *plus_node), entry.mux) {
                    let message =
                        format!("{} has the same default identifier as {first}", entry.mux);
                    self.add_at(&codes::COB_ID_DUPLICATE, entry, DEFAULT, message);
                }
            }
        }
    }

    fn in_range(&self, first: u16) -> &'e [Object] {
        let objects = &self.eds.objects;
        let start = objects.partition_point(|object| object.index < first);
        let end = objects.partition_point(|object| object.index < first + 0x200);
        &objects[start..end]
    }
}

fn restricted(index: u16, cob_id: CobId, plus_node: bool) -> bool {
    // The identifiers of SDO are reserved for SDO.
    let mut nodes = if plus_node { 1..=127 } else { 0..=0 };
    !(0x1200..0x1300).contains(&index)
        && nodes.any(|node| is_restricted(CobId(cob_id.0.wrapping_add(node)).can_id()))
}

const RPDOS: Pdos = Pdos {
    direction: Direction::Receive,
    name: "RPDO",
    first: 0x1400,
    count_key: "NrOfRXPDO",
    cob_id: 0x200,
};

const TPDOS: Pdos = Pdos {
    direction: Direction::Transmit,
    name: "TPDO",
    first: 0x1800,
    count_key: "NrOfTXPDO",
    cob_id: 0x180,
};

/// Subs of a communication parameter; the first two must be there.
const COMMUNICATION: [(u8, DataType); 6] = [
    (1, DataType::UNSIGNED32),
    (2, DataType::UNSIGNED8),
    (3, DataType::UNSIGNED16),
    (4, DataType::UNSIGNED8),
    (5, DataType::UNSIGNED16),
    (6, DataType::UNSIGNED8),
];

/// Below are data types, which fill gaps in RPDOs.
const FIRST_OBJECT: u16 = 0x1000;
