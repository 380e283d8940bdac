//! The form of a catalogue file, and what must hold of it.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::scalar::Scalar;
use super::{Block, CatalogueObject, Facts, ObjectFacts, Profile, Recognition};
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Outline, Source, read_yaml};

/// What a profile says of its objects.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct CatalogueFile {
    /// Name, such as `cia301`, by which devices and suites refer to the profile.
    profile: At<String>,
    /// What a person calls it.
    #[serde(default)]
    title: String,
    /// The profile it builds on, whose names and blocks are its own, too.
    #[serde(default)]
    based_on: Option<At<String>>,
    /// How a device that follows it is recognised where 1000h does not say.
    #[serde(default)]
    recognised: Option<Recognition>,
    /// Bits and codes by the names under which suites of this profile use them.
    #[serde(default)]
    names: BTreeMap<String, i64>,
    /// Groups of objects that repeat.
    #[serde(default)]
    blocks: BTreeMap<String, Block>,
    /// What a device of this profile may lack although no object is missing, with its meaning.
    #[serde(default)]
    options: BTreeMap<String, String>,
    /// The objects by index, `"1000"`, by range, `1400..15FF`, or by range and step, hexadecimal,
    /// `6500..65F0/10`, where `#` in the name is the number of the object.
    objects: BTreeMap<String, ObjectFacts>,
}

/// The profiles of these files, each after the one it builds on.
pub(super) fn read(sources: &[Arc<Source>]) -> Result<Vec<Profile>, Vec<Complaint>> {
    let (mut complaints, mut files) = (Vec::new(), Vec::new());
    for source in sources {
        match read_yaml::<CatalogueFile>(source) {
            Ok(file) => files.push((source, file)),
            Err(complaint) => complaints.push(complaint),
        }
    }
    let names: Vec<String> = files.iter().map(|(_, file)| file.profile.value.clone()).collect();
    let mut profiles: Vec<Profile> = Vec::new();
    // Files wait until the profile they build on is there.
    while let Some(next) = files.iter().position(|(_, file)| {
        let base = file.based_on.as_ref().map(|base| base.value.as_str());
        base.is_none_or(|base| profiles.iter().any(|known| known.name == base))
    }) {
        let (source, file) = files.remove(next);
        match profile(source, file, &profiles) {
            Ok(profile) => profiles.push(profile),
            Err(mut wrong) => complaints.append(&mut wrong),
        }
    }
    // What is left builds on a file that does not load, on itself, or on nothing.
    for (source, file) in files {
        let Some(base) = file.based_on else { continue };
        if names.contains(&base.value) && !complaints.is_empty() {
            continue;
        }
        let meant = did_you_mean(&base.value, names.iter().map(String::as_str));
        let message = format!("no profile `{}` to build on{meant}", base.value);
        complaints.push(Complaint::at(source, base.place, message));
    }
    if complaints.is_empty() { Ok(profiles) } else { Err(complaints) }
}

fn profile(
    source: &Arc<Source>,
    file: CatalogueFile,
    known: &[Profile],
) -> Result<Profile, Vec<Complaint>> {
    if known.iter().any(|known| known.name == file.profile.value) {
        let message =
            format!("profile {} is described in another file already", file.profile.value);
        return Err(vec![Complaint::at(source, file.profile.place, message)]);
    }
    let base = file.based_on.and_then(|base| known.iter().find(|known| known.name == base.value));
    let mut wrong = Wrong { source, found: Vec::new() };
    let mut objects: Vec<(RangeInclusive<u16>, String, CatalogueObject)> = Vec::new();
    for (key, object) in file.objects {
        values(&key, &object, &mut wrong);
        match keyed(&key, object) {
            None => wrong.key(
                &["objects", &key],
                format!(
                    "`{key}` is neither an index such as 1000, nor 1400..15FF, nor 6500..65F0/10"
                ),
            ),
            Some(keyed) => {
                objects.extend(keyed.into_iter().map(|(range, facts)| (range, key.clone(), facts)));
            }
        }
    }
    objects.sort_by_key(|(indices, ..)| *indices.start());
    for pair in objects.windows(2) {
        if pair[0].0.end() >= pair[1].0.start() {
            let message = format!("{:04X} is described twice", pair[1].0.start());
            wrong.key(&["objects", &pair[1].1], message);
        }
    }
    let objects = objects.into_iter().map(|(indices, _, facts)| (indices, facts)).collect();
    let profile = Profile {
        name: file.profile.value,
        title: file.title,
        base: base.cloned().map(Arc::new),
        recognised: file.recognised,
        names: file.names,
        blocks: file.blocks,
        options: file.options,
        objects,
    };
    blocks(&profile, &mut wrong);
    if wrong.found.is_empty() { Ok(profile) } else { Err(wrong.complaints()) }
}

