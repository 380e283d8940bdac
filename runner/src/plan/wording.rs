//! A step in words: `write logic-1-a2-operator (3412:05) = greater (2)`. Used to explain a case,
//! and to report what was done.

use std::fmt::Display;

use canopen::{Mux, Value};

use super::scope::{Binding, Scope};
use crate::source::At;
use crate::suite::Words;
use crate::suite::literal::{
    Amount, FrameText, Literal, Mistake, Name, ObjectRef, Tolerance, show_time,
};
use crate::suite::step::{
    Ask, Bounds, Collect, Expect, LssStep, Measure, Never, Nmt, Observe, Produce, Read, Remap,
    Step, Undeclared, Until, Write,
};

/// The words of a suite, and the values of names where they are known.
#[derive(Clone, Copy)]
pub struct Wording<'w> {
    /// The document's words for objects and values.
    pub words: &'w Words,
    /// The values of names in an instance; unknown when a case is explained.
    pub scope: Option<&'w Scope>,
    /// The node id of the device; unknown in the same way.
    pub node: Option<u8>,
}

impl Wording<'_> {
    /// The step in words, in one line.
    pub fn step(&self, step: &Step) -> String {
        match step {
            Step::Send(frame) => format!("send {}", self.frame(frame)),
            Step::Reply(reply) => format!("the answer is {}", self.frame(&reply.frame)),
            Step::Ask(ask) => self.ask(ask),
            Step::Expect(expect) => self.expect(expect),
            Step::Never(never) => self.never(never),
            Step::Collect(collect) => self.collect(collect),
            Step::Measure(measure) => self.measure(measure),
            Step::Read(read) => self.read(read),
            Step::Write(write) => self.write(write),
            Step::Until(until) => self.until(until),
            Step::Defaults(_) => "each entry has its default value".to_owned(),
            Step::Remap(remap) => self.remap(remap),
            Step::Nmt(nmt) => command(*nmt).to_owned(),
            Step::Wait(time) => format!("wait {}", self.time(time)),
            Step::Sync(sync) => match &sync.every {
                Some(every) => {
                    format!("send SYNC {} times, every {}", sync.count, self.time(every))
                }
                None => format!("send SYNC {} times", sync.count),
            },
            Step::Produce(produce) => self.produce(produce),
            Step::Bench(stimuli) => {
                let stimuli = stimuli
                    .0
                    .iter()
                    .map(|(name, value)| format!("{name} = {}", self.on_bench(name, &value.value)));
                format!("bench: {}", list(stimuli, "nothing"))
            }
            Step::Observe(observe) => self.observe(observe),
            Step::Partner(partner) => {
                format!(
                    "the other node sends its heartbeat every {}",
                    self.time(&partner.heartbeat)
                )
            }
            Step::Eds(eds) => {
                let without = &eds.without;
                let findings = without.iter().map(|finding| finding.value.clone());
                format!("the data sheet has no finding {}", list(findings, "at all"))
            }
            Step::Undeclared(undeclared) => {
                let Undeclared { range, subs, .. } = &**undeclared;
                let what = if *subs { "sub-indices" } else { "objects" };
                format!("{what} in {} that the device does not have are refused", range.value)
            }
            Step::Lss(lss) => match &**lss {
                LssStep::Fastscan(scan) => {
                    let parts = [&scan.vendor, &scan.product, &scan.revision, &scan.serial];
                    let parts = parts.map(|part| self.value(None, &part.value));
                    format!("LSS fastscan for {}", parts.join(", "))
                }
            },
        }
    }

    fn ask(&self, ask: &Ask) -> String {
        let times = ask.count.map_or_else(String::new, |count| format!(" {count} times"));
        let (request, answer) = (self.frame(&ask.send), self.frame(&ask.reply));
        let first = ask.first.as_ref();
        let first = first.map_or_else(String::new, |first| format!("send {}, ", self.frame(first)));
        format!("{first}ask {request}{times}, the answer is {answer}")
    }

    fn expect(&self, expect: &Expect) -> String {
        let after = expect.after.as_ref();
        let after = after.map_or_else(String::new, |after| format!(" after {}", self.time(after)));
        let (frame, within) = (self.frame(&expect.frame), self.time(&expect.within));
        let during = self.during(expect.during.as_ref());
        format!("expect {frame}{after} within {within}{during}")
    }

    fn never(&self, never: &Never) -> String {
        let (frame, time) = (self.frame(&never.frame), self.time(&never.time));
        format!("no {frame} for {time}{}", self.during(never.during.as_ref()))
    }

    fn collect(&self, collect: &Collect) -> String {
        let (count, frame) = (self.value(None, &collect.count.value), self.frame(&collect.frame));
        let time = self.time(&collect.time);
        format!("{count} of {frame} in {time}{}", self.during(collect.during.as_ref()))
    }

    fn measure(&self, measure: &Measure) -> String {
        let bounds = [
            ("interval", &measure.interval),
            ("mean", &measure.mean),
            ("median", &measure.median),
            ("latency", &measure.latency),
        ];
        let bounds = bounds.into_iter().filter_map(|(what, bounds)| {
            Some(format!(", {what} {}", self.bounds(bounds.as_ref()?)))
        });
        let (count, frame) = (measure.count, self.frame(&measure.frame));
        let during = self.during(measure.during.as_ref());
        format!("measure {count} of {frame}{}{during}", bounds.collect::<String>())
    }

    fn remap(&self, remap: &Remap) -> String {
        let objects = remap.objects.iter().map(|object| self.mapped(&object.value));
        let objects = list(objects, "nothing");
        let refused = remap.refused.as_ref();
        let refused = refused.map_or_else(String::new, |code| format!(", {}", code.value));
        format!("map {objects} by {}{refused}", self.object(&remap.pdo))
    }

    fn write(&self, write: &Write) -> String {
        let key = &write.object.value;
        let object = self.object(&write.object);
        let value = match (&write.value, &write.bytes, &write.fill) {
            (Some(value), ..) => self.value(Some(key), &value.value),
            (_, Some(bytes), _) => bytes.value.clone(),
            (.., Some(length)) => format!("{} bytes of text", self.value(None, &length.value)),
            (None, None, None) => String::new(),
        };
        let refused = write.refused.as_ref();
        let refused = refused.map_or_else(String::new, |code| format!(", {}", code.value));
        let declined = if write.or_refused.is_empty() { "" } else { ", or refused" };
        let mistake = match write.mistake {
            None => "",
            Some(Mistake::LostSegment) => " in blocks, the first segment lost",
            Some(Mistake::LaterSegmentsLost) => " in blocks, two later segments lost",
            Some(Mistake::RepeatedSegment) => " in blocks, the first segment twice",
            Some(Mistake::WrongChecksum) => " in blocks, with a wrong checksum",
        };
        let kept = kept(write.save.as_deref());
        format!("write {object} = {value}{mistake}{refused}{declined}{kept}")
    }

    fn read(&self, read: &Read) -> String {
        let key = &read.object.value;
        let object = self.object(&read.object);
        if let Some(refused) = &read.refused {
            return format!("read {object}, {}", refused.value);
        }
        let mask = read.mask.as_deref();
        let judged =
            self.judged(Some(key), &read.value, mask, read.min.as_deref(), read.max.as_deref());
        let tolerated = match read.tolerated.is_empty() {
            true => String::new(),
            false => {
                let values = read.tolerated.iter().map(|value| self.value(Some(key), &value.value));
                format!(", {} is tolerated", list(values, ""))
            }
        };
        let another = if read.or_another { ", or another value" } else { "" };
        let kept = kept(read.save.as_deref());
        format!("read {object}{}{tolerated}{another}{kept}", expected(&judged))
    }

    fn until(&self, until: &Until) -> String {
        let key = &until.object.value;
        let mask = until.mask.as_deref();
        let judged =
            self.judged(Some(key), &until.value, mask, until.min.as_deref(), until.max.as_deref());
        let (object, within) = (self.object(&until.object), self.time(&until.within));
        format!("until {object}{judged} within {within}")
    }

    fn observe(&self, observe: &Observe) -> String {
        let name = &observe.bench.value;
        let value = |value: &Option<At<Literal>>| {
            value.as_ref().map(|value| self.on_bench(name, &value.value))
        };
        let judged = range(value(&observe.value), value(&observe.min), value(&observe.max));
        let within = observe.within.as_ref();
        let within =
            within.map_or_else(String::new, |within| format!(" within {}", self.time(within)));
        format!("observe {}{}{within}", observe.bench.value, expected(&judged))
    }

    /// ` = 5`, ` from 5 to 7`, ` = 4 in the bits 6`.
    fn judged(
        &self,
        key: Option<&ObjectRef>,
        value: &Option<At<Literal>>,
        mask: Option<&At<Literal>>,
        min: Option<&At<Literal>>,
        max: Option<&At<Literal>>,
    ) -> String {
        let shown = |value: &At<Literal>| self.value(key, &value.value);
        let mask = mask.map(|mask| format!(" in the bits {}", shown(mask)));
        let range = range(value.as_ref().map(shown), min.map(shown), max.map(shown));
        range + &mask.unwrap_or_default()
    }

    /// `broken`, `750 mA`.
    fn on_bench(&self, name: &str, literal: &Literal) -> String {
        let value = match (literal, self.scope) {
            (Literal::Int(number), _) => Some(Value::Int(*number)),
            (Literal::Real(number), _) => Some(Value::Real(*number)),
            (_, Some(scope)) => scope.value(literal).ok(),
            _ => None,
        };
        value.map_or_else(|| literal.to_string(), |value| self.words.bench_value(name, &value))
    }

    fn produce(&self, produce: &Produce) -> String {
        let (frame, every) = (self.frame(&produce.frame), self.time(&produce.every));
        format!("send {frame} {} times, every {every}", produce.count)
    }

    fn during(&self, during: Option<&Produce>) -> String {
        during.map_or_else(String::new, |sent| format!(", meanwhile {}", self.produce(sent)))
    }

    fn bounds(&self, bounds: &Bounds) -> String {
        let strict = self.tolerance(&bounds.strict.value);
        match &bounds.lenient {
            Some(lenient) => format!("{strict} ({} tolerated)", self.tolerance(&lenient.value)),
            None => strict,
        }
    }

    fn tolerance(&self, tolerance: &Tolerance) -> String {
        let time = |amount: &Amount| self.amount(amount);
        match tolerance {
            Tolerance::Percent(center, percent) => format!("{} +/- {percent} %", time(center)),
            Tolerance::PlusMinus(center, spread) => {
                format!("{} +/- {}", time(center), time(spread))
            }
            Tolerance::AtLeast(low) => format!(">= {}", time(low)),
            Tolerance::AtMost(high) => format!("<= {}", time(high)),
            Tolerance::Between(low, high) => format!("{} .. {}", time(low), time(high)),
        }
    }

    fn time(&self, amount: &At<Amount>) -> String {
        self.amount(&amount.value)
    }

    fn amount(&self, amount: &Amount) -> String {
        let known = self.scope.and_then(|scope| scope.time(amount).ok());
        known.map_or_else(|| amount.to_string(), show_time)
    }

    /// `lss-switch-to-waiting (7E5#04 00 00 00 00 00 00 00)`; the frame alone where the suite has
    /// no word for it.
    fn frame(&self, frame: &At<FrameText>) -> String {
        let text = frame.value.to_string();
        let word = self.words.shown_frame(&text);
        let known = self.scope.zip(self.node);
        let known = known.and_then(|(scope, node)| scope.known_pattern(&frame.value, node));
        let shown = known.map_or(text, |pattern| pattern.to_string());
        match word {
            Some(word) => format!("{word} ({shown})"),
            None => shown,
        }
    }

    fn mux(&self, object: &ObjectRef) -> Option<Mux> {
        match object {
            ObjectRef::Fixed(mux) => Some(*mux),
            named @ ObjectRef::Named(_) => self.scope?.mux(named).ok(),
        }
    }

    /// `received-1 (2500:01)`; the address alone where the suite has no word for it.
    fn object(&self, object: &At<ObjectRef>) -> String {
        match (self.mux(&object.value), &object.value) {
            (Some(mux), _) => self.address(mux),
            (None, ObjectRef::Named(name)) => name.to_string(),
            (None, ObjectRef::Fixed(mux)) => mux.to_string(),
        }
    }

    fn address(&self, mux: Mux) -> String {
        match self.words.name(mux) {
            Some(word) => format!("{word} ({mux})"),
            None => mux.to_string(),
        }
    }

    /// The mapped object: an address, or a mapping entry.
    fn mapped(&self, literal: &Literal) -> String {
        match literal {
            Literal::Text(text) => {
                text.parse().map_or_else(|_| text.clone(), |mux| self.address(mux))
            }
            other => self.value(None, other),
        }
    }

    /// `greater (2)`, `50.0 °C (500)`, `7`, `80000082h` of a COB-ID.
    fn value(&self, object: Option<&ObjectRef>, literal: &Literal) -> String {
        let number = match (literal, self.scope) {
            (Literal::Int(number), _) => Some(*number),
            (_, Some(scope)) => scope.int(literal).ok(),
            _ => None,
        };
        if let Some(number) = number {
            let word = object.and_then(|object| self.words.value(object, number));
            let composed = || self.mux(object?).filter(|mux| mux.is_composed());
            return match word {
                Some(word) => format!("{word} ({number})"),
                None if composed().is_some() => format!("{number:08X}h"),
                None => number.to_string(),
            };
        }
        match literal {
            Literal::Time(amount) => self.amount(amount),
            Literal::Named(name, 0) => self.bound(name).unwrap_or_else(|| name.to_string()),
            other => other.to_string(),
        }
    }

    fn bound(&self, name: &Name) -> Option<String> {
        match self.scope?.get(name).ok()? {
            Binding::Mux(mux) => Some(self.address(*mux)),
            Binding::Value(value, _) => Some(value.to_string()),
            Binding::Time(time) => Some(show_time(*time)),
            Binding::Literal(literal) => Some(literal.to_string()),
            Binding::Id(id) => Some(format!("{id}h")),
            Binding::Bytes(_) => None,
        }
    }
}

