//! Errors of the controller and the messages about them (2.2.4, 2.2.14).

use canopen::emcy::EmcyCode;
use canopen::{Dictionary, Mux};

use super::network::{MESSAGES_OF_TABLE_5, Missing, NOTHING_MISSING, Network, OUTPUTS};
use super::objects::{EXTRA, PROCESS_VALUE, RECEIVED, WRITE_STATES};
use super::rules::Ax021211Rules;
use crate::stack::{Errors, FaultKind};

/// Raises and ends the errors of outputs and supply (table 22).
pub(super) fn report(network: &Network, supply: f64, errors: &mut Errors, rules: &Ax021211Rules) {
    let (faults, (low, high)) = (network.faults(), rules.supply_errors(supply));
    if errors.are_none() && faults == 0 && !low && !high {
        return;
    }
    for place in 0..OUTPUTS {
        let error = place as u16 + 1;
        if faults >> place & 1 == 0 {
            errors.clear(error);
        } else if !errors.has(error) {
            errors.raise(error, OUTPUT_OVERLOAD, GENERIC, [rules.channel(place), 0x10, 0, 0, 0]);
            if let Some(group) = rules.fault_group().filter(|_| rules.reacts(place)) {
                errors.react(group);
            }
        }
    }
    for (error, found, description) in [(LOW, low, 0x40), (HIGH, high, 0x20)] {
        if !found {
            errors.clear(error);
        } else if !errors.has(error) {
            errors.raise(error, VOLTAGE, GENERIC, [0, description, 0, 0, 0]);
            if let Some(group) = rules.supply_group() {
                errors.react(group);
            }
        }
    }
}

/// What is mapped into an RPDO that has timed out.
pub(super) fn timed_out(errors: &Errors, od: &Dictionary, rules: &Ax021211Rules) -> Missing {
    let mut messages = NOTHING_MISSING;
    if errors.are_none() {
        return messages;
    }
    for rpdo in (0..6).filter(|rpdo| errors.has_fault(FaultKind::RpdoTimeout, rpdo + 1)) {
        let mapping = MAPPINGS + rpdo;
        let count = od.int(Mux::new(mapping, 0)).unwrap_or(0) as u8;
        for sub in (1..=count).filter(|sub| rules.is_supervised(rpdo, *sub)) {
            let mapped = od.int(Mux::new(mapping, sub)).unwrap_or(0);
            let (index, place) = ((mapped >> 16) as u16, (mapped >> 8 & 0xFF) as usize);
            match index {
                PROCESS_VALUE | RECEIVED if (1..=10).contains(&place) => {
                    messages[place - 1] = true;
                }
                EXTRA if (1..=14).contains(&place) => messages[9 + place] = true,
                _ if index == WRITE_STATES.index => messages[MESSAGES_OF_TABLE_5..].fill(true),
                _ => {}
            }
        }
    }
    messages
}

const OUTPUT_OVERLOAD: EmcyCode = EmcyCode(0xF002);
const VOLTAGE: EmcyCode = EmcyCode(0x3000);
/// The one bit of 1001h that the controller uses (2.2.2).
const GENERIC: u8 = 1;
/// The application's numbers for the errors of the supply; those of outputs are 1 to 10.
const LOW: u16 = 11;
const HIGH: u16 = 12;
/// RPDO mapping parameters.
const MAPPINGS: u16 = 0x1600;
