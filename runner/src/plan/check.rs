//! Mistakes of a case that can be found before anything runs.

use std::collections::BTreeSet;

use canopen::bench::{self, NAMES};
use canopen::catalogue::{Profile, Shape};
use canopen::eds::{CODES, Eds, Entry};
use canopen::{Abort, Mux, Pattern};
use reports::reason::NOT_ON_BENCH;

use super::bytes::{mapping_word, parse_bytes};
use super::each::{index_range, matching_entries};
use super::instance::Instance;
use super::profile::check_capabilities;
use super::scope::{Binding, Scope};
use crate::dut::Dut;
use crate::nearest::{did_you_mean, is_slip};
use crate::source::{At, Complaint, Place};
use crate::suite::Suite;
use crate::suite::each::Objects;
use crate::suite::literal::{Amount, FrameText, Literal, ObjectRef};
use crate::suite::model::Case;
use crate::suite::profile::About;
use crate::suite::refusal::Refusal;
use crate::suite::step::{
    Ask, Bounds, FastscanStep, LssStep, Measure, Observe, Produce, REPEATS, Read, Remap, Step,
    Until, Write,
};

/// Checks that what a case requires can exist at all. `model` is the data sheet of the device that
/// the suite is for.
pub(super) fn requires(
    suite: &Suite,
    case: &Case,
    dut: &Dut,
    model: Option<&Eds>,
) -> Result<(), Complaint> {
    for At { value: requires, place } in &case.requires {
        check_capabilities(requires, suite)
            .map_err(|wrong| Complaint::at(&suite.source, wrong.place, wrong.value))?;
        let objects = [&requires.object, &requires.absent];
        let named =
            requires.supports.is_some() || requires.lacks.is_some() || requires.bit_rate.is_some();
        let nothing = !named && objects.iter().all(|object| object.is_none());
        if nothing || requires.access.is_some() && requires.object.is_none() {
            let message = "a case requires an `object`, with an `access` if need be, one that is \
                           `absent`, what the device `supports` or `lacks`, or a `bit-rate`";
            return Err(Complaint::at(&suite.source, *place, message));
        }
        for object in objects.into_iter().flatten() {
            required_object(object, requires.absent.is_some(), suite, dut)?;
            if requires.absent.is_none() {
                required_sub(object, suite, dut, model)?;
            }
        }
    }
    Ok(())
}

/// Checks that an object that must be there can be. One that must be absent may be one that no
/// profile has, such as 1004h, which a later version of CiA 301 dropped.
fn required_object(
    object: &At<ObjectRef>,
    absent: bool,
    suite: &Suite,
    dut: &Dut,
) -> Result<(), Complaint> {
    let ObjectRef::Fixed(mux) = object.value else {
        let message = "what a case requires is an object such as \"1017:00\"";
        return Err(Complaint::at(&suite.source, object.place, message));
    };
    // With the data sheet of a user the case is skipped: a suite may be for several of their
    // devices.
    let known = absent
        || !dut.sheet.trusted
        || suite.catalogue.lookup(&profiles_of(suite), mux.index).is_some()
        || dut.eds.object(mux.index).is_some();
    match known {
        true => Ok(()),
        false => {
            let message =
                format!("unknown object {mux}: neither a profile nor the data sheet has it");
            Err(Complaint::at(&suite.source, object.place, message))
        }
    }
}

/// Checks the sub-index of an object of the manufacturer that a suite of the user names for one
/// device. A suite of this program may be for a family, whose smaller members lack channels.
fn required_sub(
    object: &At<ObjectRef>,
    suite: &Suite,
    dut: &Dut,
    model: Option<&Eds>,
) -> Result<(), Complaint> {
    const MANUFACTURER: std::ops::RangeInclusive<u16> = 0x2000..=0x5FFF;
    let (ObjectRef::Fixed(mux), Some(model)) = (&object.value, model) else { return Ok(()) };
    let mux = *mux;
    let is_of_user = suite.file.device.is_some() && !suite.is_built_in;
    let Some(known) = model.object(mux.index) else { return Ok(()) };
    let is_there = model.entry(mux).is_some() || dut.eds.entry(mux).is_some();
    if !is_of_user || is_there || !MANUFACTURER.contains(&mux.index) {
        return Ok(());
    }
    let subs: Vec<String> =
        known.entries.iter().map(|entry| format!("{:02X}", entry.mux.sub)).collect();
    let subs = match &subs[..] {
        [first, .., last] if subs.len() > 8 => format!("{first} to {last}"),
        some => some.join(", "),
    };
    let message = format!("unknown object {mux}: {:04X}h has the sub-indices {subs}", mux.index);
    Err(Complaint::at(&suite.source, object.place, message))
}

