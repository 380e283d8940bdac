//! The reaction of the device to an error (CiA 301, 7.5.2.32, object 1029h).

use canopen::{Mux, NmtState};

use crate::stack::base::Base;

/// The state that an error of class `sub` leads to; `None` when it changes nothing.
/// Without that entry an operational device goes to PRE-OPERATIONAL.
pub(crate) fn reaction(base: &Base, sub: u8) -> Option<NmtState> {
    if !base.rules.errors_change(base.state) {
        return None;
    }
    let entry = Mux::new(ERROR_BEHAVIOUR, base.rules.error_class(sub)?);
    base.rules.error_reaction(base.od.int(entry).unwrap_or(0) as u8)
}

const ERROR_BEHAVIOUR: u16 = 0x1029;
