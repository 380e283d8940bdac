//! Plays a session on a device, and writes down what was seen.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use canopen::bench::{INTERFACE, POWER};
use canopen::nmt::{Command, Service};
use canopen::sdo::{Client, Initiate, Next, RESPONSE_COB_ID, Request};
use canopen::{Bus, BusError, Frame, Instant, Mux, NmtState, Value};

use reference_devices::stack::NodeSettings;

use super::coverage::{Coverage, Tried};
use super::draw::{LONGEST, LONGEST_ON_BUS, Story, story};
use crate::action::{Action, Kind, Then};
use crate::blueprint::Blueprint;
use crate::oracle::{Seen, error_control};
use crate::surface::{PROCESS, Surface, lingers, turns};
use crate::talk::Open;

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_millis(300);
/// How long a device may take to boot.
const BOOT: Duration = Duration::from_secs(12);
/// For how long a device is switched off.
const OFF: Duration = Duration::from_millis(300);
/// How long it may take to take a frame in a time of its own.
const TAKEN: Duration = Duration::from_millis(30);
/// After so many requests in a row without an answer, no more are sent in this look.
const SILENCE: u32 = 2;
/// So many frames in one wait cut it short.
const MOST_FRAMES: u32 = 1_000;
/// The parts of a wait, in sixteenths, after each of which comes a glance at the bench.
const GLANCES: [u32; 4] = [1, 4, 6, 5];
/// Before the last look, everything that is quick comes to rest.
const REST: Duration = Duration::from_millis(400);

/// Where the actions of a session come from.
pub(crate) enum Source<'s> {
    /// Bytes of which they are drawn, and what was tried before.
    Drawn(&'s [u8], &'s Coverage),
    /// A session that was played before.
    Actions(&'s [Action]),
}

/// What happened in a session.
pub(crate) struct Told {
    /// What was done.
    pub(crate) actions: Vec<Action>,
    /// What was seen.
    pub(crate) seen: Vec<Seen>,
    /// What was done in which state.
    pub(crate) goals: Vec<(u8, Open, Kind)>,
    /// What was tried together.
    pub(crate) tried: Tried,
}

/// Plays a session. What is wrong in it, [`judge`](super::judge) says.
///
/// # Errors
/// Whatever the bus reports.
pub(crate) fn play(
    bus: &mut dyn Bus,
    blueprint: &Blueprint,
    surface: &Surface,
    source: &Source<'_>,
) -> Result<Told, BusError> {
    let node = blueprint.node();
    let on_bus = blueprint.is_in_its_own_time();
    let longest = if on_bus { LONGEST_ON_BUS } else { LONGEST };
    let Story { mut actions, tried } = match source {
        Source::Drawn(bytes, coverage) => {
            story(surface, node, bytes, coverage, blueprint.known(), longest)
        }
        Source::Actions(actions) => Story { actions: actions.to_vec(), tried: Tried::default() },
    };
    actions.retain(|action| !blueprint.spares(action.does) && !outlasts(action, blueprint));
    let mut player = Player {
        bus,
        surface,
        node,
        seen: Vec::new(),
        last: Instant::ZERO,
        written: BTreeSet::new(),
        own_time: blueprint.is_in_its_own_time(),
        lasts: blueprint.lasts(),
        at_rest: BTreeSet::new(),
        before: Vec::new(),
        state: NmtState::PRE_OPERATIONAL,
        goals: Vec::new(),
    };
    player.rests();
    player.boot()?;
    let done = player.tell(&actions);
    player.set_back();
    done?;
    let Player { seen, goals, .. } = player;
    Ok(Told { actions, seen, goals, tried })
}

/// Whether a device that goes on after the session learns or moves something that outlasts it.
fn outlasts(action: &Action, blueprint: &Blueprint) -> bool {
    let NodeSettings { learns_by, moves_by, .. } = blueprint.settings();
    let does = |frame: &Frame| match Request::decode(&frame.data) {
        Ok(Request::Download(mux, start)) => {
            let moves = moves_by.get(&mux).zip(number(&start));
            learns_by.contains(&mux) || moves.is_some_and(|(by, value)| by.contains(&value))
        }
        _ => false,
    };
    blueprint.lasts() && action.frames.iter().any(does)
}

/// The number that an expedited transfer carries.
fn number(start: &Initiate) -> Option<i64> {
    let Initiate::Expedited(data) = start else { return None };
    Some(data.iter().rev().fold(0, |value, byte| value << 8 | i64::from(*byte)))
}

