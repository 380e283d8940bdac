//! The mutants that do what was seen.

use reference_devices::change::Replica;
use rustc_hash::FxHashMap;

use crate::belief::Belief;
use crate::blueprint::Blueprint;
use crate::oracle::Seen;
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
    let mut counts: FxHashMap<usize, usize> = FxHashMap::default();
    for seen in sessions {
        for mutant in dissenting(blueprint, belief, seen) {
            let device = devices.entry(mutant).or_insert_with(|| build(blueprint, belief, mutant));
            if device.as_deref().is_some_and(|device| agrees(blueprint, device, seen)) {
                *counts.entry(mutant).or_default() += 1;
            }
        }
    }
    let most = counts.values().copied().max().unwrap_or(0);
    let mut all: Vec<Suspect> = counts
        .into_iter()
        .map(|(mutant, explains)| {
            let device = devices[&mutant].as_deref();
            // Those that explain less come after the others anyway.
            let looked = if explains == most { right } else { &[] };
            let wrong = |seen: &&&[Seen]| device.is_some_and(|it| !agrees(blueprint, it, seen));
            Suspect { mutant, explains, contradicts: looked.iter().filter(wrong).count() }
        })
        .collect();
    all.sort_by_key(|it| (std::cmp::Reverse(it.explains), it.contradicts, it.mutant));
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
    judge(blueprint, device.replica(), seen).1.is_none()
}

/// The mutants that would have made a difference to what was seen, or may have.
pub(crate) fn dissenting(blueprint: &Blueprint, belief: &Belief<'_>, seen: &[Seen]) -> Vec<usize> {
    let all = blueprint.mutants().len();
    let group = |number: usize| (number..all).step_by(GROUPS);
    let muted = (0..GROUPS).filter_map(|it| blueprint.muted_mutants(belief.freedoms(), group(it)));
    muted.flat_map(|muted| muted.dissenting(blueprint, seen)).collect()
}

/// How many devices hold all mutants. A closure that is muted asks those beneath it that take the
/// same decision twice, so that few of them may be on one device; neighbours often are alike.
const GROUPS: usize = 32;
