//! Freedoms: reference devices with one named deviation each that a document allows. A case that
//! fails on one of them is unjust.
//!
//! Data state what a freedom is; only reading, combining and naming them belong here.

mod data;

use std::sync::{Arc, LazyLock};

use canopen::nearest::did_you_mean;
use canopen::source::{Complaint, Source, Tree, built_in, read_tree};

use crate::change::{Changes, Deviation, Form, Origin, in_full};
use crate::devices::{ReferenceDevice, WITH_EVERYTHING};

pub use data::{Freedom, FreedomFile, Personality, PersonalityFile};

/// Freedoms of the stack, which any device can use, by document.
const COMMON: &[(&str, &str)] = &[
    ("reference-devices/freedoms/cia301.yaml", include_str!("../freedoms/cia301.yaml")),
    ("reference-devices/freedoms/cia305.yaml", include_str!("../freedoms/cia305.yaml")),
    ("reference-devices/freedoms/cia306.yaml", include_str!("../freedoms/cia306.yaml")),
    ("reference-devices/freedoms/cia401.yaml", include_str!("../freedoms/cia401.yaml")),
];
const PERSONALITIES: (&str, &str) = (
    "reference-devices/freedoms/personalities.yaml",
    include_str!("../freedoms/personalities.yaml"),
);

const FORM: Form<'static> = Form {
    list: "freedoms",
    keys: &["name", "why", "allowed-by", "on", "excludes", "change", "changes"],
    lists: &["allowed-by", "on", "excludes"],
    change: Changes::Several,
    family: None,
};

static COMMON_SOURCES: LazyLock<Vec<Arc<Source>>> =
    LazyLock::new(|| COMMON.iter().copied().map(source).collect());
static PERSONALITY_SOURCE: LazyLock<Arc<Source>> = LazyLock::new(|| source(PERSONALITIES));

/// What the files of the stack hold: they are long, and each device has it.
static COMMON_FREEDOMS: LazyLock<Vec<Result<Vec<Freedom>, Vec<Complaint>>>> =
    LazyLock::new(|| COMMON_SOURCES.iter().map(read).collect());

/// The files that hold the freedoms of a device: those that any device can use, then its own.
pub fn sources(device: &ReferenceDevice) -> Vec<Arc<Source>> {
    COMMON_SOURCES.iter().chain(&device.files.freedoms).cloned().collect()
}

/// The file of the personalities.
pub fn personality_source() -> Arc<Source> {
    Arc::clone(&PERSONALITY_SOURCE)
}

/// Reads a file of freedoms.
///
/// # Errors
/// What is wrong with its text.
pub fn read(source: &Arc<Source>) -> Result<Vec<Freedom>, Vec<Complaint>> {
    let tree = in_full(source, &FORM)?;
    let file = read_tree::<FreedomFile>(source, &tree).map_err(|wrong| vec![wrong])?;
    let (mut freedoms, origin) = (file.freedoms, Origin::file_of(source, tree));
    for (number, freedom) in freedoms.iter_mut().enumerate() {
        freedom.origin = origin.below(&["freedoms", &number.to_string()]);
    }
    Ok(freedoms)
}

