//! The proof that no case is unjust: every case on every freedom, every personality and random
//! mixtures of freedoms.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;

use canopen::source::Complaint;
use fastrand::Rng;
use reference_devices::change::Deviation;
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom::{self, Freedom, Personality};
use reports::Verdict;
use runner::parallel::{self, processors, try_map};
use runner::suite::Register;

use super::assertion::Assertion;
use super::trial::{Clean, Reach, Trial, Wanted};
use crate::cli::QualifyArgs;
use crate::exit::Refused;
use crate::progress::Progress;

/// How many freedoms a mixture has at most.
const LARGEST_MIXTURE: usize = 6;

/// How many freedoms are tried together at first. If one of them changes anything, each is tried
/// again alone.
const LARGEST_GROUP: usize = 8;

/// The same for freedoms of which it is known where they make a difference: those are tried alone
/// there and nowhere else.
const LARGEST_KNOWN_GROUP: usize = 32;

/// How many instances say whether a freedom is one that changes most of them.
const SAMPLE: usize = 8;

/// The freedoms of one device, and what they showed.
pub(super) struct Freedoms<'c, 'l> {
    compared: Compared<'c, 'l>,
    single: Vec<Tried>,
    /// The groups that were tried first.
    groups: Vec<Tried>,
    personalities: Vec<Tried>,
    mixtures: usize,
    red: Vec<Tried>,
}

/// One deviation that documents allow, on trial.
struct Tried {
    /// How a target has it, such as `freedom=slow-answers`.
    query: String,
    /// The red instances: name, verdict and problem.
    red: Vec<(String, Verdict, String)>,
    /// The instances whose frames it changed.
    affected: BTreeSet<String>,
    /// Whether it changed a frame, or when one came, or the data sheet, which cases read as well.
    noticed: bool,
    /// Whether it is known where it makes a difference. Then it may be seen by no case: the cases
    /// leave open what the document leaves open.
    is_known: bool,
    /// The allowances of the cases that were used.
    allowed: BTreeSet<Assertion>,
    /// The cases that judge it, and skip an instance on the device without deviation.
    judging: BTreeSet<String>,
}

/// The instances with the same frames and verdict as on the device without deviation, and the
/// others.
#[derive(Default)]
struct Went {
    /// The instances that did.
    alike: BTreeSet<String>,
    /// The cases that have an instance that did not.
    otherwise: BTreeSet<String>,
}

/// The device without deviation, and the results of its plan by instance, to compare with.
struct Compared<'c, 'l> {
    clean: &'c Clean<'l>,
    trials: HashMap<&'c str, &'c Trial>,
}

/// A freedom, and where it makes a difference.
#[derive(Clone, Copy)]
struct Member<'f> {
    freedom: &'f Freedom,
    reach: &'f Reach,
}

