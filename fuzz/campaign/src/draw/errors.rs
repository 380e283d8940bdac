//! Plans about what goes wrong on the network: nodes that fall silent, masters that do, and errors
//! that come, wait to be told, and go.

use canopen::heartbeat::{ErrorControl, guarding_request};
use canopen::nmt::Service;
use canopen::sdo::Request;
use canopen::{Frame, Id, Mux, NmtState};

use super::values::OTHERS;
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};

const CONSUMER: u16 = 0x1016;
const HEARTBEAT: Mux = Mux::new(0x1017, 0);
const GUARD_TIME: Mux = Mux::new(0x100C, 0);
const LIFE_TIME_FACTOR: Mux = Mux::new(0x100D, 0);
const HISTORY: u16 = 0x1003;
const EMERGENCY: Mux = Mux::new(0x1014, 0);
const INHIBIT_TIME: Mux = Mux::new(0x1015, 0);
const BEHAVIOUR: Mux = Mux::new(0x1029, 1);
/// The states in which a node lives.
const STATES: [Service; 3] = [Service::START, Service::STOP, Service::ENTER_PRE_OPERATIONAL];

impl Draw<'_> {
    /// Another node is monitored, lives, falls silent and comes back, more than once.
    pub(super) fn whole_monitoring(&mut self, scene: Scene<'_>) -> Option<Action> {
        let kind = Kind::ConfigureErrorControl;
        let places = scene.od.entries_in(CONSUMER..=CONSUMER).len().checked_sub(1)?;
        let entry = Mux::new(CONSUMER, 1 + self.below(places.min(4)) as u8);
        scene.od.entry(entry).filter(|entry| entry.access.writable())?;
        let (node, time) = (self.pick(&OTHERS)?, self.pick(&[50_u16, 100, 200, 300])?);
        self.plan_write(kind, entry, &[0; 4]);
        self.plan_reaction(scene);
        let watched = u32::from(node) << 16 | u32::from(time);
        self.plan_write(kind, entry, &watched.to_le_bytes());
        self.plan_any_state();
        let time = u64::from(time) * 1000;
        for _ in 0..2 + self.below(3) {
            for _ in 0..=self.below(3) {
                self.plan_heartbeat(node, time / 2);
            }
            match self.below(10) {
                0..=5 => self.passes(Kind::Wait, Vec::new(), time + time / 10),
                6 => self.plan_any_state(),
                7 => self.plan_write(kind, entry, &watched.to_le_bytes()),
                8 => {
                    // What looks like a heartbeat is none.
                    let id = Id::extended(0x700 + u32::from(node));
                    let frame = Frame { id, ..Frame::new(0, [5]) };
                    self.passes(Kind::HeartbeatWrong, vec![frame], time / 2);
                }
                _ => {}
            }
            self.plan_question();
        }
        if self.chance(50) {
            self.plan_heartbeat(node, time / 2);
            self.plan_write(kind, entry, &[0; 4]);
            self.passes(Kind::Wait, Vec::new(), 2 * time);
            self.plan_question();
        }
        self.plan_to_read_errors();
        self.planned.pop_front()
    }

    /// A master guards the device, and falls silent.
    pub(super) fn whole_guarding(&mut self, scene: Scene<'_>) -> Option<Action> {
        let kind = Kind::ConfigureErrorControl;
        for mux in [HEARTBEAT, GUARD_TIME, LIFE_TIME_FACTOR] {
            scene.od.entry(mux).filter(|entry| entry.access.writable())?;
        }
        let (time, factor) = (self.pick(&[20_u16, 50, 100])?, self.pick(&[1_u8, 2, 3])?);
        self.plan_write(kind, HEARTBEAT, &[0; 2]);
        self.plan_reaction(scene);
        self.plan_write(kind, GUARD_TIME, &time.to_le_bytes());
        self.plan_write(kind, LIFE_TIME_FACTOR, &[factor]);
        self.plan_any_state();
        let life = u64::from(time) * u64::from(factor) * 1000;
        for _ in 0..2 + self.below(3) {
            for _ in 0..=self.below(2) {
                self.plan_guarding(life / 2);
            }
            match self.below(8) {
                0..=2 => self.passes(Kind::Wait, Vec::new(), life + life / 10),
                3 | 4 => self.plan_any_state(),
                5 => {
                    let other = self.pick(&[0_u16, 0, 100, 1000]).unwrap_or(0);
                    self.plan_write(kind, HEARTBEAT, &other.to_le_bytes());
                    self.plan_write(kind, HEARTBEAT, &[0; 2]);
                }
                _ => {}
            }
        }
        self.passes(Kind::Wait, Vec::new(), life + life / 10);
        self.plan_question();
        self.plan_to_read_errors();
        self.planned.pop_front()
    }

    /// RPDOs of a wrong length come and go, while what reports them is changed.
    pub(super) fn whole_errors(&mut self, scene: Scene<'_>) -> Option<Action> {
        let writable = |mux| scene.od.entry(mux).is_some_and(|entry| entry.access.writable());
        let inhibit = self.pick(&[0_u16, 100, 500, 1000])?;
        if writable(INHIBIT_TIME) {
            self.plan_write(Kind::ConfigureErrors, INHIBIT_TIME, &inhibit.to_le_bytes());
        }
        self.plan_state(Service::START);
        for _ in 0..4 + self.below(6) {
            let kind = if self.chance(60) { Kind::RpdoWrong } else { Kind::Rpdo };
            match self.below(12) {
                0..=6 => {
                    let frame = self.rpdo(kind, scene)?;
                    self.passes(kind, vec![frame], 1_500);
                }
                7 => {
                    let frame = self.sync(Kind::SyncWrong, scene)?;
                    self.passes(Kind::SyncWrong, vec![frame], 1_500);
                }
                8 => self.plan_write(Kind::ConfigureErrors, Mux::new(HISTORY, 0), &[0]),
                9 if writable(INHIBIT_TIME) => {
                    let other = self.pick(&[0_u16, 50, 500])?;
                    self.plan_write(Kind::ConfigureErrors, INHIBIT_TIME, &other.to_le_bytes());
                }
                10 if writable(EMERGENCY) => {
                    let present = scene.int(EMERGENCY.index, 0)? as u32 & !(1 << 31);
                    for cob in [present | 1 << 31, present] {
                        let pause = self.pick(&[1_500, 60_000])?;
                        self.plan_write(Kind::ConfigureErrors, EMERGENCY, &cob.to_le_bytes());
                        self.passes(Kind::Wait, Vec::new(), pause);
                    }
                }
                _ => self.passes(Kind::Wait, Vec::new(), u64::from(inhibit) * 110),
            }
        }
        self.passes(Kind::Wait, Vec::new(), u64::from(inhibit) * 400);
        if self.chance(20) {
            let kind = if self.chance(50) { Kind::PowerCycle } else { Kind::NmtReset };
            let reset = self.action(kind, scene);
            self.plan(reset);
        }
        self.plan_to_read_errors();
        let register = self.asks(Kind::Upload, Request::Upload(Mux::new(0x1001, 0)));
        self.plan(Some(register));
        self.planned.pop_front()
    }

    /// What the device does at an error of its communication, where it can be chosen.
    fn plan_reaction(&mut self, scene: Scene<'_>) {
        let there = scene.od.entry(BEHAVIOUR).is_some_and(|entry| entry.access.writable());
        if let Some(reaction) = self.pick(&[0, 1, 2]).filter(|_| there) {
            self.plan_write(Kind::ConfigureErrors, BEHAVIOUR, &[reaction]);
        }
    }

    fn plan_any_state(&mut self) {
        let service = self.pick(&STATES).unwrap_or(Service::START);
        self.plan_state(service);
    }

    fn plan_heartbeat(&mut self, node: u8, micros: u64) {
        let frame = ErrorControl::heartbeat(NmtState::OPERATIONAL).frame(node);
        self.passes(Kind::Heartbeat, vec![frame], micros);
    }

    fn plan_guarding(&mut self, micros: u64) {
        let request = guarding_request(self.node());
        self.plan(Some(Action::new(Kind::Guarding, vec![request], Then::Wait(micros))));
    }

    /// The device is asked for its state, at times.
    fn plan_question(&mut self) {
        if self.chance(40) {
            self.plan_guarding(2_000);
        }
    }
}
