//! The NMT state of the device, as its heartbeat shows it. A device without a heartbeat, or with a
//! slow one, gets another one for a moment; one that takes none is asked by node guarding.

use std::collections::BTreeSet;
use std::time::Duration;

use canopen::heartbeat;
use canopen::nmt::NmtState;
use canopen::{BusError, Frame, Mux};

use super::address::Address;
use super::restore::Snapshot;
use super::undo::Undo;
use crate::dut::Dut;
use crate::protect::Deed;
use crate::run::link::{Link, sdo};
use crate::run::policy::Policy;

/// The state in the last heartbeat of some, or in the answer to node guarding; `None` when there is
/// none.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn shown_state(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    undo: &Undo,
) -> Result<Option<NmtState>, BusError> {
    let state = in_heartbeat(link, policy, dut, undo)?;
    if state.is_some() || is_guarded(link, policy, dut)? {
        return Ok(state);
    }
    let id = heartbeat::COB_ID + u16::from(dut.node);
    link.send(&Frame::remote(id, 1))?;
    watched(link, dut, PERIOD + policy.slow_wire)
}

/// Whether a request of node guarding may begin life guarding, and so an error when no other one
/// follows.
fn is_guarded(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    for mux in LIFE_GUARDING {
        let value = sdo::upload(link, policy, dut.node, mux)?.result;
        // What cannot be read is not there, and life guarding needs both.
        if value.is_ok_and(|value| value.iter().any(|byte| *byte != 0)) {
            continue;
        }
        return Ok(false);
    }
    Ok(true)
}

fn in_heartbeat(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    undo: &Undo,
) -> Result<Option<NmtState>, BusError> {
    let writable = dut.eds.entry(PRODUCER).is_some_and(|entry| entry.access.writable());
    let protected = dut.protection.refuses(Deed::Write(PRODUCER, None)).is_some();
    let before = sdo::upload(link, policy, dut.node, PRODUCER)?.result.ok();
    let Some(before) = before.filter(|before| before.len() == 2) else { return Ok(None) };
    let own = Duration::from_millis(u16::from_le_bytes([before[0], before[1]]).into());
    let some = |period: Duration| period * 3 + policy.slow_wire;
    if !writable || protected {
        return watched(link, dut, some(PERIOD.max(own.min(LONGEST))));
    }
    if !own.is_zero() && own <= PERIOD {
        return watched(link, dut, some(PERIOD));
    }
    let mut snapshot = Snapshot::default();
    snapshot.values.insert(PRODUCER, before);
    if undo.begin(&mut snapshot) {
        link.look_from_now()?;
    }
    let time = (PERIOD.as_millis() as u16).to_le_bytes();
    let flow = canopen::sdo::Transfer::Expedited;
    let written = sdo::download(link, policy, dut.node, PRODUCER, &time, flow)?.result.is_ok();
    let state = if written { watched(link, dut, some(PERIOD))? } else { None };
    let mut changed = BTreeSet::from([PRODUCER]);
    snapshot.restore(link, policy, dut.node, &mut changed)?;
    undo.end(&snapshot, &changed, Address::AsBefore);
    Ok(state)
}

/// The state in the last message of error control that comes in that time.
fn watched(link: &mut Link, dut: &Dut, time: Duration) -> Result<Option<NmtState>, BusError> {
    let id = heartbeat::COB_ID + u16::from(dut.node);
    let until = link.mark() + time;
    let mut last = None;
    while let Some(seen) = link.find(until, |seen| !seen.own && seen.frame.data_id() == Some(id))? {
        last = seen.frame.data.first().map(|state| NmtState(state & !TOGGLE)).or(last);
    }
    link.skip_to(until);
    // A boot-up message says nothing about the state after it.
    Ok(last.filter(|state| *state != NmtState::INITIALISING))
}

const PRODUCER: Mux = Mux::new(0x1017, 0);
/// Guard time and life time factor.
const LIFE_GUARDING: [Mux; 2] = [Mux::new(0x100C, 0), Mux::new(0x100D, 0)];
/// The bit that alternates in the answers to node guarding.
const TOGGLE: u8 = 0x80;
/// As long as any producer can do, and short for one that starts.
const PERIOD: Duration = Duration::from_millis(100);
/// A heartbeat that is rarer than this, and cannot be another one, is not waited for.
const LONGEST: Duration = Duration::from_secs(2);
