//! Targets: from the user's name for one to the device and its bus.
//!
//! What is known of the device before the first case belongs here: its data sheet, node id and
//! bench, with what the user said about them. What a case finds out belongs to the [`runner`].

mod address;
mod can;
mod compose;
mod connection;
mod folder;
mod lengths;
mod options;
mod reference;
mod scan;
mod selection;
mod several;
mod sheet;
mod sim;

use canopen::catalogue::Catalogue;
use reference_devices::devices;
use runner::stop::Stop;

use crate::exit::Refused;

pub(crate) use address::Address;
pub(crate) use can::{nobody, only};
pub use compose::compose;
pub(crate) use connection::open_interface;
pub use connection::{Connection, Target};
pub(crate) use options::protect;
pub(crate) use reference::{
    Named, holds_device, reference_device, reference_device_at, with_variants,
};
pub(crate) use scan::rounds;
pub use scan::{Found, ROUNDS, scan};
pub use selection::{DEFAULT_BIT_RATE, Selection};
pub(crate) use several::Other;
pub use sheet::models;
pub(crate) use sheet::{dut_of_file, read_eds};
pub(crate) use sim::quoted;

/// The devices a selection means, beside the suites that are loaded for them. A mistake in what
/// names a simulated device is told before suites are read, which takes longest; a bus is asked
/// only when they are sound.
///
/// # Errors
/// As [`resolve`], and what `load` refuses.
pub(crate) fn resolve_beside<T>(
    selection: &Selection,
    stop: &Stop,
    load: impl FnOnce() -> Result<T, Refused>,
) -> Result<(T, Vec<Target>), Refused> {
    let catalogue = selection.folders.catalogue.load()?;
    let address = selection.target.as_deref().map(str::parse).transpose()?;
    let simulated = match address {
        Some(Address::Simulation { .. }) => Some(resolve(selection, &catalogue, stop)?),
        Some(Address::Interface(_)) | None => None,
    };
    let loaded = load()?;
    match simulated {
        Some(targets) => Ok((loaded, targets)),
        None => Ok((loaded, resolve(selection, &catalogue, stop)?)),
    }
}

/// The devices a selection means; those in folders are described with these profiles.
///
/// # Errors
/// When the target is unknown, no node answers, or no data sheet fits.
pub fn resolve(
    selection: &Selection,
    catalogue: &Catalogue,
    stop: &Stop,
) -> Result<Vec<Target>, Refused> {
    options::known(&selection.without, catalogue)?;
    selection.modules.beside(selection.eds.as_deref())?;
    let mut targets = match selection.target.as_deref() {
        None if selection.file.is_some() => Err(Refused::usage(
            "the device file has no `target`, and there is no --target: name the interface that \
             the device is on, such as `target: can0`",
        )),
        None if selection.eds.is_some() => Err(Refused::usage(
            "--eds is the data sheet of one device: --target names the interface it is on, such \
             as `--target can0`; `harness list --eds FILE` shows what would run",
        )),
        None => devices::names()
            .filter(|name| selection.device.as_ref().is_none_or(|device| device == name))
            .map(|name| sim::target(selection, name, None, catalogue))
            .collect::<Result<Vec<_>, _>>()
            .and_then(|targets| match targets.is_empty() {
                true => Err(reference::unknown(selection.device.as_deref().unwrap_or_default())),
                false => Ok(targets),
            }),
        Some(text) => match text.parse()? {
            Address::Simulation { device, deviation } => {
                Ok(vec![sim::target(selection, &device, deviation.as_ref(), catalogue)?])
            }
            Address::Interface(interface) => {
                Ok(vec![can::target(selection, &interface, catalogue, stop)?])
            }
        },
    }?;
    for target in &mut targets {
        options::free_to_write(selection, &mut target.dut)?;
        protect(selection, &mut target.dut);
        if let Some(typed) = &selection.typed {
            target.options.clone_from(typed);
        }
    }
    Ok(targets)
}
