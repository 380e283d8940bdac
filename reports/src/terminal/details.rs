//! The reasons why a case did not pass, in the order in which a reader asks for them.

use std::fmt::{self, Write as _};

use canopen::{Frame, Instant, Stamped, meaning};

use super::{one_line, plural};
use crate::event::Measured;
use crate::names::ObjectNames;
use crate::run::{CaseRun, DeviceRun};
use crate::story::{Done, Line, Story};
use crate::style::{Style, printable, shell_word};
use crate::verdict::{Excerpt, Outcome, Phase, Problem, Verdict};

/// The case and its sentence; the requirements; the expected and the actual behaviour; the place in
/// the suite file; the last frames; the command that runs the case again.
pub fn details(device: &DeviceRun, case: &CaseRun, style: Style) -> String {
    let (verdict, names) = (case.verdict(), &*device.info.objects);
    let mut block = Block { text: String::new(), style, verdict, names };
    let problem = case.outcome.problem();
    block.head(&device.info.device, case);
    block.requirements(case);
    match &case.outcome {
        Outcome::Error { reason, .. } => block.named("no verdict", reason),
        Outcome::Undecided(reason) => block.field("undecided", reason),
        Outcome::Skip(reason) => block.field("skipped", reason),
        Outcome::Blocked(reason) => block.field("blocked", reason),
        Outcome::Waived { waiver, .. } => block.field("waived", &waiver.to_string()),
        // A note says of it how often it failed.
        Outcome::Pass | Outcome::Lenient(_) | Outcome::Flaky { .. } | Outcome::Fail(_) => {}
    }
    if let Some(problem) = problem {
        block.step(case, problem);
        block.difference(problem);
    }
    for measured in &case.record().measured {
        block.field("measured", &figures(measured));
    }
    match problem {
        Some(problem) if problem.place.file.is_empty() => {}
        Some(problem) => block.place(problem),
        // If a run did not reach its cases, its one case stands in no file.
        None if case.info.file.is_empty() => {}
        None => {
            let info = &case.info;
            block.field("in", &format!("{}:{}:{}", info.file, info.line, info.column));
        }
    }
    block.story(device, case);
    if !device.info.rerun.is_empty() {
        let again = format!("{} {}", device.info.rerun, shell_word(&case.info.name()));
        block.field("run again", &again);
    }
    block.text
}

struct Block<'d> {
    text: String,
    style: Style,
    verdict: Verdict,
    names: &'d ObjectNames,
}

impl Block<'_> {
    fn line(&mut self, line: impl fmt::Display) {
        // Writing to a string does not fail.
        let _ = writeln!(self.text, "{line}");
    }

    /// A label and its text; further lines of the text stand below the first.
    fn field(&mut self, label: &str, text: &str) {
        let label = format!("{label:<LABEL$}");
        let text = printable(text);
        let mut lines = text.lines();
        let first = lines.next().unwrap_or_default();
        self.line(format_args!("  {}{first}", self.style.dim(label)));
        for line in lines {
            self.line(format_args!("  {:LABEL$}{line}", ""));
        }
    }

    /// A field whose text speaks of objects.
    fn named(&mut self, label: &str, text: &str) {
        let text = self.names.in_text(text);
        self.field(label, &text);
    }

    fn head(&mut self, device: &str, case: &CaseRun) {
        let verdict = self.style.verdict(self.verdict, self.verdict);
        let name = case.info.name();
        let subject = format!("{}: {}", one_line(device), one_line(&name));
        let line = format!("{verdict} {}", self.style.bold(subject));
        self.line(line);
        self.line(format_args!("  {}", one_line(&case.info.title)));
    }

    fn requirements(&mut self, case: &CaseRun) {
        for check in &*case.info.checks {
            let id = format!("{}, {} clause {}", check.id, check.document, check.clause);
            let level = if check.level.is_empty() { "" } else { ", level " };
            let relaxed = check.relaxed_by.as_ref();
            let relaxed = relaxed.map_or_else(String::new, |by| format!(", relaxed by {by}"));
            let level = format!("{level}{}{relaxed}", check.level);
            self.field("requires", &format!("{id}{level}\n{}", check.says));
            if let Some(decided) = &check.decided {
                self.field("decided", &one_line(decided));
            }
        }
    }

    fn difference(&mut self, problem: &Problem) {
        let words = problem.expected_in_words().into_iter();
        let expected = std::iter::once(problem.expected.clone()).chain(words);
        self.named("expected", &expected.collect::<Vec<_>>().join("\n"));
        self.named("came", &problem.actual);
        if let Some(frame) = &problem.raw {
            self.named("", &format!("{frame}  {}", meaning(frame)));
        }
        if let Some(apart) = &problem.apart {
            self.field("apart", apart);
        }
        if problem.capped {
            self.field(
                "level",
                "no requirement of this case is a must for the device, so it does not fail",
            );
        }
        for note in &problem.notes {
            self.named("note", note);
        }
    }

    /// The step that was judged, in words.
    fn step(&mut self, case: &CaseRun, problem: &Problem) {
        if let Some(step) = case.step_of(problem) {
            self.named("step", &step.text);
        }
    }

    fn place(&mut self, problem: &Problem) {
        let place = &problem.place;
        let phase = match problem.phase {
            Phase::Settle => " while the device was settled",
            Phase::Setup => " in the setup",
            Phase::Step => "",
            Phase::Finally => " in the finally part",
            Phase::Monitor => " (a monitor spoke during this step)",
        };
        self.field("in", &format!("{}:{}:{}{phase}", place.file, place.line, place.column));
        self.source(place);
        if let Some(place) = &problem.sheet {
            self.field("says", &format!("{}:{}:{}", place.file, place.line, place.column));
            self.source(place);
        }
    }

    fn source(&mut self, place: &Excerpt) {
        let number = place.line.to_string();
        let gutter = " ".repeat(number.len());
        let (source, caret) = (one_line(&place.source.replace('\t', " ")), caret(place));
        let bar = self.style.dim("|");
        let lines = format!(
            "{:INDENT$}{gutter} {bar}\n\
             {:INDENT$}{} {bar} {source}\n\
             {:INDENT$}{gutter} {bar} {}",
            "",
            "",
            self.style.dim(number),
            "",
            self.style.verdict(self.verdict, caret),
        );
        self.line(lines);
    }

    /// The excerpt, and what it leaves out.
    fn story(&mut self, device: &DeviceRun, case: &CaseRun) {
        let room = SCREEN.saturating_sub(self.text.lines().count()).max(LEAST);
        let story = Story::of(device, case, room);
        if let Some(reads) = &story.reads {
            self.named("reads", reads);
        }
        let mut label = "last PDOs";
        for place in &story.pdos {
            let (stamped, meaning) = story.frame(*place);
            let at = case.since_begin(stamped.at);
            self.named(std::mem::take(&mut label), &one_line(&format!("{at} {meaning}")));
        }
        self.field("frames", &story.frames);
        self.lines(case, &story);
        if let Some(left_out) = &story.left_out {
            self.field("left out", left_out);
        }
    }

    fn lines(&mut self, case: &CaseRun, story: &Story) {
        let width = story.shown().map(|shown| length(&shown.frame)).max().unwrap_or_default();
        for (at, line) in story.lines() {
            match line {
                Line::Again(times, frames) => self.aside(&again(*times, *frames)),
                Line::Left(count) => self.aside(&format!("{count} frames of this transfer")),
                Line::Frame(place) => {
                    let (stamped, meaning) = story.frame(*place);
                    self.frame(case, stamped, meaning, width);
                }
                Line::Done(Done::Step(text) | Done::Note(text)) => self.done(case, *at, text),
                Line::Done(Done::Bench(name, value)) => {
                    self.done(case, *at, &format!("bench: {name} = {value}"));
                }
            }
        }
    }

    fn aside(&mut self, text: &str) {
        self.line(format!("    {:>STAMP$}  ..  {text}", ""));
    }

    fn frame(&mut self, case: &CaseRun, seen: &Stamped, meaning: &str, width: usize) {
        let Stamped { at, frame, own } = seen;
        let direction = if *own { "TX" } else { "RX" };
        let frame_text = frame.to_string();
        let time = format!("{:>STAMP$}", case.since_begin(*at).to_string());
        let line = format!(
            "    {}  {direction}  {frame_text:<width$}  {}",
            self.style.dim(time),
            one_line(&self.names.in_text(meaning))
        );
        self.line(line);
    }

    fn done(&mut self, case: &CaseRun, at: Instant, text: &str) {
        let time = format!("{:>STAMP$}", case.since_begin(at).to_string());
        let line =
            format!("    {}  --  {}", self.style.dim(time), one_line(&self.names.in_text(text)));
        self.line(line);
    }
}

