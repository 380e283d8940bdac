//! `harness --dry-run`: lists what a run would do to the device, without a bus.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use canopen::Mux;
use reports::reason::PROTECTED_BY;
use runner::dut::Dut;
use runner::plan::{Fate, Plan, deeds};
use runner::protect::Deed;
use runner::stop::Stop;
use runner::suite::Library;

use super::counted::counted;
use super::estimate;
use super::planned::plan_beside;
use super::run::{last_failed, limit};
use super::select::{known_device, select};
use crate::cli::RunArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::{self, Address, Selection, Target};

/// Prints what would be done to each device.
///
/// # Errors
/// What keeps a run from starting, too; and when there is no data sheet.
pub(super) fn run(each: &[RunArgs], stop: &Stop) -> Result<Exit, Refused> {
    let planned = each.iter().map(|args| planned(args, stop));
    let (libraries, mut plans): (Vec<_>, Vec<_>) =
        planned.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    select(&mut plans, each.iter().map(|args| &args.selection))?;
    for (args, plan) in each
        .iter()
        .zip(&mut plans)
        .flat_map(|(args, plans)| plans.iter_mut().map(move |it| (args, it)))
    {
        if let Some(failed) = args.last_failed.as_deref().map(last_failed).transpose()? {
            plan.keep(&failed);
        }
        limit(plan, args);
    }
    for (place, ((args, library), plans)) in each.iter().zip(libraries).zip(plans).enumerate() {
        if place > 0 {
            say("\n");
        }
        of_one(args, &library, &plans, stop);
    }
    Ok(Exit::Green)
}

fn planned(args: &RunArgs, stop: &Stop) -> Result<(Library, Vec<Plan>), Refused> {
    let library = args.selection.folders.load()?;
    known_device(&args.selection, &library)?;
    let duts = duts(args, &library, stop)?;
    let others = &args.selection.others;
    let plans = plan_beside(&library, &duts.iter().collect::<Vec<_>>(), others)?;
    Ok((library, plans))
}

/// Prints what is meant by one set of arguments.
fn of_one(args: &RunArgs, library: &Library, plans: &[Plan], stop: &Stop) {
    let real_time = is_in_real_time(&args.selection);
    let texts = plans.iter().map(|plan| report(plan, real_time, args.verbose));
    say(&texts.collect::<Vec<_>>().join("\n"));
    // In virtual time a run is over in a moment.
    if let ([plan], true) = (plans, real_time) {
        let takes = estimate::of_plan(args, &estimate::earlier(args), library, plan, stop);
        takes.iter().for_each(|(_, said)| say(&format!("\n{said}\n")));
    }
    if args.selection.bench.is_some() && plans.iter().any(|plan| !plan.dut.own_bench) {
        say("the bench is not asked: cases about its names count as skipped\n");
    }
}

/// Whether the time of the bus would be real.
fn is_in_real_time(selection: &Selection) -> bool {
    let is_simulated = |text: &str| matches!(text.parse(), Ok(Address::Simulation { .. }));
    selection.eds.is_some() && !selection.target.as_deref().is_some_and(is_simulated)
}

/// The devices, without asking any that is not simulated.
fn duts(args: &RunArgs, library: &Library, stop: &Stop) -> Result<Vec<Dut>, Refused> {
    let selection = &args.selection;
    let address = selection.target.as_deref().map(str::parse).transpose()?;
    match (address, &selection.eds) {
        (Some(Address::Interface(_)) | None, Some(path)) => {
            Ok(vec![target::dut_of_file(selection, path)?])
        }
        (Some(Address::Interface(_)), None) => Err(Refused::usage(
            "a dry run asks no device: the data sheet says what would be done to it, and --eds or \
             `eds` in a device file names it",
        )),
        (Some(Address::Simulation { .. }), _) | (None, None) => {
            let targets = target::resolve(selection, &library.catalogue, stop)?;
            Ok(targets.into_iter().map(|Target { dut, .. }| dut).collect())
        }
    }
}

/// The effects of all cases of a run together.
#[derive(Default)]
struct Sum {
    /// In how many cases something is done; objects that are written are counted apart.
    cases: BTreeMap<Deed, usize>,
    /// In how many cases an object is written, and in how many of them by a PDO.
    written: BTreeMap<Mux, (usize, usize)>,
    /// How often 1010h and 1011h are written.
    stores: BTreeMap<u16, usize>,
    /// For each protection, the cases that it skips, and what each would do.
    protected: BTreeMap<String, Vec<String>>,
    running: usize,
    /// The cases that run only where another one fails.
    witnesses: usize,
    skipped: usize,
    asks_for_blocks: bool,
}

impl Sum {
    fn of(plan: &Plan, real_time: bool) -> Self {
        let mut sum = Self::default();
        for instance in &plan.instances {
            if real_time && instance.is_long() {
                sum.skipped += 1;
                continue;
            }
            let deeds = match instance.skip().is_none() && instance.needs_device() {
                true => deeds(instance, &plan.dut),
                false => Vec::new(),
            };
            let is_protected = matches!(instance.fate, Fate::Protected(_));
            let skip = instance.skip().map(|reason| (reason.clone(), is_protected));
            let exceeded = || plan.dut.protection.exceeded(&deeds).map(|reason| (reason, true));
            match skip.or_else(exceeded) {
                None => {
                    sum.running += 1;
                    sum.does(&deeds, plan);
                }
                Some((reason, protected)) => {
                    sum.skipped += 1;
                    let (deed, by) = reason.split_once(PROTECTED_BY).unwrap_or(("", &reason));
                    if protected {
                        let case = format!("{}  {deed}", instance.name());
                        sum.protected.entry(by.to_owned()).or_default().push(case);
                    }
                }
            }
            sum.asks_for_blocks |= instance.blocks().download;
        }
        for witness in &plan.witnesses {
            let deeds = deeds(witness, &plan.dut);
            if plan.dut.protection.exceeded(&deeds).is_none() {
                sum.witnesses += 1;
                sum.does(&deeds, plan);
            }
        }
        sum
    }

