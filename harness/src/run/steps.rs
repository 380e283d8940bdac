//! The steps, one function each.

use std::time::Duration;

use canopen::eds::Entry;
use canopen::nmt::{Command, Service};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::Transfer;
use canopen::{Abort, Frame, Instant, Mux, Pattern, Stamped, Value, sync};
use reports::Measured;

use super::judge::{Condition, Difference, Judgement, Trouble, refusal, show};
use super::limits::{Limits, mean};
use super::link::{Link, Policy};
use super::sdo::{self, Ended};
use crate::plan::{Binding, Dut, Scope, mapping_word, parse_bytes};
use crate::source::At;
use crate::suite::literal::{Amount, Flow, FrameText, Literal, ObjectRef, show_time};
use crate::suite::model::{
    Bounds, Collect, Expect, Measure, Never, Nmt, Produce, Read, Remap, Reply, Step, SyncStep,
    Until, Write,
};

/// Runs the steps of one case.
pub(super) struct Steps<'s, 'b> {
    /// The bus.
    pub link: &'s mut Link<'b>,
    /// The device.
    pub dut: &'s Dut,
    /// What to wait for and how long.
    pub policy: &'s Policy,
    /// The names, those that steps save included.
    pub scope: Scope,
    /// What was measured.
    pub measured: Vec<Measured>,
}

const DEFAULT_REPLY: Duration = Duration::from_secs(1);
const DEFAULT_POLL: Duration = Duration::from_millis(20);
const DEFAULT_SYNC_PERIOD: Duration = Duration::from_millis(10);
/// How long a measurement waits for a frame that has no upper bound.
const UNBOUNDED_PATIENCE: Duration = Duration::from_secs(10);

impl Steps<'_, '_> {
    /// Runs one step.
    ///
    /// # Errors
    /// What went wrong.
    pub(super) fn run(&mut self, step: &Step) -> Judgement {
        match step {
            Step::Send(frame) => {
                let frame = self.frame(frame)?;
                self.link.send(&frame)?;
                Ok(None)
            }
            Step::Reply(reply) => self.reply(reply),
            Step::Expect(expect) => self.expect(expect),
            Step::Never(never) => self.never(never),
            Step::Read(read) => self.read(read),
            Step::Write(write) => self.write(write),
            Step::Remap(remap) => self.remap(remap),
            Step::Nmt(nmt) => self.nmt(*nmt),
            Step::Wait(time) => {
                let until = self.link.mark() + self.time(time)?;
                self.link.wait(until)?;
                Ok(None)
            }
            Step::Until(until) => self.until(until),
            Step::Measure(measure) => self.measure(measure),
            Step::Collect(collect) => self.collect(collect),
            Step::Sync(sync) => self.sync(sync),
            Step::Produce(produce) => self.produce(produce).map(|()| None),
        }
    }

    fn reply(&mut self, reply: &Reply) -> Judgement {
        let strict = self.pattern(&reply.frame)?;
        let within = self.optional_time(&reply.within, DEFAULT_REPLY)?;
        let until = self.link.mark() + within;
        let id = strict.id();
        let answer = self.link.find(until, |seen| !seen.own && seen.frame.id == id)?;
        let Some(answer) = answer else {
            let actual = format!("no frame {id} within {}", show_time(within));
            return device(Difference::new(strict.to_string(), actual));
        };
        self.accept(&strict, &reply.lenient, &answer)
    }

    /// Judges a frame against the strict pattern and the lenient ones.
    fn accept(&mut self, strict: &Pattern, lenient: &[At<FrameText>], got: &Stamped) -> Judgement {
        if strict.matches(&got.frame) {
            for (name, byte) in strict.captures(&got.frame) {
                self.scope.bind(name, Binding::Literal(Literal::Int(byte.into())));
            }
            return Ok(None);
        }
        let actual = canopen::meaning(&got.frame).to_string();
        let difference = Difference::new(strict.to_string(), actual).about(got.frame);
        for text in lenient {
            if self.pattern(text)?.matches(&got.frame) {
                return Ok(Some(difference));
            }
        }
        device(difference)
    }

