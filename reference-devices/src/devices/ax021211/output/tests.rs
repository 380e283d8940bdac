use super::*;
use crate::devices::ax021211::load::Wiring;
use crate::devices::ax021211::rules::Ax021211Rules;

const ON: Signal = Signal::new(1.0, None);
const OFF: Signal = Signal::new(0.0, None);

/// The defaults of chapter 2 without ramps: 500 to 4500 mV become 0 to 1500 mA.
fn current() -> OutputSettings {
    OutputSettings {
        kind: Kind::Current,
        pv: (500.0, 4500.0),
        fv: (0.0, 1500.0),
        responses: Responses { control: 1, enable: 3, overriding: 0 },
        fault_fv: 500.0,
        override_fv: 750.0,
        detects: true,
        hysteresis: 100.0,
        reaction_delay: Duration::from_millis(1000),
        ..OutputSettings::default()
    }
}

fn pv(value: f64) -> Signal {
    Signal::new(value, None)
}

struct Bench {
    output: Output,
    settings: OutputSettings,
    load: Load,
    now: Instant,
}

impl Bench {
    fn new(settings: OutputSettings) -> Self {
        Self { output: Output::default(), settings, load: Load::default(), now: Instant::ZERO }
    }

    /// Advances by the given milliseconds.
    fn after(&mut self, millis: u64, inputs: [Signal; 3]) -> OutputView {
        let elapsed = Duration::from_millis(millis);
        self.now += elapsed;
        let at = (&self.load, 24.0);
        self.output.evaluate(
            (self.now, elapsed),
            &self.settings,
            inputs,
            at,
            &Ax021211Rules::plain(),
        )
    }

    fn commanded(&mut self, millis: u64, inputs: [Signal; 3]) -> i64 {
        self.after(millis, inputs).commanded.0
    }
}

fn alone(control: Signal) -> [Signal; 3] {
    [control, Signal::ABSENT, Signal::ABSENT]
}

#[test]
fn figure_5_is_linear_between_its_ends_and_table_7_switches_off_beyond_them() {
    for (response, below, low, middle, high, above) in
        [(0, 300, 300, 900, 1500, 1500), (1, 0, 300, 900, 1500, 1500), (2, 300, 300, 900, 1500, 0)]
    {
        let mut settings = current();
        settings.fv.0 = 300.0;
        settings.responses.control = response;
        let mut bench = Bench::new(settings);
        let seen = [499.0, 500.0, 2500.0, 4500.0, 4501.0]
            .map(|value| bench.commanded(0, alone(pv(value))));
        assert_eq!(seen, [below, low, middle, high, above], "{response}");
    }
    let mut inverse = current();
    inverse.fv = (1500.0, 0.0);
    let mut bench = Bench::new(inverse);
    let seen = [500.0, 1500.0, 4500.0].map(|value| bench.commanded(0, alone(pv(value))));
    assert_eq!(seen, [1500, 1125, 0]);
}

#[test]
fn table_8_enables_and_disables() {
    for (response, on, enabled) in [
        (0, true, true),
        (1, true, true),
        (2, true, true),
        (3, false, true),
        (4, false, true),
        (5, false, true),
        (0, false, false),
        (3, true, false),
    ] {
        assert_eq!(disabled(response, on).is_none(), enabled, "{response} {on}");
    }
    for (response, at_once, later) in
        [(0, 0, 0), (1, 900, 300), (2, 900, 900), (3, 0, 0), (4, 900, 300), (5, 900, 900)]
    {
        let mut settings = current();
        settings.ramp = Ramp { span: 1500.0, down: Duration::from_secs(1), ..Ramp::default() };
        settings.responses.enable = response;
        let mut bench = Bench::new(settings);
        let (enabling, disabling) = if response < 3 { (ON, OFF) } else { (OFF, ON) };
        assert_eq!(bench.commanded(0, [pv(2900.0), enabling, Signal::ABSENT]), 900);
        let disabled = [pv(2900.0), disabling, Signal::ABSENT];
        let seen = [bench.commanded(0, disabled), bench.commanded(400, disabled)];
        assert_eq!(seen, [at_once, later], "{response}");
    }
}

#[test]
fn table_9_overrides_and_a_fault_comes_first() {
    let mut bench = Bench::new(current());
    assert_eq!(bench.commanded(0, [pv(4500.0), ON, ON]), 750);
    assert_eq!(bench.commanded(0, [pv(4500.0), ON, OFF]), 0);
    let faults = [
        [pv(4500.0).failing(true), Signal::ABSENT, ON],
        [pv(4500.0), OFF.failing(true), ON],
        [pv(4500.0), OFF, OFF.failing(true)],
    ];
    for inputs in faults {
        assert_eq!(bench.commanded(0, inputs), 500);
        assert_eq!(bench.commanded(0, alone(pv(4500.0))), 1500);
    }
    bench.settings.keeps_on_fault = true;
    assert_eq!(bench.commanded(0, faults[0]), 1500);
    bench.settings.responses.overriding = 1;
    assert_eq!(bench.commanded(0, [pv(4500.0), OFF, OFF]), 750);
    assert_eq!(bench.commanded(0, [pv(4500.0), OFF, ON]), 1500);
}

