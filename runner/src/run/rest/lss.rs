//! Layer setting services that bring a device back: its node id, and the state LSS waiting.
//!
//! A slave may drop a request that comes while it starts, or too soon after the last one. So each
//! request is sent after a pause, and what is not confirmed is asked for and repeated.

use std::time::Duration;

use canopen::lss::{self, Mode, Part, Request, Response, Status};
use canopen::monitor::Seen;
use canopen::{BusError, Stamped};
use reports::Identity;

use super::address::Address;
use crate::dut::Dut;
use crate::protect::Deed;
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
        let Some(before) = configuration(link, identity, node)? else { continue };
        for _ in 0..TRIES {
            if answers(link, Request::ConfigureNodeId(node))?.contains(&configured) {
                return Ok(Some(before));
            }
        }
    }
    leave_for_sure(link)?;
    Ok(None)
}

/// Gives the device its own node id and bit rate where it may have others, and stores them where
/// others may be stored. Whether it confirmed that; one that stores nothing has nothing stored.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn give_back(
    link: &mut Link,
    dut: &Dut,
    identity: &Identity,
    address: Address,
) -> Result<bool, BusError> {
    if address == Address::AsBefore {
        return Ok(true);
    }
    let may = |deed| dut.protection.refuses(deed).is_none();
    if configuration(link, identity, dut.node)?.is_none() {
        leave_for_sure(link)?;
        return Ok(false);
    }
    let mut back = true;
    if may(Deed::NodeId) {
        let configured = Response::ConfiguredNodeId(Status::DONE);
        back &= answer(link, Request::ConfigureNodeId(dut.node))? == Some(configured);
    }
    let index = lss::BIT_RATES.iter().position(|rate| rate.is_some() && *rate == dut.bit_rate);
    if let Some(index) = index.filter(|_| may(Deed::BitTiming)) {
        // A device whose bit rate is fixed refuses it, or does not answer.
        answer(link, Request::ConfigureBitTiming { table: 0, index: index as u8 })?;
    }
    if address == Address::Stored && may(Deed::StoreLss) {
        let stored = answer(link, Request::Store)?;
        back &= stored.is_none_or(|stored| stored == Response::Stored(Status::DONE));
    }
    leave_for_sure(link)?;
    Ok(back)
}

/// Switches the device to configuration state by its address, or with all others where it alone
/// answers and is known by its node id, or by what is known of its address; the node id that it
/// has.
fn configuration(link: &mut Link, identity: &Identity, node: u8) -> Result<Option<u8>, BusError> {
    let selected = select(link, identity)?;
    if !selected {
        match send(link, Request::SwitchGlobal(Mode::CONFIGURATION)) {
            // Other slaves would take what is meant for the device.
            Err(BusError::Withheld(_)) => return Ok(None),
            sent => sent?,
        }
    }
    let ids = answers(link, Request::InquireNodeId)?;
    Ok(match ids[..] {
        [Response::NodeId(id)] if selected || id == lss::UNCONFIGURED || id == node => Some(id),
        [Response::NodeId(id)] => says_so(link, identity)?.then_some(id),
        _ => None,
    })
}

/// Whether the one slave in configuration state has this address, as far as it is known.
fn says_so(link: &mut Link, identity: &Identity) -> Result<bool, BusError> {
    let Identity { vendor, product, revision, serial, .. } = *identity;
    if vendor.is_none() || product.is_none() {
        return Ok(false);
    }
    for (part, number) in Part::ALL.into_iter().zip([vendor, product, revision, serial]) {
        let said = answers(link, Request::Inquire(part))?;
        if number.is_some_and(|number| said != [Response::Address(part, number)]) {
            return Ok(false);
        }
    }
    Ok(true)
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

/// The answer to a request, which is repeated while none comes.
fn answer(link: &mut Link, request: Request) -> Result<Option<Response>, BusError> {
    for _ in 0..TRIES {
        link.wait(link.mark() + PAUSE)?;
        link.send(&request.frame())?;
        let until = link.mark() + STORING;
        let is_answer =
            |seen: &Stamped| !seen.own && seen.frame.data_id() == Some(lss::RESPONSE_COB_ID);
        if let Some(seen) = link.find(until, is_answer)? {
            return Ok(Response::decode(&seen.frame.data.padded()).ok());
        }
    }
    Ok(None)
}

/// How long a slave gets for a request, which it may not confirm: some serve none for 30 ms.
const PAUSE: Duration = Duration::from_millis(40);
/// How long answers are waited for.
const PATIENCE: Duration = Duration::from_millis(200);
/// How long a slave may take to store its settings.
const STORING: Duration = Duration::from_secs(1);
/// How often something is tried.
const TRIES: usize = 3;
