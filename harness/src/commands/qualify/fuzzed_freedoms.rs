//! The proof that `harness fuzz` accuses nobody: it finds nothing on a device as its documents say,
//! with each freedom, as each personality, and with random mixtures of freedoms.

use std::fmt::Write;
use std::sync::Arc;

use campaign::{Action, Campaign, Finding, Tally};
use canopen::catalogue::Catalogue;
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::freedom::{self, Freedom, Personality};
use runner::parallel::{self, processors};
use runner::stop::Stop;

use super::freedoms::mixtures as mixed;
use crate::cli::QualifyArgs;
use crate::commands::counted::counted;
use crate::commands::fuzz::{Modelled, stage};
use crate::exit::{Exit, Refused};
use crate::progress::Progress;
use crate::reporter::say;
use crate::target::{self, Selection, Target};

/// A device with its freedoms.
struct Home {
    device: Arc<ReferenceDevice>,
    target: Target,
    /// Sessions of the suites, where the reference device is the model.
    known: Arc<[Vec<Action>]>,
    freedoms: Vec<Freedom>,
    personalities: Vec<Personality>,
}

/// A device that keeps to its documents.
struct Subject<'h> {
    home: &'h Home,
    deviation: Deviation,
    is_mixture: bool,
}

/// What a campaign on it showed.
struct Fuzzed {
    /// How a target names it.
    name: String,
    tally: Tally,
    /// The freedoms that were learnt.
    learnt: usize,
    findings: Vec<Finding>,
}

/// How many findings end a campaign.
const FINDINGS: usize = 2;

/// Fuzzes each device, freedom, personality and mixture.
///
/// # Errors
/// When the data of a device or of a freedom do not load.
pub(super) fn run(args: &QualifyArgs, sessions: u64) -> Result<Exit, Refused> {
    let catalogue = args.folders.catalogue.load()?;
    let names = match &args.device {
        Some(name) => target::with_variants(name, &catalogue)?,
        None => devices::names().map(str::to_owned).collect(),
    };
    let homes =
        names.iter().map(|name| Home::of(name, &catalogue, args)).collect::<Result<Vec<_>, _>>()?;
    let whole = homes.iter().map(|home| home.freedoms.len()).sum::<usize>().max(1);
    let mixtures = |home: &Home| (args.mixtures * home.freedoms.len()).div_ceil(whole);
    let subjects = homes.iter().flat_map(|home| home.subjects(mixtures(home), args.seed));
    let subjects: Vec<Subject<'_>> = subjects.filter(|it| it.is_wanted(&args.alone)).collect();
    let line = Progress::with_each(subjects.len(), "devices");
    let fuzzed = parallel::map(subjects, processors(), |subject| {
        line.each(|| subject.fuzzed(args, sessions))
    });
    drop(line);
    let fuzzed = fuzzed.into_iter().collect::<Result<Vec<_>, _>>()?;
    say(&table(&fuzzed, args.verbose));
    let found = fuzzed.iter().any(|one| !one.findings.is_empty());
    Ok(if found { Exit::Findings } else { Exit::Green })
}

impl Home {
    fn of(name: &str, catalogue: &Catalogue, args: &QualifyArgs) -> Result<Self, Refused> {
        let device = target::reference_device(name, catalogue)?;
        let selection = Selection::of_target(Some(&format!("sim:{name}")));
        let target = target::resolve(&selection, catalogue, &Stop::default())?.remove(0);
        let (freedoms, personalities) = (freedom::of(&device)?, freedom::personalities(&device)?);
        let modelled = Modelled::of(&target, &mut stage::simulated(&target)?, None)?;
        let modelled = modelled.knowing(&args.folders, &target.dut, &Stop::default())?;
        let known = modelled.blueprint.known().into();
        Ok(Self { device, target, known, freedoms, personalities })
    }

    /// The device as it is, and with everything that documents allow.
    fn subjects(&self, mixtures: usize, seed: u64) -> impl Iterator<Item = Subject<'_>> {
        let freedoms = &self.freedoms;
        let several = if freedoms.len() > 1 { mixtures } else { 0 };
        let drawn = mixed(&self.device, freedoms, several, seed);
        let drawn = drawn
            .into_iter()
            .map(|(places, _)| freedom::mixture(places.iter().map(|place| &freedoms[*place])));
        let all = std::iter::once(Deviation::default())
            .chain(freedoms.iter().map(Freedom::deviation))
            .chain(self.personalities.iter().map(Personality::deviation));
        let all = all.map(|deviation| (deviation, false)).chain(drawn.map(|it| (it, true)));
        all.map(|(deviation, is_mixture)| Subject { home: self, deviation, is_mixture })
    }
}

impl Subject<'_> {
    /// How a target names it.
    fn name(&self) -> String {
        let device = &self.home.target.dut.name;
        match self.deviation.query.as_str() {
            "" => format!("sim:{device}"),
            query => format!("sim:{device}?{query}"),
        }
    }

    /// Whether it is one of those that were asked for; all of them when none was.
    fn is_wanted(&self, only: &[String]) -> bool {
        let holds = |text: &String| match text.as_str() {
            "mixture" => self.is_mixture,
            text => self.name().contains(text),
        };
        only.is_empty() || only.iter().any(holds)
    }

    fn fuzzed(self, args: &QualifyArgs, sessions: u64) -> Result<Fuzzed, Refused> {
        let name = self.name();
        let Self { home, deviation, .. } = self;
        let target = home.target.deviating(deviation)?;
        let mut stage = stage::simulated(&target)?;
        let modelled = Modelled::of(&target, &mut stage, None)?;
        let modelled = modelled.knowing_these(&home.known);
        let mut campaign = Campaign::new(&modelled.blueprint, modelled.belief()?, args.seed);
        let mut findings = Vec::new();
        for number in 0..sessions {
            let found = campaign.session(&mut stage, number);
            findings.extend(found.map_err(|error| Refused::bus(error.to_string()))?);
            if findings.len() >= FINDINGS {
                break;
            }
        }
        let learnt = campaign.belief().freedoms().count();
        Ok(Fuzzed { name, tally: campaign.tally().clone(), learnt, findings })
    }
}

/// What was found, and the sums.
fn table(all: &[Fuzzed], verbose: bool) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for Fuzzed { name, tally, learnt, findings } in all {
        if verbose {
            let Tally { sessions, actions, void, .. } = tally;
            _ = writeln!(
                text,
                "  {name}: {sessions} sessions, {actions} actions, {void} cut short, \
                 {learnt} learnt, {} found",
                findings.len(),
            );
        }
        for finding in findings {
            _ = writeln!(text, "FOUND {name}: session {}: {}", finding.number, finding.violation);
        }
    }
    let wrong = all.iter().filter(|one| !one.findings.is_empty()).count();
    _ = writeln!(
        text,
        "{} with {} and {} actions: something found on {wrong}",
        counted(all.len(), "device"),
        counted(all.iter().map(|one| one.tally.sessions as usize).sum(), "session"),
        all.iter().map(|one| one.tally.actions).sum::<u64>(),
    );
    text
}
