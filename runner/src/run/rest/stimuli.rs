//! The state of the bench before a case, and its restoration.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use canopen::bench::{INTERFACE, POWER, moved_by};
use canopen::{Bench, BenchError, BusError, Value};
use reports::{Event, Stimulus};

use crate::run::link::Link;

/// The values that stimuli had before a case set them.
#[derive(Clone, Debug, Default)]
pub(in crate::run) struct BenchSnapshot {
    before: BTreeMap<String, Value>,
    /// Whether the device is without supply.
    pub off: bool,
}

impl BenchSnapshot {
    /// Whether the case changed any.
    pub(in crate::run) fn any(&self) -> bool {
        self.off || !self.before.is_empty()
    }

    /// Sets a stimulus, `shown` in reports, and remembers what it was, and what it moves. What
    /// comes meanwhile is for the next step.
    ///
    /// # Errors
    /// Whatever the bus reports; within, that of the bench.
    pub(in crate::run) fn set(
        &mut self,
        link: &mut Link,
        name: &str,
        value: &Value,
        shown: String,
    ) -> Result<Result<(), BenchError>, BusError> {
        if let Err(none) = bench(link) {
            return Ok(Err(none));
        }
        for name in [Some(name.to_owned()), moved_by(name)].into_iter().flatten() {
            // A stimulus that cannot be read is left as the case leaves it.
            if let Entry::Vacant(slot) = self.before.entry(name)
                && let Ok(before) = bench(link).and_then(|bench| bench.get(slot.key()))
            {
                slot.insert(before);
            }
        }
        link.catch_up()?;
        let stimulus = Stimulus {
            at: link.mark(),
            name: name.to_owned(),
            value: value.to_string(),
            says: shown,
        };
        link.emit(Event::Stimulus(stimulus));
        if let Err(error) = bench(link).and_then(|bench| bench.set(name, value)) {
            return Ok(Err(error));
        }
        link.moved();
        if name == POWER {
            self.off = *value == Value::Text("off".to_owned());
        }
        Ok(Ok(()))
    }

    /// Makes the device one that can be reached, as it was before the case: its supply first.
    ///
    /// # Errors
    /// When the bench fails.
    pub(in crate::run) fn undo_silence(&mut self, link: &mut Link) -> Result<(), BenchError> {
        if std::mem::take(&mut self.off) {
            set_back(link, POWER, &Value::Text("on".to_owned()))?;
        }
        // A device is tested with its supply on, even if a case found it off.
        self.before.remove(POWER);
        let interface = self.before.remove(INTERFACE);
        interface.map_or(Ok(false), |interface| set_back(link, INTERFACE, &interface))?;
        Ok(())
    }

    /// Makes everything else as it was before the case; whether something was otherwise. A
    /// frequency has a name before that of what it moves.
    ///
    /// # Errors
    /// When the bench fails.
    pub(in crate::run) fn undo(&mut self, link: &mut Link) -> Result<bool, BenchError> {
        let mut moved = false;
        while let Some((name, value)) = self.before.pop_first() {
            moved |= set_back(link, &name, &value)?;
        }
        Ok(moved)
    }
}

/// Sets a stimulus to what it was; whether it was another.
fn set_back(link: &mut Link, name: &str, value: &Value) -> Result<bool, BenchError> {
    let Some(bench) = link.bench() else { return Ok(false) };
    if bench.get(name).as_ref() == Ok(value) {
        return Ok(false);
    }
    bench.set(name, value)?;
    link.moved();
    Ok(true)
}

/// The bench around the device.
///
/// # Errors
/// When there is none.
pub(in crate::run) fn bench<'l>(link: &'l mut Link) -> Result<&'l mut dyn Bench, BenchError> {
    link.bench().ok_or_else(|| BenchError("there is no bench".to_owned()))
}
