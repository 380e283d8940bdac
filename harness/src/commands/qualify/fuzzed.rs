//! The proof of `harness fuzz`: it finds mutants of the stack on the device with everything, and
//! mutants of its own on a device with an application, and names the requirements that they break.

use std::collections::BTreeMap;
use std::fmt::Write;

use campaign::{Belief, Blueprint, Campaign, Finding, VirtualDevice};
use canopen::{Pattern, Word};
use reference_devices::devices::WITH_EVERYTHING;
use reference_devices::mutant::{self, Mutant};
use runner::parallel::{self, processors};
use runner::stop::Stop;

use crate::cli::QualifyArgs;
use crate::commands::counted::counted;
use crate::commands::fuzz::{Modelled, stage};
use crate::exit::{Exit, Refused};
use crate::progress::Progress;
use crate::reporter::say;
use crate::target::{self, Selection, Target};

/// The result of one mutant.
struct Fuzzed {
    mutant: Mutant,
    /// The number of the first session in which something was wrong.
    first: Option<u64>,
    /// Whether one of the first two guesses is a requirement that it breaks; `None` where nothing
    /// was found, or no guess was made.
    named: Option<bool>,
    /// The requirements that were guessed, the likeliest first.
    guesses: Vec<String>,
    /// How many actions show the first finding.
    actions: Option<usize>,
    /// What the device was taken for where nothing was found: freedoms that do the same.
    taken_for: Vec<String>,
    /// The freedoms beside those that the campaign has learnt, where nothing was found.
    learnt: Vec<String>,
    /// In how many sessions it may make a difference, where that is known.
    differs: Option<usize>,
}

impl Fuzzed {
    /// Why nothing was found, as far as it is known.
    fn why_not(&self) -> String {
        let drawn = match self.differs {
            Some(0) => ", never drawn".to_owned(),
            Some(count) => format!(", may make a difference in {}", counted(count, "session")),
            None => String::new(),
        };
        let learnt = match self.learnt.is_empty() {
            true => String::new(),
            false => format!(", learnt {}", self.learnt.join(" and ")),
        };
        format!("not found{drawn}{learnt}")
    }
}

/// How many sessions in which something is wrong lead to a guess.
const FINDINGS: usize = 4;
/// How many guesses count.
const GUESSES: usize = 2;

/// Fuzzes each mutant of the stack.
///
/// # Errors
/// When the data of the device or of a mutant do not load.
pub(super) fn run(args: &QualifyArgs, sessions: u64) -> Result<Exit, Refused> {
    let catalogue = args.folders.catalogue.load()?;
    let name = args.device.as_deref().unwrap_or(WITH_EVERYTHING);
    let selection = Selection::of_target(Some(&format!("sim:{name}")));
    let target = target::resolve(&selection, &catalogue, &Stop::default())?.remove(0);
    let device = target::reference_device(name, &catalogue)?;
    let mut mutants = mutant::of(&device)?;
    let modelled = Modelled::of(&target, &mut stage::simulated(&target)?, None)?;
    let explores = modelled.blueprint.surface().is_some();
    let known = modelled.knowing(&args.folders, &target.dut, &Stop::default())?;
    mutants.retain(|mutant| mutant.shared != explores && !mutant.canary);
    mutants.retain(|mutant| is_wanted(mutant, &args.alone));
    let why_left_out = |mutant: &Mutant| match explores {
        true => mutant.is_of_data_sheet().then_some(OF_DATA_SHEET),
        false => why_left_out(mutant, target.dut.node).or_else(|| {
            let unfit = mutant.deviation().complaints(&device).next().is_some();
            unfit.then_some("it is about an object that the device does not have")
        }),
    };
    let (mutants, left_out): (Vec<_>, Vec<_>) =
        mutants.into_iter().partition(|mutant| why_left_out(mutant).is_none());
    let differences = match explores {
        true => None,
        false => Some(Differences::of(&target, &known, &mutants, args.seed, sessions)?),
    };
    let trials = Trials { device: &target, like: &known, differences, seed: args.seed, sessions };
    let mutants: Vec<_> = mutants.into_iter().enumerate().collect();
    let line = Progress::with_each(mutants.len(), "mutants");
    let fuzzed = parallel::map(mutants, processors(), |(place, mutant): (usize, Mutant)| {
        line.each(|| trials.fuzz(mutant, args.guess_every > 0 && place % args.guess_every == 0))
    });
    drop(line);
    let fuzzed = fuzzed.into_iter().collect::<Result<Vec<_>, _>>()?;
    let left_out = left_out.iter().filter_map(|mutant| Some((why_left_out(mutant)?, mutant)));
    say(&(table(&fuzzed, args.verbose) + &rest(left_out, args.verbose)));
    Ok(Exit::Green)
}

