//! The bench as it was before a case, and its way back.

use std::collections::BTreeMap;

use canopen::bench::POWER;
use canopen::{BenchError, Value};

use super::judge::Trouble;
use super::link::Link;

/// The values that stimuli had before a case set them.
#[derive(Clone, Debug, Default)]
pub(super) struct BenchSnapshot {
    before: BTreeMap<String, Value>,
    /// Whether the device is without supply.
    pub off: bool,
}

impl BenchSnapshot {
    /// Whether the case changed any.
    pub(super) fn any(&self) -> bool {
        self.off || !self.before.is_empty()
    }

    /// Sets a stimulus and remembers what it was.
    ///
    /// # Errors
    /// When the bench fails.
    pub(super) fn set(
        &mut self,
        link: &mut Link,
        name: &str,
        value: &Value,
    ) -> Result<(), Trouble> {
        if !self.before.contains_key(name) {
            // What cannot be read is left as the case leaves it.
            if let Ok(before) = bench(link)?.get(name) {
                self.before.insert(name.to_owned(), before);
            }
        }
        link.look_from_now()?;
        bench(link)?.set(name, value).map_err(failed)?;
        link.moved();
        if name == POWER {
            self.off = *value == Value::Text("off".to_owned());
        }
        Ok(())
    }

    /// Makes everything as it was before the case, the supply first.
    ///
    /// # Errors
    /// When the bench fails.
    pub(super) fn undo(&mut self, link: &mut Link) -> Result<(), BenchError> {
        let Some(bench) = link.bench() else { return Ok(()) };
        if std::mem::take(&mut self.off) {
            bench.set(POWER, &Value::Text("on".to_owned()))?;
        }
        // A device is tested with its supply on, whatever a case found.
        self.before.remove(POWER);
        while let Some((name, value)) = self.before.pop_first() {
            if bench.get(&name).as_ref() != Ok(&value) {
                bench.set(&name, &value)?;
            }
        }
        link.moved();
        Ok(())
    }
}

/// The bench around the device.
///
/// # Errors
/// When there is none.
pub(super) fn bench<'l>(link: &'l mut Link) -> Result<&'l mut dyn canopen::Bench, Trouble> {
    link.bench().ok_or_else(|| Trouble::Impossible("there is no bench".to_owned()))
}

/// The bench did not do what it was asked.
pub(super) fn failed(error: BenchError) -> Trouble {
    Trouble::Impossible(error.0)
}
