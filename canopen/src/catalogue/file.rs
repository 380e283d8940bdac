//! The form of a catalogue file, and its validity rules.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::key::{keyed, no_index};
use super::scalar::Scalar;
use super::{Block, CatalogueObject, Facts, Indexed, ObjectFacts, Profile, Recognition};
use crate::mux::Mux;
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
    /// How long the application of such a device may take to see what was written, in
    /// milliseconds. Suites of the profile begin a case after it.
    #[serde(default)]
    cycle_ms: Option<u16>,
    /// What is not 0 while such a device goes on with something that was begun, which the suites
    /// of the profile wait for before a case.
    #[serde(default)]
    busy: Option<Mux>,
    /// The objects by index, `"1000"`, by range, `1400..15FF`, by range and step, hexadecimal,
    /// `6500..65F0/10`, or with counters, decimal, `3{01..12}0`. `#` in the name is the number of
    /// the object, `#1`, `#2` its number by each of several counters.
    #[serde(default)]
    objects: BTreeMap<String, ObjectFacts>,
}

/// The profiles that are known with those of these files, each after the one it builds on.
pub(super) fn read(
    sources: &[Arc<Source>],
    known: &[Arc<Profile>],
) -> Result<Vec<Arc<Profile>>, Vec<Complaint>> {
    let (mut complaints, mut files) = (Vec::new(), Vec::new());
    for source in sources {
        match read_yaml::<CatalogueFile>(source) {
            Ok(file) => files.push((source, file)),
            Err(complaint) => complaints.push(complaint),
        }
    }
    let mut names: Vec<String> = known.iter().map(|known| known.name.clone()).collect();
    names.extend(files.iter().map(|(_, file)| file.profile.value.clone()));
    let mut profiles: Vec<Arc<Profile>> = Vec::new();
    let mut take =
        |(source, file), before: Option<&Profile>, profiles: &mut Vec<Arc<Profile>>| match profile(
            source, file, before, profiles,
        ) {
            Ok(profile) => profiles.push(Arc::new(profile)),
            Err(mut wrong) => complaints.append(&mut wrong),
        };
    for known in known {
        let mut before = Profile::clone(known);
        // The base may have been replaced.
        let base = before.base.as_ref().map(|base| base.name.clone());
        let base = base.and_then(|base| profiles.iter().find(|profile| profile.name == base));
        before.base = base.cloned();
        match files.iter().position(|(_, file)| file.profile.value == known.name) {
            Some(place) => take(files.remove(place), Some(&before), &mut profiles),
            None => profiles.push(Arc::new(before)),
        }
    }
    // A file must wait until the profile that it builds on has been read.
    while let Some(next) = files.iter().position(|(_, file)| {
        let base = file.based_on.as_ref().map(|base| base.value.as_str());
        base.is_none_or(|base| profiles.iter().any(|known| known.name == base))
    }) {
        take(files.remove(next), None, &mut profiles);
    }
    // The remaining files build on a file that does not load, on themselves, or on nothing.
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

/// The profile of a file, over what it was before.
fn profile(
    source: &Arc<Source>,
    file: CatalogueFile,
    before: Option<&Profile>,
    known: &[Arc<Profile>],
) -> Result<Profile, Vec<Complaint>> {
    let one = |place, message: String| vec![Complaint::at(source, place, message)];
    if known.iter().any(|known| known.name == file.profile.value) {
        let message =
            format!("profile {} is described in another file already", file.profile.value);
        return Err(one(file.profile.place, message));
    }
    let mut profile = before.cloned().unwrap_or_default();
    if let Some(base) = file.based_on {
        let known = known.iter().find(|known| known.name == base.value);
        let missing = || one(base.place, format!("no profile `{}` to build on", base.value));
        profile.base = Some(Arc::clone(known.ok_or_else(missing)?));
    }
    profile.name = file.profile.value;
    if !file.title.is_empty() {
        profile.title = file.title;
    }
    profile.recognised = file.recognised.or(profile.recognised);
    profile.names.extend(file.names);
    profile.blocks.extend(file.blocks);
    profile.options.extend(file.options);
    profile.cycle_ms = file.cycle_ms.unwrap_or(profile.cycle_ms);
    profile.busy = file.busy.or(profile.busy);
    let mut wrong = Wrong { source, found: Vec::new() };
    let objects = objects(file.objects, &mut wrong);
    for (indices, _) in &objects {
        profile.objects = without(std::mem::take(&mut profile.objects), indices);
    }
    profile.objects.extend(objects);
    profile.objects.sort_by_key(|(indices, _)| *indices.start());
    blocks(&profile, &mut wrong);
    if wrong.found.is_empty() { Ok(profile) } else { Err(wrong.complaints()) }
}

/// The objects of a file by their indices.
fn objects(keys: BTreeMap<String, ObjectFacts>, wrong: &mut Wrong<'_>) -> Vec<Indexed> {
    let mut objects: Vec<(RangeInclusive<u16>, String, CatalogueObject)> = Vec::new();
    for (key, object) in keys {
        values(&key, &object, wrong);
        match keyed(&key, object) {
            None => wrong.key(&["objects", &key], no_index(&key)),
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
    objects.into_iter().map(|(indices, _, facts)| (indices, facts)).collect()
}

/// The same without what stands at these indices; a range that they are a part of is cut.
fn without(objects: Vec<Indexed>, indices: &RangeInclusive<u16>) -> Vec<Indexed> {
    let (first, last) = (*indices.start(), *indices.end());
    let cut = |(range, object): Indexed| {
        let (from, to) = (*range.start(), *range.end());
        let outside = last < from || to < first;
        let before = (!outside && from < first).then(|| (from..=first - 1, object.clone()));
        let after = (!outside && last < to).then(|| (last + 1..=to, object.clone()));
        [outside.then_some((range, object)), before, after].into_iter().flatten()
    };
    objects.into_iter().flat_map(cut).collect()
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

/// The mistakes in one file, by the keys that lead to them.
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
    fn files_override_what_is_known_and_add_to_it() {
        let base = Catalogue::built_in();
        let amended = |texts: &[&str]| {
            let source = |text: &&str| Source::new("x.yaml", (*text).to_owned());
            base.amended(&texts.iter().map(|text| Arc::new(source(text))).collect::<Vec<_>>())
        };
        let catalogue = amended(&[
            "profile: cia404\nnames: { control-on: 0x80 }\n\
             objects: { \"6425\": { object: var, name: Mine, type: unsigned8 } }\n",
            "profile: cia301\nobjects: { \"1500\": { object: var, name: Mine } }\n",
            "profile: mine\nbased-on: em66\ntitle: Mine\nnames: { lamp: 4 }\n",
        ])
        .unwrap();
        let em66 = catalogue.profile("em66").unwrap();
        assert_eq!((em66.code("control-on"), em66.code("control-tune")), (Some(0x80), Some(2)));
        let mine = catalogue.profile("mine").unwrap();
        assert_eq!((mine.code("control-on"), mine.code("lamp")), (Some(0x80), Some(4)));
        let name = |profile: &str, index| {
            catalogue.profile(profile).unwrap().lookup(index).and_then(|object| object.name.clone())
        };
        assert_eq!(name("cia404", 0x6425).as_deref(), Some("Mine"));
        assert_eq!(
            name("cia404", 0x6427),
            base.profile("cia404").unwrap().lookup(0x6427).unwrap().name
        );
        for (index, expected) in [(0x14FF, "RPDO communication parameter"), (0x1500, "Mine")] {
            assert_eq!(name("cia301", index).as_deref(), Some(expected));
        }
        assert_eq!(name("cia301", 0x1501), name("cia301", 0x14FF));
        for (texts, expected) in [
            (&["profile: em66\n", "profile: em66\n"][..], "in another file already"),
            (&["profile: em66\nbased-on: cia40\n"], "no profile `cia40` to build on"),
            (
                &["profile: cia404\nblocks: { b: { count: 1, step: 1, objects: {o: '6505:01'} } }"],
                "the profile has no object 6505",
            ),
        ] {
            let wrong = amended(texts).unwrap_err().remove(0);
            assert!(wrong.message.contains(expected), "{}", wrong.message);
            assert!(wrong.place.is_some(), "{}", wrong.message);
        }
    }

    fn complaint(rest: &str) -> String {
        let text = format!("profile: x\n{rest}\n");
        let source = Arc::new(Source::new("x.yaml", text));
        let complaints = Catalogue::read(&[source]).unwrap_err();
        let complaint = complaints.first().unwrap();
        let at =
            complaint.place.map_or_else(String::new, |at| format!("{}:{}", at.line, at.column));
        format!("{at}: {}", complaint.message)
    }
}
