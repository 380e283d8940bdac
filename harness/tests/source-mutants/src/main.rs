//! Changes the source of the reference devices, one place at a time, and asks runs of the harness
//! whether the suites notice.

mod decisions;
mod finder;
mod groups;
mod judge;
mod operators;
mod report;
mod results;
mod scratch;
mod sites;
mod survivors;
mod syntax;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{fs, thread};

use clap::{Parser, ValueEnum};

use crate::finder::Mutant;
use crate::groups::{GROUPS, Group, group_of};
use crate::judge::{Judge, Verdict};
use crate::operators::Set;
use crate::report::{Judged, Report};
use crate::scratch::Scratch;
use crate::survivors::Survivors;

/// Mutants of the source of the reference devices, judged by runs of the harness alone.
#[derive(Parser)]
struct Options {
    /// What is changed: `stack`, `codecs`, `decisions`, `profiles`, or a device
    #[arg(long, value_delimiter = ',', default_value = "stack,codecs")]
    groups: Vec<String>,
    /// Those of cargo-mutants alone, or all
    #[arg(long, value_enum, default_value_t = Operators::CargoMutants)]
    operators: Operators,
    /// How many mutants are drawn
    #[arg(long, default_value_t = 300)]
    sample: usize,
    /// All mutants instead of a sample
    #[arg(long)]
    all: bool,
    /// By which they are drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// These mutants only, by number
    #[arg(long, value_delimiter = ',')]
    ids: Vec<usize>,
    /// The list of survivors only
    #[arg(long)]
    listed: bool,
    /// Suites on disk instead of those of the copy
    #[arg(long, value_name = "DIR")]
    suites: Option<PathBuf>,
    /// Where the copy is made and built
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Take the copy as the last run has built it
    #[arg(long)]
    reuse: bool,
    /// Runs of the harness at a time
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// Write what was said about each mutant
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Which changes are made.
#[derive(Clone, Copy, Eq, PartialEq, ValueEnum)]
enum Operators {
    /// What cargo-mutants does.
    CargoMutants,
    /// And our own.
    All,
}

impl Operators {
    fn have(self, set: Set) -> bool {
        self == Self::All || set == Set::CargoMutants
    }
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

fn run(options: &Options) -> Result<bool, String> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let workspace = here.ancestors().nth(3).expect("the workspace is three folders above");
    let to = options.scratch.clone().unwrap_or_else(|| workspace.join("target/source-mutants"));
    let (operators, names) = (options.operators, options.groups.clone());
    let wanted = move |mutant: &Mutant| {
        let of_group =
            group_of(&mutant.file).is_some_and(|group| names.contains(&group.name.into()));
        of_group && operators.have(mutant.set)
    };
    let scratch = Scratch { from: workspace.to_owned(), to, wanted: Box::new(wanted) };
    let all = mutants(&scratch, options.reuse)?;
    let survivors = Survivors::read(&here.join("survivors.yaml"))?;
    let devices: BTreeSet<_> = groups(options)?.iter().flat_map(|group| group.devices).collect();
    let suites = options.suites.clone().unwrap_or_else(|| scratch.to.join("suites"));
    let judge = Judge::new(scratch.program(), suites, &devices)?;
    let chosen = choose(options, &all, &survivors, &judge)?;
    let judged = judge_all(&judge, &chosen, options.jobs)?;
    if let Some(path) = &options.json {
        let text = serde_json::to_string_pretty(&judged).map_err(|error| error.to_string())?;
        fs::write(path, text).map_err(|error| error.to_string())?;
    }
    let report = Report { judged: &judged, survivors: &survivors };
    print!("{report}");
    let mut complaints = report.complaints();
    complaints.extend(survivors.stale(&all).map(|stale| format!("listed, but no mutant: {stale}")));
    complaints.iter().for_each(|complaint| println!("{complaint}"));
    Ok(complaints.is_empty())
}

/// The mutants of the copy, which is built anew or was built by the last run.
fn mutants(scratch: &Scratch, reuse: bool) -> Result<Vec<Mutant>, String> {
    let list = scratch.to.join("mutants.json");
    if reuse {
        let text = fs::read_to_string(&list).map_err(|error| error.to_string())?;
        return serde_json::from_str(&text).map_err(|error| error.to_string());
    }
    let mutants = scratch.build()?;
    let text = serde_json::to_string(&mutants).map_err(|error| error.to_string())?;
    fs::write(&list, text).map_err(|error| error.to_string())?;
    Ok(mutants)
}

fn groups(options: &Options) -> Result<Vec<&'static Group>, String> {
    let named = |name: &String| GROUPS.iter().find(|group| group.name == name);
    let names = GROUPS.iter().map(|group| group.name).collect::<Vec<_>>().join(", ");
    let groups = options.groups.iter();
    groups.map(|name| named(name).ok_or(format!("no group {name}; there are {names}"))).collect()
}

fn choose(
    options: &Options,
    all: &[Mutant],
    survivors: &Survivors,
    judge: &Judge,
) -> Result<Vec<Mutant>, String> {
    if !options.ids.is_empty() {
        return Ok(all.iter().filter(|mutant| options.ids.contains(&mutant.id)).cloned().collect());
    }
    let groups = groups(options)?;
    let all = all.iter().filter(|mutant| mutant.built && options.operators.have(mutant.set));
    let all: Vec<_> = all.cloned().collect();
    let reached = |mutant: &&Mutant| judge.reached(mutant.id);
    let used: BTreeSet<_> = all.iter().filter(reached).map(Mutant::place).collect();
    let of_groups = |mutant: &&Mutant| {
        let group = group_of(&mutant.file);
        group.is_some_and(|group| {
            groups.iter().any(|chosen| chosen.name == group.name)
                && (!group.is_shared || used.contains(&mutant.place()))
                // Only a catalogued deviation comes there, and no device that is in order.
                && (!mutant.decided || judge.reached(mutant.id))
        })
    };
    let mut chosen: Vec<_> = all.iter().filter(of_groups).cloned().collect();
    if options.listed {
        chosen.retain(|mutant| survivors.get(mutant).is_some());
    } else if !options.all {
        println!("{} of {} mutants, seed {}", options.sample, chosen.len(), options.seed);
        fastrand::Rng::with_seed(options.seed).shuffle(&mut chosen);
        chosen.truncate(options.sample);
        chosen.sort_by_key(|mutant| mutant.id);
    }
    Ok(chosen)
}

fn judge_all(judge: &Judge, chosen: &[Mutant], jobs: usize) -> Result<Vec<Judged>, String> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut judged = Vec::new();
        while let Some(mutant) = chosen.get(next.fetch_add(1, Ordering::Relaxed)) {
            let devices = group_of(&mutant.file).map_or(&[][..], |group| group.devices);
            let (verdict, line) = judge.judge(mutant.id, devices)?;
            if verdict.is_noticed() {
                eprint!(".");
            } else {
                eprint!("{}", if verdict == Verdict::Lenient { 'l' } else { '-' });
            }
            judged.push(Judged { mutant: mutant.clone(), verdict, line });
        }
        Ok(judged)
    };
    let judged: Result<Vec<_>, String> = thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs.max(1)).map(|_| scope.spawn(work)).collect();
        workers.into_iter().map(|worker| worker.join().expect("no worker panics")).collect()
    });
    eprintln!();
    let mut judged: Vec<_> = judged?.into_iter().flatten().collect();
    judged.sort_by_key(|judged| judged.mutant.id);
    Ok(judged)
}
