//! The effects of a case on a device, known before it runs: the frames that its steps send, as far
//! as their names are bound, and those that set back what they write.

use std::collections::BTreeSet;

use canopen::nmt::Command;
use canopen::sdo::{Initiate, Request};
use canopen::{Data, Frame, Mux};

use super::bytes::{fill, mapping_word, parse_bytes};
use super::instance::Instance;
use super::scope::Scope;
use crate::dut::Dut;
use crate::protect::{Deed, Wire};
use crate::source::At;
use crate::suite::literal::FrameText;
use crate::suite::model::State;
use crate::suite::step::{Ask, Nmt, Produce, Remap, Step, Write};

/// The effects of the case, in order. Each write of 1010h and 1011h counts; other deeds may occur
/// more than once.
pub fn deeds(instance: &Instance, dut: &Dut) -> Vec<Deed> {
    let mut taking = Taking { instance, dut, wire: dut.wire.as_ref().clone(), deeds: Vec::new() };
    taking.deeds.extend(match instance.case().state {
        Some(State::Operational) => Some(Deed::Start),
        Some(State::Stopped) => Some(Deed::Stop),
        Some(State::PreOperational) | None => None,
    });
    for (mux, _) in instance.bench_needs(dut) {
        taking.write(mux, &[]);
    }
    for step in instance.case().all_steps() {
        taking.step(&step.value);
    }
    taking.restoring();
    taking.deeds
}

/// Why a device is protected from the case.
pub(crate) fn protected(instance: &Instance, dut: &Dut) -> Option<String> {
    if dut.protection.is_none() || !instance.needs_device() {
        return None;
    }
    let deeds = deeds(instance, dut);
    let refused = deeds.iter().find_map(|deed| dut.protection.refuses(*deed));
    refused.or_else(|| dut.protection.exceeded(&deeds))
}

struct Taking<'t> {
    instance: &'t Instance,
    dut: &'t Dut,
    wire: Wire,
    deeds: Vec<Deed>,
}

impl Taking<'_> {
    fn step(&mut self, step: &Step) {
        match step {
            Step::Send(frame) => self.frame(frame, 1),
            Step::Ask(ask) => {
                let Ask { first, send, count, tries, .. } = &**ask;
                let times = count.unwrap_or(1) * tries.unwrap_or(1);
                first.iter().chain([send]).for_each(|frame| self.frame(frame, times));
            }
            Step::Produce(produce) => self.produce(produce),
            Step::Expect(expect) => self.during(expect.during.as_ref()),
            Step::Never(never) => self.during(never.during.as_ref()),
            Step::Measure(measure) => self.during(measure.during.as_ref()),
            Step::Collect(collect) => self.during(collect.during.as_ref()),
            Step::Write(write) => self.write_step(write),
            Step::Remap(remap) => self.remap(remap),
            Step::Bench(_) => self.deeds.push(Deed::Stimulus),
            Step::Partner(_) => self.deeds.push(Deed::Partner),
            Step::Nmt(nmt) => self.sent(&nmt_frame(*nmt, self.dut.node), 1),
            // None of these sends anything but uploads, SYNC, and LSS requests.
            Step::Reply(_)
            | Step::Read(_)
            | Step::Until(_)
            | Step::Defaults(_)
            | Step::Wait(_)
            | Step::Sync(_)
            | Step::Observe(_)
            | Step::Eds(_)
            | Step::Undeclared(_)
            | Step::Lss(_) => {}
        }
    }

    fn scope(&self) -> &Scope {
        &self.instance.scope
    }

    fn during(&mut self, produce: Option<&Produce>) {
        if let Some(produce) = produce {
            self.produce(produce);
        }
    }

    fn produce(&mut self, produce: &Produce) {
        self.frame(&produce.frame, produce.count);
    }

    fn frame(&mut self, text: &At<FrameText>, times: usize) {
        let Some(pattern) = self.scope().known_pattern(&text.value, self.dut.node) else { return };
        let zeros = Frame { id: pattern.id(), data: Data::from([0; 8]), remote: false };
        let frame = pattern.frame().unwrap_or_else(|| pattern.edit(&zeros));
        self.sent(&frame, times);
    }

    fn sent(&mut self, frame: &Frame, times: usize) {
        for deed in self.wire.deeds(frame) {
            let counts = matches!(deed.written(), Some(0x1010 | 0x1011));
            self.deeds.extend(std::iter::repeat_n(deed, if counts { times } else { 1 }));
        }
        self.wire.learn(frame);
    }

    /// A download, of which the begin says everything; of a value that is not known yet, zeros.
    fn write(&mut self, mux: Mux, data: &[u8]) {
        let mut first = [0; 4];
        for (byte, value) in first.iter_mut().zip(data) {
            *byte = *value;
        }
        let request = Request::Download(mux, Initiate::Unsized(first));
        self.sent(&request.frame(self.dut.node), 1);
    }

    fn write_step(&mut self, write: &Write) {
        let Ok(mux) = self.scope().mux(&write.object.value) else { return };
        let entry = self.dut.eds.entry(mux);
        if write.if_there && !entry.is_some_and(|entry| entry.access.writable()) {
            return;
        }
        let value = write.value.as_ref().zip(entry);
        let data = match (value, &write.bytes, &write.fill) {
            (Some((value, entry)), ..) => self.scope().bytes(&value.value, entry).ok(),
            (_, Some(bytes), _) => parse_bytes(&bytes.value),
            (.., Some(_)) => Some(fill(4)),
            (None, None, None) => None,
        };
        self.write(mux, &data.unwrap_or_default());
    }

    fn remap(&mut self, remap: &Remap) {
        let Ok(count) = self.scope().mux(&remap.pdo.value) else { return };
        for (literal, sub) in remap.objects.iter().zip(1..) {
            let word = mapping_word(&literal.value, self.scope(), self.dut).unwrap_or_default();
            self.write(Mux::new(count.index, sub), &word.to_le_bytes());
        }
        self.write(count, &[remap.objects.len() as u8]);
    }

    /// Adds the frames that undo the case: written objects are written back, with a PDO everything
    /// it depends on, and stored values are stored again.
    fn restoring(&mut self) {
        let written = self.deeds.iter().filter_map(|deed| match deed {
            Deed::Write(mux, _) => Some(*mux),
            _ => None,
        });
        let written: BTreeSet<Mux> = written.collect();
        let of_pdos = written.iter().filter(|mux| matches!(mux.index, 0x1400..=0x1BFF));
        let of_pdos: BTreeSet<u16> = of_pdos.map(|mux| mux.index).collect();
        for index in of_pdos {
            // The mapping parameter of a PDO is 200h above its communication parameter.
            if index & 0x0200 != 0 {
                let object = self.dut.eds.object(index);
                let entries = object.into_iter().flat_map(|object| &object.entries);
                let entries: Vec<Mux> = entries.map(|entry| entry.mux).collect();
                entries.into_iter().for_each(|mux| self.write(mux, &[]));
            }
            self.write(Mux::new(index & !0x0200, 1), &[]);
        }
        if written.iter().any(|mux| matches!(mux.index, 0x1010 | 0x1011)) {
            self.write(Mux::new(0x1010, 1), &[]);
        }
    }
}

/// The command that a step sends.
pub(crate) fn nmt_frame(nmt: Nmt, node: u8) -> Frame {
    Command { service: nmt.service(), node }.frame()
}
