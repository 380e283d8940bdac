//! The step that changes the other node of the bus.

use super::judge::{Judgement, Trouble};
use super::run::Steps;
use crate::protect::Deed;
use crate::suite::literal::show_time;
use crate::suite::step::PartnerStep;

impl Steps<'_, '_> {
    /// Sets how often the other node sends its heartbeat. Where it does not let that be set, the
    /// case says nothing about the device.
    pub(super) fn partner(&mut self, partner: &PartnerStep) -> Judgement {
        let Some(other) = &self.dut.partner else {
            return Err(Trouble::Unjudged("there is no other node on the bus".to_owned()));
        };
        if let Some(why) = self.dut.protection.refuses(Deed::Partner) {
            return Err(Trouble::Unjudged(why));
        }
        let time = self.time(&partner.heartbeat)?;
        let period = u16::try_from(time.as_millis()).map_err(|_| {
            Trouble::Impossible(format!("a heartbeat every {} is none", show_time(time)))
        })?;
        let (link, undo) = (&mut *self.link, self.undo.of_partner());
        let set = self.partner.send_heartbeat(link, self.policy, other, undo, period)?;
        set.map(|()| None).map_err(Trouble::Unjudged)
    }
}
