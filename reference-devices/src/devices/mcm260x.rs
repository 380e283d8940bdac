//! The application of the MCM260X I/O modules: inputs and outputs of CiA 401 with what stands
//! before them, encoders and counters, sensors, error flags and LEDs. The data sheet says which of
//! these a module has.
//!
//! Between two events nothing is simulated: counts follow from the time, and an analogue input that
//! has settled takes no samples. While an encoder turns, its counts are looked at every 20 ms to
//! find out whether a TPDO has news; a reader, SYNC included, gets the counts of the moment.
//!
//! Modbus RTU is not built. A module that is set up for it is silent on CAN, and drives its outputs
//! like a module that hears nothing.

mod bench;
mod counts;
mod encoder;
mod flags;
mod indicators;
mod inside;
mod modbus;
mod parameters;
mod rules;
mod sampling;
mod sensor;
mod terminals;
mod wiring;

use std::sync::Arc;
use std::time::Duration;

use canopen::bench::Needs;
use canopen::eds::Eds;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};

use crate::decisions::{Otherwise, Set};
use crate::profiles::cia401::IoBlock;
use crate::stack::{Attachment, Behaviour, CommunicationEvent, Errors, earlier};

use super::pixsys::PixsysIo;
use bench::Surroundings;
use encoder::{Encoder, Setup, TENTH};
use flags::Faults;
use indicators::{Led, Pattern, Phase};
use inside::Inside;
use parameters::{COUNTS, DEFAULT_BIT_RATE, Item, Parameters, Table};
use rules::Mcm260xRules;
use sampling::AnalogueInput;
use wiring::Phases;

/// The decisions of the application that deviations can override.
pub(super) const DECISIONS: Set = Set::of::<rules::Decision>();

/// The application of an MCM260X module.
#[derive(Clone)]
pub(crate) struct Mcm260x {
    rules: Arc<Mcm260xRules>,
    table: Table,
    io: IoBlock,
    encoders: Vec<Encoder>,
    /// The settings of the encoders.
    setups: Vec<Setup>,
    /// The intervals of a second and of 100 ms are counted from here.
    intervals_from: Instant,
    /// When the next interval of 100 ms ends.
    next_tenth: Instant,
    inputs: Vec<AnalogueInput>,
    surroundings: Surroundings,
    inside: Inside,
    /// The interface that a person chose, until the network chooses.
    chosen: Option<i64>,
    wants_restart: bool,
    state: NmtState,
    /// Since when it works with Modbus.
    modbus: Option<Instant>,
    offline: bool,
    /// When it will be off-line there.
    next_offline: Option<Instant>,
    powered: bool,
    /// When the network last had to do with it.
    heard: Option<Instant>,
    run_led: Led,
    com_led: Led,
    input_leds: Vec<Led>,
    /// The analogue inputs out of range.
    faults: Vec<Faults>,
    /// Whether it has sent its announcement after power-on.
    announced: bool,
    /// When a digital input shows the next edge of an encoder.
    next_phase: Option<Instant>,
    /// When the objects were shown last.
    now: Instant,
    /// When the counts were last looked at for TPDOs with news.
    looked: Instant,
    /// Something happened since the last run.
    changed: bool,
}