    fn expect(&mut self, expect: &Expect) -> Judgement {
        let strict = self.pattern(&expect.frame)?;
        let mut patterns = vec![strict.clone()];
        for text in &expect.lenient {
            patterns.push(self.pattern(text)?);
        }
        let within = self.time(&expect.within)?;
        let start = self.link.mark();
        self.stimulate(expect.during.as_ref())?;
        let sent = self.link.mark().max(start);
        self.link_rewind(expect.during.is_some(), start);
        let fits = |seen: &Stamped| {
            !seen.own && patterns.iter().any(|pattern| pattern.matches(&seen.frame))
        };
        let Some(got) = self.link.find(sent + within, fits)? else {
            let actual = format!("nothing of the kind within {}", show_time(within));
            return device(Difference::new(strict.to_string(), actual));
        };
        if let Some(after) = &expect.after {
            let after = self.time(after)?;
            let came = got.at.since(start);
            if came < after {
                let expected = format!("{strict} not before {}", show_time(after));
                let actual = format!("after {}", show_time(came));
                return device(Difference::new(expected, actual).about(got.frame));
            }
        }
        self.accept(&strict, &expect.lenient, &got)
    }

    fn never(&mut self, never: &Never) -> Judgement {
        let pattern = self.pattern(&never.frame)?;
        let time = self.time(&never.time)?;
        let start = self.link.mark();
        self.stimulate(never.during.as_ref())?;
        let until = self.link.mark() + time;
        self.link_rewind(never.during.is_some(), start);
        let got = self.link.find(until, |seen| !seen.own && pattern.matches(&seen.frame))?;
        if let Some(got) = got {
            let expected = format!("no {pattern} for {}", show_time(time));
            let meaning = canopen::meaning(&got.frame);
            let actual = format!("{meaning} after {}", show_time(got.at.since(start)));
            return device(Difference::new(expected, actual).about(got.frame));
        }
        self.link.skip_to(until);
        Ok(None)
    }

    fn read(&mut self, read: &Read) -> Judgement {
        let mux = self.mux(&read.object)?;
        let entry = self.dut.eds.entry(mux).cloned();
        let mut ended = sdo::upload(self.link, self.policy, self.dut.node, mux)?;
        if let Some(expected) = &read.refused {
            return refusal(&ended.result, &expected.value, ended.raw);
        }
        trim_unsized(&mut ended, entry.as_ref());
        let condition = self.condition(
            entry.as_ref(),
            [&read.value, &read.mask, &read.min, &read.max],
            read.length.as_ref(),
        )?;
        let data = match ended.result {
            Ok(data) => data,
            Err(failure) => {
                let expected = format!("the value of {mux}");
                return device(Difference {
                    expected,
                    actual: failure.to_string(),
                    raw: ended.raw,
                });
            }
        };
        let about = |difference: Difference| Difference {
            expected: format!("{mux} = {}", difference.expected),
            raw: ended.raw,
            ..difference
        };
        condition.judge(entry.as_ref(), &data).map_err(|wrong| Trouble::Device(about(wrong)))?;
        if let Some(flow) = read.transfer
            && (flow == Flow::Segmented) != ended.segmented
        {
            let name = |segmented| {
                if segmented { "a segmented transfer" } else { "an expedited transfer" }
            };
            let wrong = Difference::new(name(flow == Flow::Segmented), name(ended.segmented));
            return device(Difference { raw: ended.raw, ..wrong });
        }
        if let Some(name) = &read.save {
            let value = entry.as_ref().and_then(|entry| {
                Some(Binding::Value(entry.data_type.decode(&data).ok()?, entry.data_type))
            });
            self.scope.bind(name.0.clone(), value.unwrap_or(Binding::Bytes(data)));
        }
        Ok(None)
    }

    fn write(&mut self, write: &Write) -> Judgement {
        let mux = self.mux(&write.object)?;
        let data = match (&write.value, &write.bytes) {
            (Some(value), _) => self.write_value(mux, &value.value)?,
            (None, Some(bytes)) => parse_bytes(&bytes.value).unwrap_or_default(),
            (None, None) => Vec::new(),
        };
        let flow = write.transfer.map_or_else(|| Transfer::usual(data.len()), Transfer::from);
        let ended = sdo::download(self.link, self.policy, self.dut.node, mux, &data, flow)?;
        if let Some(expected) = &write.refused {
            return refusal(&ended.result, &expected.value, ended.raw);
        }
        accepted(mux, &data, self.dut.eds.entry(mux), ended)
    }