/// Whether a mutant is one of those that were asked for; all of them when none was.
fn is_wanted(mutant: &Mutant, only: &[String]) -> bool {
    let holds = |text: &String| {
        mutant.name.contains(text) || mutant.breaks.first().is_some_and(|it| it.contains(text))
    };
    only.is_empty() || only.iter().any(holds)
}

/// Why a mutant is none that messages and states of the stack show, by the way it is made; `None`
/// when they do.
fn why_left_out(mutant: &Mutant, node: u8) -> Option<&'static str> {
    if mutant.is_of_data_sheet() {
        Some(OF_DATA_SHEET)
    } else if mutant.deviation().of_stack().is_none() {
        Some("the application deviates, which is not known of a device")
    } else if !mutant.breaks.is_empty() && mutant.breaks.iter().all(|it| it.starts_with(PROFILE)) {
        Some("the requirement is one of the profile, about what the application does")
    } else if mutant.deviation().frames(node).any(|(when, received, _)| {
        !is_predefined(when.id().raw(), node) || has_value(&when, received)
    }) {
        Some("it changes frames with an identifier or a value that one case chose, and no others")
    } else {
        None
    }
}

const OF_DATA_SHEET: &str = "the data sheet is wrong, and not the device";
/// The requirements of CiA 401.
const PROFILE: &str = "CIA401-";

/// Whether an identifier is one of the predefined connection set of a node, or of other nodes that
/// it may listen to, or of LSS.
fn is_predefined(id: u32, node: u8) -> bool {
    match id {
        0 | 0x80..=0x100 | 0x700..=0x77F | 0x7E4 | 0x7E5 => true,
        0x181..=0x67F => id & 0x7F == u32::from(node),
        _ => false,
    }
}

/// Whether a pattern fits frames with one value only: bytes other than 0 behind those that say what
/// the frame is about.
fn has_value(pattern: &Pattern, received: bool) -> bool {
    let words = pattern.words();
    let bits = |word: &Word| match word {
        Word::Bits { value, .. } => *value,
        Word::Name | Word::Open => 0,
    };
    let first = words.first().map_or(0, bits);
    let about = match (pattern.id().raw() & 0x780, received) {
        // The end of a block transfer has its checksum after the command.
        (0x580, false) | (0x600, true) if first >> 5 == 6 && first & 1 == 1 => 1,
        (0x580, false) if matches!(first >> 5, 2..=6) => 4,
        (0x600, true) if matches!(first >> 5, 1 | 2 | 4..=6) => 4,
        // The parts of an LSS message say what it is about, unless they are a whole number, which
        // one case chose. All ones are the end of its range.
        (0x780, _) => {
            let number = words.get(1..5).unwrap_or_default();
            let is_chosen = |word: &Word| !matches!(bits(word), 0 | 0xFF);
            match (number.is_empty(), number.iter().all(is_chosen)) {
                (false, true) => 1,
                _ if first == FASTSCAN => return false,
                _ => 5,
            }
        }
        (0x000, _) => return false,
        _ => 1,
    };
    words.iter().skip(about).any(|word| bits(word) != 0)
}

/// The command of a fastscan, whose last three bytes say what is asked.
const FASTSCAN: u8 = 0x51;

/// The mutants that are left out, by the reasons.
fn rest<'m>(left_out: impl Iterator<Item = (&'m str, &'m Mutant)>, verbose: bool) -> String {
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (reason, mutant) in left_out {
        reasons.entry(reason).or_default().push(&mutant.name);
    }
    let mut text = String::new();
    for (reason, names) in reasons {
        // Writing to a string cannot fail.
        _ = writeln!(text, "left out: {}: {reason}", counted(names.len(), "mutant"));
        names.iter().filter(|_| verbose).for_each(|name| _ = writeln!(text, "  {name}"));
    }
    text
}

