//! Process data: COB-ID and mapping entries, and bits in and out of a frame (CiA 301, 7.2.2,
//! 7.5.2.35 to 7.5.2.38).

use std::fmt;

use crate::frame::{Data, Id};
use crate::mux::Mux;
use crate::value::unsigned;

/// Whether an object of CiA 301 holds the identifier of a service, of PDOs and others.
pub const fn holds_cob_id(mux: Mux) -> bool {
    match mux.index {
        0x1005 | 0x1012 | 0x1014 => mux.sub == 0,
        0x1200..=0x12FF => matches!(mux.sub, 1 | 2),
        0x1400..=0x15FF | 0x1800..=0x19FF => mux.sub == 1,
        _ => false,
    }
}

/// The COB-ID of a service: an identifier, and bits with a meaning of their own. Bits 30 and 31 are
/// called as those of a PDO; in 1005h and 1012h they have other meanings (CiA 301, 7.5.2.5,
/// 7.5.2.15 and 7.5.2.35).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CobId(pub u32);

impl CobId {
    /// Bit 31: the PDO does not exist.
    pub const INVALID: u32 = 1 << 31;
    /// Bit 30: no remote request is answered.
    pub const NO_RTR: u32 = 1 << 30;
    /// Bit 29: a 29-bit identifier.
    pub const EXTENDED: u32 = 1 << 29;

    /// Whether the PDO exists.
    pub const fn valid(self) -> bool {
        self.0 & Self::INVALID == 0
    }

    /// Whether a remote request is answered.
    pub const fn rtr_allowed(self) -> bool {
        self.0 & Self::NO_RTR == 0
    }

    /// Whether the identifier has 29 bits.
    pub const fn extended(self) -> bool {
        self.0 & Self::EXTENDED != 0
    }

    /// The identifier: bits 0 to 28 with bit 29, otherwise bits 0 to 10.
    pub const fn can_id(self) -> Id {
        match self.extended() {
            true => Id::extended(self.0),
            false => Id::standard(self.0 as u16),
        }
    }

    /// The bits of the identifier that must be 0: bits 11 to 28 without bit 29.
    pub const fn stray_bits(self) -> u32 {
        if self.extended() { 0 } else { self.0 & 0x1FFF_F800 }
    }
}

/// Whether CiA 301 keeps an identifier for another service (7.3.5, table 40). No service has one of
/// 29 bits by default.
pub const fn is_restricted(id: Id) -> bool {
    !id.is_extended()
        && matches!(
            id.raw(),
            0x000..=0x07F
                | 0x101..=0x180
                | 0x581..=0x5FF
                | 0x601..=0x67F
                | 0x6E0..=0x6FF
                | 0x701..=0x7FF
        )
}

/// One entry of a PDO mapping: which value, how many bits.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Mapping {
    /// The value.
    pub mux: Mux,
    /// Its length in bits.
    pub bits: u8,
}

impl Mapping {
    /// Decodes the 32 bits of a mapping entry.
    pub const fn decode(word: u32) -> Self {
        let mux = Mux::new((word >> 16) as u16, (word >> 8) as u8);
        Self { mux, bits: word as u8 }
    }

    /// Encodes the mapping entry as 32 bits.
    pub const fn encode(self) -> u32 {
        (self.mux.index as u32) << 16 | (self.mux.sub as u32) << 8 | self.bits as u32
    }
}

impl fmt::Debug for Mapping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.mux, self.bits)
    }
}

/// Lays values side by side, low bit first, as a PDO carries them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Packer {
    word: u64,
    bits: u32,
}

impl Packer {
    /// Appends the lowest `bits` bits of `bytes`; bits beyond 64 in all are lost.
    pub fn push(&mut self, bytes: &[u8], bits: u8) {
        if self.bits < 64 && bits > 0 {
            self.word |= (unsigned(bytes) & ones(bits)) << self.bits;
        }
        self.bits = (self.bits + u32::from(bits)).min(64);
    }

