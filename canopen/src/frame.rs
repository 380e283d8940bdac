//! A classical CAN data or remote frame, and its candump text form.

use std::fmt;
use std::ops::Deref;
use std::str::FromStr;

/// A CAN identifier: 11 bits, or 29 bits when it is extended.
///
/// Ordered as the wire arbitrates: the smaller one wins (ISO 11898-1).
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Id(u32);

impl Id {
    const EXTENDED: u32 = 1 << 31;

    /// An 11-bit identifier; higher bits are cut off.
    pub const fn standard(id: u16) -> Self {
        Self((id & 0x7FF) as u32)
    }

    /// A 29-bit identifier; higher bits are cut off.
    pub const fn extended(id: u32) -> Self {
        Self(id & 0x1FFF_FFFF | Self::EXTENDED)
    }

    /// Whether this is a 29-bit identifier.
    pub const fn is_extended(self) -> bool {
        self.0 & Self::EXTENDED != 0
    }

    /// The identifier's number, without a format flag.
    pub const fn raw(self) -> u32 {
        self.0 & !Self::EXTENDED
    }

    /// The number of an 11-bit identifier, `None` for a 29-bit one.
    pub const fn as_standard(self) -> Option<u16> {
        if self.is_extended() { None } else { Some(self.0 as u16) }
    }

    /// A key that sorts as the wire arbitrates: by the leading 11 bits, then standard before
    /// extended, then the rest.
    pub const fn priority(self) -> u32 {
        if self.is_extended() {
            let id = self.raw();
            (id >> 18) << 19 | 1 << 18 | id & 0x3_FFFF
        } else {
            self.0 << 19
        }
    }
}

impl From<u16> for Id {
    fn from(id: u16) -> Self {
        Self::standard(id)
    }
}

impl PartialOrd for Id {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Id {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.priority().cmp(&other.priority())
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = Text::default();
        text.id(*self);
        f.write_str(text.as_str())
    }
}

impl fmt::Debug for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}h")
    }
}

/// Up to eight data bytes. Dereferences to the bytes in use.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Data {
    bytes: [u8; 8],
    len: u8,
}

impl Data {
    /// No data.
    pub const EMPTY: Self = Self { bytes: [0; 8], len: 0 };

    /// The first eight bytes of `bytes`; more do not fit a classical CAN frame.
    pub fn new(bytes: &[u8]) -> Self {
        if let Some(whole) = bytes.first_chunk() {
            return Self { bytes: *whole, len: 8 };
        }
        let len = bytes.len();
        let mut data = Self { bytes: [0; 8], len: len as u8 };
        data.bytes[..len].copy_from_slice(bytes);
        data
    }

    /// Appends one byte; `false` when the frame is full.
    pub fn push(&mut self, byte: u8) -> bool {
        if self.len == 8 {
            return false;
        }
        self.bytes[usize::from(self.len)] = byte;
        self.len += 1;
        true
    }

    /// All eight bytes; those after the end are zero.
    pub const fn padded(&self) -> [u8; 8] {
        self.bytes
    }
}

impl Deref for Data {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}

impl<const N: usize> From<[u8; N]> for Data {
    fn from(bytes: [u8; N]) -> Self {
        const { assert!(N <= 8) }
        Self::new(&bytes)
    }
}

impl fmt::Display for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = Text::default();
        text.data(self);
        f.write_str(text.as_str())
    }
}

impl fmt::Debug for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{self}]")
    }
}

/// A classical CAN frame. `Display` and `FromStr` are the candump form: `605#4000100000000000`,
/// `70A#R` for a remote frame, eight hex digits for a 29-bit identifier.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// The identifier.
    pub id: Id,
    /// The data; of a remote frame only the length is on the wire.
    pub data: Data,
    /// Whether this is a remote transmission request.
    pub remote: bool,
}

impl Frame {
    /// A data frame. A number is an 11-bit identifier.
    pub fn new(id: impl Into<Id>, data: impl Into<Data>) -> Self {
        Self { id: id.into(), data: data.into(), remote: false }
    }

    /// A remote frame that asks for `len` bytes. A number is an 11-bit identifier.
    pub fn remote(id: impl Into<Id>, len: u8) -> Self {
        let data = Data { bytes: [0; 8], len: len.min(8) };
        Self { id: id.into(), data, remote: true }
    }

    /// The 11-bit identifier of a data frame; `None` for remote and 29-bit frames. Every service of
    /// the pre-defined connection set but node guarding uses it (CiA 301, 7.3.3).
    pub fn data_id(&self) -> Option<u16> {
        if self.remote { None } else { self.id.as_standard() }
    }

    /// The identifier of a data frame, of 11 or 29 bits; `None` for remote frames. A service whose
    /// identifier an object holds may use either (CiA 301, 7.5.2.35).
    pub const fn any_data_id(&self) -> Option<Id> {
        if self.remote { None } else { Some(self.id) }
    }
}

impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = Text::default();
        text.id(self.id);
        text.push(b'#');
        match (self.remote, self.data.len()) {
            (true, 0) => text.push(b'R'),
            (true, len) => {
                text.push(b'R');
                text.digit(len as u32);
            }
            (false, _) => text.data(&self.data),
        }
        f.write_str(text.as_str())
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A frame's text while it is put together. Nearly all of a journal is frames, and writing each
/// digit through a formatter takes most of the time.
#[derive(Default)]
struct Text {
    /// As long as the longest: eight digits, `#`, sixteen digits.
    bytes: [u8; 25],
    len: usize,
}

