//! What stands from the start: a device with errors that no case caused is tested all the same.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::heartbeat::ErrorControl;
use canopen::monitor::Standing;
use canopen::nmt::NmtState;
use canopen::pdo::CobId;
use canopen::sdo::Failure;
use canopen::{BusError, Mux, Stamped, emcy};
use reports::Identity;

use super::link::Link;
use super::policy::Policy;
use super::sdo;
use super::settle;
use crate::dut::Dut;
use crate::suite::profile::Habits;

const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);
pub(super) const EMCY_ID: Mux = Mux::new(0x1014, 0);
const ERROR_FIELD: u16 = 0x1003;
/// So many errors stand at the same time at most.
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

/// The device as it was before the first case, freshly started.
#[derive(Clone, Debug)]
pub(super) struct Baseline {
    /// What 1000h and 1018h say.
    pub identity: Identity,
    /// The bits of the error register; why there are none to compare with.
    register: RefCell<Result<Vec<u8>, Failure>>,
    /// Whether a boot-up message follows a reset.
    boots_up: Cell<bool>,
    /// What it does by itself.
    pub habits: Habits,
    /// The error codes of the emergencies that it sent, without 0000h.
    emergencies: Vec<EmcyCode>,
    /// Errors of which it sends no emergency, since 1014h disables them.
    hidden: Standing,
    /// The nodes whose heartbeat it monitors.
    pub monitored: Vec<u8>,
    /// What the starts for cases showed.
    starts: Cell<Starts>,
    /// How long it was waited for altogether while it was busy.
    waited: Cell<Duration>,
}

/// What the device sent when it was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Starts {
    /// How many starts were looked at.
    count: u32,
    /// The longest time from a start to the last frame that belongs to it.
    longest: Duration,
}

impl Starts {
    /// So many show what the next ones bring, whatever the phase of a cycle of the application.
    const ENOUGH: u32 = 8;
    /// What a start may take longer than twice the longest so far.
    const MARGIN: Duration = Duration::from_millis(10);

    fn quiet(self, most: Duration) -> Duration {
        match self.count < Self::ENOUGH {
            true => most,
            false => most.min(self.longest * 2 + Self::MARGIN),
        }
    }
}

impl Baseline {
    /// Whether a device that is busy is waited for once more, for `time`. One that never ends costs
    /// a run no more than that.
    pub(super) fn bears_with(&self, time: Duration) -> bool {
        const ALTOGETHER: Duration = Duration::from_secs(600);
        let waited = self.waited.get() + time;
        self.waited.set(waited);
        waited <= ALTOGETHER
    }

    /// A device of which nothing stands from the start.
    pub(super) fn of(identity: Identity) -> Self {
        Self {
            identity,
            register: RefCell::new(Ok(Vec::new())),
            boots_up: Cell::new(true),
            habits: Habits::default(),
            emergencies: Vec::new(),
            waited: Cell::default(),
            hidden: Standing::default(),
            monitored: Vec::new(),
            starts: Cell::default(),
        }
    }

