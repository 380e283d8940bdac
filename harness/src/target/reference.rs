//! The reference devices and their mutants, by name.

use std::sync::Arc;

use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;

use crate::exit::Refused;
use crate::nearest::did_you_mean;

/// The in-tree device of that name.
///
/// # Errors
/// When there is none.
pub fn reference_device(name: &str) -> Result<Arc<ReferenceDevice>, Refused> {
    devices::device(name).map(Arc::new).ok_or_else(|| unknown(name))
}

/// The mutant of that name.
///
/// # Errors
/// When the device has none.
pub fn mutant_of(device: &ReferenceDevice, name: &str) -> Result<mutant::Mutant, Refused> {
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
    Refused::usage(format!("no reference device `{name}`: there are {names}{meant}"))
}
