//! How long a run waits, and how exact a bus can be.

use std::time::Duration;

/// Settings that no clause gives: how long to wait, how exact the bench is.
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// How long an SDO server may take to answer.
    pub sdo_timeout: Duration,
    /// How long a device may take to boot.
    pub boot_timeout: Duration,
    /// How long the wire must be idle for nothing to be in flight.
    pub quiet: Duration,
    /// The same after an NMT command when the wire was idle that long before it.
    pub quiet_after_command: Duration,
    /// How long a device may take to carry out an NMT command.
    pub change_of_state: Duration,
    /// How long it must be idle after the start of a node, for what the application sends to have
    /// come to rest.
    pub quiet_after_start: Duration,
    /// How long after a case with emergency messages: the one that ends an error may come late.
    pub quiet_after_emergency: Duration,
    /// How long after stimuli were set back: inputs have filters and averages.
    pub rest_after_stimuli: Duration,
    /// How late a frame may be because another one is on the wire.
    pub bus_slack: Duration,
    /// How much longer a device has for what a step waits for, since on a slow wire other frames
    /// are in front of it.
    pub slow_wire: Duration,
    /// How many times as long as a suite of a profile says the application of the device may take.
    pub patience: u32,
    /// The seed for choosing a sample of many.
    pub seed: u64,
    /// How often each case runs, at least once.
    pub repeat: u32,
    /// Whether every index is asked for where otherwise a sample is.
    pub every_index: bool,
    /// Whether steps are reported as they begin; otherwise those of a case that does not pass.
    pub every_step: bool,
}

impl Policy {
    /// The usual policy on a bus of that bit rate, in bit/s.
    pub fn at_bit_rate(bit_rate: u32) -> Self {
        /// The longest classical frame with 11-bit identifier, intermission included.
        const LONGEST_FRAME_BITS: u64 = 135;
        /// From this bit rate on, the times in suites leave room for other frames.
        const FAST: u64 = 125_000;
        /// As many frames may be in front of one.
        const IN_FRONT: u32 = 4;
        let frame =
            |bit_rate: u64| Duration::from_nanos(LONGEST_FRAME_BITS * 1_000_000_000 / bit_rate);
        let bus_slack = frame(bit_rate.into());
        Self {
            sdo_timeout: Duration::from_secs(1),
            boot_timeout: Duration::from_secs(10),
            quiet: Duration::from_millis(5),
            quiet_after_command: Duration::from_millis(2),
            change_of_state: Duration::from_millis(20),
            quiet_after_start: Duration::from_millis(50),
            quiet_after_emergency: Duration::from_millis(30),
            rest_after_stimuli: Duration::from_millis(100),
            bus_slack,
            slow_wire: bus_slack.saturating_sub(frame(FAST)) * IN_FRONT,
            patience: 1,
            seed: 1,
            repeat: 1,
            every_index: false,
            every_step: false,
        }
    }

    /// How late the tester may be for something that belongs to a window of that length.
    pub fn bears(&self, window: Duration) -> Duration {
        const ALWAYS: Duration = Duration::from_millis(5);
        // The frame itself, and one in front of it.
        self.bus_slack * 2 + ALWAYS.max(window / 10)
    }
}
