//! The steps that read and write objects.

use std::time::Duration;

use canopen::eds::Entry;
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::block::LARGEST_BLOCK;
use canopen::sdo::{Failure, Transfer};
use canopen::{Abort, Frame, Mux};

use super::judge::{Answer, Condition, Difference, Judged, Judgement, Trouble, refusal, show};
use super::run::Steps;
use crate::plan::{Binding, fill, mapping_word, matching_entries, parse_bytes, show_bytes};
use crate::run::link::sdo::{self, Ended};
use crate::source::At;
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::each::Objects;
use crate::suite::literal::{Flow, Literal, show_time};
use crate::suite::refusal::Refusal;
use crate::suite::step::{Read, Remap, Until, Write};

/// COB-ID EMCY.
const EMCY_ID: Mux = Mux::new(0x1014, 0);
const DEFAULT_POLL: Duration = Duration::from_millis(20);
/// Of a longer value to write, a difference shows this many bytes.
const LONGEST_SHOWN: usize = 64;

impl Steps<'_, '_> {
    pub(super) fn read(&mut self, read: &Read) -> Judgement {
        let mux = self.mux(&read.object)?;
        let entry = self.dut.eds.entry(mux).cloned();
        let block = match &read.block_size {
            Some(size) => Some(self.scope.int(&size.value).map_err(Trouble::Impossible)? as u8),
            None => (read.transfer == Some(Flow::Block)).then_some(LARGEST_BLOCK),
        };
        let (policy, node) = (self.policy, self.dut.node);
        let mut ended = match block {
            Some(block) => sdo::upload_in_blocks(self.link, policy, node, mux, block)?,
            None => sdo::upload(self.link, policy, node, mux)?,
        };
        if let Some(expected) = &read.refused {
            return self.refused(&ended, &expected.value);
        }
        trim_unsized(&mut ended, entry.as_ref());
        let bounds = [read.value.as_ref(), read.min.as_deref(), read.max.as_deref()];
        let entry = entry.map(|entry| Self::with_sign(entry, &bounds, &read.tolerated));
        let condition = self.condition(
            entry.as_ref(),
            read.value.as_ref(),
            [&read.mask, &read.min, &read.max],
            &read.tolerated,
            read.length.as_deref(),
        )?;
        let words = Some((self.words, &read.object.value));
        let condition = Condition { characters: read.characters, words, ..condition };
        let data = match ended.result {
            Ok(data) => data,
            Err(failure) => return self.unread(read, mux, &failure, ended.raw),
        };
        let about = |difference: Difference| Difference {
            expected: format!("{mux} = {}", difference.expected),
            raw: ended.raw,
            ..difference
        };
        let lenient = match condition.judge(entry.as_ref(), &data) {
            Judged::Right => None,
            Judged::Tolerated(place, difference) => {
                self.allows(Allowance::Tolerated(place));
                Some(about(difference))
            }
            Judged::Wrong(_, difference) if read.or_another => {
                self.allows(Allowance::OrAnother);
                let Difference { expected, actual, .. } = about(difference);
                return Err(Trouble::Declined(format!("expected {expected}, came {actual}")));
            }
            Judged::Wrong(constraints, difference) => {
                self.broken(&constraints, about(difference))?
            }
        };
        if let Some(flow) = read.transfer
            && Transfer::from(flow) != ended.protocol
        {
            let name = |transfer| match transfer {
                Transfer::Expedited => "an expedited transfer",
                Transfer::Segmented => "a segmented transfer",
                Transfer::Block => "a block transfer",
            };
            let wrong = Difference::new(name(flow.into()), name(ended.protocol));
            self.broken(&[Constraint::Transfer], Difference { raw: ended.raw, ..wrong })?;
        }
        if let Some(At { value: name, .. }) = read.save.as_deref() {
            let value = entry.as_ref().and_then(|entry| {
                Some(Binding::Value(entry.data_type.decode(&data).ok()?, entry.data_type))
            });
            self.scope.bind(name.0.to_string(), value.unwrap_or(Binding::Bytes(data)));
        }
        Ok(lenient)
    }

