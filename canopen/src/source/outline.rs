//! The places in a YAML text: the keys and items that lead to a value, and the places of both. An
//! outline is made only after a mistake was found in a text that parses.

use serde::{Deserialize, Deserializer};

use super::{Node, Place, Source, Tree};

/// A text as keys, items and their places.
#[derive(Clone, Debug)]
pub struct Outline(Tree);

impl Outline {
    /// The outline of a text; `None` when it is not YAML.
    pub fn of(source: &Source) -> Option<Self> {
        serde_yaml::from_str(&source.text).ok().map(Self)
    }

    /// The scalar that is reached by these keys, as it is written.
    pub fn text(&self, path: &[&str]) -> Option<&str> {
        self.walk(path).and_then(|(_, value)| value.text())
    }

    /// The value at these keys, in one line. If it is a map, its braces are left out.
    pub fn in_one_line(&self, path: &[&str]) -> String {
        let Some((_, value)) = self.walk(path) else { return String::new() };
        let text = value.in_one_line();
        match text.strip_prefix("{ ").and_then(|text| text.strip_suffix(" }")) {
            Some(inner) => inner.to_owned(),
            None => text,
        }
    }

    /// Where the text starts.
    pub const fn start(&self) -> Place {
        self.0.place
    }

    /// The keys of the map that is reached by `path`, each with its place; none when it is not a
    /// map.
    pub fn keys(&self, path: &[&str]) -> impl Iterator<Item = (&str, Place)> {
        let entries = match self.walk(path) {
            Some((_, Tree { node: Node::Map(entries), .. })) => entries.as_slice(),
            _ => &[],
        };
        entries.iter().map(|(key, _)| (key.value.as_str(), key.place))
    }

    /// Where the value stands that is reached by these keys; an item of a list by its number,
    /// counted from 0.
    pub fn value(&self, path: &[&str]) -> Option<Place> {
        self.walk(path).map(|(_, value)| value.place)
    }

    /// Where the last of these keys stands; an item of a list where it starts.
    pub fn key(&self, path: &[&str]) -> Option<Place> {
        self.walk(path).map(|(key, _)| key)
    }

    /// The value that is reached by as many of these keys as there are.
    pub fn nearest(&self, path: &[&str]) -> Place {
        let found = (0..=path.len()).rev().find_map(|length| self.value(&path[..length]));
        found.unwrap_or(self.0.place)
    }

    fn walk(&self, path: &[&str]) -> Option<(Place, &Tree)> {
        path.iter().try_fold((self.0.place, &self.0), |(_, at), step| match &at.node {
            Node::Map(entries) => {
                let (key, value) = entries.iter().find(|(key, _)| key.value == *step)?;
                Some((key.place, value))
            }
            Node::List(items) => {
                let item = items.get(step.parse::<usize>().ok()?)?;
                Some((item.place, item))
            }
            _ => None,
        })
    }
}

/// The outline of what a text stands for.
impl From<Tree> for Outline {
    fn from(tree: Tree) -> Self {
        Self(tree)
    }
}

impl Default for Outline {
    fn default() -> Self {
        Self(Tree { node: Node::Null, place: Place::new(1, 1) })
    }
}

impl<'de> Deserialize<'de> for Outline {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Tree::deserialize(deserializer).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn keys_and_values_have_places() {
        let text = "objects:\n  \"1017\": { value: 7 }\n  \"1018\":\n    subs: { 1: { low: 2 } }\n\
                    list: [a, { b: c, on: d }]\n";
        let source = Source::new("x", text);
        let outline = Outline::of(&source).unwrap();
        let at = |place: Option<Place>| place.map(|place| (place.line, place.column));
        assert_eq!(at(outline.key(&["objects", "1017"])), Some((2, 3)));
        assert_eq!(at(outline.value(&["objects", "1017", "value"])), Some((2, 20)));
        assert_eq!(at(outline.value(&["objects", "1018", "subs", "1", "low"])), Some((4, 23)));
        assert_eq!(at(outline.key(&["objects", "1018", "subs", "1"])), Some((4, 13)));
        assert_eq!(at(outline.value(&["list", "1", "b"])), Some((5, 16)));
        assert_eq!(at(outline.value(&["list", "1", "on"])), Some((5, 23)));
        assert_eq!(at(outline.value(&["list", "7"])), None);
        let keys: Vec<&str> = outline.keys(&["objects"]).map(|(key, _)| key).collect();
        assert_eq!(keys, ["1017", "1018"]);
        assert_eq!(at(Some(outline.nearest(&["list", "7", "x"]))), Some((5, 7)));
    }

    #[test]
    fn what_stands_there_fits_in_one_line() {
        let text = "change:\n  frame:\n    when: \"580+n#...\"\n    skip: 1\n  list: [1, on, ~]\n";
        let source = Arc::new(Source::new("x", text));
        let outline = Outline::from(Tree::of(&source).unwrap());
        let line = "frame: { when: \"580+n#...\", skip: 1 }, list: [1, on, ~]";
        assert_eq!(outline.in_one_line(&["change"]), line);
        assert_eq!(outline.in_one_line(&["change", "frame", "skip"]), "1");
        assert_eq!(outline.in_one_line(&["nothing"]), "");
    }

    #[test]
    fn what_is_no_yaml_has_no_outline() {
        for text in ["a: [", "a: b: c", "\t", "{{}: 1}"] {
            let source = Source::new("x", text);
            _ = Outline::of(&source).map(|outline| outline.nearest(&["a"]));
        }
    }
}
