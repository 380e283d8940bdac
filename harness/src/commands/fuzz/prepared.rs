//! What a campaign begins with: the device, a model of it, and what is known of both.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use campaign::{Belief, Blueprint};
use reports::{CaseRun, Outcome};
use runner::stop::Stop;
use runner::suite::Register;
use runner::waivers::Waivers;

use super::model::Modelled;
use super::stage::Place;
use crate::cli::{CampaignArgs, RunArgs};
use crate::commands::recorded::recorded;
use crate::commands::run::waivers_of;
use crate::exit::Refused;
use crate::target::Target;

/// What a campaign begins with.
pub(super) struct Prepared<'t> {
    pub(super) target: &'t Target,
    pub(super) modelled: Modelled,
    pub(super) register: Arc<Register>,
    pub(super) waivers: Waivers,
    /// The freedoms that the device is said to use, by their places in the blueprint.
    given: Vec<usize>,
}

impl<'t> Prepared<'t> {
    /// Looks at the device, and returns where sessions are played, too.
    ///
    /// # Errors
    /// When the device cannot be used, or a file cannot be read.
    pub(super) fn new(
        args: &CampaignArgs,
        run: &RunArgs,
        target: &'t Target,
        stop: &Stop,
    ) -> Result<(Self, Place<'t>), Refused> {
        let library = run.selection.folders.load_part(|_| false)?;
        let waivers = waivers_of(run, &library.register)?;
        let mut place = Place::of(target, &run.selection, stop)?;
        let modelled = Modelled::of(target, &mut place, args.oracle.as_deref())?;
        let modelled = modelled.knowing(&run.selection.folders, &target.dut, stop)?;
        let register = library.register;
        let given = match &args.after {
            Some(path) => shown(path, &target.dut.name, &modelled.blueprint)?,
            None => Vec::new(),
        };
        Ok((Self { target, modelled, register, waivers, given }, place))
    }

    /// What is believed of the device before the first session.
    ///
    /// # Errors
    /// When the model cannot be built.
    pub(super) fn belief(&self) -> Result<Belief<'_>, Refused> {
        let none = self.modelled.belief()?;
        Ok(self.given.iter().fold(none, |belief, freedom| belief.with(*freedom)))
    }
}

/// The freedoms that a run showed: a LENIENT case in which one freedom alone is allowed says that
/// the device uses it. Where several are allowed, the sessions tell which.
fn shown(journal: &Path, device: &str, blueprint: &Blueprint) -> Result<Vec<usize>, Refused> {
    let run = recorded(journal)?;
    if !run.devices.iter().any(|tested| tested.info.device == device) {
        let tested: Vec<&str> = run.devices.iter().map(|it| it.info.device.as_str()).collect();
        return Err(Refused::usage(format!(
            "--after {}: this run tested {}, and the device of this campaign is {device}",
            journal.display(),
            tested.join(", "),
        )));
    }
    let of_device = run.cases().filter(|(tested, _)| tested.info.device == device);
    let lenient = of_device.map(|(_, case)| case).filter(|case| is_lenient(&case.outcome));
    let mut shown = BTreeSet::new();
    for case in lenient {
        let allowed = |clause: &String| is_about(case, clause);
        let all = blueprint.freedoms().iter().enumerate();
        let mut fitting = all.filter(|(_, freedom)| freedom.clauses.iter().any(allowed));
        if let (Some((place, _)), None) = (fitting.next(), fitting.next()) {
            shown.insert(place);
        }
    }
    Ok(shown.into_iter().collect())
}

fn is_lenient(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::Lenient(_) => true,
        Outcome::Waived { outcome, .. } => is_lenient(outcome),
        _ => false,
    }
}

/// Whether a case checks this requirement, or what it says of its result names this decision.
fn is_about(case: &CaseRun, clause: &str) -> bool {
    let notes = case.outcome.problem().map_or(&[][..], |problem| &problem.notes);
    case.info.checks.iter().any(|check| &*check.id == clause)
        || notes.iter().any(|note| {
            note.split(|c: char| c != '-' && !c.is_alphanumeric()).any(|word| word == clause)
        })
}
