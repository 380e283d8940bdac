//! The physical side: what a bench sets there instead of the process, and what it sees.

use canopen::{BenchError, Value};

use super::process::Process;
use super::{Drive, External, Sensed};

/// What was set.
#[derive(Clone, Debug, Default)]
pub(super) struct Stimuli {}

impl Stimuli {
    /// What the sensors tell.
    pub(super) fn sense(&self, process: &Process) -> Sensed {
        let main = (process.main * 10.0).round() as i64;
        Sensed {
            main,
            return_line: main,
            external: External::Reads(main),
            medium_level: 1000,
            mould_contents: 1000,
            ..Sensed::default()
        }
    }

    pub(super) fn names(&self) -> Vec<String> {
        Vec::new()
    }

    pub(super) fn set(&mut self, name: &str, _value: &Value) -> Result<(), BenchError> {
        Err(BenchError::unknown(name))
    }

    pub(super) fn observe(&self, _name: &str, _drive: Drive) -> Option<Value> {
        None
    }
}