/// `, expect 5`, where a `= 5` might be taken for what came.
fn expected(judged: &str) -> String {
    match judged.strip_prefix(" = ") {
        Some(value) => format!(", expect {value}"),
        None if judged.is_empty() => String::new(),
        None => format!(", expect{judged}"),
    }
}

/// ` = 5`, ` from 5 to 7`.
fn range(value: Option<String>, min: Option<String>, max: Option<String>) -> String {
    let value = value.map_or_else(String::new, |value| format!(" = {value}"));
    let bounds = match (min, max) {
        (Some(min), Some(max)) => format!(" from {min} to {max}"),
        (Some(min), None) => format!(" at least {min}"),
        (None, Some(max)) => format!(" at most {max}"),
        (None, None) => String::new(),
    };
    value + &bounds
}

/// The name that later steps have for the value.
fn kept(name: Option<&At<Name>>) -> String {
    name.map_or_else(String::new, |name| format!(", kept as {}", name.value))
}

/// Words with commas between them.
fn list(words: impl Iterator<Item = impl Display>, none: &str) -> String {
    let words: Vec<String> = words.map(|word| word.to_string()).collect();
    if words.is_empty() { none.to_owned() } else { words.join(", ") }
}

/// The name of an NMT command.
const fn command(nmt: Nmt) -> &'static str {
    match nmt {
        Nmt::Start => "NMT start remote node",
        Nmt::Stop => "NMT stop remote node",
        Nmt::PreOperational => "NMT enter pre-operational",
        Nmt::ResetNode => "NMT reset node",
        Nmt::ResetCommunication => "NMT reset communication",
    }
}
