//! Waivers: causes that are known, each with the reason why a run is green all the same.
//!
//! Waivers must stay true: one whose cause is gone, that names no case or that has expired is
//! reported, and ends the run with an exit code of its own.

use std::borrow::Cow;
use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use reports::{CaseRun, CaseStarted, Cause, Outcome, Run, Verdict, Waiver};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use wildmatch::WildMatch;

use crate::nearest::did_you_mean;
use crate::plan::is_named;
use crate::source::{At, Complaint, Place, Source, read_yaml};
use crate::suite::Register;

/// The suite whose cases are the causes of what fuzzing found: a run has none of them.
pub const CAMPAIGN: &str = "fuzz";

/// The reason that stands for one until somebody writes it.
pub const UNEXPLAINED: &str = "not explained yet";

/// What is waived in a run.
#[derive(Debug, Default)]
pub struct Waivers {
    source: Arc<Source>,
    entries: Vec<At<WaiverEntry>>,
    /// The date of the run, such as `2026-01-31`.
    today: String,
}

/// A file of waivers.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct WaiverFile(pub Vec<At<WaiverEntry>>);

/// One waiver.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct WaiverEntry {
    /// The cases: one glob or a list of globs over full names. The name of a suite or of a case
    /// stands for all its instances.
    cases: Globs,
    /// The device as reports call it, a glob; every device when absent.
    #[serde(default)]
    device: Option<String>,
    /// Only what has this cause, or one of these; without it, whatever the cases find.
    #[serde(default)]
    cause: Causes,
    /// Only what has this verdict.
    #[serde(default)]
    verdict: Option<WaivedVerdict>,
    /// Why it is accepted, in a sentence.
    reason: At<String>,
    /// The person or team that answers for it.
    #[serde(default)]
    owner: Option<String>,
    /// The last day on which it holds, such as `2026-12-31`.
    #[serde(default)]
    expires: Option<At<String>>,
    /// The cause does not occur in each run, as of a race: its absence is no error.
    #[serde(default)]
    sometimes: bool,
}

/// The parts of a cause, as the summary of a run and the journal say them. All are globs.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct CauseEntry {
    /// The requirement that is checked; of several, all ids with blanks between them.
    #[serde(default)]
    requirement: Option<At<String>>,
    /// The object, such as `1017:00`; `18xx:01` is that of each TPDO.
    #[serde(default)]
    object: Option<String>,
    /// What was expected and what came, such as `*came accepted`.
    #[serde(default)]
    text: Option<String>,
}

/// A verdict that can be waived.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum WaivedVerdict {
    /// FAIL, and FLAKY: what fails may pass now and then.
    Fail,
    /// FLAKY alone; that it does not occur in each run is no error.
    Flaky,
    /// ERROR.
    Error,
    /// LENIENT.
    Lenient,
}

/// What runs say of a waiver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Need {
    /// It covers something.
    Needed,
    /// It may cover something: why that is not decided.
    Undecided(String),
    /// It covers nothing: why not.
    Needless(String),
}

/// One glob or several.
#[derive(Debug)]
struct Globs(Vec<At<String>>);

/// One cause or several, as of a fact that shows in cases about several requirements.
#[derive(Debug, Default)]
struct Causes(Vec<At<CauseEntry>>);

