//! An hour with the device, as a machine control on the bus spends it: heating up with a ramp,
//! self-optimisation, the second set point, an alarm, suction mode, and switching off at last.
//!
//! Everything goes over frames on a virtual bus: SDO and RPDO to the device, TPDOs from it.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::catalogue::Block;
use canopen::pdo::Mapping;
use canopen::{Instant, Mux, Value};
use reference_devices::devices::ReferenceDevice;

use crate::master::Master;

/// What the TPDOs of the device reported at one time. Temperatures in tenths of a degree Celsius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Seconds since power-on.
    pub seconds: u32,
    /// The value that is controlled, 7400h: the temperature of the main line.
    pub effective: i16,
    /// The set point in force, 7401h.
    pub set_point: i16,
    /// Heating is positive and cooling negative, in tenths of a percent, 6410h.
    pub output: i16,
    /// Of 6427h: on, self-optimisation, second set point.
    status: [bool; 3],
    /// Return line, 3020h.
    pub return_line: i16,
    /// The mould, 3040h.
    pub mould: i16,
    /// In tenths of a litre a minute, 3050h.
    pub flow: i16,
    /// 2002h, 2007h and the state of the first alarm.
    flags: [u8; 3],
}

impl Sample {
    /// The controller is on.
    pub const fn on(&self) -> bool {
        self.status[0]
    }

    /// Self-optimisation is going on.
    pub const fn optimises(&self) -> bool {
        self.status[1]
    }

    /// The second set point is in force.
    pub const fn second_set_point(&self) -> bool {
        self.status[2]
    }

    /// Suction mode is on.
    pub const fn suction(&self) -> bool {
        self.flags[0] & 1 != 0
    }

    /// The device empties the mould.
    pub const fn evacuates(&self) -> bool {
        self.flags[1] & 1 != 0
    }

    /// The device cools down before it switches off.
    pub const fn cools_down(&self) -> bool {
        self.flags[1] & 2 != 0
    }

    /// The flow is too small.
    pub const fn alarm(&self) -> bool {
        self.flags[2] != 0
    }
}

/// The hour, a sample every other second.
///
/// # Panics
/// When the device does not do what a heating/cooling device does, such as to take a set point.
pub fn run(device: &ReferenceDevice) -> Vec<Sample> {
    let mut control = MachineControl::new(device);
    control.prepare();
    let [on, tune, second] = control.bits("control");
    let bits = on as u8;
    control.until(60);
    control.write(SET_POINT, &800u16.to_le_bytes());
    control.write(SECOND_SET_POINT, &600u16.to_le_bytes());
    control.write(HEATING_RAMP, &40u16.to_le_bytes());
    control.write(COOLING_RAMP, &30u16.to_le_bytes());
    control.write(CONTROL_BYTE, &[bits]);
    control.until(2 * 60);
    control.write(control.alarm("type"), &[BELOW]);
    control.until(17 * 60);
    control.write(CONTROL_BYTE, &[bits | tune as u8]);
    control.until(22 * 60);
    control.write(CONTROL_BYTE, &[bits | second as u8]);
    control.until(32 * 60);
    control.write(CONTROL_BYTE, &[bits]);
    control.until(42 * 60);
    // A hose leaks: the flow is missed, and the machine control asks for suction mode.
    control.bench("flow", Value::Real(8.0));
    control.until(43 * 60);
    control.write(CONTROL_WORD, &[1]);
    control.bench("flow", Value::Text("process".to_owned()));
    control.until(47 * 60);
    control.write(CONTROL_WORD, &[0]);
    control.until(50 * 60);
    control.write(control.alarm("type"), &[0]);
    // First cool down, then evacuate, then switch off.
    control.write(SWITCH_OFF_MODE, &[4]);
    control.write(CONTROL_BYTE, &[0]);
    control.until(60 * 60);
    control.samples
}

const BELOW: u8 = 3;

const CONTROL_WORD: Mux = Mux::new(0x2001, 1);
const SWITCH_OFF_MODE: Mux = Mux::new(0x2005, 1);
const HEATING_RAMP: Mux = Mux::new(0x3060, 1);
const COOLING_RAMP: Mux = Mux::new(0x3070, 1);
const CONTROL_BYTE: Mux = Mux::new(0x6425, 1);
const SET_POINT: Mux = Mux::new(0x7402, 1);
const SECOND_SET_POINT: Mux = Mux::new(0x7403, 1);

/// The control of the machine, and what it has learnt.
struct MachineControl {
    master: Master,
    /// Bits and codes of CiA 404, which is not public: the device takes them from its profile.
    names: BTreeMap<String, i64>,
    alarm: Block,
    seconds: u32,
    samples: Vec<Sample>,
}

