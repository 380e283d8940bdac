//! Edits of a frame.

use canopen::sdo::Request;
use canopen::{Data, Frame, Mux};

/// The new content of a frame.
#[derive(Clone, Debug)]
pub(super) enum Edit {
    /// This one.
    Frame(Frame),
    /// A byte is another one.
    Byte(usize, Odd),
    /// It has a byte more, or one less where it is full.
    Length,
    /// The data of an expedited upload are others.
    Value(Vec<u8>),
    /// The number in the answer to an expedited upload of this object is so much larger.
    Larger([u8; 3], u32),
    /// This frame becomes that one.
    Swapped(Frame, Frame),
    /// These data of an expedited upload become those.
    Instead(Vec<u8>, Vec<u8>),
    /// A refusal becomes a confirmation of what was asked for.
    Taken,
    /// An SDO answer becomes a refusal with this code.
    Refused(u32),
}

/// How firmware gets a byte wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Odd {
    Stale(u8),
    Zeroed,
    Ones,
    OneMore,
    OneLess,
    HighNibble,
    LowNibble,
    Inverted,
}

impl Odd {
    /// Every way, those first that happen most; `stale` is what stood there in the last answer.
    pub(super) fn all(stale: Option<u8>) -> impl Iterator<Item = Self> {
        let others = [
            Self::Zeroed,
            Self::Ones,
            Self::OneMore,
            Self::OneLess,
            Self::HighNibble,
            Self::LowNibble,
            Self::Inverted,
        ];
        stale.map(Self::Stale).into_iter().chain(others)
    }

    pub(super) const fn of(self, byte: u8) -> u8 {
        match self {
            Self::Stale(stale) => stale,
            Self::Zeroed => 0,
            Self::Ones => 0xFF,
            Self::OneMore => byte.wrapping_add(1),
            Self::OneLess => byte.wrapping_sub(1),
            Self::HighNibble => byte ^ 0x10,
            Self::LowNibble => byte ^ 0x01,
            Self::Inverted => !byte,
        }
    }

    pub(super) const fn says(self) -> &'static str {
        match self {
            Self::Stale(_) => "is that of the last answer",
            Self::Zeroed => "is zero",
            Self::Ones => "is all ones",
            Self::OneMore => "is one too many",
            Self::OneLess => "is one too few",
            Self::HighNibble => "has another bit 4",
            Self::LowNibble => "has another bit 0",
            Self::Inverted => "is inverted",
        }
    }
}

impl Edit {
    /// The frame that is sent instead; `request` is what it answers.
    pub(super) fn apply(&self, frame: &Frame, request: Option<&Frame>) -> Frame {
        let mut bytes = frame.data.to_vec();
        match self {
            Self::Frame(other) => return *other,
            Self::Byte(place, odd) => {
                if let Some(byte) = bytes.get_mut(*place) {
                    *byte = odd.of(*byte);
                }
            }
            Self::Length => match bytes.len() {
                8 => _ = bytes.pop(),
                _ => bytes.push(0),
            },
            Self::Value(value) => {
                if let Some(data) = expedited(&mut bytes).and_then(|all| all.get_mut(..value.len()))
                {
                    data.copy_from_slice(value);
                }
            }
            Self::Larger(mux, by) => {
                let unused = bytes.first().map_or(0, |first| usize::from(first >> 2 & 3));
                let same = bytes.get(1..4) == Some(&mux[..]);
                if let Some(data) = expedited(&mut bytes).filter(|_| same) {
                    let number = u32::from_le_bytes([data[0], data[1], data[2], data[3]]);
                    let larger = number.wrapping_add(*by).to_le_bytes();
                    let used = 4 - unused;
                    data[..used].copy_from_slice(&larger[..used]);
                }
            }
            Self::Swapped(old, other) if frame == old => return *other,
            Self::Swapped(..) => {}
            Self::Instead(old, other) => {
                let data = expedited(&mut bytes).and_then(|all| all.get_mut(..other.len()));
                if let Some(data) = data.filter(|data| **data == old[..]) {
                    data.copy_from_slice(other);
                }
            }
            Self::Taken => {
                let refusal = bytes.first() == Some(&0x80);
                if let Some(request) = request.filter(|_| refusal) {
                    return Frame { data: confirmation(&request.data), ..*frame };
                }
            }
            Self::Refused(code) => {
                let mux = request.and_then(|request| mux_of(&request.data));
                let mux = mux.map_or([0; 3], |mux| mux.bytes());
                bytes = [&[0x80][..], &mux, &code.to_le_bytes()].concat();
            }
        }
        Frame { data: Data::new(&bytes), ..*frame }
    }
}

/// The four bytes of data in the answer to an expedited upload.
fn expedited(bytes: &mut [u8]) -> Option<&mut [u8]> {
    let is_expedited = bytes.first().is_some_and(|first| first & 0xE2 == 0x42);
    bytes.get_mut(4..).filter(|_| is_expedited)
}

/// The answer of a server that accepts everything.
fn confirmation(request: &[u8]) -> Data {
    let mux = [1, 2, 3].map(|place| request.get(place).copied().unwrap_or(0));
    let [low, high, sub] = mux;
    let first = request.first().copied().unwrap_or(0);
    match first >> 5 {
        0 => [0x20 | first & 0x10, 0, 0, 0, 0, 0, 0, 0].into(),
        1 => [0x60, low, high, sub, 0, 0, 0, 0].into(),
        2 => [0x43, low, high, sub, 0, 0, 0, 0].into(),
        3 => [0x0F | first & 0x10, 0, 0, 0, 0, 0, 0, 0].into(),
        6 if first & 1 == 0 => [0xA0, low, high, sub, 127, 0, 0, 0].into(),
        6 => [0xA1, 0, 0, 0, 0, 0, 0, 0].into(),
        _ => [0xC2, low, high, sub, 1, 0, 0, 0].into(),
    }
}

/// The object of a request, if the request names one.
fn mux_of(request: &[u8]) -> Option<Mux> {
    match Request::decode(request).ok()? {
        Request::Upload(mux) | Request::Download(mux, _) | Request::Abort(mux, _) => Some(mux),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_becomes_what_the_request_asked_for() {
        let edited = |edit: Edit, frame: &str, request: &str| {
            let request: Frame = request.parse().unwrap();
            edit.apply(&frame.parse().unwrap(), Some(&request)).to_string()
        };
        let refusal = "585#8017100002000106";
        for (request, confirmed) in [
            ("605#2B1710000A000000", "585#6017100000000000"),
            ("605#4017100000000000", "585#4317100000000000"),
            ("605#0D00000000000000", "585#2000000000000000"),
            ("605#C617100002000000", "585#A01710007F000000"),
        ] {
            assert_eq!(edited(Edit::Taken, refusal, request), confirmed);
        }
        let answer = "585#4B1710000A000000";
        let request = "605#4017100000000000";
        assert_eq!(edited(Edit::Taken, answer, request), answer);
        assert_eq!(edited(Edit::Refused(0x0800_0000), answer, request), "585#8017100000000008");
        let value = Edit::Value(vec![0x34, 0x12]);
        assert_eq!(edited(value, answer, request), "585#4B17100034120000");
        let other = Edit::Larger([0x18, 0x10, 0], 1);
        assert_eq!(edited(other, answer, request), answer);
        let same = Edit::Larger([0x17, 0x10, 0], 0xFFFF);
        assert_eq!(edited(same, answer, request), "585#4B17100009000000");
    }
}
