//! The proof of the verdicts, in virtual time: what `harness qualify` proves, on a sample.

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use reference_devices::devices;
use reference_devices::mutant::Mutant;
use reports::Verdict;
use runner::parallel;
use runner::suite::Library;

use super::findings::Findings;
use crate::cli::SelfTestArgs;
use crate::commands::check::mutants_proved_on;
use crate::commands::counted::counted;
use crate::commands::qualify::{Clean, noticed_by};
use crate::exit::Refused;
use crate::progress::Progress;

/// Tests every reference device, each of which must be green.
///
/// # Errors
/// When the data of a device do not load.
pub(super) fn devices<'l>(
    library: &'l Library,
    findings: &mut Findings,
) -> Result<Vec<Clean<'l>>, Refused> {
    let names: Vec<String> = devices::names().map(str::to_owned).collect();
    let line = Progress::with_each(names.len(), "devices");
    let tested = |name: &String| line.each(|| Clean::of(library, name, &|_| true));
    let cleans = parallel::try_map(&names, tested)?;
    let (mut green, mut passed, mut skipped) = (0, 0, 0);
    for clean in &cleans {
        let is_red = |verdict: Verdict| verdict >= Verdict::Fail;
        let red: Vec<_> = clean.trials.iter().filter(|trial| is_red(trial.verdict)).collect();
        green += usize::from(red.is_empty());
        passed += clean.trials.iter().filter(|trial| trial.verdict == Verdict::Pass).count();
        skipped += clean.trials.iter().filter(|trial| trial.verdict == Verdict::Skip).count();
        if let Some(first) = red.first() {
            let (name, verdict, count) = (clean.name(), first.verdict, red.len());
            let case = &first.name;
            let cases = counted(count, "case");
            findings.wrong.push(format!(
                "{name} has no deviation and is not green in {cases}, first in {case}: {verdict}"
            ));
        }
    }
    let all = cleans.len();
    let cases = format!("{passed} cases passed, {skipped} skipped");
    findings.line("devices", &format!("{green} of {all} green: {cases}"));
    Ok(cleans)
}

/// Tries some mutants of each chapter of requirements. The cases of what they break must notice
/// them, and no case may notice a canary.
///
/// # Errors
/// When the data of a mutant do not load, or it cannot be built.
pub(super) fn mutants(
    cleans: &[Clean],
    args: &SelfTestArgs,
    findings: &mut Findings,
) -> Result<(), Refused> {
    let drawn = drawn(cleans, args)?;
    let line = Progress::with_each(drawn.len(), "mutants");
    let tried = parallel::try_map(&drawn, |(place, mutant)| {
        line.each(|| noticed_by(&cleans[*place], mutant))
    })?;
    let (mut red, mut green) = (0, 0);
    let mut documents = BTreeMap::<&str, usize>::new();
    for ((place, mutant), noticing) in drawn.iter().zip(&tried) {
        let (device, name) = (cleans[*place].name(), &mutant.name);
        match (mutant.canary, noticing.first()) {
            (true, None) => green += 1,
            (false, Some(_)) => {
                red += 1;
                let document = mutant.breaks[0].split('-').next().unwrap_or_default();
                *documents.entry(document).or_default() += 1;
            }
            (true, Some(case)) => findings
                .wrong
                .push(format!("{device}: nothing is wrong with {name}, and {case} fails on it")),
            (false, None) => findings.wrong.push(format!(
                "{device}: no case notices the mutant {name}, which breaks {}",
                mutant.breaks.join(", ")
            )),
        }
    }
    let canaries = drawn.iter().filter(|(_, mutant)| mutant.canary).count();
    let chapters: BTreeSet<&str> = drawn.iter().filter_map(|(_, it)| chapter(it)).collect();
    let broken = drawn.len() - canaries;
    let of = counted(chapters.len(), "chapter");
    findings.line("mutants", &format!("{red} of {broken} red by their own cases, of {of}"));
    let each = documents.iter().map(|(document, count)| format!("{document} {count}"));
    findings.line("", &each.collect::<Vec<_>>().join(", "));
    findings.line("canaries", &format!("{green} of {canaries} green, as they must be"));
    Ok(())
}

/// Some mutants of each chapter, with the device on which they are proved. A canary takes a whole
/// run, so that there are as many of them as of a chapter.
fn drawn(cleans: &[Clean], args: &SelfTestArgs) -> Result<Vec<(usize, Mutant)>, Refused> {
    let proved = parallel::try_map(cleans, |clean| mutants_proved_on(&clean.device))?;
    let mut chapters = BTreeMap::<Option<String>, Vec<(usize, Mutant)>>::new();
    for (place, mutants) in proved.into_iter().enumerate() {
        let register = &cleans[place].library.register;
        for mutant in mutants {
            let is_known = mutant.breaks.iter().any(|id| !register.lacks_document_of(id));
            if mutant.canary || is_known {
                let chapter = chapter(&mutant).map(str::to_owned);
                chapters.entry(chapter).or_default().push((place, mutant));
            }
        }
    }
    let mut random = Rng::with_seed(args.seed);
    let mut drawn = Vec::new();
    for mut mutants in chapters.into_values() {
        random.shuffle(&mut mutants);
        mutants.truncate(args.mutants.into());
        drawn.extend(mutants);
    }
    Ok(drawn)
}

/// The chapter of the first requirement that it breaks: `CIA301-NMT` of `CIA301-NMT-04`, `DRR460-7`
/// of `DRR460-7.3-02`. A canary breaks none.
fn chapter(mutant: &Mutant) -> Option<&str> {
    let first = mutant.breaks.first()?;
    let chapter = first.rsplit_once('-').map_or(first.as_str(), |(chapter, _)| chapter);
    chapter.split('.').next()
}
