//! A session: actions from a known state, on a device and beside a model of it.

use std::time::Duration;

use canopen::bench::POWER;
use canopen::nmt::{Command, Service};
use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Bus, BusError, Frame, Instant, NmtState, Stamped, Value};
use reference_devices::change::Replica;
use serde::{Deserialize, Serialize};

use crate::action::{Action, Kind, Then};
use crate::blueprint::Blueprint;
use crate::draw::Draw;
use crate::explore::{self, Coverage, Tried};
use crate::oracle::{End, Oracle, Seen, error_control, is_request};
use crate::talk::Open;

/// Actions, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Session {
    /// The actions.
    pub actions: Vec<Action>,
}

impl Session {
    /// The same actions, each of which waits for the answer to its request to the default SDO
    /// server of this node.
    #[must_use]
    pub fn patient(mut self, node: u8) -> Self {
        let id = RESPONSE_COB_ID + u16::from(node);
        for action in &mut self.actions {
            let asks = action.frames.last().is_some_and(|frame| is_request(frame, node));
            if asks && matches!(action.then, Then::Wait(_)) {
                action.then = Then::Answers { id, count: 1 };
            }
        }
        self
    }
}

/// The most actions of a session.
pub const LONGEST: usize = 128;
/// The fewest, unless something is found before.
pub const SHORTEST: usize = 16;

/// A state of the device and the transfer, and what was done in it.
pub type Goal = (NmtStateKey, Open, Kind);
/// The byte of an NMT state.
pub type NmtStateKey = u8;

/// What happened in a session.
#[derive(Clone, Debug)]
pub struct Played {
    /// What was done.
    pub session: Session,
    /// What was seen.
    pub seen: Vec<Seen>,
    /// What the judge says of it; `None` when nothing is wrong.
    pub end: Option<End>,
    /// The states in which something was done.
    pub goals: Vec<Goal>,
    /// The objects that the application has changed.
    pub followed: Vec<canopen::Mux>,
    /// What an exploration tried together.
    pub tried: Tried,
}

/// Where the actions of a session come from.
pub enum Script<'s> {
    /// Bytes of which they are drawn.
    Bytes(&'s [u8]),
    /// The same, steered by what was tried before.
    Steered(&'s [u8], &'s Coverage),
    /// A session that was played before.
    Actions(&'s [Action]),
}

/// Plays a session on a bus.
pub struct Player<'p> {
    bus: &'p mut dyn Bus,
    oracle: Oracle<'p>,
    blueprint: &'p Blueprint,
    seen: Vec<Seen>,
    end: Option<End>,
    /// How long it may still wait, in microseconds, where time passes for everybody.
    left: u64,
}

/// When a device in its own time has booted: early enough for the slowest models to begin before.
pub const BOOTED: Instant = Instant(4_000_000_000);
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_millis(250);
/// The same for a device in its own time.
const PATIENCE_ON_BUS: Duration = Duration::from_secs(1);
/// How long an answer is waited for on a bus that the model does not give.
const SILENCE: Duration = Duration::from_millis(3);
/// How long a session on a bus waits altogether, in microseconds, and for how long each time at
/// least once it has.
const BUDGET: u64 = 1_000_000;
const LEAST: u64 = 1_000;
/// How far the end of a wait is from what the model does then, and how often it is moved.
const APART: Duration = Duration::from_millis(30);
const MOVES: u32 = 3;
/// How many frames wait for the wire: a CAN interface queues about ten.
const MOST_AHEAD: usize = 8;
/// How long a device may take to boot.
const BOOT: Duration = Duration::from_secs(3);
/// The same for a device in its own time.
const BOOT_ON_BUS: Duration = Duration::from_secs(10);
/// How long a frame of the tester may wait for the bus.
const ECHO: Duration = Duration::from_secs(1);
/// The time after the last action in which what is owed must come.
const REST: Duration = Duration::from_millis(200);
/// The same for a device in its own time, as often as something is owed.
const REST_ON_BUS: Duration = Duration::from_millis(80);

