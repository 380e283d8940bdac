//! What a campaign leaves: the events of a run. Its sessions are one case, and each cause of
//! findings is another one.

use std::path::Path;
use std::sync::Arc;

use campaign::{Finding, Seen, What};
use canopen::{Frame, Instant, meaning};
use reports::{
    CaseEnded, CaseStarted, Check, DeviceStarted, Event, Excerpt, Identity, Note, Outcome, Phase,
    Problem, RunEnded,
};
use runner::waivers::CAMPAIGN;

use super::prepared::Prepared;
use crate::cli::RunArgs;
use crate::exit::Exit;
use crate::reporter::{Reporter, started};
use crate::source::Complaint;

/// Tells the reporter of a campaign what happens in it.
pub(super) struct Record<'r> {
    reporter: &'r mut Reporter,
    prepared: &'r Prepared<'r>,
    sessions: CaseStarted,
}

/// A cause of findings, as a case.
pub(super) struct Shown<'c> {
    /// Its name.
    pub(super) cause: &'c str,
    /// The requirements that the likeliest mutant breaks.
    pub(super) requirements: &'c [String],
    /// The session that shows it best.
    pub(super) finding: &'c Finding,
    /// What else is known of it.
    pub(super) notes: Vec<String>,
    /// The file of the finding.
    pub(super) file: Option<&'c Path>,
}

impl<'r> Record<'r> {
    /// The campaign begins.
    pub(super) fn begin(
        reporter: &'r mut Reporter,
        prepared: &'r Prepared<'r>,
        args: &RunArgs,
        identity: Identity,
    ) -> Self {
        let target = &prepared.target;
        reporter.tell(&Event::RunStarted(started(args, !target.is_simulation())));
        let device = target.dut.started(String::new());
        let of_bus = &target.dut.of_bus;
        let remark = (!of_bus.is_empty()).then(|| of_bus.join("; "));
        let device = DeviceStarted { identity, remark, ..device };
        reporter.tell(&Event::DeviceStarted(Box::new(device)));
        let sessions = case("sessions", "The sessions are played to their end.", Arc::default());
        reporter.tell(&Event::CaseStarted(sessions.clone()));
        Self { reporter, prepared, sessions }
    }

    /// Whether something may be done to the device a number of times only.
    pub(super) fn is_budgeted(&self) -> bool {
        self.prepared.target.dut.protection.has_budgets()
    }

    /// How far it came.
    pub(super) fn progress(&self, done: usize, of: usize, said: impl FnOnce() -> String) {
        self.reporter.progress(done, of, said);
    }

    /// Something was wrong in a session. Its causes are known at the end only.
    pub(super) fn finds(&mut self, finding: &Finding) {
        let text = format!("session {}: {}", finding.number, finding.violation);
        self.reporter.tell(&Event::Note(Note { at: Instant::ZERO, text }));
    }

    /// The sessions are over; `why` when they did not come to their end.
    pub(super) fn sessions_over(&mut self, said: Vec<String>, why: Option<&str>) {
        for text in said {
            self.reporter.tell(&Event::Note(Note { at: Instant::ZERO, text }));
        }
        let outcome = why.map_or(Outcome::Pass, |why| Outcome::Error {
            reason: format!("the campaign was cut short: {why}"),
            problem: None,
        });
        let ended = CaseEnded::of(&self.sessions, Instant::ZERO, outcome);
        self.reporter.tell(&Event::CaseEnded(ended));
    }

    /// A cause of findings. Returns why it is waived, if it is.
    pub(super) fn cause(&mut self, shown: &Shown<'_>) -> Option<String> {
        let Prepared { register, waivers, target, .. } = self.prepared;
        let checks = shown.requirements.iter().filter_map(|id| register.check(id));
        let checks: Arc<[Check]> = checks.collect();
        let title =
            checks.first().map_or("The device does what its data sheet says.", |it| &it.says);
        let mut started = case(shown.cause, title, Arc::clone(&checks));
        let problem = problem(shown);
        if let Some(file) = shown.file {
            started.file = file.display().to_string().into();
            (started.line, started.column) = (problem.place.line, problem.place.column);
        }
        let at = problem.at;
        let outcome = Outcome::Fail(Box::new(problem));
        self.reporter.tell(&Event::CaseStarted(started.clone()));
        for seen in &shown.finding.seen {
            match seen {
                Seen::Frame(stamped) => self.reporter.tell(&Event::Frame(*stamped)),
                Seen::Power(at, on) => {
                    let text = format!("the supply is switched {}", if *on { "on" } else { "off" });
                    self.reporter.tell(&Event::Note(Note { at: *at, text }));
                }
                Seen::Ended(at) => {
                    let text = "the program ended by itself".to_owned();
                    self.reporter.tell(&Event::Note(Note { at: *at, text }));
                }
                Seen::Stimulus(at, name, value) => {
                    let text = format!("the bench sets {name} to {value}");
                    self.reporter.tell(&Event::Note(Note { at: *at, text }));
                }
                Seen::Until(_)
                | Seen::Stored(..)
                | Seen::Joined(_)
                | Seen::Observed(..)
                | Seen::Looked(_) => {}
            }
        }
        let outcome = waivers.apply(&target.dut.name, &started, outcome);
        let waived = match &outcome {
            Outcome::Waived { waiver, .. } => Some(waiver.to_string()),
            _ => None,
        };
        self.reporter.tell(&Event::CaseEnded(CaseEnded::of(&started, at, outcome)));
        waived
    }

