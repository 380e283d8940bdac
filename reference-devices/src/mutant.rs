//! Mutants: reference devices with one named deviation each. A case that no mutant fails proves
//! nothing.

mod data;
mod frame;
mod patch;
mod sheet;

use std::sync::{Arc, LazyLock};

use canopen::eds::Eds;
use canopen::nearest::did_you_mean;
use canopen::source::{Complaint, Source, read_yaml};
use canopen::{Device, Pattern};

use crate::devices::ReferenceDevice;
use crate::rules::{self, Rules, Specification};
use crate::stack::Node;

pub use data::{Mutant, MutantFile};
pub use frame::FrameMutant;

use data::{Change, Misfit};

impl Mutant {
    /// Whether the device is in order and its data sheet is not.
    pub const fn is_of_data_sheet(&self) -> bool {
        matches!(self.change, Change::Eds(_))
    }

    /// The data sheet that comes with the device.
    ///
    /// # Errors
    /// When the deviation names something that the data sheet does not have.
    pub fn data_sheet(&self, device: &ReferenceDevice) -> Result<String, Complaint> {
        let text = device.eds_text();
        let Change::Eds(patches) = &self.change else { return Ok(text) };
        patches.iter().enumerate().try_fold(text, |text, (number, patch)| {
            let applied = patch.apply(&text);
            applied.map_err(|wrong| self.complaint(&wrong.below(&["eds", &number.to_string()])))
        })
    }
}

/// Mutants that any device can be: deviations from CiA 301 in the stack they share.
const COMMON: &[(&str, &str)] = &[
    ("reference-devices/mutants/cia301.yaml", include_str!("../mutants/cia301.yaml")),
    ("reference-devices/mutants/cia305.yaml", include_str!("../mutants/cia305.yaml")),
    ("reference-devices/mutants/cia401.yaml", include_str!("../mutants/cia401.yaml")),
    ("reference-devices/mutants/cia306.yaml", include_str!("../mutants/cia306.yaml")),
];

static COMMON_SOURCES: LazyLock<Vec<Arc<Source>>> = LazyLock::new(|| {
    let source = |(name, text): &(&str, &str)| {
        Arc::new(Source { name: (*name).to_owned(), text: (*text).to_owned() })
    };
    COMMON.iter().map(source).collect()
});

/// The files that hold the mutants of a device, those that any device can be first.
pub fn sources(device: &ReferenceDevice) -> Vec<Arc<Source>> {
    COMMON_SOURCES.iter().chain(&device.files.mutants).cloned().collect()
}

/// Reads a file of mutants.
///
/// # Errors
/// What is wrong with it; a name that stands there twice is, too.
pub fn read(source: &Arc<Source>) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let mut mutants = read_yaml::<MutantFile>(source).map_err(|wrong| vec![wrong])?.mutants;
    for (number, mutant) in mutants.iter_mut().enumerate() {
        mutant.origin = Some((Arc::clone(source), number));
    }
    let twice = mutants.iter().enumerate().filter_map(|(number, mutant)| {
        let is_first = mutants[..number].iter().all(|other| other.name != mutant.name);
        let message = format!("a mutant {} stands above already", mutant.name);
        (!is_first).then(|| mutant.complain(&["name"], 0, message))
    });
    let complaints: Vec<_> = twice.collect();
    if complaints.is_empty() { Ok(mutants) } else { Err(complaints) }
}

/// The mutants that live on a device or variant.
///
/// # Errors
/// Everything that is wrong with a file of mutants: mistakes in the text, a name that is taken, a
/// variant that the device does not have.
pub fn of(device: &ReferenceDevice) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let family = device.family();
    let (mut mutants, mut complaints) = (Vec::<Mutant>::new(), Vec::new());
    for (place, source) in sources(device).iter().enumerate() {
        let mut read = match read(source) {
            Ok(read) => read,
            Err(mut wrong) => {
                complaints.append(&mut wrong);
                continue;
            }
        };
        for mutant in &mut read {
            mutant.shared = place < COMMON.len();
            if let Some(other) = mutants.iter().find(|other| other.name == mutant.name) {
                let file = other.origin.as_ref().map_or("", |(file, _)| &file.name);
                let message = format!("a mutant {} stands in {file} already", mutant.name);
                complaints.push(mutant.complain(&["name"], 0, message));
            }
            let stranger = |on: &str| device.relatives().all(|name| name != on);
            if let Some(on) = mutant.on.as_ref().filter(|on| stranger(on)) {
                let names: Vec<String> = device.relatives().collect();
                let meant = did_you_mean(on, names.iter().map(String::as_str));
                let message = format!("`{on}` is not a variant of {family}{meant}");
                complaints.push(mutant.complain(&["on"], 0, message));
            }
        }
        mutants.append(&mut read);
    }
    let lives_here = |mutant: &Mutant| {
        let on = mutant.on.as_deref().unwrap_or(family);
        mutant.shared || on == device.description.device
    };
    mutants.retain(lives_here);
    if complaints.is_empty() { Ok(mutants) } else { Err(complaints) }
}

/// The device with the deviation, switched on at time 0.
///
/// # Errors
/// When the deviation names something that is not there: a rule, an object, a pattern.
pub fn build(
    device: &ReferenceDevice,
    node: u8,
    mutant: &Mutant,
) -> Result<Box<dyn Device>, Complaint> {
    built(device, node, mutant).map_err(|misfit| mutant.complaint(&misfit))
}

fn built(device: &ReferenceDevice, node: u8, mutant: &Mutant) -> Result<Box<dyn Device>, Misfit> {
    let node_with = |eds: &Eds, rules: Box<dyn Rules>, behaviour: Option<&str>| {
        let behaviour = match behaviour {
            None => device.behaviour(),
            Some(name) => device.deviating_behaviour(name).ok_or_else(|| {
                let known = device.behaviour_rule_names();
                let meant = did_you_mean(name, known.into_iter());
                let of = &device.description.behaviour;
                Misfit::at(&["behaviour"], format!("behaviour `{of}` has no rule `{name}`{meant}"))
            })?,
        };
        Node::new(eds, node, device.settings(), rules, behaviour)
            .map_err(|(mux, error)| Misfit::at(&["dictionary"], format!("{mux}: {error}")))
    };
    let eds = &device.description.eds;
    let specification = || Box::new(Specification) as Box<dyn Rules>;
    match &mutant.change {
        Change::Rule(name) => {
            let rules = rules::named(name).ok_or_else(|| {
                let meant = did_you_mean(name, rules::names());
                Misfit::at(&["rule"], format!("the stack has no rule `{name}`{meant}"))
            })?;
            Ok(Box::new(node_with(eds, rules, None)?))
        }
        Change::Behaviour(name) => Ok(Box::new(node_with(eds, specification(), Some(name))?)),
        Change::Dictionary(patch) => {
            let mut eds = eds.clone();
            patch.apply(&mut eds).map_err(|wrong| wrong.below(&["dictionary"]))?;
            Ok(Box::new(node_with(&eds, specification(), None)?))
        }
        Change::Eds(_) => Ok(Box::new(node_with(eds, specification(), None)?)),
        Change::Frame(change) => {
            let bind = |text: &str| Ok(text.parse::<Pattern>()?.bind(node, &|_| None));
            let node = node_with(eds, specification(), None)?;
            let mutant = FrameMutant::new(node, change, bind);
            Ok(Box::new(mutant.map_err(|wrong| wrong.below(&["frame"]))?))
        }
    }
}
