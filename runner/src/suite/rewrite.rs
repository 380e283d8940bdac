//! Rewrites suites from the first edition of the notation to the second: words for addresses and
//! values, one step on several objects, lists for records. The text is edited at the places of its
//! tree, so that comments and text that is not understood stay as they are. A file is edited only
//! if it still expands into the same plain steps afterwards.

mod layout;
mod short;
mod text;

use std::collections::BTreeSet;
use std::ops::{AddAssign, Range};
use std::sync::Arc;

use canopen::Mux;
use canopen::source::Node;

use self::layout::{WIDTH, laid_out};
use self::short::{Entry, Shortener};
use self::text::{Item, Text};
use super::expand::{BOUNDS, FRAMES, OF_FRAMES, OF_OBJECTS, expand};
use super::library::{is_register, is_test_map, trees};
use super::same::same;
use super::vocabulary::{Vocabularies, Vocabulary};
use super::words::Words;
use crate::parallel::{self, processors};
use crate::source::{Complaint, Source, Tree};

/// The result for a file.
#[derive(Debug)]
pub struct Rewritten {
    /// The file as it was.
    pub source: Arc<Source>,
    /// Its new text.
    pub text: String,
    /// The changes.
    pub changes: Changes,
}

/// How often what was changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Steps that are written for short.
    pub steps: usize,
    /// Steps that they have become.
    pub into: usize,
    /// Words in place of addresses.
    pub objects: usize,
    /// Words or units in place of numbers.
    pub values: usize,
    /// Lists in place of the objects of a record.
    pub records: usize,
    /// Words in place of abort codes.
    pub refusals: usize,
    /// Words in place of frames.
    pub frames: usize,
    /// The steps that would have changed their meaning.
    pub kept: usize,
}

impl AddAssign for Changes {
    fn add_assign(&mut self, other: Self) {
        self.steps += other.steps;
        self.into += other.into;
        self.objects += other.objects;
        self.values += other.values;
        self.records += other.records;
        self.refusals += other.refusals;
        self.frames += other.frames;
        self.kept += other.kept;
    }
}

/// Another text for a part of the file.
#[derive(Clone, Debug)]
struct Edit {
    bytes: Range<usize>,
    text: String,
    changes: Changes,
}

/// The suites of that name in the second edition of the notation.
///
/// # Errors
/// Every complaint about the suites as they are.
pub fn rewritten(
    mut sources: Vec<Arc<Source>>,
    names: &BTreeSet<String>,
) -> Result<Vec<Rewritten>, Vec<Complaint>> {
    sources.retain(|source| !is_register(source) && !is_test_map(source));
    let (trees, mut complaints) = trees(sources);
    let (vocabularies, mut suites, wrong) = Vocabularies::of(trees);
    complaints.extend(wrong);
    suites.retain(|(source, _)| names.contains(&source.name));
    let files = parallel::map(suites, processors(), |(source, tree)| {
        rewrite(&source, tree, vocabularies.at(&source.name))
    });
    let mut all = Vec::new();
    for file in files {
        match file {
            Ok(file) => all.push(file),
            Err(wrong) => complaints.extend(wrong),
        }
    }
    if complaints.is_empty() { Ok(all) } else { Err(complaints) }
}

/// The suite in the second edition of the notation.
///
/// # Errors
/// What is wrong with the suite as it is.
fn rewrite(
    source: &Arc<Source>,
    tree: Tree,
    shared: &Vocabulary,
) -> Result<Rewritten, Vec<Complaint>> {
    let untouched = |source: &Arc<Source>| Rewritten {
        source: Arc::clone(source),
        text: source.text.to_string(),
        changes: Changes::default(),
    };
    let Some(text) = Text::of(&source.text) else {
        expand(source, tree, shared)?;
        return Ok(untouched(source));
    };
    let found = Finder { text: &text, words: &shared.words, edits: Vec::new() }.edits(&tree);
    let before = expand(source, tree, shared)?;
    let means_the_same = |edits: &[Edit]| {
        let edited = Arc::new(Source::new(source.name.clone(), text.edited(edits)));
        let tree = Tree::of(&edited).ok();
        let after = tree.and_then(|tree| expand(&edited, tree, shared).ok());
        after.is_some_and(|after| after.used == before.used && same(&after.tree, &before.tree))
    };
    let mut kept = sound(&found, &means_the_same);
    if !means_the_same(&kept) {
        kept.clear();
    }
    let mut changes = Changes::default();
    let starts: BTreeSet<usize> = kept.iter().map(|edit| edit.bytes.start).collect();
    for edit in &found {
        match starts.contains(&edit.bytes.start) {
            true => changes += edit.changes,
            false => changes.kept += edit.changes.steps.max(1),
        }
    }
    Ok(Rewritten { text: text.edited(&kept), changes, ..untouched(source) })
}

/// The edits after which the file means the same: those that do not are found by halves.
fn sound(edits: &[Edit], means_the_same: &dyn Fn(&[Edit]) -> bool) -> Vec<Edit> {
    if edits.is_empty() || means_the_same(edits) {
        return edits.to_vec();
    }
    if edits.len() == 1 {
        return Vec::new();
    }
    let (first, second) = edits.split_at(edits.len() / 2);
    [sound(first, means_the_same), sound(second, means_the_same)].concat()
}

struct Finder<'f> {
    text: &'f Text<'f>,
    words: &'f Words,
    edits: Vec<Edit>,
}

