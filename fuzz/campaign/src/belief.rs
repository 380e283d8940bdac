//! What is known of a device beside its data sheet: the freedoms that it was seen to use.

use std::cell::Cell;

use canopen::Stamped;
use canopen::sdo::{RESPONSE_COB_ID, Response};
use reference_devices::change::Replica;

use crate::blueprint::{Blueprint, Candidate, Muted};
use crate::diagnosis::Log;
use crate::oracle::{Oracle, Seen};
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
    doubtful: Vec<Log>,
    /// Whether the device has done something wrong, which may have looked like a freedom.
    is_wrong: bool,
    /// How much a search may still judge, in things that were seen.
    left: Cell<usize>,
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

/// Freedoms, and how far they explain what was seen.
#[derive(Clone)]
struct Step {
    /// Which session they do not explain, and up to where they do.
    reached: (usize, usize),
    used: Vec<usize>,
    /// What could have been added instead of those that were.
    others: Vec<(usize, Vec<usize>)>,
}

/// How much is looked at before something that several freedoms do together.
const LATELY: usize = 16;
/// How many checks of one request may hide the one that explains what was seen.
const MOST_CHECKS: usize = 3;
/// How many freedoms may be needed beside one that replaces another.
const MOST_COMPANIONS: usize = 4;
/// How many freedoms that explain less are tried with companions.
const MOST_DETOURS: usize = 12;
/// How often a freedom is added or replaced.
const MOST_STEPS: usize = 48;
/// How much a search judges, in things that were seen. Where freedoms were found, in hundreds of
/// devices that use some and in second implementations, a sixth of it was enough. A search that
/// finds none would go on for many minutes.
const MOST_JUDGED: usize = 16_000_000;
/// The same in an exploration, where it takes longer to judge, for each thing that is to be
/// explained. A fifth was too little for a session of a second controller.
const MOST_JUDGED_FOR_EACH: usize = 2_000;
/// How many sessions are kept that changed the belief.
const MOST_EVIDENCE: usize = 16;

impl<'b> Belief<'b> {
    /// A device that is said to use these freedoms, by their places in the blueprint; `None` when
    /// it cannot be built.
    pub fn new(blueprint: &'b Blueprint, used: Vec<usize>) -> Option<Self> {
        let model = blueprint.build(blueprint.freedoms_at(&used))?;
        let (given, evidence, doubtful) = (used.clone(), Vec::new(), Vec::new());
        let (is_wrong, left) = (false, Cell::new(0));
        Some(Self { blueprint, given, used, model, evidence, doubtful, is_wrong, left })
    }

    /// A device that has shown that it uses these freedoms, by their places in the blueprint;
    /// `None` when it cannot be built. They give way to what explains more.
    pub fn learnt(blueprint: &'b Blueprint, used: Vec<usize>) -> Option<Self> {
        Some(Self { given: Vec::new(), ..Self::new(blueprint, used)? })
    }

    /// One more freedom that the device is said to use, by its place in the blueprint; as before
    /// when no device uses it beside the others.
    #[must_use]
    pub fn with(self, freedom: usize) -> Self {
        if !self.blueprint.agree(&self.used, freedom) {
            return self;
        }
        let used = self.used.iter().copied().chain([freedom]).collect();
        Self::new(self.blueprint, used).unwrap_or(self)
    }

    /// A device that is like the one that is believed in, switched on at time 0.
    pub fn model(&self) -> Box<dyn Replica> {
        self.model.clone()
    }

    /// The freedoms.
    pub fn freedoms(&self) -> impl Iterator<Item = &'b Candidate> + '_ {
        self.blueprint.freedoms_at(&self.used)
    }

    /// Their places in the blueprint.
    pub(crate) fn used(&self) -> &[usize] {
        &self.used
    }

    /// Whether it was said before the first session that the device uses a freedom, and no session
    /// has contradicted it.
    pub fn is_given(&self, freedom: &Candidate) -> bool {
        let all = self.blueprint.freedoms();
        self.given.iter().any(|place| all[*place].name == freedom.name)
    }

