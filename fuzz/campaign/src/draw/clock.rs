//! Plans about TIME and the clock that it sets.

use canopen::nmt::Service;
use canopen::sdo::Request;
use canopen::{Mux, timestamp};

use super::values::ANY_ID;
use super::{Draw, Scene};
use crate::action::{Action, Kind};

const TIME: Mux = Mux::new(0x1012, 0);
const CONSUMES: u32 = 1 << 31;
const PRODUCES: u32 = 1 << 30;

impl Draw<'_> {
    /// Time stamps that set the clock, others that do not, and a look at it.
    pub(super) fn whole_time(&mut self, scene: Scene<'_>) -> Option<Action> {
        let clock = self.blueprint.settings().clock_object?;
        scene.od.entry(TIME).filter(|entry| entry.access.writable())?;
        let present = scene.od.int(TIME)? as u32 & ANY_ID;
        let id = if present == 0 { u32::from(timestamp::COB_ID) } else { present };
        let uses = self.pick(&[CONSUMES, CONSUMES, CONSUMES | PRODUCES])?;
        self.plan_write(Kind::ConfigureSync, TIME, &(id | uses).to_le_bytes());
        for _ in 0..2 + self.below(3) {
            let kind = if self.chance(40) { Kind::TimeWrong } else { Kind::Time };
            let frame = self.time_stamp(kind, scene)?;
            self.passes(kind, vec![frame], 3_000);
            match self.below(6) {
                0 => self.plan_state(Service::STOP),
                1 => self.plan_state(Service::START),
                2 => self.plan_state(Service::ENTER_PRE_OPERATIONAL),
                _ => {}
            }
            if self.chance(60) {
                let look = self.asks(Kind::Upload, Request::Upload(clock));
                self.plan(Some(look));
            }
        }
        self.plan_state(Service::ENTER_PRE_OPERATIONAL);
        let look = self.asks(Kind::Upload, Request::Upload(clock));
        self.plan(Some(look));
        self.planned.pop_front()
    }
}
