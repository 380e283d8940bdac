//! All frames of a session, and the phase of each.

use std::cell::RefCell;
use std::time::Duration;

use canopen::{Frame, Instant, Stamped};
use reference_devices::change::Deviation;
use reports::{Event, Outcome};
use runner::plan::Instance;
use runner::run::{Ending, Observer, Shown};

use super::super::trial::{Clean, Wanted, observed};
use crate::exit::Refused;

/// A session from power-on to its end.
pub(super) struct Recording {
    /// The instances to run.
    pub instances: Vec<Instance>,
    /// The frames before the first case, then those of each instance in the order in which they
    /// ran.
    pub parts: Vec<Recorded>,
    pub ending: Ending,
}

/// An instance as it ran, or what came before the first one.
#[derive(Default)]
pub(super) struct Recorded {
    /// Its name, with its suite; empty before the first case.
    pub name: String,
    pub begun: Instant,
    pub frames: Vec<(Moment, Stamped)>,
    /// `None` before the first case.
    pub outcome: Option<Outcome>,
    pub shown: Shown,
}

/// The phase in which a frame arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Moment {
    /// Before the setup or the first case, while the device is settled or identified.
    #[default]
    Settling,
    Setup,
    /// The step at this place.
    Step(usize),
    /// `finally`, and setting back.
    After,
}

/// Records a session while it runs.
struct Recorder(RefCell<(Moment, Vec<Recorded>)>);

impl Recording {
    /// Records a deviating device while the selected cases run.
    ///
    /// # Errors
    /// When the device cannot be built, or a case contradicts its data sheet.
    pub(super) fn of(
        clean: &Clean,
        deviation: Deviation,
        wanted: &Wanted,
    ) -> Result<Self, Refused> {
        let (target, plan) = clean.prepared(deviation, wanted)?;
        let before = vec![Recorded::default()];
        let recorder = Recorder(RefCell::new((Moment::default(), before)));
        let ending = observed(clean.library, &plan, &target, &recorder, &mut |_| ())?;
        let (_, parts) = recorder.0.into_inner();
        Ok(Self { instances: plan.instances, parts, ending })
    }

    /// The instances that ran.
    pub(super) fn cases(&self) -> &[Recorded] {
        &self.parts[1..]
    }

    /// The instance of that name, as it was planned.
    pub(super) fn instance(&self, name: &str) -> Option<&Instance> {
        self.instances.iter().find(|instance| instance.name() == name)
    }
}

impl Recorded {
    /// Whether something is held against the device.
    pub(super) fn notices(&self) -> bool {
        self.outcome.as_ref().is_some_and(Outcome::holds_against_device)
    }

    /// The frame at that place, and whether the tester sent it.
    pub(super) fn sent(&self, place: usize) -> Option<(bool, Frame)> {
        self.frames.get(place).map(|(_, seen)| (seen.own, seen.frame))
    }

    /// How long after the case began it came.
    pub(super) fn after(&self, place: usize) -> Option<Duration> {
        self.frames.get(place).map(|(_, seen)| seen.at.since(self.begun))
    }
}

impl Observer for Recorder {
    fn goes_on(&self) -> bool {
        true
    }

    fn frame(&self, frame: &Stamped) {
        self.last(|moment, last| last.frames.push((*moment, *frame)));
    }

    fn event(&self, event: &Event) {
        match event {
            Event::CaseStarted(started) => {
                let (moment, parts) = &mut *self.0.borrow_mut();
                *moment = Moment::Settling;
                let (name, begun) = (started.name(), started.at);
                parts.push(Recorded { name, begun, ..Recorded::default() });
            }
            Event::CaseEnded(ended) => {
                self.last(|_, last| last.outcome = Some(ended.outcome.clone()));
            }
            _ => {}
        }
    }

    fn case_begins(&self) {
        self.last(|moment, _| *moment = Moment::Setup);
    }

    fn step_begins(&self, step: usize, _: Instant) {
        self.last(|moment, _| *moment = Moment::Step(step));
    }

    fn steps_over(&self) {
        self.last(|moment, _| *moment = Moment::After);
    }

    fn shows(&self, shown: Shown) {
        self.last(|_, last| last.shown = shown);
    }
}

impl Recorder {
    fn last(&self, set: impl FnOnce(&mut Moment, &mut Recorded)) {
        let (moment, parts) = &mut *self.0.borrow_mut();
        set(moment, parts.last_mut().expect("what comes before the first case"));
    }
}
