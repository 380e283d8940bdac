//! Steps on one object in the way in which steps on several are written.

use canopen::Mux;
use canopen::source::Node;

use super::Changes;
use super::text::Text;
use crate::source::{At, Tree};
use crate::suite::expand::OF_OBJECTS;
use crate::suite::words::{Counted, Words};

/// A step in the new notation.
pub(super) struct Short<'t> {
    /// Which step.
    pub key: &'t str,
    /// Its objects with their values.
    pub entries: Vec<Entry>,
    /// The keys that are about all of them.
    pub shared: Vec<String>,
    /// It is written in the first edition of the notation.
    pub is_of_one_object: bool,
    /// The changes, except for the steps.
    pub changes: Changes,
}

/// An object with its value.
#[derive(Clone)]
pub(super) struct Entry {
    /// Its word or address.
    name: String,
    /// The same as it is written.
    key: String,
    value: String,
}

impl Entry {
    /// As it is written in the step.
    pub(super) fn written(&self) -> String {
        format!("{}: {}", self.key, self.value)
    }

    /// Whether its value may stand in the list of a record.
    fn is_plain(&self) -> bool {
        self.value != "~" && !self.value.starts_with(['{', '['])
    }
}

impl Short<'_> {
    /// Whether the other one may follow in the same step.
    pub(super) fn takes(&self, next: &Self) -> bool {
        let is_new = |entry: &Entry| self.entries.iter().all(|own| own.name != entry.name);
        self.key == next.key && self.shared == next.shared && next.entries.iter().all(is_new)
    }
}

type OfObjects = (&'static str, &'static str, &'static [&'static str], &'static [&'static str]);

/// Writes steps for short.
pub(super) struct Shortener<'s> {
    /// The file.
    pub text: &'s Text<'s>,
    /// Its words.
    pub words: &'s Words,
}

