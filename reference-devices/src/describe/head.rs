//! What must hold of the head of a device file, and of its `node`, whatever the objects are.

use std::sync::Arc;

use canopen::catalogue::{Catalogue, Profile};
use canopen::eds::Eds;
use canopen::nearest::did_you_mean;
use canopen::source::{At, Complaint, Source};

use super::Known;
use super::file::{DeviceFile, VariantFile};
use super::node::NodeFacts;

/// Checks the head of a device.
///
/// # Errors
/// Everything that is wrong with it.
pub(super) fn check(
    source: &Arc<Source>,
    file: &DeviceFile,
    known: Known<'_>,
) -> Result<(), Vec<Complaint>> {
    let mut complaints = Vec::new();
    let mut complain =
        |place, message: String| complaints.push(Complaint::at(source, place, message));
    let DeviceFile { device, date, behaviour, default_node, .. } = file;
    if !is_name(&device.value) {
        let message =
            format!("`{}` is not a name: write small letters, digits and `-`", device.value);
        complain(device.place, message);
    }
    if !is_date(&date.value) {
        let message = format!("`{}` is not a date: write month-day-year, `01-31-2026`", date.value);
        complain(date.place, message);
    }
    for profile in &file.profiles {
        if known.catalogue.profile(&profile.value).is_none() {
            let names = known.catalogue.profiles().iter().map(|profile| profile.name.as_str());
            let meant = did_you_mean(&profile.value, names);
            complain(
                profile.place,
                format!("no profile `{}` in the catalogue{meant}", profile.value),
            );
        }
    }
    if !known.behaviours.contains(&behaviour.value.as_str()) {
        let meant = match did_you_mean(&behaviour.value, known.behaviours.iter().copied()) {
            meant if meant.is_empty() => format!(": there is {}", known.behaviours.join(", ")),
            meant => meant,
        };
        complain(behaviour.place, format!("no behaviour `{}`{meant}", behaviour.value));
    }
    for rate in file.bit_rates.iter().filter(|rate| !(10..=1000).contains(&rate.value)) {
        complain(rate.place, "a bit rate is 10 to 1000 kbit/s".to_owned());
    }
    if !(1..=127).contains(&default_node.value) {
        complain(default_node.place, "a node id is 1 to 127".to_owned());
    }
    complaints.extend(texts(source, &file.texts()));
    complaints.extend(options(source, &file.without, &file.profiles, known.catalogue));
    if complaints.is_empty() { Ok(()) } else { Err(complaints) }
}

/// Checks the head of a variant of this device.
///
/// # Errors
/// Everything that is wrong with it.
pub(super) fn check_variant(
    source: &Arc<Source>,
    file: &VariantFile,
    device: &DeviceFile,
    known: Known<'_>,
) -> Result<(), Vec<Complaint>> {
    let mut complaints = texts(source, &file.texts());
    complaints.extend(options(source, &file.without, &device.profiles, known.catalogue));
    if complaints.is_empty() { Ok(()) } else { Err(complaints) }
}

/// The objects that `node` names and the device does not have.
pub(super) fn unknown_objects(source: &Arc<Source>, node: &NodeFacts, eds: &Eds) -> Vec<Complaint> {
    let unknown = node.objects().filter(|at| eds.entry(at.value).is_none());
    let complain = |at: &At<_>| {
        Complaint::at(source, at.place, format!("the device has no object {}", at.value))
    };
    unknown.map(complain).collect()
}

/// Texts of the data sheet stand on one line each.
fn texts(source: &Arc<Source>, texts: &[&At<String>]) -> Vec<Complaint> {
    let wrong = texts.iter().filter(|text| text.value.contains(char::is_control));
    let complain = |text: &&At<String>| {
        Complaint::at(source, text.place, "this text does not fit on a line of the data sheet")
    };
    wrong.map(complain).collect()
}

/// What a device goes without is an option of one of its profiles.
fn options(
    source: &Arc<Source>,
    without: &[At<String>],
    profiles: &[At<String>],
    catalogue: &Catalogue,
) -> Vec<Complaint> {
    let followed = || profiles.iter().filter_map(|profile| catalogue.profile(&profile.value));
    let known = || followed().flat_map(Profile::chain).flat_map(|profile| profile.options.keys());
    let unknown = without.iter().filter(|option| !known().any(|known| *known == option.value));
    let complain = |option: &At<String>| {
        let meant = did_you_mean(&option.value, known().map(String::as_str));
        let message = format!("no option `{}` of the profiles of this device{meant}", option.value);
        Complaint::at(source, option.place, message)
    };
    unknown.map(complain).collect()
}

fn is_name(text: &str) -> bool {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    !text.is_empty() && text.chars().all(fits)
}

fn is_date(text: &str) -> bool {
    let numbers: Vec<Option<u16>> = text
        .split('-')
        .zip([2, 2, 4])
        .map(|(part, length)| part.parse().ok().filter(|_| part.len() == length))
        .collect();
    let whole = text.split('-').count() == 3;
    whole && matches!(numbers[..], [Some(1..=12), Some(1..=31), Some(_)])
}
