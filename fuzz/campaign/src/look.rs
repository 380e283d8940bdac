//! A first look at a device: what its data sheet leaves open, and what somebody has stored in it.

use std::collections::BTreeMap;

use canopen::eds::{Eds, Term};
use canopen::pdo::{CobId, Mapping};
use canopen::{Id, Mux};
use reference_devices::stack::NodeSettings;

use crate::surface::FIRST_OF_APPLICATION;

/// The values of a device, as it told them.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// By address.
    pub values: BTreeMap<Mux, Vec<u8>>,
    /// Whether an error is present or was.
    pub errors: bool,
}

const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);
const HISTORY: Mux = Mux::new(0x1003, 0);

/// Reads what can be read, but for what the data sheet says not to read in passing. `read` gives
/// the value of an object, and nothing where the device has none to give.
///
/// # Errors
/// Those of `read`.
pub fn look<E>(
    eds: &Eds,
    mut read: impl FnMut(Mux) -> Result<Option<Vec<u8>>, E>,
) -> Result<Look, E> {
    let mut look = Look::default();
    let objects = eds.objects.iter().filter(|object| object.flags.unwrap_or_default() & 2 == 0);
    let entries = objects.flat_map(|object| &object.entries);
    for entry in entries.filter(|entry| entry.access.readable()) {
        look.values.extend(read(entry.mux)?.map(|value| (entry.mux, value)));
    }
    let is_set = |mux| look.values.get(&mux).is_some_and(|value| value.iter().any(|it| *it != 0));
    look.errors = is_set(ERROR_REGISTER) || is_set(HISTORY);
    Ok(look)
}

impl Look {
    /// The identifiers of the event-driven TPDOs that are valid and have no inhibit time, and what
    /// they hold.
    pub(crate) fn event_driven(&self) -> Vec<(Id, Vec<Mux>)> {
        let number = |index, sub| {
            let value = self.values.get(&Mux::new(index, sub))?;
            Some(value.iter().rev().fold(0_u32, |all, byte| all << 8 | u32::from(*byte)))
        };
        let tpdo = |index: u16| {
            let cob = CobId(number(index, 1)?);
            let free = number(index, 3).unwrap_or(0) == 0 && number(index, 2)? >= 254;
            let count = number(index + 0x200, 0)?.min(64) as u8;
            let words = (1..=count).map(|sub| number(index + 0x200, sub));
            let mapped = words.map(|word| Some(Mapping::decode(word?).mux));
            (cob.valid() && free).then_some((cob.can_id(), mapped.collect::<Option<_>>()?))
        };
        (0x1800..=0x19FF).filter_map(tpdo).collect()
    }

    /// The data sheet and the settings of a device with these values: what the application shows,
    /// texts that the data sheet leaves out, and parameters that somebody has stored.
    #[must_use]
    pub fn amend(&self, eds: &Eds, node: u8, settings: &NodeSettings) -> (Eds, NodeSettings) {
        let (mut eds, mut settings) = (eds.clone(), settings.clone());
        for entry in eds.objects.iter_mut().flat_map(|object| &mut object.entries) {
            let Some(bytes) = self.values.get(&entry.mux) else { continue };
            let Ok(value) = entry.data_type.decode(bytes) else { continue };
            let is_given = entry.default.is_some();
            let of_application = entry.mux.index >= FIRST_OF_APPLICATION;
            if of_application || !is_given && !STATES.contains(&entry.mux.index) {
                entry.default = Some(Term::fixed(value));
            } else if entry.access.writable()
                && !STATES.contains(&entry.mux.index)
                && let Some(number) = value.as_int().and_then(|it| i64::try_from(it).ok())
                && entry.default_bytes(node).is_ok_and(|default| default != *bytes)
            {
                settings.stored.insert(entry.mux, number);
            }
        }
        (eds, settings)
    }
}

/// Objects that show a state or take a command, and keep no value.
const STATES: [u16; 6] = [0x1001, 0x1002, 0x1003, 0x1010, 0x1011, 0x1013];