/// The freedoms of a device or variant. A freedom for any device belongs to the device with every
/// service, on which suites for any device are proved.
///
/// # Errors
/// Everything that is wrong with a file of freedoms: mistakes in the text, a name that is taken, a
/// variant that the device does not have, no change.
pub fn of(device: &ReferenceDevice) -> Result<Vec<Freedom>, Vec<Complaint>> {
    let family = device.family();
    let (mut freedoms, mut complaints) = (Vec::<Freedom>::new(), Vec::new());
    let own = device.files.freedoms.iter().map(read);
    for (place, read) in COMMON_FREEDOMS.iter().cloned().chain(own).enumerate() {
        let read = match read {
            Ok(read) => read,
            Err(mut wrong) => {
                complaints.append(&mut wrong);
                continue;
            }
        };
        for mut freedom in read {
            freedom.shared = place < COMMON.len();
            if freedoms.iter().any(|other| other.name == freedom.name) {
                let message = format!("a freedom {} stands there already", freedom.name);
                complaints.push(freedom.complain(&["name"], message));
            }
            if freedom.changes.is_empty() {
                complaints.push(freedom.complain(&["changes"], "a freedom without a change"));
            }
            let relatives: Vec<String> = device.relatives().collect();
            let stranger = |name: &&String| !freedom.shared && !relatives.contains(name);
            for on in freedom.on.names().iter().filter(stranger) {
                let meant = did_you_mean(on, relatives.iter().map(String::as_str));
                let message = format!("`{on}` is not a variant of {family}{meant}");
                complaints.push(freedom.complain(&["on"], message));
            }
            freedoms.push(freedom);
        }
    }
    for freedom in &freedoms {
        let names = || freedoms.iter().map(|known| known.name.as_str());
        for (place, name) in freedom.excludes.iter().enumerate() {
            if names().all(|known| known != name) {
                let meant = did_you_mean(name, names());
                let message = format!("there is no freedom `{name}`{meant}");
                complaints.push(freedom.complain(&["excludes", &place.to_string()], message));
            }
        }
    }
    freedoms.retain(|freedom| {
        let own = &device.description.device;
        let home = if freedom.shared { WITH_EVERYTHING } else { &device.first };
        match freedom.on.names() {
            [] => home == own,
            names => names.contains(own),
        }
    });
    if complaints.is_empty() { Ok(freedoms) } else { Err(complaints) }
}

/// The freedoms of the stack, which any device can use.
///
/// # Errors
/// What is wrong with their files.
pub fn common() -> Result<Vec<Freedom>, Vec<Complaint>> {
    Ok(COMMON_FREEDOMS.iter().cloned().collect::<Result<Vec<_>, _>>()?.concat())
}

/// The personalities of a device.
///
/// # Errors
/// What is wrong with their file, or with a file of the device's freedoms.
pub fn personalities(device: &ReferenceDevice) -> Result<Vec<Personality>, Vec<Complaint>> {
    let source = personality_source();
    let tree = Tree::of(&source).map_err(|wrong| vec![wrong])?;
    let file = read_tree::<PersonalityFile>(&source, &tree).map_err(|wrong| vec![wrong])?;
    let origin = Origin::file_of(&source, tree);
    let (freedoms, mut complaints, mut all) = (of(device)?, Vec::new(), Vec::new());
    for (number, mut personality) in file.personalities.into_iter().enumerate() {
        if personality.device() != device.description.device {
            continue;
        }
        let origin = origin.below(&["personalities", &number.to_string()]);
        for (place, name) in personality.freedoms.iter().enumerate() {
            let Some(freedom) = freedoms.iter().find(|freedom| freedom.name == *name) else {
                let meant = did_you_mean(name, freedoms.iter().map(|known| known.name.as_str()));
                let message = format!("{} has no freedom `{name}`{meant}", personality.device());
                let origin = origin.below(&["freedoms", &place.to_string()]);
                complaints.push(origin.complaint(0, message));
                continue;
            };
            personality.members.push(freedom.clone());
        }
        all.push(personality);
    }
    if complaints.is_empty() { Ok(all) } else { Err(complaints) }
}

fn source((name, text): (&str, &'static str)) -> Arc<Source> {
    built_in(name, text)
}

/// A device that uses all of these freedoms.
pub fn mixture<'f>(freedoms: impl IntoIterator<Item = &'f Freedom>) -> Deviation {
    let (mut names, mut mixture) = (Vec::new(), Deviation::new(String::new()));
    for freedom in freedoms {
        names.push(freedom.name.as_str());
        mixture.append(freedom.deviation());
    }
    mixture.query = format!("freedom={}", names.join(","));
    mixture
}