impl Mcm260x {
    /// The module that keeps to its documents but for these decisions.
    pub(crate) fn with_deviations(eds: &Eds, otherwise: &[Otherwise<'_>]) -> Self {
        let rules = Mcm260xRules::default().with(otherwise);
        let table = Table::of(eds);
        let filter = table.address(Item::InputFilter, 0);
        let own =
            PixsysIo { filter, stop_is_failure: true, objects_stay: rules.output_objects_stay() };
        let io = IoBlock::new(eds, own.rules().with(otherwise));
        let encoders = (1..=8).filter(|sub| eds.entry(Mux::new(COUNTS, *sub)).is_some()).count();
        let mut encoders = vec![Encoder::default(); encoders];
        let inputs = 8 * io.counts().digital_inputs as u32;
        for (place, encoder) in encoders.iter_mut().enumerate() {
            let phases = Phases::of(place, inputs).filter(|_| table == Table::Small);
            encoder.without_b = phases.is_some_and(|phases| phases.b.is_none());
        }
        let inputs = io.counts().analogue_inputs;
        Self {
            rules: Arc::new(rules),
            table,
            io,
            setups: vec![Setup { mode: 0, preset: 0 }; encoders.len()],
            encoders,
            intervals_from: Instant::ZERO,
            next_tenth: Instant::ZERO + TENTH,
            inputs: vec![AnalogueInput::default(); inputs],
            surroundings: Surroundings::default(),
            inside: Inside::default(),
            chosen: None,
            wants_restart: false,
            state: NmtState::INITIALISING,
            modbus: None,
            offline: false,
            next_offline: None,
            powered: true,
            heard: None,
            run_led: Led::default(),
            com_led: Led::default(),
            input_leds: vec![Led::default(); inputs],
            faults: vec![Faults::default(); inputs],
            announced: false,
            next_phase: None,
            now: Instant::ZERO,
            looked: Instant::ZERO,
            changed: true,
        }
    }

    fn parameters<'a>(&'a self, od: &'a Dictionary) -> Parameters<'a> {
        Parameters { table: self.table, od, rules: &self.rules }
    }

    /// Gives a value that has two addresses to the other one.
    fn mirror(&self, written: Mux, od: &mut Dictionary) {
        let Some(value) = od.int(written).filter(|_| self.rules.mirrors(written)) else { return };
        for (one, other) in self.pairs() {
            if written == one || written == other {
                od.set_int(if written == one { other } else { one }, value);
            }
        }
        if !self.rules.preset_is_one_value() {
            return;
        }
        for place in 0..self.encoders.len() {
            let preset = Mux::new(PRESETS, self.rules.preset_place(place) as u8 + 1);
            let Some((high, low)) = self.table.preset(place) else { continue };
            if written == preset {
                let words = self.rules.preset_words(value);
                od.set_int(high, words.0);
                od.set_int(low, words.1);
            } else if written == high || written == low {
                let words = [high, low].map(|mux| od.int(mux).unwrap_or(0));
                od.set_int(preset, self.rules.joined_words(words[0], words[1]));
            }
        }
    }

    /// Whether the module does not take a value of 16 bits that its data sheet allows.
    fn refuses(&self, mux: Mux, value: u16, od: &Dictionary) -> bool {
        match mux {
            BOOT_STATE => !self.rules.takes_boot_state(value),
            OFFLINE_TIME => value > self.rules.longest_offline_time(),
            Mux { index: ANALOGUE_OUTPUTS, sub: 1.. } if !self.rules.takes_beyond_limits() => {
                let (one, other) = self.limits(usize::from(mux.sub) - 1, od);
                let limits = one.min(other)..=one.max(other);
                !limits.contains(&i64::from(value.cast_signed()))
            }
            _ => false,
        }
    }

    /// Addresses of the same value.
    fn pairs(&self) -> impl Iterator<Item = (Mux, Mux)> + '_ {
        let outputs = (0..self.io.counts().analogue_outputs).flat_map(|place| {
            [(Item::ErrorMode, 0x6443), (Item::ErrorValue, 0x6444)].map(|(item, index)| {
                Some((self.table.address(item, place)?, Mux::new(index, place as u8 + 1)))
            })
        });
        let filter = self.table.address(Item::InputFilter, 0).map(|mux| (mux, FILTER));
        outputs.flatten().chain(filter)
    }

    /// The analogue inputs take the samples that are due. Returns whether there is news.
    fn sample(&mut self, now: Instant, od: &mut Dictionary) -> bool {
        let mut news = self.changed;
        for (place, input) in self.inputs.iter_mut().enumerate() {
            let parameters = Parameters { table: self.table, od, rules: &self.rules };
            let before = (input.value, input.is_out_of_range());
            let terminals = self.surroundings.terminals;
            input.follow(now, self.changed, (place, terminals), parameters);
            if self.changed || (input.value, input.is_out_of_range()) != before {
                self.io.measure(place, input.value, od);
                news = true;
            }
        }
        news
    }

    /// Brings outputs and digital inputs up to date; where a terminal is both, the input sees what
    /// the output drives.
    fn connect(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.io.drive(od);
        if self.table == Table::Large {
            for block in 0..self.io.counts().digital_outputs {
                self.io.drive_inputs(block, self.driven(block));
            }
        }
        self.io.run(now, od, errors);
    }

    /// The levels that a block of digital outputs drives.
    fn driven(&self, block: usize) -> i64 {
        let has_groups = self.groups() > 0;
        let group = self.rules.group(block, self.table == Table::Large);
        let supplied = !has_groups || self.surroundings.groups[group.min(1)];
        self.rules.energised(self.io.digital_output(block), supplied)
    }

