//! Campaigns on devices in a time of their own, as on a bus: their clock is another one, and they
//! take some time for each frame. Only the order of their frames is that of the model.

mod common;

use std::collections::VecDeque;
use std::time::Duration;

use campaign::session::{self, Played, Script};
use campaign::{
    Action, Ask, Belief, Blueprint, Campaign, Finding, Judged, Kind, Stage, VirtualDevice,
};
use canopen::{BenchError, Bus, BusError, Device, Frame, Instant, Outbox, Value, VirtualBus, eds};
use common::blueprint;
use reference_devices::change::{Deviation, Replica};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;

/// How long the device may take for a frame that it gets, and for one that it sends.
const HEARS_IN: Duration = Duration::from_millis(4);
const SENDS_IN: Duration = Duration::from_millis(12);
/// Its clock is faster by this part.
const FASTER: u64 = 2_000;

/// A device in its own time.
struct Apart {
    device: Box<dyn Replica>,
    random: fastrand::Rng,
    heard: VecDeque<(Instant, Frame)>,
    said: VecDeque<(Instant, Frame)>,
}

impl Apart {
    fn new(device: Box<dyn Replica>, seed: u64) -> Self {
        let random = fastrand::Rng::with_seed(seed);
        Self { device, random, heard: VecDeque::new(), said: VecDeque::new() }
    }

    /// At most so long after `now`, and not before what is in front.
    fn soon(&mut self, now: Instant, most: Duration, last: Option<Instant>) -> Instant {
        let nanos = self.random.u64(0..=most.as_nanos() as u64);
        (now + Duration::from_nanos(nanos)).max(last.unwrap_or(now))
    }

    fn say(&mut self, now: Instant, mut out: Outbox) {
        while let Some(frame) = out.pop() {
            let last = self.said.back().map(|(at, _)| *at);
            let at = self.soon(now, SENDS_IN, last);
            self.said.push_back((at, frame));
        }
    }
}

/// The time on the clock of the device.
fn there(at: Instant) -> Instant {
    Instant(at.0.saturating_add(at.0 / FASTER))
}

/// When that clock shows it.
fn here(at: Instant) -> Instant {
    Instant((u128::from(at.0) * u128::from(FASTER) / u128::from(FASTER + 1)) as u64 + 1)
}

impl Device for Apart {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut Outbox) {
        let last = self.heard.back().map(|(at, _)| *at);
        let at = self.soon(now, HEARS_IN, last);
        self.heard.push_back((at, *frame));
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        loop {
            let timer = self.device.poll_at().map(here).filter(|due| *due <= now);
            let frame = self.heard.front().map(|(at, _)| *at).filter(|at| *at <= now);
            let mut said = Outbox::default();
            let at = match (timer, frame) {
                (Some(due), frame) if frame.is_none_or(|at| due < at) => {
                    self.device.handle_timeout(there(due), &mut said);
                    due
                }
                (_, Some(at)) => {
                    if let Some((_, frame)) = self.heard.pop_front() {
                        self.device.handle_frame(there(at), &frame, &mut said);
                    }
                    at
                }
                (_, None) => break,
            };
            self.say(at.max(now), said);
        }
        while let Some((_, frame)) = self.said.front().filter(|(at, _)| *at <= now) {
            out.push(*frame);
            self.said.pop_front();
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        let queues = [self.heard.front(), self.said.front()];
        let queues = queues.into_iter().flatten().map(|(at, _)| *at);
        queues.chain(self.device.poll_at().map(here)).min()
    }

    fn bench_names(&self) -> Vec<String> {
        self.device.bench_names()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        _: &mut Outbox,
    ) -> Result<(), BenchError> {
        let mut said = Outbox::default();
        self.device.stimulate(there(now), name, value, &mut said)?;
        self.say(now, said);
        Ok(())
    }

    fn observe(&self, name: &str) -> Option<Value> {
        self.device.observe(name)
    }
}

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
