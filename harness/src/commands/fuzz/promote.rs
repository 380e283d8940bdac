//! `harness fuzz promote`: a finding becomes a case of the user's, once it is shown to be red on
//! the device, and green on a model of it with each freedom.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use campaign::session::Session as Actions;
use campaign::{Blueprint, Candidate, Finding, What};
use canopen::{Bus, Device, VirtualBus};
use reports::{Event, Outcome, Verdict};
use runner::dut::Dut;
use runner::plan::{Plan, plan_cases};
use runner::run::{Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

use super::case::{Names, Strictness, mutant, register, suite};
use super::file::FindingFile;
use super::model::Modelled;
use super::stage::{Place, target_of};
use crate::cli::PromoteArgs;
use crate::commands::run::undo;
use crate::exit::{Exit, Refused};
use crate::files::{shown, words, write_new};
use crate::reporter::say;
use crate::source::Source;
use crate::target::{self, DEFAULT_BIT_RATE, Selection, Target};

/// Writes the case of a finding.
///
/// # Errors
/// When the finding does not show again, or no case is red on the device alone.
pub(super) fn run(args: &PromoteArgs, stop: &Stop) -> Result<Exit, Refused> {
    let file = FindingFile::read(&args.file)?;
    let selection = file.device(&args.device).selection()?;
    let target = target_of(&selection, stop)?;
    let _held = stop.hold();
    let mut stage = Place::of(&target, &selection, stop)?;
    let modelled = Modelled::of(&target, &mut stage, file.oracle.as_deref())?;
    let session = Actions { actions: file.actions.clone() };
    let mut again = |session| modelled.again(&mut stage, &file.freedoms, &session);
    // Where actions follow each other closely, a device that serves requests late does another
    // thing.
    let ways = [again(session.clone())?, again(session.patient(target.dut.node))?];
    drop(stage);
    let [Some(_), _] = ways else {
        return Err(not_promoted(args, "nothing is wrong this time"));
    };
    let case = args.name.as_ref().unwrap_or(&file.cause);
    let requirement = format!("FOUND-{}", case.to_ascii_uppercase());
    let names = Names {
        case,
        requirement: &requirement,
        known: &file.requirements_of_first(),
        device: &target.dut.name,
        node: target.dut.node,
    };
    let trial = Trial { selection: &selection, target: &target, modelled: &modelled, stop };
    let mut why = None;
    let each = |finding| Strictness::ALL.map(|how| (how, finding));
    for (how, finding) in ways.iter().flatten().flat_map(each) {
        let Some(suite) = suite(&names, finding, how) else { continue };
        let files = Files::of(args, &names, suite, register(&names, finding));
        let ends = matches!(finding.violation.what, What::Ended(_));
        match trial.is_just(&files, &names, &file.freedoms, ends)? {
            Ok(()) => {
                files.write()?;
                say(&files.said(&names, &selection));
                if args.mutant {
                    say(&for_the_tree(&file, &names, finding, &modelled.blueprint));
                }
                return Ok(Exit::Green);
            }
            Err(reason) => _ = why.get_or_insert(reason),
        }
    }
    let inhibited = "it is about the time between two frames, which no step judges";
    Err(not_promoted(args, why.as_deref().unwrap_or(inhibited)))
}

fn not_promoted(args: &PromoteArgs, why: &str) -> Refused {
    let message = format!("error: {} is not promoted: {why}", args.file.display());
    Refused { exit: Exit::NothingRan, message }
}

/// The entry for the tree.
fn for_the_tree(
    file: &FindingFile,
    names: &Names<'_>,
    finding: &Finding,
    blueprint: &Blueprint,
) -> String {
    if blueprint.mutants().iter().any(|mutant| mutant.name == file.cause) {
        return format!("the tree has a mutant that does the same: {}\n", file.cause);
    }
    mutant(names, finding).map_or_else(
        || "no entry for the tree: no frame that differs shows what the device does\n".to_owned(),
        |entry| format!("for reference-devices/mutants, to be generalised:\n{entry}"),
    )
}

/// The files of a case.
struct Files {
    suite: (PathBuf, String),
    register: (PathBuf, String),
}

impl Files {
    fn of(args: &PromoteArgs, names: &Names<'_>, suite: String, register: String) -> Self {
        let (into, case) = (&args.into, names.case);
        Self {
            suite: (into.join("found").join(format!("{case}.yaml")), suite),
            register: (into.join("requirements").join(format!("found-{case}.yaml")), register),
        }
    }

    fn sources(&self) -> impl Iterator<Item = Arc<Source>> {
        let source =
            |(path, text): &(PathBuf, String)| Arc::new(Source::new(shown(path), text.clone()));
        [&self.suite, &self.register].into_iter().map(source)
    }

    /// What somebody has written is not overwritten.
    fn write(&self) -> Result<(), Refused> {
        for (path, text) in [&self.register, &self.suite] {
            let folder = path.parent().unwrap_or_else(|| Path::new("."));
            fs::create_dir_all(folder).map_err(|error| Refused {
                exit: Exit::File,
                message: format!("error: {}: {}", folder.display(), words(&error)),
            })?;
            write_new(
                path,
                text,
                "give the case another name with `--name`, or `--into` a folder",
            )?;
        }
        Ok(())
    }

    fn said(&self, names: &Names<'_>, selection: &Selection) -> String {
        let (suite, register) = (shown(&self.suite.0), shown(&self.register.0));
        let into = self.suite.0.parent().and_then(Path::parent).unwrap_or_else(|| Path::new("."));
        format!(
            "{suite}\n{register}\nred on the device, green on a model of it and with each \
             freedom\nrun it: harness {} --suites {} found/{}\n",
            selection.typed(),
            into.display(),
            names.case,
        )
    }
}

/// Tries a case.
struct Trial<'t> {
    selection: &'t Selection,
    target: &'t Target,
    modelled: &'t Modelled,
    stop: &'t Stop,
}

