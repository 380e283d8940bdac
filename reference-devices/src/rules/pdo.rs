//! PDOs, their parameters and their mapping.

use std::time::Duration;

use canopen::eds::Direction;
use canopen::pdo::CobId;
use canopen::{Abort, Mux, NmtState};

use super::Rules;

decisions! {
    /// The decisions of RPDOs and TPDOs (CiA 301, 7.2.2 and 7.5.2.35 to 7.5.2.38).
    pub PdoDecision of Rules, otherwise [DEVIATIONS];

    // PDO parameters, 7.5.2.35 to 7.5.2.38

    /// Inhibit time and SYNC start value do not change while the PDO exists; transmission type
    /// and event timer may.
    fn pdo_parameter_fixed_while_valid(&self, sub: u8) -> bool {
        matches!(sub, 3 | 6)
    }

    /// PDOs are configured in every state in which there is SDO, their identifiers and mappings
    /// (`routes`) as the rest.
    fn pdos_configured_in(&self, state: NmtState, _routes: bool) -> bool {
        state != NmtState::STOPPED
    }

    /// Identifiers of other services are refused (7.3.5).
    fn restricted_ids_refused(&self) -> bool {
        true
    }

    /// A COB-ID may have bit 29, and with it an identifier of 29 bits: of PDOs, SYNC, TIME,
    /// emergency messages and further SDO channels. A device need not have them (7.5.2.35).
    fn long_identifiers_taken(&self) -> bool {
        false
    }

    /// Which identifier a PDO has that does not exist is looked at (7.5.2.35).
    fn restricted_ids_of_invalid_pdos_refused(&self) -> bool {
        false
    }

    /// Bit 30 of a TPDO can be cleared, so that remote requests are answered (7.5.2.37).
    fn remote_requests_can_be_allowed(&self) -> bool {
        true
    }

    /// No two TPDOs that exist have one identifier: each belongs to one sender (7.3.5).
    fn tpdo_ids_unique(&self) -> bool {
        true
    }

    /// The identifier of a TPDO is free while that TPDO is not valid (7.5.2.37).
    fn disabled_tpdo_leaves_its_id(&self) -> bool {
        true
    }

    /// A PDO that maps nothing cannot be made to exist (7.5.2.36).
    fn pdo_needs_mapping(&self, exists: bool) -> bool {
        exists
    }

    /// Types 241 to 251 are reserved, and only a TPDO can be asked for (types 252 and 253).
    fn transmission_type_valid(&self, direction: Direction, kind: u8) -> bool {
        match direction {
            Direction::Receive => matches!(kind, 0..=240 | 254..),
            Direction::Transmit => matches!(kind, 0..=240 | 252..),
        }
    }

    /// A mapping does not change while the PDO exists.
    fn mapping_fixed_while_valid(&self) -> bool {
        true
    }

    /// Mapped objects do not change while they are in use: sub 0 is set to 0 first (7.5.2.36).
    fn mapping_fixed_while_active(&self) -> bool {
        true
    }

    /// A PDO carries at most 64 bits.
    fn pdo_bits_max(&self) -> u32 {
        64
    }

    /// An object that the device does not offer for this direction cannot be mapped.
    fn mappability_checked(&self) -> bool {
        true
    }

    /// An object is mapped with its own length, of which some devices take the first bytes alone.
    fn mapped_length_valid(&self, own: Option<u8>, asked: u8) -> bool {
        own == Some(asked)
    }

    /// The number of mapped objects counts no entry that is empty.
    fn empty_entries_refused(&self) -> bool {
        true
    }

    /// An empty entry that is counted is a wrong number of entries.
    fn empty_entry(&self) -> Abort {
        Abort::VALUE
    }

    /// A gap is filled by a data type that the device offers for it, in an RPDO only (7.4.7).
    fn gaps_checked(&self) -> bool {
        true
    }

    /// A mapping that is written as it is is written while the PDO exists.
    fn same_mapping_taken(&self) -> bool {
        false
    }

    // PDOs, 7.2.2

    /// RPDOs are used in OPERATIONAL (7.3.2.2.5).
    fn rpdo_used_in(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// An RPDO that comes before OPERATIONAL does not wait for the first SYNC in it.
    fn rpdo_waits_in(&self, _state: NmtState) -> bool {
        false
    }

    /// A synchronous RPDO takes effect with the next SYNC (7.2.2.2).
    fn synchronous_rpdo_waits(&self) -> bool {
        true
    }

    /// A SYNC with the counter value of the start value begins the count of a TPDO, and without
    /// start value the first SYNC (7.5.2.37).
    fn syncs_before_first(&self, _kind: u8) -> u8 {
        0
    }

    /// The SYNC that begins the count is the first of it (7.5.2.37).
    fn syncs_before_start_value(&self, _kind: u8) -> u8 {
        0
    }

    /// The start value begins the count once; the counter passes it in each of its rounds
    /// (7.5.2.37).
    fn sync_start_begins_again(&self) -> bool {
        false
    }

    /// Of several frames before a SYNC the last one counts (7.2.2.2).
    fn synchronous_rpdo_replaced(&self) -> bool {
        true
    }

    /// The values of a frame take effect once, not with every SYNC that follows (7.2.2.2).
    fn synchronous_rpdo_acts_once(&self) -> bool {
        true
    }

    /// A gap in the mapping takes its bits of the frame (7.4.7).
    fn gap_takes_room(&self) -> bool {
        true
    }

    /// The deadline of an RPDO counts from its first reception on (7.5.2.35).
    fn first_rpdo_starts_deadline(&self) -> bool {
        true
    }

    /// An RPDO that is too short is not used; of one that is too long, the first bytes are
    /// (7.2.2.5).
    fn rpdo_length_usable(&self, mapped: usize, actual: usize) -> bool {
        actual >= mapped
    }

    /// A wrong length is reported (7.2.7.1, 8210h and 8220h).
    fn rpdo_length_told(&self) -> bool {
        true
    }

    /// Each RPDO has errors of its own (7.2.7.1).
    fn rpdo_length_error_of(&self, pdo: u16) -> u16 {
        pdo
    }

    /// A value outside the limits of its object is not used (7.4.5).
    fn rpdo_range_checked(&self) -> bool {
        true
    }

    /// An RPDO of the right length ends the error with a message (7.2.7.1).
    fn rpdo_length_end_told(&self) -> bool {
        true
    }

    /// TPDOs are sent in OPERATIONAL (7.3.2.2.5).
    fn tpdo_sent_in(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// TPDOs end with OPERATIONAL, regardless of their trigger.
    fn tpdo_goes_on_in(&self, _state: NmtState, _kind: u8) -> bool {
        false
    }

    /// An event that waits for the end of the inhibit time ends with OPERATIONAL.
    fn event_waits_in(&self, _state: NmtState) -> bool {
        false
    }

    /// Event-driven TPDOs are sent once on entering OPERATIONAL, also those with an object whose
    /// changes are `held_back`.
    fn tpdo_sent_at_start(&self, _held_back: bool) -> bool {
        true
    }

    /// Entering OPERATIONAL is no event for a TPDO of type 0.
    fn start_is_event_of_acyclic_tpdo(&self) -> bool {
        false
    }

    /// A new parameter is no event of any TPDO.
    fn tpdo_sent_when_configured(&self) -> bool {
        false
    }

    /// A TPDO with new parameters, or that starts anew, compares with the values of that moment
    /// instead of those that it transmitted last.
    fn transmission_ends_with_its_parameters(&self) -> bool {
        true
    }

    /// Type n, 1 to 240, is sent with every n-th SYNC (7.2.2.2).
    fn cyclic_tpdo_due(&self, syncs: u8, kind: u8) -> bool {
        syncs >= kind
    }

    /// Bit 30 of the COB-ID forbids remote requests (7.5.2.37).
    fn rtr_answered(&self, cob: CobId) -> bool {
        cob.rtr_allowed()
    }

    /// The inhibit time counts 100 microseconds (7.5.2.37).
    fn pdo_inhibit(&self, configured: u16) -> Duration {
        Duration::from_micros(100) * u32::from(configured)
    }

    /// The event timer restarts with each transmission (7.5.2.37).
    fn event_timer_restarts(&self) -> bool {
        true
    }

    /// What the event timer transmits is the last transmitted value.
    fn timer_transmission_remembered(&self) -> bool {
        true
    }

    /// The inhibit time applies to event-driven TPDOs, and to none that SYNC triggers (7.5.2.37).
    fn inhibit_time_applies(&self, kind: u8) -> bool {
        kind >= 254
    }

    /// The inhibit time holds back what the event timer triggers as well (7.5.2.37).
    fn event_timer_is_inhibited(&self) -> bool {
        true
    }

    /// Each PDO has parameters of its own (7.5.2.35 and 7.5.2.37).
    fn pdo_parameter_of(&self, _direction: Direction, pdo: u16, _sub: u8) -> u16 {
        pdo
    }

    /// A transmission that the inhibit time has delayed is made once (7.5.2.37).
    fn delayed_event_ends(&self) -> bool {
        true
    }

    /// What changes while a transmission waits is an event of the application, too.
    fn changes_noted_while_pending(&self) -> bool {
        true
    }

    /// A TPDO that is disabled forgets the event that waits (7.5.2.37).
    fn disabled_tpdo_forgets_its_event(&self) -> bool {
        true
    }

    /// A change is an event of every TPDO that carries the value (7.2.2.3).
    fn change_triggers_each_tpdo(&self) -> bool {
        true
    }

    /// A change is an event at any place in the PDO (7.2.2.3).
    fn tpdo_bytes_compared(&self, mapped: usize) -> usize {
        mapped
    }

    /// With a SYNC, every synchronous RPDO takes effect (7.2.2.2).
    fn sync_brings_each_rpdo(&self) -> bool {
        true
    }

    /// Data that wait for SYNC end with the node's stop, and with new parameters of their PDO.
    fn waiting_rpdo_dropped(&self, _by_stop: bool) -> bool {
        true
    }

    /// New parameters begin a new deadline (7.5.2.35).
    fn new_parameters_end_rpdo_deadline(&self) -> bool {
        true
    }

    /// A new event time counts for an RPDO that is monitored, too (7.5.2.35).
    fn new_rpdo_event_time_taken(&self, _monitored: bool) -> bool {
        true
    }

    /// An RPDO brings the value of each entry (7.5.2.36).
    fn rpdo_entries_used(&self, mapped: usize) -> usize {
        mapped
    }
}

/// Whether the object maps a PDO.
pub(super) fn is_mapping(mux: Mux) -> bool {
    matches!(mux.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
}

deviations! {
    DEVIATIONS of PdoDecision;

    "tpdo-sent-in-pre-operational" => tpdo_sent_in: |_, state| state != NmtState::STOPPED;
    "pdos-configured-in-pre-operational-only" =>
        pdos_configured_in: |_, state, _| state == NmtState::PRE_OPERATIONAL;
    "empty-entry-is-no-object" => empty_entry: |_| Abort::NO_OBJECT;
    "pdos-routed-in-pre-operational-only" =>
        pdos_configured_in: |_, state, routes| !routes || state == NmtState::PRE_OPERATIONAL;
    "event-timer-fixed-while-valid" =>
        pdo_parameter_fixed_while_valid: |_, sub| matches!(sub, 3 | 5 | 6);
    "pdo-synchronous-types-0-and-1-only" => transmission_type_valid: |_, direction, kind| {
        let rtr = direction == Direction::Transmit && matches!(kind, 252 | 253);
        rtr || matches!(kind, 0 | 1 | 254 | 255)
    };
    "pdo-without-synchronous-types" => transmission_type_valid: |_, _, kind| kind >= 254;
    "pdo-without-remote-types" =>
        transmission_type_valid: |_, _, kind| matches!(kind, 0..=240 | 254..);
    "pdo-with-type-255-only" => transmission_type_valid: |_, direction, kind| {
        let rtr = direction == Direction::Transmit && matches!(kind, 252 | 253);
        rtr || matches!(kind, 0..=240 | 255)
    };
    "rpdo-type-253-accepted" => transmission_type_valid: |_, direction, kind| {
        let remote = direction == Direction::Transmit && kind == 252;
        remote || matches!(kind, 0..=240 | 253..)
    };
    "mapping-of-the-first-bytes" => mapped_length_valid: |_, own, asked| {
        asked.is_multiple_of(8) && own.is_some_and(|own| asked <= own)
    };
    "rpdo-used-in-stopped" =>
        rpdo_used_in: |_, state| matches!(state, NmtState::OPERATIONAL | NmtState::STOPPED);
    "synchronous-rpdo-waits-for-operational" =>
        rpdo_waits_in: |_, state| state == NmtState::PRE_OPERATIONAL;
    "event-driven-tpdos-go-on-in-pre-operational" =>
        tpdo_goes_on_in: |_, state, kind| state == NmtState::PRE_OPERATIONAL && kind >= 254;
    "event-driven-tpdos-go-on-in-stopped" =>
        tpdo_goes_on_in: |_, state, kind| state == NmtState::STOPPED && kind >= 254;
    "cyclic-tpdos-go-on-in-pre-operational" => tpdo_goes_on_in: |_, state, kind| {
        state == NmtState::PRE_OPERATIONAL && matches!(kind, 1..=240)
    };
    "acyclic-tpdos-go-on-in-pre-operational" =>
        tpdo_goes_on_in: |_, state, kind| state == NmtState::PRE_OPERATIONAL && kind == 0;
    "remote-requests-answered-after-operational" => tpdo_goes_on_in: |_, state, kind| {
        state == NmtState::PRE_OPERATIONAL && matches!(kind, 252 | 253)
    };
    "delayed-tpdo-sent-in-pre-operational" =>
        event_waits_in: |_, state| state == NmtState::PRE_OPERATIONAL;
    "delayed-tpdo-sent-in-stopped" => event_waits_in: |_, state| state == NmtState::STOPPED;
    "rpdo-long-dropped" => rpdo_length_usable: |_, mapped, actual| mapped == actual;
    "tpdo-sent-in-stopped" =>
        tpdo_sent_in: |_, state| matches!(state, NmtState::OPERATIONAL | NmtState::STOPPED);
    "tpdo-counts-from-another-sync" => syncs_before_first: |_, kind| kind / 2;
    "tpdo-sent-with-the-sync-start-value" => syncs_before_start_value: |_, kind| kind - 1;
    "tpdo-one-sync-late" => cyclic_tpdo_due: |_, syncs, kind| syncs > kind;
    "tpdo-inhibit-in-milliseconds" =>
        pdo_inhibit: |_, configured| Duration::from_millis(configured.into());
    "tpdo-inhibit-in-tenths-of-a-second" =>
        pdo_inhibit: |_, configured| Duration::from_millis(100) * u32::from(configured);
    "held-back-inputs-not-sent-at-start" => tpdo_sent_at_start: |_, held_back| !held_back;
    "inhibit-time-of-every-tpdo" => inhibit_time_applies: |_, _| true;
    "inhibit-time-of-the-first-tpdo" => pdo_parameter_of: |_, direction, pdo, sub| {
        if (direction, sub) == (Direction::Transmit, 3) { 0 } else { pdo }
    };
    "sync-start-of-the-first-tpdo" => pdo_parameter_of: |_, direction, pdo, sub| {
        if (direction, sub) == (Direction::Transmit, 6) { 0 } else { pdo }
    };
    "type-of-the-first-rpdo" => pdo_parameter_of: |_, direction, pdo, sub| {
        if (direction, sub) == (Direction::Receive, 2) { 0 } else { pdo }
    };
    "changes-beyond-four-bytes-unseen" => tpdo_bytes_compared: |_, mapped| mapped.min(4);
    "rpdo-from-before-it-was-disabled" => waiting_rpdo_dropped: |_, by_stop| by_stop;
    "rpdo-from-before-stopped" => waiting_rpdo_dropped: |_, by_stop| !by_stop;
    "rpdo-event-time-fixed-while-monitored" => new_rpdo_event_time_taken: |_, monitored| !monitored;
    "rpdo-of-seven-entries" => rpdo_entries_used: |_, mapped| mapped.min(7);
}
