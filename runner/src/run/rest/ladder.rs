//! The ways to recover a device that does not answer as it should, the gentlest first.

use std::time::Duration;

use canopen::lss::{self, Mode, Part, Request, Response, Status};
use canopen::nmt::{Command, Service};
use canopen::{Abort, BusError, Mux, sdo};
use reports::{Event, Identity, Note};

use super::answer::{booted, first_answer};
use super::baseline::Baseline;
use super::state::pre_operational;
use crate::dut::{Dut, Hook};
use crate::protect::Deed;
use crate::run::link::Link;
use crate::run::policy::Policy;

/// One way to get a device back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rung {
    /// Time.
    Patience,
    /// An SDO abort, which ends an open transfer.
    Abort,
    /// NMT enter pre-operational.
    PreOperational,
    /// NMT reset communication.
    ResetCommunication,
    /// NMT reset node.
    ResetNode,
    /// The same to every node.
    ResetAll,
    /// Its node id, given by layer setting services.
    NodeId,
    /// A program of the user's that resets it.
    ResetHook,
    /// A program of the user's that switches its supply off and on.
    PowerHook,
}

/// All of them, in order. A server may keep a transfer through a reset, hence the second abort.
pub(super) const LADDER: [Rung; 10] = [
    Rung::Patience,
    Rung::Abort,
    Rung::PreOperational,
    Rung::ResetCommunication,
    Rung::ResetNode,
    Rung::Abort,
    Rung::ResetAll,
    Rung::NodeId,
    Rung::ResetHook,
    Rung::PowerHook,
];

/// The place of [`Rung::ResetNode`] in [`LADDER`].
pub(super) const RESET_NODE: usize = 4;

impl Rung {
    /// The name in reports.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Patience => "waiting",
            Self::Abort => "an SDO abort",
            Self::PreOperational => "NMT enter pre-operational",
            Self::ResetCommunication => "reset communication",
            Self::ResetNode => "reset node",
            Self::ResetAll => "reset of all nodes",
            Self::NodeId => "LSS, which configured its node id",
            Self::ResetHook => "the program `reset`",
            Self::PowerHook => "the program `power`",
        }
    }

    /// The effects on the device, from which it may be protected.
    pub(super) const fn deeds(self) -> &'static [Deed] {
        match self {
            Self::Patience | Self::Abort | Self::PreOperational => &[],
            // The user's own hooks are always permitted.
            Self::ResetHook | Self::PowerHook => &[],
            Self::ResetCommunication => &[Deed::ResetCommunication],
            Self::ResetNode => &[Deed::ResetNode],
            Self::ResetAll => &[Deed::ResetNode, Deed::AllNodes],
            Self::NodeId => &[Deed::NodeId, Deed::ResetCommunication, Deed::AllNodes],
        }
    }

    /// Tries it, unless the device is protected from it; `false` when there is no use in looking at
    /// the device.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(super) fn climb(
        self,
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
        baseline: &Baseline,
    ) -> Result<bool, BusError> {
        if self.deeds().iter().any(|deed| dut.protection.refuses(*deed).is_some()) {
            return Ok(false);
        }
        let reset = match self {
            Self::Patience => {
                let until = link.mark() + policy.sdo_timeout;
                link.wait(until)?;
                return Ok(true);
            }
            Self::Abort => {
                let abort = sdo::Request::Abort(Mux::new(0x1000, 0), Abort::GENERAL);
                link.send(&abort.frame(dut.node))?;
                link.drain(policy.quiet)?;
                return Ok(true);
            }
            Self::PreOperational => {
                pre_operational(link, policy, dut)?;
                return Ok(true);
            }
            Self::ResetCommunication => (Service::RESET_COMMUNICATION, dut.node),
            Self::ResetNode => (Service::RESET_NODE, dut.node),
            Self::ResetAll => (Service::RESET_NODE, ALL_NODES),
            Self::ResetHook => {
                let Some(hook) = &dut.hooks.reset else { return Ok(false) };
                let done = call(link, &**hook, None)?;
                return Ok(done && first_answer(link, policy, dut)?);
            }
            Self::PowerHook => {
                let Some(hook) = &dut.hooks.power else { return Ok(false) };
                let off = call(link, &**hook, Some("off"))?;
                let until = link.mark() + WITHOUT_SUPPLY;
                link.wait(until)?;
                let on = call(link, &**hook, Some("on"))?;
                return Ok(off && on && first_answer(link, policy, dut)?);
            }
            Self::NodeId => {
                if !dut.eds.device.lss || !node_id(link, dut, &baseline.identity)? {
                    return Ok(false);
                }
                (Service::RESET_COMMUNICATION, ALL_NODES)
            }
        };
        restart(link, policy, dut, baseline, reset)
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

/// Gives the device its node id again. It is switched to configuration state by its address, or
/// with all others where it alone answers and has no node id.
fn node_id(link: &mut Link, dut: &Dut, identity: &Identity) -> Result<bool, BusError> {
    let selected = select(link, identity)?;
    if !selected {
        link.send(&Request::SwitchGlobal(Mode::CONFIGURATION).frame())?;
        link.drain(SWITCH)?;
        let ids = answers(link, Request::InquireNodeId)?;
        if ids != [Response::NodeId(lss::UNCONFIGURED)] {
            link.send(&Request::SwitchGlobal(Mode::WAITING).frame())?;
            return Ok(false);
        }
    }
    let configured = Response::ConfiguredNodeId(Status::DONE);
    let mut done = false;
    for _ in 0..TRIES {
        done = answers(link, Request::ConfigureNodeId(dut.node))?.contains(&configured);
        if done {
            break;
        }
    }
    link.send(&Request::SwitchGlobal(Mode::WAITING).frame())?;
    // A slave that has none takes the new one when it leaves the configuration state.
    link.drain(SWITCH)?;
    Ok(done)
}

/// Switches the device with that address to configuration state, when it is known and answers.
fn select(link: &mut Link, identity: &Identity) -> Result<bool, BusError> {
    let Identity { vendor, product, revision, serial, .. } = *identity;
    let (Some(vendor), Some(product), Some(revision), Some(serial)) =
        (vendor, product, revision, serial)
    else {
        return Ok(false);
    };
    link.send(&Request::SwitchGlobal(Mode::WAITING).frame())?;
    link.drain(SWITCH)?;
    for (part, number) in
        [(Part::Vendor, vendor), (Part::Product, product), (Part::Revision, revision)]
    {
        link.send(&Request::SwitchSelective(part, number).frame())?;
        link.drain(SWITCH)?;
    }
    Ok(answers(link, Request::SwitchSelective(Part::Serial, serial))?.contains(&Response::Selected))
}

/// The answers to a request, until no more arrive.
fn answers(link: &mut Link, request: Request) -> Result<Vec<Response>, BusError> {
    link.send(&request.frame())?;
    let until = link.mark() + PATIENCE;
    let mut answers = Vec::new();
    while let Some(seen) =
        link.find(until, |seen| !seen.own && seen.frame.data_id() == Some(lss::RESPONSE_COB_ID))?
    {
        answers.extend(Response::decode(&seen.frame.data));
    }
    link.skip_to(until);
    Ok(answers)
}

/// How long a slave may take to change its state, which it does not confirm.
const SWITCH: Duration = Duration::from_millis(20);
/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_millis(200);
/// How often a request is sent that is not answered.
const TRIES: usize = 3;
