//! The notations of device data: what the README shows loads, what the notations have the README
//! documents, and no text whatever makes the loader panic.

use std::collections::BTreeSet;
use std::sync::Arc;

use canopen::catalogue::{Catalogue, CatalogueFile};
use canopen::source::Source;
use canopen::{Device, Instant, Outbox};
use proptest::prelude::*;
use reference_devices::describe::{DeviceFile, PartFile, VariantFile};
use reference_devices::devices::{DeviceFiles, ReferenceDevice};
use reference_devices::freedom::{self, FreedomFile, PersonalityFile};
use reference_devices::mutant::{self, MutantFile};
use reference_devices::rules::Rules;
use schemars::{JsonSchema, schema_for};

const README: &str = include_str!("../README.md");

#[test]
fn the_examples_of_the_readme_load() {
    let family = files(&example("device.yaml"), &example("small.yaml"), &example("mutants.yaml"))
        .family(Catalogue::built_in());
    let family = family.unwrap_or_else(|wrong| panic!("{}", wrong[0]));
    let names: Vec<&str> = family.iter().map(|device| device.description.device.as_str()).collect();
    assert_eq!(names, ["my-device", "my-device-small"]);
    let mut own = 0;
    for device in &family {
        let mutants = mutant::of(device).unwrap_or_else(|wrong| panic!("{}", wrong[0]));
        for mutant in mutants.iter().filter(|mutant| !mutant.shared) {
            let deviation = mutant.deviation();
            deviation.build(device, 5).map(drop).unwrap_or_else(|wrong| panic!("{wrong}"));
            deviation.data_sheet(device).unwrap_or_else(|wrong| panic!("{wrong}"));
            own += 1;
        }
    }
    assert_eq!(own, 9);
    let freedoms = freedom::of(&family[0]).unwrap_or_else(|wrong| panic!("{}", wrong[0]));
    let freedom = freedoms.iter().find(|freedom| !freedom.shared).expect("it has one of its own");
    let deviation = freedom::mixture([freedom]);
    deviation.build(&family[0], 5).map(drop).unwrap_or_else(|wrong| panic!("{wrong}"));
    let catalogue = Catalogue::read(&[source("my-profile.yaml", &example("my-profile.yaml"))]);
    let catalogue = catalogue.unwrap_or_else(|wrong| panic!("{}", wrong[0]));
    assert!(catalogue.profile("my-profile").unwrap().lookup(0x6030).is_some());
}

#[test]
fn the_readme_documents_every_key() {
    let mut keys = BTreeSet::new();
    keys.extend(keys_of::<DeviceFile>());
    keys.extend(keys_of::<VariantFile>());
    keys.extend(keys_of::<PartFile>());
    keys.extend(keys_of::<MutantFile>());
    keys.extend(keys_of::<FreedomFile>());
    keys.extend(keys_of::<PersonalityFile>());
    keys.extend(keys_of::<CatalogueFile>());
    let shown = |key: &&String| {
        README.contains(&format!("`{key}`")) || README.contains(&format!(" {key}: "))
    };
    let missing: Vec<&String> = keys.iter().filter(|key| !shown(key)).collect();
    assert!(keys.len() > 90, "only {} keys were found", keys.len());
    assert!(missing.is_empty(), "README.md does not mention {missing:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_text_makes_the_loader_panic(
        edits in proptest::collection::vec(edit(), 1..4),
        which in 0_usize..3,
    ) {
        let mut texts = [example("device.yaml"), example("small.yaml"), example("mutants.yaml")];
        for edit in &edits {
            texts[which] = edit.apply(&texts[which]);
        }
        let [device, variant, mutants] = &texts;
        let Ok(family) = files(device, variant, mutants).family(Catalogue::built_in()) else {
            return Ok(());
        };
        for device in &family {
            run(device);
        }
    }

    #[test]
    fn no_catalogue_makes_the_loader_panic(edits in proptest::collection::vec(edit(), 1..4)) {
        let text = edits.iter().fold(example("my-profile.yaml"), |text, edit| edit.apply(&text));
        if let Err(complaints) = Catalogue::read(&[source("my-profile.yaml", &text)]) {
            prop_assert!(complaints.iter().all(|complaint| !complaint.to_string().is_empty()));
        }
    }
}

/// A change of a text that keeps most of it, so that it gets far into the loader.
#[derive(Clone, Debug)]
enum Edit {
    /// Another word for one of the words, counted over the text and beyond.
    Word(usize, String),
    /// A line is missing.
    Without(usize),
    /// A line stands there twice.
    Twice(usize),
    /// A character more.
    Character(usize, char),
}

