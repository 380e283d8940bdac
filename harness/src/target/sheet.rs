//! The data sheet of a target: the user's, one of ours, or one generated from the answers of the
//! device.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use canopen::eds::{DeviceInfo, Eds, Severity};
use canopen::{Bus, Mux};
use reference_devices::change::Deviation;
use reference_devices::describe::Description;
use reference_devices::devices::{self, ReferenceDevice};
use runner::dut::{Dut, Sheet};

use super::compose::compose;
use super::options;
use super::reference::reference_device;
use super::scan::Found;
use super::{DEFAULT_BIT_RATE, Selection};
use crate::exit::{Exit, Refused};
use crate::files::{LARGEST, read, shown, words};
use crate::plugged::Plugged;

/// The data sheets of the reference devices of the same vendor and product, by the
/// names by which suites ask for them.
pub fn models(eds: &Eds) -> BTreeMap<&'static str, &'static Eds> {
    let device_type = eds.entry(Mux::new(0x1000, 0)).and_then(|entry| entry.default.as_ref());
    let device_type = device_type.and_then(|term| term.resolve(1).as_int()?.try_into().ok());
    let DeviceInfo { vendor_number, product_number, .. } = eds.device;
    let families = devices::families_of(vendor_number, product_number, device_type);
    let models = families.into_iter().flatten().map(|device| &device.description);
    let own = |model: &&Description| model.eds.device.product_number == product_number;
    models.filter(own).map(|model| (model.device.as_str(), &*model.eds)).collect()
}

/// Reads a data sheet, with the modules that are plugged; reports its errors, and continues with
/// the rest.
///
/// # Errors
/// When it cannot be read at all, or does not have these modules.
pub(crate) fn read_eds(path: &Path, modules: &Plugged) -> Result<(Sheet, Eds), Refused> {
    let bytes = read(path, LARGEST).map_err(|error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {}", path.display(), words(&error)),
    })?;
    let name = shown(path);
    let connected = modules.of_sheet(&name, &bytes)?;
    let (sheet, eds) = Sheet::read_with_modules(name, &bytes, connected);
    if sheet.diagnostics.iter().any(|found| found.severity == Severity::Error) {
        let (path, modules) = (path.display(), modules.option());
        complain!("warning: {path} has errors; `harness eds check {path}{modules}` shows them");
    }
    if eds.objects.is_empty() {
        let message = format!("error: {}: this data sheet has no objects", path.display());
        return Err(Refused { exit: Exit::File, message });
    }
    Ok((sheet, eds))
}

/// The device that the data sheet of the user describes, without a bus; node 1 unless given.
///
/// # Errors
/// As [`read_eds`].
pub(crate) fn dut_of_file(selection: &Selection, path: &Path) -> Result<Dut, Refused> {
    let (sheet, eds) = read_eds(path, &selection.modules)?;
    let mut dut = Dut {
        sheet: Arc::new(sheet),
        bit_rate: selection.bitrate.or(Some(DEFAULT_BIT_RATE)),
        without: selection.without.clone(),
        ..Dut::new(name_of(selection, path), selection.node.unwrap_or(1), eds)
    };
    options::protect(selection, &mut dut);
    Ok(dut)
}

/// The name in reports of the device with the data sheet at `path`.
fn name_of(selection: &Selection, path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    selection.device.clone().or(stem).unwrap_or_else(|| "device".to_owned())
}

/// The data sheet of a reference device, by its place in the project.
pub(super) fn own_sheet(
    device: &ReferenceDevice,
    deviation: Option<&Deviation>,
) -> Result<(Sheet, Eds), Refused> {
    let text = match deviation {
        Some(deviation) => deviation.data_sheet(device)?,
        None => device.eds_text(),
    };
    let (mut sheet, eds) = Sheet::read(device.beside("eds"), text.as_bytes());
    sheet.trusted = !deviation.is_some_and(Deviation::falsifies_data_sheet);
    Ok((sheet, eds))
}

/// The data sheet of a device on a bus: the user's, or one of ours that fits, or what the device
/// answers.
pub(super) fn of_found(
    selection: &Selection,
    found: &Found,
    bus: &mut dyn Bus,
    catalogue: &Catalogue,
) -> Result<(String, (Sheet, Eds)), Refused> {
    if let Some(path) = &selection.eds {
        return Ok((name_of(selection, path), read_eds(path, &selection.modules)?));
    }
    let name = match &selection.device {
        Some(name) => Some(name.clone()),
        None => found.device.clone(),
    };
    match name {
        Some(name) => {
            let device = reference_device(&name, catalogue).map_err(|refused| Refused {
                message: format!("{}; for a device of your own, --eds FILE", refused.message),
                ..refused
            })?;
            let sheet = own_sheet(&device, None)?;
            Ok((name, sheet))
        }
        None => {
            let what = found.follows().map(|follows| format!(", {follows}")).unwrap_or_default();
            let node = found.node;
            complain!(
                "note: this program has no data sheet of node {node}{what}. One is generated from \
                 the answers of the device; --eds FILE gives a better one."
            );
            let name = found.name.clone().filter(|name| !name.trim().is_empty());
            let bit_rate = selection.bitrate.unwrap_or(DEFAULT_BIT_RATE);
            let composed = compose(bus, found, bit_rate, catalogue)?;
            Ok((name.unwrap_or_else(|| format!("node-{node}")), composed))
        }
    }
}
