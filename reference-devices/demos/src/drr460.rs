//! An hour with the controller on its plant: tuning, cooling down, a soft start by gradient, a
//! change of the set point, and an alarm when the set point falls.
//!
//! Everything goes over frames on a virtual bus: SDO to the device, a TPDO from it.

use std::time::Duration;

use canopen::{Instant, Mux};
use reference_devices::devices::ReferenceDevice;

use crate::master::Master;

/// What the TPDO of the device reported at one time. Temperatures in tenths of a degree Celsius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Seconds since power-on.
    pub seconds: u32,
    /// The process value, 6401h.
    pub process: i16,
    /// The set point in force, 4008h.
    pub set_point: i16,
    /// In hundredths of a per cent, 4004h.
    pub output: u16,
    /// 4009h and 400Eh.
    flags: [u8; 2],
}

impl Sample {
    /// The command is on at this moment of its cycle.
    pub const fn heats(&self) -> bool {
        self.flags[0] & 1 != 0
    }

    /// The process is too far above the set point.
    pub const fn alarm(&self) -> bool {
        self.flags[0] & 2 != 0
    }

    /// A tuning is under way.
    pub const fn tunes(&self) -> bool {
        self.flags[1] != 0
    }

    /// The set point in force is on its way.
    pub fn starts_softly(&self) -> bool {
        ![0, FIRST, SECOND, THIRD].contains(&self.set_point)
    }
}

/// The hour, a sample every other second.
///
/// # Panics
/// When the device does not do what its manual says, such as to take a set point.
pub fn run(device: &ReferenceDevice) -> Vec<Sample> {
    let mut control = Control::new(device);
    control.prepare();
    control.until(60);
    control.set_point(FIRST);
    control.write(TUNING, &[1]);
    control.until(10 * 60);
    control.write(START, &[0]);
    control.set_point(0);
    control.until(17 * 60);
    control.parameter(SOFT_START, 1);
    control.set_point(FIRST);
    control.write(START, &[1]);
    control.until(32 * 60);
    control.set_point(SECOND);
    control.until(44 * 60);
    control.set_point(THIRD);
    control.until(56 * 60);
    control.write(START, &[0]);
    control.set_point(0);
    control.until(60 * 60);
    control.samples
}

/// Where the device keeps its parameters, by their numbers.
const PARAMETERS: u16 = 0x3000;
const SET_POINT: Mux = Mux::new(0x4000, 0);
const START: Mux = Mux::new(0x4003, 0);
const TUNING: Mux = Mux::new(0x400E, 0);

/// Set points in tenths of a degree.
const FIRST: i16 = 1500;
const SECOND: i16 = 1800;
const THIRD: i16 = 1200;

/// Which soft start follows a START.
const SOFT_START: u8 = 80;

/// Pt100, cycles of 2 s, tuning by hand 30 degrees below the set point, an alarm on Q2 when the
/// process is 10 degrees above the set point, and a soft start with 600 degrees an hour without
/// end.
const SETUP: [(u8, i16); 7] = [(1, 8), (40, 2), (31, 2), (32, 300), (56, 4), (81, 6000), (84, 0)];

/// The control of the machine.
struct Control {
    master: Master,
    seconds: u32,
    samples: Vec<Sample>,
}

impl Control {
    /// On a bus with the device, which has booted up.
    fn new(device: &ReferenceDevice) -> Self {
        let master = Master::new(device, 1_000_000, Duration::from_millis(1500));
        Self { master, seconds: 0, samples: Vec::with_capacity(1800) }
    }

    /// Sets the controller up, and maps what the hour is about into a TPDO that SYNC asks for.
    fn prepare(&mut self) {
        for (sub, value) in SETUP {
            self.parameter(sub, value);
        }
        self.write(Mux::new(0x4001, 0), &100i16.to_le_bytes());
        let entries = [0x6401_0110, 0x4008_0010, 0x4004_0010, 0x4009_0008, 0x400E_0008];
        self.master.map_tpdo(0, ON_SYNC, 0, &entries);
        self.master.start();
    }

    fn parameter(&mut self, sub: u8, value: i16) {
        self.write(Mux::new(PARAMETERS, sub), &value.to_le_bytes());
    }

    fn set_point(&mut self, digits: i16) {
        self.write(SET_POINT, &digits.to_le_bytes());
    }

    fn write(&mut self, mux: Mux, bytes: &[u8]) {
        self.master.write(mux, bytes);
    }

    /// Asks for a sample every other second until so many went by.
    fn until(&mut self, seconds: u32) {
        for next in (self.seconds + 2..=seconds).step_by(2) {
            self.master.listen(Instant::ZERO + Duration::from_secs(next.into()));
            self.master.synchronise();
            self.master.listen(Instant::ZERO + Duration::from_millis(u64::from(next) * 1000 + 20));
            self.seconds = next;
            let [a, b, c, d, e, f, outputs, tuning] = self.master.tpdo(0);
            self.samples.push(Sample {
                seconds: next,
                process: i16::from_le_bytes([a, b]),
                set_point: i16::from_le_bytes([c, d]),
                output: u16::from_le_bytes([e, f]),
                flags: [outputs, tuning],
            });
        }
    }
}

/// The transmission type of a TPDO that each SYNC asks for.
const ON_SYNC: u8 = 1;

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;

    #[test]
    fn the_hour_goes_as_told() {
        let hour = run(&devices::device("drr460").unwrap());
        assert_eq!(hour.len(), 1800);
        let at = |minutes: f64| &hour[(minutes * 30.0) as usize - 1];
        let near = |sample: &Sample, digits: i16| (sample.process - digits).abs() <= 20;
        assert_eq!((at(0.5).process, at(0.5).output, at(0.5).tunes()), (250, 0, false));
        assert!(at(1.5).tunes() && at(1.5).output == 10_000, "{:?}", at(1.5));
        assert!(!at(9.5).tunes() && near(at(9.5), FIRST), "{:?}", at(9.5));
        assert!(at(16.0).output == 0 && at(16.0).process < 500, "{:?}", at(16.0));
        assert!(at(20.0).starts_softly() && near(at(20.0), at(20.0).set_point), "{:?}", at(20.0));
        assert!(!at(31.5).starts_softly() && near(at(31.5), FIRST), "{:?}", at(31.5));
        assert!(near(at(43.5), SECOND) && !at(43.5).alarm(), "{:?}", at(43.5));
        // It holds each set point, and does not swing about it.
        for (from, until, held) in [(5, 10, FIRST), (36, 44, SECOND), (48, 56, THIRD)] {
            let samples = &hour[from * 30..until * 30 - 1];
            let far = samples.iter().find(|sample| !near(sample, held));
            assert!(far.is_none(), "{far:?}");
        }
        assert!(at(44.2).alarm() && !at(55.5).alarm() && near(at(55.5), THIRD));
        assert!(hour.last().is_some_and(|last| last.output == 0 && !last.heats()));
    }
}
