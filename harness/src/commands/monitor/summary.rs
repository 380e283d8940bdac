//! What a trace has shown of each device.

use std::fmt::Write;

use campaign::{Blueprint, Candidate, Finding};
use runner::suite::Register;

use super::judge::{Judge, Unjudged};
use crate::commands::counted::counted;
use crate::commands::fuzz::{Cause, group};
use crate::exit::Exit;

/// What a trace has shown.
pub(super) struct Summary<'r> {
    register: &'r Register,
    text: String,
    is_wrong: bool,
    devices: usize,
    /// The frames that were judged.
    judged: usize,
}

/// What is said where no device is named.
const NOBODY: &str = "no device was judged: `--device NAME@ID` names one like a reference device, \
                      and `--node ID --eds FILE` any other\n";

/// How many kinds of devices are named between which a trace does not decide.
const NAMED: usize = 4;

impl<'r> Summary<'r> {
    pub(super) const fn new(register: &'r Register) -> Self {
        Self { register, text: String::new(), is_wrong: false, devices: 0, judged: 0 }
    }

    /// A device of which nobody has the data sheet.
    pub(super) fn unknown(&mut self, name: &str, node: u8) {
        // Writing to a string cannot fail.
        _ = writeln!(
            self.text,
            "{name}, node {node}: not judged, since this program has no data sheet of it: --node \
             {node} --eds FILE gives one"
        );
    }

    /// What was heard of a device, and what is wrong with it.
    pub(super) fn add(&mut self, judge: &Judge<'_>) {
        let (heard, findings) = (judge.listener.heard(), judge.listener.findings());
        self.devices += 1;
        self.judged += heard.judged;
        self.is_wrong |= !findings.is_empty();
        let (name, node) = (&judge.name, judge.node);
        let text = &mut self.text;
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{name}, node {node}: {}, {} judged, {} open, {} wrong",
            counted(heard.frames, "frame"),
            heard.judged,
            heard.open,
            findings.len(),
        );
        if heard.judged == 0 {
            _ = writeln!(
                text,
                "  nothing was judged: no frame says that node {node} boots, or its state; \
                 `--device NAME@ID` gives another node id"
            );
        }
        if let Some(said) = unjudged(judge.unjudged) {
            _ = writeln!(text, "  not judged: what the application decides, in {said}");
        }
        if judge.listener.gave_up() {
            let at = judge.times.last().copied().unwrap_or_default();
            let count = findings.len();
            _ = writeln!(
                text,
                "  not judged: what followed the {count} things wrong, from {at} s on"
            );
        }
        for freedom in judge.listener.campaign().belief().freedoms() {
            let clauses = freedom.clauses.join(", ");
            _ = writeln!(text, "  learnt: {}: {} ({clauses})", freedom.name, freedom.why);
        }
        let all: Vec<Finding> = findings.iter().map(|(_, finding)| finding.clone()).collect();
        for cause in group(judge.listener.campaign(), judge.blueprint, &all) {
            let first = cause.findings.first().copied().unwrap_or_default();
            let (finding, at) = (&all[first], judge.times.get(first).copied().unwrap_or_default());
            _ = write!(self.text, "  FAIL {}, at {at} s", finding.violation);
            _ = match cause.findings.len() - 1 {
                0 => writeln!(self.text),
                others => writeln!(self.text, ", and {} like it", counted(others, "other")),
            };
            self.requirements(&cause, judge.blueprint);
        }
    }

    /// What a device like this breaks, as far as the trace decides it.
    fn requirements(&mut self, cause: &Cause, blueprint: &Blueprint) {
        let like = cause.mutants.iter().take(cause.likeliest);
        let like: Vec<&Candidate> = like.map(|place| &blueprint.mutants()[*place]).collect();
        let text = &mut self.text;
        let Some(first) = like.first() else {
            // Writing to a string cannot fail.
            _ = writeln!(text, "    no mutant does the same, which would name the requirement");
            return;
        };
        let common =
            first.clauses.iter().filter(|id| like.iter().all(|it| it.clauses.contains(id)));
        let common: Vec<&String> = common.collect();
        let (named, rest) = match common.is_empty() {
            false => (vec![(first, common)], 0),
            true => {
                _ = writeln!(text, "    the trace does not decide which one:");
                let each = like.iter().take(NAMED).map(|it| (it, it.clauses.iter().collect()));
                (each.collect(), like.len().saturating_sub(NAMED))
            }
        };
        for (mutant, ids) in named {
            _ = writeln!(text, "    like: {}", mutant.why);
            for id in ids {
                let check = self.register.check(id);
                let says = check.map_or_else(String::new, |check| {
                    format!(" ({}, {}): {}", check.document, check.clause, check.says)
                });
                _ = writeln!(text, "    {id}{says}");
            }
        }
        if rest > 0 {
            _ = writeln!(text, "    and {}", counted(rest, "other"));
        }
    }

    /// All of it, for people.
    pub(super) fn text(&self) -> String {
        match self.devices {
            0 => self.text.clone() + NOBODY,
            _ => self.text.clone(),
        }
    }

    /// The exit code that it makes.
    pub(super) const fn exit(&self) -> Exit {
        match (self.is_wrong, self.judged) {
            (true, _) => Exit::Failed,
            (false, 0) => Exit::NothingRan,
            (false, _) => Exit::Green,
        }
    }
}

/// In how many frames the application decides something; `None` when in none.
fn unjudged(Unjudged { pdos, answers, emergencies }: Unjudged) -> Option<String> {
    let all =
        [(pdos, "PDO"), (answers, "SDO answer"), (emergencies, "emergency message")].into_iter();
    let all: Vec<String> =
        all.filter(|(count, _)| *count > 0).map(|(count, noun)| counted(count, noun)).collect();
    (!all.is_empty()).then(|| all.join(", "))
}
