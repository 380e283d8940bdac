//! The words of suites: a document's names for its objects, its values and the refusals that belong
//! to them, in the files `words.yaml` of the folders.

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::bench::POWER;
use canopen::source::{Decimal, Node};
use canopen::{Mux, Value};

use super::definition::unknown_key;
use super::literal::{FrameText, ObjectRef};
use super::same::same_numbers;
use super::scale::Scale;
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Place, Source, Tree};

/// The words that a suite may use: those of its folder and of the folders above, and the names by
/// which the suite itself calls objects.
#[derive(Clone, Debug, Default)]
pub struct Words {
    /// The suites of a folder share them.
    folder: Arc<OfFolder>,
    /// Names that differ from those of the folder: two devices of a family may have different
    /// objects at one address, and each suite has the word of its own.
    named: BTreeMap<Mux, String>,
}

#[derive(Clone, Debug, Default)]
struct OfFolder {
    objects: BTreeMap<String, Mux>,
    values: BTreeMap<String, Arc<Enumeration>>,
    /// The meanings of the values of an object, unless two words contradict each other.
    of_objects: BTreeMap<Mux, Facts>,
    /// Words of objects that are set together, in that order.
    records: BTreeMap<String, Vec<String>>,
    refusals: BTreeMap<String, Tree>,
    frames: BTreeMap<String, String>,
    /// The words for frames as reports show them; none where there are several.
    shown_frames: BTreeMap<String, Option<String>>,
    /// The same of names of the bench.
    bench: BTreeMap<String, Facts>,
    /// The name of an object.
    names: BTreeMap<Mux, String>,
    /// The meanings of the values of words, and of names that instances bind to addresses, such as
    /// `$type`.
    facts: BTreeMap<String, Facts>,
}

impl OfFolder {
    /// See [`Words::object`].
    fn object(&self, word: &str) -> Result<Mux, String> {
        self.objects.get(word).copied().ok_or_else(|| {
            let meant = did_you_mean(word, self.objects.keys().map(String::as_str));
            format!("`{word}` is neither an object such as \"1017:00\" nor a word for one{meant}")
        })
    }
}

/// The words for values, and the value of a count.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Facts {
    table: Option<Arc<Enumeration>>,
    scale: Option<Arc<Scale>>,
}

impl Facts {
    fn counted(&self) -> Counted<'_> {
        Counted { table: self.table.as_deref(), scale: self.scale.as_deref() }
    }

    fn is_empty(&self) -> bool {
        self.table.is_none() && self.scale.is_none()
    }
}

/// The meanings of the values of an object.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counted<'w> {
    /// The words for its values.
    pub table: Option<&'w Enumeration>,
    /// The value of a count.
    pub scale: Option<&'w Scale>,
}

impl<'w> Counted<'w> {
    /// The word for a value; `None` when several words stand for it.
    pub(super) fn word(self, value: i128) -> Option<&'w str> {
        only(self.table?.iter().filter(|(_, known)| **known == value).map(|(word, _)| word))
    }
}

/// A table of the document: words and the values that they stand for.
pub(super) type Enumeration = BTreeMap<String, i128>;

impl Words {
    /// Adds the words of a file, which go before those that are known.
    pub(super) fn add(&mut self, source: &Arc<Source>, tree: &Tree) -> Vec<Complaint> {
        let words = Arc::make_mut(&mut self.folder);
        let mut reader = Reader { source, words, complaints: Vec::new() };
        reader.file(tree);
        reader.complaints
    }

    /// The words with the names by which a suite calls its objects.
    pub(super) fn named_as(&self, named: BTreeMap<Mux, Option<String>>) -> Self {
        let named = named.into_iter().filter_map(|(mux, word)| Some((mux, word?)));
        let differ = named.filter(|(mux, word)| self.name(*mux) != Some(word));
        Self { folder: Arc::clone(&self.folder), named: differ.collect() }
    }

    /// What a word stands for: an object, objects that are set together, or a frame.
    pub fn meaning(&self, word: &str) -> Option<String> {
        let object = || Some(format!("object {}", self.folder.objects.get(word)?));
        let record = || Some(format!("objects {}", self.folder.records.get(word)?.join(", ")));
        let frame = || Some(format!("frame {}", self.frame(word)?));
        object().or_else(record).or_else(frame)
    }

    /// The address of a word.
    ///
    /// # Errors
    /// When it is no word for an object.
    pub(super) fn object(&self, word: &str) -> Result<Mux, String> {
        self.folder.object(word)
    }

