//! Network management: commands, resets, boot-up.

use canopen::nmt::{Command, Service};
use canopen::{Data, NmtState};

use super::Rules;
use super::reset::{Change, Reset};

decisions! {
    /// The decisions of an NMT slave (CiA 301, 7.2.8 and 7.3.2).
    pub NmtDecision of Rules, otherwise [DEVIATIONS];

    /// A command has exactly two bytes (7.2.8.3.1).
    fn nmt_command(&self, data: &[u8]) -> Option<Command> {
        Command::decode(data).ok()
    }

    /// It concerns the node it names, and node 0 is every node (7.2.8.3.1).
    fn nmt_addressed(&self, node: u8, to: u8) -> bool {
        to == 0 || to == node
    }

    /// Five services are known and others mean nothing (7.2.8.3.1).
    fn nmt_change(&self, service: Service) -> Option<Change> {
        match service {
            Service::START => Some(Change::Enter(NmtState::OPERATIONAL)),
            Service::STOP => Some(Change::Enter(NmtState::STOPPED)),
            Service::ENTER_PRE_OPERATIONAL => Some(Change::Enter(NmtState::PRE_OPERATIONAL)),
            Service::RESET_NODE => Some(Change::Reset(Reset::Node)),
            Service::RESET_COMMUNICATION => Some(Change::Reset(Reset::Communication)),
            _ => None,
        }
    }

    /// An error that is present does not keep a node from obeying (7.3.2.2).
    fn nmt_obeyed(&self, _service: Service, _error_register: u8) -> bool {
        true
    }

    /// A command that comes before the boot-up message is lost (7.3.2.2.1).
    fn nmt_remembered_until_boot_up(&self) -> bool {
        false
    }

    /// Initialisation ends with one boot-up message (7.2.8.3.3).
    fn boot_up_messages(&self) -> u32 {
        1
    }

    /// The SDO server answers from the boot-up message on, or so many milliseconds later
    /// (7.3.2.2.2).
    fn server_opens_after(&self) -> u32 {
        0
    }

    /// A reset gives the objects of its areas their stored or default values (7.3.2.2.1).
    fn reset_restores(&self, _reset: Reset) -> bool {
        true
    }

    /// The state that an object of the manufacturer chooses is entered after each boot-up (device
    /// manuals).
    fn boot_up_state_chosen(&self, _reset: Reset) -> bool {
        true
    }

    /// With bit 2 of 1F80h clear a node starts itself (7.5.2.34); without 1F80h it may.
    fn starts_itself(&self, startup: Option<u32>) -> bool {
        startup.is_some_and(|startup| startup & 1 << 2 == 0)
    }

    /// This node is not an NMT master, so the other bits are not for it.
    fn startup_valid(&self, startup: u32) -> bool {
        startup & !(1 << 2) == 0
    }

    /// Reset communication ends the errors of the communication, and reset node all of them.
    fn reset_ends_errors(&self) -> bool {
        true
    }

    /// Reset communication leaves the errors of the application, which goes on (7.3.2.2.1).
    fn reset_ends_application_errors(&self, reset: Reset) -> bool {
        reset == Reset::Node
    }

    /// Reset communication restores parameters, and the running services take them over. `index` is
    /// the first of them (7.3.2.2.1).
    fn reset_takes_over(&self, _index: u16) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of NmtDecision;

    "nmt-short-command-acts" =>
        nmt_command: |_, data| Command::decode(&Data::new(data).padded()[..2]).ok();
    "nmt-unknown-command-acts" => nmt_change: |_, service| {
        Some(match service {
            Service::START => Change::Enter(NmtState::OPERATIONAL),
            Service::STOP => Change::Enter(NmtState::STOPPED),
            Service::RESET_NODE => Change::Reset(Reset::Node),
            Service::RESET_COMMUNICATION => Change::Reset(Reset::Communication),
            _ => Change::Enter(NmtState::PRE_OPERATIONAL),
        })
    };
    "reset-communication-as-reset-node" => nmt_change: |rules, service| {
        match rules.nmt_change(service) {
            Some(Change::Reset(_)) => Some(Change::Reset(Reset::Node)),
            change => change,
        }
    };
    "nmt-broadcast-ignored" => nmt_addressed: |_, node, to| to == node;
    "nmt-node-ids-above-127-obeyed" =>
        nmt_addressed: |_, node, to| to == 0 || to == node || to > 127;
    "nmt-near-node-acts" => nmt_addressed: |_, node, to| to == 0 || to & 0x1F == node & 0x1F;
    "nmt-start-ignored-after-error" =>
        nmt_obeyed: |_, service, error_register| service != Service::START || error_register == 0;
    "reset-communication-keeps-objects" => reset_restores: |_, reset| reset == Reset::Node;
    "boot-up-state-after-reset-node-only" => boot_up_state_chosen: |_, reset| reset == Reset::Node;
    "reset-node-keeps-objects" => reset_restores: |_, reset| reset == Reset::Communication;
    "parameters-of-rpdos-outlive-reset-communication" =>
        reset_takes_over: |_, index| index != 0x1400;
    "parameters-of-tpdos-outlive-reset-communication" =>
        reset_takes_over: |_, index| index != 0x1800;
    "parameters-of-sync-outlive-reset-communication" =>
        reset_takes_over: |_, index| index != 0x1005;
    "parameters-of-time-outlive-reset-communication" =>
        reset_takes_over: |_, index| index != 0x1012;
}
