//! The steps of layer setting services that are more than a frame and its answer.

use std::time::Duration;

use canopen::lss::{Fastscan, Part, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{BusError, Id};
use reports::{Event, Measured};

use super::judge::{Difference, Judgement, Trouble};
use super::run::Steps;
use crate::suite::constraint::{Constraint, PARTS};
use crate::suite::literal::show_time;
use crate::suite::step::{FastscanStep, LssStep};

/// How long to wait for the answer to a request that a slave in order does not answer.
const DEFAULT_SLOT: Duration = Duration::from_millis(10);
/// How long one waits that it does: a busy host must not look like a silent slave.
const PATIENCE: Duration = Duration::from_millis(200);

impl Steps<'_, '_> {
    pub(super) fn lss(&mut self, step: &LssStep) -> Judgement {
        match step {
            LssStep::Fastscan(scan) => self.fastscan(scan),
        }
    }

    /// Walks through the 128 bits of an address: each question is whether it agrees so far.
    fn fastscan(&mut self, step: &FastscanStep) -> Judgement {
        let slot = self.optional_time(&step.slot, DEFAULT_SLOT)?;
        let begin = self.link.mark();
        let first = Fastscan { number: 0, bit: Fastscan::CONFIRM, part: 0, next: 0 };
        if !self.asked(first, PATIENCE)? {
            let actual = format!("no answer within {}", show_time(PATIENCE));
            let difference = Difference::new("a slave without node id that is there", actual);
            return self.broken(&[], difference);
        }
        let wanted = [&step.vendor, &step.product, &step.revision, &step.serial];
        for ((part, wanted), name) in Part::ALL.into_iter().zip(wanted).zip(PARTS) {
            let wanted = self.scope.int(&wanted.value).map_err(Trouble::Impossible)?;
            let found = self.part(part, wanted, slot)?;
            let next = (part as u8 + 1) % Part::ALL.len() as u8;
            let last = Fastscan { number: found, bit: 0, part: part as u8, next };
            let agrees = self.asked(last, PATIENCE)?;
            if i128::from(found) != wanted || !agrees {
                let actual = if agrees { "found" } else { "not confirmed:" };
                let difference = Difference::new(
                    format!("{part:?} {wanted:08X}h found by the scan"),
                    format!("{actual} {found:08X}h"),
                );
                self.broken(&[Constraint::Part(name)], difference)?;
            }
        }
        let span = self.link.mark().since(begin).as_nanos() as f64 / 1e6;
        self.link.emit(Event::Measured(Measured {
            what: "fastscan".to_owned(),
            unit: "ms".to_owned(),
            count: 1,
            min: span,
            mean: span,
            max: span,
            strict: None,
            lenient: None,
        }));
        Ok(None)
    }

    /// One part of the address, from the highest bit to the lowest: a bit that is not answered as
    /// 0 is 1.
    fn part(&mut self, part: Part, wanted: i128, slot: Duration) -> Result<u32, BusError> {
        let mut number = 0;
        for bit in (0..32).rev() {
            let scan = Fastscan { number, bit, part: part as u8, next: part as u8 };
            let patience = if wanted >> bit & 1 == 0 { PATIENCE } else { slot };
            if !self.asked(scan, patience)? {
                number |= 1 << bit;
            }
        }
        Ok(number)
    }

    fn asked(&mut self, scan: Fastscan, slot: Duration) -> Result<bool, BusError> {
        let request = Request::Fastscan(scan).frame();
        debug_assert_eq!(request.id, Id::standard(REQUEST_COB_ID));
        self.link.send(&request)?;
        let until = self.link.mark() + slot;
        let answer = self.link.find(until, |seen| {
            !seen.own
                && seen.frame.data_id() == Some(RESPONSE_COB_ID)
                && Response::decode(&seen.frame.data) == Ok(Response::Identified)
        })?;
        Ok(answer.is_some())
    }
}
