//! The NMT state machine (CiA 301, 7.3.2): commands, resets and the way to boot-up.

use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::lss::UNCONFIGURED;
use canopen::{Abort, DataType, Instant, Mux, NmtState, Outbox};

use crate::rules::{Change, Reset};
use crate::stack::base::Base;

/// The part of NMT that needs time: initialisation until boot-up.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nmt {
    boot_up_at: Option<Instant>,
    booted_at: Instant,
    /// The state to return to after boot-up, for a node with the deviation that remembers it.
    remembered: Option<NmtState>,
    /// An object chooses the state after boot-up.
    chooses: bool,
}

impl Nmt {
    /// The command to this node in a frame with identifier 0.
    pub(crate) fn command(&self, base: &Base, data: &[u8]) -> Option<Change> {
        let command = base.rules.nmt_command(data)?;
        if !base.rules.nmt_addressed(base.id, command.node)
            || !base.rules.nmt_obeyed(command.service, base.errors.register())
        {
            return None;
        }
        base.rules.nmt_change(command.service)
    }

    /// A frame on identifier 0 has come before the boot-up message.
    pub(crate) fn too_early(&mut self, base: &Base, data: &[u8]) {
        if base.rules.nmt_remembered_until_boot_up()
            && let Some(Change::Enter(state)) = self.command(base, data)
        {
            self.remembered = Some(state);
        }
    }

    /// Initialisation has begun. Without a node id it does not end (CiA 305).
    pub(crate) fn initialise(&mut self, now: Instant, reset: Reset, base: &mut Base) {
        base.state = NmtState::INITIALISING;
        self.chooses = base.rules.boot_up_state_chosen(reset);
        if base.id == UNCONFIGURED {
            self.boot_up_at = None;
            return;
        }
        let time = match base.settings.boot_up_time_object {
            Some((mux, unit)) => {
                let count = base.od.int(mux).and_then(|count| u32::try_from(count).ok());
                count.map_or(base.settings.boot_up_time, |count| unit.saturating_mul(count))
            }
            None => base.settings.boot_up_time,
        };
        self.boot_up_at = Some(now + time);
    }

