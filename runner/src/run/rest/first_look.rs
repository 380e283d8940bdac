//! The state of a device, freshly started, before the first case.

use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::heartbeat::ErrorControl;
use canopen::monitor::Standing;
use canopen::nmt::{Command, NmtState, Service};
use canopen::pdo::CobId;
use canopen::{BusError, Id, Mux, Stamped, emcy};
use reports::Identity;

use super::answer::booted;
use super::baseline::{Baseline, ERROR_REGISTER};
use super::emergencies::COB_ID_EMCY;
use super::shown::shown_state;
use super::state::pre_operational;
use super::undo::Undo;
use crate::dut::Dut;
use crate::plan::show_bytes;
use crate::protect::{Deed, Wire};
use crate::run::link::{Link, sdo};
use crate::run::policy::Policy;
use crate::suite::profile::{Autonomous, Habits};

const ERROR_FIELD: u16 = 0x1003;
/// At most this many errors stand at the same time.
const NEWEST_ERRORS: u8 = 8;
const START_UP: Mux = Mux::new(0x1F80, 0);
const STORE: Mux = Mux::new(0x1010, 1);
const RESTORE: u16 = 0x1011;
const ON_COMMAND: u8 = 1 << 0;
const AUTONOMOUS: u8 = 1 << 1;
/// Bit 2 of 1F80h: the node does not enter OPERATIONAL by itself (CiA 302-2).
const WAITS: u8 = 1 << 2;
/// How long a device may take to report an error after its boot-up message.
const FIRST_EMERGENCIES: Duration = Duration::from_millis(100);

/// What cases need to know of a device, and only the device can show.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::run) struct Wanted {
    /// Whether it enters OPERATIONAL without a command.
    pub self_start: bool,
    /// Whether it stays in OPERATIONAL.
    pub operational: bool,
}

/// Looks at a device that has answered. One of which no boot-up message was seen so far is
/// reset once, to see whether it sends one.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn first_look(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    identity: Identity,
    wanted: Wanted,
    undo: &Undo,
) -> Result<Baseline, BusError> {
    let mut baseline = Baseline::of(identity);
    let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
    let booted = link.trace().iter().any(|seen| !seen.stamped.own && seen.stamped.frame == boot_up);
    let reset = !booted && reset(link, policy, dut, &baseline)?;
    link.drain(policy.quiet.max(FIRST_EMERGENCIES))?;
    // 1F80h says what it does; another device has to be looked at, before the first command.
    let unsaid = wanted.self_start && dut.eds.entry(START_UP).is_none() && (booted || reset);
    let starts = unsaid && has_started(link, policy, dut, undo)?;
    if unsaid || reset {
        pre_operational(link, policy, dut)?;
    }
    let sent: Vec<Stamped> = link.trace().iter().map(|seen| seen.stamped).collect();
    let sent = sent.iter().filter(|seen| !seen.own);
    // Another identifier may have been stored.
    let usual = Id::standard(emcy::COB_ID + u16::from(dut.node));
    let stored = sdo::upload_patiently(link, policy, dut.node, COB_ID_EMCY)?.result.ok();
    let stored = stored.and_then(|value| Some(u32::from_le_bytes(*value.first_chunk()?)));
    let disabled = stored.is_some_and(|cob_id| !CobId(cob_id).valid());
    let stored = stored.map(|cob_id| CobId(cob_id).can_id());
    let ids = [Some(usual), stored.or(Some(usual))];
    let code = |seen: &Stamped| match (ids.contains(&seen.frame.any_data_id()), &*seen.frame.data) {
        (true, [low, high, ..]) => Some(EmcyCode(u16::from_le_bytes([*low, *high]))),
        _ => None,
    };
    let mut emergencies: Vec<EmcyCode> = sent.clone().filter_map(code).collect();
    emergencies.retain(|code| *code != EmcyCode::RESET);
    emergencies.dedup();
    let operational = ErrorControl::heartbeat(NmtState::OPERATIONAL).frame(dut.node);
    let seen = sent.clone().any(|seen| seen.frame == operational);
    let mut habits = habits(link, policy, dut)?;
    habits.self_start |= seen || starts;
    let register = sdo::upload(link, policy, dut.node, ERROR_REGISTER)?.result;
    let hidden = match register.as_deref() {
        Ok([bits, ..]) if disabled && *bits != 0 => hidden(link, policy, dut, *bits)?,
        _ => Standing::default(),
    };
    let monitored = monitored(link, policy, dut)?;
    let errors = !emergencies.is_empty()
        || register.as_ref().is_ok_and(|bits| bits.iter().any(|bits| *bits != 0));
    let may_start = dut.protection.refuses(Deed::Start).is_none();
    if wanted.operational && errors && may_start {
        let kept_in = kept_in(link, policy, dut, undo)?;
        let said = register.as_ref().map_or_else(
            |_| "an emergency".to_owned(),
            |bits| format!("1001h = {}", show_bytes(bits)),
        );
        baseline.kept_out = kept_in.map(|state| {
            format!(
                "an error from the start ({said}) keeps the device in {state} when it is started"
            )
        });
    }
    baseline.accept(register);
    (baseline.habits, baseline.monitored) = (habits, monitored);
    (baseline.emergency_id, baseline.emergencies) = (stored, emergencies);
    baseline.hidden = hidden;
    Ok(baseline)
}

/// Reads by which frames the device is written, since what it stored may differ from its data
/// sheet. The guard of a protected device listens.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn look_at_channels(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
) -> Result<(), BusError> {
    if !dut.protection.has_objects() {
        return Ok(());
    }
    for entry in dut.eds.entries() {
        if Wire::concerns(entry.mux) && entry.access.readable() {
            _ = sdo::upload(link, policy, dut.node, entry.mux)?;
        }
    }
    Ok(())
}

