//! Ten minutes with the MCM260X-9AD in a packaging machine: an encoder on the film, an eye that
//! sees the products, a jaw that seals and a knife that cuts, the temperature of the jaw and the
//! speed of the drive.
//!
//! Everything goes over frames on a virtual bus. The bench is the machine: the drive follows the
//! analogue output, the film turns the encoder, and the jaw warms and cools.

use std::time::Duration;

use canopen::{Instant, Mux, Value};
use reference_devices::devices::ReferenceDevice;

use crate::master::Master;

/// What was there at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Seconds since the start.
    pub seconds: f64,
    /// Edges of the encoder since the last bag began, 3001h.
    pub counts: i32,
    /// Edges of the encoder in the last second, 3004h.
    pub per_second: i32,
    /// The levels of the inputs, 6000h.
    inputs: u8,
    /// What the outputs drive.
    outputs: u8,
    /// The jaw in degrees Celsius, 6401h.
    pub celsius: f64,
    /// The command for the drive in volts.
    pub volts: f64,
    /// Messages about the temperature, which come only beyond its limits.
    pub warnings: u32,
    /// Bags since the start.
    pub bags: u32,
}

impl Sample {
    /// The eye sees a product.
    pub const fn product(&self) -> bool {
        self.inputs & 1 != 0
    }

    /// The door is open.
    pub const fn door(&self) -> bool {
        self.inputs & 2 != 0
    }

    /// The jaw is closed.
    pub const fn jaw(&self) -> bool {
        self.outputs & 0x10 != 0
    }

    /// The knife is down.
    pub const fn knife(&self) -> bool {
        self.outputs & 0x20 != 0
    }

    /// The heating of the jaw is on.
    pub const fn heats(&self) -> bool {
        self.outputs & 0x40 != 0
    }
}

/// The ten minutes, a sample every quarter of a second.
///
/// # Panics
/// When the module does not do what its manual says, such as to take a preset.
pub fn run(device: &ReferenceDevice) -> Vec<Sample> {
    let mut machine = Machine::new(device);
    machine.prepare();
    let mut samples = Vec::with_capacity(STEPS as usize);
    for step in 1..=STEPS {
        samples.push(machine.step(step));
    }
    samples
}

/// The machine and its control.
struct Machine {
    master: Master,
    /// When the ten minutes began.
    begin: Instant,
    /// Of the jaw, in degrees Celsius.
    celsius: f64,
    /// Of the drive, 0 to 1.
    speed: f64,
    bags: u32,
    outputs: u8,
}

impl Machine {
    fn new(device: &ReferenceDevice) -> Self {
        let begin = Duration::from_millis(1500);
        let master = Master::new(device, 1_000_000, begin);
        let begin = Instant::ZERO + begin;
        Self { master, begin, celsius: 25.0, speed: 0.0, bags: 0, outputs: 0 }
    }

    /// Encoder x4, a Pt100 at the jaw, 0 to 10 V for the drive; what is mapped is asked for by
    /// SYNC, except for the temperature, which comes by itself beyond its limits.
    fn prepare(&mut self) {
        let master = &mut self.master;
        for (sub, value) in [(21, 9i16), (54, 2), (73, 2), (85, 32767)] {
            master.write(Mux::new(0x3000, sub), &value.to_le_bytes());
        }
        master.map_tpdo(0, 1, 0, &[0x3001_0120, 0x3004_0120]);
        master.map_tpdo(1, 1, 0, &[0x6000_0108, 0x6401_0110]);
        master.map_tpdo(2, 255, 10_000, &[0x6401_0110]);
        master.map_rpdo(0, 255, &[0x6200_0108, 0x6411_0110, 0x3003_0108]);
        master.write(Mux::new(0x6421, 1), &[0b11]);
        master.write(Mux::new(0x6424, 1), &1650i16.to_le_bytes());
        master.write(Mux::new(0x6425, 1), &1350i16.to_le_bytes());
        master.write(Mux::new(0x6423, 0), &[1]);
        master.start();
    }

    fn step(&mut self, step: u32) -> Sample {
        let seconds = f64::from(step) / PER_SECOND;
        self.move_machine(seconds);
        let at = self.begin + Duration::from_millis(u64::from(step) * 250);
        self.master.listen(at);
        self.master.synchronise();
        self.master.listen(at + Duration::from_millis(5));
        let sample = self.sample(seconds);
        self.control(&sample);
        sample
    }