    /// Looks at a device that has answered. One of which no boot-up message was seen so far is
    /// reset once, to see whether it sends one.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(super) fn take(
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
        identity: Identity,
    ) -> Result<Self, BusError> {
        let baseline = Self::of(identity);
        let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
        if !link.trace().iter().any(|seen| !seen.stamped.own && seen.stamped.frame == boot_up) {
            settle::reset_node(link, policy, dut, &baseline)?;
        }
        link.drain(policy.quiet.max(FIRST_EMERGENCIES))?;
        let sent: Vec<Stamped> = link.trace().iter().map(|seen| seen.stamped).collect();
        let sent = sent.iter().filter(|seen| !seen.own);
        // The identifier may be another one that was stored.
        let usual = emcy::COB_ID + u16::from(dut.node);
        let stored = sdo::upload_patiently(link, policy, dut.node, EMCY_ID)?.result.ok();
        let stored = stored.and_then(|value| Some(u32::from_le_bytes(*value.first_chunk()?)));
        let disabled = stored.is_some_and(|cob_id| !CobId(cob_id).valid());
        let stored = stored.map(|cob_id| CobId(cob_id).can_id());
        let ids = [Some(usual), stored.or(Some(usual))];
        let code = |seen: &Stamped| match (ids.contains(&seen.frame.data_id()), &*seen.frame.data) {
            (true, [low, high, ..]) => Some(EmcyCode(u16::from_le_bytes([*low, *high]))),
            _ => None,
        };
        let mut emergencies: Vec<EmcyCode> = sent.clone().filter_map(code).collect();
        emergencies.retain(|code| *code != EmcyCode::RESET);
        emergencies.dedup();
        let operational = ErrorControl::heartbeat(NmtState::OPERATIONAL).frame(dut.node);
        let seen = sent.clone().any(|seen| seen.frame == operational);
        let mut habits = habits(link, policy, dut)?;
        habits.self_start |= seen;
        let register = sdo::upload(link, policy, dut.node, ERROR_REGISTER)?.result;
        let hidden = match register.as_deref() {
            Ok([bits, ..]) if disabled && *bits != 0 => hidden(link, policy, dut, *bits)?,
            _ => Standing::default(),
        };
        let monitored = monitored(link, policy, dut)?;
        let register = RefCell::new(register);
        Ok(Self { register, habits, emergencies, hidden, monitored, ..baseline })
    }

    /// Whether the device sends a boot-up message.
    pub(super) fn boots_up(&self) -> bool {
        self.boots_up.get()
    }

    /// The errors that it reports whenever it starts.
    pub(super) fn standing(&self) -> Standing {
        let mut standing = self.hidden.clone();
        standing.codes.extend(&self.emergencies);
        standing
    }

    /// How long the wire must be idle after a start, for what the device sends to have come to
    /// rest: as long as the policy says until enough starts were seen, then hardly longer than any
    /// of them took. Cases begin with the same configuration, so that the starts are alike.
    pub(super) fn quiet_after_start(&self, policy: &Policy) -> Duration {
        self.starts.get().quiet(policy.quiet_after_start)
    }

    /// The device was started, and the last of what it sent came after that time.
    pub(super) fn started(&self, rest: Duration) {
        let Starts { count, longest } = self.starts.get();
        self.starts.set(Starts { count: count + 1, longest: longest.max(rest) });
    }

    /// A boot-up message was waited for in vain.
    pub(super) fn without_boot_up(&self) {
        self.boots_up.set(false);
    }

    /// What the error register shows that did not stand from the start.
    pub(super) fn new_errors(&self, now: &Result<Vec<u8>, Failure>) -> Option<String> {
        let standing = self.register.borrow();
        match (now, &*standing) {
            (Ok(now), before) => {
                let before = before.as_ref().map_or(&[][..], Vec::as_slice);
                let stands = |place| before.get(place).copied().unwrap_or(0);
                let new = now.iter().enumerate().any(|(place, bits)| bits & !stands(place) != 0);
                new.then(|| format!("the error register is {}", crate::plan::show_bytes(now)))
            }
            (Err(_), Err(_)) => None,
            (Err(failure), Ok(_)) => Some(format!("upload of {ERROR_REGISTER}: {failure}")),
        }
    }

    /// Errors that a reset does not clear stand from now on.
    pub(super) fn accept(&self, now: Result<Vec<u8>, Failure>) {
        *self.register.borrow_mut() = now;
    }

    /// What readers of a report must know.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        match &*self.register.borrow() {
            Ok(register) if register.iter().any(|bits| *bits != 0) => remarks.push(format!(
                "the error register 1001h was {} before the first case; these bits count as no \
                 error",
                crate::plan::show_bytes(register)
            )),
            Ok(_) => {}
            Err(failure) => {
                remarks.push(format!("upload of {ERROR_REGISTER} before the first case: {failure}"))
            }
        }
        let listed = |codes: &[EmcyCode]| {
            codes.iter().map(|code| format!("{:04X}h", code.0)).collect::<Vec<_>>().join(", ")
        };
        if !self.emergencies.is_empty() {
            let codes = listed(&self.emergencies);
            remarks.push(format!("it sent emergencies {codes} when it started"));
        }
        if !self.hidden.codes.is_empty() {
            let codes = listed(&self.hidden.codes);
            remarks.push(format!("1003h shows errors {codes}, and 1014h disables emergencies"));
        }
        if !self.boots_up() {
            remarks.push("it sends no boot-up message after a reset".to_owned());
        }
        if self.habits.self_start {
            remarks.push("it enters OPERATIONAL without a command".to_owned());
        }
        remarks
    }
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
        // An entry that is not in use is not there, and neither is one behind it.
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

/// What the device does by itself, as its objects say; those that it lacks say nothing.
fn habits(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Habits, BusError> {
    let mut low = |mux| -> Result<Option<u8>, BusError> {
        if dut.eds.entry(mux).is_none() {
            return Ok(None);
        }
        let value = sdo::upload(link, policy, dut.node, mux)?.result;
        Ok(value.ok().and_then(|bytes| bytes.first().copied()))
    };
    // What the data sheet promises is expected.
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
    Ok(Habits {
        self_start: start.is_some_and(|bits| bits & WAITS == 0),
        save_on_command: promises(STORE) || store.is_none_or(|bits| bits & ON_COMMAND != 0),
        autonomous_storage: store.is_some_and(|bits| bits & AUTONOMOUS != 0),
        no_save,
        no_load,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_that_were_short_shorten_the_wait_for_the_next_ones() {
        let policy = Policy::at_bit_rate(1_000_000);
        let ms = Duration::from_millis;
        let after = |rests: &[u64]| {
            let baseline = Baseline::of(Identity::default());
            rests.iter().for_each(|rest| baseline.started(ms(*rest)));
            baseline.quiet_after_start(&policy)
        };
        assert_eq!(after(&[]), ms(50));
        assert_eq!(after(&[1; 7]), ms(50));
        assert_eq!(after(&[1; 8]), ms(12));
        assert_eq!(after(&[1, 1, 7, 1, 1, 1, 1, 1, 2]), ms(24));
        assert_eq!(after(&[30; 20]), ms(50));
    }
}