impl Waivers {
    /// Reads a file of waivers.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn read(
        source: Arc<Source>,
        today: &str,
        register: &Register,
    ) -> Result<Self, Vec<Complaint>> {
        let WaiverFile(entries) = read_yaml(&source).map_err(|complaint| vec![complaint])?;
        let wrong = entries.iter().flat_map(|entry| entry.value.wrong(&source, register));
        let complaints: Vec<Complaint> = wrong.collect();
        match complaints.is_empty() {
            true => Ok(Self { source, entries, today: today.to_owned() }),
            false => Err(complaints),
        }
    }

    /// The outcome of a case, waived when it has a cause that is known.
    pub fn apply(&self, device: &str, case: &CaseStarted, outcome: Outcome) -> Outcome {
        if self.entries.is_empty() {
            return outcome;
        }
        let Some(cause) = Cause::of(&case.requirement_ids(), &outcome) else { return outcome };
        let (name, verdict) = (case.name(), outcome.verdict());
        let mut valid = self.entries.iter().map(|entry| &entry.value);
        let covering = valid.find(|waiver| {
            !waiver.has_expired(&self.today)
                && waiver.concerns(device)
                && waiver.covers(&name, verdict, &cause)
        });
        match covering {
            Some(waiver) => Outcome::Waived {
                outcome: Box::new(outcome),
                waiver: Box::new(Waiver {
                    reason: waiver.reason.value.trim().to_owned(),
                    owner: waiver.owner.clone(),
                    expires: waiver.expires.as_ref().map(|date| date.value.clone()),
                }),
            },
            None => outcome,
        }
    }

    /// The waivers that have expired, and those without a reason.
    pub fn not_in_force(&self) -> Vec<Complaint> {
        self.entries.iter().filter_map(|entry| self.is_in_force(&entry.value).err()).collect()
    }

    fn is_in_force(&self, waiver: &WaiverEntry) -> Result<(), Complaint> {
        let complain = |place, message| Err(Complaint::at(&self.source, place, message));
        if let Some(date) = waiver.expires.as_ref().filter(|_| waiver.has_expired(&self.today)) {
            return complain(date.place, format!("this waiver expired on {}", date.value));
        }
        match waiver.reason.value.trim() == UNEXPLAINED {
            true => complain(waiver.reason.place, "this waiver has no reason yet".to_owned()),
            false => Ok(()),
        }
    }

    /// What `runs` say of each waiver, with its place and the names of its cases.
    pub fn needs(&self, runs: &[Run]) -> Vec<(Place, String, Need)> {
        let need = |At { value: waiver, place }: &At<WaiverEntry>| {
            let globs: Vec<&str> = waiver.cases.0.iter().map(|glob| glob.value.as_str()).collect();
            let need = match waiver.expires.as_ref().filter(|_| waiver.has_expired(&self.today)) {
                Some(date) => Need::Needless(format!("it expired on {}", date.value)),
                None => waiver.need(runs),
            };
            (*place, globs.join(", "), need)
        };
        self.entries.iter().map(need).collect()
    }

    /// The waivers that `run` does not confirm, where `names` are the existing cases. Of a run of
    /// `selected` ones, nothing is known of a waiver that names others, too.
    pub fn out_of_date(&self, run: &Run, names: &[String], selected: bool) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        let in_run = LazyCell::new(|| -> BTreeSet<String> {
            run.cases().map(|(_, case)| case.info.name()).collect()
        });
        for At { value: waiver, place } in &self.entries {
            complaints.extend(self.is_in_force(waiver).err());
            if waiver.has_expired(&self.today) {
                continue;
            }
            let mut complain = |place, message| {
                complaints.push(Complaint::at(&self.source, place, message));
            };
            let absent = |glob: &&At<String>| {
                !is_of_campaign(&glob.value)
                    && !names.iter().any(|name| is_named(&glob.value, name))
            };
            let mut known = true;
            for glob in waiver.cases.0.iter().filter(absent) {
                let meant = did_you_mean(&glob.value, names.iter().map(String::as_str));
                complain(glob.place, format!("no case is called `{}`{meant}", glob.value));
                known = false;
            }
            let named = waiver.named_in(run);
            // What is undecided may be where the cause would occur.
            if named.iter().any(|case| matches!(case.outcome, Outcome::Undecided(_))) {
                continue;
            }
            let ran: Vec<&CaseRun> = named.into_iter().filter(|it| waiver.is_about(it)).collect();
            let mut of_waiver = names.iter().filter(|name| waiver.names(name));
            let not_all = selected && of_waiver.any(|name| !in_run.contains(name));
            if !known || waiver.is_of_chance() || ran.is_empty() || not_all {
                continue;
            }
            let causes = waiver.causes(*place);
            let gone = |(_, cause): &(_, _)| !ran.iter().any(|case| waiver.occurs_in(case, *cause));
            for (place, _) in causes.into_iter().filter(gone) {
                complain(place, format!("what this waives does not occur{}", otherwise(&ran)));
            }
        }
        complaints
    }
}

/// Of a waiver whose cause does not occur in the cases that it names: the cause that does, in the
/// words of a waiver.
fn otherwise(ran: &[&CaseRun]) -> String {
    let red = ran.iter().filter(|case| !matches!(case.outcome, Outcome::Waived { .. }));
    let mut red = red.filter_map(|case| Some((case, case.cause.as_deref()?)));
    let Some((case, cause)) = red.next() else { return " any more".to_owned() };
    let ids = Some(cause.requirement.as_str()).filter(|ids| !ids.is_empty());
    let said = [
        ids.map(|ids| format!("requirement: {ids}")),
        cause.object.as_ref().map(|object| format!("object: \"{object}\"")),
        Some(format!("text: \"{}\"", cause.difference)),
    ];
    let said: Vec<String> = said.into_iter().flatten().collect();
    format!(": the cause of {} is {{ {} }}", case.info.name(), said.join(", "))
}