/// The result of checking an instance before it runs.
pub(super) struct Checked {
    /// Names that are not bound or not used, unknown objects, values that do not fit.
    pub complaints: Vec<Complaint>,
    /// A need of the case that the device, or the bench around it, does not meet.
    pub lacking: Option<String>,
    /// The names that its steps ask for.
    pub used: BTreeSet<String>,
}

/// Checks every step of an instance.
pub(super) fn case(instance: &Instance, dut: &Dut, model: Option<&Eds>) -> Checked {
    let case = instance.case();
    let mut checker = Checker {
        scope: instance.scope.clone().watched(),
        suite: &instance.suite,
        case,
        dut,
        model,
        saved: Vec::new(),
        complaints: Vec::new(),
        lacking: None,
    };
    for step in case.all_steps() {
        checker.step(step);
        checker.abort_codes(step);
    }
    for step in &case.finally {
        checker.no_way_out(step);
    }
    for step in &case.setup {
        checker.promised(&step.value);
    }
    checker.unused();
    // Without the object, anything that rests on it (a saved value, say) is wrong for the same
    // reason.
    if checker.lacking.is_some() {
        checker.complaints.clear();
    }
    let used = checker.scope.used();
    Checked { complaints: checker.complaints, lacking: checker.lacking, used }
}

struct Checker<'c> {
    scope: Scope,
    suite: &'c Suite,
    case: &'c Case,
    dut: &'c Dut,
    /// The data sheet of the device that the suite is for; `None` for suites for any device.
    model: Option<&'c Eds>,
    saved: Vec<(String, Place)>,
    complaints: Vec<Complaint>,
    lacking: Option<String>,
}

impl<'c> Checker<'c> {
    fn step(&mut self, step: &At<Step>) {
        match &step.value {
            Step::Send(frame) => self.sendable(frame),
            Step::Reply(reply) => {
                self.patterns(&reply.frame, &reply.lenient);
                self.patterns(&reply.frame, &reply.or_else);
                self.times(&reply.within);
                self.enough(reply.enough, &reply.or_else, reply.or_silence, step.place);
            }
            Step::Ask(ask) => {
                self.enough(ask.enough, &ask.or_else, ask.or_silence, step.place);
                self.ask(ask);
            }
            Step::Expect(expect) => {
                self.patterns(&expect.frame, &expect.lenient);
                self.time(&expect.within);
                self.times(&expect.after);
                if let Some(length) = &expect.length {
                    let result = self.scope.int(&length.value);
                    self.note(result.map(|_| ()), length.place);
                }
            }
            Step::Never(never) => {
                self.patterns(&never.frame, &never.lenient);
                self.patterns(&never.frame, &never.or_else);
                self.time(&never.time);
            }
            Step::Read(read) => self.read(read),
            Step::Write(write) => self.write(write, step.place),
            Step::Remap(remap) => self.remap(remap),
            Step::Defaults(objects) => self.entries(objects),
            Step::Nmt(_) => {}
            Step::Wait(time) => self.time(time),
            Step::Until(until) => self.until(until, step.place),
            Step::Measure(measure) => self.measure(measure, step.place),
            Step::Collect(collect) => {
                self.patterns(&collect.frame, &[]);
                let count = self.scope.int(&collect.count.value);
                self.note(count.map(|_| ()), collect.count.place);
                self.time(&collect.time);
            }
            Step::Sync(sync) => self.times(&sync.every),
            Step::Produce(produce) => self.produce(Some(produce)),
            Step::Bench(stimuli) => stimuli.0.iter().for_each(|(name, value)| {
                self.bench_value(value);
                self.bench_name(name, value.place);
            }),
            Step::Lss(lss) => match &**lss {
                LssStep::Fastscan(scan) => self.fastscan(scan),
            },
            Step::Eds(eds) => self.findings(eds.without.iter().chain(&eds.lenient)),
            Step::Undeclared(undeclared) => {
                let range = index_range(&undeclared.range.value);
                self.note(range.map(|_| ()), undeclared.range.place);
                let profile = undeclared.profile.as_ref();
                let number = |about: &&At<About>| matches!(about.value, About::Number(_));
                if let Some(profile) = profile.filter(number) {
                    let message = "`profile` must be the name of a profile";
                    self.complain(profile.place, message);
                }
            }
            Step::Observe(observe) => self.observe(observe, step.place),
            Step::Partner(partner) => self.time(&partner.heartbeat),
        }
        self.produce(step.value.effect().during);
    }

