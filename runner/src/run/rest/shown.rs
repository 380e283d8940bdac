//! The NMT state of the device, as its heartbeat shows it. A device without a heartbeat, or with a
//! slow one, gets another one for a moment.

use std::collections::BTreeSet;
use std::time::Duration;

use canopen::heartbeat;
use canopen::nmt::NmtState;
use canopen::{BusError, Mux};

use super::address::Address;
use super::restore::Snapshot;
use super::undo::Undo;
use crate::dut::Dut;
use crate::protect::Deed;
use crate::run::link::{Link, sdo};
use crate::run::policy::Policy;

/// The state in the last heartbeat of some; `None` when there is none, and the producer heartbeat
/// time cannot be written or must not be.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn shown_state(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    undo: &Undo,
) -> Result<Option<NmtState>, BusError> {
    let writable = dut.eds.entry(PRODUCER).is_some_and(|entry| entry.access.writable());
    let protected = dut.protection.refuses(Deed::Write(PRODUCER, None)).is_some();
    let before = sdo::upload(link, policy, dut.node, PRODUCER)?.result.ok();
    let Some(before) = before.filter(|before| before.len() == 2) else { return Ok(None) };
    let produced =
        (1..=PERIOD.as_millis() as u16).contains(&u16::from_le_bytes([before[0], before[1]]));
    if !writable || protected || produced {
        return watched(link, policy, dut);
    }
    let mut snapshot = Snapshot::default();
    snapshot.values.insert(PRODUCER, before);
    if undo.begin(&mut snapshot) {
        link.look_from_now()?;
    }
    let time = (PERIOD.as_millis() as u16).to_le_bytes();
    let flow = canopen::sdo::Transfer::Expedited;
    let written = sdo::download(link, policy, dut.node, PRODUCER, &time, flow)?.result.is_ok();
    let state = if written { watched(link, policy, dut)? } else { None };
    let mut changed = BTreeSet::from([PRODUCER]);
    snapshot.restore(link, policy, dut.node, &mut changed)?;
    undo.end(&snapshot, &changed, Address::AsBefore);
    Ok(state)
}

/// The state in the last heartbeat that comes in the time of a few.
fn watched(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Option<NmtState>, BusError> {
    let id = heartbeat::COB_ID + u16::from(dut.node);
    let until = link.mark() + PERIOD * 3 + policy.slow_wire;
    let mut last = None;
    while let Some(seen) = link.find(until, |seen| !seen.own && seen.frame.data_id() == Some(id))? {
        last = seen.frame.data.first().map(|state| NmtState(state & !TOGGLE)).or(last);
    }
    link.skip_to(until);
    // A boot-up message says nothing about the state after it.
    Ok(last.filter(|state| *state != NmtState::INITIALISING))
}

const PRODUCER: Mux = Mux::new(0x1017, 0);
/// The bit that alternates in the answers to node guarding.
const TOGGLE: u8 = 0x80;
/// As long as any producer can do, and short for one that starts.
const PERIOD: Duration = Duration::from_millis(100);
