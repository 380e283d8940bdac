//! What a run recorded.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use reports::{Keep, Run, Style, Verdict, terminal};

/// The run that a journal records.
pub(crate) fn read(journal: &Path) -> Run {
    fold(&fs::read_to_string(journal).expect("the run wrote its journal"))
}

/// The run that the text of a journal records.
pub(crate) fn fold(journal: &str) -> Run {
    Run::fold(journal, Keep::Unusual).expect("the journal reads")
}

/// The verdicts by device and instance.
pub(crate) fn verdicts(run: &Run) -> BTreeMap<(String, String), Verdict> {
    let named = run
        .cases()
        .map(|(device, case)| ((device.info.device.clone(), case.info.name()), case.verdict()));
    let all: BTreeMap<_, _> = named.collect();
    assert_eq!(all.len(), run.counts().total(), "no two instances have the same name");
    all
}

/// The instances that came out differently, with all that is known of those in `got`.
pub(crate) fn differences(expected: &Run, got: &Run) -> String {
    let expected = verdicts(expected);
    let mut unseen = expected.clone();
    let mut text = String::new();
    for (device, case) in got.cases() {
        let key = (device.info.device.clone(), case.info.name());
        unseen.remove(&key);
        let wanted = expected.get(&key).map_or("nothing", |verdict| verdict.name());
        if wanted != case.verdict().name() {
            let details = terminal::details(device, case, Style::default());
            text.push_str(&format!("{} instead of {wanted}: {}\n", case.verdict(), key.1));
            text.push_str(&details);
        }
    }
    unseen.iter().for_each(|((_, name), verdict)| {
        text.push_str(&format!("nothing instead of {verdict}: {name}\n"));
    });
    text
}
