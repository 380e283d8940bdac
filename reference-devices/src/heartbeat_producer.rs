//! The heartbeat producer (CiA 301, 7.2.8.2.2, object 1017h).

use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::{Instant, Mux, Outbox};

use crate::services::Base;
use crate::time::next_beat;

/// Tells the NMT state again and again.
#[derive(Debug, Default)]
pub(crate) struct HeartbeatProducer {
    period: Duration,
    due: Option<Instant>,
}

impl HeartbeatProducer {
    /// Takes the period from 1017h; the first heartbeat comes one period from now.
    pub(crate) fn configure(&mut self, now: Instant, base: &Base) {
        let configured = base.od.int(PERIOD).unwrap_or(0);
        self.period = base.rules.heartbeat_period(Duration::from_millis(configured as u64));
        self.due = (configured > 0).then(|| now + self.period);
    }

    /// Boot-up is done: the boot-up message counts as the first heartbeat.
    pub(crate) fn start(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        self.configure(now, base);
        if self.runs() {
            for _ in 0..base.rules.heartbeats_at_boot_up() {
                out.push(ErrorControl::heartbeat(base.state).frame(base.id));
            }
        }
    }

    pub(crate) fn stop(&mut self) {
        self.due = None;
    }

    /// Whether heartbeat is on, which rules out guarding.
    pub(crate) fn runs(&self) -> bool {
        self.due.is_some()
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        if let Some(due) = self.due.filter(|due| *due <= now) {
            out.push(ErrorControl::heartbeat(base.state).frame(base.id));
            self.due = Some(next_beat(due, self.period, now));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.due
    }
}

const PERIOD: Mux = Mux::new(0x1017, 0);