/// Default values and limits are of the type of their object, where the profile says which.
fn values(key: &str, object: &ObjectFacts, wrong: &mut Wrong<'_>) {
    let mut check = |facts: &Facts, path: &[&str]| {
        let Some(data_type) = facts.data_type else { return };
        let scalars = [("value", &facts.value), ("low", &facts.low), ("high", &facts.high)];
        for (name, scalar) in scalars {
            let misfit = |scalar: &&Scalar| scalar.term(data_type).is_none();
            if let Some(scalar) = scalar.as_ref().filter(misfit) {
                let path = [&["objects", key], path, &[name]].concat();
                wrong.value(&path, format!("{scalar} is not a value of type {data_type}"));
            }
        }
    };
    check(&object.of_var(), &[]);
    if let Some(facts) = &object.sub0 {
        check(facts, &["sub0"]);
    }
    for sub in object.subs.keys() {
        let facts = object.of_sub(*sub);
        let name = sub.to_string();
        check(&facts, &["subs", &name]);
    }
}

/// The objects of every block, counted to the last, are indices and objects of the profile.
fn blocks(profile: &Profile, wrong: &mut Wrong<'_>) {
    for (name, block) in &profile.blocks {
        for (object, first) in &block.objects {
            let path = ["blocks", name, "objects", object];
            let last = block.step.checked_mul(u16::from(block.count.saturating_sub(1)));
            match last.and_then(|last| first.index.checked_add(last)) {
                None => {
                    let count = block.count;
                    wrong.value(&path, format!("block {count} of {count} lies beyond index FFFF"));
                }
                Some(_) => {
                    let index = (1..=block.count)
                        .filter_map(|number| block.object(object, number))
                        .map(|mux| mux.index)
                        .find(|index| profile.chain().all(|known| known.lookup(*index).is_none()));
                    if let Some(index) = index {
                        wrong.value(&path, format!("the profile has no object {index:04X}"));
                    }
                }
            }
        }
    }
}

/// What is wrong in one file, by the keys that lead there.
struct Wrong<'s> {
    source: &'s Arc<Source>,
    found: Vec<(bool, Vec<String>, String)>,
}

impl Wrong<'_> {
    fn key(&mut self, path: &[&str], message: String) {
        self.found.push((true, path.iter().map(|&key| key.to_owned()).collect(), message));
    }

    fn value(&mut self, path: &[&str], message: String) {
        self.found.push((false, path.iter().map(|&key| key.to_owned()).collect(), message));
    }

    fn complaints(self) -> Vec<Complaint> {
        let outline = Outline::of(self.source);
        let complain = |(at_key, path, message): (bool, Vec<String>, String)| {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            let place = outline.as_ref().map(|outline| {
                let key = outline.key(&path).filter(|_| at_key);
                key.unwrap_or_else(|| outline.nearest(&path))
            });
            Complaint { source: Arc::clone(self.source), place, message }
        };
        self.found.into_iter().map(complain).collect()
    }
}