    /// What the machine does by itself until the next sample.
    fn move_machine(&mut self, seconds: f64) {
        let door = seconds >= DOOR.0 && seconds < DOOR.1;
        // Products come in time with the bags, one a second at full speed.
        let product = self.speed > 0.2 && seconds.fract() < 0.5;
        let levels = i64::from(product) | i64::from(door) << 1;
        self.master.bench("digital-inputs-1", &Value::from(levels));
        let wanted = self.master.see("output-voltage-1") as f64 / 10_000.0;
        self.speed += (wanted - self.speed).clamp(-0.1, 0.05);
        let film = Value::Real((self.speed * FULL_SPEED).round());
        self.master.bench("encoder-frequency-1", &film);
        let heating = if self.outputs & 0x40 != 0 { 0.9 } else { 0.0 };
        let draught = if door { 0.012 } else { 0.002 };
        self.celsius += heating - draught * (self.celsius - 25.0);
        self.master.bench("input-temperature-1", &Value::Real(self.celsius));
    }

    /// What the control of the machine does with what it knows.
    fn control(&mut self, sample: &Sample) {
        let ready = sample.celsius > 140.0 && !sample.door();
        let drive: i16 = match sample.seconds {
            _ if !ready => 0,
            seconds if seconds > END => 0,
            seconds if seconds > SLOW.0 && seconds < SLOW.1 => 500,
            _ => 1000,
        };
        let bag_ends = sample.counts >= BAG;
        self.bags += u32::from(bag_ends);
        let phase = sample.counts % BAG;
        let seals = sample.per_second > 1000 && phase > BAG / 2;
        let heats = sample.celsius < 150.0 && sample.seconds < END;
        self.outputs = u8::from(seals) << 4 | u8::from(bag_ends) << 5 | u8::from(heats) << 6;
        let [low, high] = drive.to_le_bytes();
        self.master.send_rpdo(0, [self.outputs, low, high, u8::from(bag_ends)]);
    }

    fn sample(&mut self, seconds: f64) -> Sample {
        let counts = self.master.tpdo(0);
        let process = self.master.tpdo(1);
        let word = |at: usize| i32::from_le_bytes([0, 1, 2, 3].map(|byte| counts[at + byte]));
        Sample {
            seconds,
            counts: word(0),
            per_second: word(4),
            inputs: process[0],
            outputs: self.master.see("digital-outputs-1") as u8,
            celsius: f64::from(i16::from_le_bytes([process[1], process[2]])) / 10.0,
            volts: self.master.see("output-voltage-1") as f64 / 1000.0,
            warnings: self.master.messages[4],
            bags: self.bags,
        }
    }
}

/// Samples in a second.
const PER_SECOND: f64 = 4.0;
/// All samples.
const STEPS: u32 = 2400;
/// Periods of the encoder in a second at full speed.
const FULL_SPEED: f64 = 20_000.0;
/// Edges of the encoder in a bag.
const BAG: i32 = 160_000;
/// From when to when somebody has the door open, in seconds.
const DOOR: (f64, f64) = (240.0, 285.0);
/// From when to when the machine runs slowly.
const SLOW: (f64, f64) = (420.0, 480.0);
/// When the control stops the machine.
const END: f64 = 570.0;

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;

    #[test]
    fn the_ten_minutes_go_as_told() {
        let samples = run(&devices::device("mcm260x-9ad").unwrap());
        assert_eq!(samples.len(), 2400);
        let at = |seconds: usize| &samples[seconds * 4 - 1];
        assert_eq!((at(5).per_second, at(5).bags, at(5).heats()), (0, 0, true));
        assert_eq!(at(200).per_second, 80_000, "20 kHz, every edge");
        assert!((at(200).celsius - 150.0).abs() < 3.0 && at(200).volts == 10.0, "{:?}", at(200));
        assert!(at(260).door() && at(260).per_second == 0 && !at(260).jaw());
        assert!(at(280).warnings > at(200).warnings, "the jaw cools down");
        assert_eq!((at(460).per_second, at(460).volts), (40_000, 5.0));
        assert!(at(400).bags > at(350).bags && at(400).bags - at(350).bags < 26);
        assert!(samples.iter().any(Sample::knife) && samples.iter().any(Sample::product));
        let last = samples.last().unwrap();
        assert_eq!((last.per_second, last.volts, last.heats()), (0, 0.0, false));
    }
}
