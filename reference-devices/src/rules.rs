//! Every decision that the specification takes, in one place.
//!
//! The stack asks and holds no deviation of its own. Read top to bottom, the default methods are
//! a summary of CiA 301; [`named`] gives the rules of a device that breaks one of them.

use std::ops::RangeInclusive;
use std::time::Duration;

use canopen::eds::Direction;
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::Request;
use canopen::timestamp::TimeOfDay;
use canopen::{Abort, Mux, NmtState};

mod lss;
mod mutants;
mod reset;
mod sdo_block;

pub use lss::LssRules;
pub use mutants::{named, names};
pub use reset::{Change, Reset};
pub use sdo_block::SdoBlockRules;

/// A device that keeps to the specification.
#[derive(Clone, Copy, Debug, Default)]
pub struct Specification;

impl Rules for Specification {}
impl LssRules for Specification {}
impl SdoBlockRules for Specification {}

/// The decisions. Clauses are those of CiA 301, version 4.2.
pub trait Rules: LssRules + SdoBlockRules + Send {
    // Network management, 7.2.8 and 7.3.2

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

    /// This node is no NMT master, so the other bits are not for it.
    fn startup_valid(&self, startup: u32) -> bool {
        startup & !(1 << 2) == 0
    }

    /// Reset communication ends the errors of the communication, and reset node all of them.
    fn reset_ends_errors(&self) -> bool {
        true
    }

    // Error control, 7.2.8.2 and 7.2.8.3.2

    /// The producer keeps the period of 1017h (7.5.2.20).
    fn heartbeat_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// The first heartbeat comes one period after boot-up.
    fn heartbeats_at_boot_up(&self) -> u32 {
        0
    }

    /// The consumer waits as long as 1016h says (7.5.2.19).
    fn heartbeat_consumer_time(&self, configured: Duration) -> Duration {
        configured
    }

    /// A node is watched from its first heartbeat on (7.2.8.3.2.2).
    fn first_heartbeat_starts_watch(&self) -> bool {
        true
    }

    /// The next heartbeat of a node that was lost ends the error.
    fn heartbeat_loss_recovers(&self) -> bool {
        true
    }

    /// Only the three states of a node that runs are a sign of life; a boot-up message tells of a
    /// restart.
    fn is_heartbeat(&self, state: NmtState) -> bool {
        matches!(state, NmtState::STOPPED | NmtState::OPERATIONAL | NmtState::PRE_OPERATIONAL)
    }

    /// Two entries of 1016h do not name the same node (7.5.2.19).
    fn heartbeat_node_watched_once(&self) -> bool {
        true
    }

    /// Guarding and heartbeat exclude each other, and heartbeat goes first (7.2.8.2.2.1).
    fn guarding_answered(&self, heartbeat_runs: bool) -> bool {
        !heartbeat_runs
    }

    /// The toggle bit alternates from answer to answer (7.2.8.3.2.1).
    fn guarding_toggle_after(&self, toggle: bool) -> bool {
        !toggle
    }

    /// It starts at 0 after a reset (7.2.8.3.2.1).
    fn guarding_toggle_after_reset(&self, _toggle: bool) -> bool {
        false
    }

