//! SYNC (CiA 301, 7.2.5).

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;

/// The identifier of SYNC unless 1005h says otherwise.
pub const COB_ID: u16 = 0x080;

/// A SYNC message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync {
    /// The counter, when 1019h is not 0.
    pub counter: Option<u8>,
}

impl Sync {
    /// Decodes the bytes.
    ///
    /// # Errors
    /// [`Malformed`] when there is more than one.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 0, 1)?;
        Ok(Self { counter: bytes.first().copied() })
    }

    /// Encodes the message.
    pub fn encode(self) -> Data {
        self.counter.map_or(Data::EMPTY, |counter| Data::from([counter]))
    }

    /// The whole frame on the default identifier.
    pub fn frame(self) -> Frame {
        Frame::new(COB_ID, self.encode())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_messages() {
        assert_eq!(Sync::decode(&[]), Ok(Sync { counter: None }));
        assert_eq!(Sync::decode(&[7]), Ok(Sync { counter: Some(7) }));
        assert_eq!(Sync { counter: None }.frame().to_string(), "080#");
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match Sync::decode(&bytes) {
                Ok(sync) => prop_assert_eq!(&*sync.encode(), &bytes[..]),
                Err(_) => prop_assert!(bytes.len() > 1),
            }
        }
    }
}
