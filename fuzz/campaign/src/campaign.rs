//! Session after session on one device.

use std::collections::{BTreeSet, VecDeque};

use canopen::{BusError, Mux};
use rustc_hash::FxHashSet;

use crate::belief::{Belief, Judged};
use crate::blueprint::Blueprint;
use crate::diagnosis::{Log, Suspect, dissenting, explains, suspects};
use crate::explore::{Coverage, Sights};
use crate::finding::Finding;
use crate::oracle::{End, Oracle, Seen, Violation};
use crate::session::{Goal, Played, Script, Session};
use crate::stage::Stage;
use crate::together::{Lesson, together};

/// What a campaign has shown so far.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Sessions that were played.
    pub sessions: u64,
    /// Actions in them.
    pub actions: u64,
    /// Sessions that the application of the device has cut short.
    pub void: u64,
    /// Sessions in which something was wrong once, and not when they were played again.
    pub undecided: u64,
    /// States of the model in which an action was tried.
    pub goals: FxHashSet<Goal>,
    /// Objects that the application changes.
    pub followed: BTreeSet<Mux>,
    /// Sessions that reached code which none before had.
    pub further: u64,
    /// What an exploration tried together.
    pub coverage: Coverage,
    /// What an exploration has judged.
    pub judged: Sights,
}

/// A campaign on one device.
pub struct Campaign<'b> {
    blueprint: &'b Blueprint,
    belief: Belief<'b>,
    seed: u64,
    tally: Tally,
    lessons: u64,
    /// The last sessions in which nothing was wrong.
    right: VecDeque<Log>,
    /// The sessions that taught what is believed now.
    taught: Vec<Lesson>,
    /// The sessions that reached code which none before had, by their numbers.
    further: Vec<(u64, Vec<u8>)>,
}

/// How often a session is played again since something was learnt in it.
const LESSONS: u32 = 32;

/// In how many of a hundred sessions an earlier one goes on otherwise, where one reached more code.
const FROM_EARLIER: u8 = 60;

/// How many sessions are kept in which nothing was wrong.
const MOST_RIGHT: usize = 48;
/// How many of them an exploration holds against a mutant.
const MOST_LONG: usize = 8;

impl<'b> Campaign<'b> {
    /// A campaign that begins with this belief.
    pub fn new(blueprint: &'b Blueprint, belief: Belief<'b>, seed: u64) -> Self {
        let (tally, right) = (Tally::default(), VecDeque::new());
        let (taught, further) = (Vec::new(), Vec::new());
        Self { blueprint, belief, seed, tally, lessons: 0, right, taught, further }
    }