    fn does(&mut self, deeds: &[Deed], plan: &Plan) {
        for deed in deeds {
            plan.dut.protection.spend(*deed);
            if let Some(index @ (0x1010 | 0x1011)) = deed.written() {
                *self.stores.entry(index).or_default() += 1;
            }
        }
        let (mut written, mut by_pdo) = (BTreeSet::new(), BTreeSet::new());
        for deed in BTreeSet::from_iter(deeds) {
            match deed {
                Deed::Write(mux, None) => _ = written.insert(*mux),
                Deed::Write(mux, Some(_)) => _ = by_pdo.insert(*mux),
                other => *self.cases.entry(*other).or_default() += 1,
            }
        }
        for mux in written.union(&by_pdo) {
            let (all, of_pdo) = self.written.entry(*mux).or_default();
            *all += 1;
            *of_pdo += usize::from(by_pdo.contains(mux));
        }
    }
}

fn report(plan: &Plan, real_time: bool, verbose: bool) -> String {
    let (dut, sum) = (&plan.dut, Sum::of(plan, real_time));
    let mut text = format!(
        "{}, node {}, {}\nnothing is sent: {} would run, {} would be skipped\n",
        dut.name,
        dut.node,
        dut.sheet.source.name,
        counted(sum.running, "case"),
        sum.skipped,
    );
    if sum.witnesses > 0 {
        _ = writeln!(
            text,
            "where one of these fails, {} on which it may rely would run, too",
            counted(sum.witnesses, "more case"),
        );
    }
    objects(&mut text, &sum, dut);
    resets(&mut text, &sum, dut);
    services(&mut text, &sum);
    other_node(&mut text, &sum, dut);
    protected(&mut text, &sum, verbose);
    text
}

// Writing to a string cannot fail.

fn objects(text: &mut String, sum: &Sum, dut: &Dut) {
    _ = writeln!(text, "\nobjects that would be written, and set back");
    let name = |mux| dut.sheet.names.of(mux).unwrap_or_default();
    let width = sum.written.keys().map(|mux| name(*mux).chars().count()).max().unwrap_or(0);
    for (mux, (cases, by_pdo)) in &sum.written {
        let of_pdo = match by_pdo {
            0 => String::new(),
            count => format!(", {count} of them by PDO"),
        };
        let cases = counted(*cases, "case");
        _ = writeln!(text, "  {mux}  {:<width$}  {cases}{of_pdo}", name(*mux));
    }
    if sum.asks_for_blocks {
        let mux = Mux::new(0x1000, 0);
        let why = "once, to ask for block download; a device refuses it";
        _ = writeln!(text, "  {mux}  {:<width$}  {why}", name(mux));
    }
    if sum.written.is_empty() && !sum.asks_for_blocks {
        _ = writeln!(text, "  none");
    }
}

fn resets(text: &mut String, sum: &Sum, dut: &Dut) {
    _ = writeln!(text, "\nresets");
    for deed in [Deed::ResetNode, Deed::ResetCommunication, Deed::AllNodes] {
        if let Some(cases) = sum.cases.get(&deed) {
            _ = writeln!(text, "  {:<24}  {}", deed.to_string(), counted(*cases, "case"));
        }
    }
    let beside = match dut.protection.refuses(Deed::ResetNode) {
        None => {
            "the node is reset at the start unless it has just booted, and before a case that \
                 follows one that failed"
        }
        Some(_) => "no further ones: a device that a case leaves in disorder is waited for",
    };
    _ = writeln!(text, "  {beside}");
}

fn services(text: &mut String, sum: &Sum) {
    _ = writeln!(text, "\nstored");
    for (index, times) in &sum.stores {
        let what = if *index == 0x1010 { "store" } else { "restore default" };
        let times = counted(*times, "write");
        _ = writeln!(text, "  {index:04X}h {what} parameters: at most {times}");
    }
    for deed in [Deed::NodeId, Deed::BitTiming, Deed::StoreLss] {
        if let Some(cases) = sum.cases.get(&deed) {
            _ = writeln!(text, "  {deed}: {}", counted(*cases, "case"));
        }
    }
    let of_lss = [Deed::NodeId, Deed::BitTiming, Deed::StoreLss];
    if sum.stores.is_empty() && !of_lss.iter().any(|deed| sum.cases.contains_key(deed)) {
        _ = writeln!(text, "  nothing");
    }
}

/// A simulated node beside a simulated device concerns nobody.
fn other_node(text: &mut String, sum: &Sum, dut: &Dut) {
    let other = dut.partner.as_ref().filter(|partner| dut.other_nodes.contains(partner));
    if let (Some(other), Some(cases)) = (other, sum.cases.get(&Deed::Partner)) {
        _ = writeln!(text, "\nwritten in another node, and set back");
        _ = writeln!(text, "  1017:00 of {other}: {}", counted(*cases, "case"));
    }
}

fn protected(text: &mut String, sum: &Sum, verbose: bool) {
    if sum.protected.is_empty() {
        return;
    }
    _ = writeln!(text, "\nskipped because it is protected");
    for (by, cases) in &sum.protected {
        _ = writeln!(text, "  {}, by {by}", counted(cases.len(), "case"));
        for case in cases.iter().filter(|_| verbose) {
            _ = writeln!(text, "    {case}");
        }
    }
}
