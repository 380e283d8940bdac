//! What reports and suites say beside names of their own: verdicts, steps, names of the bench, and
//! the numbers of CiA's conformance test.

use std::collections::{BTreeMap, BTreeSet};

use canopen::bench::{NAMES, is_known};
use reports::Verdict;
use runner::suite::step::Step;
use runner::suite::suite_schema;

use super::{Book, Page, full_name};

/// The notation, for people.
const NOTATION: &str = include_str!("../../../../suites/README.md");

impl Book {
    /// Explains such a word.
    pub(super) fn word(&self, name: &str) -> Option<String> {
        verdict(name)
            .or_else(|| self.test_number(name))
            .or_else(|| self.of_bench(name))
            .or_else(|| self.of_suites(name))
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
            page.field("words", &format!("{}, those of an entry: {index:04X}:01", known.len()));
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
        verdicts.chain(numbers).chain(NAMES.iter().map(|name| (*name).to_owned()))
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

fn verdict(name: &str) -> Option<String> {
    let verdict = Verdict::ALL.into_iter().find(|verdict| verdict.name() == name)?;
    let mut page = Page::new(format!("verdict {name}"));
    page.field("means", verdict.meaning());
    Some(page.0)
}

/// A step of the notation, described by the schema of suites.
pub(super) fn step(name: &str) -> Option<String> {
    let schema = suite_schema();
    let variants = schema["definitions"]["Step"]["oneOf"].as_array()?;
    let variant = variants.iter().find(|variant| !variant["properties"][name].is_null())?;
    let mut page = Page::new(format!("step {name}"));
    page.field("does", &one_line(variant["description"].as_str()?));
    if let Some((form, says)) = row_of_step(name) {
        page.field("written", &form.replace('`', ""));
        page.field("says", &says.replace('`', ""));
    }
    let target = variant["properties"][name]["$ref"]
        .as_str()
        .or_else(|| variant["properties"][name]["allOf"][0]["$ref"].as_str());
    let definition = target.and_then(|target| target.rsplit('/').next());
    let keys = definition.map(|definition| &schema["definitions"][definition]["properties"]);
    for (key, value) in keys.and_then(|keys| keys.as_object()).into_iter().flatten() {
        let means = value["description"].as_str().unwrap_or_default();
        page.field(key, &one_line(means));
    }
    Some(page.0)
}

/// What the table of the notation says of a step: how it is written, and what it does then.
fn row_of_step(name: &str) -> Option<(&'static str, &'static str)> {
    let rows = NOTATION.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |"));
    let mut cells = rows.filter_map(|row| row.split_once("` | "));
    let begins = |form: &str| form.strip_prefix(name).is_some_and(|rest| rest.starts_with(": "));
    cells.find(|(form, _)| begins(form))
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
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

    #[test]
    fn every_step_says_how_it_is_written() {
        let schema = suite_schema();
        let variants = schema["definitions"]["Step"]["oneOf"].as_array().unwrap();
        let names = variants.iter().flat_map(|it| it["properties"].as_object().unwrap().keys());
        let without: Vec<&String> = names.filter(|name| row_of_step(name).is_none()).collect();
        // The first one stands beside `sync`, and the others are of tables and named steps.
        assert_eq!(without, ["produce", "for", "rows", "steps", "use"]);
        assert!(row_of_step("measure").unwrap().0.contains("{ frame, count, interval"));
    }
}
