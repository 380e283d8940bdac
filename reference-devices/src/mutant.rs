//! Mutants: reference devices with one named deviation each. A case that no mutant fails proves
//! nothing.

mod data;
mod frame;
mod patch;
mod sheet;

use canopen::eds::Eds;
use canopen::{Device, Pattern};

use crate::devices::{self, ReferenceDevice};
use crate::rules::{self, Rules, Specification};
use crate::stack::Node;

pub use data::Mutant;
pub use frame::FrameMutant;

use data::{Change, MutantFile};

impl Mutant {
    /// Whether the device is in order and its data sheet is not.
    pub const fn is_of_data_sheet(&self) -> bool {
        matches!(self.change, Change::Eds(_))
    }

    /// The data sheet that comes with the device.
    ///
    /// # Errors
    /// When the deviation names something that the data sheet does not have.
    pub fn data_sheet(&self, device: &ReferenceDevice) -> Result<String, String> {
        let text = device.eds_text();
        match &self.change {
            Change::Eds(patches) => patches
                .iter()
                .try_fold(text, |text, patch| patch.apply(&text))
                .map_err(|why| format!("mutant {}: {why}", self.name)),
            _ => Ok(text),
        }
    }
}

/// Mutants that any device can be: deviations from CiA 301 in the stack they share.
const COMMON: &[(&str, &str)] = &[
    ("reference-devices/mutants/cia301.yaml", include_str!("../mutants/cia301.yaml")),
    ("reference-devices/mutants/cia305.yaml", include_str!("../mutants/cia305.yaml")),
    ("reference-devices/mutants/cia401.yaml", include_str!("../mutants/cia401.yaml")),
    ("reference-devices/mutants/cia306.yaml", include_str!("../mutants/cia306.yaml")),
];

/// The files that hold the mutants of a device: path in the project, and text.
pub fn sources(device: &ReferenceDevice) -> Vec<(String, &'static str)> {
    let own = format!("reference-devices/{}/mutants.yaml", device.family());
    let common = COMMON.iter().map(|(path, text)| ((*path).to_owned(), *text));
    common.chain([(own, device.mutants_yaml())]).collect()
}

/// Reads a file of mutants.
///
/// # Errors
/// What is wrong with it, with line and column.
pub fn read(text: &str) -> Result<Vec<Mutant>, serde_yaml::Error> {
    serde_yaml::from_str::<MutantFile>(text).map(|file| file.mutants)
}

/// The mutants that live on a device or variant.
///
/// # Errors
/// The file that does not load, and why; a mutant on a variant that is none.
pub fn of(device: &ReferenceDevice) -> Result<Vec<Mutant>, String> {
    let (family, mut mutants) = (device.family(), Vec::<Mutant>::new());
    for (place, (file, text)) in sources(device).into_iter().enumerate() {
        for mut mutant in read(text).map_err(|error| format!("{file}: {error}"))? {
            mutant.shared = place < COMMON.len();
            if mutants.iter().any(|other| other.name == mutant.name) {
                return Err(format!("{file}: mutant {} stands there twice", mutant.name));
            }
            if let Some(on) = &mutant.on
                && !devices::with_variants(family).any(|name| name == on)
            {
                return Err(format!("{file}: mutant {}: {on} is no {family}", mutant.name));
            }
            mutants.push(mutant);
        }
    }
    let lives_here = |mutant: &Mutant| {
        mutant.shared || mutant.on.as_deref().unwrap_or(family) == device.description.device
    };
    mutants.retain(lives_here);
    Ok(mutants)
}

/// The device with the deviation, switched on at time 0.
///
/// # Errors
/// When the deviation names something that is not there: a rule, an object, a pattern.
pub fn build(
    device: &ReferenceDevice,
    node: u8,
    mutant: &Mutant,
) -> Result<Box<dyn Device>, String> {
    let node_with = |eds: &Eds, rules: Box<dyn Rules>, behaviour: Option<&str>| {
        let behaviour = match behaviour {
            None => device.behaviour(),
            Some(name) => device
                .deviating_behaviour(name)
                .ok_or_else(|| format!("mutant {}: no behaviour {name}", mutant.name))?,
        };
        Node::new(eds, node, device.settings(), rules, behaviour)
            .map_err(|(mux, error)| format!("mutant {}: {mux}: {error}", mutant.name))
    };
    let eds = &device.description.eds;
    let specification = || Box::new(Specification) as Box<dyn Rules>;
    match &mutant.change {
        Change::Rule(name) => {
            let rules = rules::named(name)
                .ok_or_else(|| format!("mutant {}: no rule {name}", mutant.name))?;
            Ok(Box::new(node_with(eds, rules, None)?))
        }
        Change::Behaviour(name) => Ok(Box::new(node_with(eds, specification(), Some(name))?)),
        Change::Dictionary(patch) => {
            let mut eds = eds.clone();
            patch.apply(&mut eds).map_err(|why| format!("mutant {}: {why}", mutant.name))?;
            Ok(Box::new(node_with(&eds, specification(), None)?))
        }
        Change::Eds(_) => Ok(Box::new(node_with(eds, specification(), None)?)),
        Change::Frame(change) => {
            let bind = |text: &str| {
                let pattern: Pattern = text
                    .parse()
                    .map_err(|error| format!("mutant {}: `{text}`: {error}", mutant.name))?;
                Ok::<_, String>(pattern.bind(node, &|_| None))
            };
            let node = node_with(eds, specification(), None)?;
            Ok(Box::new(FrameMutant::new(node, change, bind)?))
        }
    }
}
