//! A first look at a device: what its data sheet leaves open, and what somebody has stored in it.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::eds::{Eds, Term};
use canopen::sdo::{Client, Next, RESPONSE_COB_ID, Request};
use canopen::{Bus, BusError, Frame, Mux};
use reference_devices::stack::NodeSettings;

use crate::surface::FIRST_OF_APPLICATION;

/// The values of a device, as it told them.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// By address.
    pub values: BTreeMap<Mux, Vec<u8>>,
    /// Whether an error is present or was.
    pub errors: bool,
}

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_millis(300);
/// After so many requests in a row without an answer, the device is gone.
const SILENCE: u32 = 4;
const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);
const HISTORY: Mux = Mux::new(0x1003, 0);

/// Reads what can be read, but for what the data sheet says not to read in passing.
///
/// # Errors
/// Whatever the bus reports; and when the device falls silent.
pub fn look(bus: &mut dyn Bus, eds: &Eds, node: u8) -> Result<Look, BusError> {
    let (mut look, mut silent) = (Look::default(), 0);
    let objects = eds.objects.iter().filter(|object| object.flags.unwrap_or_default() & 2 == 0);
    let entries = objects.flat_map(|object| &object.entries);
    for entry in entries.filter(|entry| entry.access.readable()) {
        match upload(bus, node, entry.mux)? {
            Some(value) => {
                silent = 0;
                look.values.extend(value.map(|value| (entry.mux, value)));
            }
            None => silent += 1,
        }
        if silent >= SILENCE {
            return Err(BusError::Io(format!("node {node} does not answer any more")));
        }
    }
    let is_set = |mux| look.values.get(&mux).is_some_and(|value| value.iter().any(|it| *it != 0));
    look.errors = is_set(ERROR_REGISTER) || is_set(HISTORY);
    Ok(look)
}

/// The value of an object; `Some(None)` when the device refuses, `None` when it does not answer.
fn upload(bus: &mut dyn Bus, node: u8, mux: Mux) -> Result<Option<Option<Vec<u8>>>, BusError> {
    let (mut client, first) = Client::upload(mux);
    let mut requests = vec![first];
    loop {
        for request in requests {
            bus.send(&request.frame(node))?;
        }
        let Some(answer) = answer(bus, node)? else {
            let abort = Request::Abort(mux, canopen::Abort::TIMEOUT);
            bus.send(&abort.frame(node))?;
            return Ok(None);
        };
        let Ok(answer) = client.decode(&answer.data) else { return Ok(Some(None)) };
        match client.step(answer) {
            Next::Send(next, more) => (client, requests) = (next, more),
            Next::Done(value, _) => return Ok(Some(Some(value))),
            Next::Failed(..) => return Ok(Some(None)),
        }
    }
}

fn answer(bus: &mut dyn Bus, node: u8) -> Result<Option<Frame>, BusError> {
    let until = bus.now() + PATIENCE;
    while let Some(seen) = bus.recv(until)? {
        if !seen.own && seen.frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node)) {
            return Ok(Some(seen.frame));
        }
    }
    Ok(None)
}

impl Look {
    /// The data sheet and the settings of a device with these values: what the application shows,
    /// texts that the data sheet leaves out, and parameters that somebody has stored.
    #[must_use]
    pub fn amend(&self, eds: &Eds, node: u8, settings: &NodeSettings) -> (Eds, NodeSettings) {
        let (mut eds, mut settings) = (eds.clone(), settings.clone());
        for entry in eds.objects.iter_mut().flat_map(|object| &mut object.entries) {
            let Some(bytes) = self.values.get(&entry.mux) else { continue };
            let Ok(value) = entry.data_type.decode(bytes) else { continue };
            let is_given = entry.default.is_some();
            let of_application = entry.mux.index >= FIRST_OF_APPLICATION;
            if of_application || !is_given && !STATES.contains(&entry.mux.index) {
                entry.default = Some(Term::fixed(value));
            } else if entry.access.writable()
                && !STATES.contains(&entry.mux.index)
                && let Some(number) = value.as_int().and_then(|it| i64::try_from(it).ok())
                && entry.default_bytes(node).is_ok_and(|default| default != *bytes)
            {
                settings.stored.insert(entry.mux, number);
            }
        }
        (eds, settings)
    }
}

/// Objects that show a state or take a command, and keep no value.
const STATES: [u16; 6] = [0x1001, 0x1002, 0x1003, 0x1010, 0x1011, 0x1013];
