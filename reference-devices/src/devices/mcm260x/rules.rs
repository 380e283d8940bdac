//! Every decision of the module that a test can observe.

mod deviations;

use canopen::emcy::EmcyCode;
use canopen::{Abort, Instant, Mux, NmtState};

use super::encoder;
use super::indicators::{Pattern, Phase};
use super::parameters::Item;
use super::sensor::Wiring;
use crate::decisions::{Layers, in_code_alone};
use crate::devices::pixsys::emergency::Module;

/// All decisions of a module; clauses are those of its manual.
pub(crate) type Mcm260xRules = Layers<Decision>;

/// The content of an emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Diagnosis {
    pub(super) code: EmcyCode,
    pub(super) register: u8,
    pub(super) vendor: [u8; 5],
}

in_code_alone! { Diagnosis, Module, Phase, Wiring }

decisions! {
    /// The decisions. The default methods are a summary of what the manual says.
    pub(crate) Decision of Mcm260xRules, otherwise [
        deviations::DEVIATIONS,
        deviations::OF_PARAMETERS,
    ];

    /// A parameter is in force as it is written (chapters 6 to 8).
    fn parameter(&self, _item: Item, configured: i64) -> i64 {
        configured
    }

    /// Each channel has parameters of its own.
    fn channel(&self, _item: Item, place: usize) -> usize {
        place
    }

    /// Edges from one place of a shaft to another are counted as the setup of the encoder says.
    fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
        encoder::counts(mode, from, to)
    }

    /// The count goes round at its ends, and what it is after `counts` more.
    fn count(&self, count: i32, counts: i64) -> i32 {
        count.wrapping_add(counts as i32)
    }

    /// The count begins at 0 after power-on and reset node.
    fn count_at_start(&self, _last: i32) -> i32 {
        0
    }

    /// While a shaft turns, its counts are looked at for the TPDOs that map them (11.2.21).
    fn looks_while_turning(&self) -> bool {
        true
    }

    /// A new setup leaves the count as it is.
    fn count_in_new_setup(&self, count: i32) -> i32 {
        count
    }

    /// Phase Z leaves the count unchanged unless a load is pending.
    fn count_at_index(&self, count: i32) -> i32 {
        count
    }

    /// A loaded value is not part of the count in an interval (11.3.6).
    fn counted_by_loading(&self, _step: i64) -> i64 {
        0
    }

    /// The preset is one value, in 3002h and in its two words.
    fn preset_is_one_value(&self) -> bool {
        true
    }

    /// 6200h and 6411h keep what was written while an error sets the outputs (11.4.6).
    fn output_objects_stay(&self) -> bool {
        true
    }

    /// The state after the boot-up is one of the list (11.3.1).
    fn takes_boot_state(&self, state: u16) -> bool {
        matches!(state, 0 | 4 | 5 | 127)
    }

    /// The off-line time goes to 60000 ms (6.a), regardless of its sign.
    fn longest_offline_time(&self) -> u16 {
        60_000
    }

    /// A value beyond the limits of an analogue output is taken, and the output gives the end of
    /// its range.
    fn takes_beyond_limits(&self) -> bool {
        true
    }

    /// 3003h bit 0 loads the preset (9.2, 11.3.5).
    fn loads_now(&self, command: i64) -> bool {
        command & 1 != 0
    }

    /// 3003h bit 1 loads the preset at the next pulse of phase Z (9.2, 11.3.5).
    fn loads_at_index(&self, command: i64) -> bool {
        command & 2 != 0
    }

    /// Phase Z belongs to the setups A-B-Z.
    fn sees_index(&self, mode: i64) -> bool {
        matches!(mode, 3 | 4)
    }

    /// A command falls back to 0 when it has been carried out.
    fn command_left(&self, _command: i64, waits: bool) -> i64 {
        if waits { 2 } else { 0 }
    }

    /// 3004h has the counts of a second, 3005h those of 100 ms (11.3.6, 11.3.7).
    fn windows(&self, second: i64, tenth: i64) -> (i64, i64) {
        (second, tenth)
    }

    /// The preset has 32 bits, in 3002h or in two parameters (chapters 6 and 8, 11.3.4).
    fn preset(&self, high: i64, low: i64) -> i64 {
        high << 16 | low & 0xFFFF
    }

    /// A fault of memory or terminal has its bit in 4007h sub 1 (11.3.8).
    fn fault_flag(&self, bit: u8) -> u8 {
        bit
    }

    /// A fault of the terminal has its bit in 4007h sub 2 (11.3.8).
    fn terminal_flag(&self, bit: u8) -> u8 {
        bit
    }

    /// A board of another kind than at the last store command is another one (11.9).
    fn board_differs(&self, board: Module, stored: Module) -> bool {
        board.differs(stored)
    }

    /// A buffer that ran over is an error for a moment, with an end, and no mere event (11.9).
    fn overflow_lasts(&self) -> bool {
        true
    }

    /// A part of the memory that cannot be read is a configuration that does not coincide (11.9).
    fn reports_memory(&self) -> bool {
        true
    }

    /// Reset communication compares the board with the one before, as power-on does (11.9).
    fn reset_communication_compares_boards(&self) -> bool {
        true
    }

    /// So does reset node (11.9).
    fn reset_node_compares_boards(&self) -> bool {
        true
    }

    /// The board inside has the messages of a module (11.9).
    fn reports_board(&self) -> bool {
        true
    }

    /// An input out of range has a bit in 4007h (11.3.8).
    fn channel_flag(&self, place: usize) -> i64 {
        1 << (12 + place)
    }

    /// An input out of range is a diagnostic message (11.9): the channel and the number of
    /// chapter 12.
    fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
        let (channel, number) = (place as u8 + 1, place as u8 + 13);
        let vendor = [0x00, 0x07, 0x00, 0x80 | channel, number];
        Some(Diagnosis { code: EmcyCode(0xFF00), register: 0x81, vendor })
    }

    /// An input that is out of range for the `times`-th time since power-on is reported again
    /// (11.9).
    fn reports(&self, _times: u32) -> bool {
        true
    }

    /// Nothing is reported at power-on with the settings of delivery (11.9 has no code for it).
    fn announcement(&self) -> Option<Diagnosis> {
        None
    }

    /// A value that a parameter does not list is refused as such (11.3.1).
    fn refusal(&self) -> Abort {
        Abort::VALUE
    }

    /// "load" leaves the parameters as they are until the next reset (11.2.13).
    fn load_clears(&self) -> bool {
        false
    }

    /// A supply below 12 V less 15 % is too low (3.2, 11.3.8).
    fn supply_is_low(&self, volts: f64) -> bool {
        volts < 12.0 * 0.85
    }

    /// An analogue output of 0 to 10 V or 4 to 20 mA between its limits.
    fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
        if upper == lower { 0.0 } else { (digits - lower) as f64 / (upper - lower) as f64 }
    }

    /// A digital input is off up to 4.3 V and on from 8 V on (3.2); between them it stays as it
    /// was.
    fn input_level(&self, millivolts: f64) -> Option<bool> {
        match millivolts {
            ..=4300.0 => Some(false),
            8000.0.. => Some(true),
            _ => None,
        }
    }

    /// Each encoder has its phases at digital inputs of its own (4.1.a, 4.1.b).
    fn encoder_at(&self, place: usize) -> usize {
        place
    }

    /// Each analogue input is at a digital input of its own (4.1.a, 4.1.b).
    fn analogue_at(&self, place: usize) -> usize {
        place
    }

    /// Static outputs need the supply of their group (4.1).
    fn energised(&self, levels: i64, supplied: bool) -> i64 {
        if supplied { levels } else { 0 }
    }

    /// The RUN LED shows whether there is an error (chapter 10).
    fn led_shows(&self, error: bool) -> bool {
        error
    }

    /// Each state has a pattern of the RUN LED (chapters 9 and 10).
    fn run_led(&self, phase: Phase) -> Phase {
        phase
    }

    /// The flashes of a pattern follow each other at their own length, and the last ends it.
    fn run_pattern(&self, pattern: Pattern) -> Pattern {
        pattern
    }

    /// The COM LED is lit while the module communicates (5.2).
    fn com_led(&self, heard: bool) -> bool {
        heard
    }

    /// An input or output has an LED with its level (5.2).
    fn level_leds(&self, inputs: i64, outputs: i64) -> i64 {
        inputs | outputs
    }

    /// On models with inputs and outputs of their own the LEDs of the inputs come first (5.2).
    fn inputs_come_first(&self) -> bool {
        true
    }

    /// The LED of an analogue input that is enabled is lit (5.2).
    fn input_led(&self, off: bool, out_of_range: bool) -> (bool, bool) {
        (off, out_of_range)
    }

    /// The LED of an analogue output is lit while the output is active (5.2).
    fn output_led(&self, active: bool) -> bool {
        active
    }

    /// The display shows the flags of 4007h (chapter 12).
    fn displayed(&self, flags: i64) -> i64 {
        flags
    }

    /// The flags of 4007h show what is wrong now (11.3.8).
    fn flags(&self, _before: i64, now: i64) -> i64 {
        now
    }

    /// 9AD has a supply for each group of outputs, the others have one (4.1).
    fn group(&self, block: usize, of_each_block: bool) -> usize {
        if of_each_block { block } else { 0 }
    }

    /// The analogue output at a place of 6411h drives the terminals at the same place (11.4.10).
    fn output(&self, place: usize) -> usize {
        place
    }

    /// A preset is loaded on command, not as it is written (11.3.5).
    fn preset_waits_for_command(&self) -> bool {
        true
    }

    /// The preset that two words are (11.3.4).
    fn joined_words(&self, high: i64, low: i64) -> i64 {
        high << 16 | low & 0xFFFF
    }

    /// Each preset has words of its own (11.3.4).
    fn preset_place(&self, place: usize) -> usize {
        place
    }

    /// The intervals are those of a clock that runs while there is power, and begin anew with a
    /// start or not (11.3.6, 11.3.7).
    fn intervals_begin_with_the_start(&self) -> bool {
        false
    }

    /// With a start no interval has counts (11.3.6, 11.3.7).
    fn intervals_over_a_start(&self) -> bool {
        false
    }

    /// A command that waits for phase Z is forgotten with a start (11.3.5).
    fn waits_over_a_start(&self) -> bool {
        false
    }

    /// Counts after phase Z start from the preset (11.3.5).
    fn loaded_at(&self, index: i64, _to: i64) -> i64 {
        index
    }

    /// A new command takes the place of the last one (11.3.5).
    fn command_replaces_the_last(&self) -> bool {
        true
    }

    /// A setup is in force at once, also while the shaft turns (6.c, 8.d).
    fn takes_a_setup_while_turning(&self) -> bool {
        true
    }

    /// An input that is back in its range ends its error (11.9).
    fn ends(&self, _place: usize) -> bool {
        true
    }

    /// A sample counts that is near the value, above or below it (7.b, 8.b).
    fn is_near(&self, difference: f64, near: f64) -> bool {
        difference.abs() <= near
    }

    /// A new conversion frequency is in force at once. The sample that is under way may end in its
    /// time instead (7.b, 8.b).
    fn sample_under_way_ends(&self) -> bool {
        false
    }

    /// The time of rejection restarts after a sample that counts (7.b, 8.b).
    fn rejection_begins_anew(&self) -> bool {
        true
    }

    /// High word and low word of a preset (11.3.4).
    fn preset_words(&self, preset: i64) -> (i64, i64) {
        (preset >> 16, i64::from(preset as i16))
    }

    /// A value with two addresses is the same at both (11.3.1, 11.3.4, 11.4.18, 11.4.19).
    fn mirrors(&self, _written: Mux) -> bool {
        true
    }

    /// On Modbus nothing has come since the start.
    fn silent_since(&self, start: Instant, _heard: Option<Instant>) -> Instant {
        start
    }

    /// Encoders count in every state (11.3.3).
    fn counts_in(&self, _state: NmtState) -> bool {
        true
    }

    /// A manual choice is in force after a restart (3.3).
    fn choice_restarts(&self) -> bool {
        true
    }

    /// Parameters 8 and 12 concern a module that works with Modbus (chapter 6, a).
    fn works_with_modbus(&self, interface: i64) -> bool {
        interface != 0
    }

    /// A linear value ends at both limits unless it may leave them (8.b, parameters 38 to 41).
    fn within_limits(&self, share: f64) -> f64 {
        share.clamp(0.0, 1.0)
    }

    /// The unit of temperatures does not concern linear signals (7.b).
    fn linear_digits(&self, digits: f64, _degree: i64) -> f64 {
        digits
    }

    /// How far the limits of a linear input are apart (chapters 6 and 7).
    fn span(&self, lower: i64, upper: i64) -> i64 {
        upper - lower
    }

    /// Gain and offset belong to the value that is shown, not to the samples that it is made of, so
    /// that no sample is rejected for them (chapters 6 and 7).
    fn calibrates_samples(&self) -> bool {
        false
    }

    /// The gain is applied before the offset is added (chapters 6 and 7).
    fn calibrated(&self, digits: f64, gain: f64, offset: f64) -> f64 {
        digits * (1.0 + gain / 1000.0) + offset
    }

    /// The junction at the terminals is compensated from 0 to 50 degrees (7.b).
    fn junction_error(&self, terminals: f64) -> f64 {
        terminals - terminals.clamp(0.0, 50.0)
    }

    /// By which share of its full scale an input is off; 3.2 allows 0.2 %.
    fn input_error(&self) -> f64 {
        0.0
    }

    /// A broken or shorted sensor is out of range (7.b).
    fn wires(&self, _sensor: i64, wiring: Wiring) -> Wiring {
        wiring
    }

    /// The value is the average of the last samples (chapters 6 and 7).
    fn average(&self, sum: f64, samples: usize) -> f64 {
        sum / samples as f64
    }

    /// The first sample fills the average, so that it need not climb from zero (chapters 6 and 7).
    fn average_starts_full(&self) -> bool {
        true
    }

    /// The average of more samples than before begins with those that it had.
    fn kept_samples(&self, wanted: usize) -> usize {
        wanted
    }

    /// A sensor type that is written as it is leaves the average as it is (chapters 6 and 7).
    fn same_sensor_keeps_average(&self) -> bool {
        true
    }
}