/// The unit of work: what is tried on a device at once.
enum Task<'f> {
    Group(Vec<Member<'f>>),
    Personality(&'f Personality),
}

/// The result of it.
enum Done {
    Group(Apart),
    Personality(Tried),
}

/// The results of freedoms that were tried together and apart.
struct Apart {
    /// Each alone, in their order.
    single: Vec<Tried>,
    /// Several of them.
    groups: Vec<Tried>,
}

impl<'c, 'l> Freedoms<'c, 'l> {
    /// Tries each freedom and each personality of these devices.
    ///
    /// # Errors
    /// When the data of a device or of a freedom do not load.
    pub(super) fn of(cleans: &'c [Clean<'l>]) -> Result<Vec<Self>, Refused> {
        let mut all: Vec<Self> = cleans.iter().map(Self::untried).collect();
        let personalities = cleans.iter().map(|clean| freedom::personalities(&clean.device));
        let personalities = personalities.collect::<Result<Vec<_>, _>>()?;
        let each: Vec<(&Compared, Member)> = all
            .iter()
            .flat_map(|of| {
                let members = of.freedoms().iter().zip(&of.compared.clean.reaches);
                members.map(|(freedom, reach)| (&of.compared, Member { freedom, reach }))
            })
            .collect();
        let loud = try_map(&each, |(of, member)| of.is_loud(member))?;
        let mut each = each.into_iter().zip(loud).map(|((_, member), loud)| (member, loud));
        // A freedom that changes everything would leave nothing equal in its group.
        let apart: Vec<(Vec<_>, Vec<_>)> = all
            .iter()
            .map(|of| each.by_ref().take(of.freedoms().len()).partition(|(_, loud)| *loud))
            .collect();
        let devices: Vec<_> = cleans.iter().zip(&apart).collect();
        let grouped = parallel::map(devices, processors(), |(clean, (_, quiet))| {
            let quiet: Vec<Member> = quiet.iter().map(|(member, _)| *member).collect();
            groups(&clean.device, &quiet)
        });
        let mut tasks = Vec::new();
        for (place, ((alone, _), groups)) in apart.into_iter().zip(grouped).enumerate() {
            let groups = alone.into_iter().map(|(member, _)| vec![member]).chain(groups);
            tasks.extend(groups.map(|group| (place, Task::Group(group))));
            let personalities = personalities[place].iter();
            tasks.extend(personalities.map(|one| (place, Task::Personality(one))));
        }
        let line = Progress::with_each(tasks.len(), "groups of freedoms");
        let done = try_map(&tasks, |(place, task)| line.each(|| all[*place].compared.run(task)))?;
        drop(line);
        let places: Vec<usize> = tasks.iter().map(|(place, _)| *place).collect();
        for (place, done) in places.into_iter().zip(done) {
            match done {
                Done::Group(apart) => {
                    all[place].single.extend(apart.single);
                    all[place].groups.extend(apart.groups);
                }
                Done::Personality(tried) => all[place].personalities.push(tried),
            }
        }
        all.iter_mut().for_each(Self::sort);
        Ok(all)
    }

    fn untried(clean: &'c Clean<'l>) -> Self {
        let trials = clean.trials.iter().map(|trial| (trial.name.as_str(), trial)).collect();
        let compared = Compared { clean, trials };
        let (single, groups, personalities, red) = Default::default();
        Self { compared, single, groups, personalities, mixtures: 0, red }
    }

    fn freedoms(&self) -> &'c [Freedom] {
        &self.compared.clean.freedoms
    }

    /// Puts what was tried alone in the order of the freedoms.
    fn sort(&mut self) {
        let queries: Vec<String> =
            self.freedoms().iter().map(|freedom| freedom.deviation().query).collect();
        let place = |tried: &Tried| queries.iter().position(|query| *query == tried.query);
        self.single.sort_by_cached_key(place);
    }

    /// Tries random mixtures: each device has a part of them by how many freedoms it has.
    ///
    /// # Errors
    /// When a device cannot be built.
    pub(super) fn mix(all: &mut [Self], args: &QualifyArgs) -> Result<(), Refused> {
        let whole = all.iter().map(Self::mixed).sum::<usize>().max(1);
        let mut each = Vec::new();
        for (place, of) in all.iter_mut().enumerate() {
            let count = (args.mixtures * of.mixed()).div_ceil(whole);
            let drawn = mixtures(&of.compared.clean.device, of.freedoms(), count, args.seed);
            of.mixtures = drawn.len();
            each.extend(drawn.into_iter().map(|mixture| (place, mixture)));
        }
        let line = Progress::with_each(each.len(), "mixtures");
        let found = try_map(&each, |(place, mixture)| line.each(|| all[*place].mixture(mixture)))?;
        for ((place, _), red) in each.iter().zip(found) {
            all[*place].red.extend(red);
        }
        Ok(())
    }

    /// How many freedoms there are to mix.
    fn mixed(&self) -> usize {
        if self.freedoms().len() < 2 { 0 } else { self.freedoms().len() }
    }

    /// The red instances of a mixture, on the smallest part of it that is red.
    fn mixture(&self, (mixture, order): &(Vec<usize>, u64)) -> Result<Option<Tried>, Refused> {
        let members = mixture.iter().map(|&place| &self.freedoms()[place]).collect();
        let affected = touched(mixture.iter().map(|&place| &self.single[place]));
        self.compared.smallest_red(members, &affected, *order)
    }

    /// Adds the summary, and with `verbose` a line for each freedom and personality.
    pub(super) fn show(&self, text: &mut String, verbose: bool) {
        if self.single.is_empty() {
            return;
        }
        let red = |tried: &[Tried]| tried.iter().filter(|tried| !tried.red.is_empty()).count();
        let unseen = match self.single.iter().filter(|tried| !tried.noticed).count() {
            0 => String::new(),
            unseen => format!(" ({unseen} seen by no case)"),
        };
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{}: {}{unseen}, {} personalities and {} mixtures, {} of them red",
            self.compared.clean.name(),
            match self.single.len() {
                1 => "1 freedom".to_owned(),
                count => format!("{count} freedoms"),
            },
            self.personalities.len(),
            self.mixtures,
            red(&self.single) + red(&self.groups) + red(&self.personalities) + red(&self.red),
        );
        for tried in self.single.iter().chain(&self.personalities).filter(|_| verbose) {
            // How many instances a freedom changes would change with each frame of the runner.
            let found = if tried.red.is_empty() { "nothing red" } else { "RED" };
            _ = writeln!(text, "  {}: {found}", tried.query);
        }
    }

    /// The allowances of the cases, each with the freedom that uses it.
    pub(super) fn proofs(&self) -> impl Iterator<Item = (&Assertion, &str)> {
        let tried = self.single.iter().chain(&self.personalities).chain(&self.groups);
        tried.flat_map(|tried| tried.allowed.iter().map(|allowed| (allowed, tried.query.as_str())))
    }

    /// The cases that judge the device with a freedom, while they skip instances without it.
    pub(super) fn judging(&self) -> impl Iterator<Item = &String> {
        let tried = self.single.iter().chain(&self.personalities).chain(&self.groups);
        tried.flat_map(|tried| &tried.judging)
    }

    /// Unjust cases, and freedoms that prove nothing.
    pub(super) fn holes(&self) -> impl Iterator<Item = String> {
        let device = self.compared.clean.name();
        let all =
            self.single.iter().chain(&self.groups).chain(&self.personalities).chain(&self.red);
        let unjust = all.flat_map(move |tried| {
            tried.red.iter().map(move |(instance, verdict, problem)| {
                format!("{device} with {}: {instance} is {verdict}: {problem}", tried.query)
            })
        });
        let vain = self.single.iter().filter(|tried| !tried.noticed && !tried.is_known);
        let vain =
            vain.map(move |tried| format!("{device} with {}: no frame changes", tried.query));
        unjust.chain(vain)
    }
}

