//! Sessions in which a device works, for an exploration to tell again in other ways: what the
//! suites of its own do to a reference device.

use std::cell::RefCell;
use std::time::Duration;

use campaign::{Action, Blueprint, Kind, Stimulus, Then};
use canopen::bench::POWER;
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Device, Frame, Instant, Stamped, VirtualBus, heartbeat, nmt};
use reports::Event;
use runner::dut::Dut;
use runner::plan::plan_cases;
use runner::run::{Observer, Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

use crate::exit::Refused;
use crate::target::{self, DEFAULT_BIT_RATE};

/// The sessions that the suites of the device itself make of a reference device.
///
/// # Errors
/// When a suite cannot be planned.
pub(in crate::commands) fn known(
    library: &Library,
    blueprint: &Blueprint,
    dut: &Dut,
    stop: &Stop,
) -> Result<Vec<Vec<Action>>, Refused> {
    let models = target::models(&dut.eds);
    let is_own = |suite: &str| !suite.starts_with("cia30");
    let plan = plan_cases(library, dut, &models, |it, _| is_own(it.name()), &mut |_| true)?;
    let device = blueprint.build([]);
    let device: Box<dyn Device> = match device {
        Some(device) => device,
        None => return Ok(Vec::new()),
    };
    let mut bus = VirtualBus::new(blueprint.settings().bit_rate);
    bus.attach_boxed(device);
    let tape = Tape { node: dut.node, ..Tape::default() };
    let undo = Undo::default();
    let session = Session {
        observer: &tape,
        ..Session::new(
            &plan,
            &library.register,
            dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE),
            stop,
            &undo,
        )
    };
    session.run(&mut bus, &mut |_| ());
    Ok(tape.stories.into_inner())
}

/// Writes down what the cases do.
#[derive(Default)]
struct Tape {
    node: u8,
    stories: RefCell<Vec<Vec<Action>>>,
    /// The case that runs, and when it did the last thing.
    open: RefCell<Option<(Vec<Action>, Instant)>>,
}

/// A pause that is one of the case, and not the time that a frame takes.
const PAUSE: Duration = Duration::from_millis(4);
/// What is longer is no story to begin with.
const MOST_ACTIONS: usize = 80;

impl Tape {
    fn add(&self, at: Instant, action: Option<Action>) {
        let mut open = self.open.borrow_mut();
        let Some((story, last)) = open.as_mut() else { return };
        let pause = at.since(*last);
        let looks = |action: &Action| action.does == Kind::Look;
        let again = action.as_ref().is_some_and(looks) && story.last().is_some_and(looks);
        if let Some(action) = action.filter(|_| !again) {
            if pause >= PAUSE && !story.is_empty() {
                story.push(Action::new(Kind::Wait, Vec::new(), Then::after(pause)));
            }
            story.push(action);
            *last = at;
        }
    }

    /// What a frame of the tester is.
    fn action(&self, frame: &Frame) -> Option<Action> {
        let id = frame.data_id()?;
        let node = u16::from(self.node);
        if id == nmt::COB_ID {
            let resets = matches!(frame.data.first(), Some(129 | 130));
            let boot = Then::answer(heartbeat::COB_ID + node);
            return Some(match resets {
                true => Action::new(Kind::NmtReset, vec![*frame], boot),
                false => Action::new(Kind::NmtState, vec![*frame], Then::Wait(1_000)),
            });
        }
        if id != REQUEST_COB_ID + node {
            return Some(Action::new(Kind::Rpdo, vec![*frame], Then::Wait(1_000)));
        }
        let does = match Request::decode(&frame.data).ok()? {
            Request::Download(mux, _) if mux.index == 0x1010 => Kind::Store,
            Request::Download(mux, _) if mux.index == 0x1011 => Kind::Restore,
            Request::Download(..) => Kind::Download,
            // Where the case reads something, a look sees more.
            Request::Upload(_) => return Some(Action::new(Kind::Look, Vec::new(), Then::Wait(0))),
            _ => return None,
        };
        Some(Action::new(does, vec![*frame], Then::answer(RESPONSE_COB_ID + node)))
    }
}

impl Observer for Tape {
    fn case_begins(&self) {
        *self.open.borrow_mut() = Some((Vec::new(), Instant::ZERO));
    }

    fn frame(&self, frame: &Stamped) {
        if frame.own {
            self.add(frame.at, self.action(&frame.frame));
        }
    }

    fn event(&self, event: &Event) {
        let Event::Stimulus(stimulus) = event else { return };
        let action = match (stimulus.name.as_str(), stimulus.value.as_str()) {
            (POWER, "\"off\"") => None,
            (POWER, _) => {
                let boot = Then::answer(heartbeat::COB_ID + u16::from(self.node));
                Some(Action::new(Kind::PowerCycle, Vec::new(), boot))
            }
            (name, value) => {
                // `12 (Ch)` and `"broken"` are for people.
                let value = value.split(' ').next().unwrap_or(value).trim_matches('"');
                let bench = Stimulus { name: name.into(), value: value.into() };
                let (frames, then) = (Vec::new(), Then::Wait(1_000));
                Some(Action { does: Kind::Stimulate, frames, bench: Some(bench), then })
            }
        };
        self.add(stimulus.at, action);
    }

    fn steps_over(&self) {
        let Some((story, _)) = self.open.borrow_mut().take() else { return };
        if (1..=MOST_ACTIONS).contains(&story.len()) {
            self.stories.borrow_mut().push(story);
        }
    }
}
