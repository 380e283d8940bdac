//! Verdicts, and the details that belong to each of them.

use std::fmt;

use canopen::{Frame, Instant, Pattern, meaning};
use serde::{Deserialize, Serialize};

use crate::wire;

/// The verdict of a case on the device, in ascending weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Verdict {
    /// Conformant.
    Pass,
    /// Not what the document says, yet within what is tolerated.
    Lenient,
    /// Not applicable to this device or not possible on this bench.
    Skip,
    /// Not run, or not to its end, because a requirement it relies on does not hold on this device.
    Blocked,
    /// FAIL, ERROR, FLAKY or LENIENT for a reason that its user knows and has waived.
    Waived,
    /// Not conformant each time: of the attempts of one run, some failed and others did not.
    Flaky,
    /// Not conformant.
    Fail,
    /// No statement about the device: the bench or the harness could not do its part.
    Error,
}

impl Verdict {
    /// How much it says about a requirement or a cause. A requirement that one case shows to hold
    /// is tested, although others were skipped; a FAIL is certain, and an ERROR is not.
    pub(crate) const fn weight(self) -> u8 {
        match self {
            Self::Skip => 0,
            Self::Blocked => 1,
            Self::Pass => 2,
            Self::Lenient => 3,
            Self::Waived => 4,
            Self::Flaky => 5,
            Self::Error => 6,
            Self::Fail => 7,
        }
    }

    /// Whether it is about something that was tried and does not simply hold.
    pub(crate) const fn is_short_of_pass(self) -> bool {
        self.weight() > Self::Pass.weight()
    }

    /// Whether it needs no explanation of its own: the device passed, or the case says nothing.
    pub const fn is_usual(self) -> bool {
        matches!(self, Self::Pass | Self::Skip | Self::Blocked)
    }

    /// Whether a table has a column for it only where it occurs.
    pub(crate) const fn is_rare(self) -> bool {
        matches!(self, Self::Blocked | Self::Waived | Self::Flaky)
    }

    /// Every verdict, in ascending weight.
    pub const ALL: [Self; 8] = [
        Self::Pass,
        Self::Lenient,
        Self::Skip,
        Self::Blocked,
        Self::Waived,
        Self::Flaky,
        Self::Fail,
        Self::Error,
    ];

    /// What it says, in a sentence.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Pass => "The device does what the specification demands.",
            Self::Lenient => {
                "Another behaviour that is tolerated, or a deviation from what is only \
                 recommended; with `--grade strict` the run is not green."
            }
            Self::Skip => "The case does not apply to this device, for the reason given.",
            Self::Blocked => {
                "The case relies on a requirement that does not hold on this device; the run \
                 stays green."
            }
            Self::Waived => "A FAIL, ERROR, FLAKY or LENIENT that is waived; the run stays green.",
            Self::Flaky => {
                "The case failed and then passed when it was repeated; with `--repeat` or `--grade \
                 strict` the run is not green."
            }
            Self::Fail => "The device breaks a requirement that is a must.",
            Self::Error => "The case could not be carried out; it says nothing about the device.",
        }
    }

    /// The verdict in capitals, as every report prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "PASS",
            Self::Lenient => "LENIENT",
            Self::Skip => "SKIP",
            Self::Blocked => "BLOCKED",
            Self::Waived => "XFAIL",
            Self::Flaky => "FLAKY",
            Self::Fail => "FAIL",
            Self::Error => "ERROR",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The grade at which a run counts as green.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// LENIENT is not good enough.
    Strict,
    /// LENIENT is good enough.
    #[default]
    Lenient,
}

/// A verdict with its details: no case fails, errs or is skipped without a reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Outcome {
    /// Conformant.
    Pass,
    /// Tolerated; the problem is that of the strict grade.
    Lenient(Box<Problem>),
    /// Why the case does not apply.
    Skip(String),
    /// Which requirement the case relies on does not hold, and how that showed.
    Blocked(String),
    /// The device's mistake.
    Fail(Box<Problem>),
    /// The device's mistake, which it does not make each time.
    Flaky {
        /// That of the latest attempt that failed.
        problem: Box<Problem>,
        /// In how many attempts or repeats it failed.
        failed: u32,
        /// Of how many.
        of: u32,
    },
    /// The original verdict, and why it is accepted.
    Waived {
        /// FAIL, ERROR, FLAKY or LENIENT.
        outcome: Box<Self>,
        /// The waiver.
        waiver: Box<Waiver>,
    },
    /// Why there is no statement about the device.
    Error {
        /// In one sentence.
        reason: String,
        /// Where it came up, when it was in a step.
        problem: Option<Box<Problem>>,
    },
    /// Why there is no statement about the device, when the tester itself was late, or frames may
    /// have been lost. It is tried again at the end of the run.
    Undecided(String),
}

impl Outcome {
    /// The verdict alone.
    pub const fn verdict(&self) -> Verdict {
        match self {
            Self::Pass => Verdict::Pass,
            Self::Lenient(_) => Verdict::Lenient,
            Self::Skip(_) => Verdict::Skip,
            Self::Blocked(_) => Verdict::Blocked,
            Self::Waived { .. } => Verdict::Waived,
            Self::Flaky { .. } => Verdict::Flaky,
            Self::Fail(_) => Verdict::Fail,
            Self::Error { .. } | Self::Undecided(_) => Verdict::Error,
        }
    }

    /// A case that was not run, because the device had gone.
    pub fn not_run(why: &str) -> Self {
        Self::Error { reason: format!("{NOT_RUN}{why}"), problem: None }
    }

