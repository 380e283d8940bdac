//! The data of this program from a folder. `HARNESS_DATA` names a checkout whose suites, catalogue
//! and devices are read instead of those in the program. So a changed case, requirement or mutant
//! can be tried without a build. A file that the program does not have must be a suite; any other
//! new file needs a build.

use std::collections::BTreeMap;
use std::env;
use std::path::{Path, PathBuf};

use canopen::catalogue::Catalogue;
use canopen::source;
use reference_devices::devices;

use crate::exit::{Exit, Refused};
use crate::files::texts_in;

const VARIABLE: &str = "HARNESS_DATA";

/// The folder that the environment names.
pub(crate) fn folder() -> Option<PathBuf> {
    let named = PathBuf::from(env::var_os(VARIABLE).filter(|named| !named.is_empty())?);
    // Files are named in complaints as people write them.
    Some(if named == Path::new(".") { PathBuf::new() } else { named })
}

/// Reads catalogue and devices, if the environment names a folder.
///
/// # Errors
/// When it has none, and everything that is wrong with them.
pub(crate) fn read() -> Result<(), Refused> {
    let Some(folder) = folder() else { return Ok(()) };
    let mut texts = BTreeMap::new();
    for part in ["canopen/catalogue", "reference-devices", "suites"] {
        let part = folder.join(part);
        if !part.is_dir() {
            let message = format!(
                "error: {VARIABLE} names a checkout of the harness, and there is no folder {}",
                part.display()
            );
            return Err(Refused { exit: Exit::File, message });
        }
        texts.extend(texts_in(&part, &folder)?);
    }
    source::replace_built_in(texts);
    Catalogue::of_the_program()?;
    devices::of_the_program()?;
    Ok(())
}
