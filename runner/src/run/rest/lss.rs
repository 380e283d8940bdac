//! Layer setting services that bring a device back: its node id, and the state LSS waiting.
//!
//! A slave may drop a request that comes while it starts, or too soon after the last one. So each
//! request is sent after a pause, and what is not confirmed is asked for and repeated.

use std::time::Duration;

use canopen::BusError;
use canopen::lss::{self, Mode, Part, Request, Response, Status};
use canopen::monitor::Seen;
use reports::Identity;

use crate::run::link::Link;

/// Puts the device into LSS configuration state and gives it a node id there; the one that it had,
/// or `None` when it did not take the new one.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn give_node_id(
    link: &mut Link,
    identity: &Identity,
    node: u8,
) -> Result<Option<u8>, BusError> {
    let configured = Response::ConfiguredNodeId(Status::DONE);
    for _ in 0..TRIES {
        let Some(before) = configuration(link, identity)? else { continue };
        for _ in 0..TRIES {
            if answers(link, Request::ConfigureNodeId(node))?.contains(&configured) {
                return Ok(Some(before));
            }
        }
    }
    leave_for_sure(link)?;
    Ok(None)
}

/// Switches the device to configuration state by its address, or with all others where it alone
/// answers and has no node id; the node id that it has.
fn configuration(link: &mut Link, identity: &Identity) -> Result<Option<u8>, BusError> {
    let selected = select(link, identity)?;
    if !selected {
        send(link, Request::SwitchGlobal(Mode::CONFIGURATION))?;
    }
    let ids = answers(link, Request::InquireNodeId)?;
    Ok(match ids[..] {
        [Response::NodeId(lss::UNCONFIGURED)] => Some(lss::UNCONFIGURED),
        [Response::NodeId(id)] if selected => Some(id),
        _ => None,
    })
}

/// Switches the device with that address to configuration state, when it is known and answers.
fn select(link: &mut Link, identity: &Identity) -> Result<bool, BusError> {
    let Identity { vendor, product, revision, serial, .. } = *identity;
    let (Some(vendor), Some(product), Some(revision), Some(serial)) =
        (vendor, product, revision, serial)
    else {
        return Ok(false);
    };
    send(link, Request::SwitchGlobal(Mode::WAITING))?;
    for (part, number) in
        [(Part::Vendor, vendor), (Part::Product, product), (Part::Revision, revision)]
    {
        send(link, Request::SwitchSelective(part, number))?;
    }
    Ok(answers(link, Request::SwitchSelective(Part::Serial, serial))?.contains(&Response::Selected))
}

/// Asks every slave to leave LSS configuration, once.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn leave(link: &mut Link) -> Result<(), BusError> {
    link.wait(link.mark() + PAUSE)?;
    link.send(&Request::SwitchGlobal(Mode::WAITING).frame())
}

/// Asks every slave to leave LSS configuration until none answers an inquiry, which is for that
/// state only.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn leave_for_sure(link: &mut Link) -> Result<(), BusError> {
    for _ in 0..TRIES {
        leave(link)?;
        link.wait(link.mark() + PAUSE)?;
        if answers(link, Request::InquireNodeId)?.is_empty() {
            break;
        }
    }
    Ok(())
}

/// Whether something in the trace may have put the device into LSS configuration state.
pub(super) fn may_configure(trace: &[Seen]) -> bool {
    let own = trace.iter().map(|seen| seen.stamped).filter(|seen| seen.own);
    let mut requests = own.filter(|seen| seen.frame.data_id() == Some(lss::REQUEST_COB_ID));
    requests.any(|seen| match Request::decode(&seen.frame.data) {
        Ok(Request::SwitchGlobal(mode)) => mode != Mode::WAITING,
        Ok(Request::SwitchSelective(Part::Serial, _) | Request::Fastscan(_)) => true,
        // Of a device that takes more than it should, nothing is known.
        Err(_) => true,
        Ok(_) => false,
    })
}

/// Whether something in the trace may have changed the node id of the device.
pub(super) fn may_change_node_id(trace: &[Seen]) -> bool {
    let own = trace.iter().map(|seen| seen.stamped).filter(|seen| seen.own);
    let mut requests = own.filter(|seen| seen.frame.data_id() == Some(lss::REQUEST_COB_ID));
    requests
        .any(|seen| matches!(Request::decode(&seen.frame.data), Ok(Request::ConfigureNodeId(_))))
}

/// A request that is not answered.
fn send(link: &mut Link, request: Request) -> Result<(), BusError> {
    link.send(&request.frame())?;
    link.wait(link.mark() + PAUSE)
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

/// How long a slave gets for a request, which it may not confirm: some serve none for 30 ms.
const PAUSE: Duration = Duration::from_millis(40);
/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_millis(200);
/// How often something is tried.
const TRIES: usize = 3;