/// The state after an action.
fn after(action: &Action, before: NmtState) -> NmtState {
    let command = action.frames.first().and_then(|frame| Command::decode(&frame.data).ok());
    match (action.does, command.map(|command| command.service)) {
        (Kind::PowerCycle | Kind::NmtReset, _) => NmtState::PRE_OPERATIONAL,
        (Kind::NmtState, Some(Service::START)) => NmtState::OPERATIONAL,
        (Kind::NmtState, Some(Service::STOP)) => NmtState::STOPPED,
        (Kind::NmtState, Some(Service::ENTER_PRE_OPERATIONAL)) => NmtState::PRE_OPERATIONAL,
        _ => before,
    }
}

struct Player<'p> {
    bus: &'p mut dyn Bus,
    surface: &'p Surface,
    node: u8,
    seen: Vec<Seen>,
    /// When the last frame of the tester was on the bus.
    last: Instant,
    /// The objects that the session has written.
    written: BTreeSet<Mux>,
    /// Whether it has a clock of its own.
    own_time: bool,
    /// Whether the device, and its bench with it, goes on after the session.
    lasts: bool,
    /// The processes that are at rest while it lasts.
    at_rest: BTreeSet<Arc<str>>,
    /// What the bench had before.
    before: Vec<(Arc<str>, Value)>,
    /// The state in which it is by the last command.
    state: NmtState,
    /// What was done in which state.
    goals: Vec<(u8, Open, Kind)>,
}

