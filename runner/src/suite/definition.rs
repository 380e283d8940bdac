//! Named steps: the files `steps.yaml` of the folders, and the `define` part of a suite.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::source::Node;

use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Place, Source, Tree};

/// Steps that have a name.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    /// What they do, in a sentence.
    #[expect(dead_code, reason = "a sentence for people who read the file")]
    pub says: String,
    /// What they are given.
    pub takes: Vec<Taken>,
    /// The steps as they are written.
    pub steps: Vec<Tree>,
    /// Where the name stands.
    pub place: Place,
}

/// Something that named steps are given.
#[derive(Clone, Debug)]
pub(super) struct Taken {
    /// Its name.
    pub name: At<String>,
    /// What it is unless the steps are given another value.
    pub default: Option<Tree>,
}

/// Named steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Definitions {
    known: BTreeMap<String, Arc<Definition>>,
    /// Those that something is wrong with, which is said where they stand.
    wrong: BTreeSet<String>,
}

impl Definitions {
    /// Adds the named steps of a file, which go before those that are known.
    pub(super) fn add(&mut self, source: &Arc<Source>, tree: &Tree) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        if !matches!(tree.node, Node::Map(_)) {
            let message = "named steps belong here: `{ name: { says, takes, steps } }`";
            complaints.push(Complaint::at(source, tree.place, message));
        }
        for (name, content) in tree.entries() {
            match definition(name, content) {
                Err((place, message)) => {
                    complaints.push(Complaint::at(source, place, message));
                    self.wrong.insert(name.value.clone());
                }
                Ok(definition) => {
                    for Taken { name, .. } in &definition.takes {
                        if !definition.steps.iter().any(|step| step.mentions(&name.value)) {
                            let message = format!("no step uses ${}", name.value);
                            complaints.push(Complaint::at(source, name.place, message));
                        }
                    }
                    self.known.insert(name.value.clone(), Arc::new(definition));
                }
            }
        }
        complaints
    }

    /// Adds others, which go before those that are known.
    pub(super) fn extend(&mut self, others: &Self) {
        let known = others.known.iter().map(|(name, steps)| (name.clone(), Arc::clone(steps)));
        self.known.extend(known);
        self.wrong.extend(others.wrong.iter().cloned());
    }

    /// Whether steps of that name are defined, and something is wrong with the definition.
    pub(super) fn has_wrong(&self, name: &str) -> bool {
        self.wrong.contains(name)
    }

    /// The steps of that name.
    pub(super) fn get(&self, name: &str) -> Option<&Definition> {
        self.known.get(name).map(AsRef::as_ref)
    }

    /// All of them by their names.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Definition)> {
        self.known.iter().map(|(name, definition)| (name.as_str(), definition.as_ref()))
    }
}

/// The keys of named steps.
pub(super) const KEYS: [&str; 3] = ["says", "takes", "steps"];

/// The known key nearest to an unknown one, or else all known keys.
pub(super) fn unknown_key(key: &str, known: &[&str]) -> String {
    let meant = did_you_mean(key, known.iter().copied());
    match meant.is_empty() {
        true => format!("unknown key `{key}`: there is {}", known.join(", ")),
        false => format!("unknown key `{key}`{meant}"),
    }
}

fn definition(name: &At<String>, content: &Tree) -> Result<Definition, (Place, String)> {
    for (key, _) in content.entries() {
        if !KEYS.contains(&key.value.as_str()) {
            return Err((key.place, unknown_key(&key.value, &KEYS)));
        }
    }
    let says = content.get("says").and_then(Tree::text);
    let says = says.ok_or_else(|| (name.place, format!("`{}` has no `says`", name.value)))?;
    let takes = match content.get("takes").map(|takes| (&takes.node, takes.place)) {
        None => Vec::new(),
        Some((Node::List(names), _)) => names.iter().map(taken).collect::<Result<_, _>>()?,
        Some((_, place)) => return Err((place, TAKES.to_owned())),
    };
    let steps = match content.get("steps").map(|steps| (&steps.node, steps.place)) {
        Some((Node::List(steps), _)) => steps.clone(),
        Some((_, place)) => return Err((place, "a list of steps belongs here".to_owned())),
        None => return Err((name.place, format!("`{}` has no `steps`", name.value))),
    };
    Ok(Definition { says: says.to_owned(), takes, steps, place: name.place })
}

const TAKES: &str = "a list of names belongs here, those with a default as `{ name: default }`";

fn taken(tree: &Tree) -> Result<Taken, (Place, String)> {
    match (&tree.node, tree.text()) {
        (Node::Map(entries), _) if entries.len() == 1 => {
            let (name, default) = entries[0].clone();
            Ok(Taken { name, default: Some(default) })
        }
        (_, Some(name)) => Ok(Taken { name: At::new(name.to_owned(), tree.place), default: None }),
        _ => Err((tree.place, TAKES.to_owned())),
    }
}
