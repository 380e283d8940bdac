//! What is different from an earlier run: which causes are new, which are cured, and which cases
//! changed.

use std::fmt::Write as _;

use crate::verdict::Verdict;

/// What is different from an earlier run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// What makes the run red, or is tolerated or waived, and did not before.
    pub new: Vec<String>,
    /// What did before, and does no longer.
    pub cured: Vec<String>,
    /// How many causes are in both.
    pub as_before: usize,
    /// The cases that came out otherwise.
    pub changed: Vec<Change>,
    /// The characteristics that moved by more than their noise.
    pub moved: Vec<Moved>,
    /// Whether a case is red that was not.
    pub is_regression: bool,
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
            && self.changed.is_empty()
            && self.moved.is_empty()
    }

    /// The changes that are told one by one, those that need work first. A case that is BLOCKED
    /// now follows from another that is told.
    pub(crate) fn told(&self) -> impl Iterator<Item = &Change> {
        self.changed.iter().filter(|change| change.now != Some(Verdict::Blocked))
    }

    /// How many cases are BLOCKED that were not.
    pub(crate) fn blocked(&self) -> Option<String> {
        match self.changed.len() - self.told().count() {
            0 => None,
            1 => Some("1 case: now BLOCKED".to_owned()),
            many => Some(format!("{many} cases: now BLOCKED")),
        }
    }

    /// In words, for a terminal: what is new, what is cured, and which cases changed.
    pub fn text(&self) -> String {
        let mut text = String::new();
        if self.is_empty() {
            return format!("as before: {} known, no case changed\n", causes_of(self.as_before));
        }
        for (heading, causes) in [("new", &self.new), ("cured", &self.cured)] {
            for cause in causes {
                // Writing to a string does not fail.
                let _ = writeln!(text, "{heading:<8}{}", cause.replace('\n', " "));
            }
        }
        for change in self.told().take(MOST_CHANGES) {
            let _ = writeln!(text, "changed {}", change.text());
        }
        let more = self.told().count().saturating_sub(MOST_CHANGES);
        if more > 0 {
            let _ = writeln!(text, "changed {more} more");
        }
        if let Some(blocked) = self.blocked() {
            let _ = writeln!(text, "changed {blocked}");
        }
        for moved in &self.moved {
            let _ = writeln!(text, "moved   {}", moved.text());
        }
        let _ = writeln!(
            text,
            "{} new, {} cured, {} as before, {} cases changed{}",
            causes_of(self.new.len()),
            self.cured.len(),
            self.as_before,
            self.changed.len(),
            if self.is_regression { ": a regression" } else { "" }
        );
        text
    }
}

impl Change {
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

fn causes_of(count: usize) -> String {
    if count == 1 { "1 cause".to_owned() } else { format!("{count} causes") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_needs_work_is_read_first_and_blocked_in_one_line() {
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
            "changed pump f: SKIP, now not run",
            "changed 2 cases: now BLOCKED",
            "0 causes new, 0 cured, 0 as before, 7 cases changed",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    }
}
