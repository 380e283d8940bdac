//! A reference device in real time: through pipes, as a program of the user is tested, or from one
//! adapter to another.

use std::collections::BTreeMap;
use std::thread;
use std::time::Duration;

use canopen::catalogue::Catalogue;
use canopen::{BusError, Instant, serve};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reports::{Event, Verdict};
use runner::run::{Ending, Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

use super::clock::waits;
use super::findings::Findings;
use crate::bus::Interface;
use crate::cli::SelfTestArgs;
use crate::commands::planned::plan_all;
use crate::exit::Refused;
use crate::target::{self, Address, DEFAULT_BIT_RATE, Selection, Target, open_interface};

/// The device has every service.
const DEVICE: &str = devices::WITH_EVERYTHING;
/// What is judged by contents and by times, in a few seconds.
const SUITES: [&str; 3] = ["cia301/nmt", "cia301/heartbeat", "cia301/sync"];
/// How long the end of a device in this process is not noticed.
const SLICE: Duration = Duration::from_millis(20);

/// Whether --target and --peer name interfaces, said before anything takes time.
///
/// # Errors
/// When one of them does not.
pub(super) fn check(args: &SelfTestArgs) -> Result<(), Refused> {
    [&args.target, &args.peer].into_iter().flatten().try_for_each(|name| interface(name).map(drop))
}

/// Tests the device, which must be green, and returns by how much waits on its bus ended late.
///
/// # Errors
/// When an interface cannot be used, or no device answers.
pub(super) fn run(
    library: &Library,
    args: &SelfTestArgs,
    stop: &Stop,
    findings: &mut Findings,
) -> Result<Vec<Duration>, Refused> {
    // The program that is the device ends with this one.
    let _held = stop.hold();
    let (Some(target), Some(peer)) = (&args.target, &args.peer) else {
        return tested(library, args, &this_program()?, "pipes", stop, findings);
    };
    let way = format!("{peer} and {target}");
    let peer = interface(peer)?.at_bit_rate(args.bitrate);
    let over = Stop::default();
    thread::scope(|scope| {
        let served = scope.spawn(|| serve_until(&peer, &over));
        let tested = tested(library, args, target, &way, stop, findings);
        over.signal();
        let served = served.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        // A device that ended is why nobody answered.
        served.and(tested)
    })
}

/// The command line that is the device: this program.
fn this_program() -> Result<String, Refused> {
    let why = |why: String| Refused::bus(format!("this program does not find itself: {why}"));
    let path = std::env::current_exe().map_err(|error| why(error.to_string()))?;
    let path = path.display().to_string();
    let path = shlex::try_quote(&path).map_err(|error| why(error.to_string()))?;
    Ok(format!("exec:{path} serve {DEVICE} --stdio"))
}

/// The interface of that name, on which there can be two programs.
fn interface(name: &str) -> Result<Interface, Refused> {
    match name.parse()? {
        Address::Interface(interface) if !interface.is_program() => Ok(interface),
        _ => Err(Refused::usage(format!(
            "`{name}` is no interface: --target and --peer name two adapters on one bus"
        ))),
    }
}

/// Is the device on an interface until nobody wants it any more.
fn serve_until(interface: &Interface, over: &Stop) -> Result<(), Refused> {
    let bit_rate = interface.bit_rate(DEFAULT_BIT_RATE).unwrap_or(DEFAULT_BIT_RATE);
    let device = target::reference_device_at(bit_rate, DEVICE, Catalogue::built_in())?;
    let mut served = device.node(device.description.default_node, Rules::default());
    let mut bus = open_interface(interface, over)?;
    while !over.asked() {
        let end = bus.now() + SLICE;
        match serve(&mut *bus, &mut served, end) {
            // A device sees an error frame, or misses others, and goes on.
            Ok(()) | Err(BusError::Controller(_) | BusError::Lost(_)) => {}
            Err(BusError::Interrupted) => break,
            Err(error) => return Err(Refused::bus(error.to_string())),
        }
    }
    Ok(())
}

/// Tests the device behind a target.
fn tested(
    library: &Library,
    args: &SelfTestArgs,
    target: &str,
    way: &str,
    stop: &Stop,
    findings: &mut Findings,
) -> Result<Vec<Duration>, Refused> {
    let node = target::reference_device(DEVICE, &library.catalogue)?.description.default_node;
    let mut selection = Selection::of_target(Some(target));
    (selection.node, selection.bitrate) = (Some(node), args.bitrate);
    selection.device = Some(DEVICE.to_owned());
    let targets = target::resolve(&selection, &library.catalogue, stop)?;
    let mut plan = plan_all(library, &targets)?.remove(0);
    plan.instances.retain(|it| SUITES.contains(&it.suite.name()) && it.skip().is_none());
    let target: &Target = &targets[0];
    let mut bus = target.open(stop)?;
    let undo = Undo::default();
    let session = Session::new(
        &plan,
        &library.register,
        target.dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE),
        stop,
        &undo,
    );
    let (mut verdicts, mut repeated) = (BTreeMap::<String, Verdict>::new(), 0);
    let (mut name, mut from) = (String::new(), None);
    let ending = session.run(&mut *bus, &mut |event| match event {
        Event::CaseStarted(started) => name = started.name(),
        Event::CaseRepeated(_) => repeated += 1,
        Event::Frame(frame) => _ = from.get_or_insert(frame.at),
        // A case that is undecided runs again at the end, and the last verdict counts.
        Event::CaseEnded(ended) => _ = verdicts.insert(name.clone(), ended.outcome.verdict()),
        _ => {}
    });
    match ending {
        Ending::Complete | Ending::Enough(_) => {}
        Ending::Bus(BusError::Interrupted) => return Err(Refused::interrupted()),
        Ending::Bus(error) => return Err(Refused::bus(error.to_string())),
        Ending::Nobody => return Err(Refused::bus(format!("{DEVICE} does not answer over {way}"))),
        Ending::Gone(why) => findings.weak.push(format!("{DEVICE} over {way}: {why}")),
    }
    let took = bus.now().since(from.unwrap_or(Instant::ZERO));
    let (cases, is_red) = (plan.instances.len(), |verdict: &Verdict| *verdict != Verdict::Pass);
    let passed = verdicts.values().filter(|verdict| !is_red(verdict)).count();
    let again = match repeated {
        0 => String::new(),
        again => format!(", {again} repeated"),
    };
    let said = format!("{DEVICE} over {way}: {passed} of {cases} passed{again}, in {took:.1?}");
    findings.line("real time", &said);
    for (case, verdict) in verdicts.iter().filter(|(_, verdict)| is_red(verdict)) {
        let said = format!("{case} is {verdict} on {DEVICE} over {way}");
        match verdict {
            // What adapters do to frames is no mistake of this program.
            Verdict::Fail if args.target.is_none() => findings.wrong.push(said),
            _ => findings.weak.push(said),
        }
    }
    waits(&mut *bus).map_err(|error| match error {
        BusError::Interrupted => Refused::interrupted(),
        error => Refused::bus(error.to_string()),
    })
}
