//! Devices that break one rule each, after bugs that real stacks had.

use std::ops::RangeInclusive;
use std::time::Duration;

use canopen::eds::Direction;
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::Request;
use canopen::timestamp::TimeOfDay;
use canopen::{Abort, Data, Mux, NmtState};

use super::{Change, LssRules, Reset, Rules, SdoBlockRules, lss, sdo_block};

/// The rules of the device that is wrong in just the way `name` says; `None` when there is none.
pub fn named(name: &str) -> Option<Box<dyn Rules>> {
    let (_, make) = all().find(|(known, _)| *known == name)?;
    Some(make())
}

/// The names that [`named`] knows.
pub fn names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| *name)
}

fn all() -> impl Iterator<Item = &'static Mutant> {
    MUTANTS.iter().chain(sdo_block::MUTANTS).chain(lss::MUTANTS)
}

pub(super) type Mutant = (&'static str, fn() -> Box<dyn Rules>);

/// Each mutant is its name and the methods of the first trait that differ.
macro_rules! mutants {
    ($trait:ident, as specified $second:ident $third:ident;
        $($name:literal { $($method:tt)* })*) => {
        pub(super) const MUTANTS: &[crate::rules::mutants::Mutant] = &[$(($name, || {
            struct Mutant;
            impl $trait for Mutant { $($method)* }
            impl $second for Mutant {}
            impl $third for Mutant {}
            Box::new(Mutant)
        })),*];
    };
}
pub(super) use mutants;

mutants! {
    Rules, as specified SdoBlockRules LssRules;

    // Network management
    "no-boot-up" {
        fn boot_up_messages(&self) -> u32 { 0 }
    }
    "nmt-remembered-until-boot-up" {
        fn nmt_remembered_until_boot_up(&self) -> bool { true }
    }
    "errors-outlive-reset" {
        fn reset_ends_errors(&self) -> bool { false }
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

    "start-by-itself-ignored" {
        fn starts_itself(&self, _startup: u32) -> bool { false }
    }
    "start-by-itself-always" {
        fn starts_itself(&self, _startup: u32) -> bool { true }
    }
    "startup-bits-unchecked" {
        fn startup_valid(&self, _startup: u32) -> bool { true }
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
    "error-classes-are-one" {
        fn error_class(&self, _sub: u8) -> Option<u8> { Some(1) }
    }
    "errors-of-the-application-without-reaction" {
        fn error_class(&self, sub: u8) -> Option<u8> { (sub == 1).then_some(sub) }
    }
    "error-behaviour-ignored" {
        fn error_reaction(&self, _configured: u8) -> Option<NmtState> { None }
    }

    "heartbeat-watched-before-first" {
        fn first_heartbeat_starts_watch(&self) -> bool { false }
    }
    "heartbeat-loss-never-recovers" {
        fn heartbeat_loss_recovers(&self) -> bool { false }
    }
    "heartbeat-consumer-time-doubled" {
        fn heartbeat_consumer_time(&self, configured: Duration) -> Duration { configured * 2 }
    }
    "heartbeat-of-any-state" {
        fn is_heartbeat(&self, _state: NmtState) -> bool { true }
    }
    "life-guarding-beside-heartbeat" {
        fn heartbeat_ends_life_guarding(&self) -> bool { false }
    }
    "errors-change-every-state" {
        fn errors_change(&self, _state: NmtState) -> bool { true }
    }
    "tpdo-sent-in-pre-operational" {
        fn tpdo_sent_in(&self, state: NmtState) -> bool { state != NmtState::STOPPED }
    }
    "heartbeat-node-watched-twice" {
        fn heartbeat_node_watched_once(&self) -> bool { false }
    }
    "guarding-answered-beside-heartbeat" {
        fn guarding_answered(&self, _heartbeat_runs: bool) -> bool { true }
    }
    "guarding-toggle-stuck" {
        fn guarding_toggle_after(&self, toggle: bool) -> bool { toggle }
    }
    "guarding-toggle-kept-over-reset" {
        fn guarding_toggle_after_reset(&self, toggle: bool) -> bool { toggle }
    }
    "life-time-factor-ignored" {
        fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
            if factor == 0 { Duration::ZERO } else { guard_time }
        }
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
        fn request_restarts_sdo_timeout(&self, first: bool) -> bool { first }
    }
    "sdo-stale-timeout-aborts-next" {
        fn request_restarts_sdo_timeout(&self, first: bool) -> bool { !first }
    }
    "sdo-transfer-survives-stop" {
        fn stop_ends_sdo_transfers(&self) -> bool { false }
    }
    "sdo-upload-of-changing-value" {
        fn upload_is_snapshot(&self) -> bool { false }
    }
    "sdo-servers-share-transfer" {
        fn sdo_servers_independent(&self) -> bool { false }
    }
    "sdo-channel-half-valid" {
        fn sdo_channel_needs_both(&self) -> bool { false }
    }
    "sdo-long-identifier-taken" {
        fn sdo_long_identifier_taken(&self) -> bool { true }
    }
    "sdo-partner-unchecked" {
        fn sdo_partner_valid(&self, _node: u8) -> bool { true }
    }
    "sdo-client-gives-up-in-silence" {
        fn sdo_client_tells_timeout(&self) -> bool { false }
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
    "abort-command-for-checksum" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            if reason == Abort::CRC { Abort::COMMAND } else { reason }
        }
    }
    "abort-block-codes-swapped" {
        fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
            match reason {
                Abort::SEQUENCE => Abort::BLOCK_SIZE,
                Abort::BLOCK_SIZE => Abort::SEQUENCE,
                reason => reason,
            }
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

    "text-keeps-the-end-of-the-last-one" {
        fn shorter_text_ends_earlier(&self) -> bool { false }
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

    "emcy-kept-over-reset" {
        fn reset_drops_emcy(&self) -> bool { false }
    }
    "history-without-end" {
        fn history_depth(&self, _lines: usize) -> usize { 254 }
    }

    // SYNC
    "sync-loss-not-told" {
        fn sync_loss_told(&self) -> bool { false }
    }
    "sync-period-in-milliseconds" {
        fn sync_period(&self, configured: Duration) -> Duration { configured * 1000 }
    }
    "sync-any-length-used" {
        fn sync_length_valid(&self, _expected: usize, _actual: usize) -> bool { true }
    }
    "sync-counter-to-255" {
        fn sync_overflow_valid(&self, _last: u8) -> bool { true }
    }

    "sync-produced-by-everybody" {
        fn sync_producer_chosen(&self, _cob: u32) -> bool { true }
    }
    "sync-never-produced" {
        fn sync_producer_chosen(&self, _cob: u32) -> bool { false }
    }
    "sync-id-moves-while-producing" {
        fn sync_id_fixed_while_producing(&self) -> bool { false }
    }
    "sync-production-drifts" {
        fn sync_production_period(&self, configured: Duration) -> Duration {
            configured * 105 / 100
        }
    }
    "sync-period-in-whole-milliseconds" {
        fn sync_production_period(&self, configured: Duration) -> Duration {
            Duration::from_millis(configured.as_millis() as u64)
        }
    }
    "sync-produced-in-stopped" {
        fn sync_produced_in(&self, _state: NmtState) -> bool { true }
    }
    "sync-counter-from-0" {
        fn sync_counter_after(&self, counter: u8, overflow: u8) -> u8 {
            if counter >= overflow { 0 } else { counter + 1 }
        }
    }
    "sync-counter-ignores-overflow" {
        fn sync_counter_after(&self, counter: u8, _overflow: u8) -> u8 { counter.wrapping_add(1) }
    }
    "sync-counter-goes-on" {
        fn sync_counter_at_start(&self, last: u8) -> u8 { last }
    }
    "sync-window-ignored" {
        fn sync_window(&self, _configured: Duration) -> Duration { Duration::ZERO }
    }
    "sync-window-always" {
        fn sync_window(&self, _configured: Duration) -> Duration { Duration::from_millis(2) }
    }

    // TIME
    "time-produced-in-stopped" {
        fn time_used_in(&self, _state: NmtState) -> bool { true }
    }
    "time-stamp-of-any-length-used" {
        fn time_stamp(&self, data: &[u8]) -> Option<TimeOfDay> {
            TimeOfDay::decode(&Data::new(data).padded()[..6]).ok()
        }
    }

    // PDO parameters
    "pdo-cob-id-moves-while-valid" {
        fn cob_id_fixed_while_valid(&self) -> bool { false }
    }
    "pdo-inhibit-changes-while-valid" {
        fn pdo_parameter_fixed_while_valid(&self, _sub: u8) -> bool { false }
    }
    "pdo-restricted-id-accepted" {
        fn restricted_ids_refused(&self) -> bool { false }
    }
    "pdo-reserved-type-accepted" {
        fn transmission_type_valid(&self, _direction: Direction, _kind: u8) -> bool { true }
    }
    "tpdo-identifier-used-twice" {
        fn tpdo_ids_unique(&self) -> bool { false }
    }
    "pdo-without-mapping-exists" {
        fn pdo_needs_mapping(&self) -> bool { false }
    }
    "mapping-changes-while-valid" {
        fn mapping_fixed_while_valid(&self) -> bool { false }
    }
    "mapping-changes-while-active" {
        fn mapping_fixed_while_active(&self) -> bool { false }
    }
    "mapping-length-unchecked" {
        fn pdo_bits_max(&self) -> u32 { u32::MAX }
    }
    "mapping-length-off-by-one" {
        fn pdo_bits_max(&self) -> u32 { 72 }
    }
    "mapping-refused-but-written" {
        fn refused_write_changes_nothing(&self, mux: Mux) -> bool { !is_mapping(mux) }
    }
    "mapping-refused-sets-error-register" {
        fn refused_write_is_an_error(&self, mux: Mux) -> bool { is_mapping(mux) }
    }
    "mapping-wrong-abort-out-of-order" {
        fn abort_code(&self, mux: Mux, reason: Abort) -> Abort {
            if is_mapping(mux) && reason == Abort::ACCESS { Abort::READ_ONLY } else { reason }
        }
    }
    "mapping-of-any-object" {
        fn mappability_checked(&self) -> bool { false }
    }
    "mapping-entry-length-unchecked" {
        fn mapped_length_checked(&self) -> bool { false }
    }

    // PDOs
    "rpdo-used-in-pre-operational" {
        fn rpdo_used_in(&self, _state: NmtState) -> bool { true }
    }
    "rpdo-short-used" {
        fn rpdo_length_usable(&self, _mapped: usize, _actual: usize) -> bool { true }
    }
    "rpdo-long-dropped" {
        fn rpdo_length_usable(&self, mapped: usize, actual: usize) -> bool { mapped == actual }
    }
    "rpdo-length-not-told" {
        fn rpdo_length_told(&self) -> bool { false }
    }
    "rpdo-acts-before-sync" {
        fn synchronous_rpdo_waits(&self) -> bool { false }
    }
    "rpdo-first-before-sync-wins" {
        fn synchronous_rpdo_replaced(&self) -> bool { false }
    }
    "rpdo-acts-with-every-sync" {
        fn synchronous_rpdo_acts_once(&self) -> bool { false }
    }
    "rpdo-gap-takes-no-room" {
        fn gap_takes_room(&self) -> bool { false }
    }
    "rpdo-deadline-before-first" {
        fn first_rpdo_starts_deadline(&self) -> bool { false }
    }
    "tpdo-sent-in-stopped" {
        fn tpdo_sent_in(&self, state: NmtState) -> bool {
            matches!(state, NmtState::OPERATIONAL | NmtState::STOPPED)
        }
    }
    "tpdo-not-sent-at-start" {
        fn tpdo_sent_at_start(&self) -> bool { false }
    }
    "tpdo-one-sync-late" {
        fn cyclic_tpdo_due(&self, syncs: u8, kind: u8) -> bool { syncs > kind }
    }
    "tpdo-rtr-always-answered" {
        fn rtr_answered(&self, _cob: CobId) -> bool { true }
    }
    "tpdo-rtr-unanswered" {
        fn rtr_answered(&self, _cob: CobId) -> bool { false }
    }
    "tpdo-inhibit-in-milliseconds" {
        fn pdo_inhibit(&self, configured: u16) -> Duration {
            Duration::from_millis(configured.into())
        }
    }
    "tpdo-inhibit-ignored" {
        fn pdo_inhibit(&self, _configured: u16) -> Duration { Duration::ZERO }
    }
    "tpdo-event-timer-not-restarted" {
        fn event_timer_restarts(&self) -> bool { false }
    }

    // Store and restore
    "save-with-any-signature" {
        fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
            expected == got || expected == b"save"
        }
    }
    "load-with-any-signature" {
        fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
            expected == got || expected == b"load"
        }
    }
    "save-stores-half" {
        fn stored(&self, mux: Mux) -> bool { mux.index < 0x2000 }
    }
    "save-stores-nothing" {
        fn stored(&self, _mux: Mux) -> bool { false }
    }
    "save-forgets-sync" {
        fn stored(&self, mux: Mux) -> bool { !matches!(mux.index, 0x1006 | 0x1019) }
    }
    "parameter-groups-are-one" {
        fn parameter_group(&self, _sub: u8) -> RangeInclusive<u16> { 0x1000..=0xFFFF }
    }
    "parameter-groups-swapped" {
        fn parameter_group(&self, sub: u8) -> RangeInclusive<u16> {
            match sub {
                2 => 0x6000..=0x9FFF,
                3 => 0x1000..=0x1FFF,
                _ => 0x1000..=0xFFFF,
            }
        }
    }
    "save-completes-first" {
        fn save_completes_last(&self) -> bool { false }
    }
    "signature-survives-change" {
        fn change_clears_signature(&self) -> bool { false }
    }
    "save-without-sdo-channels" {
        fn stored(&self, mux: Mux) -> bool { !(0x1201..=0x12FF).contains(&mux.index) }
    }
    "load-at-once" {
        fn load_waits_for_reset(&self) -> bool { false }
    }
}

fn is_mapping(mux: Mux) -> bool {
    matches!(mux.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
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
