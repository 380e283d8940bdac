//! Campaigns on reference devices: nothing is found on those that keep to their documents, and
//! mutants are found and named.

use campaign::session::{Script, Session};
use campaign::{
    Belief, Blueprint, Campaign, End, Finding, Look, Stage, VirtualDevice, bytes, look, shrink,
};
use canopen::eds;
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::{freedom, mutant};

/// A simulated device, and how models of it are built.
struct Subject {
    stage: VirtualDevice,
    blueprint: Blueprint,
}

impl Subject {
    fn new(device: &ReferenceDevice, deviation: &Deviation) -> Self {
        let node = device.description.default_node;
        let eds = &eds::read(deviation.data_sheet(device).unwrap().as_bytes()).eds;
        let settings = &device.description.settings;
        let built = deviation.build(device, node).unwrap();
        let mut stage = VirtualDevice::new(built, settings.bit_rate);
        let mut seen = Look::default();
        stage
            .ask(&mut |bus| {
                seen = look(bus, eds, node)?;
                Ok(())
            })
            .unwrap();
        let (eds, settings) = seen.amend(eds, node, settings);
        let blueprint = Blueprint::of_sheet(eds, node, settings).unwrap();
        Self { stage, blueprint: blueprint.with_errors(seen.errors) }
    }

    fn belief(&self) -> Belief<'_> {
        Belief::new(&self.blueprint, Vec::new()).unwrap()
    }

    /// What these sessions find.
    fn found(&mut self, sessions: std::ops::RangeInclusive<u64>) -> Vec<String> {
        let Self { stage, blueprint } = self;
        let belief = Belief::new(blueprint, Vec::new()).unwrap();
        let mut campaign = Campaign::new(blueprint, belief, 1);
        let found = sessions.filter_map(|number| campaign.session(stage, number).unwrap());
        found.map(|finding| format!("session {}: {}", finding.number, finding.violation)).collect()
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
    for device in devices::all() {
        let (findings, ..) = Subject::new(device, &Deviation::default()).fuzzed(150, 3);
        let found: Vec<String> = findings
            .iter()
            .map(|finding| format!("session {}: {}", finding.number, finding.violation))
            .collect();
        assert!(found.is_empty(), "{}: {found:?}", device.description.device);
    }
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
        "invalid-commands-without-address",
    ] {
        let freedom = freedoms.iter().find(|freedom| freedom.name == name).unwrap();
        let (findings, _, learnt) = Subject::new(&device, &freedom.deviation()).fuzzed(40, 1);
        let found: Vec<String> = findings.iter().map(|it| it.violation.to_string()).collect();
        assert!(found.is_empty(), "{name}: {found:?}");
        assert!(learnt.iter().any(|learnt| learnt == name), "{name}: {learnt:?}");
    }
}

/// The server time-out of 2 s explains the first sessions of the optimist as well as none does, and
/// fewer types explain those of the configurator as well as parameters that are fixed.
#[test]
fn a_freedom_that_explained_too_little_is_replaced() {
    let device = devices::device("generic").unwrap();
    for (name, last) in [("optimist", 3), ("strict-configurator", 24)] {
        let personalities = freedom::personalities(&device).unwrap();
        let personality = personalities.iter().find(|known| known.name == name).unwrap();
        let found = Subject::new(&device, &personality.deviation()).found(0..=last);
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

/// A refused initiation may leave the transfer before it open; an answer that a reset has ended is
/// not the one that is refused; dummies that a data sheet does not name may be there.
#[test]
fn what_a_refusal_or_a_data_sheet_leaves_open_is_not_judged() {
    let device = devices::device("generic").unwrap();
    let freedoms = freedom::of(&device).unwrap();
    for (name, sessions) in [
        ("local-control", 52..=52),
        ("parameters-fixed-in-this-state", 54..=54),
        ("eds-without-dummy-usage", 12..=12),
    ] {
        let freedom = freedoms.iter().find(|freedom| freedom.name == name).unwrap();
        let found = Subject::new(&device, &freedom.deviation()).found(sessions);
        assert!(found.is_empty(), "{name}: {found:?}");
    }
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
    ] {
        let mutant = mutants.iter().find(|mutant| mutant.name == name).unwrap();
        let (findings, named, _) = Subject::new(&device, &mutant.deviation()).fuzzed(200, 2);
        assert!(!findings.is_empty(), "{name} is not found");
        assert!(named.iter().any(|id| mutant.breaks.contains(id)), "{name}: {named:?}");
    }
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
    let session: Session = serde_json::from_str(text).unwrap();
    let device = devices::device("ax021211").unwrap();
    let mut subject = Subject::new(&device, &Deviation::default());
    let model = subject.belief().model();
    let script = Script::Actions(&session.actions);
    let played = subject.stage.play(&subject.blueprint, model, &script).unwrap();
    assert_eq!(played.end, None);
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
