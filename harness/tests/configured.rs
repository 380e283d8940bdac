//! Runs against a device that somebody has set up before, as that of a user is.

#[path = "common/session.rs"]
mod session;

use std::sync::Arc;

use canopen::eds::Term;
use canopen::{Mux, Value, VirtualBus};
use harness::folders::Folders;
use harness::target;
use harness::target::{DEFAULT_BIT_RATE, Selection};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reports::{Event, Verdict};
use runner::plan::{self, Plan};
use runner::stop::Stop;

use session::run_session;

#[test]
fn cases_about_alarms_leave_them_as_they_were_set_up() {
    // Link, alternate link, level, hysteresis and type of alarm 1: on the difference from the set
    // point, on the flow, which has no start condition and no hysteresis, and on the pressure.
    let setups = [
        [0x7400_0110, 0x7401_0110, 900, 10, 0x14],
        [0x3050_0110, 0, -1, 0, 0x03],
        [0x3080_0110, 0, 900, 5, 0x02],
    ];
    for setup in setups {
        let objects = ["6500:01", "6501:01", "7502:01", "7503:01", "6508:01"];
        let objects = objects.map(|object| object.parse().expect("an address"));
        let remarks = run("em66/alarm-", objects.into_iter().zip(setup));
        assert_eq!(remarks, Vec::<String>::new(), "{setup:X?}");
    }
}

/// Runs the cases of the suites whose names begin so, on an em66 that has these values. Returns
/// what failed, and what the runner remarked on restoring.
fn run(suites: &str, values: impl Iterator<Item = (Mux, i64)>) -> Vec<String> {
    let mut device = devices::device("em66").expect("it is part of the program");
    let eds = Arc::make_mut(&mut device.description.eds);
    for (mux, value) in values {
        let object = eds.objects.iter_mut().find(|object| object.index == mux.index);
        let entries = object.into_iter().flat_map(|object| &mut object.entries);
        let entry = entries.into_iter().find(|entry| entry.mux == mux).expect("the object");
        entry.default = Some(Term::fixed(Value::from(value)));
    }
    let library = Folders::default().load().expect("the suites load");
    let selection = Selection::of_target(Some("sim:em66"));
    let targets = target::resolve(&selection, &library.catalogue, &Stop::default());
    let targets = targets.map_err(|refused| refused.message);
    let dut = targets.expect("a simulated device").remove(0).dut;
    let plan = plan::plan(&library, &dut, &target::models(&dut.eds)).expect("the suites fit");
    let instances =
        plan.instances.into_iter().filter(|instance| instance.suite.name().starts_with(suites));
    let plan = Plan { instances: instances.collect(), ..plan };
    assert!(plan.instances.len() > 100);
    let mut bus = VirtualBus::new(DEFAULT_BIT_RATE);
    bus.attach(device.node(dut.node, Rules::default()));
    let (mut remarks, mut case) = (Vec::new(), String::new());
    _ = run_session(&library, &plan, &mut bus, &mut |event| match event {
        Event::CaseStarted(started) => case = format!("{}/{}", started.suite, started.case),
        Event::Note(note) if !note.text.contains("which is allowed") => {
            remarks.push(format!("{case}: {}", note.text));
        }
        Event::CaseEnded(ended) if ended.outcome.verdict() >= Verdict::Fail => {
            remarks.push(format!("{case}: {}", ended.outcome.verdict()));
        }
        _ => {}
    });
    remarks
}
