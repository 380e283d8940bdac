//! The protocol gs_usb: requests of the control pipe, and frames of the bulk pipes. Numbers are
//! little-endian, as the host says at the start.

use canopen::{Data, Frame, Id};

/// The requests of the control pipe.
pub(super) mod request {
    pub(in super::super) const HOST_FORMAT: u8 = 0;
    pub(in super::super) const BIT_TIMING: u8 = 1;
    pub(in super::super) const MODE: u8 = 2;
    pub(in super::super) const CONSTANTS: u8 = 4;
    pub(in super::super) const DEVICE_CONFIG: u8 = 5;
}

/// What the host says of its numbers: they are little-endian.
pub(super) const LITTLE_ENDIAN: [u8; 4] = 0x0000_BEEF_u32.to_le_bytes();
/// The length of the answer to [`request::DEVICE_CONFIG`] in bytes.
pub(super) const CONFIG: u16 = 12;
/// The length of the answer to [`request::CONSTANTS`] in bytes.
pub(super) const CONSTANTS: u16 = 40;
/// The adapter stamps its frames.
pub(super) const HAS_STAMPS: u32 = 1 << 4;

/// How many channels the adapter has, from the answer to [`request::DEVICE_CONFIG`].
///
/// # Errors
/// When the answer is too short.
pub(super) fn channels(answer: &[u8]) -> Result<u16, String> {
    let last = answer.get(3).filter(|_| answer.len() >= usize::from(CONFIG));
    last.map(|last| u16::from(*last) + 1).ok_or_else(|| too_short(answer))
}

/// The data of [`request::MODE`] that stops a channel.
pub(super) const STOP: [u8; 8] = [0; 8];

/// The data of [`request::MODE`] that starts a channel.
pub(super) fn start(flags: u32) -> [u8; 8] {
    let mut data = [0; 8];
    data[0] = 1;
    data[4..].copy_from_slice(&flags.to_le_bytes());
    data
}

/// What the bit timing of an adapter must keep to, in time quanta.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Constants {
    /// What the adapter can do.
    pub(super) features: u32,
    /// Its clock in Hz.
    clock: u32,
    /// The least and the greatest time before the sample point, without the first quantum.
    before: (u32, u32),
    /// The least and the greatest time after it.
    after: (u32, u32),
    /// The greatest jump for synchronisation.
    jump: u32,
    /// The least and the greatest prescaler, and its step.
    prescaler: (u32, u32, u32),
}

impl Constants {
    /// Reads the answer to [`request::CONSTANTS`].
    ///
    /// # Errors
    /// When it is too short.
    pub(super) fn parse(answer: &[u8]) -> Result<Self, String> {
        let numbers: Vec<u32> =
            answer.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let [features, clock, a, b, c, d, jump, e, f, step, ..] = numbers[..] else {
            return Err(too_short(answer));
        };
        let (before, after, prescaler) = ((a, b), (c, d), (e, f, step));
        Ok(Self { features, clock, before, after, jump, prescaler })
    }

    /// The data of [`request::BIT_TIMING`] for a bit rate in bit/s; `None` when the adapter has
    /// none within a thousandth of it. The sample point is as near to 87.5 % as can be (CiA 301).
    pub(super) fn timing(&self, rate: u32) -> Option<[u8; 20]> {
        /// Prescalers that are tried at most.
        const MOST: usize = 4096;
        let (first, last, step) = self.prescaler;
        let prescalers = (first.max(1)..=last).step_by(step.max(1) as usize).take(MOST);
        let timings = prescalers.filter_map(|prescaler| self.timing_by(prescaler, rate));
        let best = timings.min_by_key(|timing| (timing.off, timing.distance, timing.prescaler))?;
        let jump = (best.after / 2).clamp(1, self.jump.max(1));
        let propagation = best.before / 2;
        let fields = [propagation, best.before - propagation, best.after, jump, best.prescaler];
        let mut data = [0; 20];
        for (place, field) in data.as_chunks_mut().0.iter_mut().zip(fields) {
            *place = field.to_le_bytes();
        }
        Some(data)
    }

    fn timing_by(&self, prescaler: u32, rate: u32) -> Option<Timing> {
        let clock = u64::from(self.clock);
        let per_quantum = u64::from(prescaler) * u64::from(rate);
        let quanta = u32::try_from((clock + per_quantum / 2).checked_div(per_quantum)?).ok()?;
        let off = clock.abs_diff(per_quantum * u64::from(quanta));
        let fits = |part: u32, (least, most): (u32, u32)| (least.max(1)..=most).contains(&part);
        if quanta < 3 || off > clock / 1000 {
            return None;
        }
        // The part after the sample point is an eighth, rounded, and what the limits ask for.
        let room = quanta.saturating_sub(self.before.1.saturating_add(1));
        let after = (quanta.saturating_add(4) / 8).max(self.after.0).max(room).max(1);
        let before = quanta.checked_sub(after)?.checked_sub(1)?;
        let distance = (u64::from(after) * 8).abs_diff(quanta.into()) * 1000 / u64::from(quanta);
        let timing = Timing { off, distance, prescaler, before, after };
        (fits(before, self.before) && fits(after, self.after)).then_some(timing)
    }
}

