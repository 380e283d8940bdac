//! The lengths of values, where the data type leaves them open.

use std::collections::BTreeMap;

use canopen::eds::{Entry, Object};
use canopen::{Bus, BusError, Mux};

use runner::dut::Dut;
use runner::run::{Link, Policy, value_length};

/// How many bytes the values of variable length have that can be read, as far as the device says.
/// Each is asked for once, except those that the data sheet says to leave alone.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn value_lengths(
    bus: &mut dyn Bus,
    dut: &Dut,
) -> Result<BTreeMap<Mux, usize>, BusError> {
    let mut link = Link::new(bus);
    let policy = Policy::at_bit_rate(dut.bit_rate.unwrap_or(125_000));
    let asked = dut.eds.objects.iter().filter(|object| may_be_read(object));
    let asked = asked.flat_map(|object| &object.entries).filter(|entry| is_open(entry));
    let mut lengths = BTreeMap::new();
    for entry in asked.take(MOST) {
        if let Some(length) = value_length(&mut link, &policy, dut.node, entry.mux)? {
            lengths.insert(entry.mux, length);
        }
        link.take_trace();
    }
    Ok(lengths)
}

/// More would take long, and a few are enough for every case.
const MOST: usize = 32;

/// Bit 1 of `ObjFlags` asks not to read it in passing.
fn may_be_read(object: &Object) -> bool {
    object.flags.unwrap_or_default() & 2 == 0
}

fn is_open(entry: &Entry) -> bool {
    entry.access.readable() && entry.data_type.size().is_none()
}