    /// Whether it is a word for an object.
    pub(super) fn has_object(&self, word: &str) -> bool {
        self.folder.objects.contains_key(word)
    }

    /// The words of the objects of a record.
    pub(super) fn record(&self, word: &str) -> Option<&[String]> {
        self.folder.records.get(word).map(Vec::as_slice)
    }

    /// The words for records.
    pub(super) fn records(&self) -> impl Iterator<Item = &str> {
        self.folder.records.keys().map(String::as_str)
    }

    /// The refusal that a word stands for.
    pub(super) fn refusal(&self, word: &str) -> Option<&Tree> {
        self.folder.refusals.get(word)
    }

    /// The words for refusals.
    pub(super) fn refusals(&self) -> impl Iterator<Item = &str> {
        self.folder.refusals.keys().map(String::as_str)
    }

    /// The frame that a word stands for.
    pub(super) fn frame(&self, word: &str) -> Option<&str> {
        self.folder.frames.get(word).map(String::as_str)
    }

    /// The word for a frame as reports show it.
    pub fn shown_frame(&self, shown: &str) -> Option<&str> {
        self.folder.shown_frames.get(shown)?.as_deref()
    }

    /// The words for frames.
    pub(super) fn frames(&self) -> impl Iterator<Item = &str> {
        self.folder.frames.keys().map(String::as_str)
    }

    /// The meanings of the values of an object, given as a word, an address or a name.
    pub(super) fn counted(&self, object: &str) -> Counted<'_> {
        let of_word = self.folder.facts.get(object).filter(|facts| !facts.is_empty());
        let of_object = || {
            let mux = object.parse().ok().or_else(|| self.folder.objects.get(object).copied())?;
            self.folder.of_objects.get(&mux)
        };
        of_word.or_else(of_object).map(Facts::counted).unwrap_or_default()
    }

    /// The meanings of the values of a name of the bench.
    pub(super) fn on_bench(&self, name: &str) -> Counted<'_> {
        self.folder.bench.get(name).map(Facts::counted).unwrap_or_default()
    }

    /// A value of the bench in its unit.
    pub fn bench_value(&self, name: &str, value: &Value) -> String {
        let Counted { table, scale } = self.on_bench(name);
        let scaled = match (value, scale) {
            (Value::Int(number), None) => table.and_then(|table| word(table, *number)),
            (Value::Int(counts), Some(scale)) => scale.show(*counts),
            (Value::Real(counts), Some(scale)) => Some(scale.show_real(*counts)),
            _ => None,
        };
        scaled.unwrap_or_else(|| match value {
            Value::Int(number) => number.to_string(),
            Value::Text(text) => text.clone(),
            // YAML takes `on` and `off` for truth values.
            Value::Bool(on) if name == POWER => (if *on { "on" } else { "off" }).to_owned(),
            other => other.to_string(),
        })
    }

    /// An amount of a name of the bench in its unit; `None` where its values are words.
    pub(crate) fn bench_amount(&self, name: &str, amount: f64) -> Option<String> {
        let is_number = self.on_bench(name).table.is_none();
        is_number.then(|| self.bench_value(name, &Value::Real(amount)))
    }

    /// The word for an object.
    pub(super) fn word(&self, mux: Mux) -> Option<&str> {
        let word = self.name(mux)?;
        // A folder below may have given the word to another one.
        (self.folder.objects.get(word) == Some(&mux)).then_some(word)
    }

    /// The word for these abort codes; `None` when several words stand for them.
    pub(super) fn refusal_word(&self, codes: &Tree) -> Option<&str> {
        let known = self.folder.refusals.iter().filter(|(_, known)| same_numbers(known, codes));
        only(known.map(|(word, _)| word))
    }

    /// The word for a frame; `None` when several words stand for it.
    pub(super) fn frame_word(&self, frame: &str) -> Option<&str> {
        only(self.folder.frames.iter().filter(|(_, known)| *known == frame).map(|(word, _)| word))
    }

    /// The words for the entries of an object, each with the value of one count, such as `0.1 °C`.
    pub fn objects_of(&self, index: u16) -> impl Iterator<Item = (Mux, &str, Option<String>)> {
        let entries = Mux::new(index, 0)..=Mux::new(index, u8::MAX);
        self.folder.names.range(entries).map(|(mux, word)| {
            let scale = self.of(&ObjectRef::Fixed(*mux)).scale;
            (*mux, word.as_str(), scale.map(Scale::one))
        })
    }

    /// The name of the object.
    pub fn name(&self, mux: Mux) -> Option<&str> {
        self.named.get(&mux).or_else(|| self.folder.names.get(&mux)).map(String::as_str)
    }

    /// An amount of an object in its unit; `None` where its values are words.
    pub(crate) fn amount(&self, object: &ObjectRef, counts: i128) -> Option<String> {
        let Counted { table, scale } = self.of(object);
        match table {
            Some(_) => None,
            None => scale.map_or_else(|| Some(counts.to_string()), |scale| scale.show(counts)),
        }
    }

    /// The meanings of the values of an object, given as an address or a name.
    fn of(&self, object: &ObjectRef) -> Counted<'_> {
        match object {
            ObjectRef::Fixed(mux) => {
                self.folder.of_objects.get(mux).map(Facts::counted).unwrap_or_default()
            }
            ObjectRef::Named(name) => self.counted(&name.to_string()),
        }
    }

    /// The word for a value of an object, given as an address or a name, or the value in its unit.
    pub(crate) fn value(&self, object: &ObjectRef, value: i128) -> Option<String> {
        let Counted { table, scale } = self.of(object);
        let known = table.and_then(|table| word(table, value));
        known.or_else(|| scale?.show(value))
    }
}

