//! Loading suite and register files.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use reports::ToolCheck;

use super::built_in::{built_in, is_built_in};
use super::constraint::assertion_name;
use super::dimension::{Dimension, Extent};
use super::expand::{Expanded, expand};
use super::loaded::Suite;
use super::model::{Case, SuiteFile};
use super::register::{Register, Relaxation};
use super::step::Step;
use super::test_map::{TestMapEntry, wrong_map};
use super::vocabulary::{Files, Vocabularies, Vocabulary, may_be_shared};
use super::words::Words;
use crate::nearest::did_you_mean;
use crate::parallel::{self, processors};
use crate::source::{At, Complaint, Source, Tree, read_tree, read_yaml};

/// Everything in `suites/`.
#[derive(Debug)]
pub struct Library {
    /// The suites, by name.
    pub suites: Vec<Arc<Suite>>,
    /// The requirements.
    pub register: Arc<Register>,
    /// The profiles.
    pub catalogue: Arc<Catalogue>,
    /// The checks of CiA's conformance test, when the folder has the list of them.
    pub test_map: Vec<At<TestMapEntry>>,
}

impl Library {
    /// Loads register and suites out of these files, with these profiles.
    ///
    /// # Errors
    /// Every complaint about every file.
    pub fn from_sources(
        sources: &[Arc<Source>],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, Vec<Complaint>> {
        Self::of_sources(sources, catalogue, false)
    }

    /// The same of some suites of folders. Others there may use the rest of the named steps, and
    /// prove what these rely on.
    ///
    /// # Errors
    /// As [`from_sources`](Self::from_sources).
    pub fn from_part(
        sources: &[Arc<Source>],
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, Vec<Complaint>> {
        Self::of_sources(sources, catalogue, true)
    }

    /// The requirements that the cases rely on.
    pub fn relied_on(&self) -> BTreeSet<&str> {
        let of_suites = self.suites.iter().flat_map(|suite| &suite.file.relies_on);
        let cases = self.suites.iter().flat_map(|suite| &suite.file.cases);
        let of_cases = cases.flat_map(|case| &case.value.relies_on);
        of_suites.chain(of_cases).map(|id| &*id.value).collect()
    }

    fn of_sources(
        sources: &[Arc<Source>],
        catalogue: &Arc<Catalogue>,
        is_part: bool,
    ) -> Result<Self, Vec<Complaint>> {
        let (maps, sources): (Vec<_>, Vec<_>) = sources.iter().cloned().partition(is_test_map);
        let (registers, suites): (Vec<_>, Vec<_>) = sources.into_iter().partition(is_register);
        let mut complaints = Vec::new();
        let mut test_map = Vec::new();
        for source in maps {
            match read_yaml::<Vec<At<TestMapEntry>>>(&source) {
                Ok(entries) => test_map.push((source, entries)),
                Err(complaint) => complaints.push(complaint),
            }
        }
        let register = Register::load(&registers).unwrap_or_else(|mut wrong| {
            complaints.append(&mut wrong);
            Register::default()
        });
        let register_is_whole = complaints.is_empty();
        let rest = Rest { test_map, complaints, register_is_whole, is_part };
        Self::with(Arc::new(register), rest, suites, catalogue)
    }

    /// Loads these suites, with a register that is loaded.
    ///
    /// # Errors
    /// Every complaint about every file.
    pub fn with_register(
        register: Arc<Register>,
        suites: Vec<Arc<Source>>,
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, Vec<Complaint>> {
        let (test_map, complaints) = (Vec::new(), Vec::new());
        let rest = Rest { test_map, complaints, register_is_whole: true, is_part: false };
        Self::with(register, rest, suites, catalogue)
    }

    /// The suites and the register in this crate, with the profiles of the built-in catalogue.
    ///
    /// # Errors
    /// Every complaint about every file.
    pub fn built_in() -> Result<Self, Vec<Complaint>> {
        let sources: Vec<_> = built_in().into_iter().map(Arc::new).collect();
        Self::from_sources(&sources, Catalogue::built_in())
    }

    /// The checks of CiA's conformance test tool, as reports show them.
    pub fn tool_checks(&self) -> Vec<ToolCheck> {
        let entries = self.test_map.iter().map(|entry| &entry.value);
        entries.map(TestMapEntry::told).collect()
    }

    /// The state of a requirement in each dimension: the requirements that extend it, and the cases
    /// that are made for each of something the device has.
    pub fn extents(&self, id: &str) -> Option<BTreeMap<Dimension, Extent>> {
        let mut extents = self.register.extents(id)?;
        if let Some(Extent::Applies(by)) = extents.get_mut(&Dimension::Second) {
            for suite in &self.suites {
                let cases = suite.file.cases.iter().map(|case| &case.value);
                let tries = |case: &&Case| {
                    case.each.as_ref().is_some_and(|each| each.value.is_of_several())
                        && case.checks.iter().any(|check| check.value == id)
                };
                let names = cases.filter(tries);
                by.extend(names.map(|case| format!("{}/{}", suite.name(), case.id.value)));
            }
        }
        Some(extents)
    }

    fn with(
        register: Arc<Register>,
        rest: Rest,
        suites: Vec<Arc<Source>>,
        catalogue: &Arc<Catalogue>,
    ) -> Result<Self, Vec<Complaint>> {
        let Rest { test_map, mut complaints, register_is_whole, is_part } = rest;
        let mut loaded = Vec::new();
        let (shared, suites): (Vec<_>, Vec<_>) = suites.into_iter().partition(may_be_shared);
        let (shared, wrong) = trees(shared);
        let mut suites_are_whole = wrong.is_empty();
        complaints.extend(wrong);
        let (vocabularies, named_alike, wrong) = Vocabularies::of(shared);
        complaints.extend(wrong);
        let named_alike = named_alike.into_iter().map(|(source, _)| source);
        // A tree takes many times the memory of its text: there is one at a time on each processor.
        let files = parallel::map(named_alike.chain(suites).collect(), processors(), |source| {
            let file = read_suite(&source, vocabularies.at(&source.name));
            (file, source)
        });
        let mut used = BTreeSet::new();
        for (file, source) in files {
            match file {
                Ok((file, names, words)) => {
                    let catalogue = Arc::clone(catalogue);
                    let path = source.name.as_str().into();
                    let is_built_in = is_built_in(&source);
                    let suite = Suite { source, path, file, catalogue, words, is_built_in };
                    complaints.extend(unknown_profiles(&suite));
                    used.extend(names);
                    loaded.push(Arc::new(suite));
                }
                Err(wrong) => {
                    suites_are_whole = false;
                    complaints.extend(wrong);
                }
            }
        }
        if suites_are_whole && !is_part {
            complaints.extend(vocabularies.unused(&used));
        }
        complaints.extend(reused_ids(&loaded));
        complaints.extend(needless_excuses(&loaded));
        if register_is_whole {
            complaints.extend(unknown_requirements(&loaded, &register));
            complaints.extend(unknown_relaxations(&register));
            complaints.extend(register.wrong_extensions());
        }
        // A missing item may be in a suite that does not load, or is not read.
        if register_is_whole && suites_are_whole {
            complaints.extend(unproved(&loaded, &register, is_part));
        }
        let suites_are_whole = suites_are_whole && !is_part;
        complaints.extend(wrong_map(&test_map, if suites_are_whole { &loaded } else { &[] }));
        let test_map = test_map.into_iter().flat_map(|(_, entries)| entries).collect();
        if complaints.is_empty() {
            let catalogue = Arc::clone(catalogue);
            Ok(Self { suites: loaded, register, catalogue, test_map })
        } else {
            Err(complaints)
        }
    }
}

/// A suite, with the names of the steps that it uses and the words for its objects.
fn read_suite(
    source: &Arc<Source>,
    vocabulary: &Vocabulary,
) -> Result<(SuiteFile, BTreeSet<String>, Words), Vec<Complaint>> {
    let tree = Tree::of(source).map_err(|complaint| vec![complaint])?;
    let Expanded { tree, used, named } = expand(source, tree, vocabulary)?;
    let file = read_tree::<SuiteFile>(source, &tree).map_err(|complaint| vec![complaint])?;
    Ok((file, used, vocabulary.words.named_as(named)))
}

/// The files as trees, and what is wrong with those that are no YAML.
pub(super) fn trees(sources: Vec<Arc<Source>>) -> (Files, Vec<Complaint>) {
    let read = parallel::map(sources, processors(), |source| (Tree::of(&source), source));
    let (mut trees, mut wrong) = (Vec::new(), Vec::new());
    for (tree, source) in read {
        match tree {
            Ok(tree) => trees.push((source, tree)),
            Err(complaint) => wrong.push(complaint),
        }
    }
    (trees, wrong)
}

/// The files that are read before the suites.
struct Rest {
    test_map: Vec<(Arc<Source>, Vec<At<TestMapEntry>>)>,
    complaints: Vec<Complaint>,
    register_is_whole: bool,
    /// Not all suites are read that may use named steps.
    is_part: bool,
}

/// Whether this is a file of the register.
pub fn is_register(source: &Arc<Source>) -> bool {
    source.name.contains("requirements/") && !is_test_map(source)
}

/// Whether this is a suite, by its name: no file of the register, of words or of named steps.
pub fn is_suite(source: &Arc<Source>) -> bool {
    !source.name.contains("requirements/") && !may_be_shared(source)
}

/// The list of checks that the conformance test of CiA makes, and what makes them here.
pub(super) fn is_test_map(source: &Arc<Source>) -> bool {
    source.name.ends_with("requirements/cia-test-map.yaml")
}

/// The profiles that a suite and its steps name are in the catalogue.
fn unknown_profiles(suite: &Suite) -> Vec<Complaint> {
    let steps = suite.file.cases.iter().flat_map(|case| case.value.all_steps());
    let of_steps = steps.filter_map(|step| match &step.value {
        Step::Undeclared(undeclared) => undeclared.profile.as_ref(),
        _ => None,
    });
    let named = suite.file.profile.iter().chain(of_steps);
    let wrong = named.filter_map(|about| {
        let message = about.value.named(&suite.catalogue).err()?;
        Some(Complaint::at(&suite.source, about.place, message))
    });
    wrong.collect()
}

fn reused_ids(suites: &[Arc<Suite>]) -> Vec<Complaint> {
    let (mut complaints, mut names) = (Vec::new(), BTreeMap::new());
    for suite in suites {
        let name = &suite.file.suite;
        if let Some(first) = names.insert(&*name.value, suite) {
            let message = format!(
                "the suite name `{}` is used twice: {} has it",
                name.value, first.source.name
            );
            complaints.push(Complaint::at(&suite.source, name.place, message));
        }
        if !suite.source.name.ends_with(&format!("{}.yaml", name.value)) {
            let message =
                format!("a suite is named after its file, which is not {}.yaml", name.value);
            complaints.push(Complaint::at(&suite.source, name.place, message));
        }
        let mut ids: BTreeMap<&str, &At<Case>> = BTreeMap::new();
        for case in &suite.file.cases {
            let id = &case.value.id;
            if let Some(first) = ids.insert(&id.value, case) {
                let message = format!(
                    "the id `{}` is used twice: the case in line {} has it",
                    id.value, first.place.line
                );
                complaints.push(Complaint::at(&suite.source, id.place, message));
            }
        }
    }
    complaints
}

/// An excuse of a case must name one of its assertions.
fn needless_excuses(suites: &[Arc<Suite>]) -> Vec<Complaint> {
    let mut complaints = Vec::new();
    for suite in suites {
        let excusing = suite.file.cases.iter().filter(|case| !case.value.unproved.is_empty());
        for At { value: case, .. } in excusing {
            let known = case.assertions().map(|(step, one)| assertion_name(step, one.as_ref()));
            let known: Vec<String> = known.collect();
            for (name, reason) in case.unproved.iter().filter(|(name, _)| !known.contains(name)) {
                let meant = did_you_mean(name, known.iter().map(String::as_str));
                let message = format!("the case asserts nothing that is named `{name}`{meant}");
                complaints.push(Complaint::at(&suite.source, reason.place, message));
            }
        }
    }
    complaints
}

fn unknown_requirements(suites: &[Arc<Suite>], register: &Register) -> Vec<Complaint> {
    let mut complaints = Vec::new();
    for suite in suites {
        for case in &suite.file.cases {
            if case.value.checks.is_empty() {
                let message = format!("case {} checks no requirement", case.value.id.value);
                complaints.push(Complaint::at(&suite.source, case.value.id.place, message));
            }
            for id in case.value.checks.iter().filter(|id| register.find(&id.value).is_none()) {
                let ids = register.iter().map(|(id, _)| id);
                let meant = match is_of_program(&id.value) && register.lacks_document_of(&id.value)
                {
                    true => "; `--only-suites` leaves out the register of this program, and \
                             `--suites` keeps it"
                        .to_owned(),
                    false => did_you_mean(&id.value, ids),
                };
                let message = format!("no requirement `{}` in the register{meant}", id.value);
                complaints.push(Complaint::at(&suite.source, id.place, message));
            }
        }
    }
    complaints
}

/// Whether an id looks like one of the documents of CiA and EUROMAP, which this program has.
fn is_of_program(id: &str) -> bool {
    ["CIA301-", "CIA305-", "CIA306-", "CIA401-", "EM66-"].iter().any(|start| id.starts_with(start))
}

/// A relaxation must name a requirement, as far as its document is loaded.
fn unknown_relaxations(register: &Register) -> Vec<Complaint> {
    let unknown = register.relaxations().iter().filter(|relaxation| {
        let id = &relaxation.requirement.value;
        register.find(id).is_none() && !register.lacks_document_of(id)
    });
    let complain = |relaxation: &Relaxation| {
        let At { value: id, place } = &relaxation.requirement;
        let meant = did_you_mean(id, register.iter().map(|(id, _)| id));
        let message = format!("no requirement `{id}` in the register{meant}");
        Complaint::at(&relaxation.source, *place, message)
    };
    unknown.map(complain).collect()
}

/// A case must rely on a requirement that another case proves, which may be in a suite that is not
/// read where these are a part.
fn unproved(suites: &[Arc<Suite>], register: &Register, is_part: bool) -> Vec<Complaint> {
    let cases = || suites.iter().flat_map(|suite| suite.file.cases.iter());
    let checked: BTreeSet<&str> =
        cases().flat_map(|case| &case.value.checks).map(|id| id.value.as_str()).collect();
    let mut complaints = Vec::new();
    for suite in suites {
        let of_cases = suite.file.cases.iter().flat_map(|case| &case.value.relies_on);
        for id in suite.file.relies_on.iter().chain(of_cases) {
            let known = register.find(&id.value).is_some();
            if checked.contains(id.value.as_str())
                || known && is_part
                || !known && register.lacks_document_of(&id.value)
            {
                continue;
            }
            let message = match known {
                true => format!("no case checks `{}`, so nothing can tell that it holds", id.value),
                false => {
                    let meant = did_you_mean(&id.value, register.iter().map(|(id, _)| id));
                    format!("no requirement `{}` in the register{meant}", id.value)
                }
            };
            complaints.push(Complaint::at(&suite.source, id.place, message));
        }
    }
    complaints
}
