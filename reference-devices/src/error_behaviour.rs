//! What the device does on a communication error (CiA 301, 7.5.2.32, object 1029h).

use canopen::{Mux, NmtState};

use crate::services::Base;

/// The state that a communication error leads to; `None` when it changes nothing. Without 1029h
/// an operational device goes to PRE-OPERATIONAL.
pub(crate) fn reaction(base: &Base) -> Option<NmtState> {
    if !base.rules.errors_change(base.state) {
        return None;
    }
    base.rules.error_reaction(base.od.int(COMMUNICATION_ERROR).unwrap_or(0) as u8)
}

const COMMUNICATION_ERROR: Mux = Mux::new(0x1029, 1);
