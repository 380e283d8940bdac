//! The length of values, where a data sheet leaves it open.

use std::collections::BTreeSet;

use canopen::eds::{Entry, Object};
use canopen::{Bus, BusError, Mux};

use runner::dut::Dut;
use runner::run::{Link, Policy, is_long};

/// The entries of variable length without a default value that do not fit into one frame. Each is
/// uploaded once to find out, except those that the data sheet says to leave alone.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn long_values(bus: &mut dyn Bus, dut: &Dut) -> Result<BTreeSet<Mux>, BusError> {
    let mut link = Link::new(bus);
    let policy = Policy::at_bit_rate(dut.bit_rate.unwrap_or(125_000));
    let asked = dut.eds.objects.iter().filter(|object| may_be_read(object));
    let asked = asked.flat_map(|object| &object.entries).filter(|entry| is_open(entry));
    let mut long = BTreeSet::new();
    for entry in asked.take(MOST) {
        if is_long(&mut link, &policy, dut.node, entry.mux)? {
            long.insert(entry.mux);
        }
        link.take_trace();
    }
    Ok(long)
}

/// More would take long, and a few are enough for every case.
const MOST: usize = 32;

/// Bit 1 of `ObjFlags` asks not to read it in passing.
fn may_be_read(object: &Object) -> bool {
    object.flags.unwrap_or_default() & 2 == 0
}

fn is_open(entry: &Entry) -> bool {
    entry.access.readable() && entry.data_type.size().is_none() && entry.default.is_none()
}
