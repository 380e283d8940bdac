//! The notation of suites made plain: words become addresses and values, a step on several objects
//! becomes a step on each, tables and named steps become the steps that they stand for. What the
//! rest of the harness reads has one step for each thing that is done.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::Mux;
use canopen::source::Node;

use super::definition::{Definition, Definitions};
use super::formula;
use super::vocabulary::Vocabulary;
use super::words::Words;
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Place, Source, Tree};

/// The suite in plain steps, and which named steps of its folder it uses.
pub(super) fn expand(
    source: &Arc<Source>,
    mut tree: Tree,
    shared: &Vocabulary,
) -> Result<(Tree, BTreeSet<String>), Vec<Complaint>> {
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
        complaints: RefCell::new(complaints),
    };
    expander.suite(&mut tree);
    let (used, mut complaints) = (expander.used.take(), expander.complaints.take());
    for (name, definition) in own.iter().filter(|(name, _)| !used.contains(*name)) {
        let message = format!("the steps `{name}` are never used");
        complaints.push(Complaint::at(source, definition.place, message));
    }
    if complaints.is_empty() { Ok((tree, used)) } else { Err(complaints) }
}

/// Names that rows and arguments give a value.
type Values = BTreeMap<String, Tree>;

struct Expander<'s> {
    source: &'s Arc<Source>,
    words: &'s Words,
    own: &'s Definitions,
    shared: &'s Definitions,
    used: RefCell<BTreeSet<String>>,
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

/// Definitions are nested no deeper.
const MOST_DEPTH: usize = 2;

/// Steps that name objects, and what their other keys are.
const OF_OBJECTS: [(&str, &str, &[&str], &[&str]); 4] = [
    (
        "write",
        "object",
        &["refused", "or-refused", "transfer", "if-there"],
        &["value", "bytes", "fill", "save"],
    ),
    (
        "read",
        "object",
        &["refused", "lenient", "transfer", "block-size"],
        &["value", "tolerated", "mask", "min", "max", "length", "characters", "save"],
    ),
    ("until", "object", &["within", "every"], &["value", "tolerated", "mask", "min", "max"]),
    ("observe", "bench", &["within"], &["value", "min", "max"]),
];

/// The key of a suite for what its cases have in common.
const EVERY_CASE: &str = "every-case";

/// What is common to cases that do not say it themselves.
const INSTEAD: [&str; 3] = ["state", "tolerates", "requires"];

