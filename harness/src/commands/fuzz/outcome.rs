//! What a campaign showed, in words.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use campaign::{Action, Campaign, Finding, Kind, Surface, Tally};
use reports::campaign::{Explored, Found, Learnt, Like};

use super::causes::Cause;
use crate::commands::counted::counted;
use crate::reporter::harmless;

/// Findings of one cause.
pub(super) fn found(
    cause: &Cause,
    findings: &[Finding],
    kept: &Finding,
    surface: Option<&Surface>,
    file: Option<&Path>,
) -> Found {
    let actions = &kept.session.actions;
    let of_cause = || cause.findings.iter().map(|place| &findings[*place]);
    let like = cause.says.iter();
    let like = like
        .map(|(requirements, why)| Like { requirements: requirements.clone(), why: why.clone() });
    Found {
        cause: cause.name.clone(),
        what: kept.violation.to_string(),
        like: like.collect(),
        sessions: of_cause().map(|finding| finding.number).collect(),
        actions: actions.len(),
        done: words_of(actions, surface),
        said: kept.said.clone(),
        file: file.map(|file| file.display().to_string()),
        waived: None,
    }
}

/// What actions do, in the words of an exploration, or as frames.
pub(super) fn words_of(actions: &[Action], surface: Option<&Surface>) -> Vec<String> {
    match surface {
        Some(surface) => actions.iter().map(|action| surface.words(action)).collect(),
        None => actions.iter().flat_map(Action::words).collect(),
    }
}

/// What is known of it beside what was seen, a line each.
pub(super) fn notes_of(of: &Found) -> Vec<String> {
    let like =
        of.like.iter().map(|Like { requirements, why }| format!("like: {why} ({requirements})"));
    let times = counted(of.sessions.len(), "session");
    let first = of.sessions.first().copied().unwrap_or_default();
    let found = format!("found in {times}, first in session {first}");
    let file = of.file.iter();
    let repeat = file.map(|file| format!("repeat: harness fuzz repro {file}"));
    let said = of.said.iter().flat_map(|said| said.lines());
    let said = said.map(|line| format!("said: {line}"));
    like.chain([found]).chain(repeat).chain(said).collect()
}

fn text_of(of: &Found) -> String {
    let mut text = match &of.waived {
        None => format!("FINDING {}\n", of.cause),
        Some(waiver) => format!("WAIVED {}: {waiver}\n", of.cause),
    };
    let times = counted(of.sessions.len(), "session");
    let first = of.sessions.first().copied().unwrap_or_default();
    // Writing to a string cannot fail.
    _ = writeln!(text, "  found in     {times}, first in session {first}");
    _ = writeln!(text, "  what         {}", of.what);
    for Like { requirements, why } in &of.like {
        _ = writeln!(text, "  like         {why} ({requirements})");
    }
    _ = writeln!(text, "  actions      {}", of.actions);
    for done in &of.done {
        _ = writeln!(text, "    {done}");
    }
    for line in of.said.iter().flat_map(|said| said.lines()) {
        _ = writeln!(text, "  said         {}", harmless(line));
    }
    if let Some(file) = &of.file {
        _ = writeln!(text, "  repeat       harness fuzz repro {file}");
    }
    text + "\n"
}

/// What a data sheet does not tell.
const NOT_JUDGED: &str = "not judged: what the application decides, such as values of objects from \
                          2000h on and when event-driven TPDOs come";

/// How much of what was not judged is named.
const NAMED: usize = 12;

/// What a campaign showed.
pub(super) struct Outcome(pub(super) reports::Campaign);

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
        Self(reports::Campaign {
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
        })
    }

    /// What was done, and what was learnt of the device, a line each.
    pub(super) fn notes(&self) -> Vec<String> {
        std::iter::once(self.played()).chain(self.rest()).collect()
    }

    fn played(&self) -> String {
        if let Some(Explored { pairs, .. }) = self.0.explored {
            return format!(
                "{} with {} actions, {} of a setting and another function or a state",
                counted(self.0.sessions as usize, "session"),
                self.0.actions,
                counted(pairs, "pair"),
            );
        }
        format!(
            "{} with {} actions, {} pairs of state and action",
            counted(self.0.sessions as usize, "session"),
            self.0.actions,
            self.0.goals,
        )
    }

    fn rest(&self) -> Vec<String> {
        let learnt = self.0.learnt.iter().map(|Learnt { freedom, why, allowed_by, from_a_run }| {
            let how = if *from_a_run { "from the run" } else { "learnt" };
            format!("{how}: {freedom}: {why} ({})", allowed_by.join(", "))
        });
        let changes = (!self.0.changes.is_empty())
            .then(|| format!("the application changes {}", self.0.changes.join(", ")));
        let void = (self.0.cut_short > 0).then(|| {
            let void = counted(self.0.cut_short as usize, "session");
            format!("{void} cut short by an error of the application")
        });
        let undecided = (self.0.undecided > 0).then(|| {
            let undecided = counted(self.0.undecided as usize, "session");
            format!("{undecided} undecided: what was wrong once was not when it was repeated")
        });
        let further = (self.0.further > 0).then(|| {
            let further = counted(self.0.further as usize, "session");
            format!("{further} reached code of the program that none before had")
        });
        let explored = self.0.explored.iter().flat_map(|explored| {
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
        let by_sheet = self.0.explored.is_none().then(|| NOT_JUDGED.to_owned());
        learnt
            .chain(explored)
            .chain(by_sheet)
            .chain(changes)
            .chain(void)
            .chain(undecided)
            .chain(further)
            .collect()
    }

    /// The same for people; with `goals`, how often each kind of action was tried.
    pub(super) fn text(&self, goals: bool) -> String {
        let mut text: String = self.0.causes.iter().map(text_of).collect();
        let findings: usize = self.0.causes.iter().map(|found| found.sessions.len()).sum();
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{}; {} in {}",
            self.played(),
            counted(self.0.causes.len(), "cause"),
            counted(findings, "finding"),
        );
        self.rest().iter().for_each(|line| _ = writeln!(text, "{line}"));
        for (kind, states) in self.0.tried.iter().filter(|_| goals) {
            _ = writeln!(text, "  {kind:<24} {}", counted(*states, "state"));
        }
        text
    }
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