impl Finder<'_> {
    /// All edits, in the order of the text.
    fn edits(mut self, tree: &Tree) -> Vec<Edit> {
        let list = |tree: &Tree, key: &str| match tree.get(key).map(|list| &list.node) {
            Some(Node::List(items)) => items.clone(),
            _ => Vec::new(),
        };
        let cases = list(tree, "cases");
        for of_case in cases.iter().chain(tree.get("every-case")) {
            for required in list(of_case, "requires") {
                for key in ["object", "absent"] {
                    required.get(key).into_iter().for_each(|object| self.object(object));
                }
            }
            for part in ["setup", "steps", "finally"] {
                self.steps(&list(of_case, part));
            }
        }
        for (_, definition) in tree.get("define").map_or(&[][..], Tree::entries) {
            self.steps(&list(definition, "steps"));
        }
        self.edits.sort_by_key(|edit| edit.bytes.start);
        self.edits
    }

    fn steps(&mut self, steps: &[Tree]) {
        let items = self.text.items(steps);
        let mut at = 0;
        while let Some(item) = items.get(at) {
            at += match self.group(&items[at..]) {
                0 => {
                    self.step(item.step);
                    1
                }
                taken => taken,
            };
        }
    }

    /// Writes the first steps for short, as one if they are alike; returns how many there were.
    fn group(&mut self, items: &[Item<'_>]) -> usize {
        let shortener = Shortener { text: self.text, words: self.words };
        let Some(mut first) = items[0].is_whole.then(|| shortener.of(items[0].step)).flatten()
        else {
            return 0;
        };
        let mut taken = 1;
        while let Some(next) = items.get(taken)
            && first.is_of_one_object
            && items[taken - 1].comment.is_none()
            && next.comment.is_none()
            && next.is_whole
            && next.lines.start == items[taken - 1].lines.end
            && let Some(mut next) = shortener.of(next.step)
            && next.is_of_one_object
            && first.takes(&next)
        {
            first.entries.append(&mut next.entries);
            first.changes += next.changes;
            taken += 1;
        }
        let mut changes = first.changes;
        if first.is_of_one_object {
            changes.steps = taken;
            changes.into = 1;
            changes.records += shortener.as_records(&mut first.entries);
        }
        let entries: Vec<String> =
            first.entries.iter().map(Entry::written).chain(first.shared).collect();
        let lines = items[0].lines.start..items[taken - 1].lines.end;
        let Some(text) = laid_out(items[0].indent, first.key, &entries, items[0].comment) else {
            return 0;
        };
        let bytes = self.text.bytes_of(lines);
        if changes == Changes::default() || self.text.slice(&bytes) == text {
            return 0;
        }
        self.edits.push(Edit { bytes, text, changes });
        taken
    }

    /// Words in a step that is otherwise left as it is.
    fn step(&mut self, step: &Tree) {
        if let (Some(Node::List(steps)), true) =
            (step.get("steps").map(|steps| &steps.node), step.get("for").is_some())
        {
            return self.steps(steps);
        }
        let [(key, content)] = step.entries() else { return };
        match key.value.as_str() {
            "remap" => {
                content.get("pdo").into_iter().for_each(|pdo| self.object(pdo));
                if let Some(Node::List(objects)) = content.get("objects").map(|list| &list.node) {
                    objects.iter().for_each(|object| self.object(object));
                }
                if let Some(refused) = content.get("refused") {
                    self.refusal(refused);
                }
            }
            name if OF_FRAMES.contains(&name) => self.frames(content, true),
            name if OF_OBJECTS.iter().any(|of| of.0 == name) => {
                for key in ["object", "refused", "or-refused", "lenient"] {
                    match content.get(key) {
                        Some(object) if key == "object" => self.object(object),
                        Some(refusal) => self.refusal(refusal),
                        None => {}
                    }
                }
            }
            _ => {}
        }
    }

    /// A word in place of an address.
    fn object(&mut self, object: &Tree) {
        let mux = object.text().and_then(|text| text.parse::<Mux>().ok());
        let Some(word) = mux.and_then(|mux| self.words.word(mux)) else { return };
        let changes = Changes { objects: 1, ..Changes::default() };
        self.replace(self.text.scalar(object), word.to_owned(), changes);
    }

    fn refusal(&mut self, refusal: &Tree) {
        let Some(word) = self.words.refusal_word(refusal) else { return };
        let changes = Changes { refusals: 1, ..Changes::default() };
        self.replace(self.text.on_one_line(refusal), word.to_owned(), changes);
    }

    fn frames(&mut self, content: &Tree, is_frame: bool) {
        match &content.node {
            Node::Map(entries) => {
                let named = entries.iter().filter(|(key, _)| !BOUNDS.contains(&&*key.value));
                named.for_each(|(key, value)| self.frames(value, FRAMES.contains(&&*key.value)));
            }
            Node::List(items) => items.iter().for_each(|item| self.frames(item, is_frame)),
            Node::Text(text) if is_frame => {
                if let Some(word) = self.words.frame_word(text) {
                    let changes = Changes { frames: 1, ..Changes::default() };
                    self.replace(self.text.scalar(content), word.to_owned(), changes);
                }
            }
            _ => {}
        }
    }

    /// Replaces a part of a line, unless that makes it too long.
    fn replace(&mut self, bytes: Option<Range<usize>>, text: String, changes: Changes) {
        let Some(bytes) = bytes else { return };
        let (before, after) = (self.text.slice(&bytes).chars().count(), text.chars().count());
        if after <= before || self.text.width_around(&bytes) + after - before <= WIDTH {
            self.edits.push(Edit { bytes, text, changes });
        }
    }
}
