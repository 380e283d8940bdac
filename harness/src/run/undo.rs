//! What a run changed in the device and has not set back yet.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use canopen::Mux;

use super::restore::Snapshot;
use crate::plan::show_bytes;

/// The objects that are not, or perhaps not, as they were before the run, with their values from
/// then.
#[derive(Debug, Default)]
pub struct Undo {
    left: RefCell<Snapshot>,
}

impl Undo {
    /// What is not set back.
    pub fn left(&self) -> BTreeMap<Mux, Vec<u8>> {
        self.left.borrow().values.clone()
    }

    /// What is not set back, in a sentence; `None` when everything is.
    pub fn said(&self) -> Option<String> {
        let left = self.left();
        let value = |(mux, value): (&Mux, &Vec<u8>)| format!("{mux} (was {})", show_bytes(value));
        let objects: Vec<String> = left.iter().map(value).collect();
        (!left.is_empty()).then(|| {
            let objects = objects.join(", ");
            format!("these objects may not be as they were before the run: {objects}")
        })
    }

    /// A case begins that may change what is in the snapshot. What an earlier case left changed is
    /// set back to the value from before that.
    pub(super) fn begin(&self, snapshot: &mut Snapshot) {
        for (mux, value) in &self.left.borrow().values {
            if let Some(now) = snapshot.values.get_mut(mux) {
                now.clone_from(value);
            }
        }
    }

    /// The case is over, and of its snapshot that is still changed.
    pub(super) fn end(&self, snapshot: &Snapshot, changed: &BTreeSet<Mux>) {
        let mut left = self.left.borrow_mut();
        for (mux, value) in &snapshot.values {
            match changed.contains(mux) {
                true => _ = left.values.entry(*mux).or_insert_with(|| value.clone()),
                false => _ = left.values.remove(mux),
            }
        }
    }

    /// Everything that is still changed.
    pub(super) fn snapshot(&self) -> Snapshot {
        self.left.borrow().clone()
    }
}