    /// The frame's data: whole bytes.
    pub fn finish(self) -> Data {
        Data::new(&self.word.to_le_bytes()[..self.bits.div_ceil(8) as usize])
    }
}

/// Takes values out of a PDO's data, in the order of the mapping.
#[derive(Clone, Copy, Debug)]
pub struct Unpacker {
    word: u64,
    at: u32,
}

impl Unpacker {
    /// Starts at the first bit.
    pub fn new(data: Data) -> Self {
        Self { word: u64::from_le_bytes(data.padded()), at: 0 }
    }

    /// The next `bits` bits as little-endian bytes, zero after the end of the frame.
    pub fn take(&mut self, bits: u8) -> [u8; 8] {
        let value = if self.at < 64 { self.word >> self.at & ones(bits) } else { 0 };
        self.at = self.at.saturating_add(u32::from(bits));
        value.to_le_bytes()
    }
}

const fn ones(bits: u8) -> u64 {
    if bits >= 64 { u64::MAX } else { (1 << bits) - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_mapping_entry_reads_as_index_sub_length() {
        let entry = Mapping { mux: Mux::new(0x4008, 0), bits: 16 };
        assert_eq!(Mapping::decode(0x4008_0010), entry);
        assert_eq!(entry.encode(), 0x4008_0010);
    }

    #[test]
    fn values_that_share_a_byte() {
        let mut packer = Packer::default();
        packer.push(&[0b101], 3);
        packer.push(&[0xCD, 0xAB], 16);
        assert_eq!(*packer.finish(), [0x6D, 0x5E, 0x05]);
        let mut unpacker = Unpacker::new(packer.finish());
        assert_eq!(unpacker.take(3)[0], 0b101);
        assert_eq!(unpacker.take(16)[..2], [0xCD, 0xAB]);
    }

    #[test]
    fn the_frame_bit_decides_how_long_an_identifier_is() {
        for (word, id, stray) in [
            (0x0000_0185, Id::standard(0x185), 0),
            (0xC000_0185, Id::standard(0x185), 0),
            (0x2000_0185, Id::extended(0x185), 0),
            (0xFFFF_FFFF, Id::extended(0x1FFF_FFFF), 0),
            (0x3ABC_DEF0, Id::extended(0x1ABC_DEF0), 0),
            (0x1FFF_FFFF, Id::standard(0x7FF), 0x1FFF_F800),
            (0x0000_0985, Id::standard(0x185), 0x800),
        ] {
            let cob = CobId(word);
            assert_eq!((cob.can_id(), cob.stray_bits()), (id, stray), "{word:08X}");
        }
    }

    #[test]
    fn restricted_identifiers_are_those_of_other_services() {
        for id in [0x000, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x701, 0x77F, 0x7FF] {
            assert!(is_restricted(Id::standard(id)), "{id:03X}");
            assert!(!is_restricted(Id::extended(id.into())), "{id:08X}");
        }
        for id in [0x080, 0x100, 0x181, 0x200, 0x57F, 0x580, 0x600, 0x680, 0x6DF, 0x700] {
            assert!(!is_restricted(Id::standard(id)), "{id:03X}");
        }
    }

    proptest! {
        #[test]
        fn mapping_round_trip(word: u32) {
            prop_assert_eq!(Mapping::decode(word).encode(), word);
        }

        #[test]
        fn what_is_packed_is_unpacked(
            fields in proptest::collection::vec((any::<u64>(), 0u8..=64), 0..12),
        ) {
            let mut packer = Packer::default();
            let mut used = 0u32;
            for (value, bits) in &fields {
                packer.push(&value.to_le_bytes(), *bits);
            }
            let mut unpacker = Unpacker::new(packer.finish());
            for (value, bits) in &fields {
                let got = u64::from_le_bytes(unpacker.take(*bits));
                used += u32::from(*bits);
                if used <= 64 {
                    prop_assert_eq!(got, value & ones(*bits));
                }
            }
        }
    }
}
