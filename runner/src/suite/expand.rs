//! Expands the notation of suites: words become addresses and values, a step on several objects
//! becomes a step on each, tables and named steps become the steps that they stand for. Afterwards
//! each action is one step.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::Mux;
use canopen::source::{Decimal, Node, Stand, Table, Values, number_in_frame};

use super::definition::{Definition, Definitions, Taken, unknown_key};
use super::formula;
use super::literal::Amount;
use super::scale::Scale;
use super::step::REPEATS;
use super::vocabulary::Vocabulary;
use super::words::{Counted, Words};
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Place, Source, Tree};

/// A suite in plain steps.
pub(super) struct Expanded {
    /// Its text.
    pub tree: Tree,
    /// The named steps of its folder that it uses.
    pub used: BTreeSet<String>,
    /// The word by which it calls an object; `None` where it has several.
    pub named: BTreeMap<Mux, Option<String>>,
}

/// The suite in plain steps.
pub(super) fn expand(
    source: &Arc<Source>,
    mut tree: Tree,
    shared: &Vocabulary,
) -> Result<Expanded, Vec<Complaint>> {
    let mut complaints = Vec::new();
    let mut own = Definitions::default();
    if let Node::Map(entries) = &mut tree.node
        && let Some(at) = entries.iter().position(|(key, _)| key.value == "define")
    {
        let (_, define) = entries.remove(at);
        complaints.extend(own.add(source, &define));
    }
    let expander = Expander {
        source,
        words: &shared.words,
        own: &own,
        shared: &shared.steps,
        used: RefCell::default(),
        named: RefCell::default(),
        complaints: RefCell::new(complaints),
    };
    expander.suite(&mut tree);
    let (used, mut complaints) = (expander.used.take(), expander.complaints.take());
    let named = expander.named.take();
    for (name, definition) in own.iter().filter(|(name, _)| !used.contains(*name)) {
        let message = format!("the steps `{name}` are never used");
        complaints.push(Complaint::at(source, definition.place, message));
    }
    // A mistake in a step of several rows is reported once.
    let mut known = BTreeSet::new();
    complaints.retain(|wrong| known.insert((wrong.place, wrong.message.clone())));
    if complaints.is_empty() { Ok(Expanded { tree, used, named }) } else { Err(complaints) }
}

struct Expander<'s> {
    source: &'s Arc<Source>,
    words: &'s Words,
    own: &'s Definitions,
    shared: &'s Definitions,
    used: RefCell<BTreeSet<String>>,
    named: RefCell<BTreeMap<Mux, Option<String>>>,
    complaints: RefCell<Vec<Complaint>>,
}

/// Where steps stand.
#[derive(Clone, Copy)]
struct Inside<'v> {
    /// The values of names.
    values: &'v Values,
    /// How many named steps are around it.
    depth: usize,
    /// Where the failure is shown instead of the place in a definition of another file.
    place: Option<Place>,
}

impl Inside<'_> {
    const fn stand(self) -> Stand {
        match self.place {
            Some(place) => Stand::At(place),
            None => Stand::Own,
        }
    }
}

/// Definitions are nested no deeper.
const MOST_DEPTH: usize = 2;

/// Steps that name objects, and what their other keys are.
pub(super) const OF_OBJECTS: [(&str, &str, &[&str], &[&str]); 4] = [
    (
        "write",
        "object",
        &["refused", "or-refused", "enough", "transfer", "mistake", "if-there"],
        &["value", "bytes", "fill", "save"],
    ),
    (
        "read",
        "object",
        &["refused", "lenient", "transfer", "block-size", "or-another"],
        &["value", "tolerated", "mask", "min", "max", "length", "characters", "save"],
    ),
    ("until", "object", &["within", "every"], &["value", "tolerated", "mask", "min", "max"]),
    ("observe", "bench", &["within"], &["value", "min", "max"]),
];

/// Steps about frames, and the keys under which frames stand.
pub(super) const OF_FRAMES: [&str; 8] =
    ["send", "reply", "ask", "expect", "never", "collect", "measure", "produce"];