impl WaiverEntry {
    fn wrong(&self, source: &Arc<Source>, register: &Register) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        let mut complain = |place, message: String| {
            complaints.push(Complaint::at(source, place, message));
        };
        if self.reason.value.trim().is_empty() {
            complain(self.reason.place, "a waiver needs a reason".to_owned());
        }
        if let Some(At { value: date, place }) = &self.expires
            && let Err(wrong) = check_date(date)
        {
            complain(*place, wrong);
        }
        let requirements = self.cause.0.iter().filter_map(|cause| cause.value.requirement.as_ref());
        for At { value: ids, place } in requirements {
            let is_id = |id: &&str| !id.contains(['*', '?']);
            for id in ids.split_whitespace().filter(is_id) {
                if register.find(id).is_none() && !register.lacks_document_of(id) {
                    let meant = did_you_mean(id, register.iter().map(|(id, _)| id));
                    complain(*place, format!("no requirement `{id}` in the register{meant}"));
                }
            }
        }
        complaints
    }

    fn has_expired(&self, today: &str) -> bool {
        // Dates of that form sort like text.
        self.expires.as_ref().is_some_and(|date| date.value.as_str() < today)
    }

    /// Whether what it waives need not occur in each run.
    fn is_of_chance(&self) -> bool {
        self.sometimes || self.verdict == Some(WaivedVerdict::Flaky)
    }

    fn concerns(&self, device: &str) -> bool {
        self.device.as_ref().is_none_or(|glob| WildMatch::new(glob).matches(device))
    }

    fn names(&self, name: &str) -> bool {
        self.cases.0.iter().any(|glob| is_named(&glob.value, name))
    }

    fn covers(&self, name: &str, verdict: Verdict, cause: &Cause) -> bool {
        let wanted = |wanted: WaivedVerdict| match wanted {
            WaivedVerdict::Fail => matches!(verdict, Verdict::Fail | Verdict::Flaky),
            WaivedVerdict::Flaky => verdict == Verdict::Flaky,
            WaivedVerdict::Error => verdict == Verdict::Error,
            WaivedVerdict::Lenient => verdict == Verdict::Lenient,
        };
        self.names(name)
            && self.verdict.is_none_or(wanted)
            && (self.cause.0.is_empty() || self.cause.0.iter().any(|entry| entry.value.is(cause)))
    }

    /// What must occur for it to be true, and where it is written; `place` is that of the waiver.
    fn causes(&self, place: Place) -> Vec<(Place, Option<&CauseEntry>)> {
        match self.cause.0.as_slice() {
            [] => vec![(place, None)],
            [cause] => vec![(place, Some(&cause.value))],
            causes => causes.iter().map(|cause| (cause.place, Some(&cause.value))).collect(),
        }
    }

    /// Whether a case that it names said something about the device, which an ERROR of the tester
    /// does not.
    fn is_about(&self, case: &CaseRun) -> bool {
        let outcome = match &case.outcome {
            Outcome::Waived { outcome, .. } => outcome.as_ref(),
            other => other,
        };
        let said = match outcome {
            Outcome::Skip(_) | Outcome::Blocked(_) | Outcome::Undecided(_) => false,
            Outcome::Error { problem: None, .. } => self.verdict == Some(WaivedVerdict::Error),
            _ => true,
        };
        said && !outcome.is_not_run()
    }

    /// Whether it covers the outcome of the case, which has this one of its causes.
    fn occurs_in(&self, case: &CaseRun, of: Option<&CauseEntry>) -> bool {
        let verdict = match &case.outcome {
            Outcome::Waived { outcome, .. } => outcome.verdict(),
            other => other.verdict(),
        };
        let covers = |cause| self.covers(&case.info.name(), verdict, cause);
        let is_it = |cause: &&Cause| of.is_none_or(|entry| entry.is(cause));
        case.cause.as_deref().filter(is_it).is_some_and(covers)
    }
}

