//! The NMT state machine (CiA 301, 7.3.2): commands, resets and the way to boot-up.

use std::ops::RangeInclusive;

use canopen::heartbeat::ErrorControl;
use canopen::{Instant, NmtState, Outbox};

use crate::services::Base;

/// What an NMT command leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Another state.
    Enter(NmtState),
    /// Initialisation from the start.
    Reset(Reset),
}

/// How much of a device starts anew (CiA 301, 7.3.2.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Everything, as after power-on.
    Node,
    /// The communication profile area.
    Communication,
}

impl Reset {
    /// The objects that take their stored or default values.
    pub const fn objects(self) -> RangeInclusive<u16> {
        match self {
            Self::Node => 0x1000..=0xFFFF,
            Self::Communication => 0x1000..=0x1FFF,
        }
    }
}

/// The part of NMT that needs time: initialisation until boot-up.
#[derive(Debug, Default)]
pub(crate) struct Nmt {
    boot_up_at: Option<Instant>,
}

impl Nmt {
    /// What a frame on identifier 0 tells this node to do.
    pub(crate) fn command(&self, base: &Base, data: &[u8]) -> Option<Change> {
        let command = base.rules.nmt_command(data)?;
        if !base.rules.nmt_addressed(base.id, command.node)
            || !base.rules.nmt_obeyed(command.service, base.errors.register())
        {
            return None;
        }
        base.rules.nmt_change(command.service)
    }

    /// Initialisation has begun.
    pub(crate) fn initialise(&mut self, now: Instant, base: &mut Base) {
        base.state = NmtState::INITIALISING;
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
        for _ in 0..base.rules.boot_up_messages() {
            out.push(ErrorControl::BOOT_UP.frame(base.id));
        }
        let chosen = base.settings.boot_up_state_object.and_then(|mux| base.od.int(mux));
        let states = [NmtState::OPERATIONAL, NmtState::STOPPED];
        let chosen = states.into_iter().find(|state| chosen == Some(i64::from(state.0)));
        Some(chosen.unwrap_or(NmtState::PRE_OPERATIONAL))
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.boot_up_at
    }
}