    /// Judges an upload that gave no value.
    fn unread(
        &mut self,
        read: &Read,
        mux: Mux,
        failure: &Failure,
        raw: Option<Frame>,
    ) -> Judgement {
        let expected = format!("the value of {mux}");
        if let Failure::Aborted(code) = failure
            && let Some(place) = read.lenient.iter().position(|may| may.fits(code.0))
        {
            self.allows(Allowance::Lenient(place + 1));
            let difference = Difference::new(expected, code.to_string());
            return Ok(Some(Difference { raw, ..difference }));
        }
        let difference = Difference::new(expected, failure.to_string());
        self.broken(&[], Difference { raw, ..difference })
    }

    pub(super) fn write(&mut self, write: &Write) -> Judgement {
        let mux = self.mux(&write.object)?;
        let writable = self.dut.eds.entry(mux).is_some_and(|entry| entry.access.writable());
        if write.if_there && !writable {
            return Ok(None);
        }
        let data = match (&write.value, &write.bytes, &write.fill) {
            (Some(value), ..) => self.write_value(mux, &value.value)?,
            (_, Some(bytes), _) => parse_bytes(&bytes.value).unwrap_or_default(),
            (.., Some(len)) => {
                fill(self.scope.int(&len.value).map_err(Trouble::Impossible)? as usize)
            }
            (None, None, None) => Vec::new(),
        };
        let flow = write.transfer.map_or_else(|| Transfer::usual(data.len()), Transfer::from);
        let (policy, node) = (self.policy, self.dut.node);
        let mut ended = match write.mistake {
            Some(mistake) => {
                sdo::download_with(mistake.into(), self.link, policy, node, mux, &data)?
            }
            None => sdo::download(self.link, policy, node, mux, &data, flow)?,
        };
        if let Some(expected) = &write.refused {
            return self.refused(&ended, &expected.value);
        }
        let may_be_valid = mux == EMCY_ID && write.if_there;
        if may_be_valid
            && matches!(ended.result, Err(Failure::Aborted(_)))
            && let Ok(cob_id) = data[..].try_into()
        {
            // Another identifier may be in use, which only changes while it is disabled.
            let off = (u32::from_le_bytes(cob_id) | CobId::INVALID).to_le_bytes();
            sdo::download(self.link, self.policy, self.dut.node, mux, &off, flow)?;
            ended = sdo::download(self.link, self.policy, self.dut.node, mux, &data, flow)?;
        }
        if let Err(Failure::Aborted(code)) = ended.result
            && let Some(place) = write.or_refused.iter().position(|may| may.value.fits(code.0))
        {
            self.allows(Allowance::OrRefused(place + 1));
            let value = match data.len() {
                long if long > MOST_SHOWN => format!("{long} bytes"),
                _ => show(self.dut.eds.entry(mux), &data),
            };
            return Err(Trouble::Declined(format!("the device refused {value} in {mux}: {code}")));
        }
        if let Some(At { value: name, .. }) = write.save.as_deref() {
            self.scope.bind(name.0.to_string(), Binding::Bytes(data.clone()));
        }
        accepted(mux, &data, self.dut.eds.entry(mux), ended)
    }