impl Trial<'_> {
    /// Whether a case is red on the device, which may be that the program `ends`, and green on
    /// models of it; the inner error says where it is not.
    fn is_just(
        &self,
        files: &Files,
        names: &Names<'_>,
        believed: &[String],
        ends: bool,
    ) -> Result<Result<(), String>, Refused> {
        let folders = &self.selection.folders;
        let mut sources = folders.register_sources()?;
        sources.extend(files.sources());
        let library = Library::from_part(&sources, &folders.catalogue.load()?)?;
        let name = format!("found/{}", names.case);
        let plan = |dut: &Dut| {
            let models = target::models(&dut.eds);
            plan_cases(&library, dut, &models, |suite, _| suite.name() == name, &mut |_| true)
        };
        let mut bus = self.target.open(self.stop)?;
        let undo = undo(self.target, self.selection);
        let on_device = self.outcome(&library, &plan(&self.target.dut)?, &mut *bus, &undo);
        drop(bus);
        // A run has no verdict on a device that ended, and says how it did.
        let red = if ends { Verdict::Error } else { Verdict::Fail };
        if on_device.verdict() != red {
            return Ok(Err(format!("the case is {} on the device", said(&on_device))));
        }
        let blueprint = &self.modelled.blueprint;
        let plan = plan(&self.model())?;
        let all = blueprint.freedoms();
        let of_belief = all.iter().filter(|freedom| believed.contains(&freedom.name));
        let alone = all.iter().map(|freedom| vec![freedom]);
        for freedoms in [Vec::new(), of_belief.collect()].into_iter().chain(alone) {
            let Some(mut bus) = self.on_model(&freedoms) else { continue };
            let outcome = self.outcome(&library, &plan, &mut bus, &Undo::default());
            let is_green = match outcome.verdict() {
                Verdict::Pass | Verdict::Lenient => true,
                // With a freedom it may decline what comes before.
                Verdict::Skip => !freedoms.is_empty(),
                _ => false,
            };
            if !is_green {
                let with: Vec<&str> = freedoms.iter().map(|it| it.name.as_str()).collect();
                let outcome = said(&outcome);
                return Ok(Err(if with.is_empty() {
                    format!(
                        "the case is {outcome} on a device in order, too; the finding may be a \
                         mistake of this program: report it with its file"
                    )
                } else {
                    format!("the case is {outcome} on a model with {}", with.join(", "))
                }));
            }
        }
        Ok(Ok(()))
    }

    /// The device as one in virtual time.
    fn model(&self) -> Dut {
        Dut {
            interface: None,
            shares_its_bus: false,
            shares_its_machine: false,
            protection: Arc::default(),
            hooks: runner::dut::Hooks::default(),
            ..self.target.dut.clone()
        }
    }

    fn on_model(&self, freedoms: &[&Candidate]) -> Option<VirtualBus<'static>> {
        let blueprint = &self.modelled.blueprint;
        let device: Box<dyn Device> = blueprint.build(freedoms.iter().copied())?;
        let mut bus = VirtualBus::new(blueprint.settings().bit_rate);
        bus.attach_boxed(device);
        Some(bus)
    }

    /// How the case comes out.
    fn outcome(&self, library: &Library, plan: &Plan, bus: &mut dyn Bus, undo: &Undo) -> Outcome {
        let session = Session::new(
            plan,
            &library.register,
            plan.dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE),
            self.stop,
            undo,
        );
        let mut outcome = Outcome::not_run("there is no such case");
        session.run(bus, &mut |event| {
            if let Event::CaseEnded(ended) = event {
                outcome = ended.outcome;
            }
        });
        outcome
    }
}

/// A verdict, and why.
fn said(outcome: &Outcome) -> String {
    let verdict = outcome.verdict();
    match outcome {
        Outcome::Skip(why) | Outcome::Blocked(why) | Outcome::Undecided(why) => {
            format!("{verdict} ({why})")
        }
        Outcome::Error { reason, .. } => format!("{verdict} ({reason})"),
        other => other.problem().map_or_else(
            || verdict.to_string(),
            |it| format!("{verdict} (expected {}, came {})", it.expected, it.actual),
        ),
    }
}
