//! What reports and suites say beside names of their own: verdicts, names of the bench, and the
//! numbers of CiA's conformance test.

use std::collections::{BTreeMap, BTreeSet};

use canopen::bench::{NAMES, is_known};
use reports::Verdict;
use runner::suite::step::Step;

use super::notation::{self, NOTATION};
use super::{Book, Page, full_name};

impl Book {
    /// Explains such a word.
    pub(super) fn word(&self, name: &str) -> Option<String> {
        verdict(name)
            .or_else(|| self.test_number(name))
            .or_else(|| self.of_bench(name))
            .or_else(|| self.of_suites(name))
            .or_else(|| notation::key(name))
            .or_else(|| of_guide(name))
    }

    /// What a word stands for in suites.
    pub(super) fn of_suites(&self, name: &str) -> Option<String> {
        let mut meanings = BTreeMap::<String, Vec<&str>>::new();
        for suite in &self.library.suites {
            if let Some(meaning) = suite.words.meaning(name) {
                meanings.entry(meaning).or_default().push(suite.name());
            }
        }
        let mut page = Page::new(format!("word {name}"));
        for (meaning, suites) in &meanings {
            page.field("stands for", meaning);
            let others = suites.len() - 1;
            let more = if others > 0 { format!(", and {others} more") } else { String::new() };
            page.field("in", &format!("{}{more}", suites[0]));
        }
        (!meanings.is_empty()).then_some(page.0)
    }

    /// The words by which suites call an entry, or all of an object, each with the value of one
    /// count. Of an object with many words, how many.
    pub(super) fn words_of_object(&self, index: u16, sub: Option<u8>) -> Option<String> {
        const MOST: usize = 16;
        let mut known = BTreeMap::<String, BTreeSet<&str>>::new();
        for suite in &self.library.suites {
            let words = suite.words.objects_of(index);
            let words = words.filter(|(mux, ..)| sub.is_none_or(|sub| sub == mux.sub));
            for (mux, word, count) in words {
                let unit = count.map(|count| format!(", {count} a count"));
                let said = format!("{mux} {word}{}", unit.unwrap_or_default());
                known.entry(said).or_default().insert(suite.name().split('/').next()?);
            }
        }
        let sub = sub.map_or_else(|| "h".to_owned(), |sub| format!(":{sub:02X}"));
        let mut page = Page::new(format!("words for {index:04X}{sub} in suites"));
        if known.len() > MOST {
            let shown = format!("{}; `harness explain {index:04X}:01` shows", known.len());
            page.field("words", &(shown + " those of one entry"));
            return Some(page.0);
        }
        for (said, folders) in &known {
            let folders: Vec<&str> = folders.iter().copied().collect();
            page.field("word", &format!("{said} ({})", folders.join(", ")));
        }
        (!known.is_empty()).then_some(page.0)
    }

    /// The words, for what was meant.
    pub(super) fn words(&self) -> impl Iterator<Item = String> {
        let verdicts = Verdict::ALL.into_iter().map(|verdict| verdict.name().to_owned());
        let numbers = self.library.test_map.iter().map(|entry| entry.value.number.value.clone());
        let names = NAMES.iter().map(|name| (*name).to_owned());
        verdicts.chain(numbers).chain(names).chain(notation::keys())
    }

    /// A check of CiA's conformance test, such as `2.19`.
    fn test_number(&self, name: &str) -> Option<String> {
        let mut entries = self.library.test_map.iter().map(|entry| &entry.value);
        let entry = entries.find(|entry| entry.number.value == name)?;
        let mut page = Page::new(format!("check {name} of CiA's conformance test"));
        page.field("checks", &entry.checks);
        page.list("made by", entry.cases.iter().map(|case| case.value.clone()).collect());
        if let Some(reason) = &entry.reason {
            page.field("not made", reason);
        }
        Some(page.0)
    }

    pub(super) fn of_bench(&self, name: &str) -> Option<String> {
        let family = NAMES.contains(&name);
        if !family && !is_known(name) {
            return None;
        }
        let means = |used: &str| match name.ends_with('-') {
            true => used.starts_with(name),
            false => used == name,
        };
        let uses = |step: &Step| match step {
            Step::Bench(stimuli) => stimuli.0.iter().any(|(name, _)| means(name)),
            Step::Observe(observe) => means(&observe.bench.value),
            _ => false,
        };
        let mut page = Page::new(format!("`{name}` of the bench"));
        page.field("means", "a stimulus or an observation on the physical side of the device");
        page.field("value", &bench_value(name).unwrap_or_default());
        let cases = self.cases().filter(|(_, case)| case.value.all_steps().any(|s| uses(&s.value)));
        page.list("used in", cases.map(|(suite, case)| full_name(suite, case)).collect());
        Some(page.0)
    }
}

/// What the table of the notation says of a name of the bench: its values, their unit and range.
fn bench_value(name: &str) -> Option<String> {
    let (_, bench) = NOTATION.split_once("\n## The bench\n")?;
    let rows = bench.lines().filter_map(|line| line.strip_prefix("| `"));
    let means = |known: &str| match known.strip_suffix('-') {
        Some(_) => name == known || is_known(name) && name.starts_with(known),
        None => name == known,
    };
    let mut cells = rows.filter_map(|row| row.strip_suffix(" |")?.split_once(" | "));
    let (_, value) =
        cells.find(|(names, _)| names.split(", ").any(|it| means(it.trim_matches('`'))))?;
    Some(value.replace('`', ""))
}

/// A word of the guide, by its table.
fn of_guide(name: &str) -> Option<String> {
    const GUIDE: &str = include_str!("../../../../docs/src/introduction.md");
    let (_, table) = GUIDE.split_once("\n## Words of this guide\n")?;
    let mut rows = table.lines().filter_map(|row| row.strip_prefix("| ")?.strip_suffix(" |"));
    let (word, means) = rows.find_map(|row| row.split_once(" | ").filter(|it| it.0 == name))?;
    let mut page = Page::new(format!("word {word} of the guide"));
    page.field("means", &means.replace('`', ""));
    Some(page.0)
}

fn verdict(name: &str) -> Option<String> {
    let verdict = Verdict::ALL.into_iter().find(|verdict| verdict.name() == name)?;
    let mut page = Page::new(format!("verdict {name}"));
    page.field("means", verdict.meaning());
    Some(page.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_the_bench_has_its_values() {
        for name in NAMES {
            assert!(bench_value(name).is_some(), "{name} has no row in suites/README.md");
        }
        assert!(bench_value("analogue-input-3").unwrap().contains("16 bits"));
    }
}