impl Compared<'_, '_> {
    fn run(&self, task: &Task) -> Result<Done, Refused> {
        Ok(match task {
            Task::Group(members) => Done::Group(self.apart(members)?),
            Task::Personality(one) => Done::Personality(self.tried(one.deviation(), &Wanted::All)?),
        })
    }

    /// Whether a freedom changes the frames of most instances, by a sample where that is not known.
    fn is_loud(&self, member: &Member) -> Result<bool, Refused> {
        let passed = || self.clean.trials.iter().filter(|trial| trial.verdict == Verdict::Pass);
        let known = member.reach.instances.as_ref();
        if known.is_some_and(|instances| 2 * instances.len() < passed().count()) {
            return Ok(false);
        }
        let step = passed().count().div_ceil(SAMPLE).max(1);
        let names: BTreeSet<String> =
            passed().step_by(step).map(|trial| trial.name.clone()).collect();
        let tried = self.tried(member.freedom.deviation(), &Wanted::Instances(&names))?;
        Ok(2 * tried.affected.len() > names.len())
    }

    /// Tries freedoms that a device can use together, then each alone. If an instance goes as
    /// without deviation on the device that uses them all, it does so with each of them and is not
    /// tried again, since no freedom undoes the change of another.
    fn apart(&self, members: &[Member]) -> Result<Apart, Refused> {
        let freedoms: Vec<&Freedom> = members.iter().map(|member| member.freedom).collect();
        let together = freedom::mixture(freedoms.iter().copied());
        if let [_only] = members {
            let single = vec![self.everywhere(&together)?];
            return Ok(Apart { single, groups: Vec::new() });
        }
        let (mut group, mut went) = self.compared(together, &Wanted::All)?;
        let missing = self.trials.values().filter(|trial| !went.alike.contains(&trial.name));
        went.otherwise.extend(missing.map(|trial| trial.case.clone()));
        let cases = self.trials.values().map(|trial| &trial.case);
        let cases: BTreeSet<String> =
            cases.filter(|case| !went.otherwise.contains(*case)).cloned().collect();
        let rest = Wanted::Except { instances: &went.alike, cases: &cases };
        let (mut single, mut known) = (Vec::new(), BTreeSet::new());
        for Member { freedom, reach } in members {
            let alone = |wanted: &Wanted| self.tried(freedom.deviation(), wanted);
            let mut tried = match &reach.instances {
                None => alone(&rest)?,
                Some(reached) => {
                    let seen = reached.difference(&went.alike).cloned().collect();
                    alone(&Wanted::Instances(&self.clean.plan.with_proofs(&seen)))?
                }
            };
            if let Some(reached) = reach.instances.as_ref().filter(|_| !tried.noticed) {
                tried = alone(&Wanted::Instances(&self.clean.plan.with_proofs(reached)))?;
            }
            if !tried.noticed && reach.instances.is_none() {
                // A freedom that only shifts frames is noticed in a whole run.
                tried = self.everywhere(&freedom.deviation())?;
            }
            tried.is_known = reach.instances.is_some();
            known.extend(tried.red.iter().map(|(instance, ..)| instance.clone()));
            single.push(tried);
        }
        let mut groups = Vec::new();
        let red = std::mem::take(&mut group.red).into_iter().map(|(instance, ..)| instance);
        let red: BTreeSet<String> = red.filter(|instance| !known.contains(instance)).collect();
        if !red.is_empty() {
            groups.extend(self.smallest_red(freedoms, &red, 0)?);
        }
        groups.push(group);
        Ok(Apart { single, groups })
    }

