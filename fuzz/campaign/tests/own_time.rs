//! Campaigns on devices in a time of their own, as on a bus.

#[path = "common/apart.rs"]
mod apart;
mod common;

use apart::Apart;
use campaign::session::{self, Played, Script};
use campaign::{
    Action, Ask, Belief, Blueprint, Campaign, Finding, Judged, Kind, Stage, VirtualDevice,
};
use canopen::{Bus, BusError, Instant, VirtualBus, eds};
use common::blueprint;
use reference_devices::change::{Deviation, Replica};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;

/// A new one for each session, each a little different.
struct Place {
    device: Box<dyn Replica>,
    bit_rate: u32,
    seed: u64,
}

impl Place {
    fn bus(&mut self) -> VirtualBus<'static> {
        self.seed += 1;
        let mut bus = VirtualBus::new(self.bit_rate);
        bus.attach(Apart::new(self.device.replica(), self.seed));
        bus
    }
}

impl Stage for Place {
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError> {
        session::play(&mut self.bus(), blueprint, model, script)
    }

    fn repeats(&self) -> u32 {
        2
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError> {
        let mut bus = self.bus();
        while bus.recv(Instant(3_000_000_000))?.is_some() {}
        what(&mut bus)
    }
}

/// What so many sessions find, and how many are undecided.
fn fuzzed(device: &ReferenceDevice, deviation: &Deviation, sessions: u64) -> (Vec<Finding>, u64) {
    let built = deviation.build(device, device.description.default_node).unwrap();
    let bit_rate = device.description.settings.bit_rate;
    let mut place = Place { device: built, bit_rate, seed: 0 };
    let blueprint = blueprint(&mut place, device, deviation);
    campaign(&mut place, blueprint, sessions)
}

/// The same with the reference device as the model.
fn explored(device: &ReferenceDevice, deviation: &Deviation, sessions: u64) -> (Vec<Finding>, u64) {
    let node = device.description.default_node;
    let built = deviation.build(device, node).unwrap();
    let bit_rate = device.description.settings.bit_rate;
    let mut place = Place { device: built, bit_rate, seed: 0 };
    let blueprint = Blueprint::of_reference(device, node, bit_rate).unwrap();
    campaign(&mut place, blueprint, sessions)
}

fn campaign(place: &mut Place, blueprint: Blueprint, sessions: u64) -> (Vec<Finding>, u64) {
    let blueprint = blueprint.in_its_own_time(true).sparing(vec![Kind::PowerCycle]);
    let belief = Belief::new(&blueprint, Vec::new()).unwrap();
    let mut campaign = Campaign::new(&blueprint, belief, 1);
    let mut findings = Vec::new();
    for number in 0..sessions {
        findings.extend(campaign.session(place, number).unwrap());
    }
    (findings, campaign.tally().undecided)
}

/// Nothing was found, and few sessions are undecided.
fn nothing(name: &str, sessions: u64, (findings, undecided): &(Vec<Finding>, u64)) {
    let text = |it: &Finding| format!("session {}: {}", it.number, it.violation);
    let found: Vec<String> = findings.iter().map(text).collect();
    assert!(found.is_empty(), "{name}: {found:#?}");
    assert!(undecided * 20 <= sessions, "{name}: {undecided} undecided");
}

#[test]
fn nothing_is_found_on_a_device_in_its_own_time() {
    const SESSIONS: u64 = 60;
    for name in ["generic", "em66"] {
        let device = devices::device(name).unwrap();
        nothing(name, SESSIONS, &fuzzed(&device, &Deviation::default(), SESSIONS));
    }
}

#[test]
fn a_mutant_is_found_in_its_own_time() {
    let device = devices::device("generic").unwrap();
    let mutants = mutant::of(&device).unwrap();
    for name in ["sdo-toggle-unchecked", "heartbeat-cannot-be-stopped"] {
        let mutant = mutants.iter().find(|mutant| mutant.name == name).unwrap();
        let (findings, _) = fuzzed(&device, &mutant.deviation(), 24);
        assert!(!findings.is_empty(), "{name}");
    }
}

#[test]
fn an_exploration_finds_nothing_on_a_device_in_its_own_time() {
    const SESSIONS: u64 = 60;
    for name in ["drr460", "em66", "ax021211", "mcm260x-1ad", "mcm260x-5ad", "mcm260x-9ad"] {
        let device = devices::device(name).unwrap();
        nothing(name, SESSIONS, &explored(&device, &Deviation::default(), SESSIONS));
    }
}

#[test]
fn an_exploration_finds_a_mutant_in_its_own_time() {
    let device = devices::device("drr460").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let name = "filter-on-by-default";
    let mutant = mutants.iter().find(|mutant| mutant.name == name).unwrap();
    let (findings, _) = explored(&device, &mutant.deviation(), 4);
    assert!(!findings.is_empty(), "{name}");
}

/// A replica that took the first write at the moment of its boot-up would not take it, and what a
/// device does that ignores the setting would be right for that replica.
#[test]
fn one_write_after_the_boot_up_is_enough() {
    const SESSION: &str = r#"[
        { "does": "download", "frames": ["601#2B00301005000000"],
          "then": { "answers": { "id": 1409, "count": 1 } } }
    ]"#;
    let device = devices::device("drr460").unwrap();
    let mutants = mutant::of(&device).unwrap();
    let mutant = mutants.iter().find(|it| it.name == "command-live-zero-ignored").unwrap();
    let blueprint = Blueprint::of_reference(&device, 1, 1_000_000).unwrap();
    let blueprint = blueprint.in_its_own_time(true).sparing(vec![Kind::PowerCycle]);
    let actions: Vec<Action> = serde_json::from_str(SESSION).unwrap();
    for (deviation, is_found) in [(mutant.deviation(), true), (Deviation::default(), false)] {
        let built = deviation.build(&device, 1).unwrap();
        for seed in 0..8 {
            let mut place = Place { device: built.replica(), bit_rate: 1_000_000, seed };
            let model = Belief::new(&blueprint, Vec::new()).unwrap().model();
            let played = place.play(&blueprint, model, &Script::Actions(&actions)).unwrap();
            assert_eq!(played.end.is_some(), is_found, "seed {seed}");
        }
    }
}

