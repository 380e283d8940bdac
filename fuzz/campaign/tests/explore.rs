//! Explorations of reference devices: nothing is found on those that keep to their documents, and
//! mutants of their applications are found and named.

use campaign::session::{Script, Session};
use campaign::{Belief, Blueprint, Campaign, Finding, Judged, Stage, VirtualDevice};
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::{freedom, mutant};

/// The devices with an application.
const FAMILIES: [&str; 4] = ["drr460", "mcm260x-9ad", "ax021211", "em66"];

/// What so many sessions show.
struct Shown {
    findings: Vec<Finding>,
    /// The freedoms that were learnt.
    learnt: Vec<String>,
    /// The likeliest mutant of the first finding.
    suspect: Option<String>,
    /// What was not judged.
    left_out: Vec<String>,
}

fn explored(device: &ReferenceDevice, deviation: &Deviation, sessions: u64) -> Shown {
    let node = device.description.default_node;
    let bit_rate = device.description.settings.bit_rate;
    let built = deviation.build(device, node).unwrap();
    let mut stage = VirtualDevice::new(built, bit_rate);
    let blueprint = Blueprint::of_reference(device, node, bit_rate).unwrap();
    let belief = Belief::new(&blueprint, Vec::new()).unwrap();
    let mut campaign = Campaign::new(&blueprint, belief, 1);
    let mut findings = Vec::new();
    for number in 0..sessions {
        findings.extend(campaign.session(&mut stage, number).unwrap());
        if !findings.is_empty() {
            break;
        }
    }
    let looked: Vec<&Finding> = findings.iter().collect();
    let suspects = if looked.is_empty() { Vec::new() } else { campaign.suspects(&looked) };
    let suspect = suspects.first().map(|it| blueprint.mutants()[it.mutant].name.clone());
    let learnt = campaign.belief().freedoms().map(|freedom| freedom.name.clone()).collect();
    let left_out = campaign.tally().judged.left_out(blueprint.surface().unwrap());
    Shown { findings, learnt, suspect, left_out }
}

fn text(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(|it| format!("session {}: {}", it.number, it.violation)).collect()
}

#[test]
fn nothing_is_found_on_a_reference_device_and_everything_is_judged() {
    for device in devices::all().filter(|it| it.family() != devices::WITH_EVERYTHING) {
        let shown = explored(device, &Deviation::default(), 40);
        let name = &device.description.device;
        assert!(shown.findings.is_empty(), "{name}: {:?}", text(&shown.findings));
        assert!(shown.learnt.is_empty(), "{name}: {:?}", shown.learnt);
        assert!(shown.left_out.is_empty(), "{name}: {:?}", shown.left_out);
    }
}

#[test]
fn what_a_document_leaves_open_is_learnt() {
    for name in FAMILIES {
        let device = devices::device(name).unwrap();
        for freedom in freedom::of(&device).unwrap().iter().step_by(9) {
            let shown = explored(&device, &freedom.deviation(), 10);
            let (found, freedom) = (text(&shown.findings), &freedom.name);
            assert!(found.is_empty(), "{name} with {freedom}: {found:?}");
        }
    }
}

/// Whether a device with two freedoms is understood by what these actions show.
fn learns(name: &str, mut both: [&str; 2], actions: &str) {
    let device = devices::device(name).unwrap();
    let freedoms = freedom::of(&device).unwrap();
    let mixture = freedom::mixture(freedoms.iter().filter(|known| both.contains(&&*known.name)));
    let node = device.description.default_node;
    let bit_rate = device.description.settings.bit_rate;
    let mut stage = VirtualDevice::new(mixture.build(&device, node).unwrap(), bit_rate);
    let blueprint = Blueprint::of_reference(&device, node, bit_rate).unwrap();
    let mut belief = Belief::new(&blueprint, Vec::new()).unwrap();
    let session: Session = serde_json::from_str(actions).unwrap();
    let script = Script::Actions(&session.actions);
    let seen = stage.play(&blueprint, belief.model(), &script).unwrap().seen;
    assert_eq!(belief.explain(&seen), Judged::Learnt);
    let mut learnt: Vec<&str> = belief.freedoms().map(|freedom| &*freedom.name).collect();
    learnt.sort_unstable();
    both.sort_unstable();
    assert_eq!(learnt, both);
}

/// With the links in each other's place alone, the type would be refused without its link; with the
/// other freedom alone, the alarm would be active.
#[test]
fn freedoms_that_only_together_explain_something_are_learnt() {
    let answered = r#""then": { "answers": { "id": 1474, "count": 1 } }"#;
    let actions = format!(
        r#"[ {{ "does": "download", "frames": ["642#23D0650110010074"], {answered} }},
             {{ "does": "download", "frames": ["642#2FD8650102000000"], {answered} }} ]"#
    );
    learns("em66", ["type-before-link", "alarm-links-change-places"], &actions);
}

/// An automatic tuning begins far above its set point, and the sensor breaks meanwhile. Alone, one
/// that waits for the sensor has no swing, and one that takes an overshoot is at its end.
#[test]
fn freedoms_that_were_both_asked_before_are_learnt_together() {
    let answered = r#""then": { "answers": { "id": 1409, "count": 1 } }"#;
    let process = r#""does": "stimulate", "then": { "wait": 150000 }"#;
    let named = r#""bench": { "name": "input-temperature-1", "value""#;
    let actions = format!(
        r#"[ {{ "does": "download", "frames": ["601#2B00301F01000000"], {answered} }},
             {{ "does": "download", "frames": ["601#2B004000D08A0000"], {answered} }},
             {{ {process}, {named}: "-338.45" }} }},
             {{ {process}, {named}: "-1" }} }} ]"#
    );
    learns("drr460", ["tuning-by-one-overshoot", "tuning-waits-for-the-sensor"], &actions);
}

#[test]
fn what_a_device_says_is_open_is_not_judged() {
    let device = devices::device("mcm260x-9ad").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let dark = mutants.iter().find(|known| known.name == "mcm-com-led-dark").unwrap();
    let shown = explored(&device, &dark.deviation(), 20);
    assert!(shown.findings.is_empty(), "{:?}", text(&shown.findings));
}

#[test]
fn mutants_of_applications_are_found_and_named() {
    for (name, mutant) in [
        ("drr460", "filter-on-by-default"),
        ("drr460", "parameter-70-refuses-its-last-value"),
        ("em66", "output-without-digits"),
    ] {
        let device = devices::device(name).unwrap();
        let mutants = mutant::of(&device).unwrap();
        let planted = mutants.iter().find(|known| known.name == mutant).unwrap();
        let shown = explored(&device, &planted.deviation(), 400);
        assert!(!shown.findings.is_empty(), "{mutant}");
        assert_eq!(shown.suspect.as_deref(), Some(mutant), "{:?}", text(&shown.findings));
    }
}