    fn ask(&mut self, ask: &Ask) {
        ask.first.iter().chain([&ask.send]).for_each(|frame| self.sendable(frame));
        self.times(&ask.pause);
        self.patterns(&ask.reply, &ask.lenient);
        self.patterns(&ask.reply, &ask.or_else);
        self.times(&ask.within);
        self.bounds(&ask.latency);
    }

    fn bounds(&mut self, bounds: &Option<Bounds>) {
        let Some(bounds) = bounds else { return };
        for tolerance in [Some(&bounds.strict), bounds.lenient.as_ref()].into_iter().flatten() {
            let result = self.scope.bounds(&tolerance.value);
            self.note(result.map(|_| ()), tolerance.place);
        }
    }

    fn entries(&mut self, objects: &Objects) {
        if let Err(wrong) = matching_entries(objects, self.dut) {
            self.complain(wrong.place, wrong.value);
        }
    }

    fn fastscan(&mut self, scan: &FastscanStep) {
        for number in [&scan.vendor, &scan.product, &scan.revision, &scan.serial] {
            let result = self.scope.int(&number.value);
            self.note(result.map(|_| ()), number.place);
        }
        self.times(&scan.slot);
    }

    fn findings<'a>(&mut self, codes: impl Iterator<Item = &'a At<String>>) {
        for code in codes.filter(|code| !CODES.iter().any(|known| known.name == code.value)) {
            self.complain(code.place, format!("no finding is called `{}`", code.value));
        }
    }

    fn observe(&mut self, observe: &Observe, place: Place) {
        if observe.value.is_none() && observe.min.is_none() && observe.max.is_none() {
            self.complain(place, "`observe` needs a `value`, a `min` or a `max`");
        }
        for value in [&observe.value, &observe.min, &observe.max].into_iter().flatten() {
            self.bench_value(value);
        }
        self.times(&observe.within);
        self.bench_name(&observe.bench.value, observe.bench.place);
    }

    fn bench_value(&mut self, literal: &At<Literal>) {
        let result = self.scope.value(&literal.value);
        self.note(result.map(|_| ()), literal.place);
    }

    /// A case about a name of the suites is skipped if the bench does not offer it. Any other name
    /// belongs to the user's bench: if that bench is connected and does not offer it, the name is a
    /// mistake.
    fn bench_name(&mut self, name: &str, place: Place) {
        let offered = &self.dut.bench;
        if offered.iter().any(|known| known == name) {
            return;
        }
        let known = NAMES.iter().copied().filter(|known| !known.ends_with('-'));
        let mut slips = known.clone().filter(|known| name.len() > 4 && is_slip(name, known));
        let wrong = match (bench::is_known(name), self.dut.own_bench) {
            (true, _) => None,
            (false, true) => {
                let meant = did_you_mean(name, offered.iter().map(String::as_str).chain(known));
                let there = offered.join(", ");
                Some(format!("the bench has no `{name}`: it offers {there}{meant}"))
            }
            (false, false) => {
                slips.next().map(|known| format!("no bench has `{name}`; did you mean `{known}`?"))
            }
        };
        if let Some(wrong) = wrong {
            self.complain(place, wrong);
            return;
        }
        self.lacking.get_or_insert_with(|| format!("{NOT_ON_BENCH}`{name}`"));
    }

    /// A code that CiA 301 does not have is a mistake, unless the suite is for one device, which
    /// may have codes of its own in the classes of CiA 301.
    fn abort_codes(&mut self, step: &At<Step>) {
        const CLASSES: [u32; 3] = [5, 6, 8];
        let may_have_own = self.suite.file.device.is_some();
        let refused = |refused: Option<&At<Refusal>>| {
            refused
                .into_iter()
                .flat_map(|At { value, place }| {
                    let lenient = value.lenient.iter().filter_map(|refused| refused.code());
                    let codes = value.codes.iter().copied().chain(lenient);
                    codes.map(|code| (code, *place)).collect::<Vec<_>>()
                })
                .collect::<Vec<_>>()
        };
        let codes: Vec<(u32, Place)> = match &step.value {
            Step::Read(read) => {
                let lenient = read.lenient.iter();
                let lenient = lenient.filter_map(|refused| Some((refused.code()?, step.place)));
                refused(read.refused.as_deref()).into_iter().chain(lenient).collect()
            }
            Step::Write(write) => {
                let or_refused = write.or_refused.iter();
                let or_refused =
                    or_refused.filter_map(|refused| Some((refused.value.code()?, refused.place)));
                refused(write.refused.as_deref()).into_iter().chain(or_refused).collect()
            }
            Step::Remap(remap) => refused(remap.refused.as_ref()),
            _ => Vec::new(),
        };
        let is_wrong = |code: u32| {
            Abort(code).meaning().is_none() && !(may_have_own && CLASSES.contains(&(code >> 24)))
        };
        for (code, place) in codes.into_iter().filter(|(code, _)| is_wrong(*code)) {
            let known: Vec<String> =
                Abort::ALL.iter().map(|known| format!("0x{:08X}", known.0)).collect();
            let code = format!("0x{code:08X}");
            let meant = did_you_mean(&code, known.iter().map(String::as_str));
            self.complain(place, format!("{code} is not an SDO abort code of CiA 301{meant}"));
        }
    }

    fn measure(&mut self, measure: &Measure, place: Place) {
        self.patterns(&measure.frame, &[]);
        let judged = [&measure.interval, &measure.mean, &measure.median];
        let of_intervals = judged.iter().any(|bounds| bounds.is_some());
        if of_intervals && measure.count < 2 {
            self.complain(place, "an interval needs a `count` of at least 2 frames");
        }
        if measure.latency.is_some() && measure.during.is_none() {
            self.complain(place, "`latency` counts from the frames of `during`");
        }
        if !of_intervals && measure.latency.is_none() {
            let message = "`measure` judges nothing: say `interval`, `mean`, `median` or `latency`";
            self.complain(place, message);
        }
        for bounds in judged.into_iter().chain([&measure.latency]) {
            self.bounds(bounds);
        }
        self.times(&measure.within);
    }

    fn read(&mut self, read: &Read) {
        self.instead(&read.tolerated, &read.value);
        let Some(entry) = self.entry(&read.object, read.refused.as_deref()) else { return };
        let bounds = [&read.mask, &read.min, &read.max].into_iter().flatten().map(|bound| &**bound);
        for value in read.value.iter().chain(bounds).chain(&read.tolerated) {
            self.value(value, entry);
        }
        if let Some(length) = &read.length {
            let result = self.scope.int(&length.value);
            self.note(result.map(|_| ()), length.place);
        }
        if let Some(size) = &read.block_size {
            match self.scope.int(&size.value) {
                Ok(1..=127) => {}
                Ok(_) => self.complain(size.place, "a sub-block has 1 to 127 segments"),
                Err(wrong) => self.complain(size.place, wrong),
            }
        }
        if let Some(At { value: name, place }) = read.save.as_deref() {
            let bytes = entry.default_bytes(self.dut.node).unwrap_or_default();
            let value = entry.data_type.decode(&bytes);
            self.scope.bind(
                name.0.to_string(),
                value.map_or(Binding::Bytes(bytes), |value| Binding::Value(value, entry.data_type)),
            );
            self.saved.push((name.0.to_string(), *place));
        }
    }

    fn write(&mut self, write: &Write, place: Place) {
        if write.if_there && !self.is_there(&write.object) {
            return;
        }
        let entry = self.entry(&write.object, write.refused.as_deref());
        match (&write.value, &write.bytes, &write.fill) {
            (Some(value), None, None) => match (entry, &write.refused) {
                (Some(entry), None) => self.value(value, entry),
                (Some(entry), Some(_)) => self.refused_value(value, entry),
                (None, _) => {}
            },
            (None, Some(bytes), None) => {
                if parse_bytes(&bytes.value).is_none() {
                    self.complain(bytes.place, "bytes are pairs of hex digits: `01 02`");
                }
            }
            (None, None, Some(fill)) => match self.scope.int(&fill.value) {
                Ok(0..=MOST_FILL) => {}
                Ok(_) => self.complain(fill.place, format!("0 to {MOST_FILL} bytes")),
                Err(wrong) => self.complain(fill.place, wrong),
            },
            _ => self.complain(place, "a write has one of `value`, `bytes` and `fill`"),
        }
        if let (Some(refused), false) = (&write.refused, write.or_refused.is_empty()) {
            let message = "a write is to be refused, or may be: `refused` or `or-refused`";
            self.complain(refused.place, message);
        }
        if write.enough && write.or_refused.is_empty() {
            self.complain(place, "`enough` belongs to `or-refused`");
        }
        if let Some(At { value: name, place }) = write.save.as_deref() {
            self.scope.bind(name.0.to_string(), Binding::Bytes(Vec::new()));
            self.saved.push((name.0.to_string(), *place));
        }
    }

    /// Only a way out can be enough.
    fn enough(&mut self, enough: bool, or_else: &[At<FrameText>], silence: bool, place: Place) {
        if enough && or_else.is_empty() && !silence {
            self.complain(place, "`enough` belongs to `or-else` or `or-silence`");
        }
    }

    /// A value that must be refused need not be one of the object, but has to have its length:
    /// another length is refused for the length.
    fn refused_value(&mut self, literal: &At<Literal>, entry: &Entry) {
        let Err(wrong) = self.scope.bytes(&literal.value, entry) else { return };
        let (Ok(number), Some(size)) = (self.scope.int(&literal.value), entry.data_type.size())
        else {
            return;
        };
        let bits = 8 * size.min(8) as u32;
        if !(-(1 << (bits - 1))..1 << bits).contains(&number) {
            let message = format!("{wrong}; `bytes` writes another length");
            self.complain(literal.place, message);
        }
    }

    /// Whether the device has an object that can be written, among those that the case may name.
    fn is_there(&self, object: &At<ObjectRef>) -> bool {
        let mux = self.scope.mux(&object.value).ok();
        let entry = mux.and_then(|mux| self.dut.eds.entry(mux));
        entry.is_some_and(|entry| entry.access.writable())
    }

    /// A step in `finally` has no later steps to leave out.
    fn no_way_out(&mut self, step: &At<Step>) {
        let (word, place) = match &step.value {
            Step::Write(write) => ("or-refused", write.or_refused.first().map(|code| code.place)),
            Step::Read(read) => ("or-another", read.or_another.then_some(step.place)),
            Step::Reply(reply) => {
                ("or-else", way_out(&reply.or_else, reply.or_silence, step.place))
            }
            Step::Ask(ask) => ("or-else", way_out(&ask.or_else, ask.or_silence, step.place)),
            Step::Never(never) => ("or-else", way_out(&never.or_else, false, step.place)),
            _ => return,
        };
        if let Some(place) = place {
            self.complain(place, format!("`{word}` is for `setup` and `steps`, not for `finally`"));
        }
    }

    fn until(&mut self, until: &Until, place: Place) {
        if until.value.is_none() && until.min.is_none() && until.max.is_none() {
            self.complain(place, "`until` needs a `value`, a `min` or a `max`");
        }
        self.instead(&until.tolerated, &until.value);
        self.time(&until.within);
        self.times(&until.every);
        let Some(entry) = self.entry(&until.object, None) else { return };
        let bounds =
            [&until.mask, &until.min, &until.max].into_iter().flatten().map(|bound| &**bound);
        for value in until.value.iter().chain(bounds).chain(&until.tolerated) {
            self.value(value, entry);
        }
    }

    /// Values instead of which?
    fn instead(&mut self, tolerated: &[At<Literal>], value: &Option<At<Literal>>) {
        if let (Some(first), None) = (tolerated.first(), value) {
            self.complain(
                first.place,
                "`tolerated` stands beside the `value` of a conformant device",
            );
        }
    }

    fn remap(&mut self, remap: &Remap) {
        match self.scope.mux(&remap.pdo.value) {
            Ok(mux) if matches!(mux.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF) && mux.sub == 0 => {
                self.entry(&remap.pdo, None);
            }
            Ok(_) => self.complain(remap.pdo.place, "a mapping is named by its count, \"1A00:00\""),
            Err(wrong) => self.complain(remap.pdo.place, wrong),
        }
        for object in &remap.objects {
            let result = mapping_word(&object.value, &self.scope, self.dut);
            self.note(result.map(|_| ()), object.place);
        }
    }

    /// A mapping that only prepares a case is one that the data sheet promises.
    fn promised(&mut self, step: &Step) {
        let Step::Remap(remap) = step else { return };
        if remap.refused.is_some() {
            return;
        }
        let Ok(count) = self.scope.mux(&remap.pdo.value) else { return };
        let last = Mux::new(count.index, remap.objects.len() as u8);
        let eds = &self.dut.eds;
        let Some(known) = eds.entry(count) else { return };
        let reason = match eds.entry(last) {
            _ if !known.access.writable() => Some(format!("object {count} cannot be written")),
            None => Some(no_object(last)),
            Some(_) => {
                let words = remap.objects.iter();
                let words = words
                    .filter_map(|object| mapping_word(&object.value, &self.scope, self.dut).ok());
                let mapped = words.map(|word| Mux::new((word >> 16) as u16, (word >> 8) as u8));
                let mut fixed =
                    mapped.filter(|mux| eds.entry(*mux).is_some_and(|entry| !entry.mappable));
                fixed.next().map(|mux| format!("no PDO can map object {mux}"))
            }
        };
        self.lacking = self.lacking.take().or(reason);
    }

    fn produce(&mut self, produce: Option<&Produce>) {
        if let Some(produce) = produce {
            self.sendable(&produce.frame);
            self.time(&produce.every);
        }
    }

    fn sendable(&mut self, text: &At<FrameText>) {
        match self.scope.pattern(&text.value, self.dut.node) {
            Ok(pattern) if pattern.frame().is_none() => {
                self.complain(text.place, "a frame with holes or over eight bytes cannot be sent");
            }
            Ok(_) => {}
            Err(wrong) => self.complain(text.place, wrong),
        }
    }

    fn patterns(&mut self, strict: &At<FrameText>, lenient: &[At<FrameText>]) {
        for text in std::iter::once(strict).chain(lenient) {
            let result = self.scope.pattern(&text.value, self.dut.node);
            if lacks_data(&text.value.pattern) {
                let message = "no device sends a frame without data with this identifier: `...` \
                               behind `#` stands for any data";
                self.complain(text.place, message);
            }
            self.note(result.map(|_| ()), text.place);
        }
    }

    fn times(&mut self, amount: &Option<At<Amount>>) {
        if let Some(amount) = amount {
            self.time(amount);
        }
    }

    fn time(&mut self, amount: &At<Amount>) {
        let result = self.scope.time(&amount.value);
        self.note(result.map(|_| ()), amount.place);
    }

    fn value(&mut self, literal: &At<Literal>, entry: &Entry) {
        let result = self.scope.bytes(&literal.value, entry);
        self.note(result.map(|_| ()), literal.place);
    }

    /// The entry a step works on. A missing entry is no mistake of the suite if the profile, or the
    /// device that the suite is for, has it. An entry that is known to neither is a mistake, unless
    /// the case is about that.
    fn entry(
        &mut self,
        object: &At<ObjectRef>,
        refused: Option<&At<Refusal>>,
    ) -> Option<&'c Entry> {
        let mux = match self.scope.mux(&object.value) {
            Ok(mux) => mux,
            Err(wrong) => {
                self.complain(object.place, wrong);
                return None;
            }
        };
        let dut: &'c Dut = self.dut;
        let entry = dut.eds.entry(mux);
        if entry.is_none() && refused.is_none() {
            let in_profile = || in_profile(mux, self.suite);
            if self.model.map_or_else(in_profile, |eds| eds.entry(mux).is_some()) {
                self.lacking.get_or_insert_with(|| no_object(mux));
            } else {
                let name = &self.dut.name;
                let message = format!("unknown object {mux}: the data sheet of {name} has none");
                self.complain(object.place, message);
            }
        }
        entry
    }

    fn unused(&mut self) {
        let of_matrix = self.case.matrix.iter();
        let matrix = of_matrix.map(|(name, values)| (name, &values.place, REPEATS));
        let names = matrix.chain(self.saved.iter().map(|(name, place)| (name, place, "")));
        let unused = names.filter(|(name, ..)| !self.scope.uses(name));
        let unused: Vec<_> = unused.map(|(name, at, help)| (name.clone(), *at, help)).collect();
        for (name, place, help) in unused {
            self.complain(place, format!("${name} is never used{help}"));
        }
    }

    fn note(&mut self, result: Result<(), String>, place: Place) {
        if let Err(wrong) = result {
            self.complain(place, wrong);
        }
    }

    fn complain(&mut self, place: Place, message: impl Into<String>) {
        self.complaints.push(Complaint::at(&self.suite.source, place, message));
    }
}