    /// Runs every instance on the device with a deviation.
    fn everywhere(&self, deviation: &Deviation) -> Result<Tried, Refused> {
        let tried = self.tried(deviation.clone(), &Wanted::All)?;
        match tried.noticed {
            true => Ok(tried),
            // Stored values are lost with the first case that loads the defaults.
            false => self.tried(deviation.clone(), &Wanted::Each),
        }
    }

    /// Runs what is wanted on the device with a deviation.
    fn tried(&self, deviation: Deviation, wanted: &Wanted) -> Result<Tried, Refused> {
        Ok(self.compared(deviation, wanted)?.0)
    }

    /// The same, with what that changes.
    fn compared(&self, deviation: Deviation, wanted: &Wanted) -> Result<(Tried, Went), Refused> {
        let query = deviation.query.clone();
        let noticed = deviation.falsifies_data_sheet();
        let ran = self.clean.deviating(deviation, wanted)?;
        let (red, affected, allowed, judging) = Default::default();
        let mut tried = Tried { query, red, affected, noticed, is_known: false, allowed, judging };
        let mut went = Went::default();
        for trial in ran.trials {
            tried.allowed.extend(Assertion::used_by(&trial.case, &trial.shown));
            let clean = self.trials.get(trial.name.as_str());
            let is_skipped = clean.is_some_and(|clean| clean.verdict == Verdict::Skip);
            if is_skipped && matches!(trial.verdict, Verdict::Pass | Verdict::Lenient) {
                tried.judging.insert(trial.case.clone());
            }
            let frames = clean.is_none_or(|clean| clean.frames != trial.frames);
            tried.noticed |= frames || clean.is_none_or(|clean| clean.timing != trial.timing);
            if frames {
                tried.affected.insert(trial.name.clone());
            }
            if matches!(trial.verdict, Verdict::Fail | Verdict::Error) {
                let problem = trial.problem.unwrap_or_default();
                tried.red.push((trial.name.clone(), trial.verdict, problem));
            }
            match clean.filter(|_| !frames) {
                Some(clean) if clean.verdict == trial.verdict => went.alike.insert(trial.name),
                _ => went.otherwise.insert(trial.case),
            };
        }
        Ok((tried, went))
    }