impl WaiverEntry {
    /// The cases of a run that it names.
    fn named_in<'r>(&self, run: &'r Run) -> Vec<&'r CaseRun> {
        let cases = run.cases().filter(|(device, _)| self.concerns(&device.info.device));
        cases.map(|(_, case)| case).filter(|case| self.names(&case.info.name())).collect()
    }

    /// What runs say of it. What they do not decide may be where it is needed.
    fn need(&self, runs: &[Run]) -> Need {
        if runs.iter().flat_map(|run| self.named_in(run)).any(|case| self.occurs_in(case, None)) {
            return Need::Needed;
        }
        let undecided = |why: &str| Need::Undecided(why.to_owned());
        if self.is_of_chance() {
            return undecided("it need not occur in each run");
        }
        if self.cases.0.iter().any(|glob| is_of_campaign(&glob.value)) {
            return undecided("it is about a campaign of fuzzing");
        }
        // One run that shows it is enough.
        let decided = |run: &&Run| {
            let cases = self.named_in(run);
            cases.iter().any(|case| self.is_about(case))
                && cases.iter().all(|case| is_decided(&case.outcome))
                && (is_whole(run) || self.cases.0.iter().all(|glob| is_one_of(&glob.value, &cases)))
        };
        match runs.iter().any(|run| decided(&run)) {
            true => Need::Needless("what it waives does not occur any more".to_owned()),
            false => undecided("not all of its cases ran and have a verdict"),
        }
    }
}

/// Whether all cases were to run, and the run came to its end.
fn is_whole(run: &Run) -> bool {
    let chosen = run.started.as_ref().is_none_or(|it| it.selected || it.shard.is_some());
    let ended = run.ended.as_ref().is_some_and(|ended| ended.reason.is_none());
    ended && !chosen
}

/// Whether it is the full name of one of these, so that it names no other.
fn is_one_of(name: &str, cases: &[&CaseRun]) -> bool {
    cases.iter().any(|case| case.info.name() == name)
}

/// Whether a case said what it can say about the device.
fn is_decided(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::Waived { outcome, .. } => is_decided(outcome),
        Outcome::Pass | Outcome::Lenient(_) | Outcome::Fail(_) | Outcome::Flaky { .. } => true,
        Outcome::Skip(reason) => !reason.starts_with("not run"),
        Outcome::Blocked(_) | Outcome::Error { .. } | Outcome::Undecided(_) => false,
    }
}

fn is_of_campaign(glob: &str) -> bool {
    glob.split('/').next() == Some(CAMPAIGN)
}

impl CauseEntry {
    fn is(&self, cause: &Cause) -> bool {
        let fits = |glob: &str, text: &str| WildMatch::new(glob).matches(text);
        let requirement = self.requirement.as_ref().map(|ids| ids.value.as_str());
        let one_of = |glob| cause.requirement.split_whitespace().any(|id| fits(glob, id));
        requirement.is_none_or(|glob| fits(glob, &cause.requirement) || one_of(glob))
            && self.text.as_ref().is_none_or(|glob| fits(glob, &cause.difference))
            && self
                .object
                .as_ref()
                .is_none_or(|glob| cause.object.as_ref().is_some_and(|object| fits(glob, object)))
    }
}

/// Checks that `text` is a day of the calendar, such as `2026-12-31`.
///
/// # Errors
/// What is wrong with it.
pub fn check_date(text: &str) -> Result<(), String> {
    let number = |text: &str, digits: usize| {
        let whole = text.len() == digits && text.bytes().all(|byte| byte.is_ascii_digit());
        whole.then(|| text.parse::<u16>().ok()).flatten()
    };
    let parts: Vec<&str> = text.split('-').collect();
    let numbers = match parts.as_slice() {
        [year, month, day] => number(year, 4).zip(number(month, 2)).zip(number(day, 2)),
        _ => None,
    };
    match numbers {
        None => Err("a date is written `2026-12-31`".to_owned()),
        Some(((year, month), day)) if (1..=days_of(year, month)).contains(&day) => Ok(()),
        Some(_) => Err(format!("the calendar has no day {text}")),
    }
}

/// The number of days of a month; 0 when the year has no such month.
fn days_of(year: u16, month: u16) -> u16 {
    let leap = year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
    match month {
        2 => 28 + u16::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    }
}