    /// The groups of static outputs; relays have none.
    fn groups(&self) -> usize {
        let counts = self.io.counts();
        let has_relays = counts.analogue_inputs > 0 && self.table == Table::Small;
        match (counts.digital_outputs, self.table) {
            (0, _) => 0,
            (blocks, Table::Large) => blocks,
            _ if has_relays => 0,
            _ => 1,
        }
    }

    fn light(&mut self, now: Instant, errors: &Errors) {
        let error = self.rules.led_shows(errors.register() != 0);
        let phase = match (self.modbus, self.state) {
            (_, NmtState::INITIALISING) => Phase::BootUp,
            (Some(_), _) => Phase::Modbus(self.offline),
            (None, state) => Phase::Node(state, error),
        };
        let pattern = indicators::pattern(self.rules.run_led(phase));
        self.run_led.show(now, self.rules.run_pattern(pattern));
        let heard = self.heard.is_some_and(|heard| now < heard + HEARD);
        let lit = self.rules.com_led(heard);
        self.com_led.show(now, if lit { Pattern::SteadyOn } else { Pattern::SteadyOff });
        for (led, input) in self.input_leds.iter_mut().zip(&self.inputs) {
            let pattern = match self.rules.input_led(input.is_off(), input.is_out_of_range()) {
                (true, _) => Pattern::SteadyOff,
                (_, true) => Pattern::Medium,
                _ => Pattern::SteadyOn,
            };
            led.show(now, pattern);
        }
    }
}