impl<'p> Player<'p> {
    /// A session on this bus with a device that may be like `model`.
    pub fn new(bus: &'p mut dyn Bus, blueprint: &'p Blueprint, model: Box<dyn Replica>) -> Self {
        let oracle = Oracle::new(blueprint, model);
        let left = if blueprint.is_in_its_own_time() { BUDGET } else { u64::MAX };
        Self { bus, oracle, blueprint, seen: Vec::new(), end: None, left }
    }

    /// Plays the actions of a script until something is wrong, and to its end.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn play(mut self, script: &Script<'_>) -> Result<Played, BusError> {
        let (mut actions, mut goals) = (Vec::new(), Vec::new());
        self.begin(&mut |_| ())?;
        match script {
            Script::Actions(all) => {
                for action in *all {
                    if self.end.is_some() {
                        break;
                    }
                    actions.push(self.carry_out(action.clone(), &mut |_| ())?);
                }
            }
            Script::Bytes(bytes) | Script::Steered(bytes, _) => {
                let blueprint = self.blueprint;
                let mut draw = Draw::new(bytes, blueprint);
                while self.end.is_none() && actions.len() < LONGEST {
                    let model = self.oracle.model();
                    let (state, open) = (model.state(), draw.open());
                    let Some(mut action) = draw.next(model) else { break };
                    action.then = self.affords(action.then);
                    self.once(&mut action);
                    goals.push((state.0, open, action.does));
                    actions.push(self.carry_out(action, &mut |frame| draw.hear(frame))?);
                }
            }
        }
        self.rest()?;
        let Self { seen, end, oracle, .. } = self;
        let followed = oracle.followed().iter().copied().collect();
        let (session, tried) = (Session { actions }, Tried::default());
        Ok(Played { session, seen, end, goals, followed, tried })
    }

    /// Waits for what is owed. A device on a bus is reset at the end: it must come back.
    fn rest(&mut self) -> Result<(), BusError> {
        if !self.blueprint.is_in_its_own_time() {
            let until = self.bus.now() + REST;
            return self.wait(until, &mut |_| false);
        }
        loop {
            let until = self.bus.now() + REST_ON_BUS;
            self.wait(until, &mut |_| false)?;
            if self.end.is_some() || !self.oracle.owes() {
                break;
            }
        }
        let (service, node) = (Service::RESET_NODE, self.blueprint.node());
        self.send(&[Command { service, node }.frame()], &mut |_| ())?;
        self.begin(&mut |_| ())
    }

    /// On a bus, each reset waits for its boot-up message: how often a device boots that gets some
    /// in a row depends on how fast it is.
    fn once(&self, action: &mut Action) {
        if action.does == Kind::NmtReset && self.blueprint.is_in_its_own_time() {
            action.frames.truncate(1);
        }
    }

    /// What the session can wait for. On a bus, a session that waits long waits once or twice.
    fn affords(&mut self, then: Then) -> Then {
        let Then::Wait(micros @ 1..) = then else { return then };
        let micros = micros.min(self.left.max(LEAST));
        self.left = self.left.saturating_sub(micros);
        Then::Wait(micros)
    }

    /// How long a device may take to boot.
    fn boot(&self) -> Duration {
        match self.blueprint.is_in_its_own_time() {
            true if self.oracle.boots() => BOOT_ON_BUS,
            true => SILENCE,
            false => BOOT,
        }
    }

    /// How long an answer may take.
    fn patience(&self, id: u16) -> Duration {
        match self.blueprint.is_in_its_own_time() {
            true if self.oracle.awaits(id, PATIENCE_ON_BUS) => PATIENCE_ON_BUS,
            true => SILENCE,
            false => PATIENCE,
        }
    }

    /// Waits for the boot-up message. On a bus, a heartbeat from before may still come.
    fn begin(&mut self, hear: &mut dyn FnMut(&Frame)) -> Result<(), BusError> {
        let boot_up = error_control(self.blueprint.node());
        let any = !self.blueprint.is_in_its_own_time();
        let until = self.bus.now() + self.boot();
        self.wait(until, &mut |frame| {
            hear(frame);
            frame.data_id() == Some(boot_up) && (any || frame.data.first() == Some(&0))
        })
    }

    /// Carries out an action. Returns it without the frames that were withheld.
    fn carry_out(
        &mut self,
        mut action: Action,
        hear: &mut dyn FnMut(&Frame),
    ) -> Result<Action, BusError> {
        if action.does == Kind::PowerCycle {
            self.power(false)?;
            self.power(true)?;
        }
        self.let_it_answer(hear)?;
        let boots = matches!(action.does, Kind::NmtReset | Kind::PowerCycle);
        let mut answers = 0;
        let mut early = |frame: &Frame| {
            if matches!(action.then, Then::Answers { id, .. } if frame.data_id() == Some(id)) {
                answers += 1;
            }
            hear(frame);
        };
        action.frames = self.send(&action.frames, &mut early)?;
        match action.then {
            Then::Wait(0) => {}
            Then::Wait(micros) => {
                let until = self.bus.now() + Duration::from_micros(micros);
                let until = self.apart(until);
                self.wait(until, &mut |frame| {
                    hear(frame);
                    false
                })?;
            }
            Then::Answers { id, count } => {
                if answers >= count {
                    return Ok(action);
                }
                if boots && self.blueprint.is_in_its_own_time() {
                    self.begin(hear)?;
                    return Ok(action);
                }
                let patience = if boots { self.boot() } else { self.patience(id) };
                let until = self.bus.now() + patience;
                // A sub-block ends with its last segment, or with an abort.
                self.wait(until, &mut |frame| {
                    hear(frame);
                    let answer = frame.data_id() == Some(id);
                    answers += u16::from(answer);
                    let last = frame.data.first().is_some_and(|first| *first >= 0x80);
                    answer && (answers >= count || last)
                })?;
            }
        }
        Ok(action)
    }

    /// Waits for the answer to the last request. What else a device on a bus gets before it has
    /// answered comes before or after what it does for the request, and nobody knows which.
    fn let_it_answer(&mut self, hear: &mut dyn FnMut(&Frame)) -> Result<(), BusError> {
        let id = RESPONSE_COB_ID + u16::from(self.blueprint.node());
        let until = self.bus.now() + PATIENCE_ON_BUS;
        while self.blueprint.is_in_its_own_time()
            && self.end.is_none()
            && self.bus.now() < until
            && self.oracle.awaits(id, PATIENCE_ON_BUS)
        {
            self.wait(until, &mut |frame| {
                hear(frame);
                frame.data_id() == Some(id)
            })?;
        }
        Ok(())
    }

    /// A moment at which nothing is about to happen in the device. What happens then in a device in
    /// its own time, before the next frame or after it, nobody knows.
    fn apart(&self, mut until: Instant) -> Instant {
        for _ in 0..MOVES {
            let due = self.oracle.model().due_before(until + APART);
            match due.filter(|due| self.blueprint.is_in_its_own_time() && *due + APART > until) {
                Some(due) => until = due + APART,
                None => break,
            }
        }
        until
    }

    fn power(&mut self, on: bool) -> Result<(), BusError> {
        // What the device does at this very moment, it does before, as the model will.
        let now = self.bus.now();
        self.wait(now, &mut |_| false)?;
        let Some(bench) = self.bus.bench() else { return Ok(()) };
        let value = Value::Text(if on { "on" } else { "off" }.to_owned());
        bench.set(POWER, &value).map_err(|why| BusError::Io(why.to_string()))?;
        let at = self.bus.now();
        self.note(Seen::Power(at, on));
        Ok(())
    }

    /// Sends frames, and waits until the last of them is on the bus. Returns those that were not
    /// withheld.
    fn send(
        &mut self,
        frames: &[Frame],
        hear: &mut dyn FnMut(&Frame),
    ) -> Result<Vec<Frame>, BusError> {
        let most = if self.blueprint.is_in_its_own_time() { MOST_AHEAD } else { usize::MAX };
        let (mut under_way, mut sent) = (0, Vec::with_capacity(frames.len()));
        for frame in frames {
            self.echoes(&mut under_way, most, hear)?;
            match self.bus.send(frame) {
                Ok(()) => {
                    under_way += 1;
                    sent.push(*frame);
                }
                // What is protected is left out.
                Err(BusError::Withheld(_)) => {}
                Err(error) => return Err(error),
            }
        }
        self.echoes(&mut under_way, 1, hear)?;
        Ok(sent)
    }

    /// Waits until fewer than so many frames are under way.
    fn echoes(
        &mut self,
        under_way: &mut usize,
        most: usize,
        hear: &mut dyn FnMut(&Frame),
    ) -> Result<(), BusError> {
        let until = self.bus.now() + ECHO;
        while *under_way >= most && self.end.is_none() {
            let Some(stamped) = self.received(until)? else {
                if self.end.is_some() {
                    return Ok(());
                }
                return Err(BusError::Io("a frame was not sent within a second".to_owned()));
            };
            *under_way -= usize::from(stamped.own);
            self.note(Seen::Frame(stamped));
            if !stamped.own {
                hear(&stamped.frame);
            }
        }
        Ok(())
    }

    /// Waits for the end of a time, or for a frame of the device.
    fn wait(
        &mut self,
        until: Instant,
        ends: &mut dyn FnMut(&Frame) -> bool,
    ) -> Result<(), BusError> {
        while self.end.is_none() {
            let Some(stamped) = self.received(until)? else {
                self.note(Seen::Until(until));
                break;
            };
            self.note(Seen::Frame(stamped));
            if !stamped.own && ends(&stamped.frame) {
                break;
            }
        }
        Ok(())
    }

    /// The next frame that is complete by `until`. A device that is a program may have ended.
    fn received(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        match self.bus.recv(until) {
            Err(BusError::Ended(_)) => {
                let at = self.bus.now();
                self.note(Seen::Ended(at));
                Ok(None)
            }
            other => other,
        }
    }

    fn note(&mut self, seen: Seen) {
        if self.end.is_none() {
            self.end = self.oracle.see(&seen).err();
        }
        self.seen.push(seen);
    }
}

