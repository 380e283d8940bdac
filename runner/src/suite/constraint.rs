//! The demands of a step on a device, and its allowances: each part that can be loosened alone.
//!
//! The match names every step and has no `_` arm, so that a new step does not compile until its
//! judgement is defined: `harness qualify` proves each constraint.

use std::fmt;
use std::ops::Range;

use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Word, emcy, heartbeat};

use super::literal::{Flow, FrameText, Literal, Tolerance};
use super::model::Case;
use super::refusal::Refusal;
use super::step::{Ask, Bounds, Collect, Expect, LssStep, Measure, Read, Reply, Step, Until};
use crate::source::At;

/// A part of what a step judges. Places count from 1.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Constraint {
    /// This word of a frame, as the pattern is written.
    Word(usize),
    /// The multiplexer in the answer of an SDO server.
    Multiplexer,
    /// The code of an abort, or of a refusal.
    AbortCode,
    /// The error code of an emergency message.
    ErrorCode,
    /// It does not come earlier.
    After,
    /// The length of data.
    Length,
    /// Not fewer come.
    Few,
    /// Not more come.
    Many,
    /// The lower bound of this time.
    Low(Time),
    /// The upper bound of this time.
    High(Time),
    /// The value, in the bits that count.
    Value,
    /// The smallest value.
    Min,
    /// The largest value.
    Max,
    /// It is readable text.
    Characters,
    /// The protocol of the transfer.
    Transfer,
    /// The device refuses.
    Refused,
    /// This finding about the data sheet is absent.
    Finding(String),
    /// This part of an LSS address.
    Part(&'static str),
    /// An accepted alternative.
    Allowance(Allowance),
}

/// A time that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Time {
    /// Each interval.
    Interval,
    /// The mean of the intervals.
    Mean,
    /// Their median.
    Median,
    /// From a request to its answer.
    Latency,
}

/// An alternative that a step accepts beside the expected one. Lists are counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Allowance {
    /// One of `lenient`.
    Lenient(usize),
    /// A time outside the strict bounds.
    Bounds(Time),
    /// One of `tolerated`.
    Tolerated(usize),
    /// The device takes the value instead of refusing it.
    Taken,
    /// One of `or-else`.
    OrElse(usize),
    /// Another value, which ends the steps.
    OrAnother,
    /// One of `or-refused`.
    OrRefused(usize),
    /// Silence, which ends the steps.
    OrSilence,
    /// Silence, after which the steps go on.
    AcceptSilence,
    /// Silence instead of a frame.
    Optional,
}

