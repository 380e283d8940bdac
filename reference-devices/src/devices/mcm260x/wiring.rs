//! Terminals with several functions: on 2AD, 3AD and 4AD the phases of encoders are digital inputs,
//! and so are the analogue inputs (manual, 3.2.b to 3.2.d, 4.1.a and 4.1.b). The text does not say
//! at which terminals the encoders of 9AD are, so they have terminals of their own here.

use canopen::{BenchError, Dictionary, Instant, Value};

use super::Mcm260x;
use super::encoder::Motion;
use super::parameters::Table;
use crate::stack::{Behaviour, earlier};

/// The digital inputs that are the phases of an encoder, counted from 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phases {
    a: u32,
    pub(super) b: Option<u32>,
    pub(super) z: Option<u32>,
}

impl Phases {
    /// The phases of an encoder of a module with `inputs` digital inputs, those that it has.
    pub(super) fn of(place: usize, inputs: u32) -> Option<Self> {
        let (a, b, z) = *PHASES.get(place)?;
        let exists = |input: u32| Some(input).filter(|input| *input < inputs);
        Some(Self { a: exists(a)?, b: exists(b), z: exists(z) })
    }

    fn z_bit(self) -> i64 {
        self.z.map_or(0, bit)
    }

    fn all(self) -> i64 {
        bit(self.a) | self.b.map_or(0, bit) | self.z_bit()
    }

    /// The levels of the phases with a shaft at a place.
    fn levels(self, motion: Motion, place: i64) -> i64 {
        let (a, b) = Motion::phases(place);
        let of = |input: Option<u32>, level: bool| input.filter(|_| level).map_or(0, bit);
        of(Some(self.a), a) | of(self.b, b) | of(self.z, motion.index_at(place))
    }

    /// The place next to this one at which phases A and B have these levels; a phase without a
    /// terminal stays as it is. When both change at once, the shaft is taken to go on.
    fn place(self, from: i64, levels: i64) -> i64 {
        let (_, b) = Motion::phases(from);
        let wanted = (levels & bit(self.a) != 0, self.b.map_or(b, |b| levels & bit(b) != 0));
        [0, 1, -1]
            .map(|step| from + step)
            .into_iter()
            .find(|to| Motion::phases(*to) == wanted)
            .unwrap_or(from + 2)
    }
}

impl Mcm260x {
    /// The phases of an encoder that are digital inputs.
    pub(super) fn phases(&self, place: usize) -> Option<Phases> {
        let inputs = 8 * self.io.counts().digital_inputs as u32;
        Phases::of(self.rules.encoder_at(place), inputs).filter(|_| self.table == Table::Small)
    }

    /// A bench sets the levels of a block of digital inputs, and with them what else is there.
    ///
    /// # Errors
    /// When it is no block, or no levels.
    pub(super) fn set_levels(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        let before = self.levels();
        self.io.stimulate(now, name, value, od)?;
        let levels = self.levels();
        let changed = levels ^ before;
        for (place, input) in self.inputs.iter_mut().enumerate() {
            let terminal = analogue(self.table, self.rules.analogue_at(place));
            if let Some(terminal) = terminal.filter(|input| changed & bit(*input) != 0) {
                let high = levels & bit(terminal) != 0;
                input.connected.millivolts = if high { HIGH } else { 0.0 };
            }
        }
        for place in 0..self.encoders.len() {
            let phases = self.phases(place).filter(|phases| changed & phases.all() != 0);
            if let Some(phases) = phases.filter(|_| self.encoders[place].motion.millihertz == 0) {
                self.step(now, place, phases, (changed, levels));
            }
        }
        Ok(())
    }

    /// The levels of the phases of an encoder have changed, whose shaft stands.
    fn step(&mut self, now: Instant, place: usize, phases: Phases, (changed, levels): (i64, i64)) {
        let setup = self.setups[place].counting(self.rules.counts_in(self.state));
        let encoder = &mut self.encoders[place];
        let to = phases.place(encoder.motion.at(now), levels);
        encoder.motion.move_to(now, to);
        encoder.follow(now, setup, &self.rules);
        if changed & phases.z_bit() != 0 {
            encoder.motion.index_level = levels & phases.z_bit() != 0;
            if encoder.motion.index_level && encoder.motion.turn == 0 {
                encoder.see_index(setup, &self.rules);
            }
        }
    }