impl Player<'_> {
    fn tell(&mut self, actions: &[Action]) -> Result<(), BusError> {
        for action in actions {
            self.goals.push((self.state.0, Open::Nothing, action.does));
            self.carry_out(action)?;
            self.state = after(action, self.state);
        }
        self.wait(REST)?;
        self.look(true)
    }

    /// Notes the processes that were brought to rest before the session.
    fn rests(&mut self) {
        let surface = self.surface;
        let processes = surface.processes().filter(|_| self.lasts);
        let Some(bench) = self.bus.bench() else { return };
        for (name, value) in processes {
            if bench.get(name).is_ok_and(|present| present == value) {
                self.seen.push(Seen::Stimulus(Instant::ZERO, Arc::clone(name), value));
                self.at_rest.insert(Arc::clone(name));
            }
        }
    }

    /// Sets the bench back, the last first.
    fn set_back(&mut self) {
        while let Some((name, value)) = self.before.pop() {
            // A bench that fails says so at the next session.
            _ = self.bus.bench().map(|bench| bench.set(&name, &value));
        }
    }

    fn carry_out(&mut self, action: &Action) -> Result<(), BusError> {
        match action.does {
            Kind::Look => return self.look(false),
            Kind::LookAtAll => return self.look(true),
            Kind::PowerCycle => {
                self.power("off")?;
                self.wait(OFF)?;
                self.power("on")?;
                return self.boot();
            }
            _ => {}
        }
        for frame in &action.frames {
            if let Ok(Request::Download(mux, _)) = Request::decode(&frame.data) {
                self.written.insert(mux);
            }
            self.send(frame)?;
        }
        if let Some(stimulus) = &action.bench {
            self.set(&stimulus.name, &stimulus.level())?;
        }
        match action.then {
            Then::Wait(micros) => self.work(Duration::from_micros(micros)),
            Then::Answers { id, .. } if id == error_control(self.node) => self.boot(),
            Then::Answers { id, .. } => {
                self.answer(id, PATIENCE)?;
                self.glance()
            }
        }
    }

    /// Lets the device work, with a glance at its bench now and then.
    fn work(&mut self, time: Duration) -> Result<(), BusError> {
        for part in GLANCES {
            let part = time * part / 16;
            self.wait(part)?;
            self.glance()?;
        }
        Ok(())
    }

    /// What the bench shows now. A device with a clock of its own may not yet have taken the last
    /// frame.
    fn glance(&mut self) -> Result<(), BusError> {
        let at = self.now()?;
        if self.own_time && at.since(self.last) < TAKEN {
            return Ok(());
        }
        let Some(bench) = self.bus.bench() else { return Ok(()) };
        for name in &self.surface.shown {
            if let Ok(value) = bench.get(name) {
                self.seen.push(Seen::Observed(at, Arc::clone(name), value));
            }
        }
        Ok(())
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        match self.bus.send(frame) {
            // What is protected is left out.
            Err(BusError::Withheld(_)) => return Ok(()),
            other => other?,
        }
        let until = self.bus.now() + PATIENCE;
        while let Some(stamped) = self.bus.recv(until)? {
            let own = stamped.own;
            self.seen.push(Seen::Frame(stamped));
            if own {
                self.last = stamped.at;
                return Ok(());
            }
        }
        Err(BusError::Io("a frame was not sent in time".to_owned()))
    }

    /// The next frame with an identifier.
    fn answer(&mut self, id: u16, patience: Duration) -> Result<Option<Frame>, BusError> {
        let until = self.bus.now() + patience;
        while let Some(stamped) = self.bus.recv(until)? {
            let frame = stamped.frame;
            let is_answer = !stamped.own && frame.data_id() == Some(id);
            self.seen.push(Seen::Frame(stamped));
            if is_answer {
                return Ok(Some(frame));
            }
        }
        self.seen.push(Seen::Until(until));
        Ok(None)
    }

    fn boot(&mut self) -> Result<(), BusError> {
        self.answer(error_control(self.node), BOOT).map(|_| ())
    }

    fn wait(&mut self, time: Duration) -> Result<(), BusError> {
        let mut until = self.bus.now() + time;
        let mut frames = 0;
        while let Some(stamped) = self.bus.recv(until)? {
            frames += 1;
            if frames == MOST_FRAMES {
                // More of the same says nothing new.
                until = until.min(stamped.at + OFF);
            }
            self.seen.push(Seen::Frame(stamped));
        }
        self.seen.push(Seen::Until(until));
        Ok(())
    }

    /// Lets what is due now happen, so that a stimulus comes after it.
    fn now(&mut self) -> Result<Instant, BusError> {
        self.wait(Duration::ZERO)?;
        Ok(self.bus.now())
    }

    /// Lets the device take the last frame, too, so that a stimulus comes after it.
    fn taken(&mut self) -> Result<Instant, BusError> {
        let since = self.bus.now().since(self.last);
        if self.own_time {
            self.wait(TAKEN.saturating_sub(since))?;
        }
        self.now()
    }

    fn power(&mut self, word: &str) -> Result<(), BusError> {
        let at = self.now()?;
        let Some(bench) = self.bus.bench() else { return Ok(()) };
        if bench.set(POWER, &Value::Text(word.to_owned())).is_ok() {
            self.seen.push(Seen::Power(at, word == "on"));
        }
        Ok(())
    }

    /// Sets a stimulus. One that the bench does not have, or does not set so, is left out.
    fn set(&mut self, name: &Arc<str>, value: &Value) -> Result<(), BusError> {
        let process = matches!(value, Value::Text(word) if word == PROCESS);
        // How far something has turned meanwhile depends on two clocks, and when a device boots on
        // another interface, on its own.
        let apart = self.own_time && (turns(name) || &**name == INTERFACE);
        let lasting = self.lasts && lingers(name);
        if apart || lasting || process && self.at_rest.contains(name) {
            return Ok(());
        }
        let at = self.taken()?;
        let Some(bench) = self.bus.bench() else { return Ok(()) };
        if self.lasts
            && self.before.iter().all(|(known, _)| known != name)
            && let Ok(before) = bench.get(name)
        {
            self.before.push((Arc::clone(name), before));
        }
        if bench.set(name, value).is_ok() {
            self.seen.push(Seen::Stimulus(at, Arc::clone(name), value.clone()));
        }
        Ok(())
    }

    /// Looks at what moves and what was written, or at all.
    fn look(&mut self, all: bool) -> Result<(), BusError> {
        self.glance()?;
        let objects: Vec<Mux> = match all {
            true => self.surface.readable.clone(),
            false => {
                let written = self.written.iter().copied();
                let written = written.filter(|mux| self.surface.reads(*mux));
                self.surface.moving.iter().copied().chain(written).collect()
            }
        };
        let mut silent = 0;
        for mux in objects {
            silent = if self.upload(mux)? { 0 } else { silent + 1 };
            if silent >= SILENCE {
                break;
            }
        }
        let at = self.now()?;
        self.seen.push(Seen::Looked(at));
        Ok(())
    }

    /// Reads an object; false when nothing answers.
    fn upload(&mut self, mux: Mux) -> Result<bool, BusError> {
        let (mut client, first) = Client::upload(mux);
        let mut requests = vec![first];
        loop {
            for request in requests {
                self.send(&request.frame(self.node))?;
            }
            let id = RESPONSE_COB_ID + u16::from(self.node);
            let Some(answer) = self.answer(id, PATIENCE)? else { return Ok(false) };
            let Ok(answer) = client.decode(&answer.data) else { return Ok(true) };
            match client.step(answer) {
                Next::Send(next, more) => (client, requests) = (next, more),
                Next::Done(..) | Next::Failed(..) => return Ok(true),
            }
        }
    }
}
