//! The reference devices and their deviations: those in this program by name, others by their
//! folder.

use std::path::Path;
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::{freedom, mutant};

use super::folder;
use crate::exit::Refused;
use crate::nearest::did_you_mean;

/// The device of that name in this program, or else the one described at that path with these
/// profiles.
///
/// # Errors
/// When there is none, or its files have mistakes.
pub(crate) fn reference_device(
    name: &str,
    catalogue: &Catalogue,
) -> Result<Arc<ReferenceDevice>, Refused> {
    match devices::device(name) {
        Some(device) => Ok(Arc::new(device)),
        None if folder::is_path(name) => Ok(Arc::new(folder::device(Path::new(name), catalogue)?)),
        None => Err(unknown(name)),
    }
}

/// The same on a bus of a bit rate in bit/s.
///
/// # Errors
/// The same.
pub(crate) fn reference_device_at(
    bit_rate: u32,
    name: &str,
    catalogue: &Catalogue,
) -> Result<Arc<ReferenceDevice>, Refused> {
    let mut device = reference_device(name, catalogue)?;
    Arc::make_mut(&mut device).description.settings.bit_rate = bit_rate;
    Ok(device)
}

/// The arguments of `reference_device` for a device and each of its variants; for a variant, only
/// its own name or path.
///
/// # Errors
/// When the device is at a path, and its files have mistakes.
pub(crate) fn with_variants(name: &str, catalogue: &Catalogue) -> Result<Vec<String>, Refused> {
    let family: Vec<String> = devices::with_variants(name).map(str::to_owned).collect();
    match family.is_empty() {
        false => Ok(family),
        true if devices::device(name).is_none() && folder::is_path(name) => {
            Ok(folder::members(Path::new(name), catalogue)?)
        }
        true => Ok(vec![name.to_owned()]),
    }
}

/// Whether a path names a device, and not a suite.
pub(crate) fn holds_device(path: &Path) -> bool {
    folder::holds_device(path)
}

/// A deviation, as a user names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Named {
    /// A mutant.
    Mutant(String),
    /// Freedoms, separated by commas.
    Freedom(String),
    /// A personality.
    Personality(String),
}

impl Named {
    /// The deviation `name` of a kind such as `mutant`; `None` when there is no such kind.
    pub(crate) fn new(kind: &str, name: &str) -> Option<Self> {
        let name = name.to_owned();
        match kind {
            "mutant" => Some(Self::Mutant(name)),
            "freedom" => Some(Self::Freedom(name)),
            "personality" => Some(Self::Personality(name)),
            _ => None,
        }
    }

    /// The deviation as changes of the device.
    ///
    /// # Errors
    /// When the device has no deviation of that name.
    pub(crate) fn find(&self, device: &ReferenceDevice) -> Result<Deviation, Refused> {
        match self {
            Self::Mutant(name) => {
                let mutants = mutant::of(device)?;
                let names = || mutants.iter().map(|mutant| mutant.name.as_str());
                let mutant = mutants.iter().find(|mutant| mutant.name == *name);
                let missing = || none(device, "mutant", "mutants", name, names());
                Ok(mutant.ok_or_else(missing)?.deviation())
            }
            Self::Freedom(list) => {
                let freedoms = freedom::of(device)?;
                let names = || freedoms.iter().map(|freedom| freedom.name.as_str());
                let mut chosen = Vec::new();
                for name in list.split(',') {
                    let freedom = freedoms.iter().find(|freedom| freedom.name == name);
                    let missing = || none(device, "freedom", "freedoms", name, names());
                    chosen.push(freedom.ok_or_else(missing)?);
                }
                Ok(freedom::mixture(chosen))
            }
            Self::Personality(name) => {
                let all = freedom::personalities(device)?;
                let names = || all.iter().map(|personality| personality.name.as_str());
                let personality = all.iter().find(|personality| personality.name == *name);
                let missing = || none(device, "personality", "personalities", name, names());
                Ok(personality.ok_or_else(missing)?.deviation())
            }
        }
    }
}

/// The sentence for a deviation that a device does not have. Another device may have it.
fn none<'n>(
    device: &ReferenceDevice,
    kind: &str,
    list: &str,
    name: &str,
    mut names: impl Iterator<Item = &'n str> + Clone,
) -> Refused {
    let meant = did_you_mean(name, names.clone());
    let all = devices::names().filter_map(devices::device);
    let has = |other: &ReferenceDevice| match list {
        "mutants" => mutant::of(other).is_ok_and(|all| all.iter().any(|it| it.name == name)),
        "freedoms" => freedom::of(other).is_ok_and(|all| all.iter().any(|it| it.name == name)),
        _ => freedom::personalities(other).is_ok_and(|all| all.iter().any(|it| it.name == name)),
    };
    let others: Vec<String> =
        all.filter(has).map(|other| other.description.device.clone()).collect();
    let of_others = match &others[..] {
        [] => String::new(),
        [one] => format!("; {one} has it"),
        many => format!("; these have it: {}", many.join(", ")),
    };
    let device = &device.description.device;
    // A device in a folder is named by its path.
    let target = match devices::device(device) {
        Some(_) => format!(" --target sim:{device}"),
        None => String::new(),
    };
    Refused::usage(match names.next() {
        None => format!("{device} has no {list}, so no `{name}`{of_others}"),
        Some(_) => {
            format!("no {kind} `{name}`; `harness list {list}{target}` names all{of_others}{meant}")
        }
    })
}

/// The sentence for a name that no reference device has.
pub(super) fn unknown(name: &str) -> Refused {
    let names: Vec<&str> = devices::names().collect();
    let meant = did_you_mean(name, devices::names());
    let names = names.join(", ");
    Refused::usage(format!(
        "no reference device `{name}`: there are {names}, and folders with a `device.yaml`{meant}"
    ))
}
