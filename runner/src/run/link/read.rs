//! Reads a device's identity and versions, with patience.

use canopen::sdo::Failure;
use canopen::{Abort, BusError, DataType, Mux, Value};
use reports::{Identity, Versions};

use super::sdo;
use super::trace::Link;
use crate::dut::Dut;
use crate::run::policy::Policy;

/// The values of 1000h and 1018h.
pub fn identity(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Identity, BusError> {
    let mut read = |mux| read_number(link, policy, dut.node, mux);
    Ok(Identity {
        device_type: read(Mux::new(0x1000, 0))?,
        vendor: read(Mux::new(0x1018, 1))?,
        product: read(Mux::new(0x1018, 2))?,
        revision: read(Mux::new(0x1018, 3))?,
        serial: read(Mux::new(0x1018, 4))?,
    })
}

/// The values of 1008h, 1009h and 100Ah, as far as the data sheet has them.
pub(in crate::run) fn versions(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
) -> Result<Versions, BusError> {
    let mut read = |index| match dut.eds.object(index) {
        Some(_) => read_text(link, policy, dut.node, Mux::new(index, 0)),
        None => Ok(None),
    };
    Ok(Versions { name: read(0x1008)?, hardware: read(0x1009)?, software: read(0x100A)? })
}

/// The number of 32 bits at `mux`, when there is one.
pub fn read_number(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<u32>, BusError> {
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    let value = told.ok().and_then(|data| DataType::UNSIGNED32.decode(&data).ok());
    Ok(value.as_ref().and_then(Value::as_int).and_then(|number| number.try_into().ok()))
}

/// Whether the device answers for `mux` otherwise than that there is nothing.
pub fn exists(link: &mut Link, policy: &Policy, node: u8, mux: Mux) -> Result<bool, BusError> {
    let absent = |failure: &Failure| {
        matches!(failure, Failure::Aborted(Abort::NO_OBJECT | Abort::NO_SUB_INDEX))
    };
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    Ok(!told.as_ref().is_err_and(absent))
}

/// The text at `mux`, when there is one.
pub fn read_text(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<String>, BusError> {
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    Ok(told.ok().and_then(|data| String::from_utf8(data).ok()))
}