#[test]
fn ramps_soften_the_control_input_only() {
    let mut settings = current();
    let (up, down) = (Duration::from_millis(1000), Duration::from_millis(500));
    settings.ramp = Ramp { span: 1500.0, up, down, bias: 0.0 };
    let mut bench = Bench::new(settings);
    assert_eq!(bench.commanded(0, alone(pv(4500.0))), 0);
    assert_eq!(bench.commanded(400, alone(pv(4500.0))), 600);
    assert_eq!(bench.output.due(bench.now), Some(bench.now));
    assert_eq!(bench.commanded(600, alone(pv(4500.0))), 1500);
    assert_eq!(bench.output.due(bench.now), None);
    assert_eq!(bench.commanded(100, alone(pv(0.0))), 1200);
    assert_eq!(bench.commanded(0, [pv(0.0), OFF, ON]), 750);
    assert_eq!(bench.commanded(100, alone(pv(4500.0))), 900);
}

#[test]
fn the_static_bias_is_taken_off_at_zero() {
    let mut settings = current();
    (settings.pv, settings.fv) = ((0.0, 100.0), (200.0, 1200.0));
    settings.responses.control = 0;
    settings.static_bias = 150.0;
    let mut bench = Bench::new(settings);
    let seen = [0.0, 1.0, 50.0].map(|value| bench.commanded(0, alone(pv(value))));
    assert_eq!(seen, [50, 210, 700]);
}

#[test]
fn each_type_has_its_range_and_its_stage() {
    let seen = |kind, fv| {
        let mut settings = current();
        (settings.kind, settings.fv, settings.digits) = (kind, (0.0, fv), 1);
        let view = Bench::new(settings).after(0, alone(pv(4500.0)));
        let round = |value: f64| value.round() as i64;
        let Driven { duty, volts, milliamperes, .. } = view.driven;
        (view.commanded.0, view.feedback.0, round(duty * 100.0), round(volts), round(milliamperes))
    };
    assert_eq!(seen(Kind::Disabled, 10.0), (0, 0, 0, 0, 0));
    assert_eq!(seen(Kind::Voltage, 12.0), (120, 120, 50, 12, 1500));
    assert_eq!(seen(Kind::Voltage, 60.0), (600, 600, 100, 24, 3000));
    assert_eq!(seen(Kind::Current, 1500.0), (15_000, 15_000, 50, 12, 1500));
    assert_eq!(seen(Kind::Current, 3000.0), (25_000, 25_000, 83, 20, 2500));
    assert_eq!(seen(Kind::Pwm, 25.0), (250, 250, 25, 6, 750));
}

#[test]
fn an_open_circuit_is_a_fault_when_it_lasts() {
    let mut bench = Bench::new(current());
    let driven = alone(pv(2500.0));
    bench.after(0, driven);
    assert_eq!(bench.output.due(bench.now), None);
    bench.load.wiring = Wiring::Broken;
    let view = bench.after(0, driven);
    assert_eq!((view.commanded.0, view.feedback.0), (750, 0));
    assert_eq!(bench.output.due(bench.now), Some(bench.now + Duration::from_secs(1)));
    bench.after(999, driven);
    assert!(!bench.output.has_fault());
    let view = bench.after(1, driven);
    assert!(bench.output.has_fault() && view.feedback.1.is_valid());
    assert!(bench.after(1, driven).feedback.1.has_failed());
    bench.after(0, alone(pv(0.0)));
    assert!(!bench.output.has_fault());
}

#[test]
fn a_difference_within_the_tolerance_is_none_and_a_short_circuit_has_a_signal() {
    let faulty = |ohms, wiring, value, detects| {
        let mut bench = Bench::new(OutputSettings { detects, ..current() });
        bench.load = Load { ohms, wiring, ..Load::default() };
        bench.after(0, alone(pv(value)));
        bench.after(1000, alone(pv(value)));
        bench.output.has_fault()
    };
    // 24 V drive 1400 mA through the first coil and 1399 mA through the second.
    assert!(!faulty(24.0 / 1.4, Wiring::Connected, 4500.0, true));
    assert!(faulty(24.0 / 1.399, Wiring::Connected, 4500.0, true));
    assert!(!faulty(8.0, Wiring::Broken, 700.0, true));
    assert!(faulty(8.0, Wiring::Shorted, 700.0, true));
    assert!(!faulty(8.0, Wiring::Shorted, 4500.0, false));
    assert!(!faulty(8.0, Wiring::Shorted, 0.0, true));
}

fn digital(kind: Kind) -> OutputSettings {
    OutputSettings { kind, override_fv: 1.0, ..current() }
}

#[test]
fn a_digital_output_shows_its_states_and_reverts_to_its_fault_state() {
    let mut bench = Bench::new(digital(Kind::OnOff));
    let states = |view: OutputView| (view.commanded.0, view.feedback.0, view.drives_digital);
    assert_eq!(states(bench.after(0, alone(ON))), (1, 1, true));
    assert_eq!(states(bench.after(0, alone(OFF))), (0, 0, false));
    assert_eq!(states(bench.after(0, [OFF, Signal::ABSENT, ON])), (1, 1, true));
    assert_eq!(states(bench.after(0, [ON, ON, OFF])), (0, 0, false));
    assert_eq!(states(bench.after(0, alone(ON.failing(true)))), (0, 0, false));
    let view = bench.after(0, alone(ON));
    assert_eq!((view.driven.volts, view.driven.duty), (24.0, 1.0));
}

#[test]
fn a_hotshot_output_has_a_current_and_a_type_that_changes_begins_anew() {
    let mut bench = Bench::new(digital(Kind::Hotshot));
    let view = bench.after(0, alone(ON));
    assert_eq!((view.commanded.0, view.driven.milliamperes), (1, 0.0));
    bench.settings.kind = Kind::Current;
    bench.settings.ramp.up = Duration::from_secs(1);
    assert_eq!(bench.commanded(0, alone(pv(4500.0))), 0);
}
