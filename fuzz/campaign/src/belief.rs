//! What is known of a device beside its data sheet: the freedoms that it was seen to use.

use reference_devices::change::Replica;

use crate::blueprint::{Blueprint, Candidate};
use crate::oracle::{End, Seen, Tolerance};
use crate::session::{Start, judge};

/// The freedoms that a device is believed to use.
#[derive(Clone)]
pub struct Belief<'b> {
    blueprint: &'b Blueprint,
    tolerance: Tolerance,
    start: Start,
    /// The freedoms that it begins with, by their places in the blueprint.
    given: Vec<usize>,
    /// Those that it has now.
    used: Vec<usize>,
    model: Box<dyn Replica>,
    /// What showed them: another belief must explain it, too.
    evidence: Vec<Vec<Seen>>,
    /// What showed freedoms that did not hold.
    doubtful: Vec<Vec<Seen>>,
}

/// What a session says of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Judged {
    /// Nothing new.
    Expected,
    /// The device uses other freedoms than was believed.
    Learnt,
    /// No freedom explains it.
    Wrong,
}

/// How many freedoms are looked for at a time.
const MOST_FREEDOMS: usize = 8;
/// How many beliefs are followed up at a time.
const BEAM: usize = 4;
/// How many sessions are kept that changed the belief.
const MOST_EVIDENCE: usize = 16;

impl<'b> Belief<'b> {
    /// A device that uses these freedoms, by their places in the blueprint; `None` when it cannot
    /// be built.
    pub fn new(
        blueprint: &'b Blueprint,
        tolerance: Tolerance,
        start: Start,
        used: Vec<usize>,
    ) -> Option<Self> {
        let model = blueprint.build(used.iter().map(|place| &blueprint.freedoms()[*place]))?;
        let (given, evidence, doubtful) = (used.clone(), Vec::new(), Vec::new());
        Some(Self { blueprint, tolerance, start, given, used, model, evidence, doubtful })
    }

    /// A device that is like the one that is believed in, switched on at time 0.
    pub fn model(&self) -> Box<dyn Replica> {
        self.model.clone()
    }

    /// The freedoms.
    pub fn freedoms(&self) -> impl Iterator<Item = &'b Candidate> + '_ {
        let blueprint = self.blueprint;
        self.used.iter().map(|place| &blueprint.freedoms()[*place])
    }

    /// Takes what was seen in a session that is not as expected, and looks for freedoms that
    /// explain it.
    pub fn explain(&mut self, seen: &[Seen]) -> Judged {
        let explained = |used: &[usize]| {
            self.evidence.iter().all(|log| self.reaches(used, log).1.is_none())
        };
        let found = self.search(self.used.clone(), seen, &explained).or_else(|| {
            let other = self.used != self.given;
            other.then(|| self.search(self.given.clone(), seen, &explained))?
        });
        let Some((used, model)) = found.and_then(|used| {
            let freedoms = used.iter().map(|place| &self.blueprint.freedoms()[*place]);
            let model = self.blueprint.build(freedoms)?;
            Some((used, model))
        }) else {
            self.doubt();
            return Judged::Wrong;
        };
        if used == self.used {
            return Judged::Expected;
        }
        (self.used, self.model) = (used, model);
        if self.evidence.len() < MOST_EVIDENCE {
            self.evidence.push(seen.to_vec());
        }
        Judged::Learnt
    }

    /// What was learnt of a device that does something wrong may be part of that.
    fn doubt(&mut self) {
        let freedoms = self.given.iter().map(|place| &self.blueprint.freedoms()[*place]);
        if let Some(model) = self.blueprint.build(freedoms) {
            (self.used, self.model) = (self.given.clone(), model);
        }
        self.doubtful.append(&mut self.evidence);
        self.doubtful.truncate(MOST_EVIDENCE);
    }

    /// How far a device with these freedoms explains what was seen, and what is wrong then.
    fn reaches(&self, used: &[usize], seen: &[Seen]) -> (usize, Option<End>) {
        let all = self.blueprint.freedoms();
        match self.blueprint.build(used.iter().map(|place| &all[*place])) {
            Some(model) => judge(self.blueprint, model, self.tolerance, self.start, seen),
            None => (0, Some(End::Void(canopen::Instant::ZERO))),
        }
    }

    /// Adds freedoms, those first that explain most.
    fn search(
        &self,
        base: Vec<usize>,
        seen: &[Seen],
        explained: &dyn Fn(&[usize]) -> bool,
    ) -> Option<Vec<usize>> {
        let (reached, end) = self.reaches(&base, seen);
        if end.is_none() {
            return explained(&base).then_some(base);
        }
        let mut beam = vec![(reached, base)];
        for _ in 0..MOST_FREEDOMS {
            let mut next: Vec<(usize, Vec<usize>)> = Vec::new();
            for (reached, used) in &beam {
                for place in self.dissenting(used, &seen[..=*reached]) {
                    let more: Vec<usize> = used.iter().copied().chain([place]).collect();
                    let (further, end) = self.reaches(&more, seen);
                    if end.is_none() {
                        if explained(&more) {
                            return Some(more);
                        }
                    } else if further > *reached {
                        next.push((further, more));
                    }
                }
            }
            next.sort_by_key(|(further, _)| std::cmp::Reverse(*further));
            next.truncate(BEAM);
            if next.is_empty() {
                return None;
            }
            beam = next;
        }
        None
    }

    /// The freedoms that would have made a difference to what was seen, or may have.
    fn dissenting(&self, used: &[usize], seen: &[Seen]) -> Vec<usize> {
        let Some(muted) = self.blueprint.muted(used) else { return Vec::new() };
        judge(self.blueprint, muted.device, self.tolerance, self.start, seen);
        let noted = muted.notes.into_iter().filter(|(_, dissent)| dissent.take());
        let noted = noted.map(|(place, _)| place);
        let mut places: Vec<usize> = noted.chain(muted.unknown).collect();
        places.sort_unstable();
        places.dedup();
        places
    }
}

/// The mutants of a blueprint that do what was seen, each by its place, with how many of the
/// sessions it explains: those first that explain most.
pub(crate) fn suspects(
    blueprint: &Blueprint,
    belief: &Belief<'_>,
    sessions: &[&[Seen]],
) -> Vec<(usize, usize)> {
    let doubtful = belief.doubtful.iter().map(Vec::as_slice);
    let sessions: Vec<&[Seen]> = sessions.iter().copied().chain(doubtful).collect();
    let explained = |mutant: &Candidate| {
        let Some(device) = blueprint.build(belief.freedoms().chain([mutant])) else { return 0 };
        let explains = |seen: &&&[Seen]| {
            let (tolerance, start) = (belief.tolerance, belief.start);
            judge(blueprint, device.clone(), tolerance, start, seen).1.is_none()
        };
        sessions.iter().filter(explains).count()
    };
    let each = blueprint.mutants().iter().enumerate();
    let all = each.map(|(place, mutant)| (place, explained(mutant)));
    let mut all: Vec<(usize, usize)> = all.filter(|(_, count)| *count > 0).collect();
    all.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    all
}