    /// How models of the device are built.
    pub const fn blueprint(&self) -> &'b Blueprint {
        self.blueprint
    }

    /// What is believed of the device.
    pub const fn belief(&self) -> &Belief<'b> {
        &self.belief
    }

    /// What was done so far.
    pub const fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Plays the session of this number. Returns what is wrong with the device, if it is.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn session(
        &mut self,
        stage: &mut dyn Stage,
        number: u64,
    ) -> Result<Option<Finding>, BusError> {
        let played = self.play(stage, number)?;
        self.take(stage, number, played)
    }

    /// Plays the session of this number on a device that is believed to be as it is now.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn play(&self, stage: &mut dyn Stage, number: u64) -> Result<Played, BusError> {
        let bytes = self.bytes(number);
        stage.play(
            self.blueprint,
            self.belief.model(),
            &Script::Steered(&bytes, &self.tally.coverage),
        )
    }

    /// The bytes of the session of this number: new ones, or the beginning of an earlier session
    /// that reached code which none before had.
    fn bytes(&self, number: u64) -> Vec<u8> {
        let mut bytes = bytes(self.seed, number);
        // Later ones are left out, so that a number stays the same session.
        let earlier = self.further.partition_point(|(other, _)| *other < number);
        let mut random = fastrand::Rng::with_seed(self.seed.rotate_left(16) ^ number);
        if earlier > 0 && random.u8(0..100) < FROM_EARLIER {
            let (_, begun) = &self.further[random.usize(0..earlier)];
            let kept = random.usize(0..=begun.len());
            bytes.splice(0..0, begun[..kept].iter().copied());
        }
        bytes
    }

    /// Takes what was [played](Self::play) in the session of this number, and plays it again while
    /// something is learnt in it. Returns what is wrong with the device, if it is. What was played
    /// in a later one is worth nothing when [`lessons`](Self::lessons) has changed.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn take(
        &mut self,
        stage: &mut dyn Stage,
        number: u64,
        mut played: Played,
    ) -> Result<Option<Finding>, BusError> {
        for lesson in 0..=LESSONS {
            if lesson > 0 {
                played = self.play(stage, number)?;
            }
            if lesson == 0 && stage.reached_more() {
                self.tally.further += 1;
                self.further.push((number, self.bytes(number)));
            }
            self.count(&played);
            let violation = match &played.end {
                None => {
                    self.is_right(played.seen);
                    return Ok(None);
                }
                Some(End::Void(_)) => {
                    self.tally.void += 1;
                    return Ok(None);
                }
                Some(End::Violation(violation)) => violation.clone(),
            };
            if !self.repeats(stage, &played.session, &violation)? {
                self.tally.undecided += 1;
                return Ok(None);
            }
            let used = self.belief.used().to_vec();
            match self.explain(&played.seen) {
                Judged::Wrong => {}
                Judged::Learnt if lesson < LESSONS => {
                    self.taught.retain(|lesson| lesson.number != number);
                    self.taught.push(Lesson { number, session: played.session.clone() });
                    continue;
                }
                Judged::Learnt | Judged::Expected => return Ok(None),
            }
            let Played { session, seen, .. } = played;
            let finding = Finding::new(number, session, seen, violation, stage).believed(used);
            // What they taught is doubted now.
            let taught = std::mem::take(&mut self.taught);
            return together(self.blueprint, &taught, finding, stage).map(Some);
        }
        Ok(None)
    }

    /// The judge of a device that is believed to be as it is now.
    pub(crate) fn oracle(&self) -> Oracle<'b> {
        Oracle::new(self.blueprint, self.belief.model())
    }

    /// Takes note of something in which nothing was wrong.
    pub(crate) fn is_right(&mut self, seen: Vec<Seen>) {
        if self.right.len() == MOST_RIGHT {
            self.right.pop_front();
        }
        self.right.push_back(Log { used: self.belief.used().to_vec(), seen });
    }

    /// Looks for freedoms that explain what is not as expected.
    pub(crate) fn explain(&mut self, seen: &[Seen]) -> Judged {
        let judged = self.belief.explain(seen);
        self.lessons += u64::from(judged != Judged::Expected);
        judged
    }

    /// Whether the same is wrong again when a session is repeated: where the tester or the device
    /// was late, it is not.
    fn repeats(
        &self,
        stage: &mut dyn Stage,
        session: &Session,
        violation: &Violation,
    ) -> Result<bool, BusError> {
        let script = Script::Actions(&session.actions);
        for _ in 0..stage.repeats() {
            match stage.play(self.blueprint, self.belief.model(), &script) {
                Err(BusError::Interrupted) => return Err(BusError::Interrupted),
                // A device that has gone does not repeat anything.
                Err(_) => return Ok(true),
                Ok(again) => match again.end {
                    Some(End::Violation(other)) if other.is_like(violation) => {}
                    _ => return Ok(false),
                },
            }
        }
        Ok(true)
    }

    /// How often something was learnt, or was thought to be.
    pub const fn lessons(&self) -> u64 {
        self.lessons
    }

    fn count(&mut self, played: &Played) {
        self.tally.sessions += 1;
        self.tally.actions += played.session.actions.len() as u64;
        self.tally.goals.extend(played.goals.iter().copied());
        self.tally.followed.extend(played.followed.iter().copied());
        self.tally.coverage.take(&played.tried);
        if let Some(surface) = self.blueprint.surface() {
            self.tally.judged.take(&played.seen, surface, self.blueprint.node());
        }
    }

    /// The mutants that do what these findings are, the likeliest first.
    pub fn suspects(&self, findings: &[&Finding]) -> Vec<Suspect> {
        let log = |it: &&Finding| Log { used: it.used.clone(), seen: it.seen.clone() };
        let logs: Vec<Log> = findings.iter().map(log).collect();
        // The sessions of an exploration are long, and each mutant would work through all of them.
        let most = if self.blueprint.surface().is_some() { MOST_LONG } else { MOST_RIGHT };
        let right: Vec<&Log> = self.right.iter().rev().take(most).collect();
        let wrong = logs.iter().chain(self.belief.doubtful());
        suspects(self.blueprint, self.belief.used(), wrong, &right)
    }
}

impl Campaign<'_> {
    /// Those of the mutants of the blueprint at these places that would have made a difference to
    /// what was seen, or may have.
    pub fn dissenting(&self, seen: &[Seen], places: &[usize]) -> Vec<usize> {
        dissenting(self.blueprint, self.belief.used(), seen, places)
    }

    /// Whether a mutant of the blueprint does what a finding is.
    pub fn explains(&self, mutant: usize, finding: &Finding) -> bool {
        let log = (&*finding.used, &*finding.seen);
        explains(self.blueprint, self.belief.used(), mutant, log)
    }
}

/// The bytes of a session.
pub fn bytes(seed: u64, number: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed.rotate_left(32) ^ number);
    let length = random.usize(300..3_000);
    std::iter::repeat_with(|| random.u8(..)).take(length).collect()
}
