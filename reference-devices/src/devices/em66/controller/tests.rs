use super::*;
use crate::devices;
use crate::devices::em66::PERIOD;
use crate::devices::em66::objects::{EFFECTIVE_SET_POINT, EFFECTIVE_VALUE};
use crate::devices::em66::process::Process;
use crate::devices::em66::rules::Em66Rules;
use crate::devices::em66::{External, Mode};

/// A device with everything that the document leaves open.
const ALL: Options = Options {
    suction: true,
    evacuation: true,
    cool_down: true,
    self_optimisation: true,
    return_line_control: true,
    external_sensor_control: true,
};

/// A controller on its process.
struct Plant {
    controller: Controller,
    process: Process,
    od: Dictionary,
    rules: Em66Rules,
    duty: Duty,
    drive: Drive,
}

impl Plant {
    fn new(rules: Em66Rules) -> Self {
        Self {
            controller: Controller::new(codes()),
            process: Process::new(),
            od: Dictionary::new(&devices::device("em66").unwrap().description.eds, 1).unwrap(),
            rules,
            duty: Duty { on: true, ..Duty::default() },
            drive: Drive::default(),
        }
    }

    fn conformant() -> Self {
        Self::new(Em66Rules::default())
    }

    fn set(&mut self, mux: Mux, number: i64) -> &mut Self {
        self.od.set_int(mux, number);
        self.decide(Duration::ZERO);
        self
    }

    fn decide(&mut self, elapsed: Duration) {
        let sensed = Sensed {
            main: (self.process.main_line() * 10.0).round() as i64,
            return_line: (self.process.return_line() * 10.0).round() as i64,
            external: External::Reads((self.process.mould() * 10.0).round() as i64),
            ..Sensed::default()
        };
        let (duty, od, rules) = (&self.duty, &mut self.od, &self.rules);
        self.drive = self.controller.drive(elapsed, &sensed, duty, ALL, od, rules);
    }

    /// Lets seconds go by; `seen` looks at each sample.
    fn after(&mut self, seconds: u32, mut seen: impl FnMut(&Self)) -> &mut Self {
        for _ in 0..seconds * 10 {
            self.process.advance(PERIOD, self.drive);
            self.decide(PERIOD);
            seen(self);
        }
        self
    }

    fn get(&self, mux: Mux) -> i64 {
        value(&self.od, mux)
    }

    fn output(&self) -> i64 {
        i64::from(self.get(OUTPUT) as u16 as i16)
    }
}

#[test]
fn it_reaches_the_set_point_without_much_overshoot_and_stays_there() {
    let mut plant = Plant::conformant();
    let mut top = 0;
    plant.set(SET_POINT, 800).after(900, |plant| top = top.max(plant.get(EFFECTIVE_VALUE)));
    assert!((800..=810).contains(&top), "{top}");
    plant.after(300, |plant| assert!((plant.get(EFFECTIVE_VALUE) - 800).abs() <= 3));
    let mut bottom = i64::MAX;
    plant.set(SET_POINT, 600);
    plant.after(600, |plant| bottom = bottom.min(plant.get(EFFECTIVE_VALUE)));
    assert!((580..=600).contains(&bottom), "{bottom}");
    plant.after(300, |plant| assert!((plant.get(EFFECTIVE_VALUE) - 600).abs() <= 3));
}

#[test]
fn each_mode_controls_its_own_temperature() {
    for mode in [Mode::ReturnLine, Mode::ExternalSensor] {
        let mut plant = Plant::conformant();
        plant.duty.mode = mode;
        plant.set(SET_POINT, 600).after(1200, |_| {});
        plant.after(300, |plant| assert!((plant.get(EFFECTIVE_VALUE) - 600).abs() <= 3));
        assert!(plant.process.main_line() > 60.1);
    }
}

#[test]
fn a_sensor_that_tells_nothing_ends_heating() {
    let mut plant = Plant::conformant();
    plant.duty.mode = Mode::ExternalSensor;
    plant.set(SET_POINT, 800).after(2, |_| {});
    assert_eq!(plant.output(), 1000);
    let (duty, rules) = (plant.duty, Em66Rules::plain());
    let sensed = Sensed { external: External::Broken, ..Sensed::default() };
    plant.controller.drive(PERIOD, &sensed, &duty, ALL, &mut plant.od, &rules);
    assert_eq!((plant.output(), plant.get(EFFECTIVE_VALUE)), (0, 9999));
}