/// What came a moment too early waits for what explains it, and must not hide what else is to be
/// explained until then.
#[test]
fn freedoms_that_show_in_the_same_moment_are_learnt() {
    const AT_ONCE: [&str; 2] = ["mapping-changes-while-valid", "heartbeat-begins-at-once"];
    const SESSION: &str = r#"[
        { "does": "download", "frames": ["601#2B17100000010000"],
          "then": { "answers": { "id": 1409, "count": 1 } } },
        { "does": "download", "frames": ["601#2F001A0000000000"],
          "then": { "answers": { "id": 1409, "count": 1 } } }
    ]"#;
    let description = &devices::device("generic").unwrap().description;
    let eds = eds::read(devices::device("generic").unwrap().eds_text().as_bytes()).eds;
    let blueprint = Blueprint::of_sheet(eds, 1, description.settings.clone()).unwrap();
    let blueprint = blueprint.in_its_own_time(true);
    let used = blueprint.freedoms().iter().filter(|it| AT_ONCE.contains(&it.name.as_str()));
    let mut stage = VirtualDevice::new(blueprint.build(used).unwrap(), 1_000_000);
    let mut belief = Belief::new(&blueprint, Vec::new()).unwrap();
    let actions: Vec<Action> = serde_json::from_str(SESSION).unwrap();
    let played = stage.play(&blueprint, belief.model(), &Script::Actions(&actions)).unwrap();
    assert_eq!(belief.explain(&played.seen), Judged::Learnt);
    let mut learnt: Vec<_> = belief.freedoms().map(|freedom| freedom.name.as_str()).collect();
    learnt.sort_unstable();
    assert_eq!(learnt, ["heartbeat-begins-at-once", "mapping-changes-while-valid"]);
}