impl MachineControl {
    /// On a bus at 250 kbit/s with the device, which has booted up.
    fn new(device: &ReferenceDevice) -> Self {
        let master = Master::new(device, 250_000, Duration::from_millis(100));
        let names = device.description.names.clone();
        let alarm = device.description.blocks["alarm"].clone();
        Self { master, names, alarm, seconds: 0, samples: Vec::with_capacity(1800) }
    }

    /// The bits of 6425h or 6427h: on, self-optimisation, second set point.
    fn bits(&self, of: &str) -> [i64; 3] {
        ["on", "tune", "second"].map(|bit| self.names[&format!("{of}-{bit}")])
    }

    /// An object of the first alarm, which watches the flow while the pump runs (3.3).
    fn alarm(&self, object: &str) -> Mux {
        self.alarm.object(object, 1).expect("an object of the alarm block")
    }

    /// Maps what the hour is about into three TPDOs that SYNC asks for, and parameterises an alarm
    /// on the flow.
    fn prepare(&mut self) {
        let state = Mapping { mux: self.alarm("state"), bits: 8 }.encode();
        let values: [&[u32]; 3] = [
            &[0x7400_0110, 0x7401_0110, 0x6410_0110, 0x6427_0110],
            &[0x3020_0110, 0x3040_0110, 0x3050_0110],
            &[0x2002_0108, 0x2007_0108, state],
        ];
        for (tpdo, entries) in (0..).zip(values) {
            self.master.map_tpdo(tpdo, ON_SYNC, 0, entries);
        }
        self.write(self.alarm("link"), &0x3050_0110u32.to_le_bytes());
        self.write(self.alarm("level"), &200u16.to_le_bytes());
        self.master.start();
    }

    fn write(&mut self, mux: Mux, bytes: &[u8]) {
        self.master.write(mux, bytes);
    }

    fn bench(&mut self, name: &str, value: Value) {
        self.master.bench(name, &value);
    }

    /// Asks for a sample every other second until so many went by.
    fn until(&mut self, seconds: u32) {
        for next in (self.seconds + 2..=seconds).step_by(2) {
            self.master.listen(Instant::ZERO + Duration::from_secs(next.into()));
            self.master.synchronise();
            self.master.listen(Instant::ZERO + Duration::from_millis(u64::from(next) * 1000 + 20));
            self.seconds = next;
            self.samples.push(self.sample());
        }
        self.master.listen(Instant::ZERO + Duration::from_secs(seconds.into()));
    }

    /// What the TPDOs reported.
    fn sample(&self) -> Sample {
        let [control, process, bytes] = [0, 1, 2].map(|tpdo| self.master.tpdo(tpdo));
        let word = |data: [u8; 8], at: usize| i16::from_le_bytes([data[2 * at], data[2 * at + 1]]);
        let status = i64::from(word(control, 3));
        Sample {
            seconds: self.seconds,
            effective: word(control, 0),
            set_point: word(control, 1),
            output: word(control, 2),
            status: self.bits("status").map(|bit| status & bit != 0),
            return_line: word(process, 0),
            mould: word(process, 1),
            flow: word(process, 2),
            flags: [bytes[0], bytes[1], bytes[2]],
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
        let hour = run(&devices::device("em66").unwrap());
        assert_eq!(hour.len(), 1800);
        let at = |minutes: f64| &hour[(minutes * 30.0) as usize - 1];
        let near = |sample: &Sample, celsius: i16| (sample.effective - celsius).abs() <= 10;

        assert!(!at(0.5).on() && at(0.5).output == 0 && at(0.5).flow == 0);
        assert!(at(6.0).on() && (at(6.0).set_point - 450).abs() <= 2, "{:?}", at(6.0));
        assert!((at(6.0).effective - at(6.0).set_point).abs() <= 15, "{:?}", at(6.0));
        assert!(near(at(16.5), 800) && !at(16.5).optimises(), "{:?}", at(16.5));
        assert!(at(17.1).optimises());
        assert!(!at(21.5).optimises() && near(at(21.5), 800), "{:?}", at(21.5));
        assert!(at(25.0).second_set_point() && at(25.0).set_point < 800);
        assert!(near(at(31.5), 600) && near(at(41.5), 800));
        assert!(at(42.5).alarm() && !at(42.5).suction());
        assert!(at(45.0).suction() && !at(45.0).alarm(), "{:?}", at(45.0));
        assert!(!at(48.0).suction() && near(at(49.5), 800));
        assert!(at(50.5).on() && at(50.5).cools_down() && at(50.5).output == -1000);
        assert!(hour.iter().any(Sample::evacuates));
        let last = hour.last().unwrap();
        assert!(!last.on() && last.output == 0 && last.flow == 0 && last.effective < 450);
    }
}