impl Shortener<'_> {
    /// The step for short; `None` when it is none on objects, or not understood.
    pub(super) fn of<'t>(&self, step: &'t Tree) -> Option<Short<'t>> {
        let [(key, content)] = step.entries() else { return None };
        let of = OF_OBJECTS.iter().find(|of| of.0 == key.value)?;
        let (_, object, shared, single) = *of;
        let is_shared = |(key, _): &&(At<String>, Tree)| shared.contains(&key.value.as_str());
        let (options, own): (Vec<_>, Vec<_>) = content.entries().iter().partition(is_shared);
        let mut short = Short {
            key: &key.value,
            entries: Vec::new(),
            shared: Vec::new(),
            is_of_one_object: content.get(object).is_some(),
            changes: Changes::default(),
        };
        if short.is_of_one_object {
            let named = content.get(object)?;
            let own = own.into_iter().filter(|(key, _)| key.value != object);
            let own: Vec<_> = own.map(|(key, value)| (key.value.as_str(), value)).collect();
            if own.iter().any(|(key, _)| !single.contains(key)) {
                return None;
            }
            let entry = self.entry(of, named, &own, &mut short.changes)?;
            short.entries.push(entry);
        } else {
            for (key, value) in own {
                let entry = self.with_words(of, key, value, &mut short.changes)?;
                short.entries.push(entry);
            }
        }
        for (key, value) in options {
            let word = self
                .words
                .refusal_word(value)
                .filter(|_| key.value.contains("refused") || key.value == "lenient");
            short.changes.refusals += usize::from(word.is_some());
            let value = match word {
                Some(word) => word.to_owned(),
                None => self.text.copied(value)?,
            };
            short.shared.push(format!("{}: {value}", key.value));
        }
        Some(short)
    }

    /// The word of an object and its value.
    fn entry(
        &self,
        of: &OfObjects,
        named: &Tree,
        own: &[(&str, &Tree)],
        changes: &mut Changes,
    ) -> Option<Entry> {
        let (name, key, counted) = self.named(of, named, changes)?;
        let counts = of.1 == "object" && !self.words.has_object(named.text()?);
        let numbers = Numbers { text: self.text, counted, counts };
        let value = numbers.value(of.0, own, changes)?;
        Some(Entry { name, key, value })
    }

    /// The same of an object that stands in a step on several.
    fn with_words(
        &self,
        of: &OfObjects,
        key: &At<String>,
        value: &Tree,
        changes: &mut Changes,
    ) -> Option<Entry> {
        let named = Tree { node: Node::Text(key.value.clone()), place: key.place };
        let (name, key, counted) = self.named(of, &named, changes)?;
        let numbers = Numbers { text: self.text, counted, counts: false };
        let value = match &value.node {
            Node::Int(..) => numbers.number(value, changes)?,
            _ => self.text.copied(value)?,
        };
        Some(Entry { name, key, value })
    }

    /// The word for an object, or its address, the same as it is written, and the kind of its
    /// numbers.
    fn named(
        &self,
        of: &OfObjects,
        named: &Tree,
        changes: &mut Changes,
    ) -> Option<(String, String, Counted<'_>)> {
        let (_, object, shared, single) = *of;
        let is_key =
            |word: &str| word == object || shared.contains(&word) || single.contains(&word);
        let text = named.text()?;
        let mux = text.parse::<Mux>().ok().filter(|_| object == "object");
        let counted = |word: &str| match (object, self.words.object(word)) {
            ("object", Ok(mux)) => self.words.counted(&mux.to_string()),
            ("object", Err(_)) => self.words.counted(word),
            _ => Counted::default(),
        };
        match mux.and_then(|mux| self.words.word(mux)).filter(|word| !is_key(word)) {
            Some(word) => {
                changes.objects += 1;
                Some((word.to_owned(), word.to_owned(), counted(word)))
            }
            None if is_key(text) => None,
            None => Some((text.to_owned(), self.text.copied(named)?, counted(text))),
        }
    }

    /// Lists in place of the objects of records; returns how many.
    pub(super) fn as_records(&self, entries: &mut Vec<Entry>) -> usize {
        let (mut joined, mut records, mut at) = (Vec::new(), 0, 0);
        while let Some(entry) = entries.get(at) {
            match self.record_at(&entries[at..]) {
                Some((word, length)) => {
                    let values: Vec<&str> =
                        entries[at..at + length].iter().map(|one| one.value.as_str()).collect();
                    let value = format!("[{}]", values.join(", "));
                    joined.push(Entry { name: word.to_owned(), key: word.to_owned(), value });
                    (records, at) = (records + 1, at + length);
                }
                None => {
                    joined.push(entry.clone());
                    at += 1;
                }
            }
        }
        *entries = joined;
        records
    }

    /// The longest record whose objects are the next ones, and how many of them: all, or the first
    /// three or more that differ by their numbers alone.
    fn record_at(&self, entries: &[Entry]) -> Option<(&str, usize)> {
        const SOME: usize = 3;
        let without_digits = |word: &str| word.replace(|c: char| c.is_ascii_digit(), "");
        let plain = entries.iter().take_while(|entry| entry.is_plain());
        let plain: Vec<&str> = plain.map(|entry| entry.name.as_str()).collect();
        let records = self.words.records().filter_map(|word| {
            let members = self.words.record(word)?;
            let pairs = members.iter().zip(&plain);
            let length = pairs.take_while(|(member, name)| member == *name).count();
            let is_row = || {
                length >= SOME
                    && members.iter().all(|one| without_digits(one) == without_digits(&members[0]))
            };
            let fits = length >= 2 && (length == members.len() || is_row());
            fits.then_some((word, length, length == members.len()))
        });
        let best = records.max_by(|a, b| (a.2, a.1).cmp(&(b.2, b.1)).then(b.0.cmp(a.0)));
        best.map(|(word, length, _)| (word, length))
    }
}

/// The values of an object.
struct Numbers<'s> {
    text: &'s Text<'s>,
    counted: Counted<'s>,
    /// They are counts, and not in the unit of the object.
    counts: bool,
}