/// The sessions of the device without deviation.
struct Differences {
    blueprint: Blueprint,
    /// For each of them the mutants that would make a difference, by their places in the blueprint.
    dissenting: Vec<Vec<usize>>,
}

impl Differences {
    fn of(
        target: &Target,
        known: &Modelled,
        mutants: &[Mutant],
        seed: u64,
        sessions: u64,
    ) -> Result<Self, Refused> {
        let blueprint = known.blueprint.clone();
        let all = blueprint.mutants().iter().enumerate();
        let places = all.filter(|(_, one)| mutants.iter().any(|other| other.name == one.name));
        let places: Vec<usize> = places.map(|(place, _)| place).collect();
        let numbers: Vec<u64> = (0..sessions).collect();
        let line = Progress::with_each(numbers.len(), "sessions without a mutant");
        let dissents = |number| {
            let belief = Belief::new(&blueprint, Vec::new());
            let belief = belief.ok_or_else(|| Refused::usage("the device cannot be built"))?;
            let campaign = Campaign::new(&blueprint, belief, seed);
            let played = campaign.play(&mut stage::simulated(target)?, number);
            let seen = played.map_err(|error| Refused::bus(error.to_string()))?.seen;
            Ok(campaign.dissenting(&seen, &places))
        };
        let dissenting =
            parallel::map(numbers, processors(), |number| line.each(|| dissents(number)));
        let dissenting = dissenting.into_iter().collect::<Result<_, Refused>>()?;
        Ok(Self { blueprint, dissenting })
    }

    /// Whether a session may go otherwise with a mutant.
    fn differs(&self, number: u64, mutant: Option<usize>) -> bool {
        mutant.is_none_or(|mutant| self.dissenting[number as usize].contains(&mutant))
    }

    /// In how many sessions a mutant may make a difference.
    fn count(&self, mutant: usize) -> usize {
        self.dissenting.iter().filter(|mutants| mutants.contains(&mutant)).count()
    }
}

/// What all mutants are tried with.
struct Trials<'t> {
    device: &'t Target,
    /// How the device without deviation is modelled.
    like: &'t Modelled,
    /// `None` where the model is the reference device.
    differences: Option<Differences>,
    seed: u64,
    sessions: u64,
}

