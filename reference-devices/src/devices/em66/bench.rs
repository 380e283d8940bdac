//! The physical side: what a bench overrides in the process, and what it observes.

use canopen::{BenchError, Dictionary, Mux, Value};

use super::objects::{EXTERNAL_SENSOR, FLOW, INTAKE_PRESSURE, RETURN_LINE};
use super::process::Process;
use super::{Drive, External, Pump, Sensed};

/// The values that the bench has set. All others come from the process.
#[derive(Clone, Debug, Default)]
pub(super) struct Stimuli {
    /// The values that sensors are made to see, in the order of [`SENSORS`].
    seen: [Option<f64>; SENSORS.len()],
    external: Plug,
    limiter_tripped: bool,
    machine_fault: bool,
    /// Addresses that this device has of those that a sensor may need.
    has: Vec<Mux>,
}

/// The plug of the external sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Plug {
    #[default]
    Connected,
    Unplugged,
    Broken,
}

/// A value that can be set as a number, or as `process`.
struct Sensor {
    name: &'static str,
    /// The object without which the device has no such sensor.
    object: Option<Mux>,
    low: f64,
    high: f64,
    unit: &'static str,
    process: fn(&Process) -> f64,
}

impl Stimuli {
    /// Finds out which sensors the device has.
    pub(super) fn fit(&mut self, od: &Dictionary) {
        let objects = SENSORS.iter().filter_map(|sensor| sensor.object);
        self.has = objects.filter(|mux| od.entry(*mux).is_some()).collect();
    }

    /// The measurements of the sensors, in tenths.
    pub(super) fn sense(&self, process: &Process) -> Sensed {
        let tenths = |place: usize| {
            let value = self.seen[place].unwrap_or_else(|| (SENSORS[place].process)(process));
            (value * 10.0).round() as i64
        };
        Sensed {
            main: tenths(0),
            return_line: tenths(1),
            external: match self.external {
                Plug::Connected => External::Reads(tenths(2)),
                Plug::Unplugged => External::Unplugged,
                Plug::Broken => External::Broken,
            },
            flow: tenths(3),
            intake_pressure: tenths(4),
            medium_level: tenths(5),
            mould_contents: tenths(6),
            limiter_tripped: self.limiter_tripped,
            machine_fault: self.machine_fault,
        }
    }

    /// The physical side of this device.
    pub(super) fn names(&self) -> Vec<String> {
        let sensors = SENSORS.iter().filter(|sensor| self.has_sensor(sensor));
        let sensors = sensors.map(|sensor| sensor.name);
        let plug = self.has_plug().then_some(PLUG);
        let rest = [LIMITER, MACHINE, HEATER, COOLER, PUMP];
        sensors.chain(plug).chain(rest).map(str::to_owned).collect()
    }

    /// Takes a stimulus.
    ///
    /// # Errors
    /// When there is none of that name, or no sensor could see the value.
    pub(super) fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        if let Some(place) = self.place(name) {
            self.seen[place] = SENSORS[place].take(value)?;
            return Ok(());
        }
        let wrong = |what| Err(BenchError(format!("{name} is {what}, not {value}")));
        match name {
            PLUG if self.has_plug() => match Plug::named(value) {
                Some(plug) => self.external = plug,
                None => return wrong("`connected`, `unplugged` or `broken`"),
            },
            LIMITER | MACHINE => {
                let Some(is_set) = flag(value) else { return wrong("0 or 1") };
                let flag = match name {
                    LIMITER => &mut self.limiter_tripped,
                    _ => &mut self.machine_fault,
                };
                *flag = is_set;
            }
            HEATER | COOLER | PUMP => return wrong("what the device does, it cannot be set"),
            _ => return Err(BenchError::unknown(name)),
        }
        Ok(())
    }

    /// The value seen from outside: of a stimulus, the value that was set; of an actuator, what it
    /// does.
    pub(super) fn observe(&self, name: &str, drive: Drive) -> Option<Value> {
        let percent = |output: i64| Value::Real(output.max(0) as f64 / 10.0);
        let text = |text: &str| Value::Text(text.to_owned());
        if let Some(place) = self.place(name) {
            return Some(self.seen[place].map_or_else(|| text(PROCESS), Value::Real));
        }
        Some(match name {
            PLUG if self.has_plug() => text(self.external.name()),
            LIMITER => Value::Int(self.limiter_tripped.into()),
            MACHINE => Value::Int(self.machine_fault.into()),
            HEATER => percent(drive.output),
            COOLER => percent(-drive.output),
            PUMP => text(match drive.pump {
                Pump::Off => "off",
                Pump::Forward => "forward",
                Pump::Backward => "backward",
            }),
            _ => return None,
        })
    }

    fn place(&self, name: &str) -> Option<usize> {
        SENSORS.iter().position(|sensor| sensor.name == name && self.has_sensor(sensor))
    }

    fn has_sensor(&self, sensor: &Sensor) -> bool {
        sensor.object.is_none_or(|mux| self.has.contains(&mux))
    }

    fn has_plug(&self) -> bool {
        self.has.contains(&EXTERNAL_SENSOR)
    }
}

