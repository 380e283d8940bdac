//! The consequences of NMT commands, as far as the rules decide them.

use std::ops::RangeInclusive;

use canopen::NmtState;

use crate::decisions::in_code_alone;

/// The consequence of an NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Another state.
    Enter(NmtState),
    /// Initialisation from the start.
    Reset(Reset),
}

/// The part of a device that restarts (CiA 301, 7.3.2.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Everything, as after power-on.
    Node,
    /// The communication profile area.
    Communication,
}

in_code_alone! { Change }

impl Reset {
    /// The objects that take their stored or default values.
    pub const fn objects(self) -> RangeInclusive<u16> {
        match self {
            Self::Node => 0x1000..=0xFFFF,
            Self::Communication => 0x1000..=0x1FFF,
        }
    }
}
