//! Devices that break one rule each, after bugs that real stacks had.

use std::time::Duration;

use canopen::nmt::{Command, Service};
use canopen::sdo::Request;
use canopen::{Abort, Data, Mux, NmtState};

use super::Rules;
use crate::nmt::{Change, Reset};

/// The rules of the device that is wrong in just the way `name` says; `None` when there is none.
pub fn named(name: &str) -> Option<Box<dyn Rules>> {
    let (_, make) = MUTANTS.iter().find(|(known, _)| *known == name)?;
    Some(make())
}

/// The names that [`named`] knows.
pub fn names() -> impl Iterator<Item = &'static str> {
    MUTANTS.iter().map(|(name, _)| *name)
}

type Mutant = (&'static str, fn() -> Box<dyn Rules>);

/// Each mutant is its name and the one method that differs.
macro_rules! mutants {
    ($($name:literal { $($method:tt)* })*) => {
        const MUTANTS: &[Mutant] = &[$(($name, || {
            struct Mutant;
            impl Rules for Mutant { $($method)* }
            Box::new(Mutant)
        })),*];
    };
}

mutants! {
    // Network management
    "no-boot-up" {
        fn boot_up_messages(&self) -> u32 { 0 }
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
    "nmt-other-node-acts" {
        fn nmt_addressed(&self, _node: u8, _to: u8) -> bool { true }
    }
    "nmt-broadcast-ignored" {
        fn nmt_addressed(&self, node: u8, to: u8) -> bool { to == node }
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

    // Error control
    "heartbeat-period-drifts" {
        fn heartbeat_period(&self, configured: Duration) -> Duration {
            configured * 101 / 100
        }
    }
    "heartbeat-burst-at-boot-up" {
        fn heartbeats_at_boot_up(&self) -> u32 { 3 }
    }
    "error-behaviour-ignored" {
        fn error_reaction(&self, _configured: u8) -> Option<NmtState> { None }
    }

    // SDO server
    "sdo-served-in-stopped" {
        fn sdo_served_in(&self, _state: NmtState) -> bool { true }
    }
    "sdo-short-frame-answered" {
        fn sdo_request(&self, data: &[u8]) -> Option<Request> {
            Request::decode(&Data::new(data).padded()).ok()
        }
    }
    "sdo-unknown-command-unanswered" {
        fn answers_unknown_command(&self) -> bool { false }
    }
    "sdo-first-toggle-unchecked" {
        fn toggle_checked(&self, first: bool) -> bool { !first }
    }
    "sdo-toggle-unchecked" {
        fn toggle_checked(&self, first: bool) -> bool { first }
    }
    "sdo-open-after-toggle-abort" {
        fn abort_ends_transfer(&self, code: Abort) -> bool { code != Abort::TOGGLE }
    }
    "sdo-stuck-after-client-reset" {
        fn initiate_replaces_transfer(&self) -> bool { false }
    }
    "sdo-upload-of-abandoned-object" {
        fn uploaded(&self, requested: Mux, open: Option<Mux>) -> Mux { open.unwrap_or(requested) }
    }
    "sdo-download-needs-size" {
        fn size_may_be_missing(&self) -> bool { false }
    }
    "sdo-size-checked-late" {
        fn size_checked_at_initiate(&self) -> bool { false }
    }
    "sdo-underflow-accepted" {
        fn underflow_checked(&self) -> bool { false }
    }
    "sdo-overflow-accepted" {
        fn overflow_checked(&self) -> bool { false }
    }
    "sdo-timeout-early" {
        fn sdo_timeout(&self, configured: Duration) -> Duration { configured / 4 }
    }
    "sdo-timeout-never" {
        fn sdo_timeout(&self, _configured: Duration) -> Duration { Duration::MAX }
    }
    "sdo-timeout-not-restarted" {
        fn request_restarts_sdo_timeout(&self) -> bool { false }
    }
    "abort-general" {
        fn abort_code(&self, _mux: Mux, _reason: Abort) -> Abort { Abort::GENERAL }
    }
    "abort-hardware-for-length" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            match reason {
                Abort::LENGTH | Abort::TOO_LONG | Abort::TOO_SHORT => Abort::HARDWARE,
                reason => reason,
            }
        }
    }
    "abort-too-long-for-too-short" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::TOO_SHORT { Abort::TOO_LONG } else { reason }
        }
    }
    "abort-no-object-for-no-sub-index" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::NO_SUB_INDEX { Abort::NO_OBJECT } else { reason }
        }
    }
    "abort-no-connection-for-no-sub-index" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::NO_SUB_INDEX { Abort::NO_CONNECTION } else { reason }
        }
    }
    "abort-command-for-toggle" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::TOGGLE { Abort::COMMAND } else { reason }
        }
    }
    "abort-sequence-for-command" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::COMMAND { Abort::SEQUENCE } else { reason }
        }
    }
    "abort-access-for-read-only" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::READ_ONLY { Abort::NO_OBJECT } else { reason }
        }
    }
    "range-unchecked" {
        fn range_checked(&self) -> bool { false }
    }
    "refused-write-changes-value" {
        fn refused_write_changes_nothing(&self, _mux: Mux) -> bool { false }
    }

    // Emergency
    "emcy-sent-in-stopped" {
        fn emcy_sent_in(&self, _state: NmtState) -> bool { true }
    }
    "emcy-repeated" {
        fn emcy_repeated(&self) -> bool { true }
    }
    "emcy-lost-when-busy" {
        fn emcy_queued(&self) -> bool { false }
    }
    "emcy-inhibit-ignored" {
        fn emcy_inhibit(&self, _configured: u16) -> Duration { Duration::ZERO }
    }
    "emcy-inhibit-in-milliseconds" {
        fn emcy_inhibit(&self, configured: u16) -> Duration {
            Duration::from_millis(configured.into())
        }
    }
    "error-register-never-cleared" {
        fn error_register(&self, before: u8, present: u8) -> u8 { before | present }
    }
    "history-order-reversed" {
        fn history_newest_first(&self) -> bool { false }
    }
    "history-cleared-by-any-value" {
        fn history_count_valid(&self, _count: u8) -> bool { true }
    }
    "history-empty-line-readable" {
        fn empty_history_readable(&self) -> bool { true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        let mut seen = std::collections::BTreeSet::new();
        for name in names() {
            assert!(seen.insert(name), "{name} twice");
            assert!(named(name).is_some(), "{name}");
        }
        assert!(named("none-of-these").is_none());
    }
}