/// Plays a session on a bus, beside a model that the device may be like.
///
/// # Errors
/// Whatever the bus reports.
pub fn play(
    bus: &mut dyn Bus,
    blueprint: &Blueprint,
    model: Box<dyn Replica>,
    script: &Script<'_>,
) -> Result<Played, BusError> {
    let Some(surface) = blueprint.surface() else {
        return Player::new(bus, blueprint, model).play(script);
    };
    let nothing = Coverage::default();
    let source = match script {
        Script::Bytes(bytes) => explore::Source::Drawn(bytes, &nothing),
        Script::Steered(bytes, coverage) => explore::Source::Drawn(bytes, coverage),
        Script::Actions(actions) => explore::Source::Actions(actions),
    };
    let explore::Told { actions, seen, goals, tried } =
        explore::play(bus, blueprint, surface, &source)?;
    let (_, end) = explore::judge(blueprint, surface, model, &seen);
    let (session, followed) = (Session { actions }, Vec::new());
    Ok(Played { session, seen, end, goals, followed, tried })
}

/// Judges what was seen before with another model. Returns how far it goes, and what is wrong then:
/// to its end, where something that came before was to be explained by what follows.
pub fn judge(
    blueprint: &Blueprint,
    model: Box<dyn Replica>,
    seen: &[Seen],
) -> (usize, Option<End>) {
    if let Some(surface) = blueprint.surface() {
        return explore::judge(blueprint, surface, model, seen);
    }
    let mut oracle = Oracle::new(blueprint, model);
    for (place, one) in seen.iter().enumerate() {
        if let Err(end) = oracle.see(one) {
            return (place, Some(end));
        }
    }
    (seen.len(), oracle.unexplained())
}

/// The state of the network management, for people.
pub fn state_name(state: NmtStateKey) -> String {
    NmtState(state).to_string()
}