struct Timing {
    /// How far the bit rate is off, in hertz of the clock.
    off: u64,
    /// How far the sample point is off, in thousandths of an eighth of a bit.
    distance: u64,
    prescaler: u32,
    before: u32,
    after: u32,
}

/// The length of a frame to the adapter in bytes.
pub(super) const TO: usize = 20;
/// The length of a frame with a time stamp.
const STAMPED: usize = 24;
/// A transfer from the adapter as a record: its length, and as many of its bytes.
pub(super) const RECORD: usize = 1 + STAMPED;
/// In place of the number of an own frame.
const FROM_THE_BUS: u32 = u32::MAX;
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;
const OVERFLOW: u8 = 1;
const FD: u8 = 2;

/// The transfer that sends a frame on a channel. The adapter sends it back with its number.
pub(super) fn transfer(frame: &Frame, number: u32, channel: u8) -> [u8; TO] {
    let mut bytes = [0; TO];
    let flags = [(frame.id.is_extended(), EXTENDED), (frame.remote, REMOTE)];
    let flags: u32 = flags.iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum();
    bytes[..4].copy_from_slice(&number.to_le_bytes());
    bytes[4..8].copy_from_slice(&(frame.id.raw() | flags).to_le_bytes());
    bytes[8] = frame.data.len() as u8;
    bytes[9] = channel;
    if !frame.remote {
        bytes[12..][..frame.data.len()].copy_from_slice(&frame.data);
    }
    bytes
}

/// A transfer as a [`RECORD`].
pub(super) fn record(transfer: &[u8]) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let bytes = &transfer[..transfer.len().min(STAMPED)];
    record[0] = bytes.len() as u8;
    record[1..][..bytes.len()].copy_from_slice(bytes);
    record
}

/// What an adapter sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Heard {
    /// The channel.
    pub(super) channel: u8,
    /// What it is.
    pub(super) what: What,
    /// The stamp in microseconds, where there is one.
    pub(super) stamp: Option<u32>,
    /// Whether frames before it were lost in the adapter.
    pub(super) overflow: bool,
}

/// What comes from the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// A frame of another station.
    Frame(Frame),
    /// The own frame with this number is complete.
    Echo(u32),
    /// An error frame in the form of Linux: its class and data.
    Error(u32, [u8; 8]),
}

/// Reads a [`RECORD`]. Frames have stamps where that was asked for.
///
/// # Errors
/// Why it is no frame.
pub(super) fn parse(record: &[u8], stamped: bool) -> Result<Heard, String> {
    let (length, bytes) = record.split_first().ok_or("nothing came")?;
    let bytes = &bytes[..bytes.len().min(usize::from(*length))];
    let number = |place: usize| -> Result<u32, String> {
        let four = bytes.get(place..).and_then(|rest| rest.first_chunk());
        four.map(|four| u32::from_le_bytes(*four)).ok_or_else(|| too_short(bytes))
    };
    let data: [u8; 8] =
        *bytes.get(12..).and_then(<[u8]>::first_chunk).ok_or_else(|| too_short(bytes))?;
    let (echo, id) = (number(0)?, number(4)?);
    let (length, channel, flags) = (usize::from(bytes[8]), bytes[9], bytes[10]);
    let stamp = if stamped { Some(number(TO)?) } else { None };
    let what = if echo != FROM_THE_BUS {
        What::Echo(echo)
    } else if id & ERROR != 0 {
        What::Error(id & !(EXTENDED | REMOTE | ERROR), data)
    } else if flags & FD != 0 {
        return Err("it is one of CAN FD".to_owned());
    } else {
        What::Frame(frame(id, length, data)?)
    };
    Ok(Heard { channel, what, stamp, overflow: flags & OVERFLOW != 0 })
}

fn frame(id: u32, length: usize, data: [u8; 8]) -> Result<Frame, String> {
    let number = id & !(EXTENDED | REMOTE);
    let id_of = match (id & EXTENDED != 0, number) {
        (true, 0..=0x1FFF_FFFF) => Id::extended(number),
        (false, 0..=0x7FF) => Id::standard(number as u16),
        _ => return Err(format!("it has the identifier {number:X}h")),
    };
    let remote = id & REMOTE != 0;
    let data = if remote { [0; 8] } else { data };
    // A length of more than eight says eight (ISO 11898-1).
    Ok(Frame { id: id_of, data: Data::new(&data[..length.min(8)]), remote })
}

