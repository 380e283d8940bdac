//! A finding as a case of a suite, and its requirement, as text.

use std::fmt::Write;
use std::time::Duration;

use campaign::{Action, Difference, Finding, Kind, Seen, Then, What};
use canopen::heartbeat::ErrorControl;
use canopen::sdo::Request;
use canopen::{Frame, Instant, Value, meaning};

/// How much of a frame a case judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Strictness {
    /// The next frame with the identifier is that of the model, byte by byte.
    Whole,
    /// Its first four bytes are: the service and the object.
    Service,
    /// The frame that the device sent is not sent, or one with the identifier is.
    Absence,
    /// The frame that the device sent is not sent until then: it is right soon afterwards.
    Early,
}

impl Strictness {
    /// The strictest first.
    pub(super) const ALL: [Self; 4] = [Self::Whole, Self::Service, Self::Absence, Self::Early];
}

/// What a case is called.
pub(super) struct Names<'n> {
    /// The name of case and suite, such as `sdo-toggle-unchecked`.
    pub(super) case: &'n str,
    /// The requirement of its own.
    pub(super) requirement: &'n str,
    /// The requirements of the documents that a mutant breaks which does the same.
    pub(super) known: &'n [String],
    /// The device.
    pub(super) device: &'n str,
    pub(super) node: u8,
}

/// The suite with the case of a finding; `None` when no step says what is wrong.
pub(super) fn suite(names: &Names<'_>, finding: &Finding, how: Strictness) -> Option<String> {
    let node = names.node;
    let mut steps = Vec::new();
    let begins = begins(finding);
    let answers = answers(finding);
    let awaited = answers.last().and_then(|last| last.first()).map(|frame| frame.id);
    let explored = matches!(finding.violation.what, What::Differs(_));
    if explored {
        finding.session.actions.iter().for_each(|action| told(action, node, &mut steps));
    }
    let others = finding.session.actions.iter().zip(answers).filter(|_| !explored);
    for (action, answers) in others {
        done(action, node, &mut steps);
        let boots = matches!(action.does, Kind::NmtReset | Kind::PowerCycle);
        for answer in &answers {
            steps.push(if boots { boots_up(node) } else { taken(answer, node) });
        }
        if answers.is_empty()
            && let Then::Wait(micros @ 1..) = action.then
        {
            steps.push(format!("wait: {micros} us"));
        }
    }
    // The last wait is that of the judgement.
    if steps.last().is_some_and(|step| step.starts_with("wait")) {
        steps.pop();
    }
    if explored {
        steps.push(format!("wait: {} us", since_the_last(finding).as_micros()));
    }
    let before = before(finding, begins).filter(|frame| Some(frame.id) != awaited);
    // A device may lack the service that sends them.
    let came =
        |it: Frame| format!("reply: {{ frame: \"{}#...\", or-silence: true }}", id(&it, node));
    steps.extend(before.map(came));
    if matches!(finding.violation.what, What::Ended(_)) {
        // What goes on starts anew, in whichever transfer it was.
        steps.extend(["nmt: reset-communication".to_owned(), boots_up(node)]);
    } else {
        steps.push(judged(finding, node, how)?);
    }
    let reset = ["nmt: reset-node".to_owned(), boots_up(node)];
    let setup: &[String] = if begins.is_some() { &reset } else { &[] };
    if begins.is_none() {
        steps.insert(0, reset[0].clone());
    }
    let Names { case, requirement, known, device, .. } = names;
    let checks: Vec<&str> =
        std::iter::once(*requirement).chain(known.iter().map(String::as_str)).collect();
    let mut text = format!(
        "suite: found/{case}\n\
         about: Found by harness fuzz on {device}.\n\
         device: {device}\n\
         cases:\n\
         \x20 - id: {case}\n\
         \x20   title: {}\n\
         \x20   checks: [{}]\n\
         \x20   tolerates: [emergency]\n",
        quoted(&sentence(finding)),
        checks.join(", "),
    );
    // Writing to a string cannot fail.
    if !setup.is_empty() {
        _ = writeln!(text, "    setup:");
        setup.iter().for_each(|step| _ = writeln!(text, "      - {step}"));
    }
    _ = writeln!(text, "    steps:");
    steps.iter().for_each(|step| _ = writeln!(text, "      - {step}"));
    Some(text)
}

