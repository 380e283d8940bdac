//! How long a frame is on the wire (ISO 11898-1): every bit, stuff bits included.

use crate::bus::Stamped;
use crate::frame::Frame;

/// Bits between two frames (intermission).
pub const INTERMISSION_BITS: u64 = 3;

/// The bits from start of frame to end of frame, stuff bits included, intermission not.
pub fn frame_bits(frame: &Frame) -> u64 {
    let (header, header_bits) = header(frame);
    let data = if frame.remote { &[][..] } else { &frame.data };
    let (mut bits, mut word) = (header_bits, header);
    for byte in data {
        word = word << 8 | u128::from(*byte);
        bits += 8;
    }
    let sequence = word << 15 | u128::from(crc15(word, bits));
    let stuffed_from = bits + 15;
    u64::from(stuffed_from + stuff_bits(sequence, stuffed_from) + TAIL_BITS)
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
fn header(frame: &Frame) -> (u128, u32) {
    let remote = u128::from(frame.remote);
    let len = frame.data.len() as u128;
    let id = u128::from(frame.id.raw());
    if frame.id.is_extended() {
        let (high, low) = (id >> 18, id & 0x3_FFFF);
        (high << 27 | 0b11 << 25 | low << 7 | remote << 6 | len, 39)
    } else {
        (id << 7 | remote << 6 | len, 19)
    }
}

/// CRC delimiter, acknowledge slot and delimiter, end of frame.
const TAIL_BITS: u32 = 10;

/// The check sum over the lowest `bits` bits. Leading zeros do not change it, so whole bytes do.
fn crc15(word: u128, bits: u32) -> u16 {
    lowest_bytes(&word.to_be_bytes(), bits.div_ceil(8)).iter().fold(0, |crc, byte| {
        let index = (crc >> 7) as u8 ^ byte;
        (crc << 8 ^ CRC_TABLE[usize::from(index)]) & 0x7FFF
    })
}

/// How many stuff bits go into the lowest `bits` bits.
fn stuff_bits(word: u128, bits: u32) -> u32 {
    let (whole, odd) = (bits / 8, bits % 8);
    let (mut state, mut count) = (FRESH, 0);
    for bit in (0..odd).rev() {
        let (next, stuffed) = stuff(state, (word >> (8 * whole + bit) & 1) as u8);
        state = next;
        count += u32::from(stuffed);
    }
    for byte in lowest_bytes(&word.to_be_bytes(), whole) {
        let step = STUFF_TABLE[usize::from(state)][usize::from(*byte)];
        state = step.0;
        count += u32::from(step.1);
    }
    count
}

fn lowest_bytes(word: &[u8; 16], count: u32) -> &[u8] {
    &word[16 - count as usize..]
}

/// States of the stuffing machine: `4 * last bit + equal bits - 1`, and one for the beginning.
const FRESH: u8 = 8;
const CRC_TABLE: [u16; 256] = crc_table();
const STUFF_TABLE: [[(u8, u8); 256]; 9] = stuff_table();

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

const fn stuff_table() -> [[(u8, u8); 256]; 9] {
    let mut table = [[(0, 0); 256]; 9];
    let mut state = 0;
    while state < 9 {
        let mut byte = 0;
        while byte < 256 {
            let (mut at, mut count, mut bit) = (state as u8, 0, 8);
            while bit > 0 {
                bit -= 1;
                let (next, stuffed) = stuff(at, (byte >> bit & 1) as u8);
                at = next;
                count += stuffed;
            }
            table[state][byte] = (at, count);
            byte += 1;
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
