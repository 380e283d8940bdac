//! Campaigns on reference devices: nothing is found on those that keep to their documents, and
//! mutants are found and named.

mod common;

use std::sync::Mutex;
use std::thread;

use campaign::session::{Script, Session};
use campaign::{
    Belief, Blueprint, Campaign, End, Finding, Judged, Stage, VirtualDevice, bytes, shrink,
};
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::{freedom, mutant};

use common::blueprint;

/// A simulated device, and how models of it are built.
struct Subject {
    stage: VirtualDevice,
    blueprint: Blueprint,
}

impl Subject {
    fn new(device: &ReferenceDevice, deviation: &Deviation) -> Self {
        let built = deviation.build(device, device.description.default_node).unwrap();
        let mut stage = VirtualDevice::new(built, device.description.settings.bit_rate);
        let blueprint = blueprint(&mut stage, device, deviation);
        Self { stage, blueprint }
    }

    fn belief(&self) -> Belief<'_> {
        Belief::new(&self.blueprint, Vec::new()).unwrap()
    }

    /// The device with everything and one freedom.
    fn new_with(freedom: &str) -> Self {
        let device = devices::device("generic").unwrap();
        let freedoms = freedom::of(&device).unwrap();
        let freedom = freedoms.iter().find(|known| known.name == freedom).unwrap();
        Self::new(&device, &freedom.deviation())
    }

    /// What so many sessions find.
    fn found(&mut self, sessions: u64) -> Vec<String> {
        let (findings, ..) = self.fuzzed(sessions, 3);
        let text = |it: &Finding| format!("session {}: {}", it.number, it.violation);
        findings.iter().map(text).collect()
    }

    /// How a session ends that is written as a file has it.
    fn end_of(&mut self, session: &str) -> Option<End> {
        let session: Session = serde_json::from_str(session).unwrap();
        let model = self.belief().model();
        let script = Script::Actions(&session.actions);
        self.stage.play(&self.blueprint, model, &script).unwrap().end
    }

    /// What so many sessions find, the requirements of the likeliest mutant, and what was learnt.
    fn fuzzed(&mut self, sessions: u64, most: usize) -> (Vec<Finding>, Vec<String>, Vec<String>) {
        let Self { stage, blueprint } = self;
        let belief = Belief::new(blueprint, Vec::new()).unwrap();
        let mut campaign = Campaign::new(blueprint, belief, 1);
        let mut findings = Vec::new();
        for number in 0..sessions {
            findings.extend(campaign.session(stage, number).unwrap());
            if findings.len() == most {
                break;
            }
        }
        let looked: Vec<&Finding> = findings.iter().collect();
        let suspects = if looked.is_empty() { Vec::new() } else { campaign.suspects(&looked) };
        let first = suspects.first().map(|it| blueprint.mutants()[it.mutant].clauses.clone());
        let learnt = campaign.belief().freedoms().map(|freedom| freedom.name.clone()).collect();
        (findings, first.unwrap_or_default(), learnt)
    }
}

#[test]
fn nothing_is_found_on_a_reference_device() {
    let left = Mutex::new(devices::all());
    let next = || left.lock().unwrap().next();
    let work = || {
        while let Some(device) = next() {
            let found = Subject::new(device, &Deviation::default()).found(150);
            assert!(found.is_empty(), "{}: {found:?}", device.description.device);
        }
    };
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(work);
        }
    });
}

#[test]
fn what_a_document_leaves_open_is_learnt() {
    let device = devices::device("generic").unwrap();
    let freedoms = freedom::of(&device).unwrap();
    for name in [
        "one-code-for-the-range",
        "general-abort-codes",
        "heartbeat-at-change-of-state",
        "sdo-after-20-ms",
        "block-without-checksum",
        "no-server-time-out",
        "initiation-refused-while-a-transfer-is-open",
    ] {
        let freedom = freedoms.iter().find(|freedom| freedom.name == name).unwrap();
        let (findings, _, learnt) = Subject::new(&device, &freedom.deviation()).fuzzed(40, 1);
        let found: Vec<String> = findings.iter().map(|it| it.violation.to_string()).collect();
        assert!(found.is_empty(), "{name}: {found:?}");
        assert!(learnt.iter().any(|learnt| learnt == name), "{name}: {learnt:?}");
    }
}

