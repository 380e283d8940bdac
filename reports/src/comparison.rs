//! What is different from an earlier run: which causes are new, which are cured, which are not
//! decided now, and which cases changed.

use std::cmp::Reverse;
use std::fmt::Write as _;

use crate::verdict::Verdict;

/// What is different from an earlier run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// This run and the earlier one, each by target, devices and time.
    pub runs: [String; 2],
    /// What makes the run red, or is tolerated or waived, and did not before.
    pub new: Vec<KnownCause>,
    /// What did before, and does no longer: all its cases ran and are decided.
    pub cured: Vec<KnownCause>,
    /// What did before and does not occur, while some of its cases did not run or are not decided.
    pub not_decided: Vec<KnownCause>,
    /// The causes that are in both.
    pub as_before: Vec<Verdict>,
    /// The cases that came out otherwise.
    pub changed: Vec<Change>,
    /// The characteristics that moved by more than their noise.
    pub moved: Vec<Moved>,
    /// Whether a case is red that was not.
    pub is_regression: bool,
}

/// A cause of one of the runs.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct KnownCause {
    /// Device, service and cause.
    pub text: String,
    /// The heaviest verdict of its cases.
    pub verdict: Verdict,
}

/// A case that came out otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The device.
    pub device: String,
    /// The full name of the instance.
    pub name: String,
    /// Its verdict before; `None` when it was not in the earlier run.
    pub before: Option<Verdict>,
    /// Its verdict now; `None` when it is not in this run.
    pub now: Option<Verdict>,
}

/// A characteristic that moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// The device.
    pub device: String,
    /// The quantity, such as `reset node to boot-up`.
    pub what: &'static str,
    /// Which of its figures: `median` or `99 %`.
    pub figure: &'static str,
    /// Of the figures: `ms` or `%`.
    pub unit: &'static str,
    /// The figure in the earlier run.
    pub before: f64,
    /// The figure in this run.
    pub now: f64,
}

impl Comparison {
    /// Whether nothing is different.
    pub fn is_empty(&self) -> bool {
        self.new.is_empty()
            && self.cured.is_empty()
            && self.not_decided.is_empty()
            && self.changed.is_empty()
            && self.moved.is_empty()
    }

    /// The changes that are told one by one, those that need work first. A case that is BLOCKED
    /// now follows from another that is told, and one that did not run says nothing.
    pub(crate) fn told(&self) -> impl Iterator<Item = &Change> {
        self.changed.iter().filter(|change| !change.says_nothing())
    }

    /// How many cases are BLOCKED that were not, and how many did not run that did.
    pub(crate) fn untold(&self) -> Vec<String> {
        let counted = |now: Option<Verdict>, said: &str| {
            let count = self.changed.iter().filter(|change| change.now == now).count();
            let cases = if count == 1 { "case" } else { "cases" };
            (count > 0).then(|| format!("{count} {cases}: {said}"))
        };
        let lines = [(Some(Verdict::Blocked), "now BLOCKED"), (None, "not run now")];
        lines.into_iter().filter_map(|(now, said)| counted(now, said)).collect()
    }

    /// The causes that are different, each with what happened to it.
    pub(crate) fn causes(&self) -> impl Iterator<Item = (&'static str, &KnownCause)> {
        let parts = [("new", &self.new), ("cured", &self.cured), ("open", &self.not_decided)];
        parts.into_iter().flat_map(|(what, causes)| causes.iter().map(move |cause| (what, cause)))
    }

    /// In words, for a terminal: what is new, what is cured, what is not decided now, and which
    /// cases changed.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for (what, cause) in self.causes() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{what:<8}{}", cause.text.replace('\n', " "));
        }
        for change in self.told().take(MOST_CHANGES) {
            let _ = writeln!(text, "changed {}", change.text());
        }
        let more = self.told().count().saturating_sub(MOST_CHANGES);
        if more > 0 {
            let _ = writeln!(text, "changed {more} more");
        }
        for line in self.untold() {
            let _ = writeln!(text, "changed {line}");
        }
        for moved in &self.moved {
            let _ = writeln!(text, "moved   {}", moved.text());
        }
        text + &self.last_line()
    }

    /// The numbers, in one line.
    pub fn last_line(&self) -> String {
        let as_before = kinds(self.as_before.iter().copied());
        if self.is_empty() {
            let causes = causes_of(self.as_before.len());
            return format!("as before: {causes} known{as_before}, no case changed\n");
        }
        let of = |causes: &[KnownCause]| kinds(causes.iter().map(|it| it.verdict));
        let cases = if self.changed.len() == 1 { "case" } else { "cases" };
        format!(
            "{} new{}, {} cured{}, {} as before{as_before}, {} not decided now{}, {} {cases} \
             changed{}\n",
            causes_of(self.new.len()),
            of(&self.new),
            self.cured.len(),
            of(&self.cured),
            self.as_before.len(),
            self.not_decided.len(),
            of(&self.not_decided),
            self.changed.len(),
            if self.is_regression { ": a regression" } else { "" }
        )
    }
}

