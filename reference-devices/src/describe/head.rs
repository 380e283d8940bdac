//! Conditions for the head of a device file or a variant, independent of its objects.

use std::sync::Arc;

use canopen::catalogue::{Catalogue, Profile};
use canopen::nearest::did_you_mean;
use canopen::source::{At, Complaint, Source};

use super::Known;
use super::file::DeviceFile;
use super::variant::VariantFile;

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
    if !(1..=127).contains(&default_node.value) {
        complain(default_node.place, "a node id is 1 to 127".to_owned());
    }
    complaints.extend(behaviour_of(source, behaviour, known));
    complaints.extend(bit_rates(source, &file.bit_rates));
    complaints.extend(texts(source, &file.texts()));
    complaints.extend(options(source, &file.without, &file.profiles, known.catalogue));
    let unknown = file.not_judged.iter().filter(|(name, _)| !canopen::bench::is_known(name));
    complaints.extend(unknown.map(|(name, by)| {
        let message = format!("no bench has a `{name}`");
        Complaint::at(source, by.place, message)
    }));
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
    if let Some(behaviour) = &file.behaviour {
        complaints.extend(behaviour_of(source, behaviour, known));
    }
    complaints.extend(bit_rates(source, file.bit_rates.as_deref().unwrap_or_default()));
    if complaints.is_empty() { Ok(()) } else { Err(complaints) }
}

/// The application of a device must be a module of the program.
fn behaviour_of(
    source: &Arc<Source>,
    behaviour: &At<String>,
    known: Known<'_>,
) -> Option<Complaint> {
    if known.behaviours.contains(&behaviour.value.as_str()) {
        return None;
    }
    let meant = match did_you_mean(&behaviour.value, known.behaviours.iter().copied()) {
        meant if meant.is_empty() => format!(
            ": there is {}. One of your own is a program, `exec:`; leave `behaviour: inert` for \
             its data sheet",
            known.behaviours.join(", ")
        ),
        meant => meant,
    };
    let message = format!("no behaviour `{}`{meant}", behaviour.value);
    Some(Complaint::at(source, behaviour.place, message))
}

/// Bit rates are those of CAN.
fn bit_rates(source: &Arc<Source>, rates: &[At<u32>]) -> Vec<Complaint> {
    let wrong = rates.iter().filter(|rate| !(10..=1000).contains(&rate.value));
    wrong.map(|rate| Complaint::at(source, rate.place, "a bit rate is 10 to 1000 kbit/s")).collect()
}

/// Texts of the data sheet stand on one line each.
fn texts(source: &Arc<Source>, texts: &[&At<String>]) -> Vec<Complaint> {
    let wrong = texts.iter().filter(|text| text.value.contains(char::is_control));
    let complain = |text: &&At<String>| {
        Complaint::at(source, text.place, "this text does not fit on a line of the data sheet")
    };
    wrong.map(complain).collect()
}

/// An option that the device goes without must be one of its profiles' options.
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
