//! Every decision that the specification takes, in one place.
//!
//! The stack asks and holds no deviation of its own. Read top to bottom, the default methods are
//! a summary of CiA 301; [`named`] gives the rules of a device that breaks one of them.

use std::time::Duration;

use canopen::nmt::{Command, Service};
use canopen::sdo::Request;
use canopen::{Abort, Mux, NmtState};

use crate::nmt::{Change, Reset};

mod mutants;

pub use mutants::{named, names};

/// A device that keeps to the specification.
#[derive(Clone, Copy, Debug, Default)]
pub struct Specification;

impl Rules for Specification {}

/// The decisions. Clauses are those of CiA 301, version 4.2.
pub trait Rules: Send {
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

    /// Initialisation ends with one boot-up message (7.2.8.2.2.2).
    fn boot_up_messages(&self) -> u32 {
        1
    }

    /// A reset gives the objects of its areas their stored or default values (7.3.2.2.1).
    fn reset_restores(&self, _reset: Reset) -> bool {
        true
    }

    // Error control, 7.2.8.2 and 7.2.8.3.2

    /// The producer keeps the period of 1017h (7.5.2.17).
    fn heartbeat_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// The first heartbeat comes one period after boot-up.
    fn heartbeats_at_boot_up(&self) -> u32 {
        0
    }

    /// On a communication error, 1029h sub 1 decides: PRE-OPERATIONAL, nothing, or STOPPED
    /// (7.5.2.32).
    fn error_reaction(&self, configured: u8) -> Option<NmtState> {
        match configured {
            0 => Some(NmtState::PRE_OPERATIONAL),
            2 => Some(NmtState::STOPPED),
            _ => None,
        }
    }

    // SDO server, 7.2.4

    /// SDOs are served in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.6, table 37).
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

    /// Each request restarts that time.
    fn request_restarts_sdo_timeout(&self) -> bool {
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

    /// A refused write is the client's business and no error of the device.
    fn refused_write_is_an_error(&self, _mux: Mux) -> bool {
        false
    }

    /// An identifier is not changed while the service that uses it exists (7.5.2.13, 7.5.2.35).
    fn cob_id_fixed_while_valid(&self) -> bool {
        true
    }

    // Emergency, 7.2.7

    /// Emergency messages belong to PRE-OPERATIONAL and OPERATIONAL (table 37).
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

    /// 1015h counts 100 microseconds (7.5.2.14).
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
}
