//! What must hold of a sheet before a device can be made of it.

use canopen::Mux;
use canopen::eds::{Direction, Eds, Entry, Object};

use super::DescribeError;

/// Every default value lies within the limits of its entry.
pub(super) fn values(eds: &Eds) -> Result<(), DescribeError> {
    for entry in eds.entries() {
        let real = |term: &Option<canopen::eds::Term>| {
            term.as_ref().and_then(|term| term.resolve(1).as_real())
        };
        let (Some(default), mux) = (real(&entry.default), entry.mux) else { continue };
        if let Some(low) = real(&entry.low).filter(|low| default < *low) {
            return Err(DescribeError(format!("{mux}: default {default} lies below {low}")));
        }
        if let Some(high) = real(&entry.high).filter(|high| default > *high) {
            return Err(DescribeError(format!("{mux}: default {default} lies above {high}")));
        }
    }
    Ok(())
}

/// Every prepared mapping entry names a value that may be mapped that way with its own length,
/// and those in use fit a frame.
pub(super) fn mappings(eds: &Eds) -> Result<(), DescribeError> {
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
            let length = mapped(eds, entry, direction)?;
            if i128::from(entry.mux.sub) <= in_use {
                bits += length;
            }
        }
        if bits > 64 {
            let index = object.index;
            return Err(DescribeError(format!("{index:04X} maps {bits} bits, a PDO has 64")));
        }
        check_count(object, in_use)?;
    }
    Ok(())
}

fn check_count(object: &Object, in_use: i128) -> Result<(), DescribeError> {
    let set = object.entries.iter().filter(|entry| entry.mux.sub != 0 && number(entry) != 0);
    if in_use > set.count() as i128 {
        let count = Mux::new(object.index, 0);
        return Err(DescribeError(format!("{count} counts {in_use} entries, fewer are set")));
    }
    Ok(())
}

/// The length in bits of what a mapping entry names.
fn mapped(eds: &Eds, entry: &Entry, direction: Direction) -> Result<u32, DescribeError> {
    let [bits, sub, low, high] = (number(entry) as u32).to_le_bytes();
    let target = Mux::new(u16::from_le_bytes([low, high]), sub);
    let wrong = |why: &str| {
        let mux = entry.mux;
        DescribeError(format!("{mux} maps {target}, {why}"))
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
