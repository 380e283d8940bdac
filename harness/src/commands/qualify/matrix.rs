//! The kill matrix: every mutant meets the cases of the requirements it breaks.
//!
//! Mutants that any device can be are proved on the device with everything, and so are the suites
//! for any device; a device's own mutants and suites are proved on that device and its variants.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use reference_devices::devices;
use reference_devices::mutant::{Mistake, Mutant};
use reports::Verdict;
use runner::parallel;
use runner::run::Ending;
use runner::suite::model::Case;
use runner::suite::{Library, Suite};

use super::assertion::Assertion;
use super::trial::{Clean, Fits, Wanted};
use crate::commands::check::mutants_proved_on;
use crate::commands::counted::counted;
use crate::exit::Refused;
use crate::progress::Progress;

/// The results of each case on each mutant of one device.
pub(super) struct Matrix {
    device: String,
    /// Whether it is a variant of another one.
    is_variant: bool,
    /// The verdicts of the clean device, by case.
    clean: BTreeMap<String, BTreeSet<Verdict>>,
    /// The allowances of the cases that the clean device uses.
    allowed: BTreeSet<Assertion>,
    rows: Vec<Row>,
    /// The mutants of a user's device that break nothing of what was read.
    left_out: Vec<String>,
}

/// The results of one mutant.
struct Row {
    mutant: Mutant,
    /// The cases that fail.
    kills: BTreeSet<String>,
    /// The requirements that the mutant breaks and such a case checks.
    proved: BTreeSet<String>,
    /// The assertions without which a case would have passed.
    assertions: BTreeSet<Assertion>,
    /// The steps that fail, although without them another one would.
    failing: BTreeSet<Assertion>,
    ending: Ending,
}

impl Matrix {
    /// The results of the selected cases on the mutants of these devices.
    ///
    /// # Errors
    /// When the data of a mutant do not load.
    pub(super) fn of(cleans: &[Clean], fits: &Fits) -> Result<Vec<Self>, Refused> {
        let proved = |clean: &Clean| mutants_proved_on(&clean.device);
        let (mut work, mut left_out) = (Vec::new(), Vec::new());
        for (place, mut mutants) in parallel::try_map(cleans, proved)?.into_iter().enumerate() {
            let register = &cleans[place].library.register;
            let is_ours = devices::names().any(|name| name == cleans[place].name());
            let mut unread = Vec::new();
            mutants.retain(|mutant| {
                let applies = |id: &String| !register.lacks_document_of(id);
                let applies = mutant.canary || mutant.breaks.iter().any(applies);
                unread.extend((!applies && !is_ours).then(|| mutant.name.clone()));
                applies
            });
            left_out.push(unread);
            work.extend(mutants.into_iter().map(|mutant| (place, mutant)));
        }
        let line = Progress::with_each(work.len(), "mutants");
        let tried =
            |(place, mutant): &(usize, Mutant)| line.each(|| row(&cleans[*place], mutant, fits));
        let rows = parallel::try_map(&work, tried)?;
        let mut matrices: Vec<Self> = cleans.iter().map(Self::without_mutants).collect();
        for ((place, _), row) in work.iter().zip(rows) {
            matrices[*place].rows.push(row);
        }
        for (matrix, left_out) in matrices.iter_mut().zip(left_out) {
            matrix.left_out = left_out;
        }
        for (matrix, clean) in matrices.iter_mut().zip(cleans) {
            // A case that fails on the device without deviation says nothing about a mutant.
            let held: BTreeSet<&String> =
                clean.trials.iter().filter(|trial| trial.kills).map(|trial| &trial.case).collect();
            matrix.rows.iter_mut().for_each(|row| row.kills.retain(|case| !held.contains(case)));
        }
        Ok(matrices)
    }

    fn without_mutants(alone: &Clean) -> Self {
        let mut clean = BTreeMap::<String, BTreeSet<Verdict>>::new();
        let mut allowed = BTreeSet::new();
        for trial in &alone.trials {
            allowed.extend(Assertion::used_by(&trial.case, &trial.shown));
            clean.entry(trial.case.clone()).or_default().insert(trial.verdict);
        }
        let device = alone.name().to_owned();
        let is_variant = device != alone.device.first;
        Self { device, is_variant, clean, allowed, rows: Vec::new(), left_out: Vec::new() }
    }

    /// Whether suites of that device are proved on this one.
    pub(super) fn is_home_of(&self, suite: &Suite) -> bool {
        is_home(&self.device, suite)
    }

