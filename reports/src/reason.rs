//! The reasons why cases did not run: words in them, by which reports find what the user can
//! change, and what they have in common.

use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Stands before what protects a device from a case: `` `stores: 0` in dut.yaml:12 ``.
pub const PROTECTED_BY: &str = ": protected by ";

/// An object that a case needs, chosen by its `LowLimit` in the data sheet.
pub const LOWER_LIMIT: &str = "with a lower limit";

/// An object that a case needs, chosen by its `HighLimit` in the data sheet.
pub const UPPER_LIMIT: &str = "with an upper limit";

/// Stands before the name that a case asks a bench for: `` the bench does not offer `power` ``.
pub const NOT_ON_BENCH: &str = "the bench does not offer ";

/// Reasons that differ in the object or the name at their end.
pub(crate) struct Alike<'r> {
    reason: &'r str,
    /// What stands at their ends, and how often.
    about: BTreeMap<&'r str, usize>,
}

/// The reasons by what they have in common, the most frequent first.
pub(crate) fn alike<'r>(reasons: impl Iterator<Item = &'r str>) -> Vec<Alike<'r>> {
    let mut all = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
    for reason in reasons {
        let (reason, about) = split(reason);
        *all.entry(reason).or_default().entry(about).or_default() += 1;
    }
    let mut all: Vec<Alike<'_>> =
        all.into_iter().map(|(reason, about)| Alike { reason, about }).collect();
    all.sort_by_key(|alike| Reverse(alike.count()));
    all
}

impl Alike<'_> {
    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.about.values().sum()
    }

    /// The reason, and `most` of what stands at its ends.
    pub(crate) fn text(&self, most: usize) -> String {
        format!("{}{}", self.reason, counted(&self.about, most))
    }
}

/// A reason, and the object or the quoted name at its end.
fn split(reason: &str) -> (&str, &str) {
    let is_object = |word: &str| {
        let hex = |digits: &str| digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        word.split_once(':').is_some_and(|(index, sub)| index.len() == 4 && hex(index) && hex(sub))
    };
    match reason.rfind(' ') {
        Some(place) if is_object(&reason[place + 1..]) || reason.ends_with('`') => {
            reason.split_at(place + 1)
        }
        _ => (reason, ""),
    }
}

/// The subjects of a reason, the most frequent first, and how many more there are than `most`.
pub(crate) fn counted(about: &BTreeMap<&str, usize>, most: usize) -> String {
    let mut about: Vec<_> = about.iter().collect();
    about.sort_by_key(|(_, count)| Reverse(**count));
    let alone = about.len() == 1;
    let words: Vec<String> = about
        .into_iter()
        .map(|(what, count)| match count {
            1 => (*what).to_owned(),
            _ if alone => (*what).to_owned(),
            count => format!("{what} ({count})"),
        })
        .collect();
    listed(&words, most)
}

/// The labels, and how many more there are than `most`.
pub(crate) fn listed(labels: &[String], most: usize) -> String {
    match labels.len() {
        many if many > most.saturating_add(1) => {
            format!("{} and {} more", labels[..most].join(", "), many - most)
        }
        _ => labels.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_end_with_what_they_are_about() {
        for (reason, parts) in [
            ("the data sheet has no object 1F80:00", ("the data sheet has no object ", "1F80:00")),
            ("the bench has no `lamp`", ("the bench has no ", "`lamp`")),
            ("object 1014:00 is ro", ("object 1014:00 is ro", "")),
            ("interrupted", ("interrupted", "")),
        ] {
            assert_eq!(split(reason), parts);
        }
    }

    #[test]
    fn the_most_frequent_first() {
        let about = BTreeMap::from([("1006:00", 1), ("1019:00", 3), ("1012:00", 2)]);
        assert_eq!(counted(&about, 2), "1019:00 (3), 1012:00 (2), 1006:00");
        assert_eq!(counted(&about, 1), "1019:00 (3) and 2 more");
        assert_eq!(counted(&BTreeMap::from([("1006:00", 5)]), 1), "1006:00");
    }
}
