//! How long a frame is on the wire (ISO 11898-1): every bit, stuff bits included.

use crate::bus::Stamped;
use crate::frame::Frame;

/// Bits between two frames (intermission).
pub const INTERMISSION_BITS: u64 = 3;

/// The bits from start of frame to end of frame, stuff bits included, intermission not.
pub fn frame_bits(frame: &Frame) -> u64 {
    let (header, header_bits) = header(frame);
    let data = if frame.remote { &[][..] } else { &frame.data };
    let mut wire = Wire { crc: 0, state: FRESH, bits: 0 };
    match header_bits % 8 {
        3 => wire.bits_3((header >> (header_bits - 3)) as u8),
        _ => wire.bits_7((header >> (header_bits - 7)) as u8),
    }
    let whole = (header_bits / 8) as usize;
    header.to_be_bytes()[8 - whole..].iter().chain(data).for_each(|byte| wire.byte(*byte));
    let crc = wire.crc;
    wire.bits_7((crc >> 8) as u8);
    wire.byte(crc as u8);
    u64::from(wire.bits + TAIL_BITS)
}

/// The bits of one frame that have passed on the wire.
struct Wire {
    /// The check sum. Leading zeros do not change it, so fewer bits than eight can begin it.
    crc: u16,
    /// The state of the stuffing machine.
    state: u8,
    /// Stuff bits included.
    bits: u32,
}

impl Wire {
    fn byte(&mut self, byte: u8) {
        self.check(byte);
        self.stuff(8, STUFF_8[usize::from(self.state)][usize::from(byte)]);
    }

    fn bits_3(&mut self, bits: u8) {
        self.check(bits);
        self.stuff(3, STUFF_3[usize::from(self.state)][usize::from(bits & 0x07)]);
    }

    fn bits_7(&mut self, bits: u8) {
        self.check(bits);
        self.stuff(7, STUFF_7[usize::from(self.state)][usize::from(bits & 0x7F)]);
    }

    fn check(&mut self, byte: u8) {
        let index = (self.crc >> 7) as u8 ^ byte;
        self.crc = (self.crc << 8 ^ CRC_TABLE[usize::from(index)]) & 0x7FFF;
    }

    fn stuff(&mut self, bits: u32, (state, stuffed): (u8, u8)) {
        self.state = state;
        self.bits += bits + u32::from(stuffed);
    }
}

/// The part of the time from the start of the first frame to the end of the last in which the wire
/// was taken at `bit_rate` bits per second. The intermission counts with the frame before it,
/// because no station can send in it. The frames are in the order of their stamps.
pub fn load(frames: &[Stamped], bit_rate: u32) -> f64 {
    let [first, .., last] = frames else { return 1.0 };
    let bits = |seen: &Stamped| (frame_bits(&seen.frame) + INTERMISSION_BITS) as f64;
    let between = last.at.since(first.at).as_secs_f64() * f64::from(bit_rate);
    frames.iter().map(bits).sum::<f64>() / (between + bits(first))
}

/// Start of frame, arbitration and control field.
fn header(frame: &Frame) -> (u64, u32) {
    let remote = u64::from(frame.remote);
    let len = frame.data.len() as u64;
    let id = u64::from(frame.id.raw());
    if frame.id.is_extended() {
        let (high, low) = (id >> 18, id & 0x3_FFFF);
        (high << 27 | 0b11 << 25 | low << 7 | remote << 6 | len, 39)
    } else {
        (id << 7 | remote << 6 | len, 19)
    }
}

/// CRC delimiter, acknowledge slot and delimiter, end of frame.
const TAIL_BITS: u32 = 10;

/// States of the stuffing machine: `4 * last bit + equal bits - 1`, and one for the beginning.
const FRESH: u8 = 8;
const CRC_TABLE: [u16; 256] = crc_table();
const STUFF_3: [[(u8, u8); 8]; 9] = stuff_table(3);
const STUFF_7: [[(u8, u8); 128]; 9] = stuff_table(7);
const STUFF_8: [[(u8, u8); 256]; 9] = stuff_table(8);

/// Takes one bit: the next state, and how many stuff bits follow it.
const fn stuff(state: u8, bit: u8) -> (u8, u8) {
    if state == FRESH || state / 4 != bit {
        return (4 * bit, 0);
    }
    match state % 4 {
        3 => (4 * (1 - bit), 1),
        run => (4 * bit + run + 1, 0),
    }
}

const fn crc_table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        let mut crc = (index as u16) << 7;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x4000 != 0 { crc << 1 ^ 0x4599 } else { crc << 1 };
            bit += 1;
        }
        table[index] = crc & 0x7FFF;
        index += 1;
    }
    table
}

/// For each state, the effect of that many bits at once: the next state, and the number of stuff
/// bits.
const fn stuff_table<const N: usize>(bits: u32) -> [[(u8, u8); N]; 9] {
    let mut table = [[(0, 0); N]; 9];
    let mut state = 0;
    while state < 9 {
        let mut word = 0;
        while word < N {
            let (mut at, mut count, mut bit) = (state as u8, 0, bits);
            while bit > 0 {
                bit -= 1;
                let (next, stuffed) = stuff(at, (word >> bit & 1) as u8);
                at = next;
                count += stuffed;
            }
            table[state][word] = (at, count);
            word += 1;
        }
        state += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Data, Id};
    use proptest::prelude::*;

    /// The definition, bit by bit.
    fn slow_frame_bits(frame: &Frame) -> u64 {
        let (header, header_bits) = header(frame);
        let mut bits: Vec<u8> =
            (0..header_bits).rev().map(|bit| (header >> bit & 1) as u8).collect();
        if !frame.remote {
            for byte in frame.data.iter() {
                bits.extend((0..8).rev().map(|bit| byte >> bit & 1));
            }
        }
        let mut crc = 0u16;
        for bit in &bits {
            let flip = u16::from(*bit) ^ crc >> 14 & 1;
            crc = (crc << 1 & 0x7FFF) ^ (flip * 0x4599);
        }
        bits.extend((0..15).rev().map(|bit| (crc >> bit & 1) as u8));
        let (mut last, mut run, mut stuffed) = (2, 0, 0);
        for bit in &bits {
            run = if *bit == last { run + 1 } else { 1 };
            last = *bit;
            if run == 5 {
                (last, run, stuffed) = (1 - last, 1, stuffed + 1);
            }
        }
        bits.len() as u64 + stuffed + u64::from(TAIL_BITS)
    }

    #[test]
    fn the_longest_standard_frame_has_135_bits_with_intermission() {
        let bits = frame_bits(&Frame::new(0x555, [0x55; 8])) + INTERMISSION_BITS;
        assert!((111..=135).contains(&bits), "{bits}");
    }

    proptest! {
        #[test]
        fn tables_agree_with_the_definition(
            raw: u32,
            extended: bool,
            remote: bool,
            bytes in proptest::collection::vec(
                prop_oneof![Just(0u8), Just(0xFF), any::<u8>()],
                0..=8,
            ),
        ) {
            let id = if extended { Id::extended(raw) } else { Id::standard(raw as u16) };
            let frame = Frame { id, data: Data::new(&bytes), remote };
            prop_assert_eq!(frame_bits(&frame), slow_frame_bits(&frame));
        }
    }
}
