//! TIME (CiA 301, 7.2.6): the time of day for every node.

use std::fmt;

use crate::frame::{Data, Frame};
use crate::malformed::Malformed;

/// The identifier of TIME unless 1012h says otherwise.
pub const COB_ID: u16 = 0x100;

/// A time of day as TIME and the type TIME_OF_DAY carry it (CiA 301, 7.1.6.6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeOfDay {
    /// Days since 1 January 1984.
    pub days: u16,
    /// Milliseconds after midnight, 28 bits.
    pub milliseconds: u32,
}

impl TimeOfDay {
    /// Milliseconds of a day.
    pub const DAY: u32 = 24 * 60 * 60 * 1000;

    /// Whether two clocks show the same within two seconds, over midnight as well.
    pub fn is_near(self, other: Self) -> bool {
        let since =
            |time: Self| u64::from(time.days) * u64::from(Self::DAY) + u64::from(time.milliseconds);
        since(self).abs_diff(since(other)) <= 2_000
    }

    /// Decodes the bytes. The four reserved bits are ignored.
    ///
    /// # Errors
    /// [`Malformed`] when there are not exactly six.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        Malformed::unless(bytes, 6, 6)?;
        let milliseconds = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let days = u16::from_le_bytes([bytes[4], bytes[5]]);
        Ok(Self { days, milliseconds: milliseconds & MILLISECONDS })
    }

    /// Encodes the time; the reserved bits are zero.
    pub fn encode(self) -> Data {
        let [a, b, c, d] = (self.milliseconds & MILLISECONDS).to_le_bytes();
        let [low, high] = self.days.to_le_bytes();
        Data::from([a, b, c, d, low, high])
    }

    /// The whole frame on the default identifier.
    pub fn frame(self) -> Frame {
        Frame::new(COB_ID, self.encode())
    }

    /// The time that many milliseconds later; the first day follows the last one that can be
    /// expressed.
    #[must_use]
    pub const fn after(self, milliseconds: u64) -> Self {
        let total = self.milliseconds as u64 + milliseconds;
        let days = (self.days as u64 + total / Self::DAY as u64) & 0xFFFF;
        Self { days: days as u16, milliseconds: (total % Self::DAY as u64) as u32 }
    }
}

impl fmt::Display for TimeOfDay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.milliseconds / 1_000;
        let (hours, minutes) = (seconds / 3_600, seconds / 60 % 60);
        write!(f, "{hours:02}:{minutes:02}:{:02}.", seconds % 60)?;
        write!(f, "{:03}, {} days after 1984-01-01", self.milliseconds % 1_000, self.days)
    }
}

const MILLISECONDS: u32 = 0x0FFF_FFFF;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_and_times() {
        let table = [
            ([0, 0, 0, 0, 0, 0], TimeOfDay::default()),
            (
                [0x95, 0x2C, 0xB3, 0x02, 0x98, 0x3A],
                TimeOfDay { days: 15_000, milliseconds: 45_296_789 },
            ),
            (
                [0xFF, 0xFF, 0xFF, 0x0F, 0xFF, 0xFF],
                TimeOfDay { days: 65_535, milliseconds: MILLISECONDS },
            ),
        ];
        for (bytes, time) in table {
            assert_eq!(TimeOfDay::decode(&bytes), Ok(time));
            assert_eq!(*time.encode(), bytes);
        }
    }

    #[test]
    fn a_day_ends_at_midnight() {
        let late = TimeOfDay { days: 1, milliseconds: TimeOfDay::DAY - 1 };
        assert_eq!(late.after(1), TimeOfDay { days: 2, milliseconds: 0 });
        assert_eq!(late.after(u64::from(TimeOfDay::DAY)).days, 2);
        let last = TimeOfDay { days: u16::MAX, milliseconds: 0 };
        assert_eq!(last.after(u64::from(TimeOfDay::DAY)), TimeOfDay::default());
    }

    proptest! {
        #[test]
        fn round_trip(bytes in proptest::collection::vec(any::<u8>(), 0..=8)) {
            match TimeOfDay::decode(&bytes) {
                Ok(time) => prop_assert_eq!(TimeOfDay::decode(&time.encode()), Ok(time)),
                Err(_) => prop_assert_ne!(bytes.len(), 6),
            }
        }
    }
}
