//! Devices as data on disk: a folder with `device.yaml`, and perhaps `variants/`, `parts/`,
//! `mutants.yaml` and `freedoms.yaml`.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf, is_separator};
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use reference_devices::devices::{DeviceFiles, ReferenceDevice};

use crate::files::{read_text, words};
use crate::nearest::did_you_mean;
use crate::source::{Complaint, Source};

/// Whether a word is a path and not the name of a device in this program.
pub(super) fn is_path(text: &str) -> bool {
    text.contains(is_separator) || text.starts_with('.') || Path::new(text).exists()
}

/// The device in that folder, or that variant of it: `my-device`, `my-device/device.yaml`,
/// `my-device/variants/small.yaml`.
///
/// # Errors
/// Everything that is wrong with its files.
pub(super) fn device(
    path: &Path,
    catalogue: &Catalogue,
) -> Result<ReferenceDevice, Vec<Complaint>> {
    let (folder, variant) = parts(path);
    let mut family = family(&folder, catalogue)?;
    let Some(variant) = variant else { return Ok(family.swap_remove(0)) };
    let wanted = |device: &ReferenceDevice| device.source.name == shown(path);
    match family.iter().position(wanted) {
        Some(place) => Ok(family.swap_remove(place)),
        None => {
            let files = &family[0].files.variants;
            let meant = did_you_mean(&variant, files.iter().map(|(name, _)| name.as_str()));
            Err(vec![missing(path, &format!("there is no variant `{variant}`{meant}"))])
        }
    }
}

/// The paths of a device and its variants; of a variant its own alone.
pub(super) fn members(path: &Path, catalogue: &Catalogue) -> Result<Vec<String>, Vec<Complaint>> {
    match parts(path) {
        (_, Some(_)) => Ok(vec![shown(path)]),
        (folder, None) => {
            let family = family(&folder, catalogue)?;
            let variants = family.iter().skip(1).map(|variant| variant.source.name.clone());
            Ok(std::iter::once(shown(path)).chain(variants).collect())
        }
    }
}

/// Whether a path names a device or a variant of one, and not a suite.
pub(super) fn holds_device(path: &Path) -> bool {
    let (folder, variant) = parts(path);
    let named = path.is_dir() || variant.is_some() || folder != path;
    named && (folder.join(DEVICE).exists() || path.is_dir())
}

/// The device and its variants, in this order, or the models of a family.
fn family(folder: &Path, catalogue: &Catalogue) -> Result<Vec<ReferenceDevice>, Vec<Complaint>> {
    let one = |complaint| vec![complaint];
    let device = folder.join(DEVICE);
    let device = read(&device).map_err(one)?;
    let device = device.ok_or_else(|| {
        one(missing(&folder.join(DEVICE), "a device is a folder with a file `device.yaml`"))
    })?;
    let files = DeviceFiles {
        device,
        variants: listed(&folder.join(VARIANTS)).map_err(one)?,
        parts: listed(&folder.join("parts")).map_err(one)?,
        mutants: read(&folder.join("mutants.yaml")).map_err(one)?,
        freedoms: read(&folder.join("freedoms.yaml")).map_err(one)?,
    };
    files.family(catalogue)
}

/// The YAML files of a folder, by their names without ending, in alphabetical order.
fn listed(folder: &Path) -> Result<Vec<(String, Arc<Source>)>, Complaint> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(missing(folder, &words(&error))),
    };
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(|error| missing(folder, &words(&error)))?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "yaml"));
    paths.sort();
    let mut files = Vec::new();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        files.extend(read(&path)?.map(|source| (name, source)));
    }
    Ok(files)
}

/// The folder of the device, and the variant that a path names.
fn parts(path: &Path) -> (PathBuf, Option<String>) {
    let parent = |path: &Path| match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        parent => parent.unwrap_or(path).to_owned(),
    };
    let folder = parent(path);
    let is_yaml = path.extension().is_some_and(|extension| extension == "yaml");
    if is_yaml && folder.file_name().is_some_and(|name| name == VARIANTS) {
        let variant = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        return (parent(&folder), Some(variant));
    }
    match path.file_name() {
        Some(name) if name == DEVICE => (folder, None),
        _ => (path.to_owned(), None),
    }
}

/// A text file; `None` when there is none.
fn read(path: &Path) -> Result<Option<Arc<Source>>, Complaint> {
    match read_text(path) {
        Ok(text) => Ok(Some(Arc::new(Source::new(shown(path), text)))),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(missing(path, &words(&error))),
    }
}

fn missing(path: &Path, message: &str) -> Complaint {
    let source = Arc::new(Source::new(shown(path), ""));
    Complaint { source, place: None, message: message.to_owned() }
}

fn shown(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

const DEVICE: &str = "device.yaml";
const VARIANTS: &str = "variants";