impl Change {
    const fn says_nothing(&self) -> bool {
        matches!(self.now, None | Some(Verdict::Blocked))
    }

    /// Its place in the order of what matters: what is red or tolerated now comes first, what says
    /// nothing last.
    pub(crate) const fn rank(&self) -> u8 {
        match self.now {
            Some(Verdict::Fail) => 0,
            Some(Verdict::Error) => 1,
            Some(Verdict::Flaky) => 2,
            Some(Verdict::Lenient) => 3,
            Some(Verdict::Waived) => 4,
            Some(Verdict::Pass) => 5,
            Some(Verdict::Skip) => 6,
            None => 7,
            Some(Verdict::Blocked) => 8,
        }
    }

    /// `generic cia301/nmt/boot-up: PASS, now FAIL`.
    pub fn text(&self) -> String {
        let verdict = |it: Option<Verdict>| it.map_or("not run", Verdict::name);
        format!(
            "{} {}: {}, now {}",
            self.device,
            self.name,
            verdict(self.before),
            verdict(self.now)
        )
    }
}

impl Moved {
    /// `generic reset node to boot-up: median 10 ms, now 25 ms`.
    pub fn text(&self) -> String {
        let Self { device, what, figure, unit, before, now } = self;
        format!("{device} {what}: {figure} {before} {unit}, now {now} {unit}")
    }
}

/// How many changed cases are listed.
pub(crate) const MOST_CHANGES: usize = 50;

/// ` (4 FAIL, 2 LENIENT)`, of causes that are not all FAIL; else nothing.
pub(crate) fn kinds(verdicts: impl Iterator<Item = Verdict>) -> String {
    let verdicts: Vec<Verdict> = verdicts.collect();
    let count = |of: Verdict| verdicts.iter().filter(|it| **it == of).count();
    if count(Verdict::Fail) == verdicts.len() {
        return String::new();
    }
    let mut all = Verdict::ALL;
    all.sort_by_key(|verdict| Reverse(verdict.weight()));
    let said = all.into_iter().map(|verdict| (count(verdict), verdict));
    let said = said.filter(|(count, _)| *count > 0);
    let said: Vec<String> = said.map(|(count, verdict)| format!("{count} {verdict}")).collect();
    format!(" ({})", said.join(", "))
}

fn causes_of(count: usize) -> String {
    if count == 1 { "1 cause".to_owned() } else { format!("{count} causes") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_needs_work_is_read_first_and_what_says_nothing_is_counted() {
        let now = [
            ("a", Some(Verdict::Blocked)),
            ("b", Some(Verdict::Pass)),
            ("c", Some(Verdict::Lenient)),
            ("d", Some(Verdict::Blocked)),
            ("e", Some(Verdict::Error)),
            ("f", None),
            ("g", Some(Verdict::Fail)),
        ];
        let change = |(name, now): (&str, _)| Change {
            device: "pump".to_owned(),
            name: name.to_owned(),
            before: Some(Verdict::Skip),
            now,
        };
        let mut changed = now.map(change).to_vec();
        changed.sort_by_key(Change::rank);
        let text = Comparison { changed, ..Comparison::default() }.text();
        let expected = [
            "changed pump g: SKIP, now FAIL",
            "changed pump e: SKIP, now ERROR",
            "changed pump c: SKIP, now LENIENT",
            "changed pump b: SKIP, now PASS",
            "changed 2 cases: now BLOCKED",
            "changed 1 case: not run now",
            "0 causes new, 0 cured, 0 as before, 0 not decided now, 7 cases changed",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    }
}
