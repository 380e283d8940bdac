use super::*;
use crate::change::Deviation;
use crate::devices::{self, ReferenceDevice};
use crate::mutant::{self, Mutant};

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
        let (device, errors) = (Drr460::with_deviations(&eds, &[]), Errors::default());
        let mut fixture = Self { device, od, errors, now: Instant::ZERO };
        fixture.power_on();
        fixture
    }

    /// Off and on again; the objects stay as if they had been stored.
    fn power_on(&mut self) {
        self.device.supply_lost();
        self.device.reset(self.now, &mut self.od);
        self.device.run(self.now, &mut self.od, &mut self.errors);
    }

    fn parameter(&mut self, sub: u8, number: i64) -> &mut Self {
        self.set(Mux::new(0x3000, sub), number)
    }

    fn set(&mut self, mux: Mux, number: i64) -> &mut Self {
        self.od.set_int(mux, number);
        self.device.written(self.now, mux, &mut self.od);
        self.device.run(self.now, &mut self.od, &mut self.errors);
        self
    }

    fn bench(&mut self, name: &str, value: impl Into<Value>) -> &mut Self {
        self.device.stimulate(self.now, name, &value.into(), &mut self.od).unwrap();
        self.device.run(self.now, &mut self.od, &mut self.errors);
        self
    }

    fn see(&self, name: &str) -> Value {
        self.device.observe(name, &self.od).unwrap()
    }

    /// Lets time pass and gives the object's value.
    fn after(&mut self, milliseconds: u64, mux: Mux) -> i64 {
        self.now += Duration::from_millis(milliseconds);
        while let Some(due) = self.device.poll_at().filter(|due| *due <= self.now) {
            self.device.run(due, &mut self.od, &mut self.errors);
        }
        self.device.show(self.now, &mut self.od);
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
    assert!(fixture.after(10_000, PROCESS_VALUE) > 400);
    for _ in 0..300 {
        let process = fixture.after(1000, PROCESS_VALUE);
        assert!(fixture.now.0 < 60_000_000_000 || (590..=680).contains(&process), "{process}");
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
    assert!(fixture.after(20_000, PROCESS_VALUE) < 200);
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
    // The values that a reset loads, before the application restores any.
    let load = |fixture: &mut Fixture| {
        for (mux, at) in [(START, 1), (MANUAL, 0), (OUTPUT, 0)] {
            fixture.od.set_int(mux, at);
        }
        fixture.power_on();
    };
    load(&mut fixture);
    let remembered = [START, MANUAL, OUTPUT].map(|mux| fixture.after(20, mux));
    assert_eq!(remembered, [0, 1, 1234]);
    fixture.parameter(17, 1).set(START, 1);
    load(&mut fixture);
    assert_eq!(fixture.after(20, START), 0);
    fixture.parameter(17, 0);
    load(&mut fixture);
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
    assert_eq!(fixture.after(3_000_000, PROCESS_VALUE), 1750);
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
    assert_eq!((fixture.after(20, ERROR_FLAGS), fixture.after(0, OUTPUTS)), (2, 0b10));
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

const TERMINALS: &str = "digital-outputs-1";

#[test]
fn a_contact_pulses_in_its_cycle_between_the_decisions() {
    let mut fixture = Fixture::new();
    fixture.bench("input-temperature-1", 100).parameter(33, 1000).parameter(40, 2);
    fixture.set(SET_POINT, 1250).power_on();
    assert_eq!((fixture.after(0, OUTPUT), fixture.see(TERMINALS)), (2500, Value::Int(1)));
    let levels = [499, 2, 1498, 2].map(|milliseconds| fixture.after(milliseconds, OUTPUTS));
    assert_eq!(levels, [1, 0, 0, 1]);
}

#[test]
fn a_settled_device_has_nothing_to_do() {
    let mut fixture = Fixture::new();
    fixture.bench("input-temperature-1", 100).after(2000, OUTPUT);
    assert_eq!(fixture.device.next_step(), None);
    fixture.bench("input-wiring-1", Value::Text("broken".to_owned()));
    assert_eq!(fixture.after(0, ERROR_FLAGS), 2);
}

#[test]
fn silence_takes_the_command() {
    let mut fixture = Fixture::new();
    fixture.bench("input-temperature-1", 20).parameter(115, 10).set(SET_POINT, 500);
    assert_eq!([999, 2].map(|milliseconds| fixture.after(milliseconds, OUTPUTS)), [1, 0]);
    fixture.device.uploaded(OUTPUTS, &mut fixture.od);
    assert_eq!(fixture.after(1, OUTPUTS), 1);
}

#[test]
fn silence_commutes_the_outputs_of_the_master() {
    let mut fixture = Fixture::new();
    for (sub, number) in [(121, 1), (123, 1), (124, 1), (129, 1), (130, 77), (115, 10)] {
        fixture.parameter(sub, number);
    }
    fixture.set(MASTER_OUTPUTS, 2);
    assert_eq!([999, 2].map(|milliseconds| fixture.after(milliseconds, OUTPUTS)), [2, 3]);
    assert_eq!(fixture.after(0, MASTER_ANALOGUE), 77);
    assert_eq!(fixture.set(MASTER_OUTPUTS, 0).after(0, OUTPUTS), 0);
}

#[test]
fn a_fluid_presets_cooling() {
    let mut fixture = Fixture::new();
    for (fluid, preset) in [(1, (125, 4)), (2, (250, 2)), (0, (100, 10))] {
        fixture.parameter(COOLING_FLUID, fluid);
        let [multiplier, cycle] =
            [COOLING_MULTIPLIER, COOLING_CYCLE].map(|sub| parameter(&fixture.od, sub));
        assert_eq!((multiplier, cycle), preset);
    }
}

#[test]
fn the_key_teaches_a_threshold() {
    let mut fixture = Fixture::new();
    fixture.bench("transformer-current-1", 10).parameter(90, 1).bench("key", 1);
    assert_eq!(fixture.after(2999, OUTPUTS), 1);
    assert_eq!(parameter(&fixture.od, HEATER_BREAK), 0);
    fixture.after(2, OUTPUTS);
    assert_eq!(parameter(&fixture.od, HEATER_BREAK), 80);
    assert_eq!(fixture.bench("key", 0).after(0, OUTPUTS), 0);
}

#[test]
fn a_tuning_at_one_start_is_not_repeated() {
    let mut fixture = Fixture::new();
    fixture.set(SET_POINT, 1500).parameter(TUNE, 3).power_on();
    assert_eq!(fixture.after(100, TUNING), 1);
    fixture.after(600_000, TUNING);
    let found = [31, 33, 34].map(|sub| parameter(&fixture.od, sub));
    assert!(found[0] == 0 && found[1] >= 50 && found[2] >= 400, "{found:?}");
    for sub in [33, 34, 35] {
        fixture.parameter(sub, 0);
    }
    fixture.od.set_int(Mux::new(PARAMETERS, TUNE), 3);
    fixture.power_on();
    assert_eq!([31, 33, 34].map(|sub| parameter(&fixture.od, sub)), found);
}

#[test]
fn the_switches_say_where_the_device_is_on_the_bus() {
    let mut fixture = Fixture::new();
    let table = [
        (5, 7, Attachment::Node(5)),
        (0, 7, Attachment::Off),
        (0x85, 7, Attachment::Node(5)),
        (5, 1, Attachment::Off),
        (5, 0, Attachment::Off),
    ];
    for (address, rate, attachment) in table {
        fixture.bench("dip-switch-1", address).bench("dip-switch-2", rate).power_on();
        assert_eq!(fixture.device.attachment(&fixture.od), attachment, "{address} {rate}");
    }
    fixture.bench("dip-switch-1", 0).parameter(ADDRESS, 9).parameter(BIT_RATE_CODE, 6);
    assert_eq!(fixture.device.attachment(&fixture.od), Attachment::Node(9));
    assert!(fixture.bench("dip-switch-2", 15).device.loads_defaults());
}

#[test]
fn faults_are_reported_and_end() {
    let mut fixture = Fixture::new();
    let text = |text: &str| Value::Text(text.to_owned());
    fixture.bench("bus-fault", text("receive-overflow"));
    assert!(fixture.errors.has(0x11));
    fixture.after(100, OUTPUTS);
    assert!(!fixture.errors.has(0x11));
    fixture.bench("module-1", text("broken"));
    assert_eq!(fixture.errors.take_order(), Some(NmtState::STOPPED));
    assert_eq!(fixture.bench("module-1", text("fitted")).errors.register(), 0);
    fixture.bench("memory-fault", text("write"));
    assert_eq!(fixture.device.check(STORE, b"save", &fixture.od), Err(Abort::HARDWARE));
    fixture.device.refused(fixture.now, STORE, b"save", &mut fixture.od);
    assert_eq!(fixture.after(0, OUTPUTS), 0);
    fixture.device.run(fixture.now, &mut fixture.od, &mut fixture.errors);
    assert!(fixture.errors.has(2) && fixture.after(0, ERROR_FLAGS) == 4);
}

/// The parameters whose change nothing shows; `device.md` has the reason of each.
const WITHOUT_EFFECT: [u8; 2] = [113, 114];

/// The subs whose mutants override another decision than that about the value itself.
const DECIDED_OTHERWISE: [(u8, &str); 2] =
    [(41, "fluid-presets-no-cycle"), (121, "expansion-ignored")];

fn deviations_of_mutants(device: &ReferenceDevice) -> Vec<Deviation> {
    mutant::of(device).unwrap().iter().map(Mutant::deviation).collect()
}

/// A mutant is killed by a case, so what it does not obey shows on the bus or on a bench.
#[test]
fn each_parameter_has_a_mutant_that_does_not_obey_it() {
    let device = devices::device("drr460").unwrap();
    let mutants = deviations_of_mutants(&device);
    let taken = |one: &Deviation| Rules::default().with(&one.otherwise(&device).unwrap()[1]);
    let all: Vec<_> = mutants.iter().map(taken).collect();
    let obeys = |sub| {
        let values = -1..=200;
        all.iter().all(|rules| values.clone().all(|value| rules.parameter(sub, value) == value))
    };
    let mutants = mutant::of(&device).unwrap();
    let is_mutant = |name: &str| mutants.iter().any(|one| one.name == name);
    let otherwise =
        |sub| DECIDED_OTHERWISE.iter().any(|(known, name)| *known == sub && is_mutant(name));
    let od = Dictionary::new(&device.description.eds, 1).unwrap();
    let named = |entry: &&canopen::eds::Entry| {
        entry.mux.index == 0x3000 && entry.mux.sub > 0 && !entry.name.starts_with("Reserved")
    };
    let subs = od.entries().iter().filter(named).map(|entry| entry.mux.sub);
    let hidden: Vec<u8> = subs.filter(|sub| obeys(*sub) && !otherwise(*sub)).collect();
    assert_eq!(hidden, WITHOUT_EFFECT);
}

/// Inputs 2 to 5 always read 0, as device.md says, so nothing shows when they are transmitted.
fn shows_nothing(mux: Mux) -> bool {
    matches!(mux.index, 0x6421 | 0x6424..=0x6428) && (2..=5).contains(&mux.sub)
}

/// The reaction to errors is that of the stack, which has mutants of its own.
const OF_THE_STACK: [Mux; 1] = [Mux::new(0x67FE, 1)];

#[test]
fn each_object_that_can_be_written_has_a_mutant_that_does_not_obey_it() {
    let device = devices::device("drr460").unwrap();
    let mutants = deviations_of_mutants(&device);
    let od = Dictionary::new(&device.description.eds, 1).unwrap();
    let written = od.entries().iter().filter(|entry| entry.mux.index >= 0x4000);
    let written = written.filter(|entry| entry.access.writable()).map(|entry| entry.mux);
    let is_ignored = |mux: &Mux| {
        mutants.iter().any(|one| one.ignored().any(|own| own == *mux)) || OF_THE_STACK.contains(mux)
    };
    let hidden: Vec<Mux> = written.filter(|mux| !is_ignored(mux)).collect();
    assert!(hidden.iter().all(|mux| shows_nothing(*mux)), "{hidden:?}");
}
