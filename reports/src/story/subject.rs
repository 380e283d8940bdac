//! What a problem is about: the objects, words and identifiers that make a frame or a step matter.

use std::collections::{BTreeMap, BTreeSet};

use canopen::{Decoder, Frame, Id, Mux, Pattern};

use crate::cause;
use crate::event::Begun;
use crate::names::addresses;
use crate::verdict::Problem;

/// The subject of a problem.
#[derive(Debug, Default)]
pub(super) struct Subject {
    /// The object that was judged.
    pub object: Option<Mux>,
    /// The identifier of the judged frame, unless it is one of SDO.
    pub id: Option<Id>,
    /// That identifier is the one of a PDO.
    pub is_pdo: bool,
    /// Indices of records.
    records: BTreeSet<u16>,
    /// The common beginnings of words, such as `math-2` of `math-2-output`.
    stems: BTreeSet<String>,
    /// The words that steps have for objects.
    words: BTreeMap<Mux, String>,
}

impl Subject {
    /// The subject of `problem`, which the last of the `steps` found. The decoder has seen the
    /// frames until then.
    pub(super) fn of(problem: &Problem, steps: &[&Begun], decoder: &Decoder) -> Self {
        let step = steps.last().map_or("", |step| step.text.as_str());
        let object = cause::object(problem).or_else(|| Some(addresses(step).next()?.0));
        let mut subject = Self { object, id: identifier(problem), ..Self::default() };
        let named = steps.iter().flat_map(|step| addresses(&step.text));
        subject.words = named.filter_map(|(mux, word)| Some((mux, word?.to_owned()))).collect();
        let mut objects: Vec<Mux> = addresses(step).map(|(mux, _)| mux).collect();
        objects.extend(object);
        if let Some(pdo) = subject.id.and_then(|id| decoder.pdo(id)) {
            subject.is_pdo = true;
            subject.records.extend([pdo.parameter, pdo.parameter + 0x200]);
            objects.extend(pdo.mapping.iter().map(|mapped| mapped.mux));
        }
        subject.records.extend(objects.iter().map(|mux| mux.index));
        let words = objects.iter().filter_map(|mux| subject.words.get(mux));
        subject.stems = words.map(|word| stem(word).to_owned()).collect();
        subject
    }

    /// Whether it is about the object, its record or its block.
    pub(super) fn has_object(&self, mux: Mux) -> bool {
        let word = self.words.get(&mux);
        self.records.contains(&mux.index)
            || word.is_some_and(|word| self.stems.contains(stem(word)))
    }

    /// Whether a step in words is about it.
    pub(super) fn has_step(&self, text: &str) -> bool {
        addresses(text).any(|(mux, _)| self.has_object(mux))
    }
}

/// The identifier of the frame that was judged: the one that was expected, or that came.
fn identifier(problem: &Problem) -> Option<Id> {
    let expected = problem.expected.lines().next()?;
    let expected = expected.strip_prefix("no ").unwrap_or(expected);
    let expected = expected.split_whitespace().find(|word| word.contains('#'));
    let expected = expected.and_then(|word| word.parse::<Pattern>().ok()).map(|one| one.id());
    let id = expected.or_else(|| problem.raw.as_ref().map(|frame: &Frame| frame.id))?;
    let sdo = id.as_standard().is_some_and(|id| (0x580..0x680).contains(&id));
    (!sdo).then_some(id)
}

/// The beginning that words of one block have in common: up to the first number in it. A word
/// without a number stands for itself.
fn stem(word: &str) -> &str {
    let Some(digit) = word.find(|symbol: char| symbol.is_ascii_digit()) else { return word };
    let end = word[digit..].find('-').map_or(word.len(), |end| digit + end);
    &word[..end]
}

#[cfg(test)]
mod tests {
    use super::stem;

    #[test]
    fn blocks_have_a_number() {
        for (word, block) in [
            ("math-2-output", "math-2"),
            ("ai2", "ai2"),
            ("ai12-lower-limit-2ad-4ad", "ai12"),
            ("command-output", "command-output"),
        ] {
            assert_eq!(stem(word), block);
        }
    }
}
