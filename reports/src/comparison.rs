//! What is different from an earlier run: which causes are new, which are cured, which are not
//! decided now, and which cases changed.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::verdict::Verdict;

/// What is different from an earlier run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// This run and the earlier one, each by target, devices and time.
    pub runs: [String; 2],
    /// What a reader has to know before the rest: that both runs tested the same program.
    pub notes: Vec<String>,
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

    /// The changes that are told one by one, those that need work first. What follows from another
    /// that is told, or did not run, is counted.
    pub(crate) fn told(&self) -> impl Iterator<Item = &Change> {
        self.changed.iter().filter(|change| !change.follows())
    }

    /// How many changes are not told one by one when `listed` of the others are, by their kind.
    pub(crate) fn untold(&self, listed: usize) -> Vec<String> {
        let rest = self.changed.iter().filter(|change| change.follows());
        let mut kinds = BTreeMap::new();
        for change in self.told().skip(listed).chain(rest) {
            *kinds.entry((change.rank(), change.verdicts())).or_insert(0_usize) += 1;
        }
        let counted = |((_, verdicts), count): ((u8, String), usize)| {
            let cases = if count == 1 { "case" } else { "cases" };
            format!("{count} {cases}: {verdicts}")
        };
        kinds.into_iter().map(counted).collect()
    }

    /// What is different, line by line, each with its kind: causes that are `new`, `cured` or not
    /// decided (`open`), cases that `changed`, characteristics that `moved`. Many of a kind leave
    /// room for the next.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = Vec::new();
        for (kind, causes) in self.causes() {
            lines.extend(causes.iter().take(MOST).map(|it| (kind, it.text.replace('\n', " "))));
            let more = causes.len().saturating_sub(MOST);
            lines.extend((more > 0).then(|| (kind, format!("{more} more"))));
        }
        lines.extend(self.told().take(MOST).map(|it| ("changed", it.text())));
        lines.extend(self.untold(MOST).into_iter().map(|text| ("changed", text)));
        lines.extend(self.moved.iter().map(|it| ("moved", it.text())));
        lines
    }

    /// The causes that are different, by what happened to them.
    pub(crate) fn causes(&self) -> [(&'static str, &[KnownCause]); 3] {
        [("new", &self.new), ("cured", &self.cured), ("open", &self.not_decided)]
    }

    /// In words, for a terminal: which runs these are, what is different, and the numbers.
    pub fn text(&self) -> String {
        let [now, before] = &self.runs;
        // Writing to a string does not fail.
        let mut text = format!("{:<8}{now}\n{:<8}{before}\n", "now", "before");
        let notes = self.notes.iter().map(|note| ("note", note.clone()));
        for (kind, line) in notes.chain(self.lines()) {
            let _ = writeln!(text, "{kind:<8}{line}");
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
    /// Whether it says nothing of its own: what is or was BLOCKED follows from another case.
    const fn follows(&self) -> bool {
        matches!(
            (self.before, self.now),
            (_, None | Some(Verdict::Blocked)) | (Some(Verdict::Blocked), Some(Verdict::Pass))
        )
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
        format!("{} {}: {}", self.device, self.name, self.verdicts())
    }

    /// `PASS, now FAIL`.
    fn verdicts(&self) -> String {
        let verdict = |it: Option<Verdict>| it.map_or("not run", Verdict::name);
        format!("{}, now {}", verdict(self.before), verdict(self.now))
    }
}

impl Moved {
    /// `generic reset node to boot-up: median 10 ms, now 25 ms`.
    pub fn text(&self) -> String {
        let Self { device, what, figure, unit, before, now } = self;
        format!("{device} {what}: {figure} {before} {unit}, now {now} {unit}")
    }
}

/// How many lines of a kind are listed.
const MOST: usize = 50;

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
    fn what_needs_work_is_read_first_and_what_follows_is_counted() {
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
        // Cured causes are the reason why these pass.
        let blocked = Some(Verdict::Blocked);
        changed.extend(["h", "i"].map(|name| change((name, Some(Verdict::Pass)))));
        changed[7..].iter_mut().for_each(|change| change.before = blocked);
        changed.sort_by_key(Change::rank);
        let runs = ["pump, target can0", "pump, target can1"].map(str::to_owned);
        let text = Comparison { runs, changed, ..Comparison::default() }.text();
        let expected = [
            "now     pump, target can0",
            "before  pump, target can1",
            "changed pump g: SKIP, now FAIL",
            "changed pump e: SKIP, now ERROR",
            "changed pump c: SKIP, now LENIENT",
            "changed pump b: SKIP, now PASS",
            "changed 2 cases: BLOCKED, now PASS",
            "changed 1 case: SKIP, now not run",
            "changed 2 cases: SKIP, now BLOCKED",
            "0 causes new, 0 cured, 0 as before, 0 not decided now, 9 cases changed",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn many_of_a_kind_leave_room_for_the_next() {
        let cause = |text: String| KnownCause { text, verdict: Verdict::Fail };
        let change = |place: usize| Change {
            device: "pump".to_owned(),
            name: format!("case-{place}"),
            before: Some(if place < 60 { Verdict::Pass } else { Verdict::Fail }),
            now: Some(if place < 60 { Verdict::Fail } else { Verdict::Pass }),
        };
        let comparison = Comparison {
            new: (0..70).map(|place| cause(format!("new {place}"))).collect(),
            cured: vec![cause("the old one".to_owned())],
            changed: (0..65).map(change).collect(),
            ..Comparison::default()
        };
        let lines = comparison.lines();
        let said: Vec<_> = lines.iter().map(|(kind, text)| (*kind, text.as_str())).collect();
        for expected in [
            ("new", "20 more"),
            ("cured", "the old one"),
            ("changed", "10 cases: PASS, now FAIL"),
            ("changed", "5 cases: FAIL, now PASS"),
        ] {
            assert!(said.contains(&expected), "{expected:?} in {said:?}");
        }
    }
}
