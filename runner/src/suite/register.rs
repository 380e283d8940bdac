//! The requirement register: every testable statement of every document, once.

use std::collections::BTreeMap;
use std::sync::Arc;

use reports::Check;
use schemars::JsonSchema;
use serde::Deserialize;

use super::dimension::{Dimension, Extent, Lack, Lacks, lacking};
use super::step::Nmt;
use crate::nearest::did_you_mean;
use crate::parallel::{self, processors};
use crate::source::{At, Complaint, Source, read_yaml};

/// Every requirement by its id.
#[derive(Debug, Default)]
pub struct Register {
    requirements: BTreeMap<Arc<str>, Requirement>,
    decisions: BTreeMap<String, Decision>,
    relaxations: Vec<Relaxation>,
}

/// A decision with the file that contains it.
#[derive(Debug)]
struct Decision {
    source: Arc<Source>,
    entry: InterpretationEntry,
}

/// One statement of a document, in our own words.
#[derive(Debug)]
pub struct Requirement {
    /// Its id.
    pub id: Arc<str>,
    /// The document's key, such as `cia301`.
    pub document: String,
    /// What the document calls itself.
    pub title: Arc<str>,
    /// The file that contains it.
    pub source: Arc<Source>,
    /// The entry.
    pub entry: At<RequirementEntry>,
    /// The dimensions that do not apply to it; `None` of a document that does not note them.
    lacks: Option<Lacks>,
}

/// A requirement of another document that is no more than a `should` for a device, since the
/// device's own document says otherwise or can be read otherwise.
#[derive(Debug)]
pub(crate) struct Relaxation {
    /// The in-tree device whose document it is.
    pub(crate) device: String,
    /// The requirement.
    pub(crate) requirement: At<String>,
    /// The decision that says so.
    pub(crate) by: String,
    /// Whether the document demands the opposite, so that a case about it is not run.
    pub(crate) contradicts: bool,
    /// The file that contains it.
    pub(crate) source: Arc<Source>,
}

/// A register file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RegisterFile {
    /// The document's key, such as `cia301`.
    pub document: String,
    /// What the document calls itself.
    pub title: Arc<str>,
    /// The in-tree device whose manual this is. What its interpretations relax is relaxed for
    /// devices of that vendor and product only.
    #[serde(default)]
    pub device: Option<String>,
    /// Instead of `device`, those whose manuals share these clauses.
    #[serde(default)]
    pub devices: Vec<String>,
    /// Decisions where the document contradicts itself or leaves room.
    #[serde(default)]
    pub interpretations: Vec<At<InterpretationEntry>>,
    /// Which dimensions do not apply to which statements. Where it is missing, nobody has gone
    /// through the document for them.
    #[serde(default)]
    pub dimensions: Vec<At<Lack>>,
    /// The statements.
    #[serde(default)]
    pub requirements: Vec<At<RequirementEntry>>,
}

/// One statement.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RequirementEntry {
    /// Unique id.
    pub id: At<String>,
    /// Clause of the document.
    pub clause: Arc<str>,
    /// How binding it is.
    pub level: Level,
    /// The statement, one sentence.
    pub says: Arc<str>,
    /// How an ambiguity was decided, or the id of the decision.
    #[serde(default)]
    pub interpretation: Option<String>,
    /// The document's own word for a level that is no must, such as `recommended` or `may`.
    #[serde(default)]
    pub worded: Option<String>,
    /// Why no test can check it.
    #[serde(default)]
    pub untestable: Option<String>,
    /// The requirements that this one extends, each with the dimension.
    #[serde(default)]
    pub extends: BTreeMap<String, At<Dimension>>,
    /// The NMT command whose effect this is: where it does not hold, what a case finds after that
    /// command follows from it.
    #[serde(default)]
    pub effect_of: Option<Nmt>,
}

impl RequirementEntry {
    /// What is wrong with the level: one that is no must needs a decision about this statement, or
    /// the document's own word; a must has no such word.
    pub fn wrong_level(&self) -> Option<&'static str> {
        match (self.level, &self.interpretation, &self.worded) {
            (Level::Must, _, Some(_)) => Some("a must that is worded otherwise"),
            (Level::Must, ..) | (_, Some(_), _) | (.., Some(_)) => None,
            (Level::Should | Level::May, None, None) => {
                Some("no must: an `interpretation` says why, or `worded` what its document says")
            }
        }
    }
}