impl Text {
    fn push(&mut self, byte: u8) {
        self.bytes[self.len] = byte;
        self.len += 1;
    }

    /// The lowest four bits of `number`.
    fn digit(&mut self, number: u32) {
        self.push(b"0123456789ABCDEF"[number as usize & 0xF]);
    }

    fn id(&mut self, id: Id) {
        let digits = if id.is_extended() { 8 } else { 3 };
        (0..digits).rev().for_each(|place| self.digit(id.raw() >> (4 * place)));
    }

    fn data(&mut self, data: &[u8]) {
        for byte in data {
            self.digit(u32::from(byte >> 4));
            self.digit(u32::from(*byte));
        }
    }

    fn as_str(&self) -> &str {
        str::from_utf8(&self.bytes[..self.len]).expect("digits are ASCII")
    }
}

/// Why a text is not a frame in candump form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// There is no `#` between identifier and data.
    NoHash,
    /// The identifier is not 3 or 8 hex digits, or exceeds 7FFh or 1FFFFFFFh.
    Id,
    /// The data are not pairs of hex digits, or more than eight bytes.
    Data,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoHash => "a frame is written `605#4000100000000000`: the `#` is missing",
            Self::Id => "an identifier is 3 hex digits up to 7FF, or 8 up to 1FFFFFFF",
            Self::Data => "data are at most 8 pairs of hex digits, or `R` and a length up to 8",
        })
    }
}

impl std::error::Error for FrameError {}

impl FromStr for Frame {
    type Err = FrameError;

    fn from_str(text: &str) -> Result<Self, FrameError> {
        let (id, rest) = text.split_once('#').ok_or(FrameError::NoHash)?;
        let id = parse_id(id).ok_or(FrameError::Id)?;
        if let Some(len) = rest.strip_prefix(['R', 'r']) {
            let len = if len.is_empty() { 0 } else { len.parse().map_err(|_| FrameError::Data)? };
            if len > 8 {
                return Err(FrameError::Data);
            }
            return Ok(Self { id, data: Data { bytes: [0; 8], len }, remote: true });
        }
        let mut data = Data::EMPTY;
        let digits = rest.as_bytes();
        if !digits.len().is_multiple_of(2) {
            return Err(FrameError::Data);
        }
        for pair in digits.chunks_exact(2) {
            let byte = hex(pair[0]).zip(hex(pair[1])).ok_or(FrameError::Data)?;
            if !data.push(byte.0 << 4 | byte.1) {
                return Err(FrameError::Data);
            }
        }
        Ok(Self { id, data, remote: false })
    }
}

fn parse_id(text: &str) -> Option<Id> {
    let digits_only = text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let number = u32::from_str_radix(text, 16).ok().filter(|_| digits_only)?;
    match (text.len(), number) {
        (3, 0..=0x7FF) => Some(Id::standard(number as u16)),
        (8, 0..=0x1FFF_FFFF) => Some(Id::extended(number)),
        _ => None,
    }
}

fn hex(digit: u8) -> Option<u8> {
    (digit as char).to_digit(16).map(|value| value as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn texts_and_frames() {
        let table = [
            ("605#4000100000000000", Frame::new(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0])),
            ("080#", Frame::new(0x80, [])),
            ("70A#R", Frame::remote(0x70A, 0)),
            ("70A#R1", Frame::remote(0x70A, 1)),
            (
                "1ABCDEF0#01",
                Frame { id: Id::extended(0x1ABC_DEF0), data: Data::from([1]), remote: false },
            ),
        ];
        for (text, frame) in table {
            assert_eq!(text.parse(), Ok(frame), "{text}");
            assert_eq!(frame.to_string(), text);
        }
    }

    #[test]
    fn refuses_what_is_no_frame() {
        let table = [
            ("605", FrameError::NoHash),
            ("6055#", FrameError::Id),
            ("800#", FrameError::Id),
            ("+05#", FrameError::Id),
            ("605#4", FrameError::Data),
            ("605#001122334455667788", FrameError::Data),
            ("605#R9", FrameError::Data),
            ("605#\u{e4}", FrameError::Data),
        ];
        for (text, error) in table {
            assert_eq!(text.parse::<Frame>(), Err(error), "{text}");
        }
    }

    #[test]
    fn arbitration_prefers_the_lower_leading_bits_and_then_the_standard_frame() {
        assert!(Id::standard(0x100) < Id::standard(0x101));
        assert!(Id::standard(0x100) < Id::extended(0x100 << 18));
        assert!(Id::extended(0x0FF << 18) < Id::standard(0x100));
    }

    proptest! {
        #[test]
        fn display_and_parse_are_inverse(
            raw in 0u32..0x2000_0000,
            extended: bool,
            remote: bool,
            bytes in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let id = if extended { Id::extended(raw) } else { Id::standard(raw as u16) };
            let data = if remote { Data::new(&vec![0; bytes.len()]) } else { Data::new(&bytes) };
            let frame = Frame { id, data, remote };
            prop_assert_eq!(frame.to_string().parse(), Ok(frame));
        }

        #[test]
        fn no_text_panics(text in ".{0,24}") {
            let _ = text.parse::<Frame>();
        }
    }
}