    fn remap(&mut self, remap: &Remap) -> Judgement {
        let count = self.mux(&remap.pdo)?;
        let cob_id = Mux::new(count.index & !0x0200, 1);
        let mut words = Vec::new();
        for object in &remap.objects {
            words.push(mapping_word(&object.value, &self.scope, self.dut).map_err(Trouble::Bench)?);
        }
        let before = sdo::upload(self.link, self.policy, self.dut.node, cob_id)?;
        let before = match before.result.as_deref().map(<[u8]>::first_chunk::<4>) {
            Ok(Some(bytes)) => u32::from_le_bytes(*bytes),
            _ => {
                return device(Difference {
                    raw: before.raw,
                    ..Difference::new(format!("the value of {cob_id}"), "none")
                });
            }
        };
        self.must_write(cob_id, &(before | CobId::INVALID).to_le_bytes())?;
        self.must_write(count, &[0])?;
        let expected = remap.refused.as_ref().map(|refusal| &refusal.value);
        for (place, word) in words.iter().enumerate() {
            let entry = Mux::new(count.index, place as u8 + 1);
            let ended = self.raw_write(entry, &word.to_le_bytes())?;
            match expected {
                Some(expected) if ended.result.is_err() => {
                    return refusal(&ended.result, expected, ended.raw);
                }
                _ => self.taken(ended, || {
                    format!("the mapping of {:?} at {entry}", Mapping::decode(*word))
                })?,
            }
        }
        let ended = self.raw_write(count, &[words.len() as u8])?;
        if let Some(expected) = expected {
            return refusal(&ended.result, expected, ended.raw);
        }
        self.taken(ended, || format!("{} mapped objects at {count}", words.len()))?;
        self.must_write(cob_id, &(before & !CobId::INVALID).to_le_bytes())?;
        Ok(None)
    }

    fn nmt(&mut self, nmt: Nmt) -> Judgement {
        let service = match nmt {
            Nmt::Start => Service::START,
            Nmt::Stop => Service::STOP,
            Nmt::PreOperational => Service::ENTER_PRE_OPERATIONAL,
            Nmt::ResetNode => Service::RESET_NODE,
            Nmt::ResetCommunication => Service::RESET_COMMUNICATION,
        };
        self.link.send(&Command { service, node: self.dut.node }.frame())?;
        Ok(None)
    }

    fn until(&mut self, until: &Until) -> Judgement {
        let mux = self.mux(&until.object)?;
        let entry = self.dut.eds.entry(mux).cloned();
        let condition = self.condition(
            entry.as_ref(),
            [&until.value, &until.mask, &until.min, &until.max],
            None,
        )?;
        let within = self.time(&until.within)?;
        let every = self.optional_time(&until.every, DEFAULT_POLL)?.max(Duration::from_millis(1));
        let end = self.link.mark() + within;
        loop {
            let mut ended = sdo::upload(self.link, self.policy, self.dut.node, mux)?;
            trim_unsized(&mut ended, entry.as_ref());
            let difference = match ended.result {
                Ok(data) => match condition.judge(entry.as_ref(), &data) {
                    Ok(()) => return Ok(None),
                    Err(difference) => difference,
                },
                Err(failure) => {
                    return device(Difference {
                        raw: ended.raw,
                        ..Difference::new(format!("the value of {mux}"), failure.to_string())
                    });
                }
            };
            if self.link.mark() + every > end {
                let expected =
                    format!("{mux} = {} within {}", difference.expected, show_time(within));
                return device(Difference { expected, raw: ended.raw, ..difference });
            }
            let next = self.link.mark() + every;
            self.link.wait(next)?;
        }
    }