/// `24 times the two that follow`.
fn again(times: usize, frames: usize) -> String {
    let times = if times == 1 { "once".to_owned() } else { format!("{times} times") };
    match frames {
        1 => format!("{times} the one that follows"),
        2 => format!("{times} the two that follow"),
        many => format!("{times} the {many} that follow"),
    }
}

/// The marks below the stretch, and the blanks before them.
fn caret(place: &Excerpt) -> String {
    let width = place.source.chars().count();
    let before = (place.column.max(1) as usize - 1).min(width);
    let length = (place.length as usize).min(width - before).max(1);
    " ".repeat(before) + &"^".repeat(length)
}

/// The measurement of a case, and its limits.
pub(super) fn figures(measured: &Measured) -> String {
    let Measured { what, unit, count, min, mean, max, strict, lenient } = measured;
    let (min, mean, max) = (decimal(*min), decimal(*mean), decimal(*max));
    let values = plural(*count, "value");
    let mut text = format!("{what}: {count} {values}, {min} to {max} {unit}, mean {mean} {unit}");
    for (grade, limits) in [("strict", strict), ("lenient", lenient)] {
        if let Some(limits) = limits {
            let _ = write!(text, "\n{grade} limits {limits}");
        }
    }
    text
}

/// Three decimals at most.
fn decimal(figure: f64) -> String {
    let text = format!("{figure:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn length(frame: &Frame) -> usize {
    let id = if frame.id.is_extended() { 8 } else { 3 };
    id + 1 + if frame.remote { 2 } else { 2 * frame.data.len() }
}

/// The width of the labels and of the time stamps.
const LABEL: usize = 12;
const STAMP: usize = 11;
const INDENT: usize = 2 + LABEL;
/// How many lines a failure has, up to the end of its excerpt, and the excerpt at least.
const SCREEN: usize = 53;
const LEAST: usize = 24;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_marks_stay_within_the_line() {
        let place = |column, length| Excerpt {
            file: "a.yaml".into(),
            line: 1,
            column,
            length,
            source: "- nmt: start".into(),
            ..Excerpt::default()
        };
        assert_eq!(caret(&place(3, 3)), "  ^^^");
        assert_eq!(caret(&place(3, 900)), "  ^^^^^^^^^^");
        assert_eq!(caret(&place(900, 1)), "            ^");
        assert_eq!(caret(&place(0, 0)), "^");
    }

    #[test]
    fn figures_are_short() {
        for (figure, text) in [(20.0, "20"), (19.98765, "19.988"), (-0.0001, "0"), (0.5, "0.5")] {
            assert_eq!(decimal(figure), text);
        }
    }
}