/// Resets the device unless it is protected from that, and leaves it in the state that it enters by
/// itself; whether it was reset.
fn reset(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<bool, BusError> {
    if dut.protection.refuses(Deed::ResetNode).is_some() {
        return Ok(false);
    }
    link.send(&Command { service: Service::RESET_NODE, node: dut.node }.frame())?;
    booted(link, policy, dut, baseline)?;
    Ok(true)
}

/// Whether a device that has just started is OPERATIONAL: its heartbeat shows it, or else a PDO.
fn has_started(link: &mut Link, policy: &Policy, dut: &Dut, undo: &Undo) -> Result<bool, BusError> {
    let state = shown_state(link, policy, dut, undo)?;
    let is_tpdo = |index: &u16| (0x1800..0x1A00).contains(index);
    let indices = dut.eds.objects.iter().map(|object| object.index).filter(is_tpdo);
    let cob_ids = indices.filter_map(|index| dut.default_int(Mux::new(index, 1)));
    let cob_ids = cob_ids.map(|cob_id| CobId(cob_id as u32)).filter(|cob_id| cob_id.valid());
    let ids: Vec<Option<Id>> = cob_ids.map(|cob_id| Some(cob_id.can_id())).collect();
    let mut sent = link.trace().iter().map(|seen| seen.stamped).filter(|seen| !seen.own);
    Ok(match state {
        Some(state) => state == NmtState::OPERATIONAL,
        None => sent.any(|seen| ids.contains(&seen.frame.any_data_id())),
    })
}

/// The state of a device with errors that does not stay in OPERATIONAL when it is started.
fn kept_in(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    undo: &Undo,
) -> Result<Option<NmtState>, BusError> {
    pre_operational(link, policy, dut)?;
    link.send(&Command { service: Service::START, node: dut.node }.frame())?;
    link.wait(link.mark() + policy.change_of_state)?;
    let state = shown_state(link, policy, dut, undo)?;
    pre_operational(link, policy, dut)?;
    Ok(state.filter(|state| *state != NmtState::OPERATIONAL))
}

/// The nodes in 1016h.
fn monitored(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Vec<u8>, BusError> {
    let mut nodes = Vec::new();
    for mux in dut.heartbeat_consumers() {
        let entry = sdo::upload(link, policy, dut.node, mux)?.result;
        nodes.extend(entry.ok().and_then(|bytes| bytes.get(2).copied()).filter(|node| *node > 0));
    }
    Ok(nodes)
}

/// The errors behind these bits of the error register, of which 1014h lets no message be sent: the
/// newest in 1003h.
fn hidden(link: &mut Link, policy: &Policy, dut: &Dut, bits: u8) -> Result<Standing, BusError> {
    let mut codes = Vec::new();
    for sub in 1..=NEWEST_ERRORS {
        let error = sdo::upload(link, policy, dut.node, Mux::new(ERROR_FIELD, sub))?.result;
        // An entry that is not in use does not exist, and neither does any entry after it.
        let Some([low, high]) = error.ok().and_then(|error| error.first_chunk().copied()) else {
            break;
        };
        codes.push(EmcyCode(u16::from_le_bytes([low, high])));
    }
    codes.retain(|code| *code != EmcyCode::RESET);
    codes.dedup();
    let untold = if codes.is_empty() { bits } else { 0 };
    Ok(Standing { codes, untold })
}

/// The device's behaviour without requests, according to its objects; a missing object says
/// nothing.
fn habits(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Habits, BusError> {
    let mut low = |mux| -> Result<Option<u8>, BusError> {
        if dut.eds.entry(mux).is_none() {
            return Ok(None);
        }
        let value = sdo::upload(link, policy, dut.node, mux)?.result;
        Ok(value.ok().and_then(|bytes| bytes.first().copied()))
    };
    // A device is expected to keep the promises of its data sheet.
    let promises =
        |mux| dut.default_int(mux).is_some_and(|bits| bits & i128::from(ON_COMMAND) != 0);
    let (start, store) = (low(START_UP)?, low(STORE)?);
    let mut idle = |index| -> Result<u128, BusError> {
        let muxes = dut.eds.entries().map(|entry| entry.mux);
        let commands = muxes.filter(|mux| mux.index == index && (1..=127).contains(&mux.sub));
        commands.filter(|mux| !promises(*mux)).try_fold(0, |idle, mux| {
            let none = low(mux)?.is_some_and(|bits| bits & ON_COMMAND == 0);
            Ok(idle | u128::from(none) << mux.sub)
        })
    };
    let (no_save, no_load) = (idle(STORE.index)?, idle(RESTORE)?);
    let by_itself = [1, 2, 3].map(|sub| Mux::new(STORE.index, sub)).map(|mux| match mux {
        STORE => Ok(store),
        group => low(group),
    });
    let [all, communication, application] = by_itself;
    let (all, groups) = (all?, [communication?, application?]);
    let autonomous = |bits: Option<u8>| bits.is_some_and(|bits| bits & AUTONOMOUS != 0);
    // A group that has no sub-index of its own goes with all parameters.
    let [communication, application] = groups.map(|group| autonomous(group.or(all)));
    let by_itself = Autonomous { all: autonomous(all), communication, application };
    Ok(Habits {
        self_start: start.is_some_and(|bits| bits & WAITS == 0),
        save_on_command: promises(STORE) || store.is_none_or(|bits| bits & ON_COMMAND != 0),
        autonomous_storage: by_itself,
        no_save,
        no_load,
        virtual_time: !link.is_real(),
    })
}
