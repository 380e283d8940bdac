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
    /// NMT start.
    Start,
    /// NMT stop.
    Stop,
    /// NMT reset node.
    ResetNode,
    /// NMT reset communication.
    ResetCommunication,
    /// An NMT command to every node.
    AllNodes,
    /// LSS switch state global, but to waiting: from then on every slave takes requests.
    AllSlaves,
    /// LSS configure or activate bit timing parameters.
    BitTiming,
    /// LSS configure node id.
    NodeId,
    /// LSS store configuration.
    StoreLss,
    /// A heartbeat, or a guarding request, which the device may miss when no more come.
    Watch,
    /// A stimulus on the bench.
    Stimulus,
    /// Another heartbeat of another node, which every node of the bus may miss.
    Partner,
}

impl Deed {
    /// The object that it writes.
    pub const fn object(self) -> Option<Mux> {
        match self {
            Self::Write(mux, _) => Some(mux),
            _ => None,
        }
    }

    /// The index of the object that it writes.
    pub const fn written(self) -> Option<u16> {
        match self.object() {
            Some(mux) => Some(mux.index),
            None => None,
        }
    }

    /// Whether it may move an output: by the state of the device, by an error that follows, or by
    /// a parameter of the application.
    pub(super) const fn moves_outputs(self) -> bool {
        match self {
            // SYNC, guarding, what is monitored, error behaviour, RPDOs and self-start.
            Self::Write(mux, _) => matches!(
                mux.index,
                0x1006 | 0x100C..=0x100D | 0x1011 | 0x1016 | 0x1029 | 0x1400..=0x17FF | 0x1F80
                    | 0x2000..
            ),
            // A command to all nodes is also one to this node, and so is a request to all slaves.
            Self::AllNodes | Self::AllSlaves => false,
            Self::Map(..)
            | Self::WriteAny(_)
            | Self::Start
            | Self::Stop
            | Self::ResetNode
            | Self::ResetCommunication
            | Self::BitTiming
            | Self::NodeId
            | Self::StoreLss
            | Self::Watch
            | Self::Stimulus
            | Self::Partner => true,
        }
    }

    /// What an NMT service does.
    pub(crate) const fn of_service(service: Service) -> Option<Self> {
        match service {
            Service::START => Some(Self::Start),
            Service::STOP => Some(Self::Stop),
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
            Self::Start => f.write_str("NMT start"),
            Self::Stop => f.write_str("NMT stop"),
            Self::ResetNode => f.write_str("NMT reset node"),
            Self::ResetCommunication => f.write_str("NMT reset communication"),
            Self::AllNodes => f.write_str("NMT command to all nodes"),
            Self::AllSlaves => f.write_str("LSS switch state global"),
            Self::BitTiming => f.write_str("LSS bit timing"),
            Self::NodeId => f.write_str("LSS node id"),
            Self::StoreLss => f.write_str("LSS store"),
            Self::Watch => f.write_str("heartbeat or guarding of a node"),
            Self::Stimulus => f.write_str("stimulus on the bench"),
            Self::Partner => f.write_str("change of the heartbeat of another node"),
        }
    }
}
