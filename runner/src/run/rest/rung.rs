//! The names, the order and the effects of the ways to get a device back.

use crate::protect::Deed;

/// One way to get a device back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rung {
    /// Time.
    Patience,
    /// An SDO abort, which ends an open transfer.
    Abort,
    /// NMT enter pre-operational.
    PreOperational,
    /// NMT reset communication.
    ResetCommunication,
    /// NMT reset node.
    ResetNode,
    /// The same to every node.
    ResetAll,
    /// Its node id, given by layer setting services.
    NodeId,
    /// A program of the user's that resets it.
    ResetHook,
    /// A program of the user's that switches its supply off and on.
    PowerHook,
}

/// All of them, in order. A server may keep a transfer through a reset, hence the second abort.
pub(super) const LADDER: [Rung; 10] = [
    Rung::Patience,
    Rung::Abort,
    Rung::PreOperational,
    Rung::ResetCommunication,
    Rung::ResetNode,
    Rung::Abort,
    Rung::ResetAll,
    Rung::NodeId,
    Rung::ResetHook,
    Rung::PowerHook,
];

/// The place of [`Rung::ResetNode`] in [`LADDER`].
pub(super) const RESET_NODE: usize = 4;

impl Rung {
    /// The name in reports.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Patience => "waiting",
            Self::Abort => "an SDO abort",
            Self::PreOperational => "NMT enter pre-operational",
            Self::ResetCommunication => "reset communication",
            Self::ResetNode => "reset node",
            Self::ResetAll => "reset of all nodes",
            Self::NodeId => "LSS, which configured its node id",
            Self::ResetHook => "the program `reset`",
            Self::PowerHook => "the program `power`",
        }
    }

    /// Whether errors that stand after it will not go away.
    pub(super) const fn clears_errors(self) -> bool {
        match self {
            Self::Patience | Self::Abort | Self::PreOperational | Self::ResetCommunication => false,
            Self::ResetNode | Self::ResetAll | Self::NodeId | Self::ResetHook | Self::PowerHook => {
                true
            }
        }
    }

    /// The effects on the device, from which it may be protected.
    pub(super) const fn deeds(self) -> &'static [Deed] {
        match self {
            Self::Patience | Self::Abort | Self::PreOperational => &[],
            // The user's own hooks are always permitted.
            Self::ResetHook | Self::PowerHook => &[],
            Self::ResetCommunication => &[Deed::ResetCommunication],
            Self::ResetNode => &[Deed::ResetNode],
            Self::ResetAll => &[Deed::ResetNode, Deed::AllNodes],
            // A slave without node id needs no reset; of the resets for others, those that are
            // allowed are sent.
            Self::NodeId => &[Deed::NodeId],
        }
    }
}