/// The word for a value.
fn word(table: &Enumeration, value: i128) -> Option<String> {
    table.iter().find(|(_, known)| **known == value).map(|(word, _)| word.clone())
}

/// The parts of a file.
pub(super) const PARTS: [&str; 6] = ["values", "objects", "records", "refusals", "frames", "bench"];

/// The keys of an object in a file, and of a name of the bench.
pub(super) const OF_OBJECT: [&str; 4] = ["at", "means", "scale", "unit"];
pub(super) const OF_BENCH: [&str; 3] = ["means", "scale", "unit"];

struct Reader<'w> {
    source: &'w Arc<Source>,
    words: &'w mut OfFolder,
    complaints: Vec<Complaint>,
}

impl Reader<'_> {
    fn file(&mut self, tree: &Tree) {
        // Objects name tables of values, in any file.
        for (part, read) in [
            ("values", Self::values as fn(&mut Self, &At<String>, &Tree)),
            ("objects", Self::object),
            ("records", Self::record),
            ("refusals", Self::refusal),
            ("frames", Self::frame),
            ("bench", Self::bench),
        ] {
            for (word, value) in self.entries(tree.get(part)) {
                read(self, word, value);
            }
        }
        for (key, _) in self.entries(Some(tree)) {
            if !PARTS.contains(&key.value.as_str()) {
                self.complain(key.place, unknown_key(&key.value, &PARTS));
            }
        }
    }

    fn entries<'t>(&mut self, tree: Option<&'t Tree>) -> &'t [(At<String>, Tree)] {
        match tree {
            None => &[],
            Some(Tree { node: Node::Map(entries), .. }) => entries,
            Some(other) => {
                self.complain(other.place, "words belong here: `{ word: what it stands for }`");
                &[]
            }
        }
    }

    fn values(&mut self, name: &At<String>, tree: &Tree) {
        let mut table = Enumeration::new();
        for (word, value) in self.entries(Some(tree)) {
            match value.node {
                Node::Int(number, _) => _ = table.insert(word.value.clone(), number),
                _ => self.complain(value.place, "a whole number belongs here"),
            }
        }
        self.words.values.insert(name.value.clone(), Arc::new(table));
    }

    fn refusal(&mut self, name: &At<String>, tree: &Tree) {
        self.words.refusals.insert(name.value.clone(), tree.clone());
    }

    fn frame(&mut self, name: &At<String>, tree: &Tree) {
        let Some(text) = tree.text().filter(|text| text.contains('#')) else {
            return self.complain(tree.place, "a frame belongs here, such as \"7E5#04 01 ...\"");
        };
        match text.parse::<FrameText>() {
            Err(wrong) => self.complain(tree.place, wrong),
            Ok(frame) => {
                let word = &name.value;
                let shown = self.words.shown_frames.entry(frame.to_string());
                let other = shown.or_insert_with(|| Some(word.clone()));
                if other.as_ref().is_some_and(|other| other != word) {
                    *other = None;
                }
                self.words.frames.insert(word.clone(), text.to_owned());
            }
        }
    }

    fn bench(&mut self, word: &At<String>, tree: &Tree) {
        for (key, _) in tree.entries() {
            if !OF_BENCH.contains(&key.value.as_str()) {
                self.complain(key.place, unknown_key(&key.value, &OF_BENCH));
            }
        }
        let facts = self.facts(tree);
        match family(&word.value) {
            Err(wrong) => self.complain(word.place, wrong),
            Ok(_) if facts.is_empty() => {
                self.complain(tree.place, "`means`, `scale` or `unit` belongs here");
            }
            Ok(names) => {
                self.words.bench.extend(names.into_iter().map(|name| (name, facts.clone())));
            }
        }
    }

    /// Members of a family have the counters of the record first; one more stands for several.
    fn record(&mut self, word: &At<String>, tree: &Tree) {
        let Node::List(members) = &tree.node else {
            return self.complain(tree.place, "the words of its objects belong here: `[a, b]`");
        };
        let mut records = BTreeMap::<String, Vec<String>>::new();
        for member in members {
            let text = member.text().unwrap_or_default();
            let known = paired(&word.value, text, 10, 10);
            let known = known.and_then(|pairs| {
                let all = pairs.into_iter().map(|(word, text)| Ok((word, family(&text)?)));
                all.collect::<Result<Vec<_>, String>>()
            });
            match known {
                Err(wrong) => self.complain(member.place, wrong),
                Ok(known) => {
                    for (record, words) in known {
                        if let Some(wrong) =
                            words.iter().find_map(|word| self.words.object(word).err())
                        {
                            return self.complain(member.place, wrong);
                        }
                        records.entry(record).or_default().extend(words);
                    }
                }
            }
        }
        self.words.records.extend(records);
    }

    fn object(&mut self, word: &At<String>, tree: &Tree) {
        let address = match &tree.node {
            Node::Map(_) => tree.get("at"),
            _ => Some(tree),
        };
        for (key, _) in tree.entries() {
            if !OF_OBJECT.contains(&key.value.as_str()) {
                self.complain(key.place, unknown_key(&key.value, &OF_OBJECT));
            }
        }
        let facts = self.facts(tree);
        if word.value.starts_with('$') {
            if let Some(address) = tree.get("at") {
                return self.complain(address.place, "each instance binds its own address");
            }
            self.words.facts.insert(word.value.clone(), facts);
            return;
        }
        let Some((address, text)) = address.and_then(|at| Some((at, at.text()?))) else {
            return self.complain(tree.place, "an address belongs here, or `at` and `means`");
        };
        let named = counted(&word.value, text).and_then(|named| {
            let parsed = named.into_iter().map(|(word, address)| {
                let mux: Mux = address.parse().map_err(|error| format!("`{address}`: {error}"))?;
                Ok((word, mux))
            });
            parsed.collect::<Result<Vec<_>, String>>()
        });
        match named {
            Err(wrong) => self.complain(address.place, wrong),
            Ok(named) => named.into_iter().for_each(|(word, mux)| {
                if !facts.is_empty() {
                    // Two words for one object may count in different units; then it has none.
                    let differ = |known: &Facts| *known != facts;
                    let other = self.words.of_objects.get(&mux).is_some_and(differ);
                    let known = if other { Facts::default() } else { facts.clone() };
                    self.words.of_objects.insert(mux, known);
                    self.words.facts.insert(word.clone(), facts.clone());
                }
                self.words.names.insert(mux, word.clone());
                self.words.objects.insert(word, mux);
            }),
        }
    }

    fn facts(&mut self, tree: &Tree) -> Facts {
        let table = tree.get("means").and_then(|means| self.table(means));
        Facts { table, scale: self.scale(tree).map(Arc::new) }
    }

    /// The table of values of that name.
    fn table(&mut self, means: &Tree) -> Option<Arc<Enumeration>> {
        let name = means.text().unwrap_or_default();
        let table = self.words.values.get(name).map(Arc::clone);
        if table.is_none() {
            let known = self.words.values.keys().map(String::as_str);
            let meant = did_you_mean(name, known);
            self.complain(means.place, format!("no table `{name}` under `values`{meant}"));
        }
        table
    }

    /// The value of a count: `scale` and `unit`, of which one may be absent.
    fn scale(&mut self, tree: &Tree) -> Option<Scale> {
        let unit = tree.get("unit").and_then(Tree::text).unwrap_or_default().to_owned();
        let Some(scale) = tree.get("scale") else {
            let count = Decimal::of(&Node::from("1"))?;
            return (!unit.is_empty()).then_some(Scale { count, unit });
        };
        let count = Decimal::of(&scale.node).filter(|count| !count.is_zero());
        if count.is_none() {
            self.complain(scale.place, "what one count is worth belongs here, such as 0.1");
        }
        Some(Scale { count: count?, unit })
    }

    fn complain(&mut self, place: Place, message: impl Into<String>) {
        self.complaints.push(Complaint::at(self.source, place, message));
    }
}