    pub(super) fn remap(&mut self, remap: &Remap) -> Judgement {
        let count = self.mux(&remap.pdo)?;
        // The mapping parameter of a PDO is 200h above its communication parameter.
        let cob_id = Mux::new(count.index & !0x0200, 1);
        let mut words = Vec::new();
        for object in &remap.objects {
            words.push(
                mapping_word(&object.value, &self.scope, self.dut).map_err(Trouble::Impossible)?,
            );
        }
        let before = sdo::upload(self.link, self.policy, self.dut.node, cob_id)?;
        let before = match before.result.as_deref().map(<[u8]>::first_chunk::<4>) {
            Ok(Some(bytes)) => u32::from_le_bytes(*bytes),
            _ => {
                return Err(Trouble::Device(Difference {
                    raw: before.raw,
                    ..Difference::new(format!("the value of {cob_id}"), "none")
                }));
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
                    return self.refused(&ended, expected);
                }
                _ => self.taken(ended, || {
                    format!("the mapping of {:?} at {entry}", Mapping::decode(*word))
                })?,
            }
        }
        let ended = self.raw_write(count, &[words.len() as u8])?;
        if let Some(expected) = expected {
            return self.refused(&ended, expected);
        }
        self.taken(ended, || format!("{} mapped objects at {count}", words.len()))?;
        self.must_write(cob_id, &(before & !CobId::INVALID).to_le_bytes())?;
        Ok(None)
    }

    pub(super) fn defaults(&mut self, objects: &Objects) -> Judgement {
        let entries = matching_entries(objects, self.dut)
            .map_err(|wrong| Trouble::Impossible(wrong.value))?;
        let unless = objects.unless.as_ref().map(|object| self.mux(object)).transpose()?;
        let may_differ = unless.is_some_and(|mux| self.dut.eds.entry(mux).is_some());
        let mut lenient = None;
        for entry in entries.into_iter().cloned().collect::<Vec<_>>() {
            let default = entry.default_bytes(self.dut.node);
            let value =
                default.map_err(|wrong| Trouble::Impossible(format!("{}: {wrong}", entry.mux)))?;
            let mut ended = sdo::upload(self.link, self.policy, self.dut.node, entry.mux)?;
            trim_unsized(&mut ended, Some(&entry));
            let judged = match &ended.result {
                Ok(data) => Condition { value: Some(value), ..Condition::default() }
                    .judge(Some(&entry), data),
                Err(failure) => {
                    let wrong = Difference::new(show(Some(&entry), &value), failure.to_string());
                    Judged::Wrong(Vec::new(), wrong)
                }
            };
            if let Judged::Wrong(constraints, wrong) = judged {
                let expected = format!("{} = {}", entry.mux, wrong.expected);
                let sheet = self.line_of(entry.mux, "DefaultValue");
                let wrong = Difference { expected, raw: ended.raw, sheet, ..wrong };
                match may_differ {
                    true => _ = lenient.get_or_insert(wrong),
                    false => _ = self.broken(&constraints, wrong)?,
                }
            }
        }
        Ok(lenient)
    }

    pub(super) fn until(&mut self, until: &Until) -> Judgement {
        let mux = self.mux(&until.object)?;
        let bounds = [until.value.as_ref(), until.min.as_deref(), until.max.as_deref()];
        let entry = self.dut.eds.entry(mux).cloned();
        let entry = entry.map(|entry| Self::with_sign(entry, &bounds, &until.tolerated));
        let condition = self.condition(
            entry.as_ref(),
            until.value.as_ref(),
            [&until.mask, &until.min, &until.max],
            &until.tolerated,
            None,
        )?;
        let words = Some((self.words, &until.object.value));
        let condition = Condition { words, ..condition };
        let within = self.time(&until.within)? * self.patience;
        let every = self.optional_time(&until.every, DEFAULT_POLL)?.max(Duration::from_millis(1));
        let start = self.link.mark();
        let end = start + within;
        loop {
            let mut ended = sdo::upload(self.link, self.policy, self.dut.node, mux)?;
            trim_unsized(&mut ended, entry.as_ref());
            // A tolerated value may still change to the expected one: it counts at the end.
            let judged = match ended.result {
                Ok(data) => condition.judge(entry.as_ref(), &data),
                Err(failure) => {
                    let expected = format!("the value of {mux}");
                    let difference = Difference::new(expected, failure.to_string());
                    return self.broken(&[], Difference { raw: ended.raw, ..difference });
                }
            };
            if matches!(judged, Judged::Right) {
                return Ok(None);
            }
            if self.link.mark() >= end {
                let at_last = |difference: Difference| Difference {
                    expected: format!(
                        "{mux} = {} within {}",
                        difference.expected,
                        show_time(within)
                    ),
                    raw: ended.raw,
                    ..difference
                };
                return match judged {
                    Judged::Right => Ok(None),
                    Judged::Tolerated(place, difference) => {
                        self.allows(Allowance::Tolerated(place));
                        Ok(Some(at_last(difference)))
                    }
                    Judged::Wrong(constraints, difference) => {
                        self.broken(&constraints, at_last(difference))
                    }
                };
            }
            // The longer the wait, the rarer the poll, unless the suite gives an interval.
            let waited = self.link.mark().since(start);
            let seldom = if until.every.is_none() { waited / 8 } else { Duration::ZERO };
            let next = self.link.mark() + every.max(seldom);
            self.link.wait(next.min(end))?;
        }
    }

    /// Judges the end of a transfer that must be refused.
    fn refused(&mut self, ended: &Ended, expected: &Refusal) -> Judgement {
        match refusal(&ended.result, expected, ended.raw) {
            Answer::Demanded => Ok(None),
            Answer::Allowed(allowance, difference) => {
                self.allows(allowance);
                Ok(Some(difference))
            }
            Answer::Wrong(constraints, difference) => self.broken(&constraints, difference),
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

    /// The entry as the numbers of a step take it: with a sign where one of them is negative. A
    /// data sheet may call a value unsigned that the documents count below 0; on the bus both are
    /// the same bytes.
    fn with_sign(
        entry: Entry,
        bounds: &[Option<&At<Literal>>],
        tolerated: &[At<Literal>],
    ) -> Entry {
        let mut numbers = bounds.iter().copied().flatten().chain(tolerated);
        let is_signed = numbers.any(|at| matches!(at.value, Literal::Int(number) if number < 0));
        match entry.data_type.with_sign().filter(|_| is_signed) {
            Some(data_type) => Entry { data_type, ..entry },
            None => entry,
        }
    }

    fn condition(
        &self,
        entry: Option<&Entry>,
        value: Option<&At<Literal>>,
        [mask, min, max]: [&Option<Box<At<Literal>>>; 3],
        tolerated: &[At<Literal>],
        length: Option<&At<Literal>>,
    ) -> Result<Condition<'static>, Trouble> {
        let of = |literal: &At<Literal>| {
            let bytes = entry.map(|entry| self.scope.bytes(&literal.value, entry));
            bytes.transpose().map_err(Trouble::Impossible)
        };
        let bytes = |literal: Option<&At<Literal>>| literal.map_or(Ok(None), of);
        let others = tolerated.iter().filter_map(|value| of(value).transpose());
        let length = match length {
            Some(length) => {
                Some(self.scope.int(&length.value).map_err(Trouble::Impossible)? as usize)
            }
            None => None,
        };
        Ok(Condition {
            words: None,
            value: bytes(value)?,
            tolerated: others.collect::<Result<_, _>>()?,
            mask: bytes(mask.as_deref())?,
            min: bytes(min.as_deref())?,
            max: bytes(max.as_deref())?,
            length,
            characters: None,
        })
    }

    /// The bytes of a value to write; one that does not fit its object goes out in the shortest
    /// length that holds it, for the device to refuse.
    fn write_value(&self, mux: Mux, literal: &Literal) -> Result<Vec<u8>, Trouble> {
        if let Some(entry) = self.dut.eds.entry(mux) {
            match self.scope.bytes(literal, entry) {
                Ok(bytes) => return Ok(bytes),
                Err(wrong) if entry.data_type.is_integer() => {
                    let number = self.scope.int(literal).map_err(|_| Trouble::Impossible(wrong))?;
                    let size = entry.data_type.size().unwrap_or(4);
                    return Ok(number.to_le_bytes()[..size].to_vec());
                }
                Err(wrong) => return Err(Trouble::Impossible(wrong)),
            }
        }
        let number = self.scope.int(literal).map_err(Trouble::Impossible)?;
        let size = [1, 2, 4].into_iter().find(|size| number.unsigned_abs() >> (8 * size) == 0);
        Ok(number.to_le_bytes()[..size.unwrap_or(8)].to_vec())
    }
}

fn accepted(mux: Mux, data: &[u8], entry: Option<&Entry>, ended: Ended) -> Judgement {
    match ended.result {
        Ok(_) => Ok(None),
        Err(failure) => {
            let mut actual = failure.to_string();
            if failure == Failure::Aborted(Abort::GENERAL) {
                actual.push_str(", which does not say why");
            }
            let value = match data.get(..LONGEST_SHOWN) {
                Some(first) if first.len() < data.len() => {
                    format!("{} bytes that begin with {}", data.len(), show_bytes(first))
                }
                _ => show(entry, data),
            };
            let expected = format!("{mux} takes {value}");
            Err(Trouble::Device(Difference { raw: ended.raw, ..Difference::new(expected, actual) }))
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

/// How many bytes of a value that was refused are shown.
const MOST_SHOWN: usize = 32;