    fn measure(&mut self, measure: &Measure) -> Judgement {
        let pattern = self.pattern(&measure.frame)?;
        let start = self.link.mark();
        self.stimulate(measure.during.as_ref())?;
        let sent = self.link.mark().max(start);
        self.link_rewind(measure.during.is_some(), start);
        let slack = self.policy.bus_slack;
        let intervals = measure.count.saturating_sub(1).max(1) as u32;
        // The mean of many intervals suffers from only one frame in front of the first and last.
        let limits = |bounds: &Option<Bounds>, slack| {
            bounds.as_ref().map(|bounds| Limits::new(bounds, &self.scope, slack)).transpose()
        };
        let each = limits(&measure.interval, slack)?;
        let average = limits(&measure.mean, slack / intervals)?;
        let longest = each.as_ref().map_or(Duration::MAX, Limits::longest);
        let patience = longest.min(UNBOUNDED_PATIENCE) * 2;
        let first = self.optional_time(&measure.within, patience)?;
        let mut stamps: Vec<Instant> = Vec::new();
        while stamps.len() < measure.count {
            let wait = if stamps.is_empty() { first } else { patience };
            let until = self.link.mark().max(sent) + wait;
            let got = self.link.find(until, |seen| !seen.own && pattern.matches(&seen.frame))?;
            let Some(got) = got else {
                let expected = format!("{} frames {pattern}", measure.count);
                let actual = format!("{}, then none for {}", stamps.len(), show_time(wait));
                return device(Difference::new(expected, actual));
            };
            stamps.push(got.at);
        }
        let intervals: Vec<Duration> =
            stamps.windows(2).map(|pair| pair[1].since(pair[0])).collect();
        let mut lenient = None;
        let what = format!("interval of {}", pattern.id());
        if let Some(limits) = each {
            self.measured.push(limits.figures(what.clone(), &intervals));
            for interval in &intervals {
                lenient = lenient.or(limits.judge(*interval, &what)?);
            }
        }
        if let Some(limits) = average {
            let what = format!("mean {what}");
            self.measured.push(limits.figures(what.clone(), &intervals));
            lenient = lenient.or(limits.judge(mean(&intervals), &what)?);
        }
        Ok(lenient)
    }

    fn collect(&mut self, collect: &Collect) -> Judgement {
        let pattern = self.pattern(&collect.frame)?;
        let wanted = self.scope.int(&collect.count.value).map_err(Trouble::Bench)?;
        let time = self.time(&collect.time)?;
        let start = self.link.mark();
        self.stimulate(collect.during.as_ref())?;
        let until = self.link.mark() + time;
        self.link_rewind(collect.during.is_some(), start);
        let mut count = 0;
        while self.link.find(until, |seen| !seen.own && pattern.matches(&seen.frame))?.is_some() {
            count += 1;
        }
        self.link.skip_to(until);
        if count == wanted {
            return Ok(None);
        }
        let span = show_time(until.since(start));
        device(Difference::new(format!("{wanted} frames {pattern} in {span}"), format!("{count}")))
    }

    fn sync(&mut self, step: &SyncStep) -> Judgement {
        const COB_ID_SYNC: Mux = Mux::new(0x1005, 0);
        let every = self.optional_time(&step.every, DEFAULT_SYNC_PERIOD)?;
        let cob_id = self.dut.eds.entry(COB_ID_SYNC).and_then(|entry| {
            match entry.default.as_ref()?.resolve(self.dut.node) {
                Value::Int(cob_id) => Some((cob_id & 0x7FF) as u16),
                _ => None,
            }
        });
        let frame = Frame::new(cob_id.unwrap_or(sync::COB_ID), []);
        self.repeat(&frame, step.count, every)?;
        Ok(None)
    }

    fn produce(&mut self, produce: &Produce) -> Result<(), Trouble> {
        let frame = self.frame(&produce.frame)?;
        let every = self.time(&produce.every)?;
        self.repeat(&frame, produce.count, every)
    }

    fn repeat(&mut self, frame: &Frame, count: usize, every: Duration) -> Result<(), Trouble> {
        let mut next = self.link.mark();
        for place in 0..count {
            if place > 0 {
                self.link.wait(next)?;
            }
            self.link.send(frame)?;
            next += every;
        }
        Ok(())
    }

    fn stimulate(&mut self, during: Option<&Produce>) -> Result<(), Trouble> {
        during.map_or(Ok(()), |produce| self.produce(produce))
    }

    /// Looks again at what came while frames were sent.
    fn link_rewind(&mut self, stimulated: bool, start: Instant) {
        if stimulated {
            self.link.look_from(start);
        }
    }

    fn raw_write(&mut self, mux: Mux, data: &[u8]) -> Result<Ended, Trouble> {
        let flow = Transfer::usual(data.len());
        Ok(sdo::download(self.link, self.policy, self.dut.node, mux, data, flow)?)
    }

    fn must_write(&mut self, mux: Mux, data: &[u8]) -> Result<(), Trouble> {
        let ended = self.raw_write(mux, data)?;
        accepted(mux, data, self.dut.eds.entry(mux), ended).map(|_| ())
    }