impl Step {
    /// Whether the step finds out something about the device. Other steps act on it: the demands of
    /// later steps show whether the device took what they wrote.
    pub fn judges(&self) -> bool {
        match self {
            Self::Send(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Sync(_)
            | Self::Produce(_)
            | Self::Bench(_)
            | Self::Partner(_) => false,
            Self::Write(write) => write.refused.is_some(),
            Self::Remap(remap) => remap.refused.is_some(),
            // It only finds out whether the next ones can say anything.
            Self::Read(read) if read.or_another => false,
            Self::Read(read) => {
                read.save.is_none() || self.constraints().iter().any(Constraint::is_demand)
            }
            Self::Expect(expect) => {
                !expect.optional || expect.after.is_some() || expect.length.is_some()
            }
            // If it forbids a frame that also ends the steps, it only finds out whether they can
            // say anything.
            Self::Never(never) => never.or_else.iter().all(|text| text.value != never.frame.value),
            Self::Reply(reply) => {
                !reply.or_silence || self.constraints().iter().any(Constraint::is_demand)
            }
            Self::Ask(ask) => {
                let silence = ask.or_silence || ask.accept_silence;
                !silence || self.constraints().iter().any(Constraint::is_demand)
            }
            Self::Defaults(_)
            | Self::Until(_)
            | Self::Measure(_)
            | Self::Collect(_)
            | Self::Observe(_)
            | Self::Eds(_)
            | Self::Undeclared(_)
            | Self::Lss(_) => true,
        }
    }

    /// Everything in the step that can be loosened alone. A frame that has to come or to stay
    /// away is what the step as a whole is about.
    pub fn constraints(&self) -> Vec<Constraint> {
        match self {
            Self::Send(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Sync(_)
            | Self::Produce(_)
            | Self::Bench(_)
            | Self::Partner(_) => Vec::new(),
            Self::Reply(reply) => of_reply(reply),
            Self::Ask(ask) => of_ask(ask),
            Self::Expect(expect) => of_expect(expect),
            // A pattern with one word less forbids more frames.
            Self::Never(never) => {
                [each(&never.lenient, Allowance::Lenient), each(&never.or_else, Allowance::OrElse)]
                    .concat()
            }
            Self::Read(read) => of_read(read),
            Self::Write(write) => [
                write.refused.as_deref().map_or_else(Vec::new, of_refusal),
                each(&write.or_refused, Allowance::OrRefused),
            ]
            .concat(),
            Self::Remap(remap) => remap.refused.as_ref().map_or_else(Vec::new, of_refusal),
            Self::Defaults(_) => vec![Constraint::Value],
            Self::Until(until) => of_until(until),
            Self::Measure(measure) => of_measure(measure),
            Self::Collect(collect) => of_collect(collect),
            Self::Observe(observe) => {
                of_value(observe.value.is_some(), observe.min.is_some(), observe.max.is_some())
                    .collect()
            }
            Self::Eds(eds) => {
                let finding = |code: &At<String>| Constraint::Finding(code.value.clone());
                let without = eds.without.iter().map(finding);
                without.chain(each(&eds.lenient, Allowance::Lenient)).collect()
            }
            Self::Undeclared(_) => vec![Constraint::Refused, Constraint::AbortCode],
            Self::Lss(lss) => match &**lss {
                LssStep::Fastscan(_) => PARTS.map(Constraint::Part).to_vec(),
            },
        }
    }
}

/// The parts of an LSS address, in their order.
pub(crate) const PARTS: [&str; 4] = ["vendor", "product", "revision", "serial"];

impl Constraint {
    /// Whether a device that breaks it fails.
    pub fn is_demand(&self) -> bool {
        !matches!(self, Self::Allowance(_))
    }

    /// Whether it is about a part of a frame. Parts of one frame are mostly wrong together.
    pub fn is_of_frame(&self) -> bool {
        matches!(self, Self::Word(_) | Self::Multiplexer | Self::AbortCode | Self::ErrorCode)
    }
}

impl Case {
    /// The steps that find out something, with their places. The boot-up message by which a case
    /// knows that a reset is over, before it judges something else, is not among them.
    pub fn judging_steps(&self) -> Vec<(usize, &At<Step>)> {
        let judging = self.steps.iter().enumerate().filter(|(_, step)| step.value.judges());
        let mut judging: Vec<_> = judging.collect();
        let is_boot_up =
            |step: &Step| matches!(step, Step::Expect(expect) if expect.frame.value.is_boot_up());
        let last = judging.iter().rev().find(|(_, step)| !is_boot_up(&step.value));
        let last = last.map_or(0, |(place, _)| *place);
        judging.retain(|(place, step)| *place >= last || !is_boot_up(&step.value));
        judging
    }

    /// The assertions of the case that can be proved or excused, with the place of the step.
    pub fn assertions(&self) -> impl Iterator<Item = (usize, Option<Constraint>)> {
        self.judging_steps().into_iter().flat_map(|(place, step)| {
            let constraints = step.value.constraints().into_iter().map(Some);
            [None].into_iter().chain(constraints).map(move |constraint| (place, constraint))
        })
    }
}

/// An assertion as holes and excuses name it: `step 3`, or `step 3, word 2`.
pub fn assertion_name(step: usize, constraint: Option<&Constraint>) -> String {
    match constraint {
        None => format!("step {}", step + 1),
        Some(constraint) => format!("step {}, {constraint}", step + 1),
    }
}

fn of_reply(reply: &Reply) -> Vec<Constraint> {
    [
        reply.frame.value.constraints(),
        each(&reply.lenient, Allowance::Lenient),
        each(&reply.or_else, Allowance::OrElse),
        when(reply.or_silence, Allowance::OrSilence),
    ]
    .concat()
}

fn of_ask(ask: &Ask) -> Vec<Constraint> {
    [
        ask.reply.value.constraints(),
        each(&ask.lenient, Allowance::Lenient),
        each(&ask.or_else, Allowance::OrElse),
        when(ask.or_silence, Allowance::OrSilence),
        when(ask.accept_silence, Allowance::AcceptSilence),
        of_bounds(ask.latency.as_ref(), Time::Latency),
    ]
    .concat()
}

fn of_expect(expect: &Expect) -> Vec<Constraint> {
    let words = expect.frame.value.constraints();
    [
        // Where silence is accepted, another frame is accepted, too.
        if expect.optional { Vec::new() } else { words },
        each(&expect.lenient, Allowance::Lenient),
        expect.after.as_ref().map(|_| Constraint::After).into_iter().collect(),
        expect.length.as_ref().map(|_| Constraint::Length).into_iter().collect(),
        when(expect.optional, Allowance::Optional),
    ]
    .concat()
}

fn of_read(read: &Read) -> Vec<Constraint> {
    if let Some(refusal) = &read.refused {
        return of_refusal(refusal);
    }
    if read.or_another {
        return when(true, Allowance::OrAnother);
    }
    let others = [
        read.length.as_ref().map(|_| Constraint::Length),
        read.characters.map(|_| Constraint::Characters),
        // A client that asks for blocks takes nothing else.
        read.transfer.filter(|flow| *flow != Flow::Block).map(|_| Constraint::Transfer),
    ];
    of_value(read.value.is_some(), read.min.is_some(), read.max.is_some())
        .chain(others.into_iter().flatten())
        .chain(each(&read.tolerated, Allowance::Tolerated))
        .chain(each(&read.lenient, Allowance::Lenient))
        .collect()
}

fn of_until(until: &Until) -> Vec<Constraint> {
    let demands = of_value(until.value.is_some(), until.min.is_some(), until.max.is_some());
    demands.chain(each(&until.tolerated, Allowance::Tolerated)).collect()
}

fn of_measure(measure: &Measure) -> Vec<Constraint> {
    [
        measure.frame.value.constraints(),
        of_bounds(measure.interval.as_ref(), Time::Interval),
        of_bounds(measure.mean.as_ref(), Time::Mean),
        of_bounds(measure.median.as_ref(), Time::Median),
        of_bounds(measure.latency.as_ref(), Time::Latency),
    ]
    .concat()
}

fn of_collect(collect: &Collect) -> Vec<Constraint> {
    if collect.count.value == Literal::Int(0) {
        return vec![Constraint::Many];
    }
    let words = collect.frame.value.constraints();
    words.into_iter().chain([Constraint::Few, Constraint::Many]).collect()
}

fn of_refusal(refusal: &At<Refusal>) -> Vec<Constraint> {
    let refusal = &refusal.value;
    [
        when_demanded(!refusal.or_taken, Constraint::Refused),
        vec![Constraint::AbortCode],
        each(&refusal.lenient, Allowance::Lenient),
        when(refusal.or_taken, Allowance::Taken),
    ]
    .concat()
}

fn of_value(value: bool, min: bool, max: bool) -> impl Iterator<Item = Constraint> {
    let given = [(value, Constraint::Value), (min, Constraint::Min), (max, Constraint::Max)];
    given.into_iter().filter(|(given, _)| *given).map(|(_, constraint)| constraint)
}

fn of_bounds(bounds: Option<&Bounds>, time: Time) -> Vec<Constraint> {
    let Some(bounds) = bounds else { return Vec::new() };
    let (low, high) = (Constraint::Low(time), Constraint::High(time));
    let mut sides = match bounds.lenient.as_ref().unwrap_or(&bounds.strict).value {
        Tolerance::AtLeast(_) => vec![low],
        Tolerance::AtMost(_) => vec![high],
        Tolerance::Percent(..) | Tolerance::PlusMinus(..) | Tolerance::Between(..) => {
            vec![low, high]
        }
    };
    sides.extend(bounds.lenient.as_ref().map(|_| Constraint::Allowance(Allowance::Bounds(time))));
    sides
}

fn each<T>(list: &[T], allowance: fn(usize) -> Allowance) -> Vec<Constraint> {
    (1..=list.len()).map(|place| Constraint::Allowance(allowance(place))).collect()
}

fn when(given: bool, allowance: Allowance) -> Vec<Constraint> {
    when_demanded(given, Constraint::Allowance(allowance))
}

fn when_demanded(given: bool, constraint: Constraint) -> Vec<Constraint> {
    given.then_some(constraint).into_iter().collect()
}

impl FrameText {
    fn is_boot_up(&self) -> bool {
        self.id.is_none()
            && self.pattern.function() == Some(u32::from(heartbeat::COB_ID))
            && self.pattern.words() == [Word::Bits { mask: 0xFF, value: 0 }]
    }

    /// The constraints that a frame must meet to match. Bytes that form one value together are one
    /// constraint.
    pub fn constraints(&self) -> Vec<Constraint> {
        self.parts().into_iter().map(|(constraint, _)| constraint).collect()
    }

    /// The words that a constraint is about, counted from 0.
    pub fn words_of(&self, constraint: &Constraint) -> Option<Range<usize>> {
        let mut parts = self.parts().into_iter();
        parts.find(|(known, _)| known == constraint).map(|(_, words)| words)
    }

    fn parts(&self) -> Vec<(Constraint, Range<usize>)> {
        let words = self.pattern.words();
        let function = self.pattern.function().filter(|_| self.id.is_none());
        let fixed = |range: Range<usize>| {
            let bits = |word: &Word| matches!(word, Word::Bits { mask: 0xFF, .. });
            words.get(range).is_some_and(|words| words.iter().all(bits))
        };
        let mut together: Vec<(Constraint, Range<usize>)> = Vec::new();
        if function == Some(u32::from(emcy::COB_ID)) && fixed(0..2) {
            together.push((Constraint::ErrorCode, 0..2));
        }
        if function == Some(u32::from(RESPONSE_COB_ID)) && names_object(words.first()) {
            let multiplexer = match words.get(1) {
                Some(Word::Name) => 1..2,
                _ => 1..4,
            };
            let code = multiplexer.end..multiplexer.end + 4;
            if multiplexer.len() == 1 || fixed(multiplexer.clone()) {
                together.push((Constraint::Multiplexer, multiplexer));
            }
            if words.first() == Some(&ABORT) && fixed(code.clone()) {
                together.push((Constraint::AbortCode, code));
            }
        }
        let alone = |place: &usize| {
            words[*place] != Word::Open && !together.iter().any(|(_, words)| words.contains(place))
        };
        let alone: Vec<usize> = (0..words.len()).filter(alone).collect();
        let alone = alone.into_iter().map(|place| (Constraint::Word(place + 1), place..place + 1));
        let mut parts: Vec<_> = together.clone().into_iter().chain(alone).collect();
        parts.sort_by_key(|(_, words)| words.start);
        parts
    }
}

const ABORT: Word = Word::Bits { mask: 0xFF, value: 0x80 };

/// Whether an answer that begins so names the object that it is about.
fn names_object(command: Option<&Word>) -> bool {
    match command {
        // Aborts, initiated uploads and downloads, and those in blocks.
        Some(Word::Bits { mask, value }) => match mask & 0xE0 {
            0xE0 => match value & 0xE0 {
                0x40 | 0x60 | 0x80 => true,
                0xA0 => mask & 0x03 == 0x03 && value & 0x03 == 0,
                0xC0 => mask & 0x01 == 0x01 && value & 0x01 == 0,
                _ => false,
            },
            _ => false,
        },
        Some(Word::Open) => true,
        Some(Word::Name) | None => false,
    }
}

/// As holes and excuses name it.
impl fmt::Display for Constraint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(place) => write!(f, "word {place}"),
            Self::Multiplexer => f.write_str("multiplexer"),
            Self::AbortCode => f.write_str("abort code"),
            Self::ErrorCode => f.write_str("error code"),
            Self::After => f.write_str("after"),
            Self::Length => f.write_str("length"),
            Self::Few => f.write_str("not fewer"),
            Self::Many => f.write_str("not more"),
            Self::Low(time) => write!(f, "{time}, lower bound"),
            Self::High(time) => write!(f, "{time}, upper bound"),
            Self::Value => f.write_str("value"),
            Self::Min => f.write_str("min"),
            Self::Max => f.write_str("max"),
            Self::Characters => f.write_str("characters"),
            Self::Transfer => f.write_str("transfer"),
            Self::Refused => f.write_str("refused"),
            Self::Finding(code) => f.write_str(code),
            Self::Part(part) => f.write_str(part),
            Self::Allowance(allowance) => write!(f, "{allowance}"),
        }
    }
}