fn too_short(bytes: &[u8]) -> String {
    format!("it has {} bytes only", bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// candleLight on an STM32F072, with a clock of 48 MHz.
    fn constants() -> Constants {
        let numbers = [0x10, 48_000_000, 1, 16, 1, 8, 4, 1, 1024, 1];
        let bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        Constants::parse(&bytes).expect("it is whole")
    }

    #[test]
    fn the_rates_of_cia_301_have_their_sample_point() {
        for (rate, expected) in [
            (1_000_000, [6, 7, 2, 1, 3]),
            (800_000, [6, 6, 2, 1, 4]),
            (500_000, [6, 7, 2, 1, 6]),
            (250_000, [6, 7, 2, 1, 12]),
            (125_000, [6, 7, 2, 1, 24]),
            (50_000, [6, 7, 2, 1, 60]),
            (20_000, [6, 7, 2, 1, 150]),
            (10_000, [6, 7, 2, 1, 300]),
        ] {
            let timing = constants().timing(rate).expect("it has it");
            let fields = timing.as_chunks().0.iter().map(|four| u32::from_le_bytes(*four));
            assert_eq!(fields.collect::<Vec<_>>(), expected, "{rate}");
        }
        assert!(constants().timing(83_333).is_some(), "within a thousandth");
        for rate in [0, 1, 13_000_001, u32::MAX] {
            assert_eq!(constants().timing(rate), None, "{rate}");
        }
    }

    #[test]
    fn frames_of_every_kind_are_read() {
        for text in ["605#4000100000000000", "00000605#", "705#R1", "000#8100"] {
            let sent: Frame = text.parse().unwrap();
            let mut bytes = transfer(&sent, FROM_THE_BUS, 1).to_vec();
            let what = What::Frame(sent);
            let heard = Heard { channel: 1, what, stamp: None, overflow: false };
            assert_eq!(parse(&record(&bytes), false), Ok(heard), "{text}");
            bytes.extend([1, 2, 0, 0]);
            bytes[10] = OVERFLOW;
            let heard = Heard { stamp: Some(513), overflow: true, ..heard };
            assert_eq!(parse(&record(&bytes), true), Ok(heard), "{text}");
            bytes[0] = 7;
            assert_eq!(
                parse(&record(&bytes), true).map(|heard| heard.what),
                Ok(What::Echo(0xFFFF_FF07))
            );
        }
    }

    #[test]
    fn an_error_frame_has_class_and_data() {
        let mut bytes = [0; TO];
        bytes[..4].fill(0xFF);
        bytes[4..8].copy_from_slice(&(ERROR | 0x204).to_le_bytes());
        bytes[13] = 0x30;
        let what = parse(&record(&bytes), false).map(|heard| heard.what);
        assert_eq!(what, Ok(What::Error(0x204, [0, 0x30, 0, 0, 0, 0, 0, 0])));
    }

    #[test]
    fn what_is_no_frame_says_why() {
        let mut bytes = transfer(&Frame::new(5, []), FROM_THE_BUS, 0);
        assert_eq!(parse(&record(&bytes), true), Err("it has 20 bytes only".to_owned()));
        assert_eq!(parse(&record(&bytes[..7]), false), Err("it has 7 bytes only".to_owned()));
        bytes[10] = FD;
        assert_eq!(parse(&record(&bytes), false), Err("it is one of CAN FD".to_owned()));
        (bytes[5], bytes[10]) = (0x08, 0);
        assert_eq!(parse(&record(&bytes), false), Err("it has the identifier 805h".to_owned()));
        assert_eq!(channels(&[0; 4]), Err("it has 4 bytes only".to_owned()));
        assert_eq!(channels(&[0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0]), Ok(2));
    }

    proptest! {
        #[test]
        fn nothing_panics(
            bytes in any::<Vec<u8>>(),
            rate in any::<u32>(),
            stamped in any::<bool>(),
        ) {
            _ = parse(&record(&bytes), stamped);
            _ = parse(&bytes, stamped);
            _ = channels(&bytes);
            _ = Constants::parse(&bytes).map(|constants| constants.timing(rate));
        }

        #[test]
        fn any_limits_give_a_timing_within_them_or_none(
            numbers in proptest::array::uniform10(0_u32..2000),
            clock in any::<u32>(),
            rate in any::<u32>(),
        ) {
            let mut numbers = numbers;
            numbers[1] = clock;
            let bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
            let limits = Constants::parse(&bytes).unwrap();
            if let Some(timing) = limits.timing(rate) {
                let fields: Vec<u32> =
                    timing.as_chunks().0.iter().map(|four| u32::from_le_bytes(*four)).collect();
                let [propagation, phase, after, jump, prescaler] = fields[..] else { panic!() };
                prop_assert!((limits.before.0..=limits.before.1).contains(&(propagation + phase)));
                prop_assert!((limits.after.0..=limits.after.1).contains(&after));
                prop_assert!(jump >= 1 && prescaler >= 1);
                let quanta = 1 + propagation + phase + after;
                let real = f64::from(clock) / f64::from(prescaler) / f64::from(quanta);
                prop_assert!((real / f64::from(rate) - 1.0).abs() < 0.002, "{real} of {rate}");
            }
        }
    }
}