/// Whether it is a frame without data of a service of a node that has data. An identifier that is
/// written in full may be that of SYNC, whatever node has the same number.
fn lacks_data(pattern: &Pattern) -> bool {
    const WITH_DATA: [u32; 7] = [0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700];
    let is_of_node = pattern.function().is_some_and(|function| WITH_DATA.contains(&function));
    is_of_node && pattern.frame().is_some_and(|frame| !frame.remote && frame.data.is_empty())
}

/// Why a case about an object does not apply.
pub(super) fn no_object(mux: Mux) -> String {
    format!("the data sheet has no object {mux}")
}

/// The profiles whose objects a suite may name: CiA 301 and those it is about.
fn profiles_of(suite: &Suite) -> Vec<&str> {
    let chain =
        suite.profile().into_iter().flat_map(Profile::chain).map(|profile| profile.name.as_str());
    let chain: Vec<&str> = chain.collect();
    let others = if chain.is_empty() { vec!["cia401"] } else { chain };
    [vec!["cia301"], others].concat()
}

/// Whether one of the profiles that a suite may name knows a value at that address.
fn in_profile(mux: Mux, suite: &Suite) -> bool {
    suite.catalogue.lookup(&profiles_of(suite), mux.index).is_some_and(|object| {
        match object.object {
            None | Some(Shape::Var | Shape::Domain) => mux.sub == 0,
            Some(Shape::Array | Shape::Record) => {
                mux.sub == 0 || object.of_sub(mux.sub).data_type.is_some()
            }
        }
    })
}

/// More than any object of a device is tried with.
const MOST_FILL: i128 = 1 << 20;

/// Where a step says that a device may decline.
fn way_out(or_else: &[At<FrameText>], or_silence: bool, place: Place) -> Option<Place> {
    or_else.first().map(|frame| frame.place).or_else(|| or_silence.then_some(place))
}
