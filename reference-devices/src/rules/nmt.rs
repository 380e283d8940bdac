//! Network management: commands, resets, boot-up.

use canopen::nmt::{Command, Service};
use canopen::{Data, NmtState};

use super::Layer;
use super::reset::{Change, Reset};

decisions! {
    /// The decisions of an NMT slave (CiA 301, 7.2.8 and 7.3.2).
    pub trait NmtRules: Layer;

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

    /// A reset gives the objects of its areas their stored or default values (7.3.2.2.1).
    fn reset_restores(&self, _reset: Reset) -> bool {
        true
    }

    /// With bit 2 of 1F80h clear a node starts itself (7.5.2.34).
    fn starts_itself(&self, startup: u32) -> bool {
        startup & 1 << 2 == 0
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

    /// What runs takes the parameters over that reset communication has restored, by the index of
    /// the first of them (7.3.2.2.1).
    fn reset_takes_over(&self, _index: u16) -> bool {
        true
    }
}

deviations! {
    NmtRules;

    "no-boot-up" {
        fn boot_up_messages(&self) -> u32 { 0 }
    }
    "nmt-remembered-until-boot-up" {
        fn nmt_remembered_until_boot_up(&self) -> bool { true }
    }
    "errors-outlive-reset" {
        fn reset_ends_errors(&self) -> bool { false }
    }
    "reset-communication-ends-application-errors" {
        fn reset_ends_application_errors(&self, _reset: Reset) -> bool { true }
    }
    "boot-up-twice" {
        fn boot_up_messages(&self) -> u32 { 2 }
    }
    "nmt-short-command-acts" {
        fn nmt_command(&self, data: &[u8]) -> Option<Command> {
            Command::decode(&Data::new(data).padded()[..2]).ok()
        }
    }
    "nmt-unknown-command-acts" {
        fn nmt_change(&self, service: Service) -> Option<Change> {
            Some(match service {
                Service::START => Change::Enter(NmtState::OPERATIONAL),
                Service::STOP => Change::Enter(NmtState::STOPPED),
                Service::RESET_NODE => Change::Reset(Reset::Node),
                Service::RESET_COMMUNICATION => Change::Reset(Reset::Communication),
                _ => Change::Enter(NmtState::PRE_OPERATIONAL),
            })
        }
    }
    "reset-communication-as-reset-node" {
        fn nmt_change(&self, service: Service) -> Option<Change> {
            match self.0.nmt_change(service) {
                Some(Change::Reset(_)) => Some(Change::Reset(Reset::Node)),
                change => change,
            }
        }
    }
    "nmt-other-node-acts" {
        fn nmt_addressed(&self, _node: u8, _to: u8) -> bool { true }
    }
    "nmt-broadcast-ignored" {
        fn nmt_addressed(&self, node: u8, to: u8) -> bool { to == node }
    }
    "nmt-node-ids-above-127-obeyed" {
        fn nmt_addressed(&self, node: u8, to: u8) -> bool { to == 0 || to == node || to > 127 }
    }
    "nmt-start-ignored-after-error" {
        fn nmt_obeyed(&self, service: Service, error_register: u8) -> bool {
            service != Service::START || error_register == 0
        }
    }
    "reset-communication-keeps-objects" {
        fn reset_restores(&self, reset: Reset) -> bool { reset == Reset::Node }
    }
    "reset-node-keeps-objects" {
        fn reset_restores(&self, reset: Reset) -> bool { reset == Reset::Communication }
    }
    "start-by-itself-ignored" {
        fn starts_itself(&self, _startup: u32) -> bool { false }
    }
    "start-by-itself-always" {
        fn starts_itself(&self, _startup: u32) -> bool { true }
    }
    "startup-bits-unchecked" {
        fn startup_valid(&self, _startup: u32) -> bool { true }
    }
    "parameters-of-rpdos-outlive-reset-communication" {
        fn reset_takes_over(&self, index: u16) -> bool { index != 0x1400 }
    }
    "parameters-of-tpdos-outlive-reset-communication" {
        fn reset_takes_over(&self, index: u16) -> bool { index != 0x1800 }
    }
    "parameters-of-sync-outlive-reset-communication" {
        fn reset_takes_over(&self, index: u16) -> bool { index != 0x1005 }
    }
    "parameters-of-time-outlive-reset-communication" {
        fn reset_takes_over(&self, index: u16) -> bool { index != 0x1012 }
    }
}