impl Sensor {
    /// The value that the sensor is made to see; `None` leaves it to the process.
    fn take(&self, value: &Value) -> Result<Option<f64>, BenchError> {
        if *value == Value::Text(PROCESS.to_owned()) {
            return Ok(None);
        }
        let Self { name, low, high, unit, .. } = self;
        match value.as_real().filter(|number| (*low..=*high).contains(number)) {
            Some(number) => Ok(Some(number)),
            None => Err(BenchError(format!(
                "{name} is {low} to {high} {unit}, or `{PROCESS}`, not {value}"
            ))),
        }
    }
}

impl Plug {
    const ALL: [Self; 3] = [Self::Connected, Self::Unplugged, Self::Broken];

    const fn name(self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Unplugged => "unplugged",
            Self::Broken => "broken",
        }
    }

    fn named(value: &Value) -> Option<Self> {
        let Value::Text(text) = value else { return None };
        Self::ALL.into_iter().find(|plug| plug.name() == text)
    }
}

fn flag(value: &Value) -> Option<bool> {
    match (value, value.as_int()) {
        (Value::Bool(is_set), _) => Some(*is_set),
        (_, Some(0)) => Some(false),
        (_, Some(1)) => Some(true),
        _ => None,
    }
}

const fn temperature(
    name: &'static str,
    object: Option<Mux>,
    process: fn(&Process) -> f64,
) -> Sensor {
    Sensor { name, object, low: -50.0, high: 400.0, unit: "degrees Celsius", process }
}

const fn percentage(name: &'static str, process: fn(&Process) -> f64) -> Sensor {
    Sensor { name, object: None, low: 0.0, high: 100.0, unit: "percent", process }
}

/// The sensors, in the order of [`Sensed`].
const SENSORS: [Sensor; 7] = [
    temperature("main-line-temperature", None, Process::main_line),
    temperature("return-line-temperature", Some(RETURN_LINE), Process::return_line),
    temperature("external-temperature", Some(EXTERNAL_SENSOR), Process::mould),
    Sensor {
        name: "flow",
        object: Some(FLOW),
        low: 0.0,
        high: 200.0,
        unit: "l/min",
        process: Process::flow,
    },
    Sensor {
        name: "intake-pressure",
        object: Some(INTAKE_PRESSURE),
        low: -1.0,
        high: 25.0,
        unit: "bar",
        process: Process::intake_pressure,
    },
    percentage("medium-level", Process::level),
    percentage("mould-contents", Process::contents),
];