/// How long before a difference was seen the tester did the last thing, but for reading.
fn since_the_last(finding: &Finding) -> Duration {
    let at = finding.violation.at;
    let reads = |frame: &Frame| {
        let request = Request::decode(&frame.data);
        matches!(request, Ok(Request::Upload(_) | Request::UploadSegment(_)))
    };
    let done = finding.seen.iter().filter_map(|seen| match seen {
        Seen::Frame(it) if it.own && !reads(&it.frame) => Some(it.at),
        Seen::Frame(it) if !it.own && it.frame.data[..] == [0] => Some(it.at),
        Seen::Power(at, _) | Seen::Stimulus(at, ..) => Some(*at),
        _ => None,
    });
    done.take_while(|done| *done <= at).last().map_or(Duration::ZERO, |last| at.since(last))
}

/// When the last frame of the tester before something was wrong was sent; `None` when the device is
/// wrong before it is sent one.
fn begins(finding: &Finding) -> Option<Instant> {
    let mut own = finding.seen.iter().rev().filter_map(|seen| match seen {
        Seen::Frame(stamped) if stamped.own && stamped.at <= finding.violation.at => {
            Some(stamped.at)
        }
        _ => None,
    });
    own.next()
}

/// The frames of the device with the identifier that is judged, after the last one of the tester
/// and before the one that is wrong.
fn before(finding: &Finding, begins: Option<Instant>) -> impl Iterator<Item = Frame> {
    let violation = &finding.violation;
    let judged = match &violation.what {
        What::Unexpected(frame, _) | What::Missing(frame, _) | What::Inhibited(frame, _) => {
            Some(frame.id)
        }
        What::Ended(_) | What::Differs(_) => None,
    };
    let from = begins.unwrap_or(Instant::ZERO);
    finding
        .seen
        .iter()
        .filter_map(move |seen| match seen {
            Seen::Frame(it) if !it.own && (from..violation.at).contains(&it.at) => Some(it.frame),
            _ => None,
        })
        .filter(move |frame| Some(frame.id) == judged)
}

/// The register with the requirement of a case.
pub(super) fn register(names: &Names<'_>, finding: &Finding) -> String {
    format!(
        "document: found-{}\n\
         title: Found by harness fuzz\n\
         requirements:\n\
         \x20 - id: {}\n\
         \x20   clause: found\n\
         \x20   level: must\n\
         \x20   says: {}\n",
        names.case,
        names.requirement,
        quoted(&sentence(finding)),
    )
}

/// An entry for the mutants of the tree that shows what the device does; `None` where nothing but
/// its time is wrong.
pub(super) fn mutant(names: &Names<'_>, finding: &Finding) -> Option<String> {
    let node = names.node;
    let change = match &finding.violation.what {
        What::Unexpected(frame, Some(other)) => {
            let edit = pattern(frame, node, 8);
            format!("{{ when: \"{}\", edit: \"{edit}\" }}", pattern(other, node, 8))
        }
        What::Missing(frame, _) => {
            format!("{{ when: \"{}\", drop: true }}", pattern(frame, node, 8))
        }
        What::Unexpected(_, None) | What::Inhibited(..) | What::Ended(_) | What::Differs(_) => {
            return None;
        }
    };
    Some(format!(
        "- {}:\n    {}\n  breaks: [{}]\n  frame: {change}\n",
        names.case,
        quoted(&sentence(finding)),
        names.requirement,
    ))
}

/// What a conformant device does, in a sentence.
fn sentence(finding: &Finding) -> String {
    let Finding { session, violation, .. } = finding;
    let last = session.actions.last();
    let last = last.map_or_else(|| "a reset".to_owned(), |action| action.does.word());
    let words = |frame: &Frame| meaning(frame).to_string().trim_end_matches('.').to_owned();
    match &violation.what {
        What::Unexpected(_, Some(other)) => {
            format!("After {last}, the device sends {}.", words(other))
        }
        What::Unexpected(frame, None) => {
            format!("After {last}, the device does not send {}.", words(frame))
        }
        What::Missing(frame, _) => format!("After {last}, the device sends {}.", words(frame)),
        What::Inhibited(frame, _) => {
            format!("The device keeps the inhibit time of {}.", words(frame))
        }
        What::Ended(_) => format!("After {last}, the program goes on."),
        What::Differs(difference) => {
            let Difference { name, expected, .. } = &**difference;
            format!("After {last}, {name} is {expected}.")
        }
    }
}