/// Steps that are common to all cases, whatever a case adds: it does so inside of them.
const JOINED: [&str; 2] = ["setup", "finally"];

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
            for case in cases {
                if let Some(common) = &common {
                    join(case, common);
                }
                self.case(case);
            }
        }
    }

    fn only_common(&self, common: &Tree) {
        if !matches!(common.node, Node::Map(_)) {
            self.complain(common.place, "keys of cases belong here");
        }
        let known = || INSTEAD.iter().chain(&JOINED).copied();
        for (key, _) in common.entries() {
            if !known().any(|known| known == key.value) {
                let known: Vec<&str> = known().collect();
                let message = format!(
                    "`{}` belongs to a case: every case may have {}",
                    key.value,
                    known.join(", ")
                );
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
                let content = self.filled(content, inside);
                self.plain(place, key, content)
            }
            _ => vec![step.clone()],
        }
    }

    /// Steps for each row of a table.
    fn rows(&self, table: &Tree, inside: Inside<'_>) -> Vec<Tree> {
        let part = |name: &str| match table.get(name).map(|part| &part.node) {
            Some(Node::List(items)) => Some(items),
            _ => None,
        };
        let (Some(columns), Some(rows), Some(steps)) = (part("for"), part("rows"), part("steps"))
        else {
            self.complain(table.place, "`for` has columns, `rows` and `steps`: each a list");
            return Vec::new();
        };
        for (key, _) in table.entries() {
            if !["for", "rows", "steps"].contains(&key.value.as_str()) {
                self.complain(key.place, format!("unknown key `{}` of a table", key.value));
            }
        }
        let names: Vec<&str> = columns.iter().filter_map(Tree::text).collect();
        for (column, name) in columns.iter().zip(&names) {
            if !steps.iter().any(|step| mentions(step, name)) {
                self.complain(column.place, format!("no step uses ${name}"));
            }
        }
        let mut plain = Vec::new();
        for row in rows {
            let Node::List(cells) = &row.node else {
                self.complain(row.place, "a row is a list of values");
                continue;
            };
            if cells.len() != names.len() {
                let message = format!("the table has {} columns, not {}", names.len(), cells.len());
                self.complain(row.place, message);
                continue;
            }
            let mut values = inside.values.clone();
            for (name, cell) in names.iter().zip(cells) {
                values.insert((*name).to_owned(), self.filled(cell, inside));
            }
            // A failure is shown at the row: the steps are the same for all.
            let place = inside.place.unwrap_or(row.place);
            let inside = Inside { values: &values, depth: inside.depth, place: Some(place) };
            plain.extend(steps.iter().flat_map(|step| self.step(step, inside)));
        }
        plain
    }

    /// The steps that a name stands for.
    fn used(&self, used: &Tree, inside: Inside<'_>) -> Vec<Tree> {
        let none = Vec::new();
        let (name, given) = match &used.node {
            Node::Map(entries) if entries.len() == 1 => match &entries[0].1.node {
                Node::Map(given) => (entries[0].0.value.as_str(), given),
                _ => {
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
        let mut values = Values::new();
        for (argument, value) in given {
            if definition.takes.iter().any(|known| known.value == argument.value) {
                values.insert(argument.value.clone(), self.filled(value, inside));
            } else {
                let known = definition.takes.iter().map(|known| known.value.as_str());
                let meant = did_you_mean(&argument.value, known);
                let message = format!("`{name}` takes no `{}`{meant}", argument.value);
                self.complain(argument.place, message);
            }
        }
        let missing = definition.takes.iter().filter(|known| !values.contains_key(&known.value));
        let missing: Vec<&str> = missing.map(|known| known.value.as_str()).collect();
        if !missing.is_empty() {
            let message = format!("`{name}` also takes {}", missing.join(", "));
            self.complain(used.place, message);
            return none;
        }
        // The lines of another file are not those of this one.
        let place = inside.place.or_else(|| (!own).then_some(used.place));
        let inside = Inside { values: &values, depth: inside.depth + 1, place };
        definition.steps.iter().flat_map(|step| self.step(step, inside)).collect()
    }

    fn definition(&self, name: &str) -> Option<(&Definition, bool)> {
        let own = self.own.get(name).map(|definition| (definition, true));
        own.or_else(|| Some((self.shared.get(name)?, false)))
    }

    /// A copy with the values of names in their stead.
    fn filled(&self, tree: &Tree, inside: Inside<'_>) -> Tree {
        let place = inside.place.unwrap_or(tree.place);
        let node = match &tree.node {
            Node::Map(entries) => {
                let entries = entries.iter().map(|(key, value)| {
                    let word = match formula::filled(&key.value, inside.values) {
                        Some(Node::Text(text) | Node::Int(_, text)) => text,
                        _ => key.value.clone(),
                    };
                    let place = inside.place.unwrap_or(key.place);
                    (At::new(word, place), self.filled(value, inside))
                });
                Node::Map(entries.collect())
            }
            Node::List(items) => {
                Node::List(items.iter().map(|item| self.filled(item, inside)).collect())
            }
            Node::Text(text) => {
                formula::filled(text, inside.values).unwrap_or_else(|| tree.node.clone())
            }
            other => other.clone(),
        };
        Tree { node, place }
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
            if key.value == "remap" {
                self.remap(&mut content);
            }
            return vec![step(content, place)];
        };
        if content.get(object).is_some() {
            let mut content = content;
            self.of_object(&mut content);
            return vec![step(content, place)];
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
                _ => self.short(name, value, &mut parts),
            }
            parts.extend(options.iter().map(|(key, value)| (key.clone(), value.clone())));
            let mut content = Tree { node: Node::Map(parts), place: word.place };
            self.of_object(&mut content);
            step(content, word.place)
        });
        each.collect()
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

    /// What is written for short behind an object: a value, `5 .. 7`, `at least 5`, `6 +/- 1`,
    /// `6 tolerating +/- 1`, or of bits `has 4` and `lacks 4`.
    fn short(&self, step: &str, value: &Tree, parts: &mut Vec<(At<String>, Tree)>) {
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
        let tolerated = center.strip_suffix(" tolerating");
        let center = Node::from(tolerated.unwrap_or(center).trim());
        match (formula::around(&center, spread), tolerated) {
            (Some(around), Some(_)) => {
                part("value", center);
                let around = around.into_iter();
                let around = around.map(|node| Tree { node, place: value.place });
                part("tolerated", Node::List(around.collect()));
            }
            (Some(around), None) => {
                let mut ends = around.into_iter();
                if let (Some(low), Some(high)) = (ends.next(), ends.next_back()) {
                    part("min", low);
                    part("max", high);
                }
            }
            (None, _) => {
                self.complain(value.place, "write `6 +/- 1` or `6 tolerating +/- 1`, with numbers");
            }
        }
    }

    /// Address, values and refusals of a step on one object.
    fn of_object(&self, content: &mut Tree) {
        let Node::Map(entries) = &mut content.node else { return };
        let mut mux = None;
        for (_, object) in entries.iter_mut().filter(|(key, _)| key.value == "object") {
            self.address(object);
            mux = object.text().and_then(|text| text.parse::<Mux>().ok());
        }
        for (key, value) in entries {
            match key.value.as_str() {
                "value" | "min" | "max" | "mask" => self.meant(mux, value),
                "tolerated" => {
                    if let Node::List(values) = &mut value.node {
                        values.iter_mut().for_each(|value| self.meant(mux, value));
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
                            if self.words.object(text).is_ok());
                        if word {
                            self.address(object);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// The address of a word.
    fn address(&self, object: &mut Tree) {
        let Node::Text(text) = &mut object.node else { return };
        if text.starts_with('$') || text.parse::<Mux>().is_ok() {
            return;
        }
        match self.words.object(text) {
            Ok(mux) => *text = format!("{:04X}:{:02X}", mux.index, mux.sub),
            Err(wrong) => self.complain(object.place, wrong),
        }
    }

    /// The value of a word, or of several that are set together.
    fn meant(&self, mux: Option<Mux>, value: &mut Tree) {
        let Some(table) = mux.and_then(|mux| self.words.meaning(mux)) else { return };
        let Node::Text(text) = &value.node else { return };
        if text.starts_with('$') {
            return;
        }
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

    /// Abort codes instead of their words.
    fn refusal(&self, refusal: &mut Tree) {
        match &mut refusal.node {
            Node::Text(text) if !["any", "taken"].contains(&text.as_str()) => {
                match self.words.refusal(text) {
                    Some(known) => {
                        // The place is here, whatever file names the codes.
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
            let at = if key.value == "setup" { 0 } else { own.len() };
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

/// Whether a name is used somewhere in it.
pub(super) fn mentions(tree: &Tree, name: &str) -> bool {
    match &tree.node {
        Node::Map(entries) => entries
            .iter()
            .any(|(key, value)| formula::has(&key.value, name) || mentions(value, name)),
        Node::List(items) => items.iter().any(|item| mentions(item, name)),
        Node::Text(text) => formula::has(text, name),
        _ => false,
    }
}