/// One decision.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct InterpretationEntry {
    /// Unique id.
    pub id: At<String>,
    /// Clause of the document.
    pub clause: String,
    /// What contradicts what, or what is left open.
    pub conflict: String,
    /// How it was decided.
    pub decision: String,
    /// Why.
    pub reason: String,
    /// Requirements of other documents that are no more than a `should` for the device whose manual
    /// this is: a case that checks nothing else is LENIENT instead of FAIL on it.
    #[serde(default)]
    pub relaxes: Vec<At<String>>,
    /// Requirements of other documents of which the manual demands the opposite: a case that checks
    /// one is skipped on the device.
    #[serde(default)]
    pub contradicts: Vec<At<String>>,
}

/// How binding a statement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// A conformant device does it.
    Must,
    /// Recommended.
    Should,
    /// Optional.
    May,
}

impl Level {
    /// The word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Must => "must",
            Self::Should => "should",
            Self::May => "may",
        }
    }
}

impl Register {
    /// Loads register files.
    ///
    /// # Errors
    /// What is wrong with the files: unreadable, or an id of a requirement or decision used twice.
    pub fn load(sources: &[Arc<Source>]) -> Result<Self, Vec<Complaint>> {
        let (mut register, mut complaints) = (Self::default(), Vec::new());
        let files = parallel::map(sources.iter().collect(), processors(), |source| {
            (read_yaml::<RegisterFile>(source), source)
        });
        for (file, source) in files {
            match file {
                Ok(file) => register.add(source, file, &mut complaints),
                Err(complaint) => complaints.push(complaint),
            }
        }
        if complaints.is_empty() { Ok(register) } else { Err(complaints) }
    }

    /// The state of a requirement in each dimension, as far as the requirements say it: `None` if
    /// it is untestable or extends another one, or if its document has no notes.
    pub(crate) fn extents(&self, id: &str) -> Option<BTreeMap<Dimension, Extent>> {
        let requirement = self.find(id)?;
        let lacks = requirement.lacks.as_ref()?;
        let entry = &requirement.entry.value;
        if entry.untestable.is_some() || !entry.extends.is_empty() {
            return None;
        }
        let mut by: BTreeMap<Dimension, Vec<String>> = BTreeMap::new();
        for (other, requirement) in self.iter() {
            if let Some(dimension) = requirement.entry.value.extends.get(id) {
                by.entry(dimension.value).or_default().push(other.to_owned());
            }
        }
        let mut extent = |dimension| match lacks.get(&dimension) {
            Some(why) => Extent::Lacks(why.value.clone()),
            None => Extent::Applies(by.remove(&dimension).unwrap_or_default()),
        };
        let of_each = Dimension::ALL.map(|dimension| (dimension, extent(dimension)));
        Some(of_each.into())
    }