    /// The same for a case that checks no requirement which is a must for the device: such a
    /// case does not fail. `reasons` say what relaxes those that are a must for others.
    #[must_use]
    pub fn capped(self, reasons: Vec<String>) -> Self {
        match self {
            Self::Fail(mut problem) | Self::Flaky { mut problem, .. } => {
                problem.capped = true;
                problem.notes.extend(reasons);
                Self::Lenient(problem)
            }
            other => other,
        }
    }

    /// Whether the device did what a step of the case accepts beside what it expects.
    pub fn is_accepted(&self) -> bool {
        matches!(self, Self::Lenient(problem) if !problem.capped)
    }

    /// Whether the device did not do what the case says, even if the level of the case excuses it.
    pub fn holds_against_device(&self) -> bool {
        match self {
            Self::Fail(_) => true,
            Self::Lenient(problem) => problem.capped,
            Self::Waived { outcome, .. } => outcome.holds_against_device(),
            Self::Pass
            | Self::Skip(_)
            | Self::Blocked(_)
            | Self::Flaky { .. }
            | Self::Error { .. }
            | Self::Undecided(_) => false,
        }
    }

    /// Whether the case was not run at all.
    pub fn is_not_run(&self) -> bool {
        matches!(self, Self::Error { reason, .. } if reason.starts_with(NOT_RUN))
    }

    /// Whether the case ran and said what it can say about the device.
    pub fn is_decided(&self) -> bool {
        match self {
            Self::Pass | Self::Lenient(_) | Self::Fail(_) | Self::Flaky { .. } => true,
            Self::Waived { outcome, .. } => outcome.is_decided(),
            Self::Skip(_) | Self::Blocked(_) | Self::Error { .. } | Self::Undecided(_) => false,
        }
    }

    /// `in 1 of 3 attempts`, of a case that does not fail each time.
    pub(crate) fn times(&self) -> Option<String> {
        match self {
            Self::Flaky { failed, of, .. } => Some(format!("in {failed} of {of} attempts")),
            Self::Waived { outcome, .. } => outcome.times(),
            _ => None,
        }
    }

    /// The problem, when there is one.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Lenient(problem) | Self::Fail(problem) | Self::Flaky { problem, .. } => {
                Some(problem)
            }
            Self::Error { problem, .. } => problem.as_deref(),
            Self::Waived { outcome, .. } => outcome.problem(),
            Self::Pass | Self::Skip(_) | Self::Blocked(_) | Self::Undecided(_) => None,
        }
    }
}

/// Why something that is known does not make a run red.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waiver {
    /// Why it is accepted.
    pub reason: String,
    /// The person or team that answers for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// The last day on which it holds, such as `2026-12-31`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expires: Option<String>,
}

/// The reason, the responsible person and the date of expiry, in one line.
impl fmt::Display for Waiver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)?;
        match (&self.owner, &self.expires) {
            (None, None) => Ok(()),
            (Some(owner), None) => write!(f, " ({owner})"),
            (None, Some(date)) => write!(f, " (until {date})"),
            (Some(owner), Some(date)) => write!(f, " ({owner}, until {date})"),
        }
    }
}

const NOT_RUN: &str = "not run: ";

/// A difference between what was expected and what came.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// When it showed. Frames after it, such as those that restore objects, did not lead to it.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// In which part of the case.
    pub phase: Phase,
    /// The step in the suite file; for a monitor, the step during which it spoke.
    pub place: Excerpt,
    /// The expected behaviour.
    pub expected: String,
    /// The actual behaviour, decoded.
    pub actual: String,
    /// The frame in question, when it is one.
    #[serde(with = "wire::optional_frame")]
    pub raw: Option<Frame>,
    /// How far both are apart: the amount in its unit, the bits or the bytes that differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apart: Option<String>,
    /// The line of the data sheet in question, when it is about what one says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheet: Option<Excerpt>,
    /// Further help: interpretations of the register, later problems of the same case.
    pub notes: Vec<String>,
    /// Whether the case failed and is LENIENT because no requirement that it checks is a must.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub capped: bool,
}

/// The parts of a case, in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Bringing the device into a known state.
    Settle,
    /// The steps of `setup`.
    Setup,
    /// The steps proper.
    Step,
    /// The steps of `finally`.
    Finally,
    /// A monitor, which watches all the time.
    Monitor,
}

/// A stretch of one line of a suite file or a data sheet. Lines and columns count from 1, columns
/// in characters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excerpt {
    /// The file, relative to the folder of the project or as the user named it, with `/`.
    pub file: String,
    /// The line.
    pub line: u32,
    /// The column at which the stretch begins.
    pub column: u32,
    /// Its length in characters, at least 1.
    pub length: u32,
    /// The text of the whole line, without its end.
    pub source: String,
    /// The lines in front of it that belong to the same case or section, as far as they are shown.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub before: Vec<String>,
    /// The lines after it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub after: Vec<String>,
}

impl Problem {
    /// What an expected frame means, where it is a whole one; what came is told in words anyway.
    pub(crate) fn expected_in_words(&self) -> Option<String> {
        let frame = self.expected.split(" within ").next()?;
        let frame = frame.parse::<Pattern>().ok()?.frame()?;
        Some(meaning(&frame).to_string())
    }
}

#[cfg(test)]
impl Problem {
    /// A problem of a step, without a place.
    pub(crate) fn of_step(expected: &str, actual: &str, raw: Option<&str>) -> Self {
        Self {
            at: Instant::ZERO,
            phase: Phase::Step,
            place: Excerpt { line: 1, column: 1, length: 1, ..Excerpt::default() },
            expected: expected.into(),
            actual: actual.into(),
            raw: raw.map(|text| text.parse().expect("a frame")),
            apart: None,
            sheet: None,
            notes: Vec::new(),
            capped: false,
        }
    }
}