impl fmt::Display for Allowance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lenient(place) => write!(f, "lenient {place}"),
            Self::Bounds(time) => write!(f, "{time}, lenient"),
            Self::Tolerated(place) => write!(f, "tolerated {place}"),
            Self::Taken => f.write_str("taken"),
            Self::OrElse(place) => write!(f, "or-else {place}"),
            Self::OrAnother => f.write_str("or-another"),
            Self::OrRefused(place) => write!(f, "or-refused {place}"),
            Self::OrSilence => f.write_str("or-silence"),
            Self::AcceptSilence => f.write_str("accept-silence"),
            Self::Optional => f.write_str("optional"),
        }
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Interval => "interval",
            Self::Mean => "mean",
            Self::Median => "median",
            Self::Latency => "latency",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The subject of a step, as holes name it.
    fn of(step: &str) -> Vec<String> {
        let step: Step = serde_yaml::from_str(step).unwrap();
        let constraints = step.constraints();
        assert!(step.judges() || !constraints.iter().any(Constraint::is_demand), "{step:?}");
        constraints.iter().map(Constraint::to_string).collect()
    }

    const STEPS: &[(&str, &[&str])] = &[
        ("send: '000#01 05'", &[]),
        ("nmt: start", &[]),
        ("wait: 5 ms", &[]),
        ("sync: { count: 1 }", &[]),
        ("produce: { frame: '080#', count: 1, every: 1 ms }", &[]),
        ("bench: { lamp: 1 }", &[]),
        ("write: { object: '1017:00', value: 5 }", &[]),
        (
            "write: { object: '1017:00', value: 5, refused: { code: 0x06010002, \
             lenient: [0x08000000] } }",
            &["refused", "abort code", "lenient 1"],
        ),
        (
            "write: { object: '1017:00', value: 5, refused: { code: 0x06010002, \
             lenient: [taken] } }",
            &["abort code", "taken"],
        ),
        ("write: { object: '1017:00', value: 5, or-refused: [any] }", &["or-refused 1"]),
        ("remap: { pdo: '1A00:00', objects: [], refused: 0x06040041 }", &["refused", "abort code"]),
        ("read: { object: '1017:00', save: before }", &[]),
        (
            "read: { object: '1017:00', value: 1, mask: 1, min: 1, max: 2, tolerated: [3] }",
            &["value", "min", "max", "tolerated 1"],
        ),
        (
            "read: { object: '1008:00', length: 4, characters: 4, transfer: segmented, \
             lenient: [0x08000024] }",
            &["length", "characters", "transfer", "lenient 1"],
        ),
        ("read: { object: '1017:00', refused: 0x06010001 }", &["refused", "abort code"]),
        (
            "until: { object: '1017:00', value: 1, tolerated: [2], within: 1 s }",
            &["value", "tolerated 1"],
        ),
        ("defaults: { in: 1000..1FFF }", &["value"]),
        (
            "reply: { frame: '700+n#.5', lenient: ['700+n#7F'], or-else: ['700+n#04'], \
             or-silence: true }",
            &["word 1", "lenient 1", "or-else 1", "or-silence"],
        ),
        (
            "ask: { send: '700+n#R', reply: '700+n#..', accept-silence: true, \
             latency: { strict: <= 1 ms, lenient: 1 ms .. 2 ms } }",
            &["accept-silence", "latency, lower bound", "latency, upper bound", "latency, lenient"],
        ),
        (
            "expect: { frame: '700+n#00', within: 1 s, after: 1 ms, length: 1 }",
            &["word 1", "after", "length"],
        ),
        ("expect: { frame: '700+n#00', within: 1 s, optional: true }", &["optional"]),
        ("never: { frame: '700+n#00', for: 1 s, lenient: ['700+n#05'] }", &["lenient 1"]),
        (
            "measure: { frame: '700+n#05', count: 2, interval: '>= 9 ms', mean: 9 ms +/- 5 %, \
             median: 8 ms .. 9 ms }",
            &[
                "word 1",
                "interval, lower bound",
                "mean, lower bound",
                "mean, upper bound",
                "median, lower bound",
                "median, upper bound",
            ],
        ),
        ("collect: { frame: '080#', count: 0, for: 1 s }", &["not more"]),
        ("collect: { frame: '080#01', count: 2, for: 1 s }", &["word 1", "not fewer", "not more"]),
        ("observe: { bench: lamp, min: 1, max: 2 }", &["min", "max"]),
        ("eds: { without: [bad-name], lenient: [odd] }", &["bad-name", "lenient 1"]),
        ("undeclared: { in: 1000..1FFF, most: 1 }", &["refused", "abort code"]),
        (
            "lss: { fastscan: { vendor: 1, product: 2, revision: 3, serial: 4 } }",
            &["vendor", "product", "revision", "serial"],
        ),
    ];

    #[test]
    fn each_step_names_what_it_demands() {
        for (step, named) in STEPS {
            assert_eq!(of(step), *named, "{step}");
        }
    }

    #[test]
    fn a_boot_up_that_ends_a_reset_is_not_judged() {
        let case = |steps: &str| -> Case {
            let yaml = format!("{{ id: a, title: A., checks: [A-1], steps: {steps} }}");
            serde_yaml::from_str(&yaml).unwrap()
        };
        let boot_up = "expect: { frame: '700+n#00', within: 1 s }";
        let read = "read: { object: '1017:00', value: 0 }";
        for (steps, expected) in [
            (format!("[nmt: reset-node, {boot_up}]"), &["step 2", "step 2, word 1"][..]),
            (
                format!("[{read}, {boot_up}]"),
                &["step 1", "step 1, value", "step 2", "step 2, word 1"],
            ),
            (format!("[{boot_up}, {read}]"), &["step 2", "step 2, value"]),
        ] {
            let case = case(&steps);
            let names = case.assertions().map(|(step, one)| assertion_name(step, one.as_ref()));
            assert_eq!(names.collect::<Vec<_>>(), expected, "{steps}");
        }
    }

    #[test]
    fn bytes_that_are_one_value_are_one_constraint() {
        for (frame, named) in [
            ("580+n#80 $mux 02 00 01 06", &["word 1", "multiplexer", "abort code"][..]),
            ("580+n#80 17 10 00 .. .. .. 06", &["word 1", "multiplexer", "word 8"]),
            ("580+n#4. 17 10 00 ...", &["word 1", "multiplexer"]),
            ("580+n#.. 17 10 00 ...", &["multiplexer"]),
            ("580+n#A4 $mux ...", &["word 1", "multiplexer"]),
            ("580+n#A2 01 7F", &["word 1", "word 2", "word 3"]),
            ("580+n#20 00", &["word 1", "word 2"]),
            ("080+n#30 81 .1 ...", &["error code", "word 3"]),
            ("080+n#.. 81", &["word 2"]),
            ("$pdo#80 $value", &["word 1", "word 2"]),
            ("700+n#R", &[]),
        ] {
            let text: FrameText = frame.parse().unwrap();
            let constraints = text.constraints();
            let words: Vec<String> = constraints.iter().map(Constraint::to_string).collect();
            assert_eq!(words, named, "{frame}");
            let covered = constraints.iter().filter_map(|one| text.words_of(one)).flatten().count();
            let fixed = text.pattern.words().into_iter().filter(|word| *word != Word::Open);
            assert_eq!(covered, fixed.count(), "{frame}");
        }
    }
}
