//! Waiting for a device to answer.

use canopen::heartbeat::{self, ErrorControl};
use canopen::sdo::Failure;
use canopen::{BusError, Mux};

use super::baseline::Baseline;
use crate::dut::Dut;
use crate::run::link::{Link, Patience, sdo};
use crate::run::policy::Policy;

/// Any device has it.
pub(super) const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);

/// Waits for a device to answer for the first time.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn first_answer(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
) -> Result<bool, BusError> {
    let mut patience = Patience::of(link, policy.boot_timeout);
    // A device that is starting hears no request: many short waits find it sooner than a long one.
    let mut eager = Policy { sdo_timeout: policy.sdo_timeout / 10, ..*policy };
    let mut refused = false;
    while patience.lasts(link)? {
        match sdo::upload(link, &eager, dut.node, DEVICE_TYPE)?.result {
            Ok(_) => return Ok(true),
            Err(failure) => refused = failure != Failure::Timeout,
        }
        // Poll often during boot; back off for a slow device.
        eager.sdo_timeout = policy.sdo_timeout.min(eager.sdo_timeout * 2);
        // A wrong answer that comes at once must not become a busy loop.
        let pause = link.mark() + policy.quiet;
        link.wait(pause)?;
    }
    // An abort or a malformed answer still proves that the device is alive.
    Ok(refused)
}

/// Waits until a device that starts is back and at rest; returns whether it is back. A device
/// without a boot-up message is still usable for finding out more, and the wait for it happens
/// once.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn booted(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<bool, BusError> {
    baseline.monitors(false);
    let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
    debug_assert_eq!(boot_up.id.raw(), u32::from(heartbeat::COB_ID) + u32::from(dut.node));
    let back = match baseline.boots_up() {
        true => {
            let until = link.mark() + policy.boot_timeout;
            let booted = link.find(until, |seen| !seen.own && seen.frame == boot_up)?.is_some();
            if !booted {
                link.skip_to(until);
            }
            booted || {
                let answers = answers(link, policy, dut)?;
                if answers {
                    baseline.without_boot_up();
                }
                answers
            }
        }
        false => {
            link.drain(policy.quiet)?;
            first_answer(link, policy, dut)?
        }
    };
    link.drain(policy.quiet)?;
    Ok(back)
}

/// Whether the device answers an upload of 1000h in any way; where frames may be lost, one of
/// three.
pub(super) fn answers(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    for _ in 0..if dut.shares_its_bus { 3 } else { 1 } {
        let ended = sdo::upload(link, policy, dut.node, DEVICE_TYPE)?;
        if !matches!(ended.result, Err(Failure::Timeout)) {
            return Ok(true);
        }
    }
    Ok(false)
}
