//! Changes of a run in the device that are not set back yet: objects, node id and bit rate. On a
//! real bus they are also on disk, since a run that is killed sets nothing back.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

use canopen::Mux;
use reports::Identity;

use super::address::Address;
use super::restore::Snapshot;
use crate::plan::show_bytes;

/// A log of what is not set back, as a program keeps it that can be killed.
pub trait KeepChanges: Debug {
    /// Its name, when it holds something.
    fn name_if_written(&self) -> Option<String>;

    /// Records the identity of the device, which is found out before anything is changed.
    fn identify(&mut self, identity: Identity);

    /// Replaces what it holds. Where nothing is changed, there is no log.
    ///
    /// # Errors
    /// Why it cannot be written.
    fn write(&mut self, left: &Snapshot) -> Result<(), String>;
}

/// What is not, or perhaps not, as it was before the run, with the values of objects from then.
#[derive(Debug, Default)]
pub struct Undo {
    left: RefCell<Snapshot>,
    log: Option<RefCell<Box<dyn KeepChanges>>>,
    /// Why the log could not be written, which is reported once.
    failure: RefCell<Option<String>>,
    failed: Cell<bool>,
    /// The changes in the other node of the bus.
    partner: OnceCell<Box<Self>>,
}

impl Undo {
    /// With a log that outlives the run.
    pub fn kept_by(log: impl KeepChanges + 'static) -> Self {
        Self { log: Some(RefCell::new(Box::new(log))), ..Self::default() }
    }

    /// With that of the other node of the bus, which cases may change as well.
    #[must_use]
    pub fn beside(self, partner: Self) -> Self {
        Self { partner: OnceCell::from(Box::new(partner)), ..self }
    }

    /// The changes in the other node of the bus.
    pub fn of_partner(&self) -> &Self {
        self.partner.get_or_init(Box::default)
    }

    /// The values that are not set back.
    pub fn left(&self) -> BTreeMap<Mux, Vec<u8>> {
        self.left.borrow().values.clone()
    }

    /// What is not set back, in a sentence; `None` when nothing is left.
    pub fn said(&self) -> Option<String> {
        let left = self.left.borrow();
        let value = |(mux, value): (&Mux, &Vec<u8>)| format!("{mux} (was {})", show_bytes(value));
        let objects: Vec<String> = left.values.iter().map(value).collect();
        let objects = (!objects.is_empty()).then(|| {
            let objects = objects.join(", ");
            format!("these objects may not be as they were before the run: {objects}")
        });
        let address = match left.address {
            Address::AsBefore => None,
            Address::Configured => Some("its node id or bit rate may be another one"),
            Address::Stored => Some("another node id or bit rate may be active and stored"),
        };
        let said: Vec<String> = objects.into_iter().chain(address.map(str::to_owned)).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }

    /// Whether it is kept in a log, which is for a device that outlives the program.
    pub(in crate::run) const fn is_kept(&self) -> bool {
        self.log.is_some()
    }

    /// The name of the log, when it holds something that is not set back.
    pub fn log_name(&self) -> Option<String> {
        self.log.as_ref().and_then(|log| log.borrow().name_if_written())
    }

    /// Why the log could not be written, the first time that it could not.
    pub fn failure(&self) -> Option<String> {
        self.failure.take()
    }

    /// Records the identity of the device, which is found out before anything is changed.
    pub(in crate::run) fn identify(&self, identity: Identity) {
        if let Some(log) = &self.log {
            log.borrow_mut().identify(identity);
        }
    }

    /// A case begins that may change the objects in the snapshot. A change left by an earlier case
    /// is set back to the value from before that case. Returns whether that took time.
    pub(in crate::run) fn begin(&self, snapshot: &mut Snapshot) -> bool {
        let left = self.left.borrow();
        for (mux, value) in &left.values {
            if let Some(now) = snapshot.values.get_mut(mux) {
                now.clone_from(value);
            }
        }
        if snapshot.is_as_before() || self.log.is_none() {
            return false;
        }
        let mut all = left.clone();
        all.values.extend(snapshot.values.clone());
        all.stores |= snapshot.stores;
        all.address = all.address.max(snapshot.address);
        self.write(&all);
        true
    }

    /// The case is over. Of its snapshot these objects are still changed, and `address` is what it
    /// left of node id and bit rate.
    pub(in crate::run) fn end(
        &self,
        snapshot: &Snapshot,
        changed: &BTreeSet<Mux>,
        address: Address,
    ) {
        let mut left = self.left.borrow_mut();
        left.address = left.address.max(address);
        for (mux, value) in &snapshot.values {
            match changed.contains(mux) {
                true => _ = left.values.entry(*mux).or_insert_with(|| value.clone()),
                false => _ = left.values.remove(mux),
            }
        }
        left.stores = !left.values.is_empty() && (left.stores || snapshot.stores);
        if !snapshot.is_as_before() {
            self.write(&left);
        }
    }

    /// What is left of node id and bit rate.
    pub(in crate::run) fn address(&self) -> Address {
        self.left.borrow().address
    }

    /// Node id and bit rate are as before the run.
    pub(in crate::run) fn has_its_address(&self) {
        let mut left = self.left.borrow_mut();
        if std::mem::take(&mut left.address) != Address::AsBefore {
            self.write(&left);
        }
    }

    /// Everything that is still changed.
    pub(in crate::run) fn snapshot(&self) -> Snapshot {
        self.left.borrow().clone()
    }

    fn write(&self, all: &Snapshot) {
        let Some(log) = &self.log else { return };
        if let Err(why) = log.borrow_mut().write(all)
            && !self.failed.replace(true)
        {
            *self.failure.borrow_mut() = Some(why);
        }
    }
}
