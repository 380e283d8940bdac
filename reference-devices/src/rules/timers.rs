//! Periods and deadlines.

use canopen::Instant;

use super::Rules;

/// A period or a deadline of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timer {
    /// Of the heartbeat producer, 1017h.
    Heartbeat,
    /// Of the SYNC producer, 1006h.
    Sync,
    /// Event timer of a TPDO.
    Event,
    /// Inhibit time of a TPDO.
    Inhibit,
    /// Consumer time of a node, 1016h.
    HeartbeatConsumer,
    /// Event time of an RPDO.
    Rpdo,
    /// Of an SDO transfer that the client does not continue.
    SdoServer,
}

decisions! {
    /// The decisions about time (CiA 301, 7.5.2).
    pub TimerDecision of Rules, otherwise [DEVIATIONS];

    /// Each period and each deadline ends when it is over, regardless of the others.
    fn elapsed(&self, _timer: Timer, due: Instant, now: Instant) -> bool {
        due <= now
    }
}

deviations! {
    DEVIATIONS of TimerDecision;

    "heartbeat-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::Heartbeat;
    "sync-with-any-timer" => elapsed: |_, timer, due, now| due <= now || timer == Timer::Sync;
    "event-timer-ends-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::Event;
    "inhibit-time-ends-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::Inhibit;
    "consumer-time-ends-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::HeartbeatConsumer;
    "rpdo-deadline-ends-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::Rpdo;
    "sdo-timeout-ends-with-any-timer" =>
        elapsed: |_, timer, due, now| due <= now || timer == Timer::SdoServer;
}
