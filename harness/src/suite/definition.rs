//! Named steps: the files `steps.yaml` of the folders, and what a suite has under `define`.

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::source::Node;

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
pub(super) struct Definitions(BTreeMap<String, Arc<Definition>>);

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
                Err((place, message)) => complaints.push(Complaint::at(source, place, message)),
                Ok(definition) => {
                    for Taken { name, .. } in &definition.takes {
                        if !definition.steps.iter().any(|step| step.mentions(&name.value)) {
                            let message = format!("no step uses ${}", name.value);
                            complaints.push(Complaint::at(source, name.place, message));
                        }
                    }
                    self.0.insert(name.value.clone(), Arc::new(definition));
                }
            }
        }
        complaints
    }

    /// Adds others, which go before those that are known.
    pub(super) fn extend(&mut self, others: &Self) {
        let others = others.0.iter().map(|(name, steps)| (name.clone(), Arc::clone(steps)));
        self.0.extend(others);
    }

    /// The steps of that name.
    pub(super) fn get(&self, name: &str) -> Option<&Definition> {
        self.0.get(name).map(AsRef::as_ref)
    }

    /// All of them by their names.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Definition)> {
        self.0.iter().map(|(name, definition)| (name.as_str(), definition.as_ref()))
    }
}

fn definition(name: &At<String>, content: &Tree) -> Result<Definition, (Place, String)> {
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
    for (key, _) in content.entries() {
        if !["says", "takes", "steps"].contains(&key.value.as_str()) {
            let message = format!("unknown key `{}`: there is says, takes, steps", key.value);
            return Err((key.place, message));
        }
    }
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
