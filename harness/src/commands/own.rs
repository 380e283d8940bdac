//! The user's own device, for commands that look at the devices of the program else.

use std::path::Path;

use canopen::catalogue::Catalogue;
use reference_devices::devices;

use crate::exit::Refused;
use crate::target::{self, Address};

/// A device that is described in a folder.
pub(super) struct OwnDevice {
    /// The folder, or the file of the variant.
    pub(super) path: String,
    /// What the description calls it.
    pub(super) name: String,
}

/// The device that `--target sim:FOLDER` names, and its variants. A device of the program is known
/// anyway.
///
/// # Errors
/// When it is no simulated device, or its files have mistakes.
pub(super) fn own_devices(
    target: Option<&str>,
    catalogue: &Catalogue,
) -> Result<Vec<OwnDevice>, Refused> {
    let Some(text) = target else { return Ok(Vec::new()) };
    let Address::Simulation { device, deviation: None } = text.parse()? else {
        return Err(Refused::usage(format!(
            "--target {text}: a simulated device belongs here, such as `sim:my-device`"
        )));
    };
    let described = |path: String| {
        let name = target::reference_device(&path, catalogue)?.description.device.clone();
        Ok(OwnDevice { path, name })
    };
    let family = target::with_variants(&device, catalogue)?.into_iter().map(described);
    let family = family.collect::<Result<Vec<_>, Refused>>()?;
    Ok(family.into_iter().filter(|own| !is_of_program(&own.path)).collect())
}

/// Whether the program has a device of this name.
pub(super) fn is_of_program(name: &str) -> bool {
    devices::names().any(|known| known == name)
}

/// The folder beside which a command runs that describes a device, as it is named mostly; else a
/// word for it.
pub(super) fn folder_of(device: &str) -> &str {
    if Path::new(device).join("device.yaml").is_file() { device } else { "FOLDER" }
}
