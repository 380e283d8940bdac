//! The mutants that do what was seen.

use std::collections::BTreeMap;

use reference_devices::change::Replica;
use rustc_hash::FxHashMap;

use crate::blueprint::Blueprint;
use crate::oracle::{Oracle, Seen};
use crate::session::judge;

/// A mutant that does what was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Suspect {
    /// Its place in the blueprint.
    pub mutant: usize,
    /// How many of the sessions in which something was wrong it explains.
    pub explains: usize,
    /// In how many of the sessions in which nothing was wrong it would have done something wrong.
    pub contradicts: usize,
    /// How many frames it would have sent at the end of those that it explains, which were not
    /// there yet.
    pub owes: usize,
}

/// What was seen of a device.
#[derive(Clone, Debug)]
pub(crate) struct Log {
    /// The freedoms that it was believed to use then, by their places in the blueprint. What comes
    /// before the thing that is wrong needs them; the thing itself may have looked like one.
    pub(crate) used: Vec<usize>,
    pub(crate) seen: Vec<Seen>,
}

/// Devices of mutants that use freedoms of the blueprint, by the places of both.
struct Devices<'b> {
    blueprint: &'b Blueprint,
    built: FxHashMap<Places, Option<Box<dyn Replica>>>,
}

/// Those of what is believed, and that of the mutant.
type Places = (Vec<usize>, usize);

impl Devices<'_> {
    fn device(&mut self, used: &[usize], mutant: usize) -> Option<&dyn Replica> {
        let build = || build(self.blueprint, used, mutant);
        self.built.entry((used.to_vec(), mutant)).or_insert_with(build).as_deref()
    }
}

/// The mutants of a blueprint that do what was seen: those first that explain most sessions and
/// contradict fewest of those in which nothing was wrong.
pub(crate) fn suspects<'s>(
    blueprint: &Blueprint,
    believed: &[usize],
    wrong: impl Iterator<Item = &'s Log>,
    right: &[&Log],
) -> Vec<Suspect> {
    let mut devices = Devices { blueprint, built: FxHashMap::default() };
    let mut counts: FxHashMap<usize, (usize, usize)> = FxHashMap::default();
    let all: Vec<usize> = (0..blueprint.mutants().len()).collect();
    for Log { used, seen } in wrong {
        let mut owing: BTreeMap<usize, usize> = BTreeMap::new();
        for used in bases(used, believed) {
            for mutant in dissenting(blueprint, used, seen, &all) {
                let device = devices.device(used, mutant);
                if let Some(owed) = device.and_then(|device| owed(blueprint, device, seen)) {
                    owing
                        .entry(mutant)
                        .and_modify(|least| *least = owed.min(*least))
                        .or_insert(owed);
                }
            }
        }
        for (mutant, owed) in owing {
            let (explains, owes) = counts.entry(mutant).or_default();
            (*explains, *owes) = (*explains + 1, *owes + owed);
        }
    }
    let most = counts.values().map(|(explains, _)| *explains).max().unwrap_or(0);
    let mut all: Vec<Suspect> = counts
        .into_iter()
        .map(|(mutant, (explains, owes))| {
            // Those that explain less come after the others anyway.
            let looked = if explains == most { right } else { &[] };
            let contradicted = looked.iter().filter(|log| {
                let device = devices.device(&log.used, mutant);
                device.is_some_and(|device| !agrees(blueprint, device, &log.seen))
            });
            Suspect { mutant, explains, contradicts: contradicted.count(), owes }
        })
        .collect();
    all.sort_by_key(|it| (std::cmp::Reverse(it.explains), it.contradicts, it.owes, it.mutant));
    all
}

/// The freedoms beside which a mutant may do what was seen.
fn bases<'l>(used: &'l [usize], believed: &'l [usize]) -> impl Iterator<Item = &'l [usize]> {
    [used].into_iter().chain((used != believed).then_some(believed))
}

/// Whether a mutant does what was seen.
pub(crate) fn explains(
    blueprint: &Blueprint,
    believed: &[usize],
    mutant: usize,
    (used, seen): (&[usize], &[Seen]),
) -> bool {
    let mut devices = bases(used, believed).filter_map(|used| build(blueprint, used, mutant));
    devices.any(|device| agrees(blueprint, &*device, seen))
}

fn build(blueprint: &Blueprint, used: &[usize], mutant: usize) -> Option<Box<dyn Replica>> {
    blueprint.build(blueprint.freedoms_at(used).chain([&blueprint.mutants()[mutant]]))
}

fn agrees(blueprint: &Blueprint, device: &dyn Replica, seen: &[Seen]) -> bool {
    owed(blueprint, device, seen).is_some()
}

/// How many frames a device owes at the end of what was seen; `None` where it does something else.
/// A session ends with the first thing that is wrong, when what should follow is not yet missed.
fn owed(blueprint: &Blueprint, device: &dyn Replica, seen: &[Seen]) -> Option<usize> {
    if blueprint.surface().is_some() {
        return judge(blueprint, device.replica(), seen).1.is_none().then_some(0);
    }
    let mut oracle = Oracle::new(blueprint, device.replica());
    let right = seen.iter().all(|one| oracle.see(one).is_ok()) && oracle.unexplained().is_none();
    right.then(|| oracle.debts())
}

/// Those of the mutants at these places that would have made a difference to what was seen, or may
/// have.
pub(crate) fn dissenting(
    blueprint: &Blueprint,
    used: &[usize],
    seen: &[Seen],
    places: &[usize],
) -> Vec<usize> {
    let devices = places.len().div_ceil(TOGETHER);
    let group = |number: usize| places.iter().skip(number).step_by(devices).copied();
    let groups = (0..devices).map(group);
    let muted = groups.filter_map(|it| blueprint.muted_mutants(blueprint.freedoms_at(used), it));
    muted.flat_map(|muted| muted.dissenting(blueprint, seen)).collect()
}

/// How many mutants are on one device. A closure that is muted asks those beneath it that take the
/// same decision twice, so that few of them may be; neighbours often are alike, and are apart.
const TOGETHER: usize = 24;