    /// Takes what was seen in a session that is not as expected, and looks for freedoms that
    /// explain it.
    pub fn explain(&mut self, seen: &[Seen]) -> Judged {
        let logs: Vec<&[Seen]> = self.evidence.iter().map(Vec::as_slice).chain([seen]).collect();
        let found = self.search(self.used.clone(), false, &logs).or_else(|| {
            // What a device was said to use before it was seen may be a mistake.
            let other = !self.used.is_empty();
            other.then(|| self.search(self.given.clone(), true, &logs))?
        });
        let found = found.or_else(|| {
            // What it does wrong elsewhere must not make wrong what a freedom explains, nor what
            // was taken for a freedom because somebody was late.
            let doubtful = self.is_wrong || self.blueprint.is_in_its_own_time();
            let alone = doubtful && !self.evidence.is_empty();
            // Most of what was learnt may be right, and one more freedom is all that it takes.
            let used = alone.then(|| {
                let anew = self.search(self.given.clone(), true, &[seen]);
                anew.or_else(|| self.search(self.used.clone(), true, &[seen]))
            })??;
            self.doubt();
            Some(used)
        });
        let Some((used, model)) = found.and_then(|used| {
            let model = self.blueprint.build(self.blueprint.freedoms_at(&used))?;
            Some((used, model))
        }) else {
            self.doubt();
            return Judged::Wrong;
        };
        if used == self.used {
            return Judged::Expected;
        }
        self.given.retain(|freedom| used.contains(freedom));
        (self.used, self.model) = (used, model);
        if self.evidence.len() < MOST_EVIDENCE {
            self.evidence.push(seen.to_vec());
        }
        Judged::Learnt
    }

    /// What was learnt of a device that does something wrong may be part of that.
    fn doubt(&mut self) {
        self.is_wrong = true;
        if let Some(model) = self.blueprint.build(self.blueprint.freedoms_at(&self.given)) {
            (self.used, self.model) = (self.given.clone(), model);
        }
        let log = |seen| Log { used: self.used.clone(), seen };
        self.doubtful.extend(self.evidence.drain(..).map(log));
        self.doubtful.truncate(MOST_EVIDENCE);
    }

    /// How far a device with these freedoms explains what was seen: which session it does not
    /// explain, and up to where it does; the number of sessions when it explains all. A search that
    /// has judged enough gets no further.
    fn reaches(&self, used: &[usize], logs: &[&[Seen]]) -> (usize, usize) {
        let Some(model) = self.blueprint.build(self.blueprint.freedoms_at(used)) else {
            return (0, 0);
        };
        for (number, log) in logs.iter().enumerate() {
            if self.left.get() == 0 {
                return (0, 0);
            }
            let (place, end) = judge(self.blueprint, model.clone(), log);
            self.judged(place);
            if end.is_some() {
                return (number, place);
            }
        }
        (logs.len(), 0)
    }

    fn judged(&self, count: usize) {
        self.left.set(self.left.get().saturating_sub(count));
    }

    /// Adds freedoms, those first that explain most. Where none helps, one of those before is
    /// replaced by one that explained as much; with `doubts`, those of the base may be left out.
    fn search(&self, base: Vec<usize>, doubts: bool, logs: &[&[Seen]]) -> Option<Vec<usize>> {
        let is_explored = self.blueprint.surface().is_some();
        let explained: usize = logs.iter().map(|log| log.len()).sum();
        self.left.set(if is_explored { explained * MOST_JUDGED_FOR_EACH } else { MOST_JUDGED });
        let reached = self.reaches(&base, logs);
        let doubted = base.iter().filter(|_| doubts).map(|freedom| (*freedom, Vec::new()));
        let mut now = Step { reached, others: doubted.collect(), used: base };
        // The sessions of an exploration are long, and many freedoms make a difference in them.
        let checks = if is_explored { 1 } else { MOST_CHECKS };
        for _ in 0..MOST_STEPS {
            if now.reached.0 == logs.len() {
                return Some(now.used);
            }
            let each = self.with_each(&now, logs, &[]);
            // Of what explains as much, the belief with fewer freedoms is the likelier one.
            let more = furthest(&now, &each);
            let further = more.as_ref().map_or(now.reached, |more| more.reached);
            let other = more.is_some().then(|| self.with_the_other(&now, logs)).flatten();
            now = other
                .filter(|other| other.reached >= further)
                .or(more)
                .or_else(|| self.with_another(&now, logs))
                .or_else(|| self.with_several_more(&now, logs, &[], checks))
                .or_else(|| self.with_company(&now, each, logs))?;
        }
        None
    }