    /// The smallest part of a mixture on which one of these instances, in an order of this seed, is
    /// red still; `None` when nothing is red.
    fn smallest_red(
        &self,
        mut members: Vec<&Freedom>,
        instances: &BTreeSet<String>,
        seed: u64,
    ) -> Result<Option<Tried>, Refused> {
        let of = &self.clean.plan.with_proofs(instances);
        let run = |members: &[&Freedom], kept: &BTreeSet<String>| {
            let mixture = freedom::mixture(members.iter().copied());
            self.tried(mixture, &Wanted::Shuffled { seed, of, kept })
        };
        let mut smallest = run(&members, of)?;
        let Some((first, ..)) = smallest.red.first() else { return Ok(None) };
        let first = first.clone();
        let red = |tried: &Tried| tried.red.iter().any(|(instance, ..)| *instance == first);
        let alone = self.clean.plan.with_proofs(&BTreeSet::from([first.clone()]));
        let tried = run(&members, &alone)?;
        // An earlier case may be what makes this one red.
        let mut kept = of.clone();
        if red(&tried) {
            (kept, smallest) = (alone.clone(), tried);
        }
        let mut place = 0;
        while place < members.len() {
            let mut fewer = members.clone();
            fewer.remove(place);
            let tried = run(&fewer, &kept)?;
            if red(&tried) {
                (members, smallest) = (fewer, tried);
            } else {
                place += 1;
            }
        }
        let mut before: Vec<String> = kept.difference(&alone).cloned().collect();
        let mut part = before.len().div_ceil(2);
        while part > 0 {
            for left_out in before.clone().chunks(part) {
                let fewer = kept.iter().filter(|name| !left_out.contains(name)).cloned().collect();
                let tried = run(&members, &fewer)?;
                if red(&tried) {
                    (kept, smallest) = (fewer, tried);
                    before.retain(|name| !left_out.contains(name));
                }
            }
            part = if part == 1 { 0 } else { part.div_ceil(2) };
        }
        smallest.red.retain(|(instance, ..)| *instance == first);
        for (_, _, problem) in smallest.red.iter_mut().filter(|_| !before.is_empty()) {
            _ = write!(problem, "; after {}", before.join(" "));
        }
        Ok(Some(smallest))
    }
}

impl Member<'_> {
    /// Whether one of the two may take back what the other one changes, so that neither is seen.
    fn hides(&self, other: &Self) -> bool {
        let shared = !self.reach.decisions.is_disjoint(&other.reach.decisions);
        let apart = match (&self.reach.instances, &other.reach.instances) {
            (Some(one), Some(other)) => one.is_disjoint(other),
            _ => false,
        };
        let data = || self.freedom.deviation().collides_with(&other.freedom.deviation());
        shared && !apart || data()
    }
}

/// The freedoms that are tried on a device.
///
/// # Errors
/// Everything that is wrong with the files of freedoms.
pub(super) fn tried_on(
    device: &ReferenceDevice,
    register: &Register,
) -> Result<Vec<Freedom>, Vec<Complaint>> {
    let mut freedoms = freedom::of(device)?;
    // Without the cases of a document nothing shows what it leaves open.
    freedoms.retain(|freedom| {
        let loaded = |id: &String| !register.lacks_document_of(id);
        freedom.allowed_by.iter().any(loaded)
    });
    Ok(freedoms)
}

/// Whether a device can be built with all of these freedoms.
fn fits<'f>(device: &ReferenceDevice, freedoms: impl Iterator<Item = &'f Freedom>) -> bool {
    freedom::mixture(freedoms).complaints(device).next().is_none()
}

