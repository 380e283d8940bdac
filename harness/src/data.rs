//! The data of this program from a folder. `HARNESS_DATA` names a checkout whose suites, catalogue
//! and devices are read instead of those in the program. So a changed case, requirement or mutant
//! can be tried without a build. A file that the program does not have must be a suite; any other
//! new file needs a build.

use std::collections::BTreeMap;
use std::env;
use std::path::{Path, PathBuf};

use canopen::catalogue::Catalogue;
use canopen::source::{self, Source};
use reference_devices::devices;
use reports::Origin;
use runner::suite::fingerprint;

use crate::exit::{Exit, Refused};
use crate::files::texts_in;

const VARIABLE: &str = "HARNESS_DATA";

/// The folder that the environment names.
pub(crate) fn folder() -> Option<PathBuf> {
    let named = PathBuf::from(env::var_os(VARIABLE).filter(|named| !named.is_empty())?);
    // Files are named in complaints as people write them.
    Some(if named == Path::new(".") { PathBuf::new() } else { named })
}

/// The descriptions of the reference devices, as reports name them.
pub(crate) fn devices() -> Origin {
    let mut sources: BTreeMap<&str, &Source> = BTreeMap::new();
    for device in devices::all() {
        let files = &device.files;
        let others = files.variants.iter().chain(&files.parts).map(|(_, source)| source);
        let own = [&files.device].into_iter().chain(&files.mutants).chain(&files.freedoms);
        sources.extend(own.chain(others).map(|source| (&*source.name, &**source)));
    }
    let sha256 = fingerprint(sources.into_values());
    let from = folder().map(|folder| folder.join("reference-devices").display().to_string());
    Origin { from: from.unwrap_or_else(|| BUILT_IN.to_owned()), sha256 }
}

/// Where files are from that no folder has.
pub(crate) const BUILT_IN: &str = "built in";

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
