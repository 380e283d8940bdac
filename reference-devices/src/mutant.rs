//! Mutants: reference devices with one named deviation each. A case that fails on no mutant proves
//! nothing.
//!
//! Data state what a mutant is; only reading them and finding those of a device belong here. Which
//! case notices one is found by `harness qualify`.

mod data;

use std::sync::{Arc, LazyLock};

use canopen::nearest::did_you_mean;
use canopen::source::{Complaint, Source, built_in, read_tree};

use crate::change::{Changes, Form, Origin, in_full};
use crate::devices::{ReferenceDevice, WITH_EVERYTHING};
use crate::freedom;

pub use data::{Mistake, Mutant, MutantFile};

/// Mutants that any device can be: deviations from CiA 301 in the stack they share.
const COMMON: &[(&str, &str)] = &[
    ("reference-devices/mutants/cia301.yaml", include_str!("../mutants/cia301.yaml")),
    ("reference-devices/mutants/cia305.yaml", include_str!("../mutants/cia305.yaml")),
    ("reference-devices/mutants/cia401.yaml", include_str!("../mutants/cia401.yaml")),
    ("reference-devices/mutants/cia306.yaml", include_str!("../mutants/cia306.yaml")),
];

static COMMON_SOURCES: LazyLock<Vec<Arc<Source>>> =
    LazyLock::new(|| COMMON.iter().map(|(name, text)| built_in(name, text)).collect());

/// What these files hold: they are long, and each device has it.
static COMMON_MUTANTS: LazyLock<Vec<Result<Vec<Mutant>, Vec<Complaint>>>> =
    LazyLock::new(|| COMMON_SOURCES.iter().map(|source| read(source, WITH_EVERYTHING)).collect());

/// The files that hold the mutants of a device, those that any device can be first.
pub fn sources(device: &ReferenceDevice) -> Vec<Arc<Source>> {
    COMMON_SOURCES.iter().chain(&device.files.mutants).cloned().collect()
}

/// Reads a file of mutants of a family of devices.
///
/// # Errors
/// What is wrong with it; a name that stands there twice is, too, and a freedom that the stack does
/// not have.
pub fn read(source: &Arc<Source>, family: &str) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let form = Form {
        list: "mutants",
        keys: &["name", "why", "breaks", "on", "uses", "as", "canary", "change"],
        lists: &["breaks", "on", "uses"],
        change: Changes::One,
        family: Some(family),
    };
    let tree = in_full(source, &form)?;
    let file = read_tree::<MutantFile>(source, &tree).map_err(|wrong| vec![wrong])?;
    let (mut mutants, origin) = (file.mutants, Origin::file_of(source, tree));
    for (number, mutant) in mutants.iter_mut().enumerate() {
        mutant.origin = origin.below(&["mutants", &number.to_string()]);
    }
    let twice = mutants.iter().enumerate().filter_map(|(number, mutant)| {
        let is_first = mutants[..number].iter().all(|other| other.name != mutant.name);
        let message = format!("a mutant {} stands above already", mutant.name);
        (!is_first).then(|| mutant.complain(&["name"], message))
    });
    let mut complaints: Vec<_> = twice.collect();
    complaints.extend(find_freedoms(&mut mutants));
    if complaints.is_empty() { Ok(mutants) } else { Err(complaints) }
}

/// Gives the mutants the freedoms that they use.
fn find_freedoms(mutants: &mut [Mutant]) -> Vec<Complaint> {
    if mutants.iter().all(|mutant| mutant.uses.is_empty()) {
        return Vec::new();
    }
    let known = match freedom::common() {
        Ok(known) => known,
        Err(complaints) => return complaints,
    };
    let mut complaints = Vec::new();
    for mutant in mutants {
        for (place, name) in mutant.uses.iter().enumerate() {
            if let Some(freedom) = known.iter().find(|freedom| freedom.name == *name) {
                mutant.freedoms.push(freedom.clone());
                continue;
            }
            let meant = did_you_mean(name, known.iter().map(|freedom| freedom.name.as_str()));
            let message = format!("the stack has no freedom `{name}`{meant}");
            complaints.push(mutant.complain(&["uses", &place.to_string()], message));
        }
    }
    complaints
}

/// The mutants that any device can be.
///
/// # Errors
/// What is wrong with their files.
pub fn common() -> Result<Vec<Mutant>, Vec<Complaint>> {
    Ok(COMMON_MUTANTS.iter().cloned().collect::<Result<Vec<_>, _>>()?.concat())
}

/// The mutants that live on a device or variant.
///
/// # Errors
/// Everything that is wrong with a file of mutants: mistakes in the text, a name that is taken, a
/// variant that the device does not have.
pub fn of(device: &ReferenceDevice) -> Result<Vec<Mutant>, Vec<Complaint>> {
    let family = device.family();
    let (mut mutants, mut complaints) = (Vec::<Mutant>::new(), Vec::new());
    let own = device.files.mutants.iter().map(|source| read(source, family));
    for (place, read) in COMMON_MUTANTS.iter().cloned().chain(own).enumerate() {
        let mut read = match read {
            Ok(read) => read,
            Err(mut wrong) => {
                complaints.append(&mut wrong);
                continue;
            }
        };
        for mutant in &mut read {
            mutant.shared = place < COMMON.len();
            if let Some(other) = mutants.iter().find(|other| other.name == mutant.name) {
                let file = other.origin.file();
                let message = format!("a mutant {} stands in {file} already", mutant.name);
                complaints.push(mutant.complain(&["name"], message));
            }
            let stranger = |on: &str| device.relatives().all(|name| name != on);
            for (number, on) in mutant.on.names().iter().enumerate().filter(|(_, on)| stranger(on))
            {
                let names: Vec<String> = device.relatives().collect();
                let meant = did_you_mean(on, names.iter().map(String::as_str));
                let message = format!("`{on}` is not a variant of {family}{meant}");
                complaints.push(mutant.complain(&["on", &number.to_string()], message));
            }
        }
        mutants.append(&mut read);
    }
    let own = &device.description.device;
    let lives_here = |mutant: &Mutant| match mutant.on.names() {
        _ if mutant.shared => true,
        [] => device.first == *own,
        names => names.contains(own),
    };
    mutants.retain(lives_here);
    if complaints.is_empty() { Ok(mutants) } else { Err(complaints) }
}
