//! The reference devices and their mutants: those in this program by name, others by their folder.

use std::path::Path;
use std::sync::Arc;

use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;

use super::folder;
use crate::exit::Refused;
use crate::nearest::did_you_mean;

/// The device of that name in this program, or else the one described at that path.
///
/// # Errors
/// When there is none, or its files have mistakes.
pub(crate) fn reference_device(name: &str) -> Result<Arc<ReferenceDevice>, Refused> {
    match devices::device(name) {
        Some(device) => Ok(Arc::new(device)),
        None if folder::is_path(name) => Ok(Arc::new(folder::device(Path::new(name))?)),
        None => Err(unknown(name)),
    }
}

/// What `reference_device` takes for a device and each of its variants; for a variant its own
/// name or path alone.
///
/// # Errors
/// When the device is at a path, and its files have mistakes.
pub(crate) fn with_variants(name: &str) -> Result<Vec<String>, Refused> {
    let family: Vec<String> = devices::with_variants(name).map(str::to_owned).collect();
    match family.is_empty() {
        false => Ok(family),
        true if devices::device(name).is_none() && folder::is_path(name) => {
            Ok(folder::members(Path::new(name))?)
        }
        true => Ok(vec![name.to_owned()]),
    }
}

/// Whether a path names a device, and not a suite.
pub(crate) fn holds_device(path: &Path) -> bool {
    folder::holds_device(path)
}

/// The mutant of that name.
///
/// # Errors
/// When the device has none.
pub(crate) fn mutant_of(device: &ReferenceDevice, name: &str) -> Result<mutant::Mutant, Refused> {
    let mut mutants = mutant::of(device)?;
    match mutants.iter().position(|mutant| mutant.name == name) {
        Some(place) => Ok(mutants.swap_remove(place)),
        None => {
            let meant = did_you_mean(name, mutants.iter().map(|mutant| mutant.name.as_str()));
            let message = format!("no mutant `{name}`; `harness list mutants` names all{meant}");
            Err(Refused::usage(message))
        }
    }
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