    /// The assertions that are proved, with what proves them.
    pub(super) fn proofs(&self) -> impl Iterator<Item = (&Assertion, &str)> {
        let device = self.device.as_str();
        let allowed = self.allowed.iter().map(move |assertion| (assertion, device));
        let demanded = self.rows.iter().flat_map(|row| {
            row.assertions.iter().map(|assertion| (assertion, row.mutant.name.as_str()))
        });
        allowed.chain(demanded)
    }

    /// The gap that mutants leave whose requirements were not read.
    fn unread(&self) -> Option<String> {
        let first = self.left_out.first()?;
        let (device, count) = (&self.device, self.left_out.len());
        let breaks = if count == 1 { "breaks" } else { "break" };
        Some(format!(
            "{device}: {}, {first} among them, {breaks} requirements of no register that was read: \
             --suites FOLDER names one",
            counted(count, "mutant"),
        ))
    }

    /// Which mutant is killed by which case.
    pub(super) fn kills(&self) -> impl Iterator<Item = (&str, &str)> {
        self.rows
            .iter()
            .flat_map(|row| row.kills.iter().map(|case| (row.mutant.name.as_str(), case.as_str())))
    }

    /// The name of the device.
    pub(super) fn device(&self) -> &str {
        &self.device
    }

    /// The steps that fail, although without them another one would.
    pub(super) fn failing(&self) -> impl Iterator<Item = &Assertion> {
        self.rows.iter().flat_map(|row| &row.failing)
    }

    /// The mistakes in source that its mutants are, and whether a case noticed them.
    pub(super) fn mistakes(&self) -> impl Iterator<Item = (Mistake, bool)> {
        self.rows.iter().filter_map(|row| Some((row.mutant.mistake?, !row.kills.is_empty())))
    }

    /// Adds the summary, and with `verbose` the rows.
    pub(super) fn show(&self, text: &mut String, verbose: bool) {
        let killed = self.rows.iter().filter(|row| !row.kills.is_empty()).count();
        let canaries = self.rows.iter().filter(|row| row.mutant.canary).count();
        let proved: BTreeSet<&String> = self.rows.iter().flat_map(|row| &row.kills).collect();
        // The user's own mutants have none.
        let canary = if canaries > 0 { format!(", {canaries} canary") } else { String::new() };
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{}: {}, {killed} killed{canary}; {} {}, {} of them killed a mutant of this device",
            self.device,
            counted(self.rows.len(), "mutant"),
            counted(self.clean.len(), "case"),
            if self.clean.len() == 1 { "applies" } else { "apply" },
            proved.len(),
        );
        for row in self.rows.iter().filter(|_| verbose) {
            let mark = match (row.mutant.canary, row.kills.is_empty()) {
                (true, true) => "survived, as a canary must".to_owned(),
                (true, false) => "a canary that was KILLED".to_owned(),
                (false, true) => format!("SURVIVED ({})", row.mutant.breaks.join(" ")),
                (false, false) => format!("killed ({})", row.mutant.breaks.join(" ")),
            };
            _ = writeln!(text, "  {}: {mark}", row.mutant.name);
            for case in &row.kills {
                _ = writeln!(text, "    {case}");
            }
        }
    }
}

/// The cases that notice a mutant: they fail on it, and not on the device without deviation.
///
/// # Errors
/// When the mutant cannot be built.
pub(in crate::commands) fn noticed_by(
    clean: &Clean,
    mutant: &Mutant,
) -> Result<BTreeSet<String>, Refused> {
    let mut kills = row(clean, mutant, &|_| true)?.kills;
    let held = clean.trials.iter().filter(|trial| trial.kills);
    held.for_each(|trial| _ = kills.remove(&trial.case));
    Ok(kills)
}

fn row(clean: &Clean, mutant: &Mutant, fits: &Fits) -> Result<Row, Refused> {
    let meets = |case: &Case| fits(case) && is_tried_on(mutant, case);
    let wanted = Wanted::Cases(&meets);
    let mut ran = clean.deviating(mutant.deviation(), &wanted)?;
    if let Some(deviation) = mutant.without_mistake() {
        // What is LENIENT without the mistake, too, is no kill.
        let held: BTreeSet<String> = clean
            .deviating(deviation, &wanted)?
            .trials
            .into_iter()
            .filter(|trial| trial.kills)
            .map(|trial| trial.name)
            .collect();
        ran.trials.iter_mut().for_each(|trial| trial.kills &= !held.contains(&trial.name));
    }
    let killing = || ran.trials.iter().filter(|trial| trial.kills);
    let assertions =
        killing().flat_map(|trial| Assertion::proved_by(&trial.case, &trial.shown)).collect();
    let failing = killing().filter_map(Assertion::failing).collect();
    let kills: BTreeSet<String> =
        ran.trials.into_iter().filter(|trial| trial.kills).map(|trial| trial.case).collect();
    let killing = ran.instances.iter().filter(|instance| kills.contains(&instance.case_name()));
    let proved = killing.flat_map(|instance| broken(mutant, instance.case())).cloned().collect();
    Ok(Row { mutant: mutant.clone(), kills, proved, assertions, failing, ending: ran.ending })
}

