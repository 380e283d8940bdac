//! The proof by assertion. For each step that judges, and each constraint in it, the verdict on
//! some mutant rests on it. For each allowance, some device without deviation, or with a freedom,
//! uses it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Add;

use runner::suite::constraint::{Constraint, assertion_name};
use runner::suite::model::Case;
use runner::suite::{Library, Suite};

use super::alike::represented;
use super::assertion::Assertion;
use super::freedoms::Freedoms;
use super::matrix::Matrix;
use super::slips::Slips;
use crate::cli::QualifyArgs;

/// The assertions of cases, and what proves them.
pub(super) struct Assertions<'l> {
    all: Vec<Judged<'l>>,
}

/// An assertion, and what is known of it.
pub(crate) struct Judged<'l> {
    suite: &'l Suite,
    case: &'l Case,
    step: usize,
    constraint: Option<Constraint>,
    /// The mutant that is killed by nothing else, or what makes use of it.
    by: Option<String>,
    /// Why it need not be proved.
    excuse: Option<&'l str>,
    /// Whether the step fails on a mutant that another step would notice, too.
    fails: bool,
}

impl<'l> Assertions<'l> {
    /// The assertions of the cases that are proved on the devices of these matrices.
    pub(super) fn of(
        library: &'l Library,
        matrices: &[Matrix],
        freedoms: &[Freedoms],
        slips: &Slips,
    ) -> Self {
        let mut proofs = BTreeMap::<&Assertion, &str>::new();
        let all = matrices.iter().flat_map(Matrix::proofs);
        let all = all.chain(freedoms.iter().flat_map(Freedoms::proofs)).chain(slips.proofs());
        for (assertion, by) in all {
            proofs.entry(assertion).or_insert(by);
        }
        let failing: BTreeSet<&Assertion> = matrices.iter().flat_map(Matrix::failing).collect();
        let at_home = |suite: &&Suite| matrices.iter().any(|matrix| matrix.is_home_of(suite));
        let mut all = Vec::new();
        for suite in library.suites.iter().map(|suite| &**suite).filter(at_home) {
            for case in suite.file.cases.iter().map(|case| &case.value) {
                let name = format!("{}/{}", suite.name(), case.id.value);
                let represented = represented(case);
                all.extend(case.assertions().map(|(step, constraint)| {
                    let excuse = [None, constraint.as_ref()]
                        .iter()
                        .find_map(|one| case.unproved.get(&assertion_name(step, *one)));
                    let excuse = excuse.map(|reason| reason.value.as_str());
                    let assertion = Assertion { case: name.clone(), step, constraint };
                    let by = proofs.get(&assertion).map(|&by| by.to_owned());
                    let by = by.or_else(|| {
                        let step = *represented.get(&step)?;
                        let by = proofs.get(&Assertion { step, ..assertion.clone() })?;
                        Some(format!("as step {}, {by}", step + 1))
                    });
                    let fails = failing.contains(&assertion);
                    let constraint = assertion.constraint;
                    Judged { suite, case, step, constraint, by, excuse, fails }
                }));
            }
        }
        Self { all }
    }

    /// The case, the name and the state of each.
    pub(super) fn states(&self) -> impl Iterator<Item = (String, String, &'static str)> {
        self.all.iter().map(|judged| {
            let state = match (&judged.by, judged.excuse) {
                (Some(_), _) => "proved",
                (None, Some(_)) => "excused",
                (None, None) => "open",
            };
            (format!("{}/{}", judged.suite.name(), judged.case.id.value), judged.name(), state)
        })
    }

