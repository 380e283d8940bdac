//! A device on a bus. A program is started anew for each session; any other device is lent as for a
//! run: what sessions may change is in the undo log, and is set back after each of them.

use std::sync::Arc;
use std::time::Duration;

use campaign::session::{self, BOOTED, Played, Script};
use campaign::{Ask, Blueprint, Seen, Stage};
use canopen::{Bench, Bus, BusError, Frame, Instant, Stamped, Value, heartbeat};
use reference_devices::change::Replica;
use runner::protect::Deed;
use runner::run::{Policy, Started, Visit};
use runner::stop::Stop;

use crate::bus::{Reached, Watch};
use crate::commands::run::undo;
use crate::exit::Refused;
use crate::files::words;
use crate::reporter::harmless;
use crate::target::{DEFAULT_BIT_RATE, Selection, Target};

/// A device on a bus.
pub(in crate::commands) struct OnBus<'t> {
    target: &'t Target,
    stop: Stop,
    bus: Option<Box<dyn Bus>>,
    /// The device as it is lent; none when it is a program.
    visit: Option<Visit<'t>>,
    /// What a program tells beside its frames, and what it has told so far.
    watch: Option<Arc<Watch>>,
    reached: Reached,
    /// Why it is lost.
    lost: Option<String>,
    /// What the bench had before processes were brought to rest; none before the first session.
    moved: Option<Vec<(Arc<str>, Value)>>,
}

/// How long a program may take to boot.
const BOOT: Duration = Duration::from_secs(10);
/// How often a session in which something was wrong is played again: what was late is not so twice.
const REPEATS: u32 = 2;

impl<'t> OnBus<'t> {
    /// The device of a target, looked at as a run does.
    ///
    /// # Errors
    /// When it does not answer, or must not be reset, so that no session begins in a known state.
    pub(super) fn of(
        target: &'t Target,
        selection: &Selection,
        stop: &Stop,
    ) -> Result<Self, Refused> {
        let stop = stop.of_session();
        let (bus, visit, watch, reached, lost, moved) = Default::default();
        let mut on_bus = Self { target, stop, bus, visit, watch, reached, lost, moved };
        if !target.outlives_the_program() {
            let watch = Watch::new().map_err(|error| Refused::bus(words(&error)))?;
            on_bus.watch = Some(Arc::new(watch));
            return Ok(on_bus);
        }
        let dut = &target.dut;
        let mut bus = target.open(&on_bus.stop)?;
        let policy = Policy::at_bit_rate(dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE));
        let undo = undo(target, selection);
        let visit = Visit::begin(&mut *bus, dut, policy, undo, &on_bus.stop);
        let visit = visit.map_err(|error| match error {
            BusError::Interrupted => Refused::interrupted(),
            error => Refused::bus(error.to_string()),
        })?;
        (on_bus.bus, on_bus.visit) = (Some(bus), Some(visit));
        if let Some(why) = dut.protection.refuses(Deed::ResetNode) {
            on_bus.give_back();
            return Err(Refused::usage(format!("each session begins with a reset: {why}")));
        }
        Ok(on_bus)
    }

    /// Why it is lost, if it is.
    pub(super) fn lost(&self) -> Option<&str> {
        self.lost.as_deref()
    }

    /// Brings the processes of a bench that outlives the sessions to rest. What a load has been
    /// heated to before, no model knows.
    fn calm(&mut self, blueprint: &Blueprint) {
        if self.moved.is_some() || !blueprint.lasts() {
            return;
        }
        let mut moved = Vec::new();
        let bench = self.bus.as_mut().and_then(|bus| bus.bench());
        if let (Some(surface), Some(bench)) = (blueprint.surface(), bench) {
            for (name, value) in surface.processes() {
                let before = bench.get(name);
                if let (Ok(before), Ok(())) = (before, bench.set(name, &value)) {
                    moved.push((Arc::clone(name), before));
                }
            }
        }
        self.moved = Some(moved);
    }

    /// Sets back what is still changed in the device and on its bench, and says what is not.
    pub(super) fn give_back(&mut self) {
        let bench = self.bus.as_mut().and_then(|bus| bus.bench());
        if let (Some(bench), Some(moved)) = (bench, self.moved.take()) {
            // A bench that fails has said so.
            moved.iter().rev().for_each(|(name, before)| _ = bench.set(name, before));
        }
        let (Some(visit), Some(bus)) = (self.visit.take(), &mut self.bus) else { return };
        // A bus that has failed says nothing more.
        let outputs = visit.said_of_outputs(&mut **bus).unwrap_or_default();
        outputs.iter().for_each(|said| complain!("note: {}", harmless(said)));
        if let Some((changed, log)) = visit.end(&mut **bus) {
            let (name, node) = (&self.target.dut.name, self.target.dut.node);
            let log = log.map(|name| format!("; `harness restore {name}` sets this back"));
            let why = format!("{name}, node {node}: {changed}{}", log.unwrap_or_default());
            complain!("warning: {}", harmless(&why));
        }
    }

    /// The device as it is after it was switched on: the time of that, where it was seen, and the
    /// boot-up message.
    fn started(&mut self) -> Result<(Option<Instant>, Option<Stamped>), BusError> {
        let Some(visit) = &mut self.visit else {
            // A program ends before the next one begins.
            drop(self.bus.take());
            let watch = self.watch.as_ref();
            watch.map_or(Ok(()), |watch| watch.begin()).map_err(|it| BusError::Io(words(&it)))?;
            let bus = self.target.open_watched(&self.stop, watch).map_err(|it| {
                let said = watch.and_then(|watch| watch.last_words());
                let said = said.map(|said| format!("; it said:\n{said}"));
                BusError::Open(it.message + &said.unwrap_or_default())
            })?;
            let bus = &mut **self.bus.insert(bus);
            return Ok((None, boot_up(bus, self.target.dut.node)?));
        };
        let bus = self.bus.as_mut().ok_or_else(|| BusError::Io("the bus is closed".to_owned()))?;
        let started = visit.start(&mut **bus);
        visit.take_notes().iter().for_each(|note| complain!("note: {}", harmless(note)));
        match started? {
            Started::At(reset, boot_up) => Ok((Some(reset), boot_up)),
            Started::Lost(why) => {
                self.lost = Some(why.clone());
                Err(BusError::Io(format!("the device did not come back: {why}")))
            }
        }
    }

    fn leave(&mut self, seen: &[Stamped]) -> Result<(), BusError> {
        let (Some(visit), Some(bus)) = (&mut self.visit, &mut self.bus) else { return Ok(()) };
        visit.leave(&mut **bus, seen)
    }
}

