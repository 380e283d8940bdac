//! What is known of a device beside its data sheet: the freedoms that it was seen to use.

use reference_devices::change::Replica;

use crate::blueprint::{Blueprint, Candidate};
use crate::oracle::Seen;
use crate::session::judge;

/// The freedoms that a device is believed to use.
#[derive(Clone)]
pub struct Belief<'b> {
    blueprint: &'b Blueprint,
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
const MOST_FREEDOMS: usize = 24;
/// How many beliefs are followed up at a time.
const BEAM: usize = 4;
/// How many sessions are kept that changed the belief.
const MOST_EVIDENCE: usize = 16;

impl<'b> Belief<'b> {
    /// A device that uses these freedoms, by their places in the blueprint; `None` when it cannot
    /// be built.
    pub fn new(blueprint: &'b Blueprint, used: Vec<usize>) -> Option<Self> {
        let model = blueprint.build(used.iter().map(|place| &blueprint.freedoms()[*place]))?;
        let (given, evidence, doubtful) = (used.clone(), Vec::new(), Vec::new());
        Some(Self { blueprint, given, used, model, evidence, doubtful })
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
        let logs: Vec<&[Seen]> = self.evidence.iter().map(Vec::as_slice).chain([seen]).collect();
        let found = self.search(self.used.clone(), &logs).or_else(|| {
            let other = self.used != self.given;
            other.then(|| self.search(self.given.clone(), &logs))?
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

    /// How far a device with these freedoms explains what was seen: which session it does not
    /// explain, and up to where it does; the number of sessions when it explains all.
    fn reaches(&self, used: &[usize], logs: &[&[Seen]]) -> (usize, usize) {
        let all = self.blueprint.freedoms();
        let Some(model) = self.blueprint.build(used.iter().map(|place| &all[*place])) else {
            return (0, 0);
        };
        for (number, log) in logs.iter().enumerate() {
            let (place, end) = judge(self.blueprint, model.clone(), log);
            if end.is_some() {
                return (number, place);
            }
        }
        (logs.len(), 0)
    }

    /// Adds freedoms, those first that explain most.
    fn search(&self, base: Vec<usize>, logs: &[&[Seen]]) -> Option<Vec<usize>> {
        let reached = self.reaches(&base, logs);
        if reached.0 == logs.len() {
            return Some(base);
        }
        let mut beam = vec![(reached, base)];
        for _ in 0..MOST_FREEDOMS {
            let mut next = Vec::new();
            for (reached, used) in &beam {
                let found = self.extended(*reached, used, logs, &mut next);
                if found.is_some() {
                    return found;
                }
            }
            if next.is_empty() {
                // A freedom may only show what another one does.
                for (reached, used) in &beam {
                    let seen = self.dissenting(used, &logs[reached.0][..=reached.1]);
                    for freedom in &seen {
                        let more: Vec<usize> = used.iter().copied().chain([*freedom]).collect();
                        let found = self.extended_but(*reached, &more, logs, &mut next, &seen);
                        if found.is_some() {
                            return found;
                        }
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

    fn extended(
        &self,
        reached: (usize, usize),
        used: &[usize],
        logs: &[&[Seen]],
        next: &mut Vec<((usize, usize), Vec<usize>)>,
    ) -> Option<Vec<usize>> {
        self.extended_but(reached, used, logs, next, &[])
    }

    /// Adds each freedom that makes a difference, but for some that do not help. Returns one that
    /// explains all, and notes those that explain more.
    fn extended_but(
        &self,
        reached: (usize, usize),
        used: &[usize],
        logs: &[&[Seen]],
        next: &mut Vec<((usize, usize), Vec<usize>)>,
        but: &[usize],
    ) -> Option<Vec<usize>> {
        let (number, place) = reached;
        for freedom in self.dissenting(used, &logs[number][..=place]) {
            if but.contains(&freedom) {
                continue;
            }
            let more: Vec<usize> = used.iter().copied().chain([freedom]).collect();
            let further = self.reaches(&more, logs);
            if further.0 == logs.len() {
                return Some(more);
            }
            if further > reached {
                next.push((further, more));
            }
        }
        None
    }

    /// The freedoms that would have made a difference to what was seen, or may have.
    fn dissenting(&self, used: &[usize], seen: &[Seen]) -> Vec<usize> {
        let Some(muted) = self.blueprint.muted(used) else { return Vec::new() };
        judge(self.blueprint, muted.device, seen);
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
        let explains = |seen: &&&[Seen]| judge(blueprint, device.clone(), seen).1.is_none();
        sessions.iter().filter(explains).count()
    };
    let each = blueprint.mutants().iter().enumerate();
    let all = each.map(|(place, mutant)| (place, explained(mutant)));
    let mut all: Vec<(usize, usize)> = all.filter(|(_, count)| *count > 0).collect();
    all.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    all
}

/// Whether a mutant does what was seen.
pub(crate) fn explains(
    blueprint: &Blueprint,
    belief: &Belief<'_>,
    mutant: usize,
    seen: &[Seen],
) -> bool {
    let mutant = &blueprint.mutants()[mutant];
    let device = blueprint.build(belief.freedoms().chain([mutant]));
    device.is_some_and(|device| judge(blueprint, device, seen).1.is_none())
}