/// The value of a sensor that was not set.
const PROCESS: &str = "process";
const PLUG: &str = "external-sensor";
const LIMITER: &str = "safety-limiter";
const MACHINE: &str = "machine-fault";
const HEATER: &str = "heater";
const COOLER: &str = "cooler";
const PUMP: &str = "pump";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;

    fn text(text: &str) -> Value {
        Value::Text(text.to_owned())
    }

    fn stimuli() -> Stimuli {
        let mut stimuli = Stimuli::default();
        let od = Dictionary::new(&devices::device("em66").unwrap().description.eds, 1).unwrap();
        stimuli.fit(&od);
        stimuli
    }

    #[test]
    fn what_is_not_set_the_process_tells() {
        let sensed = stimuli().sense(&Process::new());
        assert_eq!((sensed.main, sensed.return_line), (250, 250));
        assert_eq!(sensed.external, External::Reads(250));
        assert_eq!((sensed.flow, sensed.intake_pressure), (0, 15));
        assert_eq!((sensed.medium_level, sensed.mould_contents), (700, 1000));
        assert!(!sensed.limiter_tripped && !sensed.machine_fault);
    }

    #[test]
    fn what_is_set_reads_back_and_is_sensed_in_tenths() {
        let mut stimuli = stimuli();
        for (place, sensor) in SENSORS.iter().enumerate() {
            assert_eq!(stimuli.observe(sensor.name, Drive::default()), Some(text(PROCESS)));
            let number = Value::Real(12.34 + place as f64);
            stimuli.set(sensor.name, &number).unwrap();
            assert_eq!(stimuli.observe(sensor.name, Drive::default()), Some(number));
        }
        let sensed = stimuli.sense(&Process::new());
        assert_eq!((sensed.main, sensed.return_line, sensed.flow), (123, 133, 153));
        assert_eq!((sensed.intake_pressure, sensed.medium_level), (163, 173));
        assert_eq!((sensed.mould_contents, sensed.external), (183, External::Reads(143)));
        stimuli.set("main-line-temperature", &text(PROCESS)).unwrap();
        assert_eq!(stimuli.sense(&Process::new()).main, 250);
        for (name, value) in [(PLUG, text("unplugged")), (LIMITER, Value::Int(1))] {
            stimuli.set(name, &value).unwrap();
            assert_eq!(stimuli.observe(name, Drive::default()), Some(value));
        }
        assert_eq!(stimuli.sense(&Process::new()).external, External::Unplugged);
    }

    #[test]
    fn what_no_sensor_could_see_is_refused_with_the_range() {
        let mut stimuli = stimuli();
        let table = [
            ("main-line-temperature", Value::Int(401), "-50 to 400 degrees Celsius, or `process`"),
            ("flow", Value::Real(-0.1), "0 to 200 l/min"),
            ("mould-contents", text("full"), "0 to 100 percent"),
            (PLUG, Value::Int(1), "`connected`, `unplugged` or `broken`"),
            (LIMITER, Value::Int(2), "0 or 1"),
            (PUMP, text("off"), "cannot be set"),
            ("wind", Value::Int(2), "no `wind`"),
        ];
        for (name, value, expected) in table {
            let error = stimuli.set(name, &value).unwrap_err();
            assert!(error.0.contains(expected), "{name}: {error}");
        }
        assert_eq!(stimuli.observe("wind", Drive::default()), None);
    }

    #[test]
    fn each_name_can_be_seen_and_absent_sensors_have_none() {
        let all = stimuli();
        for name in all.names() {
            assert!(all.observe(&name, Drive::default()).is_some(), "{name}");
        }
        let bare = Stimuli::default();
        assert!(bare.names().iter().all(|name| !name.starts_with("external")));
        assert_eq!(bare.observe(PLUG, Drive::default()), None);
        assert!(bare.clone().set("flow", &Value::Int(1)).is_err());
    }

    #[test]
    fn the_actuators_are_seen_in_percent() {
        let drive = Drive { output: -305, pump: Pump::Backward, draining: false };
        let stimuli = Stimuli::default();
        assert_eq!(stimuli.observe(HEATER, drive), Some(Value::Real(0.0)));
        assert_eq!(stimuli.observe(COOLER, drive), Some(Value::Real(30.5)));
        assert_eq!(stimuli.observe(PUMP, drive), Some(text("backward")));
    }
}