#[test]
fn what_it_is_to_do_goes_before_the_set_point() {
    let table = [
        (Duty { on: true, ..Duty::default() }, 1000, Pump::Forward),
        (Duty { on: false, ..Duty::default() }, 0, Pump::Off),
        (Duty { on: true, blocked: true, ..Duty::default() }, 0, Pump::Forward),
        (Duty { on: true, suction: true, ..Duty::default() }, 1000, Pump::Backward),
        (Duty { on: true, cooling_down: true, ..Duty::default() }, -1000, Pump::Forward),
        (Duty { on: true, evacuating: true, ..Duty::default() }, 0, Pump::Off),
    ];
    for (duty, output, pump) in table {
        let mut plant = Plant::conformant();
        plant.set(SET_POINT, 800).after(2, |_| {});
        plant.duty = duty;
        plant.after(1, |_| {});
        assert_eq!((plant.output(), plant.drive.pump), (output, pump), "{duty:?}");
        assert_eq!(plant.drive.draining, duty.evacuating);
    }
}

#[test]
fn limits_hold_at_once_and_in_manual_mode() {
    let mut plant = Plant::conformant();
    plant.set(SET_POINT, 800).after(1, |_| {});
    assert_eq!(plant.output(), 1000);
    assert_eq!(plant.set(UPPER_LIMIT, 300).output(), 300);
    plant.set(OPERATING_MODE, codes().manual).set(SET_POINT, 0).after(1, |_| {});
    assert_eq!(plant.output(), 300);
    assert_eq!(plant.set(UPPER_LIMIT, 200).output(), 200);
    plant.set(OPERATING_MODE, 0).after(1, |_| {});
    assert!(plant.output() < 0);
    assert_eq!(plant.get(STATUS), codes().status_on);
}

#[test]
fn a_ramp_shows_in_the_set_point_and_the_process_follows() {
    let mut plant = Plant::conformant();
    plant.duty.on = false;
    plant.set(HEATING_RAMP, 30).set(SET_POINT, 500);
    assert_eq!(plant.get(EFFECTIVE_SET_POINT), 500);
    plant.duty.on = true;
    plant.after(60, |_| {});
    assert_eq!(plant.get(EFFECTIVE_SET_POINT), 280);
    plant.after(300, |plant| {
        assert!((plant.get(EFFECTIVE_SET_POINT) - plant.get(EFFECTIVE_VALUE)).abs() <= 15);
    });
}

#[test]
fn self_optimisation_ends_with_parameters_that_control() {
    let mut plant = Plant::conformant();
    plant.set(SET_POINT, 500).after(600, |_| {});
    plant.set(CONTROL_BYTE, codes().control_on | codes().control_tune);
    assert_eq!(plant.get(STATUS) & codes().status_tune, codes().status_tune);
    let mut seconds = 0;
    while plant.get(STATUS) & codes().status_tune != 0 {
        plant.after(1, |_| {});
        seconds += 1;
        assert!(seconds < 1800, "it does not end");
    }
    assert_ne!(plant.controller.pid.gains, pid::Gains::COMMISSIONED);
    // The bit is still set, and nothing restarts.
    plant.after(300, |plant| assert_eq!(plant.get(STATUS), codes().status_on));
    plant.after(60, |plant| assert!((plant.get(EFFECTIVE_VALUE) - 500).abs() <= 5));
    let gains = plant.controller.pid.gains;
    plant.controller.restart();
    assert_eq!(plant.controller.pid.gains, gains);
}

#[test]
fn units_and_digits_hold_one_value() {
    let plant = Plant::conformant();
    for (index, same, other) in [
        (0x6406, vec![0, 0, 0x2D, 0], vec![0, 0, 0x2E, 0]),
        (0x6407, vec![1], vec![2]),
        (0x6415, vec![0, 0, 0, 0xFE], vec![0; 4]),
        (0x6416, vec![1], vec![0]),
    ] {
        let mux = Mux::new(index, 1);
        assert_eq!(Controller::check(mux, &same, &plant.od, &Em66Rules::plain()), Ok(()));
        let refused = Controller::check(mux, &other, &plant.od, &Em66Rules::plain());
        assert_eq!(refused, Err(Abort::VALUE), "{mux}");
    }
    assert_eq!(Controller::check(SET_POINT, &[0, 1], &plant.od, &Em66Rules::plain()), Ok(()));
}

#[test]
fn a_device_without_a_limit_of_cooling_cannot_cool() {
    let mut eds = canopen::eds::Eds::clone(&devices::device("em66").unwrap().description.eds);
    eds.objects.retain(|object| !matches!(object.index, 0x6413 | 0x6414));
    let od = Dictionary::new(&eds, 1).unwrap();
    assert_eq!(limits(&od, &Em66Rules::plain()), (0, 1000));
}

#[test]
fn each_deviation_is_known_by_its_name() {
    let mut plant = Plant::new(Em66Rules::otherwise("never-heats"));
    assert_eq!(plant.set(SET_POINT, 800).after(5, |_| {}).output(), 0);
}

fn codes() -> Codes {
    Codes::of(&devices::device("em66").unwrap().description.names)
}