/// Several freedoms explain the first sessions of these devices as well as the right ones.
#[test]
fn a_freedom_that_explained_too_little_is_replaced() {
    let device = devices::device("generic").unwrap();
    let personalities = freedom::personalities(&device).unwrap();
    for name in ["optimist", "strict-configurator"] {
        let personality = personalities.iter().find(|known| known.name == name).unwrap();
        let found = Subject::new(&device, &personality.deviation()).found(40);
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

/// The device takes an entry of a valid mapping that is in use, with a length that is not that of
/// the object: each of three checks is the first one that a model refuses it for.
#[test]
fn several_checks_that_a_device_leaves_out_explain_one_answer() {
    let device = devices::device("generic").unwrap();
    let personalities = freedom::personalities(&device).unwrap();
    let personality = personalities.iter().find(|known| known.name == "small-buffers").unwrap();
    let found = Subject::new(&device, &personality.deviation()).found(40);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn what_the_manual_of_a_device_leaves_open_is_learnt() {
    let device = devices::device("drr460").unwrap();
    let freedoms = freedom::of(&device).unwrap();
    for name in ["registers-with-the-communication-bit", "pdo-errors-with-the-communication-bit"] {
        let freedom = freedoms.iter().find(|freedom| freedom.name == name).unwrap();
        let found = Subject::new(&device, &freedom.deviation()).found(8);
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

#[test]
fn dummies_that_a_data_sheet_does_not_name_may_be_there() {
    let found = Subject::new_with("eds-without-dummy-usage").found(80);
    assert!(found.is_empty(), "{found:?}");
}

/// The device refuses the second initiation before it looks at its transfer, which times out.
#[test]
fn a_refused_initiation_may_leave_a_transfer_open() {
    let text = r#"[
        { "does": "download-in-segments", "frames": ["602#2108620101000000"],
          "then": { "answers": { "id": 1410, "count": 1 } } },
        { "does": "download", "frames": ["602#2F022F0000000000"],
          "then": { "answers": { "id": 1410, "count": 1 } } },
        { "does": "wait", "then": { "wait": 1000000 } } ]"#;
    let end = Subject::new_with("parameters-fixed-in-this-state").end_of(text);
    assert!(!matches!(end, Some(End::Violation(_))), "{end:?}");
}

/// The upload is not answered, since the supply was off; its answer is not the one that is refused.
#[test]
fn an_answer_from_before_a_reset_is_not_the_one_that_is_refused() {
    let text = r#"[
        { "does": "upload", "frames": ["602#40002F1B00000000"], "then": { "wait": 0 } },
        { "does": "power-cycle", "then": { "answers": { "id": 1794, "count": 1 } } },
        { "does": "download-unsized", "frames": ["602#22002F1B00000000"],
          "then": { "answers": { "id": 1410, "count": 1 } } },
        { "does": "block-upload", "frames": ["602#A40A100004000000"],
          "then": { "answers": { "id": 1410, "count": 1 } } } ]"#;
    let end = Subject::new_with("local-control").end_of(text);
    assert!(!matches!(end, Some(End::Violation(_))), "{end:?}");
}

#[test]
fn mutants_are_found_and_their_requirements_are_named() {
    let device = devices::device("generic").unwrap();
    let mutants = mutant::of(&device).unwrap();
    for name in [
        "boot-up-twice",
        "nmt-other-node-acts",
        "sdo-served-in-stopped",
        "guarding-toggle-stuck",
        "sdo-toggle-unchecked",
        "abort-without-sub-index",
        "heartbeat-without-state",
        // Half of a freedom does the same, whose other half the data sheet would show.
        "start-ignored",
        // Each of these needs a plan: a whole channel or fastscan.
        "third-server-unheard",
        "lss-fastscan-never-ends",
        "lss-fastscan-answers-for-any-product",
        "lss-activation-ignored",
        "lss-node-127-does-not-boot",
    ] {
        let mutant = mutants.iter().find(|mutant| mutant.name == name).unwrap();
        let (findings, named, _) = Subject::new(&device, &mutant.deviation()).fuzzed(200, 4);
        assert!(!findings.is_empty(), "{name} is not found");
        assert!(named.iter().any(|id| mutant.breaks.contains(id)), "{name}: {named:?}");
    }
}

/// An identifier of 29 bits in 1012h looks like a freedom, until another object refuses one.
#[test]
fn what_contradicts_a_lesson_is_shown_with_it() {
    let device = devices::device("generic").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let mutant = mutants.iter().find(|mutant| mutant.name == "time-any-identifier-accepted");
    let Subject { mut stage, blueprint } = Subject::new(&device, &mutant.unwrap().deviation());
    let mut campaign = Campaign::new(&blueprint, Belief::new(&blueprint, Vec::new()).unwrap(), 1);
    let mut sessions = (0..23).filter_map(|number| campaign.session(&mut stage, number).unwrap());
    let finding = sessions.next().unwrap();
    let mut frames = finding.session.actions.iter().flat_map(|action| &action.frames);
    let accepted = frames.any(|frame| frame.data.starts_with(&[0x23, 0x12, 0x10]));
    assert!(accepted, "{:?}", finding.violation);
}

#[test]
fn a_finding_becomes_shorter_and_shows_the_same() {
    let device = devices::device("generic").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let mutant = mutants.iter().find(|mutant| mutant.name == "sdo-toggle-unchecked").unwrap();
    let mut subject = Subject::new(&device, &mutant.deviation());
    let (findings, ..) = subject.fuzzed(60, 1);
    let belief = subject.belief();
    let mut stage = subject.stage.clone();
    let mut shows = |actions: &[campaign::Action]| {
        let script = Script::Actions(actions);
        let played = stage.play(&subject.blueprint, belief.model(), &script).unwrap();
        matches!(played.end, Some(End::Violation(other)) if other.is_like(&findings[0].violation))
    };
    let short = shrink(&findings[0].session.actions, 1_000, &mut shows);
    assert!(short.len() <= 6, "{short:#?}");
    assert!(shows(&short));
    let text = serde_json::to_string(&Session { actions: short.clone() }).unwrap();
    assert_eq!(serde_json::from_str::<Session>(&text).unwrap().actions, short);
}

/// The reset takes the confirmation of the first download, and the device refuses the second one,
/// since its heartbeat cannot have a period of 1 ms.
#[test]
fn a_refusal_is_of_the_object_that_was_written() {
    let text = r#"[
        { "does": "download", "frames": ["67F#2316100100000000"], "then": { "wait": 0 } },
        { "does": "nmt-reset", "frames": ["000#8100"],
          "then": { "answers": { "id": 1919, "count": 1 } } },
        { "does": "configure-error-control", "frames": ["67F#2B17100001000000"],
          "then": { "answers": { "id": 1535, "count": 1 } } } ]"#;
    let device = devices::device("ax021211").unwrap();
    assert_eq!(Subject::new(&device, &Deviation::default()).end_of(text), None);
}

/// The DRR460 keeps the command to stop that it was given, and is started again after a reset,
/// since a command is no parameter.
#[test]
fn what_an_application_keeps_is_known_until_a_reset() {
    let answered = r#"{"answers": {"id": 1409, "count": 1}}"#;
    let text = format!(
        r#"[{{"does": "download", "frames": ["601#2F03400000000000"], "then": {answered}}},
            {{"does": "upload", "frames": ["601#4003400000000000"], "then": {answered}}},
            {{"does": "store", "frames": ["601#2310100173617665"], "then": {answered}}},
            {{"does": "nmt-reset", "frames": ["000#8101"],
              "then": {{"answers": {{"id": 1793, "count": 1}}}}}},
            {{"does": "upload", "frames": ["601#4003400000000000"], "then": {answered}}}]"#,
    );
    let device = devices::device("drr460").unwrap();
    assert_eq!(Subject::new(&device, &Deviation::default()).end_of(&text), None);
}

#[test]
fn the_same_bytes_are_the_same_session() {
    let device = devices::device("generic").unwrap();
    let mut subject = Subject::new(&device, &Deviation::default());
    let bytes = bytes(7, 3);
    let model = subject.belief().model();
    let script = Script::Bytes(&bytes);
    let first = subject.stage.play(&subject.blueprint, model.clone(), &script).unwrap();
    let second = subject.stage.play(&subject.blueprint, model, &script).unwrap();
    assert!(first.session.actions.len() >= 16);
    assert_eq!(first.seen, second.seen);
}

/// The AX021211 refuses a heartbeat of a few milliseconds. What the model does when it takes it
/// (life guarding ends, the period begins anew) is not waited for then.
#[test]
fn a_time_that_is_refused_leaves_nothing() {
    let device = devices::device("ax021211").unwrap();
    let mut subject = Subject::new(&device, &Deviation::default());
    let answered = r#"{"answers": {"id": 1535, "count": 1}}"#;
    let guarded_before = format!(
        r#"[{{"does": "configure-error-control", "frames": ["67F#2F0D100001000000"],
              "then": {answered}}},
            {{"does": "configure-error-control", "frames": ["67F#2B0C10000A000000"],
              "then": {answered}}},
            {{"does": "guarding", "frames": ["77F#R1"], "then": {{"wait": 100000}}}},
            {{"does": "configure-error-control", "frames": ["67F#2B17100001000000"],
              "then": {{"wait": 100000}}}}]"#,
    );
    assert_eq!(subject.end_of(&guarded_before), None);
    // The heartbeat of the old period comes before the refusal.
    for micros in (8_000..=10_500).step_by(100) {
        let beats_on = format!(
            r#"[{{"does": "download", "frames": ["67F#2B1710000A000000"], "then": {answered}}},
                {{"does": "wait", "then": {{"wait": {micros}}}}},
                {{"does": "download", "frames": ["67F#2B17100005000000"],
                  "then": {{"wait": 50000}}}}]"#,
        );
        assert_eq!(subject.end_of(&beats_on), None, "{micros}");
    }
}

