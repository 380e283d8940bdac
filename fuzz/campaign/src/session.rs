//! A session: actions from a known state, on a device and beside a model of it.

use std::time::Duration;

use canopen::bench::POWER;
use canopen::{Bus, BusError, Frame, Instant, NmtState, Value};
use reference_devices::change::Replica;
use serde::{Deserialize, Serialize};

use crate::action::{Action, Kind, Then};
use crate::blueprint::Blueprint;
use crate::draw::Draw;
use crate::oracle::{End, Oracle, Seen, error_control};
use crate::talk::Open;

/// Actions, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Session {
    /// The actions.
    pub actions: Vec<Action>,
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
}

/// Where the actions of a session come from.
pub enum Script<'s> {
    /// Bytes of which they are drawn.
    Bytes(&'s [u8]),
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
}

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_millis(250);
/// How long a device may take to boot.
const BOOT: Duration = Duration::from_secs(3);
/// How long a frame of the tester may wait for the bus.
const ECHO: Duration = Duration::from_secs(1);
/// The time after the last action in which what is owed must come.
const REST: Duration = Duration::from_millis(200);

impl<'p> Player<'p> {
    /// A session on this bus with a device that may be like `model`.
    pub fn new(bus: &'p mut dyn Bus, blueprint: &'p Blueprint, model: Box<dyn Replica>) -> Self {
        let oracle = Oracle::new(blueprint, model);
        Self { bus, oracle, blueprint, seen: Vec::new(), end: None }
    }

    /// Plays the actions of a script until something is wrong, and to its end.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn play(mut self, script: &Script<'_>) -> Result<Played, BusError> {
        let (mut actions, mut goals) = (Vec::new(), Vec::new());
        self.begin()?;
        match script {
            Script::Actions(all) => {
                for action in *all {
                    if self.end.is_some() {
                        break;
                    }
                    actions.push(action.clone());
                    self.carry_out(action, &mut |_| ())?;
                }
            }
            Script::Bytes(bytes) => {
                let blueprint = self.blueprint;
                let mut draw = Draw::new(bytes, blueprint);
                while self.end.is_none() && actions.len() < LONGEST {
                    let model = self.oracle.model();
                    let (state, open) = (model.state(), draw.open());
                    let Some(action) = draw.next(model) else { break };
                    goals.push((state.0, open, action.does));
                    actions.push(action.clone());
                    self.carry_out(&action, &mut |frame| draw.hear(frame))?;
                }
            }
        }
        if self.end.is_none() {
            let until = self.bus.now() + REST;
            self.wait(until, &mut |_| false)?;
        }
        let Self { seen, end, oracle, .. } = self;
        let followed = oracle.followed().iter().copied().collect();
        Ok(Played { session: Session { actions }, seen, end, goals, followed })
    }

    fn begin(&mut self) -> Result<(), BusError> {
        let boot_up = error_control(self.blueprint.node());
        let until = self.bus.now() + BOOT;
        self.wait(until, &mut |frame| frame.data_id() == Some(boot_up))
    }

    fn carry_out(&mut self, action: &Action, hear: &mut dyn FnMut(&Frame)) -> Result<(), BusError> {
        if action.does == Kind::PowerCycle {
            self.power(false)?;
            self.power(true)?;
        }
        let boots = matches!(action.does, Kind::NmtReset | Kind::PowerCycle);
        let mut answers = 0;
        let mut early = |frame: &Frame| {
            if matches!(action.then, Then::Answers { id, .. } if frame.data_id() == Some(id)) {
                answers += 1;
            }
            hear(frame);
        };
        self.send(&action.frames, &mut early)?;
        match action.then {
            Then::Wait(0) => Ok(()),
            Then::Wait(micros) => {
                let until = self.bus.now() + Duration::from_micros(micros);
                self.wait(until, &mut |frame| {
                    hear(frame);
                    false
                })
            }
            Then::Answers { id, count } => {
                let until = self.bus.now() + if boots { BOOT } else { PATIENCE };
                if answers >= count {
                    return Ok(());
                }
                // A sub-block ends with its last segment, or with an abort.
                self.wait(until, &mut |frame| {
                    hear(frame);
                    let answer = frame.data_id() == Some(id);
                    answers += u16::from(answer);
                    let last = frame.data.first().is_some_and(|first| *first >= 0x80);
                    answer && (answers >= count || last)
                })
            }
        }
    }

    fn power(&mut self, on: bool) -> Result<(), BusError> {
        let Some(bench) = self.bus.bench() else { return Ok(()) };
        let value = Value::Text(if on { "on" } else { "off" }.to_owned());
        bench.set(POWER, &value).map_err(|why| BusError::Io(why.to_string()))?;
        let at = self.bus.now();
        self.note(Seen::Power(at, on));
        Ok(())
    }

    /// Sends frames, and waits until the last of them is on the bus.
    fn send(&mut self, frames: &[Frame], hear: &mut dyn FnMut(&Frame)) -> Result<(), BusError> {
        let mut sent = 0;
        for frame in frames {
            match self.bus.send(frame) {
                Ok(()) => sent += 1,
                // What is protected is left out.
                Err(BusError::Withheld(_)) => {}
                Err(error) => return Err(error),
            }
        }
        let until = self.bus.now() + ECHO;
        while sent > 0 && self.end.is_none() {
            let Some(stamped) = self.bus.recv(until)? else {
                return Err(BusError::Io("a frame was not sent within a second".to_owned()));
            };
            sent -= usize::from(stamped.own);
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
            let Some(stamped) = self.bus.recv(until)? else {
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

    fn note(&mut self, seen: Seen) {
        self.seen.push(seen);
        if self.end.is_none() {
            self.end = self.oracle.see(&seen).err();
        }
    }
}

/// Judges what was seen before with another model. Returns how far it goes, and what is wrong then.
pub fn judge(
    blueprint: &Blueprint,
    model: Box<dyn Replica>,
    seen: &[Seen],
) -> (usize, Option<End>) {
    let mut oracle = Oracle::new(blueprint, model);
    for (place, one) in seen.iter().enumerate() {
        if let Err(end) = oracle.see(one) {
            return (place, Some(end));
        }
    }
    (seen.len(), None)
}

/// The state of the network management, for people.
pub fn state_name(state: NmtStateKey) -> String {
    NmtState(state).to_string()
}