    /// The freedom that explains most beside those that are used.
    fn with_one_more(&self, now: &Step, logs: &[&[Seen]], but: &[usize]) -> Option<Step> {
        furthest(now, &self.with_each(now, logs, but))
    }

    /// Each freedom that may have made a difference, beside those that are used: the one that
    /// explains most first.
    fn with_each(&self, now: &Step, logs: &[&[Seen]], but: &[usize]) -> Vec<Step> {
        let (number, place) = now.reached;
        let all = self.dissenting(&now.used, until(logs[number], place));
        let others = all.into_iter().filter(|freedom| !but.contains(freedom));
        let steps = others.map(|freedom| {
            let used: Vec<usize> = now.used.iter().copied().chain([freedom]).collect();
            Step { reached: self.reaches(&used, logs), used, others: now.others.clone() }
        });
        let mut steps: Vec<Step> = steps.collect();
        steps.sort_by_key(|step| std::cmp::Reverse(step.reached));
        steps
    }

    /// A freedom that explains less, until others come to it: where the objects of two links change
    /// places, a type is refused without its link, unless the device takes that, too.
    fn with_company(&self, now: &Step, each: Vec<Step>, logs: &[&[Seen]]) -> Option<Step> {
        let is_refusal = |(number, place): (usize, usize)| {
            logs.get(number).and_then(|log| log.get(place)).is_some_and(answers_a_write)
        };
        let less = each.into_iter().filter(|step| step.reached < now.reached);
        for mut step in less.filter(|step| is_refusal(step.reached)).take(MOST_DETOURS) {
            let freedom = step.used.last().copied()?;
            step.others.push((freedom, Vec::new()));
            for _ in 0..MOST_COMPANIONS {
                let Some(next) = self.with_one_more(&step, logs, &[]) else { break };
                if next.reached > now.reached {
                    return Some(next);
                }
                step = next;
            }
        }
        None
    }

    /// Replaces a freedom by one that was as good when it was added, and explains more.
    fn with_the_other(&self, now: &Step, logs: &[&[Seen]]) -> Option<Step> {
        let all = now.others.iter().enumerate().flat_map(|(place, (freedom, others))| {
            let rest: Vec<usize> =
                now.used.iter().filter(|used| *used != freedom).copied().collect();
            let fits = others.iter().filter(|other| self.blueprint.agree(&rest, **other));
            let fits: Vec<usize> = fits.copied().collect();
            fits.into_iter().map(move |other| {
                let used: Vec<usize> = rest.iter().copied().chain([other]).collect();
                let mut others = now.others.clone();
                others[place].0 = other;
                Step { reached: self.reaches(&used, logs), used, others }
            })
        });
        let more = all.filter(|step| step.reached > now.reached);
        more.reduce(|best, step| if step.reached > best.reached { step } else { best })
    }

    /// Replaces a freedom by one that was as good when it was added, or leaves it out: the last
    /// ones first.
    fn with_another(&self, now: &Step, logs: &[&[Seen]]) -> Option<Step> {
        for (place, (freedom, others)) in now.others.iter().enumerate().rev() {
            let rest: Vec<usize> =
                now.used.iter().filter(|used| *used != freedom).copied().collect();
            let fits = |other: &&usize| self.blueprint.agree(&rest, **other);
            for other in others.iter().filter(fits).map(|it| Some(*it)).chain([None]) {
                let used: Vec<usize> = rest.iter().copied().chain(other).collect();
                let mut others = now.others.clone();
                match other {
                    Some(other) => others[place].0 = other,
                    None => drop(others.remove(place)),
                }
                let mut step = Step { reached: self.reaches(&used, logs), used, others };
                // Another one may need company before it explains as much.
                for _ in 0..MOST_COMPANIONS {
                    if step.reached > now.reached {
                        return Some(step);
                    }
                    let Some(next) = self.with_one_more(&step, logs, &[]) else { break };
                    step = next;
                }
            }
        }
        None
    }