/// The only word; `None` when there are several.
fn only<'w>(mut words: impl Iterator<Item = &'w String>) -> Option<&'w str> {
    let word = words.next()?;
    words.next().is_none().then_some(word)
}

/// The words of a family with their addresses: each counter of the word has its counter in the
/// address, in the same order.
fn counted(word: &str, address: &str) -> Result<Vec<(String, String)>, String> {
    let pairs = paired(word, address, 10, 16)?;
    match pairs.iter().any(|(_, address)| address.contains('{')) {
        true => Err("word and address have as many counters as each other".to_owned()),
        false => Ok(pairs),
    }
}

/// The words of a family.
fn family(word: &str) -> Result<Vec<String>, String> {
    let Some(open) = word.find('{') else { return Ok(vec![word.to_owned()]) };
    let counter = counter(&word[open..], 10)?;
    let words = counter.values.iter().map(|value| {
        family(&format!("{}{value}{}", &word[..open], &word[open + counter.length..]))
    });
    Ok(words.collect::<Result<Vec<_>, _>>()?.concat())
}

/// Two texts with the values of their counters, the first with the first and so on. The second may
/// have more of them, which stay. Behind a colon, counters have the other radix.
fn paired(
    word: &str,
    text: &str,
    radix: u32,
    behind: u32,
) -> Result<Vec<(String, String)>, String> {
    let Some(open) = word.find('{') else { return Ok(vec![(word.to_owned(), text.to_owned())]) };
    let Some(there) = text.find('{') else {
        return Err("word and address have as many counters as each other".to_owned());
    };
    let colon = text.find(':').unwrap_or(text.len());
    let names = counter(&word[open..], 10)?;
    let places = counter(&text[there..], if there > colon { behind } else { radix })?;
    if names.values.len() != places.values.len() {
        let (ours, theirs) = (names.values.len(), places.values.len());
        return Err(format!("a counter of the word has {ours} values, its other one {theirs}"));
    }
    let pairs = names.values.iter().zip(&places.values).map(|(name, place)| {
        let word = format!("{}{name}{}", &word[..open], &word[open + names.length..]);
        let text = format!("{}{place}{}", &text[..there], &text[there + places.length..]);
        paired(&word, &text, radix, behind)
    });
    Ok(pairs.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// A counter, and how long it is in the text.
struct Counter {
    values: Vec<String>,
    length: usize,
}

/// `{1..13}` at the start of a text.
fn counter(text: &str, radix: u32) -> Result<Counter, String> {
    let wrong = || format!("`{text}`: counters are written `{{1..13}}`");
    let end = text.find('}').ok_or_else(wrong)?;
    let (from, to) = text[1..end].split_once("..").ok_or_else(wrong)?;
    let number = |digits: &str| u32::from_str_radix(digits, radix).map_err(|_| wrong());
    let width = from.len();
    let values = (number(from)?..=number(to)?).map(|value| match radix {
        16 => format!("{value:0width$X}"),
        _ => format!("{value:0width$}"),
    });
    Ok(Counter { values: values.collect(), length: end + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn families_have_counters() {
        let family = |word, address| counted(word, address).unwrap();
        let of = |word: &str, address: &str| (word.to_owned(), address.to_owned());
        assert_eq!(family("a", "1017:00"), [of("a", "1017:00")]);
        let received = family("received-{9..11}", "2500:{09..0B}");
        let expected =
            [("received-9", "2500:09"), ("received-10", "2500:0A"), ("received-11", "2500:0B")];
        assert_eq!(received, expected.map(|(word, address)| of(word, address)));
        let points = family("x-{0..1}-of-table-{9..10}", "3{0..1}0:{09..0A}");
        assert_eq!(points.len(), 4);
        assert_eq!(points[1], of("x-0-of-table-10", "300:0A"));
        for (word, address) in
            [("a-{1..2}", "1017:00"), ("a-{1..2}", "1017:{1..3}"), ("a-{1}", "1:{1..2}")]
        {
            assert!(counted(word, address).is_err(), "{word} {address}");
        }
    }
}