    fn taken(&self, ended: Ended, what: impl Fn() -> String) -> Result<(), Trouble> {
        match ended.result {
            Ok(_) => Ok(()),
            Err(failure) => {
                let difference =
                    Difference::new(format!("{} is accepted", what()), failure.to_string());
                Err(Trouble::Device(Difference { raw: ended.raw, ..difference }))
            }
        }
    }

    fn condition(
        &self,
        entry: Option<&Entry>,
        [value, mask, min, max]: [&Option<At<Literal>>; 4],
        length: Option<&At<Literal>>,
    ) -> Result<Condition, Trouble> {
        let bytes = |literal: &Option<At<Literal>>| {
            let Some((literal, entry)) = literal.as_ref().zip(entry) else { return Ok(None) };
            self.scope.bytes(&literal.value, entry).map(Some).map_err(Trouble::Bench)
        };
        let length = match length {
            Some(length) => Some(self.scope.int(&length.value).map_err(Trouble::Bench)? as usize),
            None => None,
        };
        Ok(Condition {
            value: bytes(value)?,
            mask: bytes(mask)?,
            min: bytes(min)?,
            max: bytes(max)?,
            length,
        })
    }

    /// The bytes of a value to write; one that does not fit its object goes out in the shortest
    /// length that holds it, for the device to refuse.
    fn write_value(&self, mux: Mux, literal: &Literal) -> Result<Vec<u8>, Trouble> {
        if let Some(entry) = self.dut.eds.entry(mux) {
            match self.scope.bytes(literal, entry) {
                Ok(bytes) => return Ok(bytes),
                Err(wrong) if entry.data_type.is_integer() => {
                    let number = self.scope.int(literal).map_err(|_| Trouble::Bench(wrong))?;
                    let size = entry.data_type.size().unwrap_or(4);
                    return Ok(number.to_le_bytes()[..size].to_vec());
                }
                Err(wrong) => return Err(Trouble::Bench(wrong)),
            }
        }
        let number = self.scope.int(literal).map_err(Trouble::Bench)?;
        let size = [1, 2, 4].into_iter().find(|size| number.unsigned_abs() >> (8 * size) == 0);
        Ok(number.to_le_bytes()[..size.unwrap_or(8)].to_vec())
    }

    fn frame(&self, text: &At<FrameText>) -> Result<Frame, Trouble> {
        let pattern = self.pattern(text)?;
        pattern
            .frame()
            .ok_or_else(|| Trouble::Bench(format!("{pattern} has holes and cannot be sent")))
    }

    fn pattern(&self, text: &At<FrameText>) -> Result<Pattern, Trouble> {
        self.scope.pattern(&text.value, self.dut.node).map_err(Trouble::Bench)
    }

    fn mux(&self, object: &At<ObjectRef>) -> Result<Mux, Trouble> {
        self.scope.mux(&object.value).map_err(Trouble::Bench)
    }

    fn time(&self, amount: &At<Amount>) -> Result<Duration, Trouble> {
        self.scope.time(&amount.value).map_err(Trouble::Bench)
    }

    fn optional_time(
        &self,
        amount: &Option<At<Amount>>,
        usual: Duration,
    ) -> Result<Duration, Trouble> {
        amount.as_ref().map_or(Ok(usual), |amount| self.time(amount))
    }
}

fn device(difference: Difference) -> Judgement {
    Err(Trouble::Device(difference))
}

fn accepted(mux: Mux, data: &[u8], entry: Option<&Entry>, ended: Ended) -> Judgement {
    match ended.result {
        Ok(_) => Ok(None),
        Err(failure) => {
            let mut actual = failure.to_string();
            if failure == canopen::sdo::Failure::Aborted(Abort::GENERAL) {
                actual.push_str(", which does not say why");
            }
            let expected = format!("{mux} takes {}", show(entry, data));
            device(Difference { raw: ended.raw, ..Difference::new(expected, actual) })
        }
    }
}

/// An expedited answer without a size has the length of the object (CiA 301, 7.2.4.3.4).
fn trim_unsized(ended: &mut Ended, entry: Option<&Entry>) {
    if let (true, Ok(data), Some(size)) =
        (ended.unsized_data, &mut ended.result, entry.and_then(|entry| entry.data_type.size()))
    {
        data.truncate(size);
    }
}