    /// Boots up when it is time to, and says which state to enter.
    pub(crate) fn handle_timeout(
        &mut self,
        now: Instant,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<NmtState> {
        self.boot_up_at.take_if(|due| *due <= now)?;
        self.booted_at = now;
        for _ in 0..base.rules.boot_up_messages() {
            out.push(ErrorControl::BOOT_UP.frame(base.id));
        }
        let chooses = base.settings.boot_up_state_object.filter(|_| self.chooses);
        let chosen = chooses.and_then(|mux| chosen_state(mux, base));
        let startup = base.od.int(STARTUP).map(|startup| startup as u32);
        let alone = base.rules.starts_itself(startup);
        let first = if alone { NmtState::OPERATIONAL } else { NmtState::PRE_OPERATIONAL };
        Some(self.remembered.take().or(chosen).unwrap_or(first))
    }

    /// Whether the SDO server listens; it may begin to some time after the boot-up message.
    pub(crate) fn server_is_open(&self, now: Instant, base: &Base) -> bool {
        let closed = Duration::from_millis(base.rules.server_opens_after().into());
        now >= self.booted_at + closed
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.boot_up_at
    }
}

/// The state that an object chooses for the start; a switch chooses OPERATIONAL.
fn chosen_state(mux: Mux, base: &Base) -> Option<NmtState> {
    let entry = base.od.entry(mux)?;
    if entry.data_type == DataType::BOOLEAN {
        return base.od.get(mux)?.first().filter(|on| **on != 0).map(|_| NmtState::OPERATIONAL);
    }
    let state = base.od.int(mux)?;
    let states = [NmtState::OPERATIONAL, NmtState::STOPPED];
    states.into_iter().find(|known| state == i64::from(known.0))
}

/// The refusals of 1F80h: every value that this device does not support.
pub(crate) fn check_startup(bytes: &[u8], base: &Base) -> Result<(), Abort> {
    let &[a, b, c, d] = bytes else { return Ok(()) };
    match base.rules.startup_valid(u32::from_le_bytes([a, b, c, d])) {
        true => Ok(()),
        false => Err(Abort::VALUE),
    }
}

const STARTUP: Mux = Mux::new(0x1F80, 0);

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen::eds::{Entry, Term};
    use canopen::{DataType, NmtState, Value};

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, basic, eds, mux, sent, set};
    use crate::stack::{Inert, NodeSettings};

    #[test]
    fn boots_up_once_and_only_then_listens() {
        let settings =
            NodeSettings { boot_up_time: Duration::from_millis(10), ..NodeSettings::default() };
        let mut fixture = Fixture::with(&eds(basic()), settings, Rules::default(), Box::new(Inert));
        assert_eq!(fixture.node.state(), NmtState::INITIALISING);
        assert!(fixture.ask("605#4000100000000000").is_empty());
        fixture.send("000#0105");
        assert_eq!(fixture.until(100_000), sent(&[(10_000, "705#00")]));
        assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL);
    }

    #[test]
    fn commands_lead_from_every_state_to_every_other() {
        let mut fixture = Fixture::new(&eds(basic()));
        for from in ["000#0105", "000#0205", "000#8005"] {
            for (to, state) in [("0105", 5), ("0205", 4), ("8005", 127), ("0100", 5)] {
                fixture.send(from);
                fixture.send(&format!("000#{to}"));
                assert_eq!(fixture.node.state(), NmtState(state), "{from} {to}");
            }
        }
    }

    #[test]
    fn what_is_no_command_for_this_node_is_ignored() {
        let mut fixture = Fixture::new(&eds(basic()));
        for frame in ["000#0106", "000#01", "000#", "000#010500", "000#0305", "000#R2"] {
            assert!(fixture.ask(frame).is_empty(), "{frame}");
            assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL, "{frame}");
        }
    }

    #[test]
    fn a_reset_takes_back_its_areas() {
        let mut fixture = Fixture::new(&eds(basic()));
        for (reset, area_2000) in [("000#8205", 0x77), ("000#8105", 0x11)] {
            fixture.write(mux(0x1017, 0), &[50, 0]).unwrap();
            fixture.write(mux(0x2000, 0), &[0x77]).unwrap();
            fixture.send(reset);
            let at = fixture.now.0 / 1000;
            assert_eq!(fixture.until(at + 100_000), sent(&[(at + 1000, "705#00")]));
            assert_eq!(fixture.read(mux(0x1017, 0)), Ok(vec![0, 0]));
            assert_eq!(fixture.read(mux(0x2000, 0)), Ok(vec![area_2000]));
        }
    }

    #[test]
    fn state_and_time_of_boot_up_may_be_objects() {
        let settings = NodeSettings {
            boot_up_time_object: Some((mux(0x2000, 0), Duration::from_millis(10))),
            boot_up_state_object: Some(mux(0x2001, 0)),
            ..NodeSettings::default()
        };
        let mut entries = basic();
        set(&mut entries, mux(0x2001, 0), 5);
        let mut fixture = Fixture::with(&eds(entries), settings, Rules::default(), Box::new(Inert));
        assert_eq!(fixture.until(300_000), sent(&[(170_000, "705#00")]));
        assert_eq!(fixture.node.state(), NmtState::OPERATIONAL);
    }

    #[test]
    fn a_switch_may_choose_the_state_after_boot_up() {
        for (on, state) in [(true, NmtState::OPERATIONAL), (false, NmtState::PRE_OPERATIONAL)] {
            let switch = mux(0x2001, 0);
            let settings =
                NodeSettings { boot_up_state_object: Some(switch), ..NodeSettings::default() };
            let mut entries = basic();
            entries.retain(|entry| entry.mux != switch);
            let access = canopen::eds::Access::Rw;
            let entry = crate::stack::testing::entry(switch, DataType::BOOLEAN, access, 0);
            entries.push(Entry { default: Some(Term::fixed(Value::Bool(on))), ..entry });
            let fixture = Fixture::with(&eds(entries), settings, Rules::default(), Box::new(Inert));
            assert_eq!(fixture.node.state(), state, "{on}");
        }
    }

    #[test]
    fn a_node_may_start_itself() {
        let mut entries = basic();
        let data_type = DataType::UNSIGNED32;
        entries.push(crate::stack::testing::entry(
            mux(0x1F80, 0),
            data_type,
            canopen::eds::Access::Rw,
            4,
        ));
        let waits = Fixture::new(&eds(entries.clone()));
        assert_eq!(waits.node.state(), NmtState::PRE_OPERATIONAL);
        set(&mut entries, mux(0x1F80, 0), 0);
        let mut alone = Fixture::new(&eds(entries));
        assert_eq!(alone.node.state(), NmtState::OPERATIONAL);
        for (value, refused) in [(0u32, false), (4, false), (1, true), (8, true), (1 << 31, true)] {
            let answer = alone.write(mux(0x1F80, 0), &value.to_le_bytes());
            assert_eq!(answer.is_err(), refused, "{value}");
        }
    }

    #[test]
    fn mutants_break_what_they_say() {
        let booted = |rules: &str| {
            let mut fixture = Fixture::mutant(&eds(basic()), rules);
            fixture.write(mux(0x2000, 0), &[0x77]).unwrap();
            fixture.write(mux(0x1017, 0), &[100, 0]).unwrap();
            fixture
        };
        for (rules, boot_ups) in [("boot-up-messages: 0", 0), ("boot-up-messages: 2", 2)] {
            let mut fixture = booted(rules);
            fixture.send("000#8205");
            assert_eq!(fixture.until(50_000).len(), boot_ups);
        }
        for (rules, command) in
            [("nmt-short-command-acts", "000#01"), ("nmt-addressed: true", "000#0106")]
        {
            let mut fixture = booted(rules);
            fixture.send(command);
            assert_eq!(fixture.node.state(), NmtState::OPERATIONAL, "{rules}");
        }
        let mut fixture = booted("nmt-unknown-command-acts");
        fixture.send("000#0105");
        fixture.send("000#4205");
        assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL);
        let mut fixture = booted("reset-communication-keeps-objects");
        fixture.send("000#8205");
        fixture.run_to(50_000);
        assert_eq!(fixture.read(mux(0x1017, 0)), Ok(vec![100, 0]));
    }
}
