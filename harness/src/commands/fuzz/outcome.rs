//! What a campaign showed, in words and as JSON.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use campaign::{Campaign, Finding, Kind, Surface, Tally};
use serde::Serialize;

use super::causes::Cause;
use crate::commands::counted::counted;
use crate::reporter::harmless;

/// What a campaign showed.
#[derive(Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Outcome {
    /// Sessions that were played.
    sessions: u64,
    /// Actions in them.
    actions: u64,
    /// Pairs of a state of the device and a kind of action.
    goals: usize,
    /// Sessions that an error of the application has cut short.
    cut_short: u64,
    /// Sessions that were wrong once, and not when they were repeated.
    #[serde(skip_serializing_if = "is_zero")]
    undecided: u64,
    /// Sessions that reached code of a program which none before had.
    #[serde(skip_serializing_if = "is_zero")]
    further: u64,
    /// The findings by their causes.
    pub(super) causes: Vec<Found>,
    /// The freedoms that the device was seen to use.
    learnt: Vec<Learnt>,
    /// What an exploration covered.
    #[serde(skip_serializing_if = "Option::is_none")]
    explored: Option<Explored>,
    /// The objects that the application changes.
    changes: Vec<String>,
    /// In how many states each kind of action was tried, the rarest first.
    tried: Vec<(String, usize)>,
}

/// What an exploration covered.
#[derive(Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Explored {
    /// Pairs of a setting with a sort of value, and another function or a state.
    pairs: usize,
    /// Objects that were judged, and that can be read.
    objects: (usize, usize),
    /// Names of the bench that were judged, and that show something.
    bench: (usize, usize),
    /// What was not judged.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_out: Vec<String>,
}

/// Findings that have a cause in common.
#[derive(Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Found {
    cause: String,
    /// What is wrong in the first of them.
    what: String,
    /// What the device may do wrong, the likeliest first.
    like: Vec<Like>,
    /// The numbers of the sessions.
    sessions: Vec<u64>,
    /// How many actions show it.
    actions: usize,
    /// What the device, a program, said before it ended.
    #[serde(skip_serializing_if = "Option::is_none")]
    said: Option<String>,
    /// These in words, of an exploration.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    done: Vec<String>,
    /// The file with them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) file: Option<PathBuf>,
    /// Why it is accepted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) waived: Option<String>,
}

/// A mutant that does the same.
#[derive(Debug, Serialize)]
struct Like {
    requirements: String,
    why: String,
}

/// A freedom that the device uses.
#[derive(Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
struct Learnt {
    freedom: String,
    why: String,
    allowed_by: Vec<String>,
    /// Whether it is from a run, and no session has contradicted it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    from_a_run: bool,
}

impl Found {
    pub(super) fn new(
        cause: &Cause,
        findings: &[Finding],
        kept: &Finding,
        surface: Option<&Surface>,
        file: Option<PathBuf>,
    ) -> Self {
        let actions = &kept.session.actions;
        let words = |surface: &Surface| actions.iter().map(|it| surface.words(it)).collect();
        let of_cause = || cause.findings.iter().map(|place| &findings[*place]);
        let like = cause.says.iter();
        let like = like.map(|(requirements, why)| Like {
            requirements: requirements.clone(),
            why: why.clone(),
        });
        Self {
            cause: cause.name.clone(),
            what: kept.violation.to_string(),
            like: like.collect(),
            sessions: of_cause().map(|finding| finding.number).collect(),
            actions: actions.len(),
            done: surface.map_or_else(Vec::new, words),
            said: kept.said.clone(),
            file,
            waived: None,
        }
    }

    /// What is known of it beside what was seen, a line each.
    pub(super) fn notes(&self) -> Vec<String> {
        let like = self
            .like
            .iter()
            .map(|Like { requirements, why }| format!("like: {why} ({requirements})"));
        let times = counted(self.sessions.len(), "session");
        let first = self.sessions.first().copied().unwrap_or_default();
        let found = format!("found in {times}, first in session {first}");
        let file = self.file.iter();
        let repeat = file.map(|file| format!("repeat: harness fuzz repro {}", file.display()));
        let said = self.said.iter().flat_map(|said| said.lines());
        let said = said.map(|line| format!("said: {line}"));
        like.chain([found]).chain(repeat).chain(said).collect()
    }

    fn text(&self) -> String {
        let mut text = match &self.waived {
            None => format!("FINDING {}\n", self.cause),
            Some(waiver) => format!("WAIVED {}: {waiver}\n", self.cause),
        };
        let times = counted(self.sessions.len(), "session");
        let first = self.sessions.first().copied().unwrap_or_default();
        // Writing to a string cannot fail.
        _ = writeln!(text, "  found in     {times}, first in session {first}");
        _ = writeln!(text, "  what         {}", self.what);
        for Like { requirements, why } in &self.like {
            _ = writeln!(text, "  like         {why} ({requirements})");
        }
        _ = writeln!(text, "  actions      {}", self.actions);
        for done in &self.done {
            _ = writeln!(text, "    {done}");
        }
        for line in self.said.iter().flat_map(|said| said.lines()) {
            _ = writeln!(text, "  said         {}", harmless(line));
        }
        if let Some(file) = &self.file {
            _ = writeln!(text, "  repeat       harness fuzz repro {}", file.display());
        }
        text + "\n"
    }
}

