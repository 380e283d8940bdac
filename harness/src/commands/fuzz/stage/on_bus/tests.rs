//! Explorations of devices that go on from session to session, as on a bus, in virtual time.

#[path = "../../../../../../fuzz/campaign/tests/common/apart.rs"]
mod apart;

use campaign::session::BOOTED;
use campaign::{Belief, Blueprint, Campaign, Finding};
use canopen::{Bus, VirtualBus};
use clap::Parser;
use reference_devices::{devices, mutant};
use runner::run::{Policy, Undo, Visit};
use runner::stop::Stop;

use super::OnBus;
use crate::commands::fuzz::known::known;
use crate::commands::fuzz::model::ON_BUS;
use crate::target::{self, Selection};
use apart::Apart;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    selection: Selection,
}

/// What so many sessions find on a reference device with this mistake, and how many are undecided.
fn explored(name: &str, mistake: Option<&str>, sessions: u64) -> (Vec<Finding>, u64) {
    let word = format!("sim:{name}");
    let Line { selection } = Line::parse_from(["harness", "--target", &word]);
    let (stop, catalogue) = (Stop::default(), selection.folders.catalogue.load().unwrap());
    let target = target::resolve(&selection, &catalogue, &stop).unwrap().remove(0);
    let library = selection.folders.load_part(|source| !source.name.contains("/cia30")).unwrap();
    let device = devices::device(name).unwrap();
    let node = target.dut.node;
    let bit_rate = device.description.settings.bit_rate;

    let mutants = mutant::of(&device).unwrap();
    let mutant = mutants.iter().find(|mutant| Some(&*mutant.name) == mistake);
    let deviation = mutant.map(|mutant| mutant.deviation()).unwrap_or_default();
    let mut bus = VirtualBus::new(bit_rate);
    bus.attach(Apart::new(deviation.build(&device, node).unwrap(), 1));
    while bus.recv(BOOTED).unwrap().is_some() {}
    let policy = Policy::at_bit_rate(bit_rate);
    let visit = Visit::begin(&mut bus, &target.dut, policy, Undo::default(), &stop).unwrap();
    let (watch, reached, lost, moved) = Default::default();
    let (bus, visit) = (Some(Box::new(bus) as Box<dyn Bus>), Some(visit));
    let stop_of_place = stop.clone();
    let mut place =
        OnBus { target: &target, stop: stop_of_place, bus, visit, watch, reached, lost, moved };

    let blueprint = Blueprint::of_reference(&device, node, bit_rate).unwrap();
    let blueprint = blueprint.in_its_own_time(true).lasting(true).sparing(ON_BUS.to_vec());
    let stories = known(&library, &blueprint, &target.dut, &stop).unwrap();
    let blueprint = blueprint.knowing(stories);
    let mut campaign = Campaign::new(&blueprint, Belief::new(&blueprint, Vec::new()).unwrap(), 1);
    let mut findings = Vec::new();
    for number in 0..sessions {
        findings.extend(campaign.session(&mut place, number).unwrap());
    }
    (findings, campaign.tally().undecided)
}

#[test]
fn nothing_is_found_on_a_device_that_goes_on() {
    let devices = [("em66", 80), ("drr460", 80), ("mcm260x-2ad", 240), ("ax021211", 80)];
    for (name, sessions) in devices {
        let (findings, undecided) = explored(name, None, sessions);
        let text = |it: &Finding| format!("session {}: {}", it.number, it.violation);
        let found: Vec<String> = findings.iter().map(text).collect();
        assert!(found.is_empty(), "{name}: {found:#?}");
        assert!(undecided * 20 <= sessions, "{name}: {undecided} undecided");
    }
}

#[test]
fn a_mistake_is_found_on_a_device_that_goes_on() {
    let (findings, _) = explored("drr460", Some("filter-on-by-default"), 1);
    assert!(!findings.is_empty());
}
