//! What reports and suites say beside names of their own: verdicts, steps, names of the bench, and
//! the numbers of CiA's conformance test.

use canopen::bench::{NAMES, is_known};
use reports::Verdict;
use runner::suite::step::Step;
use runner::suite::suite_schema;

use super::{Book, Page, full_name};

impl Book {
    /// Explains such a word.
    pub(super) fn word(&self, name: &str) -> Option<String> {
        verdict(name)
            .or_else(|| self.test_number(name))
            .or_else(|| step(name))
            .or_else(|| self.of_bench(name))
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

    fn of_bench(&self, name: &str) -> Option<String> {
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
        page.more("see `The bench` in suites/README.md");
        let cases = self.cases().filter(|(_, case)| case.value.all_steps().any(|s| uses(&s.value)));
        page.list("used in", cases.map(|(suite, case)| full_name(suite, case)).collect());
        Some(page.0)
    }
}

fn verdict(name: &str) -> Option<String> {
    let verdict = Verdict::ALL.into_iter().find(|verdict| verdict.name() == name)?;
    let mut page = Page::new(format!("verdict {name}"));
    page.field("means", verdict.meaning());
    Some(page.0)
}

/// A step of the notation, described by the schema of suites.
fn step(name: &str) -> Option<String> {
    let schema = suite_schema();
    let variants = schema["definitions"]["Step"]["oneOf"].as_array()?;
    let variant = variants.iter().find(|variant| !variant["properties"][name].is_null())?;
    let mut page = Page::new(format!("step {name}"));
    page.field("does", &one_line(variant["description"].as_str()?));
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

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
