//! Outputs that are on before a run, which must stay as they are unless the user allows it.

use std::collections::BTreeMap;

use canopen::sdo::Failure;
use canopen::{BusError, Mux};

use crate::dut::Dut;
use crate::plan::show_bytes;
use crate::run::link::{Link, sdo};
use crate::run::policy::Policy;

/// The outputs of the device as it showed them before anything was sent but uploads.
#[derive(Debug, Default)]
pub(in crate::run) struct Outputs {
    /// Those that are on, with their values: not zero, and not what the data sheet gives a device
    /// that has just started.
    on: BTreeMap<Mux, Vec<u8>>,
    /// Those that the device does not show.
    hidden: Vec<Mux>,
}

impl Outputs {
    /// Looks at the outputs of a device that is protected from driving them, and keeps what moves
    /// them from being sent while one is on.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn look(
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
    ) -> Result<Self, BusError> {
        let mut outputs = Self::default();
        for mux in dut.protection.outputs() {
            match sdo::upload_patiently(link, policy, dut.node, mux)?.result {
                Ok(value) if is_on(&value, dut, mux) => _ = outputs.on.insert(mux, value),
                Ok(_) => {}
                Err(_) if dut.eds.entry(mux).is_none() => {}
                Err(Failure::Aborted(_) | Failure::Violation { .. }) => outputs.hidden.push(mux),
                // A device that is not there is found out elsewhere.
                Err(Failure::Timeout) => break,
            }
        }
        dut.protection.hold(outputs.on.keys().next().map(|first| match outputs.on.len() {
            1 => format!("output {first} is on"),
            count => format!("{count} outputs are on, such as {first}"),
        }));
        Ok(outputs)
    }

    /// What was not tried because of it, and what cannot be kept still.
    pub(in crate::run) fn said(&self) -> Option<String> {
        let value = |(mux, value): (&Mux, &Vec<u8>)| format!("{mux} = {}", show_bytes(value));
        let on: Vec<String> = self.on.iter().map(value).collect();
        let on = (!on.is_empty()).then(|| {
            format!(
                "outputs were on before the run ({}): cases that could move them were not run. \
                 What the device does with them on NMT enter pre-operational and on SYNC could not \
                 be kept from it",
                on.join(", ")
            )
        });
        let hidden: Vec<String> = self.hidden.iter().map(Mux::to_string).collect();
        let hidden = (!hidden.is_empty()).then(|| {
            let hidden = hidden.join(", ");
            format!("the device does not show these outputs, which were taken for off: {hidden}")
        });
        let said: Vec<String> = on.into_iter().chain(hidden).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }

    /// Which of those that were on have another value now.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn moved(
        &self,
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
    ) -> Result<Option<String>, BusError> {
        let mut moved = Vec::new();
        for (mux, before) in &self.on {
            if let Ok(now) = sdo::upload_patiently(link, policy, dut.node, *mux)?.result
                && now != *before
            {
                let (before, now) = (show_bytes(before), show_bytes(&now));
                moved.push(format!("{mux} was {before}, is {now}"));
            }
        }
        let said = || format!("outputs did not stay as they were: {}", moved.join(", "));
        Ok((!moved.is_empty()).then(said))
    }
}

fn is_on(value: &[u8], dut: &Dut, mux: Mux) -> bool {
    let entry = dut.eds.entry(mux);
    let default = entry.and_then(|entry| entry.default_bytes(dut.node).ok());
    value.iter().any(|byte| *byte != 0) && default.is_none_or(|default| default != value)
}