impl<'de> Deserialize<'de> for Globs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrSeveral;
        impl<'de> Visitor<'de> for OneOrSeveral {
            type Value = Vec<At<String>>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a case, or a list of names")
            }
            fn visit_str<E: de::Error>(self, glob: &str) -> Result<Self::Value, E> {
                Ok(vec![At { value: glob.to_owned(), ..At::default() }])
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut globs = Vec::new();
                while let Some(glob) = list.next_element()? {
                    globs.push(glob);
                }
                Ok(globs)
            }
        }
        struct Any(Vec<At<String>>);
        impl<'de> Deserialize<'de> for Any {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(OneOrSeveral).map(Self)
            }
        }
        // A glob alone has its place from around it.
        let At { value: Any(mut globs), place } = At::<Any>::deserialize(deserializer)?;
        let unplaced = |glob: &&mut At<String>| glob.place.line == 0;
        globs.iter_mut().filter(unplaced).for_each(|glob| glob.place = place);
        Ok(Self(globs))
    }
}

impl<'de> Deserialize<'de> for Causes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrSeveral;
        impl<'de> Visitor<'de> for OneOrSeveral {
            type Value = Vec<At<CauseEntry>>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a cause such as `{ text: \"*came accepted\" }`, or a list of causes")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let cause = CauseEntry::deserialize(MapAccessDeserializer::new(map))?;
                Ok(vec![At { value: cause, ..At::default() }])
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                let causes = Vec::deserialize(SeqAccessDeserializer::new(list))?;
                match causes.is_empty() {
                    true => Err(de::Error::custom("a list of causes has at least one")),
                    false => Ok(causes),
                }
            }
        }
        deserializer.deserialize_any(OneOrSeveral).map(Self)
    }
}

impl JsonSchema for Causes {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Causes".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let cause = generator.subschema_for::<CauseEntry>();
        json_schema!({
            "description": "One cause, or several.",
            "oneOf": [cause, { "type": "array", "items": cause, "minItems": 1 }]
        })
    }
}

impl JsonSchema for Globs {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Globs".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "One glob over full names of cases, or several.",
            "oneOf": [
                { "type": "string" },
                { "type": "array", "items": { "type": "string" }, "minItems": 1 }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two cases of a waiver, the one that shows the cause is undecided, and the other passes.
    #[test]
    fn what_is_undecided_leaves_a_waiver_as_it_is() {
        let waivers =
            r#"[{ "cases": "any/case-*", "cause": { "text": "*" }, "reason": "Known." }]"#;
        let source = Source::new("waivers.yaml", waivers.to_owned());
        let read = Waivers::read(Arc::new(source), "2026-01-31", &Register::default());
        let waivers = read.expect("it is right");
        let names = ["any/case-1".to_owned(), "any/case-2".to_owned()];
        const DEVICE: &str =
            r#"{"device-started":{"device":"any","node":1,"identity":{},"rerun":""}}"#;
        const STARTED: &str = concat!(
            r#"{"case-started":{"at":0,"suite":"any","case":"CASE","instance":null,"#,
            r#""title":"Any.","checks":[],"file":"any.yaml","line":1,"column":1}}"#
        );
        let complaints = |first: &str| {
            let case = |case, outcome| {
                let started = STARTED.replace("CASE", case);
                format!("{started}\n{{\"case-ended\":{{\"at\":0,\"outcome\":{outcome}}}}}\n")
            };
            let (one, other) = (case("case-1", first), case("case-2", r#""pass""#));
            let journal = format!("{DEVICE}\n{one}{other}");
            let run = Run::fold(&journal, reports::Keep::All).expect("a journal");
            waivers.out_of_date(&run, &names, false).len()
        };
        assert_eq!(complaints(r#"{"undecided":"the tester was late"}"#), 0);
        assert_eq!(complaints(r#""pass""#), 1);
    }

    #[test]
    fn dates() {
        for good in ["2026-12-31", "2024-02-29", "2000-02-29", "2026-04-30"] {
            assert_eq!(check_date(good), Ok(()), "{good}");
        }
        for no_day in ["2026-13-01", "2026-00-01", "2026-02-29", "2100-02-29", "2026-04-31"] {
            assert_eq!(check_date(no_day), Err(format!("the calendar has no day {no_day}")));
        }
        for no_date in ["2026-1-1", "31.12.2026", "tomorrow", "2026-12-31-1", ""] {
            assert!(check_date(no_date).is_err_and(|wrong| wrong.contains("is written")));
        }
    }
}
