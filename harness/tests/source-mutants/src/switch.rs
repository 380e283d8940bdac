//! Which mutant is switched on. This file is copied into the scratch workspace as a module of
//! `canopen`; here it is text only.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::sync::{LazyLock, Mutex};

static CHOSEN: LazyLock<u32> = LazyLock::new(|| {
    let id = std::env::var("SOURCE_MUTANT").ok();
    id.and_then(|id| id.parse().ok()).unwrap_or(u32::MAX)
});

/// Where to note the mutants whose place was reached.
static REACHED: LazyLock<Option<Mutex<(BTreeSet<u32>, File)>>> = LazyLock::new(|| {
    let path = std::env::var("SOURCE_MUTANTS_REACHED").ok()?;
    let file = OpenOptions::new().create(true).append(true).open(path).ok()?;
    Some(Mutex::new((BTreeSet::new(), file)))
});

thread_local! {
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Whether mutant `id` acts. Codecs are used by the tester as well: mutants act in devices only.
#[inline]
pub fn mutant(id: u32) -> bool {
    if REACHED.is_some() {
        reached(id);
    }
    *CHOSEN == id && DEPTH.get() > 0
}

#[cold]
fn reached(id: u32) {
    let Some(reached) = REACHED.as_ref().filter(|_| DEPTH.get() > 0) else { return };
    let (ids, file) = &mut *reached.lock().unwrap();
    if ids.insert(id) {
        writeln!(file, "{id}").unwrap();
    }
}

/// As long as it lives, this thread does the work of a device.
pub struct OnDevice(());

impl OnDevice {
    /// The device begins to work.
    pub fn begin() -> Self {
        DEPTH.set(DEPTH.get() + 1);
        Self(())
    }
}

impl Drop for OnDevice {
    fn drop(&mut self) {
        DEPTH.set(DEPTH.get() - 1);
    }
}