impl Behaviour for Mcm260x {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        if let Some(chosen) = self.chosen {
            od.set_int(INTERFACE, chosen);
        }
        self.io.reset(now, od);
        self.now = now;
        let compares = !self.powered || self.rules.reset_node_compares_boards();
        self.powered = true;
        self.inside.start();
        if compares {
            self.inside.compare_boards(&self.rules);
        }
        self.state = NmtState::INITIALISING;
        self.offline = false;
        self.heard = None;
        let interface = self.parameters(od).common(Item::Interface);
        self.modbus = self.rules.works_with_modbus(interface).then_some(now);
        if self.modbus.is_some() {
            self.take_offline_levels(od);
        }
        self.encoders.iter_mut().for_each(|encoder| encoder.restart(now, &self.rules));
        if self.rules.intervals_begin_with_the_start() {
            (self.intervals_from, self.next_tenth) = (now, now + TENTH);
        }
        self.inputs.iter_mut().for_each(AnalogueInput::restart);
        self.set_up(od);
        self.changed = true;
    }

    fn supply_lost(&mut self) {
        self.powered = false;
        self.announced = false;
        self.faults.fill(Faults::default());
        self.io.supply_lost();
        let leds = [&mut self.run_led, &mut self.com_led].into_iter().chain(&mut self.input_leds);
        leds.for_each(|led| *led = Led::default());
    }

    /// Parameters 1 to 3, which a start takes over, put the module on the bus: with its address, or
    /// not at all when it works with Modbus or at another bit rate (chapters 6 to 8).
    fn attachment(&self, od: &Dictionary) -> Attachment {
        let value = |item| self.parameters(od).common(item);
        match u8::try_from(value(Item::Address)) {
            _ if value(Item::Interface) != 0 => Attachment::Off,
            _ if value(Item::BitRate) != DEFAULT_BIT_RATE => Attachment::Off,
            Ok(address @ 1..=127) => Attachment::Node(address),
            _ => Attachment::AsIs,
        }
    }

    fn takes_restart(&mut self) -> bool {
        std::mem::take(&mut self.wants_restart)
    }

    fn show(&mut self, now: Instant, od: &mut Dictionary) {
        self.now = now;
        if self.changed || self.is_turning() {
            self.count(now, od);
        }
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        match *bytes {
            _ if mux.index == STORE && self.inside.stores_nothing() => Err(Abort::HARDWARE),
            // The range needs sixteen bits without a sign, which the parameters do not have.
            [low, high] if self.refuses(mux, u16::from_le_bytes([low, high]), od) => {
                Err(self.rules.refusal())
            }
            _ => Ok(()),
        }
    }

    fn refused(&mut self, _now: Instant, mux: Mux, _bytes: &[u8], _od: &mut Dictionary) {
        if mux.index == STORE && self.inside.stores_nothing() {
            self.inside.store();
            self.changed = true;
        }
    }

    fn written(&mut self, now: Instant, mux: Mux, od: &mut Dictionary) {
        self.changed = true;
        self.heard = Some(now);
        if mux.index == STORE {
            self.inside.store();
        }
        // `count` overwrites 3003h with the commands still open, so the new one is read first.
        let command = od.int(mux).unwrap_or(0);
        if mux == INTERFACE {
            self.chosen = None;
        }
        self.count(now, od);
        if mux.index == RESTORE && self.rules.load_clears() {
            (4..=14).for_each(|sub| od.set_int(Mux::new(INTERFACE.index, sub), 0));
        }
        self.mirror(mux, od);
        if !self.rules.same_sensor_keeps_average() {
            let of = |place| self.table.address(Item::SensorType, place) == Some(mux);
            let selected = self.inputs.iter_mut().enumerate().filter(|(place, _)| of(*place));
            selected.for_each(|(_, input)| input.select_again());
        }
        self.set_up(od);
        self.load_at_once(mux, od);
        let place = usize::from(mux.sub).wrapping_sub(1);
        if mux.index == COMMANDS
            && let Some((encoder, setup)) = self.encoders.get_mut(place).zip(self.setups.get(place))
        {
            let left = encoder.command(command, *setup, &self.rules);
            od.set_int(mux, left);
            self.show_counts(od);
        }
        self.io.written(now, mux, od);
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        self.heard = Some(self.now);
        self.changed = true;
        self.io.uploaded(mux, od);
    }

    fn event(&mut self, now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        self.changed = true;
        if event == CommunicationEvent::Reset && self.rules.reset_communication_compares_boards() {
            self.inside.compare_boards(&self.rules);
        }
        if let CommunicationEvent::Entered(state) = event {
            self.count(now, od);
            self.state = state;
            self.heard = Some(now);
        }
        self.io.event(now, event, od);
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.looked = now;
        if self.changed || self.now < now {
            self.show(now, od);
        }
        if self.next_phase.is_some_and(|due| due <= now) || self.changed {
            self.show_phases(now);
            self.next_phase = self.next_phase();
        }
        self.work_with_modbus(now, od);
        self.announce(errors);
        self.inside.report(now, errors, &self.rules);
        if self.sample(now, od) {
            self.show_errors(od, errors);
        }
        if self.changed || self.io.poll_at().is_some_and(|due| due <= now) {
            self.connect(now, od, errors);
        }
        self.light(now, errors);
        self.changed = false;
    }

    fn poll_at(&self) -> Option<Instant> {
        let inputs = self.inputs.iter().map(AnalogueInput::poll_at);
        let leds = self.input_leds.iter().chain([&self.run_led]).map(Led::poll_at);
        let heard = self.heard.map(|heard| heard + HEARD).filter(|_| self.com_led.lit);
        let rest = [
            self.next_look(),
            self.io.poll_at(),
            heard,
            self.next_offline,
            self.inside.poll_at(),
            self.next_phase,
        ];
        inputs.chain(leds).chain(rest).fold(None, earlier)
    }

    fn bench_names(&self) -> Vec<String> {
        self.names()
    }

    fn bench_needs(&self) -> Needs {
        self.needs()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        self.now = now;
        self.count(now, od);
        self.changed = true;
        self.set(now, name, value, od)
    }

    fn observe(&self, name: &str, od: &Dictionary) -> Option<Value> {
        if self.offers(name) { self.see(name, od) } else { None }
    }

    fn has_edges(&self, mux: Mux) -> bool {
        self.io.has_edges(mux)
    }

    fn holds_back(&self, mux: Mux, od: &Dictionary) -> bool {
        self.io.holds_back(mux, od)
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        self.io.triggers(mux, last, od)
    }
}

/// How long the COM LED shows that something was heard.
const HEARD: Duration = Duration::from_millis(100);

/// Store parameters.
const STORE: u16 = 0x1010;
/// Restore default parameters.
const RESTORE: u16 = 0x1011;
/// Communication interface.
const INTERFACE: Mux = Mux::new(0x3000, 1);
/// Modbus offline time.
const OFFLINE_TIME: Mux = Mux::new(0x3000, 8);
/// State after the boot-up.
const BOOT_STATE: Mux = Mux::new(0x2000, 4);
/// Digital input filter.
const FILTER: Mux = Mux::new(0x2000, 5);
/// Analogue outputs of 16 bits.
const ANALOGUE_OUTPUTS: u16 = 0x6411;
/// Encoder/counter presets.
const PRESETS: u16 = 0x3002;
/// Encoder/counter commands.
const COMMANDS: u16 = 0x3003;
/// Status and error flags of the module, and of its terminal.
const FLAGS: Mux = Mux::new(0x4007, 1);
const TERMINAL_FLAGS: Mux = Mux::new(0x4007, 2);

#[cfg(test)]
mod tests;