    /// A bench sets the voltage at an analogue input: a digital input at its terminal is on from
    /// 8 V on and off up to 4.3 V, and between them as it was.
    pub(super) fn set_voltage(&mut self, place: usize) {
        let millivolts = self.inputs.get(place).map(|input| input.connected.millivolts);
        let terminal = analogue(self.table, self.rules.analogue_at(place)).map(bit);
        let Some((terminal, millivolts)) = terminal.zip(millivolts) else { return };
        let before = self.levels();
        let levels = match self.rules.input_level(millivolts) {
            Some(true) => before | terminal,
            Some(false) => before & !terminal,
            None => before,
        };
        self.put_levels(before, levels);
    }

    /// The digital inputs show the phases of the shafts that do not turn too fast for them.
    pub(super) fn show_phases(&mut self, now: Instant) {
        let before = self.levels();
        let mut levels = before;
        for (place, encoder) in self.encoders.iter().enumerate() {
            if let Some(phases) =
                self.phases(place).filter(|_| encoder.motion.millihertz.abs() <= FAST)
            {
                let at = encoder.motion.at(now);
                levels = levels & !phases.all() | phases.levels(encoder.motion, at);
            }
        }
        self.put_levels(before, levels);
    }

    /// The next edge of a phase that a digital input shows.
    pub(super) fn next_phase(&self) -> Option<Instant> {
        let shown = |(place, motion): (usize, Motion)| {
            let shown = motion.millihertz.abs() <= FAST && self.phases(place).is_some();
            shown.then(|| motion.next_edge(self.now)).flatten()
        };
        let motions = self.encoders.iter().map(|encoder| encoder.motion).enumerate();
        motions.map(shown).fold(None, earlier)
    }

    /// The levels at all digital inputs.
    fn levels(&self) -> i64 {
        let blocks = 0..self.io.counts().digital_inputs;
        blocks.map(|block| self.io.digital_input(block) << (8 * block)).sum()
    }

    fn put_levels(&mut self, before: i64, levels: i64) {
        for block in 0..self.io.counts().digital_inputs {
            let of = |levels: i64| levels >> (8 * block) & 0xFF;
            if of(levels) != of(before) {
                self.io.put_digital_input(block, of(levels));
                self.changed = true;
            }
        }
    }
}

/// The digital input at the terminal of an analogue input, both counted from 0.
fn analogue(table: Table, place: usize) -> Option<u32> {
    (table == Table::Small).then_some(place as u32 + FIRST_ANALOGUE)
}

const fn bit(input: u32) -> i64 {
    1 << input
}

/// Phases A, B and Z of encoders 1 to 3.
const PHASES: [(u32, u32, u32); 3] = [(7, 6, 0), (4, 3, 9), (5, 8, 10)];
/// The digital input at the terminal of analogue input 1.
const FIRST_ANALOGUE: u32 = 1;
/// The millivolts of a level that is high.
const HIGH: f64 = 24_000.0;
/// Periods of phase A in 1000 s up to which a digital input sees each level, 0.5 ms long at least,
/// which is the unit of its filter.
const FAST: i64 = 1_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_lead_to_the_next_place_and_back() {
        let phases = Phases::of(0, 16).unwrap();
        let motion = Motion::default();
        for place in -5..5 {
            for to in [place - 1, place, place + 1] {
                assert_eq!(phases.place(place, phases.levels(motion, to)), to);
            }
        }
        assert_eq!(phases.levels(motion, 2), 0xC0);
        let counter = Phases::of(2, 8).unwrap();
        assert!(counter.b.is_none() && counter.z.is_none());
        assert_eq!([counter.place(0, 0x20), counter.place(1, 0)], [1, 0]);
    }
}
