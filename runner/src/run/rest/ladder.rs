//! The ways to recover a device that does not answer as it should, the gentlest first.

use std::time::Duration;

use canopen::nmt::{Command, Service};
use canopen::{Abort, BusError, Mux, sdo};
use reports::{Event, Note};

use super::answer::{booted, first_answer};
use super::baseline::Baseline;
use super::lss;
use super::rung::Rung;
use super::state::pre_operational;
use crate::dut::{Dut, Hook};
use crate::protect::Deed;
use crate::run::link::Link;
use crate::run::policy::Policy;

impl Rung {
    /// Tries it, unless the device is protected from it.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(super) fn climb(
        self,
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
        baseline: &Baseline,
    ) -> Result<Climbed, BusError> {
        if let Some(why) = self.deeds().iter().find_map(|deed| dut.protection.refuses(*deed)) {
            return Ok(Climbed::Withheld(why));
        }
        let back = match self {
            Self::Patience => {
                let until = link.mark() + policy.sdo_timeout;
                link.wait(until)?;
                true
            }
            Self::Abort => {
                let abort = sdo::Request::Abort(Mux::new(0x1000, 0), Abort::GENERAL);
                link.send(&abort.frame(dut.node))?;
                link.drain(policy.quiet)?;
                true
            }
            Self::PreOperational => {
                pre_operational(link, policy, dut)?;
                true
            }
            Self::ResetCommunication => {
                restart(link, policy, dut, baseline, (Service::RESET_COMMUNICATION, dut.node))?
            }
            Self::ResetNode => {
                restart(link, policy, dut, baseline, (Service::RESET_NODE, dut.node))?
            }
            Self::ResetAll => {
                restart(link, policy, dut, baseline, (Service::RESET_NODE, ALL_NODES))?
            }
            Self::ResetHook => {
                let Some(hook) = &dut.hooks.reset else { return Ok(Climbed::Absent) };
                call(link, &**hook, None)? && first_answer(link, policy, dut)?
            }
            Self::PowerHook => {
                let Some(hook) = &dut.hooks.power else { return Ok(Climbed::Absent) };
                let off = call(link, &**hook, Some("off"))?;
                let until = link.mark() + WITHOUT_SUPPLY;
                link.wait(until)?;
                let on = call(link, &**hook, Some("on"))?;
                off && on && first_answer(link, policy, dut)?
            }
            Self::NodeId if !dut.eds.device.lss => return Ok(Climbed::Absent),
            Self::NodeId => node_id(link, policy, dut, baseline)?,
        };
        Ok(if back { Climbed::Up } else { Climbed::InVain })
    }
}

/// What became of a rung.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Climbed {
    /// It was tried, and the device may be back.
    Up,
    /// It was tried, and there is no use in looking at the device.
    InVain,
    /// The device is protected from it; by what.
    Withheld(String),
    /// There is no such way to this device.
    Absent,
}

/// The rungs that were tried for a device, and those that were not.
#[derive(Debug, Default)]
pub(super) struct Tried {
    /// By their names.
    tried: Vec<&'static str>,
    /// With their protection.
    withheld: Vec<String>,
}

impl Tried {
    pub(super) fn add(&mut self, rung: Rung, climbed: &Climbed) {
        match climbed {
            Climbed::Up | Climbed::InVain if self.tried.contains(&rung.name()) => {}
            Climbed::Up | Climbed::InVain => self.tried.push(rung.name()),
            Climbed::Withheld(why) => {
                self.withheld.push(format!("{} was not tried: {why}", rung.name()));
            }
            Climbed::Absent => {}
        }
    }

    /// Why a device is given up, as the end of a sentence.
    pub(super) fn said(&self) -> String {
        let tried = match self.tried.split_last() {
            None => "nothing could be tried".to_owned(),
            Some((last, [])) => format!("{last} did not help"),
            Some((last, others)) => format!("{} and {last} did not help", others.join(", ")),
        };
        let withheld = self.withheld.iter().map(|why| format!("; {why}"));
        withheld.fold(tried, |said, why| said + &why)
    }
}

/// Does what the user gives for it; whether it succeeded. If it did not, the report says why.
fn call(link: &mut Link, hook: &dyn Hook, argument: Option<&str>) -> Result<bool, BusError> {
    let done = hook.call(argument, &mut || link.look_from_now())?;
    link.moved();
    let Err(why) = done else { return Ok(true) };
    let text = format!("the program `{}` failed: {why}", hook.name());
    link.emit(Event::Note(Note { at: link.mark(), text }));
    Ok(false)
}

const ALL_NODES: u8 = 0;
/// How long a device is without supply, for its capacitors to be empty.
const WITHOUT_SUPPLY: Duration = Duration::from_secs(1);

/// Resets the device; whether it came back, which then is in PRE-OPERATIONAL.
fn restart(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    (service, node): (Service, u8),
) -> Result<bool, BusError> {
    link.send(&Command { service, node }.frame())?;
    if !booted(link, policy, dut, baseline)? {
        return Ok(false);
    }
    pre_operational(link, policy, dut)?;
    Ok(true)
}

/// Gives the device its node id again by layer setting services, and has it start with it; whether
/// it came back.
fn node_id(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<bool, BusError> {
    let Some(before) = lss::give_node_id(link, &baseline.identity, dut.node)? else {
        return Ok(false);
    };
    // A slave without node id takes the new one when it leaves the configuration state, and may not
    // have heard that it is to leave.
    let shortly = Policy { boot_timeout: policy.boot_timeout / LEAVING, ..*policy };
    if before == canopen::lss::UNCONFIGURED {
        for _ in 0..LEAVING {
            lss::leave(link)?;
            if booted(link, &shortly, dut, baseline)? {
                pre_operational(link, policy, dut)?;
                return Ok(true);
            }
        }
    } else {
        lss::leave_for_sure(link)?;
    }
    let resets = [
        (Service::RESET_COMMUNICATION, before),
        (Service::RESET_NODE, before),
        (Service::RESET_NODE, dut.node),
        (Service::RESET_NODE, ALL_NODES),
    ];
    for (service, node) in resets {
        let deeds = [Deed::of_service(service), (node == ALL_NODES).then_some(Deed::AllNodes)];
        let withheld =
            deeds.into_iter().flatten().any(|deed| dut.protection.refuses(deed).is_some());
        let sent = node != canopen::lss::UNCONFIGURED && !withheld;
        if sent && restart(link, policy, dut, baseline, (service, node))? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// How often a slave is asked to leave LSS configuration, at most.
const LEAVING: u32 = 4;