/// How much of what was not judged is named.
const NAMED: usize = 12;

impl Outcome {
    /// Before the causes are known.
    pub(super) fn new(campaign: &Campaign<'_>) -> Self {
        let tally = campaign.tally();
        let learnt = campaign.belief().freedoms().map(|freedom| Learnt {
            freedom: freedom.name.clone(),
            why: freedom.why.clone(),
            allowed_by: freedom.clauses.clone(),
            from_a_run: campaign.belief().is_given(freedom),
        });
        Self {
            sessions: tally.sessions,
            actions: tally.actions,
            goals: tally.goals.len(),
            cut_short: tally.void,
            undecided: tally.undecided,
            further: tally.further,
            causes: Vec::new(),
            learnt: learnt.collect(),
            explored: campaign.blueprint().surface().map(|surface| {
                let (objects, bench) = tally.judged.size();
                let (all_objects, all_bench) = surface.size();
                Explored {
                    pairs: tally.coverage.len(),
                    objects: (objects, all_objects),
                    bench: (bench, all_bench),
                    left_out: tally.judged.left_out(surface),
                }
            }),
            changes: tally.followed.iter().map(ToString::to_string).collect(),
            tried: tried(tally, campaign.blueprint().surface().is_some()),
        }
    }

    /// What was done, and what was learnt of the device, a line each.
    pub(super) fn notes(&self) -> Vec<String> {
        std::iter::once(self.played()).chain(self.rest()).collect()
    }

    fn played(&self) -> String {
        if let Some(Explored { pairs, .. }) = self.explored {
            return format!(
                "{} with {} actions, {} of a setting and another function or a state",
                counted(self.sessions as usize, "session"),
                self.actions,
                counted(pairs, "pair"),
            );
        }
        format!(
            "{} with {} actions, {} pairs of state and action",
            counted(self.sessions as usize, "session"),
            self.actions,
            self.goals,
        )
    }

    fn rest(&self) -> Vec<String> {
        let learnt = self.learnt.iter().map(|Learnt { freedom, why, allowed_by, from_a_run }| {
            let how = if *from_a_run { "from the run" } else { "learnt" };
            format!("{how}: {freedom}: {why} ({})", allowed_by.join(", "))
        });
        let changes = (!self.changes.is_empty())
            .then(|| format!("the application changes {}", self.changes.join(", ")));
        let void = (self.cut_short > 0).then(|| {
            let void = counted(self.cut_short as usize, "session");
            format!("{void} cut short by an error of the application")
        });
        let undecided = (self.undecided > 0).then(|| {
            let undecided = counted(self.undecided as usize, "session");
            format!("{undecided} undecided: what was wrong once was not when it was repeated")
        });
        let further = (self.further > 0).then(|| {
            let further = counted(self.further as usize, "session");
            format!("{further} reached code of the program that none before had")
        });
        let explored = self.explored.iter().flat_map(|explored| {
            let Explored { objects, bench, left_out, .. } = explored;
            let share = format!(
                "judged {} of {} and {} of {} on the bench",
                objects.0,
                counted(objects.1, "object"),
                bench.0,
                counted(bench.1, "name"),
            );
            let shown = left_out.iter().take(NAMED).cloned().collect::<Vec<_>>().join("; ");
            let more = left_out.len().saturating_sub(NAMED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let rest = (!left_out.is_empty()).then(|| format!("not judged: {shown}{more}"));
            std::iter::once(share).chain(rest)
        });
        learnt.chain(explored).chain(changes).chain(void).chain(undecided).chain(further).collect()
    }

    /// The same for programs.
    pub(super) fn json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        text.expect("what a campaign showed is written as JSON") + "\n"
    }

    /// The same for people; with `goals`, how often each kind of action was tried.
    pub(super) fn text(&self, goals: bool) -> String {
        let mut text: String = self.causes.iter().map(Found::text).collect();
        let findings: usize = self.causes.iter().map(|found| found.sessions.len()).sum();
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{}; {} in {}",
            self.played(),
            counted(self.causes.len(), "cause"),
            counted(findings, "finding"),
        );
        self.rest().iter().for_each(|line| _ = writeln!(text, "{line}"));
        for (kind, states) in self.tried.iter().filter(|_| goals) {
            _ = writeln!(text, "  {kind:<24} {}", counted(*states, "state"));
        }
        text
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde wants it so")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}

fn tried(tally: &Tally, explored: bool) -> Vec<(String, usize)> {
    // An exploration leaves to the others what is not about the application.
    let all = Kind::ALL.iter().filter(|kind| !explored && !kind.is_of_explorations());
    let mut counts: BTreeMap<Kind, usize> = all.map(|kind| (*kind, 0)).collect();
    tally.goals.iter().for_each(|(_, _, kind)| *counts.entry(*kind).or_default() += 1);
    let mut rows: Vec<(Kind, usize)> = counts.into_iter().collect();
    rows.sort_by_key(|(_, count)| *count);
    rows.into_iter().map(|(kind, count)| (kind.word(), count)).collect()
}