pub(super) const FRAMES: [&str; 6] = ["first", "send", "reply", "frame", "lenient", "or-else"];
pub(super) const BOUNDS: [&str; 4] = ["interval", "mean", "median", "latency"];

/// The keys of a table of steps.
pub(super) const TABLE: [&str; 3] = ["for", "rows", "steps"];

/// The key of a suite for what its cases have in common.
pub(super) const EVERY_CASE: &str = "every-case";

/// Settings that all cases share unless a case gives its own.
pub(super) const INSTEAD: [&str; 4] = ["state", "each", "for", "rows"];

/// Settings that all cases share and a case adds to. The steps of the case are inside the common
/// ones.
pub(super) const JOINED: [&str; 5] = ["tolerates", "requires", "relies-on", "setup", "finally"];

impl Expander<'_> {
    fn suite(&self, tree: &mut Tree) {
        let Node::Map(entries) = &mut tree.node else { return };
        let common = entries.iter().position(|(key, _)| key.value == EVERY_CASE);
        let common = common.map(|at| entries.remove(at).1);
        if let Some(common) = &common {
            self.only_common(common);
        }
        let cases = entries.iter_mut().filter(|(key, _)| key.value == "cases");
        for (_, cases) in cases {
            let Node::List(cases) = &mut cases.node else { continue };
            let joined = std::mem::take(cases).into_iter().flat_map(|mut case| {
                if let Some(common) = &common {
                    join(&mut case, common);
                }
                self.each_row(case)
            });
            *cases = joined.collect();
            cases.iter_mut().for_each(|case| self.case(case));
        }
    }

    fn only_common(&self, common: &Tree) {
        if !matches!(common.node, Node::Map(_)) {
            self.complain(common.place, "keys of cases belong here");
        }
        let known = || INSTEAD.iter().chain(&JOINED).copied();
        for (key, _) in common.entries() {
            if !known().any(|known| known == key.value) {
                let meant = did_you_mean(&key.value, known());
                let known: Vec<&str> = known().collect();
                let message = match meant.is_empty() {
                    true => format!(
                        "`{}` belongs to a case: every case may have {}",
                        key.value,
                        known.join(", ")
                    ),
                    false => format!("unknown key `{}`{meant}", key.value),
                };
                self.complain(key.place, message);
            }
        }
    }

    fn case(&self, case: &mut Tree) {
        let Node::Map(entries) = &mut case.node else { return };
        for (key, value) in entries {
            match key.value.as_str() {
                "setup" | "steps" | "finally" => {
                    let none = Values::new();
                    let top = Inside { values: &none, depth: 0, place: None };
                    if let Node::List(steps) = &mut value.node {
                        *steps = steps.iter().flat_map(|step| self.step(step, top)).collect();
                    }
                }
                "requires" => {
                    let Node::List(required) = &mut value.node else { continue };
                    for required in required {
                        in_full(required);
                        let Node::Map(entries) = &mut required.node else { continue };
                        let named = entries
                            .iter_mut()
                            .filter(|(key, _)| ["object", "absent"].contains(&key.value.as_str()));
                        named.for_each(|(_, object)| self.address(object));
                    }
                }
                _ => {}
            }
        }
    }

    /// The plain steps of one as it is written.
    fn step(&self, step: &Tree, inside: Inside<'_>) -> Vec<Tree> {
        let Node::Map(entries) = &step.node else { return vec![step.clone()] };
        let (Some((key, content)), rest) = (entries.first(), entries.len()) else {
            return vec![step.clone()];
        };
        match key.value.as_str() {
            "use" if rest == 1 => self.used(content, inside),
            "for" => self.rows(step, inside),
            _ if rest == 1 => {
                let place = inside.place.unwrap_or(step.place);
                let content = content.filled(inside.values, inside.stand());
                self.plain(place, key, content)
            }
            _ => vec![step.clone()],
        }
    }

    /// The cases of one with a table: one for each row, whose id says which.
    fn each_row(&self, mut case: Tree) -> Vec<Tree> {
        if case.get("for").is_none() && case.get("rows").is_none() {
            return vec![case];
        }
        let none = Values::new();
        let top = Inside { values: &none, depth: 0, place: None };
        let Node::Map(entries) = &mut case.node else { return Vec::new() };
        let is_table = |key: &At<String>| ["for", "rows"].contains(&key.value.as_str());
        let (table, content): (Vec<_>, Vec<_>) =
            std::mem::take(entries).into_iter().partition(|(key, _)| is_table(key));
        let table = Tree { node: Node::Map(table), place: case.place };
        let content = Tree { node: Node::Map(content), place: case.place };
        let Some(table) = self.table(&table, std::slice::from_ref(&content), top) else {
            return Vec::new();
        };
        if let Some(id) = content.get("id")
            && !table.columns.iter().any(|column| id.mentions(&column.value))
        {
            let columns: Vec<String> =
                table.columns.iter().map(|column| format!("${}", column.value)).collect();
            let message = format!(
                "each row is a case, so a column belongs into the id: {}",
                columns.join(", ")
            );
            self.complain(id.place, message);
            return Vec::new();
        }
        let cases = table.rows.iter().map(|(place, values)| {
            let mut case = content.filled(values, Stand::Own);
            // The row is what differs from the other cases.
            case.place = *place;
            if let Node::Map(entries) = &mut case.node {
                let ids = entries.iter_mut().filter(|(key, _)| key.value == "id");
                ids.for_each(|(_, id)| id.place = *place);
            }
            case
        });
        cases.collect()
    }

    /// Steps for each row of a table.
    fn rows(&self, written: &Tree, inside: Inside<'_>) -> Vec<Tree> {
        for (key, _) in written.entries() {
            if !TABLE.contains(&key.value.as_str()) {
                self.complain(key.place, unknown_key(&key.value, &TABLE));
            }
        }
        let Some(Node::List(steps)) = written.get("steps").map(|steps| &steps.node) else {
            self.complain(written.place, "a table of steps has `for`, `rows` and `steps`");
            return Vec::new();
        };
        let Some(table) = self.table(written, steps, inside) else { return Vec::new() };
        let plain = table.rows.iter().flat_map(|(place, values)| {
            // A failure is shown at the row: the steps are the same for all.
            let place = inside.place.unwrap_or(*place);
            let inside = Inside { values, depth: inside.depth, place: Some(place) };
            steps.iter().flat_map(|step| self.step(step, inside)).collect::<Vec<_>>()
        });
        plain.collect()
    }

    /// Columns and rows, with a value for each column in each row. All columns are used in
    /// `content`.
    fn table(&self, written: &Tree, content: &[Tree], inside: Inside<'_>) -> Option<Table> {
        let complain = &mut |place, message: String| {
            let help = if message.starts_with("nothing uses") { REPEATS } else { "" };
            self.complain(place, message + help);
        };
        Table::read(written, content, inside.values, inside.stand(), complain)
    }

    /// The steps that a name stands for.
    fn used(&self, used: &Tree, inside: Inside<'_>) -> Vec<Tree> {
        let none = Vec::new();
        let (name, given) = match &used.node {
            Node::Map(entries) if entries.len() == 1 => match &entries[0].1.node {
                Node::Map(given) => (entries[0].0.value.as_str(), given),
                _ => {
                    self.used.borrow_mut().insert(entries[0].0.value.clone());
                    let message = "arguments belong here: `{ name: value }`";
                    self.complain(entries[0].1.place, message);
                    return none;
                }
            },
            Node::Text(name) => (name.as_str(), &Vec::new()),
            _ => {
                self.complain(used.place, "the name of steps belongs here, with its arguments");
                return none;
            }
        };
        if self.own.has_wrong(name) || self.shared.has_wrong(name) {
            return none;
        }
        let Some((definition, own)) = self.definition(name) else {
            let known = self.own.iter().chain(self.shared.iter());
            let meant = did_you_mean(name, known.map(|(name, _)| name));
            self.complain(used.place, format!("no steps are named `{name}`{meant}"));
            return none;
        };
        self.used.borrow_mut().insert(name.to_owned());
        if inside.depth == MOST_DEPTH {
            let message =
                format!("`{name}` is used by steps that are themselves used by named steps");
            self.complain(used.place, message);
            return none;
        }
        let (mut values, mut all_known) = (Values::new(), true);
        for (argument, value) in given {
            if definition.takes.iter().any(|known| known.name.value == argument.value) {
                let value = value.filled(inside.values, inside.stand());
                let name = &argument.value;
                if let Some(message) = number_in_frame(name, &value, &definition.steps) {
                    self.complain(value.place, message);
                }
                values.insert(name.clone(), value);
            } else {
                let known = definition.takes.iter().map(|known| known.name.value.as_str());
                let meant = did_you_mean(&argument.value, known);
                let message = format!("`{name}` takes no `{}`{meant}", argument.value);
                self.complain(argument.place, message);
                all_known = false;
            }
        }
        for Taken { name, default } in &definition.takes {
            if let (Some(default), false) = (default, values.contains_key(&name.value)) {
                values.insert(name.value.clone(), default.clone());
            }
        }
        let names = definition.takes.iter().map(|known| known.name.value.as_str());
        let missing: Vec<&str> = names.filter(|name| !values.contains_key(*name)).collect();
        if !missing.is_empty() {
            // One that is not known is often the one that is missing.
            if all_known {
                let message = format!("`{name}` also takes {}", missing.join(", "));
                self.complain(used.place, message);
            }
            return none;
        }
        // Lines of another file are not lines of this one.
        let place = inside.place.or_else(|| (!own).then_some(used.place));
        let inside = Inside { values: &values, depth: inside.depth + 1, place };
        definition.steps.iter().flat_map(|step| self.step(step, inside)).collect()
    }

    fn definition(&self, name: &str) -> Option<(&Definition, bool)> {
        let own = self.own.get(name).map(|definition| (definition, true));
        own.or_else(|| Some((self.shared.get(name)?, false)))
    }

    /// The plain steps of one without names of rows and arguments.
    fn plain(&self, place: Place, key: &At<String>, content: Tree) -> Vec<Tree> {
        let step = |content: Tree, place: Place| Tree {
            node: Node::Map(vec![(key.clone(), content)]),
            place,
        };
        let of_objects = OF_OBJECTS.iter().find(|(name, ..)| *name == key.value);
        let (Some((name, object, shared, single)), Node::Map(entries)) =
            (of_objects, &content.node)
        else {
            let mut content = content;
            match key.value.as_str() {
                "remap" => self.remap(&mut content),
                "bench" => {
                    if let Node::Map(stimuli) = &mut content.node {
                        for (name, value) in stimuli {
                            self.on_bench(&name.value, value);
                        }
                    }
                }
                name if OF_FRAMES.contains(&name) => self.frames(&mut content, true),
                _ => {}
            }
            return vec![step(content, place)];
        };
        if content.get(object).is_some() {
            let mut content = content;
            self.of_object(&mut content, true);
            return vec![step(content, place)];
        }
        if self.mistyped(entries, &[&[*object], *shared, *single].concat()) {
            return Vec::new();
        }
        let is_option = |key: &str| shared.contains(&key) || single.contains(&key);
        let (options, objects): (Vec<_>, Vec<_>) =
            entries.iter().partition(|(key, _)| is_option(&key.value));
        for (key, _) in options.iter().filter(|(key, _)| !shared.contains(&key.value.as_str())) {
            let message = match objects.is_empty() {
                true => format!("the key `{object}` is missing"),
                false => format!("write `{}` behind the object that it is about", key.value),
            };
            self.complain(key.place, message);
        }
        if objects.is_empty() {
            self.complain(content.place, format!("`{name}` names no object"));
        }
        let objects = objects.into_iter().flat_map(|(word, value)| self.members(word, value));
        let each = objects.map(|(word, value)| {
            let (word, value) = (&word, &value);
            let named = Tree { node: Node::Text(word.value.clone()), place: word.place };
            let mut parts = vec![(At::new((*object).to_owned(), word.place), named)];
            match &value.node {
                Node::Map(own) => parts.extend(own.iter().cloned()),
                Node::Null => {}
                _ => self.short(name, self.scale_of(word), value, &mut parts),
            }
            parts.extend(options.iter().map(|(key, value)| (key.clone(), value.clone())));
            let mut content = Tree { node: Node::Map(parts), place: word.place };
            self.of_object(&mut content, false);
            step(content, word.place)
        });
        each.collect()
    }

    /// Whether the text in place of an object is a mistyped key of the step.
    fn mistyped(&self, entries: &[(At<String>, Tree)], keys: &[&str]) -> bool {
        let mut any = false;
        for (key, _) in entries {
            let word = key.value.as_str();
            let is_object = keys.contains(&word)
                || word.starts_with('$')
                || word.parse::<Mux>().is_ok()
                || self.words.has_object(word)
                || self.words.record(word).is_some();
            if is_object {
                continue;
            }
            let is_slip = |known: &&&str| canopen::nearest::is_slip(word, known);
            if let Some(meant) = keys.iter().find(is_slip) {
                let message = format!("unknown key `{word}`; did you mean `{meant}`?");
                self.complain(key.place, message);
                any = true;
            }
        }
        any
    }

    /// The objects of a record, each with its value of the list, without those whose value is `~`;
    /// another object as it is.
    fn members(&self, word: &At<String>, value: &Tree) -> Vec<(At<String>, Tree)> {
        let Node::List(values) = &value.node else { return vec![(word.clone(), value.clone())] };
        let Some(members) = self.words.record(&word.value) else {
            let meant = did_you_mean(&word.value, self.words.records());
            self.complain(word.place, format!("`{}` is no record of several{meant}", word.value));
            return Vec::new();
        };
        if values.len() > members.len() {
            let (most, given) = (members.len(), values.len());
            let message = format!("`{}` has {most} objects, not {given}", word.value);
            self.complain(value.place, message);
        }
        let given = members.iter().zip(values).filter(|(_, value)| value.node != Node::Null);
        given.map(|(member, value)| (At::new(member.clone(), word.place), value.clone())).collect()
    }

    /// Short notation after an object: a value, `5 .. 7`, `at least 5`, `6 +/- 1`, `6 tolerating
    /// +/- 1`, or for bits `has 4` and `lacks 4`.
    fn short(
        &self,
        step: &str,
        scale: Option<&Scale>,
        value: &Tree,
        parts: &mut Vec<(At<String>, Tree)>,
    ) {
        let mut part = |name: &str, node: Node| {
            let value = Tree { node, place: value.place };
            parts.push((At::new(name.to_owned(), value.place), value));
        };
        let text = match &value.node {
            Node::Text(text) if step != "write" => text.trim(),
            _ => return part("value", value.node.clone()),
        };
        if let Some(low) = text.strip_prefix("at least ") {
            return part("min", Node::from(low.trim()));
        }
        if let Some(high) = text.strip_prefix("at most ") {
            return part("max", Node::from(high.trim()));
        }
        if let Some((low, high)) = text.split_once(" .. ") {
            part("min", Node::from(low.trim()));
            return part("max", Node::from(high.trim()));
        }
        if let Some(bits) = text.strip_prefix("has ") {
            part("mask", Node::from(bits.trim()));
            return part("value", Node::from(bits.trim()));
        }
        if let Some(bits) = text.strip_prefix("lacks ") {
            part("mask", Node::from(bits.trim()));
            return part("value", Node::Int(0, "0".to_owned()));
        }
        let Some((center, spread)) = text.split_once(" +/- ") else {
            return part("value", value.node.clone());
        };
        let number = |text: &str| {
            let node = Node::from(text.trim());
            let number = scale.and_then(|scale| scale.number(&node));
            number.map_or(node, Decimal::node)
        };
        let (tolerated, spread) = (center.strip_suffix(" tolerating"), number(spread));
        let center = Tree { node: number(tolerated.unwrap_or(center)), place: value.place };
        let wrong = match tolerated {
            // The value of a name is known later.
            None if center.text().is_some_and(|center| center.starts_with('$')) => {
                let (center, spread) = text.split_once(" +/- ").unwrap_or_default();
                part("min", Node::Text(format!("{center} - {spread}")));
                part("max", Node::Text(format!("{center} + {spread}")));
                None
            }
            None => match formula::ends(&center.node, &spread) {
                Some([low, high]) => {
                    part("min", low);
                    part("max", high);
                    None
                }
                None => {
                    Some("write `6 +/- 1`, with numbers in the unit of the object, if it has one")
                }
            },
            Some(_) => match around(scale, &center.node, &spread) {
                Some(around) => {
                    part("value", center.node);
                    let around = around.into_iter();
                    let around = around.map(|node| Tree { node, place: value.place });
                    part("tolerated", Node::List(around.collect()));
                    None
                }
                None => Some("write `6 tolerating +/- 1`, with numbers that are 64 apart at most"),
            },
        };
        if let Some(wrong) = wrong {
            self.complain(value.place, wrong);
        }
    }

    /// The scale of the object that a word or an address names.
    fn scale_of(&self, word: &At<String>) -> Option<&Scale> {
        let on_bench = self.words.on_bench(&word.value).scale;
        on_bench.or_else(|| self.words.counted(&word.value).scale)
    }

    /// Address, values and refusals of a step on one object. In a step in the long notation,
    /// without a word for its object, numbers are counts: suites from before the words rely on
    /// that.
    fn of_object(&self, content: &mut Tree, is_long: bool) {
        let Node::Map(entries) = &mut content.node else { return };
        let (mut counted, mut counts) = (Counted::default(), false);
        let bench = entries.iter().find(|(key, _)| key.value == "bench");
        if let Some(name) = bench.and_then(|(_, name)| name.text()).map(str::to_owned) {
            let judged = entries
                .iter_mut()
                .filter(|(key, _)| ["value", "min", "max"].contains(&key.value.as_str()));
            judged.for_each(|(_, value)| self.on_bench(&name, value));
            return;
        }
        for (_, object) in entries.iter_mut().filter(|(key, _)| key.value == "object") {
            counts = is_long && object.text().is_some_and(|text| !self.words.has_object(text));
            counted = object.text().map_or(counted, |text| self.words.counted(text));
            self.address(object);
        }
        let meant = |value: &mut Tree| match value.node {
            Node::Int(..) | Node::Real(..) if counts => {}
            _ => self.meant(counted, value),
        };
        for (key, value) in entries {
            match key.value.as_str() {
                "value" | "min" | "max" | "mask" => meant(value),
                "tolerated" => {
                    if let Node::List(values) = &mut value.node {
                        values.iter_mut().for_each(meant);
                    }
                }
                "refused" | "or-refused" | "lenient" => self.refusal(value),
                _ => {}
            }
        }
    }

    fn remap(&self, content: &mut Tree) {
        let Node::Map(entries) = &mut content.node else { return };
        for (key, value) in entries {
            match (key.value.as_str(), &mut value.node) {
                ("pdo", _) => self.address(value),
                ("refused", _) => self.refusal(value),
                ("objects", Node::List(objects)) => {
                    for object in objects {
                        let word = matches!(&object.node, Node::Text(text)
                            if self.words.has_object(text));
                        if word {
                            self.address(object);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// The frames of words.
    fn frames(&self, content: &mut Tree, is_frame: bool) {
        match &mut content.node {
            Node::Map(entries) => {
                // `lenient` of a bound is a bound.
                let named = entries.iter_mut().filter(|(key, _)| !BOUNDS.contains(&&*key.value));
                for (key, value) in named {
                    self.frames(value, FRAMES.contains(&key.value.as_str()));
                }
            }
            Node::List(items) => items.iter_mut().for_each(|item| self.frames(item, is_frame)),
            Node::Text(text) if is_frame && !text.contains('#') => match self.words.frame(text) {
                Some(frame) => frame.clone_into(text),
                None => {
                    let meant = did_you_mean(text, self.words.frames());
                    let example = "a frame such as \"000#01 02\"";
                    let message =
                        format!("`{text}` is neither {example} nor a word for one{meant}");
                    self.complain(content.place, message);
                }
            },
            _ => {}
        }
    }

    /// The address of a word.
    fn address(&self, object: &mut Tree) {
        let Node::Text(text) = &mut object.node else { return };
        if text.starts_with('$') || text.parse::<Mux>().is_ok() {
            return;
        }
        match self.words.object(text) {
            Ok(mux) => {
                let word = std::mem::replace(text, mux.to_string());
                let mut named = self.named.borrow_mut();
                let known = named.entry(mux).or_insert_with(|| Some(word.clone()));
                if known.as_ref().is_some_and(|known| *known != word) {
                    *known = None;
                }
            }
            Err(wrong) => self.complain(object.place, wrong),
        }
    }

    /// The number of a word, of several that are set together, or of a value in its unit.
    fn meant(&self, Counted { table, scale }: Counted<'_>, value: &mut Tree) {
        match scale.and_then(|scale| scale.counts(&value.node)) {
            Some(Ok(counts)) => return value.node = counts,
            Some(Err(wrong)) => return self.complain(value.place, wrong),
            None => {}
        }
        let Node::Text(text) = &mut value.node else { return };
        if text.starts_with('$') {
            match scale.map(|scale| scaled_terms(text, scale)) {
                Some(Ok(terms)) => *text = terms,
                Some(Err(wrong)) => self.complain(value.place, wrong),
                None => {}
            }
            return;
        }
        let Some(table) = table else {
            // A time is a value of an object that counts times.
            if let (Some(scale), Err(_)) = (scale, text.parse::<Amount>()) {
                let message = format!("`{text}` is no value here: one count is {}", scale.one());
                self.complain(value.place, message);
            }
            return;
        };
        let parts: Option<Vec<i128>> =
            text.split(" + ").map(|word| table.get(word).copied()).collect();
        match parts {
            Some(parts) => {
                let sum: i128 = parts.iter().sum();
                value.node = Node::Int(sum, sum.to_string());
            }
            None => {
                let meant = did_you_mean(text, table.keys().map(String::as_str));
                let known: Vec<&str> = table.keys().map(String::as_str).collect();
                let message = match meant.is_empty() {
                    true => format!("`{text}` is no value here: there is {}", known.join(", ")),
                    false => format!("`{text}` is no value here{meant}"),
                };
                self.complain(value.place, message);
            }
        }
    }

    /// The counts of a value of the bench that is written in its unit.
    fn on_bench(&self, name: &str, value: &mut Tree) {
        let Counted { table, scale } = self.words.on_bench(name);
        match (scale.and_then(|scale| scale.amount(&value.node)), table) {
            (Some(amount), _) => value.node = amount,
            (None, table @ Some(_)) => self.meant(Counted { table, scale: None }, value),
            (None, None) => {}
        }
    }

    /// Abort codes instead of their words.
    fn refusal(&self, refusal: &mut Tree) {
        match &mut refusal.node {
            Node::Text(text) if !["any", "taken"].contains(&text.as_str()) => {
                match self.words.refusal(text) {
                    Some(known) => {
                        // The place is this one, whichever file names the codes.
                        refusal.node = placed(known, refusal.place).node;
                    }
                    None => {
                        let meant = did_you_mean(text, self.words.refusals());
                        let message = format!("`{text}` is no refusal{meant}");
                        self.complain(refusal.place, message);
                    }
                }
            }
            _ => {}
        }
    }

    fn complain(&self, place: Place, message: impl Into<String>) {
        self.complaints.borrow_mut().push(Complaint::at(self.source, place, message));
    }
}

/// The values around one in the unit of the object, count by count, or whole numbers where it has
/// none.
fn around(scale: Option<&Scale>, center: &Node, spread: &Node) -> Option<Vec<Node>> {
    let (center, spread) = (Decimal::of(center)?, Decimal::of(spread)?);
    let one = scale.map_or_else(|| Decimal::of(&Node::from("1")), |scale| Some(scale.count))?;
    let around = formula::around(center.contains(one)?, spread.contains(one)?)?;
    let of_count =
        |count: i128| Some(Decimal::of(&Node::Int(count, count.to_string()))?.times(one)?.node());
    around.into_iter().map(of_count).collect()
}

/// `$now + 30.0 °C` with counts behind the signs: a number with a point or with the unit is a
/// value, another one counts.
fn scaled_terms(text: &str, scale: &Scale) -> Result<String, String> {
    let is_sign =
        |(at, _): &(usize, &str)| text[..*at].ends_with(' ') && text[at + 1..].starts_with(' ');
    let signs: Vec<usize> =
        text.match_indices(['+', '-']).filter(is_sign).map(|(at, _)| at).collect();
    let mut terms = text[..signs.first().copied().unwrap_or(text.len())].to_owned();
    for (place, at) in signs.iter().enumerate() {
        let end = signs.get(place + 1).copied().unwrap_or(text.len());
        let term = text[at + 1..end].trim();
        let is_value = term.contains('.') || term.ends_with(|last: char| !last.is_ascii_digit());
        let term = match (is_value && !term.starts_with('$'))
            .then(|| scale.counts(&Node::from(term)))
            .flatten()
        {
            Some(Ok(Node::Int(_, counts))) => counts,
            Some(Err(wrong)) => return Err(wrong),
            _ => term.to_owned(),
        };
        terms.push_str(&format!("{} {term} ", &text[*at..=*at]));
    }
    terms.truncate(terms.trim_end().len());
    Ok(terms)
}

/// The requirements of a case in short notation: `set-point`, or `{ set-point: rw }` with its
/// access.
fn in_full(required: &mut Tree) {
    const KEYS: [&str; 6] = ["object", "access", "absent", "bit-rate", "supports", "lacks"];
    let place = required.place;
    let key = |name: &str| At::new(name.to_owned(), place);
    let object = |name: &str, place| Tree { node: Node::Text(name.to_owned()), place };
    match &mut required.node {
        Node::Text(name) => {
            required.node = Node::Map(vec![(key("object"), object(name, place))]);
        }
        Node::Map(entries) => {
            let [(name, access)] = entries.as_slice() else { return };
            if !KEYS.contains(&name.value.as_str()) {
                let named = (key("object"), object(&name.value, name.place));
                required.node = Node::Map(vec![named, (key("access"), access.clone())]);
            }
        }
        _ => {}
    }
}

/// Adds to a case what it has in common with the others of its suite.
fn join(case: &mut Tree, common: &Tree) {
    let Node::Map(entries) = &mut case.node else { return };
    for (key, value) in common.entries() {
        let own = entries.iter_mut().find(|(own, _)| own.value == key.value);
        let Some((_, own)) = own else {
            entries.push((key.clone(), value.clone()));
            continue;
        };
        if let (true, Node::List(own), Node::List(common)) =
            (JOINED.contains(&key.value.as_str()), &mut own.node, &value.node)
        {
            let at = if key.value == "finally" { own.len() } else { 0 };
            own.splice(at..at, common.iter().cloned());
        }
    }
}

/// A copy of which everything stands at that place.
fn placed(tree: &Tree, place: Place) -> Tree {
    let node = match &tree.node {
        Node::Map(entries) => Node::Map(
            entries
                .iter()
                .map(|(key, value)| (At::new(key.value.clone(), place), placed(value, place)))
                .collect(),
        ),
        Node::List(items) => Node::List(items.iter().map(|item| placed(item, place)).collect()),
        other => other.clone(),
    };
    Tree { node, place }
}
