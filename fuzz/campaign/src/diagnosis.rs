//! The mutants that do what was seen.

use reference_devices::change::Replica;
use rustc_hash::FxHashMap;

use crate::belief::Belief;
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

/// The mutants of a blueprint that do what was seen: those first that explain most sessions and
/// contradict fewest of those in which nothing was wrong.
pub(crate) fn suspects<'s>(
    blueprint: &Blueprint,
    belief: &Belief<'_>,
    sessions: impl Iterator<Item = &'s [Seen]>,
    right: &[&[Seen]],
) -> Vec<Suspect> {
    let mut devices: FxHashMap<usize, Option<Box<dyn Replica>>> = FxHashMap::default();
    let mut counts: FxHashMap<usize, (usize, usize)> = FxHashMap::default();
    let all: Vec<usize> = (0..blueprint.mutants().len()).collect();
    for seen in sessions {
        for mutant in dissenting(blueprint, belief, seen, &all) {
            let device = devices.entry(mutant).or_insert_with(|| build(blueprint, belief, mutant));
            let owed = device.as_deref().and_then(|device| owed(blueprint, device, seen));
            if let Some(owed) = owed {
                let (explains, owes) = counts.entry(mutant).or_default();
                (*explains, *owes) = (*explains + 1, *owes + owed);
            }
        }
    }
    let most = counts.values().map(|(explains, _)| *explains).max().unwrap_or(0);
    let mut all: Vec<Suspect> = counts
        .into_iter()
        .map(|(mutant, (explains, owes))| {
            let device = devices[&mutant].as_deref();
            // Those that explain less come after the others anyway.
            let looked = if explains == most { right } else { &[] };
            let wrong = |seen: &&&[Seen]| device.is_some_and(|it| !agrees(blueprint, it, seen));
            Suspect { mutant, explains, contradicts: looked.iter().filter(wrong).count(), owes }
        })
        .collect();
    all.sort_by_key(|it| (std::cmp::Reverse(it.explains), it.contradicts, it.owes, it.mutant));
    all
}

/// Whether a mutant does what was seen.
pub(crate) fn explains(
    blueprint: &Blueprint,
    belief: &Belief<'_>,
    mutant: usize,
    seen: &[Seen],
) -> bool {
    build(blueprint, belief, mutant).is_some_and(|device| agrees(blueprint, &*device, seen))
}

fn build(blueprint: &Blueprint, belief: &Belief<'_>, mutant: usize) -> Option<Box<dyn Replica>> {
    blueprint.build(belief.freedoms().chain([&blueprint.mutants()[mutant]]))
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
    belief: &Belief<'_>,
    seen: &[Seen],
    places: &[usize],
) -> Vec<usize> {
    let devices = places.len().div_ceil(TOGETHER);
    let group = |number: usize| places.iter().skip(number).step_by(devices).copied();
    let groups = (0..devices).map(group);
    let muted = groups.filter_map(|it| blueprint.muted_mutants(belief.freedoms(), it));
    muted.flat_map(|muted| muted.dissenting(blueprint, seen)).collect()
}

/// How many mutants are on one device. A closure that is muted asks those beneath it that take the
/// same decision twice, so that few of them may be; neighbours often are alike, and are apart.
const TOGETHER: usize = 24;
