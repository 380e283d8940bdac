//! The worked examples of the manual, on a virtual bus: a joystick with a dead-band (figure 11), a
//! table for each range of an engine speed (1.6), and a joystick that a potentiometer shifts (1.7).

use std::time::Duration;

use canopen::{Instant, Mux};
use reference_devices::devices::ReferenceDevice;

use crate::master::Master;

/// What was there at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// The position of the joystick in millivolts.
    pub joystick: f64,
    /// The other input: the speed in 1/min, or the potentiometer in per cent.
    pub other: f64,
    /// The currents of outputs 1 and 2 in milliamperes.
    pub currents: [f64; 2],
}

/// The joystick goes from one end to the other; each of its sides drives a valve.
///
/// # Panics
/// When the controller does not take what its manual allows.
pub fn joystick(device: &ReferenceDevice) -> Vec<Sample> {
    let mut bench = Bench::new(device);
    bench.profile(1, [0, 1000, 2250, 2750, 4000, 5000], [0, 0, 0, 0, 75, 100]);
    bench.profile(2, [0, 1000, 2250, 2750, 4000, 5000], [100, 75, 0, 0, 0, 0]);
    bench.drive(1, (TABLE, 1));
    bench.drive(2, (TABLE, 2));
    (0..=200).map(|step| bench.sample(f64::from(step) * 25.0, 0.0)).collect()
}

/// Below 1000 1/min the joystick has a flat profile, above it the steep one.
///
/// # Panics
/// When the controller does not take what its manual allows.
pub fn engine(device: &ReferenceDevice) -> Vec<Sample> {
    let mut bench = Bench::new(device);
    bench.profile(1, [0, 1000, 2000, 3000, 4000, 5000], [0, 8, 16, 24, 32, 40]);
    bench.profile(2, [0, 1000, 2000, 3000, 4000, 5000], [0, 20, 40, 60, 80, 100]);
    // Speed (message 12) below constant 15, which is 1000: table A. Table B is the default.
    for (sub, value) in (1..).zip([MESSAGE, 12, CONSTANT, 15, 4]) {
        bench.byte(0x3411, sub, value);
    }
    for index in [0x3412, 0x3413] {
        bench.byte(index, 1, 0);
        bench.byte(index, 3, 0);
    }
    bench.byte(0x3402, 2, 0);
    bench.byte(0x3300, 1, 1);
    bench.drive(1, (LOGIC, 1));
    let speed = |step: f64| 1400.0 - 800.0 * (step / 200.0 * std::f64::consts::TAU).cos();
    (0..=200).map(|step| bench.sample(4000.0, speed(step.into()).round())).collect()
}

/// Three quarters of the current are for the joystick, one is for the potentiometer.
///
/// # Panics
/// When the controller does not take what its manual allows.
pub fn mixing(device: &ReferenceDevice) -> Vec<Sample> {
    let mut bench = Bench::new(device);
    for (input, number, largest, gain) in [(1, 11, 5000, 75), (2, 12, 100, 25)] {
        bench.byte(0x4100, input, MESSAGE);
        bench.byte(0x4101, input, number);
        bench.byte(0x4103, input, 0);
        bench.word(0x4122, input, largest);
        bench.byte(0x4140, input, gain);
    }
    bench.byte(0x4000, 1, 1);
    bench.drive(1, (MATH, 1));
    let joystick = |step: i32| 50.0 * f64::from(100 - (step - 100).abs());
    let potentiometer = |step: i32| [0.0, 50.0, 100.0, 25.0][(step / 51) as usize];
    (0..=200).map(|step| bench.sample(joystick(step), potentiometer(step))).collect()
}

/// The controller, with the inputs as extra received values 1 and 2.
struct Bench {
    master: Master,
    now: Instant,
}

impl Bench {
    fn new(device: &ReferenceDevice) -> Self {
        let now = Instant::ZERO + Duration::from_secs(1);
        let mut bench = Self { master: Master::new(device, 125_000, Duration::from_secs(1)), now };
        for sub in 1..=2 {
            bench.byte(0x2502, sub, 0);
            bench.word(0x2522, sub, 5000);
        }
        bench
    }

    fn byte(&mut self, index: u16, sub: u8, value: u8) {
        self.master.write(Mux::new(index, sub), &[value]);
    }

    fn word(&mut self, index: u16, sub: u8, value: i16) {
        self.master.write(Mux::new(index, sub), &value.to_le_bytes());
    }

    /// A table over message 11 with six points in per cent, the last of which stands for the rest.
    fn profile(&mut self, number: u16, x: [i32; 6], y: [i16; 6]) {
        let base = 0x3000 + 0x10 * number;
        self.byte(base, 0, MESSAGE);
        self.byte(base + 1, 0, 11);
        self.byte(base + 4, 0, 1);
        // From the last point down, since each bounds the one before.
        for sub in (1..=11_u8).rev() {
            let place = usize::from(sub.min(6)) - 1;
            self.master.write(Mux::new(base + 6, sub), &x[place].to_le_bytes());
            self.word(base + 7, sub, 10 * y[place]);
        }
    }

    /// An output of 0 to 1500 mA for 0 to 100 % of a block, without ramps.
    fn drive(&mut self, output: u8, (source, number): (u8, u8)) {
        self.byte(0x2340, output, source);
        self.byte(0x2341, output, number);
        self.word(0x7320, output, 0);
        self.word(0x7322, output, 100);
        self.byte(0x2342, output, 0);
        self.word(0x2330, output, 0);
        self.word(0x2331, output, 0);
    }

    fn sample(&mut self, joystick: f64, other: f64) -> Sample {
        self.word(0x2500, 1, joystick as i16);
        self.word(0x2500, 2, other as i16);
        self.now += Duration::from_millis(25);
        self.master.listen(self.now);
        let mut current =
            |output: u8| self.master.see(&format!("output-current-{output}")) as f64 / 1000.0;
        Sample { joystick, other, currents: [current(1), current(2)] }
    }
}

/// Sources of table 4.
const MESSAGE: u8 = 1;
const CONSTANT: u8 = 2;
const TABLE: u8 = 4;
const MATH: u8 = 5;
const LOGIC: u8 = 6;

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;

    #[test]
    fn the_dead_band_of_a_joystick_lies_between_its_valves() {
        let samples = joystick(&devices::device("ax021211").unwrap());
        let at = |millivolts: usize| samples[millivolts / 25].currents;
        assert_eq!([at(0), at(500), at(1000)], [[0.0, 1500.0], [0.0, 1313.0], [0.0, 1125.0]]);
        assert_eq!([at(2250), at(2500), at(2750)], [[0.0, 0.0]; 3]);
        assert_eq!([at(4000), at(4500), at(5000)], [[1125.0, 0.0], [1313.0, 0.0], [1500.0, 0.0]]);
    }

    #[test]
    fn a_slow_engine_has_a_flat_profile() {
        for sample in engine(&devices::device("ax021211").unwrap()) {
            let current = if sample.other < 1000.0 { 480.0 } else { 1200.0 };
            assert_eq!(sample.currents[0], current, "{sample:?}");
        }
    }

    #[test]
    fn the_potentiometer_shifts_the_joystick() {
        for sample in mixing(&devices::device("ax021211").unwrap()) {
            let percent = 0.75 * sample.joystick / 50.0 + 0.25 * sample.other;
            let difference = sample.currents[0] - 15.0 * percent;
            assert!(difference.abs() <= 1.0, "{sample:?}");
        }
    }
}
