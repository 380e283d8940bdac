//! The proof that no case is unjust: every case on every freedom, every personality and random
//! mixtures of freedoms.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

use fastrand::Rng;
use reference_devices::change::Deviation;
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom::{self, Freedom};
use reports::Verdict;

use super::assertion::Assertion;
use super::trial::{Clean, Trial, Wanted};
use crate::cli::QualifyArgs;
use crate::commands::check::sound_freedoms;
use crate::exit::Refused;
use crate::parallel::{self, processors, try_map};
use crate::suite::Library;
use crate::target::reference_device;

/// How many freedoms a mixture has at most.
const LARGEST_MIXTURE: usize = 6;

/// The freedoms of one device, and what they showed.
pub(super) struct Freedoms<'l> {
    device: Arc<ReferenceDevice>,
    compared: Compared<'l>,
    freedoms: Vec<Freedom>,
    single: Vec<Tried>,
    personalities: Vec<Tried>,
    mixtures: usize,
    red: Vec<Tried>,
}

/// One deviation that documents allow, on trial.
struct Tried {
    /// How a target has it, such as `freedom=slow-answers`.
    query: String,
    /// What was red: the instance, its verdict and the problem.
    red: Vec<(String, Verdict, String)>,
    /// The instances whose frames it changed.
    affected: BTreeSet<String>,
    /// Whether it changed a frame, or when one came, or the data sheet, which cases read as well.
    noticed: bool,
    /// What the cases accepted beside what they expect.
    allowed: BTreeSet<Assertion>,
}

/// The device without deviation, and what came of its plan, to compare with.
struct Compared<'l> {
    clean: Clean<'l>,
    trials: BTreeMap<String, Trial>,
}

impl<'l> Freedoms<'l> {
    /// Tries each freedom and each personality of a device.
    ///
    /// # Errors
    /// When the data of the device or of a freedom do not load.
    pub(super) fn of(library: &'l Library, name: &str) -> Result<Self, Refused> {
        let device = reference_device(name, &library.catalogue)?;
        let mut freedoms = sound_freedoms(&device, &library.register)?;
        // Without the cases of a document nothing shows what it leaves open.
        freedoms.retain(|freedom| {
            let loaded = |id: &String| !library.register.lacks_document_of(id);
            freedom.allowed_by.iter().any(loaded)
        });
        let personalities = freedom::personalities(&device)?;
        let clean = Clean::of(library, name)?;
        let trials = match freedoms.is_empty() && personalities.is_empty() {
            true => Vec::new(),
            false => clean.run(&|_| true)?,
        };
        let trials = trials.into_iter().map(|trial| (trial.name.clone(), trial)).collect();
        let compared = Compared { clean, trials };
        let single =
            try_map(&freedoms, |freedom| compared.tried(freedom.deviation(), &Wanted::All))?;
        let personalities = try_map(&personalities, |personality| {
            compared.tried(personality.deviation(), &Wanted::All)
        })?;
        let (mixtures, red) = (0, Vec::new());
        Ok(Self { device, compared, freedoms, single, personalities, mixtures, red })
    }

    /// Tries random mixtures: each device has a part of them by how many freedoms it has.
    ///
    /// # Errors
    /// When a device cannot be built.
    pub(super) fn mix(all: &mut [Self], args: &QualifyArgs) -> Result<(), Refused> {
        let whole: usize = all.iter().map(Self::mixed).sum();
        for freedoms in all.iter_mut().filter(|freedoms| freedoms.mixed() > 0) {
            freedoms.try_mixtures((args.mixtures * freedoms.mixed()).div_ceil(whole), args.seed)?;
        }
        Ok(())
    }

    /// How many freedoms there are to mix.
    fn mixed(&self) -> usize {
        if self.freedoms.len() < 2 { 0 } else { self.freedoms.len() }
    }

    fn try_mixtures(&mut self, count: usize, seed: u64) -> Result<(), Refused> {
        let (freedoms, single) = (&self.freedoms, &self.single);
        let mixtures = mixtures(&self.device, freedoms, count, seed);
        let red = try_map(&mixtures, |mixture| {
            let members: Vec<&Freedom> = mixture.iter().map(|&place| &freedoms[place]).collect();
            let affected = touched(mixture.iter().map(|&place| &single[place]));
            self.compared.smallest_red(members, &affected)
        })?;
        self.mixtures = mixtures.len();
        self.red = red.into_iter().flatten().collect();
        Ok(())
    }