/// Whether the case meets the mutant: it checks something that the mutant breaks.
pub(super) fn is_tried_on(mutant: &Mutant, case: &Case) -> bool {
    mutant.canary || broken(mutant, case).next().is_some()
}

/// The requirements that the mutant breaks and the case checks.
fn broken<'m>(mutant: &'m Mutant, case: &'m Case) -> impl Iterator<Item = &'m String> {
    mutant.breaks.iter().filter(|id| case.checks.iter().any(|check| check.value == **id))
}

/// The gaps that the matrices leave; `judging` are the cases that judge a device with a freedom,
/// and `again` is the command that explains a mutant.
pub(super) fn holes<'f>(
    library: &Library,
    matrices: &[Matrix],
    judging: impl Iterator<Item = &'f String>,
    again: &str,
) -> Vec<String> {
    let mut holes = Vec::new();
    let (mut ran, mut proved) = (judging.cloned().collect::<BTreeSet<_>>(), BTreeSet::new());
    for matrix in matrices {
        let device = &matrix.device;
        holes.extend(matrix.unread());
        for (case, verdicts) in &matrix.clean {
            for verdict in verdicts.iter().filter(|verdict| **verdict >= Verdict::Fail) {
                holes
                    .push(format!("{device}: {case} is {verdict} on the device without deviation"));
            }
            let said = |verdict: &Verdict| !matches!(verdict, Verdict::Skip | Verdict::Blocked);
            if verdicts.iter().any(said) {
                ran.insert(case.clone());
            }
        }
        for row in &matrix.rows {
            let name = &row.mutant.name;
            proved.extend(row.kills.iter().cloned());
            match (row.mutant.canary, row.kills.is_empty()) {
                (true, false) => holes.push(format!(
                    "{device}: the canary {name} was killed, so a case fails without a cause"
                )),
                (false, true) => {
                    let end = match &row.ending {
                        Ending::Complete => "",
                        Ending::Nobody => ", and did not answer at all",
                        Ending::Gone(_) => ", and stopped answering",
                        Ending::Bus(_) => ", and the bus failed",
                        Ending::Enough(_) => ", and not all of them ran",
                    };
                    holes.push(format!(
                        "{device}: mutant {name} survived the cases of what it breaks{end}; \
                         `{again} --why {name}` shows what it changed"
                    ));
                }
                _ => {}
            }
        }
        // That nothing fails without a cause is proved once, on the devices of the program.
        let is_ours = devices::names().any(|name| name == device);
        if is_ours && !matrix.is_variant && !matrix.rows.iter().any(|row| row.mutant.canary) {
            holes.push(format!(
                "{device}: there is no canary, a mutant with `canary: true` whose change cannot \
                 be seen"
            ));
        }
    }
    let requirements: BTreeSet<&String> =
        matrices.iter().flat_map(|matrix| &matrix.rows).flat_map(|row| &row.proved).collect();
    let broken = matrices.iter().flat_map(|matrix| &matrix.rows).flat_map(|row| &row.mutant.breaks);
    for id in broken.collect::<BTreeSet<_>>() {
        if !requirements.contains(id) && !library.register.lacks_document_of(id) {
            holes
                .push(format!("{id}: no mutant that breaks it is killed by a case that checks it"));
        }
    }
    let proving: BTreeSet<&str> = matrices.iter().map(|matrix| matrix.device.as_str()).collect();
    for suite in &library.suites {
        let device = home(suite);
        for case in suite.file.cases.iter().filter(|_| proving.contains(device)) {
            let name = format!("{}/{}", suite.name(), case.value.id.value);
            if !ran.contains(&name) {
                holes.push(format!("case {name} is skipped on {device}, whatever freedom it uses"));
            } else if !proved.contains(&name) {
                holes.push(format!("case {name} kills no mutant of a requirement it checks"));
            }
        }
    }
    holes
}

/// Whether the cases of a suite are proved on that device.
pub(super) fn is_home(device: &str, suite: &Suite) -> bool {
    home(suite) == device
}

/// The device on which the cases of a suite are proved, with its variants: the one it is for, the
/// one that bears the name of its profile, else the one with everything.
pub(super) fn home(suite: &Suite) -> &str {
    let device = suite.file.device.as_ref().map(|device| device.value.as_str());
    let of_profile =
        suite.profile().and_then(|profile| devices::with_variants(&profile.name).next());
    device.or(of_profile).unwrap_or(devices::WITH_EVERYTHING)
}