/// The frames with the awaited identifier that the device sent after each action, until something
/// was wrong.
fn answers(finding: &Finding) -> Vec<Vec<Frame>> {
    let actions = &finding.session.actions;
    let mut all = vec![Vec::new(); actions.len()];
    let (mut place, mut left): (Option<usize>, usize) = (None, 0);
    for seen in &finding.seen {
        let Seen::Frame(stamped) = seen else { continue };
        if stamped.own {
            if left == 0 {
                let from = place.map_or(0, |place| place + 1);
                let next = actions[from..].iter().position(|action| !action.frames.is_empty());
                place = next.map(|next| from + next);
                left = place.map_or(0, |place| actions[place].frames.len());
            }
            left = left.saturating_sub(1);
        } else if let Some(place) = place
            && stamped.at < finding.violation.at
            && let Then::Answers { id, .. } = actions[place].then
            && stamped.frame.data_id() == Some(id)
        {
            all[place].push(stamped.frame);
        }
    }
    all
}

/// The steps that do what an action does.
fn done(action: &Action, node: u8, steps: &mut Vec<String>) {
    if action.does == Kind::PowerCycle {
        let switched = ["bench: { power: \"off\" }", "wait: 300 ms", "bench: { power: \"on\" }"];
        steps.extend(switched.map(str::to_owned));
    }
    steps.extend(action.frames.iter().map(|it| format!("send: \"{}\"", pattern(it, node, 8))));
    steps.extend(action.bench.iter().map(|stimulus| {
        let value = match stimulus.level() {
            Value::Text(text) => quoted(&text),
            _ => stimulus.value.to_string(),
        };
        format!("bench: {{ {}: {value} }}", stimulus.name)
    }));
}

/// The same of an exploration, with what follows: an answer, whatever it is, or time.
fn told(action: &Action, node: u8, steps: &mut Vec<String>) {
    done(action, node, steps);
    match action.then {
        _ if matches!(action.does, Kind::NmtReset | Kind::PowerCycle) => steps.push(boots_up(node)),
        // A look takes its time.
        _ if matches!(action.does, Kind::Look | Kind::LookAtAll) => {
            steps.push("wait: 100 ms".to_owned());
        }
        Then::Answers { .. } => {
            steps.push("reply: { frame: \"580+n#...\", or-silence: true }".to_owned());
        }
        Then::Wait(0) => {}
        Then::Wait(micros) => steps.push(format!("wait: {micros} us")),
    }
}

/// The boot-up message, which a device takes its time for, as in cases of the suites.
fn boots_up(node: u8) -> String {
    let boot_up = ErrorControl::BOOT_UP.frame(node);
    format!("expect: {{ frame: \"{}#...\", within: {BOOT_UP_MS} ms }}", id(&boot_up, node))
}

/// An answer that only leads to what is judged: the same service, and no other bytes. After a
/// refusal, or where the device takes another way, nothing is judged.
fn taken(answer: &Frame, node: u8) -> String {
    let id = id(answer, node);
    match answer.data.first() {
        Some(&command) if answer.data.len() == 8 => {
            let others = SERVER.into_iter().filter(|digit| *digit != command >> 4);
            let others: Vec<String> =
                others.map(|digit| format!("\"{id}#{digit:X}. ...\"")).collect();
            format!(
                "reply: {{ frame: \"{id}#{:X}. ...\", or-else: [{}], or-silence: true }}",
                command >> 4,
                others.join(", "),
            )
        }
        _ => format!("reply: {{ frame: \"{id}#...\", or-silence: true }}"),
    }
}

/// The first digits of what a server answers to an initiation, or to a block.
const SERVER: [u8; 5] = [0x4, 0x6, 0x8, 0xA, 0xC];

