//! Lasting effects of a frame on a device.

use std::fmt;

use canopen::Mux;
use canopen::nmt::Service;

/// The first communication parameter of an RPDO.
pub(super) const FIRST_RPDO: u16 = 0x1400;

/// Something that a frame does to a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Deed {
    /// Writes an object, by SDO or through the RPDO with this communication parameter.
    Write(Mux, Option<u16>),
    /// Maps an object into the RPDO with this communication parameter.
    Map(u16, Mux),
    /// Writes an object that the frame names, through the RPDO with this communication parameter.
    WriteAny(u16),
    /// NMT reset node.
    ResetNode,
    /// NMT reset communication.
    ResetCommunication,
    /// An NMT command to every node.
    AllNodes,
    /// LSS configure or activate bit timing parameters.
    BitTiming,
    /// LSS configure node id.
    NodeId,
    /// LSS store configuration.
    StoreLss,
}

impl Deed {
    /// The index of the object that it writes.
    pub const fn written(self) -> Option<u16> {
        match self {
            Self::Write(mux, _) => Some(mux.index),
            _ => None,
        }
    }

    /// The reset that an NMT service is.
    pub(crate) const fn of_service(service: Service) -> Option<Self> {
        match service {
            Service::RESET_NODE => Some(Self::ResetNode),
            Service::RESET_COMMUNICATION => Some(Self::ResetCommunication),
            _ => None,
        }
    }
}

impl fmt::Display for Deed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |parameter: &u16| parameter.saturating_sub(FIRST_RPDO) + 1;
        match self {
            Self::Write(mux, None) => write!(f, "write of {mux}"),
            Self::Write(mux, Some(rpdo)) => write!(f, "write of {mux} by RPDO{}", number(rpdo)),
            Self::Map(rpdo, mux) => write!(f, "mapping of {mux} into RPDO{}", number(rpdo)),
            Self::WriteAny(rpdo) => write!(f, "write by the multiplexed RPDO{}", number(rpdo)),
            Self::ResetNode => f.write_str("NMT reset node"),
            Self::ResetCommunication => f.write_str("NMT reset communication"),
            Self::AllNodes => f.write_str("NMT command to all nodes"),
            Self::BitTiming => f.write_str("LSS bit timing"),
            Self::NodeId => f.write_str("LSS node id"),
            Self::StoreLss => f.write_str("LSS store"),
        }
    }
}