/// The objects that a key of a description means: `1000`, `1400..15FF`, or every tenth (hex) as in
/// `6500..65F0/10`, where `#` in the name is the number of the object. `None` when it is no key.
pub fn keyed(key: &str, object: ObjectFacts) -> Option<Vec<(RangeInclusive<u16>, ObjectFacts)>> {
    let hex = |text: &str| {
        let digits = text.bytes().all(|digit| digit.is_ascii_hexdigit());
        u16::from_str_radix(text, 16).ok().filter(|_| digits)
    };
    let index = |text: &str| hex(text).filter(|_| text.len() == 4);
    let Some((first, last)) = key.split_once("..") else {
        return index(key).map(|only| vec![(only..=only, object)]);
    };
    let (last, step) = match last.split_once('/') {
        Some((last, step)) => (last, hex(step).filter(|step| *step > 0)?),
        None => (last, 0),
    };
    let (first, last) = (index(first)?, index(last)?);
    match step {
        _ if first > last => None,
        0 => Some(vec![(first..=last, object)]),
        _ => {
            let indices = (first..=last).step_by(step.into()).zip(1..);
            let numbered = |(index, number): (u16, u32)| (index..=index, numbered(&object, number));
            Some(indices.map(numbered).collect())
        }
    }
}

fn numbered(object: &ObjectFacts, number: u32) -> ObjectFacts {
    let name = object.name.as_ref().map(|name| name.replace('#', &number.to_string()));
    ObjectFacts { name, ..object.clone() }
}

#[cfg(test)]
mod tests {
    use super::super::Catalogue;
    use super::*;

    #[test]
    fn mistakes_have_places() {
        let table = [
            ("objects: { \"100\": {} }", "2:12: `100` is neither an index"),
            ("objects: { \"1000..1010\": {}, \"1008\": {} }", "2:30: 1008 is described twice"),
            ("objects: { \"1000\": { type: unsignd8 } }", "did you mean `unsigned8`?"),
            ("objects: { \"1000\": { acess: ro } }", "2:22: unknown key `acess`; did you mean"),
            ("objects: { \"1000\": { access: or } }", "2:30: unknown access type `or`: there is"),
            ("objects: { \"1000\": { pdo: tdpo } }", "did you mean `tpdo`?"),
            (
                "objects: { \"1000\": { type: unsigned8, value: 256 } }",
                "2:46: 256 is not a value of type unsigned8",
            ),
            (
                "objects: { \"1000\": { type: integer8, subs: { 1: { low: -129 } } } }",
                "2:56: -129 is not a value of type integer8",
            ),
            ("based-on: y\nobjects: {}", "2:11: no profile `y` to build on"),
            ("based-on: x\nobjects: {}", "2:11: no profile `x` to build on"),
            ("objects: {}\nobjects: {}", "3:1: `objects` stands here a second time"),
            ("names: { one: first }\nobjects: {}", "2:15: a whole number belongs here"),
            (
                "blocks: { b: { count: 2, step: 0x10, objects: { o: \"1000\" } } }\nobjects: {}",
                "2:52: an object is written",
            ),
            (
                "blocks: { b: { count: 2, step: 0x10, objects: { o: \"1000:00\" } } }\n\
                 objects: { \"1000\": {} }",
                "2:52: the profile has no object 1010",
            ),
            (
                "blocks: { b: { count: 255, step: 0xFFFF, objects: { o: \"1000:00\" } } }\n\
                 objects: { \"1000\": {} }",
                "2:56: block 255 of 255 lies beyond index FFFF",
            ),
            ("{", ""),
        ];
        let wrong = table.map(|(rest, expected)| (complaint(rest), expected));
        let wrong: Vec<_> =
            wrong.iter().filter(|(got, expected)| !got.contains(expected)).collect();
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn the_last_index_has_a_number() {
        let keyed = keyed("0000..FFFF/1", ObjectFacts::default()).unwrap();
        assert_eq!(keyed.len(), 0x10000);
        assert!(super::keyed("+100", ObjectFacts::default()).is_none());
    }

    fn complaint(rest: &str) -> String {
        let text = format!("profile: x\n{rest}\n");
        let source = Arc::new(Source { name: "x.yaml".into(), text });
        let complaints = Catalogue::read(&[source]).unwrap_err();
        let complaint = complaints.first().unwrap();
        let at =
            complaint.place.map_or_else(String::new, |at| format!("{}:{}", at.line, at.column));
        format!("{at}: {}", complaint.message)
    }
}