    /// A requirement can only extend an existing one, as far as its document is loaded, and the
    /// dimension must apply to it.
    pub(super) fn wrong_extensions(&self) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        for (by, requirement) in self.iter() {
            for (id, At { value: dimension, place }) in &requirement.entry.value.extends {
                let lacks = self.find(id).and_then(|found| found.lacks.as_ref());
                let message = match lacks.and_then(|lacks| lacks.get(dimension)) {
                    Some(why) => format!(
                        "{by} extends {id} in a dimension that does not apply to it: {}",
                        why.value
                    ),
                    None if self.find(id).is_none() && !self.lacks_document_of(id) => {
                        let meant = did_you_mean(id, self.iter().map(|(id, _)| id));
                        format!("no requirement `{id}` in the register{meant}")
                    }
                    None => continue,
                };
                complaints.push(Complaint::at(&requirement.source, *place, message));
            }
        }
        complaints
    }

    /// The requirement with that id.
    pub fn find(&self, id: &str) -> Option<&Requirement> {
        self.requirements.get(id)
    }

    /// The requirement with that id, as a report has it; no decision of a manual relaxes it.
    pub fn check(&self, id: &str) -> Option<Check> {
        let requirement = self.find(id)?;
        let entry = &requirement.entry.value;
        Some(Check {
            id: Arc::clone(&requirement.id),
            document: Arc::clone(&requirement.title),
            clause: Arc::clone(&entry.clause),
            level: entry.level.name().into(),
            relaxed_by: None,
            decided: entry.interpretation.as_deref().map(|id| self.decided(id)),
            says: Arc::clone(&entry.says),
        })
    }

    /// A decision with its id; of a requirement that says it itself, as it is.
    fn decided(&self, interpretation: &str) -> Arc<str> {
        match self.decision(interpretation) {
            Some(decision) => format!("{interpretation}: {}", decision.decision).into(),
            None => interpretation.into(),
        }
    }

    /// Whether a requirement of that id may be missing because its document is not loaded: neither
    /// a requirement nor a decision has an id that begins alike.
    pub fn lacks_document_of(&self, id: &str) -> bool {
        let document = |id: &str| id.split('-').next().unwrap_or_default().to_owned();
        let requirements = self.requirements.keys().map(|known| &**known);
        let mut known = requirements.chain(self.decision_ids());
        known.all(|known| document(known) != document(id))
    }

    /// The decision with that id.
    pub fn decision(&self, id: &str) -> Option<&InterpretationEntry> {
        self.decisions.get(id).map(|decision| &decision.entry)
    }

    /// The ids of the decisions.
    pub fn decision_ids(&self) -> impl Iterator<Item = &str> {
        self.decisions.keys().map(String::as_str)
    }

    /// The relaxations by documents of devices.
    pub(crate) fn relaxations(&self) -> &[Relaxation] {
        &self.relaxations
    }

    /// The devices for which the requirement is no must, each with the decision that says so.
    pub fn relaxed(&self, id: &str) -> impl Iterator<Item = (&str, &str)> {
        let of_it = self.relaxations.iter().filter(move |found| found.requirement.value == id);
        of_it.map(|found| (found.device.as_str(), found.by.as_str()))
    }

    /// The requirements that are the effect of an NMT command, with that command.
    pub(crate) fn effects(&self) -> impl Iterator<Item = (Nmt, &Arc<str>)> {
        let of = |known: &Requirement| known.entry.value.effect_of;
        self.requirements.iter().filter_map(move |(id, known)| Some((of(known)?, id)))
    }

    /// Every requirement, by id.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Requirement)> {
        self.requirements.iter().map(|(id, requirement)| (&**id, requirement))
    }

    fn add(&mut self, source: &Arc<Source>, file: RegisterFile, complaints: &mut Vec<Complaint>) {
        for At { value: decision, .. } in file.interpretations {
            let relaxed = decision.relaxes.iter().map(|requirement| (requirement, false));
            let opposed = decision.contradicts.iter().map(|requirement| (requirement, true));
            for (requirement, contradicts) in relaxed.chain(opposed) {
                let mut devices = file.device.iter().chain(&file.devices).peekable();
                if devices.peek().is_none() {
                    let message = "a document relaxes others for its device, and none is named at \
                                   the top: `device`";
                    complaints.push(Complaint::at(source, requirement.place, message));
                }
                self.relaxations.extend(devices.map(|device| Relaxation {
                    device: device.clone(),
                    requirement: requirement.clone(),
                    by: decision.id.value.clone(),
                    contradicts,
                    source: Arc::clone(source),
                }));
            }
            if let Some(twice) = self.used_twice(source, &decision.id) {
                complaints.push(twice);
                continue;
            }
            let (id, source) = (decision.id.value.clone(), Arc::clone(source));
            self.decisions.insert(id, Decision { source, entry: decision });
        }
        let ids: Vec<_> =
            file.requirements.iter().map(|entry| entry.value.id.value.clone()).collect();
        let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
        let mut lacks = lacking(source, &file.dimensions, &ids, complaints);
        for entry in file.requirements {
            let id = &entry.value.id;
            if let Some(twice) = self.used_twice(source, id) {
                complaints.push(twice);
                continue;
            }
            let id: Arc<str> = id.value.as_str().into();
            let requirement = Requirement {
                id: Arc::clone(&id),
                document: file.document.clone(),
                title: Arc::clone(&file.title),
                source: Arc::clone(source),
                lacks: (!file.dimensions.is_empty())
                    .then(|| lacks.remove(&*id).unwrap_or_default()),
                entry,
            };
            self.requirements.insert(id, requirement);
        }
    }

    /// A complaint when a requirement or a decision has the id already: freedoms name both alike.
    fn used_twice(&self, source: &Arc<Source>, id: &At<String>) -> Option<Complaint> {
        let requirement = self.requirements.get(id.value.as_str());
        let requirement =
            requirement.map(|known| ("requirement", &known.source, &known.entry.place));
        let decision = self.decisions.get(&id.value);
        let decision = decision.map(|known| ("decision", &known.source, &known.entry.id.place));
        let (what, first, place) = requirement.or(decision)?;
        let message = format!(
            "the id `{}` is used twice: the {what} in {}:{} has it",
            id.value, first.name, place.line
        );
        Some(Complaint::at(source, id.place, message))
    }
}
