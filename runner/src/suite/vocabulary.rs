//! The vocabulary that the suites of a folder share: the words of `words.yaml` and the named steps
//! of `steps.yaml`, including those of the folders above.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, LazyLock};

use super::built_in::standard;
use super::definition::Definitions;
use super::words::Words;
use crate::source::{Complaint, Source, Tree};

/// Words and named steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Vocabulary {
    /// Words.
    pub words: Words,
    /// Named steps.
    pub steps: Definitions,
}

/// Files, each as a tree.
pub(super) type Files = Vec<(Arc<Source>, Tree)>;

/// The vocabularies by their folders.
pub(super) struct Vocabularies {
    folders: BTreeMap<String, Vocabulary>,
    base: Vocabulary,
    /// The files with named steps.
    steps: Vec<(Arc<Source>, Definitions)>,
}

const WORDS: &str = "words.yaml";
const STEPS: &str = "steps.yaml";

/// The words that suites everywhere may use: those of CiA 301.
static STANDARD: LazyLock<Words> = LazyLock::new(|| {
    let mut words = Words::default();
    if let Some(source) = standard(WORDS)
        && let Ok(tree) = Tree::of(&source)
    {
        words.add(&source, &tree);
    }
    words
});

impl Vocabularies {
    /// Parts the files into vocabularies and suites.
    pub(super) fn of(files: Files) -> (Self, Files, Vec<Complaint>) {
        let is_suite = |tree: &Tree| tree.get("suite").is_some() || tree.get("cases").is_some();
        let (shared, suites): (Vec<_>, Vec<_>) =
            files.into_iter().partition(|(source, tree)| may_be_shared(source) && !is_suite(tree));
        let base = Vocabulary { words: STANDARD.clone(), steps: Definitions::default() };
        let mut all = Self { folders: BTreeMap::new(), base, steps: Vec::new() };
        let mut complaints = Vec::new();
        // A folder comes before those in it, and adds to what they have.
        let mut folders: Vec<&str> =
            shared.iter().map(|(source, _)| folder(&source.name)).collect();
        folders.sort_unstable_by_key(|folder| folder.len());
        folders.dedup();
        for of in folders {
            let mut vocabulary = all.at(of).clone();
            for (source, tree) in shared.iter().filter(|(source, _)| folder(&source.name) == of) {
                if source.name.ends_with(WORDS) {
                    complaints.extend(vocabulary.words.add(source, tree));
                } else {
                    let mut own = Definitions::default();
                    complaints.extend(own.add(source, tree));
                    vocabulary.steps.extend(&own);
                    all.steps.push((Arc::clone(source), own));
                }
            }
            all.folders.insert(of.to_owned(), vocabulary);
        }
        (all, suites, complaints)
    }

    /// The vocabulary for the file of that name.
    pub(super) fn at(&self, name: &str) -> &Vocabulary {
        let mut path = name;
        loop {
            if let Some(vocabulary) = self.folders.get(path) {
                return vocabulary;
            }
            if path.is_empty() {
                return &self.base;
            }
            path = folder(path);
        }
    }

    /// Named steps that no suite uses.
    pub(super) fn unused(&self, used: &BTreeSet<String>) -> Vec<Complaint> {
        let all = self.steps.iter().flat_map(|(source, steps)| {
            steps.iter().map(move |(name, definition)| (source, name, definition))
        });
        let unused = all.filter(|(_, name, _)| !used.contains(*name));
        let complaints = unused.map(|(source, name, definition)| {
            let message = format!("the steps `{name}` are never used");
            Complaint::at(source, definition.place, message)
        });
        complaints.collect()
    }
}

/// By its name; a suite may be named so as well.
pub(super) fn may_be_shared(source: &Arc<Source>) -> bool {
    let name = source.name.rsplit('/').next().unwrap_or_default();
    [WORDS, STEPS].contains(&name)
}

/// The files of words and named steps that a suite may use: in its folder and in those above.
pub fn beside(suite: &Path) -> Vec<PathBuf> {
    let leads_up = suite.components().any(|part| part == Component::ParentDir);
    let folders = suite.ancestors().skip(1);
    let folders = folders.filter(|folder| !(leads_up && folder.as_os_str().is_empty()));
    let files = folders.flat_map(|folder| [WORDS, STEPS].map(|file| folder.join(file)));
    files.filter(|file| file.is_file()).collect()
}

/// The folder of a path; that of a name alone is empty.
fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}