impl Drop for OnBus<'_> {
    fn drop(&mut self) {
        self.give_back();
    }
}

/// The next boot-up message.
fn boot_up(bus: &mut dyn Bus, node: u8) -> Result<Option<Stamped>, BusError> {
    let until = bus.now() + BOOT;
    let id = heartbeat::COB_ID + u16::from(node);
    while let Some(seen) = bus.recv(until)? {
        if !seen.own && seen.frame.data_id() == Some(id) && seen.frame.data[..] == [0] {
            return Ok(Some(seen));
        }
    }
    Ok(None)
}

impl Stage for OnBus<'_> {
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError> {
        self.calm(blueprint);
        let (reset, boot_up) = self.started()?;
        let Some(bus) = &mut self.bus else { return Err(BusError::Io("closed".to_owned())) };
        let began = match (boot_up, reset) {
            (Some(boot_up), _) => i128::from(boot_up.at.0) - i128::from(BOOTED.0),
            (None, Some(reset)) => i128::from(reset.0),
            (None, None) => i128::from(bus.now().0),
        };
        let mut bus = SinceStart { bus: &mut **bus, began, boot_up };
        let played = session::play(&mut bus, blueprint, model, script)?;
        let frames = played.seen.iter().filter_map(|seen| match seen {
            Seen::Frame(stamped) => Some(*stamped),
            Seen::Power(..)
            | Seen::Until(_)
            | Seen::Ended(_)
            | Seen::Stored(..)
            | Seen::Joined(_)
            | Seen::Stimulus(..)
            | Seen::Observed(..)
            | Seen::Looked(_) => None,
        });
        let frames: Vec<Stamped> = frames.collect();
        self.leave(&frames)?;
        Ok(played)
    }

    fn repeats(&self) -> u32 {
        REPEATS
    }

    fn reached_more(&mut self) -> bool {
        self.watch.as_ref().is_some_and(|watch| watch.adds_to(&mut self.reached))
    }

    fn last_words(&mut self) -> Option<String> {
        self.watch.as_ref()?.last_words()
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError> {
        self.started()?;
        let Some(bus) = &mut self.bus else { return Err(BusError::Io("closed".to_owned())) };
        what(&mut **bus)?;
        self.leave(&[])
    }
}

/// A bus whose time begins with that of a model that is switched on together with the device.
struct SinceStart<'b> {
    bus: &'b mut dyn Bus,
    /// The time of the bus at which the model is switched on, in nanoseconds.
    began: i128,
    /// The boot-up message, until it is received.
    boot_up: Option<Stamped>,
}

impl SinceStart<'_> {
    fn here(&self, at: Instant) -> Instant {
        Instant(u64::try_from(i128::from(at.0) - self.began).unwrap_or(0))
    }

    fn there(&self, at: Instant) -> Instant {
        Instant(u64::try_from(i128::from(at.0) + self.began).unwrap_or(0))
    }
}

impl Bus for SinceStart<'_> {
    fn is_real(&self) -> bool {
        self.bus.is_real()
    }

    fn now(&mut self) -> Instant {
        let now = self.bus.now();
        self.here(now)
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        let seen = match self.boot_up.take() {
            Some(boot_up) => Some(boot_up),
            None => self.bus.recv(self.there(until))?,
        };
        Ok(seen.map(|seen| Stamped { at: self.here(seen.at), ..seen }))
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bus.bench()
    }
}

#[cfg(test)]
mod tests;