impl Numbers<'_> {
    /// The value after the object.
    fn value(&self, step: &str, own: &[(&str, &Tree)], changes: &mut Changes) -> Option<String> {
        let get = |name: &str| own.iter().find(|(key, _)| *key == name).map(|(_, value)| *value);
        if own.is_empty() {
            return Some("~".to_owned());
        }
        let mut keys: Vec<&str> = own.iter().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        let before = *changes;
        let short = match (step, keys.as_slice()) {
            (_, ["value"]) => {
                let value = self.number(get("value")?, changes)?;
                (step == "write" || !is_judgement(&value)).then_some(value)
            }
            ("write", _) => None,
            (_, ["min"]) => Some(format!("at least {}", self.number(get("min")?, changes)?)),
            (_, ["max"]) => Some(format!("at most {}", self.number(get("max")?, changes)?)),
            (_, ["max", "min"]) => {
                let (low, high) = (get("min")?, get("max")?);
                Some(format!("{} .. {}", self.number(low, changes)?, self.number(high, changes)?))
            }
            (_, ["mask", "value"]) => self.bits(get("mask")?, get("value")?, changes),
            (_, ["tolerated", "value"]) => self.around(get("value")?, get("tolerated")?, changes),
            _ => None,
        };
        let is_plain = |text: &String| {
            keys == ["value"] || !text.contains(['"', '\'', ',', '[', ']', '{', '}', '#'])
        };
        if let Some(short) = short.filter(is_plain) {
            return Some(short);
        }
        *changes = before;
        let parts = own.iter().map(|(key, value)| {
            let value = match (*key, &value.node) {
                ("value" | "min" | "max" | "mask", _) => self.number(value, changes)?,
                ("tolerated", Node::List(values)) => {
                    let values = values.iter().map(|value| self.number(value, changes));
                    format!("[{}]", values.collect::<Option<Vec<_>>>()?.join(", "))
                }
                _ => self.text.copied(value)?,
            };
            Some(format!("{key}: {value}"))
        });
        Some(format!("{{ {} }}", parts.collect::<Option<Vec<_>>>()?.join(", ")))
    }

    /// A number as a word or in its unit, if it has one.
    fn number(&self, value: &Tree, changes: &mut Changes) -> Option<String> {
        match (&value.node, self.counted.scale.filter(|_| self.counts)) {
            (Node::Int(number, _), Some(scale)) => {
                changes.values += 1;
                scale.show(*number)
            }
            // A number with a point would be taken for one in the unit.
            (Node::Real(..), Some(_)) => None,
            (Node::Int(number, _), None) => match self.counted.word(*number) {
                Some(word) => {
                    changes.values += 1;
                    Some(word.to_owned())
                }
                None => self.text.copied(value),
            },
            _ => self.text.copied(value),
        }
    }

    /// `has 4` and `lacks 4`.
    fn bits(&self, mask: &Tree, value: &Tree, changes: &mut Changes) -> Option<String> {
        if matches!(value.node, Node::Int(0, _)) {
            return Some(format!("lacks {}", self.number(mask, changes)?));
        }
        let same = match (&mask.node, &value.node) {
            (Node::Int(mask, _), Node::Int(value, _)) => mask == value,
            (mask, value) => mask == value,
        };
        same.then(|| Some(format!("has {}", self.number(mask, changes)?)))?
    }

    /// `6 tolerating +/- 1`.
    fn around(&self, value: &Tree, tolerated: &Tree, changes: &mut Changes) -> Option<String> {
        let number = |tree: &Tree| match tree.node {
            Node::Int(number, _) => Some(number),
            _ => None,
        };
        let Node::List(tolerated) = &tolerated.node else { return None };
        let (value_of, around) =
            (number(value)?, tolerated.iter().map(number).collect::<Option<Vec<_>>>()?);
        let spread = i128::try_from(around.len() / 2).ok()?;
        let all = (value_of - spread..=value_of + spread).filter(|one| *one != value_of);
        if around.is_empty() || all.collect::<Vec<_>>() != around {
            return None;
        }
        match self.counted.scale {
            Some(scale) if self.counts => {
                let value = self.number(value, changes)?;
                Some(format!("{value} tolerating +/- {}", scale.show(spread)?))
            }
            Some(_) => None,
            // A word has no values around it.
            None => Some(format!("{} tolerating +/- {spread}", self.text.copied(value)?)),
        }
    }
}

/// Whether a text would be taken for more than a value.
fn is_judgement(text: &str) -> bool {
    let starts = ["at least ", "at most ", "has ", "lacks "];
    starts.iter().any(|start| text.starts_with(start))
        || text.contains(" .. ")
        || text.contains(" +/- ")
}