    /// Those of one case.
    pub(super) fn about(self, case: &Case) -> Vec<Judged<'l>> {
        self.all.into_iter().filter(|judged| std::ptr::eq(judged.case, case)).collect()
    }

    /// Adds the figures, with `verbose` those of each suite, and what is not proved when asked for.
    pub(super) fn show(&self, text: &mut String, args: &QualifyArgs) {
        let mut suites = Vec::<(&str, Figures)>::new();
        for judged in &self.all {
            match suites.last_mut() {
                Some((name, figures)) if *name == judged.suite.name() => figures.count(judged),
                _ => {
                    let mut figures = Figures::default();
                    figures.count(judged);
                    suites.push((judged.suite.name(), figures));
                }
            }
        }
        let all = suites.iter().fold(Figures::default(), |all, (_, figures)| all + *figures);
        let rest = all.left();
        let hint = match rest {
            0 => String::new(),
            _ if args.unproved => format!(", {rest} left:"),
            _ => format!(", {rest} left: `--unproved` names them"),
        };
        text.push_str(&format!("assertions: {all}{hint}\n"));
        for (name, figures) in suites.iter().filter(|_| args.verbose) {
            text.push_str(&format!("  {name}: {figures}\n"));
        }
        let open = self.all.iter().filter(|judged| judged.by.is_none() && judged.excuse.is_none());
        for judged in open.filter(|_| args.unproved) {
            text.push_str(&format!("{judged}\n"));
        }
    }

    /// The excuses that nothing needs; of a `whole` run, too little that is proved.
    pub(super) fn holes(&self, whole: bool) -> Vec<String> {
        let excused = self.all.iter().filter(|judged| {
            let name = judged.name();
            judged.by.is_some() && judged.case.unproved.contains_key(&name)
        });
        let mut holes: Vec<String> =
            excused.map(|judged| format!("{judged} is proved, and need not be excused")).collect();
        for (of_steps, least) in [(true, LEAST_STEPS), (false, LEAST_CONSTRAINTS)] {
            let all = self.all.iter().filter(|judged| judged.excuse.is_none());
            let all = all.filter(|judged| judged.constraint.is_none() == of_steps);
            let proved = all.clone().filter(|judged| judged.by.is_some()).count();
            let all = all.count();
            if whole && proved * 100 < all * least {
                let what = if of_steps { "steps" } else { "constraints" };
                holes.push(format!(
                    "{proved} of {all} {what} that are not excused are proved, fewer than \
                     {least} %: `--unproved` lists the rest"
                ));
            }
        }
        holes
    }
}

/// How many of a hundred steps that are not excused must be proved: each of them.
const LEAST_STEPS: usize = 100;

/// How many of a hundred constraints that are not excused must be proved.
const LEAST_CONSTRAINTS: usize = 99;

impl Judged<'_> {
    /// As excuses name it.
    fn name(&self) -> String {
        assertion_name(self.step, self.constraint.as_ref())
    }

    /// The line of the step, the constraint, and what proves it.
    pub(crate) fn explained(&self) -> String {
        let line = self.case.steps[self.step].place.line;
        let what = match &self.constraint {
            None => format!("line {line}"),
            Some(constraint) => format!("line {line}, {constraint}"),
        };
        match (&self.by, self.excuse) {
            (Some(by), _) => format!("{what}: {by}"),
            (None, Some(reason)) => format!("{what}: not proved, {reason}"),
            (None, None) => format!("{what}: not proved"),
        }
    }

    /// Whether mutants can prove it; freedoms prove an allowance.
    pub(crate) fn is_demand(&self) -> bool {
        self.constraint.as_ref().is_none_or(Constraint::is_demand)
    }
}

/// With the file and the line of the step, as compilers have it.
impl fmt::Display for Judged<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (suite, case) = (self.suite.name(), &self.case.id.value);
        let line = self.case.steps[self.step].place.line;
        write!(f, "{}:{line}: {suite}/{case}: {}", self.suite.source.name, self.name())?;
        if self.fails && self.by.is_none() {
            f.write_str(" (fails, but not alone)")?;
        }
        Ok(())
    }
}

/// How many there are, and how many of them are proved.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    steps: Count,
    constraints: Count,
}

#[derive(Clone, Copy, Debug, Default)]
struct Count {
    all: usize,
    proved: usize,
    excused: usize,
}

impl Figures {
    fn count(&mut self, judged: &Judged) {
        let count = match judged.constraint {
            None => &mut self.steps,
            Some(_) => &mut self.constraints,
        };
        count.all += 1;
        count.proved += usize::from(judged.by.is_some());
        count.excused += usize::from(judged.by.is_none() && judged.excuse.is_some());
    }
}

impl Figures {
    /// How many are neither proved nor excused.
    const fn left(self) -> usize {
        let [steps, constraints] = [self.steps, self.constraints];
        let all = steps.all + constraints.all;
        all - steps.proved - steps.excused - constraints.proved - constraints.excused
    }
}

impl Add for Figures {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let steps = self.steps + other.steps;
        Self { steps, constraints: self.constraints + other.constraints }
    }
}

impl Add for Count {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            all: self.all + other.all,
            proved: self.proved + other.proved,
            excused: self.excused + other.excused,
        }
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} steps and {} constraints proved", self.steps, self.constraints)?;
        match self.steps.excused + self.constraints.excused {
            0 => Ok(()),
            excused => write!(f, ", {excused} excused"),
        }
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let permille = self.proved * 1000 / self.all.max(1);
        write!(f, "{} of {} ({}.{} %)", self.proved, self.all, permille / 10, permille % 10)
    }
}
