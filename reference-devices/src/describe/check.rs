//! Conditions that a sheet must meet before a device can be made of it.

use canopen::Mux;
use canopen::eds::{Direction, Eds, Entry, Object, Term};

use super::wrong::Wrong;

/// Every default value lies within the limits of its entry.
pub(super) fn values(eds: &Eds, wrong: &mut Vec<Wrong>) {
    for entry in eds.entries() {
        let real =
            |term: &Option<Term>, node| term.as_ref().and_then(|term| term.resolve(node).as_real());
        let mux = entry.mux;
        for node in [1, 127] {
            let Some(default) = real(&entry.default, node) else { continue };
            let low = real(&entry.low, node).filter(|low| default < *low);
            let high = real(&entry.high, node).filter(|high| default > *high);
            let message = match (low, high) {
                (Some(low), _) => format!("{mux}: the default value {default} lies below {low}"),
                (_, Some(high)) => format!("{mux}: the default value {default} lies above {high}"),
                _ => continue,
            };
            wrong.push(Wrong::value(mux, "value", message));
            break;
        }
    }
}

/// Every prepared mapping entry names a value that may be mapped that way with its own length,
/// and those in use fit a frame.
pub(super) fn mappings(eds: &Eds, wrong: &mut Vec<Wrong>) {
    for object in &eds.objects {
        let direction = match object.index {
            0x1600..=0x17FF => Direction::Receive,
            0x1A00..=0x1BFF => Direction::Transmit,
            _ => continue,
        };
        let in_use = object.entry(0).map_or(0, number);
        let mut bits = 0;
        for entry in &object.entries {
            if entry.mux.sub == 0 || number(entry) == 0 {
                continue;
            }
            match mapped(eds, entry, direction) {
                Ok(length) if i128::from(entry.mux.sub) <= in_use => bits += length,
                Ok(_) => {}
                Err(why) => wrong.push(why),
            }
        }
        if bits > 64 {
            let index = object.index;
            let message = format!("{index:04X} maps {bits} bits, a PDO has 64");
            wrong.push(Wrong::object(index, message));
        }
        wrong.extend(check_count(object, in_use).err());
    }
}

fn check_count(object: &Object, in_use: i128) -> Result<(), Wrong> {
    let set = object.entries.iter().filter(|entry| entry.mux.sub != 0 && number(entry) != 0);
    if in_use > set.count() as i128 {
        let count = Mux::new(object.index, 0);
        let message = format!("{count} counts {in_use} entries, fewer are set");
        return Err(Wrong::value(count, "value", message));
    }
    Ok(())
}

/// The length in bits of what a mapping entry names.
fn mapped(eds: &Eds, entry: &Entry, direction: Direction) -> Result<u32, Wrong> {
    let [bits, sub, low, high] = (number(entry) as u32).to_le_bytes();
    let target = Mux::new(u16::from_le_bytes([low, high]), sub);
    let wrong = |why: &str| {
        let mux = entry.mux;
        Wrong::value(mux, "value", format!("{mux} maps {target}, {why}"))
    };
    let found = eds.entry(target).ok_or_else(|| wrong("which does not exist"))?;
    if !found.maps_into(direction) {
        return Err(wrong("which must not be mapped this way"));
    }
    if found.data_type.size().map(|bytes| 8 * bytes) != Some(usize::from(bits)) {
        return Err(wrong("which has another length"));
    }
    Ok(bits.into())
}

fn number(entry: &Entry) -> i128 {
    entry.default.as_ref().and_then(|term| term.resolve(1).as_int()).unwrap_or(0)
}
