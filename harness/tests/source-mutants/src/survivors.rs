//! The list of mutants that nobody notices, and why.

use std::collections::BTreeMap;
use std::path::Path;
use std::{fmt, fs};

use serde::Deserialize;

use crate::finder::{Key, Mutant};

/// Why nobody notices.
#[derive(Clone, Copy, Debug, Deserialize, Eq, Ord, PartialEq, PartialOrd)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// The device is the same.
    Equivalent,
    /// The device differs, but not on the bus, or only where the documents leave it open.
    Unobservable,
    /// A case would notice.
    Hole,
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Equivalent => "equivalent",
            Self::Unobservable => "unobservable",
            Self::Hole => "hole",
        })
    }
}

/// Changes of one function that survive for one reason.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    file: String,
    function: String,
    changes: Vec<String>,
    class: Class,
    why: String,
}

/// The list.
pub struct Survivors(BTreeMap<Key, (Class, String)>);

impl Survivors {
    /// Reads the list.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(path).map_err(|error| error.to_string())?;
        let entries: Vec<Entry> = serde_yaml::from_str(&text).map_err(|error| error.to_string())?;
        let mut list = BTreeMap::new();
        for entry in entries {
            for change in entry.changes {
                let key = (entry.file.clone(), entry.function.clone(), change);
                let reason = (entry.class, entry.why.clone());
                if let Some(twice) = list.insert(key.clone(), reason).map(|_| key) {
                    return Err(format!("{}: {} is listed twice", path.display(), twice.2));
                }
            }
        }
        Ok(Self(list))
    }

    /// What the list says about a mutant.
    pub fn get(&self, mutant: &Mutant) -> Option<&(Class, String)> {
        self.0.get(&mutant.key())
    }

    /// What is listed and does not exist.
    pub fn stale<'a>(&'a self, mutants: &'a [Mutant]) -> impl Iterator<Item = String> + 'a {
        let present: Vec<_> = mutants.iter().map(Mutant::key).collect();
        let listed = self.0.keys().filter(move |listed| !present.contains(listed));
        listed.map(|(file, function, change)| format!("{file} {function}: {change}"))
    }
}