    /// Adds the summary, and with `verbose` a line for each freedom and personality.
    pub(super) fn show(&self, text: &mut String, verbose: bool) {
        if self.single.is_empty() {
            return;
        }
        let red = |tried: &[Tried]| tried.iter().filter(|tried| !tried.red.is_empty()).count();
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{}: {} freedoms, {} personalities and {} mixtures, {} of them red",
            self.device.description.device,
            self.single.len(),
            self.personalities.len(),
            self.mixtures,
            red(&self.single) + red(&self.personalities) + red(&self.red),
        );
        for tried in self.single.iter().chain(&self.personalities).filter(|_| verbose) {
            // How many instances a freedom changes would change with each frame of the runner.
            let found = if tried.red.is_empty() { "nothing red" } else { "RED" };
            _ = writeln!(text, "  {}: {found}", tried.query);
        }
    }

    /// What cases accept beside what they expect, with what makes use of it.
    pub(super) fn proofs(&self) -> impl Iterator<Item = (&Assertion, &str)> {
        let tried = self.single.iter().chain(&self.personalities);
        tried.flat_map(|tried| tried.allowed.iter().map(|allowed| (allowed, tried.query.as_str())))
    }

    /// What is unjust, and what proves nothing.
    pub(super) fn holes(&self) -> impl Iterator<Item = String> {
        let device = &self.device.description.device;
        let all = self.single.iter().chain(&self.personalities).chain(&self.red);
        let unjust = all.flat_map(move |tried| {
            tried.red.iter().map(move |(instance, verdict, problem)| {
                format!("{device} with {}: {instance} is {verdict}: {problem}", tried.query)
            })
        });
        let vain = self.single.iter().filter(|tried| !tried.noticed);
        let vain =
            vain.map(move |tried| format!("{device} with {}: no frame changes", tried.query));
        unjust.chain(vain)
    }
}

impl Compared<'_> {
    /// Runs what is wanted on the device with a deviation.
    fn tried(&self, deviation: Deviation, wanted: &Wanted) -> Result<Tried, Refused> {
        let query = deviation.query.clone();
        let noticed = deviation.falsifies_data_sheet();
        let ran = self.clean.deviating(deviation, wanted)?;
        let (affected, allowed) = (BTreeSet::new(), BTreeSet::new());
        let mut tried = Tried { query, red: Vec::new(), affected, noticed, allowed };
        for trial in ran.trials {
            tried.allowed.extend(Assertion::used_by(&trial.case, &trial.shown));
            let clean = self.trials.get(&trial.name);
            let frames = clean.is_none_or(|clean| clean.frames != trial.frames);
            tried.noticed |= frames || clean.is_none_or(|clean| clean.timing != trial.timing);
            if frames {
                tried.affected.insert(trial.name.clone());
            }
            if matches!(trial.verdict, Verdict::Fail | Verdict::Error) {
                let problem = trial.problem.unwrap_or_default();
                tried.red.push((trial.name, trial.verdict, problem));
            }
        }
        Ok(tried)
    }

    /// The smallest part of a mixture on which one of these instances is red still; `None` when
    /// nothing is red.
    fn smallest_red(
        &self,
        mut members: Vec<&Freedom>,
        instances: &BTreeSet<String>,
    ) -> Result<Option<Tried>, Refused> {
        let run = |members: &[&Freedom], names: &BTreeSet<String>| {
            let names = self.clean.plan.with_proofs(names);
            self.tried(freedom::mixture(members.iter().copied()), &Wanted::Instances(&names))
        };
        let mut smallest = run(&members, instances)?;
        let Some((first, ..)) = smallest.red.first() else { return Ok(None) };
        let first = BTreeSet::from([first.clone()]);
        let mut place = 0;
        while place < members.len() {
            let mut fewer = members.clone();
            fewer.remove(place);
            let tried = run(&fewer, &first)?;
            if tried.red.is_empty() {
                place += 1;
            } else {
                (members, smallest) = (fewer, tried);
            }
        }
        Ok(Some(smallest))
    }
}

/// Whether a device can be built with all of these freedoms.
fn fits<'f>(device: &ReferenceDevice, freedoms: impl Iterator<Item = &'f Freedom>) -> bool {
    let mixture = freedom::mixture(freedoms);
    mixture.data_sheet(device).is_ok() && mixture.build(device, 1).is_ok()
}

/// The instances that two members of a mixture or more have changed: where only one did, it was
/// tried alone.
fn touched<'t>(members: impl Iterator<Item = &'t Tried>) -> BTreeSet<String> {
    let mut count = BTreeMap::<&String, usize>::new();
    for name in members.flat_map(|tried| &tried.affected) {
        *count.entry(name).or_default() += 1;
    }
    count.into_iter().filter(|(_, count)| *count > 1).map(|(name, _)| name.clone()).collect()
}

/// Random sets of freedoms that a device can use together, by their places.
fn mixtures(
    device: &ReferenceDevice,
    freedoms: &[Freedom],
    count: usize,
    seed: u64,
) -> Vec<Vec<usize>> {
    let draw = |mut rng: Rng| {
        let wanted = rng.usize(2..=LARGEST_MIXTURE.min(freedoms.len()));
        let mut mixture: Vec<usize> = Vec::new();
        // A set that nothing can be added to stays smaller than wanted.
        for _ in 0..4 * wanted {
            let place = rng.usize(..freedoms.len());
            let agrees = |&other: &usize| freedoms[place].agrees_with(&freedoms[other]);
            if mixture.len() == wanted || !mixture.iter().all(agrees) {
                continue;
            }
            mixture.push(place);
            // Changes are made in the order of the freedoms.
            mixture.sort_unstable();
            // What one freedom removes, another cannot change.
            if !fits(device, mixture.iter().map(|&place| &freedoms[place])) {
                mixture.retain(|&member| member != place);
            }
        }
        mixture
    };
    let mut seeds = Rng::with_seed(seed);
    let each = (0..count).map(|_| seeds.fork()).collect();
    parallel::map(each, processors(), draw)
}
