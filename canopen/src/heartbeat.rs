//! Error control: boot-up, heartbeat and the answer to node guarding (CiA 301, 7.2.8.2.2, .3).

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;
use crate::nmt::NmtState;

/// The identifier of node 0's error control; add the node id.
pub const COB_ID: u16 = 0x700;

/// A state report: boot-up, heartbeat or guarding answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorControl {
    /// The NMT state; INITIALISING is the boot-up message.
    pub state: NmtState,
    /// The toggle bit of node guarding, always 0 in a heartbeat.
    pub toggle: bool,
}

impl ErrorControl {
    /// The boot-up message.
    pub const BOOT_UP: Self = Self::heartbeat(NmtState::INITIALISING);

    /// A heartbeat that reports `state`.
    pub const fn heartbeat(state: NmtState) -> Self {
        Self { state, toggle: false }
    }

    /// Decodes the byte.
    ///
    /// # Errors
    /// [`Malformed`] when there is not exactly one.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 1, 1)?;
        Ok(Self { state: NmtState(bytes[0] & 0x7F), toggle: bytes[0] & 0x80 != 0 })
    }

    /// Encodes it as one byte.
    pub fn encode(self) -> Data {
        Data::from([self.state.0 & 0x7F | u8::from(self.toggle) << 7])
    }

    /// The whole frame of node `node`.
    pub fn frame(self, node: u8) -> Frame {
        Frame::new(COB_ID + u16::from(node & 0x7F), self.encode())
    }
}

/// The remote frame by which a master asks node `node` for its state.
pub fn guarding_request(node: u8) -> Frame {
    Frame::remote(COB_ID + u16::from(node & 0x7F), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_reports() {
        let table = [
            (0x00, ErrorControl::BOOT_UP),
            (0x7F, ErrorControl::heartbeat(NmtState::PRE_OPERATIONAL)),
            (0x85, ErrorControl { state: NmtState::OPERATIONAL, toggle: true }),
        ];
        for (byte, report) in table {
            assert_eq!(ErrorControl::decode(&[byte]), Ok(report));
            assert_eq!(*report.encode(), [byte]);
        }
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match ErrorControl::decode(&bytes) {
                Ok(report) => prop_assert_eq!(&*report.encode(), &bytes[..]),
                Err(_) => prop_assert_ne!(bytes.len(), 1),
            }
        }
    }
}