    /// A freedom may only show what another one does: a server that leaves out the first check of
    /// a request comes to the second one. `known` are those that were asked without it, and it
    /// takes at most `more` of them before the one that explains something.
    fn with_several_more(
        &self,
        now: &Step,
        logs: &[&[Seen]],
        known: &[usize],
        more: usize,
    ) -> Option<Step> {
        let (number, place) = now.reached;
        let seen = until(logs[number], place);
        if self.left.get() == 0 {
            return None;
        }
        self.judged(seen.len());
        let muted = self.blueprint.muted_freedoms(&now.used)?;
        let mut lately = muted.dissenting_lately(self.blueprint, seen, LATELY);
        lately.retain(|freedom| !known.contains(freedom));
        let steps = lately.iter().map(|freedom| {
            let mut step = now.clone();
            step.used.push(*freedom);
            step.others.push((*freedom, Vec::new()));
            step
        });
        let steps: Vec<Step> = steps.collect();
        let known: Vec<usize> = known.iter().copied().chain(lately).collect();
        // In an exploration two of them may make a difference only together: a tuning that takes
        // less time and that waits for a broken sensor ends when the sensor is repaired.
        let but: &[usize] = if self.blueprint.surface().is_some() { &[] } else { &known };
        steps.iter().find_map(|step| self.with_one_more(step, logs, but)).or_else(|| {
            let more = more.checked_sub(1).filter(|more| *more > 0)?;
            steps.iter().find_map(|step| self.with_several_more(step, logs, &known, more))
        })
    }

    /// The freedoms that would have made a difference to what was seen, or may have.
    fn dissenting(&self, used: &[usize], seen: &[Seen]) -> Vec<usize> {
        if self.left.get() == 0 {
            return Vec::new();
        }
        self.judged(seen.len());
        let muted = self.blueprint.muted_freedoms(used);
        let mut places = muted.map_or_else(Vec::new, |it| it.dissenting(self.blueprint, seen));
        places.sort_unstable();
        places
    }

    /// What showed freedoms that did not hold.
    pub(crate) fn doubtful(&self) -> impl Iterator<Item = &Log> {
        self.doubtful.iter()
    }
}

/// What was seen up to a place and with it.
fn until(seen: &[Seen], place: usize) -> &[Seen] {
    &seen[..seen.len().min(place + 1)]
}

/// Whether an SDO server took a download, or refused something. A freedom that expects the other
/// one may be right beside another that gives leave; with an unexpected value it is not.
fn answers_a_write(seen: &Seen) -> bool {
    let Seen::Frame(Stamped { own: false, frame, .. }) = seen else { return false };
    let is_response = frame.data_id().is_some_and(|id| id & 0x780 == RESPONSE_COB_ID);
    is_response
        && matches!(
            Response::decode(&frame.data),
            Ok(Response::Download(_) | Response::DownloadSegment(_) | Response::Abort(..))
        )
}

/// The first of the steps, of which each adds a freedom, when it explains more than before.
fn furthest(now: &Step, each: &[Step]) -> Option<Step> {
    let mut further = each.iter().filter(|step| step.reached > now.reached);
    let mut best = further.next()?.clone();
    let added = |step: &Step| step.used.last().copied();
    best.others.push((added(&best)?, further.filter_map(added).collect()));
    Some(best)
}

impl Muted {
    /// The places of the deviations that would have made a difference to what was seen, or may
    /// have.
    pub(crate) fn dissenting(self, blueprint: &Blueprint, seen: &[Seen]) -> Vec<usize> {
        judge(blueprint, self.device, seen);
        let noted = self.notes.into_iter().filter(|(_, dissent)| dissent.take());
        noted.map(|(place, _)| place).chain(self.unknown).collect()
    }

    /// Those of them that can be muted and would have made one lately.
    pub(crate) fn dissenting_lately(
        self,
        blueprint: &Blueprint,
        seen: &[Seen],
        lately: usize,
    ) -> Vec<usize> {
        if blueprint.surface().is_some() {
            // What a device did an hour ago may show now.
            judge(blueprint, self.device, seen);
            let noted = self.notes.into_iter().filter(|(_, dissent)| dissent.take());
            return noted.map(|(place, _)| place).collect();
        }
        let mut oracle = Oracle::new(blueprint, self.device);
        let earlier = seen.len().saturating_sub(lately);
        for (place, one) in seen.iter().enumerate() {
            if place == earlier {
                self.notes.iter().for_each(|(_, dissent)| _ = dissent.take());
            }
            if oracle.see(one).is_err() {
                break;
            }
        }
        let noted = self.notes.into_iter().filter(|(_, dissent)| dissent.take());
        noted.map(|(place, _)| place).collect()
    }
}
