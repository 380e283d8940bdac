use super::*;
use crate::devices;

/// A DRR460 without a network.
struct Fixture {
    device: Drr460,
    od: Dictionary,
    errors: Errors,
    now: Instant,
}

impl Fixture {
    fn new() -> Self {
        let eds = devices::device("drr460").unwrap().description.eds;
        let od = Dictionary::new(&eds, 1).unwrap();
        let (device, errors) = (Drr460::new(&eds), Errors::default());
        let mut fixture = Self { device, od, errors, now: Instant::ZERO };
        fixture.power_on();
        fixture
    }

    /// Off and on again; the objects stay as if they had been stored.
    fn power_on(&mut self) {
        self.device.reset(self.now, &mut self.od);
    }

    fn parameter(&mut self, sub: u8, number: i64) -> &mut Self {
        self.set(Mux::new(0x3000, sub), number)
    }

    fn set(&mut self, mux: Mux, number: i64) -> &mut Self {
        self.od.set_int(mux, number);
        self.device.written(self.now, mux, &mut self.od);
        self
    }

    /// Lets time pass and gives the object's value.
    fn after(&mut self, milliseconds: u64, mux: Mux) -> i64 {
        self.now += Duration::from_millis(milliseconds);
        while let Some(due) = self.device.poll_at().filter(|due| *due <= self.now) {
            self.device.run(due, &mut self.od, &mut self.errors);
        }
        value(&self.od, mux)
    }
}

const PROCESS_VALUE: Mux = Mux::new(0x6401, 1);
const OUTPUT_ERROR_MODE: Mux = Mux::new(0x6206, 1);
const ANALOGUE_ERROR_VALUE: Mux = Mux::new(0x6444, 1);
const REMOTE_1: Mux = Mux::new(0x400C, 0);
const REMOTE_2: Mux = Mux::new(0x400D, 0);

#[test]
fn after_power_on_it_rests_at_ambient_temperature() {
    let mut fixture = Fixture::new();
    for (mux, expected) in
        [(PROCESS_VALUE, 250), (COLD_JUNCTION, 250), (START, 1), (OUTPUT, 0), (OUTPUTS, 0)]
    {
        assert_eq!(fixture.after(0, mux), expected, "{mux}");
        assert_eq!(fixture.after(1000, mux), expected, "{mux}");
    }
}

#[test]
fn it_heats_to_the_set_point_and_stays_there() {
    let mut fixture = Fixture::new();
    fixture.set(SET_POINT, 600);
    assert_eq!(fixture.after(20, REAL_SET_POINT), 600);
    assert_eq!((fixture.after(0, OUTPUT), fixture.after(0, OUTPUTS)), (10_000, 1));
    assert!(fixture.after(1000, PROCESS_VALUE) > 400);
    for _ in 0..100 {
        let process = fixture.after(100, PROCESS_VALUE);
        assert!(fixture.now.0 < 5_000_000_000 || (590..=605).contains(&process), "{process}");
    }
}

#[test]
fn stop_ends_heating_and_has_its_own_output_states() {
    let mut fixture = Fixture::new();
    fixture.set(SET_POINT, 30_000);
    assert_eq!(fixture.after(20, OUTPUTS), 1);
    fixture.set(START, 0);
    assert_eq!((fixture.after(20, OUTPUTS), fixture.after(0, OUTPUT)), (0, 0));
    assert_eq!(fixture.parameter(21, 1).after(20, OUTPUTS), 1);
    fixture.parameter(56, 1).parameter(60, 1);
    assert_eq!(fixture.after(20, OUTPUTS), 3);
}

#[test]
fn cooling_acts_the_other_way() {
    let mut fixture = Fixture::new();
    fixture.parameter(18, 1).set(SET_POINT, -100);
    assert_eq!(fixture.after(20, OUTPUTS), 1);
    assert!(fixture.after(2000, PROCESS_VALUE) < 200);
}

#[test]
fn manual_mode_needs_permission_and_hands_the_output_to_the_master() {
    let mut fixture = Fixture::new();
    fixture.set(MANUAL, 1).set(OUTPUT, 10_000);
    assert_eq!(fixture.after(20, OUTPUT), 0);
    fixture.parameter(25, 1).set(OUTPUT, 10_000);
    assert_eq!((fixture.after(20, OUTPUT), fixture.after(0, OUTPUTS)), (10_000, 1));
    fixture.set(MANUAL, 0);
    assert_eq!(fixture.after(20, OUTPUT), 0);
}

#[test]
fn a_power_failure_keeps_what_is_to_be_remembered() {
    let mut fixture = Fixture::new();
    fixture.parameter(17, 2).parameter(25, 2).set(START, 0).set(MANUAL, 1).set(OUTPUT, 1234);
    fixture.after(20, OUTPUT);
    fixture.set(START, 1).set(MANUAL, 0).set(OUTPUT, 0).power_on();
    let remembered = [START, MANUAL, OUTPUT].map(|mux| fixture.after(20, mux));
    assert_eq!(remembered, [0, 1, 1234]);
    fixture.parameter(17, 1).set(START, 1).power_on();
    assert_eq!(fixture.after(20, START), 0);
    fixture.parameter(17, 0).power_on();
    assert_eq!(fixture.after(20, START), 1);
}