    /// What else the campaign showed.
    pub(super) fn showed(&mut self, campaign: reports::Campaign) {
        self.reporter.tell(&Event::Campaign(Box::new(campaign)));
    }

    /// The campaign is over. Returns its exit code, where `stopped` is that of what stopped it.
    pub(super) fn end(self, stopped: Exit, reason: Option<String>) -> Exit {
        let red = self.reporter.run().cases().any(|(_, case)| {
            &*case.info.case != SESSIONS && self.reporter.run().is_red(case.verdict())
        });
        let outdated = self.prepared.waivers.not_in_force();
        let of_waivers = if outdated.is_empty() { Exit::Green } else { Exit::Waivers };
        let of_findings = if red { Exit::Findings } else { Exit::Green };
        let worst = stopped.max(of_findings).max(of_waivers);
        let said = outdated.iter().map(Complaint::in_one_line).collect();
        self.reporter.tell(&Event::RunEnded(RunEnded {
            exit: worst as u8,
            reason,
            outdated: said,
        }));
        let finished = self.reporter.finish();
        for complaint in outdated {
            complain!("{complaint}\n");
        }
        worst.max(finished)
    }
}

/// The case that all sessions are.
const SESSIONS: &str = "sessions";

fn case(name: &str, title: &str, checks: Arc<[Check]>) -> CaseStarted {
    CaseStarted {
        at: Instant::ZERO,
        suite: CAMPAIGN.into(),
        case: name.into(),
        instance: None,
        title: title.into(),
        checks,
        file: "".into(),
        line: 0,
        column: 0,
    }
}

fn problem(shown: &Shown<'_>) -> Problem {
    let violation = &shown.finding.violation;
    let words = |frame: &Frame| format!("{frame} ({})", meaning(frame));
    let (expected, actual, raw) = match &violation.what {
        What::Unexpected(frame, Some(other)) => (words(other), words(frame), Some(*frame)),
        What::Unexpected(frame, None) => {
            ("no such frame without a cause".to_owned(), words(frame), Some(*frame))
        }
        What::Missing(frame, due) => (words(frame), format!("nothing, due at {due} s"), None),
        What::Inhibited(frame, gap) => {
            let expected = "the inhibit time between two TPDOs".to_owned();
            (expected, format!("{} after {gap:?}", words(frame)), Some(*frame))
        }
        What::Ended(last) => {
            let actual = "it ended by itself".to_owned();
            ("the program that is the device goes on".to_owned(), actual, *last)
        }
        What::Differs(difference) => {
            let named = |what: &str| format!("{}: {what}", difference.name);
            (named(&difference.expected), named(&difference.actual), None)
        }
    };
    Problem {
        at: violation.at,
        phase: Phase::Step,
        place: place(shown.file),
        expected,
        actual,
        raw,
        apart: None,
        sheet: None,
        notes: shown.notes.clone(),
        capped: false,
    }
}

/// The last action in the file of a finding.
fn place(file: Option<&Path>) -> Excerpt {
    let text = file.and_then(|file| std::fs::read_to_string(file).ok()).unwrap_or_default();
    let lines = text.lines().enumerate();
    let last = lines.filter(|(_, line)| line.trim_start().starts_with("\"does\"")).last();
    let (line, source) = last.map_or((0, ""), |(place, line)| (place as u32 + 1, line));
    let indent = source.len() - source.trim_start().len();
    Excerpt {
        file: file.map_or_else(String::new, |file| file.display().to_string()),
        line,
        column: indent as u32 + 1,
        length: source.trim().chars().count().max(1) as u32,
        source: source.to_owned(),
        ..Excerpt::default()
    }
}
