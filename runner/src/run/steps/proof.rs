//! Proofs of the assertions of a case by a run, for `harness qualify`.
//!
//! Where the device breaks a constraint, the steps continue as if the constraint did not exist. If
//! nothing else is wrong, the verdict rests on that constraint alone: without it, the case would
//! have passed, and so it is proved.

use std::collections::BTreeSet;

use canopen::{Instant, Pattern, Stamped};

use super::judge::{Difference, Judgement, Trouble};
use super::run::Steps;
use crate::run::observer::{Observer, Shown};
use crate::source::At;
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::literal::FrameText;

/// The proof as it takes shape.
#[derive(Debug, Default)]
pub(in crate::run) struct Proof {
    /// The place of the step that is judged now; none in `setup` and `finally`.
    pub step: Option<usize>,
    broken: Option<Broken>,
    /// Something else is wrong, too.
    spoilt: bool,
    /// The part that does not count.
    open: Option<(usize, Option<Constraint>)>,
    allowed: BTreeSet<(usize, Allowance)>,
}

/// The device's first mistake.
#[derive(Debug)]
struct Broken {
    step: usize,
    constraints: BTreeSet<Constraint>,
    /// It broke the step in a way that no constraint is about.
    whole: bool,
    /// The difference, until it is reported.
    difference: Option<Difference>,
}

impl Proof {
    /// A proof that begins, where the observer asks for one.
    pub(in crate::run) fn of(observer: &dyn Observer) -> Option<Self> {
        observer.goes_on().then(|| Self { open: observer.opens(), ..Self::default() })
    }

    /// Whether the step that comes now is left out.
    pub(in crate::run) fn leaves_out(&self) -> bool {
        matches!(&self.open, Some((step, None)) if self.step == Some(*step))
    }

    /// The part of the step that is judged now which does not count.
    fn open(&self) -> Option<&Constraint> {
        let (step, part) = self.open.as_ref()?;
        part.as_ref().filter(|_| self.step == Some(*step))
    }

    /// Whether the steps go on although the device broke these constraints of the step that is
    /// judged now; of the step as a whole when there are none.
    fn bears(&mut self, constraints: &[Constraint], difference: &Difference) -> bool {
        let Some(step) = self.step else { return false };
        let broken = self.broken.get_or_insert_with(|| Broken {
            step,
            constraints: BTreeSet::new(),
            whole: false,
            difference: Some(difference.clone()),
        });
        if broken.step != step {
            return false;
        }
        broken.constraints.extend(constraints.iter().cloned());
        broken.whole |= constraints.is_empty();
        true
    }

    /// The first difference, once.
    pub(in crate::run) fn difference(&mut self) -> Option<Difference> {
        self.broken.as_mut()?.difference.take()
    }

    /// More is wrong than what was broken first.
    pub(in crate::run) fn spoil(&mut self) {
        self.spoilt = true;
    }

    /// Whether the device broke nothing before the step that is judged now.
    fn is_first(&self) -> bool {
        let broken = self.broken.as_ref().map(|broken| broken.step);
        self.step.is_some_and(|step| broken.is_none_or(|broken| broken == step))
    }

    /// The result at the end of the run.
    pub(in crate::run) fn end(self) -> Shown {
        let Self { broken, spoilt, allowed, .. } = self;
        let Some(broken) = broken else { return Shown { allowed, ..Shown::default() } };
        let Broken { step, constraints, whole, .. } = broken;
        let rests = !spoilt && !whole;
        let together = constraints.len() == 1 || constraints.iter().all(Constraint::is_of_frame);
        let constraints = if rests && together { constraints } else { BTreeSet::new() };
        Shown { step: Some(step), alone: !spoilt, constraints, allowed }
    }
}

impl Steps<'_, '_> {
    /// The device broke these constraints of the step; the step as a whole when there are none.
    ///
    /// # Errors
    /// The difference, unless the steps go on to find out whether it is the only one.
    pub(super) fn broken(
        &mut self,
        constraints: &[Constraint],
        difference: Difference,
    ) -> Judgement {
        let open = self.open();
        let count = constraints.iter().filter(|one| open != Some(*one)).count();
        if count == 0 && !constraints.is_empty() {
            return Ok(None);
        }
        match self.proof.as_mut().is_some_and(|proof| proof.bears(constraints, &difference)) {
            true => Ok(None),
            false => Err(Trouble::Device(difference)),
        }
    }

    /// The part of the step that does not count.
    pub(super) fn open(&self) -> Option<&Constraint> {
        self.proof.as_ref().and_then(Proof::open)
    }

    /// The device did what is accepted, too.
    pub(super) fn allows(&mut self, allowance: Allowance) {
        if let Some(proof) = &mut self.proof
            && let Some(step) = proof.step
        {
            proof.allowed.insert((step, allowance));
        }
    }

    /// The parts of the pattern that a frame does not fit. Nothing when it has another length, or
    /// none of several parts fits: it is another frame then.
    pub(super) fn misfits(
        &self,
        text: &At<FrameText>,
        got: &Stamped,
    ) -> Result<Vec<Constraint>, Trouble> {
        let parts = text.value.constraints();
        let goes_on = self.proof.as_ref().is_some_and(Proof::is_first);
        if !goes_on || !self.pattern_without(text, &parts)?.matches(&got.frame) {
            return Ok(Vec::new());
        }
        let mut misfits = Vec::new();
        for part in &parts {
            let others: Vec<Constraint> =
                parts.iter().filter(|other| *other != part).cloned().collect();
            if !self.pattern_without(text, &others)?.matches(&got.frame) {
                misfits.push(part.clone());
            }
        }
        let another = parts.len() > 1 && misfits.len() == parts.len();
        Ok(if another { Vec::new() } else { misfits })
    }

    /// The fewest parts of the pattern without which enough of the frames from `start` to `until`
    /// would have fitted.
    pub(super) fn nearly(
        &self,
        text: &At<FrameText>,
        (start, until): (Instant, Instant),
        enough: impl Fn(usize) -> bool,
    ) -> Result<Option<Vec<Constraint>>, Trouble> {
        if !self.proof.as_ref().is_some_and(Proof::is_first) {
            return Ok(None);
        }
        let came = |seen: &Stamped| !seen.own && seen.at > start && seen.at <= until;
        let trace = self.link.trace().iter().map(|seen| seen.stamped);
        let seen: Vec<Stamped> = trace.filter(came).collect();
        let mut nearest: Option<Vec<Constraint>> = None;
        for stamped in &seen {
            let misfits = self.misfits(text, stamped)?;
            let fewer = nearest.as_ref().is_none_or(|known| misfits.len() < known.len());
            if misfits.is_empty() || !fewer {
                continue;
            }
            let open = self.pattern_without(text, &misfits)?;
            if enough(seen.iter().filter(|seen| open.matches(&seen.frame)).count()) {
                nearest = Some(misfits);
            }
        }
        Ok(nearest)
    }

    /// The pattern of which these parts do not count.
    pub(super) fn pattern_without(
        &self,
        text: &At<FrameText>,
        parts: &[Constraint],
    ) -> Result<Pattern, Trouble> {
        let words: Vec<_> = parts.iter().filter_map(|part| text.value.words_of(part)).collect();
        let open = |place| words.iter().any(|words| words.contains(&place));
        self.scope.pattern_open(&text.value, self.dut.node, &open).map_err(Trouble::Impossible)
    }
}