/// The TPDO has an inhibit time of four seconds, and its identifier is written again: what was sent
/// before does not count.
#[test]
fn an_inhibit_time_begins_anew_with_a_parameter() {
    let answered = r#"{"answers": {"id": 1474, "count": 1}}"#;
    let text = format!(
        r#"[{{"does": "configure-mapping", "frames": ["642#2300180100000080"], "then": {answered}}},
            {{"does": "configure-pdo", "frames": ["642#2B001803009C0000"], "then": {answered}}},
            {{"does": "nmt-state", "frames": ["000#0100"], "then": {{"wait": 0}}}},
            {{"does": "configure-mapping", "frames": ["642#23001801C2010000"],
              "then": {answered}}},
            {{"does": "rpdo", "frames": ["242#00050501FF00"], "then": {{"wait": 0}}}},
            {{"does": "configure-pdo", "frames": ["642#23001801C2010000"],
              "then": {answered}}}]"#,
    );
    let device = devices::device("em66-minimum").unwrap();
    let end = Subject::new(&device, &Deviation::default()).end_of(&text);
    assert!(!matches!(end, Some(End::Violation(_))), "{end:?}");
}

/// The model sends the TPDO because it learns what the application has in an object: the device
/// owes a frame only when the first period since the TPDO was configured is over.
#[test]
fn a_tpdo_owes_nothing_before_its_first_period() {
    let answered = r#"{"answers": {"id": 1535, "count": 1}}"#;
    let writes = [
        "67F#23011801000000C0",
        "67F#2F011A0000000000",
        "000#017F",
        "67F#23011A0110020073",
        "67F#2F011A0004000000",
        "67F#23011801FF020000",
        "67F#2F01160000000000",
        "67F#2301160210020073",
        "67F#2F01160002000000",
        "67F#230114017F030000",
    ];
    let action = |frame: &&str| {
        let then = if frame.starts_with("67F") { answered } else { r#"{"wait": 0}"# };
        format!(r#"{{"does": "configure-mapping", "frames": ["{frame}"], "then": {then}}},"#)
    };
    let writes: String = writes.iter().map(action).collect();
    let rpdo = r#"{"does": "rpdo", "frames": ["37F#BE0486C9"], "then": {"wait": 0}}"#;
    let device = devices::device("ax021211").unwrap();
    let end = Subject::new(&device, &Deviation::default()).end_of(&format!("[{writes}{rpdo}]"));
    assert_eq!(end, None);
}

/// A device that refuses a request with one code and with another one is wrong, and each of the two
/// is a freedom.
#[test]
fn what_a_freedom_explains_is_right_on_a_device_that_is_wrong() {
    let second = r#"[{"does": "upload", "frames": ["602#4008100000000000"],
                      "then": {"answers": {"id": 1410, "count": 1}}},
                     {"does": "upload", "frames": ["602#4000100000000000"],
                      "then": {"answers": {"id": 1410, "count": 1}}}]"#;
    let session: Session = serde_json::from_str(second).unwrap();
    let ways = ["initiation-ends-an-open-transfer", "initiation-refused-while-a-transfer-is-open"];
    let seen = ways.map(|way| {
        let mut subject = Subject::new_with(way);
        let model = subject.belief().model();
        let script = Script::Actions(&session.actions);
        subject.stage.play(&subject.blueprint, model, &script).unwrap().seen
    });
    let subject = Subject::new(&devices::device("generic").unwrap(), &Deviation::default());
    let mut belief = subject.belief();
    assert_eq!(belief.explain(&seen[0]), Judged::Learnt);
    assert_eq!(belief.explain(&seen[1]), Judged::Wrong);
    for seen in [&seen[0], &seen[1], &seen[0]] {
        assert_eq!(belief.explain(seen), Judged::Learnt);
    }
}