    /// Life guarding waits for guard time times life time factor (7.5.2.12).
    fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
        guard_time * u32::from(factor)
    }

    /// While heartbeats are produced, there is no life guarding (7.2.8.2.2.1).
    fn heartbeat_ends_life_guarding(&self) -> bool {
        true
    }

    /// A communication error changes the state of an operational device only (7.5.2.32).
    fn errors_change(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// Each class of errors has its own entry of 1029h, communication errors sub 1 (7.5.2.32).
    fn error_class(&self, sub: u8) -> Option<u8> {
        Some(sub)
    }

    /// It decides: PRE-OPERATIONAL, nothing, or STOPPED (7.5.2.32).
    fn error_reaction(&self, configured: u8) -> Option<NmtState> {
        match configured {
            0 => Some(NmtState::PRE_OPERATIONAL),
            2 => Some(NmtState::STOPPED),
            _ => None,
        }
    }

    // SDO server, 7.2.4

    /// SDOs are served in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn sdo_served_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// A request has exactly eight bytes; anything else is no request (7.2.4.3).
    fn sdo_request(&self, data: &[u8]) -> Option<Request> {
        Request::decode(data).ok()
    }

    /// A command specifier that is not supported is answered with an abort (7.2.4.3.17).
    fn answers_unknown_command(&self) -> bool {
        true
    }

    /// The abort code names the reason (7.2.4.3.17).
    fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
        reason
    }

    /// An abort ends the transfer (7.2.4.3.17).
    fn abort_ends_transfer(&self, _code: Abort) -> bool {
        true
    }

    /// The toggle bit starts at 0 and alternates (7.2.4.3.4, 7.2.4.3.7).
    fn toggle_checked(&self, _first: bool) -> bool {
        true
    }

    /// A new initiate request replaces a transfer that was left open.
    fn initiate_replaces_transfer(&self) -> bool {
        true
    }

    /// An upload is of the object that was asked for, whatever was open before.
    fn uploaded(&self, requested: Mux, _open: Option<Mux>) -> Mux {
        requested
    }

    /// A segmented download need not tell its size (7.2.4.3.3).
    fn size_may_be_missing(&self) -> bool {
        true
    }

    /// A size that does not fit the object is refused before the first segment.
    fn size_checked_at_initiate(&self) -> bool {
        true
    }

    /// A download that ends before the size it told is refused.
    fn underflow_checked(&self) -> bool {
        true
    }

    /// A download that exceeds the size it told, or that of its object, is refused.
    fn overflow_checked(&self) -> bool {
        true
    }

    /// The server gives up a transfer whose next request does not come.
    fn sdo_timeout(&self, configured: Duration) -> Duration {
        configured
    }

    /// A transfer ends where SDOs are not served any more, and with a reset (7.3.2.2.5).
    fn stop_ends_sdo_transfers(&self) -> bool {
        true
    }

    /// The segments of an upload are of one value.
    fn upload_is_snapshot(&self) -> bool {
        true
    }

    /// Each server has its own transfer (7.2.4.1).
    fn sdo_servers_independent(&self) -> bool {
        true
    }

    /// A further channel exists when both of its identifiers are valid (7.5.2.33).
    fn sdo_channel_needs_both(&self) -> bool {
        true
    }

    /// A device without 29-bit identifiers refuses them.
    fn sdo_long_identifier_taken(&self) -> bool {
        false
    }

    /// The node at the other end is 1 to 127 (7.5.2.33).
    fn sdo_partner_valid(&self, node: u8) -> bool {
        (1..=127).contains(&node)
    }

    /// A client whose server does not answer says that it gives up (7.2.4.3.17).
    fn sdo_client_tells_timeout(&self) -> bool {
        true
    }

    /// Each request restarts that time, the first of a transfer and those that follow.
    fn request_restarts_sdo_timeout(&self, _first: bool) -> bool {
        true
    }

    // Access to objects, 7.4

    /// A value below or above the limits of its object is refused (7.2.4.3.17).
    fn range_checked(&self) -> bool {
        true
    }

    /// What is refused leaves the object as it was.
    fn refused_write_changes_nothing(&self, _mux: Mux) -> bool {
        true
    }

    /// A text that is written replaces all of the one before.
    fn shorter_text_ends_earlier(&self) -> bool {
        true
    }

    /// A refused write is the client's business and no error of the device.
    fn refused_write_is_an_error(&self, _mux: Mux) -> bool {
        false
    }

    /// An identifier is not changed while the service that uses it exists (7.5.2.17, 7.5.2.35).
    fn cob_id_fixed_while_valid(&self) -> bool {
        true
    }

    // Emergency, 7.2.7

    /// Emergency messages belong to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn emcy_sent_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// An error is told once, however often it is noticed (7.2.7.1).
    fn emcy_repeated(&self) -> bool {
        false
    }

    /// A message that cannot be sent at once waits.
    fn emcy_queued(&self) -> bool {
        true
    }

    /// 1015h counts 100 microseconds (7.5.2.18).
    fn emcy_inhibit(&self, configured: u16) -> Duration {
        Duration::from_micros(100) * u32::from(configured)
    }

    /// 1001h shows the errors that are present, and no others (7.5.2.2).
    fn error_register(&self, _before: u8, present: u8) -> u8 {
        present
    }

    /// 1003h sub 1 is the newest error (7.5.2.4).
    fn history_newest_first(&self) -> bool {
        true
    }

    /// 1003h sub 0 takes no value but 0 (7.5.2.4).
    fn history_count_valid(&self, count: u8) -> bool {
        count == 0
    }

    /// A line of 1003h that holds no error cannot be read (7.5.2.4).
    fn empty_history_readable(&self) -> bool {
        false
    }

    /// Reset communication forgets the messages that wait (7.3.2.2.1).
    fn reset_drops_emcy(&self) -> bool {
        true
    }

    /// 1003h keeps as many errors as it has sub-indices for them (7.5.2.4).
    fn history_depth(&self, lines: usize) -> usize {
        lines
    }

    // SYNC, 7.2.5

    /// SYNC is used in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn sync_used_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// 1006h counts microseconds (7.5.2.6).
    fn sync_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// A SYNC that does not come in time is told (7.2.7.1, 8100h).
    fn sync_loss_told(&self) -> bool {
        true
    }

    /// SYNC has a counter byte when 1019h is not 0, and no byte otherwise (7.2.5.3).
    fn sync_length_valid(&self, expected: usize, actual: usize) -> bool {
        expected == actual
    }

    /// The counter ends at 2 to 240; 0 is no counter (7.5.2.22).
    fn sync_overflow_valid(&self, last: u8) -> bool {
        matches!(last, 0 | 2..=240)
    }

    /// Bit 30 of 1005h makes the device the producer (7.5.2.5).
    fn sync_producer_chosen(&self, cob: u32) -> bool {
        cob & 1 << 30 != 0
    }

    /// The identifier stays while the device produces (7.5.2.5).
    fn sync_id_fixed_while_producing(&self) -> bool {
        true
    }

    /// The producer keeps the period of 1006h (7.5.2.6).
    fn sync_production_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// SYNC is produced in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn sync_produced_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// The counter begins anew with the production: what it was before the first SYNC (7.2.5.3).
    fn sync_counter_at_start(&self, _last: u8) -> u8 {
        0
    }

    /// It runs from 1 to the value of 1019h and begins again with 1 (7.2.5.3).
    fn sync_counter_after(&self, counter: u8, overflow: u8) -> u8 {
        if counter >= overflow { 1 } else { counter + 1 }
    }

    /// Synchronous RPDOs are used within the window of 1007h only, in microseconds (7.5.2.7).
    fn sync_window(&self, configured: Duration) -> Duration {
        configured
    }

    // TIME, 7.2.6

    /// TIME belongs to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn time_used_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// A time stamp has exactly six bytes (7.2.6.3).
    fn time_stamp(&self, data: &[u8]) -> Option<TimeOfDay> {
        TimeOfDay::decode(data).ok()
    }

    // PDO parameters, 7.5.2.35 to 7.5.2.38

    /// Inhibit time and SYNC start value do not change while the PDO exists.
    fn pdo_parameter_fixed_while_valid(&self, _sub: u8) -> bool {
        true
    }

    /// Identifiers of other services are refused (7.3.5).
    fn restricted_ids_refused(&self) -> bool {
        true
    }

    /// No two TPDOs that exist have one identifier: each belongs to one sender (7.3.5).
    fn tpdo_ids_unique(&self) -> bool {
        true
    }

    /// A PDO that maps nothing cannot be made to exist (7.5.2.36).
    fn pdo_needs_mapping(&self) -> bool {
        true
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

    /// Nor do its entries while they are in use: sub 0 is set to 0 first.
    fn mapping_fixed_while_active(&self) -> bool {
        true
    }

    /// A PDO carries at most 64 bits.
    fn pdo_bits_max(&self) -> u32 {
        64
    }

    /// What the device does not offer for this direction cannot be mapped.
    fn mappability_checked(&self) -> bool {
        true
    }

    /// An object is mapped with its own length.
    fn mapped_length_checked(&self) -> bool {
        true
    }

    // PDOs, 7.2.2

    /// RPDOs are used in OPERATIONAL (7.3.2.2.5).
    fn rpdo_used_in(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// A synchronous RPDO takes effect with the next SYNC (7.2.2.2).
    fn synchronous_rpdo_waits(&self) -> bool {
        true
    }

    /// Of several frames before a SYNC the last one counts (7.2.2.2).
    fn synchronous_rpdo_replaced(&self) -> bool {
        true
    }

    /// They take effect once, not with every SYNC that follows (7.2.2.2).
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

    /// Both are told (7.2.7.1, 8210h and 8220h).
    fn rpdo_length_told(&self) -> bool {
        true
    }

    /// TPDOs are sent in OPERATIONAL (7.3.2.2.5).
    fn tpdo_sent_in(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// Event-driven TPDOs are sent once on entering it.
    fn tpdo_sent_at_start(&self) -> bool {
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

    /// The event timer starts anew with each transmission (7.5.2.37).
    fn event_timer_restarts(&self) -> bool {
        true
    }

    // Store and restore, 7.5.2.13 and 7.5.2.14

    /// Nothing is done without the signature.
    fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
        expected == got
    }

    /// What is stored counts when it is complete, so that a loss of supply does no harm.
    fn save_completes_last(&self) -> bool {
        true
    }

    /// A parameter that changes sets 1020h to 0 (7.5.2.23).
    fn change_clears_signature(&self) -> bool {
        true
    }

    /// A sub-index of 1010h and 1011h is a group of objects; from 4 on, the manufacturer chooses.
    fn parameter_group(&self, sub: u8) -> RangeInclusive<u16> {
        match sub {
            2 => 0x1000..=0x1FFF,
            3 => 0x6000..=0x9FFF,
            4.. => 0x2000..=0x5FFF,
            _ => 0x1000..=0xFFFF,
        }
    }

    /// Every object of the group is stored.
    fn stored(&self, _mux: Mux) -> bool {
        true
    }

    /// Restored values are in force after the next reset.
    fn load_waits_for_reset(&self) -> bool {
        true
    }
}
