//! The state that every service works with.

use std::sync::Arc;

use canopen::eds::Eds;
use canopen::pdo::CobId;
use canopen::{Dictionary, Instant, NmtState};

use crate::rules::{Rules, Service};
use crate::stack::errors::Errors;
use crate::stack::fault::{Fault, FaultKind};
use crate::stack::settings::NodeSettings;

/// The node as its services see it: identity, state, decisions, objects and errors.
#[derive(Clone)]
pub(crate) struct Base {
    pub(crate) id: u8,
    pub(crate) state: NmtState,
    /// Whether an error has led there.
    pub(crate) by_error: bool,
    pub(crate) settings: NodeSettings,
    pub(crate) rules: Arc<Rules>,
    pub(crate) od: Dictionary,
    pub(crate) errors: Errors,
    /// Data types that may fill gaps in RPDOs.
    pub(crate) dummies: Vec<u16>,
    /// The smallest mappable unit in bits.
    pub(crate) granularity: u8,
    /// When the synchronous window closes that the last SYNC opened (1007h).
    pub(crate) window_end: Option<Instant>,
}

impl Base {
    /// The base of a device with this data sheet, whose objects are `od`.
    pub(crate) fn new(
        eds: &Eds,
        od: Dictionary,
        id: u8,
        settings: NodeSettings,
        rules: Rules,
    ) -> Self {
        Self {
            id,
            state: NmtState::INITIALISING,
            by_error: false,
            settings,
            rules: Arc::new(rules),
            od,
            errors: Errors::default(),
            dummies: eds.dummies.clone(),
            granularity: eds.device.granularity,
            window_end: None,
        }
    }

    /// Whether the device can use the identifier of a COB-ID: it has none of 29 bits, and one of 11
    /// bits has no further bits (CiA 301, 7.5.2.35).
    pub(crate) const fn has_room_for(&self, cob: CobId) -> bool {
        !cob.extended() && cob.stray_bits() == 0
    }

    /// The state by which a service acts.
    pub(crate) fn state_of(&self, service: Service) -> NmtState {
        if self.by_error && !self.rules.reaction_ends(service) {
            return NmtState::OPERATIONAL;
        }
        self.state
    }

    /// An error of the communication appeared.
    pub(crate) fn raise(&mut self, fault: Fault) {
        self.errors.raise_fault(fault, &self.settings.emcy, &self.rules);
    }

    /// The cause of an error of the communication is gone.
    pub(crate) fn mend(&mut self, kind: FaultKind, subject: u16) {
        if self.rules.communication_errors_end() {
            self.errors.remove(kind, subject);
        }
    }
}
