//! The process data objects of a device: as in the data sheet, and as configured since.

use std::collections::BTreeMap;

use super::layout::{PdoLayout, is_parameter};
use super::transfer::Whole;
use crate::frame::Id;
use crate::mux::Mux;
use crate::pdo::{CobId, Mapping};

/// The parameters of the process data objects of a device.
#[derive(Debug)]
pub(super) struct Process {
    /// By the data sheet.
    factory: BTreeMap<Mux, u32>,
    /// The values that are in force after the next start.
    stored: BTreeMap<Mux, u32>,
    /// The values in force now.
    now: BTreeMap<Mux, u32>,
}

/// A process data object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Such as `TPDO1`.
    pub name: String,
    /// The index of its communication parameter.
    pub parameter: u16,
    /// The mapped objects.
    pub mapping: Vec<Mapping>,
}

impl Process {
    pub(super) fn of(node: u8, layout: &PdoLayout) -> Self {
        let parameters = layout.parameters.iter();
        let factory: BTreeMap<Mux, u32> =
            parameters.map(|(mux, default)| (*mux, default.resolve(node))).collect();
        Self { stored: factory.clone(), now: factory.clone(), factory }
    }

    /// An object of the device was written, or its value was read.
    pub(super) fn learn(&mut self, whole: &Whole) {
        let Whole { mux, value, written, .. } = whole;
        match (mux.index, written, &value[..]) {
            (STORE, true, b"save") if mux.sub <= 2 => self.stored = self.now.clone(),
            (LOAD, true, b"load") if mux.sub <= 2 => self.stored = self.factory.clone(),
            _ if is_parameter(*mux) && value.len() <= 4 => {
                let value = value.iter().rev().fold(0, |all, byte| all << 8 | u32::from(*byte));
                self.now.insert(*mux, value);
            }
            _ => {}
        }
    }

    /// The device has restarted.
    pub(super) fn restart(&mut self) {
        self.now = self.stored.clone();
    }

    /// The object with an identifier, when the device has it now.
    pub(super) fn carried(&self, wanted: Id) -> Option<Pdo> {
        let of_frame = |(mux, cob_id): &(&Mux, &u32)| {
            let cob_id = CobId(**cob_id);
            is_communication(mux.index)
                && mux.sub == 1
                && cob_id.valid()
                && cob_id.can_id() == wanted
        };
        let (mux, _) = self.now.iter().find(of_frame)?;
        let name = match mux.index {
            0x1800.. => format!("TPDO{}", mux.index - 0x17FF),
            _ => format!("RPDO{}", mux.index - 0x13FF),
        };
        let words = |sub| self.now.get(&Mux::new(mux.index + 0x200, sub)).copied();
        let count = words(0).unwrap_or(0).min(64) as u8;
        let words = (1..=count).filter_map(words);
        let mapping = words.map(Mapping::decode).collect();
        Some(Pdo { name, parameter: mux.index, mapping })
    }
}

const fn is_communication(index: u16) -> bool {
    matches!(index, 0x1400..=0x15FF | 0x1800..=0x19FF)
}

const STORE: u16 = 0x1010;
const LOAD: u16 = 0x1011;
