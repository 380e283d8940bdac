//! The reference devices and their mutants, by name.

use std::sync::Arc;

use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;

use crate::exit::{Exit, Refused};

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
    let mutants = mutant::of(device).map_err(|message| Refused { exit: Exit::File, message })?;
    mutants.into_iter().find(|mutant| mutant.name == name).ok_or_else(|| {
        Refused::usage(format!("no mutant `{name}`: `harness qualify -v` names all of them"))
    })
}

/// The sentence for a name that no reference device has.
pub(super) fn unknown(name: &str) -> Refused {
    let names: Vec<&str> = devices::names().collect();
    Refused::usage(format!("no reference device `{name}`: there is {}", names.join(", ")))
}