impl Trials<'_> {
    /// Fuzzes the device with a mutant, and guesses which one it is where `guesses`.
    fn fuzz(&self, mutant: Mutant, guesses: bool) -> Result<Fuzzed, Refused> {
        let target = self.device.deviating(mutant.deviation())?;
        let mut stage = stage::simulated(&target)?;
        let explores = self.differences.is_none();
        let mut modelled = match explores {
            // The reference device is the model, whatever the device says of itself.
            true => self.like.clone(),
            false => Modelled::of(&target, &mut stage, None)?,
        };
        if modelled.blueprint.is_like(&self.like.blueprint) {
            // What one of them has found out of its deviations, all know.
            modelled.blueprint = self.like.blueprint.clone();
        }
        let blueprint = &modelled.blueprint;
        let mut campaign = Campaign::new(blueprint, modelled.belief()?, self.seed);
        let most = if explores || !guesses { 1 } else { FINDINGS };
        let place = blueprint.mutants().iter().position(|other| other.name == mutant.name);
        let known = self.differences.as_ref();
        let known = known.filter(|known| blueprint.is_like(&known.blueprint));
        let differs = known.and_then(|known| Some(known.count(place?)));
        let may = |number| known.is_none_or(|known| known.differs(number, place));
        let mut findings = self.findings(&mut campaign, &mut stage, may, most)?;
        let first = findings.first().map(|finding| finding.number);
        let allows = |clause: &String| explores || mutant.breaks.contains(clause);
        let learnt = campaign.belief().freedoms().filter(|_| first.is_none());
        let (taken_for, learnt): (Vec<_>, Vec<_>) =
            learnt.partition(|freedom| freedom.clauses.iter().any(allows));
        let [taken_for, learnt] =
            [taken_for, learnt].map(|all| all.iter().map(|it| it.name.clone()).collect());
        if !guesses || findings.is_empty() {
            let (named, guesses, actions) = (None, Vec::new(), None);
            return Ok(Fuzzed {
                mutant,
                first,
                named,
                guesses,
                actions,
                taken_for,
                learnt,
                differs,
            });
        }
        // Mutants are held against the whole of a session, and that of an exploration is long.
        for finding in findings.iter_mut().filter(|_| explores) {
            *finding = modelled.shortest(&campaign, &mut stage, None, finding);
        }
        let suspects = campaign.suspects(&findings.iter().collect::<Vec<_>>());
        let likeliest = suspects.first().map(|suspect| &suspect.mutant);
        let short = modelled.shortest(&campaign, &mut stage, likeliest, &findings[0]);
        let mut guesses: Vec<String> = Vec::new();
        for suspect in suspects {
            let clauses = &blueprint.mutants()[suspect.mutant].clauses;
            guesses.extend(clauses.first().filter(|guess| !guesses.contains(guess)).cloned());
        }
        let named = Some(guesses.iter().take(GUESSES).any(|guess| mutant.breaks.contains(guess)));
        let actions = Some(short.session.actions.len());
        Ok(Fuzzed { mutant, first, named, guesses, actions, taken_for, learnt, differs })
    }

    /// The first findings of a campaign, up to `most`, in sessions that may differ.
    fn findings(
        &self,
        campaign: &mut Campaign<'_>,
        stage: &mut VirtualDevice,
        differs: impl Fn(u64) -> bool,
        most: usize,
    ) -> Result<Vec<Finding>, Refused> {
        let mut findings = Vec::new();
        for number in 0..self.sessions {
            // A session is drawn by what is believed.
            if campaign.lessons() == 0 && !differs(number) {
                continue;
            }
            // A mutant that lets no time pass is a defect of the mutant.
            let found = campaign.session(stage, number);
            findings.extend(found.map_err(|error| Refused::bus(error.to_string()))?);
            if findings.len() >= most {
                break;
            }
        }
        Ok(findings)
    }
}

/// The numbers of each group of requirements, such as `CIA301-SEG`.
fn table(all: &[Fuzzed], verbose: bool) -> String {
    #[derive(Default)]
    struct Row {
        mutants: usize,
        found: usize,
        guessed: usize,
        named: usize,
        taken: usize,
    }
    let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
    let mut text = String::new();
    for one in all {
        let first = one.mutant.breaks.first().map_or("", String::as_str);
        let group = first.rsplit_once('-').map_or(first, |(group, _)| group);
        for row in [group, "all"] {
            let row = rows.entry(row).or_default();
            row.mutants += 1;
            row.found += usize::from(one.first.is_some());
            row.guessed += usize::from(one.named.is_some());
            row.named += usize::from(one.named == Some(true));
            row.taken += usize::from(!one.taken_for.is_empty());
        }
        if verbose {
            let found = match one.first {
                Some(number) => format!("found in session {number}"),
                None if one.taken_for.is_empty() => one.why_not(),
                None => format!("taken for {}", one.taken_for.join(" and ")),
            };
            let named = match one.named {
                Some(true) => ", named".to_owned(),
                Some(false) if one.guesses.is_empty() => ", no guess".to_owned(),
                Some(false) => {
                    let guesses: Vec<&str> =
                        one.guesses.iter().take(GUESSES).map(String::as_str).collect();
                    format!(", taken for {}", guesses.join(" or "))
                }
                None => String::new(),
            };
            // Writing to a string cannot fail.
            _ = writeln!(text, "  {}: {found}{named} ({first})", one.mutant.name);
        }
    }
    for (group, row) in rows {
        let Row { mutants, found, guessed, named, taken } = row;
        let taken =
            if taken > 0 { format!(", {taken} taken for a freedom") } else { String::new() };
        let named = format!("{named:>4} of {guessed} named{taken}");
        _ = writeln!(text, "{group:<14} {mutants:>4} mutants, {found:>4} found, {named}");
    }
    let mut actions: Vec<usize> = all.iter().filter_map(|one| one.actions).collect();
    actions.sort_unstable();
    if let Some(median) = actions.get(actions.len() / 2) {
        _ = writeln!(text, "{median} actions show the median of the findings");
    }
    text
}