/// Sets of freedoms that a device can use together, with each freedom in one of them. Freedoms that
/// change the data sheet, and with it the plan, come first. Freedoms for which the instances they
/// can affect are known come last.
fn groups<'f>(device: &ReferenceDevice, members: &[Member<'f>]) -> Vec<Vec<Member<'f>>> {
    let (known, rest): (Vec<Member>, Vec<_>) =
        members.iter().partition(|member| member.reach.instances.is_some());
    let (sheet, rest): (Vec<Member>, Vec<_>) =
        rest.into_iter().partition(|member| member.freedom.deviation().changes_data_sheet());
    let rest = sheet.into_iter().chain(rest);
    let mut groups = filled(device, rest, LARGEST_GROUP);
    groups.extend(filled(device, known.into_iter(), LARGEST_KNOWN_GROUP));
    groups
}

fn filled<'f>(
    device: &ReferenceDevice,
    members: impl Iterator<Item = Member<'f>>,
    most: usize,
) -> Vec<Vec<Member<'f>>> {
    let mut groups: Vec<Vec<Member>> = Vec::new();
    for member in members {
        let freedom = member.freedom;
        let takes = |group: &&mut Vec<Member>| {
            let others = || group.iter().map(|member| member.freedom);
            group.len() < most
                && !group.iter().any(|other| member.hides(other))
                && others().all(|other| other.agrees_with(freedom))
                && fits(device, others().chain([freedom]))
        };
        match groups.iter_mut().find(takes) {
            Some(group) => group.push(member),
            None => groups.push(vec![member]),
        }
    }
    groups
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

/// Random sets of freedoms that a device can use together, by their places, each with a seed for
/// the order of the instances.
pub(super) fn mixtures(
    device: &ReferenceDevice,
    freedoms: &[Freedom],
    count: usize,
    seed: u64,
) -> Vec<(Vec<usize>, u64)> {
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
            // One freedom may remove what another one changes.
            if !fits(device, mixture.iter().map(|&place| &freedoms[place])) {
                mixture.retain(|&member| member != place);
            }
        }
        (mixture, rng.u64(..))
    };
    let mut seeds = Rng::with_seed(seed);
    let each = (0..count).map(|_| seeds.fork()).collect();
    parallel::map(each, processors(), draw)
}

#[cfg(test)]
mod tests {
    use reference_devices::devices::{self, WITH_EVERYTHING};

    use super::*;

    #[test]
    fn each_freedom_is_in_one_group_with_freedoms_that_agree() {
        let device = devices::device(WITH_EVERYTHING).unwrap();
        let freedoms = freedom::of(&device).unwrap();
        let decisions = BTreeSet::from(["one"]);
        let known = Reach { instances: Some(BTreeSet::new()), decisions: decisions.clone() };
        let unknown = Reach { instances: None, decisions: BTreeSet::new() };
        let reach = |place: usize| if place.is_multiple_of(2) { &known } else { &unknown };
        let members = freedoms.iter().enumerate();
        let members: Vec<Member> =
            members.map(|(place, freedom)| Member { freedom, reach: reach(place) }).collect();
        let groups = groups(&device, &members);
        let mut names: Vec<&String> =
            groups.iter().flatten().map(|member| &member.freedom.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!((names.len(), count), (freedoms.len(), freedoms.len()));
        for group in &groups {
            let known = group.iter().filter(|member| member.reach.instances.is_some()).count();
            assert!(known == 0 && group.len() <= LARGEST_GROUP || known == group.len());
            let group: Vec<&Freedom> = group.iter().map(|member| member.freedom).collect();
            assert!(group.len() <= LARGEST_KNOWN_GROUP && fits(&device, group.iter().copied()));
            let agree = |one: &&Freedom| {
                group.iter().all(|other| one.name == other.name || one.agrees_with(other))
            };
            assert!(group.iter().all(agree));
        }
        assert!(groups.len() < freedoms.len() / 4, "{}", groups.len());
    }
}