/// The step that fails on the device.
fn judged(finding: &Finding, node: u8, how: Strictness) -> Option<String> {
    let violation = &finding.violation;
    let never_for = |frame: String, time: Duration| {
        format!("never: {{ frame: \"{frame}\", for: {} us }}", time.as_micros())
    };
    let since = |after: Instant| violation.at.since(after);
    let never = |frame: String, after| never_for(frame, since(after) + MARGIN);
    let last = begins(finding).unwrap_or(Instant::ZERO);
    let bytes = if how == Strictness::Service { 4 } else { 8 };
    let came_early = matches!(violation.what, What::Unexpected(_, None));
    if how == Strictness::Early && !came_early {
        return None;
    }
    match &violation.what {
        What::Unexpected(frame, Some(_)) if how == Strictness::Absence => {
            Some(never(pattern(frame, node, 8), last))
        }
        What::Unexpected(_, Some(other)) => {
            Some(format!("reply: {{ frame: \"{}\" }}", pattern(other, node, bytes)))
        }
        What::Unexpected(frame, None) => {
            let any = format!("{}#...", id(frame, node));
            match how {
                Strictness::Whole => Some(never(any, last)),
                Strictness::Service => Some(never(pattern(frame, node, bytes), last)),
                // It may be right a little later.
                Strictness::Absence => {
                    Some(never_for(pattern(frame, node, bytes), since(last) + EARLY))
                }
                Strictness::Early => {
                    let came = came(finding, frame)?.since(last);
                    Some(never_for(pattern(frame, node, bytes), came + MOMENT))
                }
            }
        }
        What::Missing(frame, due) => {
            let within = (due.since(last) + MARGIN).as_millis();
            let is_boot_up = *frame == ErrorControl::BOOT_UP.frame(node);
            let within = if is_boot_up { BOOT_UP_MS } else { within };
            let frame = match how {
                Strictness::Absence => format!("{}#...", id(frame, node)),
                _ => pattern(frame, node, bytes),
            };
            Some(format!("expect: {{ frame: \"{frame}\", within: {within} ms }}"))
        }
        What::Differs(difference) => judged_by_name(difference, how),
        What::Inhibited(..) | What::Ended(_) => None,
    }
}

/// When a frame of the device came the last time.
fn came(finding: &Finding, frame: &Frame) -> Option<Instant> {
    finding.seen.iter().rev().find_map(|seen| match seen {
        Seen::Frame(stamped) if !stamped.own && stamped.frame == *frame => Some(stamped.at),
        _ => None,
    })
}

/// The step that reads an object, or looks at the bench.
fn judged_by_name(difference: &Difference, how: Strictness) -> Option<String> {
    let value = match difference.value.as_ref()? {
        number if how == Strictness::Service => halfway(number, difference.shown.as_ref()?)?,
        Value::Text(text) => format!("value: {}", quoted(text)),
        Value::Int(number) => format!("value: {number}"),
        Value::Bool(is_set) => format!("value: {is_set}"),
        Value::Real(number) => format!("value: {number}"),
        Value::Bytes(_) => return None,
    };
    match (&difference.object, &difference.bench) {
        (Some(mux), _) => Some(format!("read: {{ object: \"{mux}\", {value} }}")),
        (_, Some(name)) => Some(format!("observe: {{ bench: {name}, {value} }}")),
        _ => None,
    }
}

/// Every number on the side of the right one, where freedoms make small differences.
fn halfway(right: &Value, wrong: &Value) -> Option<String> {
    let (right, wrong) = (right.as_real()?, wrong.as_real()?);
    let half = ((right + wrong) / 2.0).round();
    let apart = (right - wrong).abs() > 2.0;
    apart.then(|| format!("{}: {half}", if right > wrong { "min" } else { "max" }))
}

/// How long a device may take to boot.
const BOOT_UP_MS: u128 = 5_000;
/// How much longer than in the session a case waits.
const MARGIN: Duration = Duration::from_millis(50);
/// The same where a frame came too early.
const EARLY: Duration = Duration::from_millis(1);
/// The same where another frame like it is due at once.
const MOMENT: Duration = Duration::from_micros(100);

/// A frame as a pattern: its identifier, and the first bytes.
fn pattern(frame: &Frame, node: u8, bytes: usize) -> String {
    let id = id(frame, node);
    if frame.remote {
        let text = frame.to_string();
        let asked = text.split_once('#').map_or("R", |(_, asked)| asked);
        return format!("{id}#{asked}");
    }
    let mut words: Vec<String> =
        frame.data.iter().take(bytes).map(|byte| format!("{byte:02X}")).collect();
    if frame.data.len() > bytes {
        words.push("...".to_owned());
    }
    format!("{id}#{}", words.join(" "))
}

/// An identifier; one that has the node id has it from the device.
fn id(frame: &Frame, node: u8) -> String {
    match frame.id.as_standard() {
        Some(id) if (0x81..0x7E4).contains(&id) && id & 0x7F == u16::from(node) => {
            format!("{:03X}+n", id - u16::from(node))
        }
        _ => frame.id.to_string(),
    }
}

/// A text for YAML.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
