//! The terminals, LEDs, switches and the key by their names on a bench (manual, chapters 5 and 6).

use canopen::{BenchError, Instant, Value};

use super::Drr460;
use super::model::bench::Surroundings;

impl Drr460 {
    /// The names that can be set and observed.
    pub(super) fn names() -> impl Iterator<Item = &'static str> {
        Surroundings::names().chain(SEEN)
    }

    /// Takes a stimulus.
    ///
    /// # Errors
    /// When there is none of that name, or it does not take the value.
    pub(super) fn set(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
    ) -> Result<(), BenchError> {
        if SEEN.contains(&name) {
            return Err(BenchError(format!("{name} is what the device does, it cannot be set")));
        }
        let before = self.around;
        self.around.set(name, value)?;
        let moved = self.around.switches != before.switches;
        self.switched |= name.starts_with(SWITCHES);
        self.restarts = moved && self.rules.switches_act_at_once();
        self.panel.press(now, self.around.key, &self.rules);
        if self.around.bus != before.bus {
            self.overflow_ends = self.around.bus.ends(now);
        }
        Ok(())
    }

    /// The value seen on the bench: of a stimulus, the value that was set; of a terminal or an LED,
    /// its present state.
    pub(super) fn see(&self, name: &str) -> Option<Value> {
        let int = |number: i64| Some(Value::Int(number.into()));
        let terminals = self.terminals();
        match name {
            CONTACTS => {
                let [q1, q2] = terminals.contacts.map(i64::from);
                int(q1 | q2 << 1)
            }
            CURRENT => int(terminals.microamperes.round() as i64),
            RUN => int(self.panel.run.lit.into()),
            OUT1 => int(self.panel.outputs[0].lit.into()),
            OUT2 => int(self.panel.outputs[1].lit.into()),
            _ => self.around.observe(name),
        }
    }
}

const SWITCHES: &str = "dip-switch-";
const CONTACTS: &str = "digital-outputs-1";
const CURRENT: &str = "output-current-1";
const RUN: &str = "run-led";
const OUT1: &str = "output-led-1";
const OUT2: &str = "output-led-2";

const SEEN: [&str; 5] = [CONTACTS, CURRENT, RUN, OUT1, OUT2];