fn edit() -> impl Strategy<Value = Edit> {
    prop_oneof![
        4 => (any::<usize>(), proptest::sample::select(WORDS))
            .prop_map(|(at, word)| Edit::Word(at, word.to_owned())),
        1 => any::<usize>().prop_map(Edit::Without),
        1 => any::<usize>().prop_map(Edit::Twice),
        1 => (any::<usize>(), proptest::char::range('\t', '~'))
            .prop_map(|(at, c)| Edit::Character(at, c)),
    ]
}

impl Edit {
    fn apply(&self, text: &str) -> String {
        let lines: Vec<&str> = text.lines().collect();
        let joined = |lines: Vec<&str>| lines.join("\n") + "\n";
        match self {
            Self::Word(at, word) => {
                let mut words: Vec<&str> = text.split(' ').collect();
                let at = at % words.len();
                // What closes a bracket or a line stays.
                let tail = words[at].trim_start_matches(|c: char| !"\n,]}".contains(c)).to_owned();
                let word = format!("{word}{tail}");
                words[at] = &word;
                words.join(" ")
            }
            Self::Without(at) => {
                let mut lines = lines;
                if !lines.is_empty() {
                    lines.remove(at % lines.len());
                }
                joined(lines)
            }
            Self::Twice(at) => {
                let mut lines = lines;
                if !lines.is_empty() {
                    let at = at % lines.len();
                    lines.insert(at, lines[at]);
                }
                joined(lines)
            }
            Self::Character(at, c) => {
                let places: Vec<usize> = text.char_indices().map(|(place, _)| place).collect();
                let mut text = text.to_owned();
                text.insert(places.get(at % places.len().max(1)).copied().unwrap_or(0), *c);
                text
            }
        }
    }
}

/// Boots a device, and every mutant of its own that can be built.
fn run(device: &ReferenceDevice) {
    let mut node = device.node(device.description.default_node, Rules::default());
    let mut out = Outbox::default();
    for _ in 0..20 {
        let Some(due) = node.poll_at().filter(|due| *due != Instant::NEVER) else { break };
        node.handle_timeout(due, &mut out);
    }
    for mutant in mutant::of(device).unwrap_or_default().iter().filter(|mutant| !mutant.shared) {
        let deviation = mutant.deviation();
        _ = deviation.build(device, 5);
        _ = deviation.data_sheet(device);
    }
}

fn files(device: &str, variant: &str, mutants: &str) -> DeviceFiles {
    DeviceFiles {
        device: source("my-device/device.yaml", device),
        variants: vec![("small".to_owned(), source("my-device/variants/small.yaml", variant))],
        parts: vec![("temperature".to_owned(), source("parts", &example("temperature.yaml")))],
        mutants: Some(source("my-device/mutants.yaml", mutants)),
        freedoms: Some(source("my-device/freedoms.yaml", &example("freedoms.yaml"))),
    }
}

fn source(name: &str, text: &str) -> Arc<Source> {
    Arc::new(Source::new(name, text.to_owned()))
}

/// The block of the README whose first line names a file that ends so.
fn example(name: &str) -> String {
    let blocks = README.split("```yaml\n").skip(1).filter_map(|rest| rest.split("```").next());
    let named = |block: &&str| block.lines().next().is_some_and(|first| first.ends_with(name));
    blocks.into_iter().find(named).unwrap_or_else(|| panic!("no example of {name}")).to_owned()
}

/// The keys of every struct that a schema describes.
fn keys_of<T: JsonSchema>() -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    collect(&schema_for!(T).to_value(), &mut keys);
    keys
}

fn collect(schema: &serde_json::Value, keys: &mut BTreeSet<String>) {
    if let Some(properties) = schema.get("properties").and_then(|known| known.as_object()) {
        keys.extend(properties.keys().cloned());
    }
    match schema {
        serde_json::Value::Object(members) => {
            members.values().for_each(|value| collect(value, keys))
        }
        serde_json::Value::Array(items) => items.iter().for_each(|value| collect(value, keys)),
        _ => {}
    }
}

/// Words that are something else almost everywhere.
const WORDS: &[&str] = &[
    "0",
    "-1",
    "255",
    "256",
    "65536",
    "4294967295",
    "99999999999999999999",
    "0xFFFFFFFF",
    "$NODEID+0x80",
    "$NODEID+4294967295",
    "\"\"",
    "[]",
    "{}",
    "~",
    "true",
    "1.5",
    ".nan",
    "var",
    "array",
    "domain",
    "visible_string",
    "real32",
    "boolean",
    "ro",
    "wo",
    "both",
    "x",
    "\"1000:00\"",
    "\"FFFF\"",
];