#[test]
fn the_wiring_decides_what_the_outputs_show() {
    let mut fixture = Fixture::new();
    fixture.parameter(56, 12).parameter(68, 12).set(REMOTE_1, 1);
    assert_eq!(fixture.after(20, OUTPUTS), 0b10);
    assert_eq!(fixture.parameter(16, 4).after(20, OUTPUTS), 0b01);
    assert_eq!(fixture.set(REMOTE_2, 1).after(20, OUTPUTS), 0b11);
    assert_eq!(fixture.parameter(16, 2).after(20, OUTPUTS), 0);
}

#[test]
fn an_analogue_command_heats_with_its_share() {
    let mut fixture = Fixture::new();
    fixture.parameter(16, 4).parameter(25, 1).set(MANUAL, 1).set(OUTPUT, 5000);
    assert_eq!(fixture.after(60_000, PROCESS_VALUE), 750);
}

#[test]
fn alarms_are_reset_by_hand() {
    let mut fixture = Fixture::new();
    fixture.parameter(56, 12).parameter(61, 1).set(REMOTE_1, 1);
    assert_eq!((fixture.after(20, OUTPUTS), fixture.after(0, ALARMS_RESET)), (2, 0));
    fixture.set(REMOTE_1, 0);
    assert_eq!((fixture.after(20, OUTPUTS), fixture.after(0, ALARMS_RESET)), (2, 1));
    fixture.set(ALARMS_RESET, 1);
    assert_eq!(fixture.after(20, OUTPUTS), 2);
    fixture.set(ALARMS_RESET, 0);
    assert_eq!((fixture.after(20, OUTPUTS), fixture.after(0, ALARMS_RESET)), (0, 0));
}

#[test]
fn a_sensor_that_cannot_measure_is_an_error() {
    let mut fixture = Fixture::new();
    fixture.set(SET_POINT, 30_000).parameter(56, 11).parameter(1, 7);
    assert_eq!((fixture.after(20, ERROR_FLAGS), fixture.after(0, OUTPUTS)), (SENSOR_ERROR, 0b10));
    assert_eq!(fixture.parameter(20, 1).after(20, OUTPUTS), 0b11);
    fixture.parameter(1, 0);
    assert_eq!((fixture.after(20, ERROR_FLAGS), fixture.after(0, OUTPUTS)), (0, 0b01));
    // With memory, the output stays as it was.
    fixture.parameter(25, 2).parameter(1, 7);
    assert_eq!((fixture.after(20, MANUAL), fixture.after(0, OUTPUT)), (1, 10_000));
}

#[test]
fn a_soft_start_follows_every_start() {
    let mut fixture = Fixture::new();
    fixture.parameter(80, 1).parameter(81, 3600).set(SET_POINT, 1000).set(START, 0);
    assert_eq!(fixture.after(20, REAL_SET_POINT), 1000);
    fixture.set(START, 1);
    assert_eq!(fixture.after(1000, REAL_SET_POINT), 251);
    fixture.parameter(80, 2).parameter(82, 30).set(START, 0);
    fixture.after(20, OUTPUT);
    fixture.set(START, 1);
    assert_eq!((fixture.after(20, OUTPUT), fixture.after(0, REAL_SET_POINT)), (3000, 1000));
}

#[test]
fn the_master_has_the_outputs_in_expansion_mode() {
    let mut fixture = Fixture::new();
    fixture.parameter(121, 1).parameter(122, 2).power_on();
    assert_eq!(fixture.after(20, OUTPUTS), 2);
    fixture.set(MASTER_OUTPUTS, 3);
    assert_eq!(fixture.after(20, OUTPUTS), 3);
    fixture.set(OUTPUT_ERROR_MODE, 1).set(ANALOGUE_ERROR_VALUE, 77);
    fixture.device.event(fixture.now, CommunicationEvent::CommunicationError, &mut fixture.od);
    assert_eq!((fixture.after(20, OUTPUTS), fixture.after(0, MASTER_ANALOGUE)), (2, 77));
}

#[test]
fn synchronised_tuning_forces_the_output() {
    let mut fixture = Fixture::new();
    fixture.parameter(31, 4).set(TUNING, 2);
    assert_eq!(fixture.after(20, OUTPUT), 10_000);
    assert_eq!(fixture.set(SET_POINT, 30_000).set(TUNING, 1).after(20, OUTPUT), 0);
    assert_eq!(fixture.set(TUNING, 0).after(20, OUTPUT), 10_000);
}

#[test]
fn tuning_takes_what_its_kind_has_a_meaning_for() {
    let mut fixture = Fixture::new();
    let table = [
        (0, 3, Ok(())),
        (0, 4, Err(Abort::VALUE)),
        (1, 0, Err(Abort::DEVICE_STATE)),
        (2, 1, Ok(())),
        (2, 2, Err(Abort::VALUE)),
        (3, 1, Err(Abort::DEVICE_STATE)),
        (4, 3, Ok(())),
        (4, 5, Err(Abort::VALUE)),
    ];
    for (kind, value, verdict) in table {
        fixture.parameter(31, kind);
        assert_eq!(fixture.device.check(TUNING, &[value], &fixture.od), verdict, "{kind} {value}");
    }
}
